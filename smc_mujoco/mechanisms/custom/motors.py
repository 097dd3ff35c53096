"""Motors of a user's model: the actuator that drives each channel's joint, replaced by a motor of gear 1."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import mujoco

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.mechanisms.custom.channels import Channel
from smc_mujoco.mechanisms.custom.mjcf import pick
from smc_mujoco.mechanisms.hardware.part import PASSIVE

ONE_JOINT = (mujoco.mjtTrn.mjTRN_JOINT.value, mujoco.mjtTrn.mjTRN_JOINTINPARENT.value)  # transmissions to one joint
FIXED, NO_BIAS = mujoco.mjtGain.mjGAIN_FIXED.value, mujoco.mjtBias.mjBIAS_NONE.value
NO_DYNAMICS = mujoco.mjtDyn.mjDYN_NONE.value
MOTOR_GROUP = 31  # actuator group of motors, which actuatorgroupdisable cannot turn off
CURE = "give smc.Channel(motor=True) for an ideal motor in its place"


class Motor(NamedTuple):
    """The motor of a channel.

    Attributes:
      joint: name of the joint.
      limit: bound on its force, N m or N.
      replaced: indices of the actuators that it replaces.
    """

    joint: str
    limit: float
    replaced: tuple[int, ...]


def motor_of(label: str, model: mujoco.MjModel, joint: str, channel: Channel) -> Motor:
    """Return the motor that drives a joint."""
    joint_id, wanted = model.joint(joint).id, channel.actuator
    bounds = [tuple(map(float, model.jnt_actfrcrange[joint_id]))] if model.jnt_actfrclimited[joint_id] else []
    actuators = [i for i in range(model.nactuator) if model.actuator_trntype[i] in ONE_JOINT]
    actuators = [i for i in actuators if model.actuator_trnid[i, 0] == joint_id]
    if channel.motor:
        if wanted is not None:
            raise ScenarioError(f"channel {joint!r} has motor=True and actuator {shown(wanted)}: give one of the two")
        takes = f"joint {joint!r} of {label} takes"
        return Motor(
            joint, _limit(takes, "widen its actuatorfrcrange", *bounds, _together(model, actuators)), tuple(actuators)
        )
    if wanted is not None:
        chosen = pick(label, "actuator", wanted, [model.actuator(i).name for i in range(model.nactuator)])
        if chosen not in actuators:
            raise ScenarioError(f"actuator {wanted!r} of {label} does not drive joint {joint!r} alone: {CURE}")
        actuators = [chosen]
    if not actuators:
        raise ScenarioError(f"no actuator of {label} drives joint {joint!r} alone: {CURE}")
    names = [model.actuator(i).name or f"number {i}" for i in actuators]
    if len(actuators) > 1:
        raise ScenarioError(
            f"joint {joint!r} of {label} has the actuators {', '.join(names)}: name one with smc.Channel(actuator=...)"
        )
    if why := _no_motor(model, actuators[0]):
        raise ScenarioError(f"actuator {names[0]!r} of joint {joint!r} {why}, and a law commands a force: {CURE}")
    gives = f"actuator {names[0]!r} gives joint {joint!r} of {label}"
    return Motor(joint, _limit(gives, CURE, *bounds, _of_actuator(model, actuators[0])), tuple(actuators))


def _no_motor(model: mujoco.MjModel, i: int) -> str:
    """Return why an actuator is not a motor; "" if it is one."""
    if model.actuator_gaintype[i] != FIXED or model.actuator_biastype[i] != NO_BIAS:
        return "is a servo, a damper or a muscle"
    if model.actuator_dyntype[i] != NO_DYNAMICS or model.actuator_delay[i]:
        return "has dynamics or a delay"
    if model.actuator_armature[i] or model.actuator_damping[i] or model.actuator_dampingpoly[i].any():
        return "has armature or damping"
    if 0 <= model.actuator_group[i] <= 30 and model.opt.disableactuator >> int(model.actuator_group[i]) & 1:
        return "is in a group that actuatorgroupdisable turns off"
    if not model.actuator_gear[i, 0] * model.actuator_gainprm[i, 0]:
        return "has gear or gain 0"
    return ""


def _limit(who: str, cure: str, *ranges: tuple[float, ...]) -> float:
    """Return the largest force that all ranges allow in both directions, N m or N, because |u| has one bound."""
    low, high = max([-math.inf, *(low for low, _ in ranges)]), min([math.inf, *(high for _, high in ranges)])
    if not low < 0.0 < high:
        raise ScenarioError(f"{who} {low:g} to {high:g}, but a law pushes both ways: {cure}")
    return min(-low, high)


def _of_actuator(model: mujoco.MjModel, i: int) -> tuple[float, float]:
    """Return the least and the largest force of an actuator at its joint, N m or N."""
    gain, gear = model.actuator_gainprm[i, 0], model.actuator_gear[i, 0]
    low, high = -math.inf, math.inf
    clamped = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL.value
    if model.actuator_ctrllimited[i] and clamped:
        low, high = sorted(float(gain * end) for end in model.actuator_ctrlrange[i])
    if model.actuator_forcelimited[i]:
        lowest, highest = model.actuator_forcerange[i]
        low, high = (float(min(max(end, lowest), highest)) for end in (low, high))
    low, high = sorted((float(gear * low), float(gear * high)))
    return low, high


def _together(model: mujoco.MjModel, actuators: Sequence[int]) -> tuple[float, float]:
    """Return the least and the largest force that the forceranges of a joint's actuators allow together, N m or N.

    There is no bound without an actuator, if one has no forcerange, and if they push only one way: an ideal motor that
    replaces them pushes both ways.
    """
    if not actuators or not all(model.actuator_forcelimited[i] for i in actuators):
        return -math.inf, math.inf
    ends = [sorted(float(model.actuator_gear[i, 0] * end) for end in model.actuator_forcerange[i]) for i in actuators]
    low, high = sum(low for low, _ in ends), sum(high for _, high in ends)
    return (low, high) if low < 0.0 < high else (-math.inf, math.inf)


def add_motors(spec: mujoco.MjSpec, motors: Sequence[Motor]) -> None:
    """Add the channels' motors, in this order, and keep the model's other actuators as passive parts."""
    replaced = {i for motor in motors for i in motor.replaced}
    for i, actuator in enumerate(list(spec.actuators)):
        if i in replaced:
            spec.delete(actuator)
        else:
            actuator.name = f"{PASSIVE}smc:{i}"  # no joint has this name
    for motor in motors:  # named after joints: names of actuators may be missing
        made = spec.add_actuator(name=f"u:{motor.joint}", target=motor.joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        made.set_to_motor()
        limit = motor.limit if math.isfinite(motor.limit) else 0.0
        made.gear, made.ctrllimited, made.forcelimited = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0), False, limit > 0.0
        made.ctrlrange, made.forcerange = (0.0, 0.0), (-limit, limit)
        made.armature, made.damping, made.delay, made.nsample, made.group = 0.0, (0.0, 0.0, 0.0), 0.0, 0, MOTOR_GROUP
