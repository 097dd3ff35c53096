"""Exponential reaching law: u = -(k sgn(s) + q s), s = de + c e.

Gao's "constant plus proportional rate". s' = u reaches s = 0 at ln(1 + q |s0| / k) / q; if q |s0|
>> k this is much sooner than |s0| / k. Under |d| <= D < k it is reached at ln(1 + q |s0| / (k - D))
/ q at the latest. The residual is that of `classical`, O(dt). The law is explicit and needs g q dt
< 1. With k = 0 it is linear and never reaches s = 0.
Gains: k, switching gain [N]; q, reaching rate [N s/m]; c, slope of the surface [1/s].
Source: W. Gao & J. C. Hung, "Variable structure control of nonlinear systems: a new approach", IEEE
Trans. Ind. Electron. 40(1):45, 1993 (law); times: integrated here.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE, FORCE_PER_SPEED, SLOPE, Gain


@law_function(
    family="first-order",
    finite_time="s",
    accuracy=1,
    gains={
        "k": Gain(3.0, FORCE, nonnegative=True),
        "q": Gain(3.0, FORCE_PER_SPEED, nonnegative=True),
        "c": SLOPE,
    },
    conditions={"k > 0": lambda g: g.k > 0.0},
)
def exponential_reaching(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    return command(y, v_eq - (gains.k * sgn(s) + gains.q * s)), s
