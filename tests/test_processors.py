"""The same trials on every processor: no function of the C library takes part in a run.

glibc chooses its functions by the processor's features, and their last bits differ. Its tunables
hide features, so that one machine stands for two.
"""

import csv
import os
import platform
import subprocess
import sys

import pytest

HIDDEN = "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4,-AVX"
EXPONENTIALS = "import math; print([math.exp(k / 97) for k in range(3000)])"
TABLE = "from upright.commands import main; main()"
ARGUMENTS = (
    "table --agents reinforce,ndp,ase-ace --settings as-published --steps 3000 --trials 300 "
    "--format csv"
)


def printed(program, arguments="", hidden=""):
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments.split()],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"GLIBC_TUNABLES": hidden},
    )
    return done.stdout


def rows(hidden=""):
    lines = printed(TABLE, ARGUMENTS, hidden).splitlines()
    return [row | {"seconds": ""} for row in csv.DictReader(lines)]


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64", reason="the tunables are of x86")
def test_the_features_of_the_processor_change_no_row():
    if printed(EXPONENTIALS) == printed(EXPONENTIALS, hidden=HIDDEN):
        pytest.skip("the C library here has the same bits with and without these features")
    found = rows()
    assert len(found) == 21
    assert found == rows(HIDDEN)
