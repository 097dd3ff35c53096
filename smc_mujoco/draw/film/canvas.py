"""Rendering of the scene with shadows on the floor.

Shadows are flattened copies of what casts them. A directional light casts a point (x, y, z) along
its direction w to the floor, at (x, y, z) - z w / w_z. As this is linear, a shape's shadow is the
same shape under another matrix, with edges as smooth as all others. MuJoCo looks its own shadows up
in a picture from the light: they have saw-tooth edges, and take as long to draw as all the rest.
"""

from collections.abc import Callable

import mujoco
import numpy as np
from PIL import Image, ImageChops, ImageFilter

from smc_mujoco.common import gl
from smc_mujoco.common.aliases import Array
from smc_mujoco.draw import style
from smc_mujoco.draw.film import camera, world

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

    def close(self) -> None:
        """Close the renderer."""
        self.renderer.close()

    def draw(self, add: Callable[[mujoco.MjvScene], None]) -> Array:
        """Return the picture of `data` as it is, (height, width, 3) uint8.

        `add` adds shapes to the scene, such as ghosts.
        """
        scene = self.renderer.scene
        self.renderer.update_scene(self.data, "film", self.option)
        add(scene)
        add_shadows(scene, self.sun, self.casts, self.extent)
        return self.renderer.render()

    def outlined(
        self, picture: Array, add: Callable[[mujoco.MjvScene], None], width: float
    ) -> Array:
        """Return a picture with the outline, of a width in px, of the white shapes that `add` adds
        to a scene; read-only. An outline that would be cut is not drawn.
        """
        scene = self.renderer.scene
        scene.ngeom = 0
        add(scene)
        if not scene.ngeom:
            return picture
        flags = scene.flags.copy()
        scene.flags[FLAT] = 1
        scene.flags[FOG] = scene.flags[SKY] = 0
        seen = Image.fromarray(self.renderer.render()[..., 0])  # white shapes on black
        scene.flags[:] = flags
        x0, y0, x1, y1 = seen.getbbox() or (0, 0, 0, 0)
        if x0 == 0 or y0 == 0 or x1 == seen.width or y1 == seen.height:
            return picture
        thick = 2 * max(1, round(width)) + 1
        edge = ImageChops.subtract(seen.filter(ImageFilter.MaxFilter(thick)), seen)
        image = Image.fromarray(picture)
        image.paste(style.rgb(style.INK), (0, 0), edge.point(lambda part: OUTLINE_OPACITY * part))
        return np.asarray(image)


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
