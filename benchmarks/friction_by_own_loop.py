"""The reversals and the runs to rest of benchmarks/friction.py again, by a loop with nothing of
this package in it: the joints, frictions, encoder, rate, delay, compensation and square wave are
written out here, and most laws are those of fronts_by_own_loop.py.

    python -m benchmarks.friction_by_own_loop --keep benchmarks/friction_by_own_loop.json

It has all points that the fast engine runs, but those of 40 s. Each runs 48 times, with starts,
phases, zeros of the encoder and noise of a generator of its own.
"""

import argparse
import itertools
import json
import math
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numba import njit

from benchmarks.friction_sentences import is_settled
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

SEED, RUNS = 7, 48
H, PARTS, LATE = 1e-3, 20, 2  # s, of control; steps of physics in it; periods of delay
SETTLING, NOISE, LONGEST = 3.0, 0.3, 60.0  # s; counts; s, of pid's integral
REST, WINDOW = 10.0, 5.0  # s, of a run to rest, and of its last part
JOINTS = {  # mass, viscous friction, moment of gravity, angle; start; counts per unit of x
    "rail": ((1.0, 0.0, 0.0, 0.0), 0.1, 40960.0),
    "geared": ((0.225, 0.02, 2.4525, 0.8), 0.5, 4096.0 / math.tau),
    "ak80": ((0.1635, 0.0, 3.2373, math.pi), 0.3, 4096.0 / math.tau),
}
LEVELS = {  # of the bound: in motion, at rest; times the torque on a gearbox
    "coulomb10": (0.1, 0.1, 0.0),
    "coulomb30": (0.3, 0.3, 0.0),
    "stribeck": (0.15, 0.225, 0.0),
    "identified": (0.035, 0.035, 0.0),
    "load": (0.03, 0.042, 0.12),
    "lugre": (0.1, 0.15, 0.0),
}
INTEGRAL, SLOPED = len(GAINS), 1 + len(GAINS)  # laws of this file
ALL_GAINS = {
    **GAINS,
    "observer_free_integral": ("lam", "k1", "ki"),
    "sloped": ("k1", "k2", "c", "eps"),
}
HALF_WAVE = 4e-3  # s, of the square wave
APART, FLOOR = 1.3, 1.0  # of lines that are compared; count


@njit
def resisting(friction, speed, torque):
    """Return the dry friction at a speed, with the torque on a gearbox."""
    moving, resting, slow, share, _ = friction
    near = math.exp(-((speed / slow) ** 2))
    return moving + share * torque + near * (resting - moving + 0.4 * share * torque)


@njit
def observer_free(g, e, de, z):
    """Return u of the observer-free law with an integral in z."""
    lam, k1, ki = g[0], g[1], g[2]
    whole = de + k1 * e + ki * z[0]
    u = -lam * math.tanh(whole)
    if (abs(whole) <= 2.0 and abs(u) <= BOUND) or e * whole < 0.0:
        z[0] += H * e
    return u


@njit
def sloped(g, e, de, z):
    """Return u of super-twisting with a slope of width eps in place of the sign in its integral."""
    k1, k2, c, eps = g[0], g[1], g[2], g[3]
    s = de + c * e
    u = z[0] - k1 * math.copysign(math.sqrt(abs(s)), s)
    z[0] = within_bounds(z[0] - H * k2 * min(max(s / eps, -1.0), 1.0))
    return u


@njit
def pid(g, e, de, first, z):
    """Return u; z holds the integral."""
    kp, ki, kd, tt = g[0], g[1], g[2], g[3]
    u = z[0] - kp * e - kd * de
    back = (within_bounds(u) - u) / tt * min(1.0, LONGEST * ki / kp)
    z[0] += H * (back - ki * e)
    return u


