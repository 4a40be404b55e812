"""Custom code: classes and functions of the user's own, named `module:name`."""

import inspect
import os
import sys
import sysconfig
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from upright.errors import CodeError, UprightError, did_you_mean, said
from upright.support.faults import RAISED, fault, reporting


class CustomCode(NamedTuple):
    """A class or function that is found by its name, and imported only when it is needed."""

    path: str
    """Where it is found: `module:name`."""
    error: type[CodeError]
    """The error of such code, which says what it makes: an agent or a plant."""
    advice: Callable[[str], str]
    """Returns what to write in place of a wrong path, or an empty string."""

    @property
    def _is(self) -> str:
        return f"{self.error.owner} is {said(self.path)}"

    def find(self) -> Callable[..., Any]:
        """Return the class or function.

        Raises
        ------
        UprightError
            If there is none of this name.
        CodeError
            If its module cannot be imported.
        """
        module, name = self._module(), self.path.partition(":")[2]
        found: Any = module
        with reporting(self.error, self.path, f"{name!r} cannot be had from its module"):
            for part in name.split("."):
                found = getattr(found, part, None)
        if not callable(found):
            names = (key for key, value in vars(module).items() if callable(value))
            hint = did_you_mean(name, names)
            raise UprightError(
                f"{self._is}; there is no class or function {said(name)} in {module.__name__}{hint}"
            )
        return found  # type: ignore[no-any-return]

    def call(self, argument: object, what: str) -> Any:
        """Return what the class or function returns, given this argument.

        Parameters
        ----------
        argument
            The only argument.
        what
            What the argument is, in words.

        Raises
        ------
        UprightError
            If there is none of this name.
        CodeError
            If it cannot be called with this argument alone, or raises an exception.
        """
        make = self.find()
        try:
            inspect.signature(make).bind(argument)
        except TypeError as error:
            reason = f"it must be callable with {what} alone: {error}"
            raise self.error(f"{self._is}; {reason}") from None
        except ValueError:  # nothing is known of its parameters, as for some functions written in C
            pass
        try:
            return make(argument)
        except CodeError:  # it is reported already
            raise
        except RAISED as error:
            raise fault(self.error, self.path, "it cannot be created", error) from error

    def summary(self) -> str:
        """Return the first line of its docstring or of its module's; empty if there is none."""
        text = inspect.getdoc(self.find()) or self._module().__doc__ or ""
        return str(text).partition("\n")[0]

    def source(self) -> Path:
        """Return the file of its module.

        Raises
        ------
        UprightError
            If the module has no file.
        """
        file = self._module().__file__
        if file is None:
            raise UprightError(f"{self._is}; its module has no file")
        return Path(file)

    def _module(self) -> ModuleType:
        """Return the module; it may also be in the current folder, as for Python itself.

        Nothing of Python's own modules is imported or called: none has what is looked for, and
        `os:abort` or `antigravity:x` do something else instead.
        """
        name = self.path.partition(":")[0]
        if not all(part.isidentifier() for part in name.split(".")) or os.path.isfile(name):
            why = self.advice(self.path) or f"{name!r} is not the name of a module"
            raise UprightError(f"{self._is}; {why}")
        if os.getcwd() not in sys.path:
            sys.path.insert(0, os.getcwd())
        if _is_of_python(name):
            why = f"{name} is a module of Python itself, which has no {self.error.owner}"
            raise UprightError(f"{self._is}; {why}")
        try:
            return import_module(name)
        except RAISED as error:
            if _is_missing(name, error):
                why = f"there is no module {said(name)} in this folder or where Python looks"
                raise UprightError(f"{self._is}; {why}") from error
            raise fault(self.error, self.path, "its module cannot be imported", error) from error


def _is_of_python(name: str) -> bool:
    """Whether a module is of Python's standard library, and no file of the user's hides it."""
    top = name.partition(".")[0]
    if top not in sys.stdlib_module_names:
        return False
    spec = find_spec(top)
    if spec is None or spec.origin is None or not spec.has_location:
        return True
    return Path(spec.origin).is_relative_to(sysconfig.get_path("stdlib"))


def _is_missing(name: str, error: BaseException) -> bool:
    """Whether importing the module `name` failed because it, or a package above it, is missing."""
    missing = getattr(error, "name", None)
    return isinstance(error, ModuleNotFoundError) and f"{name}.".startswith(f"{missing}.")


def path_of(thing: Any, error: type[CodeError], find: Callable[[str], object]) -> str:
    """Return the path `module:name` of a class or function.

    Parameters
    ----------
    thing
        The class or function.
    error
        The error of such code.
    find
        Returns what stands at a path.

    Raises
    ------
    UprightError
        If it has no such path, or what stands there is not this class or function.
    """
    path = f"{thing.__module__}:{thing.__qualname__}"
    if "<" in path.partition(":")[2]:  # of a lambda, or within a function
        raise UprightError(
            f"{error.owner} is {path!r}; it must be defined at the top level of a module, a script "
            "or a notebook, under a name"
        )
    if find(path) is not thing:
        raise UprightError(
            f"{error.owner} is {path!r}; another class or function has that name now"
        )
    return path


Calls = Mapping[str, tuple[str, ...]]
"""Methods by name, with the names of what they are called with."""


def refuse_class(kind: type[CodeError], name: str, thing: object) -> None:
    """Raise an error of this kind if custom code returned a class in place of an object."""
    if isinstance(thing, type):
        raise kind(
            f"{kind.owner} is {name!r}; it returned the class {thing.__name__}; it must return an "
            "object of the class"
        )


def lacking(thing: object, needed: Calls) -> list[str]:
    """Return the names of the methods that an object does not have."""
    return [method for method in needed if not callable(getattr(thing, method, None))]


def refuse_mismatches(
    kind: type[CodeError], name: str, thing: object, needed: Calls, optional: Calls
) -> None:
    """Raise an error of this kind unless methods can be called as they will be.

    Parameters
    ----------
    kind
        Class of the error: whose code it is.
    name
        Name of the custom code.
    thing
        The object that it made.
    needed
        Methods that it has.
    optional
        Methods that it may have.
    """
    given = {method: call for method, call in optional.items() if hasattr(thing, method)}
    calls = {**needed, **given}
    wrong = [text for method, call in calls.items() if (text := mismatch(thing, method, call))]
    if wrong:
        raise kind(f"{kind.owner} is {name!r}; {'; '.join(wrong)}")


def mismatch(thing: object, name: str, call: tuple[str, ...]) -> str:
    """Return how a method is defined and how it must be; empty if it can be called so."""
    method = getattr(thing, name)
    try:
        inspect.signature(method).bind(*call)
    except TypeError:
        pass
    except ValueError:  # nothing is known of its parameters, as for some functions written in C
        return ""
    else:
        return ""
    if not callable(method):
        return f"{name} is {method!r}; it must be a method {name}(self, {', '.join(call)})"
    function: Callable[..., Any] = getattr(method, "__func__", method)
    own = ("self",) if function is not method else ()
    plain = [p.replace(annotation=p.empty) for p in inspect.signature(function).parameters.values()]
    defined = inspect.Signature(plain)
    return f"{name}{defined} must be {name}({', '.join((*own, *call))})"
