"""Paths to the numbers of a user's machine, which identification finds: where each enters, where
its search starts and within which range.

    shoulder.damping, .frictionloss, .armature, .stiffness    of a joint in the model
    shoulder.gain, .offset    force = gain u + offset, from the recorded command of its motor
    shoulder.zero             what its encoder reads at 0, rad or m
    input_delay               s, from a recorded command to its force
    hand.payload              kg, a point mass at the centre of mass of a body of the model
    m, grav                   kg and m/s^2: the mass of all that moves, and gravity; or other
                              parameters of a plant of the library
    elbow.kp, .kv, .ki, .dead_band  of the joint's position servo in the model
    elbow.play                rad or m, between its motor and the joint
    friction.elbow.kc         a number of a part of the scenario: FIELD.JOINT.NAME, or FIELD.NAME

Dry friction with another level in each direction is frictionloss and offset: the levels are
frictionloss - offset and frictionloss + offset.
"""

import dataclasses
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common.constraints import of_fields
from smc_mujoco.common.errors import ScenarioError, items_of, shown, unknown
from smc_mujoco.identification.rig import Quantity
from smc_mujoco.mechanisms.custom.model_numbers import (
    KINDS,
    model_numbers,
    with_model_numbers,
)
from smc_mujoco.mechanisms.custom.plant_from import PARAMETER_UNITS
from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.moments import JointState
from smc_mujoco.mechanisms.hardware.part import Friction, Part
from smc_mujoco.mechanisms.hardware.position_servo import PositionServo
from smc_mujoco.mechanisms.layout import channel_names, driven_names
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.part_numbers import (
    FIELDS,
    PartNumber,
    is_path,
    part_number,
    parts_of,
    paths_of_parts,
    ranges,
)
from smc_mujoco.simulation.scenario import Scenario

DELAY = "input_delay"
SERVO = "kp", "kv", "ki", "dead_band"  # of a position servo
PLAY = "play"  # of a joint, between its motor and itself
FIRST_PLAY = 0.01  # rad or m, at which a search starts where the scenario has none; chosen
ROTOR_SHARE = 0.01  # of the inertia at the joint, that the rotor before a play then has; chosen
MAX_DELAY = 0.05  # s, up to which a delay is looked for; chosen
MAX_ZERO = 0.5  # rad or m, of an encoder; chosen
MIN_GAIN = 1e-6  # chosen: a motor that does nothing cannot be found
LEAST_ABOVE_ZERO = 1e-9  # SI units, of a number that must be greater than 0
# Frictions and inertias of the library's plants, which are 0 or more
NATURAL = frozenset(("b", "bq", "b1", "b2", "cf", "cfq", "cf1", "cf2", "delta", "J", "Jc"))


class Paths(NamedTuple):
    """The numbers that names stand for."""

    plant: Plant  # with those of its joints and bodies among its parameters
    quantities: dict[str, Quantity]
    parts: dict[str, PartNumber]  # those of parts


def named_once(names: Iterable[str]) -> list[str]:
    """Return the names of quantities that a user gives, each of which may be there once."""
    listed = items_of("names", names)
    for name in listed:
        if not isinstance(name, str):
            raise ScenarioError(f"names has {shown(name)}: give texts, such as 'elbow.damping'")
    for name, times in Counter(listed).items():
        if times > 1:
            raise ScenarioError(f"quantities have {name} {times} times: name it once")
    return listed


def resolved(base: Scenario, names: Sequence[str]) -> Paths:
    """Return the numbers of a scenario that names stand for.

    Raises:
      ScenarioError: there is no such number, or it is not given in the scenario.
    """
    plant = base.plant
    of_joints = model_numbers(plant)
    quantities: dict[str, Quantity] = {}
    places: dict[str, PartNumber] = {}
    for name in names:
        if name in of_joints:
            number = of_joints[name]
            least = KINDS[number.kind].least if number.kind in KINDS else 0.0
            quantities[name] = Quantity(number.value, number.unit, "the model", least)
        elif name in plant.parameters:
            least = _open(plant.constraint(name).low)
            if name in NATURAL:
                least = 0.0
            unit = PARAMETER_UNITS.get(name, "") if plant.is_user_model else ""
            quantities[name] = Quantity(plant.parameters[name], unit, "the plant", least)
        elif quantity := _of_signals(base, str(name)):
            quantities[name] = quantity
        elif path := _path_of_part(base, str(name)):
            places[name], quantities[name] = _of_part(base, path)
        else:
            raise unknown(f"number of {plant.name}", name, known_paths(base))
    return Paths(with_model_numbers(plant, of_joints.keys() & quantities), quantities, places)


def with_plays(base: Scenario, names: Sequence[str]) -> Scenario:
    """Return a scenario with a Backlash before each joint whose play is named and that has none,
    with a light rotor.
    """
    plant = base.plant
    added = []
    for i, joint in enumerate(driven_names(plant)):
        geared = any(isinstance(part, Backlash) for part in base.drive_train.chains[i])
        if f"{joint}.{PLAY}" in names and not geared:
            model = plant.load()
            inertia = ROTOR_SHARE * float(model.dof_M0[model.joint(joint).dofadr[0]])
            added.append(Backlash(FIRST_PLAY, rotor_inertia=inertia, on=(joint,)))
    return dataclasses.replace(base, actuator=(*base.actuator, *added)) if added else base


