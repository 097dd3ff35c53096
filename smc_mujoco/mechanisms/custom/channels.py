"""Channels of a user's model: the joints that the user names, checked against the model, and the
motors on them.

A motor of gear 1 replaces the actuator that drives a channel's joint.
"""

import dataclasses
import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Floats, Names, Numbers, Pair
from smc_mujoco.common.constraints import Boolean, Bound, Number, constrain
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import (
    ScenarioError,
    ScenarioWarning,
    find,
    items_of,
    one_line,
    shown,
    users_stacklevel,
)
from smc_mujoco.mechanisms.custom.actuator_kinds import filters, gear_of, no_motor
from smc_mujoco.mechanisms.custom.kept_actuators import (
    delay_of,
    filter_of,
    forcerange_of,
    kept,
    not_kept,
    of_command,
    of_motor,
)
from smc_mujoco.mechanisms.custom.mjcf import pick
from smc_mujoco.mechanisms.custom.pulled import pulled_by
from smc_mujoco.mechanisms.hardware.part import Actuator
from smc_mujoco.mechanisms.hardware.position_servo import PositionServo
from smc_mujoco.mechanisms.layout import BASE, PASSIVE, PLACES, POSE, unit_wrenches
from smc_mujoco.mechanisms.plant import MAX_EXCESS, Range
from smc_mujoco.mechanisms.rotation import rotation_vector

FREE = mujoco.mjtJoint.mjJNT_FREE
UNIT_OF_JOINT = {mujoco.mjtJoint.mjJNT_HINGE: "rad", mujoco.mjtJoint.mjJNT_SLIDE: "m"}

Place = Annotated[float, Number(low=-1e6, high=1e6)]  # rad or m
SUGGESTED = ("law", "u_max", "reference")  # fields of a Channel that are defaults of scenarios
Step = Annotated[float, Number(low=0.0, high=1e6)]  # rad or m
# transmissions to one joint
ONE_JOINT = (mujoco.mjtTrn.mjTRN_JOINT.value, mujoco.mjtTrn.mjTRN_JOINTINPARENT.value)
FIXED = mujoco.mjtGain.mjGAIN_FIXED.value
NO_BIAS = mujoco.mjtBias.mjBIAS_NONE.value
NO_DYNAMICS = mujoco.mjtDyn.mjDYN_NONE.value
FLIES = (
    4  # independent forces and torques that hold a heading: a thrust, and a torque about each axis
)
MAX_JOINTS = 600  # characters of the joints to choose from: chosen
HOLD = "hold:"  # prefix of names of motors that hold other joints, see others.py
MOTOR_GROUP = 31  # actuator group of motors, which actuatorgroupdisable cannot turn off


@keyword_dataclass
class Channel:
    """How a joint of a user's model is driven.

    Attributes:
      motor: whether to replace the joint's actuators, if it has any, by an ideal motor. It keeps
        their forcerange, a motor's ctrlrange, and the joint's actuatorfrcrange. Without it, the
        joint needs exactly one actuator, which stays as it is, or motors of tendons, over which u
        is shared. In a file without actuators, such as a URDF, a joint whose force is bounded gets
        an ideal motor.
      servo: what the joint's actuator has to be. True: a `<position>` or a `<pid>`, whose
        set-point u is, rad (m) from the joint's default goal, with its gains, gear, timeconst,
        forcerange and ctrlrange, and without a nominal model; or a `<dcmotor>`, whose voltage u is,
        V. False: a motor, whose force u is, N m (N). None: any of these, and a warning if u is no
        force. Each keeps its delay.
      set_point_step: the servo rounds its set-point to multiples of this, rad (m); 0: it does not.
      partner: a joint without an actuator that moves with this one, such as a pole on its cart. It
        is measured and scored as a separate channel, after the driven ones. The law of this channel
        reads it in y.q, y.dq, y.fq and y.gq. If it has an actuator, a motor stays at 0, and a servo
        holds its start.
      x0, partner_x0: initial positions of the joint and of its partner, rad or m; None: those of
        the keyframe, or of the model.
      law, u_max, reference: defaults for this channel, of scenarios that leave them out; values as
        in a Scenario. If one channel has a law here, all need one. None: the default bound, and
        rest at 0.
    """

    motor: Boolean = False
    servo: Boolean | None = None
    set_point_step: Step = 0.0
    partner: str | None = None
    x0: Place | None = None
    partner_x0: Place | None = None
    law: Any = None
    u_max: Bound | None = None
    reference: Any = None

    def __post_init__(self) -> None:
        constrain(self)
        if self.servo and self.motor:
            raise ScenarioError(
                "a Channel has motor=True and servo=True: give motor to replace the file's servo, "
                "or servo to command it"
            )
        if self.set_point_step and (self.motor or self.servo is False):
            raise ScenarioError(
                f"a Channel has set_point_step={self.set_point_step:g} but no servo: give "
                "servo=True, without motor"
            )


