"""What a law of one channel sees at a sample."""

import math
from typing import NamedTuple


class Measurement(NamedTuple):
    """The inputs of a law: its channel at a sample, in SI units."""

    t: float  # time of the sample
    dt: float  # control period
    x: float  # measured position
    v: float  # measured or estimated velocity
    e: float  # x - r
    de: float  # v - r'
    r: float  # reference
    dr: float
    ddr: float
    f: float  # nominal f(x, v) of x'' = f + g u, at the measured x and v
    g: float
    a: float = 0.0  # estimated acceleration; r'' if the estimator gives none
    limit: float = math.inf  # bound on |u|: u_max, or the limit of the channel's motor
    model: float = 0.0  # 1 if the scenario lets the law use f and g, else 0
    has_surface: float = 0.0  # 1 if the scenario has a surface, else 0
    s: float = 0.0  # sliding variable of the scenario's surface
    v_eq: float = 0.0  # equivalent control: acceleration of the error that keeps s constant
    # measured position of the joint without actuator that this one moves; 0 without such a joint
    q: float = 0.0
    dq: float = 0.0  # its velocity
    fq: float = 0.0  # its nominal q'' = fq + gq u
    gq: float = 0.0
