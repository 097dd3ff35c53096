"""Rendering that draws again only the part of the picture that has changed.

Software OpenGL takes time in proportion to the pixels that it draws. So a new picture is a copy of
the one before, in which one rectangle is drawn again: the one around everything that has moved,
where it was and where it is, and around its shadow.

Shadows on the floor are flattened copies of what casts them. A directional light casts a point (x,
y, z) along its direction w to the floor, at (x, y, z) - z w / w_z. As this is linear, a shape's
shadow is the same shape under another matrix, with edges as smooth as all others. MuJoCo looks its
own shadows up in a picture from the light: they have saw-tooth edges, and take as long to draw as
all the rest.
"""

from collections.abc import Callable

import mujoco
import numpy as np

from smc_mujoco.common import gl
from smc_mujoco.draw.film import camera, scene

THICKNESS = 1e-4  # of a shadow, of its shape's height: normals of a flat shape would be undefined
FLOOR_DISTANCE = 4e-4  # of the model's extent: height of shadows over the floor
SHADOW_EMISSION = 20.0  # so large that a shadow is as dark whichever light falls on it
SHADE = (0.70, 0.715, 0.74)  # red, green, blue of the floor in shadow, chosen
MIN_CAST = 1.0  # px, half the least thickness of what casts a shadow
MIN_BOX_CAST = 3.0  # px, the same of boxes, as scale marks are
MIN_ARM_CAST = 3.0  # px, the same of rings around an arm's links, which the links shade
MIN_MOTION = 0.2  # px: a shape that has moved less since it was drawn is not drawn again; chosen
EDGE_MARGIN = 3  # px around what has changed, for smoothed edges
GEOM = mujoco.mjtObj.mjOBJ_GEOM

Add = Callable[[mujoco.MjvScene], None]


