"""What a run was made with, which a store records: versions, and the processor."""

import json
import platform
import re
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from upright import __version__
from upright.support.machine_code import sources_hash
from upright.support.terminal import visible

PARTS = {
    "upright": "Version of Upright.",
    "sources": "Digest of the source files of Upright.",
    "python": "Version of Python.",
    "numpy": "Version of NumPy.",
    "numba": "Version of Numba.",
    "llvmlite": "Version of llvmlite, which makes the machine code.",
    "host": "Name of the machine.",
    "platform": "Operating system and architecture.",
    "libc": "C library.",
    "processor": "Name of the processor.",
    "features": "What the processor can do, as LLVM names it.",
}
"""The parts of an environment, and what each is. All are text, empty where it is not known."""


@cache
def present_environment() -> str:
    """Return the environment of this process as JSON, as stores record it."""
    libraries = {name: _version(name) for name in ("numpy", "numba", "llvmlite")}
    parts = {
        "upright": __version__,
        "sources": sources_hash(),
        "python": platform.python_version(),
        **libraries,
        "host": platform.node(),
        "platform": platform.platform(),
        "libc": " ".join(platform.libc_ver()).strip(),
        **_processor(),
    }
    return json.dumps(parts)


def read_environment(description: str) -> dict[str, str]:
    """Return the parts of an environment from its JSON; those that are not known are empty."""
    try:
        parts = json.loads(description)
    except (ValueError, RecursionError):
        parts = {}
    known = parts if isinstance(parts, dict) else {}
    return {name: visible(str(known.get(name, ""))) for name in PARTS}


def in_words(description: str) -> str:
    """Return an environment on a line, from its JSON."""
    parts = read_environment(description)
    if not any(parts.values()):
        return "environment not recorded"
    versions = (f"{name} {parts[name]}" for name in ("upright", "python", "numpy", "numba"))
    return ", ".join([parts["host"], parts["processor"], parts["platform"], *versions])


def differences(recorded: str, present: str) -> list[str]:
    """Return what differs between two environments, given as JSON: a text for each part."""
    recorded_parts, present_parts = map(read_environment, (recorded, present))
    found = []
    for name in PARTS:
        ours, theirs = recorded_parts[name], present_parts[name]
        if ours == theirs:
            continue
        if name == "features":
            gone, new = (
                {*a.split(",")} - {*b.split(",")} for a, b in ((ours, theirs), (theirs, ours))
            )
            ours, theirs = (",".join(sorted(each)) or "no others" for each in (gone, new))
        found.append(f"{name}: {ours or '-'}, here {theirs or '-'}")
    return found


def _version(library: str) -> str:
    try:
        return version(library)
    except PackageNotFoundError:
        return ""


def _processor() -> dict[str, str]:
    from llvmlite import binding  # imported late: reading a store needs no compiler

    features = binding.get_host_cpu_features()
    names = sorted(name for name, has in features.items() if has)
    return {"processor": _name() or binding.get_host_cpu_name(), "features": ",".join(names)}


def _name() -> str:
    """Return the name of the processor that its maker gave it; empty if it cannot be told."""
    try:
        text = Path("/proc/cpuinfo").read_text(errors="replace")
    except OSError:
        return platform.processor()
    found = re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE)
    return found[1].strip() if found else platform.processor()
