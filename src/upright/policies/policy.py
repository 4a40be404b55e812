"""A learned policy: what it computes, and the contract that describes how to use it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from upright import __version__
from upright.agents import Settings, is_custom
from upright.agents.checks.faults import reporting
from upright.agents.parts.policy_form import Form
from upright.core.parameters import State
from upright.core.task import TaskSpec
from upright.errors import AgentError, UprightError
from upright.plants import describe_plant
from upright.plants.equations import EQUATIONS
from upright.policies.acting import Actor
from upright.policies.form_json import form_entries, restore_form
from upright.policies.greedy import GREEDY_ACTION, greedy_form
from upright.policies.stages import SavedAs, Stage
from upright.support.short_repr import call

OBSERVATION = ["x [m]", "x_dot [m/s]", "theta [rad]", "theta_dot [rad/s]"]
ACTION = "push to the right (+F) with the probability that the policy returns, else left"


@dataclass(frozen=True)
class Policy:
    """A learned policy. It balances like an agent, without learning.

    An agent with the method `push_probability` is asked for it, and pushes are drawn. Of another
    one only `act` is called, on its state as it was at the end of the run: each trial begins with a
    copy of it, and the probability of a push is estimated by asking that copy, 25 times if it draws
    random numbers. If the agent also has `remember(observation, action)`, its `begin_trial` is
    called before a trial, and `remember` after each step, so that it can keep a history.

    Examples
    --------
    >>> policy, _ = upright.learn("random-search", steps=300, seed=3)
    >>> policy.push_probability(upright.State(0.0, 0.0, theta=0.1, theta_dot=0.5))
    1.0
    >>> policy.contract()["observation"]
    ['x [m]', 'x_dot [m/s]', 'theta [rad]', 'theta_dot [rad/s]']
    """

    agent: str
    """Name of the agent that learned it."""
    memory: Any
    """The memory of that agent."""
    learned_on: TaskSpec
    """The task that it learned on."""
    seed: int = 0
    """Seed of the study that it was learned in."""
    run: int = 0
    """Number of the run in that study."""
    plant: Mapping[str, Any] = field(default_factory=lambda: describe_plant(EQUATIONS))
    """The plant that it learned on as data: its name, and its settings if they are known."""
    settings: Settings | None = None
    """The settings of its agent; None if unknown, because JSON files do not hold them."""
    stages: tuple[Stage, ...] = ()
    """The runs it learned in, this one last; empty if unknown, as JSON files do not hold them."""
    saved_as: SavedAs | None = None
    """The file that it was read from; None if it was not, or from a JSON file."""
    greedy: bool = False
    """Whether it makes the more probable push at each step, and draws no random number."""

    def __post_init__(self) -> None:
        """Reset to the start of a trial."""
        if not self._actor:
            self.begin_trial(np.random.default_rng(0))

    def __repr__(self) -> str:
        parts = {**self.learned_on.changes(), "seed": self.seed, "run": self.run}
        plant = {} if self.plant["name"] == EQUATIONS.name else {"plant": self.plant["name"]}
        return call("Policy", parts | plant, [self.agent])

    def push_probability(self, observation: State) -> float:
        """Return the probability of a push to the right; of a greedy policy, 1 or 0.

        Raises
        ------
        AgentError
            If a custom agent's code raises an exception, or returns what is no probability.
        """
        probability = self._probability(State(*map(float, observation)))
        return float(probability > 0.5) if self.greedy else probability

    def _probability(self, observation: State) -> float:
        if self._actor:
            return self._actor.push_probability(observation)
        if not is_custom(self.agent):
            return float(self.memory.push_probability(observation))
        with reporting(self.agent, f"push_probability failed in play at {observation}"):
            probability = float(self.memory.push_probability(observation))
        if not 0.0 <= probability <= 1.0:
            raise AgentError(
                f"agent is {self.agent!r}; push_probability returned {probability!r} in play at "
                f"{observation}; it must be a number from 0 to 1"
            )
        return probability

    def begin_trial(self, rng: np.random.Generator) -> None:
        """Forget the previous trial."""
        if self._actor:
            self._actor.begin_trial(rng, draws=not self.greedy)
        elif self._has_history:
            self.memory.begin_trial(rng)

    def act(self, observation: State, rng: np.random.Generator) -> bool:
        """Choose a push."""
        if self._actor:
            act = self._actor.likelier if self.greedy else self._actor.act
            return act(observation, rng)
        probability = self.push_probability(observation)
        return probability > 0.5 if self.greedy else bool(rng.random() < probability)

    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        """Learn nothing; enter the step into the history, if the policy has one."""
        if self._actor:
            self._actor.remember(before, action)
        elif self._has_history:
            self.memory.remember(before, action)

    @cached_property
    def _actor(self) -> Actor | None:
        """What plays an agent that does not give the probability of its pushes."""
        return None if hasattr(self.memory, "push_probability") else Actor(self.agent, self.memory)

    @property
    def _has_history(self) -> bool:
        return hasattr(self.memory, "remember")

    def end_trial(self, fallen: bool) -> None:
        """Do nothing; a policy does not learn."""

    @property
    def task(self) -> dict[str, Any]:
        """The task that it learned on, ready for JSON."""
        return task_as_data(self.learned_on, self.seed, self.run, self.plant)

    @property
    def form(self) -> Form | None:
        """What it computes, as data; None if its agent does not provide that."""
        if not hasattr(self.memory, "policy_form"):
            return None
        form: Form = self.memory.policy_form()
        return greedy_form(form) if self.greedy else form

    def contract(self) -> dict[str, Any]:
        """Return all that one needs to know to use the policy, ready for JSON."""
        form, parameters = self.form, self.learned_on.parameters
        inputs = form.contract() if form else {"normalisation": "known to the agent alone"}
        return {
            "version": __version__,
            "agent": self.agent,
            "task": self.task,
            "observation": OBSERVATION,
            **inputs,
            "action": GREEDY_ACTION if self.greedy else ACTION,
            "force [N]": parameters.force,
            "time step [s]": parameters.time_step,
        }


def task_as_data(spec: TaskSpec, seed: int, run: int, plant: Mapping[str, Any]) -> dict[str, Any]:
    """Return the task of a run, ready for JSON; it names the plant unless that is the usual one."""
    named = {} if plant == describe_plant(EQUATIONS) else {"plant": dict(plant)}
    return spec.as_data() | {"seed": seed, "run": run} | named


def form_of(policy: Policy) -> Form:
    """Return what a policy computes, as data, its numbers checked.

    Raises
    ------
    UprightError
        If the policy's agent does not provide it, or a number is out of bounds.
    """
    form = policy.form
    if form is None:
        raise UprightError(
            f"agent is {policy.agent!r}; its policy cannot be exported: it lacks the method "
            "policy_form(), which returns a Network or a Table of upright.agents.parts.policy_form"
        )
    restore_form(form_entries(form))
    return form


def check_form(policy: Policy) -> None:
    """Raise UprightError if an agent of the package computes with numbers out of bounds.

    So no sum overflows, and every such policy that is saved or loaded can be exported.
    """
    if not is_custom(policy.agent):
        form_of(policy)


def describe(contract: dict[str, Any]) -> str:
    """Return a contract or a header as text: one entry a line, printable characters only."""
    return "\n".join(
        f"{json.dumps(name)[1:-1]}: {json.dumps(value)}" for name, value in contract.items()
    )
