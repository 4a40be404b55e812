"""From LLVM's code of several functions to an object file for another machine."""

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import llvmlite.binding as llvm

from upright.builds.memory import Memory
from upright.builds.numba_inside import Leaf, Lowered
from upright.errors import UprightError

OWN = re.compile(r"llvm\.(?!(?:exp|exp2|pow|powi|log|log2|log10|sin|cos|tan)\.)")
"""Names of what a machine does by itself; the others are functions of its C library."""
OUTSIDE = {"i64": "i32", "i8": "i32", "double": "double", "float": "float", "ptr": "void"}
"""What callers give and get for each of Numba's types; its pointer to a result may be to none."""


class Machine(NamedTuple):
    """A machine to build for, by LLVM's names."""

    triple: str
    cpu: str = ""
    features: str = ""


class Function(NamedTuple):
    """A function to export."""

    lowered: Lowered
    given: tuple[str, ...] = ()
    """Names of the arguments that the caller gives, number by number."""

    def is_given(self, leaf: Leaf) -> bool:
        """Whether the caller gives a number, or else memory holds it."""
        return leaf.name.partition(".")[0] in self.given

    def leaves(self) -> list[Leaf]:
        """Return what its other arguments consist of, which is taken from memory."""
        return [leaf for leaf in self.lowered.leaves if not self.is_given(leaf)]


def emit(
    functions: Mapping[str, Function], memory: Memory, machine: Machine, prefix: str = ""
) -> bytes:
    """Return an object file.

    Each function takes a pointer to the memory, then what it is given, and returns a number or
    nothing. Whole numbers and truth values have 32 bits there. Another function, `begin`, sets the
    memory to what it holds at first.

    Parameters
    ----------
    functions
        Functions by the names that they get.
    memory
        How their memory is laid out.
    machine
        What to build for.
    prefix
        What all names begin with.

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
    module = llvm.parse_assembly(_begin(f"{prefix}begin", memory))
    module.triple, module.data_layout = machine.triple, layout
    for name, function in functions.items():
        text = _retargeted(function.lowered.text, machine.triple, layout)
        module.link_in(llvm.parse_assembly(text + _wrapper(prefix + name, function, memory)))
    _refuse_library(module)
    exported = {prefix + name for name in ("begin", *functions)}
    for each in module.functions:
        if not each.is_declaration and each.name not in exported:
            each.linkage = llvm.Linkage.internal
    module.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=2)
    options.loop_vectorization = options.slp_vectorization = False
    builder = llvm.create_pass_builder(target, options)
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
    for name, own, kind in (
        ("sqrt", "llvm.sqrt.f64", "double"),
        ("sqrtf", "llvm.sqrt.f32", "float"),
    ):
        text = re.sub(rf"^declare {kind} @({re.escape(own)}|{name})\(.*$", "", text, flags=re.M)
        text = re.sub(rf"@{name}\b", f"@{own}", text)
        text += f"\ndeclare {kind} @{own}({kind})\n"
    return text


def _begin(name: str, memory: Memory) -> str:
    """Return the code of a function that sets the memory to what it holds at first."""
    count, rest = len(memory.initial), memory.size - len(memory.initial)
    content = "".join(f"\\{byte:02x}" for byte in memory.initial)
    return f"""
@initial = internal constant [{count} x i8] c"{content}", align 8
declare void @llvm.memcpy.p0.p0.i32(ptr, ptr, i32, i1)
declare void @llvm.memset.p0.i32(ptr, i8, i32, i1)
define void @{name}(ptr %memory) {{
  call void @llvm.memcpy.p0.p0.i32(ptr %memory, ptr @initial, i32 {count}, i1 false)
  %rest = getelementptr i8, ptr %memory, i32 {count}
  call void @llvm.memset.p0.i32(ptr %rest, i8 0, i32 {rest}, i1 false)
  ret void
}}
"""


def _wrapper(name: str, function: Function, memory: Memory) -> str:
    """Return the code of a function that takes its arguments from memory, or is given them."""
    lowered = function.lowered
    lines, parameters, passed = [], ["ptr %memory"], ["ptr %result", "ptr %exception"]
    for i, leaf in enumerate(lowered.leaves):
        if function.is_given(leaf):
            parameters.append(f"{OUTSIDE[leaf.kind]} %g{i}")
            code, value = _inwards(i, leaf.kind)
        else:
            code, value = _argument(i, leaf, memory)
        lines += code
        passed.append(f"{leaf.kind} {value}")
    result = OUTSIDE[lowered.result]
    body = "\n  ".join(lines)
    return f"""
define {result} @{name}({", ".join(parameters)}) {{
  %result = alloca {lowered.result}, align 8
  %exception = alloca ptr, align 8
  {body}
  %status = call i32 @"{lowered.symbol}"({", ".join(passed)})
  {_returned(lowered.result)}
}}
"""


def _inwards(i: int, kind: str) -> tuple[list[str], str]:
    """Return the code that makes one of Numba's numbers of what is given, and what it is called."""
    if kind == "i64":
        return [f"%v{i} = zext i32 %g{i} to i64"], f"%v{i}"
    if kind == "i8":
        truth = [f"%t{i} = icmp ne i32 %g{i}, 0", f"%v{i} = zext i1 %t{i} to i8"]
        return truth, f"%v{i}"
    return [], f"%g{i}"


def _returned(kind: str) -> str:
    """Return the code that returns a result of Numba's."""
    if kind == "ptr":
        return "ret void"
    load = f"%returned = load {kind}, ptr %result, align 8"
    if kind in ("double", "float"):
        return f"{load}\n  ret {kind} %returned"
    convert = "trunc i64" if kind == "i64" else "zext i8"
    return f"{load}\n  %number = {convert} %returned to i32\n  ret i32 %number"


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
