"""What EMPS and the QUBE-Servo 3 were made to do in public records: a program, a step, free falls.

tracking(smc.rig("emps"))            # rms and largest error, m; recorded 0.5814 and 0.8522 mm
falls(smc.rig("qube_servo_3"))       # Hz, and damping ratio; recorded 2.432 and 0.0261
"""

import itertools
import math
from typing import Any

import numpy as np

import smc_mujoco as smc
from smc_mujoco.evidence.rigs.machines.emps import PERIOD
from smc_mujoco.identification.rig import Rig
from smc_mujoco.simulation.time_series import TimeSeries

SAMPLES, LAP = 24_841, 6_240  # of the record, and of the program's period
LENGTHS = (  # ms, of alternately constant and zero acceleration
    35,
    351,
    50,
    1,
    98,
    687,
    98,
    1,
    148,
    1035,
    148,
    1,
    50,
    351,
    101,
    351,
    50,
    1,
    98,
    687,
    98,
    1,
    148,
    1035,
    148,
    1,
    50,
    351,
    66,
)
ACCELERATIONS = (  # m/s^2
    0.819696,
    -0.826876,
    0.834499,
    -0.834589,
    0.837223,
    -0.83719,
    0.827038,
    -0.834201,
    0.827215,
    -0.834609,
    0.834591,
    -0.837223,
    0.837141,
    -0.826781,
    0.827378,
)
START = 1.078221e-4, 0.01343255  # m, m/s
FALLS = 25.0, 19.0, 13.0  # degrees, of falls that cover the machine's swings of 8 to 25


def program() -> TimeSeries:
    """Return the reference of the public record: four laps, the last cut short.

    Its samples are the controller's.
    """
    parts = []
    for i, n in enumerate(LENGTHS):
        parts.append(np.full(n, ACCELERATIONS[i // 2] if i % 2 == 0 else 0.0))
    a = np.concatenate(parts)
    v = START[1] + PERIOD * np.concatenate([[0.0], np.cumsum(a)])[:-1]
    x = START[0] + np.concatenate([[0.0], np.cumsum(PERIOD * v + 0.5 * PERIOD**2 * a)])[:-1]
    laps = math.ceil(SAMPLES / LAP)
    return TimeSeries((PERIOD * np.arange(SAMPLES)).tolist(), np.tile(x, laps)[:SAMPLES].tolist())


def tracking(rig: Rig, reference: TimeSeries | None = None, **changes: Any) -> tuple[float, float]:
    """Return the rms and the largest tracking error of the program, m; `reference`: the
    controller's instead.
    """
    motion = program()
    fields = {
        "reference": reference or motion,
        "duration": motion.times[-1],
        "x0": START[0],
        "v0": START[1],
    }
    error = np.array(motion.values) - smc.run(rig.scenario(**fields | changes)).x[:, 0]
    return float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())


def moved(
    twin: Rig, volts: float | None, angle: float, duration: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, the arm's angle and the pendulum's from hanging, of a QUBE-Servo that starts at
    rest.

    `volts`: None for an open circuit, in which only the rotor's inertia is left of the motor.
    """
    fields = {"x0": (0.0, math.pi + angle), "v0": 0.0, "duration": duration}
    if volts is None:
        inertia = twin.values["arm_inertia"] + twin.values["rotor_inertia"]
        free = twin.with_values({"arm_inertia": inertia}).scenario("none", actuator=None, **fields)
    else:
        free = twin.scenario("none", feedforward=smc.Constant(volts), **fields)
    trace = smc.run(free)
    return trace.t, trace.x[:, 0], trace.x[:, 1] - math.pi


def falls(twin: Rig) -> tuple[float, float]:
    """Return frequency, Hz, and damping ratio of the pendulum, means of the first periods of FALLS,
    circuit open.
    """
    swings = []
    for angle in map(math.radians, FALLS):
        t, _, a = moved(twin, None, angle, 1.2)
        i = np.flatnonzero(a[:-1] * a[1:] < 0.0)
        crossings = t[i] + (t[i + 1] - t[i]) * a[i] / (a[i] - a[i + 1])
        peaks = [np.abs(a[j:k]).max() for j, k in itertools.pairwise(i[:4])]
        swings.append(
            (1.0 / (crossings[2] - crossings[0]), math.log(peaks[0] / peaks[2]) / math.tau)
        )
    frequency, damping = np.mean(swings, axis=0)
    return float(frequency), float(damping)
