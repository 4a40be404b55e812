"""Installs Gazebo 11 without root privileges, and builds the plugin that steps it.

Debian 11 is the last Debian with Gazebo 11. Its packages are unpacked into a private folder: apt,
with a separate configuration, selects and downloads them, and verifies them against Debian's
signature; `dpkg-deb` unpacks them. Steps that are already done are skipped, so an interrupted
installation resumes where it stopped.
"""

import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, MofNCompleteColumn, Progress, TextColumn

from upright.errors import UprightError
from upright.plants.gazebo.installation import (
    LIBRARY,
    Installation,
    Program,
    complete_mark,
    find_gazebo,
    find_program,
    private_folder,
    sources,
)
from upright.support.private_folders import make_private

SUITE = "bullseye"
"""Debian's name of its version 11."""
PROGRAMS = ("gazebo", "libgl1-mesa-dri")
"""Packages that are installed with their dependencies: the simulator, and drawing without a
graphics card."""
HEADERS = (
    "libgazebo-dev",
    "libsdformat-dev",
    "libignition-common-dev",
    "libignition-fuel-tools-dev",
    "libignition-math-dev",
    "libignition-msgs-dev",
    "libignition-transport-dev",
    "libboost1.74-dev",
    "libprotobuf-dev",
    "libtbb-dev",
    "libtinyxml-dev",
    "libtinyxml2-dev",
)
"""Packages that a plugin is compiled against. Their dependencies are left out: they are twice as
large, and no header of theirs is included."""
FROM_THE_MACHINE = ("libc6", "libgcc-s1", "libstdc++6")
"""Packages that are not installed. The machine's own libraries are used instead, because its
compiler builds for them; they are at least as new."""
DEBIAN = (
    *("bullseye", "bookworm", "trixie", "forky", "duke", "sid"),
    *("oldoldstable", "oldstable", "stable", "testing", "unstable"),
)
"""Suites that only Debian's main archive has."""
OURS = ("complete", "apt", "unpacked", "prefix", "build", "plugin", "lock")
"""Contents of the private folder, in the order of removal; "complete" marks it as complete."""
SPARE = 200_000_000
"""Disk space that must remain free, which also holds apt's lists and the plugin [bytes]."""
PACKAGED = {
    "apt-cache": "apt",
    "apt-get": "apt",
    "c++": "g++",
    "cmake": "cmake",
    "dpkg-deb": "dpkg",
    "make": "make",
}
"""The package of Debian or Ubuntu that contains each program."""


class Package(NamedTuple):
    """A package to install."""

    name: str
    file: str
    size: int
    """Size of the download [bytes]."""
    unpacked: int
    """Size on disk [bytes]."""
    sha256: str


def install(mirror: str | None = None) -> Installation:
    """Install Gazebo 11 and build the plugin, as far as either is missing.

    Parameters
    ----------
    mirror
        Address of a mirror of Debian's archive; by default the one that this machine uses.

    Raises
    ------
    UprightError
        If that is not possible on this machine.
    """
    if mirror is not None:
        check_mirror(mirror)
    with _alone():
        program = find_program()
        if program is None or not program.plugin.is_file():
            require_programs("cmake", "make", "c++")  # before the download rather than after it
            if program is None:
                install_packages(mirror or machine_mirror())
                program = find_program()
                assert program is not None
            build(program)
    find_gazebo.cache_clear()
    return find_gazebo()


def remove() -> int:
    """Remove everything that was installed and built; return the bytes freed.

    Raises
    ------
    UprightError
        If an installation is in progress.
    """
    folder = private_folder()
    if not (folder / "lock").exists():
        return 0
    freed = 0
    with _alone():
        for path in [folder / name for name in OURS]:
            if path.is_dir():
                freed += _room_of(path)
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
    with suppress(OSError):
        folder.rmdir()  # fails if it contains other files, which are kept
    find_gazebo.cache_clear()
    return freed


def _room_of(folder: Path) -> int:
    """Return the disk space of a folder's files [bytes]; files with several names count once."""
    files = (path.lstat() for path in folder.rglob("*") if path.is_symlink() or path.is_file())
    return int(sum(file.st_blocks * 512 / file.st_nlink for file in files))


