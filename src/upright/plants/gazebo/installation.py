"""Finds Gazebo 11 on this machine, and the environment that its programs need.

Either Gazebo 11 is installed on the machine, or `upright gazebo install` has unpacked it into a
private folder. The private one runs with the machine's own C and C++ libraries; all other libraries
are found in that folder through environment variables.
"""

import os
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import NamedTuple

from upright.errors import UprightError
from upright.support.files import digest, home, user_cache
from upright.support.private_folders import changeable

CHOICE = "UPRIGHT_GAZEBO"
"""Environment variable that names another private folder."""
LIBRARY = "libupright_stepper.so"
"""File name of the plugin that lets Python step a world."""
INSTALL = "`upright gazebo install`"
TRIPLET = "x86_64-linux-gnu"
"""Debian's name of the architecture that the packages are for."""


class Installation(NamedTuple):
    """A Gazebo that is ready for use."""

    server: Path
    client: Path
    environment: dict[str, str]
    """Environment variables of its programs. Other programs must not have them: an X server, for
    instance, would load Gazebo's graphics libraries."""
    plugin: Path
    version: str


class Program(NamedTuple):
    """A Gazebo, whose plugin may not be built yet."""

    root: Path
    """The folder with `bin`, `lib` and `share`."""
    prefix: Path | None
    """Folder that the packages are unpacked into; None if Gazebo is installed on the machine."""
    version: str

    @property
    def server(self) -> Path:
        """Path of its server."""
        return self.root / "bin/gzserver"

    @property
    def plugin(self) -> Path:
        """Path of its plugin once that is built, which depends on the plugin's sources."""
        origin = "unpacked" if self.prefix else "installed"
        return private_folder() / "plugin" / f"{_sources_digest()}-{origin}" / LIBRARY


@cache
def find_gazebo() -> Installation:
    """Return the Gazebo 11 of this machine.

    Raises
    ------
    UprightError
        If there is none, its plugin is not built or was built from other sources, or another user
        could change either.
    """
    program = find_program()
    if program is None:
        raise UprightError(f"Gazebo 11 is missing; {INSTALL} installs it")
    plugin = program.plugin
    if not plugin.is_file():
        others = plugin.parents[1].glob(f"*/{LIBRARY}")
        state = "was built from other sources" if any(others) else "is not built"
        raise UprightError(f"Gazebo's plugin {state}; {INSTALL} builds it")
    _check_is_ours(plugin)
    return Installation(
        program.server,
        program.root / "bin/gzclient",
        environment(program.prefix, plugin.parent),
        plugin,
        program.version,
    )


def find_program() -> Program | None:
    """Return the Gazebo 11 that is installed on the machine, or else the unpacked one, or None.

    Raises
    ------
    UprightError
        If the unpacked one does not run, or another user could change it.
    """
    prefix = private_folder() / "prefix"
    server = shutil.which("gzserver")
    if server and prefix not in Path(server).parents:
        version = version_of(Path(server), {})
        if version.startswith("11."):
            return Program(Path(server).parents[1], None, version)
    if not complete_mark().exists():
        return None
    _check_is_ours(prefix / "usr/bin/gzserver")
    version = version_of(prefix / "usr/bin/gzserver", environment(prefix, None))
    if not version:
        raise UprightError(
            f"the Gazebo in {str(prefix)!r} does not run; `upright gazebo install --remove` and "
            f"{INSTALL} install it again"
        )
    return Program(prefix / "usr", prefix, version)


def _check_is_ours(program: Path) -> None:
    """Raise UprightError if another user could change a program in the private folder."""
    try:
        other = changeable(program.resolve())
    except OSError:  # it is not there, and does not run
        return
    if other:
        raise UprightError(
            f"folder is {str(private_folder())!r}; others may change {str(other)!r}, so Gazebo is "
            "not run from there"
        )


def version_of(server: Path, additions: dict[str, str]) -> str:
    """Return the version that a server reports, or an empty string if it does not run."""
    try:
        done = subprocess.run(
            [server, "--version"],
            env=os.environ | additions,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=60,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    version = re.search(r"version (\d+\.\d+\.\d+)", done.stdout)
    return version[1] if version else ""  # its exit status is 255 even if it succeeds


def private_folder() -> Path:
    """Return the folder for downloaded packages and the plugin; it need not exist yet."""
    chosen = os.environ.get(CHOICE)
    return home(chosen).absolute() if chosen else user_cache() / "gazebo-11"


def complete_mark() -> Path:
    """Return the file that exists once all packages are unpacked."""
    return private_folder() / "complete"


def sources() -> Path:
    """Return the folder with the plugin's sources."""
    return Path(__file__).parent / "plugin"


def _sources_digest() -> str:
    paths = (path for path in sources().glob("*") if path.suffix in (".cc", ".hh", ".txt"))
    return digest(sorted(paths), sources())


def environment(prefix: Path | None, plugins: Path | None) -> dict[str, str]:
    """Return what Gazebo's programs need in their environment.

    Parameters
    ----------
    prefix
        Folder that its packages are unpacked into; None if it is installed on the machine.
    plugins
        Folder of Upright's plugin; None if that is not built.
    """
    usr = (prefix or Path("/")) / "usr"
    own = usr / f"lib/{TRIPLET}/gazebo-11/plugins"
    variables = {
        "GAZEBO_PLUGIN_PATH": _joined("GAZEBO_PLUGIN_PATH", *([plugins] if plugins else []), own),
        "GAZEBO_MODEL_DATABASE_URI": "",  # download nothing at run time
    }
    if prefix is None:
        return variables
    libraries = usr / "lib" / TRIPLET
    share = usr / "share/gazebo-11"
    return variables | {
        "LD_LIBRARY_PATH": _joined(
            "LD_LIBRARY_PATH",
            libraries,
            prefix / "lib" / TRIPLET,
            libraries / "blas",
            libraries / "lapack",
            libraries / "pulseaudio",
            own,
            usr / "lib",
        ),
        "GAZEBO_RESOURCE_PATH": _joined("GAZEBO_RESOURCE_PATH", share),
        "GAZEBO_MODEL_PATH": _joined("GAZEBO_MODEL_PATH", share / "models"),
        "OGRE_RESOURCE_PATH": str(libraries / "OGRE-1.9.0"),
        "LIBGL_DRIVERS_PATH": str(libraries / "dri"),
        "FONTCONFIG_SYSROOT": str(prefix),
        "XKB_CONFIG_ROOT": str(usr / "share/X11/xkb"),
        # The machine may have no Qt 5, or another one; the user's variables may lead to a third.
        "QT_PLUGIN_PATH": str(libraries / "qt5/plugins"),
        "QT_QPA_PLATFORM_PLUGIN_PATH": str(libraries / "qt5/plugins/platforms"),
        "QT_QPA_PLATFORM": "xcb",
    }


def _joined(variable: str, *folders: Path) -> str:
    """Return a search path: these folders, followed by the variable's present value."""
    present = os.environ.get(variable)
    return os.pathsep.join([*map(str, folders), *([present] if present else [])])
