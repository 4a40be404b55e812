import importlib.util
import shutil
import subprocess

import pytest
from helpers import ROOT

import upright

spec = importlib.util.spec_from_file_location("release", ROOT / "tools/release.py")
release = importlib.util.module_from_spec(spec)
spec.loader.exec_module(release)

CITATION = 'cff-version: 1.2.0\nversion: "1.2.3"\ndate-released: "2024-05-06"\n'
CHANGES = """# Changelog

## [Unreleased]

## [1.2.3] - 2024-05-06

### Added

- A door.

## [1.2.2] - 2024-01-02

- A window.
"""


def git(folder, *arguments):
    own = ["-c", "user.name=Nobody", "-c", "user.email=nobody@upright.invalid"]
    subprocess.run(["git", "-C", folder, *own, *arguments], check=True, capture_output=True)


@pytest.fixture
def house(tmp_path):
    """A small repository that could be released."""
    for name, text in {
        "src/upright/__init__.py": '"""A package."""\n\n__version__ = "1.2.3"\n',
        "ros2/package.xml": "<package><version>1.2.3</version></package>\n",
        "CHANGELOG.md": CHANGES,
        "CITATION.cff": CITATION,
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    git(tmp_path, "init")
    git(tmp_path, "add", "--all")
    git(tmp_path, "commit", "--message", "Begin")
    return tmp_path


def change(house, name, old, new):
    """Change a file, and commit it."""
    text = (house / name).read_text()
    assert old in text
    (house / name).write_text(text.replace(old, new))
    git(house, "commit", "--all", "--message", "Change")


def test_a_clean_tree_with_a_new_version_can_be_released(house):
    assert release.version_of(house) == "1.2.3"
    assert release.obstacles(house) == []


def test_changes_that_are_not_committed_are_refused(house):
    (house / "CHANGELOG.md").write_text(CHANGES + "\n- A roof.\n")
    (house / "new file").touch()
    (told,) = release.obstacles(house)
    assert told == "there are changes that are not committed: CHANGELOG.md, new file"


def test_a_version_that_has_a_tag_is_refused(house):
    git(house, "tag", "v1.2.2")
    assert release.obstacles(house) == []
    git(house, "tag", "v1.2.3")
    (told,) = release.obstacles(house)
    assert told.startswith("there is a tag v1.2.3 already")


@pytest.mark.parametrize(
    ("old", "new"), [("[1.2.3] - 2024-05-06", "[1.2.3]"), ("## [1.2.3]", "## [1.2.4]")]
)
def test_a_version_without_a_dated_section_is_refused(house, old, new):
    change(house, "CHANGELOG.md", old, new)
    (told,) = release.obstacles(house)
    assert told == "CHANGELOG.md has no section '## [1.2.3] - YEAR-MONTH-DAY'"


def test_a_version_of_which_nothing_is_said_is_refused(house):
    change(house, "CHANGELOG.md", "- A door.\n", "")
    assert release.obstacles(house) == ["CHANGELOG.md says nothing of 1.2.3"]


def test_places_that_do_not_agree_are_refused(house):
    change(house, "ros2/package.xml", "1.2.3", "1.2.2")
    assert release.obstacles(house) == ["ros2/package.xml has version 1.2.2; it must be 1.2.3"]


@pytest.mark.parametrize("line", CITATION.splitlines()[1:])
def test_a_citation_of_another_version_or_day_is_refused(house, line):
    change(house, "CITATION.cff", line, line.replace("3", "2").replace("6", "7"))
    assert release.obstacles(house) == [f"CITATION.cff has no line '{line}'"]


def test_what_is_refused_is_not_built(house, capsys):
    git(house, "tag", "v1.2.3")
    change(house, "ros2/package.xml", "1.2.3", "1.2.2")
    assert release.main(house) == 1
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2
    assert all(line.startswith("release: error: ") for line in told)
    assert not (house / "dist").exists()


def test_this_version_is_known_everywhere():
    assert release.version_of(ROOT) == upright.__version__
    assert release.disagreements(ROOT) == []


@pytest.mark.slow
def test_what_is_built_would_be_taken_by_an_index(tmp_path):
    caches = shutil.ignore_patterns(".git", ".venv", ".*_cache", "__pycache__", "results", "dist")
    shutil.copytree(ROOT, tmp_path / "tree", ignore=caches)
    folder = tmp_path / "dist"
    folder.mkdir()
    (folder / "upright-0.0.1.tar.gz").touch()  # of an earlier release
    sdist, wheel = release.build(tmp_path / "tree", folder)
    assert {sdist, wheel} == set(folder.iterdir())
    release.check_metadata(sdist, wheel, upright.__version__)
    with pytest.raises(KeyError):
        release.check_metadata(sdist, wheel, "0.0.1")
