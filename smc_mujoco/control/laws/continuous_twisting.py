"""Continuous twisting: u = -k1 L^(2/3) [e]^(1/3) - k2 L^(1/2) [de]^(1/2) + w, w' = -L (k3 sgn(e) +
k4 sgn(de)).

For e'' = u + d with |d'| <= L this continuous u brings e, de and e'' to 0 in finite time, with w =
-d from then on (3-sliding with respect to e). The proof holds for (k1, k2, k3, k4) = (7, 5, 2.3,
1.1) at L = 1, and by homogeneity for every L; other gains, those of tuning included, converge in
runs, without a proof. Sampled with the explicit Euler method, |e| = O(dt^3)
and |de| = O(dt^2). w winds up while the actuator saturates. The trace's s is e, of relative degree
2.
Gains: L, bound on d' [N/s]; k1, of the position [kg^1/3]; k2, of the velocity [kg^1/2]; k3 and k4,
of the integral.
Source: V. Torres-Gonzalez, T. Sanchez, L. Fridman & J. Moreno, "Design of continuous twisting
algorithm", Automatica 80:119, 2017.
"""

import math

from smc_mujoco.control.law import command, law_function, power, sgn
from smc_mujoco.control.units import FORCE_RATE, Gain, Unit


@law_function(
    family="higher-order",
    continuous=True,
    finite_time="e",
    accuracy=3,
    gains={
        "L": Gain(1.0, FORCE_RATE, positive=True),
        "k1": Gain(
            7.0, Unit(force=1 / 3, position=-1 / 3, time=2 / 3), positive=True
        ),  # the cube root of an inertia
        "k2": Gain(
            5.0, Unit(force=1 / 2, position=-1 / 2, time=1), positive=True
        ),  # the square root of an inertia
        "k3": Gain(
            2.3, positive=True, held=True
        ),  # tuning searches L, a common factor of k3 and k4
        "k4": Gain(1.1, positive=True, held=True),
    },
    memory=1,
    relative_degree=2,
    conditions={"k3 > k4 + 1": lambda g: g.k3 > g.k4 + 1.0},
)
def continuous_twisting(y, gains, memory):
    L = gains.L
    v = (
        memory[0]
        - gains.k1 * power(L, 2.0 / 3.0) * power(y.e, 1.0 / 3.0)
        - gains.k2 * math.sqrt(L) * power(y.de, 0.5)
    )
    memory[0] -= y.dt * L * (gains.k3 * sgn(y.e) + gains.k4 * sgn(y.de))
    return command(y, v), y.e
