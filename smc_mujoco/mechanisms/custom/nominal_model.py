"""The nominal model of a user's own MJCF: f and g of every channel from MuJoCo itself, at the
measured state.

With M the mass matrix and tau what gravity, gyration, springs, dampers and the model's other
actuators exert, MuJoCo's x'' = M^-1 (tau + u). The nominal model of channel i is

    x_i'' = f_i + g_i u_i,    g_i = (M^-1)_ii,
    f_i = (M^-1 tau)_i + sum over j != i of (M^-1)_ij u_j,

with u_j the latest command of channel j: that of this sample for j < i, that of the sample before
for j > i. The laws of the channels run one after the other, so each sample is one Gauss-Seidel
sweep on the equations of all channels. The sweeps converge for every positive definite M. A joint q
without an actuator that moves with channel i has g = (M^-1)_qi.

The compiled path calls MuJoCo's own functions by name, with a copy of the model that has the
nominal parameters and an mjData for each simulation.

Laws of many joints see the mechanism as a whole instead,

    M x'' + h = u,    h = qfrc_bias - qfrc_passive - qfrc_actuator at ctrl = 0,    g = h at v = 0,

and C(x, v) w = (qfrc_bias(x, v + w) - qfrc_bias(x, v - w)) / 4: gravity cancels, and the rest is
quadratic in v.

Constraints are left out: contacts, limits, dry friction. Joints that are not measured, all in other
kinematic trees, are assumed to be in the model's initial state.
"""

import contextlib
import ctypes
import dataclasses
import functools
import math
import threading
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import mujoco
import numpy as np
from llvmlite import binding
from numba import carray, types

from smc_mujoco.common import fingerprint, libmujoco
from smc_mujoco.common.aliases import Array, Numbers, Pair
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.jit import CompiledFunction, Key, floats, pointer, record_at, whole_numbers
from smc_mujoco.common.mjcb import silence
from smc_mujoco.common.process import free_after_fork
from smc_mujoco.mechanisms import rotation
from smc_mujoco.mechanisms.layout import dof_ids, drive_ids, free_joint, joint_ids
from smc_mujoco.mechanisms.plant import (
    SEEN,
    Dynamics,
    Field,
    Native,
    Values,
    compiled_for_runs,
    write_fields,
)

_DISABLED = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT.value | mujoco.mjtDisableBit.mjDSBL_CONTACT.value
# Parameters of the C functions: numbers of channels, of driven ones and of degrees of freedom;
# addresses of model and data, of their arrays, and of arrays of this simulation's own: the
# channels' places, the state that was evaluated, a unit force and its acceleration.
NOMINAL = floats(
    [
        "n",
        "driven",
        "nv",
        "model",
        "data",
        "qpos",
        "qvel",
        "ctrl",
        "acceleration",
        "places",
        "x",
        "v",
        "unit",
        "moved",
    ]
)
# The same for M, h and g; then the tip's site or -1, whether h is of passive forces alone, and
# whether to compute g.
DYNAMICS = floats(
    [
        "n",
        "nv",
        "model",
        "data",
        "qpos",
        "qvel",
        "bias",
        "passive",
        "actuator",
        "places",
        "dense",
        "v",
        "moves",
        "site",
        "alone",
        "at_rest",
        "quaternion",
    ]
)
# Indices of a channel in qpos, qvel and ctrl; the last is -1 without an actuator. Driven channels
# come first.
PLACE = whole_numbers(("qpos", "qvel", "ctrl"))
nominal_at, dynamics_at, seen_at, place_at = map(record_at, (NOMINAL, DYNAMICS, SEEN, PLACE))
_SLEEP = mujoco.mjtEnableBit.mjENBL_SLEEP.value
_lock = threading.Lock()  # held while Python computes with the mjData of a model
free_after_fork(_lock)


