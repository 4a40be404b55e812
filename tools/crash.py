"""Kill commands that write files at random moments, and check that nothing is lost.

    python tools/crash.py                              1,000 kills, about an hour
    python tools/crash.py --scenario learn --seed 3    one command alone

A scenario is a command in a folder of its own. First it runs twice undisturbed: that is the
reference. Then come rounds: the same command is started, killed by SIGKILL and started again, four
to eight times, and at last it may complete. Half of the moments are uniform over the command's
duration. The others come shortly after one of the changes that it makes in its folder, because
little of the duration goes into writing. In three kills of four all processes are killed, in the
fourth the command alone, and its children must end by themselves. After each kill

- every file that exists is whole: equal to that of the reference, or to what was there before; of a
  store, which grows, the runs equal those of the reference, and none that it held before is lost;
- `PRAGMA integrity_check` finds nothing in a store;
- no process is left;

and whenever the command completes, its exit status, what it prints and all its files equal the
reference, up to seconds and dates, and there is no other file: neither in its folder, nor in the
folder for temporary files, nor in the cache.

The plan follows from the seed; the moments also depend on the machine. Where something is wrong,
the folder is kept, and the line that reports it says how to repeat the round.
"""

import argparse
import os
import re
import shlex
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import reliability

from upright.support.files import user_cache

ROOT = Path(__file__).parents[1]
MARK = "UPRIGHT_CRASH"
"""Environment variable that tells which processes descend from a command under test."""
PATIENCE = 10.0
"""How long children may outlive a killed command [s]."""
LIMIT = 600.0
"""How long a command may take; one that takes longer hangs [s]."""
POLL = 0.0005
"""Interval at which a command's folder is looked at, and the shortest time before a kill [s]."""
BEFORE = b"what was here before\n"
"""What some files hold before the command writes them."""
LEFT_BY_PYTHON = "__pycache__"

# ------------------------------------------------------------------------------ what is killed

SHORT = "--steps 300"
INPUTS = {
    "policy.npz": f"learn random-search {SHORT} --quiet --save policy.npz",
    "runs.sqlite": f"table --agents random-search --noises none,sensor-5 --runs 20 {SHORT} "
    "--parameter half_length=0.3,0.5 --store runs.sqlite",
    "other.sqlite": f"table --agents random-search --noises none --runs 20 {SHORT} --seed 1 "
    "--store other.sqlite",
    "a.toml": f"table --agents random-search --noises none,sensor-5 --runs 50 {SHORT} "
    "--save-study a.toml",
    "my_agent.py": "new my_agent.py",
}
"""Files that commands read, and the commands that make them."""


def has_octave() -> bool:
    """Whether GNU Octave is there."""
    return shutil.which("octave-cli") is not None


def has_gazebo() -> bool:
    """Whether Gazebo 11 is there."""
    from upright.errors import UprightError
    from upright.plants.gazebo.installation import find_gazebo

    try:
        return bool(find_gazebo())
    except UprightError:
        return False


@dataclass(frozen=True)
class Scenario:
    """A command that writes files."""

    name: str
    command: str
    inputs: tuple[str, ...] = ()
    """Those of INPUTS that its folder begins with."""
    own_cache: bool = False
    """Whether each round begins with an empty cache, so that kills hit compilation."""
    statuses: tuple[int, ...] = ()
    """Exit statuses that are as good as that of the reference when the command is repeated."""
    prints_the_same: bool = True
    """Whether it does so when it finds its work done."""
    is_possible: Callable[[], bool] = lambda: True
    """Whether the programs that it needs are there."""


