"""A scenario's plant and parts as one compiled MuJoCo model, and the model fields that its numbers
set.

Scenarios of the same `structure` share a `Mechanism`, with one compiled base model. Their
mechanisms differ only in values of model fields. A Batch has those values separately for each
simulation.
"""

import copy
import dataclasses
import functools
import itertools
import weakref
from collections.abc import Collection, Hashable

import mujoco
import numpy as np

from smc_mujoco.common import mjcb
from smc_mujoco.common.aliases import Floats
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.process import return_freed_memory
from smc_mujoco.common.text import joined
from smc_mujoco.mechanisms.hardware.contact import contact_pairs
from smc_mujoco.mechanisms.hardware.encoder import remember
from smc_mujoco.mechanisms.hardware.moments import CHANNEL
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.mechanisms.layout import (
    BASE,
    OWN,
    PASSIVE,
    PLACES,
    POSE,
    base_joint,
    drive_ids,
    free_joint,
    joint_ids,
    moving_joints,
    state_with,
    unit_wrenches,
)
from smc_mujoco.mechanisms.plant import (
    DIRECT_TEXT,
    Plant,
    compiled_for_runs,
    field_array,
    leave_out_scenery,
)
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Push

USERDATA = 2  # numbers in mjData.userdata: callback.MAGIC and the address of the record
PATH_POINTS = 400  # points that are checked on the path to a start: 1 cm apart on the longest rail
SENSORS = {
    "x_sensor": mujoco.mjtSensor.mjSENS_JOINTPOS,
    "v_sensor": mujoco.mjtSensor.mjSENS_JOINTVEL,
}
# with which MuJoCo refuses to leave out a geom that has mass
# of a tendon around a geom
ROUND_WRAPS = mujoco.mjtWrap.mjWRAP_SPHERE, mujoco.mjtWrap.mjWRAP_CYLINDER
# ends of the names of a free body's sensors
POSE_SENSORS = {"x_sensor": (":x", ":q"), "v_sensor": (":v", ":w")}
MAX_RECENT = 16  # mechanisms that are kept for later runs, as those of a search for gains; chosen
MAX_RECENT_BYTES = 50_000_000  # of their models together; chosen
# m, at a start; chosen: bodies in contact overlap by less, so a deeper start begins with a blow
MAX_OVERLAP = 1e-3
OBSTACLE = "the obstacle"


def parts(scenario: Scenario) -> tuple[Part, ...]:
    """Return the scenario's parts, in the order in which they are added to the model."""
    added: list[Part] = [*scenario.contact]
    for part in scenario.friction:
        if part.side == "link":
            added.append(part)
    for part in scenario.actuator:
        if not part.in_callback:
            added.append(part)
    for part in scenario.friction:
        if part.side == "motor":  # on rotors
            added.append(part)
    return (*added, *scenario.sensors)


def structure(scenario: Scenario) -> Hashable:
    """Return a key that is equal for scenarios whose mechanisms differ only in numbers."""
    plant = scenario.plant
    of_parts = tuple(part.structure() for part in parts(scenario))
    placed = tuple(part.placed(plant) for part in scenario.contact)
    edits = placed, plant.mechanisms.get(scenario.mechanism)
    stepping = scenario.resolved.integrator, scenario.resolved.physics_step, scenario.exact_friction
    return (
        plant.build,
        plant.fields,
        plant.n,
        edits,
        of_parts,
        scenario.readings,
        pushed(scenario),
        *stepping,
    )


def pushed(scenario: Scenario) -> frozenset[str]:
    """Return the bodies that pushes act on."""
    return frozenset(d.body for d in scenario.disturbance if isinstance(d, Push))


@dataclasses.dataclass(frozen=True, eq=False)
class Mechanism:
    """What scenarios of one structure share."""

    model: mujoco.MjModel  # the base model, without the values of a scenario and without scenery
    channels: np.ndarray  # the indices of the channels in it, (n,) CHANNEL
    # those that `check_start` has passed
    free_starts: set[Hashable] = dataclasses.field(default_factory=set)


# by structure
_mechanisms: weakref.WeakValueDictionary[Hashable, Mechanism] = weakref.WeakValueDictionary()
_recent: list[Mechanism] = []  # replaced at once, as other threads read and replace it too


