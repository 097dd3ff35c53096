"""What laws of free bodies share: the attitude that turns the thrust to a wanted force, and its rate.

Attitudes are unit quaternions (w, x, y, z), body to world, see mechanisms/rotation.py.
"""

import math

from numba import njit

from smc_mujoco.mechanisms.rotation import quaternion, relative, rotation_vector, turned, turned_back

MIN_FORCE = 1e-9  # N, chosen: a smaller wanted force has no direction
MIN_SINE = 1e-6  # chosen: of the angle between thrust and heading, below which the heading says nothing


@njit(error_model="numpy")
def of_thrust(F, r):
    """Return the attitude whose third axis is along the force F, (3,), and whose first is nearest to the heading.

    The heading is the first axis of the rotation vector r, (3,). It is the third axis with the minus sign if the force
    is along the first, as in a flip.
    """
    size, heading = math.sqrt(F[0] * F[0] + F[1] * F[1] + F[2] * F[2]), quaternion(r[0], r[1], r[2])
    z = (F[0] / size, F[1] / size, F[2] / size) if size > MIN_FORCE else turned(heading, 0.0, 0.0, 1.0)
    y = _cross(z, turned(heading, 1.0, 0.0, 0.0))
    sine = math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
    if sine < MIN_SINE:
        y = _cross(z, turned(heading, 0.0, 0.0, -1.0))
        sine = math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
    y = y[0] / sine, y[1] / sine, y[2] / sine
    return _of_axes(_cross(y, z), y, z)


@njit(error_model="numpy")
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(error_model="numpy")
def _of_axes(x, y, z):
    """Return the quaternion of a rotation matrix with these columns, by the largest of its four numbers."""
    squares = 1 + x[0] + y[1] + z[2], 1 + x[0] - y[1] - z[2], 1 - x[0] + y[1] - z[2], 1 - x[0] - y[1] + z[2]
    a, b, c = y[2] - z[1], z[0] - x[2], x[1] - y[0]
    d, e, f = x[1] + y[0], z[0] + x[2], y[2] + z[1]
    if squares[0] >= 1.0:
        root = 2.0 * math.sqrt(squares[0])
        return 0.25 * root, a / root, b / root, c / root
    if squares[1] >= squares[2] and squares[1] >= squares[3]:
        root = 2.0 * math.sqrt(squares[1])
        return a / root, 0.25 * root, d / root, e / root
    if squares[2] >= squares[3]:
        root = 2.0 * math.sqrt(squares[2])
        return b / root, d / root, 0.25 * root, f / root
    root = 2.0 * math.sqrt(squares[3])
    return c / root, e / root, f / root, 0.25 * root


@njit(error_model="numpy")
def rate_of(wanted, memory, dt):
    """Return the angular velocity of the wanted attitude, in its own axes, since the sample before; 0 at the first.

    memory, (5,), keeps the attitude of the sample before, and whether there was one.
    """
    w = 0.0, 0.0, 0.0
    if memory[4] != 0.0:
        turn = relative((memory[0], memory[1], memory[2], memory[3]), wanted)
        vector = rotation_vector(turn[0], turn[1], turn[2], turn[3])
        w = vector[0] / dt, vector[1] / dt, vector[2] / dt
    memory[0], memory[1], memory[2], memory[3], memory[4] = wanted[0], wanted[1], wanted[2], wanted[3], 1.0
    return w


@njit(error_model="numpy")
def attitude_error(y, wanted, memory):
    """Return the error quaternion from a wanted attitude, the angular velocity relative to it, and that of it.

    Both angular velocities are in the axes of the body.
    """
    error = relative(wanted, quaternion(y.x[3], y.x[4], y.x[5]))
    w = rate_of(wanted, memory, y.dt)
    moving = turned_back(error, w[0], w[1], w[2])
    return error, (y.v[3] - moving[0], y.v[4] - moving[1], y.v[5] - moving[2]), moving


@njit(error_model="numpy")
def put_thrust(y, F, u):
    """Write into u, (6,), the part of the force F, (3,), along the third axis of the body."""
    up = turned(quaternion(y.x[3], y.x[4], y.x[5]), 0.0, 0.0, 1.0)
    thrust = F[0] * up[0] + F[1] * up[1] + F[2] * up[2]
    u[0], u[1], u[2] = thrust * up[0], thrust * up[1], thrust * up[2]


@njit(error_model="numpy")
def put_torque(y, v, moving, u):
    """Write into u, (6,), the torque for the change v, (3,), of the angular velocity relative to the wanted one.

    `moving` is the wanted one, in the axes of the body, whose own change is left out, as in the Crazyflie's firmware.
    """
    w = (y.v[3], y.v[4], y.v[5])
    carried = _cross(w, moving)
    for i in range(3):
        u[3 + i] = y.h[3 + i]
        for j in range(3):
            u[3 + i] += y.M[3 + i, 3 + j] * (v[j] - carried[j])