SCENARIOS = (
    Scenario("learn", f"learn random-search {SHORT} --save a.npz --plot a.png --save-task a.toml"),
    Scenario("learn-json", f"learn q-learning {SHORT} --quiet --save a.json"),
    Scenario("learn-on", "learn --from policy.npz --steps 500 --save b.npz", ("policy.npz",)),
    Scenario("learn-video", f"learn random-search {SHORT} --quiet --size 320x180 --video a.mp4"),
    Scenario("learn-cold", f"learn random-search {SHORT} --save a.npz --plot a.png", (), True),
    Scenario(
        "table",
        f"table --agents random-search,q-learning --noises none,sensor-5 --runs 100 {SHORT} "
        "--store a.sqlite --format json --output a.json",
    ),
    Scenario(
        "table-own-agent",
        f"table --agents my_agent:MyAgent --noises none --runs 40 {SHORT} --store a.sqlite "
        "--save-task a.toml",
        ("my_agent.py",),
    ),
    Scenario("table-cold", f"table --agents random-search {SHORT} --store a.sqlite", (), True),
    Scenario(
        "leaderboard",
        f"leaderboard --agents random-search --runs 20 {SHORT} --store a.sqlite --output a.md",
    ),
    Scenario(
        "robust", f"robust --agents random-search --runs 3 {SHORT} --output a.md --store a.db"
    ),
    Scenario("reproduce", "reproduce --runs 2 --steps 100 --output report"),
    Scenario(
        "matlab-table",
        f"matlab table --agents random-search --noises none,sensor-5 --runs 20 {SHORT} "
        "--store a.sqlite",
        is_possible=has_octave,
    ),
    Scenario(
        "table-gazebo",
        "table --plant gazebo --agents random-search --noises none --runs 4 --steps 100 "
        "--store a.sqlite",
        is_possible=has_gazebo,
    ),
    Scenario(
        "tune",
        f"tune q-learning --candidates 6 --runs 4 --validation-runs 4 --noises none {SHORT} "
        "--trials 100 --store a.sqlite --output a.toml",
    ),
    Scenario(
        "merge",
        "merge runs.sqlite other.sqlite --output all.sqlite",
        ("runs.sqlite", "other.sqlite"),
        prints_the_same=False,
    ),
    Scenario("study", "study a.toml --format json --output a.json", ("a.toml",)),
    Scenario("show-table", "show runs.sqlite --format latex --output a.tex", ("runs.sqlite",)),
    Scenario("show-csv", "show runs.sqlite --each trial --output a.csv", ("runs.sqlite",)),
    Scenario(
        "show-json", "show runs.sqlite --each trial --format json --output a.json", ("runs.sqlite",)
    ),
    Scenario(
        "show-parquet", "show runs.sqlite --format parquet --output a.parquet", ("runs.sqlite",)
    ),
    Scenario("show-policy", "show policy.npz --output a.txt", ("policy.npz",)),
    Scenario("plot-curves", "plot curves runs.sqlite --output a.png", ("runs.sqlite",)),
    Scenario("plot-policy", "plot policy policy.npz --output a.pdf", ("policy.npz",)),
    Scenario("export-c", "export policy.npz a.h", ("policy.npz",)),
    Scenario("export-onnx", "export policy.npz a.onnx", ("policy.npz",)),
    Scenario("export-json", "export policy.npz a.json", ("policy.npz",)),
    Scenario(
        "play-mp4", "play policy.npz --steps 50 --size 320x180 --video a.mp4", ("policy.npz",)
    ),
    Scenario(
        "play-gif", "play policy.npz --steps 50 --size 320x180 --video a.gif", ("policy.npz",)
    ),
    Scenario("new", "new an_agent.py", statuses=(2,)),  # what is there is not overwritten
    Scenario("cite", "cite --format bibtex --output a.bib"),
)

# ------------------------------------------------------------------------------ what files hold


def runs_of_store(path: Path) -> set[Any]:
    """Return every run of a store, without times."""
    from upright.studies.store import Store

    with Store(path, must_exist=True) as store:
        return {
            (key, seed, result.run, result.success, result.lengths.tobytes())
            for _, key, seed in store.cases()
            for result in store.results(key, seed)
        }


