"""Identification of the QUBE-Servo 3: its arm, cable and friction, from a step of 1 V and ten free falls.

    python benchmarks/qube_servo_3.py [RECORD.csv]

RECORD has the columns t, theta, alpha, Vm of datos/cable_theta/pruebaincial_real_fit.csv in the repository of the
thesis that smc_mujoco/evidence/rigs/machines/quanser.py names (MIT); without it, an excerpt of every tenth sample. At
-1 V the arm turns until it meets a stop (0.91 s) and comes back. Both parts are fitted, the way back from its measured
place with free velocities, as the stop is not modelled. The falls are one number: 2.432 Hz while the pendulum's swings
are 8 to 25 degrees. Their damping ratio, .0261, is not used but printed: whether the amplifier was on is not known. As
a twin's swings fade faster, its frequency is the mean of the first periods of three falls, which cover that range.

The arm has no dry friction here. With one of 4.5e-4 N m step and way back are met as well (.0145, .0237 rad rms), but
the arm then sticks in falls below 10 degrees, where the pendulum swings at 1.70 Hz; the ten falls exclude that.

The equation is integrated by Dormand-Prince here and shares nothing with the suite.
"""

import itertools
import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

EXCERPT = Path(__file__).parents[1] / "tests" / "evidence" / "rigs" / "qube_servo_3_step.csv"
NAMES = "resistance", "arm_inertia", "arm_damping", "cable"
SCALES = np.array([10.0, 1e-4, 1e-4, 1e-3])  # ohm, kg m^2, N m s/rad, N m/rad
START = np.array([0.8, 0.6, 4.0, 2.3])  # of the search, in SCALES
STEP_END, RETURN = 0.8, (0.94, 1.66)  # s
SPACING = 0.02  # s, between samples that are used
ENCODER = 2 * np.pi / 2048  # rad
NOISE, FREQUENCY, FREQUENCY_ERROR = 5e-3, 2.432, 4e-3  # rad, Hz, Hz: what a residual of one is; chosen
ARM, MASS, LENGTH, GRAVITY, CONSTANT, ROTOR, DRY = 0.085, 0.024, 0.12865, 9.7807, 0.0422, 1.4e-6, 6.1e-6
FALLS, FALL_TIME = np.radians((25.0, 19.0, 13.0)), 1.2  # rad, s
SLOW = 0.05  # rad/s, at which the pendulum's dry friction reaches 76 % of its limit


def motion(q, state, volts, times, motor=1.0):
    """Return theta and alpha, 0 hanging, (2, K); `motor`: share of the back-EMF that flows, 0 for an open circuit."""
    R, J, b, cable = q
    inertia, pull, centre = MASS * LENGTH**2 / 3, MASS * ARM * LENGTH / 2, MASS * LENGTH / 2

    def rates(_, z):
        x, a, v, w = z
        s, c = np.sin(a), np.cos(a)
        mass = np.array([[J + ROTOR + MASS * ARM**2 + inertia * s * s, -pull * c], [-pull * c, inertia]])
        torque = CONSTANT / R * (volts - motor * CONSTANT * v) - b * v - cable * x
        arm = torque - pull * s * w * w - 2 * inertia * s * c * v * w
        swing = inertia * s * c * v * v - GRAVITY * centre * s - DRY * np.tanh(w / SLOW)
        return v, w, *np.linalg.solve(mass, [arm, swing])

    return solve_ivp(rates, (times[0], times[-1]), state, t_eval=times, rtol=1e-7, atol=1e-9, max_step=0.01).y[:2]


