"""The record of one simulation: all that the callback needs besides MuJoCo's state.

`mjData.userdata` holds two numbers: `callback.MAGIC` and the address of the record. Compiled code
reads the record by names (`sim.period`, `sim.calls += 1`), Python as a NumPy structured array of
the same dtype. Inputs and outputs of users' functions are in the record, too. Arrays, such as gains
and memories, are in one buffer outside of the record, which has their addresses.
"""

import itertools
from collections import namedtuple
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from smc_mujoco.common.jit import floats, record_at
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import HANDLE
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.hardware.moments import (
    FUNCTION,
    PART,
    REACH,
    JointState,
    Sight,
)
from smc_mujoco.mechanisms.plant import SEEN

# Inputs and outputs of functions.
#   law: MEASUREMENT, or the measurement of a law of many joints -> u and s, one or n of each
#   surface: MEASUREMENT -> SLIDING; estimator: READING -> ESTIMATE; nominal model: SEEN -> MODEL
#   reference and disturbance: INSTANT -> MOTION; sensor: SIGHT -> RAW
#   force of a part: JOINT_STATE -> EXERTED
MEASUREMENT = floats(Measurement._fields)
READING = floats(Reading._fields)
INSTANT = floats(("t", "seed", "channel", "stream", "e", "de", "s"))
SLIDING = floats(("s", "v_eq"))
ESTIMATE = floats(("v", "a"))
MOTION = floats(("value", "rate", "acceleration"))
MODEL = floats(("f", "g"))
SIGHT = floats(Sight._fields)
RAW = floats(("x", "v"))
JOINT_STATE = floats(JointState._fields)
# grip: the level of dry friction, N m (N), of a `brake`; for how many s it holds the joint, of a
# `stage_force`
EXERTED = floats(("force", "grip", "away"))

# A sample of a channel: position, velocity, command, command after its delay, sliding variable,
# disturbance, reference, the drive's force, what friction and contacts exert.
LOGGED = ("x", "v", "u", "applied", "s", "d", "r", "force", "reaction")
# and the time for which `exact_friction` held its joint since the sample before, s; what of u
# compensates friction
LOG = floats((*LOGGED, "held", "compensation"))

# A disturbance: its stream of random numbers (0: none, and then it is the same in every channel),
# whether it is a horizontal force on the body instead of a force on the joint, and whether it sees
# the loop. Of a `Push` also the index of its body in xfrc_applied, and its peak; body is -1 for
# others. `air` tells whether it is a wind, m/s, with its peak along each axis.
DISTURBANCE = np.dtype(
    [
        ("function", FUNCTION),
        ("stream", "f8"),
        ("cartesian", "i8"),
        ("sees", "i8"),
        ("body", "i8"),
        ("air", "i8"),
        ("peak", "f8", (3,)),
    ],
    align=True,
)

