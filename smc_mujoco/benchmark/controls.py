"""Controls of the problems: laws that are no entries.

- zero: u = 0. It must reach no target of any problem.
- oracle: it is handed the state, and f and g of x'' = f + g u with the true parameters and with all other forces in f
  (a scenario's model "true"). It must reach every target. With a = g limit - |f - r''| the acceleration that is left,
  it goes to its goal on the parabola de^2 = 2 share a |e|, and near it as a critically damped pole of frequency w:

    u = (r'' - f - 2 w (de + h)) / g,   h = w e / 2 where |e| <= 2 share a / w^2,
                                        sgn(e) (sqrt(2 share a |e|) - share a / w) elsewhere

  Source: a proximate time-optimal servo, G. F. Franklin, J. D. Powell & M. L. Workman, Digital Control of Dynamic
  Systems, 2nd ed., Addison-Wesley 1990, section 11.3. share and w are of the rules.
"""

import math
from typing import Any

from smc_mujoco.control.from_text import law
from smc_mujoco.control.law import Law, law_function


@law_function(gains={"w": 20.0, "share": 0.5}, positive=("w", "share"), requires_model=True)
def oracle(y, gains, memory):
    """Return u and the distance to the parabola."""
    w = gains.w
    left = gains.share * max(abs(y.g) * y.limit - abs(y.f - y.ddr), 0.05 * abs(y.g) * y.limit)
    h = 0.5 * w * y.e
    if abs(y.e) > 2.0 * left / (w * w):
        h = math.copysign(math.sqrt(2.0 * left * abs(y.e)) - left / w, y.e)
    s = y.de + h
    return (y.ddr - y.f - 2.0 * w * s) / y.g, s


def is_oracle(one: Law) -> bool:
    """Return whether a law is the oracle, under any name, which no entry may be."""
    return any(part.function is oracle.function for part in one.parts)


def truth() -> dict[str, Any]:
    """Return the fields of a scenario that hand the oracle the truth."""
    return {"model": "true", "noise": None, "sensor": None, "velocity": None}


def laws() -> dict[str, Law]:
    """Return the controls by name."""
    return {"zero": law("none").named("zero"), "oracle": oracle()}
