"""See agents learn in your browser, and push the pole.

The agents run in the page itself, as WebAssembly: the code of this package, with the same bits.
The command builds the page, which needs `wasm-ld` (on Debian and Ubuntu `apt-get install lld`) and
a minute or two, and serves it to this machine alone until Ctrl-C. With --build it writes the page
to a folder instead, for any static host.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

from upright.commands.options import whole
from upright.commands.parser import WRITTEN, Parser
from upright.commands.showing import tell_file
from upright.errors import require
from upright.support import terminal

EXAMPLES = """\
examples:
  upright watch                        then open the address that it prints
  upright watch --port 9000
  upright watch --build page           a folder for any static host
exit status: 0 if the page was written, 2 if something asked for is not possible, 130 after Ctrl-C.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright watch`."""
    help_text = "write the page to this folder, and do not serve it"
    parser.add_argument("--build", metavar="FOLDER", file=WRITTEN, help=help_text)
    parser.add_argument("--port", **whole(8000, "serve at this port; 0 takes any free one"))


def run(options: argparse.Namespace) -> int:
    """Carry out `upright watch`."""
    require("port", options.port, 0, 65535, whole=True)
    if options.build is not None:
        _build(options.build)
        tell_file("page", Path(options.build) / "index.html")
        return 0
    from upright.live.static_server import LOOPBACK, static_server

    with TemporaryDirectory() as folder, static_server(Path(folder), options.port) as server:
        _build(folder)
        terminal.end_notice()
        address = f"http://{LOOPBACK}:{server.server_port}"
        print(f"open {address} in your browser (Ctrl-C ends this)", flush=True)
        server.serve_forever()
    return 0


def _build(folder: str) -> None:
    from upright.live.static_page import build_page

    terminal.notice("building the page, which takes a minute or two …")
    for _ in build_page(folder):
        pass
