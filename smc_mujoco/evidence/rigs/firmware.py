"""Firmware of the rotary pendulum on a stepper: its three laws with their filters, trim, gates,
moves and falls.

One function, as on the machine, 200 times a second; the gain `kind` chooses the law. It counts in
degrees and steps. It returns the acceleration of the arm that a `Stepper` sums to the firmware's
own speed, in rad/s^2, and its sliding variable, deg/s (0 of the linear law). Source:
Piyushiitk24/Rotary-Inverted-Pendulum at 05a9ffa, as read there. A run begins when the firmware
engages: until then a hand holds the pendulum. What it does after a fall is simpler here.
"""

import math

from numba.extending import register_jitable

from smc_mujoco.control.law import law_function
from smc_mujoco.control.units import Gain

LINEAR = 0.0
TWO_STATES = 1.0
FOUR_STATES = 2.0
TICK = 5e-3  # s, the period that the firmware counts with
STEPS = 1600.0 / 360.0  # a degree
DEGREES = 180.0 / math.pi
GRAVITY, COUPLING = (
    100.8,
    1.952,
)  # A, 1/s^2, and B of its model a'' = A sin a + sin a cos a th'^2 - B cos a th''
SLOPE, OLD_RATE, MAX_RATE = (
    211.7647,
    0.0588,
    300.0,
)  # filter of rates: 1/s, share of the old one, deg/s
RAMP_TIME, GATE_TIME = 0.1, 0.2  # s after engaging
FALL_ARM = 80.0
STOP_ARM = 78.0
FALL_PENDULUM = 30.0
FALL_AT_ONCE = 25.0
FALL_RATE = 250.0
FALL_TICKS = 3.0
NEAR = 5.0  # deg, of the gates
MOVE_RATE, MOVE_SPEED, MOVE_ACCELERATION = (
    80.0,
    12.0,
    60.0,
)  # deg/s of the pendulum that freezes a move; of the arm
DEAD_BAND, LEAK, LEAK_ARM = 0.5, 2.0, 20.0  # deg, 1/s, deg
TRIM_RATE, TRIM_ANGLE, TRIM_SPEED, MAX_TRIM = 0.2, 3.0, 50.0, 1.5  # 1/s, deg, deg/s, deg
(
    STARTED,
    TIME,
    ALPHA,
    ALPHA_RATE,
    THETA,
    THETA_RATE,
    ENGAGED,
    TRIM,
    SPEED,
    REF,
    REF_RATE,
    FALLEN,
    TILTED,
    FAST,
) = range(14)  # of the memory


@register_jitable
def clip(value, bound):
    """Return a value held within -bound .. bound."""
    return min(max(value, -bound), bound)


@register_jitable
def measure(y, m):
    """Read both angles, deg, and filter their rates. Return the time since the last tick, s."""
    alpha = DEGREES * y.q
    theta = DEGREES * y.x
    passed = TICK
    if m[STARTED] == 0.0:
        m[STARTED] = 1.0
        m[ALPHA] = alpha
        m[THETA] = theta
        m[ENGAGED] = y.t
    else:
        passed = y.t - m[TIME]
    m[ALPHA_RATE] = clip(SLOPE * (alpha - m[ALPHA]) - OLD_RATE * m[ALPHA_RATE], MAX_RATE)
    m[THETA_RATE] = clip(SLOPE * (theta - m[THETA]) - OLD_RATE * m[THETA_RATE], MAX_RATE)
    m[TIME] = y.t
    m[ALPHA] = alpha
    m[THETA] = theta
    return passed


@register_jitable
def move(target, m, passed):
    """Advance the arm's reference towards a target, deg, on a trapezoid of speed.

    Return its acceleration, deg/s^2.
    """
    distance = target - m[REF]
    old = m[REF_RATE]
    braking = math.sqrt(2.0 * MOVE_ACCELERATION * abs(distance))
    target_rate = math.copysign(min(MOVE_SPEED, braking), distance)
    rate = old + clip(target_rate - old, MOVE_ACCELERATION * passed)
    if abs(distance) <= abs(rate) * passed and abs(rate) <= 2.0 * MOVE_ACCELERATION * passed:
        m[REF], m[REF_RATE] = target, 0.0
        return 0.0
    m[REF], m[REF_RATE] = m[REF] + rate * passed, rate
    return (rate - old) / passed


