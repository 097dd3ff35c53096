"""A plant from any MJCF: the user names the joints that are its channels, and the model supplies
the rest.

    arm = smc.plant_from("arm.xml", channels=["shoulder", "elbow"])
    law = smc.law("computed_torque", kp=100.0, kd=20.0)
    trace = smc.run(smc.Scenario(plant=arm, law=law, model="nominal"))

A channel's command u is the force on its joint, N m or N. Its motor gets gear 1. |u| is bounded by
the scenario's u_max and by what the motor's ranges and the joint's actuatorfrcrange allow in both
directions; a law reads the bound in y.limit. The model's sensors are replaced by a position and a
velocity sensor per channel. Joints without a channel move as the model says, with servos that hold
the start, or as `others` says. A channel's default goal is its place in the keyframe or the model.
Integrator, step and initial state are the scenario's. Disturbances act on the joints themselves.
Dry friction of the file's joints and tendons is as hard as `Coulomb`, unless the file gives its
solreffriction. The parameters are m in kg, the mass of all that moves, which scales all masses and
inertias, and grav in m/s^2.
"""

import base64
import dataclasses
import math
import os
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import mujoco
import numpy as np

from smc_mujoco.common import errors, mjcb
from smc_mujoco.common.aliases import Fields, Names
from smc_mujoco.common.constraints import OneOf, constrained
from smc_mujoco.common.errors import (
    ScenarioError,
    ScenarioWarning,
    items_of,
    shown,
    users_stacklevel,
)
from smc_mujoco.common.process import return_freed_memory
from smc_mujoco.common.text import joined
from smc_mujoco.mechanisms.custom import channels as own
from smc_mujoco.mechanisms.custom import mjcf, urdf
from smc_mujoco.mechanisms.custom.channels import Channel, Motor, Pairs, is_free, joints_of
from smc_mujoco.mechanisms.custom.clearance import DEPTH, TOUCH, Overlap, overlap
from smc_mujoco.mechanisms.custom.mjcf import ModelSource
from smc_mujoco.mechanisms.custom.model_constraints import (
    default_friction,
    smooth,
    softness_warnings,
    touches,
)
from smc_mujoco.mechanisms.custom.nominal_model import NominalModel
from smc_mujoco.mechanisms.custom.others import OTHERS, limp, ties
from smc_mujoco.mechanisms.custom.pulled import Pulled, may_push, name_of, pulled, pulled_by
from smc_mujoco.mechanisms.custom.scales import free_base, rises
from smc_mujoco.mechanisms.custom.user_model import UserFields, UserModel
from smc_mujoco.mechanisms.hardware.position_servo import PositionServo
from smc_mujoco.mechanisms.hardware.tendons import Tendons, of_plant
from smc_mujoco.mechanisms.layout import loaded
from smc_mujoco.mechanisms.plant import Plant, check_ranges, degrees_hint, plant_catalogue

if TYPE_CHECKING:
    from dm_control.mjcf import RootElement

WITHOUT_MODEL = "give model='none' and a law that reads no model"
SET_POINT = f"u is the set-point of a servo, and a nominal u is a force: {WITHOUT_MODEL}"
EMPTY_NAMES = "scene", "model", "robot"  # of files, or their first words: they say nothing
PARAMETER_UNITS = {"m": "kg", "grav": "m/s^2"}
UNNAMED_MODEL = "mujoco_model"  # MuJoCo's name of a model without one, as `_name` writes it
# dynamics of an actuator whose state changes even at ctrl = 0
UNMEASURED = {
    mujoco.mjtDyn.mjDYN_DCMOTOR.value: "a dcmotor has a current",
    mujoco.mjtDyn.mjDYN_PID.value: "a pid has an integral",
}


