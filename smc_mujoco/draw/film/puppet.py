"""A machine as a film moves it: from the positions of its channels to the pose of its whole mechanism."""

from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.draw.film import scene
from smc_mujoco.draw.states import shapes
from smc_mujoco.mechanisms.hardware.part import ROTOR, joint_ids
from smc_mujoco.simulation import model as assembly
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

SLIDE = mujoco.mjtJoint.mjJNT_SLIDE
POSES = 24  # poses of a trace that must be in the picture
MAX_FIXED = (
    4.0  # size of a fixed thing of an own model, in sizes of what moves: larger ones may leave the picture; chosen
)
CLOSE = 0.6  # height of the part of a stand that must be in the picture, in sizes of what moves; chosen


class Puppet:
    """The machine of one scenario, with the channels that a film shows.

    Attributes:
      scenario: with as many channels as are shown.
      shapes: its compiled mechanism at the start of the run, and after its jump.
      slides: which channels slide, (shown,).
      rail: length of the rail on which a cart stays, m; inf without one.
      links: the bodies that the channels' joints move.
    """

    def __init__(self, scenario: Scenario):
        self.scenario = scene.first_channels(scenario)
        self.shapes = shapes(self.scenario)
        model = self.shapes[0].model
        ids = joint_ids(model)
        rotors = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, ROTOR + model.joint(i).name) for i in ids]
        self.slides = model.jnt_type[ids] == SLIDE
        self.rail = scene.rail(self.scenario, model)
        self._joints = model.jnt_qposadr[ids]
        self._rotors = [(k, model.jnt_qposadr[rotor]) for k, rotor in enumerate(rotors) if rotor >= 0]
        moved = set(model.jnt_bodyid[ids].tolist())
        for body in range(1, model.nbody):
            if model.body_parentid[body] in moved:
                moved.add(body)
        self.links = sorted(moved)
        own = self.scenario.plant.direct
        self._start = assembly.start(model, self.scenario)[0] if own else model.qpos0

    @property
    def shown(self) -> int:
        """The number of channels that are shown."""
        return self.scenario.plant.n

    def qpos(self, x: np.ndarray, ahead: np.ndarray | None = None, rest: np.ndarray | None = None) -> np.ndarray:
        """Return the pose, (nq,), with the channels at x, (shown,) rad or m; a cart stays on its rail.

        Args:
          ahead: lead of the rotors over their joints, (shown,) rad or m; default: none.
          rest: pose from which joints without a channel are taken, (nq,); default: that of the start.
        """
        found = (self._start if rest is None else rest).copy()
        x = np.where(self.slides, np.clip(x, -self.rail / 2, self.rail / 2), x)
        found[self._joints] = x
        for k, place in self._rotors:
            found[place] = x[k] if ahead is None else x[k] + ahead[k]
        return found

    def reach(self, trace: Trace) -> np.ndarray:
        """Return what must be in the picture, (points, 3) m from the machine's place.

        These are the corners of the boxes of all that moves, over the poses of its trace. Of what stands still they are
        those of the part that is close to it, such as the upper half of a stand.
        """
        data = [mujoco.MjData(shape.model) for shape in self.shapes]
        model, moved = self.shapes[0].model, []
        world = np.empty((0, 8, 3))
        fixed, plane = model.body_weldid[model.geom_bodyid] == 0, model.geom_type == scene.PLANE
        for part in np.linspace(0.0, 1.0, POSES) ** 2:  # most of the motion is early
            sample = round(part * (len(trace.t) - 1))
            now = self.shape(float(trace.t[sample]))
            data[now].qpos[:] = self.qpos(trace.x[sample, : self.shown])
            scene.forward(self.shapes[now].model, data[now])
            world = scene.boxes(self.shapes[now].model, data[now])
            moved.append(world[~fixed & ~plane].reshape(-1, 3))
        points, still = np.concatenate(moved), world[fixed & ~plane]
        if not len(points):
            return still.reshape(-1, 3)
        low, high = points.min(axis=0), points.max(axis=0)
        size = (high - low).max()
        if self.scenario.plant.direct:
            still = still[np.ptp(still, axis=1).max(axis=1) < MAX_FIXED * size]
        still = still.reshape(-1, 3)
        still[:, 2] = still[:, 2].clip(low[2] - CLOSE * size, high[2] + CLOSE * size)
        return np.concatenate([points, still])

    def shape(self, time: float) -> int:
        """Return the index of the shape at a time, s."""
        return sum(time >= shape.time for shape in self.shapes) - 1


def places(puppets: Sequence[Puppet], reaches: Sequence[np.ndarray], turn: np.ndarray) -> np.ndarray:
    """Return where the machines stand, (machines, 3) m: side by side, on the floor."""
    scenarios = [puppet.scenario for puppet in puppets]
    step = scene.lane(scenarios, reaches, turn)
    found = step * (np.arange(len(puppets)) - (len(puppets) - 1) / 2)[:, None]
    if scenarios[0].plant.direct:
        found[:, 2] += [scene.depth(puppet.shapes[0].model) for puppet in puppets]
    return found
