"""Rotors of a free body, and the air that it flies through: what MuJoCo's actuators and fluids do
not have.

A rotor turns at the speed W, rad/s. It is told the speed c that gives the wanted thrust, and
follows it by

    W' = rise (c - W) + rise2 (c^2 - W^2),    with fall and fall2 instead while it slows down,
    thrust = (1 - fade) (linear W + square W^2),    0 at least,

and its angular momentum h = sum of inertia spin W, along the body's third axis, acts on the body
with -w x (0, 0, h) - (0, 0, h'). spin is 1 counter-clockwise seen from above; the drag of a rotor's
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

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a function or a property here)
import dataclasses
import functools
import math
from collections.abc import Sequence

import mujoco
import numpy as np
from numba import njit

from smc_mujoco.common.jit import floats, pointer, record_at
from smc_mujoco.mechanisms import rotation
from smc_mujoco.mechanisms.hardware.moments import Run, channel_at, state_at
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.mechanisms.layout import drive_ids, loaded
from smc_mujoco.mechanisms.plant import Plant

ROTORS_TEXT = "smc:rotors"  # name of a text in models whose actuators are rotors
# linear [N s/rad], square [N s^2/rad^2], rise and fall [1/s], rise2 and fall2 [1/rad],
# inertia [kg m^2], spin [1 or -1], fade [1], sag [1/N], start: the speed at which a run begins
# [rad/s]
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
FAST_ROTOR = 12.0  # time constants in a step: with more, a rotor has no lag
rotor_at = record_at(ROTOR)
kept_at = record_at(floats(("first", "second")))  # a rotor's speed, and the speed that it is told


def has_rotors(model: mujoco.MjModel) -> bool:
    """Return whether a model's actuators are rotors."""
    return mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, ROTORS_TEXT) >= 0


@functools.lru_cache(maxsize=32)
def flies(plant: Plant) -> bool:
    """Return whether a plant's actuators are rotors, so that it has drag."""
    return bool(plant.pose) and has_rotors(loaded(plant))


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
    if t != 0.0:
        passed = t
        if first != 0.0:
            passed = -math.expm1(-first * t) / first
        z *= math.exp(-first * t) / (1.0 + b * z * passed)
    return c + z, -(first + b * z) * z


def speeds_at_start(model: mujoco.MjModel, numbers: np.ndarray) -> list[float]:
    """Return the speeds of the rotors of a model at the start of a run, (drives,) rad/s, from its
    `actuator_user`.
    """
    return [float(row.view(ROTOR)["start"][0]) for row in numbers[drive_ids(model)]]


@njit(error_model="numpy")
def _command(sim, data, part, lifted):
    """Tell the rotors their speeds while all of them give the thrust `lifted`, N."""
    for j in range(sim.actuators):
        rotor = rotor_at(data.actuator_user, j)
        delayed = state_at(sim.states, j).delayed
        speed = speed_for(rotor, delayed) * max(0.0, 1.0 - rotor.sag * lifted)
        kept_at(part.function.memory, j).second = speed


@njit(error_model="numpy")
def _begin_step(sim, data, part):
    """Turn the rotors to the step, and tell them their speeds in it."""
    lifted = 0.0
    sags = False
    for j in range(sim.actuators):
        rotor = rotor_at(data.actuator_user, j)
        speeds = kept_at(part.function.memory, j)
        if sim.now > 0:
            speeds.first = spun(rotor, speeds.first, speeds.second, sim.step)[0]
        lifted += thrust_at(rotor, speeds.first)
        sags |= rotor.sag != 0.0
    _command(sim, data, part, lifted)
    if sags:  # by the thrust in the middle of the step
        lifted = 0.0
        for j in range(sim.actuators):
            rotor = rotor_at(data.actuator_user, j)
            speeds = kept_at(part.function.memory, j)
            lifted += thrust_at(rotor, spun(rotor, speeds.first, speeds.second, 0.5 * sim.step)[0])
        _command(sim, data, part, lifted)
    for j in range(sim.actuators):
        rotor = rotor_at(data.actuator_user, j)
        speeds = kept_at(part.function.memory, j)
        if min(rotor.rise, rotor.fall) * sim.step > FAST_ROTOR:
            speeds.first = speeds.second


@njit(error_model="numpy")
def drag_of(sim, data, x, y, z):
    """Return R diag(drag) R' times a velocity (x, y, z) in the axes of the world, N."""
    place = channel_at(sim.channels, 0)
    first = channel_at(sim.channels, 3).qpos
    q = data.qpos[first], data.qpos[first + 1], data.qpos[first + 2], data.qpos[first + 3]
    along = rotation.rotate_inverse(q, x, y, z)
    drag = pointer(data.body_user + 8 * DRAG_AXES * (place.xfrc // 6))
    return rotation.turned(q, drag[0] * along[0], drag[1] * along[1], drag[2] * along[2])


@dataclasses.dataclass(frozen=True)
class Rotors(Part):
    """The rotors and the drag of a free body whose model has them."""

    is_drive = True
    memory = 2

    def start(self, run: Run) -> list[Sequence[float]]:
        speeds = speeds_at_start(run.model, run.model.actuator_user)
        # the last row: angular momentum and its rate
        return [*((speed, speed) for speed in speeds), (0.0, 0.0)]

    def channels(self, plant: Plant) -> Sequence[int]:
        return (-1,)

    @staticmethod
    def act(sim, data, part):
        """Give the body its rotors' thrust, their gyroscopic torque and its drag at a stage."""
        if sim.stage == 0:
            _begin_step(sim, data, part)
        passed = sim.step * (0.5 if sim.stages == 1 else 0.5 * ((sim.stage + 1) // 2))
        turning = kept_at(part.function.memory, sim.actuators)
        momentum = turning.first
        change = turning.second
        if sim.stage != 2:  # which is in the middle of the step, too
            momentum = change = 0.0
        for j in range(sim.actuators if sim.stage != 2 else 0):
            rotor = rotor_at(data.actuator_user, j)
            speeds = kept_at(part.function.memory, j)
            W, rate = spun(rotor, speeds.first, speeds.second, passed)
            data.ctrl[channel_at(sim.channels, j).ctrl] = thrust_at(rotor, W)
            momentum += rotor.inertia * rotor.spin * W
            change += rotor.inertia * rotor.spin * rate
        turning.first = momentum
        turning.second = change
        dof = channel_at(sim.channels, 0).qvel
        v = data.qvel
        drag = drag_of(sim, data, data.qvel[dof], data.qvel[dof + 1], data.qvel[dof + 2])
        for i in range(3):
            data.qfrc_applied[dof + i] = -drag[i]
        data.qfrc_applied[dof + 3] = -v[dof + 4] * momentum
        data.qfrc_applied[dof + 4] = v[dof + 3] * momentum
        data.qfrc_applied[dof + 5] = -change

    @staticmethod
    def push(sim, data, part):
        """Apply the force of the wind."""
        force = drag_of(sim, data, sim.wind[0], sim.wind[1], sim.wind[2])
        for i in range(3):
            data.xfrc_applied[channel_at(sim.channels, i).xfrc] += force[i]
