"""Rendering of the scene with shadows on the floor.

Shadows are flattened copies of what casts them. A directional light casts a point (x, y, z) along
its direction w to the floor, at (x, y, z) - z w / w_z. As this is linear, a shape's shadow is the
same shape under another matrix, with edges as smooth as all others. MuJoCo looks its own shadows up
in a picture from the light: they have saw-tooth edges, and take as long to draw as all the rest.
"""

from collections.abc import Callable

import mujoco
import numpy as np
from PIL import Image

from smc_mujoco.common import gl
from smc_mujoco.common.aliases import Array
from smc_mujoco.draw import style
from smc_mujoco.draw.film import camera, world
from smc_mujoco.draw.film.changes import Look
from smc_mujoco.draw.film.dilation import widened

THICKNESS = 1e-4  # of a shadow, of its shape's height: normals of a flat shape would be undefined
FLOOR_DISTANCE = 4e-4  # of the model's extent: height of shadows over the floor
SHADOW_EMISSION = 20.0  # so large that a shadow is as dark whichever light falls on it
SHADE = (0.70, 0.715, 0.74)  # red, green, blue of the floor in shadow, chosen
MIN_CAST = 1.0  # px, half the least thickness of what casts a shadow
MIN_BOX_CAST = 3.0  # px, the same of boxes, as scale marks are
OUTLINE_OPACITY = 0.75  # of the line around where the reference wants a machine; chosen
GEOM = mujoco.mjtObj.mjOBJ_GEOM
FLAT = mujoco.mjtRndFlag.mjRND_SEGMENT  # colours without light
FOG = mujoco.mjtRndFlag.mjRND_FOG
SKY = mujoco.mjtRndFlag.mjRND_SKYBOX


class Canvas:
    """A picture of `size` px of a model, from its camera `film`."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, size: tuple[int, int]):
        self.data = data
        self.size = size
        self.look: Look | None = None  # of the last picture
        self.picture = np.empty(0)
        light = data.light(world.SUN)
        self.sun = light.xdir.copy()
        self.extent = model.stat.extent
        eye = data.cam("film")
        way = eye.xmat.reshape(3, 3)[:, 2]
        middle = (eye.xpos - model.stat.center) @ way
        thinnest = middle * camera.pixel(size)
        self.casts = casting(model, thinnest)
        self.renderer = gl.renderer(model, size[1], size[0])
        self.option = mujoco.MjvOption()
        self.renderer.scene.flags[FOG] = 1
        # the last outline, which is kept while its shapes stand still, and how it looked
        self.outline: Image.Image | None = None
        self.outline_look = b""

    def close(self) -> None:
        """Close the renderer."""
        self.renderer.close()

    def draw(self, add: Callable[[mujoco.MjvScene], None]) -> Array:
        """Return the picture of `data` as it is, (height, width, 3) uint8; drawn where it differs
        from the last one.

        `add` adds shapes to the scene, such as ghosts.
        """
        scene = self.renderer.scene
        self.renderer.update_scene(self.data, "film", self.option)
        add(scene)
        add_shadows(scene, self.sun, self.casts, self.extent)
        look = Look.of(scene)
        parts = look and look.changed(self.look, self.renderer.model, self.size)
        if parts is None:
            self.picture = self.renderer.render()
        else:
            self.picture = self.picture.copy()
            for box in parts:
                left_edge, top, right, bottom = box
                self.picture[top:bottom, left_edge:right] = gl.part(self.renderer, box)
        self.picture.setflags(write=False)  # it is the next one's beginning
        self.look = look
        return self.picture

    def outlined(
        self, picture: Array, add: Callable[[mujoco.MjvScene], None], width: float
    ) -> Array:
        """Return a picture with the outline, of a width in px, of the white shapes that `add` adds
        to a scene, in one width; read-only. An outline that would be cut is not drawn.
        """
        scene = self.renderer.scene
        scene.ngeom = 0
        add(scene)
        if not scene.ngeom:
            return picture
        if (look := look_of(scene)) != self.outline_look:
            self.outline_look = look
            self.outline = self.outline_of(max(1, round(width)))
        if self.outline is None:
            return picture
        image = Image.fromarray(picture)
        image.paste(style.rgb(style.INK), (0, 0), self.outline)
        return np.asarray(image)

    def outline_of(self, width: int) -> Image.Image | None:
        """Return the opacity of the outline of the scene's white shapes, of a width in px; None if
        it would be cut.
        """
        scene = self.renderer.scene
        flags = scene.flags.copy()
        scene.flags[FLAT] = 1
        scene.flags[FOG] = scene.flags[SKY] = 0
        seen = self.renderer.render()[..., 0]  # white shapes on black
        scene.flags[:] = flags
        if not seen.any() or any(rim.any() for rim in (seen[0], seen[-1], seen[:, 0], seen[:, -1])):
            return None
        edge = Image.fromarray(widened(seen, width) - seen)
        return edge.point(lambda part: OUTLINE_OPACITY * part)


def look_of(scene: mujoco.MjvScene) -> bytes:
    """Return what a picture of a scene's shapes depends on: their places, turns and sizes, and the
    camera's place and directions.
    """
    eye = scene.camera[0]
    parts = [eye.pos, eye.forward, eye.up]
    for shape in scene.geoms[: scene.ngeom]:
        parts += [shape.pos, shape.mat, shape.size]
    return b"".join(part.tobytes() for part in parts)


def casting(model: mujoco.MjModel, pixel: float) -> Array:
    """Return which geoms cast shadows if opaque, (geoms,): not thin ones.

    `pixel` is the size of one, m.
    """
    box = model.geom_type == mujoco.mjtGeom.mjGEOM_BOX
    thinnest = np.where(box, MIN_BOX_CAST, MIN_CAST) * pixel
    half = np.sort(model.geom_aabb[:, 3:], axis=1)
    return (half[:, 1] > thinnest) & (model.geom_type != world.PLANE)


def add_shadows(shown: mujoco.MjvScene, way: Array, casts: Array, extent: float) -> None:
    """Add the shadows of a scene's opaque geoms, (geoms,) as `casting` returns, and tendons.

    `way` is the direction of the light, (3,).
    """
    flatten = np.diag([1.0, 1.0, THICKNESS])
    flatten[:2, 2] = -way[:2] / way[2]
    rise = np.array([0.0, 0.0, FLOOR_DISTANCE * extent])
    shade = np.array(SHADE) / SHADOW_EMISSION
    rgba = np.array([*shade, 1.0], np.float32)
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
