"""Rendering that draws again only the part of the picture that has changed.

Software OpenGL takes time in proportion to the pixels and the shapes that it draws. A new picture is the one before,
with a rectangle in it drawn anew: the smallest one around all that moved, where it was and where it is, with shadows.
Shapes outside the rectangle are left out meanwhile.
"""

import itertools
from collections.abc import Callable

import mujoco
import numpy as np

from smc_mujoco.common import gl
from smc_mujoco.draw.film import camera, scene, shadows

MOVED = 0.2  # px: a shape that has moved less since it was drawn is not drawn again; chosen
MARGIN = 3  # px around what has changed, for smoothed edges and soft shadows
HIDDEN = 5  # group of geoms and skins that are left out
GEOM = mujoco.mjtObj.mjOBJ_GEOM
Add = Callable[[mujoco.MjvScene], None]
Area = tuple[int, int, int, int]  # px from the top left: left, top, right, bottom


class Canvas:
    """A picture of `size` px of a model, from its camera `film`, which stands still."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, size: tuple[int, int]):
        self.model, self.data, self.size = model, data, size
        self.turn, self.place = data.cam("film").xmat.reshape(3, 3).copy(), data.cam("film").xpos.copy()
        self.sun = sun(model, data)
        self.steady = not any(model.light_castshadow & model.light_active)  # where lamps' shadows fall is not foretold
        middle = (model.stat.center - self.place) @ -self.turn[:, 2]
        self.casts = shadows.casting(model, middle * camera.pixel(size))
        self.renderer = gl.renderer(model, size[1], size[0])
        self.renderer.scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = 1
        self.groups = model.geom_group.copy(), model.skin_group.copy()
        self.bounded = np.append(model.geom_type != scene.PLANE, np.ones(model.nskin, bool))
        self.shapes = self.others = np.empty((0, 0, 2))
        self.picture = np.empty(0, np.uint8)

    def close(self) -> None:
        """Close the renderer."""
        self.renderer.close()

    def draw(self, add: Add = lambda scene: None, anew: bool = False) -> np.ndarray:
        """Return the picture of `data` as it is, (height, width, 3) uint8, read-only.

        Args:
          add: adds shapes to the scene, such as arrows.
          anew: whether all of it is drawn, as after changes of the model that are no motion.
        """
        self.renderer.update_scene(self.data, camera="film")
        add(self.renderer.scene)
        shapes, others = self.seen_shapes(), self.seen_others()
        whole = 0, 0, *self.size
        first = not self.picture.size
        area = whole if anew or first or not self.steady else self.changed(shapes, others)
        if area is None:
            return self.picture
        if area == whole:
            self.shapes, self.others = shapes, others
        else:
            self.hide(self.bounded & outside(around(shapes), area))
            self.renderer.update_scene(self.data, camera="film")
            add(self.renderer.scene)
            self.model.geom_group[:], self.model.skin_group[:] = self.groups
        if self.sun is not None:
            shadows.draw(self.renderer.scene, self.sun, self.casts, self.model.stat.extent)
        left, top, right, bottom = area
        picture = np.empty((self.size[1], self.size[0], 3), np.uint8) if area == whole else self.picture.copy()
        picture[top:bottom, left:right] = self.render(area)
        picture.flags.writeable = False
        self.picture = picture
        return picture

    def hide(self, away: np.ndarray) -> None:
        """Leave some geoms and skins, a mask (geoms + skins,), out of the scene."""
        self.model.geom_group[away[: self.model.ngeom]] = HIDDEN
        self.model.skin_group[away[self.model.ngeom :]] = HIDDEN

    def seen_shapes(self) -> np.ndarray:
        """Return corners of each geom and skin and of its shadow in the picture, (geoms + skins, m, 2) px."""
        seen, found = self.renderer.scene, [scene.boxes(self.model, self.data)]
        vertices = np.asarray(seen.skinvert, float).reshape(-1, 3)
        for start, count in zip(seen.skinvertadr[: seen.nskin], seen.skinvertnum[: seen.nskin], strict=True):
            part = vertices[start : start + count]
            found.append(corners(part.min(axis=0), part.max(axis=0))[None])
        return self.seen(np.concatenate(found))

    def seen_others(self) -> np.ndarray:
        """Return the same, (shapes, m, 2) px, of what is no geom of the model, such as arrows and tendons."""
        geoms = [geom for geom in self.renderer.scene.geoms[: self.renderer.scene.ngeom] if geom.objtype != GEOM]
        half = [np.array(geom.size) * (2.0, 2.0, 2.0) + 2.0 * geom.size[0] for geom in geoms]  # an arrow is inside
        points = [corners(-h, h) @ geom.mat.T + geom.pos for geom, h in zip(geoms, half, strict=True)]
        return self.seen(np.array(points).reshape(-1, 8, 3))

    def seen(self, points: np.ndarray) -> np.ndarray:
        """Return where points (shapes, m, 3) and their shadows on the floor are in the picture, (shapes, k m, 2) px."""
        height = np.maximum(points[..., 2:], 0.0)
        if self.sun is not None:
            points = np.concatenate([points, points - height / self.sun[2] * self.sun], axis=1)
        flat = camera.project(points.reshape(-1, 3), self.turn, self.place, self.size)
        return flat.reshape(*points.shape[:2], 2)

    def changed(self, shapes: np.ndarray, others: np.ndarray) -> Area | None:
        """Return the rectangle that must be drawn again; None if nothing has moved since it was last drawn."""
        moved = self.bounded & (np.abs(shapes - self.shapes).max(axis=(1, 2)) > MOVED)
        parts = [around(shapes[moved]), around(self.shapes[moved])]
        self.shapes[moved] = shapes[moved]
        gap = np.full((len(others), len(self.others)), np.inf)
        if gap.size:
            gap = np.abs(others[:, None] - self.others[None]).max(axis=(2, 3))
        new, gone = gap.min(axis=1, initial=np.inf) > MOVED, gap.min(axis=0, initial=np.inf) > MOVED
        parts += [around(others[new]), around(self.others[gone])]
        self.others = np.concatenate([self.others[~gone], others[new]]) if gap.size else others
        parts = np.concatenate(parts)
        if not len(parts):
            return None
        low, high = np.floor(parts[:, :2].min(axis=0)) - MARGIN, np.ceil(parts[:, 2:].max(axis=0)) + MARGIN
        left, top, right, bottom = np.clip([*low, *high], 0, [*self.size, *self.size]).astype(int).tolist()
        return (left, top, right, bottom) if left < right and top < bottom else None

    def render(self, area: Area) -> np.ndarray:
        """Return a part of the picture."""
        left, top, right, bottom = area
        (width, height), renderer = self.size, self.renderer
        for eye in renderer.scene.camera:
            high = eye.frustum_top  # before, the view is from -high to high
            px = 2 * high / height
            eye.frustum_top, eye.frustum_bottom = high - px * top, high - px * bottom
            eye.frustum_center, eye.frustum_width = px * ((left + right) - width) / 2, px * (right - left) / 2
        out = np.empty((bottom - top, right - left, 3), np.uint8)
        rect, context = mujoco.MjrRect(0, 0, right - left, bottom - top), renderer._mjr_context
        if renderer._gl_context:  # Renderer.render draws whole pictures only
            renderer._gl_context.make_current()
        mujoco.mjr_render(rect, renderer.scene, context)
        mujoco.mjr_readPixels(out, None, rect, context)
        return out[::-1]


def sun(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray | None:
    """Return the direction, (3,), of the light `scene.SUN`, which casts shadows on the floor; None without it."""
    light = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_LIGHT, scene.SUN)
    return None if light < 0 else data.light_xdir[light].copy()


def around(points: np.ndarray) -> np.ndarray:
    """Return the rectangle around each shape's points (shapes, m, 2): (shapes, 4) px, left, top, right, bottom."""
    if not len(points):
        return np.empty((0, 4))
    return np.concatenate([points.min(axis=1), points.max(axis=1)], axis=1)


def outside(boxes: np.ndarray, area: Area) -> np.ndarray:
    """Return which rectangles (n, 4) have nothing in common with an area, (n,)."""
    left, top, right, bottom = area
    return (boxes[:, 0] > right) | (boxes[:, 2] < left) | (boxes[:, 1] > bottom) | (boxes[:, 3] < top)


def corners(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the corners of a box, (8, 3)."""
    return np.array(list(itertools.product(*zip(low, high, strict=True))))
