"""The reversals and the runs to rest of benchmarks/friction.py again, by a loop with nothing of
this package in it: the joints, dry friction, encoder, rate, delay and compensation are written out
here, and the laws are those of fronts_by_own_loop.py.

    python -m benchmarks.friction_by_own_loop --keep benchmarks/friction_by_own_loop.json

It has the points of `rail` and `geared` under dry friction, but those of the observer-free law.
Each runs a dozen times, with starts, phases, zeros of the encoder and noise of a generator of its
own.
"""

import argparse
import itertools
import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numba import njit

from benchmarks.fronts_by_own_loop import (
    ADRC,
    BOUND,
    GAINS,
    HODOB,
    PD_OBSERVER,
    PID,
    adrc,
    pd_with_observer,
    sliding,
    within_bounds,
)

SEED, RUNS = 7, 12
H, PARTS, LATE = 1e-3, 20, 2  # s, of control; steps of physics in it; periods of delay
SETTLING, NOISE, LONGEST = 3.0, 0.3, 60.0  # s; counts; s, of pid's integral
REST, WINDOW = 10.0, 5.0  # s, of a run to rest, and of its last part
JOINTS = {  # mass, viscous friction, moment of gravity, angle; start; counts per unit of x
    "rail": ((1.0, 0.0, 0.0, 0.0), 0.1, 40960.0),
    "geared": ((0.225, 0.02, 2.4525, 0.8), 0.5, 4096.0 / math.tau),
}
LEVELS = {"coulomb10": (0.1, 0.1), "coulomb30": (0.3, 0.3), "stribeck": (0.15, 0.225)}
APART, FLOOR = 1.3, 1.0  # of lines that are compared; count


@njit
def resisting(friction, speed):
    """Return the dry friction at a speed."""
    moving, resting, slow = friction
    return moving + (resting - moving) * math.exp(-((speed / slow) ** 2))


@njit
def pid(g, e, de, first, z):
    """Return u; z holds the integral."""
    kp, ki, kd, tt = g[0], g[1], g[2], g[3]
    u = z[0] - kp * e - kd * de
    back = (within_bounds(u) - u) / tt * min(1.0, LONGEST * ki / kp)
    z[0] += H * (back - ki * e)
    return u


@njit
def rms(joint, friction, law, g, tau, share, x0, sine, count, zero, noise, window):
    """Return the rms of the error in the last `window` samples, counts."""
    mass, viscous, moment, angle = joint
    size, omega, phase = sine
    x, v = x0, 0.0
    samples = len(noise) - 1
    z = np.zeros(4)
    waiting = np.zeros(samples + 1 + LATE)
    before, rate, total = 0.0, 0.0, 0.0
    for k in range(samples + 1):
        turn = omega * k * H + phase
        r, speed = size * math.sin(turn), size * omega * math.cos(turn)
        if k > samples - window:
            total += (x - r) ** 2
        read = round((x + zero + noise[k]) / count) * count
        if k > 0:
            rate += H / (tau + H) * ((read - before) / H - rate)
        before = read
        e, de = read - r, rate - speed
        if law == ADRC:
            u = adrc(g, e, de, H, k == 0, z)
        elif law in (PD_OBSERVER, HODOB):
            u = pd_with_observer(law, g, e, de, H, k == 0, z)
        elif law == PID:
            u = pid(g, e, de, k == 0, z)
        else:
            u = sliding(law, g, e, de, H, z)
        level = resisting(friction, speed) * math.tanh(abs(speed) / (friction[2] / 4.0))
        waiting[k + LATE] = within_bounds(u + share * math.copysign(level, speed))
        step = H / PARTS
        for _ in range(PARTS):
            force = waiting[k] - moment * math.sin(x + angle) - viscous * v
            free = v + step * force / mass
            stops = step * resisting(friction, v) / mass
            v = math.copysign(max(abs(free) - stops, 0.0), free)
            x += step * v
    return math.sqrt(total / window) / count