def candidates_of_search(database: sqlite3.Connection) -> set[Any]:
    """Return every measured candidate of Optuna's database: its settings, and what they gave."""
    return set(
        database.execute(
            "SELECT state, (SELECT group_concat(name || value) FROM (SELECT param_name AS name, "
            "param_value AS value FROM trial_params WHERE trial_id = t.trial_id ORDER BY name)), "
            "(SELECT group_concat(value) FROM trial_values WHERE trial_id = t.trial_id) "
            "FROM trials AS t WHERE state IN ('COMPLETE', 'PRUNED')"
        )
    )


def rows_of(path: Path) -> set[Any]:
    """Return what a database holds, checked, from a copy: reading may alter it."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        for end in ("", "-wal", "-journal"):
            if (part := path.with_name(path.name + end)).exists():
                shutil.copy(part, copy.with_name(copy.name + end))
        with closing(sqlite3.connect(copy)) as database:
            ((found,),) = database.execute("PRAGMA integrity_check")
            if found != "ok":
                raise ValueError(f"integrity_check: {found}")
            tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master")}
            if "trials" in tables:
                return candidates_of_search(database)
        return runs_of_store(copy) if "runs" in tables else set()


TIMES = re.compile(rb'"(?:seconds|ended|date)": [^,}\n]*|took [\d.]+ s')
"""What differs between two runs of the same command."""


def content_of(path: Path) -> Any:
    """Return what a file holds that depends on its command alone: a set for a database."""
    return rows_of(path) if is_database(path) else TIMES.sub(b"", path.read_bytes())


def is_database(path: Path) -> bool:
    """Whether a file is one to which rows are added, rather than written as a whole."""
    return path.suffix in (".sqlite", ".db")


def listing(folder: Path) -> set[str]:
    """Return the names of all files and folders below a folder, but those of Python's own cache."""
    paths = (path.relative_to(folder) for path in folder.rglob("*"))
    return {path.as_posix() for path in paths if LEFT_BY_PYTHON not in path.parts}


def contents(folder: Path, names: Iterable[str]) -> dict[str, Any]:
    """Return what the files of these names hold, those that exist."""
    paths = {name: folder / name for name in sorted(names)}
    return {name: content_of(path) for name, path in paths.items() if path.is_file()}


# ------------------------------------------------------------------------------ processes


def descendants(mark: str) -> list[int]:
    """Return the numbers of all processes whose environment has a mark."""
    found, wanted = [], f"{MARK}={mark}".encode()
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if wanted in (process / "environ").read_bytes().split(b"\0"):
                found.append(int(process.name))
        except OSError:  # it has ended, or belongs to somebody else
            continue
    return found


def kill_all(mark: str) -> None:
    """Kill all processes with a mark, also those that begin meanwhile."""
    while numbers := descendants(mark):
        for number in numbers:
            try:
                os.kill(number, signal.SIGKILL)
            except ProcessLookupError:
                continue


class Kill(NamedTuple):
    """When and how a command is killed. The parts are numbers from 0 to 1."""

    change: float | None
    """Part of the changes of the folder to wait for first; None to count from the start."""
    part: float
    """Of what is left of the duration then; of its logarithm after a change."""
    alone: bool
    """Whether its children are spared, which must end by themselves."""

    def after(self, timing: "Ended") -> tuple[int, float]:
        """Return how many changes to wait for, and for how long after them [s]."""
        if self.change is None or not timing.changes:
            return 0, self.part * timing.seconds
        count = 1 + int(self.change * len(timing.changes))
        rest = max(timing.seconds - timing.changes[count - 1], POLL)
        return count, POLL * (rest / POLL) ** self.part


class Ended(NamedTuple):
    """How a command ended."""

    status: int
    """Exit status, -9 if it was killed."""
    printed: bytes
    errors: str
    seconds: float
    """How long it took [s]."""
    changes: list[float]
    """When its folder was seen to change, from its start [s]."""


