"""A Gazebo server for one cart-pole, which steps on request (`plugin/stepper.cc`)."""

import os
import re
import socket
import struct
import subprocess
import sys
import time
from contextlib import ExitStack, suppress
from itertools import count
from pathlib import Path

import numpy as np

from upright.core.parameters import Parameters, State
from upright.errors import Stopped, UprightError
from upright.plants.gazebo.installation import find_gazebo
from upright.plants.gazebo.world import write_world
from upright.support.processes import end_process, ending_with_us, share_core
from upright.support.temporary import temporary_folder

STEP, RESET = 0, 1
REQUEST, ANSWER = struct.Struct("=II4d"), struct.Struct("=4d")
"""The plugin's messages. Request: kind, number of physics steps, values. Answer: a state."""
STARTING = 60.0
"""How long a server may take to start [s]."""
ANSWERING = 10.0
"""How long a server may take to answer [s]."""
POLL = 0.1
"""Interval of checks during a start, and how long a server may take to exit by itself [s]."""
WINDOW = """\
[geometry]
x=0
y=0
width=1280
height=720
"""
"""Position and size of gzclient's window [pixels]."""
_numbers = count(os.getpid())
"""Numbers that distribute servers over the cores."""


class ServerGoneError(Exception):
    """The server has exited, or does not answer."""


class Server:
    """A gzserver process, and the socket over which it is stepped.

    The server and the calling thread are pinned to one core until that thread closes the server.

    Parameters
    ----------
    parameters
        Parameters of the plant.
    engine
        Name of Gazebo's physics engine.
    physics_step
        Its time step [s].
    gui
        Whether to show the cart-pole in gzclient.
    stop
        Shape (1,), bool. Once it is set, starting is aborted by raising Stopped.

    Raises
    ------
    UprightError
        If Gazebo is missing or does not start, or there is no display for its window.
    """

    def __init__(
        self,
        parameters: Parameters,
        engine: str,
        physics_step: float,
        gui: bool,
        stop: np.ndarray,
    ) -> None:
        gazebo = find_gazebo()
        if gui and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise UprightError(
                "there is no display for Gazebo's window (DISPLAY is not set); `upright gazebo "
                "view POLICY --screenshot FILE.png` takes a picture without one"
            )
        with ExitStack() as opened:
            if not gui:  # drawing needs a core of its own
                opened.enter_context(share_core(next(_numbers)))
            folder = opened.enter_context(temporary_folder("gazebo"))
            listener = opened.enter_context(socket.socket(socket.AF_UNIX))
            address = folder / "socket"
            try:
                listener.bind(str(address))
            except OSError as error:
                raise UprightError(f"a socket cannot be created at {address}: {error}") from error
            listener.listen(1)
            listener.settimeout(POLL)
            world = write_world(folder, parameters, engine, physics_step)
            self._folder, self._window = folder, None
            self._environment = _environment(gazebo.environment, folder)
            # Otherwise each physics step wakes a thread that publishes contacts to no subscriber.
            quiet = [] if gui else ["--minimal_comms"]
            self._process = self._start([str(gazebo.server), "--verbose", *quiet, str(world)])
            opened.callback(_end, self._process)
            self._socket = opened.enter_context(self._accept(listener, stop))
            self._socket.settimeout(ANSWERING)
            if gui:
                self._window = self._start([str(gazebo.client), "--verbose"])
                opened.callback(_end, self._window)
            self._closing = opened.pop_all()

    def ask(self, kind: int, steps: int, values: State) -> State:
        """Send a request, and return the state after it was carried out.

        Parameters
        ----------
        kind
            STEP or RESET.
        steps
            Number of physics steps to make.
        values
            The force [N] in the first field for STEP; the state for RESET.

        Raises
        ------
        ServerGoneError
            If the server has exited, or does not answer.
        UprightError
            If its window has failed.
        """
        if self._window is not None and self._window.poll() is not None:
            self._notice_closed_window(self._window.returncode)
        try:
            self._socket.sendall(REQUEST.pack(kind, steps, *values))
            answer = self._socket.recv(ANSWER.size, socket.MSG_WAITALL)
        except OSError as error:
            raise ServerGoneError(f"gzserver does not answer: {error}") from error
        if len(answer) < ANSWER.size:
            raise ServerGoneError("gzserver has exited")
        return State(*ANSWER.unpack(answer))

    def close(self) -> None:
        """Terminate the server, and remove its files."""
        self._closing.close()

    def _notice_closed_window(self, status: int) -> None:
        """Go on without the window if it was closed; raise UprightError if it has failed."""
        self._window = None
        if status != 0:
            raise UprightError(
                f"Gazebo's window ended with status {status}{self._last_words('gzclient')}"
            )
        print("upright: Gazebo's window is closed; the run goes on without it", file=sys.stderr)

    def _log(self, program: str) -> Path:
        return self._folder / f"{program}.txt"

    def _start(self, command: list[str]) -> "subprocess.Popen[bytes]":
        """Start a program in its own session, so that Ctrl-C reaches only this program."""
        with self._log(Path(command[0]).name).open("ab") as log:
            return subprocess.Popen(
                ending_with_us(command),
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def _accept(self, listener: socket.socket, stop: np.ndarray) -> socket.socket:
        """Wait until the plugin connects."""
        until = time.monotonic() + STARTING
        while time.monotonic() < until:
            with suppress(TimeoutError):
                return listener.accept()[0]
            if stop[0]:
                raise Stopped
            if self._process.poll() is not None:
                raise UprightError(f"gzserver exited while starting{self._last_words('gzserver')}")
        raise UprightError(
            f"gzserver did not start within {STARTING:g} s{self._last_words('gzserver')}"
        )

    def _last_words(self, program: str) -> str:
        """Return the last error in a program's log, or else its last line."""
        log = self._log(program).read_text(errors="replace")
        text = re.sub(r"\x1b\[[0-9;]*m", "", log)  # colours
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        errors = [line for line in lines if "[Err]" in line or "rror" in line]
        return "".join(f": {line}" for line in (errors or lines)[-1:])


def _environment(gazebo: dict[str, str], folder: Path) -> dict[str, str]:
    """Return the environment of a server, which has its own port and models."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    others = gazebo.get("GAZEBO_MODEL_PATH")
    models = os.pathsep.join(filter(None, [str(folder / "models"), others]))
    own = {"GAZEBO_MASTER_URI": f"http://127.0.0.1:{port}", "GAZEBO_IP": "127.0.0.1"}
    (folder / "gui.ini").write_text(WINDOW, encoding="utf-8")
    own |= {"GAZEBO_MODEL_PATH": models, "GAZEBO_GUI_INI_FILE": str(folder / "gui.ini")}
    return os.environ | gazebo | own


def _end(process: "subprocess.Popen[bytes]") -> None:
    """Wait for a process, and terminate it; a server exits by itself once its socket is closed."""
    with suppress(subprocess.TimeoutExpired):
        process.wait(POLL)
    end_process(process)
