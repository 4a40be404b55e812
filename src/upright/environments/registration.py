"""Makes the environments known to Gymnasium, without importing it."""

import sys
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType
from typing import Any

from upright.core.conditions import STEPS


def register_environments() -> None:
    """Register the environments: now, or as soon as Gymnasium is imported.

    ``import upright`` is to suffice, before or after ``import gymnasium``, yet nobody who does not
    need Gymnasium should wait for it.
    """
    if "gymnasium" in sys.modules:
        _register()
    else:
        sys.meta_path.insert(0, _Watch())


def _register() -> None:
    from gymnasium.envs.registration import register, registry

    for name, options in (("CartPole", {}), ("ContinuousCartPole", {"continuous": True})):
        if f"upright/{name}-v0" not in registry:
            register(
                id=f"upright/{name}-v0",
                entry_point="upright.environments.cartpole_env:CartPoleEnv",
                vector_entry_point="upright.environments.vector_env:CartPoleVectorEnv",
                max_episode_steps=STEPS,
                kwargs=options,
            )


class _Watch:
    """Registers the environments when Gymnasium has been imported.

    A finder of modules by its one method; the base class in `importlib.abc` would take most of the
    time of ``import upright``.
    """

    _looks = False

    def find_spec(self, name: str, *_: Any) -> ModuleSpec | None:
        """Find Gymnasium as anybody would, but note when it is executed."""
        if name != "gymnasium" or self._looks:
            return None
        self._looks = True
        try:
            found = find_spec(name)
        finally:
            self._looks = False
        if found is not None and found.loader is not None:
            execute = found.loader.exec_module

            def execute_and_register(module: ModuleType) -> None:
                execute(module)
                sys.meta_path.remove(self)
                _register()

            found.loader.exec_module = execute_and_register  # type: ignore[method-assign]
        return found
