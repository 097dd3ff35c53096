"""Barrier adaptive gain: u = -K sgn(s), K' = K0 |s| until |s| <= eps/2, then K = |s| / (eps - |s|); s = de + c e.

K goes to infinity at |s| = eps, so s stays inside whatever |d| <= D is, D unknown: |s| <= eps D / (1 + D) for s' = u +
d, and u = -s / (eps - |s|) is continuous. Sampled, that same bound is kept if dt < eps / (1 + D)^2 (derived here: then
s + dt (d + u) grows with s inside the bound, and maps it into itself); a larger dt or D leaves it, and where |s| >= eps
the barrier means nothing. K is kept below k_max, which the actuator has to give, and is k_max beyond eps.
Source: H. Obeid, L. Fridman, S. Laghrouche & M. Harmouche, "Barrier function-based adaptive sliding mode control",
Automatica 93:540, 2018; sampling: L. Ovalle, A. Gonzalez, L. Fridman & H. Haimovich, arXiv 2502.15201, 2025.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE, FORCE_PER_POSITION, RATE, SPEED, Gain


@law_function(
    gains={
        "K0": Gain(50.0, FORCE_PER_POSITION, nonnegative=True),
        "eps": Gain(0.1, SPEED, positive=True),
        "k_max": Gain(6.0, FORCE, positive=True),
        "c": Gain(2.5, RATE, nonnegative=True),
    },
    memory=2,
)
def barrier_adaptive(y, gains, memory):
    s, eq = sliding(y, gains.c)
    size = abs(s)
    if size <= 0.5 * gains.eps:
        memory[1] = 1.0
    if memory[1] == 0.0:
        K = min(memory[0], gains.k_max)
        memory[0] += y.dt * gains.K0 * size
    else:
        K = min(size / (gains.eps - size), gains.k_max) if size < gains.eps else gains.k_max
    return command(y, eq - K * sgn(s)), s
