"""Parameter sets of the rig stepper_furuta: draws whose simulated recordings have the linear law's recorded figures.

    python benchmarks/stepper_furuta.py           # 400 draws, 9 minutes of one core; prints the ensemble
    python benchmarks/stepper_furuta.py 20        # 20 draws of each round at most

The rule was fixed before it was run. Approximate Bayesian computation in two rounds: the machine is bursty, so its
one recording of a condition is one draw from a distribution, and each draw of the quantities is run once from its own
seed, in both recorded conditions. The distance of its figures from the recorded ones is counted in the standard
deviations that these figures have over seeds, so that a figure counts as much as it tells. The first round draws from
the prior, the second about the nearest of it.

The nearest are so by luck too. So TRIED of them are run again, from SEEDS new seeds, and accepted if nothing falls, if
the recorded rms of alpha in the hold is within the 5 to 95 % of its seeds, and if it rests there for at least half of
the time, in the median. Of the accepted ones those whose medians are nearest are the ensemble. No figure of another law
is looked at.
"""

import math
import sys

import numpy as np

import smc_mujoco as smc
from smc_mujoco.evidence.rigs.machines.stepper_furuta import NAMES, PREDICTION
from smc_mujoco.evidence.rigs.predictions import percentiles

ROUNDS = {21: 240, 22: 160}  # seed -> draws
BATCH, NEAR, TRIED, SEEDS, KEPT = 10, 24, 16, 8, 8
INERTIA = 1.0215e-4  # kg m^2, of the pendulum by formula: ten percent to either side
PRIOR = {  # ends; True for a logarithmic prior
    "holding_torque": (0.08, 0.5, True), "arm_damping": (0.004, 0.04, True), "arm_friction": (5e-4, 0.010, True),
    "pivot_friction": (5e-5, 2e-4, False), "pivot_damping": (1e-5, 4e-4, True),
    "upright_error": (-0.02, 0.02, False), "sensor_noise": (5e-5, 6e-4, True), "vibration": (2e-4, 8e-3, True),
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


def distance(figures):
    """Return the rms deviation of condition -> figures from the recorded ones, in spreads."""
    apart = []
    for condition, spreads in SPREADS.items():
        found, recorded = figures[condition], PREDICTION.recorded[condition]
        for name, spread in spreads.items():
            off = found[name] - recorded[name] if name in LINEAR else math.log(max(found[name], 1e-3) / recorded[name])
            apart.append(off / spread)
    squares = float(np.mean(np.square(apart)))
    return math.sqrt(squares) if math.isfinite(squares) else math.inf


def recordings(sets, seeds):
    """Return condition -> the figures of a recording from each seed, for each set of shares; `seeds`: of each set."""
    rig = smc.rig("stepper_furuta")
    scenarios = [
        rig.with_values(quantities(one), "drawn").scenario(x0=PREDICTION.start(seed), seed=seed, **fields)
        for one, own in zip(sets, seeds, strict=True)
        for fields in PREDICTION.conditions.values()
        for seed in own
    ]
    found = iter([PREDICTION.figures(trace) for trace in smc.run(scenarios)])
    return [{name: [next(found) for _ in own] for name in PREDICTION.conditions} for own in seeds]


def fallen(recorded):
    """Return whether any of condition -> figures of runs fell."""
    return any(PREDICTION.fallen(run) for runs in recorded.values() for run in runs)


def explored(most):
    """Return (distance, shares) of every draw of all rounds, the nearest first."""
    found = []
    for seed, draws in ROUNDS.items():
        random, nearest = np.random.default_rng(seed), np.array([shares for _, shares in found[:NEAR]])
        for first in range(0, min(draws, most), BATCH):
            drawn = [about(nearest, random) if len(nearest) else random.random(len(PRIOR)) for _ in range(BATCH)]
            seeds = [[100_000 * seed + number] for number in range(first, first + BATCH)]
            for one, recorded in zip(drawn, recordings(drawn, seeds), strict=True):
                apart = {name: runs[0] for name, runs in recorded.items()}
                found.append((math.inf if fallen(recorded) else distance(apart), one))
            print(f"round {seed}: {first + BATCH} of {draws}", file=sys.stderr)
        found.sort(key=lambda each: each[0])
        print(f"round {seed}: the nearest are {found[0][0]:.2f} to {found[NEAR - 1][0]:.2f} away", file=sys.stderr)
    return found


def accepted(shares, number):
    """Return how far a set's medians over new seeds are from the recorded figures; inf if it is refused."""
    recorded = recordings([shares], [range(1_000 * number, 1_000 * number + SEEDS)])[0]
    figures = {name: {key: np.array([run[key] for run in runs]) for key in runs[0]} for name, runs in recorded.items()}
    hold = figures["hold"]
    _, low, high = percentiles(hold["alpha_rms"])
    inside = low <= PREDICTION.recorded["hold"]["alpha_rms"] <= high
    apart = distance({name: {key: np.nanmedian(values) for key, values in of.items()} for name, of in figures.items()})
    rests = np.median(hold["resting"])
    print(f"tried {number}: {apart:.2f}, {low:.3f} to {high:.3f}, rests {rests:.2f}", file=sys.stderr)
    return apart if inside and rests >= 0.5 and not fallen(recorded) else math.inf


def main(most):
    tried = [(accepted(shares, number), shares) for number, (_, shares) in enumerate(explored(most)[:TRIED], 1)]
    passed = sorted((each for each in tried if each[0] < math.inf), key=lambda each: each[0])
    for apart, shares in passed[:KEPT]:
        found = quantities(shares)
        values = ", ".join(f"{float(f'{found[name]:.4g}')!r}" for name in NAMES)
        print(f"    ({values}),  # {apart:.2f}")
    print(f"{len(passed)} of {len(tried)} accepted")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
