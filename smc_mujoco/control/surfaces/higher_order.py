"""Order 3: s = e'' + k2 de + k1 e, where an actuator lag makes the plant one of relative degree 3.

On s = 0 the error follows e'' + k2 e' + k1 e = 0. With a lag tau F' = u - F before e'' = f + g F,
s' contains u. So s has relative degree 1, and first-order laws can use it:
`Scenario(law="classical", surface="higher_order", actuator=smc.Lag(0.05), velocity=...)`. Without a
lag s itself contains u, and a law that switches on s is an algebraic loop through one sample of
delay. e'' is the estimated acceleration minus r''. If the estimator gives none, s is k2 de + k1 e.
v_eq is the acceleration on the surface, -k2 de - k1 e. Commanded through the lag, it leaves s' =
-s/tau + O(1).
Gains: k1 [1/s^2] and k2 [1/s], of the surface.
Source: J. Gaber, "Observer-Free Sliding Mode Control via Structured Decomposition", section 3, for
relative degree 3.
"""

from smc_mujoco.control.surface import surface_function
from smc_mujoco.control.units import RATE, RATE2, Gain


@surface_function(
    gains={
        "k1": Gain(6.25, RATE2, positive=True),
        "k2": Gain(5.0, RATE, positive=True),
    },
    memory=1,
)
def higher_order(y, gains, memory):
    v_eq = -gains.k2 * y.de - gains.k1 * y.e
    return y.a - y.ddr - v_eq, v_eq
