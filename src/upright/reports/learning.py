"""One run from Python: `learn`, and what it returns."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from upright.core.contracts import AnyAgent
from upright.core.trials import Result
from upright.errors import UprightError, require
from upright.policies.policy import Policy
from upright.reports.names import agent_name, noise_name
from upright.reports.notebook import displayed, html_table
from upright.studies.case import Case, make_case, named
from upright.studies.columns import TRIAL
from upright.studies.learned import KEEPS_SETTINGS, case_from, make_learned
from upright.studies.records import make_frame
from upright.studies.study import check_study
from upright.support.settings import with_values

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


class Learned(NamedTuple):
    """What `learn` returns: a policy and the result of its run. A notebook shows it as a table.

    Examples
    --------
    >>> learned = upright.learn("q-learning", steps=300, seed=2)
    >>> policy, result = learned
    >>> learned.result.trials == len(learned.frame())
    True
    >>> figure = learned.plot()
    >>> figure.savefig("curve.png")
    """

    policy: Policy
    """What the agent had learned when the run ended."""
    result: Result
    """The outcome of the run, with the length of every trial."""

    def frame(self) -> "pandas.DataFrame":
        """Return the trials as a pandas DataFrame, a row each.

        Returns
        -------
        DataFrame
            With the columns `trial`, from 1; `steps`, how long it lasted; and `fallen`.

        Raises
        ------
        UprightError
            If pandas is missing.
        """
        return make_frame([({}, self.result)], "trial", TRIAL)

    def plot(self) -> "Figure":
        """Draw the learning curve: the length of each trial."""
        from upright.reports.plots import plot_curve  # imported late: it is slow

        policy, spec = self.policy, self.policy.learned_on
        title = f"{agent_name(policy.agent)}, {noise_name(spec.noise)}"
        subtitle = f"seed {policy.seed}, run {policy.run}"
        figure = plot_curve(self.result.lengths, spec.steps, title, subtitle, policy.agent)
        return displayed(figure)

    @property
    def _name(self) -> str:
        return named(self.policy.agent, "Python", self.policy.plant["name"])

    def _repr_html_(self) -> str:
        spec, lengths = self.policy.learned_on, self.result.lengths
        cells = {
            "Agent": self._name,
            "Noise": spec.noise,
            "Balanced": "yes" if self.result.success else "no",
            "Trials": f"{self.result.trials:,}",
            "Longest trial": f"{int(lengths.max(initial=0)):,} of {spec.steps:,} steps",
            "All trials": f"{int(lengths.sum()):,} steps",
            "Time": f"{self.result.seconds:.2f} s",
        }
        texts = ("Agent", "Noise", "Balanced")
        return html_table(list(cells), [list(cells.values())], [], texts)


def learn(
    agent: AnyAgent | Policy,
    settings: str | Mapping[str, Any] = "default",
    *,
    seed: int = 0,
    run: int = 0,
    **task: Any,
) -> Learned:
    """Train an agent until a trial succeeds, and return what it learned.

    Parameters
    ----------
    agent
        Name of an agent in `AGENTS`, or ``module:name`` of a custom one; or a class or function
        which returns an agent when it is called with the run's random numbers. Or a policy, whose
        agent then goes on learning in place of a new one; the policy does not change.
    settings
        Name of its settings: "default" or "as-published"; or those of its settings that are to be
        changed, by name. An agent that goes on from a policy has the policy's settings, of which
        those can be changed that nothing it has learned depends on.
    seed, run
        These two numbers determine the result on every machine. The run is the one with the same
        number in a `study` with this seed.
    **task
        Parts of the task by name, as `make_case` takes them: `noise`, `start`, `steps`, `trials`,
        `condition`, `plant` and others. From a policy on, noise, start, condition and parameters
        are by default those that it was trained on.

    Returns
    -------
    Learned
        A pair: the policy, to play, save or export; and the result, with the length of every trial.
        Its methods `plot` and `frame` show the trials. What an agent in plain Python has learned is
        `policy.memory`, the agent itself. The trials of the result are those of this run alone;
        `policy.stages` also has the runs before.

    Raises
    ------
    UprightError
        If a name is unknown, a number is not allowed, the agent cannot work, or it cannot go on
        from the policy, such as one from a JSON file.
    KeyboardInterrupt
        If interrupted; the run ends before its next trial.

    Examples
    --------
    >>> policy, result = upright.learn("adaptive-lqr", noise="gaussian-0.1", steps=2000)
    >>> result.success, result.lengths
    (True, array([2000]))

    Some settings may be changed:

    >>> upright.learn("q-learning", {"learning_rate": 0.3}, steps=300).result.success
    True

    A run that fails also returns what was learned:

    >>> policy, result = upright.learn("q-learning", steps=2000, trials=2)
    >>> result.success
    False

    It can go on learning, here for longer trials under another condition:

    >>> policy, result = upright.learn(policy, condition="delay-1", steps=3000)
    >>> [stage.trials for stage in policy.stages] == [2, result.trials]
    True
    """
    require("run", run, 0, 10**6 - 1, whole=True)
    check_study(run + 1, seed)
    if isinstance(agent, Policy):
        case = _case_from(agent, settings, task)
        return Learned(*make_learned(case, seed, run, agent))
    chosen = {"settings": settings} if isinstance(settings, Mapping) else {"label": settings}
    return Learned(*make_learned(make_case(agent, **chosen, **task), seed, run))


def _case_from(policy: Policy, settings: str | Mapping[str, Any], task: dict[str, Any]) -> Case:
    """Return the case of an agent that goes on from a policy."""
    if isinstance(settings, Mapping) and policy.settings is not None:
        return case_from(policy, with_values(policy.settings, settings), **task)
    if settings != "default":
        raise UprightError(f"settings is {settings!r}; {KEEPS_SETTINGS}")
    return case_from(policy, **task)