@dataclasses.dataclass(frozen=True)
class NominalModel:
    """The nominal model of a user's plant: f and g computed by MuJoCo from the model without
    mismatch.
    """

    build: Callable[[int], mujoco.MjSpec]
    fields: Callable[[mujoco.MjModel, Values], Iterator[Field]]

    def __call__(self, x: Array, v: Array, i: int, p: Any, /, u: Array | None = None) -> Pair:
        """Return f and g of channel i, given the last commands u, (n,), of the others."""
        with self._placed(x, p) as (model, places, data):
            data.qvel[places["qvel"]] = v
            ctrl = driven(places)
            j = i % len(ctrl)  # the driven channel that moves channel i
            if u is None:
                data.ctrl[ctrl] = 0.0
            else:
                data.ctrl[ctrl] = np.asarray(u)[: len(ctrl)]
            data.ctrl[ctrl[j]] = 0.0
            mujoco.mj_fwdVelocity(model, data)
            mujoco.mj_fwdActuation(model, data)
            mujoco.mj_fwdAcceleration(model, data)
            unit = np.zeros((1, model.nv))
            moved = np.zeros((1, model.nv))
            unit[0, places["qvel"][j]] = 1.0
            mujoco.mj_solveM(model, data, moved, unit)
            dof = places["qvel"][i]
            of_u = float(moved[0, dof])
            return float(data.qacc_smooth[dof]), of_u

    @contextlib.contextmanager
    def _placed(self, x: Array, p: Any) -> Iterator[tuple[mujoco.MjModel, Array, mujoco.MjData]]:
        """Yield the model, its channels' indices and an mjData at rest at positions x, which no
        other thread has.
        """
        model, places, data, _ = prepared(self, frozen(vars(p)))
        with _lock:
            data.qpos[:] = model.qpos0
            data.qvel[:] = 0.0
            data.ctrl[:] = 0.0
            data.qpos[places["qpos"]] = x
            if (free := free_joint(model)) >= 0:
                first = model.jnt_qposadr[free]
                turn = rotation.quaternion(*x[3:])
                data.qpos[first : first + 7] = [*x[:3], *turn]
            mujoco.mj_fwdPosition(model, data)
            yield model, places, data

    def native(self, parameters: Numbers) -> Native:
        """Return the C function, and the addresses of one simulation's model, data and arrays."""
        model, places, borrowed = self._borrow(parameters)
        data = borrowed.data
        seen = np.full((2, len(places)), np.nan)
        solved = np.zeros((2, model.nv))
        arrays = data.qpos, data.qvel, data.ctrl, data.qacc_smooth, places, *seen, *solved
        addresses = _addresses(model, data, arrays)
        sizes = len(places), len(driven(places)), model.nv
        numbers = tuple(map(float, (*sizes, *addresses)))
        return Native(native().address, numbers, (model, borrowed, *arrays))

    def _borrow(self, parameters: Numbers) -> "tuple[mujoco.MjModel, np.ndarray, BorrowedData]":
        """Return the model, its channels' indices, and an mjData for one simulation."""
        model, places, _, spare = prepared(self, frozen(parameters))
        try:
            # used before, but a simulation writes every field before it reads it
            data = spare.pop()
        except IndexError:
            data = mujoco.MjData(model)
        return model, places, BorrowedData(data, spare)

    def dynamics(self, x: Array, v: Array, p: Any) -> Dynamics:
        """Return M, h and g of all channels, at their x and v, (n,) each."""
        with self._placed(x, p) as (model, places, data):
            dense = np.zeros((model.nv, model.nv))
            forces = {}
            mujoco.mj_fullM(model, data, dense)
            at_rest = np.zeros(len(x))
            for name, velocity in (("g", at_rest), ("h", v)):
                data.qvel[places["qvel"]] = velocity
                mujoco.mj_fwdVelocity(model, data)
                mujoco.mj_fwdActuation(model, data)
                forces[name] = (data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator)[
                    places["qvel"]
                ]
        of_joints = np.ix_(places["qvel"], places["qvel"])
        return Dynamics(dense[of_joints], forces["h"], forces["g"])

    def coriolis(self, x: Array, v: Array, w: Array, p: Any) -> Array:
        """Return C(x, v) w, (n,), with the C of Christoffel's symbols."""
        forces = np.zeros(len(x))
        with self._placed(x, p) as (model, places, data):
            for sign in (1.0, -1.0):
                data.qvel[places["qvel"]] = v + sign * w
                mujoco.mj_fwdVelocity(model, data)
                forces += sign * 0.25 * data.qfrc_bias[places["qvel"]]
        return forces

    def jacobian(self, x: Array, p: Any, tip: str) -> Array:
        """Return how the position of a site, the tip, depends on the channels, (3, n)."""
        with self._placed(x, p) as (model, places, data):
            rows = np.zeros((3, model.nv))
            site = model.site(tip).id
            mujoco.mj_jacSite(model, data, rows, None, site)
        return rows[:, places["qvel"]]

    @staticmethod
    def handles() -> dict[str, int]:
        """Return the addresses of the C functions of C and of the tip's Jacobian."""
        return {"coriolis": native_coriolis().address, "jacobian": native_jacobian().address}

    def native_dynamics(self, parameters: Numbers, tip: str, at_rest: bool = True) -> Native:
        """Return the C function of `dynamics` for one simulation; g is NaN unless at_rest. The tip
        is a site or "".
        """
        model, places, borrowed = self._borrow(parameters)
        data = borrowed.data
        data.ctrl[:] = data.qfrc_actuator[:] = 0.0
        dense = np.zeros(model.nv**2)
        v = np.zeros(len(places))
        moves = np.zeros(3 * model.nv)
        forces = data.qfrc_bias, data.qfrc_passive, data.qfrc_actuator
        arrays = data.qpos, data.qvel, *forces, places, dense, v, moves
        addresses = _addresses(model, data, arrays)
        site = model.site(tip).id if tip else -1
        values = (len(places), model.nv, *addresses, site, passive_alone(model), at_rest)
        free = free_joint(model)
        values += (model.jnt_qposadr[free] + 3 if free >= 0 else -1,)
        return Native(
            native_dynamics().address, tuple(map(float, values)), (model, borrowed, *arrays)
        )