@constrained
def plant_from(
    path: "str | os.PathLike | mujoco.MjSpec | RootElement",
    channels: Mapping[str, Channel | Mapping | None] | Iterable[str] | None = None,
    name: str | None = None,
    keyframe: str | None = None,
    assets: Mapping[str, bytes | str] | None = None,
    tip: str | None = None,
    others: Annotated[str, OneOf(names=OTHERS)] | None = None,
    measured: Iterable[str] | None = None,
    pose: Mapping[str, float] | None = None,
) -> Plant:
    """Make a plant of an MJCF or URDF model.

        arm = smc.plant_from("arm.xml", {"elbow": smc.Channel(x0=0.3)})
        trace = smc.run(smc.Scenario(plant=arm, law=smc.law("pid", kp=20.0), duration=1.0))

    Args:
      path: of an MJCF or URDF file; or the model itself: its text, an MjSpec as it is now, or a
        mjcf.RootElement of dm_control.
      channels: joint -> Channel, a dict of its fields, or None for the defaults; or a list of
        joints' names. The plant's channels have the same order. A free joint without a name has
        that of its body. Left out, the error names the joints that the file has.
      name: name of the plant, in tables and pictures; default: the file's. Pictures write it as the
        model does where that is the same name.
      keyframe: name of the model's keyframe with the initial positions, which is the default goal;
        default: the model's qpos0. Runs start at rest, unless the scenario has a v0, and those of
        `grid`, `tune`, `compare` and `which` beside the goal, see `starts`.
      pose: joint -> its position, rad or m, in place of a keyframe, which a URDF has not; joints
        that are not in it stand as the model draws them.
      assets: name -> content of the files that a text names, bytes or text.
      tip: name of the site that films trace and `smc.metrics.tip_scores` scores; laws of many
        joints may read its Jacobian.
      others: what other joints do. "file": as the model says; servos hold the start, or the
        keyframe's ctrl. "held": a joint with a motor (in a URDF, with an effort) is held there too,
        by a stiff PD. "locked": all are welded there, and equality constraints between them and
        the channels are left out. Default: "file".
      measured: names of further joints that are measured but not driven, in the order of their
        channels, which come last. Laws of many joints read them, and they count in scores. A free
        joint, or "base" for the model's only one, gives six channels, base_x to base_rz: position,
        rotation vector and their rates as of a free body. Its x and y count only in runs whose
        reference names a measured channel.

    Returns:
      A Plant, for `plant` of a Scenario and for every function that takes one.

    Raises:
      ScenarioError: a model that cannot be read; a number in it that is NaN, infinite or beyond
        1e15; an unknown or unsuitable joint, actuator or keyframe; or an x0 outside its joint's
        range.

    Warns:
      ScenarioWarning: a range in degrees that may be meant in rad; what u is where the file's
        actuator takes no force, and an ideal motor in a file without actuators; what is changed in
        a URDF; constraints that give way, or dry friction that creeps; parts that overlap by 1 to 5
        mm at the start or the goal of a fixed machine; a joint drawn outside its range; motors that
        nothing commands, without `others`; equality constraints that are left out.

    Dry friction of the file (frictionloss) is made as hard as `smc.Coulomb`, harder than MuJoCo's
    default, which creeps, unless the file gives its solreffriction.

    A scenario may have model="nominal" if every joint that moves with the channels is a channel or
    a partner, and no equality constraint acts; `plant.unmodelled` says why not. Films show the
    model in its own colours; those of several laws are mixed with the laws' colours.
    """
    source = mjcf.model_source(path, assets)
    if pose:
        if keyframe is not None:
            raise ScenarioError(f"keyframe is {keyframe!r} beside a pose: give one of them")
        source, keyframe = source.posed(pose), mjcf.POSE
    # laws and gains refer to plants by name
    if name is not None and plant_catalogue().taken(errors.name("name", name)):
        raise ScenarioError(f"name is {shown(name)}: give one that is none of smc.plants()")
    if channels is None:
        pairs: Pairs = own.UNNAMED  # refused with the joints that there are
    else:
        pairs = own.coerce(channels)
    measured = items_of("measured", () if measured is None else measured)
    model = mjcf.unedited_model(source)
    machine = _plant(source, pairs, name, keyframe, tip, others or "", measured)
    spec = source.spec()
    read = urdf.read_urdf(Path(source.path))
    doubts = [
        *_narrow_ranges(source.label, machine, spec),
        *_assumed_drives(source.label, machine, pairs),
        *(read.notes(source.label, spec) if read else ()),
        *softness_warnings(source.label, machine),
    ]
    if touches(model):
        doubts += _overlaps(source.label, machine, of_urdf=read is not None)
    _, outside = ((), []) if machine.pose else own.goals(model, joints_of(pairs), keyframe)
    for joint in outside:
        doubts.append(
            f"{source.label} draws joint {joint!r} outside its range, so that the default goal is "
            "the middle of it: give a keyframe or a reference for another one"
        )
    seen = [*joints_of(pairs), *measured]
    doubts += _doubts_of_others(source.label, spec, model, seen, others)
    doubts += _left_out_cables(source.label, model, pairs)
    if tendons := of_plant(machine):
        doubts += may_push(source.label, model, tendons.cables)
    for doubt in doubts:
        warnings.warn(doubt, ScenarioWarning, users_stacklevel())
    if mujoco.mj_sizeModel(model) > mjcb.LARGE:
        del model
        return_freed_memory()
    return machine


