"""A first-order filter of the command of some joints, as a file's motor has it.

    tau a' = u - a,  force = a,  from a = 0

MuJoCo steps it with the model. A `Lag` is the same equation, with the mean force over a step.
"""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a property here)
from collections.abc import Hashable, Iterator, Mapping
from typing import ClassVar

import mujoco

from smc_mujoco.common.constraints import Boolean
from smc_mujoco.common.data import frozen_data
from smc_mujoco.mechanisms.hardware.part import Actuator, Positive
from smc_mujoco.mechanisms.plant import Field

TIMECONST = 0  # its place in actuator_dynprm of the compiled model


@frozen_data
class CommandFilter(Actuator):
    """MuJoCo's filter of the command of a motor (dyntype filterexact or filter).

        smc.hardware.CommandFilter(0.05)

    A model of your own that has such motors keeps them so. In a scenario of your own a `Lag` is
    nearer to its equation: MuJoCo gives each step the force at its start, half a step late. A Lag
    or a CommandDelay may stand before it.

    Attributes:
      tau: s, greater than 0.
      euler: whether MuJoCo steps it by Euler's rule (dyntype filter), else exactly (filterexact).
    """

    units: ClassVar[Mapping[str, str]] = {"tau": "s"}

    tau: Positive
    euler: Boolean = False

    @property
    def delay(self) -> float:
        """The time constant tau, s."""
        return self.tau

    def edit(self, spec: mujoco.MjSpec) -> None:
        kinds = mujoco.mjtDyn
        for actuator in self.drives_of(spec):
            actuator.dyntype = kinds.mjDYN_FILTER if self.euler else kinds.mjDYN_FILTEREXACT

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        yield Field("actuator_dynprm", (self.drive_ids(model), TIMECONST), self.tau)

    def structure(self) -> tuple[Hashable, ...]:
        return *super().structure(), self.euler