SIMULATION = np.dtype(
    [
        # address of the addresses of MuJoCo's other callbacks, which nobody may set meanwhile
        ("slots", "i8"),
        # what has happened so far: calls of the callback, a failure and its physics step
        ("calls", "i8"),
        ("failure", "i8"),
        ("failed_step", "i8"),
        # sizes: channels, those of them that have an actuator, their partners, those that have a
        # reference, qpos, qvel, samples in the log, disturbances
        ("n", "i8"),
        ("driven", "i8"),
        ("partners", "i8"),
        ("referenced", "i8"),
        ("nq", "i8"),
        ("nv", "i8"),
        ("samples", "i8"),
        ("disturbance_count", "i8"),
        # the clock: physics steps per control period, callbacks per physics step, lengths of step
        # and period in s
        ("steps", "i8"),
        ("stages", "i8"),
        ("step", "f8"),
        ("period", "f8"),
        # addresses of arrays: CHANNEL (n,), CHANNEL_STATE (n,), LOG (K + 1, n), DISTURBANCE
        # (disturbance_count,)
        ("channels", "i8"),
        ("states", "i8"),
        ("log", "i8"),
        ("disturbances", "i8"),
        # addresses of C functions for what only some runs have, see cfunctions.compile_moment:
        # disturbances, a law of many joints, the mixing of a free body's force and torque
        ("disturb", "i8"),
        ("ask_joints", "i8"),
        ("mix", "i8"),
        # the command: delay in physics steps, a ring of (delay_slots, n) commands; DRIVE (n,)
        ("delay", "i8"),
        ("delay_slots", "i8"),
        ("delay_buffer", "i8"),
        ("drives", "i8"),
        # a fault of the actuators: its first physics step, gain, bias, whether they are stuck, and
        # the index of the one that fails, -1 for all
        ("fault_step", "i8"),
        ("fault_gain", "f8"),
        ("fault_bias", "f8"),
        ("stuck", "i8"),
        ("failing", "i8"),
        # a free body: its actuators, the address of their rows for rotation.mix, 0 for others, and
        # its keeps_torques
        ("actuators", "i8"),
        ("mixer", "i8"),
        ("keeps_torques", "i8"),
        # the controller's timer: the largest delay of a sample in physics steps, the share of
        # samples that are missed
        ("jitter", "i8"),
        ("missed", "f8"),
        # pauses: physics steps of one, samples from one to the next, and by how many the first
        # comes earlier
        ("pause", "i8"),
        ("pause_samples", "i8"),
        ("pause_phase", "i8"),
        # the parts that act: how many, the address of their PARTs, whether these exert forces on
        # joints; what pushes at a wind, and what the wind is, m/s
        ("part_count", "i8"),
        ("parts", "i8"),
        ("exerts", "i8"),
        ("push", PART),
        ("wind", "f8", (3,)),
        # what they read of the callback: stage and physics step, whether a command arrived, and
        # what they reach, if `reaches`
        ("stage", "i8"),
        ("now", "i8"),
        ("arrived", "i8"),
        ("reaches", "i8"),
        ("reach", REACH),
        # the sensors: noise, and the address of READER (n,), 0 for none
        ("seed", "f8"),
        ("sigma_x", "f8"),
        ("sigma_v", "f8"),
        ("readers", "i8"),
        ("position_error", FUNCTION),
        ("velocity_error", FUNCTION),
        # functions, and whether the law may use the nominal model
        ("law", FUNCTION),
        ("surface", FUNCTION),
        ("estimator", FUNCTION),
        ("nominal", FUNCTION),
        ("reference", FUNCTION),
        ("feedforward", FUNCTION),
        # compensation of friction: how many PARTs, their address, 1 + error, eps, and on what, an
        # index of feedforward.ON
        ("compensated", "i8"),
        ("compensations", "i8"),
        ("share", "f8"),
        ("eps", "f8"),
        ("compensates_on", "i8"),
        ("uses_model", "f8"),
        # address of the other forces on the joints, (n,), for a law with the true model; else 0
        ("other_forces", "i8"),
        # addresses of the FUNCTIONs of the driven channels, and of those with a reference, where
        # they differ; 0: all have `law`, or `reference`
        ("laws", "i8"),
        ("references", "i8"),
        # what has been measured, and the address of estimated accelerations, (n,)
        ("seen", SEEN),
        ("a", "i8"),
        # the law: how many channels it commands at a call, 1 or n, and the address of its u and s,
        # (2, width)
        ("width", "i8"),
        ("commands", "i8"),
        # a law of many joints: the address of its measurement, see control/joint_law.py, and 0 for
        # a law of one channel; the nominal M, h and g (0: from `nominal`, one equation per
        # channel), and the functions of C and of the tip's Jacobian (0: there are none)
        ("joint", "i8"),
        ("dynamics", FUNCTION),
        ("handle", HANDLE),
        # inputs and outputs of functions
        ("y", MEASUREMENT),
        ("reading", READING),
        ("instant", INSTANT),
        ("sliding", SLIDING),
        ("estimate", ESTIMATE),
        ("motion", MOTION),
        ("model", MODEL),
        ("sight", SIGHT),
        ("raw", RAW),
        ("joint_state", JOINT_STATE),
        ("exerted", EXERTED),
        ("unused", "f8", (8,)),  # so that no two simulations write to one cache line
    ],
    align=True,
)

# How compiled code reads record i of an array at an address.
simulation_at, log_at, disturbance_at = map(record_at, (SIMULATION, LOG, DISTURBANCE))

# Bytes from the start of a simulation's record to the inputs and outputs of functions.
At = namedtuple(
    "At",
    "y reading instant sliding estimate motion model seen handle sight raw joint_state exerted "
    "push",
)
AT = At(*(SIMULATION.fields[name][1] for name in At._fields))  # pyright: ignore[reportOptionalSubscript, reportArgumentType]

# Values of `failure`. RAISED: another function than the law raised an exception.
FINE, DIVERGED, NOT_FINITE, LAW_RAISED, RAISED, DISTURBANCE_NOT_FINITE, INTERRUPTED = range(7)


class Index(int):
    """The index of a number in a Buffer."""


class Buffer:
    """Numbers that become one float64 array.

    They have indices at once, and addresses when the array is made.
    """

    def __init__(self) -> None:
        self.values: list[float] = []
        self.base = 0

    def put(self, values: Iterable[float]) -> Index:
        """Append numbers and return the index of the first."""
        index = Index(len(self.values))
        self.values.extend(values)
        return index

    def reserve(self, count: int) -> Index:
        """Append zeros and return the index of the first."""
        return self.put(itertools.repeat(0.0, count))

    def array(self) -> np.ndarray:
        """Return the numbers, (count,) float64."""
        array = np.array(self.values)
        self.base = address(array)
        return array

    def as_tuple(self, dtype: np.dtype, values: Mapping[str, Any]) -> tuple:
        """Return the values of a record's fields in their order: an address for an Index, 0 for a
        missing value.
        """
        fields = []
        for name in dtype.names or ():
            value = values.get(name, 0)
            if dtype[name].names is not None:
                value = self.as_tuple(dtype[name], value or {})
            fields.append(self.base + 8 * value if isinstance(value, Index) else value)
        return tuple(fields)


def address(array: np.ndarray) -> int:
    """Return the address of the data of a C-contiguous array."""
    return array.ctypes.data  # of a record array 25 times faster than its __array_interface__


def array_at(array: np.ndarray, at: int, shape: Sequence[int]) -> np.ndarray:
    """Return the numbers at an address within a float64 array, as an array of a shape."""
    first = (at - address(array)) // 8
    return array[first : first + int(np.prod(shape))].reshape(shape)
