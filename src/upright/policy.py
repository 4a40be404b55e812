"""What was learned, kept in a file with its contract, and played again.

The file is a NumPy archive: `header`, a text in JSON that anybody can read, and the arrays of the
agent's memory. It may come from anywhere, so reading it executes nothing, and allocates no more
than the settings in its header imply, which have bounds.

A policy's form alone, as JSON, is what other languages write and read: it plays as well.
"""

import codecs
import io
import json
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from upright import __version__
from upright.agents import AGENTS, Settings, is_outside, restore_settings
from upright.agents.form_data import NUMBERS, restore_form
from upright.agents.forms import Form
from upright.agents.played import make_memory
from upright.cartpole import State
from upright.errors import UprightError, require, require_one_of
from upright.files import write_file
from upright.plants import PLANTS
from upright.plants.equations import SETTINGS as EQUATIONS
from upright.study import Case
from upright.task import Task, make_task

FORMAT = "upright policy 1"
OBSERVATION = ["x [m]", "x_dot [m/s]", "theta [rad]", "theta_dot [rad/s]"]
ACTION = "push to the right (+F) with the probability that the policy returns, else left"
TASK = ("noise", "start", "steps", "integrator", "condition")
"""What names a task; a policy also knows the seed and the run."""
HEADER = {"agent": str, "task": dict, "settings": dict}
"""What reading needs of a header besides its format; all else is for people."""
HEADER_LIMIT = 2**20
"""Characters that a header may have."""
JSON_FORMAT = "upright policy form 1"
JSON_HEADER = {"agent": str, "task": dict, "form": str}
"""The same of a file in JSON."""
JSON_LIMIT, JSON_MARKS = 2**25, 2 * 10**6
"""How many bytes such a file may have, enough for the largest form; and how many of them may begin
a list, an object or a text, which take more memory than numbers.
"""
LONGEST_ERROR = 500
"""Characters of what is said of a file; its author chose some of them."""
PACKINGS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""How arrays may be packed: so that no more is unpacked than is asked for."""


@dataclass(frozen=True)
class Policy:
    """A learned policy. It balances as an agent does, and learns no more."""

    agent: str
    """Name of the agent that learned it."""
    memory: Any
    """Its memory."""
    task: dict[str, Any]
    """What it learned on: noise, start, steps, integrator, condition, seed and run; and the name of
    the plant, if that was not the equations.
    """

    def __post_init__(self) -> None:
        """Stand at the beginning of a trial."""
        self.begin_trial(np.random.default_rng(0))

    def push_probability(self, observation: State) -> float:
        """Return the probability of a push to the right."""
        return float(self.memory.push_probability(State(*map(float, observation))))

    def begin_trial(self, rng: np.random.Generator) -> None:
        """Forget what was measured in the trial before, where that plays a part."""
        if self._has_history:
            self.memory.begin_trial(rng)

    def act(self, observation: State, rng: np.random.Generator) -> bool:
        """Sample a push."""
        return bool(rng.random() < self.push_probability(observation))

    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        """Learn nothing; remember what was measured, where that plays a part."""
        if self._has_history:
            self.memory.remember(before, action)

    @property
    def _has_history(self) -> bool:
        return hasattr(self.memory, "remember")

    def end_trial(self, fallen: bool) -> None:
        """Learn nothing."""

    def make_task(self) -> Task:
        """Return the task that it learned on, in numbers."""
        return make_task(**{name: self.task[name] for name in TASK})

    @property
    def form(self) -> Form | None:
        """What it computes, as data; None of an agent that does not tell."""
        return self.memory.policy_form() if hasattr(self.memory, "policy_form") else None

    def contract(self) -> dict[str, Any]:
        """Return all that one must know to use the policy, as JSON takes it."""
        form, parameters = self.form, self.make_task().parameters
        inputs = form.contract() if form else {"normalisation": "known to the agent alone"}
        return {
            "version": __version__,
            "agent": self.agent,
            "task": self.task,
            "observation": OBSERVATION,
            **inputs,
            "action": ACTION,
            "force [N]": parameters.force,
            "time step [s]": parameters.time_step,
        }


def check_policy(case: Case) -> None:
    """Make sure that what the case's agent learns can be saved.

    Raises
    ------
    UprightError
        If its memory is no NamedTuple of plain arrays, or it cannot tell the probability of a push.
    """
    agent = case.settings.agent(np.random.default_rng(0))
    plain = hasattr(agent, "_asdict") and not any(a.dtype.hasobject for _, a in _arrays(agent))
    if not (plain and callable(getattr(agent, "push_probability", None))):
        raise UprightError(
            f"agent is {case.agent!r}; its policy cannot be saved: that takes a NamedTuple of "
            "arrays of numbers with the method push_probability(observation)"
        )


def learned_policy(case: Case, seed: int, run: int, memory: Any) -> Policy:
    """Return the policy that an agent learned in a run."""
    task = {name: getattr(case, name) for name in TASK} | {"seed": seed, "run": run}
    if case.plant != EQUATIONS:
        task["plant"] = case.plant.name
    return Policy(case.agent, memory, task)


def save_policy(path: Path | str, policy: Policy, settings: Settings) -> None:
    """Write a policy to a file: a NumPy archive of plain arrays and a header in JSON.

    Raises
    ------
    UprightError
        If the file cannot be written.
    """
    header = {"format": FORMAT, **policy.contract(), "settings": asdict(settings)}
    written = io.BytesIO()
    np.savez_compressed(
        written,
        allow_pickle=False,
        header=np.array(json.dumps(header)),
        **dict(_arrays(policy.memory)),
    )
    write_file(path, written.getvalue())


def load_policy(path: Path | str, agent: str | None = None) -> Policy:
    """Read a policy from a file.

    Nothing in the file is executed, and no more is unpacked than the settings in it imply.

    Parameters
    ----------
    path
        What `save_policy` or `export_policy` wrote, the latter as JSON, or anything else.
    agent
        The agent that learned it. One from outside is code, which is imported; so it must be named
        here, as in the file.

    Raises
    ------
    UprightError
        If the file is missing, damaged, not a policy, or another agent's.
    """
    if _is_json(path):
        return _load_json(path, agent)
    with _opened(path) as archive:
        header = _read_header(archive)
        _check_agent(header["agent"], agent)
        _check_task(header["task"])
        settings = restore_settings(header["agent"], header["settings"])
        memory = settings.agent(np.random.default_rng(0))
        _fill(memory, archive, finite=not is_outside(header["agent"]))
        policy = Policy(header["agent"], memory, header["task"])
        _check_contract(policy, header, {"version"})
    return policy


def _load_json(path: Path | str, agent: str | None) -> Policy:
    with _explained(path):
        entries = _read_json(path)
        _check_agent(entries["agent"], agent)
        if agent is None:
            require_one_of("agent", entries["agent"], AGENTS)
        _check_task(entries["task"])
        memory = make_memory(restore_form(entries))
        policy = Policy(entries["agent"], memory, entries["task"])
        # What these say follows from the form; other languages may word it otherwise.
        _check_contract(policy, entries, {"version", "normalisation", "history"})
    return policy


def read_header(path: Path | str) -> dict[str, Any]:
    """Return what a policy's file says of itself: its contract, and the settings of its agent.

    Of a file in JSON: all but the numbers of its form.

    Raises
    ------
    UprightError
        If the file is missing, damaged, or not a policy.
    """
    if _is_json(path):
        with _explained(path):
            entries = _read_json(path)
        return {name: value for name, value in entries.items() if name not in NUMBERS}
    with _opened(path) as archive:
        return _read_header(archive)


def describe(contract: dict[str, Any]) -> str:
    """Return a contract or a header as text: an entry a line, in printable characters alone."""
    return "\n".join(
        f"{json.dumps(name)[1:-1]}: {json.dumps(value)}" for name, value in contract.items()
    )


def is_policy(path: Path | str) -> bool:
    """Whether a file begins as a policy does, be it damaged further on."""
    return _begin(path)[:2] == b"PK" or _is_json(path)


def _is_json(path: Path | str) -> bool:
    return _begin(path).removeprefix(codecs.BOM_UTF8).lstrip()[:1] == b"{"


def _begin(path: Path | str) -> bytes:
    """Return the first bytes of a file; none where there is no such file."""
    if not Path(path).is_file():
        return b""
    with _explained(path), Path(path).open("rb") as file:
        return file.read(100)


@contextmanager
def _explained(path: Path | str) -> Iterator[None]:
    """Make whatever is wrong with a policy's file one clear error."""
    try:
        yield
    except Exception as error:  # nobody can list how a foreign file makes its readers fail
        said = str(error)
        said = said if len(said) <= LONGEST_ERROR else said[:LONGEST_ERROR] + " …"
        raise UprightError(f"policy is {str(path)!r}; it cannot be read: {said}") from error


