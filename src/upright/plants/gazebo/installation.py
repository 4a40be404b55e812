"""Where Gazebo 11 is on this machine, and with which environment its programs run.

Either the machine has a Gazebo 11 of its own, or `upright gazebo install` has unpacked one into a
private folder. The private one runs with the machine's own C and C++ libraries; every other library
comes from that folder, by way of the environment.
"""

import os
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import NamedTuple

from upright.errors import UprightError
from upright.support.files import digest, user_cache

CHOICE = "UPRIGHT_GAZEBO"
"""Environment variable that names another private folder."""
LIBRARY = "libupright_stepper.so"
"""The plugin by which Python steps a world."""
INSTALL = "`upright gazebo install`"
TRIPLET = "x86_64-linux-gnu"
"""What Debian calls the machines that the packages are for."""


class Installation(NamedTuple):
    """A Gazebo that is ready for use."""

    server: Path
    client: Path
    environment: dict[str, str]
    """What its programs need in their environment. Nothing else may have it: an X server, for
    instance, would take Gazebo's graphics libraries for its own."""
    plugin: Path
    version: str


class Program(NamedTuple):
    """A Gazebo, whose plugin may not be built yet."""

    root: Path
    """The folder with `bin`, `lib` and `share`."""
    prefix: Path | None
    """Where the packages are unpacked; None if the machine has a Gazebo of its own."""
    version: str

    @property
    def server(self) -> Path:
        """Return its server."""
        return self.root / "bin/gzserver"

    @property
    def plugin(self) -> Path:
        """Return where its plugin lies once it is built, by what it is built from and for."""
        origin = "unpacked" if self.prefix else "installed"
        return private_folder() / "plugin" / f"{_sources_digest()}-{origin}" / LIBRARY


@cache
def find_gazebo() -> Installation:
    """Return the Gazebo 11 of this machine.

    Raises
    ------
    UprightError
        If there is none, or its plugin is not built, or not from the present sources.
    """
    program = find_program()
    if program is None:
        raise UprightError(f"Gazebo 11 is missing; {INSTALL} brings it")
    plugin = program.plugin
    if not plugin.is_file():
        others = plugin.parents[1].glob(f"*/{LIBRARY}")
        state = "was built from other sources" if any(others) else "is not built"
        raise UprightError(f"Gazebo's plugin {state}; {INSTALL} builds it")
    return Installation(
        program.server,
        program.root / "bin/gzclient",
        environment(program.prefix, plugin.parent),
        plugin,
        program.version,
    )


def find_program() -> Program | None:
    """Return the machine's own Gazebo 11, or else the unpacked one, or None."""
    prefix = private_folder() / "prefix"
    found = shutil.which("gzserver")
    if found and prefix not in Path(found).parents:
        version = version_of(Path(found), {})
        if version.startswith("11."):
            return Program(Path(found).parents[1], None, version)
    if not complete_mark().exists():
        return None
    version = version_of(prefix / "usr/bin/gzserver", environment(prefix, None))
    if not version:
        raise UprightError(
            f"the Gazebo in {str(prefix)!r} does not run; `upright gazebo install --remove` and "
            f"{INSTALL} bring it again"
        )
    return Program(prefix / "usr", prefix, version)


def version_of(server: Path, additions: dict[str, str]) -> str:
    """Return what a server calls its version, or nothing if it does not run."""
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
    found = re.search(r"version (\d+\.\d+\.\d+)", done.stdout)
    return found[1] if found else ""  # its exit status is 255 even so


def private_folder() -> Path:
    """Return the folder for all that is brought and built; it need not exist yet."""
    chosen = os.environ.get(CHOICE)
    return Path(chosen).expanduser().absolute() if chosen else user_cache() / "gazebo-11"


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
        Where its packages are unpacked; None for a Gazebo that is installed.
    plugins
        The folder of our plugin, if it is built.
    """
    usr = (prefix or Path("/")) / "usr"
    own = usr / f"lib/{TRIPLET}/gazebo-11/plugins"
    found = {
        "GAZEBO_PLUGIN_PATH": _joined("GAZEBO_PLUGIN_PATH", *([plugins] if plugins else []), own),
        "GAZEBO_MODEL_DATABASE_URI": "",  # nothing is fetched while it runs
    }
    if prefix is None:
        return found
    libraries = usr / "lib" / TRIPLET
    share = usr / "share/gazebo-11"
    return found | {
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
    }


def _joined(variable: str, *folders: Path) -> str:
    """Return a search path: these folders, and then those that the variable names already."""
    given = os.environ.get(variable)
    return os.pathsep.join([*map(str, folders), *([given] if given else [])])