Pairs = tuple[tuple[str, Channel], ...]  # each a joint and its Channel
UNNAMED: Pairs = (("", Channel()),)  # of a user who names no joint


def coerce(channels: object) -> Pairs:
    """Coerce a user's channels to pairs of joint and Channel."""
    if isinstance(channels, str | set | frozenset) or not isinstance(
        channels, Iterable
    ):  # sets have no order
        raise ScenarioError(
            f"channels is {shown(channels)}: give joints' names, such as ['elbow', 'wrist']"
        )
    if isinstance(channels, Mapping):
        pairs = list(channels.items())
    else:
        pairs = [(joint, None) for joint in items_of("channels", channels)]
    if not pairs:
        raise ScenarioError("channels is empty: give at least one joint's name")
    return tuple((joint, channel(joint, value)) for joint, value in pairs)


def as_text(joint: str, channel: Channel) -> str:
    """Return a channel as on the command line, such as "lift(motor,x0=0.2)"."""
    options = []
    for field in dataclasses.fields(channel):
        value = getattr(channel, field.name)
        if field.name in SUGGESTED or value in (None, False, field.default):
            continue
        if value is True:
            options.append(field.name)
        else:
            text = value if isinstance(value, str) else format(value, "g")
            options.append(f"{field.name}={text}")
    if options:
        return f"{joint}({','.join(options)})"
    return joint


def joints_of(channels: Pairs) -> list[str]:
    """Return the names of the driven joints, then those of their partners."""
    joints = []
    partners = []
    for joint, channel in channels:
        joints.append(joint)
        if channel.partner is not None:
            partners.append(channel.partner)
    return joints + partners


def channel(joint: object, value: object) -> Channel:
    """Coerce a Channel, a dict of its fields, or None to a Channel."""
    if isinstance(value, Mapping):
        fields = {field.name: None for field in dataclasses.fields(Channel)}
        for key in value:
            find("field of a Channel", key, fields)
    coerced = value
    if value is None:
        coerced = Channel()
    elif isinstance(value, Mapping):
        coerced = Channel(**value)
    if not isinstance(coerced, Channel):
        raise ScenarioError(
            f"channel {shown(joint)} is {shown(value)}: give smc.Channel(...) or None"
        )
    if coerced.partner is None and coerced.partner_x0 is not None:
        raise ScenarioError(
            f"channel {joint!r} has a partner_x0 and no partner: give smc.Channel(partner=...) too"
        )
    return coerced


def suggested(channels: Pairs) -> dict[str, tuple]:
    """Return field -> what each channel suggests to scenarios, None for nothing; without fields
    that none suggests.
    """
    bare = []
    for joint, channel in channels:
        if channel.law is None:
            bare.append(joint)
    if 0 < len(bare) < len(channels):
        raise ScenarioError(
            f"channel {bare[0]!r} has no law and others have: give each one, or none"
        )
    fields = {}
    for name in SUGGESTED:
        values = tuple(getattr(channel, name) for _, channel in channels)
        if values.count(None) < len(values):
            fields[name] = values
    return fields


def _joint_names(model: mujoco.MjModel) -> list[str]:
    """Return the names of all joints, by id."""
    return [model.joint(i).name for i in range(model.njnt)]


