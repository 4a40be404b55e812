"""Measure how much of the package the quick tests execute, and print it package by package.

    python tools/measure_coverage.py

Coverage cannot see into machine code, so the tests run twice, at the same time: all quick ones as
usual, and some with Numba's compiler switched off, so that the kernels run as plain Python. There,
a test that takes longer than LIMIT is skipped; what it executed until then counts. The report never
fails: it shows what no test reaches, not whether results are right. Code that runs only in other
processes, such as the workers of tuning or Gazebo's server, is not counted.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
LIMIT = 0.2
"""How long a test may take while nothing is compiled [s]."""
PASS_LIMIT = 240.0
"""How long a pass may take; one that takes longer is left out of the report [s]."""
KERNEL_TESTS = (
    "tests/core",
    "tests/agents",
    "tests/environments/test_environments.py",
    "tests/policies/test_json_file.py",
)
PLAIN = {"NUMBA_DISABLE_JIT": "1", "PYTEST_PLUGINS": "tools.measure_coverage"}
"""Environment of the pass in plain Python."""
COUNTS = ("num_statements", "covered_lines", "num_branches", "covered_branches")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Iterator[None]:
    """Skip the rest of a test that takes longer than LIMIT."""

    def skip(_signal: int, _frame: FrameType | None) -> None:
        pytest.skip("takes too long in plain Python")

    previous = signal.signal(signal.SIGALRM, skip)
    signal.setitimer(signal.ITIMER_REAL, LIMIT)
    try:
        return (yield)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous)


def run_tests(*arguments: str, **environment: str) -> str:
    """Run the quick tests under coverage and return pytest's last line."""
    command = (sys.executable, "-m", "coverage", "run", "--parallel-mode", "-m", "pytest")
    options = ("-m", "not slow", "--tb=no", "-r", "", "-p", "no:cacheprovider")
    try:
        done = subprocess.run(
            [*command, *options, *arguments],
            cwd=ROOT,
            env=os.environ | environment,
            stdout=subprocess.PIPE,
            text=True,
            timeout=PASS_LIMIT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"not finished within {PASS_LIMIT:.0f} s, and not counted"
    if done.returncode < 0:
        return f"ended by signal {-done.returncode}, and not counted"
    return done.stdout.strip().rpartition("\n")[2].strip("= ")


def measured(folder: Path) -> dict[str, dict[str, Any]]:
    """Combine the data in a folder and return coverage's summary of every file."""
    coverage = (sys.executable, "-m", "coverage")
    report = folder / "coverage.json"
    subprocess.run([*coverage, "combine", "--quiet"], cwd=ROOT, check=True)
    subprocess.run([*coverage, "json", "--quiet", "-o", report], cwd=ROOT, check=True)
    files = json.loads(report.read_text())["files"]
    return {name: values["summary"] for name, values in files.items()}


def by_package(files: dict[str, dict[str, Any]]) -> dict[str, list[int]]:
    """Return COUNTS for each package below `upright`, and their total."""
    counts: dict[str, list[int]] = defaultdict(lambda: [0] * len(COUNTS))
    for name, summary in sorted(files.items()):
        parts = Path(name).parts
        inside = parts[parts.index("upright") + 1 :]
        for package in (inside[0] if len(inside) > 1 else "upright", "TOTAL"):
            counts[package] = [a + summary[b] for a, b in zip(counts[package], COUNTS, strict=True)]
    counts["TOTAL"] = counts.pop("TOTAL")
    return counts


def percent(part: int, whole: int) -> str:
    """Return a share in per cent, as text."""
    return f"{100 * part / whole:.1f} %" if whole else ""


def main() -> None:
    """Measure and report."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["COVERAGE_FILE"] = str(Path(folder) / "data")
        with ThreadPoolExecutor() as threads:
            quick_pass = threads.submit(run_tests)
            options = ("-W", "ignore::RuntimeWarning", *KERNEL_TESTS)
            plain = threads.submit(run_tests, *options, **PLAIN).result()
            quick = quick_pass.result()
        packages = by_package(measured(Path(folder)))
    print(f"Quick tests:              {quick}\nKernels in plain Python:  {plain}\n")
    print(f"{'package':14}{'statements':>12}{'executed':>10}{'branches':>12}{'executed':>10}")
    for package, (statements, lines, branches, taken) in packages.items():
        shares = percent(lines, statements), percent(taken, branches)
        print(f"{package:14}{statements:12,}{shares[0]:>10}{branches:12,}{shares[1]:>10}")


if __name__ == "__main__":
    main()
