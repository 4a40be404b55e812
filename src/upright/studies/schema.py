"""The forms that stores have had, how each is recognised and read, and how it becomes the present.

A file is a store only if it holds the tables of a form, word for word, and nothing besides: what
else could be in a database, such as a view, is never executed.
"""

import reprlib
import sqlite3
from collections.abc import Iterable
from functools import cache
from typing import Any, NamedTuple

from upright.studies.database import Database
from upright.studies.stored_run import COMPUTED, StoredRun, key_checksum


class Form(NamedTuple):
    """A form that stores have, or had."""

    mark: int
    """The application id of the database."""
    version: int
    """The schema version of the database."""
    tables: str
    """The statements that create its tables."""
    runs: str
    """What stands for the table of runs, with the present columns, in queries."""
    environments: str
    """What stands for the table of environments."""


CASES = """
CREATE TABLE cases (
    id INTEGER PRIMARY KEY,
    key TEXT NOT NULL UNIQUE
);
"""
RUNS_1 = """
CREATE TABLE runs (
    case_id INTEGER NOT NULL REFERENCES cases (id),
    seed INTEGER NOT NULL,
    run INTEGER NOT NULL,
    success INTEGER NOT NULL,
    lengths BLOB NOT NULL,
    seconds REAL NOT NULL,
    ended TEXT NOT NULL DEFAULT (datetime('now')),
    PRIMARY KEY (case_id, seed, run)
) WITHOUT ROWID;
"""
RUNS_2 = RUNS_1.replace("    PRIMARY", "    version TEXT,\n    PRIMARY")
PRESENT = f"""\
{CASES.lstrip()}
CREATE TABLE environments (
    id INTEGER PRIMARY KEY,
    description TEXT NOT NULL UNIQUE
);

CREATE TABLE runs (
    case_id INTEGER NOT NULL REFERENCES cases (id),
    seed INTEGER NOT NULL,
    run INTEGER NOT NULL,
    success INTEGER NOT NULL,
    trials INTEGER NOT NULL,
    steps INTEGER NOT NULL,
    longest INTEGER NOT NULL,
    seconds REAL NOT NULL,
    ended TEXT NOT NULL,
    version TEXT,
    environment INTEGER REFERENCES environments (id),
    lengths_checksum INTEGER NOT NULL,
    checksum INTEGER NOT NULL,
    lengths BLOB NOT NULL,
    PRIMARY KEY (case_id, seed, run)
) WITHOUT ROWID;
"""
"""The present tables. The lengths come last, so that the others are read without them."""
COLUMNS = ("case_id", *StoredRun._fields, "lengths")


def _runs_of(version: str) -> str:
    """Return a query which gives the runs of an old form the present columns."""
    made = {name: f"{name}(lengths)" for name in COMPUTED}
    made |= {"version": version, "environment": "NULL", "checksum": "NULL"}
    return (
        f"(SELECT {', '.join(f'{made.get(name, name)} AS {name}' for name in COLUMNS)} FROM runs)"
    )


NO_ENVIRONMENTS = "(SELECT NULL AS id, NULL AS description)"
OLD_MARK, MARK = 0x55505254, 0x55505253
"""Mark a database as a store: "UPRT", and "UPRS" since form 3. Versions that only know the former
would write rows that lack columns."""
FORMS = {
    1: Form(OLD_MARK, 0, CASES + RUNS_1, _runs_of("NULL"), NO_ENVIRONMENTS),  # versions 0.1 and 0.2
    2: Form(OLD_MARK, 0, CASES + RUNS_2, _runs_of("version"), NO_ENVIRONMENTS),
    3: Form(MARK, 3, PRESENT, "runs", "environments"),
}
"""Every form by its number."""
NEWEST = max(FORMS)
"""The present form, which is the one that is written."""


def form_of(database: Database) -> Form | None:
    """Return the form of a store; None if the database is empty, so that it can become a store.

    Raises
    ------
    UprightError
        If it is the database of another program, or of a newer version of this package.
    """
    found = database.rows(  # in one query: another process may be changing its form
        "SELECT application_id, user_version, type, name, sql "
        "FROM pragma_application_id, pragma_user_version LEFT JOIN sqlite_master LIMIT 20"
    )
    mark, version = found[0][:2]
    tables = [row[2:] for row in found if row[2]]
    if mark in (0, OLD_MARK) and not tables:
        return None
    if mark not in (OLD_MARK, MARK):
        raise database.fault("it is a database of another program")
    if version > NEWEST:
        raise database.fault("it was written by a newer version of Upright, which can read it")
    for form in FORMS.values():
        if (form.mark, form.version) == (mark, version) and _listed(tables) == _made(form.tables):
            for name, function in COMPUTED.items() if form.version < NEWEST else ():
                database.define(name, function)
            return form
    raise database.fault("it is damaged: its tables are not those of a store")


