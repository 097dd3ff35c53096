"""Whether this thread computes as usual: foreign code, such as a library built with -Ofast, may
change how it rounds or flush small numbers to 0 for all that computes after it.
"""

from typing import Any

# what `computed` returns where nothing was changed
USUAL = (
    float.fromhex("0x1.5555555555555p-2"),
    float.fromhex("0x1.999999999999ap-4"),
    float.fromhex("0x1.99999999999a0p-26"),
)


def computes_as_usual() -> bool:
    """Return whether this thread rounds to the nearest number, and keeps subnormal ones."""
    return computed((3.0, 10.0, 2.0**-1022, 2.0**1000)) == USUAL


def computed(numbers: Any) -> tuple[float, ...]:
    """Return results that differ between the directions of rounding, and where subnormal numbers
    are flushed to 0.

    The float64 nearest to 1/3 is below it, and that to 1/10 above. No result is subnormal itself:
    it may be read as 0.
    """
    three, ten, tiny, big = numbers[:]  # from memory: no compiler knows them
    return 1.0 / three, 1.0 / ten, tiny / ten * big
