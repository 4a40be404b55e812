"""Settings for all tests."""

import os
import signal
from collections.abc import Callable
from typing import NamedTuple

import pytest
from hypothesis import settings
from octave import IS_THERE, SESSION

from upright.errors import UprightError
from upright.plants.gazebo.installation import find_gazebo
from upright.studies.store import Store


class Program(NamedTuple):
    """A program that the tests with a marker of its name need."""

    title: str
    demand: str
    """The environment variable that makes its absence a failure."""
    installer: str
    is_there: Callable[[], bool]

    def is_wanted(self):
        return os.environ.get(self.demand) or self.is_there()


def has_gazebo():
    try:
        return bool(find_gazebo())
    except UprightError:
        return False


PROGRAMS = {
    "octave": Program(
        "GNU Octave", "UPRIGHT_REQUIRE_OCTAVE", "matlab/install-octave.sh", lambda: IS_THERE
    ),
    "gazebo": Program("Gazebo 11", "UPRIGHT_REQUIRE_GAZEBO", "upright gazebo install", has_gazebo),
}

# A shell starts background jobs with SIGINT ignored, and their children inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples every time, and no deadline: the first call of a kernel compiles it.
settings.register_profile("upright", deadline=None, derandomize=True, database=None)
settings.load_profile("upright")


@pytest.fixture(autouse=True)
def _no_store_is_left_open(monkeypatch):
    """Fail where a test, or what it tests, does not close a store."""
    left = []
    make, close = Store.__init__, Store.close

    def make_and_note(self, *arguments, **options):
        make(self, *arguments, **options)
        left.append(self)

    def close_and_note(self):
        close(self)
        left[:] = [store for store in left if store is not self]

    monkeypatch.setattr(Store, "__init__", make_and_note)
    monkeypatch.setattr(Store, "close", close_and_note)
    yield
    paths = [store.path for store in left]
    for store in left.copy():
        store.close()
    assert not paths, "these stores were left open"


@pytest.fixture(scope="session", autouse=True)
def _close_octave():
    yield
    SESSION.close()


def pytest_collection_modifyitems(items):
    """Skip tests that need a missing program, unless they are demanded."""
    missing = [name for name, program in PROGRAMS.items() if not program.is_wanted()]
    for item in items:
        for name in missing:
            if item.get_closest_marker(name):
                item.add_marker(pytest.mark.skip(reason=f"{PROGRAMS[name].title} is missing"))


def pytest_terminal_summary(terminalreporter):
    """Report prominently what was not tested."""
    reasons = [str(report.longrepr) for report in terminalreporter.stats.get("skipped", [])]
    for program in PROGRAMS.values():
        missing = f"{program.title} is missing"
        if count := sum(missing in reason for reason in reasons):
            terminalreporter.section(missing.upper(), red=True, bold=True)
            terminalreporter.line(f"{count} tests were NOT run; {program.installer} installs it")
