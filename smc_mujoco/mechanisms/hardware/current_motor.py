"""A motor whose command is its current: u in A, and a force in proportion to it."""

# pyright: reportIncompatibleVariableOverride=false
# (constants of the base class are properties here)
import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

from smc_mujoco.common.constraints import Number
from smc_mujoco.common.data import frozen_data
from smc_mujoco.mechanisms.hardware.part import Actuator, NominalDrive, Positive


@frozen_data
class CurrentMotor(Actuator):
    """Motor with a current loop: force = constant u, where u is the current, A.

        smc.hardware.CurrentMotor(8.478, largest=150.0)  # u in A, at most 17.7

    The current follows u at once; a Lag may stand before it. A law's nominal model knows the
    constant.

    Attributes:
      constant: N m/A (N/A) at the joint, greater than 0.
      largest: N m (N), the force at the largest current, greater than 0, which bounds u; math.inf:
        u is not bounded.
    """

    unit = "A"
    meaning = "the current of its motor, in A"
    units: ClassVar[Mapping[str, str]] = {"constant": "{f}/A", "largest": "{f}"}

    constant: Positive
    largest: Annotated[float, Number(above=0.0, infinite=True)] = math.inf

    @property
    def scale(self) -> float:
        """The force per unit of u, N m/A (N/A)."""
        return self.constant

    @property
    def bound(self) -> float | None:
        """The largest current, A; None if it is not bounded."""
        return self.largest / self.constant if self.largest < math.inf else None

    @property
    def stall(self) -> float | None:
        """The largest force, N m (N); None if it is not bounded."""
        return self.largest if self.largest < math.inf else None

    @property
    def nominal(self) -> NominalDrive:
        """The force per unit of u."""
        return NominalDrive(self.constant)