def _unnamed(label: str, file: str, model: mujoco.MjModel, named: list[str]) -> ScenarioError:
    """Return the error for a user who names no joint, with those that can be named."""
    driven = [name for name in named if _on_joint(model, model.joint(name).id)]
    first = (driven or named)[0]
    of_file = f"{file}:{first} or " if file else ""
    those = "its actuators drive" if driven else "it has"
    return ScenarioError(
        f"no joint of {label} is chosen: give one or more, as {of_file}channels={[first]}; {those} "
        f"{one_line(', '.join(driven or named), MAX_JOINTS)}"
    )


def check_joints(label: str, file: str, model: mujoco.MjModel, channels: Pairs) -> None:
    """Raise ScenarioError for joints that do not exist or cannot be channels, and for flags that
    forbid control. `file` is the model's as a user here writes it, "" for a text.
    """
    joints = joints_of(channels)
    names = _joint_names(model)
    named = list(filter(None, names))
    if joints == [""] and named:
        raise _unnamed(label, file, model, named)
    for joint in joints:
        place = pick(label, "joint", joint, names)
        kind = mujoco.mjtJoint(model.jnt_type[place])
        if kind == FREE and len(channels) == 1 and dict(channels)[joint] == Channel():
            continue
        if kind == FREE:
            raise ScenarioError(
                f"joint {joint!r} of {label} is a free joint: leave it out, or name it in "
                "measured=['base'] so that laws read it, or give it as the only channel, without "
                "fields of a Channel"
            )
        if kind not in UNIT_OF_JOINT:
            raise ScenarioError(
                f"joint {joint!r} of {label} is a {kind.name[6:].lower()} joint: "
                "give one that is a hinge or slide"
            )
        if joints.count(joint) > 1:
            raise ScenarioError(f"joint {joint!r} is two channels or partners: name it once")
    if len(channels) < len(joints) < 2 * len(channels):
        bare = next(joint for joint, channel in channels if channel.partner is None)
        raise ScenarioError(
            f"channel {bare!r} has no partner and others have: give each one, or none"
        )
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_ACTUATION.value:
        raise ScenarioError(
            f'{label} has <flag actuation="disable"/>, so that nothing drives it: take it out'
        )


def measured_joints(
    label: str, model: mujoco.MjModel, channels: Pairs, measured: Iterable[str]
) -> Names:
    """Return the names of the joints that are measured beside the channels; "base" is the model's
    only free joint.
    """
    measured_names = items_of("measured", measured)
    if not all(isinstance(name, str) for name in measured_names):
        raise ScenarioError(
            f"measured is {shown(measured_names)}: give joints' names, such as ['pole', 'base']"
        )
    names = _joint_names(model)
    places = np.flatnonzero(model.jnt_type == FREE)
    free = [names[i] for i in places]
    taken = joints_of(channels)
    joints = []
    for name in measured_names:
        joint = name
        if name == "base" and name not in names and len(free) == 1:
            joint = free[0]
        place = pick(label, "joint", joint, names)
        kind = mujoco.mjtJoint(model.jnt_type[place])
        if kind not in UNIT_OF_JOINT and kind != FREE:
            raise ScenarioError(
                f"measured joint {joint!r} of {label} is a {kind.name[6:].lower()} joint: give one "
                "that is a hinge, a slide or a free joint"
            )
        bases = set(joints).intersection(free)
        if joint in (*taken, *joints) or (kind == FREE and bases):
            raise ScenarioError(
                f"measured joint {joint!r} of {label} is measured already, or a second base: "
                "name each joint once, and one base"
            )
        joints.append(joint)
    if joints and is_free(model, taken[0]):
        raise ScenarioError(
            f"joint {taken[0]!r} of {label} is a free joint, the only channel: leave measured out"
        )
    return tuple(joints)