def _addresses(
    model: mujoco.MjModel, data: mujoco.MjData, arrays: Iterable[Array]
) -> tuple[int, ...]:
    """Return where the model, its data and these arrays are in memory."""
    return (model._address, data._address, *(array.ctypes.data for array in arrays))


@dataclasses.dataclass(eq=False)
class BorrowedData:
    """An MjData borrowed from a pool, to which it returns when this is deleted. A new one costs a
    run 0.7 ms.
    """

    data: mujoco.MjData
    spare: list[mujoco.MjData]

    def __del__(self):
        self.spare.append(self.data)


@functools.lru_cache(maxsize=32)
def prepared(
    nominal: NominalModel, parameters: Numbers
) -> tuple[mujoco.MjModel, Array, mujoco.MjData, list[mujoco.MjData]]:
    """Return the model with nominal parameters, its channels' indices, an MjData for Python, and
    the pool.
    """
    model = compiled_for_runs(nominal.build(0), 0)
    model.opt.disableflags |= _DISABLED
    model.opt.enableflags &= ~_SLEEP
    fields = nominal.fields(model, Values(**parameters))
    write_fields(model, iter(list(fields)))
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    mujoco.mj_resetData(model, data)
    silence(data)
    joints = joint_ids(model)
    ctrl = model.actuator_ctrladr[drive_ids(model)]
    places = np.full(len(joints), -1, PLACE)
    places["qpos"] = model.jnt_qposadr[joints]
    places["qvel"] = dof_ids(model)
    if free_joint(model) >= 0:
        places["qpos"] += np.arange(len(joints))
    places["ctrl"][: len(ctrl)] = ctrl
    return model, places, data, []


def driven(places: Array) -> Array:
    """Return the indices of the driven channels in ctrl, (driven,)."""
    return places["ctrl"][places["ctrl"] >= 0]


def _mujoco(name: str, more: int = 0) -> Callable:
    """Return a function of MuJoCo's library for compiled code. It takes the addresses of model,
    data and `more`.

    Compiled code has its name, not its address, so that another process can load the code from the
    disk.
    """
    function = libmujoco.library()[name]
    address = ctypes.cast(function, ctypes.c_void_p).value
    binding.add_symbol(name, address)
    arguments = [types.int64] * (2 + more)
    return types.ExternalFunction(name, types.void(*arguments))


