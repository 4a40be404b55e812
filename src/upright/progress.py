"""Showing how far a study is."""

from collections.abc import Iterable

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from upright.store import Result, Store
from upright.study import Case, study


def study_with_progress(cases: Iterable[Case], runs: int, seed: int, store: Store) -> None:
    """Make a study, as `study.study`, with a bar that shows its rate and the time left."""
    cases = list(cases)
    done = sum(run < runs for case in cases for run in store.finished(case.key, seed))
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("runs"),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("compiling", total=runs * len(cases) - done, rate="")
        steps = 0

        def show(case: Case, result: Result) -> None:
            nonlocal steps
            steps += int(result.lengths.sum())
            rate = steps / (bar.tasks[0].elapsed or 1e-9) / 1e6
            described = f"{case.agent}, {case.noise}"
            bar.update(task, advance=1, description=described, rate=f"{rate:.1f} M steps/s")

        study(cases, runs, seed, store, show)
