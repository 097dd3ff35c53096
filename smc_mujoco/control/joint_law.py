"""Laws of many joints: functions of the measurement of all channels, which return a command for
each channel.

    @law_function(joint=True, gains={"lam": 6.0, "k1": 3.0})
    def my_law(y, gains, memory):
        s = y.de + gains.k1 * y.e                     # vectors (n,), one number for each channel
        return -gains.lam * saturate(s), s

The law runs once per control sample. It sees the nominal model of the whole mechanism, M(x) x'' +
h(x, v) = u + d. A law of one channel sees x'' = f + g u instead. M and h come from MuJoCo's own
functions for your own models, `double_pendulum`, `panda` and `quadrotor`. The other plants have one
equation per channel, so their M is diagonal.

A gain is a vector (n,), unless its `Gain` is shared. The memory is an array (n, slots). The
measurement's arrays are copies, which a law may overwrite. A law without the model (`y.model ==
0.0`) sees M = 1 and h = g = 0.

Where joints are only measured, the m driven channels come first. The law then returns u and s of
these, (m,) each, and its gains are vectors (m,). M, h and g are of all n, with M x'' + h = (u, 0),
and y.limit is 0 where nothing drives.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import math
from typing import Any, NamedTuple

import numpy as np
from numba import carray, njit
from numba.extending import overload

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.jit import call, floats, pointer, record_at


class JointMeasurement(NamedTuple):
    """The inputs of a law of many joints: all channels at a sample, in SI units.

    Vectors are (n,).
    """

    t: float  # time of the sample
    dt: float  # control period
    model: float  # 1 if the scenario lets the law use M, h and g, else 0
    dynamics: Any  # handle of the nominal mechanism, for `coriolis` and `jacobian`
    x: Array  # measured positions
    v: Array  # measured or estimated velocities
    e: Array  # x - r
    de: Array  # v - r'
    r: Array  # references
    dr: Array
    ddr: Array
    a: Array  # estimated accelerations; r'' if the estimator gives none
    limit: Array  # bounds on |u|
    M: Array  # nominal mass matrix of M x'' + h = u, (n, n), at the measured x
    h: Array  # Coriolis forces c(x, v), gravity, springs and dampers, in the unit of u
    g: Array  # h(x, 0), the forces at rest: gravity and springs


# the vectors, M, h and g, in the order in which they are stored
ARRAYS = JointMeasurement._fields[4:]
# What is stored before the arrays. `dynamics` is 0, or the address of a HANDLE; `driven` is how
# many commands the law gives.
HEAD = floats(("t", "dt", "model", "dynamics", "n", "driven"))
# The nominal mechanism: addresses of the functions for C(x, v) w and the tip's Jacobian, and of
# their parameters, and of the force per unit of u on each joint.
HANDLE = floats(("coriolis", "jacobian", "parameters", "units"))
head_at = record_at(HEAD)
handle_at = record_at(HANDLE)
HEAD_BYTES = HEAD.itemsize


def stored_dtype(n: int) -> np.dtype:
    """Return the dtype of a stored measurement of n channels."""
    arrays = [(name, "f8", (n, n) if name == "M" else (n,)) for name in ARRAYS]
    return np.dtype([*((name, "f8") for name in HEAD.names or ()), *arrays])


def measurement_of(stored: np.void, dynamics: Any) -> JointMeasurement:
    """Return the measurement in a record of `stored_dtype`; `dynamics` has the methods `coriolis`
    and `jacobian`.
    """
    t, dt, model = (float(stored[name]) for name in ("t", "dt", "model"))
    return JointMeasurement(t, dt, model, dynamics, *(stored[name] for name in ARRAYS))


@njit
def _array_after(array, shape):
    """Return the array of this shape that is stored after another array."""
    return carray(pointer(array.ctypes.data + 8 * array.size), shape)


@njit
def measurement_at(address):
    """Return the measurement that is stored at an address. Its arrays are views."""
    head = head_at(address, 0)
    n = int(head.n)
    x = carray(pointer(address + HEAD_BYTES), (n,))
    v = _array_after(x, (n,))
    e = _array_after(v, (n,))
    de = _array_after(e, (n,))
    r = _array_after(de, (n,))
    dr = _array_after(r, (n,))
    ddr = _array_after(dr, (n,))
    a = _array_after(ddr, (n,))
    limit = _array_after(a, (n,))
    M = _array_after(limit, (n, n))
    h = _array_after(M, (n,))
    g = _array_after(h, (n,))
    return JointMeasurement(
        head.t, head.dt, head.model, int(head.dynamics), x, v, e, de, r, dr, ddr, a, limit, M, h, g
    )


@njit
def begin_measurement(address, t, dt, model, dynamics, n, driven):
    """Store what is before the arrays of a measurement at an address, and return the
    measurement.
    """
    head = head_at(address, 0)
    head.t = t
    head.dt = dt
    head.model = model
    head.dynamics = dynamics
    head.n = n
    head.driven = driven
    return measurement_at(address)


@njit
def put_channel(y, i, x, v, a, limit, r, dr, ddr):
    """Store what is measured of channel i, its bound on |u| and its reference in a measurement."""
    y.x[i] = x
    y.v[i] = v
    y.e[i] = x - r
    y.de[i] = v - dr
    y.r[i] = r
    y.dr[i] = dr
    y.ddr[i] = ddr
    y.a[i] = ddr if math.isnan(a) else a
    y.limit[i] = limit


def coriolis(y, w):
    """Return C(x, v) w, (n,), for a vector w (n,). C is made of Christoffel symbols, so M' - 2 C is
    skew-symmetric.

    c(x, v) = C(x, v) v is part of y.h. The product follows from c alone: C(x, v) w = (c(x, v + w) -
    c(x, v - w)) / 4. It is 0 without the model, and for plants with one equation per channel.
    """
    return y.dynamics.coriolis(np.asarray(w, float))


@overload(coriolis)
def _coriolis(y, w):
    def compiled(y, w):
        n = len(y.x)
        vector = np.empty(n)
        forces = np.zeros(n)
        if len(w) != n:  # numba may have compiled this function elsewhere, without checks of bounds
            raise ValueError
        for i in range(n):
            vector[i] = w[i]
        if y.dynamics != 0:
            handle = handle_at(y.dynamics, 0)
            call(
                int(handle.coriolis),
                vector.ctypes.data,
                int(handle.parameters),
                0,
                forces.ctypes.data,
            )
            units = pointer(int(handle.units))
            for i in range(n):
                forces[i] /= units[i]
        return forces

    return compiled


def jacobian(y):
    """Return the nominal Jacobian J of the plant's tip, (3, n); ValueError without a model or a
    tip.

    J v is the tip's velocity, m/s. J' F is the generalised force of a force F, N, that acts on the
    tip.
    """
    return y.dynamics.jacobian()


@overload(jacobian)
def _jacobian(y):
    def compiled(y):
        rows = np.zeros((3, len(y.x)))
        if y.dynamics == 0:
            raise ValueError
        handle = handle_at(y.dynamics, 0)
        if call(int(handle.jacobian), 0, int(handle.parameters), 0, rows.ctypes.data) != 0:
            raise ValueError
        return rows

    return compiled


@njit
def product(M, w):
    """Return M w, added in the same order in Python and compiled. `M @ w` does not promise that."""
    total = np.zeros(len(w))
    for i in range(len(w)):
        for j in range(len(w)):
            total[i] += M[i, j] * w[j]
    return total


@njit
def inner(a, b):
    """Return the sum of a_i b_i, added in the same order in Python and compiled. `a @ b` does not
    promise that.
    """
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@njit
def solve(M, b):
    """Return M^-1 b for a positive definite M, by Cholesky's factors. The bits are the same in
    Python and compiled.
    """
    n = len(b)
    L = np.zeros((n, n))
    x = b.copy()
    for i in range(n):
        for j in range(i + 1):
            rest = M[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            if i == j:
                L[i, j] = math.sqrt(rest)
            else:
                L[i, j] = rest / L[j, j]
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= L[k, i] * x[k]
        x[i] /= L[i, i]
    return x


@njit
def torque(y, v):
    """Return the u for the accelerations v of the errors: M (v + r'') + h with the model, v
    without.
    """
    if y.model == 0.0:
        return v
    return product(y.M, v + y.ddr) + y.h


@njit
def saturate(a):
    """Return a clipped to -1 .. 1, element by element."""
    return np.minimum(np.maximum(a, -1.0), 1.0)


@njit
def tanh(a):
    """Return the hyperbolic tangents of a vector. The bits are the same in Python and compiled,
    unlike numpy's.
    """
    values = np.zeros(len(a))
    for i in range(len(a)):
        values[i] = math.tanh(a[i])
    return values


@njit
def norm(a):
    """Return the Euclidean norm of a vector. The bits are the same in Python and compiled."""
    return math.sqrt(inner(a, a))
