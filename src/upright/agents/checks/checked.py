"""Custom agents as the loop sees them: every action is checked, every exception is reported.

An agent in plain Python is called through `CheckedAgent`, a compiled one through `CompiledCheck`.
Neither changes what the agent is given or returns, so a seed gives the same trials without them.
Learners that only know Gymnasium have environments/checked_learner.py.
"""

import operator
import reprlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import overload

from upright.agents.checks.contract import METHODS
from upright.agents.checks.faults import RAISED, fault, place
from upright.agents.checks.missing_numbers import NumberWatch
from upright.core.compiled import Compiled, is_compiled
from upright.core.contracts import Agent
from upright.core.parameters import State
from upright.errors import AgentError

MEANING = "it must be True (or 1) to push right, +F, or False (or 0) to push left, -F"
FORGOTTEN = "did it forget to return a value?"


@contextmanager
def checked(agent: Any, name: str, run: str) -> Iterator[Any]:
    """Give what a loop is to call in place of a custom agent, for one run.

    Parameters
    ----------
    agent
        The agent, just created; what is given keeps its state in it.
    name
        Name of the agent.
    run
        Which run this is, such as "run 0".

    Raises
    ------
    AgentError
        If the agent's code raises, an action is neither True nor False, or one of the agent's
        numbers has become NaN.
    """
    if is_compiled(agent):
        yield from _checked_compiled(agent, name, run)
    else:
        watched = CheckedAgent(agent, name, run)
        yield watched
        watched.look_at_numbers()


def is_push(action: object) -> bool:
    """Whether a value means a push: a bool, or an integer that is 0 or 1, also as a 0-d array.

    Floats are refused, even 0.0 and 1.0: they are more often a force or a probability.
    """
    if isinstance(action, np.bool_ | np.ndarray) and action.ndim == 0:
        action = action.item()
    try:
        return operator.index(action) in (0, 1)  # type: ignore[arg-type]
    except TypeError:
        return False


def wrong_action(name: str, action: object, where: str) -> AgentError:
    """Return the error about an action of a custom agent that is no push."""
    value = " ".join(reprlib.repr(action).split())
    hint = f"; {FORGOTTEN}" if action is None else ""
    return AgentError(f"agent is {name!r}; act returned {value} in {where}; {MEANING}{hint}")


class CheckedAgent:
    """A custom agent in plain Python, as the loop sees it."""

    __slots__ = ("_agent", "_name", "_numbers", "_run", "_step", "_trial")

    def __init__(self, agent: Agent, name: str, run: str) -> None:
        self._agent, self._name, self._run = agent, name, run
        self._trial = self._step = 0
        self._numbers = NumberWatch(name, agent)

    def begin_trial(self, rng: np.random.Generator) -> None:
        """Let the agent begin a trial."""
        self._trial += 1
        self._step = 0
        try:
            self._agent.begin_trial(rng)
        except RAISED as error:
            raise self._fault("begin_trial", error) from error

    def act(self, observation: State, rng: np.random.Generator) -> bool:
        """Let the agent act, and refuse what is no push."""
        self._step += 1
        try:
            action = self._agent.act(observation, rng)
        except RAISED as error:
            raise self._fault("act", error) from error
        if action is True or action is False or is_push(action):
            return action
        raise wrong_action(self._name, action, self._place())

    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        """Let the agent learn from a step."""
        try:
            self._agent.learn(before, action, after, fallen)
        except RAISED as error:
            raise self._fault("learn", error) from error

    def end_trial(self, fallen: bool) -> None:
        """Let the agent learn from the trial."""
        try:
            self._agent.end_trial(fallen)
        except RAISED as error:
            raise self._fault("end_trial", error) from error
        if self._numbers.is_due(self._step):
            self.look_at_numbers()

    def look_at_numbers(self) -> None:
        """Raise AgentError if one of the agent's numbers has become NaN."""
        self._numbers.look(place(self._run, self._trial))

    def _place(self) -> str:
        return place(self._run, self._trial, self._step)

    def _fault(self, method: str, error: BaseException) -> AgentError:
        return fault(self._name, f"{method} failed in {self._place()}", error)


