"""Settings and fixtures for all tests."""

import importlib
import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from textwrap import dedent
from typing import NamedTuple

import pytest
from helpers import forget, new_module_name
from hypothesis import settings
from octave import IS_THERE, SESSION

from upright.errors import UprightError
from upright.plants.gazebo.installation import find_gazebo
from upright.studies.store import Store


class Program(NamedTuple):
    """A program needed by the tests that are marked with its name."""

    title: str
    demand: str
    """Environment variable that turns its absence into a failure."""
    installer: str
    is_there: Callable[[], bool]

    def is_wanted(self):
        return os.environ.get(self.demand) or self.is_there()


def has_gazebo():
    try:
        return bool(find_gazebo())
    except UprightError:
        return False


CHIP_PROGRAMS = (
    *("qemu-system-arm", "qemu-system-riscv32"),
    *("arm-none-eabi-gcc", "riscv64-unknown-elf-gcc", "cmake"),
)
PROGRAMS = {
    "octave": Program(
        "GNU Octave", "UPRIGHT_REQUIRE_OCTAVE", "matlab/install-octave.sh", lambda: IS_THERE
    ),
    "gazebo": Program("Gazebo 11", "UPRIGHT_REQUIRE_GAZEBO", "upright gazebo install", has_gazebo),
    "wasm": Program(
        "Node.js or lld",
        "UPRIGHT_REQUIRE_WASM",
        "apt-get install nodejs lld",
        lambda: all(map(shutil.which, ("node", "wasm-ld"))),
    ),
    "chromium": Program(
        "Chromium",
        "UPRIGHT_REQUIRE_WASM",
        "apt-get install chromium",
        lambda: bool(shutil.which("chromium")),
    ),
    "chip": Program(
        "QEMU or a compiler for chips",
        "UPRIGHT_REQUIRE_CHIPS",
        "apt-get install qemu-system-arm qemu-system-misc gcc-arm-none-eabi "
        "gcc-riscv64-unknown-elf cmake",
        lambda: all(map(shutil.which, CHIP_PROGRAMS)),
    ),
}

TESTS = Path(__file__).parent
FIRST = (
    "nodes/test_ros2.py",
    "agents/test_agents.py",
    "nodes/test_any_cart.py",
    "nodes/test_driver.py",
    "nodes/test_record.py",
    "plants/test_gazebo.py",
    "agents/test_adaptive_lqr.py",
    "test_package.py",
    "studies/test_matlab_twin.py",
    "test_same_trials.py",
    "studies/test_cluster.py",
    "fuzz/test_fuzz.py",
    "test_notebooks.py",
    "test_benchmarks.py",
)
"""The files that take longest: workers start with them, so that none is left with one at the end.

Of two that stand together, at most one compiles the agents, which both would do at the same time.
"""

# Shells start background jobs with SIGINT ignored, which child processes inherit.
signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples every time, and no deadline, because the first call of a kernel compiles it.
settings.register_profile("upright", deadline=None, derandomize=True, database=None)
settings.load_profile("upright")


@pytest.fixture(autouse=True)
def _no_store_is_left_open(monkeypatch):
    """Fail if a test, or the code it tests, leaves a store open."""
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


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Return a function that writes a module into the current folder and returns its name."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path.copy())
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    written = []

    def write(text, name=None):
        name = name or new_module_name()
        (tmp_path / f"{name}.py").write_text(dedent(text))
        importlib.invalidate_caches()
        written.append(name)
        return name

    yield write
    for name in written:
        forget(name)


@pytest.fixture(scope="session", autouse=True)
def _close_octave():
    yield
    SESSION.close()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Put FIRST first, and skip tests of missing programs, unless a variable demands them."""
    place = {TESTS / name: number for number, name in enumerate(FIRST)}
    items.sort(key=lambda item: place.get(item.path, len(FIRST)))
    missing = [name for name, program in PROGRAMS.items() if not program.is_wanted()]
    for item in items:
        for name in missing:
            if item.get_closest_marker(name):
                item.add_marker(pytest.mark.skip(reason=f"{PROGRAMS[name].title} is missing"))


def pytest_terminal_summary(terminalreporter):
    """Report prominently which tests were not run."""
    reasons = [str(report.longrepr) for report in terminalreporter.stats.get("skipped", [])]
    for program in PROGRAMS.values():
        missing = f"{program.title} is missing"
        if count := sum(missing in reason for reason in reasons):
            terminalreporter.section(missing.upper(), red=True, bold=True)
            terminalreporter.line(f"{count} tests were NOT run; {program.installer} installs it")
