"""Rendering that draws again only the parts of the picture that have changed.

Software OpenGL takes time in proportion to the pixels and the shapes that it draws. So a new
picture is a copy of the one before, in which some rectangles are drawn again: those around
everything that moved, where it was and where it is, and around its shadow. Shapes outside a
rectangle are left out of its drawing.

Shadows on the floor are flattened copies of what casts them. A directional light casts a point (x,
y, z) along its direction w to the floor, at (x, y, z) - z w / w_z. As this is linear, a shape's
shadow is the same shape under another matrix, with edges as smooth as all others. MuJoCo looks its
own shadows up in a picture from the light: they have saw-tooth edges, and take as long to draw as
all the rest.
"""

import itertools
from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from smc_mujoco.common import gl
from smc_mujoco.draw.film import camera, scene

THICKNESS = 1e-4  # of a shadow, of its shape's height: normals of a flat shape would be undefined
FLOOR_DISTANCE = 4e-4  # of the model's extent: height of shadows over the floor
SHADOW_EMISSION = 20.0  # so large that a shadow is as dark whichever light falls on it
SHADE = (0.70, 0.715, 0.74)  # red, green, blue of the floor in shadow, chosen
MIN_CAST, MIN_BOX_CAST = (
    1.0,
    3.0,
)  # px, half the least thickness of what casts a shadow: shapes; boxes, as scale marks
MIN_ARM_CAST = (
    3.0  # px, the same of rings around an arm's links, which are in the shadow of the links
)
MIN_MOTION = 0.2  # px: a shape that has moved less since it was drawn is not drawn again; chosen
EDGE_MARGIN = 3  # px around what has changed, for smoothed edges
RECTANGLE_COST, SHAPE_COST = (
    8000,
    4000,
)  # px drawn in the time of a rectangle, and of a shape in it; fitted to films
SMALL_RADIUS, FEW_STACKS = (
    6.0,
    2,
)  # px, up to which round shapes have as few stacks as cylinders, and their number
CHORD_GAP, MIN_CHORDS = (
    0.35,
    6,
)  # px between an arc and its chords, and the smallest number of chords; chosen
RING_CHORDS = 24  # chords of a ring around an arm's link: with fewer, a link would show through it
GEOM = mujoco.mjtObj.mjOBJ_GEOM
SKIN = mujoco.mjtObj.mjOBJ_SKIN
TENDON = mujoco.mjtObj.mjOBJ_TENDON
ROUND = [
    mujoco.mjtGeom.mjGEOM_SPHERE,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID,
]
CYLINDER = mujoco.mjtGeom.mjGEOM_CYLINDER
NOTHING = mujoco.mjtGeom.mjGEOM_NONE
Add = Callable[[mujoco.MjvScene], None]
Area = tuple[int, int, int, int]  # px from the top left: left, top, right, bottom


