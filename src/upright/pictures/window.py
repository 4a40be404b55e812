"""A window that shows pictures as fast as they would happen."""

import os
import sys
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from upright.errors import UprightError
from upright.pictures.picture import HEIGHT, WIDTH, _pygame

if TYPE_CHECKING:
    pass


class Window:
    """A window that shows pictures, at its own pace.

    Parameters
    ----------
    title
        What stands above it.
    frames_per_second
        How many pictures are shown a second; less if they come later.

    Raises
    ------
    UprightError
        If pygame-ce is missing, or there is no display.
    """

    is_open: bool
    """Whether the window can be seen: until it is closed, or Esc or q pressed."""

    def __init__(self, title: str, frames_per_second: float) -> None:
        self._pygame = pygame = _pygame()
        try:
            _find_display(pygame)
            self._window = pygame.Window(title, (WIDTH, HEIGHT))
        except pygame.error as error:
            why = f"a window cannot be opened: {error}"
            raise UprightError(f"{why}; a video can be written without one") from None
        self._clock, self._rate = pygame.time.Clock(), frames_per_second
        pygame.event.clear()  # the closing of an earlier window, say
        self.is_open = True

    def show(self, pixels: np.ndarray) -> None:
        """Show a picture as `picture` returns it, once it is time. A closed window shows none."""
        if self._is_left():
            self.close()
        if self.is_open:
            surface = self._pygame.image.frombuffer(pixels.tobytes(), (WIDTH, HEIGHT), "RGB")
            self._clock.tick(self._rate)
            self._window.get_surface().blit(surface, (0, 0))
            self._window.flip()

    def _is_left(self) -> bool:
        """Whether the user closed the window, or pressed a key that does."""
        pygame = self._pygame
        return any(
            event.type in (pygame.QUIT, pygame.WINDOWCLOSE)
            or (event.type == pygame.KEYDOWN and event.key in (pygame.K_ESCAPE, pygame.K_q))
            for event in (pygame.event.get() if self.is_open else ())
        )

    def close(self) -> None:
        """Close the window, if it is open."""
        if self.is_open:
            self.is_open = False
            self._window.destroy()


def _find_display(pygame: ModuleType) -> None:
    """Get ready for windows, or fail: without a display SDL would draw nowhere, and not tell."""
    chosen = os.environ.get("SDL_VIDEODRIVER")
    named = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform == "linux" and not named and not chosen:
        raise pygame.error("there is no display")
    pygame.display.init()
    if pygame.display.get_driver() == "offscreen" and not chosen:
        raise pygame.error(f"there is no display {named!r}")
