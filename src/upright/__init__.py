"""Learning to balance an inverted pendulum, fast and honestly measured.

A pole stands on a cart that can only be pushed left or right. An agent that knows nothing of the
physics must learn, by falling, to keep it upright: by default for 60,000 steps of 0.02 s.

A first run
-----------
Let an agent learn until a trial succeeds, and see how many trials that took
and how many steps the last one lasted:

>>> import upright
>>> policy, result = upright.learn("reinforce", steps=1000, seed=1)
>>> result.success, result.trials, int(result.lengths[-1])
(True, 7, 1000)

An agent of your own takes the place of the name: a class with four methods, wherever it is defined
(see docs/agents.md).

Play what it learned, here under noise that it did not train with, and save it to a file:

>>> played = upright.play(policy, episodes=3, noise="sensor-5")
>>> [outcome.steps for outcome in played]
[1000, 1000, 1000]
>>> upright.save_policy("policy.npz", policy)

How it flows
------------
Parameters → plant → noise → agent → trial → run → store → table:

- A *plant* moves according to its *parameters* (masses, lengths, friction); *noise* disturbs the
  push and what the agent measures. With a start and the lengths of trials and runs they form a
  *task*.
- A *trial* lasts until the pole falls or has stayed up for the `steps` of a success. A *run* is one
  new agent that learns from trial to trial until one succeeds; its *result* counts every trial.
- A *case* is an agent with its settings on a task. A *study* runs each of its cases many times, on
  all cores; a *store* keeps the results in a file. A *table* shows the statistics of each case.

>>> compared = upright.compare(["reinforce", "q-learning"], ["none", "sensor-5"], runs=5, steps=500,
...                            progress=False)
>>> compared
Comparison(reinforce, q-learning, random-search; none, sensor-5; 5 runs each)
>>> print(compared)  # doctest: +ELLIPSIS
Agent          ...

A notebook shows it as a table; ``compared.frame()`` is a pandas DataFrame of the runs, and
``compared.plot()`` a figure. Step by step:

>>> case = upright.make_case("random-search", noise="gaussian-0.1", steps=500)
>>> results = upright.study([case], runs=5, seed=0)
>>> [result.trials for result in results[case]]
[8, 3, 5, 4, 4]
>>> print(upright.render([upright.summarise(case, 0, results[case])], "text"))  # doctest: +ELLIPSIS
Agent          Noise ...  Success ...  Mean trials ...

The same seed gives the same result on any machine, with any number of cores and in any order.

The names
---------
A task
    `TaskSpec` by names, `Task` in numbers; `Parameters`, `State`, `Noise`; `NOISES`, `STARTS`,
    `CONDITIONS`; `read_task` and `save_task`, files of a task
Plants and agents
    `PLANTS`, `equations`; `AGENTS`; `compiled`, to make your own agents as fast
One run
    `learn`, which returns `Learned`, and `play`; step by step: `make_case`, `Case`, `make_run`,
    `Result`
Many runs
    `compare`, which returns a `Comparison`; step by step: `study`, `Store`, `summarise`, `render`;
    `read_study`, a file of a study; `verify` makes stored runs again and compares them, and `merge`
    unites stores of several machines
What was learned
    `Policy`, `save_policy`, `load_policy`, `export_policy` (C, ONNX or JSON)
Gymnasium
    `CartPoleEnv`, `CartPoleVectorEnv`, and `TrialProtocol` with `RunOver` for other learners.
    ``import upright`` registers ``upright/CartPole-v0`` and ``upright/ContinuousCartPole-v0``
What goes wrong
    `UprightError`: one line that names the value and what is allowed; `AgentError`, one of them,
    if a custom agent failed, and `PlantError` if a custom plant did; `AgentWarning`, if an agent's
    results cannot be repeated

``help(upright.learn)``, and so on, gives the details of each, with an example. The command
``upright`` does the same from a terminal (``upright --help``). In the sources, README.md is the
tour, docs/protocol.md defines the task, and docs/agents.md explains how the agents work.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from upright.environments.registration import register_environments as _register_environments

if TYPE_CHECKING:  # the same names as in _PLACES, for type checkers and editors
    from upright.agents import AGENTS as AGENTS
    from upright.core.compiled import compiled as compiled
    from upright.core.conditions import CONDITIONS as CONDITIONS
    from upright.core.conditions import NOISES as NOISES
    from upright.core.conditions import STARTS as STARTS
    from upright.core.conditions import Noise as Noise
    from upright.core.parameters import Parameters as Parameters
    from upright.core.parameters import State as State
    from upright.core.task import Task as Task
    from upright.core.task import TaskSpec as TaskSpec
    from upright.core.trials import Result as Result
    from upright.environments.cartpole_env import CartPoleEnv as CartPoleEnv
    from upright.environments.trial_protocol import RunOver as RunOver
    from upright.environments.trial_protocol import TrialProtocol as TrialProtocol
    from upright.environments.vector_env import CartPoleVectorEnv as CartPoleVectorEnv
    from upright.errors import AgentError as AgentError
    from upright.errors import AgentWarning as AgentWarning
    from upright.errors import PlantError as PlantError
    from upright.errors import UprightError as UprightError
    from upright.plants import PLANTS as PLANTS
    from upright.plants.equations import equations as equations
    from upright.policies.files import export_policy as export_policy
    from upright.policies.files import load_policy as load_policy
    from upright.policies.files import save_policy as save_policy
    from upright.policies.policy import Policy as Policy
    from upright.reports.comparison import Comparison as Comparison
    from upright.reports.comparison import compare as compare
    from upright.reports.learning import Learned as Learned
    from upright.reports.learning import learn as learn
    from upright.reports.statistics import summarise as summarise
    from upright.reports.tables import render as render
    from upright.studies.case import Case as Case
    from upright.studies.case import make_case as make_case
    from upright.studies.merge import merge as merge
    from upright.studies.playing import play as play
    from upright.studies.run import make_run as make_run
    from upright.studies.store import Store as Store
    from upright.studies.study import study as study
    from upright.studies.study_file import read_study as read_study
    from upright.studies.task_file import read_task as read_task
    from upright.studies.task_file import save_task as save_task
    from upright.studies.verify import verify as verify

__version__ = "0.2.0"

_PLACES = {
    "agents": ("AGENTS",),
    "core.compiled": ("compiled",),
    "core.conditions": ("CONDITIONS", "NOISES", "STARTS", "Noise"),
    "core.parameters": ("Parameters", "State"),
    "core.task": ("Task", "TaskSpec"),
    "core.trials": ("Result",),
    "environments.cartpole_env": ("CartPoleEnv",),
    "environments.trial_protocol": ("RunOver", "TrialProtocol"),
    "environments.vector_env": ("CartPoleVectorEnv",),
    "errors": ("AgentError", "AgentWarning", "PlantError", "UprightError"),
    "plants": ("PLANTS",),
    "plants.equations": ("equations",),
    "policies.files": ("export_policy", "load_policy", "save_policy"),
    "policies.policy": ("Policy",),
    "reports.comparison": ("Comparison", "compare"),
    "reports.learning": ("Learned", "learn"),
    "reports.statistics": ("summarise",),
    "reports.tables": ("render",),
    "studies.case": ("Case", "make_case"),
    "studies.merge": ("merge",),
    "studies.playing": ("play",),
    "studies.run": ("make_run",),
    "studies.store": ("Store",),
    "studies.study": ("study",),
    "studies.study_file": ("read_study",),
    "studies.task_file": ("read_task", "save_task"),
    "studies.verify": ("verify",),
}
"""Module of each public name, imported when first used: Numba alone takes a second."""

_MODULE_OF = {name: f"upright.{place}" for place, names in _PLACES.items() for name in names}
_NEED_GYMNASIUM = {name for name in _MODULE_OF if ".environments." in _MODULE_OF[name]}


if not TYPE_CHECKING:  # a type checker would accept any name

    def __getattr__(name: str) -> Any:
        """Return a public name, imported when first used."""
        if name == "__all__":
            return __dir__()
        if name not in _MODULE_OF:
            raise AttributeError(f"module 'upright' has no attribute {name!r}")
        if name in _NEED_GYMNASIUM:
            from upright.errors import require_module

            require_module("gymnasium", f"{name} needs Gymnasium", "gymnasium")
        value = globals()[name] = getattr(import_module(_MODULE_OF[name]), name)
        return value


def __dir__() -> list[str]:
    """Return the public names; those that need Gymnasium only if it is installed."""
    from importlib.util import find_spec

    is_there = find_spec("gymnasium") is not None
    return sorted({"__version__", *_MODULE_OF} - (set() if is_there else _NEED_GYMNASIUM))


_register_environments()
