"""Where everything is in the memory of a learner, as data for other programs."""

from typing import Any

from upright.builds.memory import Memory


def places(memory: Memory) -> dict[str, Any]:
    """Return type, shape and offset [bytes] of every number and array, by name."""
    return {
        place.name: {
            "type": place.dtype.name,
            "shape": list(place.shape),
            "offset": place.offset,
        }
        for place in memory.places.values()
    }
