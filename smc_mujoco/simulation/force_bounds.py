"""The bound on |u| where a scenario gives none.

Here `s` is a Scenario, which imports this module.
"""

import contextlib
import math
from typing import Any

import numpy as np

from smc_mujoco.common.text import joined, number
from smc_mujoco.mechanisms.layout import driven_names
from smc_mujoco.mechanisms.plant import Plant

SET_POINT = "{x}"  # the unit of u before a position servo
INSTANTS = 101  # of a run, in which its reference is looked at
U_MAX = 6.0  # N or N m, chosen: the bound of every study here


def default_bound(s: Any, reference: Any) -> float | tuple[float, ...]:
    """Return the default of u_max: of each joint that of its motor, or what the plant suggests; of
    a set-point what a run with this reference asks for.
    """
    suggested = suggested_u_max(s.plant)
    if not any(part.bound is not None or part.unit == SET_POINT for part in s.actuator):
        return suggested
    bounds = list(suggested) if isinstance(suggested, tuple) else [suggested] * s.plant.driven
    own = s.plant.suggested.get("u_max", (None,) * s.plant.driven)
    # what the plant suggests is for the servos that it keeps
    for i, motor in enumerate(s.drive_train.motors):
        if servo_of(s.plant, i) is not None:
            if own[i] is None and motor.unit == SET_POINT:
                bounds[i] = min(bounds[i], _asked(s, i, motor, reference))
        elif motor.bound is not None and not any(part.unit for part in drives_of_file(s.plant, i)):
            bounds[i] = motor.bound
    return tuple(bounds) if len(set(bounds)) > 1 else bounds[0]


def drives_of_file(plant: Plant, i: int) -> tuple[Any, ...]:
    """Return the actuators of a file that a plant keeps at its driven channel i."""
    return plant.suggested.get("actuator", ((),) * plant.driven)[i]


def servo_of(plant: Plant, i: int) -> Any:
    """Return the position servo that a plant keeps at its driven channel i, or None."""
    return next((part for part in drives_of_file(plant, i) if part.unit == SET_POINT), None)


def _reach(plant: Plant, i: int, servo: Any) -> float:
    """Return how far from the goal a file lets the set-point of a servo be, rad (m)."""
    if servo.bound is not None:
        return servo.bound
    _, low, high = plant.ranges[i]
    return max(high - servo.goal, servo.goal - low)


def _asked(s: Any, i: int, servo: Any, reference: Any) -> float:
    """Return how far from the goal a run asks for the set-point of a servo, rad (m), with two
    digits: as far as the joint starts and its reference goes, and farther by what makes the servo
    give all its force there, or what it needs to move and to hold, but by no less than the way
    from the start.
    """
    from smc_mujoco.mechanisms.custom.scales import FARTHEST, needs, usual_start

    starts = [usual_start(s.plant)[i] - servo.goal]
    starts += [] if s.x0 is None else [s.x0[i] - servo.goal]
    way = FARTHEST * max(map(abs, starts))
    signal = getattr(reference, "signals", (reference,) * s.plant.driven)[i]
    farthest = way
    lead = 0.0
    series = (signal.data,) if signal.series else ()
    for t in np.linspace(0.0, s.duration, INSTANTS).tolist():
        with contextlib.suppress(Exception):  # of a user's signal, which the run says
            r, dr, _ = type(signal).value(t, signal, *series)
            farthest = max(farthest, abs(r - servo.goal))
            lead = max(lead, servo.kv * abs(dr) / servo.kp)
    stall = math.inf if servo.stall is None else servo.stall
    need = needs(s.plant)[i] / servo.kp
    return float(f"{farthest + lead + min(stall / servo.kp, max(way, need)):.2g}")


def suggested_u_max(plant: Plant) -> float | tuple[float, ...]:
    """Return what the plant's channels suggest, or the default bound; one number if all channels
    have the same.
    """
    suggested = plant.suggested.get("u_max", (None,) * plant.driven)
    limits = [default_u_max(plant)] * len(suggested)
    # the bound of one joint's motor is no other's
    if _unbounded(plant):
        limits = _limits(plant)
    bounds = []
    for i, (limit, bound) in enumerate(zip(limits, suggested, strict=True)):
        servo = servo_of(plant, i)
        if bound is not None:
            bounds.append(bound)
        else:
            bounds.append(limit if servo is None else _reach(plant, i, servo))
    return tuple(bounds) if len(set(bounds)) > 1 else bounds[0]


def default_u_max(plant: Plant) -> float:
    """Return the bound on |u| where none is given, N or N m: the limit of the plant's strongest
    motor, by its file and by what its channel suggests; else 6, or what a user's joint needs.
    """
    return max(_limits(plant), default=U_MAX)


def bounds_in_words(s: Any, unit: str = "") -> str:
    """Return the bounds on |u|, such as "9.00 N m", or "9.00 N m at shoulder and 4.00 N m at elbow"
    where they differ; of the channels whose u has a `unit` if one is given.
    """
    joints: dict[str, list[str]] = {}
    for name, limit, effort in zip(driven_names(s.plant), s.limits, s.efforts, strict=False):
        if unit in ("", effort):
            joints.setdefault(f"{number(limit)} {effort}", []).append(name)
    if len(joints) == 1:
        return next(iter(joints))
    return joined(f"{most} at {joined(names)}" for most, names in joints.items())


def _limits(plant: Plant) -> list[float]:
    """Return the limits of the plant's motors, or the lesser bounds that their channels suggest;
    where a user's model has neither, what a joint needs.
    """
    from smc_mujoco.mechanisms.custom.scales import needs

    suggested = plant.suggested.get("u_max", (None,) * plant.driven)
    unbounded = _unbounded(plant)
    bounds = []
    for i, limit in enumerate(plant.limits or (math.inf,) * plant.driven):
        bound = math.inf
        if suggested[i] is not None and not any(part.unit for part in drives_of_file(plant, i)):
            bound = suggested[i]
        if min(limit, bound) < math.inf:
            bounds.append(min(limit, bound))
        elif unbounded:
            bounds.append(needs(plant)[i])
    return bounds


def _unbounded(plant: Plant) -> bool:
    """Return whether nothing bounds the force on some joint of a user's model."""
    bounded = plant.limits and math.inf not in plant.limits
    return plant.has_user_joints and not bounded
