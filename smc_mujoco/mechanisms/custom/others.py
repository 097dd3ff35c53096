"""What the joints of a user's model do that are no channels.

By default, and as "file": a servo holds where the runs start, or the ctrl of the keyframe; the rest
is as the model says. "held": other joints with a motor are held there too, by a PD of HELD rad/s.
"locked": every other joint is welded at the start, and ties of the channels to it are cut.
"""

import math
from collections.abc import Collection, Iterable, Sequence

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.mechanisms.custom.channels import (
    FREE,
    HOLD,
    ONE_JOINT,
    UNIT_OF_JOINT,
    Pairs,
    add_motor,
    joint_starts,
    joints_of,
)
from smc_mujoco.mechanisms.custom.mjcf import ModelSource, unedited_model
from smc_mujoco.mechanisms.plant import leave_out_scenery

OTHERS = ("file", "held", "locked")
HELD = 2.0 * math.pi * 8.0  # rad/s, chosen: fast beside the channels, slow beside a physics step
AFFINE = mujoco.mjtBias.mjBIAS_AFFINE
PID = mujoco.mjtGain.mjGAIN_PID
POSITION = mujoco.mjtCtrlInput.mjINPUT_POS.value


def is_servo(actuator: mujoco.MjsActuator) -> bool:
    """Return whether an actuator pulls to a position that is its command."""
    if actuator.gaintype == PID and actuator.ctrlspec and not actuator.ctrlspec & POSITION:
        return False
    return actuator.biastype == AFFINE and actuator.biasprm[1] < 0.0


def target_of(actuator: mujoco.MjsActuator) -> str:
    """Return the joint that an actuator drives alone, or ""."""
    return actuator.target if actuator.trntype.value in ONE_JOINT else ""


def limp(spec: mujoco.MjSpec, seen: Iterable[str]) -> list[str]:
    """Return the joints that are not seen as channels and have motors, which nothing commands. In a
    file without actuators, such as a URDF, these are the joints whose force is bounded.
    """
    mine = {"", *seen}
    served = {target_of(actuator) for actuator in spec.actuators if is_servo(actuator)}
    driven = dict.fromkeys(target_of(actuator) for actuator in spec.actuators)
    if not spec.actuators:
        follow = {equality.name1 for equality in spec.equalities}
        driven = {}
        for joint in spec.joints:
            if np.any(joint.actfrcrange) and joint.name not in follow:
                driven[joint.name] = None
    return [joint for joint in driven if joint not in mine | served]


def usual_keyframe(spec: mujoco.MjSpec) -> str:
    """Return the keyframe that a text without one takes: the only one, or "home"; "" if none."""
    names = [key.name for key in spec.keys]
    if len(names) == 1:
        return names[0]
    return "home" if "home" in names else ""


