"""Calibrate the ranges of predicted chattering on random loops that are integrated exactly.

    python benchmarks/chattering.py [--loops 200] [--seed 0]
    python benchmarks/chattering.py --halving duffing    # whose cycles change at half the step

A range is widened by a factor, so that it holds the exact amplitude, or frequency, in more than 95
% of the loops. The script prints the factors, which `smc_mujoco/analysis/chattering.py` has as
constants, and how good the predictions are. It takes about a minute and a half of processor time,
the halving a third of that.
"""

import argparse
import math
import sys
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "analysis")]

from helpers.exact_cycles import random_loop  # noqa: E402
from test_exact_cycles import scenario  # noqa: E402

import smc_mujoco as smc  # noqa: E402
from smc_mujoco.chattering.prediction import AMPLITUDE_FACTOR, FREQUENCY_FACTOR  # noqa: E402
from smc_mujoco.control import gain_sets  # noqa: E402
from smc_mujoco.simulation.grid import case  # noqa: E402

# of the loops whose ranges are to hold the truth, over 95 %: chosen after a trial on 60 other loops
SHARE = 0.97
SLOWEST = 1.0  # Hz: a slower cycle does not count
MANY = 40  # samples a period, from which on a cycle hardly locks to them: chosen
DRIVES = {
    "none": None,
    "lag 1 ms": smc.Lag(1e-3),
    "lag 10 ms": smc.Lag(0.01),
    "lags 5 and 10 ms": (smc.Lag(5e-3), smc.Lag(0.01)),
    "rate limit": smc.hardware.RateLimit(200.0),
    "motor without inductance": smc.DCMotor(inductance=0.0),
    "motor RE 40": smc.DCMotor(),
    "motor of 5 ms": smc.DCMotor(inductance=5e-3 * smc.DCMotor().resistance),
    "backlash": smc.Backlash(0.02, rotor_damping=0.02),
}


def halving(plant: str) -> None:
    """Print the laws with tuned gains whose cycles half the step or a nudge changes, behind each
    drive.
    """
    marked = Counter()
    cases = Counter()
    laws = gain_sets.general_laws([plant], "tuned")
    for name, drive in DRIVES.items():
        changes = {} if drive is None else {"actuator": drive}
        runs = smc.run([case(plant, law, "nominal", 5.0, "tuned", changes=changes) for law in laws])
        integrator = runs[0].scenario.resolved.integrator
        change_by_law = {}
        for t, c in zip(runs, smc.accuracy.step_halving(runs, 0), strict=True):
            if c.marked:
                change_by_law[t.scenario.law.name] = c
        marked[integrator] += len(change_by_law)
        cases[integrator] += len(runs)
        parts = []
        for law, change in change_by_law.items():
            parts.append(f"{law} {100 * change.amplitude:.0f} %, {100 * change.frequency:.0f} %")
        print(
            f"{name}: {len(change_by_law)} of "
            f"{len(runs)}{', amplitude and frequency: ' * bool(parts)}{'; '.join(parts)}"
        )
    print(*(f"{name}: {marked[name]} of {cases[name]}" for name in cases), sep=", ")


def main() -> None:
    """Print the factors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--loops", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--halving",
        metavar="PLANT",
        help="what half the physics step changes on this plant instead",
    )
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    if options.halving:
        halving(options.halving)
        return
    rng = np.random.default_rng(options.seed)
    rows = []
    samples = []
    none = 0
    while len(rows) < options.loops:
        loop = random_loop(rng)
        amplitude, frequency = loop.cycle()
        if not frequency > SLOWEST:
            continue
        cycle = smc.design.chattering(scenario(loop))
        none += not cycle
        rows.append(
            (
                cycle.amplitude / amplitude,
                *(end / amplitude for end in cycle.amplitude_range),
                cycle.frequency / frequency,
                *(end / frequency for end in cycle.frequency_range),
            )
        )
        samples.append(1.0 / (frequency * loop.period))
    for name, factor, (ratio, low, high) in zip(
        ("amplitude", "frequency"),
        (AMPLITUDE_FACTOR, FREQUENCY_FACTOR),
        np.array(rows).T.reshape(2, 3, -1),
        strict=True,
    ):
        held = np.mean((low <= 1.0) & (high >= 1.0))
        # the factor with which the range just holds the truth
        needed = np.fmax(low * factor, factor / high)
        needed = np.sort(np.where(np.isnan(low), math.inf, needed))[
            math.ceil(SHARE * len(rows)) - 1
        ]
        errors = np.abs(ratio[~np.isnan(ratio)] - 1.0)
        print(
            f"{name}: factor {max(needed, 1.0):.4f} for {100 * SHARE:g} %; with {factor:g} the "
            "ranges hold "
            f"{100 * held:.1f} %; the median error is {100 * np.median(errors):.2g} %, "
            f"{100 * np.mean(errors < 0.05):.0f} % err by less than 5 %"
        )
    for words, which in (
        (f"under {MANY} samples a period", np.array(samples) < MANY),
        ("more", np.array(samples) >= MANY),
    ):
        ratio, low, high = np.array(rows)[which, :3].T
        errors = np.abs(ratio[~np.isnan(ratio)] - 1.0)
        widths = high / low
        print(
            f"{words}: {which.sum()} loops, {np.isnan(ratio).sum()} without a prediction; the "
            "median error of the "
            f"amplitude is {100 * np.median(errors):.2g} %, {100 * np.mean(errors < 0.05):.0f} "
            "% err by less than 5 %; "
            f"the range ends at {np.nanmedian(widths):.2f} times its begin in the median, at "
            "over 2 times in "
            f"{100 * np.mean(widths > 2.0):.0f} %"
        )
    print(f"{len(rows)} loops, {none} without a predicted cycle")


if __name__ == "__main__":
    main()
