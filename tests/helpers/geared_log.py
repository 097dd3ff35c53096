"""A joint that a motor drives through a play, by an own integration of both equations: the flanks are
stiff springs with dampers that only push, and dry friction is set-valued.
"""

import math

import numpy as np

STEP, PERIOD = 1e-5, 2e-3  # s
KP, KD = 18.0, 1.2  # of the loop on the encoder
ROTOR, ROTOR_DAMPING = 0.012, 0.05  # kg m^2, N m s/rad
DAMPING, FRICTION = 0.2, 0.15  # N m s/rad, N m
STIFFNESS, LOSS = 2e5, 90.0  # of a flank, N m/rad and N m s/rad
LATE = 0.004  # s
COUNTS, NOISE = 8192, 2e-4


def geared_log(
    inertia: float, weight: float, gap: float, duration: float = 4.0
) -> dict[str, np.ndarray]:
    """Return t, x and u of a joint of inertia I, kg m^2, and weight w sin x, N m, whose encoder is on
    the joint.
    """
    random = np.random.default_rng(0)
    x = v = y = w = u = rate = 0.0
    before = None
    rows, sent = [], []
    for k in range(round(duration / STEP)):
        t = k * STEP
        if k % round(PERIOD / STEP) == 0:
            counts = round((x + NOISE * random.standard_normal()) * COUNTS / math.tau)
            read = counts * math.tau / COUNTS
            if before is not None:
                rate += 0.5 * ((read - before) / PERIOD - rate)
            before = read
            r = 0.5 * math.sin(2.6 * t) + 0.25 * math.sin(7.1 * t + 0.5) + 0.1 * math.sin(17 * t)
            dr = 1.3 * math.cos(2.6 * t) + 1.775 * math.cos(7.1 * t + 0.5) + 1.7 * math.cos(17 * t)
            command = KP * (r - read) + KD * (dr - rate)
            rows.append((t, read, command))
            sent.append((k + round(LATE / STEP), command))
        while sent and sent[0][0] <= k:
            u = sent.pop(0)[1]
        into = abs(y - x) - gap / 2.0
        side = math.copysign(1.0, y - x)
        push = max(0.0, STIFFNESS * into + LOSS * side * (w - v)) if into > 0.0 else 0.0
        w += STEP / ROTOR * (u - side * push - ROTOR_DAMPING * w)
        y += STEP * w
        after = v + STEP / inertia * (side * push - weight * math.sin(x) - DAMPING * v)
        stopped = STEP / inertia * FRICTION
        v = 0.0 if abs(after) <= stopped else after - math.copysign(stopped, after)
        x += STEP * v
    return dict(zip(("t", "x", "u"), np.array(rows).T, strict=True))
