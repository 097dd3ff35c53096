"""Passivity-based sliding law: u = M v_r' + C v_r + g - K s - k sat(s / width), v_r = r' - c e, s =
v - v_r.

So s = de + c e. Here g also has springs and the nominal damping. The law does not cancel Coriolis
forces but keeps the mechanism passive. As M' - 2 C is skew-symmetric,

    V = s' M s / 2,    V' = -s' (K s + k sat(s / width) - d),

so that V falls while each |s_i| > width, if k_i > |d_i|. Both are forces: no bound on M^-1 d is
needed, and M is not inverted. Under a constant d, |s| = |d| / (K + k / width) remains at rest.
Gains: K, damping of s [N m s/rad]; k, switching gain [N m]; c, slope of the surface [1/s]; width,
of the boundary layer [rad/s].
Source: J.-J. E. Slotine & W. Li, "On the adaptive control of robot manipulators", Int. J. Robotics
Research 6(3):49, 1987; the same, Applied Nonlinear Control, Prentice Hall 1991, section 9.2. The
switching term has a boundary layer here.
"""

from smc_mujoco.control.joint_law import coriolis, product, saturate
from smc_mujoco.control.law import law_function
from smc_mujoco.control.units import FORCE, FORCE_PER_SPEED, RATE, SPEED, Gain


@law_function(
    joint=True,
    family="first-order",
    continuous=True,
    accuracy=0,
    requires_model=True,
    gains={
        "K": Gain(1.0, FORCE_PER_SPEED, positive=True),
        "k": Gain(1.0, FORCE, nonnegative=True),
        "c": Gain(5.0, RATE, positive=True),
        "width": Gain(0.1, SPEED, positive=True),
    },
    label="Passivity-based",
)
def passivity_based(y, gains, memory):
    s = y.de + gains.c * y.e
    # C v_r = C v - C s, and h has C v
    feedforward = product(y.M, y.ddr - gains.c * y.de) + y.h - coriolis(y, s)
    return feedforward - gains.K * s - gains.k * saturate(s / gains.width), s
