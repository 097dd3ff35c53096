"""What laws of free bodies share: the attitude that turns the thrust to a wanted force, its rate,
and the command.

A law wants an acceleration v(e, e') of the position's error, of stiffness -dv/de and damping
-dv/de'. So it wants the force F = m (r'' + v) + h, and wd, the wanted attitude's rate, follows from
F' = m (r''' - stiffness e' - damping e''). r''' is the difference of r'' over a sample, which has
no noise. e'' is the measured e' through p B / (p + B): 0 at rest and on the path, so that it adds
to no steady error, and late by 1 / B after a gust. The difference of the wanted attitude over a
sample would bring the noise of F, divided by the period, into wd. wd' is left out, as in the
Crazyflie's firmware. Attitudes are unit quaternions (w, x, y, z), body to world, see
mechanisms/rotation.py.
"""

import math

import numpy as np
from numba import njit

from smc_mujoco.control.joint_law import tanh
from smc_mujoco.control.units import ACCELERATION, RATE, RATE2, TIME, Gain, Unit
from smc_mujoco.mechanisms.rotation import quaternion, rate, relative, rotate_inverse, turned

as_in_c = njit(error_model="numpy")  # a division by 0 gives inf or NaN
# 1/s, chosen: B. A larger one loses less on a fast path, and stands less noise and delay
BANDWIDTH = 20.0
# least thrust over weight: 0.04 N for 0.032 kg, as published, so that rotors can turn the body over
LEAST = 0.127
# gains of the position: in laws that feed back its error, and in those that slide
FEEDBACK = {
    "kx": Gain(2.0, RATE2, positive=True),
    "kv": Gain(2.0, RATE, positive=True),
}
SLIDING = {
    "c": Gain(1.25, RATE, positive=True),
    "Kx": Gain(5.0, ACCELERATION, positive=True),
    "rhox": Gain(1.0, Unit(position=-1, time=1), positive=True),
    "lam": Gain(8.0, RATE, positive=True, turns=True),
}
LAG = Gain(0.0625, TIME, nonnegative=True, held=True, turns=True)  # of the Crazyflie's rotors
STEERING = 2  # slots of a law's memory, the first ones, which `steer` keeps
MIN_FORCE = 1e-9  # N, chosen: a smaller wanted force has no direction
# chosen: sine of the angle between thrust and heading; below it the heading says nothing
MIN_SINE = 1e-6


@as_in_c
def of_thrust(F, r):
    """Return the attitude whose third axis is along the force F, (3,), and whose first is nearest
    to the heading.

    The heading is the first axis of the rotation vector r, (3,), or minus its third one if the
    force is along the first, as in a flip.
    """
    size = math.sqrt(F[0] * F[0] + F[1] * F[1] + F[2] * F[2])
    heading = quaternion(r[0], r[1], r[2])
    if size > MIN_FORCE:
        z = (F[0] / size, F[1] / size, F[2] / size)
    else:
        z = turned(heading, 0.0, 0.0, 1.0)
    ahead = _ahead(z, heading)
    y = _cross(z, turned(heading, ahead[0], ahead[1], ahead[2]))
    sine = math.sqrt(_dot(y, y))
    y = y[0] / sine, y[1] / sine, y[2] / sine
    return _of_axes(_cross(y, z), y, z)


@as_in_c
def rate_of(wanted, F, dF, r, dr):
    """Return the rate of the attitude `wanted` by `of_thrust`, in its axes, as F and r change by dF
    and dr a second.
    """
    size = math.sqrt(F[0] * F[0] + F[1] * F[1] + F[2] * F[2])
    heading = quaternion(r[0], r[1], r[2])
    if size <= MIN_FORCE:
        return 0.0, 0.0, 0.0
    x = turned(wanted, 1.0, 0.0, 0.0)
    y = turned(wanted, 0.0, 1.0, 0.0)
    z = turned(wanted, 0.0, 0.0, 1.0)
    along = _dot(z, dF)
    dz = (dF[0] - along * z[0]) / size, (dF[1] - along * z[1]) / size, (dF[2] - along * z[2]) / size
    ahead = _ahead(z, heading)
    turning = _cross(rate(r[0], r[1], r[2], dr[0], dr[1], dr[2]), ahead)
    b = turned(heading, ahead[0], ahead[1], ahead[2])
    db = turned(heading, turning[0], turning[1], turning[2])
    across = _cross(z, b)
    yaw = (_dot(x, _cross(dz, b)) + _dot(x, _cross(z, db))) / math.sqrt(_dot(across, across))
    return -_dot(y, dz), _dot(x, dz), -yaw


