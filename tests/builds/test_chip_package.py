"""Learners on emulated microcontrollers: every bit is that of the same run here."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from upright.agents import AGENTS
from upright.builds.chip_package import CPUS, FIRMWARE, board_files, build_chip
from upright.builds.learner import build_learner
from upright.core.conditions import NOISES, noise_of
from upright.core.trials import push, start
from upright.errors import UprightError
from upright.policies.npz_file import arrays_of
from upright.studies.case import make_case
from upright.studies.random_streams import random_numbers
from upright.studies.run import make_plant, make_run

HERE = Path(__file__).parent
SHORT = {"steps": 1000, "trials": 12}
SEED, RUN = 7, 3
FNV_START, FNV_FACTOR = 14695981039346656037, 1099511628211
pytestmark = pytest.mark.slow


def printed_by(cpu, folder):
    """Build the program of a folder with CMake, and return what it prints in the emulator."""
    options = ["-S", ".", "-B", "build", "-DCMAKE_TOOLCHAIN_FILE=toolchain.cmake"]
    for command in (["cmake", *options], ["cmake", "--build", "build"]):
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        assert not done.returncode, done.stdout + done.stderr
        assert "warning" not in done.stderr
    command = [*CPUS[cpu].emulator.split(), "build/example.elf"]
    done = subprocess.run(
        command,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=300,
    )
    return done.returncode, done.stdout.splitlines()


# ---- Every agent under every noise, on its plant -------------------------------------------------


def fnv(data):
    total = FNV_START
    for byte in data:
        total = ((total ^ byte) * FNV_FACTOR) % 2**64
    return f"{total:016x}"


def write_whole_run(name, cpu, folder):
    """Write a program that makes runs under all noises, and return the names of its arrays."""
    built = build_learner(make_case(name, **SHORT), CPUS[cpu].machine)
    places = built.memory.places
    agent, _ = make_run(make_case(name, **SHORT), SEED, RUN)
    arrays = [place for place, _ in arrays_of(agent, "agent.")] + ["lengths"]
    fields = [f"task.noise.{field}" for field in noise_of("none")._fields]
    values = [
        [
            int.from_bytes(np.array(value, places[field].dtype).tobytes(), "little")
            for field, value in zip(fields, noise_of(noise), strict=True)
        ]
        for noise in NOISES
    ]

    def table(rows):
        return "{" + ", ".join(table(r) if isinstance(r, list) else f"{r}u" for r in rows) + "}"

    spans = [
        [places[a].offset, places[a].dtype.itemsize * int(np.prod(places[a].shape))] for a in arrays
    ]
    widths = [places[field].dtype.itemsize for field in fields]
    header = [
        f"enum {{ SIZE = {built.memory.size}, RUNS = {len(NOISES)}, ARRAYS = {len(arrays)}, "
        f"NUMBERS = {len(fields)}, SEED = {SEED}, RUN = {RUN} }};",
        f"static const uint32_t arrays[ARRAYS][2] = {table(spans)};",
        f"static const uint32_t offsets[NUMBERS] = {table([places[f].offset for f in fields])};",
        f"static const uint32_t sizes[NUMBERS] = {table(widths)};",
        f"static const uint64_t values[RUNS][NUMBERS] = {table(values)};",
    ]
    (folder / "proof.h").write_text("\n".join(header) + "\n")
    (folder / "learner.o").write_bytes(built.code)
    shutil.copy(HERE / "whole_run.c", folder / "main.c")
    return arrays


WITHOUT_A_UNIT = [("rv32imc", "q-learning"), ("cortex-m0plus", "ase-ace")]


@pytest.mark.chip
@pytest.mark.parametrize(
    ("cpu", "name"), [*(("cortex-m7", name) for name in AGENTS.built_in), *WITHOUT_A_UNIT]
)
def test_a_chip_learns_the_same_to_the_bit(name, cpu, tmp_path):
    for file, text in board_files(CPUS[cpu]).items():
        (tmp_path / file).write_text(text.replace(" cart.o", ""))
    arrays = write_whole_run(name, cpu, tmp_path)
    status, lines = printed_by(cpu, tmp_path)
    assert status == 0
    assert len(lines) == len(NOISES) * len(arrays)
    found = iter(lines)
    for noise in NOISES:
        agent, result = make_run(make_case(name, noise=noise, **SHORT), SEED, RUN)
        lengths = np.zeros(SHORT["trials"], np.int64)
        lengths[: result.trials] = result.lengths
        for array, value in [*arrays_of(agent, "agent."), ("lengths", lengths)]:
            assert next(found) == fnv(value.tobytes()), (noise, array)


# ---- The example: a learner without a plant, and a simulated cart-pole beside it -----------------


def trials_here(case, enough=3000, most=100):
    """Return what the example should print, found with the package's own agent and plant."""
    rng, cart_rng = random_numbers(0, 0), random_numbers(0, 1)
    agent = case.settings.agent(rng)
    plant, task = make_plant(case, 0, 0, np.zeros(1, np.bool_))
    lines = []
    for number in range(1, most + 1):
        observation, fallen, steps = start(plant, task, cart_rng), False, 0
        agent.begin_trial(rng)
        while steps < enough and not fallen:
            before, action = observation, agent.act(observation, rng)
            observation, fallen = push(plant, task, cart_rng, action)
            agent.learn(before, action, observation, fallen)
            steps += 1
        agent.end_trial(fallen)
        lines.append(f"trial {number}: {steps} steps{'' if fallen else ', balanced'}")
        if not fallen:
            break
    return lines


