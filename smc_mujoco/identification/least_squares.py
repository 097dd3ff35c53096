"""Linear least squares."""

import numpy as np

from smc_mujoco.common.aliases import Array


def least_squares(A: Array, b: Array, ratio: float | None = None) -> Array:
    """Return x with the least |A x - b|, (p,) or (p, k). Singular values of A below `ratio` times
    the largest count as 0; None: below rounding.
    """
    return np.linalg.lstsq(A, b, rcond=ratio)[0]
