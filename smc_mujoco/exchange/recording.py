"""A trace as an .mcap file: the moving machine, and its signals as curves, for Foxglove and Rerun.

Messages are protobuf, which both read; Rerun 0.41 does not show JSON. The machine is in Foxglove's
own kinds of message: FrameTransforms has the pose of every body in the world. SceneUpdate has the
shapes that move with the bodies; Rerun does not draw them. Each of x, v, u, applied, s, d, r, force
and reaction is a topic, whose messages have a number for each joint. The scenario is JSON in the
file's metadata.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.extras import extra
from smc_mujoco.common.files import to_json
from smc_mujoco.draw.states import shapes
from smc_mujoco.mechanisms.hardware.part import joint_ids, joint_names
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation import serialise
from smc_mujoco.simulation.run import poses
from smc_mujoco.simulation.state import LOGGED
from smc_mujoco.simulation.trace import Trace

MAX_POSE_RATE = 100.0  # Hz, of poses at most: screens show 60; chosen
DRAWN_GROUPS = 3  # groups of geoms that MuJoCo draws by default
GEOM = mujoco.mjtGeom


def write(trace: Trace, file: Path) -> None:
    """Write a trace to an .mcap file."""
    with extra("mcap", "Trace.export to .mcap"):
        from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
        from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
        from mcap_protobuf.writer import Writer

    message = message_of(joint_names(trace.scenario.plant))
    fields = message.DESCRIPTOR.fields_by_name
    model = shapes(trace.scenario)[0].model
    samples, places, turns = posed(trace)
    scene = SceneUpdate()
    at = {sample: i for i, sample in enumerate(samples.tolist())}
    add_shapes(scene, model)
    with file.open("wb") as stream, Writer(stream) as writer:
        about = to_json(serialise.describe(trace.scenario))
        writer.add_metadata(
            "trace of smc_mujoco", {"scenario": about, "failure": trace.failure or ""}
        )
        writer.write_message("/machine", scene, 0, 0)
        for k, time in enumerate((1e9 * trace.t).round().astype(int).tolist()):
            if k in at:
                transforms, (world, *names) = FrameTransforms(), frames(model)
                for name, place, turn in zip(
                    names, places[at[k], 1:], turns[at[k], 1:], strict=True
                ):
                    transform = transforms.transforms.add(
                        parent_frame_id=world, child_frame_id=name
                    )
                    transform.timestamp.FromNanoseconds(time)
                    put(transform.translation, "xyz", place)
                    put(transform.rotation, "wxyz", turn)
                writer.write_message("/poses", transforms, time, time)
            for name in LOGGED:
                if np.isfinite(values := getattr(trace, name)[k]).any():
                    signal = message(**dict(zip(fields, values.tolist(), strict=True)))
                    writer.write_message(f"/{name}", signal, time, time)


def message_of(joints: Sequence[str]) -> Any:
    """Return the class of a protobuf message with a number for each joint.

    Characters that its names lack become _.

    A name of two fields, or of a method of protobuf's messages, gets the joint's number.
    """
    from google.protobuf import descriptor_pb2, descriptor_pool, message, message_factory

    file = descriptor_pb2.FileDescriptorProto(
        name="smc_mujoco/joints.proto", package="smc_mujoco", syntax="proto3"
    )
    kind = file.message_type.add(name="Joints")
    taken = {*dir(message.Message)}
    plain = [re.sub(r"^(?=\d)|\W", "_", joint, flags=re.ASCII) for joint in joints]
    for number, known in enumerate(plain, 1):
        name = known + f"_{number}" * (plain.count(known) > 1)
        while name in taken:
            name = f"{name}_{number}"
        taken.add(name)
        kind.field.add(
            name=name, json_name=name, number=number, type="TYPE_DOUBLE", label="LABEL_OPTIONAL"
        )
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("smc_mujoco.Joints"))


def posed(trace: Trace) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return sample indices, (m,), MAX_POSE_RATE a second, and the bodies' places, (m, nbody, 3),
    and quaternions.
    """
    machines = shapes(trace.scenario)
    data = [mujoco.MjData(machine.model) for machine in machines]
    first = machines[0].model
    channels = first.jnt_qposadr[joint_ids(first)]
    step = max(1, round(1.0 / (MAX_POSE_RATE * trace.scenario.control_period)))
    samples = np.flatnonzero(np.isfinite(trace.x).all(axis=1))[::step]
    if first.nq > len(channels):
        whole = poses(trace, trace.t[samples])
    else:
        whole = None
    if whole is None:
        whole = np.tile(models.initial_state(first, trace.scenario)[0], (len(samples), 1))
    if not trace.scenario.plant.pose:  # of which `poses` has all
        whole[:, channels] = trace.x[samples]
    places = np.empty((len(samples), first.nbody, 3))
    turns = np.empty((len(samples), first.nbody, 4))
    for i, k in enumerate(samples.tolist()):
        now = sum(trace.t[k] >= machine.time for machine in machines) - 1
        data[now].qpos[:] = whole[i]
        mujoco.mj_kinematics(machines[now].model, data[now])
        places[i], turns[i] = data[now].xpos, data[now].xquat
    return samples, places, turns


