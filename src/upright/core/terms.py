"""Terms: the grammar in which the options --noise and --condition name disturbances. Data only.

A text has names of cases and terms, joined by commas: ``delay-1,encoder=1024,no-velocities``. A
term is NAME=SIZE, or NAME alone if it has no size. Every text has one canonical form, so that the
same task has the same name everywhere; where lists of cases have commas between, + joins terms.
"""

import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import NamedTuple

from upright.core.parameters import LARGEST, SMALLEST, lowest
from upright.errors import UprightError, require, require_one_of, said

FRACTION = "fraction"
"""Unit of sizes that may also be given in percent: 0.1 or 10%."""
RANGE = "LOW:HIGH[:log]"
"""In place of a unit: the size is a `Range`."""


class Term(NamedTuple):
    """What a term means, and which sizes it may have."""

    meaning: str
    """What it does, in a sentence without its full stop."""
    unit: str
    """Unit of its size, as people write it; empty for a term without a size."""
    low: float = 0.0
    """Smallest size."""
    high: float = LARGEST
    """Largest size."""
    whole: bool = False
    """Whether its size is a whole number."""
    source: str = ""
    """Where it is from, if it was published."""


class Range(NamedTuple):
    """Where a parameter is drawn from."""

    low: float
    """Smallest value, in the parameter's unit."""
    high: float
    """Largest value."""
    is_log: bool = False
    """Whether values are uniform on a logarithmic scale."""


Size = float | int | bool | Range
"""Size of a term; True for a term without a size."""
VARIABLE = (
    "gravity",
    "cart_mass",
    "pole_mass",
    "half_length",
    "cart_friction",
    "pole_friction",
    "force",
)
"""Parameters that may change in a run, or be drawn."""
_PLACES = {"STEP": r"(?P<step>\d{1,9})", "PARAMETER": r"(?P<parameter>\w+)"}
"""Words in the name of a term that stand for something, and what they may stand for."""


def parse_terms(
    kind: str,
    text: str,
    terms: Mapping[str, Term],
    names: Mapping[str, str],
    advice: Callable[[str], str] = lambda _name: "",
) -> dict[str, Size]:
    """Return the terms of a text with their sizes, in the order of the table of terms.

    Parameters
    ----------
    kind
        What the text describes, for errors: "noise" or "condition".
    text
        The text.
    terms
        Every term by name. STEP and PARAMETER in a name stand for a number and for a parameter.
    names
        Names of cases, each with the terms it stands for.
    advice
        Returns what to say of an unknown name in place of the known ones, or an empty string.

    Raises
    ------
    UprightError
        If a term is unknown, is given twice, or has an impossible size.
    """
    if not isinstance(text, str):
        require_one_of(kind, text, names)
    found: dict[str, Size] = {}
    for part in re.split(r"[,+](?![\d.])", text):
        for name, size in _sizes(kind, part.strip(), terms, names, advice).items():
            if name in found:
                raise UprightError(f"{kind} is {said(text)}; it has {name} twice")
            found[name] = size
    return dict(sorted(found.items(), key=lambda item: _rank(item[0], terms)))


def canonical_text(sizes: Mapping[str, Size], names: Mapping[str, str]) -> str:
    """Return the text of terms with their sizes: the name of a case if there is one, or terms.

    Examples
    --------
    >>> from upright.core.terms import canonical_text
    >>> canonical_text({"delay": 1, "encoder": 1024, "no-velocities": True}, {})
    'delay=1,encoder=1024,no-velocities'
    >>> canonical_text({"delay": 1}, {"delay-1": "delay=1"})
    'delay-1'
    """
    text = ",".join(
        name if size is True else f"{name}={size_text(size)}" for name, size in sizes.items()
    )
    return next((name for name, stands_for in names.items() if stands_for == text), text)


def size_text(size: Size) -> str:
    """Return the text of a size, which reads back as the same number."""
    if isinstance(size, Range):
        ends = f"{size_text(size.low)}:{size_text(size.high)}"
        return f"{ends}:log" if size.is_log else ends
    return str(size) if isinstance(size, int) else repr(size).removesuffix(".0")


