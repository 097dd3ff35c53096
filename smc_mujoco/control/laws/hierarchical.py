"""Hierarchical: u = (a g u1 + gq u2 - k sgn(S) - rate S) / (a g + gq), S = a s1 + s2, s1 = de + c1
e, s2 = dq + c2 q.

For a joint with an actuator, e'' = f + g u - r'', that moves a joint without one, q'' = fq + gq u.
Under u1 = (r'' - f - c1 de) / g the first joint stays on its surface, under u2 = (-fq - c2 dq) / gq
the second. The law mixes the two so that S' = -k sgn(S) - rate S. While u is not saturated, S = 0
from the time ln(1 + rate |S(0)| / k) / rate on, and stays 0 under a matched disturbance d with |(a
g + gq) d| < k. A larger one leaves |S| <= (|(a g + gq) d| - k) / rate. Sampled explicitly, S
chatters within about k dt. A force on the joint without an actuator leaves an error e all the same.
A scenario gives this law the nominal model by default. s1 may be the scenario's surface instead.

The motion on S = 0 must bring both joints to rest. The authors conclude this from V = S^2/2 by
Barbalat's lemma, which proves only S -> 0. To first order, without friction, both joints come to
rest if and only if the roots p of

    (1 - a L) p^3 + (c2 - a L c1) p^2 + a grav p + a c1 grav = 0,
    L = 4 l/3 for cart_pole, -l for overhead_crane

lie in the left half-plane (x + L q is a flat output: its second derivative is grav q). For a > 0
this means 0 < c1 < c2 and a L < 1. The default gains bring the three roots of cart_pole near -2
1/s. u is singular at a g = -gq, for cart_pole at cos q = a L, 63 degrees; beyond this angle the
pole falls.

Your own model can use the law if its joint has the same sign: q > 0 leans a pole towards growing x,
and swings a load the other way. If it does not, reverse the axis of the joint.

Without the model f = fq = gq = 0 and g = 1, so u = -(k sgn(S) + rate S) / a. Its sign is right for
the crane, and wrong for the pole, because gq < 0 outweighs a g there: the crane comes to rest, and
the pole falls.
Gains: a, weight of the first joint's surface; c1 and c2, slopes of the surfaces [1/s]; k, switching
gain [m/s^2]; rate, reaching rate [1/s].
Source: W. Wang, J. Yi, D. Zhao & D. Liu, "Design of a stable sliding-mode controller for a class of
second-order underactuated systems", IEE Proc. Control Theory Appl. 151(6):683, 2004; the roots are
worked out here.
"""

from smc_mujoco.control.law import law_function, sgn, sliding
from smc_mujoco.control.units import ACCELERATION, RATE, Gain, Unit


@law_function(
    family="underactuated",
    finite_time="s",
    accuracy={"s": 1, "e": 0},
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
    s1, v_eq = sliding(y, gains.c1)
    s = gains.a * s1 + y.dq + gains.c2 * y.q
    reaching = -gains.k * sgn(s) - gains.rate * s
    if y.model == 0.0:
        return reaching / gains.a, s
    drift = gains.a * (y.f - y.ddr - v_eq) + y.fq + gains.c2 * y.dq  # S' without u
    return (reaching - drift) / (gains.a * y.g + y.gq), s