def prepare(database: Database) -> None:
    """Make a database a store of the present form, which takes over the runs of an old form.

    Either all is done, or the file stays as it is.

    Raises
    ------
    UprightError
        If it is not a store, or cannot be written.
    """
    form_of(database)  # before anything is written
    database.write_ahead()
    with database.transaction():
        form = form_of(database)  # another process may have prepared it
        if form == FORMS[NEWEST]:
            return
        if form:
            for table in ("cases", "runs"):
                database.run(f"ALTER TABLE {table} RENAME TO old_{table}")
        for statement in PRESENT.split(";"):
            database.run(statement)
        if form:
            _take_over(database, form)
        database.run(f"PRAGMA application_id = {MARK}")
        database.run(f"PRAGMA user_version = {NEWEST}")


def _take_over(database: Database, form: Form) -> None:
    """Write all runs of an old form into the present tables, and remove the old ones."""
    database.run("INSERT INTO cases SELECT id, key FROM old_cases")
    query = f"SELECT {', '.join(COLUMNS)} FROM {form.runs}".replace("FROM runs", "FROM old_runs")
    keys = {case: key_checksum(key) for case, key in database.each("SELECT id, key FROM cases")}
    for case, *values, lengths in database.each(query):
        row = StoredRun._make(values)
        if not row.is_sound(keys.get(case, -1)):
            run, seed = map(reprlib.repr, (row.run, row.seed))
            raise database.fault(f"it is damaged in run {run} of seed {seed}, and is left as it is")
        _insert(database, case, row._replace(checksum=row.checksum_under(keys[case])), lengths)
    for table in ("runs", "cases"):
        database.run(f"DROP TABLE old_{table}")


def put(
    database: Database, key: str, row: StoredRun, lengths: bytes, environment: str | None
) -> None:
    """Write a run, unless the store has one of this key, seed and number.

    Parameters
    ----------
    database
        A store of the present form.
    key
        Key of the case.
    row, lengths
        The run; its environment and its checksum need not be right.
    environment
        Description of what it was made with; None if that is not known.
    """
    case = _number(database, "cases", "key", key, "(SELECT max(case_id) FROM runs)")
    known = environment and _number(database, "environments", "description", environment)
    row = row._replace(environment=known or None, checksum=row.checksum_under(key_checksum(key)))
    _insert(database, case, row, lengths)


def _number(database: Database, table: str, column: str, text: str, last: str = "0") -> int:
    """Return the number of a text in a table, which gets it if it does not have it.

    A new number is above that of the last use, whose text may be missing in a damaged file.
    """
    query = f"SELECT id FROM {table} WHERE {column} = ?"
    if not (found := database.rows(query, (text,))):
        database.run(
            f"INSERT INTO {table} (id, {column}) "
            f"SELECT 1 + max(coalesce(max(id), 0), coalesce({last}, 0)), ? FROM {table}",
            (text,),
        )
        found = database.rows(query, (text,))
    number: int = found[0][0]
    return number


def _insert(database: Database, case: int, row: StoredRun, lengths: bytes) -> None:
    marks = ", ".join("?" * len(COLUMNS))
    database.run(
        f"INSERT INTO runs ({', '.join(COLUMNS)}) VALUES ({marks}) ON CONFLICT DO NOTHING",
        (case, *row, lengths),
    )


def _listed(tables: Iterable[Any]) -> set[tuple[str, ...]]:
    """Return what a database holds, whatever the white space in its statements."""
    return {(kind, name, " ".join(str(sql).split())) for kind, name, sql in tables}


@cache
def _made(statements: str) -> set[tuple[str, ...]]:
    """Return what a database holds after these statements."""
    database = sqlite3.connect(":memory:")
    try:
        database.executescript(statements)
        return _listed(database.execute("SELECT type, name, sql FROM sqlite_master"))
    finally:
        database.close()
