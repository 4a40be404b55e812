"""Measures what a cluster costs, with workers on this machine, and what that means for large ones.

A study is made in turns by threads of this process and by as many workers of a dask cluster, each
with one thread. The workers, the scheduler and this process, which owns the store, share the cores
of this machine. Compilation and the start of programs are not included; connecting is.
"""

import json
import os
import pickle
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Any

from speed import machine, make_parser, put

from upright.core.trials import Result
from upright.studies.case import Case, make_case
from upright.studies.cluster import A_SECOND, LEAST, Cluster
from upright.studies.executors import opened
from upright.studies.store import Store
from upright.studies.study import make_missing_runs
from upright.support.processes import ending_with_us

CORES = (10, 100, 1000)
"""Sizes of clusters for which the figures are projected."""


def started(opened: ExitStack, *words: str) -> None:
    """Start a program of dask's, until the block ends."""
    quiet = subprocess.DEVNULL
    program = [sys.executable, "-m", f"distributed.cli.dask_{words[0]}", *words[1:]]
    process = subprocess.Popen(ending_with_us(program), stdout=quiet, stderr=quiet)
    opened.callback(process.wait)
    opened.callback(process.terminate)


@contextmanager
def cluster(workers: int) -> Iterator[str]:
    """Run a scheduler and workers on loopback within the block; yield the scheduler's address."""
    import distributed

    with tempfile.TemporaryDirectory() as folder, ExitStack() as opened:
        place = Path(folder, "scheduler.json")
        quiet = ("--host", "127.0.0.1", "--no-dashboard", "--dashboard-address", "127.0.0.1:0")
        started(opened, "scheduler", "--port", "0", "--scheduler-file", str(place), *quiet)
        while not (place.exists() and place.read_text()):
            time.sleep(0.1)
        address = str(json.loads(place.read_text())["address"])
        for _ in range(workers):
            own = ("--nthreads", "1", "--no-nanny", "--local-directory", folder)
            started(opened, "worker", address, *own, *quiet)
        with distributed.Client(address, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=60)
        yield address


def seconds(cases: list[Case], runs: int, executor: Any) -> tuple[float, list[Result]]:
    """Return how long a study takes [s], and its results."""
    with Store() as store:
        began = time.perf_counter()
        make_missing_runs(cases, runs, 0, store, executor=executor)
        took = time.perf_counter() - began
        return took, [result for case in cases for result in store.results(case.key, 0)]


def compare(workers: int, cases: list[Case], runs: int, rounds: int) -> tuple[float, float, float]:
    """Return the median times of threads and workers [s], and the median of their ratios."""
    pairs = []
    with cluster(workers) as address, ThreadPoolExecutor(workers) as threads:
        seconds(cases, workers, address), seconds(cases, workers, threads)  # compiles
        for _ in range(rounds):
            (here, ours), (there, theirs) = (
                seconds(cases, runs, executor) for executor in (threads, address)
            )
            if [r.lengths.tolist() for r in ours] != [r.lengths.tolist() for r in theirs]:
                raise SystemExit("the results of threads and workers differ")
            pairs.append((here, there))
    ratio = median(here / there for here, there in pairs)
    return median(here for here, _ in pairs), median(there for _, there in pairs), ratio


def a_piece(pieces: int) -> float:
    """Return what a piece of work costs beside its runs [s]: here, it makes none."""
    with cluster(1) as address, opened(address) as connected:
        assert isinstance(connected, Cluster)
        took = []
        for count in (10, pieces):
            began = time.perf_counter()
            futures = [connected.submit(int, []) for _ in range(count)]
            for _ in futures:
                connected.result(connected.next_ended())
            took.append((time.perf_counter() - began) / count)
    return took[-1]


def a_write(results: list[Result], key: str, together: int) -> tuple[float, float]:
    """Return what storing a run takes if several arrive together: time [s] and space [bytes]."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "runs.sqlite")
        with Store(path) as store:
            began = time.perf_counter()
            numbered = [(key, result._replace(run=run)) for run, result in enumerate(results)]
            for first in range(0, len(numbered), together):
                store.add_several(numbered[first : first + together], 0)
            took = time.perf_counter() - began
        return took / len(results), path.stat().st_size / len(results)


def size(results: list[Result]) -> float:
    """Return the mean size of a result as it is sent [bytes]."""
    return sum(len(pickle.dumps(result)) for result in results) / len(results)


def projection(run: float, piece: float, write: float, sent: float) -> Iterator[str]:
    """Yield the rows of the table about large clusters, which the slowest part holds back."""
    for cores in CORES:
        budget = max(LEAST, cores / A_SECOND)
        possible = cores / run  # if neither the scheduler nor the store had a limit
        runs = min(possible, 1 / write, possible * budget / (cores * piece))
        pieces = runs / possible * cores / budget
        yield (
            f"| {cores:,} | {budget:.0f} | {pieces:,.0f} | {pieces * piece:.0%} | {runs:,.0f} | "
            f"{runs * write:.0%} | {runs * sent / 1e6:.1f} | {1e6 / runs / 60:,.1f} |"
        )


def text(runs: int, rounds: int, pieces: int) -> str:
    """Return the tables in Markdown."""
    cases = [make_case(agent, steps=600_000) for agent in ("random-search", "q-learning")]
    most = min(2, os.cpu_count() or 1)
    lines = ["| workers | threads [s] | cluster [s] | efficiency |", "|---|---|---|---|"]
    for workers in range(1, most + 1):
        here, there, ratio = compare(workers, cases, runs, rounds)
        lines.append(f"| {workers} | {here:.2f} | {there:.2f} | {ratio:.0%} |")
        if workers == 1:
            run = here / (runs * len(cases))
    results = seconds(cases, runs, "threads")[1]
    piece, sent = a_piece(pieces), size(results)
    write, kept = a_write(results, cases[0].key, max(1, round(LEAST / run)))
    lines += [
        "",
        f"A run takes {run * 1e3:.0f} ms and is sent as {sent:,.0f} bytes. The store takes "
        f"{write * 1e6:.0f} µs and {kept:,.0f} bytes for it. A piece of work costs "
        f"{piece * 1e3:.1f} ms beside its runs.",
        "",
        "| cores | seconds a piece | pieces a second | scheduler busy | runs a second | store busy "
        "| MB a second | minutes for 10⁶ runs |",
        "|---|---|---|---|---|---|---|---|",
        *projection(run, piece, write, sent),
    ]
    return "\n".join(lines)


def main() -> None:
    """Measure, and print the tables or write them into a page."""
    parser = make_parser(__doc__, "docs/scale.md")
    parser.add_argument("--runs", type=int, default=500, help="runs of each of two cases")
    parser.add_argument("--rounds", type=int, default=5, help="studies of each kind")
    parser.add_argument("--pieces", type=int, default=1000, help="empty pieces of work")
    options = parser.parse_args()
    put(f"{text(options.runs, options.rounds, options.pieces)}\n\n{machine()}\n", options.output)


if __name__ == "__main__":
    main()