def _narrow_ranges(label: str, made: Plant, spec: mujoco.MjSpec) -> Iterator[str]:
    """Yield a sentence on each range in degrees that is as narrow as if it was meant in rad."""
    if not spec.compiler.degree:
        return
    for (joint, low, high), unit in zip(made.ranges, made.units, strict=False):
        if hint := degrees_hint((low, high), 0.5 * (low + high), unit):
            yield f"joint {joint!r} of {label} moves from {low:.3g} to {high:.3g} rad{hint}"


def _assumed_drives(label: str, machine: Plant, pairs: Pairs) -> Iterator[str]:
    """Yield a sentence on each drive that the file decides, and that is no motor of the file."""
    build: Any = machine.build
    meant = zip(pairs, build.channels, build.motors, machine.units, strict=False)
    for (joint, requested), (_, taken), motor, unit in meant:
        if taken.motor and not requested.motor:
            yield (
                f"{label} has no actuators, so joint {joint!r} gets an ideal motor, bounded as the "
                f"joint is: {joint}(motor), or smc.Channel(motor=True), says so without this line"
            )
        if taken.servo and requested.servo is None:
            meaning = motor.of_file[-1].meaning.format(x=unit)
            if late := motor.of_file[0].lateness:
                meaning += f", which it gets {1e3 * late:g} ms late"
            yield (
                f"u of {joint!r} of {label} is {meaning}, as in the file: "
                f"{joint}(servo), or smc.Channel(servo=True), says so without this line, and "
                f"{joint}(motor), or motor=True, puts an ideal motor there, whose u is a force"
            )


def _left_out_cables(label: str, model: mujoco.MjModel, pairs: Pairs) -> Iterator[str]:
    """Yield a sentence on each joint whose ideal motor stands for cables that pull at it."""
    for joint, channel in pairs:
        if channel.motor and (pulling := pulled_by(model, joint)):
            names = joined([repr(name_of(model, i)) for i in pulling])
            yield (
                f"the ideal motor of joint {joint!r} of {label} leaves out that {names} "
                "pull at it: it may push, and no tension is bounded, so its runs are of another "
                "machine"
            )


def _doubts_of_others(
    label: str, spec: mujoco.MjSpec, model: mujoco.MjModel, seen: list[str], others: str | None
) -> Iterator[str]:
    """Yield a sentence on what moves, or is left out, beside the joints that are `seen`."""
    if others is None and (names := limp(spec, seen)):
        yield (
            f"joints of {label} have motors that nothing commands, "
            f"{joined(map(repr, names))}: give others='held' (+held after the joints in a text), "
            "'locked', or 'file' if they should move freely"
        )
    if others == "locked" and np.any(ties(model, seen)[1]):
        yield (
            f"equality constraints of {label} tie its channels to what is locked, and are "
            "left out: give others='held' to keep them"
        )


def _overlaps(label: str, machine: Plant, of_urdf: bool) -> list[str]:
    """Return a sentence on a start inside something from which the robot rises, or on a start or a
    goal where something presses. Raise ScenarioError for one inside something from which the robot
    does not rise.
    """
    # the goal first: another x0 does not help there
    overlaps = {"goal": overlap(machine, machine.origin), "start": overlap(machine, machine.x0)}
    deep = [what for what, inside in overlaps.items() if inside.depth > DEPTH]
    if deep and all(rises(machine, x) for x in dict.fromkeys((machine.x0, machine.origin))):
        what = deep[-1]
        return [
            f"the {what} of {label} has {overlaps[what]}: it rises from there and stands, so its "
            "first moments are of that; give a keyframe that stands on the ground"
        ]
    if deep:
        what = deep[0]
        cure = _cure_of_overlap(what, overlaps[what], of_urdf)
        raise ScenarioError(f"the {what} of {label} has {overlaps[what]}: give {cure}")
    if free_base(loaded(machine)):  # on feet, which are soft
        return []
    for what, inside in overlaps.items():
        if inside.depth > TOUCH:
            first, second = map(repr, inside.geoms)
            cure = _cure_of_overlap(what, inside, of_urdf)
            return [
                f"at the {what} of {label}, {first} and {second} overlap by "
                f"{1e3 * inside.depth:.1f} mm, so contact pushes them apart: give {cure}, unless "
                "you want this"
            ]
    return []


