"""What a scenario warns of: a value that may be in another unit, a motor that is too weak, bristles
that are too stiff, a bound that was assumed.

Here `s` is a scenario with its defaults, whose module imports this one.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from smc_mujoco.common.text import joined
from smc_mujoco.control.law import law_catalogue
from smc_mujoco.control.source import DEFAULT
from smc_mujoco.mechanisms.hardware.friction import LuGre
from smc_mujoco.mechanisms.hardware.joint_force import of_joint
from smc_mujoco.mechanisms.layout import channel_names, driven_names, loaded
from smc_mujoco.simulation.signals import Constant, Step

LOST_SHARE = 0.05  # of a duration that is no whole number of periods, before it is told; chosen
MAX_LATENESS = 0.3  # stiffness times step over damping of bristles; chosen: joints rest 20 % off
MAX_ANGLE = (
    3.0 * math.pi
)  # rad: chosen; swing-ups stay below 1.5 turns, and a larger number may be degrees
MAX_DEGREES = 720.0  # chosen; a number above this is not taken for degrees
FAR_START = (
    10.0,
    10.0,
)  # m, and times the plant's usual start: chosen; farther from the goal may be mm
MAX_MILLIMETRES = 1e4  # chosen; a number above this is not taken for mm
HOLDING = 2.0  # times the force of a motor: friction above it may be in another unit; chosen
LEVELS = "static", "coulomb", "level"  # of a friction at rest: the first that it has
LONG_TIME = 1.0  # s; chosen: an input delay or a control period that is as long may be in ms
LARGE_FACTORS = 15.0, 1000.0  # chosen: a mismatch between them may be in percent


def _times_and_factors(s: Any) -> Iterator[str]:
    """Yield a sentence about each number that may be in ms or percent."""
    for what in ("input_delay", "control_period"):
        if (seconds := getattr(s, what)) >= LONG_TIME:
            yield f"{what} is {seconds:g} s: if it is {seconds:g} ms, give {seconds / 1e3:g}"
    for name, factor in s.mismatch.items():
        low, high = LARGE_FACTORS
        # a number of a joint or a part, as elbow.damping, may be far from its nominal value
        if low <= factor <= high and name not in s.plant.added and "." not in name:
            fact = f"the true {name} of {s.plant.name} is {factor:g} times the nominal one"
            yield f"{fact}: if it is {factor:g} % more, give {1.0 + factor / 100.0:g}"


def _unreachable_goals(s: Any) -> Iterator[str]:
    """Yield a sentence about each obstacle that a constant reference runs into."""
    goal = constant_goal(s)
    if goal is None or s.law.name == "none":
        return
    for part in s.contact:
        if met := part.meets(s.plant, goal):
            yield (
                f"the reference of {s.plant.name} has {met}, so that it is not reached: give "
                "another reference or more room, unless it is to lean there"
            )


def constant_goal(s: Any) -> tuple[float, ...] | None:
    """Return where a constant reference wants each channel, and where the others rest; None for
    another reference.
    """
    if not all(isinstance(signal, Constant) for signal in s.references):
        return None
    amplitudes = tuple(signal.parameters()["amplitude"] for signal in s.references)
    return amplitudes + tuple(s.plant.goal or s.plant.origin[s.plant.driven :])


def _positions_for_speeds(s: Any) -> Iterator[str]:
    """Yield a sentence about each position that stands for the reference of a speed loop."""
    if s.tracks != "speed":
        return
    rest = s.plant.rest or (0.0,) * s.plant.driven
    for i, signal in enumerate(s.references):
        if not isinstance(signal, Constant | Step):
            continue
        amplitude = signal.parameters()["amplitude"]
        if amplitude != rest[i]:
            yield (
                f"the reference of channel {i} is a position that stays at {amplitude:g}, which "
                "asks a speed loop for the speed 0: for that speed give "
                f"smc.signals.Ramp({amplitude:g})"
            )


def _stiff_bristles(s: Any) -> Iterator[str]:
    """Yield a sentence about bristles that are too stiff for the physics step."""
    for part in s.friction:
        # of the library's plants, softer bristles are those of a named condition or of a rig
        if not isinstance(part, LuGre):
            continue
        if part.stiffness <= LuGre.stiffness and not s.plant.is_user_model:
            continue
        damping = part.damping
        if damping is None:
            model = loaded(s.plant)
            masses = model.dof_M0[part.dofs(model)]
            damping = part.default_damping(masses.min())
        if part.stiffness * s.physics_step > MAX_LATENESS * damping:
            yield (
                f"LuGre's bristles of stiffness {part.stiffness:g} and damping {damping:.3g} "
                f"are too stiff for a physics step of {s.physics_step:g} s: MuJoCo bends them "
                "a step late, and joints rest at wrong places. Give a physics_step of "
                f"{0.1 * MAX_LATENESS * damping / part.stiffness:.1g} or less, or softer ones"
            )


def _broken_period(s: Any) -> Iterator[str]:
    """Yield a sentence about a duration that is no whole number of control periods."""
    lasts = s.samples * s.control_period
    if abs(lasts - s.duration) > LOST_SHARE * s.duration:
        yield (
            f"duration {s.duration:g} s is not a whole number of control periods of "
            f"{s.control_period:g} s, so the run lasts {lasts:g} s: give a duration of "
            f"{lasts:g} or {lasts + s.control_period:g} s"
        )


def _degrees(s: Any) -> Iterator[str]:
    """Yield a sentence about each angle that may be in degrees."""
    # ramps may have many turns
    amplitudes = [signal.parameters().get("amplitude", 0.0) for signal in s.references]
    for what, values in (("x0", s.x0), ("the reference's amplitude", amplitudes)):
        for unit, value in zip(s.plant.units, values, strict=False):
            if unit == "rad" and MAX_ANGLE < abs(value) <= MAX_DEGREES:
                fact = f"{what} is {value:g} rad, {abs(value) / math.tau:.1f} turns"
                yield f"{fact}: if it is {value:g} degrees, give {math.radians(value):.4g}"


def _far_starts(s: Any) -> Iterator[str]:
    """Yield a sentence about each start so far away that it may be in mm. What joints' limits allow
    is not questioned.
    """
    if s.plant.pose or s.plant.ranges:
        return
    least, share = FAR_START
    goal = constant_goal(s) or s.plant.origin
    for unit, x, usual, end in zip(s.plant.units, s.x0, s.plant.x0, goal, strict=False):
        near = max(least, share * abs(usual))
        if unit == "m" and near < abs(x - end) <= MAX_MILLIMETRES:
            yield (
                f"x0 is {x:g} m, and runs of {s.plant.name} usually start at {usual:g} m: if it is "
                f"{x:g} mm, give {x / 1e3:g}"
            )


def _holding_friction(s: Any) -> Iterator[str]:
    """Yield a sentence about each dry friction that no command can overcome."""
    if not s.friction:  # names of joints take a model
        return
    forces = dict(zip(driven_names(s.plant), s.drive_train.forces, strict=True))
    for part in s.friction:
        values = [getattr(part, name, None) for name in LEVELS]
        level = next((value for value in values if value is not None), 0.0)
        for i, joint in enumerate(part.joint_names(s.plant)):
            force = forces.get(joint, math.inf)
            if part.side == "link" and of_joint(level, i) > HOLDING * force:
                yield (
                    f"{type(part).__name__} holds joint {joint!r} with {of_joint(level, i):g}, and "
                    f"its motor gives at most {force:g}: no command moves it, so give less "
                    "friction, or more u_max"
                )


def _weak_motors(s: Any) -> Iterator[str]:
    """Yield a sentence about each motor that cannot hold its joint at the start."""
    for i, chain in enumerate(s.drive_train.chains):
        for motor in chain:
            if motor.stall is None:
                continue
            with np.errstate(all="ignore"):
                values = s.plant.values({})
                zeros = np.zeros(s.plant.n)
                f, g = s.plant.nominal(np.array(s.x0), zeros, i, values)
            need = abs(f) / abs(g) if g else 0.0
            if motor.stall < need and (need <= s.limits[i] or not s.force_command):
                yield (
                    f"{type(motor).__name__} gives at most {motor.stall:.3g} {s.plant.efforts[i]} "
                    f"at rest, and channel {i} of {s.plant.name} needs {need:.3g} to hold its "
                    "start: give a stronger motor, or more gear"
                )


def of_units(s: Any) -> Iterator[str]:
    """Yield a sentence about each value that may be in another unit."""
    yield from _times_and_factors(s)
    yield from _degrees(s)
    yield from _far_starts(s)


def of_values(s: Any) -> Iterator[str]:
    """Yield a sentence about each value that makes a run other than it seems."""
    yield from _stiff_bristles(s)
    yield from _broken_period(s)
    yield from _unreachable_goals(s)
    yield from _positions_for_speeds(s)
    yield from _holding_friction(s)
    yield from _weak_motors(s)


def of_default_gains(s: Any) -> str:
    """Return a sentence on default gains of the library's, which are for a force, before an
    actuator of a file that takes another command, or "".
    """
    if not any(part.is_of_file and part.unit for part in s.actuator):
        return ""
    library = law_catalogue()
    for law in s.law.parts:
        if law.name in library and law.gains and law.source.kind == DEFAULT:
            return (
                f"{s.drive_train.words[0].removesuffix('.')}, and the default gains of {law.name} "
                f"are for a force: tune them, as smc.tune(plant, {law.name!r}) does"
            )
    return ""


def of_assumed_bound(s: Any) -> str:
    """Return a sentence on the joints of your own model whose force a default limits, or ""."""
    plant = s.plant
    limits = s.limits
    if not plant.is_user_model or not s.force_command or s.law.name == "none":
        return ""
    suggested = plant.suggested.get("u_max", (None,) * plant.driven)
    own = plant.limits or (math.inf,) * plant.driven
    free = []
    for i, limit in enumerate(own):
        if limit == math.inf and suggested[i] is None:
            free.append(i)
    if not free:
        return ""
    joints = []
    bounds = []
    for i in free:
        joints.append(repr(channel_names(plant)[i]))
        bounds.append(f"{limits[i]:g} {plant.efforts[i]}")
    bounds_text = joined(dict.fromkeys(bounds))
    what = "joint" if len(free) == 1 else "joints"
    example = f"u_max={limits[free[0]]:g}"
    if plant.driven > 1:
        example = f"smc.Channel({example}) for each"
    return (
        f"nothing limits the force on {what} {joined(joints)} of {plant.name}; |u| <= "
        f"{bounds_text} is assumed from its load and inertia: give u_max, the limit of your motor, "
        f"such as {example}"
    )
