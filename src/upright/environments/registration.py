"""Registers the environments with Gymnasium, without importing it."""

import sys
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType
from typing import Any


def register_environments() -> None:
    """Register the environments: now, or as soon as Gymnasium is imported.

    This way ``import upright`` is enough, whether before or after ``import gymnasium``, and does
    not slow down programs that do not use Gymnasium.
    """
    if "gymnasium" in sys.modules:
        _register()
    else:
        sys.meta_path.insert(0, _GymnasiumFinder())


def _register() -> None:
    from gymnasium.envs.registration import register, registry

    from upright.core.conditions import STEPS

    for name, options in (("CartPole", {}), ("ContinuousCartPole", {"continuous": True})):
        if f"upright/{name}-v0" not in registry:
            register(
                id=f"upright/{name}-v0",
                entry_point="upright.environments.cartpole_env:CartPoleEnv",
                vector_entry_point="upright.environments.vector_env:CartPoleVectorEnv",
                max_episode_steps=STEPS,
                kwargs=options,
            )


class _GymnasiumFinder:
    """A module finder that registers the environments once Gymnasium has been imported.

    It does not inherit from the base class in `importlib.abc`, whose import would take most of the
    time of ``import upright``.
    """

    _is_searching = False

    def find_spec(self, name: str, *_: Any) -> ModuleSpec | None:
        """Find Gymnasium as Python does, and register the environments after it is executed."""
        if name != "gymnasium" or self._is_searching:
            return None
        self._is_searching = True
        try:
            spec = find_spec(name)
        finally:
            self._is_searching = False
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def execute_and_register(module: ModuleType) -> None:
                execute(module)
                sys.meta_path.remove(self)
                _register()

            spec.loader.exec_module = execute_and_register  # type: ignore[method-assign]
        return spec