class Place:
    """A folder in which a command is run again and again: its files, temporary files and cache.

    Parameters
    ----------
    folder
        Where all that is; it is made.
    inputs
        Files that it begins with.
    cache
        The user's cache of the command; the present user's own unless given.
    """

    def __init__(
        self, folder: Path, inputs: Iterable[Path] = (), cache: Path | None = None
    ) -> None:
        self.folder, self.cache = folder, cache
        self.files, self.temporary = folder / "files", folder / "temporary"
        for each in (self.files, self.temporary):
            each.mkdir(parents=True)
        for path in inputs:
            shutil.copy(path, self.files)
        self.mark = uuid.uuid4().hex

    def run(self, command: str, kill: Kill | None = None, timing: "Ended | None" = None) -> Ended:
        """Run a command, and kill it if that is asked for and it has not ended before.

        Parameters
        ----------
        command
            What stands behind `upright`.
        kill
            When and how to kill it.
        timing
            How it ended in the reference, which gives its duration.
        """
        environment = os.environ | {MARK: self.mark, "TMPDIR": str(self.temporary)}
        if self.cache:
            gazebo = {"UPRIGHT_GAZEBO": str(user_cache() / "gazebo-11")}  # it stays where it is
            environment = gazebo | environment | {"XDG_CACHE_HOME": str(self.cache)}
        with (
            (self.folder / "printed").open("wb") as out,
            (self.folder / "errors").open("wb") as err,
        ):
            began = time.monotonic()
            process = subprocess.Popen(
                [sys.executable, "-m", "upright", *shlex.split(command)],
                cwd=self.files,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                start_new_session=True,
            )
            try:
                changes = self._wait(process, began, kill, timing)
            except BaseException:
                kill_all(self.mark)
                raise
            process.kill()  # which does nothing if it has ended
            if not (kill and kill.alone):
                kill_all(self.mark)
            process.wait()
            seconds = time.monotonic() - began
        printed = TIMES.sub(b"", (self.folder / "printed").read_bytes())
        errors = (self.folder / "errors").read_text(errors="replace")
        return Ended(process.returncode, printed, errors, seconds, changes)

    def _wait(
        self,
        process: "subprocess.Popen[bytes]",
        began: float,
        kill: Kill | None,
        timing: Ended | None,
    ) -> list[float]:
        """Wait until a process has ended or is to be killed; return when its folder changed."""
        wanted, delay = kill.after(timing) if kill and timing else (0, LIMIT)
        state, changes, until = self._state(), list[float](), LIMIT if wanted else delay
        while process.poll() is None and (now := time.monotonic() - began) < until:
            previous, state = state, self._state()
            if state != previous:
                changes.append(now)
                if len(changes) == wanted:
                    until = now + delay
            time.sleep(POLL)
        return changes

    def _state(self) -> set[tuple[str, int, int]]:
        found = set()
        for folder, _, names in os.walk(self.files):
            for name in names:
                try:
                    about = os.stat(os.path.join(folder, name))
                except FileNotFoundError:
                    continue
                found.add((name, about.st_size, about.st_mtime_ns))
        return found

    def left_processes(self) -> list[int]:
        """Return the command's processes that have not ended within PATIENCE; they are killed."""
        until = time.monotonic() + PATIENCE
        while (left := descendants(self.mark)) and time.monotonic() < until:
            time.sleep(0.05)
        kill_all(self.mark)
        return left

    def listing(self) -> dict[str, set[str]]:
        """Return the names of all its files by the folder they are in."""
        folders = {"files": self.files, "temporary": self.temporary}
        if self.cache:
            folders["cache"] = self.cache
        return {name: listing(folder) for name, folder in folders.items() if folder.exists()}


# ------------------------------------------------------------------------------ rounds


