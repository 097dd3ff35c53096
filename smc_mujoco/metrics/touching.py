"""Where a machine touches something: its stops, an obstacle, or another part of itself.

Contact is what MuJoCo's collision detection says of the scenario's model, posed at each sample. A
touch that begins and ends between two samples does not count.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.mechanisms.hardware.contact import HIT
from smc_mujoco.mechanisms.layout import joint_ids
from smc_mujoco.metrics.once_per_trace import once_per_trace
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.run import poses
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace


class Shape(NamedTuple):
    """The model of a scenario's mechanism from a time on, s."""

    time: float
    model: mujoco.MjModel


def shapes(scenario: Scenario, scenery: bool = True) -> list[Shape]:
    """Return the mechanism at the start of a run, and after its jump; without `scenery`, as runs
    have it.
    """
    if scenery:
        compiled = models.compile_model(scenario)
    else:
        compiled = models.mechanism(scenario).model
    shapes_of_run = [Shape(0.0, models.with_values(compiled, scenario, 0))]
    if scenario.jump:
        step = scenario.jump_step
        model = models.with_values(compiled, scenario, step)
        shapes_of_run.append(Shape(step * scenario.resolved.physics_step, model))
    return shapes_of_run


@once_per_trace
def in_contact(trace: Trace) -> Array:
    """Return where each channel touches an obstacle or another channel, (K + 1, n)."""
    contact = np.zeros(trace.x.shape, bool)
    if not trace.scenario.contact:
        return contact
    parts = shapes(trace.scenario, scenery=False)
    data = [mujoco.MjData(shape.model) for shape in parts]
    places = parts[0].model.jnt_qposadr[joint_ids(parts[0].model)]
    tables = [_channels(shape.model) for shape in parts]
    if any(pairs for pairs, _ in tables):
        reacting = (trace.holding != 0.0).any(axis=1)
    else:
        reacting = np.zeros(len(trace.t), bool)
    moved = None
    if any(part.loose for part in trace.scenario.contact):
        moved = poses(trace, trace.t)
    for k in np.flatnonzero(reacting):
        now = sum(float(trace.t[k]) >= shape.time for shape in parts) - 1
        model, posed, (hits, owner) = parts[now].model, data[now], tables[now]
        if moved is not None:
            posed.qpos[:] = moved[k]
        posed.qpos[places] = trace.x[k]
        mujoco.mj_kinematics(model, posed)
        mujoco.mj_collision(model, posed)
        touches = posed.contact
        for geoms in touches.geom[touches.dist <= 0.0].tolist():
            if frozenset(geoms) in hits:
                channels = owner[model.geom_bodyid[geoms]]
                contact[k, channels[channels >= 0]] = True
    joints = joint_ids(parts[0].model)  # at their stops
    low, high = parts[0].model.jnt_range[joints].T
    stopped = (trace.x <= low) | (trace.x >= high)
    return contact | (stopped & (parts[0].model.jnt_limited[joints] > 0))


def touched(trace: Trace) -> bool | None:
    """Return whether the machine touched a stop or an obstacle at a sample of a run; None where
    the scenario's contact has neither, as with a floor that only rubs.
    """
    if not trace.scenario.contact:
        return None
    model = shapes(trace.scenario, scenery=False)[0].model
    hits, _ = _channels(model)
    if not hits and not model.jnt_limited[joint_ids(model)].any():
        return None
    return bool(in_contact(trace).any())


def _channels(model: mujoco.MjModel) -> tuple[set[frozenset[int]], Array]:
    """Return the pairs of geoms that hit each other, and the channel that moves each body, -1 if
    none does.
    """
    geoms = zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)
    hits = set()
    for i, pair in enumerate(geoms):
        if model.pair(i).name.startswith(HIT):
            hits.add(frozenset(pair))
    owner = np.full(model.nbody, -1)
    bodies = model.jnt_bodyid[joint_ids(model)].tolist()
    for body in range(1, model.nbody):
        if body in bodies:
            owner[body] = bodies.index(body)
        else:
            owner[body] = owner[model.body_parentid[body]]
    return hits, owner
