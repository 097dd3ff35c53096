"""PID: s = de + kp e + ki I, I' = e; on s = 0 the error follows e'' + kp e' + ki e = 0.

Poles of p^2 + kp p + ki; I starts at 0, so that s(0) = de + kp e: there is a reaching phase, in which I winds up, and
the overshoot that it costs is the price of no steady error under a law that leaves a constant s. I is integrated by
the explicit Euler rule.
Source: J.-J. Slotine & W. Li, Applied Nonlinear Control, Prentice Hall 1991, section 7.1.1 (s with the integral of e).
"""

from smc_mujoco.control.surface import surface_function
from smc_mujoco.control.units import RATE, RATE2, Gain


@surface_function(gains={"kp": Gain(3.0, RATE, positive=True), "ki": Gain(2.0, RATE2, positive=True)}, memory=1)
def pid(y, gains, memory):
    s = y.de + gains.kp * y.e + gains.ki * memory[0]
    memory[0] += y.dt * y.e
    return s, -gains.kp * y.de - gains.ki * y.e