class Fault(Exception):  # noqa: N818 - it is found, rather than made
    """Something is not as promised."""


def require(holds: bool, what: str) -> None:
    """Raise Fault unless a promise holds."""
    if not holds:
        raise Fault(what)


class Reference(NamedTuple):
    """What a command leaves if nobody kills it."""

    ended: Ended
    listing: dict[str, set[str]]
    contents: dict[str, Any]


def make_reference(
    scenario: Scenario, folder: Path, inputs: list[Path], cache: Path | None
) -> Reference:
    """Run a command twice undisturbed, in two folders, and return what it leaves.

    Raises
    ------
    Fault
        If it fails, or the two differ, so that nothing can be compared with them.
    """
    references = []
    for name in ("first", "again"):
        place = Place(folder / name, inputs, cache_of(scenario, folder / name, cache))
        ended = place.run(scenario.command)
        if ended.status not in (0, 1):
            raise Fault(f"{scenario.name} fails with status {ended.status}: {ended.errors}")
        found = place.listing()
        references.append(Reference(ended, found, contents(place.files, found["files"])))
    first, again = references
    for what, a, b in (
        ("prints", first.ended.printed, again.ended.printed),
        ("makes the files", first.listing["files"], again.listing["files"]),
        *(
            ("writes " + name, first.contents[name], again.contents[name])
            for name in first.contents
        ),
    ):
        if a != b:
            raise Fault(f"{scenario.name} {what} differently the second time: {a!r}, {b!r}")
    return again  # the first one may have compiled


def cache_of(scenario: Scenario, folder: Path, cache: Path | None) -> Path | None:
    """Return the cache for a scenario in a folder."""
    return folder / "cache" if scenario.own_cache else cache


@dataclass
class Tally:
    """Figures of a scenario."""

    scenario: Scenario
    kills: int = 0
    writing: int = 0
    """Those after the command had changed its folder."""
    completions: int = 0
    seconds: float = 0.0
    """How long the command takes [s]."""
    faults: list[str] = field(default_factory=list)


@dataclass
class Round:
    """Kills of a command in one folder, until it completes."""

    scenario: Scenario
    reference: Reference
    place: Place
    tally: Tally
    held: dict[str, Any]
    """What the files held last."""

    def play(self, kills: Iterable[Kill]) -> None:
        """Run the command with these kills, and at last without one.

        Raises
        ------
        Fault
            If a promise does not hold.
        """
        for kill in kills:
            ended = self.place.run(self.scenario.command, kill, self.reference.ended)
            if ended.status != -signal.SIGKILL:
                self.check_complete(ended)  # it was faster
                continue
            self.tally.kills += 1
            self.tally.writing += bool(ended.changes)
            left = self.place.left_processes()
            require(not left, f"{len(left)} processes outlive the killed command")
            self.check_whole()
        self.check_complete(self.place.run(self.scenario.command))

    def check_whole(self) -> None:
        """Check that no file is half-written, and that nothing is lost."""
        for name in self.reference.contents:
            path, before = self.place.files / name, self.held.get(name)
            if not path.exists():
                require(before is None, f"{name} is gone")
                continue
            try:
                now, whole = content_of(path), self.reference.contents[name]
            except Exception as error:
                raise Fault(f"{name} cannot be read: {error!r}") from error
            if is_database(path):
                require(now <= whole, f"{name} holds what the reference does not")
                require((before or set()) <= now, f"{name} has lost what it held")
            else:
                require(now in (whole, before), f"{name} is half-written: {len(now)} bytes")
            self.held[name] = now

    def check_complete(self, ended: Ended) -> None:
        """Check that all is as in the reference."""
        self.tally.completions += 1
        repeated = ended.status in self.scenario.statuses
        status = self.reference.ended.status
        require(
            repeated or ended.status == status,
            f"status is {ended.status}, not {status}: {ended.errors.strip()[-300:]}",
        )
        self.check_whole()
        for name, whole in self.reference.contents.items():
            require(self.held.get(name) == whole, f"{name} differs from the reference")
        require(
            repeated
            or not self.scenario.prints_the_same
            or ended.printed == self.reference.ended.printed,
            "what it prints differs from the reference",
        )
        for where, names in self.place.listing().items():
            expected = self.reference.listing[where]
            more, fewer = sorted(names - expected), sorted(expected - names)
            require(not more, f"{where} has besides: {', '.join(more)}")
            require(not fewer, f"{where} lacks: {', '.join(fewer)}")


