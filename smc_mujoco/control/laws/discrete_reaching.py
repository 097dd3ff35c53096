"""Discrete reaching law: u = -(eps sgn(s) + q s + c de) / (1 + c dt/2), s = de + c e.

u solves s+ = (1 - q dt) s - eps dt sgn(s) for the sampled double integrator, whose s+ is s + c dt
de + (dt + c dt^2/2) u. Without the model the term c de is left out. With a surface of the scenario
the divisor is 1. For 0 < q dt < 1, |s| falls in each sample until s changes sign in each: a
quasi-sliding mode. Then |s| <= eps dt, inside the band eps dt / (1 - q dt) of the source, and s
ends in the cycle +-eps dt / (2 - q dt). A disturbance |d| <= D widens this to (eps + D) dt and
requires eps > D.
Gains: eps, switching gain [N]; q, reaching rate [N s/m]; c, slope of the surface [1/s].
Source: W. Gao, Y. Wang & A. Homaifa, "Discrete-time variable structure control systems", IEEE
Trans. Ind. Electron. 42(2):117, 1995 (law and band); the narrower band: A. Bartoszewicz, "Remarks
on 'Discrete-time variable structure control systems'", IEEE Trans. Ind. Electron. 43(1):235, 1996.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE, FORCE_PER_SPEED, SLOPE, Gain


@law_function(
    family="first-order",
    finite_time="s",
    accuracy=1,
    gains={
        "eps": Gain(3.0, FORCE, positive=True),
        "q": Gain(3.0, FORCE_PER_SPEED, nonnegative=True),
        "c": SLOPE,
    },
)
def discrete_reaching(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    stretch = 1.0 + 0.5 * gains.c * y.dt if y.has_surface == 0.0 else 1.0
    return command(y, (v_eq - gains.q * s - gains.eps * sgn(s)) / stretch), s
