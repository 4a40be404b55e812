"""A window that shows pictures, and tells which keys were pressed."""

import os
import sys
from types import ModuleType
from typing import Any

import numpy as np

from upright.errors import UprightError
from upright.pictures.canvas import load_pygame
from upright.pictures.size import SIZE, Size

CHARACTERS = {"+": "faster", "=": "faster", "-": "slower", " ": "pause", "n": "step"}
"""What the keys ask for that have characters; + and = are one key on many keyboards."""
KEYS = {"K_UP": "faster", "K_DOWN": "slower", "K_SPACE": "pause", "K_RIGHT": "step"}
"""What other keys ask for, by their names in pygame."""
HINT = "− slower   + faster   space pause   → step   q close"
"""What the keys do, for the picture."""


class Window:
    """A window that shows pictures.

    Parameters
    ----------
    title
        Title of the window.
    frames_per_second
        Highest number of pictures shown per second; `show` waits accordingly. 0: no limit.
    size
        Size of the window.
    resizable
        Whether the user may change its size.

    Raises
    ------
    UprightError
        If pygame-ce is missing, or there is no display.
    """

    is_open: bool
    """Whether the window is open; closing it, Esc and q end that."""

    def __init__(
        self,
        title: str,
        frames_per_second: float,
        size: Size = SIZE,
        *,
        resizable: bool = False,
    ) -> None:
        self._pygame = pygame = load_pygame()
        try:
            _find_display(pygame)
            self._window = pygame.Window(title, tuple(size), resizable=resizable)
        except pygame.error as error:
            raise UprightError(
                f"a window cannot be opened: {error}; a video can be written without a display"
            ) from None
        self._clock, self._rate = pygame.time.Clock(), frames_per_second
        self._size, self._commands = size, {getattr(pygame, key): KEYS[key] for key in KEYS}
        pygame.event.clear()  # such as the closing of an earlier window
        self.is_open = True

    @property
    def size(self) -> Size:
        """The present size of the window; of one that was closed, the last."""
        if self.is_open:
            self._size = Size(*self._window.size)
        return self._size

    def commands(self) -> list[str]:
        """Return what keys have asked for since the last call: faster, slower, pause or step.

        If the user closed the window, or pressed Esc or q, it closes.
        """
        asked = []
        for event in self._pygame.event.get() if self.is_open else ():
            if self._dismisses(event):
                self.close()
                return []
            if event.type == self._pygame.KEYDOWN:
                character = CHARACTERS.get(getattr(event, "unicode", ""))
                asked.append(character or self._commands.get(event.key))
        return [command for command in asked if command]

    def show(self, pixels: np.ndarray) -> None:
        """Wait until the next picture is due and show it, unless the window is closed."""
        self.commands()
        self.draw(pixels)

    def draw(self, pixels: np.ndarray) -> None:
        """Do what `show` does, but leave the keys for `commands`."""
        if self.is_open:
            height, width, _ = pixels.shape
            surface = self._pygame.image.frombuffer(pixels, (width, height), "RGB")
            self._clock.tick(self._rate)
            self._window.get_surface().blit(surface, (0, 0))
            self._window.flip()

    def _dismisses(self, event: Any) -> bool:
        """Whether by this event the user closed the window or pressed Esc or q."""
        pygame = self._pygame
        return event.type in (pygame.QUIT, pygame.WINDOWCLOSE) or (
            event.type == pygame.KEYDOWN and event.key in (pygame.K_ESCAPE, pygame.K_q)
        )

    def close(self) -> None:
        """Close the window, if it is open."""
        if self.is_open:
            self.is_open = False
            self._window.destroy()


def _find_display(pygame: ModuleType) -> None:
    """Initialise the display, or fail; without a display SDL would silently draw off screen."""
    chosen = os.environ.get("SDL_VIDEODRIVER")
    named = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform == "linux" and not named and not chosen:
        raise pygame.error("there is no display")
    pygame.display.init()
    if pygame.display.get_driver() == "offscreen" and not chosen:
        raise pygame.error(f"there is no display {named!r}")