def mechanism(scenario: Scenario) -> Mechanism:
    """Return the Mechanism of a scenario.

    It is kept while a prepared scenario uses it, or it is a recent one.
    """
    key = structure(scenario)
    if (shared := _mechanisms.get(key)) is None:
        forget_large()
        base = compile_model(scenario, USERDATA, scenery=False)
        if mujoco.mj_sizeModel(base) > mjcb.LARGE:  # the spec, which is gone, took more
            return_freed_memory()
        shared = _mechanisms[key] = Mechanism(base, channels(base))
        mechanisms = [*_recent, shared][-MAX_RECENT:]
        sizes = [mujoco.mj_sizeModel(recent.model) for recent in mechanisms]
        while len(mechanisms) > 1 and sum(sizes[-len(mechanisms) :]) > MAX_RECENT_BYTES:
            del mechanisms[0]
        _recent[:] = mechanisms
    elif source := getattr(scenario.plant.build, "source", None):  # of a user's model
        source.check_unchanged()
    return shared


def forget_large() -> None:
    """Free a model that is kept for later runs if it is so large that it is kept alone."""
    if any(mujoco.mj_sizeModel(recent.model) > MAX_RECENT_BYTES for recent in [*_recent]):
        _recent.clear()


def channels(model: mujoco.MjModel) -> np.ndarray:
    """Return the channels, (n,) CHANNEL: one for each actuator that takes commands, then one for
    each other joint.

    A disturbance d acts on the body of the joint, as a force along the axis of a slide or a torque
    about the axis of a hinge, so that its generalised force is d. A horizontal force acts on the
    body's centre of mass.
    """
    if free_joint(model) >= 0:
        return _pose_channels(model)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for i in drive_ids(model):
        if (
            model.actuator_trntype[i] != mujoco.mjtTrn.mjTRN_JOINT
            or model.actuator_gear[i, 0] != 1.0
        ):
            raise ScenarioError(
                f"actuator {model.actuator(i).name!r} does not drive a joint with gear 1: give it "
                "one"
            )
    joints = joint_ids(model).tolist()
    drives = drive_ids(model).tolist()
    drives += [-1] * (len(joints) - len(drives))
    base = base_joint(model)
    rows = []
    for drive, joint in zip(drives, joints, strict=True):
        if joint != base:
            channel = _channel(model, data, drive, joint)
            rows.append(tuple(channel.values()))
        elif joint not in joints[: len(rows)]:
            table = _places(model, base, BASE)
            table["qfrc"] = table["qvel"]
            table["xfrc"] = table["horizontal"] = 0  # of the world, which no force moves
            rows += table.tolist()
    return np.array(rows, CHANNEL)


def _channel(model: mujoco.MjModel, data: mujoco.MjData, drive: int, joint: int) -> dict[str, int]:
    """Return the fields of a CHANNEL; `drive` is -1 for a joint without an actuator."""
    body = int(model.jnt_bodyid[joint])
    name = f"sensor of joint {model.joint(joint).name!r}"
    if drive >= 0:
        name = f"actuator {model.actuator(drive).name!r}"
    hinge = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
    if not hinge and model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_SLIDE:
        raise ScenarioError(f"{name} is not on a hinge or slide joint: give it one")
    direct = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, DIRECT_TEXT) >= 0
    axis = data.xaxis[joint].round(12)
    if direct:  # it may have any axis
        axis = np.array([0.0, 0.0, 1.0])
    if np.count_nonzero(axis) != 1:
        raise ScenarioError(f"the joint of {name} has axis {axis}: align it with a world axis")
    component = int(np.argmax(np.abs(axis)))
    friction = mujoco.mj_name2id(
        model, mujoco.mjtObj.mjOBJ_ACTUATOR, PASSIVE + model.joint(joint).name
    )
    xfrc = 6 * body + component + 3 * hinge
    indices = dict.fromkeys(CHANNEL.names or (), -1) | {
        "qpos": model.jnt_qposadr[joint],
        "qvel": model.jnt_dofadr[joint],
        "xfrc": xfrc,
        "sign": int(np.sign(axis[component])),
        "horizontal": xfrc,
        "axis": 0,
    }
    if drive >= 0:
        driven = model.actuator_trnid[drive, 0]
        indices |= {
            "ctrl": model.actuator_ctrladr[drive],
            "force": model.actuator_outadr[drive],
            "shaft": model.jnt_dofadr[driven],
            "shaft_qpos": model.jnt_qposadr[driven],
        }
    if friction >= 0:
        indices["friction_force"] = model.actuator_outadr[friction]
    if direct:
        indices["qfrc"] = model.jnt_dofadr[joint]
    if hinge:
        across = int(component == 0)  # a horizontal axis across that of the hinge
        indices |= {
            "horizontal": 6 * body + across,
            "axis": across,
            "hinge_body": 3 * body,
            "anchor": 3 * joint,
        }
    sides = [joint] if drive < 0 else [joint, model.actuator_trnid[drive, 0]]
    for field, kind in SENSORS.items():
        on_it = np.isin(model.sensor_objid, sides)
        sensors = np.flatnonzero((model.sensor_type == int(kind)) & on_it)
        if not len(sensors):
            raise ScenarioError(
                f"the joint of {name} has no {kind.name[7:].lower()} sensor: add one"
            )
        indices[field] = model.sensor_adr[sensors[0]]
    return indices


