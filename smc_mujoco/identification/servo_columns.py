"""What is doubtful in the columns of a position servo's log: their sign and their unit.

The command is a set-point, so forces do not tell. But a joint follows its set-point when that moves
slowly: the slow parts of x and u agree, in sign and in size. Angles in degrees that are small agree
as well, and are not seen.
"""

import math
from collections.abc import Sequence

import numpy as np

from smc_mujoco.common.aliases import Array, Data
from smc_mujoco.identification import records
from smc_mujoco.identification.first_guess import LARGEST_ANGLE
from smc_mujoco.identification.log_rig import LogRig
from smc_mujoco.mechanisms.hardware.position_servo import PositionServo
from smc_mujoco.mechanisms.layout import dof_ids, driven_names

# Of the rate at which the joint swings on its servo by the model's inertia: a set-point that moves
# so slowly is followed, also where the armature is fifteen times that inertia; chosen
SLOW = 0.2
LEAST = 0.1  # of the deviation of u, that its slow part must have; chosen
AGREES = 0.8  # correlation of the slow parts, from which they agree, or have two signs; chosen
FOLLOWS = 0.3  # of the slow u, that the slow x must have: else friction holds the joint; chosen
DEGREES = 20.0, 150.0  # about 57.3, of one slow part over the other; chosen


def doubts(rig: LogRig, data: Sequence[Data]) -> list[str]:
    """Return sentences on the columns of joints with a servo."""
    inertias = rig.plant.load().dof_M0[dof_ids(rig.plant.load())]
    said = []
    for record in map(rig.checked, data):
        period = records.step_of(record[rig.columns.time])
        for i, motor in enumerate(rig.base.drive_train.motors):
            if isinstance(motor, PositionServo):
                names = rig.columns.x[i], rig.columns.inputs[i]
                x, u = record[names[0]], record[names[1]]
                rate = SLOW * math.sqrt(motor.kp / inertias[i])
                force = (
                    f"; if {names[1]} is the motor's force and no set-point, ask for "
                    f"{driven_names(rig.plant)[i]}(motor)"
                )
                for doubt in _of_servo(names, x, u, rate * period, rig.plant.units[i]):
                    said.append(doubt + force)
    return list(dict.fromkeys(said))


def _of_servo(names: tuple[str, str], x: Array, u: Array, rate: float, unit: str) -> list[str]:
    """Return sentences on the columns x and u of one servo, whose slow parts are below a rate, rad
    a sample.
    """
    of_x, of_u = names
    reach = float(max(np.abs(x).max(), np.abs(u).max()))
    if unit == "rad" and reach > LARGEST_ANGLE:
        columns = f"{of_x} and {of_u}"
        return [f"{columns} reach {reach:.3g} rad: if that is in degrees, divide both by 57.3"]
    slow_x, slow_u = _slow(x, rate), _slow(u, rate)
    moved_x, moved_u = float(np.std(slow_x)), float(np.std(slow_u))
    if not (moved_x and moved_u > LEAST * np.std(u)):
        return []
    agreement = np.corrcoef(slow_x, slow_u)[0, 1]
    if agreement < -AGREES and moved_x > FOLLOWS * moved_u:
        return [f"{of_x} moves against its set-point {of_u}: turn the sign of one of these columns"]
    far = max(moved_x / moved_u, moved_u / moved_x)
    if unit == "rad" and agreement > AGREES and DEGREES[0] < far < DEGREES[1]:
        more, less = (of_x, of_u) if moved_x > moved_u else (of_u, of_x)
        return [
            f"{more} moves {far:.3g} times as far as {less}, and a servo keeps them near each "
            f"other: if {more} is in degrees, divide it by 57.3"
        ]
    return []


def _slow(values: Array, rate: float) -> Array:
    """Return the part of a column below a rate, rad a sample, without its mean."""
    from scipy.signal import butter, sosfiltfilt

    poles = butter(2, min(rate / math.pi, 0.9), output="sos")
    return sosfiltfilt(poles, values - values.mean())
