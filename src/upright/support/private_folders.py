"""Folders whose content is executed: nobody else may change what lies in them."""

import os
import stat
from pathlib import Path


def changeable(path: Path) -> Path | None:
    """Return the first, from the root, of a path's parts that others could change; None if none.

    Others are all users except this one and root. Where they cannot go, below a folder that is
    closed to them, they can change nothing, whatever permissions say there. In a folder with the
    sticky bit, such as /tmp, they cannot change what belongs to this user.

    Parameters
    ----------
    path
        A file or folder, absolute and without symbolic links, as `Path.resolve` returns it.

    Raises
    ------
    OSError
        If it cannot be examined, for example because it is not there.
    """
    is_closed = False
    for place in reversed((path, *path.parents)):
        status = place.stat()
        is_sticky = place != path and bool(status.st_mode & stat.S_ISVTX)
        if not is_ours(status, closed=not (is_closed or is_sticky)):
            return place
        is_closed |= not status.st_mode & (stat.S_IXGRP | stat.S_IXOTH)
    return None


def is_ours(status: os.stat_result, *, closed: bool = True) -> bool:
    """Whether a file belongs to this user or to root, and, if `closed`, no other may write to it.

    Where files have no such owners, as on Windows, all are ours.
    """
    if not hasattr(os, "geteuid"):
        return True
    is_open = bool(status.st_mode & (stat.S_IWGRP | stat.S_IWOTH))
    return status.st_uid in (0, os.geteuid()) and not (closed and is_open)


def make_private(folder: Path) -> Path:
    """Make a folder, and those above it that are missing, for this user alone; resolve its path.

    Raises
    ------
    OSError
        If it cannot be made.
    """
    for each in reversed((folder, *folder.parents)):
        each.mkdir(0o700, exist_ok=True)
    return folder.resolve()
