"""What no log has at the start of a piece: what servos have integrated by then, and where rotors
are beside their joints. These are free numbers of each piece, as velocities are.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.identification import records
from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.beside_joint import BesideJoint
from smc_mujoco.mechanisms.hardware.elastic_joint import ElasticJoint
from smc_mujoco.mechanisms.hardware.part import Actuator
from smc_mujoco.mechanisms.hardware.position_servo import PositionServo
from smc_mujoco.mechanisms.layout import driven_names
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.scenario import Scenario

PLAYS = 5.0  # of a play: scale of where its rotor starts; chosen


class HiddenStart(NamedTuple):
    """A number that a part has at the start of a piece."""

    channel: int
    part: Actuator
    motor: Actuator  # of the channel
    field: str  # of the part

    def guesses(self, u: Array, x: Array, period: float) -> Array:
        """Return about its value at each sample of the command and the position of its channel,
        (K,).
        """
        if isinstance(self.part, PositionServo):
            return self.part.integrals(u, x, period)
        if self.field == "lead_rate":
            return np.zeros(len(u))
        force = self.motor.force_of(u, x, records.rate(x, period))
        if isinstance(self.part, Backlash):
            return 0.5 * self.part.gap * np.sign(force)
        assert isinstance(self.part, ElasticJoint)
        return force / self.part.stiffness

    def spread(self, u: Array, x: Array, period: float) -> float:
        """Return how far it varies in a log."""
        if isinstance(self.part, PositionServo):  # by its force
            return self.part.kp / self.part.ki * (float(x.std()) or 1.0)
        if self.field == "lead_rate":
            return float(records.rate(x, period).std()) or 1.0
        if isinstance(self.part, Backlash):
            return PLAYS * self.part.gap or 1.0
        return float(self.guesses(u, x, period).std()) or 1.0


def hidden_starts(scenario: Scenario) -> list[HiddenStart]:
    """Return the hidden numbers of a scenario's actuators, by channel."""
    train = scenario.drive_train
    starts = []
    for i, (chain, motor) in enumerate(zip(train.chains, train.motors, strict=True)):
        for part in chain:
            fields = []
            if isinstance(part, PositionServo) and part.ki:
                fields = ["integral"]
            elif isinstance(part, BesideJoint):
                fields = ["lead", "lead_rate"]
            starts += [HiddenStart(i, part, motor, field) for field in fields]
    return starts


def begun(
    actuators: Sequence[Actuator], plant: Plant, starts: Sequence[HiddenStart], values: Array
) -> tuple[Actuator, ...]:
    """Return actuators that begin with the values of hidden starts, (starts,)."""
    joints = driven_names(plant)
    by_joint: dict[tuple[str, str], float] = {}
    for start, value in zip(starts, values.tolist(), strict=True):
        by_joint[joints[start.channel], start.field] = value
    parts = []
    for part in actuators:
        fields = {start.field for start in starts if type(start.part) is type(part)}
        if not fields:
            parts.append(part)
            continue
        for joint in part.joint_names(plant):
            begin = {}
            for field in fields:
                if (joint, field) in by_joint:
                    bound = _bound(part, field)
                    begin[field] = min(max(by_joint[joint, field], -bound), bound)
            parts.append(dataclasses.replace(part, on=(joint,), **begin))
    return tuple(parts)


def _bound(part: Actuator, field: str) -> float:
    """Return how large a hidden number of a part may be."""
    if isinstance(part, PositionServo):
        return part.imax or math.inf
    if isinstance(part, Backlash) and field == "lead":
        return 0.5 * part.gap
    return math.inf
