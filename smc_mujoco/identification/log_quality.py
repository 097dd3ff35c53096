"""What in the columns of a log makes any number found from it doubtful: samples that stick out, and
a motion of few steps of its sensor.
"""

from collections.abc import Sequence

import numpy as np

from smc_mujoco.common.aliases import Array, Data
from smc_mujoco.identification import records
from smc_mujoco.identification.own_rig import OwnRig, moves
from smc_mujoco.identification.records import Record

SPIKE = 10.0  # times the noise or the sensor's step: a sample that sticks out by more; chosen
LARGE_SPIKE = 0.02  # of the motion's deviation; a smaller spike hardly moves a number; chosen
FEW_STEPS = 100.0  # of the sensor, or deviations of its noise: span of a small motion; chosen


def doubts(rig: OwnRig, data: Sequence[Data]) -> list[str]:
    """Return sentences on columns whose samples stick out, or that span few steps of a sensor."""
    said = []
    for record in map(rig.checked, data):
        for name, unit in zip(rig.columns.x, rig.plant.units, strict=True):
            said += _spikes(record, name, rig.columns.time, unit)
            said += _small(record[name], name, unit)
    return list(dict.fromkeys(said))


def _spikes(record: Record, name: str, time: str, unit: str) -> list[str]:
    """Return a sentence on samples that stick out from both their neighbours, if there are any."""
    x = record[name]
    step = records.sensor_step(x)
    least = max(SPIKE * records.white_noise(x), SPIKE * step, LARGE_SPIKE * float(np.std(x)))
    out = _sticking_out(x) > least
    if not out.any():
        return []
    first = int(np.argmax(out))
    at = record[time][first + 1]
    return [
        f"{int(out.sum())} of {len(x)} samples of {name} stick out from both their neighbours by "
        f"more than {least:.2g} {unit}, the first at {at:.4g} s: interpolate over them"
    ]


def _sticking_out(x: Array) -> Array:
    """Return how far each inner sample lies beyond both its neighbours, (K - 2,); 0 if it lies
    between them.
    """
    before = x[1:-1] - x[:-2]
    after = x[1:-1] - x[2:]
    least = np.minimum(np.abs(before), np.abs(after))
    return np.where(before * after > 0.0, least, 0.0)


def _small(x: Array, name: str, unit: str) -> list[str]:
    """Return a sentence on a joint that rests, or that moves by few steps of its sensor."""
    span = f"{name} spans {float(np.ptp(x)):.2g} {unit}"
    if not moves(x):
        return [f"{span}, no more than noise or some steps of its sensor: this joint rests"]
    finest = max(records.white_noise(x), records.sensor_step(x))
    times = float(np.ptp(x)) / finest if finest else np.inf
    if times > FEW_STEPS:
        return []
    return [
        f"{span}, only {times:.0f} times the noise or the step of its sensor: rounding then looks "
        "like friction and delay, so record a larger motion"
    ]
