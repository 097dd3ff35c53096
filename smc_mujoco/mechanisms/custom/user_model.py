"""The builder of a user's mechanism, and what its parameters set."""

import base64
import dataclasses
import functools
from collections.abc import Iterable, Iterator

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Names
from smc_mujoco.common.data import frozen_data
from smc_mujoco.mechanisms.custom import channels as own
from smc_mujoco.mechanisms.custom.channels import Channel, Motor, Pairs, joints_of
from smc_mujoco.mechanisms.custom.mjcf import ModelSource
from smc_mujoco.mechanisms.custom.model_constraints import harden, touches
from smc_mujoco.mechanisms.custom.others import edit, limp, usual_keyframe
from smc_mujoco.mechanisms.hardware.tendons import Tendons
from smc_mujoco.mechanisms.layout import OWN, ROTOR, START
from smc_mujoco.mechanisms.plant import DIRECT_TEXT, Field

SENSORS = mujoco.mjtDisableBit.mjDSBL_SENSOR.value


def _stated(channel: Channel) -> dict:
    """Return a channel as plain data, without fields of servos where it has none, as older records
    are.
    """
    data = dataclasses.asdict(channel)
    if not channel.servo:
        del data["servo"], data["set_point_step"]
    return data


@frozen_data
class UserModel:
    """Builder of a user's mechanism: Plant.build. It ignores n, because the channels decide it."""

    source: ModelSource
    keyframe: str | None
    channels: Pairs
    motors: tuple[Motor, ...]
    tip: str = ""
    # indices of the actuators of a free joint, which then has the six channels
    thrusters: tuple[int, ...] = ()
    tendons: Tendons | None = None  # over which the channels' forces are shared
    others: str = ""  # one of others.OTHERS, or "" if not given
    measured: Names = ()  # joints that are measured beside the channels

    @property
    def file(self) -> str:
        """The file of the model; "" for a text."""
        return self.source.path

    def edited(self) -> mujoco.MjSpec:
        """Return the model without sensors, and with its other joints as wanted."""
        self.source.check_unchanged()
        return _edited(self).copy()

    def with_channels(self) -> mujoco.MjSpec:
        """Return the model with the sensors of each channel, and a motor for each driven one. A
        free joint keeps its thrusters instead of motors.
        """
        spec = self.edited()
        if self.thrusters:
            first_joint = self.channels[0][0]
            own.add_pose(spec, first_joint, self.thrusters)
        else:
            own.add_motors(spec, self.motors)
            for joint in (*joints_of(self.channels), *self.measured):
                own.add_joint_sensors(spec, joint)
        return spec

    def __call__(self, n: int) -> mujoco.MjSpec:
        """Return the model of runs: with its channels, hard dry friction and one keyframe."""
        spec = self.with_channels()
        harden(spec, functools.partial(_touches, self))
        for key in list(spec.keys):
            if key.name != self.keyframe or self.keyframe is None:
                spec.delete(key)
            else:
                key.name, key.ctrl, key.act = START, [], key.act if self.thrusters else []
        spec.add_text(name=DIRECT_TEXT, data="disturbances act on the joints")
        spec.option.disableflags &= ~SENSORS
        return spec

    def with_motor(self, joint: str) -> str:
        """Return its `argument` with an ideal motor on a joint."""
        channels = dict(self.channels)
        ideal = {"motor": True, "servo": None, "set_point_step": 0.0}
        channels[joint] = dataclasses.replace(channels[joint], **ideal)
        return dataclasses.replace(self, channels=tuple(channels.items())).argument

    @property
    def argument(self) -> str:
        """The model as written on the command line, such as arm.xml:shoulder+elbow@home."""
        parts = []
        for joint, channel in self.channels:
            parts.append(own.as_text(joint, channel))
        for joint in self.measured:
            parts.append(f"{joint}(measured)")
        text = "+".join(parts)
        spec = self.source.spec()
        if self.source.pose:
            places = ";".join(f"{joint}={place:g}" for joint, place in self.source.pose)
            text += f"@{{{places}}}"
        elif self.keyframe is not None:
            text += f"@{self.keyframe}"
        elif usual_keyframe(spec):  # which a text would take
            text += "@"
        if self.others or limp(spec, [*joints_of(self.channels), *self.measured]):
            text += f"+{self.others or 'file'}"
        return f"{self.source.file or 'FILE.xml'}:{text}"

    def about(self) -> dict:
        """Return the arguments with which `restored` makes this plant again, as plain data."""
        channels = {joint: _stated(channel) for joint, channel in self.channels}
        data = {
            "path": self.source.path and self.source.label,  # without the folder, which is a user's
            "sha256": self.source.sha256,
            "keyframe": self.keyframe,
            "channels": channels,
        }
        data |= {"pose": dict(self.source.pose)} if self.source.pose else {}
        data |= {"tip": self.tip} if self.tip else {}
        data |= {"others": self.others} if self.others else {}
        data |= {"measured": list(self.measured)} if self.measured else {}
        if not self.source.path:
            assets = {}
            for name, content in self.source.assets:
                assets[name] = base64.b64encode(content).decode()
            data |= {"text": self.source.text, "assets": assets}
        return data


@functools.lru_cache(maxsize=32)
def _edited(build: UserModel) -> mujoco.MjSpec:
    """Return the model that `UserModel.edited` copies, which is made once."""
    spec = build.source.spec()
    # tuples may name sensors and motors that are deleted
    while named := [*spec.tuples, *spec.sensors]:
        # MuJoCo 4 also deletes the tuples that name it, so list them again
        spec.delete(named[0])
    seen = joints_of(build.channels) + list(build.measured)
    edit(spec, build.source, build.channels, build.keyframe, build.others, seen)
    return spec


@functools.lru_cache(maxsize=32)
def _touches(build: UserModel) -> bool:
    """Return whether two geoms of a model may meet."""
    return touches(build.with_channels().compile())


def with_compensation(model: mujoco.MjModel, fields: Iterable[Field]) -> Iterator[Field]:
    """Yield fields, and one that leaves the gravity compensation of a file (gravcomp) at the
    weights of the file: a machine compensates what its maker knew of.
    """
    masses = model.body_mass.copy()
    gravity = model.opt.gravity.copy()
    changed = {"body_mass": masses, "opt.gravity": gravity}
    for field in fields:
        yield field
        if field.name in changed:
            values = changed[field.name]
            values[field.place] = field.value + (values[field.place] if field.adds else 0.0)
    if model.ngravcomp:
        weights = masses * np.linalg.norm(gravity)
        known_weights = model.body_mass * np.linalg.norm(model.opt.gravity)
        share = np.divide(known_weights, weights, out=np.ones(model.nbody), where=weights > 0.0)
        yield Field("body_gravcomp", slice(None), model.body_gravcomp * share)


@frozen_data
class UserFields:
    """The fields that m and grav set: Plant.fields. They scale all masses and inertias, and
    gravity.
    """

    mass: float
    gravity: float

    def __call__(self, model, p):
        yield from with_compensation(model, self._scaled(model, p))

    def _scaled(self, model, p):
        scale = np.ones(model.nbody)
        for i in range(model.nbody):
            if not model.body(i).name.startswith((ROTOR, OWN)):
                scale[i] = p.m / self.mass
        yield Field("body_mass", slice(None), model.body_mass * scale)
        scaled = model.body_inertia * scale[:, None]
        yield Field("body_inertia", slice(None), scaled)
        if self.gravity:
            factor = p.grav / self.gravity
            yield Field("opt.gravity", slice(None), model.opt.gravity * factor)
