"""Discrete reaching law: u = -(eps sgn(s) + q s + c de) / (1 + c dt/2), s = de + c e.

It solves s+ = (1 - q dt) s - eps dt sgn(s) for u, s+ that of the sampled double integrator, s + c dt de + (dt + c
dt^2/2) u; without c de where the law has no model, and without the divisor on another surface. For 0 < q dt < 1, s
falls in each sample until it changes its sign in each: a quasi-sliding mode, there |s| <= eps dt, inside the band eps
dt / (1 - q dt), ending in the cycle +-eps dt / (2 - q dt). |d| <= D widens that to (eps + D) dt; it needs eps > D.
Source: W. Gao, Y. Wang & A. Homaifa, "Discrete-time variable structure control systems", IEEE Trans. Ind. Electron.
42(2):117, 1995 (law and band); the narrower band: A. Bartoszewicz, "Remarks on 'Discrete-time variable structure
control systems'", IEEE Trans. Ind. Electron. 43(1):235, 1996.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE, FORCE_PER_SPEED, RATE, Gain


@law_function(
    gains={
        "eps": Gain(3.0, FORCE, positive=True),
        "q": Gain(3.0, FORCE_PER_SPEED, nonnegative=True),
        "c": Gain(2.5, RATE, nonnegative=True),
    }
)
def discrete_reaching(y, gains, memory):
    s, eq = sliding(y, gains.c)
    stretch = 1.0 + 0.5 * gains.c * y.dt if y.surfaced == 0.0 else 1.0
    return command(y, (eq - gains.q * s - gains.eps * sgn(s)) / stretch), s
