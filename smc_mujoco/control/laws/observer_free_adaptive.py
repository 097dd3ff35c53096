"""Observer-free law with adaptive gain: u = -L tanh(s), L = lam + w, w' = gamma max(|s| - deadzone,
0) - leak w.

An extension of this package towards the paper's future work, abrupt changes of parameters. s = de +
k1 e and 0 <= w <= w_max. A larger L makes the law steeper at the origin, which helps even while the
actuator limits u.

Stability: because L >= lam, this law is stable wherever the plain law is: lam > -D and lam k1 > -K
on J x'' + D x' + K x = u. Inside the dead zone w decays as exp(-leak t), which leaves the plain
law. If the plain law is unstable, because K has fallen below -lam k1, |s| leaves the dead zone and
L grows until L k1 > -K. For s' = u + d with constant d the equilibrium is |s| = b with (lam + gamma
(b - deadzone) / leak) tanh b = |d|, if that b > deadzone. It is stable: its Jacobian [-L sech^2 b,
-tanh b; gamma, -leak] has a negative trace and a positive determinant. w is bounded, by gamma
sup|s| / leak and by w_max. w is integrated by the explicit Euler method, which needs leak dt < 1.
Gains: lam, bound of the plain law [N]; k1, slope of the surface [1/s]; gamma, adaptation rate
[N/m]; leak, rate at which w decays [1/s]; deadzone, half its width [m/s]; w_max, bound on w [N].
Source: the law of J. Gaber (observer_free) with the leak of P. Ioannou & P. Kokotovic, "Instability
analysis and improvement of robustness of adaptive control", Automatica 20(5):583, 1984.
"""

import math

from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import FORCE, FORCE_PER_POSITION, OBSERVER_FREE, RATE, SPEED, Gain


@law_function(
    family="observer-free",
    continuous=True,
    accuracy=0,
    label="Observer-free, adaptive",
    gains={
        **OBSERVER_FREE,
        "gamma": Gain(200.0, FORCE_PER_POSITION, nonnegative=True),
        "leak": Gain(1.0, RATE, nonnegative=True),
        "deadzone": Gain(0.1, SPEED, nonnegative=True),
        "w_max": Gain(60.0, FORCE, nonnegative=True, held=True),
    },
    memory=1,
)
def observer_free_adaptive(y, gains, memory):
    s, v_eq = sliding(y, gains.k1)
    w = memory[0]
    growth = gains.gamma * max(abs(s) - gains.deadzone, 0.0)
    memory[0] = min(max(w + y.dt * (growth - gains.leak * w), 0.0), gains.w_max)
    return command(y, v_eq - (gains.lam + w) * math.tanh(s)), s
