"""Calibrate the ranges of predicted chattering on random loops that are integrated exactly.

    python benchmarks/chattering.py [--loops 200] [--seed 0]

A range is widened by a factor, so that it holds the exact amplitude, or frequency, in more than 95 % of the loops. The
script prints the factors, which `smc_mujoco/analysis/chattering.py` has as constants, and how good the predictions are.
It takes about a minute and a half of processor time.
"""

import argparse
import math
import sys
import warnings
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "analysis")]

from helpers.exact_cycles import random_loop  # noqa: E402
from test_exact_cycles import scenario  # noqa: E402

import smc_mujoco as smc  # noqa: E402
from smc_mujoco.analysis.chattering import AMPLITUDE_FACTOR, FREQUENCY_FACTOR  # noqa: E402

SHARE = 0.97  # of the loops whose ranges are to hold the truth, over 95 %: chosen after a trial on 60 other loops
SLOWEST = 1.0  # Hz, of the cycles that count


def main() -> None:
    """Print the factors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--loops", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    rng, rows, none = np.random.default_rng(given.seed), [], 0
    while len(rows) < given.loops:
        loop = random_loop(rng)
        amplitude, frequency = loop.cycle()
        if not frequency > SLOWEST:
            continue
        cycle = smc.chattering(scenario(loop))
        none += not cycle
        rows.append((
            cycle.amplitude / amplitude, *(end / amplitude for end in cycle.amplitude_range),
            cycle.frequency / frequency, *(end / frequency for end in cycle.frequency_range),
        ))  # fmt: skip
    for name, factor, (ratio, low, high) in zip(
        ("amplitude", "frequency"),
        (AMPLITUDE_FACTOR, FREQUENCY_FACTOR),
        np.array(rows).T.reshape(2, 3, -1),
        strict=True,
    ):
        held = np.mean((low <= 1.0) & (high >= 1.0))
        needed = np.fmax(low * factor, factor / high)  # the factor with which the range just holds the truth
        needed = np.sort(np.where(np.isnan(low), math.inf, needed))[math.ceil(SHARE * len(rows)) - 1]
        errors = np.abs(ratio[~np.isnan(ratio)] - 1.0)
        print(
            f"{name}: factor {max(needed, 1.0):.4f} for {100 * SHARE:g} %; with {factor:g} the ranges hold "
            f"{100 * held:.1f} %; the median error is {100 * np.median(errors):.2g} %, "
            f"{100 * np.mean(errors < 0.05):.0f} % err by less than 5 %"
        )
    print(f"{len(rows)} loops, {none} without a predicted cycle")


if __name__ == "__main__":
    main()
