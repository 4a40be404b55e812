"""Registries: named things, one module each, imported when first used.

A module of a registry has a docstring, whose first line says what the thing is, and where the thing
can be set, `SETTINGS`: its settings by label, "default" among them. Installed packages register
modules of their own by entry points.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from importlib import import_module
from types import ModuleType
from typing import Any, Generic, TypeVar

from upright.errors import UprightError, require_one_of
from upright.support.settings import Fields, restored, values_of

S = TypeVar("S", bound=Fields)


class Registry(Mapping[str, str], Generic[S]):
    """The modules of a kind of thing by name.

    Parameters
    ----------
    kind
        What the things are, for errors: "agent".
    modules
        Those of the package: the path of each module by name.
    group
        The entry points by which installed packages register theirs; empty for none.
    custom
        Makes the settings of a thing that is named `module:name` and not registered; None where
        there are no such things.

    Examples
    --------
    >>> from upright.support.registry import Registry
    >>> shapes = Registry("shape", {"circle": "shapes.circle", "square": "shapes.square"})
    >>> list(shapes), "circle" in shapes
    (['circle', 'square'], True)
    >>> shapes.summary("triangle")
    Traceback (most recent call last):
    upright.errors.UprightError: shape is 'triangle'; it must be one of circle, square
    """

    def __init__(
        self,
        kind: str,
        modules: dict[str, str],
        group: str = "",
        custom: Callable[[str], S] | None = None,
    ) -> None:
        self.kind, self.built_in, self._group, self._custom = kind, modules, group, custom

    def __getitem__(self, name: str) -> str:
        """Return the path of a module; installed packages are searched only for other names."""
        return self.built_in[name] if name in self.built_in else self._installed[name]

    def __iter__(self) -> Iterator[str]:
        """Give all names, the package's own first."""
        return iter(self.built_in | self._installed)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.built_in | self._installed)

    @cached_property
    def _installed(self) -> dict[str, str]:
        """The modules that installed packages register. They cannot replace the package's own."""
        if not self._group:
            return {}
        from importlib.metadata import entry_points

        found = {point.name: point.value for point in entry_points(group=self._group)}
        return {name: found[name] for name in sorted(found) if name not in self.built_in}

    def check(self, name: str) -> None:
        """Raise UprightError unless there is a thing of this name; a custom one is not sought."""
        if self.is_path(name) or name in self.built_in:
            return
        require_one_of(self.kind, name, [*self, "module:name"] if self._custom else self)

    def is_path(self, name: str) -> bool:
        """Whether this names a thing that is not registered: `module:name`."""
        return self._custom is not None and ":" in name

    def module(self, name: str) -> ModuleType:
        """Return the module of a registered thing.

        Raises
        ------
        UprightError
            If there is no such thing, or an installed package registers what cannot be imported.
        """
        self.check(name)
        if name in self.built_in:
            return import_module(self.built_in[name])
        try:
            return import_module(self[name])
        except (ImportError, SyntaxError) as error:
            raise UprightError(
                f"{self.kind} is {name!r}; its module {self[name]!r} cannot be imported: {error}"
            ) from error

    def settings(self, name: str) -> dict[str, S]:
        """Return the settings of a thing by label.

        Raises
        ------
        UprightError
            If there is no such thing, or an installed package registers what has no settings.
        """
        if self._custom is not None and self.is_path(name):
            return {"default": self._custom(name)}
        settings: dict[str, S] = getattr(self.module(name), "SETTINGS", {})
        if "default" not in settings:
            raise UprightError(
                f"{self.kind} is {name!r}; SETTINGS of its module {self[name]!r} has no 'default'"
            )
        return settings

    def default(self, name: str) -> S:
        """Return the default settings of a thing.

        Raises
        ------
        UprightError
            If there is no such thing.
        """
        return self.settings(name)["default"]

    def summary(self, name: str) -> str:
        """Return what a thing is, in one line.

        Raises
        ------
        UprightError
            If there is no such thing.
        """
        if self._custom is not None and self.is_path(name):
            settings: Any = self._custom(name)
            return str(settings.summary())
        return (self.module(name).__doc__ or "").partition("\n")[0]

    def restore(self, name: str, values: Mapping[str, Any]) -> S:
        """Return the settings that were written to a file, as `values_of` gave them.

        Raises
        ------
        UprightError
            If there is no such thing, or they are not its settings, or not allowed.
        """
        if self._custom is not None and self.is_path(name):
            settings = self._custom(name)
            if values != values_of(settings):  # another name would be other code
                raise UprightError(f"the settings are {values!r}; they are not those of {name!r}")
            return settings
        return restored(self.default(name), values, name)
