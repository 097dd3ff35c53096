"""The bound on |u| where a scenario gives none.

Here `s` is a Scenario, which imports this module.
"""

import math
from typing import Any

from smc_mujoco.common.text import joined, number
from smc_mujoco.mechanisms.layout import driven_names
from smc_mujoco.mechanisms.plant import Plant

U_MAX = 6.0  # N or N m, chosen: the bound of every study here


def default_bound(s: Any) -> float | tuple[float, ...]:
    """Return the default of u_max: of each joint that of its motor, or what the plant suggests."""
    suggested = suggested_u_max(s.plant)
    if not any(part.bound is not None for part in s.actuator):
        return suggested
    bounds = list(suggested) if isinstance(suggested, tuple) else [suggested] * s.plant.driven
    # what the plant suggests is for the servos that it keeps
    none = ((),) * s.plant.driven
    drives_of_file = s.plant.suggested.get("actuator", none)
    for i, motor in enumerate(s.drive_train.motors):
        if motor.bound is not None and not any(part.unit for part in drives_of_file[i]):
            bounds[i] = motor.bound
    return tuple(bounds) if len(set(bounds)) > 1 else bounds[0]


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
    for limit, bound in zip(limits, suggested, strict=True):
        bounds.append(limit if bound is None else bound)
    return tuple(bounds) if len(set(bounds)) > 1 else bounds[0]


def default_u_max(plant: Plant) -> float:
    """Return the bound on |u| where none is given, N or N m: the limit of the plant's strongest
    motor, else 6, or what a user's joint needs.
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
    """Return the limits of the plant's motors; where a user's model has none, what a joint
    needs.
    """
    if not _unbounded(plant):
        return [limit for limit in plant.limits if limit < math.inf]
    from smc_mujoco.mechanisms.custom.scales import needs

    limits = plant.limits or (math.inf,) * plant.driven
    bounds = []
    for need, limit in zip(needs(plant), limits, strict=True):
        bounds.append(need if limit == math.inf else limit)
    return bounds


def _unbounded(plant: Plant) -> bool:
    """Return whether nothing bounds the force on some joint of a user's model."""
    bounded = plant.limits and math.inf not in plant.limits
    return plant.is_user_model and not plant.pose and not bounded