def passive_alone(model: mujoco.MjModel) -> bool:
    """Return whether h is of inertia and passive forces alone: without tendons, and actuators that
    act at ctrl = 0.
    """
    moving = model.actuator_dyntype != mujoco.mjtDyn.mjDYN_NONE.value
    biased = model.actuator_biastype != mujoco.mjtBias.mjBIAS_NONE.value
    return not (np.any(moving | biased) or model.ntendon or np.any(model.jnt_actgravcomp))


@functools.cache
def native_dynamics() -> CompiledFunction:
    """Return the C function of M (n, n), h and g, (n,) each, from a record SEEN. Without `at_rest`
    g is NaN.

    If h is of passive forces alone, it computes no more than M and h need. With that and without g,
    it takes a law on the Panda three quarters of the time.
    """
    positions, velocities, actuation = map(
        _mujoco, ("mj_fwdPosition", "mj_fwdVelocity", "mj_fwdActuation")
    )
    kinematics, centres, inertia, rates, passives = map(
        _mujoco, ("mj_kinematics", "mj_comPos", "mj_makeM", "mj_comVel", "mj_passive")
    )
    newton_euler = _mujoco("mj_rne", 2)
    full = _mujoco("mj_fullM", 1)

    def native(y, p, m, out):
        dynamics = dynamics_at(p, 0)
        read = seen_at(y, 0)
        n = int(dynamics.n)
        nv = int(dynamics.nv)
        model = int(dynamics.model)
        data = int(dynamics.data)
        x = pointer(read.x)
        v = pointer(read.v)
        last_v = pointer(int(dynamics.v))
        places = int(dynamics.places)
        qpos = pointer(int(dynamics.qpos))
        qvel = pointer(int(dynamics.qvel))
        bias = pointer(int(dynamics.bias))
        passive = pointer(int(dynamics.passive))
        actuator = pointer(int(dynamics.actuator))
        dense = carray(pointer(int(dynamics.dense)), (nv, nv))
        M = carray(pointer(out), (n, n))
        h = pointer(out + 8 * n * n)
        g = pointer(out + 8 * (n * n + n))
        for j in range(n):
            last_v[j] = v[j]
            g[j] = math.nan
            qpos[place_at(places, j).qpos] = x[j]
        if dynamics.quaternion >= 0.0:
            first = int(dynamics.quaternion)
            qpos[first], qpos[first + 1], qpos[first + 2], qpos[first + 3] = rotation.quaternion(
                x[3], x[4], x[5]
            )
        if dynamics.alone != 0.0:
            kinematics(model, data)
            centres(model, data)
            inertia(model, data)
        else:
            positions(model, data)
        full(model, data, int(dynamics.dense))
        for i in range(n):
            for j in range(n):
                M[i, j] = dense[place_at(places, i).qvel, place_at(places, j).qvel]
        # g, then h, so that the last velocities are those of the sample
        for part in range(0 if dynamics.at_rest else 1, 2):
            for j in range(n):
                qvel[place_at(places, j).qvel] = part * v[j]
            if dynamics.alone != 0.0:
                rates(model, data)
                passives(model, data)
                newton_euler(model, data, 0, int(dynamics.bias))
            else:
                velocities(model, data)
                actuation(model, data)
            forces = h if part == 1 else g
            for j in range(n):
                k = place_at(places, j).qvel
                forces[j] = bias[k] - passive[k] - actuator[k]
        return 0

    return CompiledFunction(native, Key("nominal-model", fingerprint.now(native)))


