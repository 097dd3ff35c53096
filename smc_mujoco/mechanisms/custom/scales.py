"""Scales of a user's joints from MuJoCo, at the default goal, with or without a nominal model.

Tuning and the default bound on u need them.
"""

import copy
import functools
import math
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array, Floats
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.mjcb import silence
from smc_mujoco.mechanisms.custom.channels import ONE_JOINT
from smc_mujoco.mechanisms.custom.clearance import DEPTH, TOUCH, deepest, overlap
from smc_mujoco.mechanisms.layout import (
    channel_names,
    dof_ids,
    driven_ids,
    initial_pose,
    joint_ids,
    loaded,
    posed,
)
from smc_mujoco.mechanisms.plant import MAX_EXCESS, Plant

# All chosen; the need's terms were each missed by a machine that did not arrive without it.
STEP = 1e-5  # rad or m, and rad/s or m/s, of central differences
BESIDE = 0.3  # rad or m: how far beside its goal a joint starts by default
ROOM = 0.6  # of the way to a limit, at most
POSES_OF_LOAD = 9  # from the start to the goal, and between the limits, in which the load is taken
HALVINGS = 5  # of this way, where it ends inside something
FARTHEST = 1.2  # of this way: where the runs of a grid start, which spread by 20 %
HOLD = 2.0  # s for which a plant on a free base is held; its load is that of the second half
STIFF = 100.0  # rad/s, of the PD that holds it
STIFFNESS = 60.0  # 1/s^2, of the inertia, in the need
DAMPING = 8.0  # 1/s, of the damping, in the need
MOST = 100.0  # of the need: a larger bound on u is no scale
UNSTABLE = mujoco.mjtWarning.mjWARN_BADQACC.value
TIPPED = 0.5  # the cosine of 60 degrees
ROUNDS = 4  # of T and the mobility, which depend on each other


class AtGoal(NamedTuple):
    """M a + D v + K x = force about the goal, of all degrees of freedom, (nv, nv) each."""

    M: Array
    D: Array
    K: Array
    dofs: Array  # of the driven channels, (driven,)
    load: Array  # N m or N, of the driven channels, (driven,), as the next
    dry: Array
    strayed: float  # how far the base moves while it is held, in its own sizes; 0 if it is fixed


def _at(plant: Plant, x: Floats) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return a model of one's own, and its data with the channels at x, (n,) rad or m."""
    model = copy.copy(loaded(plant))
    data = posed(model, x)
    mujoco.mj_forward(model, data)
    return model, data