@contextmanager
def _opened(path: Path | str) -> Iterator[zipfile.ZipFile]:
    """Open a policy's file."""
    if not Path(path).is_file():
        raise UprightError(f"policy is {str(path)!r}; there is no such file")
    if not zipfile.is_zipfile(path):
        raise UprightError(f"policy is {str(path)!r}; it is damaged, or no file of a policy")
    with _explained(path), zipfile.ZipFile(path) as archive:
        yield archive


def _read_json(path: Path | str) -> dict[str, Any]:
    """Return the entries of a file in JSON, its form yet to be looked at."""
    with Path(path).open("rb") as file:
        data = file.read(JSON_LIMIT + 1)
    if len(data) > JSON_LIMIT:
        raise ValueError(f"it is larger than {JSON_LIMIT:,} bytes")
    if sum(map(data.count, (b"[", b"{", b'"'))) > JSON_MARKS:
        raise ValueError(f"it has more than {JSON_MARKS:,} lists, objects and texts")
    entries = json.loads(data.decode("utf-8-sig"), parse_constant=_refuse_constant)
    return _check_header(entries, JSON_FORMAT, JSON_HEADER)


def _refuse_constant(name: str) -> None:
    raise ValueError(f"it holds {name}, which is no number")


def _read_header(archive: zipfile.ZipFile) -> dict[str, Any]:
    if any(info.compress_type not in PACKINGS for info in archive.infolist()):
        raise ValueError("it is packed in an unknown way")
    with archive.open("header.npy") as member:
        shape, _, dtype = _declared(member)
        if shape != () or dtype.kind != "U" or dtype.itemsize > 4 * HEADER_LIMIT:
            raise ValueError(f"its header is no text of at most {HEADER_LIMIT:,} characters")
        header = json.loads(str(np.ndarray((), dtype, _read(member, dtype.itemsize))))
    return _check_header(header, FORMAT, HEADER)


