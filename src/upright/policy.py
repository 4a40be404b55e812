"""What was learned, kept in a file and played again."""

import io
import json
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from upright import __version__
from upright.agents import Settings, restore_settings
from upright.cartpole import State
from upright.errors import UprightError
from upright.files import write_file
from upright.study import Case

FORMAT = "upright policy 1"


@dataclass(frozen=True)
class Policy:
    """A learned policy. It balances as an agent does, and learns no more."""

    agent: str
    """Name of the agent that learned it."""
    memory: Any
    """Its memory."""
    task: dict[str, Any]
    """What it learned on: noise, start, steps, integrator, condition, seed and run."""

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


def check_policy(case: Case) -> None:
    """Make sure that what the case's agent learns can be saved.

    Raises
    ------
    UprightError
        If its memory is no NamedTuple, or it cannot tell the probability of a push.
    """
    agent = case.settings.agent(np.random.default_rng(0))
    if not (hasattr(agent, "_asdict") and callable(getattr(agent, "push_probability", None))):
        raise UprightError(
            f"agent is {case.agent!r}; its policy cannot be saved: that takes a NamedTuple of "
            "arrays with the method push_probability(observation)"
        )


def learned_policy(case: Case, seed: int, run: int, memory: Any) -> Policy:
    """Return the policy that an agent learned in a run."""
    names = ("noise", "start", "steps", "integrator", "condition")
    task = {name: getattr(case, name) for name in names} | {"seed": seed, "run": run}
    return Policy(case.agent, memory, task)


def save_policy(path: Path | str, policy: Policy, settings: Settings) -> None:
    """Write a policy to a file: a NumPy archive of plain arrays and a header in JSON.

    Raises
    ------
    UprightError
        If the file cannot be written.
    """
    header = {
        "format": FORMAT,
        "version": __version__,
        "agent": policy.agent,
        "settings": asdict(settings),
        "task": policy.task,
        "observation": ["x [m]", "x_dot [m/s]", "theta [rad]", "theta_dot [rad/s]"],
        "action": "push to the right (+F) with the probability that the policy returns, else left",
    }
    written = io.BytesIO()
    np.savez_compressed(
        written,
        allow_pickle=False,
        header=np.array(json.dumps(header)),
        **dict(_arrays(policy.memory)),
    )
    write_file(path, written.getvalue())


def load_policy(path: Path | str) -> Policy:
    """Read a policy from a file.

    Nothing in the file is executed. Of an agent from outside it holds the name, and the module of
    this name is imported.

    Raises
    ------
    UprightError
        If the file is missing, damaged, or not a policy.
    """
    if not Path(path).is_file():
        raise UprightError(f"policy is {str(path)!r}; there is no such file")
    if not zipfile.is_zipfile(path):
        raise UprightError(f"policy is {str(path)!r}; it is damaged, or no file of a policy")
    try:
        with np.load(path, allow_pickle=False) as archive:
            header = json.loads(str(archive["header"]))
            if header["format"] != FORMAT:
                raise ValueError("it is of another format")
            settings = restore_settings(header["agent"], header["settings"])
            memory = settings.agent(np.random.default_rng(0))
            for name, array in _arrays(memory):
                if archive[name].shape != array.shape:
                    raise ValueError(f"{name} has another shape")
                array[...] = archive[name]
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,  # an agent from outside is no NamedTuple any more
        EOFError,
        zipfile.BadZipFile,
    ) as error:
        raise UprightError(f"policy is {str(path)!r}; it cannot be read: {error}") from None
    return Policy(header["agent"], memory, header["task"])


def _arrays(memory: Any, prefix: str = "") -> list[tuple[str, np.ndarray]]:
    """Return all arrays of a memory, those of the tuples in it included, by name."""
    found = []
    for name, value in memory._asdict().items():
        if isinstance(value, np.ndarray):
            found.append((prefix + name, value))
        elif hasattr(value, "_asdict"):
            found += _arrays(value, f"{prefix}{name}.")
    return found
