"""Parameter sets of the rig stepper_furuta: draws whose simulated recordings have the linear law's recorded figures.

    python benchmarks/stepper_furuta.py           # 780 draws, 12 minutes of one core; prints the ensemble
    python benchmarks/stepper_furuta.py 20        # 20 draws of each seed at most

Approximate Bayesian computation in two rounds. The machine is bursty, so its one recording of a condition is one draw
from a distribution: each draw of the quantities is run once from its own seed, in both recorded conditions. The
distance of its figures from the recorded ones is counted in the standard deviations that these figures have over seeds,
so that a figure counts as much as it tells: the largest of them, of a second of the hold, may differ by a factor of
three by chance alone. The first round draws from the prior, the second about the nearest of the first. The nearest of
both rounds are the ensemble. No figure of another law is looked at.
"""

import math
import sys

import numpy as np

import smc_mujoco as smc
from smc_mujoco.evidence.rigs.machines.stepper_furuta import NAMES, PREDICTION

FIRST, SECOND = {11: 230, 12: 130, 13: 180}, {14: 240}  # seed -> draws
BATCH, NEAR, KEPT = 10, 24, 8
INERTIA = 1.0215e-4  # kg m^2, of the pendulum by formula: ten percent to either side
PRIOR = {  # ends; True for a logarithmic prior
    "holding_torque": (0.08, 0.5, True), "arm_damping": (0.004, 0.04, True), "arm_friction": (0.0, 0.010, False),
    "pivot_friction": (5e-5, 1.5e-4, False), "pivot_damping": (1e-6, 1.5e-4, True),
    "upright_error": (-0.006, 0.006, False), "sensor_noise": (5e-5, 6e-4, True), "vibration": (2e-4, 8e-3, True),
    "pendulum_inertia": (0.9 * INERTIA, 1.1 * INERTIA, True),
}  # fmt: skip
SPREADS = {  # of figures over eight seeds, the mean over eight sets of an earlier search: of logarithms, but for LINEAR
    "hold": {
        "alpha_rms": 0.466, "second_50": 0.967, "second_90": 1.03, "resting": 0.0916, "resting_90": 0.376,
        "running": 0.789, "theta_std": 0.681, "ratio": 0.153, "gain": 0.12, "lag": 16.6, "phase": 1.93,
        "centroid": 0.027,
    },
    "nudges": {
        "alpha_rms": 0.157, "second_25": 0.91, "second_90": 0.155, "running": 0.151, "theta_std": 0.045,
        "acceleration_rms": 0.152, "ratio": 0.0518, "gain": 0.0933, "lag": 5.31, "phase": 0.507, "centroid":
        0.0419,
    },
}  # fmt: skip
LINEAR = {"lag", "phase", "resting"}  # degrees, and the share of time
KERNEL = 0.5  # of the spread of the nearest, in shares of the prior: how far the second round goes about them


def quantities(shares):
    """Return quantities at shares of the prior, 0 to 1 each."""
    ends = zip(PRIOR.items(), shares, strict=True)
    return {
        name: low * (high / low) ** share if logarithmic else low + (high - low) * share
        for (name, (low, high, logarithmic)), share in ends
    }


def about(nearest, random):
    """Return a draw about one of the nearest, (NEAR, Q), within the prior."""
    while True:
        shares = nearest[random.integers(len(nearest))] + KERNEL * nearest.std(axis=0) * random.standard_normal(
            len(PRIOR)
        )
        if ((shares >= 0.0) & (shares <= 1.0)).all():
            return shares


def distance(found, condition):
    """Return the sum of squared deviations of a run's figures from a condition's recorded ones, and their number."""
    recorded, total = PREDICTION.recorded[condition], 0.0
    for name, spread in SPREADS[condition].items():
        apart = found[name] - recorded[name] if name in LINEAR else math.log(max(found[name], 1e-3) / recorded[name])
        total += (apart / spread) ** 2
    return total if math.isfinite(total) and not PREDICTION.fallen(found) else math.inf


def explored(seeds, draw, most):
    """Return (distance, shares) of every draw of the seeds; `draw`: function of a generator."""
    rig, found = smc.rig("stepper_furuta"), []
    count = sum(map(len, SPREADS.values()))
    for seed, draws in seeds.items():
        random = np.random.default_rng(seed)
        for first in range(0, min(draws, most), BATCH):
            drawn = [draw(random) for _ in range(BATCH)]
            scenarios = [
                rig.with_values(quantities(one), "drawn").scenario(x0=PREDICTION.start(number), seed=number, **fields)
                for number, one in enumerate(drawn, 100_000 * seed + first)
                for fields in PREDICTION.conditions.values()
            ]
            traces = iter(smc.run(scenarios))
            for one in drawn:
                squares = sum(distance(PREDICTION.figures(next(traces)), name) for name in PREDICTION.conditions)
                found.append((math.sqrt(squares / count), one))
            print(f"seed {seed}: {first + BATCH} of {draws}", file=sys.stderr)
    return sorted(found, key=lambda each: each[0])


def main(most):
    first = explored(FIRST, lambda random: random.random(len(PRIOR)), most)
    nearest = np.array([shares for _, shares in first[:NEAR]])
    both = sorted([*first, *explored(SECOND, lambda random: about(nearest, random), most)], key=lambda each: each[0])
    for apart, shares in both[:KEPT]:
        found = quantities(shares)
        values = ", ".join(f"{float(f'{found[name]:.4g}')!r}" for name in NAMES)
        print(f"    ({values}),  # {apart:.2f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
