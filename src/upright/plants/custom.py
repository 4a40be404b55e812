"""Custom plants, named `module:name`.

The name refers to any callable that returns a plant when it is called with `Parameters`: a class
whose constructor takes them, or a function. The plant may be plain Python, every step of which is
checked, or a NamedTuple whose methods have the decorator `upright.compiled`, which is as fast as
the equations.
"""

import ast
import reprlib
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numba.core.errors import NumbaError

from upright.core.cartpole import has_fallen
from upright.core.compiled import explain, is_compiled
from upright.core.contracts import Plant
from upright.core.parameters import Parameters, State
from upright.core.task import Task
from upright.errors import PlantError, Stopped, UprightError
from upright.plants.settings import RunContext
from upright.support import code_names
from upright.support.custom_code import (
    CustomCode,
    lacking,
    path_of,
    refuse_class,
    refuse_mismatches,
)
from upright.support.faults import RAISED, fault, place

METHODS = {"reset": ("state",), "step": ("force",)}
"""The parameters of the methods of every plant; `upright.core.contracts.Plant` describes them."""
OPTIONAL = {"has_fallen": ("state",), "close": ()}
"""Those of methods that a plant in plain Python may lack: it then falls at the task's limits."""
STATE = "it must return the state: x, x_dot, theta and theta_dot, four finite numbers"
FORGOTTEN = "did it forget to return a value?"


def path_of_plant(plant: Callable[[Parameters], Any]) -> str:
    """Return the path `module:name` of a class or function that returns a plant.

    Raises
    ------
    UprightError
        If it has none, or what stands there is not this class or function.
    """
    return path_of(plant, PlantError, lambda path: CustomPlant(path).code.find())


@dataclass(frozen=True)
class CustomPlant:
    """Placeholder for the settings of a custom plant, which manages its own.

    The plant is imported only when needed, so its stored runs stay readable after its code is gone.
    """

    plant_name: str
    """Where the plant is found: `module:name`."""

    alone: ClassVar[bool] = False

    @property
    def name(self) -> str:
        """The path of the plant."""
        return self.plant_name

    @property
    def code(self) -> CustomCode:
        """The class or function that returns a new plant."""
        return CustomCode(self.plant_name, PlantError, advice)

    def summary(self) -> str:
        """Return the first line of the docstring of the plant or its module; empty if none."""
        return self.code.summary()

    def make(self, context: RunContext) -> tuple[Plant, Task]:
        """Return a new plant with the parameters of the task, and the task.

        Raises
        ------
        UprightError
            If there is no plant of this name.
        PlantError
            If its code raises an exception, it cannot be created from the parameters alone, or it
            lacks a method that can be called as it must be.
        """
        return self.new(context.task.parameters, f"run {context.run}"), context.task

    def new(self, parameters: Parameters, run: str = "") -> Plant:
        """Return a new plant; one in plain Python is checked as it moves, in this run."""
        plant: Plant = self.code.call(parameters, "the parameters")
        _check_contract(self.name, plant)
        if not is_compiled(plant):
            return CheckedPlant(plant, self.name, parameters, run)
        _compile(self.name, plant)
        return plant

    def check(self, parameters: Parameters) -> None:
        """Raise what `make` would raise of a task with these parameters."""
        self.new(parameters).close()

    def is_compiled(self) -> bool:
        """Whether it is compiled."""
        with closing(self.new(Parameters())) as plant:
            return is_compiled(plant)

    def version(self) -> str:
        """Return an empty string: no simulator is known to be behind the plant."""
        return ""


def advice(name: str) -> str:
    """Return what to write in place of a name that looks like the file of a custom plant."""
    return code_names.advice(name, "plant", plants_in)


