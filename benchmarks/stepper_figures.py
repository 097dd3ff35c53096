"""Figures of the pendulum on a stepper: of its public recordings, and of many runs of its twin.

    figures(load("linear_hold.csv"))["alpha_rms"]    # degrees, of the machine
    figures(logged(trace))["alpha_rms"]              # of a twin's run
    predicted(smc.rig("stepper_furuta"), "hold", 4)  # set -> law -> figures of each seed

A bursty machine never repeats a record, so its twin is a distribution of figures over seeds and
parameter sets. The figures of the linear law were fitted on; all of the sliding modes are
predicted, and their recordings were not opened. Of these only the order of the three laws on the
machine is known here. A row of a recording is every fourth tick, 20 ms. Times, angles and steps are
the firmware's: ms, degrees, steps.
"""

import csv
import math
from collections import namedtuple
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numba import njit

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.evidence.rigs import firmware
from smc_mujoco.simulation.prepare import pause_phase
from smc_mujoco.simulation.signals import after_pauses
from smc_mujoco.simulation.time_series import TimeSeries

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
ORDER = "linear", "two_states", "four_states"  # on the machine, the least rms of alpha first
FITTED_ON = "linear"
SHOWN = {"alpha_rms": "deg", "acceleration_rms": "steps/s^2", "running": "", "centroid": "Hz"}
STIFF = {"holding_torque": 20.0, "arm_damping": 0.5}  # a spring of 150 Hz
PLAIN = STIFF | dict.fromkeys(
    (
        "steps",
        "arm_friction",
        "pivot_friction",
        "pivot_damping",
        "upright_error",
        "sensor_noise",
        "vibration",
        "counts",
        "sensor_delay",
        "sensor_skew",
        "pause",
    ),
    0.0,
)
LEFT_OUT = {  # part of the twin -> the quantities without it
    "queue": {"queue": 0.0, "refill": 0.0},
    "stop band": {"stop_band": 0.0},
    "motor spring": STIFF,
    "pivot friction": {"pivot_friction": 0.0, "pivot_damping": 0.0},
    "all of these, noise and vibration": PLAIN,
}
RECORDED = {  # condition -> the machine's figures under the linear law
    "hold": {
        "alpha_rms": 0.439,
        "alpha_max": 3.82,
        "theta_std": 2.28,
        "theta_max": 10.8,
        "alpha_rate_rms": 16.3,
        "theta_rate_rms": 9.3,
        "acceleration_rms": 1066.0,
        "speed_rms": 33.0,
        "running": 0.064,
        "resting": 0.80,
        "resting_50": 0.21,
        "resting_90": 0.47,
        "second_25": 0.018,
        "second_50": 0.064,
        "second_75": 0.40,
        "second_90": 0.78,
        "centroid": 4.73,
        "ratio": 1.85,
        "phase": -174.5,
        "gain": 1.15,
        "lag": -81.0,
    },
    "nudges": {
        "alpha_rms": 0.844,
        "alpha_max": 3.65,
        "theta_std": 12.57,
        "theta_max": 29.6,
        "alpha_rate_rms": 31.1,
        "theta_rate_rms": 18.0,
        "acceleration_rms": 2005.0,
        "speed_rms": 57.3,
        "running": 0.260,
        "centroid": 4.69,
        "second_25": 0.47,
        "second_50": 0.75,
        "second_75": 1.03,
        "second_90": 1.27,
        "ratio": 1.82,
        "phase": -173.4,
        "gain": 1.21,
        "lag": -81.0,
    },
}


def start(seed):
    """Return where the pendulum is let go as the firmware engages, rad: 0.5 to 1 degrees from
    upright.
    """
    random = np.random.default_rng(seed)
    return 0.0, math.radians(random.uniform(0.5, 1.0)) * random.choice((-1, 1))


def steps_of(*targets):
    """Return a reference that steps to targets, (s, degrees)."""
    times = [0.0]
    values = [0.0]
    before = 0.0
    for time, target in targets:
        times += [time, time + 1e-3]
        values += [before, math.radians(target)]
        before = math.radians(target)
    return TimeSeries(times, values)