@register_jitable
def falls(kind, alpha, m, since):
    """Return whether the machine falls, by the firmware's limits."""
    if abs(alpha) > FALL_PENDULUM:
        m[TILTED] = m[TILTED] + 1.0
    else:
        m[TILTED] = 0.0
    fast = abs(m[ALPHA_RATE]) > FALL_RATE and abs(alpha) > NEAR and since > GATE_TIME
    m[FAST] = m[FAST] + 1.0 if fast else 0.0
    sliding = kind != LINEAR and (abs(alpha) > FALL_AT_ONCE or m[FAST] >= FALL_TICKS)
    return abs(m[THETA]) > FALL_ARM or m[TILTED] >= FALL_TICKS or sliding


@register_jitable
def acceleration(kind, alpha, m, since, ref_acceleration):
    """Return the law's acceleration of the arm, steps/s^2, and its sliding variable, deg/s."""
    rate = m[ALPHA_RATE]
    e = m[THETA] - m[REF]
    de = m[THETA_RATE] - m[REF_RATE]
    base = STEPS * ref_acceleration + 31.5 * e + 28.3 * de
    if kind == LINEAR:
        tilt = 0.0 if abs(alpha) < DEAD_BAND else alpha
        return base + 725.6 * tilt + 73.5 * rate, 0.0
    gate = 150.0 if kind == TWO_STATES else 250.0
    if not (abs(alpha) < NEAR and abs(rate) < gate and since >= GATE_TIME):
        base = 0.0
    sine = math.sin(alpha / DEGREES)
    cosine = max(math.cos(alpha / DEGREES), 0.2)
    free = DEGREES * GRAVITY * sine + sine * cosine * m[THETA_RATE] ** 2 / DEGREES
    if kind == TWO_STATES:
        s = rate + 15.0 * alpha
        return STEPS * (free + 15.0 * rate + 800.0 * clip(s / 50.0, 1.0)) / (
            COUPLING * cosine
        ) + base, s
    rate, de = clip(rate, 200.0), clip(de, 200.0)
    k = 0.5 * min(since / 0.2, 1.0)
    s = rate + 15.0 * alpha + k * clip(de + 2.0 * clip(e, STOP_ARM), 300.0)
    desired = free + 15.0 * rate + 2.0 * k * de - k * ref_acceleration + 800.0 * clip(s / 50.0, 1.0)
    return STEPS * desired / max(COUPLING * cosine - k, 0.6) + base, s


@law_function(
    gains={
        "kind": Gain(LINEAR, nonnegative=True, held=True),
        "top": Gain(20e3, positive=True, held=True),
        "speed": Gain(15e3, positive=True, held=True),
    },
    memory=14,
    label="Firmware of the stepper's pendulum",
)
def firmware(y, gains, memory):
    """Linear law (kind 0), or sliding mode on two (1) or four states (2); `top` steps/s^2, `speed`
    steps/s at most.

    The reference is the arm's target, to which the firmware moves on its own.
    Source: Piyushiitk24/Rotary-Inverted-Pendulum at 05a9ffa, without a licence; the constants are
    its facts.
    """
    m = memory
    passed = measure(y, m)
    before = m[SPEED]
    alpha = m[ALPHA] - m[TRIM]
    since = y.t - m[ENGAGED]
    if m[FALLEN] != 0.0:
        m[SPEED] = 0.0
        return -before / passed / STEPS / DEGREES, 0.0
    calm = abs(alpha) < NEAR and abs(m[ALPHA_RATE]) < MOVE_RATE
    target = DEGREES * y.r
    if calm:
        ref_acceleration = move(target, m, passed)
    else:
        ref_acceleration = 0.0
    moving = m[REF] != target or m[REF_RATE] != 0.0
    u, s = acceleration(gains.kind, alpha, m, since, ref_acceleration)
    saturated = abs(u) > gains.top
    u = clip(u, gains.top) * min(since / RAMP_TIME, 1.0)
    still = not moving and not saturated
    if still and abs(alpha) < TRIM_ANGLE and abs(m[ALPHA_RATE]) < TRIM_SPEED:
        m[TRIM] = clip(m[TRIM] + TRIM_RATE * alpha * passed, MAX_TRIM)
    leaks = (
        gains.kind == LINEAR
        and abs(alpha) < NEAR
        and abs(m[THETA] - m[REF]) < LEAK_ARM
        and not moving
    )
    m[SPEED] = clip(before + (u - (LEAK * before if leaks else 0.0)) * passed, gains.speed)
    if abs(m[THETA]) > STOP_ARM and m[SPEED] * m[THETA] > 0.0:
        m[SPEED] = 0.0
    if falls(gains.kind, alpha, m, since):
        m[FALLEN], m[SPEED] = 1.0, 0.0
    return (m[SPEED] - before) / passed / STEPS / DEGREES, s
