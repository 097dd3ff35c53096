"""Unit vector control: u = M (r'' - c de - rho s / (|s| + eps)) + h, s = de + c e, |s| the norm of
all joints.

The control switches on a subspace, s = 0, and not on each joint's surface: it is discontinuous only
where all s are 0. With the perfect model and eps = 0, s' = -rho s / |s|: s keeps its direction, |s|
falls at the rate rho, and all joints reach their surfaces together at the time |s(0)| / rho. If
|d_a| <= D < rho for d_a = M^-1 d, then |s| <= eps D / (rho - D) remains. Joints with different
units enter one norm, so choose c and rho with care.
Gains: rho, switching gain, shared by all joints [rad/s^2]; c, slope of the surface [1/s]; eps,
which smooths the unit vector, shared by all joints [rad/s].
Sources: S. Gutman, "Uncertain dynamical systems - a Lyapunov min-max approach", IEEE Trans. Autom.
Control 24(3):437, 1979; V. Utkin, J. Guldner & J. Shi, Sliding Mode Control in Electro-Mechanical
Systems, CRC Press 2009 (unit control).
"""

from smc_mujoco.control.joint_law import norm, torque
from smc_mujoco.control.law import law_function
from smc_mujoco.control.units import ACCELERATION, RATE, SPEED, Gain


@law_function(
    joint=True,
    family="first-order",
    continuous=True,
    accuracy={
        "s": lambda g: 0.0 if g.eps > 0.0 else 1.0,
        "e": lambda g: 0.0 if g.eps > 0.0 else 1.0,
    },
    requires_model=True,
    gains={
        "rho": Gain(10.0, ACCELERATION, positive=True, shared=True),
        "c": Gain(5.0, RATE, positive=True),
        "eps": Gain(0.05, SPEED, nonnegative=True, shared=True),
    },
)
def unit_vector(y, gains, memory):
    s = y.de + gains.c * y.e
    length = norm(s) + gains.eps
    if length == 0.0:
        return torque(y, -gains.c * y.de), s
    return torque(y, -gains.c * y.de - gains.rho * s / length), s
