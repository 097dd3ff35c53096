"""Computed torque: u = (r'' - kd de - kp e - f) / g.

With the nominal model the error obeys e'' + kd de + kp e = g d exactly. kp = w^2 and kd = 2 w give
critical damping. Without the model the law is PD control, u = -kp e - kd de. It is a baseline
without a sliding mode: a constant disturbance leaves the error g d / kp. The trace's s is kp e + kd
de.
Gains: kp, stiffness [N/m]; kd, damping [N s/m].
Source: B. R. Markiewicz, Analysis of the Computed Torque Drive Method, JPL Technical Memorandum
33-601, 1973; J. Y. S. Luh, M. W. Walker & R. P. C. Paul, "Resolved-acceleration control of
mechanical manipulators", IEEE Trans. Automatic Control 25(3):468, 1980.
"""

from smc_mujoco.control.law import command, law_function
from smc_mujoco.control.units import FORCE_PER_POSITION, FORCE_PER_SPEED, Gain


@law_function(
    family="baseline",
    continuous=True,
    accuracy=0,
    gains={
        "kp": Gain(9.0, FORCE_PER_POSITION, positive=True),
        "kd": Gain(6.0, FORCE_PER_SPEED, positive=True),
    },
    relative_degree=2,
)
def computed_torque(y, gains, memory):
    s = gains.kp * y.e + gains.kd * y.de
    return command(y, -s), s
