"""Give damaged inputs to everything of Upright that parses, and see that it says no.

    python tools/fuzz.py                                  a million inputs, a while on two cores
    python tools/fuzz.py --inputs 5000 --target task-file
    python tools/fuzz.py --repeat fuzz-failures/terms-123.txt

An input may be accepted or refused by an UprightError of one line. It fails if it raises anything
else, ends the process, takes longer than SECONDS or more memory than MEGABYTES, or changes a file.
What failed is written to fuzz-failures/, with the command that repeats it. Inputs follow
from the seed, the target and their number alone, so the same options try the same inputs.
"""

import argparse
import json
import multiprocessing
import os
import random
import re
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from fuzz_inputs import damaged

SECONDS, MEGABYTES = 30.0, 512.0
"""Bounds of one input: how long it may take, and how much memory beyond what is used already."""
ADDRESSES = 8 * 2**30
"""Bound of a worker's address space [bytes]."""
JOB = 2000
"""Inputs of one target that a worker tries before it reports."""
MOST_FAILURES = 20
"""A target is left after this many failures."""
FAILURES = Path("fuzz-failures")
"""Where failures are written."""
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
CHANGES = {"os.mkdir", "os.remove", "os.rename", "os.rmdir", "os.link", "os.symlink", "os.truncate"}
"""Audit events that change the file in their first argument."""
STARTS = {"os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect"}
"""Audit events of what no input may lead to."""


@dataclass
class Figures:
    """What came of some inputs of a target."""

    inputs: int = 0
    accepted: int = 0
    refused: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    """How often inputs were refused in words that differ in more than numbers and quoted texts."""
    failures: dict[str, str] = field(default_factory=dict)
    """What went wrong, by the number of the input."""
    slowest: float = 0.0
    """The longest that an input took [s]."""
    memory: float = 0.0
    """The most memory that a job took beyond what was used before [MB]."""
    seconds: float = 0.0
    """How long all took together, on one core [s]."""

    def add(self, more: "Figures") -> None:
        """Add the figures of more inputs."""
        for name in ("inputs", "accepted", "refused", "seconds"):
            setattr(self, name, getattr(self, name) + getattr(more, name))
        self.reasons += more.reasons
        self.failures |= more.failures
        self.slowest = max(self.slowest, more.slowest)
        self.memory = max(self.memory, more.memory)


class EscapedError(BaseException):
    """An input led to a change outside of the folder, or to another program."""


# ---- In a worker ---------------------------------------------------------------------------------


