"""A folder for a microcontroller: the learner as an object file, its header, and an example.

The example is the learner on a simulated cart-pole, from the same sources, and runs in QEMU.
"""

import json
from pathlib import Path
from string import Template
from typing import NamedTuple

from upright import __version__
from upright.builds.learner import build_agent, build_cart
from upright.builds.machine import Machine
from upright.errors import require_one_of
from upright.studies.case import Case
from upright.support.files import make_folder, write_file

FIRMWARE = Path(__file__).parent / "firmware"
"""The example's files, the same for all chips but for the board."""


class Cpu(NamedTuple):
    """A processor of microcontrollers."""

    machine: Machine
    compiler: str
    """The compiler that links its programs."""
    flags: str
    """Of that compiler."""
    board: str
    """The file that starts it."""
    code_at: int
    """Address of the program's code on the emulated board."""
    data_at: int
    """Address of its data there."""
    emulator: str
    """The command that runs a program."""
    precisions: tuple[str, ...]
    """Of the learners that it can have, the usual one first."""


SOFT = "-DUPRIGHT_NO_DOUBLE_UNIT"


def _arm(machine: Machine, flags: str, board: str, *precisions: str) -> Cpu:
    emulator = f"qemu-system-arm -M {board} -nographic -semihosting -kernel"
    compiler = "arm-none-eabi-gcc"
    return Cpu(machine, compiler, flags, "board_arm.c", 0, 0x20000000, emulator, precisions)


CPUS = {
    "cortex-m7": _arm(
        Machine("thumbv7em-unknown-none-eabihf", "cortex-m7", "+fp-armv8d16"),
        "-mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16",
        "mps2-an500",
        *("float64", "float32"),
    ),
    # GCC 12 adds numbers of 64 bits for this one by code that rounds a few sums otherwise.
    "cortex-m4": _arm(
        Machine("thumbv7em-unknown-none-eabihf", "cortex-m4", "+vfp4d16sp"),
        f"-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 {SOFT}",
        "mps2-an386",
        "float32",
    ),
    "cortex-m0plus": _arm(
        Machine("thumbv6m-unknown-none-eabi", "cortex-m0plus"),
        f"-mcpu=cortex-m0plus -mthumb -mfloat-abi=soft {SOFT}",
        "mps2-an386",
        *("float32", "float64"),
    ),
    "rv32imc": Cpu(
        machine=Machine("riscv32-unknown-elf", "generic-rv32", "+m,+c"),
        compiler="riscv64-unknown-elf-gcc",
        flags=f"-march=rv32imc -mabi=ilp32 -mcmodel=medany {SOFT}",
        board="board_riscv.c",
        code_at=0x80000000,
        data_at=0x80100000,
        emulator="qemu-system-riscv32 -M virt -bios none -nographic -semihosting -kernel",
        precisions=("float32", "float64"),
    ),
}
"""The processors that can be built for, by name."""


PRECISIONS = {
    "float64": "what it is on a computer, to the last bit",
    "float32": "with other last bits than on a computer, so other trials",
}
"""The precisions that a learner can have, and what that means."""
NUMBER = {"float64": "double", "float32": "float"}
"""Their names in C."""


def build_chip(case: Case, cpu: str, folder: Path | str, precision: str | None = None) -> Path:
    """Write the learner and the example.

    Parameters
    ----------
    case
        The agent with its settings, and the task of the example.
    cpu
        One of CPUS.
    folder
        Where to; it is created if it is missing.

    precision
        One of PRECISIONS; by default float64 if the processor has a unit for it, else float32.

    Returns
    -------
    Path
        The object file of the learner.

    Raises
    ------
    UprightError
        If there is no such processor or precision, the agent cannot be built, or the folder cannot
        be written.
    """
    require_one_of("cpu", cpu, CPUS)
    chip = CPUS[cpu]
    precision = precision or chip.precisions[0]
    require_one_of(f"precision for {cpu}", precision, chip.precisions)
    place = make_folder(folder)
    learner = build_agent(case, chip.machine, single=precision == "float32")
    cart = build_cart(case, chip.machine)
    about = (
        f"{case.agent} of Upright {__version__}, for {cpu}, in {precision}: {PRECISIONS[precision]}"
    )
    size = learner.memory.size
    files: dict[str, bytes | str] = {
        **board_files(chip),
        "main.c": (FIRMWARE / "main.c").read_text(),
        "learner.o": learner.code,
        "learner.h": filled(
            "learner.h", about=about, size=f"{size:,}", words=size // 8, number=NUMBER[precision]
        ),
        "learner.json": json.dumps(learner.memory.layout(), indent=1) + "\n",
        "cart.o": cart.code,
        "cart.h": filled(
            "cart.h",
            words=cart.memory.size // 8,
            observation=cart.memory.offset("observation") // 8,
        ),
    }
    for name, content in files.items():
        write_file(place / name, content)
    return place / "learner.o"


def board_files(chip: Cpu) -> dict[str, str]:
    """Return what a program for the emulated board needs besides itself: texts by name."""
    texts = {
        name: (FIRMWARE / name).read_text() for name in ("board.h", "support.c", "CMakeLists.txt")
    }
    return texts | {
        "board.c": (FIRMWARE / chip.board).read_text(),
        "board.ld": filled("board.ld", code_at=hex(chip.code_at), data_at=hex(chip.data_at)),
        "toolchain.cmake": filled(
            "toolchain.cmake", emulator=chip.emulator, compiler=chip.compiler, flags=chip.flags
        ),
    }


def filled(name: str, **values: object) -> str:
    """Return a file of the example with values in their places."""
    return Template((FIRMWARE / f"{name}.in").read_text()).substitute(values)
