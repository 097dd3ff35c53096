"""The shapes of a MuJoCo model, and arrows, as triangles for the page of `smc.view`.

A browser shades an edge as round where triangles share its corners. So a sharp edge has each of its
corners twice.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw.film import arrows, world

SIDES = 32  # of what is round; chosen
ARROW_SIDES = 12
TURNS = np.linspace(-0.5 * np.pi, 0.5 * np.pi, SIDES // 2 + 1)  # from pole to pole
Rgba = tuple[float, ...]  # 0 .. 1
Geom = mujoco.mjtGeom


class Mesh(NamedTuple):
    """Triangles: vertices, (n, 3) m, and faces, (m, 3) indices of vertices."""

    vertices: Array
    faces: Array


def body_meshes(model: mujoco.MjModel, body: int, paint: Array) -> Iterator[tuple[Rgba, Mesh]]:
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
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
        vertices = mesh.vertices @ turn.reshape(3, 3).T + model.geom_pos[geom]
        parts.setdefault(rgba, []).append(Mesh(vertices, mesh.faces))
    for rgba, meshes in parts.items():
        yield rgba, joined(meshes)


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one."""
    firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + first for mesh, first in zip(meshes, firsts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def geom_mesh(model: mujoco.MjModel, geom: int) -> Mesh | None:
    """Return a geom's shape in its own frame; None for planes, height fields and the like."""
    radius, half, _ = size = model.geom_size[geom]
    kind = Geom(model.geom_type[geom])
    if kind == Geom.mjGEOM_MESH:
        return own_mesh(model, model.geom_dataid[geom])
    if kind == Geom.mjGEOM_BOX:
        return box(size)
    if kind == Geom.mjGEOM_CYLINDER:
        edges = np.array([-half, -half, -half, half, half, half])
        return revolved(radius * np.array([0.0, 1.0, 1.0, 1.0, 1.0, 0.0]), edges)
    if kind in (Geom.mjGEOM_SPHERE, Geom.mjGEOM_ELLIPSOID):
        ball = revolved(np.cos(TURNS), np.sin(TURNS))
        return ball._replace(
            vertices=ball.vertices * (radius if kind == Geom.mjGEOM_SPHERE else size)
        )
    if kind == Geom.mjGEOM_CAPSULE:
        turns = np.insert(TURNS, SIDES // 4, 0.0)  # the equator twice, at the ends of its rod
        ends = half * np.where(np.arange(len(turns)) > SIDES // 4, 1.0, -1.0)
        return revolved(radius * np.cos(turns), radius * np.sin(turns) + ends)
    return None


def own_mesh(model: mujoco.MjModel, mesh: int) -> Mesh:
    """Return a mesh of a model, with the edges that MuJoCo draws sharp."""
    first, start = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    faces = slice(start, start + model.mesh_facenum[mesh])
    corners = np.stack([model.mesh_face[faces], model.mesh_facenormal[faces]], axis=-1)
    unique, places = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    return Mesh(model.mesh_vert[first + unique[:, 0]], places.reshape(-1, 3))


def box(size: Array) -> Mesh:
    """Return a box of these half sides, (3,) m."""
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    sides = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            side = np.insert(square * (1.0, sign), 2, sign, axis=1)
            sides.append(Mesh(np.roll(side, axis, axis=1), np.array([(0, 1, 2), (0, 2, 3)])))
    cube = joined(sides)
    return cube._replace(vertices=cube.vertices * size)


def revolved(radii: Array, heights: Array) -> Mesh:
    """Return a solid of revolution about z from rings of these radii at these heights, (k,) m."""
    middles = heights[:, None] * (0.0, 0.0, 1.0)
    x, y, _ = np.eye(3)
    return tube(middles, radii, x, np.broadcast_to(y, middles.shape), SIDES)


def tube(middles: Array, radii: Array, normal: Array, across: Array, sides: int) -> Mesh:
    """Return a tube through rings with these middles, (k, 3) m, and radii, (k,) m; each lies in the
    plane of `normal`, (3,), and of its `across`, (k, 3).
    """
    turns = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)[:, None]
    around = np.cos(turns) * normal + np.sin(turns) * across[:, None]
    rings = middles[:, None] + radii[:, None, None] * around
    corners = np.arange(len(rings) * sides).reshape(-1, sides)
    near, far = corners[:-1], corners[1:]
    beside, far_beside = np.roll(near, -1, axis=1), np.roll(far, -1, axis=1)
    halves = [np.stack([near, beside, far], axis=-1), np.stack([beside, far_beside, far], axis=-1)]
    return Mesh(rings.reshape(-1, 3), np.concatenate(halves).reshape(-1, 3))


def arrow_mesh(line: Array, width: float) -> Mesh:
    """Return an arrow along a line, (m, 3) m, whose shaft is so wide, m, with a film's head."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    way = np.append(0.0, steps.cumsum())
    width = min(width, arrows.MAX_THICKNESS * way[-1])
    head = 0.5 * arrows.HEAD_WIDTH * width
    neck = way[-1] - min(arrows.HEAD_LENGTH * head, arrows.HEAD * way[-1])
    stations = np.array([0.0, *np.linspace(0.0, neck, ARROW_SIDES), neck, way[-1]])
    radii = np.array([0.0, *np.full(ARROW_SIDES, 0.5 * width), head, 0.0])
    ahead = np.gradient(line, axis=0)
    middles, ways = (
        np.column_stack([np.interp(stations, way, part) for part in curve.T])
        for curve in (line, ahead)
    )
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    normal = np.cross(ways[0], ways[-1])  # of the plane in which the arrow is bent
    if np.linalg.norm(normal) < 1e-9:
        normal = np.cross(ways[0], np.eye(3)[np.abs(ways[0]).argmin()])
    normal /= np.linalg.norm(normal)
    return tube(middles, radii, normal, np.cross(ways, normal), ARROW_SIDES)
