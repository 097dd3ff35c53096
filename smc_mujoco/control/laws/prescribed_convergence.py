"""Prescribed convergence: u = -a sgn(de + b [e]^(1/2)).

The state converges along a prescribed curve (2-sliding). For e'' = g u + d, |d| <= D and a g - D >
b^2/2 the state comes to de = -b [e]^(1/2), and along it to e = 0 in 2 sqrt(|e|) / b. Sampled, |e| =
O(dt^2) and |de| = O(dt). The trace's s is e, of relative degree 2.
Gains: a, switching gain [N]; b, of the curve [m^1/2/s].
Source: A. Levant, "Sliding order and sliding accuracy in sliding mode control", Int. J. Control
58(6):1247, 1993, section 5 (the algorithm with a prescribed law of variation), following S.
Emelyanov, S. Korovin & L. Levantovsky, 1986.
"""

from smc_mujoco.control.law import command, law_function, power, sgn
from smc_mujoco.control.units import FORCE, SPEED_PER_ROOT, Gain


@law_function(
    family="higher-order",
    finite_time="e",
    accuracy=2,
    gains={
        "a": Gain(5.0, FORCE, positive=True),
        "b": Gain(2.0, SPEED_PER_ROOT, positive=True),
    },
    memory=1,
    relative_degree=2,
    conditions={"a > b^2/2": lambda g: g.a > g.b**2 / 2.0},
)
def prescribed_convergence(y, gains, memory):
    return command(y, -gains.a * sgn(y.de + gains.b * power(y.e, 0.5))), y.e