@contextmanager
def _alone() -> Iterator[None]:
    """Lock the private folder within the block, or refuse if another process has locked it."""
    if sys.platform != "linux":
        raise UprightError(
            f"the system is {sys.platform!r}; Gazebo 11 can be installed only on Linux"
        )
    import fcntl

    folder = private_folder()
    try:
        make_private(folder)
        lock = open(folder / "lock", "w")  # noqa: SIM115 - closed below
    except OSError as error:
        raise UprightError(
            f"folder is {str(folder)!r}; it cannot be written: {error.strerror}"
        ) from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise UprightError(f"another installation is in progress in {str(folder)!r}") from None
        yield


def require_programs(*names: str) -> None:
    """Raise UprightError unless these programs are on the path."""
    missing = [name for name in names if shutil.which(name) is None]
    if missing:
        packages = " ".join(dict.fromkeys(PACKAGED[name] for name in missing))
        raise UprightError(
            f"{' and '.join(missing)} missing; on Debian or Ubuntu: apt-get install {packages}"
        )


def install_packages(mirror: str) -> None:
    """Download and unpack the packages.

    Raises
    ------
    UprightError
        If a package cannot be downloaded, or the disk is too full.
    """
    if platform.machine() != "x86_64":
        raise UprightError(
            f"the processor is {platform.machine()!r}; the packages of Gazebo 11 are for x86_64"
        )
    require_programs("apt-get", "apt-cache", "dpkg-deb")
    apt = Apt(private_folder() / "apt")
    apt.configure(mirror)
    apt.update()
    packages = apt.plan()
    missing = [package for package in packages if not apt.has(package)]
    fresh = [package for package in packages if not _unpacked_mark(package).exists()]
    download = sum(package.size for package in missing)
    unpacked = sum(package.unpacked for package in fresh)
    print(
        f"Gazebo 11: {len(packages)} packages, {size(download)} to download, "
        f"{size(sum(package.unpacked for package in packages))} on disk",
        flush=True,
    )
    check_room(download + unpacked)
    apt.download(missing)
    unpack(fresh, apt.archives)
    complete_mark().touch()
    shutil.rmtree(apt.folder)  # no longer needed


def size(count: float) -> str:
    """Return a number of bytes as text, in GB or MB."""
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.0f} MB"


def check_room(needed: int) -> None:
    """Raise UprightError unless the disk has room for this many bytes."""
    free = shutil.disk_usage(private_folder()).free
    if free < needed + SPARE:
        raise UprightError(
            f"the disk of {str(private_folder())!r} has {size(free)} free; Gazebo 11 needs "
            f"{size(needed + SPARE)}"
        )


class Apt:
    """apt with a separate configuration, which does not touch the machine's packages.

    Parameters
    ----------
    folder
        The folder that it keeps its files in.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.archives = folder / "archives"

    def configure(self, mirror: str) -> None:
        """Write the configuration.

        apt reads it after the machine's own, so that settings such as proxies apply here too.
        """
        (self.folder / "lists/partial").mkdir(parents=True, exist_ok=True)
        (self.archives / "partial").mkdir(parents=True, exist_ok=True)
        (self.folder / "status").touch()  # as if no package were installed
        keyring = find_keyring()
        signed = f" signed-by={keyring}" if keyring else ""
        (self.folder / "sources.list").write_text(
            f"deb [arch=amd64{signed}] {mirror} {SUITE} main\n"
        )
        (self.folder / "apt.conf").write_text(f"""\
