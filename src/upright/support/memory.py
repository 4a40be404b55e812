"""Whether a process may take the memory that compiling needs."""

import os
import sys
from pathlib import Path

from upright.errors import UprightError

ITSELF, EACH_THREAD = 600_000, 100_000
"""Address space that Numba, SciPy and a study take, and what each thread of BLAS adds [kB]."""


def require_memory() -> None:
    """Raise UprightError if a limit of this process, such as ``ulimit -v``, leaves too little.

    Asked before Numba is imported: with too little, BLAS may wait for ever for its memory, and the
    compiler ends the process.
    """
    if sys.platform != "linux" or "numba" in sys.modules:
        return
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "")
    count = int(threads) if threads.isdecimal() else os.cpu_count() or 1
    needed = _taken() + ITSELF + EACH_THREAD * count
    if limit // 1024 < needed:
        raise UprightError(
            f"memory is limited to {limit // 1024:,} kB (ulimit -v); it must be at least "
            f"{needed:,} kB, of which each of {count} threads of BLAS takes {EACH_THREAD:,} "
            "(OPENBLAS_NUM_THREADS)"
        )


def _taken() -> int:
    """Return the address space that this process has [kB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return pages * os.sysconf("SC_PAGE_SIZE") // 1024
