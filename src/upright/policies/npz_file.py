"""Policies as NumPy archives: a header, and what the agent learned.

`header` is JSON text that anyone can read. If the agent's memory is a NamedTuple of arrays, the
other members are these arrays. The state of a plain Python agent is JSON in the member `state`, and
the arrays that it refers to by number, `array 0` and so on.

Files may come from anyone, so reading one executes nothing. A memory takes no more than the
settings in the header imply, which are bounded; a state takes memory in proportion to the size of
the file, because it is not compressed.
"""

import hashlib
import io
import json
import math
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np

from upright.agents import AGENTS, is_custom
from upright.core.compiled import is_compiled
from upright.errors import UprightError
from upright.policies.checks import (
    check_agent,
    check_contract,
    check_header,
    check_json_size,
    explained,
    is_greedy,
    parse_json,
    read_task,
)
from upright.policies.plain_state import (
    ARRAYS,
    PlainState,
    decode_state,
    describe_state,
    encode_state,
)
from upright.policies.policy import Policy, check_form
from upright.policies.stages import SavedAs, describe_stages, read_stages
from upright.support.settings import values_of

FORMAT = "upright policy 1"
"""The format of memories, which are NamedTuples of arrays."""
PLAIN_FORMAT = "upright policy 2"
"""The format of the states of plain Python agents."""
HEADER = {"agent": str, "task": dict, "settings": dict}
"""What reading needs of a header besides its format, and the types; the rest is for people."""
HEADER_LIMIT = 2**20
"""Maximum length of a header, in characters."""
STATE = "state"
"""Name of the member that holds a plain state, but for its arrays."""
PACKINGS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Accepted compression methods, which unpack no more than is asked for."""
LARGEST_COUNT = 10**15
"""Largest whole number in an agent's memory, far from where sums overflow."""


def encode(policy: Policy) -> bytes:
    """Return a policy as a NumPy archive of plain arrays, with a header in JSON.

    Raises
    ------
    UprightError
        If the settings of the policy's agent are unknown, or something that the agent keeps is not
        data, or not a number that `load_policy` would accept.
    """
    if policy.settings is None:
        raise UprightError(
            f"policy is one of {policy.agent!r} without its settings; it can be exported as JSON"
        )
    header = {"format": FORMAT, **policy.contract(), "settings": values_of(policy.settings)}
    if policy.stages:
        header["stages"] = [stage.as_data() for stage in policy.stages]
    save = np.savez_compressed
    if not is_memory(policy.agent, policy.memory):
        header |= {"format": PLAIN_FORMAT, "state": describe_state(policy.memory)}
        save = np.savez  # its size is the only bound of what it holds
    members = {"header": np.array(json.dumps(header)), **_members(policy)}
    written = io.BytesIO()
    save(written, allow_pickle=False, **members)
    return written.getvalue()


def check_saving(policy: Policy) -> None:
    """Check that a policy of a custom agent can be saved and played.

    Raises
    ------
    UprightError
        If the agent has neither `push_probability` nor `act`, or keeps something that is not data.
    """
    plays = (getattr(policy.memory, name, None) for name in ("push_probability", "act"))
    if not any(map(callable, plays)):
        raise _cannot_be_saved(
            policy, "it has no push_probability(observation), which is needed to play it"
        )
    _members(policy)


def _members(policy: Policy) -> dict[str, np.ndarray]:
    """Return what an archive holds of what an agent learned."""
    if not is_memory(policy.agent, policy.memory):
        return _state_members(policy)
    arrays = dict(arrays_of(policy.memory))
    if objects := [name for name, array in arrays.items() if array.dtype.hasobject]:
        raise _cannot_be_saved(policy, f"its array {objects[0]!r} holds objects, not numbers")
    try:
        check_memory(policy.agent, policy.memory)
        check_form(policy)
    except ValueError as error:
        raise _cannot_be_saved(policy, f"{error}; its learning diverged") from error
    return arrays


def _state_members(policy: Policy) -> dict[str, np.ndarray]:
    assert policy.settings is not None
    fresh = policy.settings.agent(np.random.default_rng(0))
    state = encode_state(policy.agent, policy.memory, fresh)
    text = json.dumps(state.data, allow_nan=False).encode()
    try:
        check_json_size(text)
    except ValueError as error:
        raise _cannot_be_saved(policy, f"apart from arrays, {error}") from error
    return {STATE: np.array(text), **{_array(i): each for i, each in enumerate(state.arrays)}}


