"""An environment that tells of its steps, for learners that only know Gymnasium."""

from collections.abc import Callable
from typing import Any

import gymnasium

from upright.environments.trial_protocol import TrialProtocol


class ObservedEnv(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Stands between a `TrialProtocol` and its `CartPoleEnv`, and tells of every start and step.

    Parameters
    ----------
    env
        The environment.
    protocol
        What counts its trials.
    tell
        Called with the number of the trial and of the step, the true state, the measured one, the
        force [N], and whether the pole has fallen.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], protocol: TrialProtocol, tell: Callable[..., None]
    ) -> None:
        super().__init__(env)
        self._protocol, self._tell, self._steps = protocol, tell, 0

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        begun = self.env.reset(**options)
        self._steps = 0
        self._tell_now(fallen=False)
        return begun

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Make a step."""
        made = self.env.step(action)
        self._steps += 1
        self._tell_now(fallen=made[2])
        return made

    def _tell_now(self, fallen: bool) -> None:
        scene = self.unwrapped.scene()  # type: ignore[attr-defined]
        number = len(self._protocol.lengths) + 1
        self._tell(number, self._steps, scene.state, scene.measured, scene.force, fallen)
