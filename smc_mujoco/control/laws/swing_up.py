"""Swing-up and catch: u = -k E sgn(x'), E = J (x'^2 / 2 + w^2 (cos x - 1)); near upright u = -q s,
s = de + w e.

E is the pendulum's energy relative to rest in the upright position. During the swing-up E' = u x' -
b x'^2 has the sign of -E whenever k |E| exceeds the friction b |x'|, so |E| falls, however small
u_max is compared with m l grav. Near upright s is the unstable mode, s' = w s + u / J. With |u| <=
u_max it can be brought back if and only if |s| < u_max / (J w). u = -q s with q > J w does so from
this whole set, and the remaining mode decays as exp(-w t). The catch starts at |s| below `part` of
that bound, within 1 rad (chosen), and ends beyond it. Angles count from the nearest upright
position. From rest the law first pushes upwards.

J = m l^2 and w = sqrt(grav / l) are gains; the defaults are those of the library's pendulum. With
the nominal model J is 1 / g. During the swing-up the trace's s is E sgn(x').
Gains: k, of the energy [1/rad]; q, of the catch [N m s/rad]; J, inertia [kg m^2]; w, rate of the
unstable mode [1/s]; part, of the catchable set.
Source: K. J. Astrom & K. Furuta, "Swinging up a pendulum by energy control", Automatica 36(2):287,
2000, eq. 8, with the torque at the pivot in place of the pivot's acceleration; the catch is
derived.
"""

import math

from smc_mujoco.control.law import law_function, sgn
from smc_mujoco.control.units import FORCE_PER_SPEED, INERTIA, RATE, Gain, Unit


@law_function(
    family="baseline",
    accuracy=0,
    label="Swing-up",
    gains={
        "k": Gain(4.0, Unit(position=-1), positive=True),  # of the force k E
        "q": Gain(6.0, FORCE_PER_SPEED, positive=True),
        "J": Gain(0.125, INERTIA, positive=True, held=True),
        "w": Gain(4.43, RATE, positive=True, held=True),
        "part": Gain(0.8, positive=True, held=True),
    },
    relative_degree=2,
    conditions={"q > J w": lambda g: g.q > g.J * g.w, "part < 1": lambda g: g.part < 1.0},
    plants=("inverted_pendulum",),
)
def swing_up(y, gains, memory):
    J = 1.0 / y.g if y.model != 0.0 else gains.J
    near = math.atan2(math.sin(y.e), math.cos(y.e))
    s = y.de + gains.w * near
    if abs(near) < 1.0 and abs(s) < gains.part * y.limit / (J * gains.w):
        return -gains.q * s, s
    E = J * (0.5 * y.v * y.v + gains.w * gains.w * (math.cos(y.x) - 1.0))
    s = E * (sgn(y.v) if y.v != 0.0 else -sgn(near))
    return -gains.k * s, s
