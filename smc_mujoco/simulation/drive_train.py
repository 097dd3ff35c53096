"""The drives between the command and the joints of a scenario, by driven channel."""

import math
from typing import Any

from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.text import joined
from smc_mujoco.mechanisms.hardware.moments import Torque
from smc_mujoco.mechanisms.hardware.part import Actuator, NominalDrive, chains
from smc_mujoco.mechanisms.layout import driven_names


class DriveTrain:
    """What is between the command u of each driven channel and the force on its joint.

        smc.Scenario(plant="duffing", law="pid", actuator=smc.Lag(0.01)).drive_train.scales

    Attributes:
      scenario: the Scenario whose drives they are.
    """

    def __init__(self, scenario: Any):
        self.scenario = scenario
        self.plant = scenario.plant
        self.actuator = scenario.actuator

    @cached_property
    def chains(self) -> list[tuple[Actuator, ...]]:
        """The actuators of each driven channel, in series."""
        if not self.actuator:
            return [()] * self.plant.driven
        return chains(self.actuator, driven_names(self.plant))

    @cached_property
    def motors(self) -> list[Actuator]:
        """The motor of each driven channel whose u is no force; else an Actuator that does
        nothing.
        """
        motors = []
        for chain in self.chains:
            special = (part for part in chain if part.unit)
            motors.append(next(special, Actuator()))
        return motors

    @property
    def accelerates(self) -> bool:
        """Whether u is an acceleration, of any joint."""
        return any(part.accelerates for part in self.actuator)

    @property
    def force_command(self) -> bool:
        """Whether u is a force."""
        return not any(part.unit for part in self.actuator)

    @cached_property
    def efforts(self) -> tuple[str, ...]:
        """Unit of u in each channel, (n,): that of the joint's force, "V", or that of its
        acceleration or of its position.
        """
        efforts = list(self.plant.efforts)
        for i, (motor, unit_of_x) in enumerate(zip(self.motors, self.plant.units, strict=False)):
            efforts[i] = motor.unit.format(x=unit_of_x) or efforts[i]
        return tuple(efforts)

    @property
    def words(self) -> list[str]:
        """Sentences that say what u is where it is no force, one for the joints that share it, and
        where an actuator gets it late.
        """
        joints: dict[str, list[str]] = {}
        for motor, unit, joint in zip(
            self.motors, self.plant.units, driven_names(self.plant), strict=False
        ):
            if motor.meaning:
                meaning = motor.meaning.format(x=unit)
                joints.setdefault(meaning, []).append(repr(joint))
        name = self.plant.name
        sentences = []
        for what, those in joints.items():
            sentences.append(f"u of {joined(those)} of {name} is {what}.")
        for part in self.actuator:
            if part.lateness:
                late = joined(map(repr, part.joint_names(self.plant)))
                ms = f"{1e3 * part.lateness:g} ms"
                sentences.append(f"The actuator of {late} of {name} gets its command {ms} late.")
        return sentences

    @cached_property
    def limits(self) -> tuple[float, ...]:
        """The bound on |u| of each driven channel, in the unit of u: the lesser of u_max and the
        motor's limit.
        """
        bounds = self.scenario.resolved.u_max
        if not isinstance(bounds, tuple):
            bounds = (bounds,) * self.plant.driven
        limits = self.plant.limits or bounds
        smaller = []
        for motor, bound, limit in zip(self.motors, bounds, limits, strict=True):
            if motor.accelerates:  # the plant's limits are of a force
                smaller.append(bound)
            elif motor.unit:
                smaller.append(min(bound, motor.bound or math.inf))
            else:
                smaller.append(min(bound, limit))
        return tuple(smaller)

    @property
    def forces(self) -> list[float]:
        """The largest force of each driven channel at rest, N m or N."""
        pairs = zip(self.motors, self.limits, strict=True)
        return [motor.force_at(limit) for motor, limit in pairs]

    @property
    def torques(self) -> list[Torque]:
        """What MuJoCo's actuator of each driven channel makes of its control in a step with
        `exact_friction`.
        """
        step = self.scenario.resolved.physics_step
        torques = []
        for chain in self.chains:
            even = next((part for part in chain if part.even), None)
            torque = Torque() if even is None else even.mujoco_torque(step, True)
            torques.append(torque)
        return torques

    @property
    def scales(self) -> list[float]:
        """The control of the actuator of each driven channel, per unit of u."""
        scales = []
        for chain in self.chains:
            scales.append(math.prod(part.scale for part in chain))
        return scales

    @cached_property
    def nominal(self) -> list[NominalDrive]:
        """The actuator of each channel, (n,), in the nominal model: its force is gain u - drag
        v.
        """
        of_free = [NominalDrive()] * self.plant.free
        return [motor.nominal for motor in self.motors] + of_free
