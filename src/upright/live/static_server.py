"""Serves a folder to browsers of this machine."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from upright.errors import UprightError

LOOPBACK = "127.0.0.1"
"""The address that only this machine reaches."""


class _Handler(SimpleHTTPRequestHandler):
    """Serves files, and logs nothing."""

    def log_message(self, *_: Any) -> None:
        """Keep quiet."""


@contextmanager
def static_server(folder: Path, port: int) -> Iterator[ThreadingHTTPServer]:
    """Provide a server of a folder within the block; its `serve_forever` serves.

    Parameters
    ----------
    folder
        What it serves.
    port
        Where it listens; 0 for any free port.

    Raises
    ------
    UprightError
        If it cannot listen there.
    """
    try:
        server = ThreadingHTTPServer((LOOPBACK, port), partial(_Handler, directory=folder))
    except OSError as error:
        raise UprightError(
            f"port is {port}; nothing can listen there: {error.strerror} (--port 0 takes any free "
            "port)"
        ) from None
    with server:
        yield server
