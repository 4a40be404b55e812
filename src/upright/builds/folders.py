"""The folder that a build writes to."""

from pathlib import Path

from upright.errors import UprightError, said


def own_folder(folder: Path | str) -> Path:
    """Return the folder, created if it is missing.

    Raises
    ------
    UprightError
        If it cannot be created.
    """
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise UprightError(
            f"output is {said(str(folder))}; the folder cannot be created: {why}"
        ) from None
    return path
