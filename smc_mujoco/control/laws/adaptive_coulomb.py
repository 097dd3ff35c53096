"""PD beside an adapting level of Coulomb friction: u = -s + F tanh(r' / v0), s = kp e + kd de, F' =
-gamma s sgn(r'), 0 <= F <= the bound on u, or with the model the acceleration that it gives.

No model and no level is given: F begins at 0. While the joint moves as its reference does, M x'' =
u - F0 sgn(x') leaves M e'' + kd e' + kp e = (F - F0) sgn(r') - M r''. From that force to s the
error is (kd p + kp) / (M p^2 + kd p + kp), p = d/dt, which is positive real if kd^2 >= M kp: then
the adaptation is passive, F - F0 stays bounded, and both e and F - F0 go to 0 where M r'' is small,
whatever gamma > 0 is. A load that does not change its sign with r' looks like no friction, and
moves F up and down. The trace's s is kp e + kd de.
Gains: kp, of the error [N/m]; kd, of its rate [N s/m]; gamma, of the adaptation [1/s]; v0, the
speed of the reference above which the whole level is given [m/s].
Sources: C. Canudas de Wit, K. J. Astrom & K. Braun, "Adaptive friction compensation in DC-motor
drives", IEEE J. Robotics Autom. 3(6):681, 1987; J.-J. Slotine & W. Li, Applied Nonlinear Control,
Prentice Hall 1991, section 8.1 (positive real error systems). The condition is worked out here.
"""

import math

from smc_mujoco.control.law import command, input_gain, law_function, sgn
from smc_mujoco.control.units import FORCE_PER_POSITION, FORCE_PER_SPEED, RATE, SPEED, Gain


@law_function(
    family="adaptive",
    continuous=True,
    accuracy=0,
    gains={
        "kp": Gain(10.0, FORCE_PER_POSITION, nonnegative=True),
        "kd": Gain(6.0, FORCE_PER_SPEED, nonnegative=True),
        "gamma": Gain(1.0, RATE, nonnegative=True),
        "v0": Gain(0.005, SPEED, positive=True),
    },
    memory=1,
    relative_degree=2,
    # M of the joint, taken as 1 here, as pid's advice does
    advice={
        "kd^2 >= M kp (M is the mass or inertia of the joint, taken as 1 here)": (
            lambda g: g.kd * g.kd >= g.kp
        )
    },
    label="PD with adapting Coulomb level",
    short="PAC",
)
def adaptive_coulomb(y, gains, memory):
    s = gains.kp * y.e + gains.kd * y.de
    u = command(y, memory[0] * math.tanh(y.dr / gains.v0) - s)
    level = memory[0] - y.dt * gains.gamma * s * sgn(y.dr)
    memory[0] = min(max(level, 0.0), y.limit * abs(input_gain(y)))
    return u, s