def _cure_of_overlap(what: str, inside: Overlap, of_urdf: bool) -> str:
    """Return what to give so that nothing overlaps at the "start" or the "goal"."""
    if what == "start":
        return "another x0"
    if of_urdf:
        return "one of these links no <collision> in the file"
    first, second = (name or "GIVE-IT-A-NAME" for name in inside.bodies)
    return (
        "a keyframe in which they do not touch, or <exclude "
        f'body1="{first}" body2="{second}"/> in the <contact> of the file'
    )


def _plant(
    source: ModelSource,
    pairs: Pairs,
    name: str | None,
    keyframe: str | None,
    tip: str | None,
    others: str,
    measured: Iterable[str],
) -> Plant:
    """Return the plant of a model, see `plant_from`."""
    label = source.label
    title = source.spec().modelname
    model = mjcf.unedited_model(source)
    mjcf.check_model(label, model)
    scenarios = own.suggested(pairs)
    pairs = _without_suggestions(pairs)
    own.check_joints(label, source.file, model, pairs)
    seen = own.measured_joints(label, model, pairs, measured)
    joints = [*joints_of(pairs), *seen]
    _check_names(label, model, keyframe, tip)
    plant_name = _name(source, title) if name is None else name
    units, special = _places(plant_name, model, joints, pairs, keyframe)
    if tip and special.get("base", -1) >= 0:
        raise ScenarioError(f"the base of {label} is measured: leave the tip out")
    build = UserModel(source, keyframe, pairs, (), tip or "", others=others, measured=seen)
    goals = _goals(model, [joint for joint, _ in pairs if not is_free(model, joint)], keyframe)
    if others in ("held", "locked"):
        model = source.compiled(build.edited())
    build, limits = _with_drives(build, label, model, scenarios, goals)
    if is_free(model, joints[0]):
        special["pose"] = own.held_pose(label, model, joints[0])
    scenarios |= _kept(label, model, build.motors, scenarios)
    mass = float(model.body_mass[model.body_weldid != 0].sum())
    gravity = float(np.linalg.norm(model.opt.gravity))
    fields = UserFields(mass, gravity)
    why_not = _unmodelled(model, joints, build.motors)
    rubs = default_friction(model)
    return Plant(
        name=plant_name,
        parameters={"m": mass} | ({"grav": gravity} if gravity else {}),
        mass="m",
        unit=units[0],
        mixed=units if len(set(units)) > 1 else (),
        n=len(units),
        sizes=(len(units), len(units)),
        build=build,
        fields=fields,
        nominal=without_model if why_not else NominalModel(build, fields),
        underactuated=len(joints) - len(seen) > len(pairs),
        direct=True,
        smooth=smooth(model, rubs),
        rubs=rubs,
        unmodelled=why_not,
        limits=limits if any(limit < math.inf for limit in limits) else (),
        tip=tip or "",
        suggested=scenarios,
        # which pictures show: a name other than the tables' would be taken for another machine
        label=title if title.lower().replace(" ", "_") == plant_name.lower() else "",
        **special,
    )


def _without_suggestions(pairs: Pairs) -> Pairs:
    """Return channels without what they suggest to a scenario."""
    bare = []
    for joint, channel in pairs:
        bare_fields = dict.fromkeys(own.SUGGESTED)
        bare.append((joint, dataclasses.replace(channel, **bare_fields)))
    return tuple(bare)