def joint_starts(
    model: mujoco.MjModel, joints: list[str], channels: Pairs, keyframe: str | None
) -> tuple[dict[str, float], list[Range]]:
    """Return joint -> x0, rad or m, and the ranges of those joints whose x0 the user chose.

    x0 is that of the channel, else the goal.
    """
    chosen = {}
    for joint, channel in channels:
        if channel.x0 is not None:
            chosen[joint] = channel.x0
    for _, channel in channels:
        if channel.partner is not None and channel.partner_x0 is not None:
            chosen[channel.partner] = channel.partner_x0
    at_goal = goals(model, joints, keyframe)[0]
    x0 = dict(zip(joints, at_goal, strict=True)) | chosen
    checked = []
    for row in ranges(model, joints):
        if keyframe is not None or row[0] in chosen:
            checked.append(row)
    return x0, checked


def places(
    model: mujoco.MjModel, joints: Sequence[str], start: Numbers, keyframe: str | None
) -> tuple[list[str], Names, Floats]:
    """Return the joint of each channel, its unit and its x0; `start` has x0 of hinges and slides.

    A free joint has six channels.
    """
    names = []
    units = ()
    x0 = ()
    for joint in joints:
        if joint in start:
            names.append(joint)
            kind = mujoco.mjtJoint(model.joint(joint).type[0])
            units += (UNIT_OF_JOINT[kind],)
            x0 += (start[joint],)
        else:
            names += [joint] * len(PLACES)
            units += ("m",) * 3 + ("rad",) * 3
            x0 += pose_at_start(model, joint, keyframe)
    return names, units, x0


def ranges(model: mujoco.MjModel, joints: Sequence[str]) -> tuple[Range, ...]:
    """Return joint, least and largest position of each channel, rad or m; empty where none has
    limits.
    """
    rows = []
    for joint in map(model.joint, joints):
        if joint.limited[0]:
            low, high = joint.range
        else:
            low = -math.inf
            high = math.inf
        rows.append((joint.name, float(low), float(high)))
    flags = mujoco.mjtDisableBit
    limits_and_constraints = flags.mjDSBL_LIMIT.value | flags.mjDSBL_CONSTRAINT.value
    off = model.opt.disableflags & limits_and_constraints
    if off or not any(math.isfinite(low) for _, low, _ in rows):
        return ()
    return tuple(rows)


def is_free(model: mujoco.MjModel, joint: str) -> bool:
    """Return whether a joint is a free one."""
    return model.joint(joint).type[0] == FREE


def thrusters(model: mujoco.MjModel, joint: str) -> list[int]:
    """Return the actuators that act at a site of what a free joint moves."""
    root = model.body_rootid[model.joint(joint).bodyid[0]]
    at_site = model.actuator_trntype == mujoco.mjtTrn.mjTRN_SITE
    drives = []
    for i in np.flatnonzero(at_site).tolist():
        site = int(model.actuator_trnid[i, 0])
        if model.body_rootid[model.site_bodyid[site]] == root:
            drives.append(i)
    return drives


def reach_of(label: str, model: mujoco.MjModel, joint: str) -> Floats:
    """Return the largest force in any direction, three times, N, and the largest torque about each
    axis, N m.
    """
    drives = thrusters(model, joint)
    if not 0 < len(drives) <= len(PLACES):
        raise ScenarioError(
            f"joint {joint!r} of {label} is a free joint, and {len(drives)} actuators act at sites "
            "of its body: give it one to six, or give hinges and slides as channels instead"
        )
    plain = (NO_DYNAMICS, mujoco.mjtDyn.mjDYN_FILTER.value, mujoco.mjtDyn.mjDYN_FILTEREXACT.value)
    for i in drives:
        name = model.actuator(i).name or f"number {i}"
        is_force = model.actuator_dyntype[i] in plain and model.actuator_trnid[i, 1] < 0
        is_force = is_force and not model.actuator_delay[i]
        if (
            not is_force
            or model.actuator_gaintype[i] != FIXED
            or model.actuator_biastype[i] != NO_BIAS
        ):
            raise ScenarioError(
                f"actuator {name!r} of {label} is more than a force behind a lag: "
                "make it a <motor> without a refsite and without a delay"
            )
    largest = np.array([np.abs(of_command(model, i)).max() for i in drives])
    forces = unit_wrenches(model, model.joint(joint).id, drives)
    pushes = forces[:, :3]
    together = np.linalg.norm(pushes, axis=1)
    alone = np.abs(forces[:, 3:])
    sizes = np.array([together, *alone.T]).T
    reached = []
    for column in sizes.T:
        used = column > 0.0
        force = np.sum(largest[used] * column[used])
        reached.append(float(force))
    return (reached[0],) * 3 + tuple(reached[1:])