def fall(q, motor=1.0):
    """Return the frequency, Hz, and the damping ratio of falls, the means of the first period of each."""
    t, found = np.arange(0.0, FALL_TIME, 2e-3), []
    for angle in FALLS:
        a = motion(q, (0.0, angle, 0.0, 0.0), 0.0, t, motor)[1]
        i = np.flatnonzero(a[:-1] * a[1:] < 0.0)[:4]
        crossings = t[i] + 2e-3 * a[i] / (a[i] - a[i + 1])
        peaks = [np.abs(a[j:k]).max() for j, k in itertools.pairwise(i)]
        found.append((1.0 / (crossings[2] - crossings[0]), np.log(peaks[0] / peaks[2]) / (2.0 * np.pi)))
    return np.mean(found, axis=0)


def parts(record):
    """Return times, theta and alpha of the step and of the way back, (3, K) each; alpha grows with theta here."""
    rows = record[np.round(record[:, 0] / SPACING, 6) % 1.0 == 0.0]
    ahead, back = rows[:, 0] <= STEP_END, (rows[:, 0] >= RETURN[0]) & (rows[:, 0] <= RETURN[1])
    return [np.array([one[:, 0], one[:, 1], -one[:, 2]]) for one in (rows[ahead], rows[back])]


def errors(q, speeds, step, back):
    """Return the errors of the step and of the way back, (2, K) each, rad."""
    start = (*back[1:, 0], *speeds)
    return motion(q, np.zeros(4), -1.0, step[0]) - step[1:], motion(q, start, -1.0, back[0]) - back[1:]


def identified(step, back, weight=1.0, kept=None):
    """Return the quantities, (4,), and the two speeds of the way back.

    `weight`: of the way back; `kept`: which samples of all count.
    """
    count = step.shape[1]
    kept = np.ones(count + back.shape[1], bool) if kept is None else kept

    def residuals(z):
        q = z[:4] * SCALES
        ahead, after = errors(q, z[4:], step, back)
        rows = [ahead[:, kept[:count]] / NOISE, weight * after[:, kept[count:]] / NOISE]
        return np.concatenate([*map(np.ravel, rows), [(fall(q)[0] - FREQUENCY) / FREQUENCY_ERROR]])

    low, high = [0.3, 0.1, 0, 0, -3, -3], [3, 5, 20, 10, 3, 3]
    z = least_squares(residuals, [*START, 0.9, 0.1], diff_step=1e-3, bounds=(low, high)).x
    return z[:4] * SCALES, z[4:]


def told(label, q, speeds, step, back):
    """Print quantities and what they reach."""
    ahead, after = (np.sqrt(np.mean(one**2, axis=1)) for one in errors(q, speeds, step, back))
    print(f"{label}: " + ", ".join(f"{name} {value:.4g}" for name, value in zip(NAMES, q, strict=True)))
    print(f"  step, rad rms: theta {ahead[0]:.4f}, alpha {ahead[1]:.4f}; back: {after[0]:.4f}, {after[1]:.4f}")
    for motor, words in ((1.0, "amplifier on"), (0.0, "circuit open")):
        print("  falls, {}: {:.3f} Hz, damping ratio {:.3f}".format(words, *fall(q, motor)), flush=True)


def main():
    """Print the quantities, their errors from a jackknife over eight blocks, and sets with other weights."""
    step, back = parts(np.genfromtxt(sys.argv[1] if sys.argv[1:] else EXCERPT, delimiter=",", skip_header=1))
    best, speeds = identified(step, back)
    told("identified", best, speeds, step, back)
    count = step.shape[1] + back.shape[1]
    blocks = np.array_split(np.arange(count), 8)
    without = [identified(step, back, kept=~np.isin(np.arange(count), block))[0] for block in blocks]
    spread = np.sqrt(7 / 8 * np.sum((np.array(without) - np.mean(without, axis=0)) ** 2, axis=0))
    print("  standard errors: " + ", ".join(f"{name} {e:.2g}" for name, e in zip(NAMES, spread, strict=True)))
    for weight, label in (
        (0.3, "the way back at a third of the weight"),
        (3.0, "the way back at three times the weight"),
    ):
        told(f"the way back at {label}", *identified(step, back, weight), step, back)


if __name__ == "__main__":
    main()
