"""Rotary swing-up and catch: u = w - k sat(s / phi) - k1 [s]^(1/2), w' = -k2 sgn(s), near upright;
before, by energy.

E = q'^2 / (2 w0^2) + cos q - 1 is the pendulum's energy relative to rest upright, in m grav l.
During the swing-up the arm gets the acceleration a = sat(pump E) sgn(q' cos q) - 20 x - 3 v, by the
nominal model or, without it, by u = J a. E' = -m L l cos(q) q' a / (m grav l) then has the sign of
-E, except for the last two terms, which keep the arm near 0 (chosen); a jumps with the sign of q'
cos q. The catch begins where |q| < 0.35 and |s| < catch, and ends at |q| > 0.8 (chosen).

s = c1 x + c2 q + c3 v + c4 q' is b'P z / R, of the Riccati equation A'P + P A - P b b'P / R + Q = 0
at the upright equilibrium: with V = z'P z, V' = -z'Q z on s = 0, whatever u is. u = -s (k = phi =
1) is the linear quadratic regulator, k > 0 with a small phi almost a relay, k1 and k2 > 0
super-twisting. u is continuous at s = 0, as phi > 0. c1 .. c4 are by default those of the library's
Furuta pendulum for Q = diag(1, 10, 0.05, 0.05), R = 2000. q counts from the nearest upright
position.
Gains: k, bound of the relay [N m]; phi, half-width of its layer [N m]; k1 [(N m)^(1/2)] and k2 [N
m/s], of super-twisting; w_max, bound of w [N m]; c1 and c2 [N m/rad], c3 and c4 [N m s/rad], of s;
pump and most [rad/s^2], of the pumping and its bound; w0, of small oscillations when hanging [1/s];
J, inertia of the arm [kg m^2]; catch, |s| where the catch begins [N m].
Sources: K. J. Astrom & K. Furuta, "Swinging up a pendulum by energy control", Automatica 36(2):287,
2000 (the pumping); S. Gutman, "Uncertain dynamical systems: a Lyapunov min-max approach", IEEE
Trans. Automatic Control 24(3):437, 1979 (the surface b'P z = 0).
"""

import math

from smc_mujoco.control.law import law_function, sgn
from smc_mujoco.control.units import (
    ACCELERATION,
    FORCE,
    FORCE_PER_POSITION,
    FORCE_PER_SPEED,
    FORCE_RATE,
    INERTIA,
    RATE,
    Gain,
    Unit,
)


@law_function(
    family="underactuated",
    gains={
        "k": Gain(0.0, FORCE, nonnegative=True),
        "phi": Gain(1.0, FORCE, positive=True, held=True),
        "k1": Gain(0.2, Unit(force=0.5), nonnegative=True),
        "k2": Gain(0.1, FORCE_RATE, nonnegative=True),
        "w_max": Gain(0.03, FORCE, nonnegative=True, held=True),
        "c1": Gain(-0.02236068, FORCE_PER_POSITION, held=True),
        "c2": Gain(-0.23625222, FORCE_PER_POSITION, held=True),
        "c3": Gain(-0.01029829, FORCE_PER_SPEED, held=True),
        "c4": Gain(-0.02020648, FORCE_PER_SPEED, held=True),
        "pump": Gain(150.0, ACCELERATION, positive=True, held=True),
        "most": Gain(80.0, ACCELERATION, positive=True, held=True),
        "w0": Gain(10.680345, RATE, positive=True, held=True),
        "J": Gain(1.0455e-4, INERTIA, positive=True, held=True),
        "catch": Gain(0.05, FORCE, positive=True, held=True),
    },
    memory=2,
    plants=("furuta",),
    requires_model=True,
    continuous=True,
    accuracy=0,
    label="Rotary swing-up",
    short="RU",
)
def rotary_swing_up(y, gains, memory):
    q = math.atan2(math.sin(y.q), math.cos(y.q))
    s = gains.c1 * y.e + gains.c2 * q + gains.c3 * y.de + gains.c4 * y.dq
    if abs(q) < 0.35 and abs(s) < gains.catch:
        memory[0] = 1.0
    elif abs(q) > 0.8:
        memory[0] = 0.0
        memory[1] = 0.0
    if memory[0] == 0.0:
        energy = 0.5 * y.dq * y.dq / (gains.w0 * gains.w0) + math.cos(q) - 1.0
        push = min(max(gains.pump * energy, -gains.most), gains.most) * sgn(y.dq * math.cos(q))
        if y.dq == 0.0:
            push = gains.most * sgn(q)  # from rest
        a = push - 20.0 * y.e - 3.0 * y.de
        return ((a - y.f) / y.g if y.model != 0.0 else gains.J * a), s
    w = memory[1]
    memory[1] = min(max(w - y.dt * gains.k2 * sgn(s), -gains.w_max), gains.w_max)
    return w - gains.k * min(max(s / gains.phi, -1.0), 1.0) - gains.k1 * sgn(s) * math.sqrt(
        abs(s)
    ), s
