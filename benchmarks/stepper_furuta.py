"""Parameter sets of the rig stepper_furuta: draws whose simulated recordings have the linear law's recorded figures.

    python benchmarks/stepper_furuta.py           # 200 draws, 10 minutes of two cores; prints the ensemble
    python benchmarks/stepper_furuta.py 20        # the first 20

Approximate Bayesian computation by rejection. The machine is bursty, so its one recording of a condition is one draw
from a distribution: each draw of the quantities is run once from its own seed, in both recorded conditions, and kept if
its figures are within tolerances of the recorded ones. The tolerances were chosen while a pilot's draws ran, not
before; no figure of another law is looked at. A hold is burstier than nudges, so its tolerances are three times as
wide, on fewer figures.
"""

import math
import sys

import numpy as np

import smc_mujoco as smc
from smc_mujoco.evidence.rigs.machines.stepper_furuta import NAMES, PREDICTION

SEED, BATCH, KEPT = 2, 10, 8
PRIOR = {  # ends; True for a logarithmic prior
    "holding_torque": (0.12, 0.5, True), "arm_damping": (0.004, 0.04, True), "arm_friction": (0.0, 0.010, False),
    "pivot_friction": (5e-5, 1.5e-4, False), "pivot_damping": (1e-6, 1.5e-4, True),
    "upright_error": (-0.006, 0.006, False), "sensor_noise": (5e-5, 6e-4, True), "vibration": (2e-4, 8e-3, True),
}  # fmt: skip
LOGARITHMIC = {  # figure -> tolerance of its logarithm
    "alpha_rms": 0.25, "alpha_max": 0.5, "theta_std": 0.3, "alpha_rate_rms": 0.25, "theta_rate_rms": 0.25,
    "acceleration_rms": 0.25, "speed_rms": 0.25, "running": 0.3, "centroid": 0.06, "ratio": 0.08, "gain": 0.12,
}  # fmt: skip
LINEAR = {"phase": 3.0, "lag": 8.0, "resting": 0.25}  # degrees, and the share of time
OF_HOLD = ("alpha_rms", "theta_std", "acceleration_rms", "speed_rms", "running", "resting")
HOLD_WIDTH = 3.0  # of logarithms


def draw(random):
    """Return a draw of the quantities."""
    drawn = {}
    for name, (low, high, logarithmic) in PRIOR.items():
        share = random.random()
        drawn[name] = low * (high / low) ** share if logarithmic else low + (high - low) * share
    return drawn


def distance(found, condition):
    """Return the rms of a run's deviations from the recorded figures of a condition, in tolerances."""
    recorded = PREDICTION.recorded[condition]
    names = OF_HOLD if condition == "hold" else [name for name in recorded if name in LOGARITHMIC | LINEAR]
    width, parts = HOLD_WIDTH if condition == "hold" else 1.0, []
    for name in names:
        if name in LINEAR:
            parts.append((found[name] - recorded[name]) / LINEAR[name])
        else:
            parts.append(math.log(max(found[name], 1e-6) / recorded[name]) / LOGARITHMIC[name] / width)
    return float(np.sqrt(np.mean(np.square(parts))))


def main(count):
    rig, random, found = smc.rig("stepper_furuta"), np.random.default_rng(SEED), []
    for first in range(0, count, BATCH):
        drawn = [draw(random) for _ in range(min(BATCH, count - first))]
        scenarios = [
            rig.with_values(one, "drawn").scenario(x0=PREDICTION.start(seed), seed=seed, **fields)
            for seed, one in enumerate(drawn, 100_000 * SEED + first)
            for fields in PREDICTION.conditions.values()
        ]
        traces = smc.run(scenarios)
        for i, one in enumerate(drawn):
            pair = zip(PREDICTION.conditions, traces[2 * i : 2 * i + 2], strict=True)
            worst = max(distance(PREDICTION.figures(trace), condition) for condition, trace in pair)
            found.append((worst if math.isfinite(worst) else math.inf, one))
        print(f"{first + len(drawn)} of {count}, {sum(worst <= 1.0 for worst, _ in found)} within", file=sys.stderr)
    for worst, one in sorted(found, key=lambda each: each[0])[:KEPT]:
        values = ", ".join(f"{float(f'{one[name]:.4g}')!r}" for name in NAMES)
        print(f"    ({values}),  # {worst:.2f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
