"""Films a run as it learns, in at most a minute however long it takes.

The first trials are shown in real time; then the others fast forward; then the last, with the
success if there was one. Of a long trial the beginning and the end are shown in real time, and what
is between them fast forward. While the run goes on only moments are kept, and only as many as the
film may need; its pictures are drawn afterwards.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from upright.core.parameters import Parameters
from upright.core.task import Task
from upright.core.trials import Result
from upright.errors import Stopped
from upright.pictures.picture import picture
from upright.pictures.scene import Scene
from upright.pictures.size import SIZE, Size
from upright.pictures.video import check_video, write_video
from upright.studies.case import Case
from upright.studies.observing import Moment, check_observable, scene_of
from upright.studies.run import make_run
from upright.support.words import count

FRAME = 0.02
"""Time that a picture lasts, unless the plant's time step is longer [s]."""
FIRST = 3
"""Number of first trials that are shown in real time."""
BEGIN, JUMP, END = 5.0, 1.0, 4.0
"""Time for the beginning of a long trial, for what is between, and for its end [s]."""
MIDDLE = 10.0
"""Time for the trials between the first and the last [s]."""
HOLD, CLOSE = 0.5, 1.5
"""How much longer the last picture of a trial is shown, and that of the film [s]."""

T = TypeVar("T")


class Shot(NamedTuple):
    """What a picture of the film shows."""

    parameters: Parameters
    """The parameters that the plant then has."""
    scene: Scene
    lasts: int = 1
    """For how many pictures it is shown."""


class Film:
    """Keeps the moments of a run that a film of it needs; called by the run, as its observer."""

    def __init__(self) -> None:
        self._first: list[_Clip] = []
        self._middle: list[_Clip] = []
        self._every = 1  # of the middle trials, one in so many is kept
        self._present: _Clip | None = None

    def __call__(self, moment: Moment) -> None:
        """Take note of a moment."""
        if self._present is None or moment.trial != self._present.trial:
            self._put_away()
            self._present = _Clip(moment)
        else:
            self._present.add(moment)

    def _put_away(self) -> None:
        """Keep what may be shown of the trial that another one follows."""
        clip = self._present
        if clip is None:
            return
        if len(self._first) < FIRST:
            self._first.append(clip)
        elif (clip.trial - FIRST) % self._every == 0:
            clip.reduce()
            self._middle.append(clip)
            if len(self._middle) > pictures_in(MIDDLE, clip.task):
                self._every *= 2
                self._middle = [c for c in self._middle if (c.trial - FIRST) % self._every == 0]

    def shots(self, who: str) -> list[Shot]:
        """Return what the film shows.

        Parameters
        ----------
        who
            Name of the agent.
        """
        last = self._present
        if last is None:
            return []
        shown = [shot for clip in self._first for shot in clip.whole(who)]
        each = pictures_in(MIDDLE, last.task) // max(1, len(self._middle))
        note = f"fast forward: trials {FIRST + 1:,} to {last.trial - 1:,}"
        for clip in self._middle:
            shown += clip.glimpse(who, each, note)
        shown += last.whole(who)
        return [*shown, shown[-1]._replace(lasts=pictures_in(CLOSE - HOLD, last.task))]

    @property
    def task(self) -> Task:
        """The task of the run."""
        assert self._present is not None, "a run has begun"
        return self._present.task

    def write(
        self,
        path: Path | str,
        who: str,
        size: Size = SIZE,
        *,
        stop: np.ndarray | None = None,
        on_picture: Callable[[int, int], None] | None = None,
    ) -> None:
        """Draw the film and write it.

        Parameters
        ----------
        path
            Path of the video, .mp4 or .gif.
        who
            Name of the agent.
        size
            Size of the pictures.
        stop
            Shape (1,), bool. Once it is set, nothing is written and `Stopped` is raised.
        on_picture
            Called with the number of pictures drawn, and with that of all.

        Raises
        ------
        UprightError
            If the video cannot be written.
        """
        shots = self.shots(who)

        def frames() -> Iterator[np.ndarray]:
            total, done = sum(shot.lasts for shot in shots), 0
            for parameters, scene, lasts in shots:
                if stop is not None and stop[0]:
                    raise Stopped
                pixels = picture(parameters, scene, size)
                yield from repeat(pixels, lasts)
                done += lasts
                if on_picture:
                    on_picture(done, total)

        write_video(path, frames(), 1 / picture_time(self.task), size)