@pytest.mark.chip
@pytest.mark.parametrize("cpu", [cpu for cpu in CPUS if "float64" in CPUS[cpu].precisions])
def test_the_example_makes_the_trials_that_are_made_here(cpu, tmp_path):
    case = make_case("q-learning", noise="gaussian-0.1")
    build_chip(case, cpu, tmp_path, "float64")
    assert printed_by(cpu, tmp_path) == (0, trials_here(case))


@pytest.mark.chip
@pytest.mark.parametrize("name", AGENTS.built_in)
def test_a_learner_in_single_precision_learns(name, tmp_path):
    build_chip(make_case(name), "cortex-m4", tmp_path)
    assert "float upright_number" in (tmp_path / "learner.h").read_text()
    status, lines = printed_by("cortex-m4", tmp_path)
    assert status == 0
    assert len(lines) > 1 or name == "adaptive-lqr"
    assert lines[-1].endswith(": 3000 steps, balanced")


@pytest.mark.chip
def test_reinforce_fits_128_kilobytes(tmp_path):
    settings = {"episodes": 4, "kept_steps": 500}
    build_chip(make_case("reinforce", settings=settings), "cortex-m7", tmp_path)
    assert printed_by("cortex-m7", tmp_path)[0] == 0
    done = subprocess.run(
        ["size", "build/example.elf"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    _, data, bss, *_ = map(int, done.stdout.splitlines()[1].split()[:3])
    assert data + bss < 128_000


# ---- Square roots --------------------------------------------------------------------------------


ROOTS = """
#include <stdint.h>
#include <stdio.h>
double own_sqrt(double x);
int main(void) {
  union { double number; uint64_t bits; } value;
  while (scanf("%llx", (unsigned long long *)&value.bits) == 1) {
    value.number = own_sqrt(value.number);
    printf("%llx\\n", (unsigned long long)value.bits);
  }
}
"""


@pytest.mark.skipif(shutil.which("cc") is None, reason="a C compiler is missing")
def test_the_square_root_is_correctly_rounded(tmp_path):
    rng = np.random.default_rng(5)
    numbers = np.concatenate(
        [
            rng.random(2000),
            np.exp(rng.uniform(-700, 700, 2000)),
            rng.integers(0, 1000, 200).astype(float) ** 2,
            [0.0, -0.0, 1.0, 2.0, 5e-324, 2.2e-308, 1.7976931348623157e308, np.inf],
            np.nextafter(np.arange(1.0, 100.0), 0.0),
        ]
    )
    support = (FIRMWARE / "support.c").read_text()
    for name in ("memcpy", "memset", "sqrtf", "sqrt"):
        support = support.replace(f"{name}(", f"own_{name}(")
    (tmp_path / "support.c").write_text(support)
    (tmp_path / "main.c").write_text(ROOTS)
    command = ["cc", "-DUPRIGHT_NO_DOUBLE_UNIT", "main.c", "support.c", "-o", "roots"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    asked = "\n".join(f"{bits:x}" for bits in numbers.view(np.uint64).tolist())
    done = subprocess.run(
        [tmp_path / "roots"], input=asked, capture_output=True, text=True, check=True
    )
    found = np.array([int(line, 16) for line in done.stdout.split()], np.uint64)
    assert np.array_equal(found, np.sqrt(numbers).view(np.uint64))


# ---- What is refused -----------------------------------------------------------------------------


def test_an_unknown_processor_is_refused(tmp_path):
    with pytest.raises(UprightError, match="cpu is 'z80'; it must be one of cortex-m7, cortex-m4"):
        build_chip(make_case("q-learning"), "z80", tmp_path / "firmware")
    assert not (tmp_path / "firmware").exists()


def test_an_unknown_precision_is_refused(tmp_path):
    with pytest.raises(UprightError, match="precision for cortex-m7 is 'half'; it must be one of"):
        build_chip(make_case("q-learning"), "cortex-m7", tmp_path, "half")
    with pytest.raises(UprightError, match="precision for cortex-m4 is 'float64'; it must be"):
        build_chip(make_case("q-learning"), "cortex-m4", tmp_path, "float64")
