"""How far a study is, and what the rest of it will take, in words."""

from collections.abc import Sequence

from upright.plants import PLANTS
from upright.reports.sweeps import heading, sizes, swept
from upright.reports.tables import Column, lines_of, number, seen
from upright.studies.case import Case, name_settings
from upright.studies.estimate import Estimate, Probe, Standing, estimate
from upright.support import terminal
from upright.support.words import count

PARTS = ("start", "condition", "steps", "trials")
"""Parts of tasks that have a column where they differ, besides noise and parameters."""
UNITS = ((86400.0, "d"), (3600.0, "h"), (60.0, "min"), (1.0, "s"))
"""Units of time, each with its seconds."""


def time_text(seconds: float) -> str:
    """Return a time, to two digits, in a unit that suits it.

    Examples
    --------
    >>> [time_text(seconds) for seconds in (0.0, 0.26, 5.2, 100, 90_000)]
    ['0 s', '0.3 s', '5.2 s', '1.7 min', '1 d']
    """
    size, unit = next((unit for unit in UNITS if seconds >= unit[0]), UNITS[-1])
    return f"{_short(seconds / size)} {unit}"


def size_text(size: float) -> str:
    """Return a number of bytes, to two digits, in a unit that suits it.

    Examples
    --------
    >>> [size_text(size) for size in (999, 5_210, 3e9)]
    ['1 kB', '5.2 kB', '3 GB']
    """
    unit = next((unit for unit in ((1e9, "GB"), (1e6, "MB")) if size >= unit[0]), (1e3, "kB"))
    return f"{_short(size / unit[0])} {unit[1]}"


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{round(value, 1):g}"


def plan_text(found: Probe, runs: int, store: str) -> str:
    """Return how many runs a study has, is to make, and what they will take.

    Parameters
    ----------
    found
        How far each of its cases is, with what was tried out.
    runs
        Number of runs of each case.
    store
        Path of its store.
    """
    several = found.several
    whole, finished = len(several) * runs, sum(each.finished for each in several)
    wanted = sum(len(each.wanted) for each in several)
    part = f"; this part: {wanted:,}" if wanted < whole else ""
    lines = [
        f"study: {count(len(several), 'case')} of {count(runs, 'run')} each: {whole:,}{part}",
        f"store: {terminal.visible(store)}, which has {finished:,} of them",
        f"to do: {count(wanted - finished, 'run')}",
    ]
    if finished < wanted:
        expected = estimate(several, is_least=found.is_least)
        lines += [
            f"time: {_time_text(expected, several)}",
            f"disk: {'unknown' if expected is None else f'about {size_text(expected.bytes)}'}",
            f"from: {_sources(found)}",
        ]
    return "\n".join(lines) + "\n"


def _time_text(expected: Estimate | None, several: Sequence[Standing]) -> str:
    if expected is None:
        plants = sorted({each.case.plant.name for each in several})
        return f"unknown, until a run on {' or '.join(plants)} is finished"
    if expected.is_least:
        return f"more than {time_text(expected.seconds)}: some runs take too long to be tried now"
    if expected.high < 1.0:
        return "less than 1 s"
    low, high = time_text(expected.low), time_text(expected.high)
    return f"about {time_text(expected.seconds)} ({low} to {high}), {expected.workers} runs at once"


def _sources(found: Probe) -> str:
    """Return where an estimate comes from."""
    stored = [each.known for each in found.several if each.known]
    others = sum(not each.seconds for each in found.several)
    parts = []
    if stored:
        parts.append(f"{count(sum(stored), 'run')} of {count(len(stored), 'case')} in the store")
    if found.tried:
        cases = count(len(found.tried), "case")
        parts.append(f"{count(sum(found.tried.values()), 'run')} of {cases}, made now and not kept")
    if others and parts:
        parts.append(f"the mean of these for {count(others, 'other case')}")
    return "; ".join(parts) or "nothing"


def status_text(several: Sequence[Standing], store: str) -> str:
    """Return a table of how far each case of a study is, and what came out of it so far.

    Parameters
    ----------
    several
        How far each of its cases is.
    store
        Path of its store.
    """
    figures = [
        Column("Runs", [f"{each.finished:,}/{len(each.wanted):,}" for each in several]),
        Column("Success", [_success(each) for each in several]),
        Column("Mean trials", [number(each.mean_trials) for each in several]),
        Column("Time left", [_time_left([each]) for each in several]),
    ]
    finished, wanted = sum(e.finished for e in several), sum(len(e.wanted) for e in several)
    place = terminal.visible(store)
    verb = "is" if wanted == 1 else "are"
    total = f"{finished:,} of {count(wanted, 'run')} {verb} finished in {place}; "
    left = f"time left: {_time_left(several)}" if finished < wanted else "nothing is left to do"
    lines = lines_of(seen(_labels([each.case for each in several])), figures, terminal.width())
    return "\n".join([*lines, "", f"{total}{left}."]) + "\n"


def _success(each: Standing) -> str:
    return f"{100 * each.successes / each.known:.0f} %" if each.known else "–"


def _time_left(several: Sequence[Standing]) -> str:
    if not any(each.missing for each in several):
        return "–"
    expected = estimate(several)
    return "unknown" if expected is None else time_text(expected.seconds)


def _labels(cases: Sequence[Case]) -> list[Column]:
    """Return columns of names that tell cases apart: the agent, and what else they differ in."""
    tasks = [case.spec for case in cases]
    plants = [
        name_settings("default", PLANTS.default(case.plant.name), case.plant) for case in cases
    ]
    columns = [
        Column("Settings", [case.settings_name for case in cases]),
        Column("Plant settings", plants),
        *(
            Column(part.capitalize(), [str(getattr(task, part)) for task in tasks])
            for part in PARTS
        ),
        Column("Noise", [task.noise for task in tasks], stays=True),
        *(
            Column(heading(name), [f"{sizes(task)[name]:.12g}" for task in tasks], stays=True)
            for name in swept(tasks)
        ),
    ]
    agent = Column("Agent", [case.name for case in cases])
    *others, last = [agent, *(column for column in columns if len(set(column.cells)) > 1)]
    return [*others, last._replace(stays=True)]