def known_paths(base: Scenario) -> list[str]:
    """Return every path to a number of a scenario."""
    plant = base.plant
    paths = [*plant.parameters, DELAY, *model_numbers(plant)]
    for joint in driven_names(plant):
        paths += [f"{joint}.gain", f"{joint}.offset"]
    paths += [f"{joint}.zero" for joint in channel_names(plant)]
    for joint, motor in zip(driven_names(plant), base.drive_train.motors, strict=True):
        if isinstance(motor, PositionServo):
            paths += [f"{joint}.{kind}" for kind in SERVO]
    paths += [f"{joint}.{PLAY}" for joint in driven_names(plant)]
    for field in FIELDS:
        paths += paths_of_parts(base, field)
    return paths


def usual_paths(base: Scenario) -> list[str]:
    """Return paths to numbers of a scenario that most logs determine, for a user who names none."""
    plant = base.plant
    paths = paths_of_parts(base, "friction")
    kinds = ["armature"]
    if not paths:
        kinds = ["damping", "frictionloss", "armature"]
    of_joints = model_numbers(plant)
    for joint in driven_names(plant):
        for kind in kinds:
            if f"{joint}.{kind}" in of_joints:
                paths.append(f"{joint}.{kind}")
    if not of_joints:
        paths += sorted(NATURAL & plant.parameters.keys())
    return [*paths, DELAY]


def _of_signals(base: Scenario, name: str) -> Quantity | None:
    """Return a number of the signals between machine and log; None if the name is no such."""
    if name == DELAY:
        return Quantity(base.input_delay, "s", "the scenario", 0.0, MAX_DELAY)
    joint, _, kind = name.rpartition(".")
    if joint in driven_names(base.plant):
        i = driven_names(base.plant).index(joint)
        if kind == "gain":
            return Quantity(1.0, "", "nominal", MIN_GAIN)
        if kind == "offset":
            return Quantity(0.0, base.plant.efforts[i], "nominal")
    if joint in channel_names(base.plant) and kind == "zero":
        unit = base.plant.units[channel_names(base.plant).index(joint)]
        return Quantity(0.0, unit, "nominal", -MAX_ZERO, MAX_ZERO)
    return None


def _path_of_part(base: Scenario, name: str) -> str:
    """Return the path of a part's number: a name that is one, JOINT.kp of a joint's servo, or
    JOINT.play of its Backlash; "" for another name.
    """
    if is_path(name):
        return name
    joint, _, kind = name.rpartition(".")
    if kind == PLAY and joint in driven_names(base.plant):
        return f"actuator.{joint}.gap"
    if kind in SERVO and joint in driven_names(base.plant):
        motor = base.drive_train.motors[driven_names(base.plant).index(joint)]
        if isinstance(motor, PositionServo):
            return f"actuator.{joint}.{kind}"
    return ""


def _of_part(base: Scenario, path: str) -> tuple[PartNumber, Quantity]:
    """Return where a number of a part is, with its value and the range of its type."""
    place = part_number(base, path, known_paths(base))
    parts = parts_of(base, place.field)
    least, most = -math.inf, math.inf
    for number in ranges(of_fields(type(parts[place.part])).get(place.name)):
        least = _open(number.low) if number.above != 0.0 else LEAST_ABOVE_ZERO
        most = math.inf if number.high >= 1e12 else number.high
    unit = _unit(base.plant, parts[place.part], place)
    return place, Quantity(float(place.of(parts)), unit, "the scenario", least, most)


def _unit(plant: Plant, part: Any, place: PartNumber) -> str:
    """Return the unit of a part's number, "" for none, by the first of the joints that share it."""
    if not isinstance(part, Part):
        return ""  # a signal
    i = max(part.channels(plant)[max(place.joint, 0)], 0)
    x = plant.units[i]
    inertia = "kg m^2" if x == "rad" else "kg"
    return part.units.get(place.name, "").format(f=plant.efforts[i], x=x, m=inertia)


def _open(least: float) -> float:
    """Return the low end of a range; minus infinity for one that bounds nothing."""
    return -math.inf if least <= -1e12 else least


def steady_force(part: Friction, v: np.ndarray, i: int) -> np.ndarray:
    """Return the force with which a friction resists its joint i at steady speeds v, (K,)."""
    if part.steady is None:
        raise ScenarioError(
            f"{type(part).__name__} has no force at a steady speed: identify without it, or give "
            "Coulomb, Viscous, LuGre or ServoFriction"
        )
    fields = [(name, float) for name in part.names]
    p = np.rec.array([part.parameters(i)], dtype=fields)[0]
    memory = np.zeros(part.memory)
    state = JointState(*[0.0] * 7)
    forces = []
    for speed in v:
        forces.append(part.steady(state._replace(v=float(speed)), p, memory))
    return np.array(forces)


def slope(part: Friction, place: PartNumber, v: np.ndarray, i: int) -> np.ndarray:
    """Return how a friction's force at steady speeds v depends on one of its numbers, (K,)."""
    alone = place._replace(part=0)
    value = alone.of((part,))
    step = 1e-3 * abs(value) or 1e-3
    (moved,) = alone.put((part,), value + step)
    return (steady_force(moved, v, i) - steady_force(part, v, i)) / step
