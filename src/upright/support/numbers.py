"""Whole numbers as people write them."""

import re

from upright.errors import UprightError, said

PLAIN = re.compile(r"[+-]?[0-9]{1,30}|[+-]?[0-9]{1,3}(_[0-9]{3})+")
COMMAS = re.compile(r"[+-]?[0-9]{1,3}(,[0-9]{3})+")
SCALED = re.compile(r"([+-]?[0-9]{1,30}(?:\.[0-9]{1,30})?)(?:[eE]\+?([0-9]{1,2})|([kKM]))")
EXPONENTS = {"k": 3, "K": 3, "M": 6}


def whole_number(text: str, *, commas: bool = True) -> int:
    """Return the whole number that a text stands for.

    Parameters
    ----------
    text
        The text.
    commas
        Whether there may be commas between thousands.

    Raises
    ------
    UprightError
        If the text can be read in two ways, such as 60.000, or is not a whole number.

    Examples
    --------
    >>> from upright.support.numbers import whole_number
    >>> [whole_number(text) for text in ("60000", "60,000", "60_000", "6e4", "1.5k", "-1")]
    [60000, 60000, 60000, 60000, 1500, -1]
    """
    text = text.strip()
    if PLAIN.fullmatch(text) or (commas and COMMAS.fullmatch(text)):
        return int(text.replace(",", ""))
    if scaled := SCALED.fullmatch(text):
        from decimal import Decimal  # imported late: few numbers need it

        number, exponent, letter = scaled.groups()
        value = Decimal(number).scaleb(EXPONENTS[letter] if letter else int(exponent))
        if value == value.to_integral_value():
            return int(value)
    forms = "60000, 60,000, 60_000, 6e4 or 60k" if commas else "60000, 60_000, 6e4 or 60k"
    raise UprightError(f"{said(text)}; it must be a whole number, written like {forms}")