def held_pose(label: str, model: mujoco.MjModel, joint: str) -> Literal["all", "heading"]:
    """Return what of its pose a free body can hold, as a Plant has it; warn if that is less than
    its heading.
    """
    drives = thrusters(model, joint)
    forces = unit_wrenches(model, model.joint(joint).id, drives)
    least = 1e-9 * np.abs(forces).max()
    rank = np.linalg.matrix_rank(forces, tol=least)
    if rank < FLIES:
        text = (
            f"the actuators of {label} give {rank} independent forces and torques, "
            f"and {FLIES} are to hold a heading"
        )
        warnings.warn(
            f"{text}: give them other places, or gears of other signs",
            ScenarioWarning,
            users_stacklevel(),
        )
    return "all" if rank == len(PLACES) else "heading"


def pose_at_start(model: mujoco.MjModel, joint: str, keyframe: str | None) -> Floats:
    """Return position, m, and rotation vector, rad, of a free body in the model or its keyframe,
    (6,).
    """
    if keyframe is None:
        qpos = model.qpos0
    else:
        qpos = model.key_qpos[model.key(keyframe).id]
    first = model.joint(joint).qposadr[0]
    place = qpos[first:][:7].tolist()
    return *place[:3], *rotation_vector(*place[3:])


def add_pose(spec: mujoco.MjSpec, joint: str, drives: Sequence[int]) -> None:
    """Add a free body's sensors, and keep the actuators that are not among its drives as passive
    parts.
    """
    add_pose_sensors(spec, joint, POSE)
    for i, actuator in enumerate(list(spec.actuators)):
        if i not in drives:
            actuator.name = f"{PASSIVE}smc:{i}"


def add_pose_sensors(spec: mujoco.MjSpec, joint: str, name: str) -> None:
    """Add a site of this name to the body of a free joint, and sensors of its pose and rates."""
    body = spec.joint(joint).parent
    site = body.add_site(name=name, size=(1e-6,) * 3, group=5)
    site.pos = (0.0, 0.0, 0.0)
    site.quat = (1.0, 0.0, 0.0, 0.0)
    kinds = mujoco.mjtSensor
    for end, kind in (
        (":x", kinds.mjSENS_FRAMEPOS),
        (":q", kinds.mjSENS_FRAMEQUAT),
        (":v", kinds.mjSENS_FRAMELINVEL),
        (":w", kinds.mjSENS_GYRO),
    ):
        spec.add_sensor(name=name + end, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=name)


def add_joint_sensors(spec: mujoco.MjSpec, joint: str) -> None:
    """Add the sensors of a joint's position and velocity; of a free joint, of its body's pose."""
    if spec.joint(joint).type == FREE:
        return add_pose_sensors(spec, joint, BASE)
    on_joint = {"objtype": mujoco.mjtObj.mjOBJ_JOINT, "objname": joint}
    spec.add_sensor(name=f"x:{joint}", type=mujoco.mjtSensor.mjSENS_JOINTPOS, **on_joint)
    spec.add_sensor(name=f"v:{joint}", type=mujoco.mjtSensor.mjSENS_JOINTVEL, **on_joint)
    return None


class Motor(NamedTuple):
    """The motor of a channel."""

    joint: str
    limit: float  # bound on its force, N m or N
    replaced: tuple[int, ...]  # indices of the actuators that it replaces
    # of the file, as they are: its delay, and what takes another command than a force
    of_file: tuple[Actuator, ...] = ()


