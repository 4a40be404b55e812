"""Settings for all tests."""

from hypothesis import settings

# The same examples every time, and no deadline: the first call of a kernel compiles it.
settings.register_profile("upright", deadline=None, derandomize=True, database=None)
settings.load_profile("upright")
