"""Channels of a user's model: the joints that the user names, checked against the model."""

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import mujoco

from smc_mujoco.common.errors import ScenarioError, find, items_of, number, shown
from smc_mujoco.mechanisms.custom.mjcf import pick

MAX_EXCESS = 1e-3  # rad or m, chosen: how far beyond its range a joint may start, because MuJoCo's limits are soft
UNIT_OF_JOINT = {mujoco.mjtJoint.mjJNT_HINGE: "rad", mujoco.mjtJoint.mjJNT_SLIDE: "m"}

Range = tuple[str, float, float]  # joint, least and largest position, rad or m
SUGGESTED = ("law", "u_max", "reference")  # fields of a Channel that are defaults of scenarios


@dataclasses.dataclass(frozen=True, kw_only=True)
class Channel:
    """How a joint of a user's model is driven.

    Attributes:
      actuator: name of the motor that drives the joint; None: its only actuator.
      motor: whether to replace the joint's actuators, if it has any, by an ideal motor. It keeps their forcerange, and
        the joint's actuatorfrcrange.
      partner: a joint without an actuator that moves with this one, such as a pole on its cart. It is measured and
        scored as a separate channel, after the driven ones. The law of this channel reads it in y.q, y.dq, y.fq and
        y.gq. If it has an actuator, that stays at ctrl = 0: a motor then does nothing, a servo holds its position.
      x0, partner_x0: initial positions of the joint and of its partner, rad or m; None: those of the keyframe, or of
        the model.
      law, u_max, reference: what scenarios that are given none take for this channel, as in a Scenario. Give each
        channel a law, or none. None: the default bound, and rest at 0.
    """

    actuator: str | None = None
    motor: bool = False
    partner: str | None = None
    x0: float | None = None
    partner_x0: float | None = None
    law: Any = None
    u_max: float | None = None
    reference: Any = None

    @property
    def mechanical(self) -> "Channel":
        """The channel without what only scenarios read."""
        return dataclasses.replace(self, **dict.fromkeys(SUGGESTED))


Pairs = tuple[tuple[str, Channel], ...]  # each a joint and its Channel


def coerce(channels: object) -> Pairs:
    """Coerce a user's channels to pairs of joint and Channel."""
    if isinstance(channels, str | set | frozenset) or not isinstance(channels, Iterable):  # sets have no order
        raise ScenarioError(f"channels is {shown(channels)}: give joints' names in order, such as ['elbow', 'wrist']")
    named = isinstance(channels, Mapping)
    pairs = list(channels.items()) if named else [(joint, None) for joint in items_of("channels", channels)]
    if not pairs:
        raise ScenarioError("channels is empty: give at least one joint's name")
    return tuple((joint, channel(joint, value)) for joint, value in pairs)


def joints_of(channels: Pairs) -> list[str]:
    """Return the names of the driven joints, then those of their partners."""
    partners = [channel.partner for _, channel in channels if channel.partner is not None]
    return [*(joint for joint, _ in channels), *partners]


def channel(joint: object, value: object) -> Channel:
    """Coerce a Channel, a dict of its fields, or None to a Channel."""
    if isinstance(value, Mapping):
        for key in value:
            find("field of a Channel", key, {field.name: None for field in dataclasses.fields(Channel)})
    made = Channel() if value is None else Channel(**value) if isinstance(value, Mapping) else value
    if not isinstance(made, Channel):
        raise ScenarioError(f"channel {shown(joint)} is {shown(value)}: give smc.Channel(...) or None")
    if not isinstance(made.motor, bool):
        raise ScenarioError(f"motor of channel {joint!r} is {shown(made.motor)}: give True or False")
    if made.partner is None and made.partner_x0 is not None:
        raise ScenarioError(f"channel {joint!r} has a partner_x0 and no partner: give smc.Channel(partner=...) too")
    numbers = {
        name: number(f"{name} of channel {joint!r}", getattr(made, name), low=-1e6, high=1e6)
        for name in ("x0", "partner_x0")
        if getattr(made, name) is not None
    }
    if made.u_max is not None:
        numbers["u_max"] = number(f"u_max of channel {joint!r}", made.u_max, above=0.0, infinite=True)
    return dataclasses.replace(made, **numbers)


