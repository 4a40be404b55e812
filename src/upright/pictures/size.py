"""Sizes of pictures."""

import re
from typing import NamedTuple

from upright.errors import UprightError

SMALLEST, LARGEST = 320, 3840
"""Smallest width, and largest width and height, of a picture [pixels]."""
SHORTEST = 176
"""Smallest height of a picture [pixels]."""
BLOCK = 16
"""Codecs divide pictures into squares of this size [pixels]."""


class Size(NamedTuple):
    """Width and height of a picture [pixels]."""

    width: int
    height: int

    def __str__(self) -> str:
        """Return the size as people write it."""
        return f"{self.width}x{self.height}"


SIZE = Size(640, 352)
"""The usual size of a picture; multiples of 16, which video codecs prefer."""


def parse_size(text: str) -> Size:
    """Return the size that a text such as "1280x720", or only a width such as "1280", stands for.

    The height that belongs to a width alone has the usual proportions, as a multiple of 16.

    Raises
    ------
    UprightError
        If it is not a size, too small, too large, or odd, which videos cannot be.
    """
    numbers = re.fullmatch(r"([0-9]{1,5})(?:\s*[x×X]\s*([0-9]{1,5}))?", text.strip())
    if numbers:
        width = int(numbers[1])
        usual = BLOCK * round(width * SIZE.height / SIZE.width / BLOCK)
        size = Size(width, int(numbers[2]) if numbers[2] else usual)
        in_range = SMALLEST <= size.width <= LARGEST and SHORTEST <= size.height <= LARGEST
        if in_range and size.width % 2 == size.height % 2 == 0:
            return size
    raise UprightError(
        f"size is {text!r}; it must be a width, such as 1280, or WIDTHxHEIGHT, such as 1280x720, "
        f"in even numbers of pixels from {Size(SMALLEST, SHORTEST)} to {Size(LARGEST, LARGEST)}"
    )
