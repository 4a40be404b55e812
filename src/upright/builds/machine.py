"""From LLVM's code of several functions to an object file for another machine."""

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import llvmlite.binding as llvm

from upright.builds.memory import Memory
from upright.builds.numba_inside import Leaf, Lowered
from upright.errors import UprightError

OWN = re.compile(r"llvm\.(?!(?:exp|pow|log|sin|cos|tan))")
"""Names of what a machine does by itself; the others are functions of its C library."""


class Machine(NamedTuple):
    """A machine to build for, by LLVM's names."""

    triple: str
    cpu: str = ""
    features: str = ""


class Function(NamedTuple):
    """A function to export."""

    lowered: Lowered
    given: tuple[str, ...] = ()
    """Names of the arguments that the caller gives, as numbers of 32 bits."""

    def leaves(self) -> list[Leaf]:
        """Return what its other arguments consist of, which is taken from memory."""
        return [leaf for leaf in self.lowered.leaves if leaf.name not in self.given]


def emit(functions: Mapping[str, Function], memory: Memory, machine: Machine) -> bytes:
    """Return an object file.

    Each function takes a pointer to the memory of a learner, then what it is given. Another one,
    `begin`, sets the memory to what it holds at first.

    Raises
    ------
    UprightError
        If a function calls the C library.
    """
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple(machine.triple).create_target_machine(
        cpu=machine.cpu, features=machine.features, opt=3, reloc="static"
    )
    layout = str(target.target_data)
    module = llvm.parse_assembly(_begin(memory))
    module.triple, module.data_layout = machine.triple, layout
    for name, function in functions.items():
        text = _retargeted(function.lowered.text, machine.triple, layout)
        module.link_in(llvm.parse_assembly(text + _wrapper(name, function, memory)))
    _refuse_library(module)
    for each in module.functions:
        if not each.is_declaration and each.name not in (*functions, "begin"):
            each.linkage = llvm.Linkage.internal
    module.verify()
    builder = llvm.create_pass_builder(target, llvm.create_pipeline_tuning_options(speed_level=2))
    builder.getModulePassManager().run(module, builder)
    return bytes(target.emit_object(module))


def _refuse_library(module: Any) -> None:
    """Raise UprightError if something is left to the C library, as no two are the same."""
    called = {f.name for f in module.functions if f.is_declaration and not OWN.match(f.name)}
    if called:
        names = sorted(name.removeprefix("llvm.").partition(".")[0] for name in called)
        raise UprightError(
            f"it calls {', '.join(names)} of the C library, whose last bits differ from machine to "
            "machine (upright.core.portable_math has functions that do not)"
        )


def _retargeted(text: str, triple: str, layout: str) -> str:
    text = re.sub(r"^target datalayout = .*$", f'target datalayout = "{layout}"', text, flags=re.M)
    text = re.sub(r"^target triple = .*$", f'target triple = "{triple}"', text, flags=re.M)
    # LLVM's writer for wasm knows no common symbols.
    text = re.sub(r"= common ((local_unnamed_addr )?)global", r"= internal \1global", text)
    # A square root is an instruction of the machine, not a function of the C library.
    text = re.sub(r"^declare double @(llvm\.sqrt\.f64|sqrt)\(.*$", "", text, flags=re.M)
    text = re.sub(r"@sqrt\b", "@llvm.sqrt.f64", text)
    return f"{text}\ndeclare double @llvm.sqrt.f64(double)\n"


def _begin(memory: Memory) -> str:
    """Return the code of a function that sets the memory to what it holds at first."""
    count, rest = len(memory.initial), memory.size - len(memory.initial)
    content = "".join(f"\\{byte:02x}" for byte in memory.initial)
    return f"""
@initial = internal constant [{count} x i8] c"{content}", align 8
declare void @llvm.memcpy.p0.p0.i32(ptr, ptr, i32, i1)
declare void @llvm.memset.p0.i32(ptr, i8, i32, i1)
define void @begin(ptr %memory) {{
  call void @llvm.memcpy.p0.p0.i32(ptr %memory, ptr @initial, i32 {count}, i1 false)
  %rest = getelementptr i8, ptr %memory, i32 {count}
  call void @llvm.memset.p0.i32(ptr %rest, i8 0, i32 {rest}, i1 false)
  ret void
}}
"""


def _wrapper(name: str, function: Function, memory: Memory) -> str:
    """Return the code of a function that takes its arguments from memory."""
    lowered = function.lowered
    lines, passed = [], ["ptr %result", "ptr %exception"]
    for i, leaf in enumerate(lowered.leaves):
        if leaf.name in function.given:
            lines.append(f"%v{i} = zext i32 %{leaf.name} to i64")
            passed.append(f"i64 %v{i}")
        else:
            code, value = _argument(i, leaf, memory)
            lines += code
            passed.append(f"{leaf.kind} {value}")
    given = "".join(f", i32 %{each}" for each in function.given)
    body = "\n  ".join(lines)
    return f"""
define {lowered.result} @{name}(ptr %memory{given}) {{
  %result = alloca {lowered.result}, align 8
  %exception = alloca ptr, align 8
  {body}
  %status = call i32 @"{lowered.symbol}"({", ".join(passed)})
  %returned = load {lowered.result}, ptr %result, align 8
  ret {lowered.result} %returned
}}
"""


def _argument(i: int, leaf: Leaf, memory: Memory) -> tuple[list[str], str]:
    """Return the code that takes an argument from memory, and what it is called."""
    if leaf.fixed:
        return [], str(leaf.value)
    if leaf.value is None:
        return [], "null"
    place = f"%p{i} = getelementptr i8, ptr %memory, i32 {memory.offset(leaf.name)}"
    if leaf.kind == "ptr":
        return [place], f"%p{i}"
    return [place, f"%v{i} = load {leaf.kind}, ptr %p{i}, align 8"], f"%v{i}"
