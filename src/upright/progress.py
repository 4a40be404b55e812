"""Showing how far a study is."""

from collections.abc import Iterable
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from upright.store import Result, Store
from upright.study import Case, study


class StudyProgress:
    """A bar on the standard error stream with the rate and the time left."""

    def __init__(self, total: int) -> None:
        self._steps = 0
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("runs"),
            TextColumn("{task.fields[rate]}"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        self._task = self._bar.add_task("compiling", total=total, rate="")

    def __enter__(self) -> "StudyProgress":
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def __call__(self, case: Case, result: Result) -> None:
        """Count a run that ended."""
        self._steps += int(result.lengths.sum())
        elapsed = self._bar.tasks[0].elapsed or 1e-9
        self._bar.update(
            self._task,
            advance=1,
            description=f"{case.agent}, {case.noise}",
            rate=f"{self._steps / elapsed / 1e6:.1f} M steps/s",
        )


def study_with_progress(cases: Iterable[Case], runs: int, seed: int, store: Store) -> None:
    """Make a study, as `study.study`, and show how far it is."""
    cases = list(cases)
    done = sum(len(store.results(case.key, seed, runs)) for case in cases)
    with StudyProgress(runs * len(cases) - done) as progress:
        study(cases, runs, seed, store, progress)
