"""The parts of a picture that change from one frame to the next: the rest is kept, since a
processor takes most of a film's time to fill pixels.
"""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw.film import camera

PLACE, TURN, SIZE = slice(0, 3), slice(3, 12), slice(12, 15)  # columns of a shape's look
KIND, MESH = 19, 20
CAPSULE, OF_MESH = int(mujoco.mjtGeom.mjGEOM_CAPSULE), int(mujoco.mjtGeom.mjGEOM_MESH)
BOXED = [  # kinds of shapes whose sizes say how far they reach
    int(mujoco.mjtGeom.mjGEOM_SPHERE),
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID),
    int(mujoco.mjtGeom.mjGEOM_CYLINDER),
    int(mujoco.mjtGeom.mjGEOM_BOX),
    CAPSULE,
    OF_MESH,
]
RIM = 2  # px, around a shape, that its smooth edges take
PART_COST = 26_000  # px, whose filling takes as long as what each part takes beside it
Box = tuple[int, int, int, int]  # left, top, right, bottom, px


class Look(NamedTuple):
    """What the picture of a scene depends on."""

    eye: Array  # the camera's place, and its directions forward and up, (3, 3)
    lights: bytes
    shapes: Array  # (shapes, columns)

    @classmethod
    def of(cls, scene: mujoco.MjvScene) -> "Look | None":
        """Return the look of a scene; None if a shape may change the picture elsewhere, as by its
        shadow or reflection, or has no place of its own, as a skin has none.
        """
        lights = scene.lights[: scene.nlight]
        shapes = scene.geoms[: scene.ngeom]
        apart = any(light.castshadow for light in lights)
        apart = apart or any(shape.reflectance > 0.0 for shape in shapes)
        if apart or scene.nskin or scene.nflex:
            return None
        rows = []
        for shape in shapes:
            look = (shape.type, shape.dataid, shape.matid, shape.emission)
            rows.append(
                np.concatenate([shape.pos, shape.mat.ravel(), shape.size, shape.rgba, look])
            )
        of_lights = [part.tobytes() for light in lights for part in (light.pos, light.dir)]
        eyes = [(view.pos, view.forward, view.up) for view in scene.camera]  # MuJoCo draws between
        eye = np.mean(eyes, axis=0)
        return cls(eye, b"".join(of_lights), np.array(rows))

    def changed(
        self, before: "Look | None", model: mujoco.MjModel, size: tuple[int, int]
    ) -> Sequence[Box] | None:
        """Return the parts of a picture of some size, px, that differ from one before; None if all
        of it may, or if it takes less time to draw all of it.
        """
        if (
            before is None
            or before.lights != self.lights
            or before.shapes.shape != self.shapes.shape
            or not np.array_equal(before.eye, self.eye)
        ):
            return None
        moved = (before.shapes != self.shapes).any(axis=1)
        boxes = []
        for look in (before, self):
            shapes = look.shapes[moved]
            if not np.isin(shapes[:, KIND], BOXED).all():
                return None
            points = corners(shapes, model)
            place, forward, up = self.eye
            turn = np.column_stack([np.cross(forward, up), up, -forward])
            if ((points - place) @ forward <= 0.0).any():
                return None
            boxes.append(camera.project(points.reshape(-1, 3), turn, place, size).reshape(-1, 8, 2))
        pixels = np.concatenate(boxes, axis=1)
        low = np.floor(pixels.min(axis=1)).clip(RIM, size) - RIM
        high = np.ceil(pixels.max(axis=1)).clip(-RIM, np.array(size) - RIM) + RIM
        parts: list[Box] = []
        for left_edge, top, right, bottom in np.hstack([low, high]).astype(int).tolist():
            if left_edge < right and top < bottom:
                join(parts, (left_edge, top, right, bottom))
        cost = sum(area(part) + PART_COST for part in parts)
        return parts if cost < size[0] * size[1] else None


def corners(shapes: Array, model: mujoco.MjModel) -> Array:
    """Return the corners of the boxes around shapes, (shapes, 8, 3) m."""
    half = shapes[:, SIZE].copy()
    half[shapes[:, KIND] == CAPSULE, 2] += half[shapes[:, KIND] == CAPSULE, 0]
    for i in np.flatnonzero(shapes[:, KIND] == OF_MESH).tolist():
        mesh = int(shapes[i, MESH]) // 2  # even for the mesh, odd for its hull
        first = model.mesh_vertadr[mesh]
        points = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        half[i] = np.abs(points).max(axis=0)
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, 8).T
    turns = shapes[:, TURN].reshape(-1, 3, 3)
    return shapes[:, None, PLACE] + np.einsum("sij,scj->sci", turns, half[:, None] * signs)


def join(parts: list[Box], box: Box) -> None:
    """Add a box to parts, in one with those beside which that takes less time."""
    for i, part in enumerate(parts):
        union = (
            min(box[0], part[0]),
            min(box[1], part[1]),
            max(box[2], part[2]),
            max(box[3], part[3]),
        )
        if area(union) <= area(box) + area(part) + PART_COST:
            del parts[i]
            join(parts, union)
            return
    parts.append(box)


def area(box: Box) -> int:
    """Return the number of pixels of a box."""
    return (box[2] - box[0]) * (box[3] - box[1])
