"""Attitudes: unit quaternions (w, x, y, z), body to world, and rotation vectors, the axis times the
angle in rad.

The rotation vector of an attitude has an angle of 0 to pi, and is the same for q and -q: a pose has
six numbers, as a velocity has. Angular velocities are in the axes of the body, as those of MuJoCo's
free joint.
"""

import math

import numpy as np
from numba import njit

from smc_mujoco.common.aliases import Array


@njit(error_model="numpy")
def rotation_vector(w, x, y, z):
    """Return the rotation vector of a quaternion."""
    sine = math.sqrt(x * x + y * y + z * z)
    if sine == 0.0:
        return 0.0, 0.0, 0.0
    scale = 2.0 * math.atan2(sine, abs(w)) / sine
    scale = -scale if w < 0.0 else scale
    return scale * x, scale * y, scale * z


@njit(error_model="numpy")
def quaternion(x, y, z):
    """Return the quaternion of a rotation vector."""
    angle = math.sqrt(x * x + y * y + z * z)
    if angle == 0.0:
        scale = 0.5
    else:
        scale = math.sin(0.5 * angle) / angle
    return math.cos(0.5 * angle), scale * x, scale * y, scale * z


@njit(error_model="numpy")
def relative(p, q):
    """Return conj(p) q: the attitude q as seen from p."""
    return (
        p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3],
        p[0] * q[1] - p[1] * q[0] - p[2] * q[3] + p[3] * q[2],
        p[0] * q[2] + p[1] * q[3] - p[2] * q[0] - p[3] * q[1],
        p[0] * q[3] - p[1] * q[2] + p[2] * q[1] - p[3] * q[0],
    )


@njit(error_model="numpy")
def turned(q, x, y, z):
    """Return the vector R(q) (x, y, z)."""
    w, a, b, c = q
    s = 2.0 * (b * z - c * y)
    t = 2.0 * (c * x - a * z)
    u = 2.0 * (a * y - b * x)
    return x + w * s + b * u - c * t, y + w * t + c * s - a * u, z + w * u + a * t - b * s


@njit(error_model="numpy")
def rotate_inverse(q, x, y, z):
    """Return the vector R(q)' (x, y, z)."""
    return turned((q[0], -q[1], -q[2], -q[3]), x, y, z)


@njit(error_model="numpy")
def rate(x, y, z, dx, dy, dz):
    """Return the angular velocity of an attitude whose rotation vector (x, y, z) changes by (dx,
    dy, dz) per second.
    """
    angle = math.sqrt(x * x + y * y + z * z)
    half = math.sin(0.5 * angle)
    if angle < 1e-4:
        first = 0.5
    else:
        first = 2.0 * half * half / (angle * angle)
    if angle < 1e-2:
        second = (1.0 - angle * angle / 20.0) / 6.0
    else:
        second = (angle - math.sin(angle)) / angle**3
    ax = y * dz - z * dy
    ay = z * dx - x * dz
    az = x * dy - y * dx
    bx = y * az - z * ay
    by = z * ax - x * az
    bz = x * ay - y * ax
    return (
        dx - first * ax + second * bx,
        dy - first * ay + second * by,
        dz - first * az + second * bz,
    )


@njit(error_model="numpy")
def put_attitude_error(x, v, r, dr, e, de):
    """Write the last three numbers of the errors e and de of a pose x, v from a reference r, dr,
    (6,) each.

    e is the rotation vector from the reference's attitude to the body's. de is the angular velocity
    relative to the reference's, both in the axes of the body.
    """
    error = relative(quaternion(r[3], r[4], r[5]), quaternion(x[3], x[4], x[5]))
    e[3], e[4], e[5] = rotation_vector(error[0], error[1], error[2], error[3])
    own = rate(r[3], r[4], r[5], dr[3], dr[4], dr[5])
    wx, wy, wz = rotate_inverse(error, own[0], own[1], own[2])
    de[3] = v[3] - wx
    de[4] = v[4] - wy
    de[5] = v[5] - wz


@njit(error_model="numpy")
def mix(x, u, rows, actuators, keeps_torques, controls):
    """Write the controls of a free body's actuators for the force u[:3], in the axes of the world,
    and torque u[3:].

    The force is turned into the axes of the body by its pose x. An actuator has 8 numbers in
    `rows`: what it gets of the force and of the torque, and its bounds. Where all actuators push
    one way and alike, as rotors do, the excess of the largest over its bound is taken from all:
    that keeps the torques, and gives up thrust, as the Crazyflie's firmware does.
    """
    fx, fy, fz = rotate_inverse(quaternion(x[3], x[4], x[5]), u[0], u[1], u[2])
    excess = 0.0
    for j in range(actuators):
        i = 8 * j
        of_force = rows[i] * fx + rows[i + 1] * fy + rows[i + 2] * fz
        controls[j] = of_force + rows[i + 3] * u[3] + rows[i + 4] * u[4] + rows[i + 5] * u[5]
        excess = max(excess, controls[j] - rows[i + 7])
    for j in range(actuators):
        command = controls[j] - (excess if keeps_torques != 0 else 0.0)
        controls[j] = min(max(command, rows[8 * j + 6]), rows[8 * j + 7])


def pose_errors(x: Array, r: Array) -> Array:
    """Return the errors of poses x from references r, (K, 6) each: of an attitude the rotation
    vector between both.
    """
    e = x - r
    e[:, 3:] = attitude_errors(x[:, 3:], r[:, 3:])
    return e


@njit(error_model="numpy")
def attitude_errors(x, r):
    """Return the rotation vectors, (K, 3), from attitudes r to attitudes x, both as rotation
    vectors (K, 3).
    """
    errors = np.empty(x.shape)
    for k in range(len(x)):
        error = relative(
            quaternion(r[k, 0], r[k, 1], r[k, 2]), quaternion(x[k, 0], x[k, 1], x[k, 2])
        )
        errors[k, 0], errors[k, 1], errors[k, 2] = rotation_vector(
            error[0], error[1], error[2], error[3]
        )
    return errors
