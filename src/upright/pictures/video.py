"""Writes videos with FFmpeg."""

import subprocess
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryFile

import numpy as np

from upright.errors import UprightError, missing, require_one_of
from upright.pictures.picture import HEIGHT, WIDTH, _pygame
from upright.support.files import check_output, replacing

FORMATS = {
    ".mp4": "-c:v libx264 -crf 18 -preset veryfast -pix_fmt yuv420p -movflags +faststart",
    # The palette is that of the first pictures, because the rest would have to wait in memory.
    ".gif": "-vf split[a][b];[a]trim=end_frame=100,palettegen=max_colors=48[palette];"
    "[b][palette]paletteuse=dither=none:diff_mode=rectangle -loop 0",
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
    _pygame()
    _ffmpeg()
    return check_output(path)


def _ffmpeg() -> str:
    """Return the path of FFmpeg."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):  # the latter: the package came without the program
        raise missing("videos need imageio-ffmpeg", "video") from None


def write_video(path: Path | str, frames: Iterable[np.ndarray], frames_per_second: float) -> None:
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

    Raises
    ------
    UprightError
        As for `check_video`; if there are no pictures; or if writing fails.
    """
    path = check_video(path)
    source = f"-f rawvideo -pix_fmt rgb24 -s {WIDTH}x{HEIGHT} -r {frames_per_second} -i -"
    command = [_ffmpeg(), "-v", "error", "-y", *source.split(), *FORMATS[path.suffix].split()]
    with replacing(path) as part, TemporaryFile() as errors:
        # FFmpeg gets a session of its own so that Ctrl-C reaches only this program, which kills it.
        with subprocess.Popen(
            [*command, str(part)], stdin=subprocess.PIPE, stderr=errors, start_new_session=True
        ) as writer:
            try:
                count = _send(frames, writer)
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


def _send(frames: Iterable[np.ndarray], writer: "subprocess.Popen[bytes]") -> int:
    """Send pictures to FFmpeg and return how many; stop if FFmpeg exits early."""
    count = 0
    assert writer.stdin is not None
    for frame in frames:
        if frame.shape != (HEIGHT, WIDTH, 3) or frame.dtype != np.uint8:
            allowed = f"it must be ({HEIGHT}, {WIDTH}, 3), uint8"
            raise UprightError(f"shape of a picture is {frame.shape}, {frame.dtype}; {allowed}")
        count += 1
        try:
            writer.stdin.write(frame.tobytes())
        except BrokenPipeError:
            break
    return count
