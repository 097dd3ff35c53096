"""The least relevant difference of two values of a metric, and differences by rounding.

`ranking` of laws and the answers of scenes use the same one: more than 3 % of the larger value, or what the sensor
resolves.
"""

import numpy as np
from numpy.typing import ArrayLike

from smc_mujoco.common.errors import number

RELEVANT = 0.03  # default share of the larger value that is relevant; chosen
ROUNDING = 1e-9  # in SI units: smaller differences are a tie, because they depend on how runs are integrated


def least_difference(value: ArrayLike, resolution: ArrayLike = 0.0, relevant: float = RELEVANT) -> np.ndarray:
    """Return the least relevant difference between a value >= 0 and a smaller one.

    It is the larger of a share of the value and the resolution, see `paired_runs.floor`. Any difference from inf is
    relevant.
    """
    share = relevant * np.where(np.isinf(value), 0.0, np.abs(value))
    return np.maximum(share, np.maximum(resolution, ROUNDING))


def exceeds(a: ArrayLike, b: ArrayLike, resolution: ArrayLike = 0.0, relevant: float = RELEVANT) -> np.ndarray:
    """Return whether a is larger than b by more than the least relevant difference; a, b >= 0."""
    return np.asarray(a) - least_difference(a, resolution, relevant) > np.asarray(b)


def checked_share(relevant: float) -> float:
    """Return the share of a value that is relevant. Raise ScenarioError if it is out of range."""
    return number("relevant", relevant, low=0.0, high=0.5)


def without_rounding(values: np.ndarray) -> np.ndarray:
    """Round values so that rounding errors vanish: 0 below 1e-9, else 20 binary digits."""
    share, exponent = np.frexp(np.where(np.abs(values) < ROUNDING, 0.0, values))
    with np.errstate(over="ignore"):
        return np.ldexp(np.round(share * 2**20), exponent - 20)
