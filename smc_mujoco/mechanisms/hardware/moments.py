"""What parts see of a run, and the moments at which they act.

A callback is a stage of a physics step. At each, in this order:

    stage 0: the sums of the step before; at a sample the readings (`read`), law and delay buffer;
      the command whose delay has passed arrives
    every stage: disturbances, and what a part makes of the wind (`push`); at a sample, the log
    every stage: the parts act, actuators in their order, then frictions: `act`, `force`, `brake` or
      `stage_force`

A part acts by compiled functions:

    force(y, p, memory) -> force on one joint, N m (N), once a physics step, and held over it
    stage_force(y, p, memory) -> the force on one joint at a stage of RK4, and for how many s it
      holds the joint at rest in this step
    brake(y, p, memory) -> a force, as above, the level of MuJoCo's dry friction on the joint, and
      how far the joint is from where that holds it, rad (m)
    read(y, p, memory) -> position and velocity that a sensor gives for a Sight
    act(sim, data, part), push(sim, data, part) -> nothing, once a stage

y is a JointState. p has the part's numbers of the joint by name. The memory is the joint's own.
These functions are checked as laws are: one that raises, or writes beyond its memory, ends the run.
`act` and `push` are for this package's own parts and have no checks. They get the run's record, see
simulation/state.py, the Reach of its mjData, and their PART. They write ctrl, and sum what they
exert in the channel's state.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import dataclasses
import math
from collections import namedtuple
from collections.abc import Callable, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numba import njit
from numba.extending import register_jitable

from smc_mujoco.common.jit import call, floats, inlined, pointer, record_at, whole_numbers

# Indices of a channel in arrays of mjData, -1 if there is none:
#   qpos, qvel, ctrl: in the arrays of these names
#   x_sensor, v_sensor: in sensordata
#   force: in actuator_force
#   shaft, shaft_qpos: in qvel and qpos, of what the actuator drives: the joint, or its rotor
#   xfrc: of the body's force along the joint, in xfrc_applied
#   sign: 1 or -1, with which d enters there
#   horizontal: of the body's horizontal force, in xfrc_applied
#   axis: of the world, 0 or 1, along which that force of a hinge acts
#   hinge_body: of the body of a hinge, in xipos
#   anchor: of a hinge, in xanchor and xaxis
#   friction_force: of a friction's actuator, in actuator_force
#   qfrc: in qfrc_applied, of users' models, whose disturbances act on joints
#   turn: 0 to 2, which number of the rotation vector; qpos and x_sensor are then of the quaternion
#   gathered: in qfrc_actuator, of a free body, on which each actuator may act along every channel
CHANNEL = whole_numbers(
    (
        "qpos",
        "qvel",
        "x_sensor",
        "v_sensor",
        "ctrl",
        "force",
        "shaft",
        "xfrc",
        "sign",
        "horizontal",
        "axis",
        "hinge_body",
        "anchor",
        "friction_force",
        "qfrc",
        "shaft_qpos",
        "turn",
        "gathered",
    )
)

# The state of a channel between calls:
#   delayed: the command after its delay
#   force, reaction: sums over a control period, of the drive's force, and of friction and contacts
#   middle: the force of a drive in the middle of a step of RK4, if the drive sums its force itself
#   exerted: what frictions exert on the joint at this stage
#   held: s of a control period for which friction held the joint
#   level: of MuJoCo's dry friction in the step before, as a part set it
CHANNEL_STATE = floats(("delayed", "force", "reaction", "middle", "exerted", "held", "level"))


class Torque(NamedTuple):
    """How MuJoCo's actuator turns its control into a force on a joint. By default the control is
    the force.
    """

    gain: float = 1.0
    drag: float = 0.0  # N m s/rad (N s/m)
    most: float = math.inf  # bound on the control
    limit: float = math.inf  # N m (N)


# What is between a channel's command and its force: the bound on u; the control of its actuator per
# unit of u; the force as a law's model knows it, gain u - drag v; whether u is an acceleration;
# whether a part sums the force itself; by how much the reference leads through a play; and what
# MuJoCo makes of a control.
DRIVE = np.dtype(
    [
        ("limit", "f8"),
        ("scale", "f8"),
        ("gain", "f8"),
        ("drag", "f8"),
        ("accelerates", "f8"),
        ("sums_force", "f8"),
        ("lead", "f8"),
        ("torque", floats(Torque._fields)),
    ]
)

# A compiled function: its address, those of its parameters and of its memory, and the bytes of
# memory a channel has.
FUNCTION = np.dtype(
    [(name, "i8") for name in ("address", "parameters", "memory", "stride")], align=True
)
# The sensor of a channel: its function, 0 without one; s between readings, and until one arrives.
READER = np.dtype([("function", FUNCTION), ("period", "f8"), ("delay", "f8")], align=True)
# What a part does on one joint, or as a whole (channel -1): its function, whether this is `act`,
# whether a force is of every stage, where in ctrl a force goes (-1: to qfrc_applied), and which
# row of constraints is the joint's dry friction (-1: none).
PART = np.dtype(
    [
        ("function", FUNCTION),
        ("channel", "i8"),
        ("acts", "i8"),
        ("staged", "i8"),
        ("ctrl", "i8"),
        ("row", "i8"),
    ],
    align=True,
)

# What `act` reaches of an mjData, as pointers to numbers; of its mjModel the addresses of what
# rotors and drag have.
Reach = namedtuple(
    "Reach",
    "qpos qvel ctrl xfrc_applied qfrc_applied actuator_force ten_J actuator_user body_user",
)
REACH = whole_numbers(Reach._fields)  # their addresses


@inlined
def reached(at):
    """Return the Reach at the addresses of a REACH."""
    return Reach(
        pointer(at.qpos),
        pointer(at.qvel),
        pointer(at.ctrl),
        pointer(at.xfrc_applied),
        pointer(at.qfrc_applied),
        pointer(at.actuator_force),
        pointer(at.ten_J),
        at.actuator_user,
        at.body_user,
    )


channel_at, state_at, drive_at, reader_at, function_at, part_at = map(
    record_at, (CHANNEL, CHANNEL_STATE, DRIVE, READER, FUNCTION, PART)
)


@njit(error_model="numpy", inline="always")
def evaluate(function, i, inputs, outputs):
    """Call a FUNCTION for channel i, with the addresses of its inputs and outputs. Return whether
    it raised.
    """
    memory = function.memory + i * function.stride
    return call(function.address, inputs, function.parameters, memory, outputs) != 0


@njit(error_model="numpy", inline="always")
def lever(channel, xipos, xanchor, xaxis):
    """Return the torque of a horizontal force of 1 N about a hinge, m: axis . (arm x force).

    All are flat arrays.
    """
    j = channel.axis + 1
    k = (channel.axis + 2) % 3
    arm_j = xipos[channel.hinge_body + j] - xanchor[channel.anchor + j]
    arm_k = xipos[channel.hinge_body + k] - xanchor[channel.anchor + k]
    return xaxis[channel.anchor + j] * arm_k - xaxis[channel.anchor + k] * arm_j


@njit(error_model="numpy", inline="always")
def generalised_disturbance(data, channel):
    """Return the generalised force on a channel's joint of the disturbances that act on its
    body.
    """
    if channel.qfrc >= 0:
        return data.qfrc_applied[channel.qfrc]
    d = channel.sign * data.xfrc_applied[channel.xfrc]
    if channel.hinge_body >= 0:
        d += (
            lever(channel, data.xipos, data.xanchor, data.xaxis)
            * data.xfrc_applied[channel.horizontal]
        )
    return d


class JointState(NamedTuple):
    """What the force of a part on a joint may depend on, in SI units.

    It is of the start of a physics step, or of a stage if the force is given at every stage.
    """

    t: float  # time
    h: float  # physics step
    x: float  # position
    v: float  # velocity
    u: float  # the command of its channel after its delay; 0 without an actuator
    motor: float  # force of the joint's drive: in the step before, or at this stage
    # the other forces: gravity, gyration, springs, disturbances; contacts of the step before, but
    # not a play or a spring, which passes on the motor's force
    load: float
    # the rest is only of joints that move alone, for forces at every stage
    stage: float = 0.0  # 0 to 3
    others: float = 0.0  # `load` with the joint's damping, and without contacts
    mean: float = 0.0  # force of the drive in the middle of the step
    level: float = 0.0  # dry friction of the model
    mobility: float = 0.0  # 1/inertia


class Sight(NamedTuple):
    """What a sensor may give: the true state with noise, and the reading's random number 0 .. 1."""

    x: float  # rad (m)
    v: float
    j: float  # index of the reading, from 0
    hinge: float  # 1 on a hinge, 0 on a slide
    chance: float


