"""The shapes of a MuJoCo model, and arrows, as triangles for the page of `smc.view`.

A browser shades an edge as round where triangles share its corners. So a sharp edge has each of its
corners twice. Meshes of many triangles have fewer here.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw.film import flat_arrows, world

MOST_TRIANGLES = 10_000  # of the meshes of a model; a processor draws 1000 in about a ms
FEWEST_TRIANGLES = 200  # of a mesh that has more than its share of those
SIDES = 24, 16, 12  # of what is round: the first with which a model has not too many triangles
MOST_ROUND = 5000  # of what is round; chosen
FIELD_LINES = 100  # of a height field, along each side
CELLS = 100  # in its size: what lies in one becomes a point; gaps between its parts would stay
SHARP = np.radians(30.0)  # at an edge of such a mesh, from which on it is sharp; chosen
ARROW_SIDES = 12
Rgba = tuple[float, ...]  # 0 .. 1
Geom = mujoco.mjtGeom
MESHES = Geom.mjGEOM_MESH, Geom.mjGEOM_SDF


class Mesh(NamedTuple):
    """Triangles: vertices, (n, 3) m, and faces, (m, 3) indices of vertices."""

    vertices: Array
    faces: Array


def geom_meshes(model: mujoco.MjModel) -> list[Mesh | None]:
    """Return the shape of each geom in its body's frame; None for those that are not drawn."""
    drawn = model.geom_group < world.DRAWN_GROUPS
    assets = model.geom_dataid[drawn & np.isin(model.geom_type, MESHES)]
    triangles = model.mesh_facenum[assets].sum()
    share = min(1.0, MOST_TRIANGLES / max(1, triangles))
    own = {mesh: own_mesh(model, mesh, share) for mesh in set(assets.tolist())}
    solids = {}
    for sides in SIDES:
        solids = {geom: solid(model, geom, sides) for geom in np.flatnonzero(drawn).tolist()}
        if sum(len(mesh.faces) for mesh in solids.values() if mesh is not None) <= MOST_ROUND:
            break
    meshes = []
    for geom in range(model.ngeom):
        kind = Geom(model.geom_type[geom])
        dataid = int(model.geom_dataid[geom])
        if not drawn[geom]:
            mesh = None
        elif kind in MESHES:
            mesh = own[dataid]
        elif kind == Geom.mjGEOM_HFIELD:
            mesh = height_field(model, dataid)
        else:
            mesh = solids[geom]
        if mesh is not None:
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
            mesh = Mesh(mesh.vertices @ turn.reshape(3, 3).T + model.geom_pos[geom], mesh.faces)
        meshes.append(mesh)
    return meshes


