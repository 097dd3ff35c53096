"""The user's model file with identified numbers: MJCF by MjSpec, or the URDF that it was."""

import warnings
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, ScenarioWarning, users_stacklevel
from smc_mujoco.common.files import write_text
from smc_mujoco.common.mjcb import compiled_spec
from smc_mujoco.common.text import joined
from smc_mujoco.identification.log_rig import LogRig
from smc_mujoco.identification.paths import SERVO
from smc_mujoco.mechanisms.custom import urdf
from smc_mujoco.mechanisms.custom.mjcf import full_precision_xml
from smc_mujoco.mechanisms.custom.model_numbers import KINDS, PAYLOAD
from smc_mujoco.mechanisms.hardware.position_servo import PositionServo
from smc_mujoco.simulation.part_numbers import parts_of

OF_URDF = {"damping": "damping", "frictionloss": "friction"}  # kind -> attribute of <dynamics>

UNSEEN_GROUP = 5  # of the sphere that carries a payload
POINT = 1e-3  # m, its radius


def save_model(rig: LogRig, path: Path) -> Path:
    """Write the rig's model with its numbers, and return the path.

    Numbers that a model file does not have, such as a delay, are left out, with a warning.

    Raises:
      ScenarioError: the plant has no file of its own, the name ends in neither .xml nor .urdf, or
        none of the numbers can be written.
    """
    if not rig.plant.is_user_model:
        raise ScenarioError(f"{rig.name} has no model file: save FILE.txt, a condition")
    source = rig.plant.build.source  # pyright: ignore[reportFunctionMemberAccess]
    write = {".xml": _mjcf, ".urdf": _urdf}.get(path.suffix.lower())
    if write is None:
        raise ScenarioError(f"cannot save a model as {path.name!r}: end the name in .xml or .urdf")
    left_out: list[str] = []
    text = write(rig, source, path, left_out)
    if len(left_out) == len(rig.quantities):
        raise ScenarioError(
            f"{path.name} cannot have {joined(left_out)}: save FILE.txt, a condition"
        )
    if left_out:
        warnings.warn(
            f"{path.name} is without {joined(left_out)}, which a model file does not have: "
            "they are in the condition, FILE.txt",
            ScenarioWarning,
            stacklevel=users_stacklevel(),
        )
    return write_text(path, text)


def _mjcf(rig: LogRig, source: Any, path: Path, left_out: list[str]) -> str:
    """Return the MJCF with a rig's numbers. What cannot be written is added to `left_out`."""
    spec = source.spec()
    model = compiled_spec(spec.copy())
    values = rig.values
    for name, value in values.items():
        owner, _, kind = name.rpartition(".")
        if owner and kind in KINDS and name in rig.plant.parameters:
            _set(spec.joint(owner), kind, value)
        elif owner and kind == PAYLOAD and name in rig.plant.parameters:
            _load(spec.body(owner), model, value)
        elif name == "m":
            _scale_masses(spec, model, value / rig.base.plant.parameters["m"])
        elif name == "grav":
            spec.option.gravity *= value / rig.base.plant.parameters["grav"]
        elif not _set_servo(rig, spec, name, value):
            left_out.append(name)
    if source.path:
        folder = Path(source.path).parent
        _find_files(spec, folder, path.parent, urdf.read_urdf(Path(source.path)))
    compiled_spec(spec)  # MuJoCo writes what it has compiled
    return full_precision_xml(spec)


def _set(joint: mujoco.MjsJoint, kind: str, value: float) -> None:
    """Set a number of a joint; of a polynomial its first coefficient."""
    field = getattr(joint, kind)
    if np.ndim(field):
        field[:] = 0.0
        field[0] = value
    else:
        setattr(joint, kind, value)


def _load(body: mujoco.MjsBody, model: mujoco.MjModel, mass: float) -> None:
    """Add a point mass at the centre of mass of a body."""
    if body.explicitinertial:
        body.mass += mass
        return
    body.add_geom(
        name=f"payload of {body.name}",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=(POINT, 0.0, 0.0),
        pos=model.body(body.name).ipos,
        mass=mass,
        contype=0,
        conaffinity=0,
        group=UNSEEN_GROUP,
    )


def _scale_masses(spec: mujoco.MjSpec, model: mujoco.MjModel, factor: float) -> None:
    """Scale masses and inertias of all bodies that move. The model has them in the same order."""
    for i, body in enumerate(spec.bodies):
        if model.body_weldid[i]:
            body.mass = factor * model.body_mass[i]
            body.ipos, body.iquat = model.body_ipos[i], model.body_iquat[i]
            body.inertia = factor * model.body_inertia[i]
            body.explicitinertial = True


def _set_servo(rig: LogRig, spec: mujoco.MjSpec, name: str, value: float) -> bool:
    """Set a number of a joint's servo; return whether it is one."""
    place = rig.places.get(name)
    if place is None or place.name not in SERVO or place.name == "dead_band":
        return False
    servo = parts_of(rig.base, place.field)[place.part]
    if not isinstance(servo, PositionServo):
        return False
    before = getattr(servo, place.name)
    for actuator in spec.actuators:
        if actuator.target not in servo.joint_names(rig.plant) or not before:
            continue
        ratio = value / before
        if place.name == "ki" or (place.name == "kp" and not servo.by_pid):
            actuator.gainprm[0] *= ratio
        if place.name in ("kp", "kv"):
            actuator.biasprm[1 if place.name == "kp" else 2] *= ratio
    return bool(before)


def _find_files(spec: mujoco.MjSpec, folder: Path, out: Path, read: urdf.Urdf | None) -> None:
    """Name meshes and textures so that they are found from the folder of the new file."""
    meshes: Mapping[str, Path] = read.meshes if read else {}
    for mesh in spec.meshes:
        if mesh.file in meshes:
            mesh.file = str(meshes[mesh.file])
    if folder.resolve() != out.resolve():
        for kind in ("meshdir", "texturedir"):
            setattr(spec, kind, str((folder / getattr(spec, kind)).resolve()))


def _urdf(rig: LogRig, source: Any, path: Path, left_out: list[str]) -> str:
    """Return the URDF with the damping and friction of its joints."""
    del path
    if not source.path or urdf.read_urdf(Path(source.path)) is None:
        raise ScenarioError(f"the model of {rig.name} is no URDF: save FILE.xml")
    tree = ET.parse(source.path)  # the user's own file
    joints = {joint.get("name"): joint for joint in tree.getroot().iter("joint")}
    for name, value in rig.values.items():
        owner, _, kind = name.rpartition(".")
        if owner not in joints or kind not in OF_URDF:
            left_out.append(name)
            continue
        joint = joints[owner]
        dynamics = joint.find("dynamics")
        if dynamics is None:
            dynamics = ET.SubElement(joint, "dynamics")
        dynamics.set(OF_URDF[kind], repr(value))
    return ET.tostring(tree.getroot(), encoding="unicode")
