"""Progress bars for studies and searches."""

from collections.abc import Iterable
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from upright.core.trials import Result
from upright.studies.case import Case
from upright.studies.store import Store
from upright.studies.study import study
from upright.studies.tuning import BATCHES, Search, SearchProgress, SearchResult, search


def study_with_progress(cases: Iterable[Case], runs: int, seed: int, store: Store) -> None:
    """Run a study with `study.study`, showing a progress bar with its rate and the time left."""
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
        task = bar.add_task("starting", total=runs * len(cases) - done, rate="")
        steps = 0

        def show(case: Case, result: Result) -> None:
            nonlocal steps
            steps += int(result.lengths.sum())
            rate = steps / (bar.tasks[0].elapsed or 1e-9) / 1e6
            description = f"{case.name}, {case.spec.noise}"
            bar.update(task, advance=1, description=description, rate=f"{rate:.1f} M steps/s")

        study(cases, runs, seed, store, show)


def search_with_progress(plan: Search, candidates: int, path: Path | str) -> SearchResult:
    """Run `tuning.search`, showing a progress bar with the best so far and the time left."""
    columns = (
        TextColumn("candidate"),
        BarColumn(),
        TextColumn("{task.fields[place]}"),
        TextColumn("{task.fields[best]}"),
        TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    hidden = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as bar:
        task = bar.add_task("", total=candidates * BATCHES, place="", best="")

        def show(progress: SearchProgress) -> None:
            best = "" if progress.best is None else f"best {progress.best:.1f} trials"
            bar.update(
                task,
                completed=progress.finished * BATCHES + progress.batch,
                place=f"{min(progress.finished + 1, candidates)}/{candidates}",
                best=best,
            )

        return search(plan, candidates, path, show)
