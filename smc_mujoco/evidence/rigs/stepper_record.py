"""Records of the pendulum on a stepper as its firmware logs them, from files or from runs, and the
figures of a record.

    record = load("linear_hold.csv")          # of the machine; column -> values
    figures(record)["alpha_rms"]              # degrees
    figures(logged(trace))["alpha_rms"]       # of a twin's run

A row is every fourth tick, 20 ms. Times, angles and steps are the firmware's: ms, degrees, steps.
"""

import csv
from collections import namedtuple
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numba import njit

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.evidence.rigs import firmware
from smc_mujoco.simulation.prepare import IDEAL_SENSOR, pause_phase
from smc_mujoco.simulation.signals import after_pauses
from smc_mujoco.simulation.trace import Trace

COLUMNS = (
    "timestamp_ms",
    "alpha_deg",
    "alpha_dot_deg_s",
    "theta_deg",
    "theta_dot_deg_s",
    "acc_cmd_steps_s2",
    "vel_cmd_steps_s",
    "pos_meas_steps",
    "position_clamped",
)
ROW_TICKS = 4
SINCE = 3.0  # s, from which the figures count
STOP_BAND = 50.0  # steps/s
REST = 0.2  # s, of the shortest rest
SEGMENT = 256  # samples of Welch's method, Hann, half overlap: as the machine's figures were made
BAND = 2.0, 9.0  # Hz, of centroid and peak
MIN_ROWS = 1000
UNITS = {  # of the figures
    **dict.fromkeys(
        ("alpha_rms", "alpha_max", "theta_rms", "theta_std", "theta_max", "phase", "lag"), "deg"
    ),
    **dict.fromkeys(
        ("second_25", "second_50", "second_75", "second_90", "resting_50", "resting_90"), "deg"
    ),
    **dict.fromkeys(("alpha_rate_rms", "theta_rate_rms"), "deg/s"),
    **dict.fromkeys(("acceleration_rms", "acceleration_max"), "steps/s^2"),
    **dict.fromkeys(("centroid", "peak"), "Hz"),
    **dict.fromkeys(("running", "resting", "ratio", "gain"), ""),
    "speed_rms": "steps/s",
    "starts": "1/min",
}

Seen = namedtuple("Seen", "t x q r")
Gains = namedtuple("Gains", "kind top speed")
_firmware = njit(firmware.firmware.function)


def load(path: str | Path) -> dict[str, np.ndarray]:
    """Return the columns of a recording's CSV file.

    Raises:
      ScenarioError: a missing column, or a value that is no number.
    """
    with Path(path).open(newline="") as file:
        rows = list(csv.DictReader(file))
    if missing := [name for name in COLUMNS if not rows or name not in rows[0]]:
        raise ScenarioError(
            f"{path} lacks the column {missing[0]}: give a CSV file with {', '.join(COLUMNS)}"
        )
    try:
        return {name: np.array([float(row[name]) for row in rows]) for name in COLUMNS}
    except (TypeError, ValueError) as error:
        raise ScenarioError(
            f"{path} has a value that is no number ({error}): give numbers"
        ) from error


@njit
def _replayed(t, theta, alpha, target, gains):
    """Return what the firmware shows at each tick of measured angles, rad: alpha, its rate, theta,
    its rate; deg.
    """
    memory = np.zeros(15)
    rows = np.zeros((len(t), 4))
    for i in range(len(t)):
        _firmware(Seen(t[i], theta[i], alpha[i], target[i]), gains, memory)
        rows[i, 0], rows[i, 1] = (
            memory[firmware.ALPHA] - memory[firmware.TRIM],
            memory[firmware.ALPHA_RATE],
        )
        rows[i, 2], rows[i, 3] = memory[firmware.THETA], memory[firmware.THETA_RATE]
    return rows