def plan(scenario: Scenario, seed: int, number: int) -> tuple[list[Kill], bool]:
    """Return the kills of a round, and whether files are there before it."""
    rng = Random(f"{seed} {scenario.name} {number}")
    kills = [
        Kill(rng.random() if rng.random() < 0.5 else None, rng.random(), rng.random() < 0.25)
        for _ in range(rng.randint(4, 8))
    ]
    return kills, rng.random() < 0.5


def begin_round(
    scenario: Scenario, reference: Reference, place: Place, tally: Tally, preset: bool
) -> Round:
    """Return a round in a new place, with or without files that the command is to replace."""
    held = contents(place.files, reference.contents)
    if preset and not scenario.statuses:
        for name in reference.contents:
            path = place.files / name
            if not path.exists() and not is_database(path):
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(BEFORE)
                held[name] = BEFORE
    return Round(scenario, reference, place, tally, held)


def rounds(
    tally: Tally,
    kills: int,
    seed: int,
    folder: Path,
    inputs: list[Path],
    cache: Path | None,
    numbers: Iterable[int],
) -> Iterator[int]:
    """Make rounds of a scenario until it has been killed often enough; yield their numbers."""
    scenario = tally.scenario
    reference = make_reference(scenario, folder, inputs, cache)
    tally.seconds = reference.ended.seconds
    for number in numbers:
        planned, preset = plan(scenario, seed, number)
        place = Place(folder / str(number), inputs, cache_of(scenario, folder / str(number), cache))
        try:
            begin_round(scenario, reference, place, tally, preset).play(
                planned[: kills - tally.kills]
            )
        except Fault as fault:
            repeat = f"--scenario {scenario.name} --seed {seed} --round {number}"
            tally.faults.append(f"{fault} ({place.folder}; {repeat})")
        else:
            shutil.rmtree(place.folder)
        yield number
        if tally.kills >= kills:
            break


def make_inputs(names: Sequence[str], place: Place) -> list[Path]:
    """Make those of INPUTS that are not there yet, and return their paths.

    Raises
    ------
    Fault
        If a command fails.
    """
    for name in names:
        if not (place.files / name).exists():
            ended = place.run(INPUTS[name])
            if ended.status != 0:
                raise Fault(f"{name} cannot be made: {ended.errors}")
    return [place.files / name for name in names]


def crash(
    scenarios: Sequence[Scenario],
    kills: int,
    seed: int,
    folder: Path,
    *,
    cache: Path | None = None,
    only_round: int | None = None,
    on_round: Callable[[Tally], object] = lambda _tally: None,
) -> list[Tally]:
    """Kill commands again and again, and return what was found.

    Parameters
    ----------
    scenarios
        The commands; those whose programs are missing are left out.
    kills
        How often to kill, over all of them.
    seed
        Where the plan of every round follows from.
    folder
        An empty folder to work in.
    cache
        The cache of the commands; the present user's own unless given.
    only_round
        The number of the only round to make.
    on_round
        Called after each round with the figures of its scenario so far.
    """
    tallies = []
    scenarios = [scenario for scenario in scenarios if scenario.is_possible()]
    source = Place(folder / "inputs", cache=cache)
    for place, scenario in enumerate(scenarios):
        share = kills * (place + 1) // len(scenarios) - kills * place // len(scenarios)
        numbers = range(2 * share) if only_round is None else [only_round]
        tallies.append(tally := Tally(scenario))
        where = folder / scenario.name
        try:
            inputs = make_inputs(scenario.inputs, source)
            for _ in rounds(tally, share, seed, where, inputs, cache, numbers):
                on_round(tally)
        except Fault as fault:  # undisturbed
            tally.faults.append(str(fault))
            on_round(tally)
    return tallies


