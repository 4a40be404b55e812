"""Make very large stores, and measure what it takes to show them.

    python tools/sizes.py --record docs/results/reliability.json

Ten million trials, as ten thousand runs of a thousand trials and as a million runs of ten.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import reliability

from upright import __version__
from upright.core.trials import Result
from upright.studies.case import make_case
from upright.studies.schema import put
from upright.studies.store import Store
from upright.studies.stored_run import as_stored

SIZES = ((10_000, 1000), (1_000_000, 10))
"""Runs, and trials of each."""
SHOWN = ("show {}", "show {} --each trial --output trials.csv")
HEAD = ("command", "runs", "trials of each", "store [MB]", "time [s]", "memory [MB]")


def make_store(path: Path, runs: int, trials: int) -> None:
    """Write a store of as many runs, whose last trial succeeds."""
    key, rng = make_case("random-search").key, np.random.default_rng(0)
    with Store(path) as store, store.writing() as database:
        for run in range(runs):
            lengths = rng.integers(8, 200, trials)
            lengths[-1] = 60_000
            result = Result(run, True, lengths, 0.1)
            put(database, key, *as_stored(0, result, datetime(2026, 1, 1), __version__), "")


def measure(command: str, folder: Path) -> tuple[float, float]:
    """Return how long a command takes [s], and the most memory that it has [MB]."""
    began = time.monotonic()
    words = [sys.executable, "-m", "upright", *command.split()]
    process = subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"upright {command} failed")
    return time.monotonic() - began, usage.ru_maxrss / 1024  # in kB on Linux


def rows() -> list[list[Any]]:
    """Return what each command took for each store, in the columns of HEAD."""
    found: list[list[Any]] = []
    with tempfile.TemporaryDirectory(prefix="upright-sizes-") as name:
        folder = Path(name)
        for runs, trials in SIZES:
            path = folder / f"{runs}.sqlite"
            make_store(path, runs, trials)
            size = round(path.stat().st_size / 1e6)
            for form in SHOWN:
                seconds, memory = measure(form.format(path.name), folder)
                command = f"`upright {form.format('runs.sqlite')}`"
                found.append([command, runs, trials, size, f"{seconds:.1f}", round(memory)])
                print(*found[-1], sep="  ", flush=True)
    return found


def main() -> None:
    """Measure, and write the figures where the command line says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--record", type=Path, metavar="FILE", help="write the figures here")
    options = parser.parse_args()
    found = {
        "command": "python tools/sizes.py",
        "version": __version__,
        "head": HEAD,
        "rows": rows(),
    }
    if options.record:
        reliability.put("sizes", found, options.record)


if __name__ == "__main__":
    main()
