"""Drag of a fluid: a force against the motion that grows with the square of the speed."""

# pyright: reportIncompatibleVariableOverride=false
# (a constant of the base class is a property here)
from collections.abc import Iterator, Mapping
from typing import ClassVar

import mujoco

from smc_mujoco.common.data import frozen_data
from smc_mujoco.mechanisms.hardware.part import Added, Friction, Natural
from smc_mujoco.mechanisms.plant import Field

OF_SPEED = 0  # column of dof_dampingpoly: the damping that |v| adds


@frozen_data
class Drag(Friction):
    """Drag of water or air: -(linear + quadratic |v|) v, on top of the plant's own damping.

        smc.hardware.Drag(linear=50.0, quadratic=30.0)

    MuJoCo integrates it as the damping of the joint.

    Source: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., Wiley,
    2021, chapter 6.4: the damping of one degree of freedom.

    Attributes:
      linear: N m s/rad (N s/m), 0 or more.
      quadratic: N m s^2/rad^2 (N s^2/m^2), 0 or more.
    """

    smooth = True
    forces = names = "linear", "quadratic"
    units: ClassVar[Mapping[str, str]] = {"linear": "{f} s/{x}", "quadratic": "{f} s^2/{x}^2"}

    linear: Natural
    quadratic: Natural

    @staticmethod
    def steady(y, p, memory):
        return (p.linear + p.quadratic * abs(y.v)) * y.v

    @property
    def added_to_model(self) -> Added:
        """Its damping, at rest and per speed, and no dry friction."""
        return Added(damping=self.linear, per_speed=self.quadratic)

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        dofs = self.dofs(model)
        yield Field("dof_damping", dofs, self.linear, adds=True)
        yield Field("dof_dampingpoly", (dofs, OF_SPEED), self.quadratic, adds=True)
