"""The fastest rates of a user's model, which decide its integrator and its physics step.

An explicit integrator is stable while its step times the fastest pole is less than about 2.8, and
precise while it is well below 1. The poles are those of the model that nothing commands: of damping
over inertia, springs, servos, activations. They depend on the pose, so the fastest of several poses
counts. Constraints have rates of their own, those of their solref.
"""

import functools
from collections.abc import Iterable

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.mjcb import compiled_spec
from smc_mujoco.mechanisms.custom.model_constraints import touches
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.mechanisms.layout import loaded, moving_joints, state_with
from smc_mujoco.mechanisms.plant import Plant, write_fields

POSES = 12  # in which poles are computed, beside the start; chosen
SEED = 0  # of these poses
REACH = 1.0  # rad or m, of joints without a range, about the start; chosen
MAX_REACH = 3.2  # rad or m about the start, of joints with a wide range; chosen
NUDGE = 1e-6  # rad, m, rad/s, m/s, and of activations: of the differences
STEP = 1e-3  # s; MuJoCo softens ties to this step, so that their own poles do not count
FLAGS = mujoco.mjtDisableBit
UNTIED = FLAGS.mjDSBL_CONTACT, FLAGS.mjDSBL_LIMIT, FLAGS.mjDSBL_FRICTIONLOSS


@functools.lru_cache(maxsize=64)
def fastest_pole(plant: Plant, parts: tuple[Part, ...] = ()) -> float:
    """Return the largest |pole| of a plant with these parts and with u held, 1/s, in its start and
    in POSES poses drawn at random.

    Its ties hold, as they take away the modes of light bodies; no other constraint acts.
    """
    model = _model(plant, parts)
    data = mujoco.MjData(model)
    state = state_with(model, moving_joints(model), plant.x0, 0.0)
    start = state[0]
    rng = np.random.default_rng(SEED)
    fastest = 0.0
    for k in range(POSES + 1 if model.nv + model.na else 0):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = _drawn(model, start, rng) if k else start
        poles = np.linalg.eigvals(_linear(model, data))
        largest = float(np.abs(poles).max())
        fastest = max(fastest, largest)
    return fastest


def _model(plant: Plant, parts: Iterable[Part]) -> mujoco.MjModel:
    """Return the model of a plant with parts, without constraints but its ties."""
    spec = plant.spec()
    for part in parts:
        part.edit(spec)
    model = compiled_spec(spec)
    model.opt.timestep = STEP
    for flag in UNTIED:
        model.opt.disableflags |= flag.value
    for part in parts:
        write_fields(model, part.fields(model))
    return model


def _drawn(model: mujoco.MjModel, start: Array, rng: np.random.Generator) -> Array:
    """Return a pose drawn at random, near the start and within the joints' ranges."""
    qpos = start.copy()
    for i in range(model.njnt):
        if model.jnt_type[i] < mujoco.mjtJoint.mjJNT_SLIDE.value:  # free or ball
            continue
        address = model.jnt_qposadr[i]
        low = start[address] - REACH
        high = start[address] + REACH
        if model.jnt_limited[i]:
            low, high = model.jnt_range[i]
            low = max(low, start[address] - MAX_REACH)
            high = min(high, start[address] + MAX_REACH)
        qpos[address] = rng.uniform(low, max(low, high))
    return qpos


def _linear(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Return the derivative of (v, v', act') by (q, v, act) at a pose at rest, a square matrix."""
    nv = model.nv
    na = model.na
    A = np.zeros((2 * nv + na, 2 * nv + na))
    A[:nv, nv : 2 * nv] = np.eye(nv)
    qpos = data.qpos.copy()
    step = np.zeros(nv)

    def rates() -> Array:
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qacc, data.act_dot])

    first = rates()
    for j in range(nv):
        step[j] = 1.0
        mujoco.mj_integratePos(model, data.qpos, step, NUDGE)
        A[nv:, j] = (rates() - first) / NUDGE
        data.qpos[:] = qpos
        step[j] = 0.0
    for moved, columns in ((data.qvel, nv), (data.act, 2 * nv)):
        for j in range(len(moved)):
            before = float(moved[j])
            moved[j] = before + NUDGE
            A[nv:, columns + j] = (rates() - first) / NUDGE
            moved[j] = before
    return np.nan_to_num(A, posinf=1e12, neginf=-1e12)


@functools.lru_cache(maxsize=64)
def constraint_rate(plant: Plant) -> float:
    """Return the fastest rate of what a plant may touch, of its limits and its ties, 1/s; 0 if it
    has none of them.
    """
    model = loaded(plant)
    off = model.opt.disableflags
    if off & FLAGS.mjDSBL_CONSTRAINT.value:
        return 0.0
    solrefs = [np.empty((0, 2))]
    if not off & FLAGS.mjDSBL_LIMIT.value:
        solrefs.append(model.jnt_solref[model.jnt_limited.astype(bool)])
        solrefs.append(model.tendon_solref_lim[model.tendon_limited.astype(bool)])
    if touches(model):
        touching = (model.geom_contype > 0) | (model.geom_conaffinity > 0)
        solrefs += [model.geom_solref[touching], model.pair_solref]
    if not off & FLAGS.mjDSBL_EQUALITY.value:
        solrefs.append(model.eq_solref[model.eq_active0.astype(bool)])
    first, second = np.concatenate(solrefs).T
    # a time constant and a damping ratio, or a stiffness and a damping, both negative
    by_time = first > 0.0
    softness = np.maximum(np.abs(first * second), 1e-12)
    stiffness = np.where(by_time, 1.0 / softness, 0.0)
    stiffness += np.sqrt(-np.minimum(first, 0.0))
    times = np.maximum(np.abs(first), 1e-12)
    decay = np.where(by_time, 2.0 / times, -second)
    rates = np.maximum(stiffness, decay)
    return float(np.max(rates, initial=0.0))


@functools.lru_cache(maxsize=64)
def rubs(plant: Plant) -> bool:
    """Return whether joints or tendons of the file have dry friction, or a parameter adds it,
    whatever its value: the steps of a search do not depend on the number that it tries.
    """
    if any(name.endswith(".frictionloss") for name in plant.parameters):
        return True
    model = loaded(plant)
    return bool(np.any(model.dof_frictionloss) or np.any(model.tendon_frictionloss))


@functools.lru_cache(maxsize=64)
def coupled(plant: Plant) -> bool:
    """Return whether joints of a plant move each other."""
    model = loaded(plant)
    return bool(np.any(model.dof_parentid >= 0) or model.ntendon or model.neq)


@functools.lru_cache(maxsize=64)
def may_touch(plant: Plant) -> bool:
    """Return whether two geoms of the file may meet."""
    return touches(loaded(plant))