@functools.cache
def native_coriolis() -> CompiledFunction:
    """Return the C function of C(x, v) w, at the state of the last call of `native_dynamics`. Its
    input is w, (n,).
    """
    rates = _mujoco("mj_comVel")
    newton_euler = _mujoco("mj_rne", 2)
    velocities = _mujoco("mj_fwdVelocity")

    def native(y, p, m, out):
        dynamics = dynamics_at(p, 0)
        n = int(dynamics.n)
        model = int(dynamics.model)
        data = int(dynamics.data)
        w = pointer(y)
        output = pointer(out)
        v = pointer(int(dynamics.v))
        qvel = pointer(int(dynamics.qvel))
        bias = pointer(int(dynamics.bias))
        places = int(dynamics.places)
        for j in range(n):
            output[j] = 0.0
        for part in range(2):
            sign = 1.0 - 2.0 * part
            for j in range(n):
                qvel[place_at(places, j).qvel] = v[j] + sign * w[j]
            if dynamics.alone != 0.0:
                rates(model, data)
                newton_euler(model, data, 0, int(dynamics.bias))
            else:
                velocities(model, data)
            for j in range(n):
                output[j] += sign * 0.25 * bias[place_at(places, j).qvel]
        return 0

    return CompiledFunction(native, Key("nominal-model", fingerprint.now(native)))


@functools.cache
def native_jacobian() -> CompiledFunction:
    """Return the C function of the tip's Jacobian, (3, n), at the state of the last call of
    `native_dynamics`.
    """
    of_site = _mujoco("mj_jacSite", 3)

    def native(y, p, m, out):
        dynamics = dynamics_at(p, 0)
        n = int(dynamics.n)
        nv = int(dynamics.nv)
        site = int(dynamics.site)
        output = carray(pointer(out), (3, n))
        moves = carray(pointer(int(dynamics.moves)), (3, nv))
        if site < 0:
            return 1
        of_site(int(dynamics.model), int(dynamics.data), int(dynamics.moves), 0, site)
        for i in range(3):
            for j in range(n):
                output[i, j] = moves[i, place_at(int(dynamics.places), j).qvel]
        return 0

    return CompiledFunction(native, Key("nominal-model", fingerprint.now(native)))


@functools.cache
def native() -> CompiledFunction:
    """Return the C function of the nominal model: from a record SEEN, f and g of channel i."""
    positions, velocities = map(_mujoco, ("mj_fwdPosition", "mj_fwdVelocity"))
    actuation, accelerations, solve = map(
        _mujoco, ("mj_fwdActuation", "mj_fwdAcceleration", "mj_solveM"), (0, 0, 3)
    )

    def native(y, p, m, out):
        read = seen_at(y, 0)
        nominal = nominal_at(p, 0)
        i = read.i
        n = int(nominal.n)
        driven = int(nominal.driven)
        nv = int(nominal.nv)
        x = pointer(read.x)
        v = pointer(read.v)
        u = pointer(read.u)
        model = int(nominal.model)
        data = int(nominal.data)
        places = int(nominal.places)
        qpos = pointer(int(nominal.qpos))
        qvel = pointer(int(nominal.qvel))
        ctrl = pointer(int(nominal.ctrl))
        qacc = pointer(int(nominal.acceleration))
        last_x = pointer(int(nominal.x))
        last_v = pointer(int(nominal.v))
        unit = pointer(int(nominal.unit))
        moved = pointer(int(nominal.moved))
        fresh = False
        for j in range(n):
            # NaN, the initial value, differs from everything
            if last_x[j] != x[j] or last_v[j] != v[j]:
                fresh = True
                last_x[j] = x[j]
                last_v[j] = v[j]
        if fresh:  # the first channel of a sample; the others have the same state
            for j in range(n):
                qpos[place_at(places, j).qpos] = x[j]
                qvel[place_at(places, j).qvel] = v[j]
            positions(model, data)
            velocities(model, data)
        for j in range(driven):
            if j == i % driven:
                ctrl[place_at(places, j).ctrl] = 0.0
            else:
                ctrl[place_at(places, j).ctrl] = u[j]
        actuation(model, data)
        accelerations(model, data)
        for j in range(nv):
            unit[j] = 0.0
        unit[place_at(places, i % driven).qvel] = 1.0
        solve(model, data, int(nominal.moved), int(nominal.unit), 1)
        output = pointer(out)
        dof = place_at(places, i).qvel
        output[0] = qacc[dof]
        output[1] = moved[dof]
        return 0

    return CompiledFunction(native, Key("nominal-model", fingerprint.now(native)))
