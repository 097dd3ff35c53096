"""What makes any number found from a log doubtful: samples that stick out, a motion of few steps of
its sensor, and a rate at which commands may be missing.
"""

from collections.abc import Sequence

import numpy as np

from smc_mujoco.common.aliases import Array, Data
from smc_mujoco.identification import records
from smc_mujoco.identification.log_rig import LogRig, moves
from smc_mujoco.identification.paths import DELAY
from smc_mujoco.identification.records import Record

SPIKE = 10.0  # times the noise or the sensor's step: a sample that sticks out by more; chosen
LARGE_SPIKE = 0.02  # of the motion's deviation; a smaller spike hardly moves a number; chosen
FEW_STEPS = 100.0  # of the sensor, or deviations of its noise: span of a small motion; chosen

LONG_PERIOD = 0.0051  # s: loops of machines are seldom slower; chosen
SAME_PERIOD = 0.02  # of a period, by which a loop's own may differ from the log's; chosen


def doubts(rig: LogRig, data: Sequence[Data]) -> list[str]:
    """Return sentences on what is doubtful in logs."""
    said = []
    for record in map(rig.checked, data):
        said += _slow(rig, records.step_of(record[rig.columns.time]))
        for name, unit in zip(rig.columns.x, rig.plant.units, strict=True):
            said += _spikes(record, name, rig.columns.time, unit)
            said += _small(record[name], name, unit)
    return list(dict.fromkeys(said))


def _slow(rig: LogRig, period: float) -> list[str]:
    """Return a sentence on a log that may lack commands of a faster loop."""
    loop_known = abs(period - rig.base.control_period) < SAME_PERIOD * period
    if period <= LONG_PERIOD or loop_known:
        return []
    late = ""
    if DELAY in rig.quantities:
        late = f", and {DELAY} may be {500.0 * period:.3g} ms off"
    return [
        f"the log has {1.0 / period:.4g} samples a second: if its loop is faster, the commands "
        f"between them are missing{late}; record every command of the loop. If the loop is not "
        f'faster, say so by --condition "loop: control_period={period:g}"'
    ]


def _spikes(record: Record, name: str, time: str, unit: str) -> list[str]:
    """Return a sentence on samples that stick out from both their neighbours, if there are any."""
    x = record[name]
    step = records.sensor_step(x)
    least = max(SPIKE * records.white_noise(x), SPIKE * step, LARGE_SPIKE * float(np.std(x)))
    out = _sticking_out(x) > least
    if not out.any():
        return []
    first = int(np.argmax(out))
    time_of_first = record[time][first + 2]
    return [
        f"{int(out.sum())} of {len(x)} samples of {name} stick out from both their neighbours by "
        f"more than {least:.2g} {unit}, the first at {time_of_first:.4g} s: interpolate over them"
    ]


def _sticking_out(x: Array) -> Array:
    """Return how far each of K samples but two at both ends sticks out, (K - 4,): beyond both its
    neighbours, and off the cubic through two samples on each side.

    The cubic follows a turn of a fast motion, which lies beyond its neighbours, too.
    """
    inner = x[2:-2]
    before = inner - x[1:-3]
    after = inner - x[3:-1]
    beyond = np.minimum(np.abs(before), np.abs(after))
    beyond[before * after <= 0.0] = 0.0
    cubic = (4.0 * (x[1:-3] + x[3:-1]) - x[:-4] - x[4:]) / 6.0
    return np.minimum(beyond, np.abs(inner - cubic))


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
