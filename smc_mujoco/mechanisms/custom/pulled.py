"""Joints of a user's model that tendons pull at, and the tendons that share the force on them."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array, Pair
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.text import joined
from smc_mujoco.mechanisms.custom.actuator_kinds import filters, gear_of, no_motor
from smc_mujoco.mechanisms.custom.kept_actuators import of_motor
from smc_mujoco.mechanisms.hardware.tendons import Cable

TENDON = mujoco.mjtTrn.mjTRN_TENDON.value
OF_JOINTS = mujoco.mjtWrap.mjWRAP_JOINT.value  # a fixed tendon, which couples joints
LEAST = 1e-9  # of a tendon's largest moment arm: less is rounding
# rad (m), chosen: how far from a pose arms are looked at, which may be 0 there
BESIDE = 0.0, 0.13, -0.21


class Pulled(NamedTuple):
    """The tendons that drive some joints."""

    cables: tuple[Cable, ...] = ()
    actuators: tuple[int, ...] = ()  # their indices in the file, in the same order
    # joint -> bound on its force at the goal, N m (N): what it gets both ways, or the one way
    limits: Mapping[str, float] = {}


def pulled_by(model: mujoco.MjModel, joint: str) -> list[int]:
    """Return the actuators of tendons that act on a joint."""
    pulling = np.flatnonzero(model.actuator_trntype == TENDON)
    arms = _largest_arms(model, model.qpos0)
    of_joint = arms[model.actuator_trnid[pulling, 0], model.joint(joint).dofadr[0]]
    return pulling[of_joint > 0.0].tolist()


def name_of(model: mujoco.MjModel, i: int) -> str:
    """Return the name of a tendon's actuator, or that of the tendon."""
    tendon = model.tendon(model.actuator_trnid[i, 0]).name
    return model.actuator(i).name or tendon or f"number {i}"


def pulled(
    label: str,
    model: mujoco.MjModel,
    goals: Mapping[str, float],
    keyframe: str | None,
    cure: str,
) -> Pulled:
    """Return the tendons that drive these joints, which nothing drives alone. `goals` are where the
    joints end by default, and `cure` says how to leave tendons out.

    Raises:
      ScenarioError: a tendon whose actuator is no plain force, has no bound or only pushes; one
        that also moves another joint; or no moment arm at the goal.
    """
    pose = _pose(model, goals, keyframe)
    arms = _largest_arms(model, pose)
    actuators = sorted({i for joint in goals for i in pulled_by(model, joint)})
    cables = []
    for i in actuators:
        who = f"actuator {name_of(model, i)!r} of {label}"
        if why := _no_force(model, i):
            raise ScenarioError(f"{who} {why}, and a tendon that drives has a <motor>: {cure}")
        tendon = int(model.actuator_trnid[i, 0])
        for dof in np.flatnonzero(arms[tendon]):
            moved = model.joint(model.dof_jntid[dof]).name
            if moved not in goals:
                raise ScenarioError(
                    f"{who} also moves joint {moved!r}, which tendons do not drive: make it a "
                    f"channel without an actuator of its own, or {cure}"
                )
        low, high = tension(model, i)
        if not max(-low, high) < np.inf:
            raise ScenarioError(f"{who} has no bound: give it a ctrlrange, such as 0 100")
        if not low < high:
            gear = -gear_of(model, i)
            raise ScenarioError(f"{who} only pushes, which a tendon cannot: give it gear {gear:g}")
        cables.append(Cable(tendon, name_of(model, i), low, high))
    limits = {}
    pulls = -moments(model, pose)
    for joint in goals:
        at_joint = pulls[:, model.joint(joint).dofadr[0]]
        ends = [sorted((at_joint[c.tendon] * c.low, at_joint[c.tendon] * c.high)) for c in cables]
        low, high = np.sum(ends, axis=0).tolist()
        if not low < high:
            names = joined([repr(cable.name) for cable in cables])
            raise ScenarioError(
                f"{names} of {label} have no moment arm about joint {joint!r} at its goal: give a "
                f"keyframe where they have one, or {cure}"
            )
        available = min(-low, high) if low < 0.0 < high else max(-low, high)
        place = model.joint(joint).id
        taken = np.inf
        if model.jnt_actfrclimited[place]:
            taken = np.abs(model.jnt_actfrcrange[place]).min()
        limits[joint] = float(min(available, taken))
    return Pulled(tuple(cables), tuple(actuators), limits)


def may_push(label: str, model: mujoco.MjModel, cables: tuple[Cable, ...]) -> Iterator[str]:
    """Yield a sentence on each actuator of a file that may push a tendon which drives."""
    names = [cable.name for cable in cables]
    for i in np.flatnonzero(model.actuator_trntype == TENDON).tolist():
        low, high = _pull(model, i)
        if name_of(model, i) in names and low < tension(model, i)[0]:
            yield (
                f"actuator {name_of(model, i)!r} of {label} may push with {-low:g} N, which a "
                f"tendon cannot: its tension is 0 to {high:g} N"
            )


def tension(model: mujoco.MjModel, i: int) -> Pair:
    """Return the least and the largest tension that an actuator gives its tendon, N; below 0 where
    the tendon couples joints and may push.
    """
    low, high = _pull(model, i)
    if model.wrap_type[model.tendon_adr[model.actuator_trnid[i, 0]]] == OF_JOINTS:
        return low, high
    return max(low, 0.0), high


def _pull(model: mujoco.MjModel, i: int) -> Pair:
    low, high = of_motor(model, i)
    return -high, -low


def _no_force(model: mujoco.MjModel, i: int) -> str:
    """Return why a force at once is not all that an actuator gives; "" if it is."""
    if filters(model, i):
        return "has a lag"
    return "has a delay" if model.actuator_delay[i] else no_motor(model, i)


def _pose(model: mujoco.MjModel, goals: Mapping[str, float], keyframe: str | None) -> Array:
    """Return the pose of a keyframe, if the model has it, with joints at their goals, (nq,)."""
    key = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, keyframe or "")
    pose = (model.qpos0 if key < 0 else model.key_qpos[key]).copy()
    for joint, goal in goals.items():
        pose[model.joint(joint).qposadr[0]] = goal
    return pose


def _largest_arms(model: mujoco.MjModel, pose: Array) -> Array:
    """Return the largest moment arm of each tendon about each degree of freedom near a pose,
    (ntendon, nv); 0 where it is rounding.
    """
    turning = model.jnt_qposadr[model.jnt_type >= mujoco.mjtJoint.mjJNT_SLIDE.value]
    arms = np.zeros((model.ntendon, model.nv))
    for shift in BESIDE:
        moved = pose.copy()
        moved[turning] += shift * np.linspace(1.0, 1.7, len(turning))
        arms = np.maximum(arms, np.abs(moments(model, moved)))
    return np.where(arms > LEAST * arms.max(axis=1, keepdims=True, initial=0.0), arms, 0.0)


def moments(model: mujoco.MjModel, pose: Array) -> Array:
    """Return how much each tendon lengthens per unit of each degree of freedom, (ntendon, nv)."""
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_tendon(model, data)
    dense = np.zeros((model.ntendon, model.nv))
    for tendon in range(model.ntendon):
        first = model.ten_J_rowadr[tendon]
        row = slice(first, first + model.ten_J_rownnz[tendon])
        dense[tendon, model.ten_J_colind[row]] = data.ten_J[row]
    return dense