def _pose_channels(model: mujoco.MjModel) -> np.ndarray:
    """Return the channels of a free body, (6,) CHANNEL.

    The first ones have the ctrl of the actuators.

    A disturbance is a force on its centre of mass, the same along each axis of the world; a
    horizontal one is along x.
    """
    joint = free_joint(model)
    drives = drive_ids(model)
    table = _places(model, joint, POSE)
    axes = np.arange(len(PLACES))
    table["gathered"] = table["qvel"]
    table["xfrc"] = 6 * model.jnt_bodyid[joint] + axes
    # 0 is of the world, which no force moves
    table["horizontal"] = np.where(axes == 0, table["xfrc"], 0)
    table["ctrl"][: len(drives)] = model.actuator_ctrladr[drives]
    return table


def _places(model: mujoco.MjModel, joint: int, site: str) -> np.ndarray:
    """Return where the pose and the rates of a free joint are, measured at a site, (6,) CHANNEL; -1
    in all other fields.
    """
    table = np.full(len(PLACES), -1, CHANNEL)
    axes = np.arange(len(PLACES))
    turns = np.arange(len(PLACES)) - 3
    for name, kinds in POSE_SENSORS.items():
        addresses = []
        for kind in kinds:
            sensor = model.sensor(site + kind).id
            addresses.append(int(model.sensor_adr[sensor]))
        first, second = addresses
        if name == "v_sensor":
            second = second + turns
        table[name] = np.where(turns < 0, first + axes, second)
    places = np.minimum(axes, 3)
    table["qpos"] = model.jnt_qposadr[joint] + places
    table["qvel"] = model.jnt_dofadr[joint] + axes
    table["turn"] = np.where(turns < 0, -1, turns)
    table["sign"] = np.where(turns < 0, 1, 0)
    return table


@functools.lru_cache(maxsize=32)
def mixer(plant: Plant) -> np.ndarray:
    """Return what the actuators of a free body get of a force and a torque, and their bounds,
    (actuators, 8).

    It is the pseudoinverse of what they nominally exert: exact for what they can exert together,
    else nearest to it. Empty, (0, 8), for other plants.
    """
    if not plant.pose:
        return np.zeros((0, 8))
    model = plant.load()
    drives = drive_ids(model)
    forces = model.actuator_gainprm[drives, :1] * unit_wrenches(
        model, free_joint(model), drives.tolist()
    )
    limited = model.actuator_ctrllimited[drives].astype(bool)[:, None]
    bounds = np.where(limited, model.actuator_ctrlrange[drives], (-np.inf, np.inf))
    inverse = np.linalg.pinv(forces.T, rcond=1e-9)
    return np.hstack([inverse, bounds])


def keeps_torques(rows: np.ndarray) -> bool:
    """Return whether the actuators in a `mixer` all push one way and alike, as rotors do."""
    return len(set(rows[:, 7].tolist())) == 1 and bool(np.all(rows[:, 6] >= 0.0))


def spec(scenario: Scenario) -> mujoco.MjSpec:
    """Return a scenario's mechanism as an editable MjSpec."""
    spec = scenario.plant.spec()
    spec.option.timestep = scenario.resolved.physics_step
    if scenario.mechanism != "equation":
        scenario.plant.mechanisms[scenario.mechanism].edit(spec)
    for obstacle in scenario.contact:
        obstacle.edit_on(scenario.plant, spec)
    for part in parts(scenario):
        part.edit(spec)
    if scenario.plant.is_user_model and not scenario.contact:
        from smc_mujoco.mechanisms.custom import model_constraints, poles

        if not poles.may_touch(scenario.plant):
            model_constraints.hold(spec)
    for sensor in spec.sensors:
        sensor.nsample = scenario.readings
    return spec


