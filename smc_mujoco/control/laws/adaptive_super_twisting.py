"""Adaptive super-twisting: u = -K [s]^(1/2) + w, w' = -2 eps K sgn(s), K' = rate sgn(|s| - mu) while K >= least.

K(0) = k0; below `least`, K' = rate. K grows outside the layer |s| <= mu and falls inside, so that neither the bound
nor the slope of d need be known: |s| ends in a layer of the order of mu, and K at about what d asks for. `rate` is the
source's w1 sqrt(g1/2). Explicit Euler rule for w and K. A start beyond mu makes K grow all the way: mu too small for
the noise or the period, and it grows without end.
Source: Y. Shtessel, M. Taleb & F. Plestan, "A novel adaptive-gain supertwisting sliding mode controller: methodology
and application", Automatica 48(5):759, 2012 (its beta is 2 eps K; the conference version halves it).
"""

from smc_mujoco.control.law import command, law_function, power, sgn, sliding
from smc_mujoco.control.units import FORCE_PER_ROOT, RATE, SPEED, Gain, Unit


@law_function(
    gains={
        "rate": Gain(2.0, Unit(force=1, position=-0.5, time=-0.5), positive=True),  # of K, a force per root
        "eps": Gain(0.5, Unit(position=0.5, time=-1.5), positive=True),
        "mu": Gain(0.02, SPEED, positive=True),
        "least": Gain(0.5, FORCE_PER_ROOT, positive=True),
        "k0": Gain(2.0, FORCE_PER_ROOT, nonnegative=True, held=True),
        "c": Gain(2.5, RATE, nonnegative=True),
    },
    memory=2,
)
def adaptive_super_twisting(y, gains, memory):
    s, eq = sliding(y, gains.c)
    K = gains.k0 + memory[1]
    v = memory[0] - K * power(s, 0.5)
    memory[0] -= y.dt * 2.0 * gains.eps * K * sgn(s)
    memory[1] += y.dt * gains.rate * (sgn(abs(s) - gains.mu) if gains.least <= K else 1.0)
    return command(y, eq + v), s
