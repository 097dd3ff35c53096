"""Parts: what makes a mechanism realistic, as edits of its model and numbers in its fields.

A part is frozen data. `edit` adds to an MjSpec what it is made of - a rotor, a stop, an actuator that is a friction -
and `fields` yields the fields of the compiled model that its numbers set, so that simulations with other numbers share
one model in a Batch. MuJoCo simulates the parts; they have no code of their own.

Names of parts: an actuator `passive:<joint>` belongs to a part and takes no command; `rotor:<joint>` is the joint that
a channel's actuator drives if that is not the channel's own.
"""

import dataclasses
from collections.abc import Hashable, Iterator
from typing import Any, ClassVar

import mujoco
import numpy as np

from smc_mujoco.common.errors import number
from smc_mujoco.mechanisms.plant import LARGEST, Field

PASSIVE, ROTOR = "passive:", "rotor:"
PLAY = "play:"  # the tendon of length rotor - joint
# The hardest constraint that MuJoCo offers: it reads a time constant of less than two steps as two steps.
HARD_SOLREF = (1e-9, 1.0)  # time constant in s, damping ratio
HARD_SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)  # impedance at and away from zero; the rest then has no effect
START = "smc:start"  # a keyframe in which the joints without a channel start


@dataclasses.dataclass(frozen=True)
class Part:
    """Base of all parts."""

    stateful: ClassVar[bool] = False  # whether MuJoCo integrates a state of it, which RK4 does badly

    def check_numbers(self, *names: str, **bounds: Any) -> None:
        """Replace fields by the floats that they stand for. None stays where it is the field's default.

        Args:
          bounds: as those of `errors.number`; `most` is LARGEST by default.

        Raises:
          ScenarioError: a field is no number within these bounds.
        """
        limits: dict[str, Any] = {"most": LARGEST} | bounds
        for name in names:
            value, optional = getattr(self, name), getattr(type(self), name, 0.0) is None
            if value is not None or not optional:
                value = number(f"{type(self).__name__}'s {name}", value, **limits)
                object.__setattr__(self, name, value)

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Add what the part is made of to a mechanism, once for every channel."""

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        """Yield the fields of the edited, compiled model that the part's numbers set."""
        del model
        yield from ()

    def structure(self) -> Hashable:
        """Return what simulations must have in common to share a model: equal if `edit` does the same."""
        return type(self)


@dataclasses.dataclass(frozen=True)
class Friction(Part):
    """Base of frictions: what resists a channel's joint, beside the plant's own damping."""


@dataclasses.dataclass(frozen=True)
class Actuator(Part):
    """Base of actuators: what stands between a command u, the force asked of the joint, and the joint."""

    drives: ClassVar[bool] = True  # whether it turns u into force; else it stands after what does

    @property
    def scale(self) -> float:
        """Control of the model's actuator per unit of u."""
        return 1.0

    @property
    def delay(self) -> float:
        """Time constant with which the force follows a held u, s; 0: at once."""
        return 0.0


def drives(spec: mujoco.MjSpec) -> list[mujoco.MjsActuator]:
    """Return the actuators that take commands, one for each driven channel."""
    return [actuator for actuator in spec.actuators if not actuator.name.startswith(PASSIVE)]


def driven(spec: mujoco.MjSpec) -> list[mujoco.MjsJoint]:
    """Return the joints of the driven channels, in the order of `drives`."""
    return [spec.joint(actuator.target.removeprefix(ROTOR)) for actuator in drives(spec)]


def joints(spec: mujoco.MjSpec) -> list[mujoco.MjsJoint]:
    """Return the channels' joints: first the driven ones, then those that are only measured."""
    names = [joint.name for joint in driven(spec)]
    measured = [sensor.objname for sensor in spec.sensors if sensor.type == mujoco.mjtSensor.mjSENS_JOINTPOS]
    return [spec.joint(name) for name in [*names, *(name for name in measured if name not in names)]]


def drive_ids(model: mujoco.MjModel) -> np.ndarray:
    """Return the numbers of the actuators that take commands."""
    return np.array([i for i in range(model.nactuator) if not model.actuator(i).name.startswith(PASSIVE)], int)


def driven_ids(model: mujoco.MjModel) -> np.ndarray:
    """Return the numbers of the driven channels' joints."""
    names = [model.joint(model.actuator_trnid[i, 0]).name for i in drive_ids(model)]
    return np.array([model.joint(name.removeprefix(ROTOR)).id for name in names], int)


def joint_ids(model: mujoco.MjModel) -> np.ndarray:
    """Return the numbers of the channels' joints, (n,): first the driven ones, then those that are only measured."""
    found = driven_ids(model)
    measured = model.sensor_objid[model.sensor_type == mujoco.mjtSensor.mjSENS_JOINTPOS]
    return np.array([*found, *(joint for joint in measured if joint not in found)], int)


def dof_ids(model: mujoco.MjModel) -> np.ndarray:
    """Return the numbers of the channels' degrees of freedom, (n,)."""
    return model.jnt_dofadr[joint_ids(model)]
