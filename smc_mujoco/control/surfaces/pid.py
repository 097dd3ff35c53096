"""PID: s = de + kp e + ki I, I' = e; on s = 0 the error follows e'' + kp e' + ki e = 0.

The poles are the roots of p^2 + kp p + ki. I starts at 0, so s(0) = de + kp e and there is a
reaching phase, during which I winds up. The overshoot this causes is the price of no steady error
under a law that leaves a constant s. I is integrated by the explicit Euler method.
Gains: kp [1/s] and ki [1/s^2], of the surface.
Source: J.-J. Slotine & W. Li, Applied Nonlinear Control, Prentice Hall 1991, section 7.1.1 (s with
the integral of e).
"""

from smc_mujoco.control.surface import surface_function
from smc_mujoco.control.units import RATE, RATE2, Gain


@surface_function(
    gains={
        "kp": Gain(3.0, RATE, positive=True),
        "ki": Gain(2.0, RATE2, positive=True),
    },
    memory=1,
)
def pid(y, gains, memory):
    s = y.de + gains.kp * y.e + gains.ki * memory[0]
    memory[0] += y.dt * y.e
    return s, -gains.kp * y.de - gains.ki * y.e