@njit
def rms(joint, friction, law, g, tau, fed, x0, sine, count, zero, noise, window):
    """Return the rms of the error in the last `window` samples, counts."""
    mass, viscous, moment, angle = joint
    size, omega, phase = sine
    share, measured, wave = fed
    stiffness = friction[4]
    damping = 0.2 * math.sqrt(stiffness * mass)
    x, v, bend = x0, 0.0, 0.0
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
        elif law == INTEGRAL:
            u = observer_free(g, e, de, z)
        elif law == SLOPED:
            u = sloped(g, e, de, z)
        else:
            u = sliding(law, g, e, de, H, z)
        known = rate if measured else speed
        level = resisting(friction, known, 0.0) * math.tanh(abs(known) / (friction[2] / 4.0))
        u += share * math.copysign(level, known)
        u += wave if math.floor(k * H / HALF_WAVE + 1e-6) % 2 == 0 else -wave
        waiting[k + LATE] = within_bounds(u)
        step = H / PARTS
        for _ in range(PARTS):
            outside = -moment * math.sin(x + angle)
            force = waiting[k] + outside - viscous * v
            level = resisting(friction, v, abs(waiting[k] - outside))
            if stiffness > 0.0:
                bending = v - stiffness * abs(v) / level * bend
                force -= stiffness * bend + damping * bending
                bend += step * bending
                level = 0.0
            free = v + step * force / mass
            v = math.copysign(max(abs(free) - step * level / mass, 0.0), free)
            x += step * v
    return math.sqrt(total / window) / count


def printed(points: Sequence[dict]) -> list[dict]:
    """Return the points that the loop has, with errors that are numbers of the page."""
    found = []
    for point in points:
        known = point["joint"] in JOINTS and point["friction"] in LEVELS
        if known and point.get("errors") and is_settled(point):
            found.append(point)
    return found


def gains_of(point: dict) -> tuple[int, np.ndarray, float]:
    """Return the number of a point's law, its gains, and the time constant of its rate, s."""
    its = dict(point["gains"])
    tau = its.pop("tau")
    law = "pid" if point["law"] == "pd" else point["law"]
    if point["price"] == "slope":
        law = "sloped"
        mass, start = JOINTS[point["joint"]][0][0], JOINTS[point["joint"]][1]
        its["eps"] = point["size"] * start / math.sqrt(start * mass / BOUND)
    assumed = {"ki": 0.0, "b": 1.0}
    values = [its[name] if name in its else assumed[name] for name in ALL_GAINS[law]]
    return list(ALL_GAINS).index(law), np.array(values), tau


def friction_of(point: dict) -> tuple[float, ...]:
    """Return the friction of a point: in motion and at rest, the speed of the drop, times the
    torque on a gearbox, stiffness of bristles.
    """
    joint, start, _ = JOINTS[point["joint"]]
    moving, resting, share = LEVELS[point["friction"]]
    slow = 0.02 * start / math.sqrt(start * joint[0] / BOUND)
    stiffness = 1e3 * moving * BOUND / start if point["friction"] == "lugre" else 0.0
    return moving * BOUND, resting * BOUND, slow, share, stiffness


def generator(point: dict) -> np.random.Generator:
    """Return the generator of a point's starts, phases, zeros and noise, the same in any file."""
    about = point["law"], point["price"], point.get("size"), cell(point)
    return np.random.default_rng([SEED, zlib.crc32(repr(about).encode())])


def median(point: dict, rng: np.random.Generator) -> float:
    """Return the median error of a point, counts."""
    joint, start, counts = JOINTS[point["joint"]]
    omega = 0.1 / math.sqrt(start * joint[0] / BOUND)
    rests = point["task"] == "rest"
    window = round((WINDOW if rests else math.tau / omega) / H)
    samples = round(REST / H) if rests else window + round(SETTLING / H)
    friction = friction_of(point)
    wave = point["size"] * friction[0] if point["price"] == "dither" else 0.0
    fed = point["share"], point.get("on") == "speed", wave
    law, g, tau = gains_of(point)
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
        about = joint, friction, law, g, tau, fed
        found.append(rms(*about, x0, sine, 1.0 / counts, zero, noise, window))
    return float(f"{np.median(found):.4g}")


def cell(point: dict) -> tuple:
    """Return what a point of a law shares with those of others, or of other waves and slopes."""
    price = point["price"] if "size" in point else ""
    about = [point[name] for name in ("joint", "task", "friction", "level", "share")]
    return (*about, point.get("on"), price)


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
    medians = [median(point, generator(point)) for point in printed(points)]
    for point, own in zip(printed(points), medians, strict=True):
        error = float(np.median(point["errors"]))
        if error > FLOOR and abs(own / error - 1.0) >= 0.1:
            print(point["law"], point["price"], *cell(point), f"{error:.3g}, own {own:.3g}")
    print(in_words(points, medians))
    if asked.keep:
        asked.keep.write_text(json.dumps(medians) + "\n")


if __name__ == "__main__":
    main()
