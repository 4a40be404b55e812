"""Settings for all tests."""

import pytest
from hypothesis import settings

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