def motor_of(
    label: str, model: mujoco.MjModel, joint: str, channel: Channel, goal: float, ideal: str
) -> Motor:
    """Return the motor that drives a joint, whose default goal is given. `ideal` is the plant's
    text with an ideal motor there.
    """
    joint_id = model.joint(joint).id
    bounds = []
    stays = False
    if model.jnt_actfrclimited[joint_id]:
        bounds.append(tuple(map(float, model.jnt_actfrcrange[joint_id])))
    actuators = _on_joint(model, joint_id)
    _limit(f"joint {joint!r} of {label} takes", "widen its actuatorfrcrange", *bounds)
    names = ", ".join(model.actuator(i).name or f"number {i}" for i in actuators)
    cure = f'give "{ideal}", or smc.Channel(motor=True), for one ideal motor instead'
    if channel.motor:
        bounds.append(_together(model, actuators))
    elif not actuators:
        if not bounds or _has_actuators(model):
            raise ScenarioError(
                f"no actuator of {label} drives joint {joint!r} alone: {cure}; without a u_max its "
                "bound is what the joint's load and travel need"
            )
    elif len(actuators) > 1:
        raise ScenarioError(f"joint {joint!r} of {label} has the actuators {names}: {cure}")
    elif channel.servo or (channel.servo is None and no_motor(model, actuators[0])):
        _check_kept(model, actuators[0], joint, channel, cure)
        bounds.append(forcerange_of(model, actuators[0]))
        stays = True
    elif why := no_motor(model, actuators[0]):
        raise ScenarioError(
            f"actuator {names!r} of joint {joint!r} {why}, but servo=False is for a force: leave "
            f"servo out, or {cure}"
        )
    else:
        bounds.append(of_motor(model, actuators[0]))
    gives = f"actuator {names!r} gives joint {joint!r} of {label}"
    limit = _limit(gives, cure, *bounds)
    parts = ()
    if actuators and not channel.motor:
        parts = delay_of(model, actuators[0])
        if not stays:
            parts += filter_of(model, actuators[0])
    if stays:
        parts += (kept(model, actuators[0], goal, channel.set_point_step),)
    if channel.set_point_step and not any(isinstance(part, PositionServo) for part in parts):
        raise ScenarioError(
            f"the drive of joint {joint!r} of {label} has no set-point: leave set_point_step out"
        )
    return Motor(joint, limit, tuple(actuators), parts)


def _check_kept(model: mujoco.MjModel, i: int, joint: str, channel: Channel, cure: str) -> None:
    """Raise ScenarioError for an actuator that cannot stay as it is."""
    if why := not_kept(model, i):
        name = model.actuator(i).name or f"number {i}"
        if not no_motor(model, i):
            raise ScenarioError(
                f"actuator {name!r} of joint {joint!r} {why}, but servo=True is for a <position>, "
                "a <pid> or a <dcmotor>: leave servo out"
            )
        raise ScenarioError(
            f"actuator {name!r} of joint {joint!r} {why}, and only a <motor>, a <position>, a "
            f"<pid> or a plain <dcmotor> can be used as it is: {cure}"
        )


def bound_of_kept(label: str, model: mujoco.MjModel, joint: str, part: Actuator) -> float:
    """Return the default bound on |u| of an actuator that stays as it is: its ctrlrange, of a
    set-point about the goal; without one, the joint's range.
    """
    if part.bound is not None and part.bound < math.inf:
        return part.bound
    cure = f"give {joint}(u_max=3), or smc.Channel(u_max=3), with your bound"
    if not isinstance(part, PositionServo):
        raise ScenarioError(
            f"the <dcmotor> of joint {joint!r} of {label} has no ctrlrange: {cure} in V"
        )
    for _, low, high in ranges(model, [joint]):
        return max(high - part.goal, part.goal - low)
    raise ScenarioError(
        f"the servo of joint {joint!r} of {label} has no ctrlrange, and the joint has no range: "
        f"{cure} on the distance of the set-point from the goal"
    )


def _on_joint(model: mujoco.MjModel, joint_id: int) -> list[int]:
    """Return the actuators that act on this joint alone."""
    acting = []
    for i in range(model.nactuator):
        if model.actuator_trntype[i] in ONE_JOINT and model.actuator_trnid[i, 0] == joint_id:
            acting.append(i)
    return acting


