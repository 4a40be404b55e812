"""Progress bars for studies and searches."""

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from upright.agents import is_custom
from upright.core.trials import Result
from upright.studies.case import Case
from upright.studies.executors import AnyExecutor, opened
from upright.studies.notebook_bar import in_notebook, notebook_bar
from upright.studies.store import Store
from upright.studies.study import WHOLE, count_finished, make_missing_runs, runs_of_part
from upright.studies.tuning import BATCHES, Search, SearchProgress, SearchResult, search
from upright.support.machine_code import lacking
from upright.support.terminal import end_notice, visible


def study_with_progress(
    cases: Iterable[Case],
    runs: int,
    seed: int,
    store: Store,
    executor: AnyExecutor = None,
    part: tuple[int, int] = WHOLE,
) -> None:
    """Make missing runs, showing a progress bar with its rate and the time left.

    Parameters and errors are those of `study.study`; the results are in the store.
    """
    cases = list(cases)
    numbers = runs_of_part(cases, runs, part)
    total = sum(len(n) - count_finished(case, n, seed, store) for case, n in numbers.items())
    kept = f"they are kept in {store.path}" if store.path else "they are lost without a store"
    ours = {case.agent for case in cases if not is_custom(case.agent)}
    starting = "compiling" if lacking(f"learn {agent}" for agent in ours) else "starting"
    steps, began = 0, time.monotonic()
    bar = notebook_bar(total, kept) if in_notebook() else _terminal_bar(total, starting)
    with bar as advance:

        def show(case: Case, result: Result) -> None:
            nonlocal steps
            steps += int(result.lengths.sum())
            rate = steps / (time.monotonic() - began or 1e-9) / 1e6
            advance(f"{case.name}, {case.spec.noise}", f"{rate:.1f} M steps/s")

        make_missing_runs(cases, runs, seed, store, show, executor, part)


@contextmanager
def _terminal_bar(total: int, starting: str) -> Iterator[Callable[[str, str], None]]:
    """Show a bar in the terminal; yield what is called after each run, as `notebook_bar` does."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("runs"),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    end_notice()
    console = Console(stderr=True)
    hidden = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as bar:
        task = bar.add_task(starting, total=total, rate="")

        def advance(name: str, speed: str) -> None:
            bar.update(task, advance=1, description=visible(name), rate=speed)

        yield advance


def search_with_progress(
    plan: Search, candidates: int, path: Path | str, executor: AnyExecutor = None
) -> SearchResult:
    """Run `tuning.search`, showing a progress bar with the best so far and the time left."""
    columns = (
        TextColumn("candidate"),
        BarColumn(),
        TextColumn("{task.fields[place]}"),
        TextColumn("{task.fields[best]}"),
        TimeRemainingColumn(),
    )
    end_notice()
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

        with opened(executor) as chosen:
            return search(plan, candidates, path, show, chosen)