#clear APT::Update::Pre-Invoke;
#clear APT::Update::Post-Invoke;
#clear APT::Update::Post-Invoke-Success;
#clear APT::Default-Release;
Dir::State "{self.folder}";
Dir::State::lists "{self.folder}/lists";
Dir::State::status "{self.folder}/status";
Dir::State::extended_states "{self.folder}/extended_states";
Dir::Cache "{self.folder}";
Dir::Cache::archives "{self.archives}";
Dir::Etc::sourcelist "{self.folder}/sources.list";
Dir::Etc::sourceparts "/dev/null";
Dir::Etc::preferences "/dev/null";
Dir::Etc::preferencesparts "/dev/null";
APT::Architecture "amd64";
APT::Architectures {{ "amd64"; }};
APT::Install-Recommends "false";
APT::Install-Suggests "false";
APT::Sandbox::User "root"; // apt's own user cannot enter this folder
APT::Update::Error-Mode "any";
Acquire::Languages "none";
Acquire::IndexTargets::deb::DEP-11::DefaultEnabled "false";
Acquire::IndexTargets::deb::Contents-deb::DefaultEnabled "false";
Acquire::Retries "3";
""")

    def update(self) -> None:
        """Download the lists of packages."""
        try:
            self._output("apt-get", "update")
        except UprightError as error:
            keys = "" if find_keyring() else ", or apt-get install debian-archive-keyring"
            raise UprightError(
                f"{error}; is the network up, and does the mirror have Debian's suite {SUITE}? "
                f"--mirror names another{keys}"
            ) from None

    def plan(self) -> list[Package]:
        """Return the packages to install."""
        steps = self._output("apt-get", "install", "--simulate", *PROGRAMS)
        names = [*parse_names(steps), *HEADERS]
        packages = [name for name in names if name not in FROM_THE_MACHINE]
        return parse_packages(self._output("apt-cache", "show", "--no-all-versions", *packages))

    def has(self, package: Package) -> bool:
        """Whether a package is downloaded completely and correctly, or already unpacked."""
        if _unpacked_mark(package).exists():
            return True
        path = self.archives / package.file
        if not path.is_file() or path.stat().st_size != package.size:
            return False
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest() == package.sha256

    def download(self, packages: Iterable[Package]) -> None:
        """Download packages; apt resumes partial downloads and verifies all of them."""
        packages = list(packages)
        if not packages:
            return
        paths = [self.archives / package.file for package in packages]
        command = self._command("apt-get", "download", *(package.name for package in packages))
        with (
            _bar(
                "downloading", sum(package.size for package in packages), DownloadColumn()
            ) as show,
            tempfile.TemporaryFile("w+") as output,
            subprocess.Popen(
                command,
                cwd=self.archives,
                env=_english(),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
            ) as process,
        ):
            try:
                while process.poll() is None:
                    show(sum(path.stat().st_size for path in paths if path.exists()))
                    time.sleep(0.2)
            finally:
                process.terminate()
            output.seek(0)
            _check(command, process.returncode, output.read())

    def _command(self, program: str, *arguments: str) -> list[str]:
        return [program, "--config-file", str(self.folder / "apt.conf"), "--quiet", *arguments]

    def _output(self, program: str, *arguments: str) -> str:
        return _run(self._command(program, *arguments))


def _english() -> dict[str, str]:
    """Return an environment in which programs print English, for `parse_names` and `reason`."""
    return os.environ | {"LC_ALL": "C"}


def _run(command: list[str]) -> str:
    """Run a program and return its output; if it fails, raise an error with the reason."""
    done = subprocess.run(
        command,
        env=_english(),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
    )
    _check(command, done.returncode, done.stderr or done.stdout)
    return done.stdout


def _check(command: list[str], status: int, output: str) -> None:
    if status != 0:
        raise UprightError(f"{command[0]} exited with status {status}: {reason(output)}")


def reason(output: str) -> str:
    """Return the line that explains why a program failed: its first error, or its last line."""
    lines = [line.strip() for line in output.splitlines() if line.strip()] or ["no output"]
    errors = [line for line in lines if re.search(r"^E: |\berror\b", line, re.IGNORECASE)]
    return (errors or lines[-1:])[0]


def parse_names(steps: str) -> list[str]:
    """Return the names of the packages that apt would install, from the steps that it prints."""
    return re.findall(r"^Inst (\S+) ", steps, re.MULTILINE)


def parse_packages(stanzas: str) -> list[Package]:
    """Return the packages that the output of `apt-cache show` describes."""
    return [
        Package(
            fields["package"],
            "_".join(fields[field] for field in ("package", "version", "architecture")).replace(
                ":", "%3a"
            )
            + ".deb",
            int(fields["size"]),
            int(fields["installed-size"]) * 1024,
            fields["sha256"],
        )
        for fields in parse_stanzas(stanzas)
    ]


def parse_stanzas(text: str) -> list[dict[str, str]]:
    """Return the fields of each stanza of a text in Debian's format, by lower-case name.

    Continuation lines are appended to their field.
    """
    stanzas: list[dict[str, str]] = []
    for block in re.split(r"\n\s*\n", re.sub(r"^#.*\n?", "", text, flags=re.MULTILINE)):
        fields: dict[str, str] = {}
        name = ""
        for line in block.splitlines():
            if line[:1].isspace():
                fields[name] = f"{fields.get(name, '')} {line.strip()}"
            elif ":" in line:
                name, _, value = line.partition(":")
                name = name.lower()
                fields[name] = value.strip()
        if fields:
            stanzas.append(fields)
    return stanzas


def unpack(packages: Iterable[Package], archives: Path) -> None:
    """Unpack packages, and mark each as unpacked so that it is not unpacked again.

    Raises
    ------
    UprightError
        If a package is damaged, or the disk is full.
    """
    packages = list(packages)
    prefix = private_folder() / "prefix"
    prefix.mkdir(exist_ok=True)
    with _bar("unpacking", len(packages), MofNCompleteColumn()) as show:
        for count, package in enumerate(packages, 1):
            _run(["dpkg-deb", "--extract", str(archives / package.file), str(prefix)])
            _unpacked_mark(package).parent.mkdir(exist_ok=True)
            _unpacked_mark(package).touch()
            show(count)


def _unpacked_mark(package: Package) -> Path:
    return private_folder() / "unpacked" / package.file


@contextmanager
def _bar(
    text: str, total: int, column: DownloadColumn | MofNCompleteColumn
) -> Iterator[Callable[[int], None]]:
    """Show a progress bar within the block, and yield the function that updates it."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), column)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task(text, total=total)
        yield lambda done: bar.update(task, completed=done)


