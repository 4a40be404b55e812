"""A policy that balances in Gazebo's window, and a picture of it where there is no display."""

import os
import shutil
import struct
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from upright.errors import Stopped, UprightError
from upright.support.files import replacing
from upright.support.processes import end_process

SCREEN = "Xvfb_screen0"
"""The file in which Xvfb keeps what is on its screen, as an X window dump."""
SIZE = (1280, 720)
"""Of that screen [pixels]."""
WINDOW = 60.0
"""How long Gazebo's window may take to show something [s]."""
SETTLED = 2.0
"""How long after that the picture is taken [s]."""
COLOURFUL = 1_000
"""Pixels of bright colour that show that the cart-pole is drawn: the window's own are fewer."""


def photograph(play: Callable[[np.ndarray], None], path: Path | str) -> None:
    """Write a picture of Gazebo's window while the cart-pole moves in it, on a display of its own.

    Parameters
    ----------
    play
        Starts Gazebo with its window and moves the cart-pole, until it is done or its argument, an
        array of one bool, is set.
    path
        Where the picture is written.

    Raises
    ------
    UprightError
        If Xvfb is missing, or nothing is shown.
    """
    stop = np.zeros(1, np.bool_)
    with _screen() as screen, ThreadPoolExecutor(1) as thread:
        playing = thread.submit(play, stop)
        try:
            pixels = _wait_for_picture(screen, playing)
        finally:
            stop[0] = True
        with suppress(Stopped):
            playing.result()
    _write_picture(pixels, path)


def _wait_for_picture(screen: Path, playing: Future[Any]) -> np.ndarray:
    """Return what is on the screen once the cart-pole is there."""
    until = time.monotonic() + WINDOW
    while time.monotonic() < until and not playing.done():
        pixels = _read_dump(screen.read_bytes()).astype(np.int16)
        if (np.ptp(pixels, axis=2) > 80).sum() > COLOURFUL:
            time.sleep(SETTLED)
            return _read_dump(screen.read_bytes())
        time.sleep(0.2)
    if playing.done():
        playing.result()  # raises what went wrong
    raise UprightError("Gazebo's window showed nothing before the playing ended")


@contextmanager
def _screen() -> Iterator[Path]:
    """Provide a display without a screen; give the file that holds what would be on it."""
    program = shutil.which("Xvfb")
    if not program:
        raise UprightError("Xvfb is missing, the display without a screen; install package xvfb")
    with tempfile.TemporaryDirectory(prefix="upright-screen-") as folder:
        read, write = os.pipe()
        size = "x".join(map(str, (*SIZE, 24)))
        command = [program, "-displayfd", str(write), "-screen", "0", size, "-fbdir", folder]
        quiet = subprocess.DEVNULL
        server = subprocess.Popen(command, pass_fds=[write], stdout=quiet, stderr=quiet)
        os.close(write)
        before = os.environ.get("DISPLAY")
        try:
            with os.fdopen(read) as told:
                os.environ["DISPLAY"] = f":{told.readline().strip()}"
            yield Path(folder) / SCREEN
        finally:
            os.environ.pop("DISPLAY")
            if before is not None:
                os.environ["DISPLAY"] = before
            end_process(server)


def _read_dump(dump: bytes) -> np.ndarray:
    """Return the pixels of an X window dump of 32 bits a pixel, shape (height, width, 3), uint8."""
    header = struct.unpack(">25I", dump[:100])
    size, width, height, row, colours = (header[field] for field in (0, 4, 5, 12, 19))
    start = size + 12 * colours
    pixels = np.frombuffer(dump[start : start + height * row], np.uint8)
    return pixels.reshape(height, row // 4, 4)[:, :width, 2::-1]


def _write_picture(pixels: np.ndarray, path: Path | str) -> None:
    from matplotlib.image import imsave

    with replacing(path) as place:
        imsave(place, np.ascontiguousarray(pixels), format="png")
