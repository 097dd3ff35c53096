"""A delay of the command of some joints, in MuJoCo's own buffer.

`input_delay` delays all commands of a run alike. A file's actuator may have a delay of its own,
which stays as it is: u is the command before it.
"""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a field here)
import math
from collections.abc import Hashable, Mapping, Sequence
from typing import Annotated, Any, ClassVar

import mujoco

from smc_mujoco.common.constraints import OneOf
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.hardware.drives import drive_step
from smc_mujoco.mechanisms.hardware.part import Actuator, Positive

INTERPOLATIONS = ("zoh", "linear", "cubic")  # in MuJoCo's order
# Physics steps by which a held command is read later than its delay. All stages of a step of RK4
# then read the same command: the last stage is one step later than the first.
HELD = 0.25
ROUNDING = 1e-6  # physics steps
MOST_LATE = 0.05  # of a delay, by which a whole number of steps may exceed it; chosen
MORE = 2  # samples on each side of an interpolation


@frozen_data
class CommandDelay(Actuator):
    """A delay between the command and the actuator of a joint, in MuJoCo's own buffer.

        smc.hardware.CommandDelay(0.02)

    It adds to `input_delay`, which is of all joints. The command is held over each physics step, as
    that of `input_delay`, and is late by a whole number of them, at most 5 % more. Until the first
    one arrives, the actuator has the command 0. In a trace `applied` is the command before it. A
    law has no nominal model of it.

    It stands before a PositionServo, a CommandFilter, a DCMotor without ripple and inductance, or
    no drive at all. What MuJoCo's callback simulates before the actuator, such as a Lag, would be
    delayed too, with speeds that are not.

    Attributes:
      dead_time: s, greater than 0.
      interp: how MuJoCo reads between two commands: "zoh" holds the one before; "linear" and
        "cubic" interpolate, also at the stages of RK4.

    Raises:
      ScenarioError: in a scenario beside a drive that the callback simulates, or with a physics
        step that is too long for it.
    """

    units: ClassVar[Mapping[str, str]] = {"dead_time": "s"}

    dead_time: Positive
    interp: Annotated[str, OneOf(names=INTERPOLATIONS)] = "zoh"

    leads: ClassVar[bool] = True

    @property
    def lateness(self) -> float:
        """The dead time, s."""
        return self.dead_time

    def edit(self, spec: mujoco.MjSpec) -> None:
        step = float(spec.option.timestep)
        samples = max(1, math.ceil(self.dead_time / step - ROUNDING))
        delay = (samples + HELD) * step
        if self.interp != "zoh":
            samples += MORE
            delay = self.dead_time
        for actuator in self.drives_of(spec):
            actuator.nsample = samples
            actuator.interp = INTERPOLATIONS.index(self.interp)
            actuator.delay = delay

    def structure(self) -> tuple[Hashable, ...]:
        return *super().structure(), self.dead_time, self.interp

    def suits(self, s: Any, chain: Sequence[Actuator]) -> None:
        steps = self.dead_time / s.physics_step
        late = math.ceil(steps - ROUNDING)
        if self.interp == "zoh" and late > (1.0 + MOST_LATE) * steps:
            raise ScenarioError(
                f"CommandDelay's dead_time {self.dead_time:g} s would be "
                f"{late * s.physics_step:g} s at physics steps of {s.physics_step:g} s: give a "
                "physics_step that divides it"
            )
        simulated = drive_step(tuple(chain), s.physics_step, s.integrator == "RK4") is not None
        for part in chain:
            if part.drives and part is not self and (simulated or part.force is not None):
                raise ScenarioError(
                    f"a CommandDelay stands before {type(part).__name__}, whose state would be "
                    "delayed with the command: give input_delay instead, or leave one of them out"
                )