def find_keyring() -> Path | None:
    """Return the file with Debian's keys; None if apt has to rely on its own keys."""
    return next(iter(sorted(Path("/usr/share/keyrings").glob("debian-archive-keyring.*"))), None)


def check_mirror(mirror: str) -> None:
    """Raise UprightError unless this is an address that apt can download from."""
    if not re.fullmatch(r"(https?|ftp|file)://[^\s\[\]\"]+", mirror):
        raise UprightError(
            f"mirror is {mirror!r}; it must be the address of a mirror of Debian's archive, "
            "beginning with https://, http://, ftp:// or file://"
        )


def machine_mirror(folder: Path = Path("/etc/apt")) -> str:
    """Return the mirror of Debian's main archive that this machine's apt uses.

    Raises
    ------
    UprightError
        If it does not use one.
    """
    parts = folder / "sources.list.d"
    for path in (folder / "sources.list", *sorted(parts.glob("*.list")), *parts.glob("*.sources")):
        if path.is_file():
            text = path.read_text(errors="replace")
            parse = mirrors_in_sources if path.suffix == ".sources" else mirrors_in_list
            if mirrors := parse(text):
                return mirrors[0]
    raise UprightError(
        "this machine's apt has no mirror of Debian's archive; name one with --mirror, which must "
        f"have Debian's suite {SUITE}"
    )


def mirrors_in_list(text: str) -> list[str]:
    """Return the mirrors of Debian's main archive in a file of apt's one-line format."""
    entries = re.findall(
        r"^\s*deb\s+(?:\[[^\]]*\]\s*)?(\S+)\s+(\S+)\s+([^#\n]*)", text, re.MULTILINE
    )
    return [
        address
        for address, suite, components in entries
        if suite in DEBIAN and "main" in components.split()
    ]


def mirrors_in_sources(text: str) -> list[str]:
    """Return the mirrors of Debian's main archive in a file of apt's deb822 format."""
    return [
        address
        for fields in parse_stanzas(text)
        if "deb" in fields.get("types", "").split()
        and fields.get("enabled", "yes").lower() not in ("no", "false", "off", "0")
        and set(fields.get("suites", "").split()) & set(DEBIAN)
        and "main" in fields.get("components", "").split()
        for address in fields.get("uris", "").split()
    ]


def build(program: Program) -> None:
    """Build the plugin for a Gazebo.

    Raises
    ------
    UprightError
        If its sources or Gazebo's headers are missing, or it does not compile.
    """
    if not (sources() / "CMakeLists.txt").is_file():
        raise UprightError(f"folder is {str(sources())!r}; the plugin's sources are not in it")
    if not (program.root / "include/gazebo-11").is_dir():
        raise UprightError(
            "the headers of this machine's Gazebo 11 are missing: apt-get install libgazebo-dev "
            "(libgazebo11-dev if the packages are those of the Gazebo project)"
        )
    print("building the plugin", flush=True)
    plugin = program.plugin
    plugin.parent.mkdir(parents=True, exist_ok=True)
    place = private_folder() / "build"
    shutil.rmtree(place, ignore_errors=True)  # what is left of a build that was killed
    place.mkdir()
    try:
        prefix = program.prefix or ""
        choices = (f"-DGAZEBO_PREFIX={prefix}", "-DCMAKE_BUILD_TYPE=Release")
        _run(["cmake", "-S", str(sources()), "-B", str(place), *choices])
        _run(["cmake", "--build", str(place), "--target", "upright_stepper"])
        os.replace(place / LIBRARY, plugin)
    finally:
        shutil.rmtree(place, ignore_errors=True)
