"""Tell what is there of Gazebo, and of what it takes to bring it."""

import shutil
from collections.abc import Callable
from typing import NamedTuple

from upright.errors import UprightError
from upright.plants.gazebo.installation import INSTALL, find_gazebo, find_program, private_folder
from upright.plants.gazebo.installer import PACKAGED, SPARE, machine_mirror, size

ROOM = 1_300_000_000
"""Bytes that an installation needs at most: the downloaded packages, and what is in them."""
TOOLS = {
    "c++": "to build the plugin",
    "cmake": "to build the plugin",
    "make": "to build the plugin",
    "apt-get": "to bring Gazebo",
    "dpkg-deb": "to bring Gazebo",
    "Xvfb": "to show a window where there is no display",
}


class Check(NamedTuple):
    """Something that was looked for."""

    name: str
    found: bool
    told: str
    """Where it is; or how to get it."""
    needed: bool = False
    """Whether Gazebo cannot be used without it."""

    def __str__(self) -> str:
        return f"{'found' if self.found else 'missing':8} {self.name}: {self.told}"


def examine() -> list[Check]:
    """Look for everything, and return what was found."""
    return [
        _tried("Gazebo 11", _gazebo, needed=True),
        _tried("plugin", _plugin, needed=True),
        *(_tool(name, purpose) for name, purpose in TOOLS.items()),
        _tried("mirror of Debian", machine_mirror),
        _tried("disk space", _room),
    ]


def _tried(name: str, look: Callable[[], str], *, needed: bool = False) -> Check:
    try:
        return Check(name, True, look(), needed)
    except UprightError as error:
        return Check(name, False, str(error), needed)


def _gazebo() -> str:
    program = find_program()
    if program is None:
        raise UprightError(f"{INSTALL} brings it")
    origin = "brought by Upright" if program.prefix else "the machine's own"
    return f"version {program.version} runs, {origin}, {program.server}"


def _plugin() -> str:
    return str(find_gazebo.__wrapped__().plugin)


def _tool(name: str, purpose: str) -> Check:
    path = shutil.which(name)
    package = {**PACKAGED, "Xvfb": "xvfb"}[name]
    return Check(name, path is not None, path or f"{purpose}: apt-get install {package}")


def _room() -> str:
    folder = private_folder()
    there = next(path for path in (folder, *folder.parents) if path.exists())
    free = shutil.disk_usage(there).free
    if free < ROOM + SPARE:
        raise UprightError(
            f"{size(free)} free in {there}; an installation needs {size(ROOM + SPARE)}"
        )
    return f"{size(free)} free in {there}"
