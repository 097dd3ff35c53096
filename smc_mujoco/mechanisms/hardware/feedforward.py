"""Friction compensation beside any law: the force that friction is expected to need, added to u."""

import math
from collections.abc import Mapping, Sequence
from typing import Annotated

from smc_mujoco.common.constraints import Number, OneOf, constrain
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.hardware.part import Friction, Positive
from smc_mujoco.mechanisms.plant import Plant

ON = "speed", "reference", "error"  # in the order of their codes
AT_REST = 1e-12  # rad/s (m/s): the speed at which F is what a joint at rest needs
Compensated = Friction | Sequence[Friction] | Mapping[str, Friction | Sequence[Friction]]


@frozen_data
class Feedforward:
    """Compensation of friction, added to a law's u before its bound.

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
      ScenarioError: a number out of its range, or a friction without a force at a steady speed.
    """

    friction: Compensated
    on: Annotated[str, OneOf(names=ON)] = "reference"
    eps: Positive = 0.005
    error: Annotated[float, Number(low=-1.0, high=math.inf)] = 0.0

    def __post_init__(self) -> None:
        constrain(self)

    def check(self, plant: Plant) -> None:
        """Raise ScenarioError if it does not suit the plant."""
        parts: tuple[Friction, ...] = self.friction  # pyright: ignore[reportAssignmentType] a scenario has converted it
        if not parts:
            raise ScenarioError("Feedforward has no friction: give one, such as smc.Coulomb(0.05)")
        for part in parts:
            part.check(plant)
            if part.steady is None:
                raise ScenarioError(
                    f"Feedforward cannot compensate {type(part).__name__}, whose force at a steady "
                    "speed is not known: give Coulomb, Viscous, LuGre or ServoFriction with its "
                    "numbers"
                )
