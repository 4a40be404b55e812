"""Takes pictures of Gazebo's window on a machine without a display."""

import io
import math
import os
import shutil
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from upright.errors import Stopped, UprightError
from upright.support.files import write_file
from upright.support.processes import end_process, ending_with_us
from upright.support.temporary import temporary_folder

SCREEN = "Xvfb_screen0"
"""The file that Xvfb writes the contents of its screen to, as an X window dump."""
SIZE = (1280, 720)
"""Size of that screen [pixels]."""
WINDOW = 60.0
"""How long Gazebo's window may take to show the cart-pole [s]."""
SETTLED = 2.0
"""How long it must be shown before the picture is taken [s]."""
CART, POLE, DIFFERENCE = 1_000, 300, 76
"""Pixels by which the blue cart and the red pole are recognised, and how much more of their own
colour than of the other they have."""


def photograph(play: Callable[[np.ndarray], None], path: Path | str) -> None:
    """Write a picture of Gazebo's window while the cart-pole moves in it, on a virtual display.

    Parameters
    ----------
    play
        Starts Gazebo with its window and moves the cart-pole, until it is done or its argument, an
        array of one bool, is set.
    path
        Path of the picture, a PNG.

    Raises
    ------
    UprightError
        If Xvfb is missing, or the window never shows the cart-pole.
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
    """Return the pixels of the screen once they show the cart-pole for a while."""
    until, since = time.monotonic() + WINDOW, math.inf
    while time.monotonic() < until and not playing.done():
        pixels = _read_dump(screen.read_bytes())
        if not _shows_cart_pole(pixels):
            since = math.inf
        elif time.monotonic() - since >= SETTLED:
            return pixels
        else:
            since = min(since, time.monotonic())
        time.sleep(0.2)
    if playing.done():
        playing.result()  # raises what went wrong
    raise UprightError("Gazebo's window did not show the cart-pole in time")


def _shows_cart_pole(pixels: np.ndarray) -> bool:
    red, _, blue = np.moveaxis(pixels.astype(np.int16), 2, 0)
    return bool((blue - red > DIFFERENCE).sum() > CART and (red - blue > DIFFERENCE).sum() > POLE)


@contextmanager
def _screen() -> Iterator[Path]:
    """Provide a virtual display within the block; yield the file that holds its contents."""
    program = shutil.which("Xvfb")
    if not program:
        raise UprightError("Xvfb, the virtual display, is missing; install the package xvfb")
    with temporary_folder("screen") as folder:
        read, write = os.pipe()
        size = "x".join(map(str, (*SIZE, 24)))
        command = [program, "-displayfd", str(write), "-screen", "0", size, "-fbdir", str(folder)]
        quiet = subprocess.DEVNULL
        server = subprocess.Popen(
            ending_with_us(command), pass_fds=[write], stdout=quiet, stderr=quiet
        )
        os.close(write)
        previous = os.environ.get("DISPLAY")
        try:
            with os.fdopen(read) as number:
                os.environ["DISPLAY"] = f":{number.readline().strip()}"
            yield folder / SCREEN
        finally:
            os.environ.pop("DISPLAY")
            if previous is not None:
                os.environ["DISPLAY"] = previous
            end_process(server)


def _read_dump(dump: bytes) -> np.ndarray:
    """Return the pixels of a 32-bit X window dump, shape (height, width, 3), uint8."""
    header = struct.unpack(">25I", dump[:100])
    size, width, height, row, colours = (header[field] for field in (0, 4, 5, 12, 19))
    start = size + 12 * colours
    pixels = np.frombuffer(dump[start : start + height * row], np.uint8)
    return pixels.reshape(height, row // 4, 4)[:, :width, 2::-1]


def _write_picture(pixels: np.ndarray, path: Path | str) -> None:
    from matplotlib.image import imsave

    output = io.BytesIO()
    imsave(output, np.ascontiguousarray(pixels), format="png")
    write_file(path, output.getvalue())