class _Clip:
    """What is kept of a trial.

    Parameters
    ----------
    start
        Its start.
    """

    def __init__(self, start: Moment) -> None:
        self.task, self.trial = start.task, start.trial
        self._stride = stride(start.task)
        self._most = pictures_in(BEGIN, start.task)
        self._begin = [start]
        self._end: deque[Moment] = deque(maxlen=pictures_in(END, start.task))
        self._sample, self._every = [start], self._stride  # one moment in so many is kept
        self._last = start

    def add(self, moment: Moment) -> None:
        """Take note of the trial's next moment."""
        self._last = moment
        if moment.step % self._stride and not moment.ending:
            return
        if len(self._begin) < self._most:
            self._begin.append(moment)
        else:
            self._end.append(moment)
        if moment.step % self._every == 0:
            self._sample.append(moment)
            if len(self._sample) > 2 * pictures_in(JUMP, self.task):
                self._every *= 2
                self._sample = [m for m in self._sample if m.step % self._every == 0]

    def reduce(self) -> None:
        """Keep only what a glimpse needs."""
        self._begin.clear()
        self._end.clear()

    def whole(self, who: str) -> list[Shot]:
        """Return the shots of the trial."""
        begin, end = self._begin, list(self._end)
        gap = end[0].step - begin[-1].step if end else 0
        shown = [_shot(moment, who) for moment in begin]
        if gap > self._stride:
            inside = [m for m in self._sample if begin[-1].step < m.step < end[0].step]
            note = f"fast forward: {in_words(gap * self.task.parameters.time_step)}"
            for moment in _spread(inside, pictures_in(JUMP, self.task)):
                shown.append(_shot(moment, who, note))
        shown += [_shot(moment, who) for moment in end]
        return [*shown, shown[-1]._replace(lasts=pictures_in(HOLD, self.task))]

    def glimpse(self, who: str, most: int, note: str) -> Iterator[Shot]:
        """Yield at most so many shots of the trial, the last of which is its end."""
        sample = self._sample[:-1] if self._sample[-1] is self._last else self._sample
        for moment in _spread([*sample, self._last], most):
            yield _shot(moment, who, note)


def _shot(moment: Moment, who: str, note: str = "") -> Shot:
    return Shot(moment.task.parameters, scene_of(moment, who, chart=True)._replace(note=note))


def stride(task: Task) -> int:
    """Return how many steps a picture stands for in real time."""
    return max(1, round(FRAME / task.parameters.time_step))


def picture_time(task: Task) -> float:
    """Return the time that a picture lasts [s]."""
    return stride(task) * task.parameters.time_step


def pictures_in(seconds: float, task: Task) -> int:
    """Return how many pictures last so long, at least one."""
    return max(1, round(seconds / picture_time(task)))


def in_words(seconds: float) -> str:
    """Return a time as a person would say it."""
    if seconds >= 120:
        return count(round(seconds / 60), "minute")
    return count(round(seconds), "second")


def _spread(items: Sequence[T], most: int) -> list[T]:
    """Return at most so many of the items, evenly spread, with the last among them."""
    if len(items) <= most:
        return list(items)
    return [items[round((i + 1) * len(items) / most) - 1] for i in range(most)]


def check_film(path: Path | str, case: Case) -> None:
    """Check that a run of this case can be filmed, and the film written.

    Raises
    ------
    UprightError
        If it cannot.
    """
    check_observable(case)
    check_video(path)


def film_run(
    path: Path | str,
    case: Case,
    seed: int = 0,
    run: int = 0,
    *,
    size: Size = SIZE,
    stop: np.ndarray | None = None,
) -> tuple[Any, Result | None]:
    """Make a run as `make_run` does, and a video of it.

    Parameters
    ----------
    path
        Path of the video, .mp4 or .gif. It is complete or not written at all.
    case, seed, run, stop
        As for `make_run`.
    size
        Size of the pictures.

    Returns
    -------
    tuple
        The trained agent, and the result, which is None if the run was stopped.

    Raises
    ------
    UprightError
        As for `make_run`; if a library is missing, or the video cannot be written.
    """
    check_film(path, case)
    film = Film()
    agent, result = make_run(case, seed, run, stop=stop, observer=film)
    if result is not None:
        film.write(path, case.name, size, stop=stop)
    return agent, result