def without_scenery(spec: mujoco.MjSpec, pushed: Collection[str] = ()) -> None:
    """Drop cameras, lights, the geoms that touch nothing, and fixed bodies that then have nothing,
    unless pushed.

    MuJoCo computes their poses at every step, in up to 28 % of its time. The compiler drops the
    geoms: deleted one by one, they take a time quadratic in their number. What something refers to
    stays, and a moving body keeps the inertia that it has from its geoms.
    """
    spec.compiler.discardvisual = True
    for element in (*spec.cameras, *spec.lights, *spec.skins):
        spec.delete(element)
    needed = set(pushed)
    for pair in spec.pairs:
        needed |= {pair.geomname1, pair.geomname2}
    for sensor in spec.sensors:
        needed |= {sensor.objname, sensor.refname}
    for tendon in spec.tendons:
        for wrap in tendon.path:
            if wrap.type in ROUND_WRAPS:
                needed.add(wrap.target.name)
    for body in reversed(spec.bodies[1:]):
        needs = [*body.sites, *body.bodies, *body.frames, body.explicitinertial]
        for geom in body.geoms:
            needs.append(geom.contype or geom.conaffinity or geom.name in needed)
        if not any(needs) and _is_fixed(body) and body.name not in needed:
            spec.delete(body)


def _is_fixed(body: mujoco.MjsBody | None) -> bool:
    """Return whether no joint moves a body."""
    return body is None or (not body.joints and _is_fixed(body.parent))


def compile_model(scenario: Scenario, nuserdata: int = 0, scenery: bool = True) -> mujoco.MjModel:
    """Return the base model of a scenario's structure: compiled, without the scenario's values.

    It is not for pictures. Its procedural textures have a few pixels, because MuJoCo paints them at
    each compilation, in three quarters of its time. Without `scenery` a user's robot has no geoms
    that touch nothing, and without their meshes it takes 0.02 MB in place of 30. It keeps all its
    bodies, as a fixed one may be a floor, and all its geoms if these define all inertias.
    """
    edited = spec(scenario)
    plant = scenario.plant
    if not scenery and plant.is_user_model:
        leave_out_scenery(edited)
    elif not (scenery or plant.direct):
        without_scenery(edited, pushed(scenario))
    for texture in edited.textures:
        texture.width, texture.height = 1, 6  # a skybox has six sides
    return compiled_model(edited, scenario, nuserdata)


def compiled_model(spec: mujoco.MjSpec, scenario: Scenario, nuserdata: int = 0) -> mujoco.MjModel:
    """Return the model of a mechanism, with the step and the integrator of a scenario, and without
    its values.
    """
    model = compiled_for_runs(spec, nuserdata)
    resolved = scenario.resolved
    model.opt.timestep = resolved.physics_step
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{resolved.integrator.upper()}")
    if resolved.exact_friction:  # the callback reads the levels from the model
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS.value
    return model


def with_values(base: mujoco.MjModel, scenario: Scenario, step: int = 0) -> mujoco.MjModel:
    """Return a copy of the base model with the scenario's values from a physics step on."""
    model = copy.copy(base)
    put_values(model, base, scenario, step)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def put_values(
    model: mujoco.MjModel, base: mujoco.MjModel, scenario: Scenario, step: int
) -> dict[str, np.ndarray]:
    """Write a scenario's field values into a copy of the base model, and return them.

    The caller calls mj_setConst.
    """
    values = field_values(base, scenario, step)
    for name, value in values.items():
        field_array(model, name)[:] = value
    return values


def field_values(base: mujoco.MjModel, scenario: Scenario, step: int) -> dict[str, np.ndarray]:
    """Return model field -> its values from a physics step on, for every field that the scenario
    sets.
    """
    plant = scenario.plant
    written = {}
    fields = plant.fields
    if scenario.mechanism != "equation":
        fields = plant.mechanisms[scenario.mechanism].fields
    of_plant = fields(base, plant.values(scenario.factors(step)))
    of_parts = (part.fields(base) for part in parts(scenario.machine(step)))
    for name, index, value, adds in itertools.chain(of_plant, *of_parts):
        values = written.setdefault(name, field_array(base, name).copy())
        if adds:
            values[index] = values[index] + value
        else:
            values[index] = value
    return written


