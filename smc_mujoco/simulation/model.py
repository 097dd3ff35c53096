"""Assembly: a scenario's plant and parts as one compiled model, and the model fields that its numbers set.

Scenarios of the same `structure` share a `Mechanism`. Everything else about their mechanisms is a number in some field
of its model, and a Batch keeps those fields separately for each simulation.
"""

import copy
import dataclasses
import itertools
import weakref
from collections.abc import Hashable

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.frozen import frozen
from smc_mujoco.mechanisms.hardware import encoder
from smc_mujoco.mechanisms.hardware.part import ROTOR, Part, initial_pose, joint_ids
from smc_mujoco.mechanisms.plant import field_array, ready
from smc_mujoco.simulation.channels import channels
from smc_mujoco.simulation.scenario import Scenario

USERDATA = 2  # numbers in mjData.userdata: callback.magic() and the address of the simulation's record
PATH_POINTS = 400  # points that are checked on the path to a start: 1 cm apart on the longest rail
MAX_OVERLAP = 1e-3  # m, at a start; chosen: contacts give way by less, so a deeper start begins with a blow


def parts(scenario: Scenario) -> tuple[Part, ...]:
    """Return the scenario's parts, in the order in which they are added to the model."""
    contact = () if scenario.contact.kind == "none" else (scenario.contact,)
    sensor = () if scenario.sensor is None else (scenario.sensor,)
    actuator = tuple(part for part in scenario.actuator if not part.in_callback)
    return (*contact, *scenario.friction, *actuator, *sensor)


def structure(scenario: Scenario) -> Hashable:
    """Return a key that is equal for scenarios whose mechanisms differ only in numbers."""
    plant = scenario.plant
    built = tuple(part.structure() for part in parts(scenario))
    edits = plant.contacts.get(scenario.contact.kind), plant.mechanisms.get(scenario.mechanism)
    resolved = scenario.resolved
    clock = resolved.integrator, resolved.physics_step
    return plant.build, plant.fields, plant.n, edits, built, scenario.readings, *clock


class Mechanism:
    """What scenarios of one structure share.

    Attributes:
      model: their compiled model, without their values and without scenery.
      channels: where their channels are in it, (n,) CHANNEL.
    """

    def __init__(self, model: mujoco.MjModel, channels: np.ndarray):
        self.model, self.channels = model, channels
        self._free_starts: set[Hashable] = set()

    def check_start(self, scenario: Scenario) -> None:
        """Check that a scenario starts on the free side of its obstacles.

        The path from the plant's own start, or from 0 if that is not free, must cross no obstacle, because the
        mechanism could not get to a start beyond a stop or inside it.
        """
        if scenario.contact.kind == "none":
            return
        # all that the check depends on
        place = scenario.plant, scenario.contact, scenario.resolved.x0, frozen(scenario.factors(0))
        if place not in self._free_starts:
            made = copy.copy(self.model)
            put_values(made, self.model, scenario, 0)
            _check_start(made, scenario)
            self._free_starts.add(place)


_mechanisms: weakref.WeakValueDictionary[Hashable, Mechanism] = weakref.WeakValueDictionary()  # by structure


def mechanism(scenario: Scenario) -> Mechanism:
    """Return the Mechanism of a scenario. It is compiled once, as long as any scenario that is prepared needs it."""
    key = structure(scenario)
    if (shared := _mechanisms.get(key)) is None:
        made = model(scenario, USERDATA, scenery=False)
        shared = _mechanisms[key] = Mechanism(made, channels(made))
    return shared


def spec(scenario: Scenario) -> mujoco.MjSpec:
    """Return a scenario's mechanism as an editable MjSpec."""
    made = scenario.plant.spec()
    if scenario.mechanism != "equation":
        scenario.plant.mechanisms[scenario.mechanism].edit(made)
    scenario.contact.edit_on(scenario.plant, made)
    for part in parts(scenario):
        part.edit(made)
    for sensor in made.sensors:
        sensor.nsample = scenario.readings
    return made


def without_scenery(spec: mujoco.MjSpec) -> None:
    """Delete cameras, lights and the geoms that neither move nor touch anything, and to which nothing refers.

    MuJoCo computes their poses at every step, in up to 28 % of its time.
    """
    needed = {name for pair in spec.pairs for name in (pair.geomname1, pair.geomname2)}
    needed |= {name for sensor in spec.sensors for name in (sensor.objname, sensor.refname)}
    needed |= {wrap.target.name for tendon in spec.tendons for wrap in tendon.path if wrap.target}
    fixed = [geom for geom in spec.geoms if _is_fixed(geom.parent) and not geom.contype and not geom.conaffinity]
    scenery = [geom for geom in fixed if geom.name not in needed]
    for element in (*spec.cameras, *spec.lights, *spec.skins, *scenery):
        spec.delete(element)


def _is_fixed(body: mujoco.MjsBody | None) -> bool:
    """Return whether no joint moves a body."""
    return body is None or (not body.joints and _is_fixed(body.parent))


