"""The shapes of a MuJoCo model as triangles, for the page of `smc.view`."""

from collections.abc import Iterator, Sequence

import mujoco
import numpy as np
import trimesh

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw.film import arrows, world

SMOOTH = np.radians(30.0)  # the sharpest edge that is shaded as round; chosen
SIDES = 12  # of an arrow; chosen
Rgba = tuple[float, ...]  # 0 .. 1
Geom = mujoco.mjtGeom


def body_meshes(
    model: mujoco.MjModel, body: int, paint: Array
) -> Iterator[tuple[Rgba, trimesh.Trimesh]]:
    """Yield the drawn shapes of a body in its own frame, one for each colour of `paint`, (geoms,
    4).
    """
    first = model.body_geomadr[body]
    parts = {}
    for geom in range(first, first + model.body_geomnum[body]):
        mesh = geom_mesh(model, geom)
        rgba = tuple(paint[geom].tolist())
        if mesh is None or model.geom_group[geom] >= world.DRAWN_GROUPS or not rgba[3]:
            continue
        pose = np.eye(4)
        pose[:3, 3] = model.geom_pos[geom]
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
        pose[:3, :3] = turn.reshape(3, 3)
        parts.setdefault(rgba, []).append(mesh.apply_transform(pose))
    for rgba, meshes in parts.items():
        yield rgba, joined(meshes)


def joined(meshes: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return several meshes as one."""
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + first for mesh, first in zip(meshes, firsts, strict=False)]
    return trimesh.Trimesh(vertices, np.concatenate(faces), process=False)


def geom_mesh(model: mujoco.MjModel, geom: int) -> trimesh.Trimesh | None:
    """Return a geom's shape in its own frame; None for planes, height fields and the like."""
    radius, half, _ = size = model.geom_size[geom]
    kind = Geom(model.geom_type[geom])
    if kind in (Geom.mjGEOM_SPHERE, Geom.mjGEOM_ELLIPSOID):
        shape = trimesh.creation.icosphere(subdivisions=3)
        return shape.apply_scale(radius if kind == Geom.mjGEOM_SPHERE else size)
    if kind == Geom.mjGEOM_CAPSULE:
        return trimesh.creation.capsule(height=2.0 * half, radius=radius, count=[24, 24])
    if kind == Geom.mjGEOM_CYLINDER:
        shape = trimesh.creation.cylinder(radius, 2.0 * half, sections=48)
    elif kind == Geom.mjGEOM_BOX:
        shape = trimesh.creation.box(2.0 * size)
    elif kind == Geom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first, start = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        vertices = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        faces = model.mesh_face[start : start + model.mesh_facenum[mesh]]
        shape = trimesh.Trimesh(vertices, faces)
    else:
        return None
    return trimesh.graph.smooth_shade(shape, angle=SMOOTH, facet_minarea=None)


def arrow_mesh(line: Array, width: float) -> trimesh.Trimesh:
    """Return an arrow along a line, (m, 3) m, whose shaft is so wide, m, with a film's head."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    way = np.append(0.0, steps.cumsum())
    width = min(width, arrows.MAX_THICKNESS * way[-1])
    head = 0.5 * arrows.HEAD_WIDTH * width
    neck = way[-1] - min(arrows.HEAD_LENGTH * head, arrows.HEAD * way[-1])
    stations = np.array([0.0, *np.linspace(0.0, neck, SIDES), neck, way[-1]])
    radii = np.array([0.0, *np.full(SIDES, 0.5 * width), head, 0.0])
    middles = np.column_stack([np.interp(stations, way, part) for part in line.T])
    ahead = np.column_stack(
        [np.interp(stations, way, part) for part in np.gradient(line, axis=0).T]
    )
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    normal = np.cross(ahead[0], ahead[-1])  # of the plane in which the arrow is bent
    if np.linalg.norm(normal) < 1e-9:
        normal = np.cross(ahead[0], np.eye(3)[np.abs(ahead[0]).argmin()])
    normal /= np.linalg.norm(normal)
    turns = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)[:, None]
    around = np.cos(turns) * normal + np.sin(turns) * np.cross(ahead, normal)[:, None]
    rings = middles[:, None] + radii[:, None, None] * around
    corners = np.arange(len(rings) * SIDES).reshape(-1, SIDES)
    near, ahead_of = corners[:-1], corners[1:]
    beside = np.roll(near, -1, axis=1)
    sides = [(near, beside, ahead_of), (beside, np.roll(ahead_of, -1, axis=1), ahead_of)]
    faces = np.stack([np.stack(side, axis=-1) for side in sides])
    return trimesh.Trimesh(rings.reshape(-1, 3), faces.reshape(-1, 3), process=False)
