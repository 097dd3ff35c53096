"""Power-rate reaching law: u = -k [s]^a, 0 < a < 1, s = de + c e.

s' = u reaches s = 0 at |s0|^(1 - a) / (k (1 - a)). u goes to 0 with s, which reduces chattering.
But there is no sliding mode under a disturbance: |d| <= D leaves |s| <= (D / k)^(1/a). The law is
explicit: its infinite slope at 0 leaves |s| = O(dt^(1/(1 - a))) even without a disturbance.
Gains: k, of the power [N (s/m)^a]; a, exponent; c, slope of the surface [1/s].
Source: W. Gao & J. C. Hung, "Variable structure control of nonlinear systems: a new approach", IEEE
Trans. Ind. Electron. 40(1):45, 1993 (law); time and bounds: integrated here.
"""

from smc_mujoco.control.law import command, law_function, power, sliding
from smc_mujoco.control.units import SLOPE, Gain, force_per


@law_function(
    family="first-order",
    continuous=True,
    finite_time="s",
    accuracy=0,
    label="Power-rate",
    gains={
        "k": Gain(6.0, force_per("a"), nonnegative=True),
        "a": Gain(0.5, positive=True, held=True),
        "c": SLOPE,
    },
    conditions={"a < 1": lambda g: g.a < 1.0},
)
def power_rate(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    return command(y, v_eq - gains.k * power(s, gains.a)), s
