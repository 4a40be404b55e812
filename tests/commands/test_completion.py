"""The scripts for Tab completion, in the real shells, installed as their help says."""

import os
import pty
import re
import select
import shutil
import subprocess
import time

import pytest
from helpers import python

from upright.agents import AGENTS
from upright.commands import make_parser, run
from upright.commands.completion import FILES, FREE, LISTS, SHELLS, actions
from upright.core.conditions import NOISES

LIMIT = 60
"""No shell takes longer [s]."""
STARTS = {
    "bash": (["bash", "--noprofile", "-i"], ".bashrc", "source ~/.upright-completion.bash"),
    "zsh": (["zsh", "-i"], ".zshrc", "fpath=(~/.zfunc $fpath)\nautoload -Uz compinit && compinit"),
}
"""How a shell is started in which one types, and the lines of its file that the help tells of."""
PLACES = {
    "bash": ".upright-completion.bash",
    "zsh": ".zfunc/_upright",
    "fish": ".config/fish/completions/upright.fish",
}
"""Where the script is written to."""


def installed(shell):
    """Mark what needs a shell: it is skipped where that is missing, unless it is demanded."""
    there = shutil.which(shell) or os.environ.get("UPRIGHT_REQUIRE_SHELLS")
    return pytest.param(shell, marks=pytest.mark.skipif(not there, reason=f"{shell} is missing"))


@pytest.fixture
def home(tmp_path, monkeypatch, capsys):
    """A home with every shell's script, files, and an `upright` that shows how it was called."""
    for shell, place in PLACES.items():
        assert run(["completion", shell]) == 0
        path = tmp_path / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(capsys.readouterr().out)
    command = tmp_path / "bin" / "upright"
    command.parent.mkdir()
    command.write_text("#!/bin/sh\nprintf '<%s>' \"$@\"\necho '<end>'\n")
    command.chmod(0o755)
    (tmp_path / "work").mkdir()
    (tmp_path / "work" / "policy.npz").touch()
    (tmp_path / "work" / "pictures").mkdir()
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("PATH", f"{command.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("TERM", "xterm")
    for name in ("ZDOTDIR", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "ENV", "BASH_ENV"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path


CASES = {
    "rep": "reproduce",
    "learn reinf": "learn reinforce",
    "learn reinforce --noi": "learn reinforce --noise",
    "learn reinforce --noise act\t-1": "learn reinforce --noise actuator-10",
    "learn reinforce --plant muj": "learn reinforce --plant mujoco",
    "table --agents ran": "table --agents random-search",
    "table --agents q-learning,reinf": "table --agents q-learning,reinforce",
    "table --noises none,all-1": "table --noises none,all-10",
    "matlab ta": "matlab table",
    "matlab table --format mark": "matlab table --format markdown",
    "plot ph": "plot phases",
    "plants muj": "plants mujoco",
    "play pol": "play policy.npz",
    "reproduce --output pict": "reproduce --output pictures/",
    "ros2 demo --start wi": "ros2 demo --start wide",
    "completion fi": "completion fish",
}
"""What is typed before the Tab key, and what then stands there."""


class Terminal:
    """A shell in which one types."""

    def __init__(self, command):
        self.unread = ""
        self.end, theirs = pty.openpty()
        self.process = subprocess.Popen(
            command, stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True
        )
        os.close(theirs)

    def read_until(self, pattern):
        until = time.monotonic() + LIMIT
        while not (found := re.search(pattern, self.unread)):
            assert time.monotonic() < until, self.unread
            if select.select([self.end], [], [], 0.1)[0]:
                self.unread += os.read(self.end, 65536).decode(errors="replace")
        self.unread = self.unread[found.end() :]
        return found

    def type(self, keys):
        os.write(self.end, keys.encode())

    def close(self):
        self.process.kill()
        self.process.wait()
        os.close(self.end)


@pytest.mark.parametrize("shell", [installed(shell) for shell in STARTS])
def test_tab_completes_in_a_shell_one_types_in(shell, home):
    command, file, lines = STARTS[shell]
    (home / file).write_text(f"PS1='re''ady> '\n{lines}\n")
    terminal = Terminal(command)
    try:
        for typed, completed in CASES.items():
            terminal.read_until("ready> ")
            terminal.type(f"upright {typed}\t\n")
            called = terminal.read_until(r"((?:<[^<>\s]+>)+)<end>")[1]
            words = [word.rstrip("/") for word in called[1:-1].split("><")]  # zsh takes it away
            assert words == completed.rstrip("/").split(), typed
    finally:
        terminal.close()


@pytest.mark.parametrize("shell", [installed("fish")])
def test_fish_completes(shell, home):
    for typed, completed in CASES.items():
        line = "upright " + typed.replace("\t", "uator")
        asked = ["fish", "--command", f"complete --do-complete '{line}'"]
        ended = subprocess.run(asked, capture_output=True, text=True, timeout=LIMIT, check=True)
        words = [found.split("\t")[0] for found in ended.stdout.splitlines()]
        assert words == [completed.split()[-1]], (typed, ended.stderr)


@pytest.mark.parametrize("shell", SHELLS)
def test_the_help_says_where_each_script_goes(shell, capsys):
    with pytest.raises(SystemExit):
        run(["completion", "--help"])
    shown = capsys.readouterr().out
    assert f"upright completion {shell} > ~/{PLACES[shell]}" in shown
    for line in STARTS.get(shell, ((), "", ""))[2].splitlines():
        assert line in shown


def test_every_value_is_completed_or_free():
    """A new kind of value is either completed, or said to be free."""
    kinds = {
        action.metavar
        for action in actions(make_parser())
        if action.choices is None and action.nargs != 0 and action.option_strings
    }
    named = {kind for kind in kinds if kind is not None}
    assert named <= {*FREE, *FILES, *LISTS, "AGENT", "PLANT", "FOLDER"}


def test_lists_are_of_all_agents_and_noises():
    assert tuple(LISTS["AGENTS"]) == tuple(AGENTS)
    assert set(LISTS["CASES"]) == {"all", *NOISES}


def test_nothing_but_completion_imports_its_library():
    code = "import sys; from upright.commands import run\n"
    code += "try: run(['learn', '--help'])\nexcept SystemExit: print('shtab' in sys.modules)"
    assert python(code).stdout.endswith("False\n")
