"""Linear quadratic regulator: u = -(k1 e + k2 de), for the least integral of q1 e^2 + q2 de^2 + r
u^2.

On e'' = a1 e + a2 de + b u, k1 = (a1 + sqrt(a1^2 + b^2 q1 / r)) / b and k2 = (a2 + sqrt(a2^2 + 2 b
k1 + b^2 q2 / r)) / b: the closed solution of the Riccati equation for two states (derived here).
The linear loop is stable, with a phase margin of at least 60 degrees. The default a1, a2, b are
those of the double integrator; `smc.design.lqr` computes those of a plant. With the nominal model f
and g are cancelled and the law regulates e'' = v, so a1, a2, b are 0, 0, 1. It is a baseline
without a sliding mode: a constant disturbance leaves an error. The trace's s is k1 e + k2 de.
Gains: q1 [N^2/m^2], q2 [N^2 s^2/m^2] and r, weights of error, rate and control; a1 [1/s^2], a2
[1/s] and b [1/kg], of the plant.
Source: R. E. Kalman, "Contributions to the theory of optimal control", Bol. Soc. Mat. Mexicana
5:102, 1960; margins: B. D. O. Anderson & J. B. Moore, Optimal Control: Linear Quadratic Methods,
Prentice Hall 1990, section 5.4.
"""

import math

from smc_mujoco.control.law import command, law_function
from smc_mujoco.control.units import INPUT_GAIN, RATE, RATE2, WEIGHTS, Gain


@law_function(
    family="baseline",
    continuous=True,
    accuracy=0,
    gains={
        **WEIGHTS,
        "r": Gain(1.0, positive=True, held=True),  # only the ratios of the weights matter
        "a1": Gain(0.0, RATE2, held=True),
        "a2": Gain(0.0, RATE, held=True),
        "b": Gain(1.0, INPUT_GAIN, positive=True, held=True),
    },
    relative_degree=2,
    label="LQR",
    short="LQR",
)
def lqr(y, gains, memory):
    a1, a2, b = (0.0, 0.0, 1.0) if y.model != 0.0 else (gains.a1, gains.a2, gains.b)
    k1 = (a1 + math.sqrt(a1 * a1 + b * b * gains.q1 / gains.r)) / b
    k2 = (a2 + math.sqrt(a2 * a2 + 2.0 * b * k1 + b * b * gains.q2 / gains.r)) / b
    s = k1 * y.e + k2 * y.de
    return command(y, -s), s