def initial_state(model: mujoco.MjModel, scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Return qpos and qvel at t = 0, see `started`."""
    start = scenario.resolved.x0, scenario.resolved.v0
    return started(model, moving_joints(model), scenario, *start)


def started(
    model: mujoco.MjModel,
    joints: np.ndarray,
    scenario: Scenario,
    x: Floats | np.ndarray,
    v: Floats | np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return qpos and qvel at the start of a run from x and v, see `state_with`, with rotors where
    their parts put them.
    """
    qpos, qvel = state_with(model, joints, x, v)
    for part in scenario.actuator:
        part.place(model, qpos, qvel)
    return qpos, qvel


def initial_activations(model: mujoco.MjModel, scenario: Scenario) -> np.ndarray:
    """Return the activations of the actuators at t = 0, (na,)."""
    act = np.zeros(model.na)
    if scenario.plant.pose and model.nkey:  # thrust behind a lag
        act[:] = model.key_act[0]
    for part in scenario.actuator:
        part.begin(model, act)
    return act


def put_initial_state(model: mujoco.MjModel, data: mujoco.MjData, scenario: Scenario) -> None:
    """Write a scenario's state at t = 0 into the data of its model, with the past readings of
    delayed sensors.
    """
    data.qpos[:], data.qvel[:] = initial_state(model, scenario)
    data.act[:] = initial_activations(model, scenario)
    if scenario.readings:
        remember(model, data)


def check_start(shared: Mechanism, scenario: Scenario) -> None:
    """Raise ScenarioError if a scenario starts inside an obstacle, or beyond a stop that it could
    not pass.

    A check of many pendulums takes 40 ms, and most runs of a grid share their starts, so free ones
    are remembered.
    """
    factors = frozen(scenario.factors(0))
    inputs = scenario.plant, scenario.contact, scenario.resolved.x0, factors
    if not scenario.contact or inputs in shared.free_starts:
        return
    model = copy.copy(shared.model)
    put_values(model, shared.model, scenario, 0)
    check_path(model, scenario)
    shared.free_starts.add(inputs)


def check_path(model: mujoco.MjModel, scenario: Scenario) -> None:
    """Check that the path from the plant's default start, or from 0 if that is not free, crosses no
    obstacle.
    """
    data = mujoco.MjData(model)
    qpos = initial_state(model, scenario)[0]
    inside = _overlap(model, data, qpos)
    beyond = None
    # an arm: the straight line in its joints may cross what the arm goes around
    moves_around = scenario.plant.tip
    if not inside and scenario.resolved.x0 != scenario.plant.x0 and not moves_around:
        # no scenario is made, because it would refuse a default start beyond a stop
        v0 = scenario.resolved.v0
        state = state_with(model, moving_joints(model), scenario.plant.x0, v0)
        free = state[0]
        if _overlap(model, data, free):
            free = model.qpos0
        for part in np.linspace(0, 1, PATH_POINTS):
            beyond = beyond or _overlap(model, data, (1 - part) * free + part * qpos)
    if overlap := inside or beyond:
        raise ScenarioError(
            f"at x0 {shown(scenario.resolved.x0)} of {scenario.plant.name} {overlap[0]} is "
            f"{'inside' if inside else 'beyond'} {overlap[1]} of contact "
            f"{joined(map(str, scenario.contact))}: give another x0"
        )


def _overlap(
    model: mujoco.MjModel, data: mujoco.MjData, qpos: np.ndarray
) -> tuple[str, str] | None:
    """Return the names of two geoms that a contact part lets hit each other, if they overlap at
    qpos by more than MAX_OVERLAP, or None. What else of a user's model overlaps is its own matter.
    """
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    paired = contact_pairs(model)
    for contact in data.contact:
        if contact.dist < -MAX_OVERLAP and frozenset(contact.geom.tolist()) in paired:
            first, second = (_shown_geom(model, geom) for geom in contact.geom.tolist())
            return (second, first) if first == OBSTACLE else (first, second)
    return None


def _shown_geom(model: mujoco.MjModel, geom: int) -> str:
    """Return the name of a geom in a sentence; of one that this package named, that of its body."""
    name = model.geom(geom).name
    body = model.body(model.geom_bodyid[geom]).name
    if body.startswith(OWN):
        return OBSTACLE
    return f"body {body!r}" if name.startswith(OWN) else repr(name)
