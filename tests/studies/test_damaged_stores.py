"""Whatever a file holds, a store is read as it is, or refused in one line that names it.

Each mutant is a store with some bytes, values, texts or tables changed. `MUTANTS=10000 pytest
tests/studies/test_damaged_stores.py` makes more of them, `FIRST_MUTANT` others.
"""

import io
import json
import os
import random
import shutil
import signal
import sqlite3
import time
from contextlib import closing, contextmanager

import numpy as np
import pytest
from helpers import ROOT

import upright
from upright.core.trials import Result
from upright.errors import UprightError
from upright.reports.data_files import write_csv
from upright.reports.statistics import stored_rows
from upright.studies.merge import merge
from upright.studies.schema import MARK
from upright.studies.store import Store
from upright.studies.stored_run import StoredRun, checksum_of, key_checksum, measure
from upright.studies.verify import verify

MUTANTS, FIRST = (
    int(os.environ.get(name, n)) for name, n in (("MUTANTS", 200), ("FIRST_MUTANT", 0))
)
LONGEST = 60
"""More seconds than any use of a mutant takes, by far, on the slowest machine [s]."""
KEY = '{"agent": "added"}'
"""Key of a run that is added to a mutant."""
ODD = [
    *(
        None,
        "",
        "text",
        "\x1b[31m",
        "\udc80".encode("utf-8", "surrogatepass"),
        b"",
        b"\xff",
        b"\0" * 7,
    ),
    *(0, 1, -1, 2**31, 2**32 - 4, 2**63 - 1, -(2**63), 0.5, -0.0, 1e308, float("inf"), "9" * 10**5),
    *(
        "2026-01-31 12:00:00+05:00",
        "0001-01-01 00:00:00",
        "[" * 10**5,
        b"\xff" * 4000,
        b"\0" * 10**6,
    ),
]
"""Values for columns."""
ODD_JSON = [
    None,
    True,
    "",
    "os:system",
    "\x1b]0;",
    0,
    -1,
    1.5,
    1e308,
    10**40,
    [],
    [[]],
    {},
    {"a": 1},
]
"""Values for what is in a key."""
ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT"
RUNS_OF_AN_ENDLESS_VIEW = ", ".join(
    f"i AS {name}" for name in ("case_id", *StoredRun._fields, "lengths")
)
SCHEMAS = [
    f"DROP TABLE runs; CREATE VIEW runs AS {ENDLESS} {RUNS_OF_AN_ENDLESS_VIEW} FROM n",
    f"DROP TABLE cases; CREATE VIEW cases AS {ENDLESS} i AS id, 'k' AS key FROM n",
    "CREATE TRIGGER t AFTER INSERT ON runs BEGIN DELETE FROM runs; END",
    "CREATE TABLE more (a)",
    "CREATE INDEX more ON runs (seed)",
    "CREATE VIRTUAL TABLE more USING fts5(a)",
    "ALTER TABLE runs ADD COLUMN more TEXT",
    "ALTER TABLE cases ADD COLUMN more BLOB AS (zeroblob(1000000000))",
    "ALTER TABLE runs RENAME COLUMN run TO number",
    "ALTER TABLE runs RENAME TO others",
    "DROP TABLE runs",
    "DROP TABLE cases",
    "DELETE FROM cases",
    "DELETE FROM runs",
    "UPDATE runs SET lengths = zeroblob(100000000) WHERE run = 0",
    "UPDATE cases SET key = printf('%.100000000c', '[') WHERE id = 1",
    *(f"PRAGMA user_version = {number}" for number in (-1, 0, 1, 2, 4, 10**9)),
    *(f"PRAGMA application_id = {number}" for number in (-1, 0, 1, MARK, MARK + 1)),
    "PRAGMA journal_mode = DELETE",
    "PRAGMA auto_vacuum = 1; VACUUM",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = replace(sql, 'INTEGER', 'INT')",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET rootpage = 2",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET type = '\x1b[31m'",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET name = char(27) || name",
]


