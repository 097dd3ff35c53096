"""Adaptive gain with leakage: u = -K sgn(s), K' = gamma |s| [|s| > deadzone] - leak K, K(0) = k0, s
= de + c e.

[|s| > deadzone] is 1 outside the dead zone and 0 inside. The dead zone and the leak (sigma
modification) keep K bounded under noise and sampling. The price is a residual s, whatever the
control period. K is integrated by the explicit Euler method and kept from falling below 0, which it
would do if leak dt > 1.
Gains: gamma, adaptation rate [N/m]; c, slope of the surface [1/s]; leak, rate at which K decays
[1/s]; deadzone, half its width [m/s]; k0, initial K [N].
Source: P. Ioannou & P. Kokotovic, "Instability analysis and improvement of robustness of adaptive
control", Automatica 20(5):583, 1984 (leak); Plestan et al., Int. J. Control 83(9), 2010 (in a
switching gain).
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE, FORCE_PER_POSITION, RATE, SLOPE, SPEED, Gain


@law_function(
    family="adaptive",
    accuracy=0,
    gains={
        "gamma": Gain(15.0, FORCE_PER_POSITION, nonnegative=True),
        "c": SLOPE,
        "leak": Gain(3.0, RATE, nonnegative=True),
        "deadzone": Gain(0.05, SPEED, nonnegative=True),
        "k0": Gain(0.0, FORCE, nonnegative=True, held=True),
    },
    label="Adaptive + leak",
    colour="#56B4E9",
)
def adaptive_leak(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    K = gains.k0 + memory[0]
    growth = gains.gamma * abs(s) if abs(s) > gains.deadzone else 0.0
    memory[0] = max(K + y.dt * (growth - gains.leak * K), 0.0) - gains.k0
    return command(y, v_eq - K * sgn(s)), s