@dataclasses.dataclass(frozen=True)
class Run:
    """What a part's numbers may depend on. Lists are of the joints that it acts on."""

    n: int  # these joints
    driven: int  # channels that have an actuator
    step: float  # physics step, s
    rk4: bool
    x0: Sequence[float]
    v0: Sequence[float]
    locate: Callable[[], Sequence[int]]  # -> degrees of freedom of these joints in the MjModel
    load: Callable[[int], mujoco.MjModel]  # physics step -> a copy with the values from then on
    jump_step: int  # the first with what the scenario's jump changes; -1 without a jump
    draw: Callable[[], list[float]]

    @property
    def dofs(self) -> Sequence[int]:
        """Their degrees of freedom in the MjModel."""
        return self.locate()

    @property
    def model(self) -> mujoco.MjModel:
        """The MjModel with the scenario's values, a new copy."""
        return self.load(0)

    @property
    def phases(self) -> list[float]:
        """Random numbers 0 .. 1 of the joints."""
        return self.draw()


@register_jitable
def torque(drive, control, v):
    """Return the force of an actuator, N m (N), on a joint at the speed v, rad/s (m/s)."""
    force = drive.gain * min(max(control, -drive.most), drive.most) - drive.drag * v
    return min(max(force, -drive.limit), drive.limit)
