"""The points of benchmarks/fronts.py again, by a loop with nothing of this package in it: equations
of the plants, formulas of the laws, RK4, starts, phases and noise are written out here.

    python -m benchmarks.fronts_by_own_loop --keep benchmarks/fronts_by_own_loop.json

Each set of gains whose error is settled and above the floor runs as often as it did for the page,
from starts within 20 % of the plant's, with phases and noise of a generator of its own.
"""

import argparse
import json
import math
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numba import njit

from benchmarks.fronts_sentences import FLOOR, is_settled, read

SEED = 5
H, BOUND = 1e-3, 6.0  # s, of RK4; N or N m
STARTS = {"duffing": 1.5, "inverted_pendulum": 0.5, "van_der_pol": 2.0}  # m, rad, m
LOADS = {"middle": (1.0, 0.5), "strong": (4.0, 0.5), "fast": (1.0, 2.0)}  # N or N m, of wc
GAINS = {
    "super_twisting": ("k1", "k2", "c"),
    "implicit_super_twisting": ("k1", "k2", "c", "b"),
    "classical": ("k", "c"),
    "boundary_layer": ("k", "c", "phi"),
    "adrc": ("wc", "w", "b"),
    "pd_observer": ("wc", "l", "b"),
    "hodob": ("wc", "l", "b"),
    "pid": ("kp", "ki", "kd", "tt"),
}
TWISTING, IMPLICIT, CLASSICAL, LAYER, ADRC, PD_OBSERVER, HODOB, PID = range(len(GAINS))
TAU, LONGEST = 5e-3, 60.0  # s, of pid


@njit
def acceleration(plant, x, v, force):
    """Return x'': of Duffing, of the pendulum, of Van der Pol."""
    if plant == 0:
        return x - x**3 - 0.2 * v + force
    if plant == 1:
        return (0.5 * 9.81 * 0.5 * math.sin(x) - 0.02 * v + force) / (0.5 * 0.5**2)
    return (1.0 - x * x) * v - x + force


@njit
def within_bounds(u):
    return min(max(u, -BOUND), BOUND)


@njit
def sliding(law, g, e, de, h, z):
    """Return u of a sliding law; z holds its integral."""
    if law == TWISTING:
        s = de + g[2] * e
        u = -g[0] * math.sqrt(abs(s)) * np.sign(s) + z[0]
        z[0] -= h * g[1] * np.sign(s)
        return u
    if law == CLASSICAL:
        return -g[0] * np.sign(de + g[1] * e)
    if law == LAYER:
        return -g[0] * min(max((de + g[1] * e) / g[2], -1.0), 1.0)
    # implicit: s+ = s + h b u with u = -k1 |s+|^(1/2) sgn(s+) + w+, w+ = w - h k2 sgn(s+)
    s = de + g[2] * e
    hb = h * g[3]
    ahead = s + hb * z[0]
    beyond = abs(ahead) - hb * h * g[1]
    if beyond <= 0.0:
        z[0] = -s / hb
        return z[0]
    root = 0.5 * (math.sqrt((hb * g[0]) ** 2 + 4.0 * beyond) - hb * g[0])
    z[0] -= h * g[1] * np.sign(ahead)
    return z[0] - g[0] * root * np.sign(ahead)


@njit
def adrc(g, e, de, h, first, z):
    """Return u; z holds the estimates of e, e' and d, and b u."""
    wc, w, b = g[0], g[1], g[2]
    p = math.exp(-w * h)
    if first:
        z[0], z[1] = e, de
    else:
        push = z[2] + z[3]
        ahead = z[0] + h * z[1] + 0.5 * h * h * push
        miss = e - ahead
        z[0] = ahead + (1.0 - p**3) * miss
        z[1] += h * push + 1.5 * (1.0 - p) ** 2 * (1.0 + p) / h * miss
        z[2] += (1.0 - p) ** 3 / h**2 * miss
    u = -(wc * wc * z[0] + 2.0 * wc * z[1] + z[2]) / b
    z[3] = b * within_bounds(u)
    return u


@njit
def pd_with_observer(law, g, e, de, h, first, z):
    """Return u; z holds the estimate of d, its change in a period, the last e' and b u."""
    wc, l, b = g[0], g[1], g[2]
    p = math.exp(-l * h)
    if not first:
        miss = (de - z[2]) / h - z[3] - z[0]
        if law == HODOB:  # the estimate for the next period
            z[1] += (1.0 - p) ** 2 * miss
            z[0] += z[1] + (1.0 - p * p) * miss
        else:
            z[0] += (1.0 - p) * miss
    u = -(wc * wc * e + 2.0 * wc * de + z[0]) / b
    z[2] = de
    z[3] = b * within_bounds(u)
    return u


@njit
def pid(g, e, de, h, first, z):
    """Return u; z holds the integral and the filtered derivative."""
    kp, ki, kd, tt = g[0], g[1], g[2], g[3]
    z[1] = de if first else z[1] + h / (TAU + h) * (de - z[1])
    u = z[0] - kp * e - kd * z[1]
    back = (within_bounds(u) - u) / tt * min(1.0, LONGEST * ki / kp)
    z[0] += h * (back - ki * e)
    return u


