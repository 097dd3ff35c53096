"""Prescribed-time reaching: u = -m s / (T - t) - k sgn(s) for t < T, u = -k sgn(s) after; s = de +
c e.

s' = -m s / (T - t) has the solution s0 (1 - t/T)^m, so s = 0 exactly at T, whatever s0. u starts at
m |s0| / T and, for m >= 1, never exceeds this. The switching term keeps s = 0 under |d| <= D < k,
and does not delay reaching. T counts from t = 0. The gain m / (T - t) grows without bound, so it is
limited to 1 / dt, from m dt before T on; this value gives s+ = 0 in one sample. Noise is amplified
by the same gain. If u saturates, T is missed, and after T the law is `classical`.
Gains: T, time of reaching [s]; m, of the growing gain [kg]; k, switching gain [N]; c, slope of the
surface [1/s].
Source: Y. Song, Y. Wang, J. Holloway & M. Krstic, "Time-varying feedback for regulation of
normal-form nonlinear systems in prescribed finite time", Automatica 83:243, 2017 (the growing
gain); with a switching term as in a reaching law.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE, INERTIA, SLOPE, TIME, Gain


@law_function(
    family="first-order",
    finite_time="s",
    accuracy=1,
    label="Prescribed-time",
    gains={
        "T": Gain(2.0, TIME, positive=True),
        "m": Gain(2.0, INERTIA, nonnegative=True),  # m s / (T - t) is a force
        "k": Gain(3.0, FORCE, nonnegative=True),
        "c": SLOPE,
    },
    conditions={"m >= 1, or u grows without bound towards T": lambda g: g.m >= 1.0},
)
def prescribed_time(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    remaining = gains.T - y.t
    pull = s * min(gains.m / remaining, 1.0 / y.dt) if remaining > 0.5 * y.dt else 0.0
    return command(y, v_eq - pull - gains.k * sgn(s)), s
