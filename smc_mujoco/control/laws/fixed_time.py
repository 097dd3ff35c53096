"""Fixed-time reaching: u = -(k1 [s]^a + k2 [s]^b + k sgn(s)), 0 < a < 1 < b, s = de + c e.

s' = u + d with |d| <= D <= k reaches s = 0 before 1 / (k1 (1 - a)) + 1 / (k2 (b - 1)), whatever s0.
With explicit sampling this holds only below |s0| = (2 / (k2 dt))^(1/(b - 1)). Above it k2 [s]^b
overshoots more at each sample, and diverges unless u is bounded. After reaching, the residual is
that of `classical` with this k. With k = 0, |d| <= D leaves |s| <= (D / k1)^(1/a).
Gains: k1 [N (s/m)^a] and k2 [N (s/m)^b], of the powers; a and b, exponents; k, switching gain [N];
c, slope of the surface [1/s].
Source: A. Polyakov, "Nonlinear feedback design for fixed-time stabilization of linear control
systems", IEEE Trans. Autom. Control 57(8):2106, 2012 (Lemma 1: the bound).
"""

from smc_mujoco.control.law import command, law_function, power, sgn, sliding
from smc_mujoco.control.units import FORCE, SLOPE, Gain, force_per


def order(gains):
    """Return the order of accuracy: that of a relay, or 0 without one."""
    return 1.0 if gains.k > 0.0 else 0.0


@law_function(
    family="first-order",
    finite_time="s",
    accuracy=order,
    label="Fixed-time",
    gains={
        "k1": Gain(2.0, force_per("a"), nonnegative=True),
        "k2": Gain(2.0, force_per("b"), nonnegative=True),
        "a": Gain(0.5, positive=True, held=True),
        "b": Gain(1.5, positive=True, held=True),
        "k": Gain(2.0, FORCE, nonnegative=True),
        "c": SLOPE,
    },
    conditions={
        "a < 1 < b": lambda g: g.a < 1.0 < g.b,
        "k1, k2 > 0": lambda g: g.k1 > 0.0 and g.k2 > 0.0,
    },
)
def fixed_time(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    pull = gains.k1 * power(s, gains.a) + gains.k2 * power(s, gains.b)
    return command(y, v_eq - (pull + gains.k * sgn(s))), s
