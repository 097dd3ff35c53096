"""Rotors of a free body, and the air that it flies through: what MuJoCo's actuators and fluids do
not have.

A rotor turns at the speed W, rad/s. It is told the speed c that gives the wanted thrust, and
follows it by

    W' = rise (c - W) + rise2 (c^2 - W^2),    with fall and fall2 instead while it slows down,
    thrust = (1 - fade) (linear W + square W^2),    0 at least,

and its angular momentum h = sum of inertia spin W, along the body's third axis, acts on the body
with
-w x (0, 0, h) - (0, 0, h'). spin is 1 counter-clockwise seen from above; the drag of a rotor's
blades turns the body the other way, which is in the gear of its actuator. The supply sags: c is
less by the share `sag` times the sum of all thrusts in the middle of the physics step. The body's
drag is -R diag(drag) R' (v - wind), at its origin.

The callback does this at every stage of a physics step, by the closed solution of W' under a
constant c. So the speed is exact for whatever step, but for the sag, which changes within it. A
rotor with more than 12 time constants in a step has its new speed at once. Poses err by the square
of the step under RK4: measured orders are 2.0 in all sets of the quadrotor, also with sag. Other
integrators get the thrust at the middle of the step. The torque of h' is that at the stages: a
rotor with inertia whose lag is shorter than some steps gets too much of it.

A model has its numbers in `actuator_user` (ROTOR) and `body_user` (drag), where a text `smc:rotors`
says so.
"""

import functools
import math

import mujoco
import numpy as np
from numba import njit

from smc_mujoco.common.jit import floats, record_at
from smc_mujoco.common.mjcb import compiled
from smc_mujoco.mechanisms.hardware.part import drive_ids
from smc_mujoco.mechanisms.plant import Plant

ROTORS_TEXT = "smc:rotors"  # name of a text in models whose actuators are rotors
# linear [N s/rad], square [N s^2/rad^2], rise and fall [1/s], rise2 and fall2 [1/rad], inertia [kg
# m^2], spin [1 or
# -1], fade [1], sag [1/N], start: the speed at which a run begins [rad/s]
ROTOR = floats(
    [
        "linear",
        "square",
        "rise",
        "rise2",
        "fall",
        "fall2",
        "inertia",
        "spin",
        "fade",
        "sag",
        "start",
    ]
)
DRAG_AXES = 3  # numbers in `body_user`: drag along the axes of the body, N s/m
rotor_at = record_at(ROTOR)


def has_rotors(model: mujoco.MjModel) -> bool:
    """Return whether a model's actuators are rotors."""
    return mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, ROTORS_TEXT) >= 0


@functools.lru_cache(maxsize=32)
def flies(plant: Plant) -> bool:
    """Return whether a plant's actuators are rotors, so that it has drag."""
    return bool(plant.pose) and has_rotors(compiled(plant.spec()))


@njit(error_model="numpy")
def thrust_at(rotor, W):
    """Return the thrust of a rotor at the speed W, N."""
    return (1.0 - rotor.fade) * max(0.0, (rotor.linear + rotor.square * W) * W)


@njit(error_model="numpy")
def speed_for(rotor, thrust):
    """Return the speed at which a whole rotor gives a thrust, rad/s."""
    root = math.sqrt(rotor.linear * rotor.linear + 4.0 * rotor.square * max(thrust, 0.0))
    return (root - rotor.linear) / (2.0 * rotor.square)


@njit(error_model="numpy")
def spun(rotor, W, c, t):
    """Return the speed after a time t at the constant command c, from the speed W, and its rate.

    z = W - c obeys z' = -(first + second z) z, with first = a + 2 b c and second = b.
    """
    if c >= W:
        a = rotor.rise
        b = rotor.rise2
    else:
        a = rotor.fall
        b = rotor.fall2
    z = W - c
    first = a + 2.0 * b * c
    left = math.exp(-first * t)
    if first == 0.0:
        passed = t
    else:
        passed = -math.expm1(-first * t) / first
    z *= left / (1.0 + b * z * passed)
    return c + z, -(first + b * z) * z


def speeds_at_start(model: mujoco.MjModel, numbers: np.ndarray) -> list[float]:
    """Return the speeds of the rotors of a model at the start of a run, (drives,) rad/s, from its
    `actuator_user`.
    """
    return [float(row.view(ROTOR)["start"][0]) for row in numbers[drive_ids(model)]]