def body_meshes(
    model: mujoco.MjModel, body: int, meshes: Sequence[Mesh | None], paint: Array
) -> Iterator[tuple[Rgba, Mesh]]:
    """Yield the drawn shapes of a body in its own frame, one for each colour of `paint`, (geoms,
    4).
    """
    first = model.body_geomadr[body]
    parts = {}
    for geom in range(first, first + model.body_geomnum[body]):
        rgba = tuple(paint[geom].tolist())
        if meshes[geom] is not None and rgba[3]:
            parts.setdefault(rgba, []).append(meshes[geom])
    for rgba, same_colour in parts.items():
        yield rgba, joined(same_colour)


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one."""
    firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + first for mesh, first in zip(meshes, firsts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def solid(model: mujoco.MjModel, geom: int, sides: int) -> Mesh | None:
    """Return a geom's shape in its own frame; None for planes, flexes and what has a mesh."""
    radius, half, _ = size = model.geom_size[geom]
    kind = Geom(model.geom_type[geom])
    if kind == Geom.mjGEOM_BOX:
        return box(size)
    if kind == Geom.mjGEOM_CYLINDER:
        edges = np.array([-half, -half, -half, half, half, half])
        return revolved(radius * np.array([0.0, 1.0, 1.0, 1.0, 1.0, 0.0]), edges, sides)
    turns = np.linspace(-0.5 * np.pi, 0.5 * np.pi, sides // 2 + 1)  # from pole to pole
    if kind in (Geom.mjGEOM_SPHERE, Geom.mjGEOM_ELLIPSOID):
        ball = revolved(np.cos(turns), np.sin(turns), sides)
        return ball._replace(
            vertices=ball.vertices * (radius if kind == Geom.mjGEOM_SPHERE else size)
        )
    if kind == Geom.mjGEOM_CAPSULE:
        turns = np.insert(turns, sides // 4, 0.0)  # the equator twice, at the ends of its rod
        ends = half * np.where(np.arange(len(turns)) > sides // 4, 1.0, -1.0)
        return revolved(radius * np.cos(turns), radius * np.sin(turns) + ends, sides)
    return None


def own_mesh(model: mujoco.MjModel, mesh: int, share: float) -> Mesh:
    """Return a mesh of a model with this share of its triangles, and with its sharp edges: all that
    MuJoCo draws sharp where the share is 1.
    """
    first, start = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    vertices = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
    face = slice(start, start + model.mesh_facenum[mesh])
    faces, normals = model.mesh_face[face], model.mesh_facenormal[face]
    most = max(FEWEST_TRIANGLES, round(share * len(faces)))
    if len(faces) > most:
        return simplified(vertices, faces, most)
    corners = np.stack([faces, normals], axis=-1)
    unique, places = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    return Mesh(vertices[unique[:, 0]], places.reshape(-1, 3))


def simplified(vertices: Array, faces: Array, most: int) -> Mesh:
    """Return a mesh with fewer triangles of much the same shape, nearly `most` of them."""
    import trimesh

    size = np.ptp(vertices, axis=0).max()
    cells = np.round(CELLS / size * vertices)
    _, first, cell = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    mesh = trimesh.Trimesh(vertices[first], cell.reshape(-1)[faces])
    mesh.update_faces(mesh.unique_faces() & mesh.nondegenerate_faces())
    if len(mesh.faces) > most:
        mesh = mesh.simplify_quadric_decimation(face_count=most)
    smooth = trimesh.graph.smooth_shade(mesh, SHARP)
    return Mesh(np.asarray(smooth.vertices), np.asarray(smooth.faces))


def height_field(model: mujoco.MjModel, field: int) -> Mesh:
    """Return the surface of a height field."""
    x, y, top, _ = model.hfield_size[field]
    rows, columns = model.hfield_nrow[field], model.hfield_ncol[field]
    first = model.hfield_adr[field]
    heights = top * model.hfield_data[first : first + rows * columns].reshape(rows, columns)
    drawn_rows, drawn_columns = (
        np.linspace(0, lines - 1, min(lines, FIELD_LINES)).astype(int) for lines in (rows, columns)
    )
    heights = heights[np.ix_(drawn_rows, drawn_columns)]
    across, along = np.meshgrid(
        x * (2.0 * drawn_columns / (columns - 1) - 1.0), y * (2.0 * drawn_rows / (rows - 1) - 1.0)
    )
    places = np.column_stack([across.ravel(), along.ravel(), heights.ravel()])
    return Mesh(places, net(np.arange(heights.size).reshape(heights.shape)))


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


def revolved(radii: Array, heights: Array, sides: int) -> Mesh:
    """Return a solid of revolution about z from rings of these radii at these heights, (k,) m."""
    middles = heights[:, None] * (0.0, 0.0, 1.0)
    x, y, _ = np.eye(3)
    return tube(middles, radii, x, np.broadcast_to(y, middles.shape), sides)


def tube(middles: Array, radii: Array, normal: Array, across: Array, sides: int) -> Mesh:
    """Return a tube through rings with these middles, (k, 3) m, and radii, (k,) m; each lies in the
    plane of `normal`, (3,), and of its `across`, (k, 3).
    """
    turns = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)[:, None]
    around = np.cos(turns) * normal + np.sin(turns) * across[:, None]
    rings = middles[:, None] + radii[:, None, None] * around
    corners = np.arange(len(rings) * sides).reshape(-1, sides)
    vertices = rings.reshape(-1, 3)
    faces = net(np.column_stack([corners, corners[:, 0]]))
    a, b, c = vertices[faces].swapaxes(0, 1)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return Mesh(vertices, faces[areas > 1e-9 * areas.max()])  # at its poles, half are points


def net(corners: Array) -> Array:
    """Return the faces, (m, 3), of a net whose knots are these corners, (rows, columns)."""
    near, beside = corners[:-1, :-1], corners[:-1, 1:]
    far, far_beside = corners[1:, :-1], corners[1:, 1:]
    halves = [np.stack([near, beside, far], axis=-1), np.stack([beside, far_beside, far], axis=-1)]
    return np.concatenate(halves).reshape(-1, 3)


def arrow_mesh(line: Array, width: float) -> Mesh:
    """Return an arrow along a line, (m, 3) m, whose shaft is so wide, m, with a film's head."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    way = np.append(0.0, steps.cumsum())
    width = min(width, flat_arrows.MAX_THICKNESS * way[-1])
    head = 0.5 * flat_arrows.HEAD_WIDTH * width
    neck = way[-1] - min(flat_arrows.HEAD_LENGTH * head, flat_arrows.HEAD * way[-1])
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
