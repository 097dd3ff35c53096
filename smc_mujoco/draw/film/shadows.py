"""Shadows on the floor, drawn as flattened copies of what casts them.

A directional light casts a point (x, y, z) to the floor along its direction w, to (x, y, z) - z w / w_z. As this is
linear, a shape's shadow is the same shape under another matrix. Its edges are as smooth as all others. MuJoCo looks its
shadows up in a picture from the light: they have saw-tooth edges, and take as long to draw as all the rest.
"""

import mujoco
import numpy as np

THICKNESS = 1e-4  # of a shadow, of its shape's height: normals of a flat shape would be undefined
FLOOR_DISTANCE = 4e-4  # of the model's extent: height of shadows over the floor
EMISSION = 20.0  # so large that a shadow is as dark whichever light falls on it
SHADE = (0.70, 0.715, 0.74)  # red, green, blue of the floor in shadow, chosen
MIN_SIZE, MIN_BOX_SIZE = 1.0, 3.0  # px: half the thickness of shapes, and of boxes such as scale marks, with a shadow
MIN_ARM_SIZE = 3.0  # px, the same of rings around an arm's links, which are in the shadow of the links
PLANE, BOX = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_BOX
GEOM, TENDON = mujoco.mjtObj.mjOBJ_GEOM, mujoco.mjtObj.mjOBJ_TENDON


def flattening(way: np.ndarray) -> np.ndarray:
    """Return the matrix, (3, 3), that casts points to the floor along a light's direction `way`."""
    matrix = np.diag([1.0, 1.0, THICKNESS])
    matrix[:2, 2] = -way[:2] / way[2]
    return matrix


def casting(model: mujoco.MjModel, pixel: float, flat: float = 0.0) -> np.ndarray:
    """Return which geoms cast shadows, (geoms,): opaque ones, neither thin nor flat; `pixel` is the size of one, m."""
    thinnest = np.where(model.geom_type == BOX, MIN_BOX_SIZE, MIN_SIZE) * pixel
    half = np.sort(model.geom_aabb[:, 3:], axis=1)
    return (half[:, 1] > thinnest) & (half[:, 0] > flat * pixel) & (model.geom_type != PLANE)


def draw(scene: mujoco.MjvScene, way: np.ndarray, casts: np.ndarray, extent: float) -> list[int]:
    """Add the shadows of a scene's geoms, (geoms,) as `casting` returns, and of its tendons; return what casts each."""
    cast, rise = flattening(way), np.array([0.0, 0.0, FLOOR_DISTANCE * extent])
    rgba = np.array([*np.array(SHADE) / EMISSION, 1.0], np.float32)
    casting: list[int] = []
    for i, shape in enumerate(list(scene.geoms[: scene.ngeom])):
        if shape.rgba[3] < 1.0 or not (casts[shape.objid] if shape.objtype == GEOM else shape.objtype == TENDON):
            continue
        if scene.ngeom >= scene.maxgeom:
            return casting
        shadow = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(shadow, shape.type, shape.size, cast @ shape.pos + rise, (cast @ shape.mat).ravel(), rgba)
        shadow.dataid, shadow.objtype, shadow.emission = shape.dataid, mujoco.mjtObj.mjOBJ_UNKNOWN, EMISSION
        shadow.specular = 0.0
        scene.ngeom += 1
        casting.append(i)
    return casting
