"""What a law of one channel sees at a sample."""

import math
from typing import NamedTuple


class Measurement(NamedTuple):
    """The inputs of a law: its channel at a sample, in SI units.

    Attributes:
      t, dt: time of the sample, control period.
      x, v: measured position; measured or estimated velocity.
      e, de: x - r and v - r'.
      r, dr, ddr: reference and its derivatives.
      f, g: of the nominal x'' = f + g u at the measured x and v; see `model`.
      a: estimated acceleration; r'' if the estimator gives none.
      limit: bound on |u|, u_max or the limit of the channel's motor.
      model: 1 if the scenario lets the law use f and g, else 0.
      has_surface, s, v_eq: 1 if the scenario has a surface, else 0; its sliding variable; and the
        acceleration of the error that keeps s constant.
      q, dq, fq, gq: position and velocity of the joint without actuator that this one moves, and
        its nominal q'' = fq + gq u; 0 without such a joint.
    """

    t: float
    dt: float
    x: float
    v: float
    e: float
    de: float
    r: float
    dr: float
    ddr: float
    f: float
    g: float
    a: float = 0.0
    limit: float = math.inf
    model: float = 0.0
    has_surface: float = 0.0
    s: float = 0.0
    v_eq: float = 0.0
    q: float = 0.0
    dq: float = 0.0
    fq: float = 0.0
    gq: float = 0.0
