"""A run as a store holds it: its values, the lengths of its trials as bytes, and checksums."""

import math
import struct
import zlib
from datetime import datetime
from typing import Any, NamedTuple

import numpy as np

from upright.core.trials import Result

LENGTH = np.dtype("<i4")
"""How the length of a trial is stored."""
PACKED = struct.Struct("<IqqqqqqdI")
"""How values are packed for their checksum: the key's checksum, then values in order."""
MOST_TRIALS, MOST_STEPS, LONGEST = 10**6, 10**15, 10**9
"""The most that a run can have, as tasks are limited."""


class StoredRun(NamedTuple):
    """The values of a stored run without the lengths of its trials, in the order of its columns."""

    seed: int
    run: int
    success: int
    trials: int
    steps: int
    longest: int
    seconds: float
    ended: str
    """When it ended (UTC), as SQLite writes times."""
    version: str | None
    """Version of this package that made it."""
    environment: int | None
    """Number, in its store, of the environment that made it."""
    lengths_checksum: int
    checksum: int | None
    """Checksum of the key and of all values but the environment; None in old forms of stores."""

    def is_sound(self, key_checksum: int) -> bool:
        """Whether every value is of its type and in its range, and the checksum is right."""
        try:
            numbers_are = (
                min(self.seed, self.run, self.success, self.trials, self.steps, self.longest) >= 0
                and self.success <= 1
                and self.trials <= MOST_TRIALS
                and self.steps <= MOST_STEPS
                and self.longest <= LONGEST
                and 0.0 <= self.seconds < math.inf
            )
            time_is = datetime.fromisoformat(self.ended).tzinfo is None
            checksum = self.checksum_under(key_checksum)
        except (TypeError, ValueError, struct.error):
            return False
        version_is = self.version is None or isinstance(self.version, str)
        environment_is = self.environment is None or isinstance(self.environment, int)
        known = checksum if self.checksum is None else self.checksum
        return numbers_are and time_is and version_is and environment_is and known == checksum

    def checksum_under(self, key_checksum: int) -> int:
        """Return the checksum that the run has to have under a key."""
        numbers = PACKED.pack(key_checksum, *self[:7], self.lengths_checksum)
        return zlib.crc32(f"{self.ended} {self.version}".encode(), zlib.crc32(numbers))

    def has(self, lengths: object) -> bool:
        """Whether these are the lengths of its trials, as bytes."""
        return self[3:6] == measure(lengths) and self.lengths_checksum == checksum_of(lengths)

    def about(self) -> dict[str, Any]:
        """Return what its result does not have, by the names of `studies.columns`."""
        return {
            "seed": self.seed,
            "run": self.run,
            "ended": datetime.fromisoformat(self.ended).isoformat(timespec="seconds") + "Z",
            "version": self.version or "unknown",
            "environment": self.environment or 0,
        }


def as_stored(
    seed: int, result: Result, ended: datetime, version: str | None
) -> tuple[StoredRun, bytes]:
    """Return a run as a store holds it, yet without a checksum, and the lengths of its trials."""
    lengths = result.lengths.astype(LENGTH).tobytes()
    run, success, seconds = int(result.run), int(result.success), float(result.seconds)
    when = ended.isoformat(" ", "seconds")
    values = (seed, run, success, *measure(lengths), seconds, when, version, None)
    return StoredRun(*values, checksum_of(lengths), None), lengths


def as_result(row: StoredRun, lengths: bytes) -> Result:
    """Return the result of a stored run."""
    trials = np.frombuffer(lengths, LENGTH).astype(np.int64)
    return Result(row.run, bool(row.success), trials, row.seconds)


def key_checksum(key: object) -> int:
    """Return the checksum of a key; -1, which none has, of what cannot be one."""
    return zlib.crc32(key.encode("utf-8", "surrogatepass")) if isinstance(key, str) else -1


def checksum_of(data: object) -> int:
    """Return the checksum of bytes; -1, which none has, of anything else."""
    return zlib.crc32(data) if isinstance(data, bytes) else -1


def measure(lengths: object) -> tuple[int, int, int]:
    """Return the number of trials, the steps of all, and those of the longest.

    They are -1 if these are not lengths of trials.
    """
    if isinstance(lengths, bytes) and len(lengths) % LENGTH.itemsize == 0:
        trials = np.frombuffer(lengths, LENGTH)
        if trials.min(initial=0) >= 0:
            return len(trials), int(trials.sum(dtype=np.int64)), int(trials.max(initial=0))
    return -1, -1, -1


COMPUTED = {
    "trials": lambda lengths: measure(lengths)[0],
    "steps": lambda lengths: measure(lengths)[1],
    "longest": lambda lengths: measure(lengths)[2],
    "lengths_checksum": checksum_of,
}
"""Columns that old forms of stores do not have, and how each is computed from the lengths."""
