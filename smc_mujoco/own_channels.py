"""The channels of an own model as its user names them, checked against the model."""

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path

import mujoco

from smc_mujoco.errors import ScenarioError, find, number, shown

SIMPLE = {mujoco.mjtJoint.mjJNT_HINGE: "rad", mujoco.mjtJoint.mjJNT_SLIDE: "m"}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Channel:
    """How a joint of an own model is driven.

    Attributes:
      actuator: name of the motor that drives it; None: the only one that does.
      motor: whether an ideal motor takes the place of whatever actuators drive the joint, servos or none.
      partner: a joint without an actuator that moves with it, as a pole on its cart: measured and scored as a channel
        of its own, after the driven ones, and seen by this one's law in y.q, y.dq, y.fq, y.gq.
      x0: rad or m, where it starts; None: where the keyframe, or the model, has it.
    """

    actuator: str | None = None
    motor: bool = False
    partner: str | None = None
    x0: float | None = None


def given(channels: object) -> tuple[tuple[str, Channel], ...]:
    """Joints with their Channels, from whatever the user gave."""
    if isinstance(channels, str) or not isinstance(channels, Iterable):
        raise ScenarioError(f"channels is {shown(channels)}: give joints' names, such as {{'shoulder': smc.Channel()}}")
    items = list(channels.items()) if isinstance(channels, Mapping) else [(joint, None) for joint in channels]
    if not items:
        raise ScenarioError("channels is empty: give at least one joint's name")
    found = []
    for joint, value in items:
        found.append((joint, channel(joint, value)))
    return tuple(found)


def channel(joint: object, value: object) -> Channel:
    """A Channel, from one, a dict of its fields, or None."""
    if isinstance(value, Mapping):
        for key in value:
            find("field of a Channel", key, {field.name: None for field in dataclasses.fields(Channel)})
    made = Channel() if value is None else Channel(**value) if isinstance(value, Mapping) else value
    if not isinstance(made, Channel):
        raise ScenarioError(f"channel {shown(joint)} is {shown(value)}: give smc.Channel(...) or None")
    if made.x0 is None:
        return made
    return dataclasses.replace(made, x0=number(f"x0 of channel {joint!r}", made.x0, least=-1e6, most=1e6))


def check(file: Path, model: mujoco.MjModel, asked: tuple[tuple[str, Channel], ...], partners: list[str]) -> None:
    """Raise ScenarioError for joints that are not there or cannot be channels, and for flags that forbid control."""
    joints = [*(joint for joint, _ in asked), *partners]
    there = {model.joint(i).name: i for i in range(model.njnt) if model.joint(i).name}
    for joint in joints:
        kind = mujoco.mjtJoint(model.jnt_type[find(f"joint of {file.name}", joint, there)])
        if kind not in SIMPLE:
            raise ScenarioError(
                f"joint {joint!r} of {file.name} is a {kind.name[6:].lower()} joint: give one that is a hinge or slide"
            )
        if joints.count(joint) > 1:
            raise ScenarioError(f"joint {joint!r} is two channels or partners: name it once")
    if partners and len(partners) < len(asked):
        bare = next(joint for joint, channel in asked if channel.partner is None)
        raise ScenarioError(f"channel {bare!r} has no partner and others have: give each one, or none")
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_ACTUATION.value:
        raise ScenarioError(f'{file.name} has <flag actuation="disable"/>, so that nothing drives it: take it out')


def starts(
    model: mujoco.MjModel, joints: list[str], asked: tuple[tuple[str, Channel], ...], keyframe: str | None
) -> tuple[float, ...]:
    """x0: as the channels say, else as the keyframe, else as the model has it."""
    qpos = model.qpos0 if keyframe is None else model.key_qpos[model.key(keyframe).id]
    held = {joint: float(qpos[model.joint(joint).qposadr[0]]) for joint in joints}
    said = {joint: channel.x0 for joint, channel in asked if channel.x0 is not None}
    return tuple((held | said).values())