def _check_header(header: Any, form: str, needed: Mapping[str, type]) -> dict[str, Any]:
    """Return a header, having made sure that it is one of this format."""
    if not isinstance(header, dict) or header.get("format") != form:
        raise ValueError(f"it does not say that its format is {form!r}")
    for name, kind in needed.items():
        if not isinstance(header.get(name), kind):
            raise ValueError(f"it does not tell its {name}")
    return header


def _check_agent(found: str, named: str | None) -> None:
    """Make sure that no code is imported because a file says so."""
    if named is not None and named != found:
        raise ValueError(f"it was learned by {found!r}, not by {named!r}")
    if named is None and is_outside(found):
        raise ValueError(
            f"it was learned by {found!r}, code from outside the package, which is run only if "
            "you name it: --agent MODULE:NAME, or agent= in Python"
        )


def _fill(memory: Any, archive: zipfile.ZipFile, *, finite: bool) -> None:
    """Set all arrays of a memory, having compared what is declared with what is due."""
    arrays = _arrays(memory)
    found, due = archive.namelist(), ["header.npy", *(f"{name}.npy" for name, _ in arrays)]
    if sorted(found) != sorted(due):
        odd = sorted(set(found) ^ set(due)) or "one that is there twice"
        raise ValueError(f"it does not hold the arrays of its agent; it differs in {odd}")
    for name, array in arrays:
        with archive.open(f"{name}.npy") as member:
            shape, by_columns, dtype = _declared(member)
            if (shape, dtype) != (array.shape, array.dtype) or dtype.hasobject:
                raise ValueError(
                    f"{name} is {dtype} of shape {shape}; "
                    f"it must be {array.dtype} of shape {array.shape}, and never objects"
                )
            data = _read(member, array.nbytes)
        array[...] = np.ndarray(shape, dtype, data, order="F" if by_columns else "C")
        if finite and not np.isfinite(array).all():
            raise ValueError(f"{name} holds a number that is not finite")


def _declared(member: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return what a NumPy file says it holds: shape, whether column by column, and type."""
    if np.lib.format.read_magic(member) != (1, 0):
        raise ValueError("it is written in an unknown way")
    return np.lib.format.read_array_header_1_0(member)


def _read(member: IO[bytes], size: int) -> bytes:
    """Return the rest of a file, which must have this size; no more is unpacked."""
    data = member.read(size + 1)
    if len(data) != size:
        raise ValueError(f"{member.name} is shorter or longer than it says")
    return data


def _check_task(task: dict[str, Any]) -> None:
    if task.keys() - {"plant"} != {*TASK, "seed", "run"}:
        raise ValueError(f"its task must tell {', '.join(TASK)}, seed and run")
    make_task(**{name: task[name] for name in TASK})
    for name in ("seed", "run"):
        require(name, task[name], 0, whole=True)
    require_one_of("plant", task.get("plant", EQUATIONS.name), PLANTS)


def _check_contract(policy: Policy, header: dict[str, Any], for_people: set[str]) -> None:
    """Make sure that what the file promises is what its policy does."""
    for name, ours in policy.contract().items():
        if name not in for_people and header.get(name, ours) != ours:
            raise ValueError(f"it says of {name}: {header[name]!r}; it must be {ours!r}")


def _arrays(memory: Any, prefix: str = "") -> list[tuple[str, np.ndarray]]:
    """Return all arrays of a memory, those of the tuples in it included, by name."""
    found = []
    for name, value in memory._asdict().items():
        if isinstance(value, np.ndarray):
            found.append((prefix + name, value))
        elif hasattr(value, "_asdict"):
            found += _arrays(value, f"{prefix}{name}.")
    return found
