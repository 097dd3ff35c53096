"""Order 3: s = e'' + k2 de + k1 e, where an actuator lag makes the plant one of relative degree 3.

On s = 0 the error follows e'' + k2 e' + k1 e = 0. `degree` is that of s as the law's own sliding variable: with a lag
tau f' = u - f before e'' = f + ..., s' = e''' + ... holds u, so that s has degree 1 there, and first-order laws take
it: `Scenario(law="classical", surface="higher_order", actuator=smc.Lag(0.05), velocity=...)`. Without a lag s holds
u itself, degree 0, and a law that switches on it is an algebraic loop through one sample of delay. e'' is the
estimated acceleration less r'': an estimator that gives none leaves k2 de + k1 e.
eq is the acceleration that lies on the surface, -k2 de - k1 e: commanded through the lag, it leaves s' = -s/tau + O(1).
Source: J. Gaber, "Observer-Free Sliding Mode Control via Structured Decomposition", section 3, for relative degree 3.
"""

from smc_mujoco.control.surface import surface_function
from smc_mujoco.control.units import RATE, RATE2, Gain


@surface_function(gains={"k1": Gain(6.25, RATE2, positive=True), "k2": Gain(5.0, RATE, positive=True)}, memory=1)
def higher_order(y, gains, memory):
    eq = -gains.k2 * y.de - gains.k1 * y.e
    return y.a - y.ddr - eq, eq