def plants_in(path: Path) -> list[str]:
    """Return the names in a file that look like plants: classes that can be stepped and reset."""
    body = code_names.statements(path) or []
    classes = [node for node in body if isinstance(node, ast.ClassDef)]
    return [
        node.name
        for node in classes
        if {*METHODS} <= {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
    ]


def _check_contract(name: str, plant: object) -> None:
    """Raise PlantError unless a plant can be called as the loop does."""
    refuse_class(PlantError, name, plant)
    needed = METHODS | OPTIONAL if is_compiled(plant) else METHODS
    if missing := lacking(plant, needed):
        kind = "a compiled plant" if is_compiled(plant) else "a plant"
        raise PlantError(
            f"plant is {name!r}; it lacks {_listed(missing)}; {kind} has the methods "
            f"{_listed(needed)}"
        )
    refuse_mismatches(PlantError, name, plant, METHODS, OPTIONAL)


def _listed(methods: Any) -> str:
    calls = METHODS | OPTIONAL
    return ", ".join(f"{method}({', '.join(calls[method])})" for method in methods)


def _compile(name: str, plant: Any) -> None:
    """Compile a plant by moving it, and check what its methods return."""
    start = State(0.0, 0.0, 0.0, 0.0)
    calls = {"reset": start, "step": 0.0, "has_fallen": start}
    for method, argument in calls.items():
        try:
            returned = getattr(plant, method)(argument)
        except NumbaError as error:
            reason = f"{method} cannot be compiled: {explain(error)}"
            raise PlantError(f"plant is {name!r}; {reason}") from error
        except RAISED as error:
            raise fault(PlantError, name, f"{method} failed", error) from error
        expected = bool if method == "has_fallen" else State
        if type(returned) is not expected:
            kind = type(returned).__name__
            wanted = "upright.State" if expected is State else "True or False"
            reason = f"{method} returned {_shown(returned)}, of type {kind}; it must be {wanted}"
            raise PlantError(f"plant is {name!r}; {reason}")


def _shown(value: object) -> str:
    return " ".join(reprlib.repr(value).split())


class CheckedPlant:
    """A custom plant in plain Python, as the loop sees it: every state it returns is checked."""

    def __init__(self, plant: Any, name: str, parameters: Parameters, run: str) -> None:
        self._plant, self._name, self._parameters, self._run = plant, name, parameters, run
        self._trial = self._step = 0
        self._has_fallen = getattr(plant, "has_fallen", None)

    def reset(self, state: State) -> State:
        """Put the plant into `state`."""
        self._trial += 1
        self._step = 0
        return self._state("reset", self._called("reset", self._plant.reset, state))

    def step(self, force: float) -> State:
        """Apply a force [N] for one time step and return the next state."""
        self._step += 1
        return self._state("step", self._called("step", self._plant.step, force))

    def has_fallen(self, state: State) -> bool:
        """Whether the plant says that it has fallen; or else, whether it has left its limits."""
        if self._has_fallen is None:
            return has_fallen(self._parameters, state)
        fallen = self._called("has_fallen", self._has_fallen, state)
        if isinstance(fallen, (bool, np.bool_)):
            return bool(fallen)
        raise self._wrong("has_fallen", fallen, "it must return True or False")

    def close(self) -> None:
        """Release what the plant holds."""
        if hasattr(self._plant, "close"):
            self._called("close", self._plant.close)

    def _called(self, method: str, function: Callable[..., Any], *arguments: object) -> Any:
        try:
            return function(*arguments)
        except (Stopped, PlantError):
            raise
        except RAISED as error:
            what = f"{method} failed in {self._place()}"
            raise fault(PlantError, self._name, what, error) from error

    def _state(self, method: str, returned: Any) -> State:
        """Return a state with floats, as compiled agents need it, if this is one."""
        try:
            state = State(*map(float, returned))
        except (TypeError, ValueError):
            raise self._wrong(method, returned, STATE) from None
        if all(map(isfinite, state)):
            return state
        raise self._wrong(method, returned, STATE)

    def _wrong(self, method: str, returned: object, rule: str) -> PlantError:
        hint = f"; {FORGOTTEN}" if returned is None else ""
        said = f"{method} returned {_shown(returned)} in {self._place()}; {rule}{hint}"
        return PlantError(f"plant is {self._name!r}; {said}")

    def _place(self) -> str:
        return place(self._run, self._trial, self._step)


@contextmanager
def reporting_trial(plant: str, run: int, lengths: np.ndarray) -> Iterator[None]:
    """Report an exception of a compiled plant, of which compiled code tells no more than that.

    Parameters
    ----------
    plant
        Name of the plant.
    run
        Number of the run.
    lengths
        Of the trials that have ended; the others are 0.
    """
    try:
        yield
    except (UprightError, Stopped):
        raise
    except RAISED as error:
        where = place(f"run {run}", int(np.count_nonzero(lengths)) + 1)
        raise fault(PlantError, plant, f"it failed in {where}", error) from error