class Canvas:
    """A picture of `size` px of a model, from its camera `film`, which does not move.

    With `arms`, rings around links cast no shadows, and show on all sides.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, size: tuple[int, int], arms: bool = False
    ):
        self.model = model
        self.data = data
        self.size = size
        self.turn = data.cam("film").xmat.reshape(3, 3).copy()
        self.place = data.cam("film").xpos.copy()
        light = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_LIGHT, scene.SUN)
        # (3,), of what casts shadows on the floor
        if light < 0:
            self.sun = None
        else:
            self.sun = data.light_xdir[light].copy()
        self.steady = not any(
            model.light_castshadow & model.light_active
        )  # a lamp's shadow may be anywhere
        middle = (model.stat.center - self.place) @ -self.turn[:, 2]
        self.casts = casting(model, middle * camera.pixel(size), MIN_ARM_CAST if arms else 0.0)
        ball, widest = roundness(model) / (middle * camera.pixel(size))
        quality = model.vis.quality
        # also those of cylinders
        if ball < SMALL_RADIUS:
            quality.numstacks = FEW_STACKS
        else:
            quality.numstacks = facets(ball, np.pi, quality.numstacks)
        if arms:  # joints hide the round ends of links
            ball = model.geom_size[model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE, 0].max(
                initial=0.0
            )
            ball /= middle * camera.pixel(size)
            quality.numstacks = min(
                max(facets(ball, np.pi, quality.numstacks), MIN_CHORDS), quality.numstacks
            )
        quality.numslices = max(facets(widest, 2 * np.pi, quality.numslices), RING_CHORDS * arms)
        self.renderer = gl.renderer(model, size[1], size[0])
        self.renderer.scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = 1
        bounded = [
            model.geom_type != scene.PLANE,
            np.ones(model.nskin, bool),
            self.casts & (self.sun is not None),
        ]
        self.bounded = np.concatenate(bounded)
        self.shapes = self.others = np.empty((0, 8, 2))
        self.picture = np.empty(0, np.uint8)

    def close(self) -> None:
        """Close the renderer."""
        self.renderer.close()

    def draw(self, add: Add = lambda scene: None, whole: bool = False) -> np.ndarray:
        """Return the picture of `data` as it is, (height, width, 3) uint8, read-only.

        `add` adds shapes to the scene, such as ghosts. If `whole`, all is drawn again, as after a
        change of colours.
        """
        shown = self.renderer.scene
        self.renderer.update_scene(self.data, camera="film")
        add(shown)
        geoms = list(shown.geoms[: shown.ngeom])
        others = [geom for geom in geoms if geom.objtype not in (GEOM, SKIN)]
        shapes = self.seen_shapes()
        loose = self.seen_others(others)
        if whole or not self.picture.size or not self.steady:
            areas = [(0, 0, *self.size)]
            self.shapes = shapes
            self.others = loose
        else:
            areas = self.changed(shapes, loose)
        if not areas:
            return self.picture
        if self.sun is None:
            cast = []
        else:
            cast = add_shadows(shown, self.sun, self.casts, self.model.stat.extent)
        boxes = self.boxes(geoms, cast, around(shapes), around(loose))

        def load(area: Area) -> int:
            return pixels(area) + RECTANGLE_COST + SHAPE_COST * int((~outside(boxes, area)).sum())

        geoms = list(shown.geoms[: shown.ngeom])
        if self.picture.size:
            picture = self.picture.copy()
        else:
            picture = np.empty((self.size[1], self.size[0], 3), np.uint8)
        views = [eye.frustum_top for eye in shown.camera]
        for area in joined(areas, load):
            left, top, right, bottom = area
            away = [geoms[i] for i in np.flatnonzero(outside(boxes, area))]
            kinds = [geom.type for geom in away]
            for geom in away:
                geom.type = NOTHING
            picture[top:bottom, left:right] = self.render(area, views)
            for geom, kind in zip(away, kinds, strict=True):
                geom.type = kind
        picture.flags.writeable = False
        self.picture = picture
        return picture

    def boxes(
        self, geoms: Sequence, casting: Sequence[int], shapes: np.ndarray, others: np.ndarray
    ) -> np.ndarray:
        """Return the rectangle of each geom of a scene and then of their shadows, (geoms + shadows,
        4) px.

        `casting` has the index of the geom that casts each shadow; `shapes` and `others` are the
        rectangles, (n, 4) px, of what `seen_shapes` and `seen_others` return.
        """
        model = self.model
        remaining = iter(others)
        boxes = []
        shadow_boxes = {}
        for i, geom in enumerate(geoms):
            if geom.objtype == GEOM and model.geom_type[geom.objid] == scene.PLANE:
                boxes.append(np.array([-np.inf, -np.inf, np.inf, np.inf]))
            elif geom.objtype in (GEOM, SKIN):
                boxes.append(shapes[geom.objid + model.ngeom * (geom.objtype == SKIN)])
            else:
                boxes.append(next(remaining))
            if geom.objtype == GEOM:
                shadow_boxes[i] = shapes[model.ngeom + model.nskin + geom.objid]
        shadow_boxes |= {
            i: next(remaining) for i, geom in enumerate(geoms) if geom.objtype == TENDON
        }
        return np.array([*boxes, *(shadow_boxes[i] for i in casting)]).reshape(-1, 4)

    def seen_shapes(self) -> np.ndarray:
        """Return where each geom, each skin and the shadow of each geom is in the picture: (shapes,
        8, 2) px.
        """
        shown = self.renderer.scene
        boxes = [scene.boxes(self.model, self.data)]
        vertices = np.asarray(shown.skinvert, float).reshape(-1, 3)
        for start, count in zip(
            shown.skinvertadr[: shown.nskin], shown.skinvertnum[: shown.nskin], strict=True
        ):
            skin = vertices[start : start + count]
            boxes.append(corners(skin.min(axis=0), skin.max(axis=0))[None])
        return self.seen(np.concatenate([*boxes, self.cast(boxes[0])]))

    def seen_others(self, others: Sequence) -> np.ndarray:
        """Return the same of geoms of the scene that are not the model's, such as ghosts and
        tendons.
        """
        points = [corners(*reach(geom)) @ geom.mat.T + geom.pos for geom in others]
        boxes = np.array(points).reshape(-1, 8, 3)
        return self.seen(
            np.concatenate([boxes, self.cast(boxes[[geom.objtype == TENDON for geom in others]])])
        )

    def cast(self, points: np.ndarray) -> np.ndarray:
        """Return the shadows of points (n, 8, 3) on the floor, (n, 8, 3); the points themselves if
        there are none.
        """
        if self.sun is None:
            return points
        return points - np.maximum(points[..., 2:], 0.0) / self.sun[2] * self.sun

    def seen(self, points: np.ndarray) -> np.ndarray:
        """Return where points (n, 8, 3) are in the picture, (n, 8, 2) px."""
        return camera.project(points.reshape(-1, 3), self.turn, self.place, self.size).reshape(
            -1, 8, 2
        )

    def changed(self, shapes: np.ndarray, others: np.ndarray) -> list[Area]:
        """Return the rectangles that must be drawn again: none if nothing has moved since it was
        last drawn.
        """
        moved = self.bounded & (np.abs(shapes - self.shapes).max(axis=(1, 2)) > MIN_MOTION)
        parts = [around(np.concatenate([shapes[moved], self.shapes[moved]], axis=1))]
        self.shapes[moved] = shapes[moved]
        gap = np.full((len(others), len(self.others)), np.inf)
        if gap.size:
            gap = np.abs(others[:, None] - self.others[None]).max(axis=(2, 3))
        new = gap.min(axis=1, initial=np.inf) > MIN_MOTION
        gone = gap.min(axis=0, initial=np.inf) > MIN_MOTION
        parts += [around(others[new]), around(self.others[gone])]
        if gap.size:
            self.others = np.concatenate([self.others[~gone], others[new]])
        else:
            self.others = others
        boxes = np.concatenate(parts)
        boxes = np.concatenate(
            [np.floor(boxes[:, :2]) - EDGE_MARGIN, np.ceil(boxes[:, 2:]) + EDGE_MARGIN], axis=1
        )
        boxes = boxes.clip(0, [*self.size, *self.size]).astype(int)
        inside = [(a, b, c, d) for a, b, c, d in boxes.tolist() if a < c and b < d]
        return joined(inside, lambda area: pixels(area) + RECTANGLE_COST)

    def render(self, area: Area, views: Sequence[float]) -> np.ndarray:
        """Return a part of the picture; `views` are the tops of the whole views of the scene's
        cameras.
        """
        left, top, right, bottom = area
        (width, height), renderer = self.size, self.renderer
        for eye, high in zip(renderer.scene.camera, views, strict=True):
            px = 2 * high / height
            eye.frustum_top = high - px * top
            eye.frustum_bottom = high - px * bottom
            eye.frustum_center = px * ((left + right) - width) / 2
            eye.frustum_width = px * (right - left) / 2
        out = np.empty((bottom - top, right - left, 3), np.uint8)
        rect = mujoco.MjrRect(0, 0, right - left, bottom - top)
        context = renderer._mjr_context
        if renderer._gl_context:  # Renderer.render draws whole pictures only
            renderer._gl_context.make_current()
        mujoco.mjr_render(rect, renderer.scene, context)
        mujoco.mjr_readPixels(out, None, rect, context)
        return out[::-1]


def around(points: np.ndarray) -> np.ndarray:
    """Return the rectangle around each shape's points (shapes, m, 2): (shapes, 4) px, left, top,
    right, bottom.
    """
    if not len(points):
        return np.empty((0, 4))
    return np.concatenate([points.min(axis=1), points.max(axis=1)], axis=1)


def joined(areas: Sequence[Area], load: Callable[[Area], int]) -> list[Area]:
    """Return fewer rectangles that cover all: two are joined where this lowers their load, the time
    to draw them.
    """
    covering: list[Area] = []
    for area in areas:
        new = area
        k = 0
        while k < len(covering):
            a, b, c, d = covering[k]
            both = min(a, new[0]), min(b, new[1]), max(c, new[2]), max(d, new[3])
            k += 1
            if load(both) <= load(covering[k - 1]) + load(new):
                del covering[k - 1]
                new, k = both, 0  # it may now be close to those that were too far away
        covering.append(new)
    return covering


def pixels(area: Area) -> int:
    """Return the number of pixels in an area."""
    return (area[2] - area[0]) * (area[3] - area[1])


def roundness(model: mujoco.MjModel) -> np.ndarray:
    """Return the largest radius, m, of the model's shapes that are round on all sides, and of these
    and cylinders.
    """
    long = np.isin(model.geom_type, [mujoco.mjtGeom.mjGEOM_CAPSULE, CYLINDER])
    size = np.where(long, model.geom_size[:, 0], model.geom_size.max(axis=1))
    return np.array(
        [
            size[np.isin(model.geom_type, kinds)].max(initial=0.0)
            for kinds in (ROUND, [*ROUND, CYLINDER])
        ]
    )


def facets(radius: float, angle: float, max_chords: int) -> int:
    """Return how many chords of an arc are within CHORD_GAP of it: its radius in px, its angle in
    rad.
    """
    return int(
        np.clip(
            np.ceil(angle * np.sqrt(radius / (8 * CHORD_GAP))),
            min(MIN_CHORDS, max_chords),
            max_chords,
        )
    )


def outside(boxes: np.ndarray, area: Area) -> np.ndarray:
    """Return which rectangles (n, 4) have nothing in common with an area, (n,)."""
    left, top, right, bottom = area
    return (
        (boxes[:, 0] > right) | (boxes[:, 2] < left) | (boxes[:, 1] > bottom) | (boxes[:, 3] < top)
    )


def reach(geom: mujoco.MjvGeom) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and highest corner of a box in a geom's frame, (3,) m, that has all of the
    geom in it.
    """
    width, _, long = geom.size
    if geom.type == mujoco.mjtGeom.mjGEOM_CAPSULE:
        half = np.array([width, width, long + width])
    else:
        half = 2.0 * (geom.size + width)  # sizes of some kinds are not in all directions
    return -half, half


