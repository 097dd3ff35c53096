"""Computed torque with sliding mode: u = M (r'' - c de - k sat(s / width)) + h, s = de + c e.

sat(a) = min(max(a, -1), 1). With the perfect model each joint obeys s' = -k sat(s / width) + d_a,
d_a = M^-1 d, whatever the others do. While |s| > width, |s| falls at the rate k, so it reaches
width at the time (|s(0)| - width) / k. Then s decays at the rate k / width. If |d_a| <= D < k, then
|s| <= width D / k and |e| <= width D / (k c) remain. A boundary layer of a width below k dt
chatters.
Gains: k, switching gain [rad/s^2]; c, slope of the surface [1/s]; width, of the boundary layer
[rad/s].
Source: J.-J. E. Slotine & W. Li, Applied Nonlinear Control, Prentice Hall 1991, sections 7.1 and
9.1.
"""

from smc_mujoco.control.joint_law import saturate, torque
from smc_mujoco.control.law import law_function
from smc_mujoco.control.units import ACCELERATION, RATE, SPEED, Gain


@law_function(
    joint=True,
    family="first-order",
    continuous=True,
    accuracy=0,
    requires_model=True,
    gains={
        "k": Gain(10.0, ACCELERATION, positive=True),
        "c": Gain(5.0, RATE, positive=True),
        "width": Gain(0.1, SPEED, positive=True),
    },
    label="Computed-torque sliding",
)
def computed_torque_sliding(y, gains, memory):
    s = y.de + gains.c * y.e
    return torque(y, -gains.c * y.de - gains.k * saturate(s / gains.width)), s