def frames(model: mujoco.MjModel) -> list[str]:
    """Return the name of each body's frame, (nbody,): its own, or its number."""
    return [model.body(i).name or f"body {i}" for i in range(model.nbody)]


def add_shapes(message: Any, model: mujoco.MjModel) -> None:
    """Add an entity for each body to a SceneUpdate, with the shapes that MuJoCo draws, but for
    planes and fields.
    """
    for body, name in enumerate(frames(model)):
        entity = message.entities.add(id=name, frame_id=name, frame_locked=True)
        for geom in range(
            model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body]
        ):
            material = model.geom_matid[geom]
            if material >= 0:
                rgba = model.mat_rgba[material]
            else:
                rgba = model.geom_rgba[geom]
            if model.geom_group[geom] < DRAWN_GROUPS and rgba[3] > 0.0:
                for shape, place in primitives(entity, model, geom):
                    put(shape.color, "rgba", rgba)
                    put(shape.pose.position, "xyz", place)
                    put(shape.pose.orientation, "wxyz", model.geom_quat[geom])


def primitives(entity: Any, model: mujoco.MjModel, geom: int) -> Iterator[tuple[Any, np.ndarray]]:
    """Yield the primitives of a geom, added to an entity, with their places in the body."""
    kind = GEOM(model.geom_type[geom])
    size = model.geom_size[geom]
    place = model.geom_pos[geom]
    if kind == GEOM.mjGEOM_BOX:
        yield sized(entity.cubes.add(), 2.0 * size), place
    elif kind in (GEOM.mjGEOM_SPHERE, GEOM.mjGEOM_ELLIPSOID):
        yield (
            sized(
                entity.spheres.add(),
                2.0 * (size if kind == GEOM.mjGEOM_ELLIPSOID else size[[0, 0, 0]]),
            ),
            place,
        )
    elif kind in (GEOM.mjGEOM_CYLINDER, GEOM.mjGEOM_CAPSULE):
        yield (
            sized(entity.cylinders.add(bottom_scale=1.0, top_scale=1.0), 2.0 * size[[0, 0, 1]]),
            place,
        )
        axis = np.empty(3)
        mujoco.mju_rotVecQuat(axis, np.array([0.0, 0.0, size[1]]), model.geom_quat[geom])
        for end in (axis, -axis) if kind == GEOM.mjGEOM_CAPSULE else ():
            yield sized(entity.spheres.add(), 2.0 * size[[0, 0, 0]]), place + end
    elif kind == GEOM.mjGEOM_MESH:
        mesh = model.mesh(model.geom_dataid[geom])
        shape = entity.triangles.add(
            indices=model.mesh_face[slice_of(mesh.faceadr, mesh.facenum)].ravel().tolist()
        )
        for vertex in model.mesh_vert[slice_of(mesh.vertadr, mesh.vertnum)].tolist():
            put(shape.points.add(), "xyz", vertex)
        yield shape, place


def slice_of(start: np.ndarray, count: np.ndarray) -> slice:
    """Return the part of an array that an object of a model has."""
    return slice(int(start[0]), int(start[0] + count[0]))


def sized(shape: Any, size: np.ndarray) -> Any:
    """Return a primitive with its size, (3,) m."""
    put(shape.size, "xyz", size)
    return shape


def put(message: Any, names: str, values: Sequence[float] | np.ndarray) -> None:
    """Set the fields of a message that have these names, of one letter each."""
    for name, value in zip(names, values, strict=True):
        setattr(message, name, float(value))