@njit
def rms(plant, law, g, x0, force, omega, phase, sensor, h, samples, window):
    """Return the rms of x at the last `window` samples; inf if it diverges."""
    x, v, total = x0, 0.0, 0.0
    z = np.zeros(4)
    for k in range(samples + 1):
        if k > samples - window:
            total += x * x
        if k == samples:
            break
        e, de = x + sensor[k, 0], v + sensor[k, 1]
        if law == ADRC:
            u = adrc(g, e, de, h, k == 0, z)
        elif law in (PD_OBSERVER, HODOB):
            u = pd_with_observer(law, g, e, de, h, k == 0, z)
        elif law == PID:
            u = pid(g, e, de, h, k == 0, z)
        else:
            u = sliding(law, g, e, de, h, z)
        u = within_bounds(u)
        for j in range(round(h / H)):
            t = k * h + j * H
            f1 = u + force * math.sin(omega * t + phase)
            f2 = u + force * math.sin(omega * (t + 0.5 * H) + phase)
            f3 = u + force * math.sin(omega * (t + H) + phase)
            a1 = acceleration(plant, x, v, f1)
            a2 = acceleration(plant, x + 0.5 * H * v, v + 0.5 * H * a1, f2)
            a3 = acceleration(plant, x + 0.5 * H * (v + 0.5 * H * a1), v + 0.5 * H * a2, f2)
            a4 = acceleration(plant, x + H * (v + 0.5 * H * a2), v + H * a3, f3)
            x += H * v + H * H / 6.0 * (a1 + a2 + a3)
            v += H / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        if not abs(x) < 1e6:
            return math.inf
    return math.sqrt(total / window)


def printed(points: Sequence[dict]) -> list[dict]:
    """Return the points whose errors are numbers of the page: settled, above the floor, and not
    drawn; each set of gains once for a load.
    """
    found = {}
    for point in points:
        told = point["price"] != "least" and is_settled(point["error"])
        if told and point["draw"] is None and point["error"][0] > FLOOR:
            place = [point[name] for name in ("plant", "period", "law", "condition")]
            found.setdefault((*place, *point["gains"].values()), point)
    return list(found.values())


def errors(point: dict, runs: int, rng: np.random.Generator) -> np.ndarray:
    """Return the errors of a point in some runs, over the start, (runs,)."""
    start = STARTS[point["plant"]]
    kind, _, noise = point["condition"].partition(", ")
    force, ratio = LOADS[kind]
    omega, h = ratio * point["wc"], point["period"]
    window = math.tau / omega * max(1, math.ceil(2.0 * omega / math.tau))
    samples = round(round(4.0 + 2.0 * window, 2) / h)
    sigma = 1e-3 * start * bool(noise)
    law = list(GAINS).index(point["law"])
    plant = list(STARTS).index(point["plant"])
    g = np.array([point["gains"][name] for name in GAINS[point["law"]]])
    found = []
    for _ in range(runs):
        x0 = start * rng.uniform(0.8, 1.2)
        sensor = rng.normal(size=(samples + 1, 2)) * (sigma, 5.0 * sigma)
        phase = rng.uniform(0.0, math.tau)
        load = force, omega, phase
        found.append(rms(plant, law, g, x0, *load, sensor, h, samples, round(window / h)) / start)
    return np.array(found)


def generator(point: dict) -> np.random.Generator:
    """Return the generator of a point's starts, phases and noise, the same in any file."""
    about = [point[name] for name in ("plant", "period", "law", "condition", "gains")]
    return np.random.default_rng([SEED, zlib.crc32(json.dumps(about).encode())])


def median(point: dict, rng: np.random.Generator) -> float:
    """Return the median error of a point."""
    return float(f"{np.median(errors(point, point['runs'], rng)):.4g}")


def apart(points: Sequence[dict], medians: Sequence[float]) -> np.ndarray:
    """Return how far the medians of an own loop are from those of the page, as shares."""
    theirs = [point["error"][0] for point in printed(points)]
    return np.abs(np.divide(medians, theirs) - 1.0)


def in_words(points: Sequence[dict], medians: Sequence[float]) -> str:
    """Return what the page says of the medians of an own loop."""
    off = apart(points, medians)
    return (
        f"A loop of its own, with nothing of this package in it, gives {np.sum(off < 0.05)} of the "
        f"{len(off)} errors that are settled and above the floor within 5 %, the farthest within "
        f"{math.ceil(100 * off.max())} %"
    )


def main() -> None:
    """Run all points, and print how far they are from the page's."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    folder = Path(__file__).parent
    parser.add_argument("file", nargs="?", type=Path, default=folder / "fronts.json")
    parser.add_argument("--keep", type=Path, help="file of the medians")
    asked = parser.parse_args()
    points = read(asked.file)
    medians = [median(point, generator(point)) for point in printed(points)]
    for point, its, off in zip(printed(points), medians, apart(points, medians), strict=True):
        if off >= 0.05:
            error, low, high = point["error"]
            place = [point[name] for name in ("search", "plant", "period", "law", "condition")]
            print(*place, f"{error:.3g} ({low:.3g} to {high:.3g}), own {its:.3g}")
    print(in_words(points, medians))
    if asked.keep:
        asked.keep.write_text(json.dumps(medians) + "\n")


if __name__ == "__main__":
    main()