@as_in_c
def _ahead(z, heading):
    """Return the axis that is the heading for `of_thrust`, in those of the quaternion `heading`."""
    y = _cross(z, turned(heading, 1.0, 0.0, 0.0))
    if math.sqrt(_dot(y, y)) >= MIN_SINE:
        return (1.0, 0.0, 0.0)
    return (0.0, 0.0, -1.0)


@as_in_c
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@as_in_c
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@as_in_c
def _of_axes(x, y, z):
    """Return the quaternion of a rotation matrix with these columns, by the largest of its four
    numbers.
    """
    squares = (
        1 + x[0] + y[1] + z[2],
        1 + x[0] - y[1] - z[2],
        1 - x[0] + y[1] - z[2],
        1 - x[0] - y[1] + z[2],
    )
    a = y[2] - z[1]
    b = z[0] - x[2]
    c = x[1] - y[0]
    d = x[1] + y[0]
    e = z[0] + x[2]
    f = y[2] + z[1]
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


@as_in_c
def slide(y, c, K, rho):
    """Return s = e' + c e of the position, v = -c e' - K tanh(rho s), its stiffness and its
    damping, (3,) each.

    c, K and rho are numbers, or vectors (3,).
    """
    s = y.de[:3] + c * y.e[:3]
    reached = tanh(rho * s)
    slope = K * rho * (1.0 - reached * reached)
    return s, -c * y.de[:3] - K * reached, c * slope, c + slope


@as_in_c
def steer(y, v, stiffness, damping, memory):
    """Return the force for the acceleration v of the position's error, and how far the body is off
    its attitude.

    Arguments are vectors (3,). After the force come the quaternion from the wanted attitude to the
    body's, and two angular velocities in the axes of the body: the body's relative to the wanted
    attitude, and that attitude's own. In two slots the memory keeps the filtered e' and r'' of the
    sample before, and whether there was one.
    """
    m = y.M[0, 0]
    F = np.zeros(3)
    dF = np.zeros(3)
    if memory[0, 1] == 0.0:
        memory[:3, 0] = y.de[:3]
        memory[3:, 0] = y.ddr[:3]
        memory[0, 1] = 1.0
    for i in range(3):
        F[i] = m * (y.ddr[i] + v[i]) + y.h[i]
        change = BANDWIDTH * (y.de[i] - memory[i, 0]) / (1.0 + y.dt * BANDWIDTH)
        memory[i, 0] += y.dt * change
        dF[i] = m * (
            (y.ddr[i] - memory[3 + i, 0]) / y.dt - stiffness[i] * y.de[i] - damping[i] * change
        )
        memory[3 + i, 0] = y.ddr[i]
    attitude = of_thrust(F, y.r[3:])
    w = rate_of(attitude, F, dF, y.r[3:], y.dr[3:])
    error = relative(attitude, quaternion(y.x[3], y.x[4], y.x[5]))
    moving = rotate_inverse(error, w[0], w[1], w[2])
    return F, error, (y.v[3] - moving[0], y.v[4] - moving[1], y.v[5] - moving[2]), moving


@as_in_c
def shorter(error, turning):
    """Return 2 sgn(q0) qv of an error quaternion, and its rate at a relative angular velocity;
    sgn(0) = 1.

    q and -q are the same attitude, and the sign is that of the shorter way.
    """
    sign = 1.0 if error[0] >= 0.0 else -1.0
    angle = np.zeros(3)
    change = np.zeros(3)
    for i in range(3):
        j = (i + 1) % 3
        k = (i + 2) % 3
        angle[i] = 2.0 * sign * error[1 + i]
        change[i] = sign * (
            error[0] * turning[i] + error[1 + j] * turning[k] - error[1 + k] * turning[j]
        )
    return angle, change


@as_in_c
def wrench(y, F, v, moving):
    """Return a law's command, (6,): the share of F along the body's third axis, and the torque for
    the acceleration v.

    The thrust is at least `LEAST` of the weight, also upside down. v, (3,), is the change of the
    angular velocity relative to the wanted one, `moving`, in the axes of the body.
    """
    u = np.zeros(6)
    w = (y.v[3], y.v[4], y.v[5])
    up = turned(quaternion(y.x[3], y.x[4], y.x[5]), 0.0, 0.0, 1.0)
    carried = _cross(w, moving)
    thrust = max(_dot(F, up), LEAST * math.sqrt(_dot(y.h, y.h)))
    for i in range(3):
        u[i] = thrust * up[i]
        u[3 + i] = y.h[3 + i]
        for j in range(3):
            u[3 + i] += y.M[3 + i, 3 + j] * (v[j] - carried[j])
    return u
