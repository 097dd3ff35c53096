"""Quasi-continuous, order 2: u = -a (de + b [e]^(1/2)) / (|de| + b |e|^(1/2)).

u is continuous except at e = de = 0, which is reached in finite time (2-sliding). Condition for e''
= g u + d, |d| <= D: some r > b satisfies a g (r - b) / (r + b) > D + r^2/2. Then the state comes
between de = -b [e]^(1/2) and de = -r [e]^(1/2), and from there to the origin in at most 2 sqrt(|e|)
/ b. For D = 0 and g = 1 the condition is r^3 + b r^2 - 2 a r + 2 a b < 0. Sampled, |e| = O(dt^2)
and |de| = O(dt). The trace's s is e, of relative degree 2.
Gains: a, bound of u [N]; b, of the curve [m^1/2/s].
Source: A. Levant, "Quasi-continuous high-order sliding-mode controllers", IEEE Trans. Autom.
Control 50(11):1812, 2005; condition: A. Levant, "Principles of 2-sliding mode design", Automatica
43(4):576, 2007.
"""

import math

from smc_mujoco.control.law import command, law_function, power
from smc_mujoco.control.units import FORCE, SPEED_PER_ROOT, Gain


def brakes(gains):
    """Return whether the cubic of the docstring is negative at its minimum, r, and r > b."""
    a = gains.a
    b = gains.b
    r = (math.sqrt(b * b + 6.0 * a) - b) / 3.0
    return r > b and r**3 + b * r * r - 2.0 * a * r + 2.0 * a * b < 0.0


@law_function(
    family="higher-order",
    finite_time="e",
    accuracy=2,
    label="Quasi-continuous",
    gains={
        "a": Gain(6.0, FORCE, positive=True),
        "b": Gain(1.0, SPEED_PER_ROOT, positive=True),
    },
    memory=1,
    relative_degree=2,
    conditions={"a (r - b) / (r + b) > r^2/2 for some r > b": brakes},
)
def quasi_continuous(y, gains, memory):
    size = abs(y.de) + gains.b * math.sqrt(abs(y.e))
    if size == 0.0:
        return command(y, 0.0), y.e
    return command(y, -gains.a * (y.de + gains.b * power(y.e, 0.5)) / size), y.e