class Bench:
    """A folder in which inputs of targets are tried, one after the other.

    Parameters
    ----------
    folder
        An empty folder, which becomes the current and the home folder.
    """

    def __init__(self, folder: Path) -> None:
        from upright.support.files import user_cache
        from upright.support.machine_code import cache_folder

        cache = user_cache()
        cache_folder()  # made here, as no input may make a folder
        self._allowed = (str(folder), str(cache), os.devnull)
        self._watching = False
        self._seeds: dict[str, tuple[list[bytes], list[bytes]]] = {}
        os.environ |= {"XDG_CACHE_HOME": str(cache.parent), "HOME": str(folder)}
        os.environ |= {"TMPDIR": str(folder), "NO_COLOR": "1"}
        tempfile.tempdir = None
        os.chdir(folder)
        sys.path.insert(0, str(folder))
        sys.addaudithook(self._audit)

    def input_of(self, name: str, seed: int, number: int) -> bytes:
        """Return an input; 0, 1, ... are the undamaged ones first."""
        from fuzz_targets import TARGETS

        if name not in self._seeds:
            self._seeds[name] = TARGETS[name].seeds(), TARGETS[name].words()
        seeds, words = self._seeds[name]
        if number < len(seeds):
            return seeds[number]
        return damaged(random.Random(f"{seed} {name} {number}"), seeds, words)

    def try_one(self, name: str, data: bytes, figures: Figures) -> str:
        """Try an input, enter it into the figures, and return what went wrong, if anything did."""
        from fuzz_targets import TARGETS

        from upright.errors import CodeError, UprightError

        target = TARGETS[name]
        path = Path(f"input{target.suffix}")
        path.write_bytes(data)
        wrong, began = "", time.perf_counter()
        self._watching = True
        try:
            target.read(path)
            figures.accepted += 1
        except UprightError as error:
            figures.refused += 1
            figures.reasons[_kind(str(error))] += 1
            if "\n" in str(error) and not isinstance(error, CodeError):
                wrong = f"it was refused in several lines:\n{error}"
            if isinstance(error.__cause__, MemoryError):
                wrong = "it ran out of memory"
        except KeyboardInterrupt:
            raise
        except BaseException:
            wrong = traceback.format_exc()
        self._watching = False
        took = time.perf_counter() - began
        figures.inputs += 1
        figures.slowest = max(figures.slowest, took)
        figures.seconds += took
        if took > SECONDS:
            wrong = wrong or f"it took {took:.1f} s"
        return wrong

    def left(self) -> list[str]:
        """Return the names of files that inputs have left in the folder, and remove them."""
        known = {"fuzz_climber.py", "__pycache__"}
        paths = [path for path in Path().iterdir() if path.name not in known]
        names = [path.name for path in paths if path.stem != "input"]
        for path in paths:
            if path.is_file():
                path.unlink()
        return names

    def _audit(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self._watching:
            return
        changes = event in CHANGES or (event == "open" and (arguments[2] or 0) & WRITING)
        if changes and isinstance(arguments[0], (str, bytes)):
            place = os.path.abspath(os.fsdecode(arguments[0]))
            if not place.startswith(self._allowed):
                raise EscapedError(f"{event} of {place!r}")
        if event in STARTS:
            raise EscapedError(f"{event}{arguments!r}")


def _kind(text: str) -> str:
    """Return an error without what differs between inputs."""
    text = re.sub(r"'(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\"", "'…'", text)
    return re.sub(r"[+-]?[\d.,_]+(e[+-]?\d+)?", "#", text)[:200]


def _peak() -> float:
    """Return the most memory that this process has had since `_forget_peak` [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def work(connection: Connection, now: Any, folder: Path, seed: int, place: Path) -> None:
    """Try inputs as a worker: for each job that is received, send its figures."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())  # what libraries warn of
    warnings.simplefilter("ignore")
    bench = Bench(folder)
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    while (job := connection.recv()) is not None:
        name, numbers = job
        figures = Figures()
        bench.input_of(name, seed, 0)
        _forget_peak()
        peak = base = _peak()
        for number in numbers:
            now.value = number
            data = bench.input_of(name, seed, number)
            wrong = bench.try_one(name, data, figures)
            if (reached := _peak()) > peak:
                if reached - peak > MEGABYTES:
                    wrong = wrong or f"it took {reached - peak:.0f} MB"
                peak = reached
            if wrong:
                figures.failures[str(number)] = wrong
                keep(place, name, number, data, wrong)
        figures.memory = peak - base
        if left := bench.left():
            figures.failures[f"{numbers[0]}"] = f"the job left {', '.join(left)}"
        connection.send(figures)


# ---- The run -------------------------------------------------------------------------------------


class Worker:
    """A process that tries inputs, and is started again when one of them ends it."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self.job: tuple[str, range] | None = None
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._folder = tempfile.TemporaryDirectory(prefix="upright-fuzz-")
        self._now = context.Value("q", -1, lock=False)
        self.connection, theirs = context.Pipe()
        place = FAILURES.absolute()
        arguments = (theirs, self._now, Path(self._folder.name), self._seed, place)
        self._process = context.Process(target=work, args=arguments, daemon=True)
        self._process.start()
        theirs.close()
        self._seen, self._since = -1, time.monotonic()

    def give(self, job: tuple[str, range] | None) -> None:
        """Give the worker a job; None ends it."""
        self.job = job
        self._now.value, self._since = -1, time.monotonic()
        self.connection.send(job)

    def lost(self) -> tuple[int, str] | None:
        """Return the input that has ended the process or hangs, and how; None if none has."""
        number = self._now.value
        if number != self._seen:
            self._seen, self._since = number, time.monotonic()
        if not self._process.is_alive():
            return number, f"it ended the process with status {self._process.exitcode}"
        if number >= 0 and time.monotonic() - self._since > 2 * SECONDS:
            return number, f"it had not ended after {2 * SECONDS:g} s"
        return None

    def input(self, suffix: str) -> bytes:
        """Return the input that is being tried; empty if there is none."""
        path = Path(self._folder.name) / f"input{suffix}"
        return path.read_bytes() if path.exists() else b""

    def restart(self) -> None:
        """Replace the process by a new one."""
        self.end()
        self._start()

    def end(self) -> None:
        """End the process, and remove its folder."""
        self._process.kill()
        self._process.join()
        self.connection.close()
        self._folder.cleanup()


def jobs(names: Sequence[str], inputs: int) -> Iterator[tuple[str, range]]:
    """Yield the jobs of a run, those of all targets in turn."""
    from fuzz_targets import TARGETS

    shares = {name: TARGETS[name].share for name in names}
    ends = {n: max(1, round(inputs * share / sum(shares.values()))) for n, share in shares.items()}
    for first in range(0, max(ends.values()), JOB):
        for name, end in ends.items():
            if first < end:
                yield name, range(first, min(end, first + JOB))


def fuzz(names: Sequence[str], inputs: int, seed: int, workers: int) -> dict[str, Figures]:
    """Try this many inputs in all, and return the figures of each target."""
    from fuzz_targets import TARGETS

    totals = {name: Figures() for name in names}
    waiting, began = list(jobs(names, inputs))[::-1], time.monotonic()
    due = sum(len(numbers) for _, numbers in waiting)
    crew = [Worker(seed) for _ in range(workers)]
    try:
        while waiting or any(worker.job for worker in crew):
            for worker in crew:
                if not worker.job and waiting:
                    worker.give(waiting.pop())
            for connection in wait([worker.connection for worker in crew], timeout=1.0):
                worker = next(each for each in crew if each.connection is connection)
                if worker.job and (figures := _received(worker)):
                    totals[worker.job[0]].add(figures)
                    worker.job = None
            for worker in crew:
                if worker.job and (lost := worker.lost()):
                    data = worker.input(TARGETS[worker.job[0]].suffix)
                    keep(FAILURES.absolute(), worker.job[0], lost[0], data, lost[1])
                    waiting += _without(worker.job, lost, totals)
                    worker.restart()
                    worker.job = None
            left = {name for name, each in totals.items() if len(each.failures) >= MOST_FAILURES}
            waiting = [job for job in waiting if job[0] not in left]
            _show(totals, due, time.monotonic() - began)
    except KeyboardInterrupt:
        print("\nstopped", file=sys.stderr)
    finally:
        for worker in crew:
            worker.end()
    print(file=sys.stderr)
    return totals


def _received(worker: Worker) -> Figures | None:
    try:
        figures: Figures = worker.connection.recv()
    except EOFError:  # the process has ended
        return None
    return figures


def _without(
    job: tuple[str, range], lost: tuple[int, str], totals: dict[str, Figures]
) -> list[tuple[str, range]]:
    """Enter a lost input as a failure; return the jobs without it, which are tried again."""
    name, numbers = job
    number, how = lost
    if number < 0:
        raise SystemExit(f"a worker could not begin with {name}: {how}")
    totals[name].failures[str(number)] = how
    totals[name].inputs += 1
    parts = [range(numbers.start, number), range(number + 1, numbers.stop)]
    return [(name, part) for part in parts if part]


def _show(totals: dict[str, Figures], due: int, seconds: float) -> None:
    done = sum(figures.inputs for figures in totals.values())
    failed = sum(len(figures.failures) for figures in totals.values())
    line = f"{done:,} of {due:,} inputs, {failed} failures, {seconds:.0f} s"
    print(f"\r{line}", end="", file=sys.stderr, flush=True)


HEAD = (
    "target",
    "inputs",
    "accepted",
    "refused",
    "reasons",
    "faults",
    "slowest [s]",
    "memory [MB]",
)


def rows(totals: dict[str, Figures]) -> list[list[Any]]:
    """Return the figures of each target, and those of all, in the columns of HEAD."""
    every = Figures()
    for figures in totals.values():
        every.add(figures)
    return [
        [
            name,
            *(figures.inputs, figures.accepted, figures.refused),
            *(len(figures.reasons), len(figures.failures)),
            *(f"{figures.slowest:.2f}", f"{figures.memory:.0f}"),
        ]
        for name, figures in (totals | {"all": every}).items()
    ]


def record(totals: dict[str, Figures], seed: int) -> dict[str, Any]:
    """Return what came out in the form of a section of docs/results/reliability.json."""
    from upright import __version__

    inputs = sum(figures.inputs for figures in totals.values())
    command = f"python tools/fuzz.py --inputs {inputs} --seed {seed}"
    return {"command": command, "version": __version__, "head": HEAD, "rows": rows(totals)}


def keep(place: Path, name: str, number: int, data: bytes, wrong: str) -> None:
    """Write an input that failed, and beside it what happened and how to repeat it."""
    from fuzz_targets import TARGETS

    place.mkdir(exist_ok=True)
    path = place / f"{name}-{number}{TARGETS[name].suffix}"
    path.write_bytes(data)
    how = f"python tools/fuzz.py --repeat {FAILURES / path.name}"
    path.with_name(f"{path.name}.why").write_text(f"{how}\n{wrong.rstrip()}\n")


def repeat(path: Path) -> int:
    """Try one input that failed again, in this process."""
    data, name = path.read_bytes(), path.name.rpartition("-")[0]
    figures = Figures()
    with tempfile.TemporaryDirectory(prefix="upright-fuzz-") as folder:
        bench = Bench(Path(folder))
        bench.input_of(name, 0, 0)
        wrong = bench.try_one(name, data, figures)
        os.chdir("/")
    print(wrong or ("accepted" if figures.accepted else f"refused: {next(iter(figures.reasons))}"))
    return 1 if wrong else 0


def main() -> int:
    """Carry out what the command line asks for, and return the exit status."""
    parser = argparse.ArgumentParser(
        description=(__doc__ or "").partition("\n")[0], allow_abbrev=False
    )
    parser.add_argument("--inputs", type=int, default=10**6, metavar="N", help="inputs in all")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="where inputs follow from")
    parser.add_argument("--target", action="append", metavar="NAME", help="this one; repeatable")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), metavar="N")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to this file")
    parser.add_argument("--record", type=Path, metavar="FILE", help="write a table of them here")
    parser.add_argument("--repeat", type=Path, metavar="FILE", help="try one failure again")
    options = parser.parse_args()
    if options.repeat:
        return repeat(options.repeat.absolute())
    from fuzz_targets import TARGETS

    names = options.target or list(TARGETS)
    if unknown := [name for name in names if name not in TARGETS]:
        parser.error(f"target is {unknown[0]!r}; it must be one of {', '.join(TARGETS)}")
    totals = fuzz(names, options.inputs, options.seed, options.workers)
    for name, *cells in [HEAD, *rows(totals)]:
        print(f"{name:14}", *(f"{cell:>12}" for cell in cells))
    for name, figures in totals.items():
        for number, wrong in figures.failures.items():
            suffix, last = TARGETS[name].suffix, wrong.strip().splitlines()[-1]
            print(f"{FAILURES / f'{name}-{number}{suffix}'}: {last[:200]}")
    if options.record:
        import reliability

        reliability.put("fuzz", record(totals, options.seed), options.record)
    if options.json:
        options.json.write_text(json.dumps({n: vars(f) for n, f in totals.items()}, indent=1))
    return 1 if any(figures.failures for figures in totals.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
