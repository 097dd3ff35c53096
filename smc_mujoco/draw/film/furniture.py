"""What a machine stands on, cut to what moves: a film shows the motion, and not the length of a rail."""

from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.draw.film import scene

MARGIN = 0.08  # of the size of what moves, on both sides of it, to which rails and columns are cut; chosen
SLENDER = 3.0  # a rail or column is longer than this many thicknesses; chosen
END = 0.06  # of a rail's length: what stands within it of an end is moved with the end; chosen
ROUND = [int(mujoco.mjtGeom.mjGEOM_CYLINDER), int(mujoco.mjtGeom.mjGEOM_CAPSULE)]
BOB, BOB_GROWTH = "bob", 1.3  # a pendulum's mass is the larger in films
DIAL, DIAL_OPACITY = ("face", "bezel"), 0.4  # a dial is the paler
FIELDS = ("geom_pos", "geom_size", "geom_aabb", "geom_group", "geom_sameframe")


def restyle(model: mujoco.MjModel) -> None:
    """Enlarge the bobs of pendulums, to which the eye should go, and make dials translucent."""
    names = [model.geom(i).name.rpartition("/")[2] for i in range(model.ngeom)]
    bobs, dial = np.flatnonzero(np.isin(names, BOB)), np.flatnonzero(np.isin(names, DIAL))
    model.geom_rgba[dial] = model.mat_rgba[model.geom_matid[dial]] * (1.0, 1.0, 1.0, DIAL_OPACITY)
    model.geom_matid[dial] = -1
    for field in (model.geom_size, model.geom_aabb, model.geom_rbound):
        field[bobs] *= BOB_GROWTH


def cut(models: Sequence[mujoco.MjModel], points: np.ndarray, slides: np.ndarray, own: bool) -> float:
    """Shorten columns, and rails along `slides`, (m, 3), to what moves, whose points are (m, 3) m, in all models.

    The foot of a column and the posts at the ends of a rail come closer, and marks beyond are hidden. Columns are cut
    of the library's `own` machines. Returns how far the foot came up, m.
    """
    model, data = models[0], mujoco.MjData(models[0])
    scene.forward(model, data)
    fixed = np.flatnonzero((model.body_weldid[model.geom_bodyid] == 0) & (model.geom_type != scene.PLANE))
    boxes, raised = scene.boxes(model, data)[fixed], 0.0
    margin = MARGIN * np.ptp(points, axis=0).max()
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    for axis in range(3) if len(fixed) else ():
        turned = np.abs(data.geom_xmat[fixed].reshape(-1, 3, 3)[:, axis])
        least, most, sides = boxes[..., axis].min(axis=1), boxes[..., axis].max(axis=1), np.ptp(boxes, axis=1)
        long = (sides[:, axis] > SLENDER * np.delete(sides, axis, axis=1).max(axis=1)) & (turned.max(axis=1) > 0.999)
        first, last = low[axis], high[axis]
        if axis == 2:
            first, last = min(least[~long & (most > first)].min(initial=first) - margin, first), np.inf
        if not long.any() or not (own if axis == 2 else (np.abs(slides[:, axis]) > 0.9).any()):
            continue
        start, stop = least[long].min(), most[long].max()
        first, last, near = max(first, start), min(last, stop), END * (stop - start)
        home = model.geom_bodyid[fixed] == model.geom_bodyid[fixed[0]]
        for k, geom in enumerate(fixed.tolist()):
            way, middle = np.zeros(3), 0.5 * (least[k] + most[k])
            if long[k]:
                a, b, side = max(least[k], first), min(most[k], last), int(turned[k].argmax())
                way[axis], longer = 0.5 * (a + b) - middle, 0.5 * (b - a - sides[k, axis])
                model.geom_size[geom, 1 if int(model.geom_type[geom]) in ROUND else side] += longer
                model.geom_aabb[geom, 3 + side] += longer
            elif home[k] and middle < start + near:
                way[axis] = first - start
            elif home[k] and middle > stop - near:
                way[axis] = last - stop
            elif axis < 2 and not first <= middle <= last:
                model.geom_group[geom] = scene.HIDDEN_GROUP
            if way.any():
                model.geom_sameframe[geom] = 0  # else MuJoCo takes it to be where its body is
            model.geom_pos[geom] += way @ data.xmat[model.geom_bodyid[geom]].reshape(3, 3)
        raised = first - start if axis == 2 else 0.0
    for other, name in ((other, name) for other in models[1:] for name in FIELDS):
        getattr(other, name)[fixed] = getattr(model, name)[fixed]
    return raised
