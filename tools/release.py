"""Make a release: check the sources, build the packages into dist/, and try the wheel.

    make release

The version stands in src/upright/__init__.py alone; the other places must agree with it. Nothing is
tagged or pushed: the last lines say how to do that.
"""

import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path
from xml.etree import ElementTree

from packaging.metadata import Metadata

ROOT = Path(__file__).parents[1]
TRIALS = (
    "upright --version",
    "upright learn random-search --steps 200",
    "upright table --agents random-search --noises none --runs 2 --steps 200",
    "upright matlab path",
)
"""What the wheel must be able to do in an environment that has nothing else."""


def version_of(root: Path) -> str:
    """Return the version that the package tells."""
    source = (root / "src/upright/__init__.py").read_text(encoding="utf-8")
    (version,) = re.findall(r'^__version__ = "(.+)"$', source, re.MULTILINE)
    return str(version)


def disagreements(root: Path) -> list[str]:
    """Return a line for every place that does not know of the version."""
    version, found = version_of(root), []
    ros = ElementTree.parse(root / "ros2/package.xml").getroot().findtext("version")
    if ros != version:
        found.append(f"ros2/package.xml has version {ros}; it must be {version}")
    changes = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    head = rf"^## \[{re.escape(version)}\] - (\d{{4}}-\d\d-\d\d)$"
    section = re.search(head + r"\n(.*?)(?=^## |\Z)", changes, re.MULTILINE | re.DOTALL)
    if section is None:
        return [*found, f"CHANGELOG.md has no section '## [{version}] - YEAR-MONTH-DAY'"]
    if not re.search(r"^- ", section[2], re.MULTILINE):
        found.append(f"CHANGELOG.md says nothing of {version}")
    citation = (root / "CITATION.cff").read_text(encoding="utf-8")
    for name, value in {"version": version, "date-released": section[1]}.items():
        line = f'{name}: "{value}"'
        if line not in citation.splitlines():
            found.append(f"CITATION.cff has no line '{line}'")
    return found


def obstacles(root: Path) -> list[str]:
    """Return a line for all that stands in the way of a release."""
    found, tag = disagreements(root), f"v{version_of(root)}"
    if changed := _git(root, "status", "--porcelain", "-z").split("\0")[:-1]:
        names = ", ".join(entry[3:] for entry in changed)
        found.append(f"there are changes that are not committed: {names}")
    if _git(root, "tag", "--list", tag):
        found.append(f"there is a tag {tag} already; a release needs a version of its own")
    return found


def _git(root: Path, *arguments: str) -> str:
    command = ["git", "-C", str(root), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def build(root: Path, folder: Path) -> tuple[Path, Path]:
    """Build the sdist, and from it the wheel, into an empty folder; return both files."""
    shutil.rmtree(folder, ignore_errors=True)
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(root)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    (sdist,), (wheel,) = folder.glob("*.tar.gz"), folder.glob("*.whl")
    return sdist, wheel


def check_metadata(sdist: Path, wheel: Path, version: str) -> None:
    """Make sure that an index would take both files.

    Raises
    ------
    ValueError
        If it would not.
    """
    with tarfile.open(sdist) as archive:
        member = archive.extractfile(f"upright-{version}/PKG-INFO")
        assert member is not None
        texts = [member.read()]
    with zipfile.ZipFile(wheel) as packed:
        texts.append(packed.read(f"upright-{version}.dist-info/METADATA"))
    for text in texts:
        metadata = Metadata.from_email(text, validate=True)
        if str(metadata.version) != version or not metadata.description:
            raise ValueError(f"the metadata has version {metadata.version}, or no description")


def try_wheel(wheel: Path) -> None:
    """Install the wheel into an empty environment, with what it needs, and use it there."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-m", "venv", f"{folder}/environment"], check=True)
        programs = Path(folder, "environment", "bin")
        install = ["-m", "pip", "install", "--quiet", str(wheel.resolve())]
        subprocess.run([programs / "python", *install], check=True)
        for line in TRIALS:
            print(f"$ {line}", flush=True)
            program, *arguments = line.split()
            subprocess.run([programs / program, *arguments], cwd=folder, check=True)


def main(root: Path = ROOT) -> int:
    """Make the release, and return the exit status."""
    if found := obstacles(root):
        for line in found:
            print(f"release: error: {line}", file=sys.stderr)
        return 1
    version = version_of(root)
    sdist, wheel = build(root, root / "dist")
    check_metadata(sdist, wheel, version)
    try_wheel(wheel)
    print(f"\n{sdist}\n{wheel}\nare ready. To tag and publish version {version}:")
    print(f"  git tag -a v{version} -m 'Upright {version}'\n  git push origin v{version}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