@pytest.fixture(scope="module")
def bases(tmp_path_factory):
    """Stores of each form, and one that a killed process has left with its log."""
    folder = tmp_path_factory.mktemp("bases")
    cases = [
        upright.make_case("random-search", steps=300, noise=noise) for noise in ("none", "sensor-5")
    ]
    cases.append(upright.make_case("q-learning", plant="equations", steps=9, trials=5))
    cases.append(upright.make_case("reinforce", parameters={"force": 9.5}, condition="delay-1"))
    present, killed = folder / "present.sqlite", folder / "killed.sqlite"
    numbers = np.random.default_rng(0)
    with Store(present) as store:
        for case in cases:
            for run in range(12):
                lengths = numbers.integers(1, 300, 1 + run**2 * 4)
                store.add(case.key, run % 2, Result(run, run % 3 == 0, lengths, 0.1))
            if case is cases[1]:
                shutil.copy(present, killed)
                shutil.copy(f"{present}-wal", f"{killed}-wal")
    old = [ROOT / "tests/data/stores/0.2.0.sqlite", ROOT / "tests/data/stores/unreleased.sqlite"]
    return [present, present, present, killed, *old]


def mutate_bytes(path, draw):
    """Change some bytes, in a way that disks and programs do."""
    data = bytearray(path.read_bytes())
    start = draw.choice([0, 0, draw.randrange(len(data)), draw.randrange(len(data))])
    size = min(draw.choice([1, 1, 2, 8, 100, 4096]), len(data) - start)
    kind = draw.randrange(8)
    if kind == 0:
        del data[start:]
    elif kind == 1:
        data[start : start + size] = bytes(size)
    elif kind == 2:
        data[start : start + size] = draw.randbytes(size)
    elif kind == 3:
        data += draw.randbytes(size)
    elif kind == 4:  # a page in the place of another
        pages = len(data) // 4096
        one, other = (4096 * draw.randrange(max(1, pages)) for _ in range(2))
        data[one : one + 4096] = data[other : other + 4096]
    else:
        for _ in range(size % 50 + 1):
            place = draw.choice(
                [draw.randrange(100), *(draw.randrange(len(data)) for _ in range(3))]
            )
            if place < len(data):
                data[place] = (
                    data[place] ^ 1 << draw.randrange(8) if kind > 5 else draw.randrange(256)
                )
    path.write_bytes(data)


def connected(path):
    """Connect to a mutant; a query that would not end is an error."""
    database = sqlite3.connect(path, isolation_level=None)
    left = iter(range(2000))
    database.set_progress_handler(lambda: next(left, None) is None, 10**4)
    return database


def mutate_value(path, draw):
    """Put an odd value into a column of some rows; often, with checksums that are right again."""
    with closing(connected(path)) as database:
        database.create_function("old", 1, lambda _: draw.choice(ODD))
        tables = [
            name
            for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
        ]
        table = draw.choice(["runs", "runs", *tables])
        columns = [row[1] for row in database.execute(f"PRAGMA table_info({table})")]
        some = draw.choice(["1", "1", f"{columns[0]} % 2 = 0"])
        column = draw.choice(columns)
        database.execute(
            f"UPDATE OR IGNORE {table} SET {column} = ? WHERE {some}", (draw.choice(ODD),)
        )
        if draw.random() < 0.5:
            correct_checksums(database)


def correct_checksums(database):
    """Give rows the checksums that they would have if Upright had written them."""
    has_them = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND sql LIKE '%checksum%'"
    if database.execute(has_them).fetchone() == (0,):
        return
    keys = dict(database.execute("SELECT id, key FROM cases"))
    listed = ", ".join(StoredRun._fields)
    for case, lengths, *values in database.execute(
        f"SELECT case_id, lengths, {listed} FROM runs"
    ).fetchall():
        row = StoredRun._make(values)._replace(lengths_checksum=checksum_of(lengths))
        if random.Random(str(row.seed)).random() < 0.5:
            row = row._replace(
                **dict(zip(("trials", "steps", "longest"), measure(lengths), strict=True))
            )
        try:
            checksum = row.checksum_under(key_checksum(keys.get(case)))
        except Exception:
            continue
        database.execute(
            "UPDATE runs SET lengths_checksum = ?, checksum = ?, trials = ?, steps = ?, "
            "longest = ? WHERE case_id IS ? AND seed IS ? AND run IS ?",
            (
                row.lengths_checksum,
                checksum,
                row.trials,
                row.steps,
                row.longest,
                case,
                row.seed,
                row.run,
            ),
        )


