"""Settings for all tests."""

import os

import pytest
from hypothesis import settings
from octave import IS_THERE

from upright.store import Store

# The same examples every time, and no deadline: the first call of a kernel compiles it.
settings.register_profile("upright", deadline=None, derandomize=True, database=None)
settings.load_profile("upright")


@pytest.fixture(autouse=True)
def _close_stores(monkeypatch):
    """Close every store that a test leaves open: an open database at exit is a warning."""
    opened = []
    make = Store.__init__

    def make_and_remember(self, *arguments, **options):
        make(self, *arguments, **options)
        opened.append(self)

    monkeypatch.setattr(Store, "__init__", make_and_remember)
    yield
    for store in opened:
        store.close()


def pytest_collection_modifyitems(config, items):
    """Skip what needs Octave where it is missing, unless its tests are demanded."""
    if IS_THERE or os.environ.get("UPRIGHT_REQUIRE_OCTAVE"):
        return
    for item in items:
        if item.get_closest_marker("octave"):
            item.add_marker(pytest.mark.skip(reason="GNU Octave is missing"))


def pytest_terminal_summary(terminalreporter):
    """Say loudly that the MATLAB twin was not tested."""
    skipped = terminalreporter.stats.get("skipped", [])
    count = sum("GNU Octave is missing" in str(report.longrepr) for report in skipped)
    if count:
        terminalreporter.section("GNU OCTAVE IS MISSING", red=True, bold=True)
        terminalreporter.line(
            f"{count} tests of the MATLAB twin were NOT run; matlab/install-octave.sh installs it"
        )