class Canvas:
    """A picture of `size` px of a model, from its camera `film`, which does not move.

    With `arms`, rings around links cast no shadows.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, size: tuple[int, int], arms: bool = False
    ):
        self.model = model
        self.data = data
        self.size = size
        self.turn = data.cam("film").xmat.reshape(3, 3).copy()
        self.place = data.cam("film").xpos.copy()
        self.sun = data.light(scene.SUN).xdir.copy()
        middle = (model.stat.center - self.place) @ -self.turn[:, 2]
        self.casts = casting(model, middle * camera.pixel(size), arms)
        self.renderer = gl.renderer(model, size[1], size[0])
        self.renderer.scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = 1
        self.picture = np.empty((size[1], size[0], 3), np.uint8)
        self.boxes = np.empty((0, 8, 2))

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
        add_shadows(shown, self.sun, self.casts, self.model.stat.extent)
        boxes = self.seen(shown)
        area = (0, 0, *self.size)
        if whole or len(boxes) != len(self.boxes):
            self.boxes = boxes
        else:
            moved = np.abs(boxes - self.boxes).max(axis=(1, 2)) > MIN_MOTION
            points = np.concatenate([boxes[moved], self.boxes[moved]]).reshape(-1, 2)
            if not len(points):
                return self.picture
            self.boxes[moved] = boxes[moved]
            low = (np.floor(points.min(axis=0)) - EDGE_MARGIN).clip(0, self.size)
            high = (np.ceil(points.max(axis=0)) + EDGE_MARGIN).clip(0, self.size)
            area = tuple(np.concatenate([low, high]).astype(int).tolist())
        left, top, right, bottom = area
        if left < right and top < bottom:
            self.picture = self.picture.copy()
            self.picture[top:bottom, left:right] = self.render(left, top, right, bottom)
            self.picture.flags.writeable = False
        return self.picture

    def seen(self, shown: mujoco.MjvScene) -> np.ndarray:
        """Return where the corners of a box around each geom of a scene are in the picture.

        They are (geoms, 8, 2) px; 0 for planes, which do not move.
        """
        boxes = np.zeros((shown.ngeom, 8, 3))
        vertices = np.asarray(shown.skinvert, float).reshape(-1, 3)
        for box, geom in zip(boxes, shown.geoms, strict=False):
            if geom.type == scene.PLANE:
                continue
            if geom.objtype == mujoco.mjtObj.mjOBJ_SKIN:
                start = shown.skinvertadr[geom.objid]
                skin = vertices[start : start + shown.skinvertnum[geom.objid]]
                box[:] = np.where(scene.CORNERS > 0, skin.max(axis=0), skin.min(axis=0))
                continue
            centre = np.zeros(3)
            half = 2.0 * (geom.size + geom.size[0])  # sizes of some kinds are not in all directions
            if geom.objtype == GEOM and geom.type != scene.CAPSULE:  # a run may change capsules
                centre = self.model.geom_aabb[geom.objid, :3]
                half = self.model.geom_aabb[geom.objid, 3:]
            box[:] = (centre + scene.CORNERS * half) @ geom.mat.T + geom.pos
        points = camera.project(boxes.reshape(-1, 3), self.turn, self.place, self.size)
        return points.reshape(-1, 8, 2)

    def render(self, left: int, top: int, right: int, bottom: int) -> np.ndarray:
        """Return a part of the picture."""
        renderer = self.renderer
        width, height = self.size
        for eye in renderer.scene.camera:
            high = eye.frustum_top
            px = 2 * high / height
            eye.frustum_top = high - px * top
            eye.frustum_bottom = high - px * bottom
            eye.frustum_center = px * ((left + right) - width) / 2
            eye.frustum_width = px * (right - left) / 2
        out = np.empty((bottom - top, right - left, 3), np.uint8)
        rect = mujoco.MjrRect(0, 0, right - left, bottom - top)
        if renderer._gl_context:  # Renderer.render draws whole pictures only
            renderer._gl_context.make_current()
        mujoco.mjr_render(rect, renderer.scene, renderer._mjr_context)
        mujoco.mjr_readPixels(out, None, rect, renderer._mjr_context)
        return out[::-1]


def casting(model: mujoco.MjModel, pixel: float, arms: bool) -> np.ndarray:
    """Return which geoms cast shadows if opaque, (geoms,): not thin or flat ones.

    `pixel` is the size of one, m.
    """
    box = model.geom_type == mujoco.mjtGeom.mjGEOM_BOX
    thinnest = np.where(box, MIN_BOX_CAST, MIN_CAST) * pixel
    flattest = MIN_ARM_CAST * pixel if arms else 0.0
    half = np.sort(model.geom_aabb[:, 3:], axis=1)
    return (half[:, 1] > thinnest) & (half[:, 0] > flattest) & (model.geom_type != scene.PLANE)


def add_shadows(shown: mujoco.MjvScene, way: np.ndarray, casts: np.ndarray, extent: float) -> None:
    """Add the shadows of a scene's opaque geoms, (geoms,) as `casting` returns, and tendons.

    `way` is the direction of the light, (3,).
    """
    flatten = np.diag([1.0, 1.0, THICKNESS])
    flatten[:2, 2] = -way[:2] / way[2]
    rise = np.array([0.0, 0.0, FLOOR_DISTANCE * extent])
    rgba = np.array([*np.array(SHADE) / SHADOW_EMISSION, 1.0], np.float32)
    for shape in list(shown.geoms[: shown.ngeom]):
        if shape.objtype == GEOM:
            cast = casts[shape.objid]
        else:
            cast = shape.objtype == mujoco.mjtObj.mjOBJ_TENDON
        if not cast or shape.rgba[3] < 1.0 or shown.ngeom >= shown.maxgeom:
            continue
        shadow = shown.geoms[shown.ngeom]
        place = flatten @ shape.pos + rise
        turn = (flatten @ shape.mat).ravel()
        mujoco.mjv_initGeom(shadow, shape.type, shape.size, place, turn, rgba)
        shadow.dataid = shape.dataid
        shadow.objtype = mujoco.mjtObj.mjOBJ_UNKNOWN
        shadow.emission = SHADOW_EMISSION
        shadow.specular = 0.0
        shown.ngeom += 1
