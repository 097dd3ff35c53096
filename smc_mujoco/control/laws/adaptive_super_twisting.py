"""Adaptive super-twisting: u = -K [s]^(1/2) + w, w' = -2 eps K sgn(s), K' = rate sgn(|s| - mu)
while K >= least.

K starts at k0. Below `least`, K' = rate. K grows outside the layer |s| <= mu and falls inside it,
so neither a bound on d nor a bound on d' need be known. |s| ends in a layer of the order of mu,
with K about as large as d requires. If s starts outside the layer, K grows until s is inside. If mu
is too small for the noise or the control period, K grows without limit. w and K are integrated by
the explicit Euler method.
Gains: rate, of K, w1 sqrt(g1/2) in the source [N m^-1/2 s^-1/2]; eps, ratio of the two gains [m^1/2
s^-3/2]; mu, half-width of the layer [m/s]; least and k0, of K [N (s/m)^1/2]; c, slope of the
surface [1/s].
Source: Y. Shtessel, M. Taleb & F. Plestan, "A novel adaptive-gain supertwisting sliding mode
controller: methodology and application", Automatica 48(5):759, 2012 (its beta is 2 eps K; the
conference version halves it).
"""

from smc_mujoco.control.law import command, law_function, power, sgn, sliding
from smc_mujoco.control.units import FORCE_PER_ROOT, SLOPE, SPEED, Gain, Unit


@law_function(
    family="adaptive",
    continuous=True,
    accuracy=0,
    label="Adaptive super-twisting",
    gains={
        "rate": Gain(
            2.0, Unit(force=1, position=-0.5, time=-0.5), positive=True
        ),  # of K, a force per root
        "eps": Gain(0.5, Unit(position=0.5, time=-1.5), positive=True),
        "mu": Gain(0.02, SPEED, positive=True),
        "least": Gain(0.5, FORCE_PER_ROOT, positive=True),
        "k0": Gain(2.0, FORCE_PER_ROOT, nonnegative=True, held=True),
        "c": SLOPE,
    },
    memory=2,
)
def adaptive_super_twisting(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    K = gains.k0 + memory[1]
    v = memory[0] - K * power(s, 0.5)
    memory[0] -= y.dt * 2.0 * gains.eps * K * sgn(s)
    memory[1] += y.dt * gains.rate * (sgn(abs(s) - gains.mu) if gains.least <= K else 1.0)
    return command(y, v_eq + v), s
