"""Compensation beside any law: the force that friction is expected to need, added to u, and the way
through a play, added to the reference.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar

import numpy as np

from smc_mujoco.common.constraints import Number, OneOf, constrain
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.part import Friction, Part, Positive
from smc_mujoco.mechanisms.layout import driven_names

ON = "speed", "reference", "error"  # in the order of their codes
AT_REST = 1e-12  # rad/s (m/s): the speed at which F is what a joint at rest needs
Compensable = Friction | Backlash
Several = Compensable | Sequence[Compensable]
Compensated = Several | Mapping[str, Several]


@frozen_data
class Feedforward:
    """Compensation of friction, added to a law's u before its bound, and of play.

        friction = smc.Coulomb(0.2), smc.Viscous(0.1)
        compensated = smc.Feedforward(friction)
        smc.Scenario(plant="duffing", law="pid", friction=friction, feedforward=compensated)

    At each sample it is (1 + error) F(v) tanh(|v| / eps), with F the force that a joint needs to
    move against the friction at a steady speed v. Of a drive it takes the u that gives this force
    at rest. What it added is `compensation` of the trace. Observers of a law do not see it.
    `smc.exchange.law_to_c` and `law_to_fmu` write it with the law of a scenario, as if its error
    were 0: no controller knows how far its compensation is off.

    On the "error" it is (1 + error) F(0+) tanh(|e| / eps) towards the reference: what a joint at
    rest needs to break away.

    A `Backlash` among them is compensated by its inverse: (1 + error) gap/2 tanh(r' / eps), the way
    by which the motor has to lead the joint. Of a law that reads an encoder on the motor it moves
    the reference that the law sees; r of the trace stays. Of a servo whose law reads the joint it
    is added to u, the set-point. Its other numbers do not count. Under a load that holds the play
    closed on one side the joint does not cross it, and the inverse does harm.

        smc.Feedforward(smc.Backlash(0.02))

    Source: G. Tao and P. V. Kokotovic, Adaptive control of systems with backlash, Automatica 29(2),
    1993, with a step that is smooth.

    Attributes:
      friction: what is compensated, as a scenario's `friction`: one part, several, or by joint. It
        may differ from the true one.
      on: which v: that of the "reference", or the "speed" that the law measures or estimates; or
        the "error", whose sign is the direction.
      eps: rad/s (m/s), or rad (m) on the error; greater than 0: the speed, or the error, above
        which all of F is given, nearly.
      error: the share by which it is wrong: -0.3 gives 70 % of the force. `grid`, `tune` and
        `compare` draw it for each seed, evenly between -error and error.

    Raises:
      ScenarioError: a number out of its range; a friction without a force at a steady speed, or
        with a loss that is all of what it carries, or grows with a load that no set-point has; a
        play of a joint that the law measures itself and drives by a force, or on another than the
        reference.
    """

    friction: Compensated
    on: Annotated[str, OneOf(names=ON)] = "reference"
    eps: Positive = 0.005
    error: Annotated[float, Number(low=-1.0, high=math.inf)] = 0.0

    def __post_init__(self) -> None:
        constrain(self)

    @property
    def frictions(self) -> tuple[Friction, ...]:
        """The frictions, as a scenario has converted them."""
        return tuple(part for part in self._parts if isinstance(part, Friction))

    @property
    def plays(self) -> tuple[Backlash, ...]:
        """The plays, as a scenario has converted them."""
        return tuple(part for part in self._parts if isinstance(part, Backlash))

    @property
    def _parts(self) -> tuple[Compensable, ...]:
        return self.friction  # pyright: ignore[reportReturnType] a scenario has converted it

    def leads(self, s: Any) -> list[float]:
        """Return by how much the motor of each driven channel of a scenario leads its reference:
        half its play, rad (m).
        """
        leads = [0.0] * s.plant.driven
        for play in self.plays:
            for i in play.channels(s.plant):
                leads[i] = 0.5 * play.gap
        return leads

    def moves_reference(self, s: Any, i: int) -> bool:
        """Return whether the lead of channel i is of the reference, and not of the set-point."""
        encoder = s.encoder(i)
        return encoder is not None and encoder.side == "motor"

    def check(self, s: Any) -> None:
        """Raise ScenarioError if it does not suit a scenario."""
        if not self._parts:
            raise ScenarioError("Feedforward has no friction: give one, such as smc.Coulomb(0.05)")
        self._check_plays(s)
        for part in self.frictions:
            part.check(s.plant)
            self._check_loss(s, part)
            if part.steady is None:
                raise ScenarioError(
                    f"Feedforward cannot compensate {type(part).__name__}, whose force at a steady "
                    "speed is not known: give Coulomb, Viscous, LuGre or ServoFriction with its "
                    "numbers"
                )

    def _check_loss(self, s: Any, part: Friction) -> None:
        """Raise ScenarioError for a loss that no u overcomes, or of a load that is not known."""
        loss = part.loss_of_load
        if not np.any(loss):
            return
        if np.max(loss) >= 1.0:
            raise ScenarioError(
                f"Feedforward has {part!r}, which loses as much as it carries: give a km below 1"
            )
        for i in part.channels(s.plant):
            if s.efforts[i] == s.plant.units[i]:
                raise ScenarioError(
                    f"Feedforward has {part!r}, whose loss grows with the load, and u of "
                    f"{driven_names(s.plant)[i]!r} is a set-point, which does not tell the load: "
                    "leave km out"
                )

    def _check_plays(self, s: Any) -> None:
        """Raise ScenarioError for a play that nothing leads."""
        if self.plays and self.on != "reference":
            raise ScenarioError(
                f"Feedforward has a Backlash and on={self.on!r}: leave on out, as the inverse of a "
                "play is of the reference"
            )
        for play in self.plays:
            for i in play.channels(s.plant):
                sets = s.efforts[i] == s.plant.units[i]
                if not (sets or self.moves_reference(s, i)):
                    raise ScenarioError(
                        f"Feedforward has {play!r}, and the law measures joint "
                        f"{driven_names(s.plant)[i]!r} itself, behind the play: give "
                        "sensor=smc.Encoder(side='motor') if yours is on the motor, or leave the "
                        "Backlash out"
                    )


@frozen_data
class Ahead(Part):
    """What leads a set-point through a play, as a part of the compensation."""

    names = ("force",)
    units: ClassVar[Mapping[str, str]] = {"force": "{f}"}

    @staticmethod
    def steady(y, p, memory):
        return math.copysign(p.force, y.v)