def printed(points: Sequence[dict]) -> list[dict]:
    """Return the points that the loop has."""
    found = []
    for point in points:
        known = point["joint"] in JOINTS and point["law"] in ("pd", *GAINS)
        if known and point["friction"] in LEVELS and point.get("errors"):
            found.append(point)
    return found


def median(point: dict, rng: np.random.Generator) -> float:
    """Return the median error of a point, counts."""
    joint, start, counts = JOINTS[point["joint"]]
    scale = math.sqrt(start * joint[0] / BOUND)
    omega = 0.1 / scale
    rests = point["task"] == "rest"
    window = round((WINDOW if rests else math.tau / omega) / H)
    samples = round(REST / H) if rests else window + round(SETTLING / H)
    moving, resting = LEVELS[point["friction"]]
    friction = moving * BOUND, resting * BOUND, 0.02 * start / scale
    its = dict(point["gains"])
    tau = its.pop("tau")
    law = "pid" if point["law"] == "pd" else point["law"]
    assumed = {"ki": 0.0, "b": 1.0}
    g = np.array([its[name] if name in its else assumed[name] for name in GAINS[law]])
    found = []
    for _ in range(RUNS):
        phase = rng.uniform(0.0, math.tau)
        size = 0.0 if rests else start
        sine = size, omega, phase
        x0 = size * math.sin(phase)
        if rests:
            x0 = start * rng.uniform(0.8, 1.2) * rng.choice([-1, 1])
        zero = rng.uniform(-0.5, 0.5) / counts
        noise = rng.normal(0.0, NOISE / counts, samples + 1)
        about = joint, friction, list(GAINS).index(law), g, tau, point["share"]
        found.append(rms(*about, x0, sine, 1.0 / counts, zero, noise, window))
    return float(f"{np.median(found):.4g}")


def cell(point: dict) -> tuple:
    """Return what a point of a law shares with those of others."""
    return tuple(point[name] for name in ("joint", "task", "friction", "level", "share"))


def pairs(points: Sequence[dict], medians: Sequence[float]) -> Iterator[tuple]:
    """Yield two laws' points in one cell whose errors are APART, the smaller first, and whether the
    loop has them in the same order; both below one count is no order.
    """
    its = [(max(FLOOR, float(np.median(one["errors"]))), one) for one in printed(points)]
    known = [(error, one, own) for (error, one), own in zip(its, medians, strict=True)]
    for first, second in itertools.permutations(known, 2):
        same_cell = cell(first[1]) == cell(second[1])
        if same_cell and second[0] > APART * first[0]:
            yield first[1], second[1], first[2] < second[2]


def in_words(points: Sequence[dict], medians: Sequence[float]) -> str:
    """Return what the page says of the loop."""
    same = [agrees for *_, agrees in pairs(points, medians)]
    errors = [float(np.median(point["errors"])) for point in printed(points)]
    off = [abs(own / error - 1.0) for own, error in zip(medians, errors, strict=True)]
    above = [one for one, error in zip(off, errors, strict=True) if error > FLOOR]
    near = sum(one < 0.1 for one in above)
    return (
        f"of {len(above)} errors that are above one count, it has {near} within 10 %, and of "
        f"{len(same)} pairs of laws in one cell that are more than 30 % apart, {sum(same)} in the "
        "same order"
    )


def main() -> None:
    """Run all points, and print those that are off."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    file = Path(__file__).with_name("friction.json")
    parser.add_argument("file", nargs="?", type=Path, default=file)
    parser.add_argument("--keep", type=Path, help="file of the medians")
    asked = parser.parse_args()
    points = json.loads(asked.file.read_text())
    rng = np.random.default_rng(SEED)
    medians = [median(point, rng) for point in printed(points)]
    for point, own in zip(printed(points), medians, strict=True):
        error = float(np.median(point["errors"]))
        if error > FLOOR and abs(own / error - 1.0) >= 0.1:
            place = [point[name] for name in ("joint", "law", "task", "friction", "level", "share")]
            print(*place, f"{error:.3g}, own {own:.3g}")
    print(in_words(points, medians))
    if asked.keep:
        asked.keep.write_text(json.dumps(medians) + "\n")


if __name__ == "__main__":
    main()
