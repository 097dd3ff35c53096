"""Two drives in series: the first one's output is what the second is asked for.

The second is MuJoCo's own. The first is a lag, tau1 a' = u - a from a = 0, which the callback moves on step by step. In
between, MuJoCo holds what the second is asked for over a physics step of length h, while a moves. What is held is the
mean of a with the weights exp(-(h - t)/tau2) that the second's own lag gives it: it brings the second to where the
moving a would. So the output of two lags is exact at the end of each step for a held u, as that of one lag is.
"""

import math
from typing import NamedTuple

import numpy as np

from smc_mujoco.mechanisms.hardware.part import Actuator

SUDDEN = 1e-15  # s: a shorter lag counts as this one, as in MuJoCo


class Tandem(NamedTuple):
    """What a physics step does to the first drive's output a under a command u: numbers in 0 .. 1.

    Attributes:
      held: share of a in what the second drive is asked for, u + held (a - u).
      left: share of a in a at the end of the step, u + left (a - u).
    """

    held: float
    left: float

    def __call__(self, u: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the second drive is asked for over a step, and a at its end, of the same shape as u and a."""
        return u + self.held * (a - u), u + self.left * (a - u)


def tandem(actuator: tuple[Actuator, ...], step: float) -> Tandem | None:
    """Return what two drives in series do in a physics step of `step` s; None without a second drive."""
    drives = [part for part in actuator if part.drives]
    if len(drives) < 2:
        return None
    first, second = (step / max(drive.delay, SUDDEN) for drive in drives)  # in their time constants
    apart = abs(second - first)
    mean = -math.expm1(-apart) / apart if apart else 1.0
    held = second * math.exp(-min(first, second)) * mean / -math.expm1(-second)
    return Tandem(held=held, left=math.exp(-first))
