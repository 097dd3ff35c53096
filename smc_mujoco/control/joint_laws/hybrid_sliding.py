"""Hybrid control: u = M (P (r'' - c de) + a) + h + A' (force - B A v - n' L J a) + friction, a = -k
sat(s / width).

The tip presses with a wanted force along the direction n, and a sliding mode moves the joints in
all other directions. A = n' J is the row of the tip's Jacobian J along n, z = M^-1 A', G = A z, L =
(J M^-1 J')^-1 is the inertia of the tip, and s = P (de + c e). The projection P = 1 - z A / G keeps
the part of a motion that does not move the tip along n. n' L J a is the force along n that the
acceleration a would exert. While a wall holds the tip along n, A v = 0. Then the normal force f and
s obey, with the perfect model, in slow motion and under a disturbance d,

    s' = P (a + M^-1 d),    f = force + A (a + M^-1 d) / G - n' L J a.

The friction of the wall is a disturbance d = -J' t phi along a direction t with n' t = 0. Once a
cancels it, f = force. Other disturbances along n, such as the friction of the joints, change the
force for every k, because the law does not measure the force. The law compensates f1 / (1 + exp(-f2
(v + f3))) - f1 / (1 + exp(-f2 f3)), the friction that C. Gaz et al. identified for a Panda. Without
contact the tip moves along n at the speed force / B.
Gains: force, wanted normal force [N]; nx, ny, nz, direction in which the tip presses, in the
world's frame; B, damping along n [N s/m]; c, slope of the surface [1/s]; k, switching gain
[rad/s^2]; width, of the boundary layer [rad/s]; f1, f2, f3, of the joints' friction [N m, s/rad,
rad/s].
Sources: M. Raibert & J. Craig, "Hybrid position/force control of manipulators", J. Dyn. Syst. Meas.
Control 102:126, 1981; O. Khatib, "A unified approach for motion and force control of robot
manipulators", IEEE J. Robotics and Automation 3(1):43, 1987 (the consistent projection). The
sliding mode in the free directions is derived here.
"""

import math

import numpy as np

from smc_mujoco.control.joint_law import inner, jacobian, product, saturate, solve
from smc_mujoco.control.law import law_function
from smc_mujoco.control.units import ACCELERATION, FORCE, RATE, SPEED, Gain, Unit


@law_function(
    joint=True,
    family="first-order",
    continuous=True,
    accuracy=0,
    requires_model=True,
    gains={
        "force": Gain(10.0, held=True, shared=True),
        "nx": Gain(1.0, held=True, shared=True),
        "ny": Gain(0.0, held=True, shared=True),
        "nz": Gain(0.0, held=True, shared=True),
        "B": Gain(50.0, held=True, nonnegative=True, shared=True),
        "c": Gain(10.0, RATE, positive=True),
        "k": Gain(10.0, ACCELERATION, positive=True),
        "width": Gain(0.1, SPEED, positive=True),
        "f1": Gain(0.0, FORCE, held=True),
        "f2": Gain(0.0, Unit(position=-1, time=1), held=True),
        "f3": Gain(0.0, SPEED, held=True),
    },
    label="Hybrid of position and force",
)
def hybrid_sliding(y, gains, memory):
    n = np.array([gains.nx, gains.ny, gains.nz]) / math.sqrt(
        gains.nx**2 + gains.ny**2 + gains.nz**2
    )
    J = jacobian(y)
    A = n[0] * J[0] + n[1] * J[1] + n[2] * J[2]
    z = solve(y.M, A)
    G = inner(A, z)
    s = y.de + gains.c * y.e
    s = s - z * (inner(A, s) / G)
    w = y.ddr - gains.c * y.de
    w = w - z * (inner(A, w) / G)
    a = -gains.k * saturate(s / gains.width)
    tip = np.zeros(3)
    inverse = np.zeros((3, 3))
    for i in range(3):
        tip[i] = inner(J[i], a)
        column = solve(y.M, J[i])
        for j in range(3):
            inverse[j, i] = inner(J[j], column)
    exerted = inner(n, solve(inverse, tip))  # n' L J a
    friction = np.zeros(len(s))
    for i in range(len(s)):
        friction[i] = gains.f1[i] / (1.0 + math.exp(-gains.f2[i] * (y.v[i] + gains.f3[i])))
        friction[i] -= gains.f1[i] / (1.0 + math.exp(-gains.f2[i] * gains.f3[i]))
    pressing = gains.force - gains.B * inner(A, y.v) - exerted
    return product(y.M, w + a) + y.h + A * pressing + friction, s
