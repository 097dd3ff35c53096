"""The least relevant difference of two values of a metric, and differences by rounding.

    exceeds(0.31, 0.30)                                # True: more than 3 % of the larger value
    exceeds(0.31, 0.30, scale=2.5)                     # False: less than 0.5 % of the scale

All comparisons use the same least relevant difference: `ranking` of laws, and claims about larger or slower values.
"""

import numpy as np
from numpy.typing import ArrayLike

OF_VALUE, OF_SCALE = 0.03, 0.005  # shares in the least relevant difference, see `least_difference`
# In SI units, and relative: smaller differences are a tie, because they depend on how runs are integrated.
ROUNDING, ALIKE = 1e-9, 1e-6


def least_difference(value: ArrayLike, scale: ArrayLike = 0.0, resolution: ArrayLike = 0.0) -> np.ndarray:
    """Return the least relevant difference between a value >= 0 and a smaller one.

    It is the largest of 3 % of the value, 0.5 % of the scale, and the resolution. Any difference from inf is relevant.

    Args:
      scale: usual size of such values: the largest |x0| for a position error, u_max for a command, 100 for percentages.
      resolution: least difference that the sensor can resolve; 0 for any.
    """
    own = OF_VALUE * np.where(np.isinf(value), 0.0, np.abs(value))
    return np.maximum(np.maximum(own, OF_SCALE * np.abs(scale)), np.maximum(resolution, ROUNDING))


def exceeds(a: ArrayLike, b: ArrayLike, scale: ArrayLike = 0.0, resolution: ArrayLike = 0.0) -> np.ndarray:
    """Return whether a is larger than b by more than the least relevant difference; a, b >= 0."""
    return np.asarray(a) - least_difference(a, scale, resolution) > np.asarray(b)


def worse(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return 1.0 where a is larger than b, -1.0 where smaller, 0.0 where equal up to rounding; NaN where a is NaN."""
    tie = np.maximum(ROUNDING, ALIKE * np.minimum(np.abs(a), np.abs(b)))
    return np.where(np.isnan(a), np.nan, (a > b + tie).astype(float) - (b > a + tie))


def coarse(values: np.ndarray) -> np.ndarray:
    """Round values so that rounding errors vanish: 0 below 1e-9, else 20 binary digits."""
    share, exponent = np.frexp(np.where(np.abs(values) < ROUNDING, 0.0, values))
    with np.errstate(over="ignore"):
        return np.ldexp(np.round(share * 2**20), exponent - 20)