def mutate_key(path, draw):
    """Change, add or remove something in the JSON of a case."""
    with closing(connected(path)) as database:
        number, key = draw.choice(database.execute("SELECT id, key FROM cases").fetchall())
        values = json.loads(key)
        inside = draw.choice(
            [values, *(each for each in values.values() if isinstance(each, dict))]
        )
        name = draw.choice([*inside, "more"])
        if draw.random() < 0.3:
            inside.pop(name, None)
        else:
            inside[name] = draw.choice(ODD_JSON)
        text = json.dumps(draw.choice([values, values, values, draw.choice(ODD_JSON)]))
        database.execute("UPDATE OR IGNORE cases SET key = ? WHERE id = ?", (text, number))
        correct_checksums(database)


def mutate_schema(path, draw):
    """Change the tables, or what stands in their place."""
    with closing(connected(path)) as database:
        database.executescript(draw.choice(SCHEMAS))


def mutate_log(path, draw):
    """Change the log, or the file below it."""
    log = path.with_name(f"{path.name}-wal")
    mutate_bytes(log if log.exists() else path, draw)


def make_mutant(number, bases, folder):
    """Return a mutant, and in words how it was made."""
    draw = random.Random(number)
    base = draw.choice(bases)
    path = folder / "mutant.sqlite"
    shutil.copy(base, path)
    if os.path.exists(f"{base}-wal"):
        shutil.copy(f"{base}-wal", f"{path}-wal")
    kinds = (mutate_bytes, mutate_value, mutate_key, mutate_schema, mutate_log)
    done = []
    for _ in range(draw.choice([1, 1, 1, 2])):
        kind = draw.choice(kinds)
        done.append(kind.__name__)
        try:
            kind(path, draw)
        except Exception:
            done.append("(in vain)")  # the first mutation was enough
    return path, f"mutant {number} of {base.name}: {', '.join(done)}"


def read_all(path):
    with Store(path, must_exist=True) as store:
        repr(store)
        for _, key, seed in store.cases():
            store.case(key)
            store.finished(key, seed)
            store.results(key, seed)
            store.outcomes(key, seed)
            store.version(key, seed)
        store.environments()


def write_both(path):
    for each in ("run", "trial"):
        with Store(path, must_exist=True) as store:
            write_csv(store, each, io.StringIO())


def frame(path):
    with Store(path, must_exist=True) as store:
        store.frame()


def add_a_run(path):
    with Store(path) as store:
        store.add(KEY, 0, Result(0, True, np.array([1]), 0.1))
        assert store.finished(KEY, 0) == {0}


USES = {
    "read": read_all,
    "rows": stored_rows,
    "data": write_both,
    "frame": frame,
    "verify": lambda path: verify(path, sample=0),
    "merge": lambda path: merge([path], path.with_name("merged.sqlite")),
    "add": add_a_run,
}
"""What is done with each mutant."""


@contextmanager
def ending():
    """Raise TimeoutError if the block does not end."""

    def stop(*_):
        raise TimeoutError

    usual = signal.signal(signal.SIGALRM, stop)
    signal.alarm(LONGEST)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, usual)


@pytest.mark.slow
def test_every_mutant_is_read_or_refused_in_one_line(bases, tmp_path):
    wrong, refused, slowest = [], 0, (0.0, "")
    for number in range(FIRST, FIRST + MUTANTS):
        folder = tmp_path / "mutant"
        folder.mkdir()
        path, how = make_mutant(number, bases, folder)
        for name, use in USES.items():
            began = time.monotonic()
            try:
                with ending():
                    use(path)
            except UprightError as error:
                refused += 1
                text = str(error)
                if "\n" in text or not text.isprintable() or path.name not in text:
                    wrong.append(f"{how}: {name}: {text!r}")
            except Exception as error:
                wrong.append(f"{how}: {name}: {type(error).__name__}: {error}")
            slowest = max(slowest, (time.monotonic() - began, f"{name} of {how}"))
        shutil.rmtree(folder)
    print(
        f"{MUTANTS} mutants, {refused} refusals, the slowest took {slowest[0]:.1f} s: {slowest[1]}"
    )
    assert wrong == []
    assert refused > MUTANTS


def test_a_message_of_sqlite_that_is_not_utf_8_is_shown(tmp_path):
    """SQLite quotes a damaged statement, and Python decodes its message."""
    path = tmp_path / "damaged.sqlite"
    with Store(path) as store:
        store.add(KEY, 0, Result(0, True, np.ones(3, np.int32), 1.0))
    data = path.read_bytes()
    path.write_bytes(data.replace(b"CREATE TABLE cases", b"CREATE TAB\xcaE cases"))
    with pytest.raises(UprightError, match=r'malformed .* near "TAB.E"'):
        Store(path)
