"""What a friction of a user's own costs in the fast engine, beside Coulomb friction.

    python benchmarks/own_friction.py

A pendulum at 1 ms under super-twisting, with dry friction that is held about a point, without and
with noise, follows a sine, or takes a blow. Three frictions take turns with Coulomb in each round:
a Stribeck curve; a level without an exponential; and a curve that also reads the time, so that its
levels at rest are not known beforehand. A ratio is of processor time, the median over rounds, with
the quartiles; frictions in one round run the same starts and seeds.
"""

import math
import statistics
import time
from typing import Any

import numpy as np

import smc_mujoco as smc
from smc_mujoco.analysis.engine.form import SETTING
from smc_mujoco.analysis.engine.group import FormGroup

RUNS = 32
ROUNDS = 41
COULOMB, STATIC, SPEED = 0.2, 0.3, 0.1  # N m, N m, rad/s
LAW = smc.law("super_twisting", k1=8.0, k2=10.0, c=3.0)
BLOW = smc.signals.Pulse(0.05, 2.0, 0.01)


@smc.hardware.friction_function(numbers={"coulomb": COULOMB, "static": STATIC, "speed": SPEED})
def stribeck(y, p, memory):
    return p.coulomb + (p.static - p.coulomb) * math.exp(-((y.v / p.speed) ** 2))


@smc.hardware.friction_function(numbers={"coulomb": COULOMB, "static": STATIC})
def flat(y, p, memory):
    return p.static if y.v == 0.0 else p.coulomb


@smc.hardware.friction_function(numbers={"coulomb": COULOMB, "static": STATIC, "speed": SPEED})
def of_time(y, p, memory):
    level = p.coulomb + (p.static - p.coulomb) * math.exp(-((y.v / p.speed) ** 2))
    return level if y.t >= 0.0 else p.coulomb


FRICTIONS = {
    "Coulomb": smc.Coulomb(COULOMB),
    "Stribeck": stribeck(),
    "no exponential": flat(),
    "reads the time": of_time(),
}
CASES = {
    "held": {},
    "held, noise": {"noise": smc.Noise(1e-3, 5e-3)},
    "sine": {"reference": smc.Sine(0.3, 5.0)},
    "blow": {"disturbance": BLOW},
}


def group_of(friction: Any, fields: dict) -> tuple[FormGroup, np.ndarray]:
    """Return a group of one run, and the rows of RUNS that differ in start and seed."""
    scenario = smc.Scenario(
        plant="inverted_pendulum",
        law=LAW,
        friction=friction,
        duration=10.0,
        u_max=6.0,
        **fields,
    )
    group = FormGroup([scenario], ("itae",))
    rows = np.repeat(group.rows, RUNS, axis=0)
    rows[:, group.layout.row.x0] = np.linspace(0.2, 0.6, RUNS)
    rows[:, SETTING.seed] = np.arange(RUNS)
    return group, rows


def times(fields: dict) -> tuple[dict[str, list[float]], int]:
    """Return the processor time of every round by friction, s, and the steps of a round."""
    groups = {}
    for name, friction in FRICTIONS.items():
        groups[name] = group_of(friction, fields)
    found: dict[str, list[float]] = {name: [] for name in groups}
    for k in range(ROUNDS + 1):
        for name, (group, rows) in groups.items():
            began = time.process_time()
            group.run(rows, threads=1)
            if k:  # the first compiles
                found[name].append(time.process_time() - began)
    rows = groups["Coulomb"][1]
    steps = RUNS * rows[0, SETTING.samples] * rows[0, SETTING.steps]
    return found, int(steps)


def main() -> None:
    print("case, ns a step of Coulomb; times that of Coulomb: median (quartiles)")
    for name, fields in CASES.items():
        found, steps = times(fields)
        coulomb = found.pop("Coulomb")
        print(f"{name:12} {1e9 * statistics.median(coulomb) / steps:5.1f} ns", end="")
        for other, seconds in found.items():
            ratios = [a / b for a, b in zip(seconds, coulomb, strict=True)]
            low, middle, high = statistics.quantiles(ratios, n=4)
            print(f"; {other} {middle:.3f} ({low:.3f} to {high:.3f})", end="")
        print(flush=True)


if __name__ == "__main__":
    main()