def _cannot_be_saved(policy: Policy, reason: str) -> UprightError:
    return UprightError(f"agent is {policy.agent!r}; its policy cannot be saved: {reason}")


def _array(number: int) -> str:
    return f"array {number}"


def begins(start: bytes) -> bool:
    """Whether a file that starts with these bytes is an archive."""
    return start[:2] == b"PK"


def read(path: Path | str, agent: str | None) -> Policy:
    """Read a policy, as `files.load_policy` does."""
    with _opened(path) as archive:
        header = _read_header(archive)
        check_agent(header["agent"], agent)
        settings = AGENTS.restore(header["agent"], header["settings"])
        memory = settings.agent(np.random.default_rng(0))
        if header["format"] == PLAIN_FORMAT:
            if is_memory(header["agent"], memory):
                raise _of_another_form("the state of a plain Python agent")
            memory = decode_state(_read_state(archive, Path(path).stat().st_size), memory)
        else:
            if not hasattr(memory, "_asdict"):
                raise _of_another_form("a NamedTuple")
            _fill(memory, archive, renamed=getattr(settings, "RENAMED_ARRAYS", {}))
            check_memory(header["agent"], memory)
        policy = Policy(
            header["agent"],
            memory,
            **read_task(header["task"]),
            settings=settings,
            stages=read_stages(header.get("stages", [])),
            saved_as=SavedAs(Path(path).name, hashlib.sha256(Path(path).read_bytes()).hexdigest()),
            greedy=is_greedy(header),
        )
        check_form(policy)
        check_contract(policy, header, {"version"})
    return policy


def _of_another_form(held: str) -> ValueError:
    return ValueError(
        f"it holds {held}; the agent is no such thing; has the agent's code changed since?"
    )


def read_header(path: Path | str) -> dict[str, Any]:
    """Return the header of an archive, with an entry for each stage."""
    with _opened(path) as archive:
        header = _read_header(archive)
        read_task(header["task"])
        stages = describe_stages(read_stages(header.pop("stages", [])))
    return header | stages


@contextmanager
def _opened(path: Path | str) -> Iterator[zipfile.ZipFile]:
    """Open a policy's file."""
    if not zipfile.is_zipfile(path):
        raise UprightError(f"policy is {str(path)!r}; it is damaged, or not a policy's file")
    with explained(path), zipfile.ZipFile(path) as archive:
        yield archive


def _read_header(archive: zipfile.ZipFile) -> dict[str, Any]:
    """Return the header of an archive, checked."""
    if any(info.compress_type not in PACKINGS for info in archive.infolist()):
        raise ValueError("it is compressed in an unknown way")
    with archive.open("header.npy") as member:
        shape, _, dtype = _declared(member)
        if shape != () or dtype.kind != "U" or dtype.itemsize > 4 * HEADER_LIMIT:
            raise ValueError(f"its header is not a text of at most {HEADER_LIMIT:,} characters")
        header = json.loads(str(np.ndarray((), dtype, _read(member, dtype.itemsize))))
    return check_header(header, HEADER, FORMAT, PLAIN_FORMAT)


def _read_state(archive: zipfile.ZipFile, size: int) -> PlainState:
    """Return the state in an archive, of which only its form is checked.

    Parameters
    ----------
    size
        Size of the file [bytes]; no more than this is read from it.
    """
    members = archive.infolist()
    if any(info.compress_type != zipfile.ZIP_STORED for info in members):
        raise ValueError("it is compressed, and a state must not be")
    if sum(info.file_size for info in members) > size:
        raise ValueError("it holds more than its size")
    due = ["header", STATE, *(_array(i) for i in range(len(members) - 2))]
    if sorted(archive.namelist()) != sorted(f"{name}.npy" for name in due):
        raise ValueError("it does not hold a header, a state and the arrays of that state")
    text = _read_array(archive, STATE)
    if text.shape != () or text.dtype.kind != "S":
        raise ValueError("its state is not a text")
    return PlainState(parse_json(text.item()), [_read_array(archive, name) for name in due[2:]])


