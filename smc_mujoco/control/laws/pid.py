"""PID: u = -(kp e + kd D) + w, tau D' = de - D, w' = -ki e + (sat(u) - u) / tt.

A baseline without a sliding mode. The filter tau limits the amplification of noise by the
derivative. Back-calculation prevents wind-up: while u is beyond the bound +-u_max, w tends with the
time constant tt to the value that brings u back to its bound; with ki = 0, w = 0. What it leaves in
w goes with the time constant kp / ki. Where that is longer than 60 s, only the share
60 s ki / kp of it is brought back, so that a tiny ki is as good as none. On M x'' = u the loop is
stable if and only if kp kd > M ki (Routh, tau = 0), and a constant disturbance leaves no error.
D is computed by the implicit (backward) Euler method, starting at the first de, and w by the
explicit one. The trace's s is kp e + kd D.
Gains: kp, proportional [N/m]; ki, integral [N/(m s)]; kd, derivative [N s/m]; tau, of the filter
[s]; tt, of the anti-windup [s].
Source: K. J. Astrom & T. Hagglund, PID Controllers: Theory, Design, and Tuning, 2nd ed., ISA 1995,
sections 3.4 (derivative) and 3.5 (integrator windup).
"""

from smc_mujoco.control.law import command, excess, law_function
from smc_mujoco.control.units import FORCE_PER_POSITION, FORCE_PER_SPEED, TIME, Gain, Unit

LONGEST = 60.0  # s, chosen: what takes longer to go would stay for the run


@law_function(
    family="baseline",
    continuous=True,
    accuracy=0,
    gains={
        "kp": Gain(10.0, FORCE_PER_POSITION, nonnegative=True),
        "ki": Gain(5.0, Unit(force=1, position=-1, time=-1), nonnegative=True),
        "kd": Gain(6.0, FORCE_PER_SPEED, nonnegative=True),
        "tau": Gain(5e-3, TIME, nonnegative=True, held=True),
        "tt": Gain(0.5, TIME, positive=True),
    },
    memory=3,
    relative_degree=2,
    # no theorem: it is Routh's condition for M x'' = u, and no plant of the suite is that
    advice={
        "kp kd > M ki, or ki = 0 (M is the mass or inertia of the joint, taken as 1 here)": (
            lambda g: g.kp * g.kd > g.ki or g.ki == 0.0
        )
    },
    label="PID",
    short="PID",
)
def pid(y, gains, memory):
    started, w, D = memory
    D = (gains.tau * D + y.dt * y.de) / (gains.tau + y.dt) if started else y.de
    s = gains.kp * y.e + gains.kd * D
    u = command(y, w - s)
    if gains.ki != 0.0:  # else nothing would take w back
        back = excess(y, u) / gains.tt
        if gains.kp > LONGEST * gains.ki:
            back *= LONGEST * gains.ki / gains.kp
        w += y.dt * (back - gains.ki * y.e)
    memory[0] = 1.0
    memory[1] = w
    memory[2] = D
    return u, s
