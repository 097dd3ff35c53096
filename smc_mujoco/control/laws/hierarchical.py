"""Hierarchical: u = (a g u1 + gq u2 - k sgn(S) - rate S) / (a g + gq), S = a s1 + s2, s1 = de + c1 e, s2 = dq + c2 q.

For a joint e'' = f + g u - r'' that has an actuator and a joint q'' = fq + gq u that moves with it and has none. Each
would stay on its own surface under u1 = (r'' - f - c1 de) / g and u2 = (-fq - c2 dq) / gq; the law mixes the two, so
that S' = -k sgn(S) - rate S. While u is not at its bound, S = 0 from ln(1 + rate |S(0)| / k) / rate on, and it stays
there against a matched force d with |(a g + gq) d| < k; a larger one leaves |S| <= (|(a g + gq) d| - k) / rate.
Sampled explicitly, S chatters within about k dt. It has the model by default; s1 may be the scenario's surface instead.

On S = 0 what is left must bring both joints in. Its authors conclude so from V = S^2/2 by Barbalat's lemma, which gives
no more than S -> 0; to first order, without friction, it holds just if the roots p of

    (1 - a L) p^3 + (c2 - a L c1) p^2 + a grav p + a c1 grav = 0,    L = 4 l/3 for cart_pole, -l for overhead_crane

lie on the left (x + L q is a flat output: its second derivative is grav q). With a > 0 that is 0 < c1 < c2, and
a L < 1. The default gains are chosen: p = -2 1/s, three times, for cart_pole. u is singular where a g = -gq, for
cart_pole at cos q = a L, 63 degrees; past it the pole is lost.

A model of yours takes it where its joint turns as theirs do: q > 0 leans a pole the way x grows, and swings a load the
other way; else turn the joint's axis round.

Without the model, f = fq = gq = 0 and g = 1: u = -(k sgn(S) + rate S) / a. That has the sign of the crane's a g + gq
and not of the pole's, where gq < 0 outweighs a g: it brings the crane in and drops the pole.
Source: W. Wang, J. Yi, D. Zhao & D. Liu, "Design of a stable sliding-mode controller for a class of second-order
underactuated systems", IEE Proc. Control Theory Appl. 151(6):683, 2004; the roots are worked out here.
"""

from smc_mujoco.control.law import law_function, sgn, sliding
from smc_mujoco.control.units import ACCELERATION, RATE, Gain, Unit


@law_function(
    gains={
        "a": Gain(0.67, Unit(), positive=True),
        "c1": Gain(0.67, RATE, positive=True),
        "c2": Gain(3.6, RATE, nonnegative=True),
        "k": Gain(0.5, ACCELERATION, positive=True),
        "rate": Gain(3.0, RATE, nonnegative=True),
    },
    conditions={"c2 > c1": lambda g: g.c2 > g.c1},
    plants=("cart_pole", "overhead_crane"),
    requires_model=True,
)
def hierarchical(y, gains, memory):
    s1, eq = sliding(y, gains.c1)
    s = gains.a * s1 + y.dq + gains.c2 * y.q
    reaching = -gains.k * sgn(s) - gains.rate * s
    if y.model == 0.0:
        return reaching / gains.a, s
    drift = gains.a * (y.f - y.ddr - eq) + y.fq + gains.c2 * y.dq  # of S without u
    return (reaching - drift) / (gains.a * y.g + y.gq), s
