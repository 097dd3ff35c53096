"""Nested, order 3: u = -a sgn(q2 + 2 (|q1|^3 + q0^2)^(1/6) sgn(q1 + [q0]^(2/3))), q0 = e, q1 = de/w, q2 = e''/w^2.

3-sliding: e = de = e'' = 0 in finite time for e''' = g u + h, where a g exceeds |h| by enough for w (at w = 1 nothing
but a is to be tuned; w > 1 converges w times as fast and asks for about w^3 as much). Sampled with exact derivatives:
|e| = O(dt^3), |de| = O(dt^2), |e''| = O(dt). For a plant with an actuator lag and an estimator that gives the
acceleration; where it gives none, e'' counts as 0 and the law is one of sgn(de + w [e]^(2/3)). The trace's s is e,
of relative degree 3.
Source: A. Levant, "Higher-order sliding modes, differentiation and output-feedback control", Int. J. Control
76(9/10):924, 2003 (law); A. Levant, "Quasi-continuous high-order sliding-mode controllers", IEEE Trans. Autom. Control
50(11):1812, 2005 (w).
"""

from smc_mujoco.control.law import command, law_function, power, sgn
from smc_mujoco.control.units import FORCE, RATE, Gain


@law_function(
    gains={"a": Gain(5.0, FORCE, positive=True), "w": Gain(2.0, RATE, positive=True)}, memory=1, relative_degree=3
)
def nested_third_order(y, gains, memory):
    q1, q2 = y.de / gains.w, (y.a - y.ddr) / gains.w**2
    inner = power(abs(q1) ** 3 + y.e * y.e, 1.0 / 6.0) * sgn(q1 + power(y.e, 2.0 / 3.0))
    return command(y, -gains.a * sgn(q2 + 2.0 * inner)), y.e
