"""Backlash: play between a rotor, which the actuator drives, and the channel's joint. Its stops are
MuJoCo's limits.
"""

import dataclasses
import math
from collections.abc import Iterator
from typing import Annotated

import mujoco
import numpy as np

from smc_mujoco.common.constraints import Number
from smc_mujoco.common.mjcb import compiled
from smc_mujoco.mechanisms.hardware.part import HARD_SOLIMP, HARD_SOLREF, Actuator, Natural
from smc_mujoco.mechanisms.layout import PLAY, ROTOR, drive_ids, driven_ids
from smc_mujoco.mechanisms.plant import MAX_PARAMETER, Field

BRASS = (0.80, 0.62, 0.28, 1.0)
MIN_INERTIA = 1e-9  # kg m^2 (kg): a lighter rotor is lost in rounding
# Time constant, s, and damping ratio of the stops: with a ratio of 1 a flank rebounds at up to 25 %
# of its speed, according to where in its step it strikes, at any step; with 8 at up to 0.4 %. Steps
# of 0.125 ms let penetration fade.
STOP_SOLREF = (HARD_SOLREF[0], 8.0)
MIN_ARM = (
    1e-6  # m, from a hinge to the centre of mass: a shorter one gives its pointer no direction
)


# s; tests/mechanisms/hardware/test_play.py compares with plastic stops
PLAY_STEP = 1.25e-4


@dataclasses.dataclass(frozen=True)
class Backlash(Actuator):
    """Play between a rotor, which the actuator drives, and the joint: |rotor - joint| <= gap/2.

    The stops of the play are MuJoCo's limits, as hard as it allows and damped so much that the
    flanks do not bounce: they rebound at less than 1 % of their speed. The default physics step is
    0.125 ms, as penetration fades slowly. The rotor starts in the middle of the play. With gap 0
    the rotor is rigid on the joint, and adds its inertia and damping to it.

    Attributes:
      gap: rad (m), the whole play; 0 or more.
      rotor_inertia: kg m^2 (kg) at the joint, 1e-9 or more; that of a DCMotor is added. The default
        is chosen: 1 % of the pendulums' 0.125.
      rotor_damping: N m s/rad (N s/m), 0 or more.
    """

    drives = False
    longest_step = PLAY_STEP

    gap: Natural
    rotor_inertia: Annotated[float, Number(low=MIN_INERTIA, high=MAX_PARAMETER)] = 1e-3
    rotor_damping: Natural = 0.0

    def edit(self, spec: mujoco.MjSpec) -> None:
        rigid = compiled(spec.copy())
        pose = mujoco.MjData(rigid)
        mujoco.mj_kinematics(rigid, pose)
        for actuator in self.drives_of(spec):
            joint = spec.joint(actuator.target)
            _add_rotor(spec, joint, rigid, pose)
            play = spec.add_tendon(name=PLAY + joint.name, limited=True, range=(-1.0, 1.0))
            play.solref_limit = STOP_SOLREF
            play.solimp_limit = HARD_SOLIMP
            play.wrap_joint(ROTOR + joint.name, 1.0)
            play.wrap_joint(joint.name, -1.0)
            actuator.target = ROTOR + joint.name
        for key in spec.keys:
            if len(key.qpos) == rigid.nq:
                start = {}
                for i in range(rigid.njnt):
                    start[rigid.joint(i).name] = key.qpos[rigid.jnt_qposadr[i]]
                key.qpos = [start[joint.name.removeprefix(ROTOR)] for joint in spec.joints]

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        driven = dict(zip(drive_ids(model).tolist(), driven_ids(model), strict=True))
        names = [model.joint(driven[i]).name for i in self.drive_ids(model).tolist()]
        rotors = [model.joint(ROTOR + name).dofadr[0] for name in names]
        yield Field(
            "tendon_range",
            [model.tendon(PLAY + name).id for name in names],
            (-self.gap / 2, self.gap / 2),
        )
        yield Field("dof_armature", rotors, self.rotor_inertia, adds=True)
        yield Field("dof_damping", rotors, self.rotor_damping)


def _add_rotor(
    spec: mujoco.MjSpec, joint: mujoco.MjsJoint, rigid: mujoco.MjModel, pose: mujoco.MjData
) -> None:
    """Add a rotor on the joint's own axis, with a pointer that shows where in the play it is."""
    i = rigid.joint(joint.name).id
    body = rigid.jnt_bodyid[i]
    parent = rigid.body_parentid[body]
    frame = pose.xmat[parent].reshape(3, 3)
    anchor = frame.T @ (pose.xanchor[i] - pose.xpos[parent])
    axis = frame.T @ pose.xaxis[i]
    # all inertia is in the joint's armature, so that it weighs nothing
    light = {"mass": 1e-9, "inertia": (1e-13, 1e-13, 1e-13), "explicitinertial": True}
    rotor = joint.parent.parent.add_body(name=ROTOR + joint.name, pos=anchor, **light)
    rotor.add_joint(name=ROTOR + joint.name, type=joint.type, axis=axis)
    if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
        arm = frame.T @ (pose.xipos[body] - pose.xanchor[i])
        if np.linalg.norm(arm) < MIN_ARM:  # a wheel: any direction across its axis does
            arm = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        away = arm / np.linalg.norm(arm)
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
