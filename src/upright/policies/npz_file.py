"""Policies as NumPy archives: a header, and the arrays of the agent's memory.

`header` is JSON text that anyone can read. Files may come from anyone, so reading one executes
nothing and allocates no more than the settings in its header imply, which are bounded.
"""

import io
import json
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np

from upright.agents import AGENTS, is_custom
from upright.errors import UprightError
from upright.policies.checks import (
    check_agent,
    check_contract,
    check_header,
    explained,
    read_task,
)
from upright.policies.policy import Policy
from upright.support.settings import values_of

FORMAT = "upright policy 1"
HEADER = {"agent": str, "task": dict, "settings": dict}
"""What reading needs of a header besides its format, and the types; the rest is for people."""
HEADER_LIMIT = 2**20
"""Maximum length of a header, in characters."""
PACKINGS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Accepted compression methods, which unpack no more than is asked for."""


def encode(policy: Policy) -> bytes:
    """Return a policy as a NumPy archive of plain arrays, with a header in JSON.

    Raises
    ------
    UprightError
        If the settings of the policy's agent are unknown.
    """
    if policy.settings is None:
        raise UprightError(
            f"policy is one of {policy.agent!r} without its settings; it can be exported as JSON"
        )
    header = {"format": FORMAT, **policy.contract(), "settings": values_of(policy.settings)}
    written = io.BytesIO()
    np.savez_compressed(
        written,
        allow_pickle=False,
        header=np.array(json.dumps(header)),
        **dict(arrays_of(policy.memory)),
    )
    return written.getvalue()


def begins(start: bytes) -> bool:
    """Whether a file that starts with these bytes is an archive."""
    return start[:2] == b"PK"


def read(path: Path | str, agent: str | None) -> Policy:
    """Read a policy, as `files.load_policy` does."""
    with _opened(path) as archive:
        header = _read_header(archive)
        check_agent(header["agent"], agent)
        settings = AGENTS.restore(header["agent"], header["settings"])
        memory = settings.agent(np.random.default_rng(0))
        renamed = getattr(settings, "RENAMED_ARRAYS", {})
        _fill(memory, archive, finite=not is_custom(header["agent"]), renamed=renamed)
        trained = read_task(header["task"])
        policy = Policy(header["agent"], memory, **trained, settings=settings)
        check_contract(policy, header, {"version"})
    return policy


def read_header(path: Path | str) -> dict[str, Any]:
    """Return the header of an archive."""
    with _opened(path) as archive:
        return _read_header(archive)


@contextmanager
def _opened(path: Path | str) -> Iterator[zipfile.ZipFile]:
    """Open a policy's file."""
    if not zipfile.is_zipfile(path):
        raise UprightError(f"policy is {str(path)!r}; it is damaged, or not a policy's file")
    with explained(path), zipfile.ZipFile(path) as archive:
        yield archive


def _read_header(archive: zipfile.ZipFile) -> dict[str, Any]:
    """Return the header of an archive, checked."""
    if any(info.compress_type not in PACKINGS for info in archive.infolist()):
        raise ValueError("it is compressed in an unknown way")
    with archive.open("header.npy") as member:
        shape, _, dtype = _declared(member)
        if shape != () or dtype.kind != "U" or dtype.itemsize > 4 * HEADER_LIMIT:
            raise ValueError(f"its header is not a text of at most {HEADER_LIMIT:,} characters")
        header = json.loads(str(np.ndarray((), dtype, _read(member, dtype.itemsize))))
    return check_header(header, FORMAT, HEADER)


def _fill(
    memory: Any, archive: zipfile.ZipFile, *, finite: bool, renamed: Mapping[str, str]
) -> None:
    """Fill all arrays of a memory after checking that the archive declares the same ones.

    `renamed` maps the names of arrays in older files to their present names.
    """
    arrays = arrays_of(memory)
    present = {f"{old}.npy": f"{new}.npy" for old, new in renamed.items()}
    members = {present.get(name, name): name for name in archive.namelist()}
    found = [present.get(name, name) for name in archive.namelist()]
    due = ["header.npy", *(f"{name}.npy" for name, _ in arrays)]
    if sorted(found) != sorted(due):
        odd = sorted(set(found) ^ set(due)) or "one that occurs twice"
        raise ValueError(f"it does not hold the arrays of its agent; it differs in {odd}")
    for name, array in arrays:
        with archive.open(members[f"{name}.npy"]) as member:
            shape, by_columns, dtype = _declared(member)
            if (shape, dtype) != (array.shape, array.dtype) or dtype.hasobject:
                raise ValueError(
                    f"{name} is {dtype} of shape {shape}; "
                    f"it must be {array.dtype} of shape {array.shape}, and never objects"
                )
            data = _read(member, array.nbytes)
        array[...] = np.ndarray(shape, dtype, data, order="F" if by_columns else "C")
        if finite and not np.isfinite(array).all():
            raise ValueError(f"{name} holds a number that is not finite")


def _declared(member: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return what a NumPy file declares: shape, whether in column order, and type."""
    if np.lib.format.read_magic(member) != (1, 0):
        raise ValueError("it is in an unknown version of NumPy's format")
    return np.lib.format.read_array_header_1_0(member)


def _read(member: IO[bytes], size: int) -> bytes:
    """Return the rest of a file, which must have this size [bytes]; no more is unpacked."""
    data = member.read(size + 1)
    if len(data) != size:
        raise ValueError(f"{member.name} is shorter or longer than it declares")
    return data


def arrays_of(memory: Any, prefix: str = "") -> list[tuple[str, np.ndarray]]:
    """Return the names and arrays of a memory, including those of tuples within it."""
    found = []
    for name, value in memory._asdict().items():
        if isinstance(value, np.ndarray):
            found.append((prefix + name, value))
        elif hasattr(value, "_asdict"):
            found += arrays_of(value, f"{prefix}{name}.")
    return found
