"""References that move: a ramp, and the smooth way from one place to another; with Sine and Step among the signals."""

import dataclasses

from smc_mujoco.simulation.signals import EARLY, Signal


@dataclasses.dataclass(frozen=True)
class Ramp(Signal):
    """0 before `time`, slope (t - time) from then on; slope in the signal's unit per second."""

    slope: float
    time: float = 0.0

    @staticmethod
    def value(t, p):
        if t < p.time * EARLY:
            return 0.0, 0.0, 0.0
        return p.slope * (t - p.time), p.slope, 0.0


@dataclasses.dataclass(frozen=True)
class MinimumJerk(Signal):
    """amplitude (10 a^3 - 15 a^4 + 6 a^5), a = (t - time)/duration held to 0 .. 1: a smooth move from rest to rest.

    Of all moves in that time it has the least integral of the squared jerk; velocity and acceleration are 0 at both
    ends. Source: T. Flash & N. Hogan, "The coordination of arm movements: an experimentally confirmed mathematical
    model", J. Neuroscience 5(7):1688, 1985.
    """

    amplitude: float
    time: float
    duration: float

    positive = ("duration",)

    @staticmethod
    def value(t, p):
        a = min(max((t - p.time) / p.duration, 0.0), 1.0)
        b, T = 1.0 - a, p.duration
        r = p.amplitude * a * a * a * (10.0 - a * (15.0 - 6.0 * a))
        return r, p.amplitude * 30.0 * a * a * b * b / T, p.amplitude * 60.0 * a * b * (1.0 - 2.0 * a) / (T * T)
