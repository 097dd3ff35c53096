"""Stribeck friction: more at rest than in motion, with an offset, which holds a joint at rest."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import numpy as np

from smc_mujoco.common.constraints import Each, Number
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.hardware.friction import Coulomb
from smc_mujoco.mechanisms.hardware.joint_force import PerJoint
from smc_mujoco.mechanisms.hardware.part import Friction
from smc_mujoco.mechanisms.hardware.sliding import NaturalPerJoint, PositivePerJoint, Sliding
from smc_mujoco.mechanisms.plant import MAX_PARAMETER


@dataclasses.dataclass(frozen=True)
class Stribeck(Sliding):
    """Friction that falls with speed from its level at rest, with viscous friction and an offset.

        F(v) = (L + (static - coulomb) exp(-(v/stribeck)^2)) step(v) + viscous v + offset
        L = coulomb + km |motor - load|

        smc.hardware.Stribeck(coulomb=0.2, static=0.3, stribeck=0.1, viscous=0.05, offset=-0.02)

    step(v) is sgn(v), or tanh(v/width). At rest friction holds what lies between offset - S and
    offset + S, with S = static + km |motor - load|. So the offset is what the two directions differ
    by: levels of 0.3 forward and 0.26 backward are coulomb = 0.28 and offset = 0.02.

    It has no bristles and no state of its own, unlike `LuGre`. With `km` it grows with what the
    gearbox carries: the torque of the motor and that from outside, as `ServoFriction` has them. A
    `Feedforward` takes the law's own u for what the motor carries at a steady speed, and solves for
    the u that gives it beside its own loss.

    Source: B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, A survey of models, analysis
    tools and compensation methods for the control of machines with friction, Automatica 30(7),
    1994, eq. (4) with the exponent 2. The offset and the smooth step are those of fits to pairs of
    speed and torque, see `smc.identify_friction`.

    Attributes:
      coulomb: dry friction when sliding fast, N m (N), 0 or more.
      static: dry friction at rest, N m (N), coulomb or more. None: coulomb.
      stribeck: the speed at which 1/e of static - coulomb is left, rad/s (m/s), greater than 0. It
        is needed with static.
      viscous: N m s/rad (N s/m), 0 or more.
      offset: a constant part of the force, N m (N).
      km: dry friction for each N m (N) that the gearbox carries, 0 or more: its loss, twice over
        where the motor holds a load, as both torques count.
      width: the speed within which the step is smooth, rad/s (m/s), 0 or more. 0: a step. Such a
        joint is held by static at rest, too.

    Raises:
      ScenarioError: a number out of its range, static below coulomb, or static without stribeck.
    """

    forces = "coulomb", "static", "viscous", "offset", "km"
    ordered = "coulomb", "static"
    units: ClassVar[Mapping[str, str]] = {
        "coulomb": "{f}",
        "static": "{f}",
        "stribeck": "{x}/s",
        "viscous": "{f} s/{x}",
        "offset": "{f}",
        "width": "{x}/s",
    }

    coulomb: NaturalPerJoint
    static: NaturalPerJoint | None = None
    stribeck: PositivePerJoint | None = None
    viscous: NaturalPerJoint = 0.0
    offset: Annotated[PerJoint, Each(item=Number(low=-MAX_PARAMETER, high=MAX_PARAMETER))] = 0.0
    width: NaturalPerJoint = 0.0
    km: NaturalPerJoint = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.static is None:
            return
        if self.stribeck is None:
            raise ScenarioError(
                f"Stribeck has static {self.static} and no stribeck: give the speed at which "
                "friction falls, rad/s (m/s)"
            )
        if np.any(np.less(self.static, self.coulomb)):
            raise ScenarioError(
                f"Stribeck's static {self.static} is less than its coulomb {self.coulomb}: give "
                "static >= coulomb"
            )

    @staticmethod
    def value(v, motor, load, p):
        carried = p.km * abs(motor - load)
        level = p.coulomb + carried
        static = level
        if not math.isnan(p.static):
            static = p.static + carried
            level += (p.static - p.coulomb) * math.exp(-((v / p.stribeck) ** 2))
        step = math.tanh(v / p.width) if p.width > 0.0 else math.copysign(1.0, v)
        return level * step + p.viscous * v + p.offset, p.offset - static, p.offset + static

    @property
    def loss_of_load(self) -> Any:
        return self.km

    @staticmethod
    def steady(y, p, memory):  # pyright: ignore[reportIncompatibleMethodOverride] a property of the base
        """Return what a motor that carries y.u needs besides: F, of which a share km is its own."""
        v = y.v
        level = p.coulomb
        if not math.isnan(p.static):
            level += (p.static - p.coulomb) * math.exp(-((v / p.stribeck) ** 2))
        carried = math.copysign(1.0, v) * (2.0 * y.u + p.viscous * v + p.offset)
        lost = (level + p.km * carried) / (1.0 - p.km)
        if carried < -lost:  # the load drives
            lost = (level - p.km * carried) / (1.0 + p.km)
        step = math.tanh(v / p.width) if p.width > 0.0 else math.copysign(1.0, v)
        return lost * step + p.viscous * v + p.offset


def loaded(part: Friction) -> Friction:
    """Return a friction, of a Coulomb with `km` the Stribeck that it is."""
    if isinstance(part, Coulomb) and part.km:
        return Stribeck(part.level, km=part.km, on=part.on, side=part.side)
    return part