def model(scenario: Scenario, nuserdata: int = 0, scenery: bool = True) -> mujoco.MjModel:
    """Return the compiled model of a scenario's structure, without its values and for no picture.

    Its procedural textures have a few pixels: MuJoCo paints them at each compilation, in three quarters of its time.

    Args:
      nuserdata: length of mjData.userdata.
      scenery: whether it keeps what `without_scenery` deletes. Users' own models always do: a fixed part may be a
        floor.
    """
    edited, resolved = spec(scenario), scenario.resolved
    if not (scenery or scenario.plant.direct):
        without_scenery(edited)
    for texture in edited.textures:
        texture.width, texture.height = 1, 6  # a skybox has six sides
    made = ready(edited, nuserdata)
    made.opt.timestep = resolved.physics_step
    made.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{resolved.integrator.upper()}")
    return made


def with_values(compiled: mujoco.MjModel, scenario: Scenario, step: int = 0) -> mujoco.MjModel:
    """Return a copy of the compiled model with the scenario's values from a physics step on."""
    made = copy.copy(compiled)
    put_values(made, compiled, scenario, step)
    mujoco.mj_setConst(made, mujoco.MjData(made))
    return made


def put_values(made: mujoco.MjModel, compiled: mujoco.MjModel, scenario: Scenario, step: int) -> dict[str, np.ndarray]:
    """Write the field values of a scenario into a copy of the compiled model, and return them.

    The caller calls mj_setConst.
    """
    values = field_values(compiled, scenario, step)
    for name, value in values.items():
        field_array(made, name)[:] = value
    return values


def field_values(compiled: mujoco.MjModel, scenario: Scenario, step: int) -> dict[str, np.ndarray]:
    """Return model field -> its values from a physics step on, for every field that the scenario sets."""
    plant, written = scenario.plant, {}
    fields = plant.fields if scenario.mechanism == "equation" else plant.mechanisms[scenario.mechanism].fields
    of_parts = (part.fields(compiled) for part in parts(scenario))
    for name, at, value, adds in itertools.chain(fields(compiled, plant.values(scenario.factors(step))), *of_parts):
        values = written.setdefault(name, field_array(compiled, name).copy())
        values[at] = values[at] + value if adds else value
    return written


def start(compiled: mujoco.MjModel, scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Return qpos and qvel at t = 0: channels and their rotors at x0 and v0, other joints as in `initial_pose`."""
    qpos, qvel = initial_pose(compiled), np.zeros(compiled.nv)
    resolved = scenario.resolved
    for joint, x, v in zip(joint_ids(compiled), resolved.x0, resolved.v0, strict=True):
        rotor = mujoco.mj_name2id(compiled, mujoco.mjtObj.mjOBJ_JOINT, ROTOR + compiled.joint(joint).name)
        for moved in (joint, rotor) if rotor >= 0 else (joint,):
            qpos[compiled.jnt_qposadr[moved]], qvel[compiled.jnt_dofadr[moved]] = x, v
    return qpos, qvel


def put_start(made: mujoco.MjModel, data: mujoco.MjData, scenario: Scenario) -> None:
    """Put a scenario's state at t = 0 into the data of its model, with the past readings of late sensors."""
    data.qpos[:], data.qvel[:] = start(made, scenario)
    if made.nhistory:
        encoder.remember(made, data)


def _check_start(made: mujoco.MjModel, scenario: Scenario) -> None:
    """Raise ScenarioError if a scenario, whose values the model has, starts inside an obstacle or beyond it."""
    data, there = mujoco.MjData(made), start(made, scenario)[0]
    inside, beyond = _overlap(made, data, there), None
    moves_around = scenario.plant.tip  # an arm: the straight line in its joints may cross what the arm goes around
    if not inside and scenario.resolved.x0 != scenario.plant.x0 and not moves_around:
        free = start(made, dataclasses.replace(scenario, x0=scenario.plant.x0))[0]
        free = made.qpos0 if _overlap(made, data, free) else free
        path = (_overlap(made, data, (1 - part) * free + part * there) for part in np.linspace(0, 1, PATH_POINTS))
        beyond = next(filter(None, path), None)
    if hit := inside or beyond:
        raise ScenarioError(
            f"x0 {shown(scenario.resolved.x0)} puts {scenario.plant.name}'s {hit[0]} "
            f"{'inside' if inside else 'beyond'} {hit[1]} of contact {scenario.contact.kind!r}: give another x0"
        )


def _overlap(made: mujoco.MjModel, data: mujoco.MjData, qpos: np.ndarray) -> tuple[str, str] | None:
    """Return the names of two geoms that overlap at qpos by more than MAX_OVERLAP, or None."""
    data.qpos[:] = qpos
    mujoco.mj_kinematics(made, data)
    mujoco.mj_collision(made, data)
    for touching in data.contact:
        if touching.dist < -MAX_OVERLAP:
            first, second = (made.geom(int(geom)).name for geom in touching.geom)
            return first, second
    return None
