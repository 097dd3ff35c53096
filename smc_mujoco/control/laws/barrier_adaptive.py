"""Barrier adaptive gain: u = -K sgn(s), K' = K0 |s| until |s| <= eps/2, then K = |s| / (eps - |s|);
s = de + c e.

K grows until |s| falls to eps/2 for the first time. From then on it is a barrier function, which
tends to infinity at |s| = eps. So s stays inside |s| < eps for every bounded d, |d| <= D, without
knowledge of D: |s| <= eps D / (1 + D) for s' = u + d. There u = -s / (eps - |s|) is continuous.
Sampled, the same bound holds if dt < eps / (1 + D)^2 (derived here: s + dt (d + u) then increases
with s inside the bound, and maps the bound into itself). With a larger dt or D, s leaves the bound,
and beyond eps the barrier means nothing. K is limited to k_max, which the actuator must be able to
give, and is k_max for |s| >= eps.
Gains: K0, adaptation rate [N/m]; eps, half-width of the barrier [m/s]; k_max, bound on K [N]; c,
slope of the surface [1/s].
Source: H. Obeid, L. Fridman, S. Laghrouche & M. Harmouche, "Barrier function-based adaptive sliding
mode control", Automatica 93:540, 2018; sampling: L. Ovalle, A. Gonzalez, L. Fridman & H. Haimovich,
arXiv 2502.15201, 2025.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding
from smc_mujoco.control.units import FORCE, FORCE_PER_POSITION, SLOPE, SPEED, Gain


@law_function(
    family="adaptive",
    continuous=True,
    accuracy=0,
    gains={
        "K0": Gain(50.0, FORCE_PER_POSITION, nonnegative=True),
        "eps": Gain(0.1, SPEED, positive=True),
        "k_max": Gain(6.0, FORCE, positive=True),
        "c": SLOPE,
    },
    memory=2,
)
def barrier_adaptive(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    size = abs(s)
    if size <= 0.5 * gains.eps:
        memory[1] = 1.0
    if memory[1] == 0.0:
        K = min(memory[0], gains.k_max)
        memory[0] += y.dt * gains.K0 * size
    else:
        K = min(size / (gains.eps - size), gains.k_max) if size < gains.eps else gains.k_max
    return command(y, v_eq - K * sgn(s)), s
