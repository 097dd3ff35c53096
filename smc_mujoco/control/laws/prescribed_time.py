"""Prescribed-time reaching: u = -m s / (T - t) - k sgn(s) for t < T, u = -k sgn(s) after; s = de + c e.

s' = -m s / (T - t) is s0 (1 - t/T)^m: s = 0 at T exactly, whatever s0, with u(0) = m |s0| / T and for m >= 1 no more
after; the switching term keeps it there under |d| <= D < k, and brings it there no later. T counts from t = 0. The gain
grows without bound, so it is held at 1 / dt, from m dt before T on: the one sample in which s+ = 0. Noise is amplified
as much. Where u saturates T is missed, and after T there is classical.
Source: Y. Song, Y. Wang, J. Holloway & M. Krstic, "Time-varying feedback for regulation of normal-form nonlinear
systems in prescribed finite time", Automatica 83:243, 2017 (the growing gain); with a switching term as in a reaching
law.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE, INERTIA, RATE, TIME, Gain


@law_function(
    gains={
        "T": Gain(2.0, TIME, positive=True),
        "m": Gain(2.0, INERTIA, nonnegative=True),  # m s / (T - t) is a force
        "k": Gain(3.0, FORCE, nonnegative=True),
        "c": Gain(2.5, RATE, nonnegative=True),
    },
    conditions={"m >= 1, or u grows without bound towards T": lambda g: g.m >= 1.0},
)
def prescribed_time(y, gains, memory):
    s, eq = sliding(y, gains.c)
    left = gains.T - y.t
    pull = s * min(gains.m / left, 1.0 / y.dt) if left > 0.5 * y.dt else 0.0
    return command(y, eq - pull - gains.k * sgn(s)), s
