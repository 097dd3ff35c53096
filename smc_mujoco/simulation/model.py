"""Assembly: a scenario's plant and parts as one compiled model, and the fields that its numbers set in it.

What scenarios must have in common to share a model is its `structure`; everything else about their mechanisms is a
number in some field of the model, which a Batch holds for every simulation on its own.
"""

import copy
import dataclasses
from collections.abc import Hashable, Iterator, Sequence

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.frozen import frozen
from smc_mujoco.mechanisms.hardware import encoder
from smc_mujoco.mechanisms.hardware.part import ROTOR, START, Part, joint_ids
from smc_mujoco.mechanisms.plant import Field, array, ready
from smc_mujoco.simulation.scenario import Scenario

WAY = 400  # places on the way to a start that must be free: 1 cm apart on the longest rail
INSIDE = 1e-3  # m: chosen, as a run that starts deeper than a contact gives way begins with a blow from nowhere


def parts(scenario: Scenario) -> tuple[Part, ...]:
    """The scenario's parts, in the order in which they are built in and their numbers written."""
    contact = () if scenario.contact.kind == "none" else (scenario.contact,)
    sensor = () if scenario.sensor is None else (scenario.sensor,)
    actuator = scenario.actuator if scenario.tandem is None else scenario.actuator[1:]  # the callback has the first
    return (*contact, *scenario.friction, *actuator, *sensor)


def structure(scenario: Scenario) -> Hashable:
    """Equal for scenarios whose mechanisms differ in numbers only."""
    plant = scenario.plant
    built = tuple(part.structure() for part in parts(scenario))
    edits = plant.contacts.get(scenario.contact.kind), plant.mechanisms.get(scenario.mechanism)
    return plant.build, plant.fields, plant.n, edits, built


def spec(scenarios: Sequence[Scenario]) -> mujoco.MjSpec:
    """The mechanism that scenarios of one structure share, as an editable MjSpec."""
    first = scenarios[0]
    made = first.plant.spec()
    if first.mechanism != "equation":
        first.plant.mechanisms[first.mechanism].edit(made)
    first.contact.edit_on(first.plant, made)
    for part in parts(first):
        part.edit(made)
    encoder.buffer(made, max(s.readings for s in scenarios))
    return made


def model(scenarios: Sequence[Scenario], nuserdata: int = 0) -> mujoco.MjModel:
    """The model that scenarios of one structure share, as it was compiled: without their numbers."""
    made = ready(spec(scenarios), nuserdata)
    made.opt.timestep = scenarios[0].physics_step
    made.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{scenarios[0].integrator.upper()}")
    return made


def numbered(compiled: mujoco.MjModel, scenario: Scenario, step: int = 0) -> mujoco.MjModel:
    """A copy of the compiled model with the scenario's numbers in it."""
    made = copy.copy(compiled)
    put_numbers(made, compiled, scenario, step)
    mujoco.mj_setConst(made, mujoco.MjData(made))
    return made


def put_numbers(made: mujoco.MjModel, compiled: mujoco.MjModel, scenario: Scenario, step: int) -> None:
    """Write the scenario's numbers into a copy of the compiled model; mj_setConst is left to the caller."""
    for name, value in numbers(compiled, scenario, step).items():
        array(made, name)[:] = value


def numbers(compiled: mujoco.MjModel, scenario: Scenario, step: int) -> dict[str, np.ndarray]:
    """Model field -> its values from a physics step on, of every field that the scenario's numbers set."""
    found: dict[str, np.ndarray] = {}
    for name, at, value, adds in fields(compiled, scenario, step):
        held = found.setdefault(name, array(compiled, name).copy())
        held[at] = held[at] + value if adds else value
    return found


def start(compiled: mujoco.MjModel, scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """qpos and qvel at t = 0: every channel at x0 and v0, its rotor with it, the rest where the model has it."""
    qpos, qvel = home(compiled), np.zeros(compiled.nv)
    for joint, x, v in zip(joint_ids(compiled), scenario.x0, scenario.v0, strict=True):
        rotor = mujoco.mj_name2id(compiled, mujoco.mjtObj.mjOBJ_JOINT, ROTOR + compiled.joint(joint).name)
        for moved in (joint, rotor) if rotor >= 0 else (joint,):
            qpos[compiled.jnt_qposadr[moved]], qvel[compiled.jnt_dofadr[moved]] = x, v
    return qpos, qvel


def home(compiled: mujoco.MjModel) -> np.ndarray:
    """qpos where the model itself has every joint, or the keyframe in which runs start."""
    key = mujoco.mj_name2id(compiled, mujoco.mjtObj.mjOBJ_KEY, START)
    return (compiled.qpos0 if key < 0 else compiled.key_qpos[key]).copy()


def check_starts(scenarios: Sequence[Scenario]) -> None:
    """Whether scenarios of one structure start on the free side of their obstacles.

    The way there from the plant's own start, or from 0 where that is not free, must cross none: what begins beyond a
    stop, or half-way through, would be no run of this mechanism.

    Raises:
      ScenarioError: one starts inside an obstacle or beyond it.
    """
    if scenarios[0].contact.kind == "none":
        return
    scratch, seen = model(scenarios), set()
    compiled, data = copy.copy(scratch), mujoco.MjData(scratch)
    for scenario in scenarios:
        place = scenario.plant, scenario.x0, frozen(scenario.factors(0))  # all on which it depends
        if place not in seen:
            seen.add(place)
            put_numbers(scratch, compiled, scenario, 0)
            check_start(scratch, data, scenario)


def check_start(made: mujoco.MjModel, data: mujoco.MjData, scenario: Scenario) -> None:
    """Raise ScenarioError where a scenario starts inside an obstacle or beyond it."""
    there = start(made, scenario)[0]
    inside, beyond = _overlap(made, data, there), None
    if not inside and scenario.x0 != scenario.plant.x0:
        home = start(made, dataclasses.replace(scenario, x0=scenario.plant.x0))[0]
        home = made.qpos0 if _overlap(made, data, home) else home
        way = (_overlap(made, data, (1.0 - part) * home + part * there) for part in np.linspace(0.0, 1.0, WAY))
        beyond = next(filter(None, way), None)
    if hit := inside or beyond:
        raise ScenarioError(
            f"x0 {shown(scenario.x0)} puts {scenario.plant.name}'s {hit[0]} {'inside' if inside else 'beyond'} "
            f"{hit[1]} of contact {scenario.contact.kind!r}: give another x0"
        )


def _overlap(made: mujoco.MjModel, data: mujoco.MjData, qpos: np.ndarray) -> tuple[str, str] | None:
    """The two geoms that overlap at qpos by more than INSIDE, if any do."""
    data.qpos[:] = qpos
    mujoco.mj_kinematics(made, data)
    mujoco.mj_collision(made, data)
    for touching in data.contact:
        if touching.dist < -INSIDE:
            first, second = (made.geom(int(geom)).name for geom in touching.geom)
            return first, second
    return None


def fields(compiled: mujoco.MjModel, scenario: Scenario, step: int) -> Iterator[Field]:
    """What the plant's parameters and the parts' numbers write into the compiled model, in this order."""
    plant = scenario.plant
    by = plant.fields if scenario.mechanism == "equation" else plant.mechanisms[scenario.mechanism].fields
    yield from by(compiled, plant.values(scenario.factors(step)))
    for part in parts(scenario):
        yield from part.fields(compiled)
