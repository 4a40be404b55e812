"""A window that shows pictures in real time."""

import os
import sys
from types import ModuleType

import numpy as np

from upright.errors import UprightError
from upright.pictures.picture import HEIGHT, WIDTH, _pygame


class Window:
    """A window that shows pictures at a fixed rate.

    Parameters
    ----------
    title
        Title of the window.
    frames_per_second
        Highest number of pictures shown per second.

    Raises
    ------
    UprightError
        If pygame-ce is missing, or there is no display.
    """

    is_open: bool
    """Whether the window is open; closing it, Esc and q end that."""

    def __init__(self, title: str, frames_per_second: float) -> None:
        self._pygame = pygame = _pygame()
        try:
            _find_display(pygame)
            self._window = pygame.Window(title, (WIDTH, HEIGHT))
        except pygame.error as error:
            raise UprightError(
                f"a window cannot be opened: {error}; a video can be written without a display"
            ) from None
        self._clock, self._rate = pygame.time.Clock(), frames_per_second
        pygame.event.clear()  # such as the closing of an earlier window
        self.is_open = True

    def show(self, pixels: np.ndarray) -> None:
        """Wait until the next picture is due and show it, unless the window is closed."""
        if self._is_dismissed():
            self.close()
        if self.is_open:
            surface = self._pygame.image.frombuffer(pixels.tobytes(), (WIDTH, HEIGHT), "RGB")
            self._clock.tick(self._rate)
            self._window.get_surface().blit(surface, (0, 0))
            self._window.flip()

    def _is_dismissed(self) -> bool:
        """Whether the user closed the window or pressed Esc or q."""
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
    """Initialise the display, or fail; without a display SDL would silently draw off screen."""
    chosen = os.environ.get("SDL_VIDEODRIVER")
    named = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform == "linux" and not named and not chosen:
        raise pygame.error("there is no display")
    pygame.display.init()
    if pygame.display.get_driver() == "offscreen" and not chosen:
        raise pygame.error(f"there is no display {named!r}")
