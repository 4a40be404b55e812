"""Measures how fast the MATLAB twin is in GNU Octave, beside its compiled C and the package.

All of them make runs of Q-learning, noise-free, with the same random numbers, and therefore the
same trials, which is checked. The M code makes its runs in lockstep; its rate is also measured
while at least nine tenths of the runs advance together, because the last runs of a study advance
nearly alone.
"""

import subprocess
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from speed import machine, make_parser, put

from upright.studies.case import make_case
from upright.studies.matlab_twin import command, find_program
from upright.studies.random_streams import twister_numbers
from upright.studies.run import make_run

BENCHMARKS = Path(__file__).parent


class Line(NamedTuple):
    """The measurements of one contender."""

    name: str
    steps: float
    """Number of learner-steps."""
    seconds: float
    together: float | None = None
    """Learner-steps per second while most runs advance together."""


def octave(statements: str) -> list[float]:
    """Return the numbers in the last line that Octave prints."""
    statements = f"addpath('{BENCHMARKS}'); {statements}"
    done = subprocess.run(command(find_program(), statements), capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(done.stderr or done.stdout)
    return list(map(float, done.stdout.splitlines()[-1].split()))


def readable(trials: int) -> Line:
    """Time the learner that is written to be read, which makes one run step by step."""
    steps, seconds = octave(
        f"began = tic(); r = upright.q_learning('trials', {trials}, 'steps', 5000);"
        "printf('%g ', sum(r.lengths), toc(began));"
    )
    return Line("M code, one run, for reading (`upright.q_learning`)", steps, seconds)


def in_lockstep(agent: str, runs: int, steps: int) -> Line:
    """Time the M code that makes many runs at once."""
    make = {"q-learning": "q_learners", "random-search": "random_searchers"}[agent]
    together, rate, seconds = octave(
        f"lockstep(@upright.internal.{make}, '{agent}', {runs}, {steps})"
    )
    return Line(f"M code, {agent}, {runs:,} runs in lockstep", rate * seconds, seconds, together)


def in_compiled_c(runs: int, steps: int, expected: list[int]) -> Line:
    """Time the compiled C, which is built for this measurement."""
    with tempfile.TemporaryDirectory() as place:
        seconds, *lengths = octave(
            f"evalc('upright.build_mex(''{place}'')'); addpath('{place}');"
            "p = upright.parameters(); n = upright.noise_case('none');"
            "s = upright.settings('q-learning'); all = []; began = tic();"
            f"for k = 1:{runs}, all = [all, q_learning_mex(p, n, 0.05 * [1 1 1 1], s, k, {steps},"
            "1000)]; end; printf('%g ', toc(began), all);"
        )
    if lengths != expected:
        raise SystemExit("the trials of the compiled C differ from those of the package")
    return Line(f"compiled C, {runs:,} runs, called from Octave", sum(lengths), seconds)


def in_python(runs: int, steps: int) -> tuple[Line, list[int]]:
    """Time the package, and return the lengths of all trials."""
    case = make_case("q-learning", steps=steps)
    make_run(case, 0, 0)  # compiles
    began = time.perf_counter()
    results = [make_run(case, 0, run, numbers=twister_numbers)[1] for run in range(runs)]
    seconds = time.perf_counter() - began
    lengths = np.concatenate([result.lengths for result in results if result])
    line = Line(f"Python with Numba, {runs:,} runs, one core", lengths.sum(), seconds)
    return line, lengths.tolist()


def version() -> str:
    """Return the name and version of the program that runs the twin."""
    line = [find_program(), "--version"]
    return subprocess.run(line, capture_output=True, text=True).stdout.splitlines()[0]


def table(lines: list[Line]) -> str:
    """Return the measurements as a table in Markdown."""
    rows = ["| | million steps per second | while together | duration [s] |", "|---|---|---|---|"]
    for line in lines:
        together = f"{line.together / 1e6:.2f}" if line.together else "–"
        rate = line.steps / line.seconds / 1e6
        rows.append(f"| {line.name} | {rate:.3g} | {together} | {line.seconds:.3g} |")
    return "\n".join(rows) + "\n"


def main() -> None:
    """Measure, and write the table."""
    parser = make_parser(__doc__, "docs/matlab.md")
    parser.add_argument("--steps", type=int, default=60_000, help="N (default 60,000)")
    parser.add_argument("--runs", type=int, default=100, help="of the smaller study (default 100)")
    arguments = parser.parse_args()
    runs, steps = arguments.runs, arguments.steps
    ours, expected = in_python(runs, steps)
    lines = [
        readable(10),
        in_lockstep("q-learning", runs, steps),
        in_lockstep("q-learning", 10 * runs, steps),
        in_lockstep("random-search", 10 * runs, steps),
        in_compiled_c(runs, steps, expected),
        ours,
    ]
    text = (
        f"{table(lines)}\nAll runs are noise-free with default settings and N = {steps:,}, and "
        "include learning. The agent is Q-learning unless the row names another. “While together” "
        "is the rate while at least nine tenths of the runs advance.\n"
        f"{machine()}, {version()}.\n"
    )
    put(text, arguments.output)


if __name__ == "__main__":
    main()
