"""A joint on a position servo, by an own integration of its equation: dry friction is set-valued,
and the servo has a dead band.
"""

import math
from collections.abc import Callable

import numpy as np

STEP = 2e-5  # s


def servo_log(
    set_point: Callable[[float], float],
    duration: float,
    *,
    inertia: float,
    weight: float,
    kp: float,
    kv: float,
    damping: float,
    friction: float,
    dead_band: float = 0.0,
    period: float = 5e-3,
) -> dict[str, np.ndarray]:
    """Return t, x and u of I x'' = kp dz(u - x) - kv x' - b x' - w sin x - friction, from rest at 0,
    with u held for a period.
    """
    x = v = u = 0.0
    rows = []
    for k in range(round(duration / STEP)):
        if k % round(period / STEP) == 0:
            u = set_point(k * STEP)
            rows.append((k * STEP, x, u))
        error = u - x
        error -= min(max(error, -dead_band), dead_band)
        force = kp * error - (kv + damping) * v - weight * math.sin(x)
        after = v + STEP / inertia * force
        stopped = STEP / inertia * friction
        v = 0.0 if abs(after) <= stopped else after - math.copysign(stopped, after)
        x += STEP * v
    return dict(zip(("t", "x", "u"), np.array(rows).T, strict=True))
