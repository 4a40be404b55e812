"""Writes videos with FFmpeg."""

import shutil
import subprocess
from collections.abc import Iterable
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryFile

import numpy as np

from upright.errors import UprightError, missing, require_one_of
from upright.pictures import colours
from upright.pictures.canvas import load_pygame
from upright.pictures.size import SIZE, Size
from upright.support.files import check_output, scratch, writing

FORMATS = {
    ".mp4": "-c:v libx264 -crf 18 -preset veryfast -pix_fmt yuv420p -movflags +faststart -f mp4",
    ".gif": "-lavfi paletteuse=dither=none:diff_mode=rectangle -loop 0 -f gif",
}
"""Endings of video files, and FFmpeg's options for each."""


def check_video(path: Path | str) -> Path:
    """Return the path of a video to be written later, after checking that it can be written.

    Raises
    ------
    UprightError
        If its ending is not one of the FORMATS, it cannot be written, or a library is missing.
    """
    require_one_of(f"the ending of {str(path)!r}", Path(path).suffix, FORMATS)
    load_pygame()
    _ffmpeg()
    return check_output(path)


def _ffmpeg() -> str:
    """Return the path of FFmpeg."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):  # the latter: the package came without the program
        raise missing("videos need imageio-ffmpeg", "video") from None


def write_video(
    path: Path | str,
    frames: Iterable[np.ndarray],
    frames_per_second: float,
    size: Size = SIZE,
) -> None:
    """Write a video, encoding each picture as it arrives. A GIF repeats for ever.

    The file is complete or not written at all, whatever happens meanwhile.

    Parameters
    ----------
    path
        Path of the video; its ending, .mp4 (H.264) or .gif, selects the format.
    frames
        Pictures as `picture` returns them.
    frames_per_second
        Rate at which they are shown. A GIF rounds delays to hundredths of a second.
    size
        Size of all pictures.

    Raises
    ------
    UprightError
        As for `check_video`; if there are no pictures; or if writing fails.
    """
    path = check_video(path)
    source = f"-f rawvideo -pix_fmt rgb24 -s {size} -r {frames_per_second} -i -"
    # FFmpeg needs a file in which it can go back, which not every output is.
    with (
        scratch() as (made, place),
        scratch() as (palette, colour_table),
        TemporaryFile() as errors,
    ):
        command = [_ffmpeg(), "-v", "error", "-y", *source.split()]
        if path.suffix == ".gif":
            palette.write(_palette())
            palette.flush()
            source = "-f rawvideo -pix_fmt rgb24 -s 16x16 -i"
            command += [*source.split(), colour_table]
        command += [*FORMATS[path.suffix].split(), place]
        # FFmpeg gets a session of its own so that Ctrl-C reaches only this program, which kills it.
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stderr=errors, start_new_session=True
        ) as writer:
            try:
                count = _send(frames, writer, size)
                writer.communicate()
            except BaseException:
                writer.kill()
                writer.communicate()  # tolerates a broken pipe, which leaving the block does not
                raise
        if writer.returncode != 0 or count == 0:
            errors.seek(0)
            first = errors.readline().decode(errors="replace").strip()
            why = first if count else "there are no pictures"
            raise UprightError(f"output is {str(path)!r}; it cannot be written: {why}")
        with writing(path) as file:
            shutil.copyfileobj(made, file)


def _send(frames: Iterable[np.ndarray], writer: "subprocess.Popen[bytes]", size: Size) -> int:
    """Send pictures to FFmpeg and return how many; stop if FFmpeg exits early."""
    count = 0
    assert writer.stdin is not None
    shape = (size.height, size.width, 3)
    for frame in frames:
        if frame.shape != shape or frame.dtype != np.uint8:
            allowed = f"it must be {shape}, uint8"
            raise UprightError(f"shape of a picture is {frame.shape}, {frame.dtype}; {allowed}")
        count += 1
        try:
            writer.stdin.write(frame.tobytes())
        except BrokenPipeError:
            break
    return count


def _palette() -> bytes:
    """Return the 256 colours of a GIF: those of pictures and blends of any two, as at edges."""
    plain = [colour for name, colour in vars(colours).items() if name.isupper()]
    rgb = np.array([[int(each[i : i + 2], 16) for i in (1, 3, 5)] for each in plain], float)
    shades = [(1 - part) * rgb[0] + part * ink for ink in rgb[1:] for part in (0.25, 0.5, 0.75)]
    blends = [(a + b) / 2 for a, b in combinations(rgb[1:], 2)]
    table = np.zeros((256, 3), np.uint8)
    found = np.array([*rgb, *shades, *blends])[:256]
    table[: len(found)] = found.round()
    return table.tobytes()