def at_start(
    source: ModelSource, channels: Pairs, keyframe: str | None
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return the file's model, with a body for each of the file, and its state at the start."""
    spec = source.spec()
    if spec.compiler.fusestatic:
        spec.compiler.fusestatic = False
        leave_out_scenery(spec)
        model = source.compiled(spec)
    else:
        model = unedited_model(source)
    data = mujoco.MjData(model)
    if keyframe is not None:
        mujoco.mj_resetDataKeyframe(model, data, model.key(keyframe).id)
    data.qvel[:] = 0.0
    start_positions = joint_starts(model, joints_of(channels), channels, keyframe)[0]
    for joint, x in start_positions.items():
        if model.joint(joint).type[0] != FREE:
            data.qpos[model.joint(joint).qposadr[0]] = x
    mujoco.mj_forward(model, data)
    return model, data


def edit(
    spec: mujoco.MjSpec,
    source: ModelSource,
    channels: Pairs,
    keyframe: str | None,
    others: str,
    seen: Sequence[str],
) -> None:
    """Edit a model that `source` has just read. Its channels are on the joints that are `seen`."""
    driven = {joint for joint, _ in channels}
    servos = {}
    for i, actuator in enumerate(spec.actuators):
        if is_servo(actuator) and target_of(actuator) not in driven:
            servos[i] = actuator
    if not servos and others not in ("held", "locked"):
        return
    model, data = at_start(source, channels, keyframe)
    for i, servo in servos.items():
        place = float(data.actuator_length[model.actuator_outadr[i]])
        stiffness = -servo.biasprm[1]
        if keyframe is not None and np.any(data.ctrl):
            place = float(data.ctrl[model.actuator_ctrladr[i]])
            if model.actuator_ctrllimited[model.actuator_ctrladr[i]]:
                low, high = model.actuator_ctrlrange[model.actuator_ctrladr[i]].tolist()
                place = min(max(place, low), high)
            stiffness = servo.gainprm[0]
        if servo.gaintype == PID:
            _hold_pid(servo, place)
            continue
        servo.biasprm[0] += stiffness * place
        # its ctrl stays at 0, which its range may leave out, as a knee's does
        servo.ctrllimited = servo.actlimited = False
    if others == "held":
        _hold(spec, model, data, limp(spec, seen))
    if others == "locked":
        _lock(spec, model, data, set(seen))


def _hold_pid(servo: mujoco.MjsActuator, place: float) -> None:
    """Let a `<pid>`, which integrates the distance from its command, hold a place: its ctrl stays
    at 0, which MuJoCo clips to a range that begins or ends there.
    """
    servo.ctrllimited = True
    servo.ctrlrange = (place, place + 1.0) if place > 0.0 else (place - 1.0, place)
    servo.dynprm[1] = 0.0  # its slewmax, for which it would begin at 0
    if not servo.gainprm[0]:
        servo.dyntype = mujoco.mjtDyn.mjDYN_NONE


def _hold(
    spec: mujoco.MjSpec, model: mujoco.MjModel, data: mujoco.MjData, joints: list[str]
) -> None:
    """Add a PD to joints: stiffness and damping by their inertia, and their load fed forward."""
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    for name in joints:
        joint = model.joint(name)
        if mujoco.mjtJoint(joint.type[0]) not in UNIT_OF_JOINT:
            continue
        dof = joint.dofadr[0]
        kp = inertia[dof, dof] * HELD**2
        kd = 2.0 * inertia[dof, dof] * HELD
        load = data.qfrc_bias[dof] - data.qfrc_passive[dof]
        servo = add_motor(spec, f"{HOLD}{name}", name)
        servo.biastype = AFFINE
        hold = kp * data.qpos[joint.qposadr[0]] + load
        servo.biasprm[:3] = hold, -kp, -kd


def _lock(
    spec: mujoco.MjSpec, model: mujoco.MjModel, data: mujoco.MjData, joints: set[str]
) -> None:
    """Weld every body whose joints are no channels to its parent, by pose, where it starts."""
    drawn = mujoco.MjData(model)
    drawn.qpos[:] = data.qpos
    for joint in map(model.joint, joints):  # so that the poses of their bodies stay the file's
        if joint.type[0] != FREE:
            place = joint.qposadr[0]
            drawn.qpos[place] = model.qpos0[place]
    mujoco.mj_kinematics(model, drawn)
    bodies = list(spec.bodies)  # in the order of the model; their ids are -1 before compilation
    for i, body in enumerate(bodies):
        body.name = body.name or f"body:{i}"
    _exclude(spec, model, bodies)
    holds = ties(model, joints)[0]
    for equality, held in zip(list(spec.equalities), holds, strict=True):
        if not held:
            spec.delete(equality)
    for i, body in enumerate(bodies):
        loose = [joint for joint in body.joints if joint.name not in joints]
        if loose:
            _place(body, model.body_parentid[i], i, drawn)
        for joint in loose:
            spec.delete(joint)
        for joint in body.joints if loose else ():
            number = model.joint(joint.name).id
            to_body = drawn.xmat[i].reshape(3, 3).T
            joint.axis = to_body @ drawn.xaxis[number]
            arm = drawn.xanchor[number] - drawn.xpos[i]
            joint.pos = to_body @ arm
    _delete_orphans(spec)


def ties(model: mujoco.MjModel, joints: Collection[str]) -> tuple[Array, Array]:
    """Return which equality constraints hold if all but these joints are locked, and which tie one
    of them to what is locked, (neq,) each. Those of flexes hold.
    """
    above = np.zeros((model.nbody, model.njnt), bool)  # the joints that carry a body
    for i in range(1, model.nbody):
        above[i] = above[model.body_parentid[i]]
        above[i, model.jnt_bodyid == i] = True
    free = np.array([model.joint(i).name in joints for i in range(model.njnt)])
    holds = np.ones(model.neq, bool)
    cut = np.zeros(model.neq, bool)
    kinds = mujoco.mjtEq
    for k, kind in enumerate(map(kinds, model.eq_type)):
        first = model.eq_obj1id[k]
        second = model.eq_obj2id[k]
        between = np.zeros(model.njnt, bool)
        if kind == kinds.mjEQ_JOINT:
            between[[*{first, second} - {-1}]] = True
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            if model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE.value:
                first, second = model.site_bodyid[[first, second]]
            between = above[first] ^ above[second]
        elif kind == kinds.mjEQ_TENDON:
            for tendon in {first, second} - {-1}:
                between |= _stretching(model, tendon, above)
        else:
            continue
        holds[k] = np.any(between) and np.all(free[between])
        cut[k] = np.any(free[between]) and not holds[k]
    return holds, cut


def _stretching(model: mujoco.MjModel, tendon: int, above: Array) -> Array:
    """Return the joints that a tendon wraps, or that carry some of its sites only, (njnt,)."""
    first = model.tendon_adr[tendon]
    wraps = slice(first, first + model.tendon_num[tendon])
    kinds = model.wrap_type[wraps]
    ids = model.wrap_objid[wraps]
    sites = ids[kinds == mujoco.mjtWrap.mjWRAP_SITE]
    carried = above[model.site_bodyid[sites]]
    joints = np.any(carried, axis=0) & ~np.all(carried, axis=0)
    joints[ids[kinds == mujoco.mjtWrap.mjWRAP_JOINT]] = True
    return joints


def _place(body: mujoco.MjsBody, parent: int, i: int, at: mujoco.MjData) -> None:
    """Give a body the pose in its parent that it has in `at`."""
    back = np.zeros(3)
    turn = np.zeros(4)
    pos = np.zeros(3)
    quat = np.zeros(4)
    mujoco.mju_negPose(back, turn, at.xpos[parent], at.xquat[parent])
    mujoco.mju_mulPose(pos, quat, back, turn, at.xpos[i], at.xquat[i])
    if body.frame is not None:
        body.set_frame(body.parent.add_frame())
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.pos = pos
    body.quat = quat


def _exclude(spec: mujoco.MjSpec, model: mujoco.MjModel, bodies: list[mujoco.MjsBody]) -> None:
    """Exclude the pairs of bodies that may not touch now. Of a parent that becomes part of the
    world MuJoCo would forget that.
    """
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT.value:
        return
    excluded = {frozenset((pair.bodyname1, pair.bodyname2)) for pair in spec.excludes}
    weld = model.body_weldid
    above = weld[model.body_parentid[weld]]
    for i in np.flatnonzero(model.body_geomnum):
        for j in np.flatnonzero(model.body_geomnum[:i]):
            near = weld[i] == weld[j] or weld[i] == above[j] or weld[j] == above[i]
            pair = bodies[i].name, bodies[j].name
            if near and weld[i] and weld[j] and frozenset(pair) not in excluded:
                spec.add_exclude(bodyname1=pair[0], bodyname2=pair[1])


def _lost_a_joint(tendon: mujoco.MjsTendon) -> bool:
    """Say whether a tendon goes along a joint that was deleted."""
    for wrap in tendon.path:
        along_joint = wrap.type == mujoco.mjtWrap.mjWRAP_JOINT
        if along_joint and wrap.target is None:
            return True
    return False


def _delete_orphans(spec: mujoco.MjSpec) -> None:
    """Delete all keyframes, and what names a joint or a tendon that is gone."""
    joint_names = {"", *(joint.name for joint in spec.joints)}
    orphans = [*spec.keys]
    gone = set()
    for tendon in spec.tendons:
        if _lost_a_joint(tendon):
            orphans.append(tendon)
            gone.add(tendon.name)
    for actuator in spec.actuators:
        by_tendon = actuator.trntype == mujoco.mjtTrn.mjTRN_TENDON and actuator.target in gone
        if by_tendon or target_of(actuator) not in joint_names:
            orphans.append(actuator)
    for orphan in reversed(orphans):  # a tendon after what names it
        spec.delete(orphan)
