"""Numbers beside the words they count."""


def count(number: int, thing: str) -> str:
    """Return a number with the noun for one such thing, which gets an s if there are more.

    Examples
    --------
    >>> from upright.support.words import count
    >>> count(1, "run"), count(60_000, "step")
    ('1 run', '60,000 steps')
    """
    return f"{number:,} {thing}{'' if number == 1 else 's'}"