def _with_drives(
    build: UserModel,
    label: str,
    model: mujoco.MjModel,
    suggested: Fields,
    goals: Mapping[str, float],
) -> tuple[UserModel, tuple[float, ...]]:
    """Return a builder with its thrusters or motors, and the bounds on their force, (driven,).
    `goals` are those of the driven joints.
    """
    first = build.channels[0][0]
    if is_free(model, first):
        if build.tip or suggested:
            cure = "leave the tip out"
            if not build.tip:
                cure = f"give {', '.join(suggested)} to the scenario"
            raise ScenarioError(f"joint {first!r} of {label} is a free joint: {cure}")
        thrusters = tuple(own.thrusters(model, first))
        reach = own.reach_of(label, model, first)
        return dataclasses.replace(build, thrusters=thrusters), reach
    motors = []
    channels = []
    by_tendons = own.by_tendons(model, build.channels)
    shared = Pulled()
    tendons = None
    if by_tendons:
        cure = f'give "{build.with_motor(by_tendons[0])}", with an ideal motor instead'
        shared = pulled(
            label, model, {joint: goals[joint] for joint in by_tendons}, build.keyframe, cure
        )
        driven = [i for i, (joint, _) in enumerate(build.channels) if joint in by_tendons]
        tendons = Tendons(shared.cables, tuple(driven))
    for joint, channel in build.channels:
        ideal = build.with_motor(joint)
        if joint in shared.limits:
            own_motor = Motor(joint, shared.limits[joint], shared.actuators)
        else:
            own_motor = own.motor_of(label, model, joint, channel, goals[joint], ideal)
        motors.append(own_motor)
        # what the file decided is stated from now on, also in texts and records
        motor = channel.motor or not own_motor.replaced
        servo = any(part.unit for part in own_motor.of_file)
        stated = dataclasses.replace(channel, motor=motor, servo=servo)
        channels.append((joint, stated))
    limits = tuple(motor.limit for motor in motors)
    drives = {"channels": tuple(channels), "motors": tuple(motors), "tendons": tendons}
    return dataclasses.replace(build, **drives), limits


def _check_names(label: str, model: mujoco.MjModel, keyframe: str | None, tip: str | None) -> None:
    """Raise ScenarioError for a keyframe or a site that the model does not have."""
    if keyframe is not None:
        if not model.nkey:
            raise ScenarioError(
                f"keyframe is {shown(keyframe)}: {label} has none, so leave it out, or give a pose "
                "instead"
            )
        keyframes = [model.key(i).name for i in range(model.nkey)]
        mjcf.pick(label, "keyframe", keyframe, keyframes)
    if tip is not None:
        sites = [model.site(i).name for i in range(model.nsite)]
        mjcf.pick(label, "site", tip, sites)


def _name(source: ModelSource, title: str) -> str:
    """Return the name of the plant of a file, which is none of the library's: the file's, or that
    of its model or its folder if the file's says nothing.
    """
    file = source.name.removesuffix(".xml")
    first = Path(file).stem.lower().partition("_")[0]
    if source.path and first in EMPTY_NAMES:
        model = re.sub(r"[\W_]+", "_", title.lower().removesuffix("scene")).strip("_")
        folder = Path(source.path).parent.name
        file = next(filter(_says_something, (model, folder)), file)
    return f"{file}.xml" if plant_catalogue().taken(file) else file


def _says_something(name: str) -> bool:
    return name not in ("", UNNAMED_MODEL, *EMPTY_NAMES)


def _places(
    plant: str, model: mujoco.MjModel, joints: list[str], pairs: Pairs, keyframe: str | None
) -> tuple[Names, Fields]:
    """Return the units of the channels, and the plant's fields on where they start, end and may
    go.
    """
    if is_free(model, joints[0]):
        _, units, x0 = own.places(model, joints, {}, keyframe)
        return units, {"x0": x0, "rest": x0}
    alone = [joint for joint in joints if not is_free(model, joint)]
    start, checked = own.joint_starts(model, alone, pairs, keyframe)
    names, units, x0 = own.places(model, joints, start, keyframe)
    unit_of = dict(zip(names, units, strict=True))
    named = [joint for joint, _, _ in checked]
    check_ranges(
        plant,
        checked,
        [start[channel] for channel in named],
        [unit_of[channel] for channel in named],
    )
    goals = _goals(model, alone, keyframe)
    rest = own.places(model, joints, goals, keyframe)[2]
    ranges = own.ranges(model, names)
    fields: Fields = {"x0": x0, "ranges": ranges}
    if any(rest):
        fields |= {"rest": rest, "goal": rest[len(pairs) :]}
    fields["measured"] = len(names) - len(joints_of(pairs))
    for joint in joints:
        if joint not in alone:
            fields["base"] = names.index(joint)
    return units, fields