def logged(trace: Trace) -> dict[str, np.ndarray]:
    """Return a run as the firmware would have logged it, without the sensors' noise."""
    s = trace.scenario.resolved
    pause, samples = s.clock.pauses(s.control_period, s.physics_step)
    phase = pause_phase(s)
    late = []
    for k in range(s.samples):
        late.append(after_pauses(k, s.steps, pause, samples, phase) if pause else 0)
    ran = np.flatnonzero(np.array(late) >= 0)
    t = s.control_period * ran + s.physics_step * np.array(late)[ran]
    sensor = s.sensor or IDEAL_SENSOR
    places = []
    for i in range(2):
        x = np.interp(t - sensor.delay - i * sensor.skew, trace.t, trace.x[:, i]) + sensor.bias
        count = sensor.quantum(True)
        places.append(count * np.round(x / count) if count else x)
    rows = _replayed(t, places[0], places[1], trace.r[ran, 0], Gains(**s.law.gains))
    steps = firmware.STEPS * firmware.DEGREES
    rate = steps * trace.u[ran, 0]  # of the speed
    speed = np.cumsum(rate * np.diff(t, prepend=t[0]))
    if s.law.gains["kind"] == firmware.LINEAR:
        leak = firmware.LEAK
    else:
        leak = 0.0
    acceleration = rate + leak * np.append(0.0, speed[:-1])
    columns = (1e3 * t, *rows.T, acceleration, speed, firmware.STEPS * rows[:, 2], np.zeros(len(t)))
    return {name: values[::ROW_TICKS] for name, values in zip(COLUMNS, columns, strict=True)}


def figures(record: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Return the figures of a recording from SINCE on, in degrees, steps and seconds.

    Its keys: rms and largest values; `second_50`, alpha's standard deviation in a second that half
    of them exceed; `running`, the share of rows with a speed above the stop band; `starts`, from
    rest a minute; `resting`, the share of time in rests of REST and more, and `resting_50`, what
    half of |alpha| exceeds there; of Welch's spectra `centroid` and `peak` of alpha in Hz, `ratio`
    and `phase` of alpha over theta there, `gain` and `lag` of theta' over the speed command.
    """
    from scipy import signal

    t = record["timestamp_ms"] / 1e3
    if len(t) < MIN_ROWS:
        raise ScenarioError(f"the record has {len(t)} rows: give at least {MIN_ROWS}, 20 s")
    kept = t - t[0] >= SINCE
    alpha, alpha_rate, theta, theta_rate, acceleration, speed = (
        record[name][kept] for name in COLUMNS[1:7]
    )

    def rms(values: np.ndarray) -> float:
        return float(np.sqrt(np.mean(values**2)))

    runs = np.abs(speed) >= STOP_BAND
    row = float(np.median(np.diff(t)))
    starts = np.sum(np.diff(runs.astype(int)) == 1)
    edges = np.flatnonzero(np.diff(np.concatenate(([True], runs, [True])).astype(int))).reshape(
        -1, 2
    )
    long = edges[np.diff(edges)[:, 0] * row >= REST]
    rests = np.concatenate([np.abs(alpha[first:last]) for first, last in long] or [np.zeros(0)])
    second = round(1.0 / row)
    seconds = alpha[: len(alpha) // second * second].reshape(-1, second).std(axis=1)
    settings = {"fs": 1.0 / row, "window": "hann", "nperseg": SEGMENT, "noverlap": SEGMENT // 2}
    f, power = signal.welch(alpha, **settings)
    inside = (f >= BAND[0]) & (f <= BAND[1])
    at = int(np.flatnonzero(inside)[np.argmax(power[inside])])

    def response(output: np.ndarray, driver: np.ndarray) -> complex:
        cross = signal.csd(driver, output, **settings)[1]
        own = signal.welch(driver, **settings)[1]
        if own[at] > 0.0:
            return complex(cross[at] / own[at])
        return complex(np.nan)

    tilt = response(alpha, theta)
    follow = response(theta_rate, speed / firmware.STEPS)
    return {
        "alpha_rms": rms(alpha),
        "alpha_max": float(np.abs(alpha).max()),
        "theta_rms": rms(theta),
        "theta_std": float(theta.std()),
        "theta_max": float(np.abs(theta).max()),
        "alpha_rate_rms": rms(alpha_rate),
        "theta_rate_rms": rms(theta_rate),
        "acceleration_rms": rms(acceleration),
        "acceleration_max": float(np.abs(acceleration).max()),
        "speed_rms": rms(speed),
        "running": float(runs.mean()),
        "starts": float(60.0 * starts / (len(runs) * row)),
        "resting": len(rests) / len(runs),
        **{
            f"resting_{p}": float(np.percentile(rests, p)) if len(rests) else np.nan
            for p in (50, 90)
        },
        **{f"second_{p}": float(np.percentile(seconds, p)) for p in (25, 50, 75, 90)},
        "centroid": float(np.average(f[inside], weights=power[inside]))
        if power[at] > 0.0
        else np.nan,
        "peak": float(f[at]),
        "ratio": abs(tilt),
        "phase": float(np.degrees(np.angle(tilt)) % 360.0 - 360.0),
        "gain": abs(follow),
        "lag": float(np.degrees(np.angle(follow))),
    }
