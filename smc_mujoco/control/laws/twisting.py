"""Twisting: u = -r1 sgn(e) - r2 sgn(de).

e = de = 0 is reached in finite time (2-sliding) for e'' = g u + d, |d| <= D, if (r1 + r2) g - D >
(r1 - r2) g + D and (r1 - r2) g > D. Without d each peak of e is q = (r1 - r2) / (r1 + r2) of the
last. For g = 1 the time from rest at e is sqrt(2 |e| / (r1 - r2)) (1 + q) / (1 - sqrt(q)). Sampled,
|e| = O(dt^2) and |de| = O(dt). The trace's s is e, of relative degree 2.
Gains: r1 and r2, switching gains of position and velocity [N].
Source: A. Levant, "Sliding order and sliding accuracy in sliding mode control", Int. J. Control
58(6):1247, 1993.
"""

from smc_mujoco.control.law import command, law_function, sgn
from smc_mujoco.control.units import FORCE, Gain


@law_function(
    family="higher-order",
    finite_time="e",
    accuracy=2,
    admits={"d": lambda g: min(g.r1 - g.r2, g.r2)},
    gains={
        "r1": Gain(3.7, FORCE, positive=True),
        "r2": Gain(2.3, FORCE, positive=True),
    },
    memory=1,
    relative_degree=2,
    conditions={"r1 > r2": lambda g: g.r1 > g.r2},
    short="TW",
)
def twisting(y, gains, memory):
    return command(y, -gains.r1 * sgn(y.e) - gains.r2 * sgn(y.de)), y.e
