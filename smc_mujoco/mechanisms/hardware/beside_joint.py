"""A rotor beside a joint: what the actuator drives, where it is not rigid on the channel's joint.

Both turn about the joint's axis. A tendon of length rotor - joint is what is between them: a play,
or a spring. All angles and inertias are those at the joint, behind the gear.
"""

import math
from collections.abc import Iterator, Mapping
from typing import ClassVar

import mujoco
import numpy as np

from smc_mujoco.common.mjcb import compiled_spec
from smc_mujoco.mechanisms.hardware.part import Actuator
from smc_mujoco.mechanisms.layout import LEAD, ROTOR, drive_ids, driven_ids
from smc_mujoco.mechanisms.plant import Field

BRASS = (0.80, 0.62, 0.28, 1.0)
MIN_INERTIA = 1e-9  # kg m^2 (kg): a lighter rotor is lost in rounding
MIN_ARM = (
    1e-6  # m, from a hinge to the centre of mass: a shorter one gives its pointer no direction
)


class BesideJoint(Actuator):
    """Base of parts that put a rotor between the drive and the joint. They have two numbers of it.

    Attributes:
      rotor_inertia: kg m^2 (kg) at the joint; that of a DCMotor is added.
      rotor_damping: N m s/rad (N s/m), of the rotor's bearings.
      lead, lead_rate: rotor - joint at the start of a run, rad (m), and its rate, rad/s (m/s).
    """

    drives = False
    units: ClassVar[Mapping[str, str]] = {
        "rotor_inertia": "{m}",
        "rotor_damping": "{f} s/{x}",
        "lead": "{x}",
        "lead_rate": "{x}/s",
    }

    rotor_inertia: float
    rotor_damping: float
    lead: float
    lead_rate: float

    def couple(self, tendon: mujoco.MjsTendon) -> None:
        """Make of a tendon what is between rotor and joint."""
        raise NotImplementedError

    def edit(self, spec: mujoco.MjSpec) -> None:
        rigid = compiled_spec(spec.copy())
        pose = mujoco.MjData(rigid)
        mujoco.mj_kinematics(rigid, pose)
        for actuator in self.drives_of(spec):
            joint = spec.joint(actuator.target)
            _add_rotor(spec, joint, rigid, pose)
            tendon = spec.add_tendon(name=LEAD + joint.name)
            tendon.wrap_joint(ROTOR + joint.name, 1.0)
            tendon.wrap_joint(joint.name, -1.0)
            self.couple(tendon)
            actuator.target = ROTOR + joint.name
        for key in spec.keys:
            if len(key.qpos) == rigid.nq:
                start = {}
                for i in range(rigid.njnt):
                    start[rigid.joint(i).name] = key.qpos[rigid.jnt_qposadr[i]]
                key.qpos = [start[joint.name.removeprefix(ROTOR)] for joint in spec.joints]

    def tendons(self, model: mujoco.MjModel) -> list[int]:
        """Return the indices of its tendons."""
        return [model.tendon(LEAD + name).id for name in self._names(model)]

    def rotors(self, model: mujoco.MjModel) -> list[int]:
        """Return the degrees of freedom of its rotors."""
        return [model.joint(ROTOR + name).dofadr[0] for name in self._names(model)]

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        rotors = self.rotors(model)
        yield Field("dof_armature", rotors, self.rotor_inertia, adds=True)
        yield Field("dof_damping", rotors, self.rotor_damping)

    def place(self, model: mujoco.MjModel, qpos: np.ndarray, qvel: np.ndarray) -> None:
        if self.lead or self.lead_rate:
            rotors = self.rotors(model)
            qpos[model.jnt_qposadr[model.dof_jntid[rotors]]] += self.lead
            qvel[rotors] += self.lead_rate

    def _names(self, model: mujoco.MjModel) -> list[str]:
        """Return the names of its joints."""
        driven = dict(zip(drive_ids(model).tolist(), driven_ids(model), strict=True))
        return [model.joint(driven[i]).name for i in self.drive_ids(model).tolist()]


def _add_rotor(
    spec: mujoco.MjSpec, joint: mujoco.MjsJoint, rigid: mujoco.MjModel, pose: mujoco.MjData
) -> None:
    """Add a rotor on the joint's own axis, with a pointer that shows where in the play it is."""
    i = rigid.joint(joint.name).id
    body = rigid.jnt_bodyid[i]
    parent = rigid.body_parentid[body]
    frame = pose.xmat[parent].reshape(3, 3)
    offset = pose.xanchor[i] - pose.xpos[parent]
    anchor = frame.T @ offset
    axis = frame.T @ pose.xaxis[i]
    # all inertia is in the joint's armature, so that it weighs nothing
    light = {"mass": 1e-9, "inertia": (1e-13, 1e-13, 1e-13), "explicitinertial": True}
    rotor = joint.parent.parent.add_body(name=ROTOR + joint.name, pos=anchor, **light)
    rotor.add_joint(name=ROTOR + joint.name, type=joint.type, axis=axis)
    if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
        lever = pose.xipos[body] - pose.xanchor[i]
        arm = frame.T @ lever
        if np.linalg.norm(arm) < MIN_ARM:  # a wheel: any direction across its axis does
            thinnest = np.argmin(np.abs(axis))
            arm = np.cross(axis, np.eye(3)[thinnest])
        away = arm / np.linalg.norm(arm)
        # not on the axis: MuJoCo refuses a rotor there that an ElasticJoint has left no mass
        rotor.ipos = MIN_ARM * away
        # in front of the hub, towards the camera at -y
        face = axis * math.copysign(0.045, -axis[1])
        ends = (*face, *(face + 0.16 * away))
    else:
        ends = (0.0, -0.05, 0.155, 0.0, 0.05, 0.155)  # across the cart's top
    look = {
        "fromto": ends,
        "size": (0.008, 0.0, 0.0),
        "rgba": BRASS,
        "contype": 0,
        "conaffinity": 0,
    }
    rotor.add_geom(name=ROTOR + joint.name, type=mujoco.mjtGeom.mjGEOM_CAPSULE, **look)
