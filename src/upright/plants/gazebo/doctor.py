"""Checks whether Gazebo is installed, and whether it could be installed."""

import shutil
from collections.abc import Callable
from typing import NamedTuple

from upright.errors import UprightError
from upright.plants.gazebo.installation import INSTALL, find_gazebo, find_program, private_folder
from upright.plants.gazebo.installer import PACKAGED, SPARE, machine_mirror, size

ROOM = 1_300_000_000
"""Most disk space that an installation needs: packages and their contents [bytes]."""
TOOLS = {
    "c++": "to build the plugin",
    "cmake": "to build the plugin",
    "make": "to build the plugin",
    "apt-get": "to install Gazebo",
    "dpkg-deb": "to install Gazebo",
    "Xvfb": "to take pictures of the window without a display",
}


class Check(NamedTuple):
    """The result of looking for one thing."""

    name: str
    found: bool
    detail: str
    """Where it is, or how to get it."""
    needed: bool = False
    """Whether Gazebo cannot be used without it."""

    def __str__(self) -> str:
        return f"{'found' if self.found else 'missing':8} {self.name}: {self.detail}"


def examine() -> list[Check]:
    """Look for everything that Gazebo and its installation need."""
    return [
        _check("Gazebo 11", _gazebo, needed=True),
        _check("plugin", _plugin, needed=True),
        *(_tool(name, purpose) for name, purpose in TOOLS.items()),
        _check("mirror of Debian", machine_mirror),
        _check("disk space", _room),
    ]


def _check(name: str, find: Callable[[], str], *, needed: bool = False) -> Check:
    try:
        return Check(name, True, find(), needed)
    except UprightError as error:
        return Check(name, False, str(error), needed)


def _gazebo() -> str:
    program = find_program()
    if program is None:
        raise UprightError(f"{INSTALL} installs it")
    origin = "installed by Upright" if program.prefix else "the machine's own"
    return f"version {program.version} runs, {origin}, {program.server}"


def _plugin() -> str:
    return str(find_gazebo.__wrapped__().plugin)


def _tool(name: str, purpose: str) -> Check:
    path = shutil.which(name)
    package = {**PACKAGED, "Xvfb": "xvfb"}[name]
    return Check(name, path is not None, path or f"{purpose}: apt-get install {package}")


def _room() -> str:
    folder = private_folder()
    existing = next(path for path in (folder, *folder.parents) if path.exists())
    free = shutil.disk_usage(existing).free
    if free < ROOM + SPARE:
        raise UprightError(
            f"{size(free)} free in {existing}; an installation needs {size(ROOM + SPARE)}"
        )
    return f"{size(free)} free in {existing}"