def by_tendons(model: mujoco.MjModel, channels: Pairs) -> list[str]:
    """Return the driven joints that tendons drive: nothing drives them alone, and the user asks for
    no other motor.
    """
    joints = []
    for joint, channel in channels:
        alone = _on_joint(model, model.joint(joint).id)
        if not (channel.motor or channel.servo or alone) and pulled_by(model, joint):
            joints.append(joint)
    return joints


def _has_actuators(model: mujoco.MjModel) -> bool:
    """Return whether the file has actuators."""
    return any(not model.actuator(i).name.startswith(HOLD) for i in range(model.nactuator))


def _limit(who: str, cure: str, *ranges: Floats) -> float:
    """Return the largest force that all ranges allow in both directions, N m or N, because |u| has
    one bound.
    """
    low = -math.inf
    high = math.inf
    for lowest, highest in ranges:
        low = max(low, lowest)
        high = min(high, highest)
    if not low < 0.0 < high:
        raise ScenarioError(f"{who} {low:g} to {high:g}, but a law pushes both ways: {cure}")
    return min(-low, high)


def _together(model: mujoco.MjModel, actuators: Sequence[int]) -> Pair:
    """Return the least and the largest force that a joint's actuators allow together by their
    forceranges, and motors by their ctrlranges, N m or N.

    They give no bound if one has none, or if they push only one way: the ideal motor pushes both
    ways.
    """
    low = 0.0
    high = 0.0
    for i in actuators:
        ends = -math.inf, math.inf
        if not no_motor(model, i) and not filters(model, i):
            ends = of_motor(model, i)
        elif model.actuator_forcelimited[i]:
            of_gear = gear_of(model, i) * model.actuator_forcerange[i]
            ends = sorted(of_gear)
        low += float(ends[0])
        high += float(ends[1])
    if low < 0.0 < high:
        return low, high
    return -math.inf, math.inf


def add_motors(spec: mujoco.MjSpec, motors: Sequence[Motor]) -> None:
    """Add the channels' motors, in this order, and keep the model's other actuators as passive
    parts.
    """
    replaced = set()
    for motor in motors:
        replaced.update(motor.replaced)
    for i, actuator in enumerate(list(spec.actuators)):
        if i in replaced:
            spec.delete(actuator)
        else:
            actuator.name = f"{PASSIVE}smc:{i}"  # no joint has this name
    for motor in motors:  # named after joints: names of actuators may be missing
        actuator_added = add_motor(spec, f"u:{motor.joint}", motor.joint)
        limit = motor.limit if math.isfinite(motor.limit) else 0.0
        actuator_added.forcelimited = limit > 0.0
        actuator_added.forcerange = (-limit, limit)


def add_motor(spec: mujoco.MjSpec, name: str, joint: str) -> mujoco.MjsActuator:
    """Add a motor of gear 1 without bounds to a joint, whatever the model's defaults are."""
    motor = spec.add_actuator(name=name, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    motor.set_to_motor()
    motor.gear = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    motor.ctrllimited = False
    motor.forcelimited = False
    motor.ctrlrange = (0.0, 0.0)
    motor.forcerange = (0.0, 0.0)
    motor.armature = 0.0
    motor.damping = (0.0, 0.0, 0.0)
    motor.delay = 0.0
    motor.nsample = 0
    motor.group = MOTOR_GROUP
    return motor


def goals(
    model: mujoco.MjModel, joints: Sequence[str], keyframe: str | None
) -> tuple[Floats, list[str]]:
    """Return where the joints end by default, rad or m: in the keyframe, else as the model is
    drawn, else in the middle of the range, and the joints of which that is so.
    """
    if keyframe is None:
        qpos = model.qpos0
    else:
        qpos = model.key_qpos[model.key(keyframe).id]
    rest = {joint: float(qpos[model.joint(joint).qposadr[0]]) for joint in joints}
    outside = []
    for joint, low, high in ranges(model, joints):
        if keyframe is None and not low - MAX_EXCESS <= rest[joint] <= high + MAX_EXCESS:
            rest[joint] = 0.5 * (low + high)
            outside.append(joint)
    return tuple(rest.values()), outside
