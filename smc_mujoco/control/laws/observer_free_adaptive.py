"""Observer-free law with adaptive gain: u = -L tanh(s), L = lam + w, w' = gamma max(|s| - deadzone, 0) - leak w.

Ours, for the paper's future work, abrupt changes of parameters; s = de + k1 e, 0 <= w <= w_max. A larger L is a steeper
law at the origin, so it helps even where the actuator's bound hides it from u.

Stability: L >= lam, so where the plain law is stable, lam > -D and lam k1 > -K on J x'' + D x' + K x = u, this one is,
and inside the dead zone w dies out as exp(-leak t): the plain law is what is left. Where it is not, as K fell below
-lam k1, |s| grows past the dead zone and L with it until L k1 > -K. For s' = u + d, d constant, the rest is |s| = b
with (lam + gamma (b - deadzone) / leak) tanh b = |d|, where that b > deadzone; its Jacobian [-L sech^2 b, -tanh b;
gamma, -leak] has a negative trace and a positive determinant, so it is stable. w cannot grow without end: w <= gamma
sup|s| / leak, and w <= w_max whatever the noise. Integrated by the explicit Euler rule; leak dt < 1.
Source: the law of J. Gaber (observer_free) with the leak of P. Ioannou & P. Kokotovic, "Instability analysis and
improvement of robustness of adaptive control", Automatica 20(5):583, 1984.
"""

import math

from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import FORCE, FORCE_PER_POSITION, RATE, SPEED, Gain


@law_function(
    gains={
        "lam": Gain(6.0, FORCE, positive=True),
        "k1": Gain(2.5, RATE),
        "gamma": Gain(200.0, FORCE_PER_POSITION, nonnegative=True),
        "leak": Gain(1.0, RATE, nonnegative=True),
        "deadzone": Gain(0.1, SPEED, nonnegative=True),
        "w_max": Gain(60.0, FORCE, nonnegative=True, held=True),
    },
    memory=1,
)
def observer_free_adaptive(y, gains, memory):
    s, eq = sliding(y, gains.k1)
    w = memory[0]
    growth = gains.gamma * max(abs(s) - gains.deadzone, 0.0)
    memory[0] = min(max(w + y.dt * (growth - gains.leak * w), 0.0), gains.w_max)
    return command(y, eq - (gains.lam + w) * math.tanh(s)), s
