"""When two values of a metric differ: by more than rounding, and by enough to matter.

    exceeds(0.31, 0.30)                                # True: more than 3 % of the larger value
    exceeds(0.31, 0.30, scale=2.5)                     # False: less than 0.5 % of the scale

The least relevant difference is one for all that is compared: laws in `ranking`, and what claims call larger or slower.
"""

import numpy as np
from numpy.typing import ArrayLike

OF_VALUE, OF_SCALE = 0.03, 0.005  # the least relevant difference: more than these shares, see `least_difference`
# In SI units, and relative: runs that differ by less are tied, for how they are integrated decides about it.
ROUNDING, ALIKE = 1e-9, 1e-6


def least_difference(value: ArrayLike, scale: ArrayLike = 0.0, resolution: ArrayLike = 0.0) -> np.ndarray:
    """Return the least relevant difference between a value >= 0 and a smaller one.

    It is the largest of 3 % of the value, 0.5 % of the scale, and the resolution; any difference from inf is relevant.

    Args:
      scale: of such values: of a position error the largest |x0|, of a command u_max, of a percentage 100.
      resolution: the least difference that the sensor can tell; 0 for any.
    """
    own = OF_VALUE * np.where(np.isinf(value), 0.0, np.abs(value))
    return np.maximum(np.maximum(own, OF_SCALE * np.abs(scale)), np.maximum(resolution, ROUNDING))


def exceeds(a: ArrayLike, b: ArrayLike, scale: ArrayLike = 0.0, resolution: ArrayLike = 0.0) -> np.ndarray:
    """Return whether a is larger than b by more than the least relevant difference; a, b >= 0."""
    return np.asarray(a) - least_difference(a, scale, resolution) > np.asarray(b)


def worse(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return 1.0 where a is larger than b, -1.0 where smaller, 0.0 for a difference of rounding; NaN where both are."""
    tie = np.maximum(ROUNDING, ALIKE * np.minimum(np.abs(a), np.abs(b)))
    return np.where(np.isnan(a), np.nan, (a > b + tie).astype(float) - (b > a + tie))


def coarse(values: np.ndarray) -> np.ndarray:
    """Round values so that rounding errors vanish: 0 below 1e-9, else 20 binary digits."""
    share, exponent = np.frexp(np.where(np.abs(values) < ROUNDING, 0.0, values))
    with np.errstate(over="ignore"):
        return np.ldexp(np.round(share * 2**20), exponent - 20)
