"""Registries: named things, one module each, imported when first used.

A registered module has a docstring, whose first line says what the thing is. If the thing has
settings, the module also has `SETTINGS`: a dictionary of them by label, "default" among them.
Installed packages register modules of their own through entry points.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from importlib import import_module
from types import ModuleType
from typing import Any, Generic, TypeVar

from upright.errors import UprightError, require_one_of, said
from upright.support.settings import Fields, restored, values_of

S = TypeVar("S", bound=Fields)


class Registry(Mapping[str, str], Generic[S]):
    """Maps names of things of one kind to their modules.

    Parameters
    ----------
    kind
        What the things are called in errors, such as "agent".
    modules
        The package's own modules: the import path of each by name.
    group
        Group of entry points through which installed packages register theirs; empty for none.
    custom
        Makes the settings of a thing that is named by its path, `module:name`, without being
        registered; None if this kind has no such things.
    advice
        Returns what to write in place of an unknown name, or an empty string.

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
        advice: Callable[[str], str] = lambda _name: "",
    ) -> None:
        self.kind, self.built_in, self._group, self._custom = kind, modules, group, custom
        self._advice = advice

    def __getitem__(self, name: str) -> str:
        """Return the import path of a module; look among installed packages only if need be."""
        return self.built_in[name] if name in self.built_in else self._installed[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over all names, the package's own first."""
        return iter(self.built_in | self._installed)

    def __len__(self) -> int:
        """Return the number of names."""
        return len(self.built_in | self._installed)

    @cached_property
    def _installed(self) -> dict[str, str]:
        """The modules that installed packages register. They cannot replace the package's own."""
        if not self._group:
            return {}
        from importlib.metadata import entry_points

        modules = {point.name: point.value for point in entry_points(group=self._group)}
        return {name: modules[name] for name in sorted(modules) if name not in self.built_in}

    def check(self, name: str) -> None:
        """Raise UprightError unless this name is registered or is the path of a custom thing."""
        if self.is_path(name) or name in self.built_in:
            return
        if name not in self and (advice := self._advice(name)):
            raise UprightError(f"{self.kind} is {said(name)}; {advice}")
        require_one_of(self.kind, name, [*self, "module:name"] if self._custom else self)

    def is_path(self, name: str) -> bool:
        """Whether this is the path of a custom thing, `module:name`, rather than a name."""
        return self._custom is not None and ":" in name

    def module(self, name: str) -> ModuleType:
        """Return the module of a registered thing.

        Raises
        ------
        UprightError
            If there is no such thing, or an installed package's module cannot be imported.
        """
        self.check(name)
        if name in self.built_in:
            return import_module(self.built_in[name])
        try:
            return import_module(self[name])
        except Exception as error:  # the module's own code may raise anything
            explained = isinstance(error, (ImportError, SyntaxError))
            why = str(error) if explained else f"{type(error).__name__}: {error}"
            raise UprightError(
                f"{self.kind} is {name!r}; its module {self[name]!r} cannot be imported: "
                f"{' '.join(why.split())}"
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
        """Return a one-line description of a thing.

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
        """Return settings read from a file, which holds them as `values_of` returned them.

        Raises
        ------
        UprightError
            If there is no such thing, or the values are not its settings or are not allowed.
        """
        if self._custom is not None and self.is_path(name):
            settings = self._custom(name)
            if values != values_of(settings):  # another name would be other code
                raise UprightError(f"the settings are {values!r}; they are not those of {name!r}")
            return settings
        return restored(self.default(name), values, name)