CONDITIONS = {  # name -> fields of a scenario
    "hold": {"duration": 70.0},
    "nudges": {
        "duration": 50.3,
        "reference": steps_of((15.0, 20.0), (24.34, -20.0), (36.73, 0.0)),
    },
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
    memory = np.zeros(14)
    rows = np.zeros((len(t), 4))
    for i in range(len(t)):
        _firmware(Seen(t[i], theta[i], alpha[i], target[i]), gains, memory)
        rows[i, 0], rows[i, 1] = (
            memory[firmware.ALPHA] - memory[firmware.TRIM],
            memory[firmware.ALPHA_RATE],
        )
        rows[i, 2], rows[i, 3] = memory[firmware.THETA], memory[firmware.THETA_RATE]
    return rows


def logged(trace: smc.Trace) -> dict[str, np.ndarray]:
    """Return a run as the firmware would have logged it, without the sensors' noise."""
    s = trace.scenario.resolved
    pause, samples = s.clock.pauses(s.control_period, s.physics_step)
    phase = pause_phase(s)
    late = []
    for k in range(s.samples):
        late.append(after_pauses(k, s.steps, pause, samples, phase) if pause else 0)
    ran = np.flatnonzero(np.array(late) >= 0)
    t = s.control_period * ran + s.physics_step * np.array(late)[ran]
    sensor = s.encoder(0) or smc.Encoder(counts=math.inf)
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
    counted = t - t[0] >= SINCE
    alpha, alpha_rate, theta, theta_rate, acceleration, speed = (
        record[name][counted] for name in COLUMNS[1:7]
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
    peak = int(np.flatnonzero(inside)[np.argmax(power[inside])])

    def response(output: np.ndarray, driver: np.ndarray) -> complex:
        cross = signal.csd(driver, output, **settings)[1]
        own = signal.welch(driver, **settings)[1]
        if own[peak] > 0.0:
            return complex(cross[peak] / own[peak])
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
        if power[peak] > 0.0
        else np.nan,
        "peak": float(f[peak]),
        "ratio": abs(tilt),
        "phase": float(np.degrees(np.angle(tilt)) % 360.0 - 360.0),
        "gain": abs(follow),
        "lag": float(np.degrees(np.angle(follow))),
    }


def fallen(found):
    """Return whether a run with these figures fell."""
    return not found["alpha_max"] < 30.0


def standing(runs: Sequence[Mapping[str, float]], figure: str) -> np.ndarray:
    """Return a figure of the runs that stood; an arm that rests has no phase, which is left out."""
    values = np.array([run_figures[figure] for run_figures in runs if not fallen(run_figures)])
    return values[np.isfinite(values)]


def percentiles(values: np.ndarray) -> list[float]:
    """Return the median, and the 5th and the 95th percentile."""
    return np.percentile(values, (50.0, 5.0, 95.0)).tolist()


def predicted(rig, condition, seeds, changes=None):
    """Return set -> law -> the figures of its run from each seed, in a condition.

    `changes`: quantities that leave a part of the twin out.
    """
    laws = [law for law in rig.laws if law.name in ORDER]
    runs_by_law = {}
    for name, member in rig.members().items():
        twin = member.with_values(changes or {}, "left out")
        scenarios = []
        for law in laws:
            for seed in range(seeds):
                fields = {"x0": start(seed), "seed": seed} | CONDITIONS[condition]
                scenarios.append(twin.scenario(law, **fields))
        of_runs = [figures(logged(trace)) for trace in smc.run(scenarios)]
        runs_by_law[name] = {
            law.name: of_runs[i * seeds : (i + 1) * seeds] for i, law in enumerate(laws)
        }
    return runs_by_law


def ordered(found):
    """Return in how many sets the median rms of alpha orders the laws as the machine does, and
    Kendall's tau, the mean over sets. A fall is the worst.
    """
    count = 0
    taus = []
    for by_law in found.values():
        medians = []
        for law in ORDER:
            ranks = [math.inf if fallen(run) else run["alpha_rms"] for run in by_law[law]]
            medians.append(float(np.median(ranks)))
        first, second, third = medians
        signs = []
        for low, high in ((first, second), (first, third), (second, third)):
            signs.append(float(low < high) - float(low > high))
        count += first < second < third
        taus.append(np.mean(signs))
    return count, float(np.mean(taus))
