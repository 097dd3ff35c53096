"""Nested, order 3: u = -a sgn(q2 + 2 (|q1|^3 + q0^2)^(1/6) sgn(q1 + [q0]^(2/3))), q0 = e, q1 =
de/w, q2 = e''/w^2.

e, de and e'' reach 0 in finite time (3-sliding) for e''' = g u + h if a g exceeds |h| by enough for
w. At w = 1 only a has to be tuned. A larger w converges w times as fast and needs about w^3 times
the control. Sampled with exact derivatives, |e| = O(dt^3), |de| = O(dt^2) and |e''| = O(dt). The
law is for a plant with an actuator lag and an estimator that gives the acceleration. If the
estimator gives none, e'' counts as 0, and the law switches on de + w [e]^(2/3). The trace's s is e,
of relative degree 3.
Gains: a, switching gain [N]; w, speed of convergence [1/s].
Source: A. Levant, "Higher-order sliding modes, differentiation and output-feedback control", Int.
J. Control 76(9/10):924, 2003 (law); A. Levant, "Quasi-continuous high-order sliding-mode
controllers", IEEE Trans. Autom. Control 50(11):1812, 2005 (w).
"""

from smc_mujoco.control.law import command, law_function, power, sgn
from smc_mujoco.control.units import FORCE, RATE, Gain


@law_function(
    family="higher-order",
    finite_time="e",
    accuracy=3,
    label="Nested third-order",
    gains={
        "a": Gain(5.0, FORCE, positive=True),
        "w": Gain(2.0, RATE, positive=True),
    },
    memory=1,
    relative_degree=3,
)
def nested_third_order(y, gains, memory):
    q1 = y.de / gains.w
    q2 = (y.a - y.ddr) / gains.w**2
    inner = power(abs(q1) ** 3 + y.e * y.e, 1.0 / 6.0) * sgn(q1 + power(y.e, 2.0 / 3.0))
    return command(y, -gains.a * sgn(q2 + 2.0 * inner)), y.e