def _sizes(
    kind: str,
    part: str,
    terms: Mapping[str, Term],
    names: Mapping[str, str],
    advice: Callable[[str], str],
) -> dict[str, Size]:
    """Return the terms, with their sizes, that a part of a text stands for."""
    if part in names:
        return parse_terms(kind, names[part], terms, {}) if names[part] else {}
    name, sign, size = (word.strip() for word in part.partition("="))
    if (form := form_of(name, terms)) is None:
        if name in names:
            raise UprightError(f"{kind} {name} is {said(size)}; it is a case, which has no size")
        if why := advice(name):
            raise UprightError(f"{kind} is {said(part)}; {why}")
        require_one_of(kind, name, dict.fromkeys([*names, *written(terms)]))
    assert form is not None
    term, places = terms[form], _places(form, name)
    if "parameter" in places:
        require_one_of(f"parameter in {said(name)[1:-1]}", places["parameter"], VARIABLE)
    if "step" in places:
        name = name.replace(places["step"], str(int(places["step"])), 1)
    label = f"{kind} {name}"
    if sign and not term.unit:
        raise UprightError(f"{label} is {said(size)}; it has no size: write {name}")
    if not sign and term.unit:
        raise UprightError(f"{label} has no size; write {name}=SIZE [{term.unit}]")
    if term.unit == RANGE:
        return {name: _range(label, size)}
    return {name: _size(label, size, term) if term.unit else True}


def written(terms: Mapping[str, Term]) -> list[str]:
    """Return the names of terms, those that need a size with an equals sign."""
    return [f"{name}=" if term.unit else name for name, term in terms.items()]


def form_of(name: str, terms: Mapping[str, Term]) -> str | None:
    """Return the name that a term has in the table of terms; None if it is not there.

    Only names with a dot have words that stand for something.
    """
    if "." not in name:
        return name if name in terms else None
    return next((form for form in terms if "." in form and _pattern(form).fullmatch(name)), None)


@cache
def _pattern(form: str) -> re.Pattern[str]:
    """Return the pattern of the names that a name in the table of terms stands for."""
    pattern = re.escape(form)
    for word, place in _PLACES.items():
        pattern = pattern.replace(word, place)
    return re.compile(pattern)


def _places(form: str, name: str) -> dict[str, str]:
    """Return what stands in a name for the words STEP and PARAMETER."""
    match = _pattern(form).fullmatch(name) if "." in form else None
    return match.groupdict() if match else {}


def _rank(name: str, terms: Mapping[str, Term]) -> tuple[int, int, str]:
    """Return where a term stands in canonical order."""
    form = form_of(name, terms)
    assert form is not None
    return list(terms).index(form), int(_places(form, name).get("step", 0)), name


def _size(label: str, text: str, term: Term) -> float | int:
    """Return the size that a text gives."""
    percent = term.unit == FRACTION and text.endswith("%")
    try:
        size = float(text.removesuffix("%") if percent else text) / (100.0 if percent else 1.0)
        size += 0.0  # -0 is 0
    except ValueError:
        raise UprightError(f"{label} is {said(text)}; it must be a number [{term.unit}]") from None
    if term.unit == FRACTION and not 0.0 <= size <= 1.0:
        raise UprightError(f"{label} is {said(text)}; it must be from 0 to 1, such as 0.05 or 5%")
    whole = term.whole and size.is_integer()
    require(label, int(size) if whole else size, term.low, term.high, whole=term.whole)
    return int(size) if whole else size


def _range(label: str, text: str) -> Range:
    """Return the range that a text gives."""
    match = re.fullmatch(r"([^:]+):([^:]+)(:log)?", text)
    try:
        low, high = float(match[1]), float(match[2])  # type: ignore[index]
    except (TypeError, ValueError):
        raise UprightError(f"{label} is {said(text)}; it must be {RANGE}") from None
    return checked_range(label, Range(low, high, match is not None and bool(match[3])))


def checked_range(label: str, drawn: Range) -> Range:
    """Return the range of a parameter with its ends as floats.

    Parameters
    ----------
    label
        Name of the range, for errors. It ends in the name of the parameter, after a dot if need be.
    drawn
        The range.

    Raises
    ------
    UprightError
        If its ends are not numbers in order, or too small.
    """
    low = SMALLEST if drawn.is_log else lowest(label.rpartition(".")[2])
    require(f"the low end of {label}", drawn.low, low, LARGEST)
    require(f"the high end of {label}", drawn.high, drawn.low, LARGEST)
    return Range(drawn.low + 0.0, drawn.high + 0.0, bool(drawn.is_log))  # floats, and no -0