def suggested(channels: Pairs) -> dict[str, tuple]:
    """Return field -> what each channel suggests to scenarios, None for nothing; without fields that none suggests."""
    fields = {name: tuple(getattr(channel, name) for _, channel in channels) for name in SUGGESTED}
    bare = [joint for joint, channel in channels if channel.law is None]
    if 0 < len(bare) < len(channels):
        raise ScenarioError(f"channel {bare[0]!r} has no law and others have: give each one, or none")
    return {name: values for name, values in fields.items() if any(value is not None for value in values)}


def check(label: str, model: mujoco.MjModel, channels: Pairs) -> None:
    """Raise ScenarioError for joints that do not exist or cannot be channels, and for flags that forbid control."""
    joints = joints_of(channels)
    names = [model.joint(i).name for i in range(model.njnt)]
    for joint in joints:
        kind = mujoco.mjtJoint(model.jnt_type[pick(label, "joint", joint, names)])
        if kind not in UNIT_OF_JOINT:
            raise ScenarioError(
                f"joint {joint!r} of {label} is a {kind.name[6:].lower()} joint: give one that is a hinge or slide"
            )
        if joints.count(joint) > 1:
            raise ScenarioError(f"joint {joint!r} is two channels or partners: name it once")
    if len(channels) < len(joints) < 2 * len(channels):
        bare = next(joint for joint, channel in channels if channel.partner is None)
        raise ScenarioError(f"channel {bare!r} has no partner and others have: give each one, or none")
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_ACTUATION.value:
        raise ScenarioError(f'{label} has <flag actuation="disable"/>, so that nothing drives it: take it out')


def starts(
    model: mujoco.MjModel, joints: list[str], channels: Pairs, keyframe: str | None
) -> tuple[dict[str, float], list[Range]]:
    """Return joint -> x0, rad or m, and the ranges in which positions that the user chose must be.

    x0 comes from the channels, else from the keyframe, else from the model. The model's own x0 may be outside its
    range, because the user did not choose it, and a scenario can replace it.
    """
    qpos = model.qpos0 if keyframe is None else model.key_qpos[model.key(keyframe).id]
    chosen = {joint: channel.x0 for joint, channel in channels if channel.x0 is not None}
    chosen |= {c.partner: c.partner_x0 for _, c in channels if c.partner is not None and c.partner_x0 is not None}
    x0 = {joint: float(qpos[model.joint(joint).qposadr[0]]) for joint in joints} | chosen
    return x0, [row for row in ranges(model, joints) if keyframe is not None or row[0] in chosen]


def check_ranges(plant: str, ranges: Iterable[Range], x0: Iterable[float]) -> None:
    """Raise ScenarioError for a start outside a joint's range."""
    for (joint, low, high), x in zip(ranges, x0, strict=False):
        if not low - MAX_EXCESS <= x <= high + MAX_EXCESS:
            raise ScenarioError(
                f"x0 of joint {joint!r} of {plant} is {x:g}, outside its range from {low:g} to {high:g}: "
                "give another x0"
            )


def ranges(model: mujoco.MjModel, joints: Sequence[str]) -> tuple[Range, ...]:
    """Return joint, least and largest position of each channel, rad or m; empty where none has limits."""
    rows = []
    for joint in map(model.joint, joints):
        low, high = joint.range if joint.limited[0] else (-math.inf, math.inf)
        rows.append((joint.name, float(low), float(high)))
    flags = mujoco.mjtDisableBit
    off = model.opt.disableflags & (flags.mjDSBL_LIMIT.value | flags.mjDSBL_CONSTRAINT.value)
    return () if off or not any(math.isfinite(low) for _, low, _ in rows) else tuple(rows)
