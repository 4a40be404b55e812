import os
import subprocess
import sys

import pytest

from upright.support.memory import EACH_THREAD, ITSELF

if sys.platform != "linux":
    pytest.skip("limits of memory are Linux's", allow_module_level=True)

TABLE = "table --agents random-search --noises none --runs 2 --steps 100"


def limited(limit, work):
    """Run a command in this much address space [kB]; fail if it takes long."""
    command = f"import resource\nresource.setrlimit(resource.RLIMIT_AS, ({limit * 1024},) * 2)\n"
    command += f"from upright.commands import run\nraise SystemExit(run({work.split()!r}))"
    return subprocess.run(
        [sys.executable, "-c", command], capture_output=True, text=True, timeout=120, check=False
    )


@pytest.mark.parametrize("limit", [300_000, 450_000, 550_000, 600_000, 650_000])
def test_with_too_little_memory_a_command_ends_with_one_line(limit):
    ended = limited(limit, TABLE)
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert ended.stderr.startswith(f"upright: error: memory is limited to {limit:,} kB")
    assert ended.stderr.count("\n") == 1


@pytest.mark.slow
def test_with_enough_memory_a_study_ends_well():

    ended = limited(ITSELF + EACH_THREAD * os.cpu_count() + 50_000, TABLE)
    assert ended.returncode == 0, ended.stderr
