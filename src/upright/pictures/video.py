"""Videos of pictures, written by FFmpeg."""

import subprocess
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING

import numpy as np

from upright.errors import UprightError, missing, require_one_of
from upright.pictures.picture import HEIGHT, WIDTH, _pygame
from upright.support.files import check_output, replacing

if TYPE_CHECKING:
    pass

FORMATS = {
    ".mp4": "-c:v libx264 -crf 18 -preset veryfast -pix_fmt yuv420p -movflags +faststart",
    # The first pictures give the palette: all of them would have to wait in memory.
    ".gif": "-vf split[a][b];[a]trim=end_frame=100,palettegen=max_colors=48[palette];"
    "[b][palette]paletteuse=dither=none:diff_mode=rectangle -loop 0",
}
"""Endings of videos, and how FFmpeg writes them."""


def check_video(path: Path | str) -> Path:
    """Return the path of a video to be written later, having made sure that it can be.

    Raises
    ------
    UprightError
        If its ending is not one of the FORMATS, it cannot be written, or a library is missing.
    """
    require_one_of(f"the ending of {str(path)!r}", Path(path).suffix, FORMATS)
    _pygame()
    _ffmpeg()
    return check_output(path)


def _ffmpeg() -> str:
    """Return the program that writes videos."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):  # the latter: it came without the program
        raise missing("videos need imageio-ffmpeg", "video") from None


def write_video(path: Path | str, frames: Iterable[np.ndarray], frames_per_second: float) -> None:
    """Write a video, picture by picture as they come; a GIF is shown again and again.

    The file is whole or not there, whatever happens on the way.

    Parameters
    ----------
    path
        Where to; the ending, .mp4 (H.264) or .gif, says the format.
    frames
        Pictures as `picture` returns them.
    frames_per_second
        How fast they are shown. A GIF counts time in hundredths of a second.

    Raises
    ------
    UprightError
        As `check_video`; if there is no picture; or if writing fails.
    """
    path = check_video(path)
    given = f"-f rawvideo -pix_fmt rgb24 -s {WIDTH}x{HEIGHT} -r {frames_per_second} -i -"
    command = [_ffmpeg(), "-v", "error", "-y", *given.split(), *FORMATS[path.suffix].split()]
    with replacing(path) as part, TemporaryFile() as said:
        # In a session of its own: Ctrl-C is for this program, which then ends the other.
        with subprocess.Popen(
            [*command, str(part)], stdin=subprocess.PIPE, stderr=said, start_new_session=True
        ) as writer:
            try:
                count = _send(frames, writer)
                writer.communicate()
            except BaseException:
                writer.kill()
                writer.communicate()  # unlike the end of the block, it expects a broken pipe
                raise
        if writer.returncode != 0 or count == 0:
            said.seek(0)
            why = said.readline().decode(errors="replace").strip() if count else "no picture came"
            raise UprightError(f"output is {str(path)!r}; it cannot be written: {why}")


def _send(frames: Iterable[np.ndarray], writer: "subprocess.Popen[bytes]") -> int:
    """Send pictures to FFmpeg and return how many; if it ends early, its status tells."""
    count = 0
    assert writer.stdin is not None
    for frame in frames:
        if frame.shape != (HEIGHT, WIDTH, 3) or frame.dtype != np.uint8:
            wanted = f"it must be ({HEIGHT}, {WIDTH}, 3), uint8"
            raise UprightError(f"a picture has shape {frame.shape}, {frame.dtype}; {wanted}")
        count += 1
        try:
            writer.stdin.write(frame.tobytes())
        except BrokenPipeError:
            break
    return count
