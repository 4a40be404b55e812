"""Chromium, which loads a page and sends what it finds."""

import json
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from queue import Queue
from shutil import which
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Any
from urllib.parse import urlencode

from playwright.sync_api import Browser, sync_playwright

SECONDS = 300
"""How long a page may take."""


class Handler(SimpleHTTPRequestHandler):
    """Serves a folder, and keeps what pages send."""

    def __init__(self, *arguments: Any, found: Queue[Any], **options: Any) -> None:
        self.found = found
        super().__init__(*arguments, **options)

    def do_POST(self) -> None:
        """Keep what a page sends, as JSON."""
        self.found.put(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
        self.send_response(204)
        self.end_headers()

    def log_message(self, *_: Any) -> None:
        """Say nothing."""


@contextmanager
def serving(folder: Path) -> Iterator[tuple[str, Queue[Any]]]:
    """Serve a folder; the context is its address, and what its pages send."""
    found: Queue[Any] = Queue()
    handler = partial(Handler, directory=folder, found=found)
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}", found
        finally:
            server.shutdown()


@contextmanager
def driven_chromium() -> Iterator[Browser]:
    """Provide a Chromium without a window, whose pages are visited by program."""
    with sync_playwright() as playwright:
        options = ["--no-sandbox"]
        browser = playwright.chromium.launch(executable_path=which("chromium"), args=options)
        yield browser
        browser.close()


def found_in_browser(folder: Path, page: str, **asked: str) -> Any:
    """Return what a page of a folder sends, opened with a query in Chromium."""
    with (
        serving(folder) as (address, found),
        TemporaryDirectory(ignore_cleanup_errors=True) as profile,
    ):
        options = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}"]
        command = ["chromium", *options, f"{address}/{page}?{urlencode(asked)}"]
        quiet = subprocess.DEVNULL
        with subprocess.Popen(command, stdout=quiet, stderr=quiet) as browser:
            try:
                return found.get(timeout=SECONDS)
            finally:
                browser.terminate()
