"""Run the commands that a page shows, and write what they print below them.

    python tools/record_transcript.py docs/first-hour.md

Blocks of `text` that begin with a prompt, "$ ", are transcripts. Their commands run one after the
other in one empty folder, to which blocks of `python` that begin with a file's name in a comment,
such as "# wrong.py", are written first. A line says how a command ended unless it succeeded.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```(text|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"# (\w+\.py)\n")
WIDTH = "96"
"""Width of the terminal [columns]."""


def recorded(page: str, folder: Path) -> str:
    """Return a page with the transcripts of its commands, run in a folder."""
    for block in BLOCK.finditer(page):
        if block[1] == "python" and (file := FILE.match(block[2])):
            (folder / file[1]).write_text(block[2])

    def transcript(block: re.Match[str]) -> str:
        if block[1] != "text" or not block[2].startswith("$ "):
            return block[0]
        commands = [line[2:] for line in block[2].splitlines() if line.startswith("$ ")]
        return f"```text\n{''.join(shown(command, folder) for command in commands)}```"

    return BLOCK.sub(transcript, page)


def shown(command: str, folder: Path) -> str:
    """Return a command with what it prints."""
    here = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": here, "COLUMNS": WIDTH}
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    status = f"[exit status {done.returncode}]\n" if done.returncode else ""
    output = done.stdout.replace(str(folder), "/home/ada")
    return f"$ {command}\n{output}{status}"


def main() -> None:
    """Record the pages that the command line names."""
    for path in map(Path, sys.argv[1:]):
        with tempfile.TemporaryDirectory() as folder:
            path.write_text(recorded(path.read_text(), Path(folder)))
        print(f"recorded: {path}")


if __name__ == "__main__":
    main()