def _forces(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Return what springs, servos, dampers and gravity exert, (nv,)."""
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_fwdActuation(model, data)
    return data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias


@functools.lru_cache(maxsize=32)
def at_goal(plant: Plant, share: float = 0.0) -> AtGoal:
    """Return what moves a plant's joints about their default goal, or a share of the way from it to
    where runs begin.
    """
    goal = np.array(plant.rest or plant.origin)
    start = np.array(usual_start(plant)) if share else goal
    pose = goal + share * (start - goal)
    model, data = _at(plant, tuple(pose.tolist()))
    dofs = dof_ids(model)[: plant.driven]
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    load = -_forces(model, data)[dofs]
    start = data.qpos.copy()
    K = np.zeros_like(M)
    D = np.zeros_like(M)
    for j, step in enumerate(STEP * np.eye(model.nv)):
        for sign in (0.5, -0.5):
            mujoco.mj_integratePos(model, data.qpos, step, 2.0 * sign)
            K[:, j] -= sign * _forces(model, data) / STEP
            data.qpos[:] = start
            data.qvel[:] = 2.0 * sign * step
            D[:, j] -= sign * _forces(model, data) / STEP
            data.qvel[:] = 0.0
    strayed = 0.0
    if base := free_base(model):
        load, strayed = _held(model, data, base, load, M)
    return AtGoal(M, D, K, dofs, load, model.dof_frictionloss[dofs], strayed)


def free_base(model: mujoco.MjModel) -> int:
    """Return the body that carries the first channel and moves in two ways or more, none of them
    driven; 0 if there is none.
    """
    body = model.jnt_bodyid[driven_ids(model)[0]]
    base = int(model.body_rootid[body])
    first = model.body_jntadr[base]
    joints = np.arange(first, first + model.body_jntnum[base])
    on_joints = np.isin(model.actuator_trntype, ONE_JOINT)
    if np.isin(joints, model.actuator_trnid[on_joints, 0]).any() or model.body_dofnum[base] < 2:
        return 0
    return base


def _held(
    model: mujoco.MjModel, data: mujoco.MjData, base: int, load: Array, M: Array
) -> tuple[Array, float]:
    """Hold the goal by a stiff PD. Return its force, (driven,), and how far the base moves, in its
    sizes: inf if the simulation breaks down.
    """
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    joints = driven_ids(model)
    places = model.jnt_qposadr[joints]
    dofs = model.jnt_dofadr[joints]
    inertia = M[dofs, dofs]
    # the PD's gains suit M[i, i]; where the base gives way the joint is lighter, and its modes are
    # faster
    mobility = np.linalg.inv(M)
    mobility_of_dofs = mobility[np.ix_(dofs, dofs)]
    poles = np.linalg.eigvals(mobility_of_dofs * inertia)
    fastest = STIFF * poles.real.max()
    model.opt.timestep = min(model.opt.timestep, 0.1 / STIFF, 0.5 / fastest)
    goal = data.qpos[places].copy()
    mujoco.mj_forward(model, data)
    silence(data)
    first = data.xpos[base].copy()
    steps = round(HOLD / model.opt.timestep)
    total = np.zeros(len(dofs))
    for k in range(steps):
        error = goal - data.qpos[places]
        rate = STIFF * error - 2.0 * data.qvel[dofs]
        push = load + inertia * STIFF * rate
        data.qfrc_applied[dofs] = push
        mujoco.mj_step(model, data)
        if data.warning.number[UNSTABLE] > 1:
            return load, math.inf
        if k >= steps // 2:
            total += np.abs(push)
    geoms = np.flatnonzero(model.geom_bodyid == base)
    size = model.geom_rbound[geoms].max(initial=0.0) or model.stat.extent
    load = total / (steps - steps // 2)
    strayed = np.linalg.norm(data.xpos[base] - first)
    return load, float(strayed / size)


@functools.lru_cache(maxsize=32)
def rises(plant: Plant, x: Floats) -> bool:
    """Return whether a robot on a free base stands while its joints are held at x, (n,) rad or m,
    and then has nothing inside it. How deep its feet stand in the ground is their softness.
    """
    model, data = _at(plant, x)
    if not (base := free_base(model)):
        return False
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    forces = _forces(model, data)
    load = -forces[dof_ids(model)[: plant.driven]]
    _, strayed = _held(model, data, base, load, M)
    if strayed > 1.0 or tips_over(model, data):
        return False
    return deepest(plant, model, data, ground=False).depth <= DEPTH


def falls(plant: Plant) -> str:
    """Return a sentence if the base of a user's plant falls while its joints are held, or ""."""
    if not plant.has_user_joints or at_goal(plant).strayed <= 1.0:
        return ""
    return (
        f"the base of {plant.name} falls or drives off while its joints are held, by more than its "
        "size: no law of a joint can be judged there, so give others='locked' (+locked in a text), "
        "or a keyframe in which it stands"
    )


def tips_over(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Return whether a base that the law does not read lies more than 60 degrees from its initial
    pose.
    """
    base = free_base(model)
    if not (base and model.opt.gravity.any()) or base in model.jnt_bodyid[joint_ids(model)]:
        return False
    first = mujoco.MjData(model)
    first.qpos[:] = initial_pose(model)
    directions = []
    for state in (first, data):
        mujoco.mj_kinematics(model, state)
        pose = state.xmat[base].reshape(3, 3)
        directions.append(model.opt.gravity @ pose)
    least = TIPPED * model.opt.gravity @ model.opt.gravity
    return bool(directions[0] @ directions[1] < least)


@functools.lru_cache(maxsize=32)
def beside_goal(plant: Plant) -> Floats:
    """Return a start beside the default goal, (n,): each driven joint moves towards the limit with
    more room, and less far or the other way where that ends inside something.

    Raises:
      ScenarioError: it does so wherever the joint moves.
    """
    x0 = plant.origin
    limits = plant.ranges or (("", -math.inf, math.inf),) * plant.driven
    for i, (_, low, high) in enumerate(limits[: plant.driven]):
        down = x0[i] - low
        up = high - x0[i]
        x0 = _clear_start(plant, x0, i, down, up)
    return x0


def usual_start(plant: Plant) -> Floats:
    """Return where runs of a plant begin if nobody says so, (n,): beside the goal of a user's
    model that would start at it.
    """
    if plant.has_user_joints and plant.x0 == plant.origin:
        return beside_goal(plant)
    return plant.x0


def _clear_start(plant: Plant, x0: Floats, i: int, down: float, up: float) -> Floats:
    """Return a start in which joint i is moved, the farthest of those that touch nothing; `down`
    and `up` are the ways to its limits.
    """
    above = min(BESIDE, ROOM * up)
    below = min(BESIDE, ROOM * down)
    sides = [above, -below]
    if down > up:
        sides.reverse()
    halvings = 0.5 ** np.arange(HALVINGS)
    ways = np.outer(sides, halvings).ravel().tolist()
    ways.sort(key=abs, reverse=True)
    at_goal = overlap(plant, plant.origin).depth
    places: list[Floats] = []
    for allowed in (max(TOUCH, at_goal), max(DEPTH, at_goal)):
        for way in ways:
            places = [(*x0[:i], x0[i] + share * way, *x0[i + 1 :]) for share in (1.0, FARTHEST)]
            if all(overlap(plant, place).depth <= allowed for place in places):
                return places[0]
    joint = channel_names(plant)[i]
    raise ScenarioError(
        f"wherever joint {joint!r} of {plant.name} starts beside its goal, that pose has "
        f"{overlap(plant, places[1])}: say where runs begin, with starts=smc.starts(x0=...) or "
        "--x0, or give others='held' or 'file' if it is to stand"
    )


@functools.lru_cache(maxsize=32)
def needs(plant: Plant) -> Floats:
    """Return the force with which each driven joint arrives from its start and holds, N m or N,
    with two digits: 2 load + (60/s^2 M + 8/s D) X + 1.5 dry friction; at least twice the largest
    load between its start, its goal and its limits.
    """
    moments = at_goal(plant)
    apart = np.subtract(usual_start(plant), plant.origin)
    way = np.abs(apart)[: plant.driven]
    way = np.where(way > MAX_EXCESS, way, BESIDE)
    diagonal = np.diag(moments.D)[moments.dofs]
    damping = np.maximum(diagonal, 0.0)
    inertia = np.diag(moments.M)[moments.dofs]
    moving = (STIFFNESS * inertia + DAMPING * damping) * way
    load = 2.0 * np.abs(moments.load)
    need = np.maximum(load + moving, 2.0 * _largest_loads(plant)) + 1.5 * moments.dry
    return tuple(float(f"{value:.2g}") for value in need)


def _largest_loads(plant: Plant) -> Array:
    """Return the largest load of each driven joint on its way from the start to the goal, and
    between its limits with the others at the goal, (driven,) N m or N. 0 on a free base, which
    stands at its goal alone.
    """
    model, data = _at(plant, plant.origin)
    largest = np.zeros(plant.driven)
    if free_base(model):
        return largest
    goal = np.array(plant.origin)
    dofs = dof_ids(model)[: plant.driven]
    places = model.jnt_qposadr[driven_ids(model)]
    shares = np.linspace(0.0, 1.0, POSES_OF_LOAD)
    way = np.subtract(usual_start(plant), goal)[: plant.driven]
    poses = [goal[: plant.driven] + share * way for share in shares]
    for i, (_, low, high) in enumerate(plant.ranges[: plant.driven]):
        if math.isfinite(low) and math.isfinite(high):
            for x in low + shares * (high - low):
                pose = goal[: plant.driven].copy()
                pose[i] = x
                poses.append(pose)
    for pose in poses:
        data.qpos[places] = pose
        largest = np.maximum(largest, np.abs(_forces(model, data)[dofs]))
    return largest


def mobility(plant: Plant, u_max: float, reach: float) -> Floats:
    """Return x'' of each driven joint for a unit of its force, 1/(kg m^2) or 1/kg.

    Other joints answer as they would in the time T in which the motor moves the joint by `reach`:
    one with a stiff servo is as good as locked, a limp one is free.
    """
    moments = at_goal(plant)
    mobilities = []
    for i in moments.dofs:
        g = 1.0 / moments.M[i, i]
        unit = np.eye(len(moments.M))[i]
        for _ in range(ROUNDS):
            T = np.sqrt(reach / (g * u_max))
            A = moments.M + T * moments.D + 0.5 * T * T * moments.K
            A[i] = moments.M[i]
            A[:, i] = moments.M[:, i]
            g = abs(np.linalg.solve(A, unit)[i])
        mobilities.append(float(g))
    return tuple(mobilities)
