"""Measures learners here, in Node.js and in Chromium, and how large they are on microcontrollers.

Every learner makes the same runs, without noise, in turns; the script refuses runs that differ in
their number of steps. It needs lld, Node.js, Chromium and binutils (`size`).
"""

import json
import math
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numba
import numpy as np
from speed import machine, make_parser, put

from upright.agents import AGENTS
from upright.builds.chip_package import CPUS, PRECISIONS, build_chip
from upright.builds.web_package import build_web
from upright.core.portable_math import (
    error_function_complement,
    exponential,
    hyperbolic_tangent,
    whole_power,
)
from upright.studies.case import Case, make_case
from upright.studies.run import make_run

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tools"))
from browser import found_in_browser  # noqa: E402 - the path of the tools comes first

IN_NODE = """
import { times } from "%s/one_source.js";
const place = new URL("file://%s/package/");
const upright = await import(new URL("upright.js", place));
console.log(JSON.stringify(await times(upright, "%s", place, %s)));
"""
SMALL = {"episodes": 4, "kept_steps": 500}
"""Settings of reinforce with which its memory fits into 128 kB."""
FUNCTIONS: list[tuple[str, Any, Any]] = [
    ("e^x", lambda x: exponential(x), lambda x: math.exp(x)),
    ("x^20", lambda x: whole_power(x, 20.0), lambda x: x**20.0),
    ("tanh x", lambda x: hyperbolic_tangent(x), lambda x: math.tanh(x)),
    ("erfc x", lambda x: error_function_complement(x), lambda x: math.erfc(x)),
]
"""Names, the package's own functions, and those of the C library."""
Times = list[tuple[int, float]]


def here(case: Case, seeds: list[int]) -> Times:
    """Return steps and seconds of a run for each seed, on this machine's own processor."""
    make_run(case, seeds[0], 0)
    results = [make_run(case, seed, 0)[1] for seed in seeds]
    return [(int(result.lengths.sum()), result.seconds) for result in results if result]


def in_node(folder: Path, name: str, seeds: list[int]) -> Times:
    """Return the same in Node.js, after a run that is not timed."""
    program = IN_NODE % (HERE, folder, name, [seeds[0], *seeds])
    command = ["node", "--input-type=module", "-e", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [(steps, seconds) for steps, seconds in json.loads(done.stdout)[1:]]


def in_chromium(folder: Path, name: str, seeds: list[int]) -> Times:
    """Return the same in Chromium."""
    for file in ("one_source.js", "one_source.html"):
        shutil.copy(HERE / file, folder)
    asked = {"name": name, "seeds": json.dumps([seeds[0], *seeds])}
    found = found_in_browser(folder, "one_source.html", **asked)
    return [(steps, seconds) for steps, seconds in found[1:]]


def speeds(steps: int, seeds: list[int]) -> str:
    """Return the table of speeds and sizes of modules."""
    lines = [
        "| agent | steps/s here | Node.js | Chromium | module | its memory |",
        "|---|---|---|---|---|---|",
    ]
    for name in AGENTS.built_in:
        case = make_case(name, steps=steps)
        with TemporaryDirectory() as text:
            folder = Path(text)
            (module,) = build_web([case], folder / "package")
            memory = json.loads(module.with_suffix(".json").read_text())["size"]
            size = module.stat().st_size
            found = [
                here(case, seeds),
                in_node(folder, name, seeds),
                in_chromium(folder, name, seeds),
            ]
        counts = [[count for count, _ in times] for times in found]
        if counts[1:] != counts[:-1]:
            raise SystemExit(f"{name} made other steps elsewhere: {counts}")
        own, *others = (median(count / seconds for count, seconds in times) for times in found)
        ratios = " | ".join(f"{other / own:.2f}" for other in others)
        lines.append(
            f"| `{name}` | {own / 1e6:.1f} million | {ratios} | {size / 1e3:.1f} kB "
            f"| {memory / 1e3:.0f} kB |"
        )
    return "\n".join(lines)


def sizes() -> str:
    """Return the table of code and memory on microcontrollers."""
    kinds = [(cpu, each) for cpu in CPUS for each in PRECISIONS if each in CPUS[cpu].precisions]
    heads = [f"{cpu}, {precision}" for cpu, precision in kinds]
    lines = [f"| agent | {' | '.join(heads)} |", f"|---|{'---|' * len(heads)}"]
    cases = [(f"`{name}`", make_case(name)) for name in AGENTS.built_in]
    cases.insert(2, ("`reinforce`, small", make_case("reinforce", settings=SMALL)))
    for label, case in cases:
        cells = []
        for cpu, precision in kinds:
            with TemporaryDirectory() as folder:
                code = build_chip(case, cpu, folder, precision)
                done = subprocess.run(["size", code], capture_output=True, text=True, check=True)
                words = (Path(folder) / "learner.h").read_text().partition("words[")[2]
            text, data, _ = map(int, done.stdout.splitlines()[1].split()[:3])
            memory = 8 * int(words.partition("]")[0])
            cells.append(f"{(text + data) / 1e3:.1f} + {memory / 1e3:.1f}")
        lines.append(f"| {label} | {' | '.join(cells)} |")
    return "\n".join(lines)


def timed(function: Any, inputs: np.ndarray) -> Callable[[], float]:
    """Return a function that returns the nanoseconds of a call of a function of one number."""
    inner = numba.njit(function)

    @numba.njit
    def total(values: np.ndarray) -> float:
        found = 0.0
        for value in values:
            found += inner(value)
        return found

    def nanoseconds() -> float:
        began = time.perf_counter()
        total(inputs)
        return (time.perf_counter() - began) / len(inputs) * 1e9

    nanoseconds()
    return nanoseconds


def functions() -> str:
    """Return the table of the package's own functions beside those of the C library."""
    lines = ["| function | ns a call | C library = 1 |", "|---|---|---|"]
    for name, own, library in FUNCTIONS:
        inputs = np.random.default_rng(0).uniform(-6, 6, 1_000_000)
        times = timed(own, inputs), timed(library, inputs)
        pairs = [(times[0](), times[1]()) for _ in range(9)]
        mine, ratio = median(a for a, _ in pairs), median(a / b for a, b in pairs)
        lines.append(f"| {name} | {mine:.1f} | {ratio:.2f} |")
    return "\n".join(lines)


def main() -> None:
    """Measure, and print the tables or write them into a page."""
    parser = make_parser(__doc__, "docs/one-source.md")
    parser.add_argument("--steps", type=int, default=600_000, help="N, of the runs that are timed")
    parser.add_argument("--seeds", type=int, default=7, help="how many runs are timed")
    options = parser.parse_args()
    seeds = [*range(options.seeds)]
    put(
        f"{speeds(options.steps, seeds)}\n\n"
        f"The runs are those of `upright learn AGENT --steps {options.steps} --seed SEED`, "
        f"{options.seeds} of each; the medians are compared, and compiling is not timed. "
        "Node.js and Chromium stand as parts of the speed here.\n\n"
        "Code and memory in kB:\n\n"
        f"{sizes()}\n\nOwn functions, for numbers from -6 to 6:\n\n{functions()}\n\n"
        f"`reinforce`, small, is with "
        f"{' '.join(f'--set {name}={value}' for name, value in SMALL.items())}.\n\n{machine()}\n",
        options.output,
    )


if __name__ == "__main__":
    main()
