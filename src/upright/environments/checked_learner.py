"""Custom learners that only know Gymnasium, as `run_learner` sees them: exceptions are reported."""

from typing import Any

from upright.agents.checks.faults import RAISED, fault, place
from upright.core.contracts import GymnasiumLearner
from upright.environments.trial_protocol import RunOver
from upright.errors import AgentError


class CheckedLearner:
    """A learner whose exceptions are reported as its own, and which must train to the end.

    Parameters
    ----------
    learner
        The learner.
    name
        Name of the agent.
    run
        Which run this is, such as "run 0".
    """

    def __init__(self, learner: GymnasiumLearner, name: str, run: str) -> None:
        self._learner, self._name, self._run = learner, name, run

    def train(self, env: Any) -> None:
        """Let the learner train in a `TrialProtocol`.

        Raises
        ------
        AgentError
            If the learner raises anything but RunOver, or returns before the run is over.
        """
        try:
            self._learner.train(env)
        except RunOver:
            raise
        except RAISED as error:
            raise fault(self._name, f"train failed in {self._place(env)}", error) from error
        if not env.over:
            raise AgentError(
                f"agent is {self._name!r}; train returned in {self._place(env)}; it must go on "
                f"until the environment raises RunOver, after a success or {env.trials:,} trials"
            )

    def _place(self, env: Any) -> str:
        return place(self._run, *env.position)