def _read_array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    """Return an array of any size and plain type."""
    with archive.open(f"{name}.npy") as member:
        shape, by_columns, dtype = _declared(member)
        if dtype.kind not in ARRAYS or dtype.itemsize == 0:
            raise ValueError(f"{name} is of {dtype}, which is neither numbers nor text")
        data = bytearray(_read(member, math.prod(shape) * dtype.itemsize))
    return np.ndarray(shape, dtype, data, order="F" if by_columns else "C")


def _fill(memory: Any, archive: zipfile.ZipFile, *, renamed: Mapping[str, str]) -> None:
    """Fill all arrays of a memory after checking that the archive declares the same ones.

    `renamed` maps the names of arrays in older files to their present names.
    """
    arrays = arrays_of(memory)
    present = {f"{old}.npy": f"{new}.npy" for old, new in renamed.items()}
    members = {present.get(name, name): name for name in archive.namelist()}
    found = [present.get(name, name) for name in archive.namelist()]
    due = ["header.npy", *(f"{name}.npy" for name, _ in arrays)]
    if sorted(found) != sorted(due):
        odd = sorted(set(found) ^ set(due)) or "one that occurs twice"
        raise ValueError(f"it does not hold the arrays of its agent; it differs in {odd}")
    for name, array in arrays:
        with archive.open(members[f"{name}.npy"]) as member:
            shape, by_columns, dtype = _declared(member)
            if (shape, dtype) != (array.shape, array.dtype) or dtype.hasobject:
                raise ValueError(
                    f"{name} is {dtype} of shape {shape}; "
                    f"it must be {array.dtype} of shape {array.shape}, and never objects"
                )
            data = _read(member, array.nbytes)
        array[...] = np.ndarray(shape, dtype, data, order="F" if by_columns else "C")


def check_memory(agent: str, memory: Any) -> None:
    """Raise ValueError unless compiled code can work with the numbers in a memory.

    It trusts indices blindly: `index_limits()` of a memory returns the least and the greatest
    number that may stand in its arrays of indices, by name. Of the package's own agents, other
    whole numbers are counts, and all numbers are finite.
    """
    limits: dict[str, tuple[int, int]] = getattr(memory, "index_limits", dict)()
    for name, array in arrays_of(memory):
        if array.dtype.kind == "i" and (name in limits or not is_custom(agent)):
            low, high = limits.get(name, (0, LARGEST_COUNT))
            if not ((low <= array) & (array <= high)).all():
                raise ValueError(f"{name} holds a number that is not from {low:,} to {high:,}")
        elif not is_custom(agent) and not np.isfinite(array).all():
            raise ValueError(f"{name} holds a number that is not finite")


def is_memory(agent: str, memory: Any) -> bool:
    """Whether an agent is saved as a memory: a NamedTuple in which only arrays change.

    The package's own agents are; custom ones if they are compiled, or consist of arrays alone.
    """
    if not is_custom(agent) or is_compiled(memory):
        return True
    return hasattr(memory, "_asdict") and _holds_arrays_alone(memory)


def _holds_arrays_alone(memory: Any) -> bool:
    return all(
        isinstance(part, np.ndarray) or (hasattr(part, "_asdict") and _holds_arrays_alone(part))
        for part in memory
    )


def _declared(member: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return what a NumPy file declares: shape, whether in column order, and type."""
    if np.lib.format.read_magic(member) != (1, 0):
        raise ValueError("it is in an unknown version of NumPy's format")
    return np.lib.format.read_array_header_1_0(member)


def _read(member: IO[bytes], size: int) -> bytes:
    """Return the rest of a file, which must have this size [bytes]; no more is unpacked."""
    data = member.read(size + 1)
    if len(data) != size:
        raise ValueError(f"{member.name} is shorter or longer than it declares")
    return data


def arrays_of(memory: Any, prefix: str = "") -> list[tuple[str, np.ndarray]]:
    """Return the names and arrays of a memory, including those of tuples within it."""
    found = []
    for name, value in memory._asdict().items():
        if isinstance(value, np.ndarray):
            found.append((prefix + name, value))
        elif hasattr(value, "_asdict"):
            found += arrays_of(value, f"{prefix}{name}.")
    return found