def _goals(model: mujoco.MjModel, joints: list[str], keyframe: str | None) -> dict[str, float]:
    """Return hinges and slides with where they end by default, rad or m."""
    at_goal = own.goals(model, joints, keyframe)[0]
    return dict(zip(joints, at_goal, strict=True))


def without_model(x, v, i, p):
    """Return the f and g of a plant that has no nominal model: NaN."""
    return math.nan, math.nan


def _kept(
    label: str, model: mujoco.MjModel, motors: Sequence[Motor], given: Mapping[str, tuple]
) -> dict[str, tuple]:
    """Return what the actuators that stay as they are suggest to scenarios: themselves, and bounds
    on u where their channels give none.
    """
    parts = tuple(motor.of_file for motor in motors)
    if not any(parts):
        return {}
    bounds = list(given.get("u_max", (None,) * len(motors)))
    for i, motor in enumerate(motors):
        if bounds[i] is None and motor.of_file and motor.of_file[-1].unit:
            bound = own.bound_of_kept(label, model, motor.joint, motor.of_file[-1])
            if not isinstance(motor.of_file[-1], PositionServo):  # whose bound a run asks for
                bounds[i] = bound
    bounded = {"u_max": tuple(bounds)} if any(bounds) else {}
    return {"actuator": parts, **bounded}


def _unmodelled(model: mujoco.MjModel, joints: list[str], motors: Sequence[Motor]) -> str:
    """Return why a plant has no nominal model; "" if it has one."""
    for motor in motors:
        if any(isinstance(part, PositionServo) for part in motor.of_file):
            return SET_POINT
    return why_no_nominal(model, joints, motors)


def why_no_nominal(model: mujoco.MjModel, joints: list[str], motors: Sequence[Motor]) -> str:
    """Return why there is no nominal model of the channels, or ""."""
    if np.any(model.eq_active0):
        return f"equality constraints hold its joints together: {WITHOUT_MODEL}"
    if model.nplugin or model.nflex:
        return f"it has plugins or flexible bodies: {WITHOUT_MODEL}"
    channel_dofs = []
    for dof, joint in enumerate(model.dof_jntid):
        if model.joint(joint).name in joints:
            channel_dofs.append(dof)
    if any(is_free(model, joint) for joint in joints[1:]):
        return f"nothing is known of what its base stands on: {WITHOUT_MODEL}"
    idle = np.ones(model.nactuator, bool)
    if is_free(model, joints[0]):
        idle[own.thrusters(model, joints[0])] = False
    for motor in motors:
        idle[list(motor.replaced)] = False
    if states := UNMEASURED.keys() & set(model.actuator_dyntype[idle].tolist()):
        return f"{UNMEASURED[min(states)]} that is not measured: {WITHOUT_MODEL}"
    # what may couple trees
    kinds = np.isin(model.actuator_trntype[idle], own.ONE_JOINT)
    alone = np.all(kinds)
    if model.ntendon or not alone:
        near = range(model.nv)
    else:
        of_channels = model.dof_treeid[channel_dofs]
        near = np.flatnonzero(np.isin(model.dof_treeid, of_channels))
    loose = [model.joint(model.dof_jntid[dof]) for dof in near if dof not in channel_dofs]
    if not loose:
        return ""
    named = f"joint {loose[0].name!r}" if loose[0].name else "a joint without a name"
    cure = "make it a channel, or name it in measured if nothing drives it, or "
    if is_free(model, joints[0]) or loose[0].type[0] not in own.UNIT_OF_JOINT:
        cure = ""
    return f"{named} moves with its channels and is not measured: {cure}{WITHOUT_MODEL}"


def restored(data: Mapping, name: str) -> Plant:
    """Return the plant that `UserModel.about` describes."""
    if "text" in data:
        assets = {name: base64.b64decode(content) for name, content in data["assets"].items()}
        source = mjcf.model_source(data["text"], assets)
    else:
        source = mjcf.source_of_record(data["path"], data["sha256"])
    source = source.posed(data.get("pose", {}))
    what_others_do = data.get("others", "")
    pairs = own.coerce(data["channels"])
    measured = data.get("measured", ())
    return _plant(source, pairs, name, data["keyframe"], data.get("tip"), what_others_do, measured)
