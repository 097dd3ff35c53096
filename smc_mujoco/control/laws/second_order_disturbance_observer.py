"""Sliding mode with a disturbance observer of second order: u = (v_eq - k sgn(s) - z) / b, s = de +
c e, z estimates e'' - b u = d.

The observer is that of `hodob`, which has two integrals: a d of constant rate leaves no error, and
|d''| <= J leaves |d - z| <= J / l^2 in the end. k has to exceed only this error to keep s = 0,
where `disturbance_observer`, of first order, has J' / l for |d'| <= J'. With the model b = g, and f
and r'' are known and fed forward. The observer uses u after saturation, so z does not wind up.
Gains: k, switching gain [m/s^2]; c, slope of the surface [1/s]; l, bandwidth of the observer [1/s];
b, assumed input gain [1/kg].
Sources: those of `disturbance_observer` and of `hodob`; S. Li, J. Yang, W.-H. Chen & X. Chen,
Disturbance Observer-Based Control, CRC Press 2014, theorem 9.1 (k need only exceed the estimate's
error).
"""

from smc_mujoco.control.law import assumed, clipped, law_function, sgn, sliding
from smc_mujoco.control.laws.disturbance_observer import GAINS
from smc_mujoco.control.laws.hodob import estimated, remember


@law_function(
    family="disturbance-observer",
    accuracy=1,
    gains=GAINS,
    memory=5,
    label="Sliding mode with second-order observer",
    short="DO2",
)
def second_order_disturbance_observer(y, gains, memory):
    b, f = assumed(y, gains.b)
    z = estimated(y, gains.l, memory)
    s, v_eq = sliding(y, gains.c)
    u = (v_eq - gains.k * sgn(s) - z - f) / b
    remember(y, b * clipped(y, u) + f, memory)
    return u, s