def corners(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the corners of a box, (8, 3)."""
    return np.array(list(itertools.product(*zip(low, high, strict=True))))


def flattening(way: np.ndarray) -> np.ndarray:
    """Return the matrix, (3, 3), that casts points to the floor along a light's direction `way`."""
    matrix = np.diag([1.0, 1.0, THICKNESS])
    matrix[:2, 2] = -way[:2] / way[2]
    return matrix


def casting(model: mujoco.MjModel, pixel: float, flat: float = 0.0) -> np.ndarray:
    """Return which geoms cast shadows if opaque, (geoms,): not thin or flat ones; `pixel` is the
    size of one, m.
    """
    thinnest = (
        np.where(model.geom_type == mujoco.mjtGeom.mjGEOM_BOX, MIN_BOX_CAST, MIN_CAST) * pixel
    )
    half = np.sort(model.geom_aabb[:, 3:], axis=1)
    return (half[:, 1] > thinnest) & (half[:, 0] > flat * pixel) & (model.geom_type != scene.PLANE)


def add_shadows(
    shown: mujoco.MjvScene, way: np.ndarray, casts: np.ndarray, extent: float
) -> list[int]:
    """Add the shadows of a scene's geoms, (geoms,) as `casting` returns, and of its tendons; return
    what casts each.
    """
    cast = flattening(way)
    rise = np.array([0.0, 0.0, FLOOR_DISTANCE * extent])
    rgba = np.array([*np.array(SHADE) / SHADOW_EMISSION, 1.0], np.float32)
    casting: list[int] = []
    for i, shape in enumerate(list(shown.geoms[: shown.ngeom])):
        if shape.rgba[3] < 1.0 or not (
            casts[shape.objid] if shape.objtype == GEOM else shape.objtype == TENDON
        ):
            continue
        if shown.ngeom >= shown.maxgeom:
            return casting
        shadow = shown.geoms[shown.ngeom]
        mujoco.mjv_initGeom(
            shadow,
            shape.type,
            shape.size,
            cast @ shape.pos + rise,
            (cast @ shape.mat).ravel(),
            rgba,
        )
        shadow.dataid = shape.dataid
        shadow.objtype = mujoco.mjtObj.mjOBJ_UNKNOWN
        shadow.emission = SHADOW_EMISSION
        shadow.specular = 0.0
        shown.ngeom += 1
        casting.append(i)
    return casting