# ------------------------------------------------------------------------------ compiled agents

WHERE, TRIAL, STEP, ACTION, NOTES = range(5)
"""What stands where in the notes of a `CompiledCheck`, and how many there are."""
OUTSIDE, IN_BEGIN_TRIAL, IN_ACT, IN_LEARN, IN_END_TRIAL, WRONG_ACTION = range(6)
"""Values of notes[WHERE]: which method is running, if any, or that it returned no push."""

_compiled = partial(
    Compiled, kept=False
)  # as the agent within is code whose changes nobody notices


def _accepts(action: object, notes: np.ndarray) -> bool:
    """Whether an action is a push; note it if it is not."""
    return is_push(action)


@overload(_accepts)
def _accepts_when_compiled(action, notes):
    if isinstance(action, types.Integer):

        def accepts(action, notes):
            notes[ACTION] = action
            return action == 0 or action == 1

        return accepts
    is_bool = isinstance(action, types.Boolean)
    return lambda action, notes: is_bool  # noqa: ARG005


class CompiledCheck(NamedTuple):
    """A compiled custom agent, as the compiled loop sees it.

    Compiled code can say little about an exception, so notes tell where it was raised.
    """

    agent: Any
    notes: np.ndarray
    """Shape (NOTES,), int64."""

    @_compiled
    def begin_trial(self, rng):
        """Let the agent begin a trial."""
        self.notes[TRIAL] += 1
        self.notes[STEP] = 0
        self.notes[WHERE] = IN_BEGIN_TRIAL
        self.agent.begin_trial(rng)
        self.notes[WHERE] = OUTSIDE

    @_compiled
    def act(self, observation, rng):
        """Let the agent act, and refuse what is no push."""
        self.notes[STEP] += 1
        self.notes[WHERE] = IN_ACT
        action = self.agent.act(observation, rng)
        if not _accepts(action, self.notes):
            self.notes[WHERE] = WRONG_ACTION
            raise ValueError("no push")
        self.notes[WHERE] = OUTSIDE
        return action

    @_compiled
    def learn(self, before, action, after, fallen):
        """Let the agent learn from a step."""
        self.notes[WHERE] = IN_LEARN
        self.agent.learn(before, action, after, fallen)
        self.notes[WHERE] = OUTSIDE

    @_compiled
    def end_trial(self, fallen):
        """Let the agent learn from the trial."""
        self.notes[WHERE] = IN_END_TRIAL
        self.agent.end_trial(fallen)
        self.notes[WHERE] = OUTSIDE


def _checked_compiled(agent: Any, name: str, run: str) -> Iterator[CompiledCheck]:
    """Do what `checked` does for a compiled agent."""
    notes, numbers = np.zeros(NOTES, np.int64), NumberWatch(name, agent)
    try:
        yield CompiledCheck(agent, notes)
    except RAISED as error:
        where, trial, step, action = notes.tolist()
        if where == OUTSIDE:  # it is the plant's, or the agent could not be compiled
            raise
        if where == WRONG_ACTION:
            raise wrong_action(name, action, place(run, trial, step)) from None
        method = list(METHODS)[where - IN_BEGIN_TRIAL]
        raise fault(name, f"{method} failed in {place(run, trial, step)}", error) from error
    numbers.look(place(run, int(notes[TRIAL])))


def check_returned_type(agent: Any, name: str) -> None:
    """Raise AgentError unless `act` of a compiled agent returns a boolean or an integer.

    Its type is known once the loop has been compiled.
    """
    for signature in type(agent).act.signatures:
        returned = signature.return_type
        if signature.args[0].instance_class is not type(agent):
            continue
        if not isinstance(returned, types.Boolean | types.Integer):
            may_forget = isinstance(returned, types.NoneType | types.Optional)
            kind = f"{returned.type} or none" if hasattr(returned, "type") else returned
            hint = f"; {FORGOTTEN}" if may_forget else ""
            raise AgentError(f"agent is {name!r}; act returns {kind}; {MEANING}{hint}")
