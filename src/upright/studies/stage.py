"""Shows a run in a window as it goes on in another thread."""

import math
import time

import numpy as np

from upright.core.parameters import Parameters, State
from upright.pictures.picture import picture
from upright.pictures.scene import Scene
from upright.pictures.size import SIZE, Size
from upright.pictures.window import HINT, Window
from upright.studies.observing import Moment, scene_of
from upright.studies.pace import Pace

PERIOD = 0.02
"""Time from one picture to the next [s]."""
SHARE = 0.15
"""Largest share of the time that drawing takes from a run that goes as fast as possible."""
REST = 0.5
"""Simulated time for which a trial's end is shown before the next one begins [s]."""
LINGER = 1.5
"""Time for which the window stays open after the run [s]."""


class Stage:
    """Shows the latest moment of a run in a window, and lets its keys set the pace.

    It is called by the run, as its observer; its other methods by the main thread.

    Parameters
    ----------
    who
        Name of the agent.
    about
        More for the title of the window, such as the noise.
    stop
        Shape (1,), bool; once it is set, the run stops at its next step.
    size
        Size of the window, which its user may change.
    chart
        Whether to show the lengths of the trials so far.

    Raises
    ------
    UprightError
        If pygame-ce is missing, or there is no display.
    """

    def __init__(
        self, who: str, about: str, stop: np.ndarray, size: Size = SIZE, *, chart: bool
    ) -> None:
        self._who, self._chart = who, chart
        self.pace = Pace(stop)
        self._window = Window(f"{who}, {about}", 0, size, resizable=True)
        self._latest: Moment | None = None
        self._drawn: Moment | None = None
        self._drawn_as: tuple[Size, str] | None = None
        self._due = 0.0
        waiting = Scene(State(0.0, 0.0, 0.0, 0.0), caption=who, detail="getting ready", hint=HINT)
        self._window.draw(picture(Parameters(), waiting, size))

    def __call__(self, moment: Moment) -> None:
        """Take note of a moment, and wait until the next one may come."""
        self._latest = moment
        self.pace.wait(REST if moment.ending else moment.task.parameters.time_step)

    @property
    def is_open(self) -> bool:
        """Whether the window is open."""
        return self._window.is_open

    def update(self) -> None:
        """Obey the keys, and draw the latest moment if that is due and it is not yet shown.

        A run whose window is closed goes on as fast as possible.
        """
        for command in self._window.commands():
            self.pace.obey(command)
        if not self._window.is_open:
            self.pace.let_go()
            return
        moment, size, speed = self._latest, self._window.size, str(self.pace)
        is_drawn = moment is self._drawn and self._drawn_as == (size, speed)
        now = time.perf_counter()
        if moment is None or is_drawn or now < self._due:
            return
        worked = time.thread_time()
        scene = scene_of(moment, self._who, chart=self._chart)._replace(note=speed, hint=HINT)
        self._window.draw(picture(moment.task.parameters, scene, size))
        self._drawn, self._drawn_as = moment, (size, speed)
        worked = time.thread_time() - worked
        self._due = now + max(PERIOD, worked / SHARE if self.pace.speed == math.inf else 0.0)

    def linger(self) -> None:
        """Show how the run ended for a while, unless the window is closed."""
        until = time.perf_counter() + LINGER
        while self.is_open and time.perf_counter() < until:
            self._due = 0.0
            self.update()
            time.sleep(PERIOD)

    def __enter__(self) -> "Stage":
        return self

    def __exit__(self, *_error: object) -> None:
        """Close the window."""
        self._window.close()