# ------------------------------------------------------------------------------ the report

HEAD = ("command", "kills", "after its first write", "completions", "faults")


def figures(
    tallies: Sequence[Tally], seed: int, before: Sequence[Sequence[Any]] = ()
) -> dict[str, Any]:
    """Return what was found in the form of a section of docs/results/reliability.json.

    Parameters
    ----------
    tallies
        What was found.
    seed
        Where the plan of every round follows from.
    before
        Rows found before: those of scenarios that are not among the tallies are kept.
    """
    from upright import __version__

    rows: list[list[Any]] = [
        [
            f"`{t.scenario.command.split()[0]}` ({t.scenario.name})",
            *(t.kills, t.writing, t.completions, len(t.faults)),
        ]
        for t in tallies
    ]
    names = {row[0] for row in rows}
    rows = [*(list(row) for row in before if row[0] not in names), *rows]
    total = [sum(row[column] for row in rows) for column in range(1, len(HEAD))]
    return {
        "command": f"python tools/crash.py --kills {total[0]} --seed {seed}",
        "version": __version__,
        "head": HEAD,
        "rows": [*rows, ["all", *total]],
    }


def show(tallies: Sequence[Tally], seed: int) -> None:
    """Print the figures as a table, and a line for each fault."""
    found = figures(tallies, seed)
    for first, *cells in [found["head"], *found["rows"]]:
        widths = (len(head) + 2 for head in HEAD[1:])
        print(f"{first:34}", *(f"{cell:>{w}}" for cell, w in zip(cells, widths, strict=True)))
    for tally in tallies:
        for fault in tally.faults:
            print(f"{tally.scenario.name}: {fault}")


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of this program's options."""
    names = [scenario.name for scenario in SCENARIOS]
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=1000, metavar="N", help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="default: %(default)s")
    parser.add_argument(
        "--scenario",
        action="append",
        choices=names,
        metavar="NAME",
        help=f"only this one; may be repeated: {', '.join(names)}",
    )
    parser.add_argument("--round", type=int, metavar="K", help="make only this round")
    parser.add_argument(
        "--record",
        type=Path,
        metavar="FILE",
        help="write the figures into this file of records; those of other scenarios stay",
    )
    return parser


def main() -> int:
    """Kill, report, and return 1 if something is wrong."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    options = make_parser().parse_args()
    chosen = [each for each in SCENARIOS if each.name in (options.scenario or [each.name])]
    folder = Path(tempfile.mkdtemp(prefix="upright-crash-"))
    tallies: dict[str, Tally] = {}

    def tell(tally: Tally) -> None:
        name = tally.scenario.name
        tallies[name] = tally
        faults = f", {len(tally.faults)} FAULTS" if tally.faults else ""
        print(f"{name}: {tally.kills} kills{faults}", file=sys.stderr, flush=True)

    try:
        crash(
            chosen,
            options.kills,
            options.seed,
            folder,
            cache=folder / "cache",
            only_round=options.round,
            on_round=tell,
        )
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        status = 130
    else:
        status = int(any(tally.faults for tally in tallies.values()))
    if options.record:
        before = reliability.rows("crash", options.record)
        found = figures([*tallies.values()], options.seed, before)
        reliability.put("crash", found, options.record)
    show([*tallies.values()], options.seed)
    if not any(tally.faults for tally in tallies.values()):
        shutil.rmtree(folder)
    return status


if __name__ == "__main__":
    sys.exit(main())
