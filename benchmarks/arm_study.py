"""How well laws of many joints hold a seven-joint arm's tip on its path: medians with 95 %
intervals over seeds.

    python benchmarks/arm_study.py [--quick] [--search]

The arm has the friction identified on a real Panda and 2 kg of payload, of which no law knows.
Seeds are starts within 0.05 rad and noise, the same for each law. --search repeats the search of
all gains first, and prints what it finds.
"""

import dataclasses
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

import smc_mujoco as smc
from smc_mujoco.analysis.bootstrap import median_of

sys.path.append(str(Path(__file__).parents[1] / "scenes"))
import arms

SEEDS = range(1, 4 if "--quick" in sys.argv else 13)
PAYLOAD = 2.0  # kg
# N m/s: TV rate of u that doubles the cost of a draw; chosen before any search
ROUGH_TV_RATE = 1000.0
SEARCH_PAYLOAD = 1.0  # kg
SEARCH_SEED = 1000
# relative change of an error with half the physics step; more means unstable; chosen
MAX_STEP_CHANGE = 0.1
COLUMNS = (
    "tip rms, mm",
    "tip at the end, mm",
    "worst joint, mrad",
    "TV rate, N m/s",
    "most work, J",
)

# Law -> gain -> range of the search. For a gain in BY_LIMIT or BY_INERTIA, the range is that of its
# factor.
RANGES: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "computed_torque_sliding": {"c": (3.0, 40.0), "k": (3.0, 300.0), "width": (0.03, 1.0)},
    "super_twisting_computed_torque": {"c": (3.0, 40.0), "k1": (1.0, 40.0), "k2": (1.0, 400.0)},
    "unit_vector": {"c": (3.0, 40.0), "rho": (3.0, 300.0), "eps": (0.03, 3.0)},
    "passivity_based": {
        "c": (3.0, 40.0),
        "K": (0.01, 1.0),
        "k": (0.003, 0.3),
        "width": (0.03, 1.0),
    },
    "time_delay_sliding": {
        "c": (3.0, 40.0),
        "k": (3.0, 300.0),
        "width": (0.03, 1.0),
        "m": (0.03, 1.0),
    },
    "observer_free_joint": {"k1": (3.0, 40.0), "lam": (0.1, 1.0)},
    "adrc_computed_torque": {"wc": (3.0, 40.0), "w": (10.0, 400.0)},
    "pd_observer_computed_torque": {"wc": (3.0, 40.0), "l": (3.0, 400.0)},
    "lqi_computed_torque": {"q0": (1e2, 1e9), "q1": (1e2, 3e6), "q2": (1.0, 6e3)},
}


def unstable(scenarios: Sequence[smc.Scenario], traces: Sequence[smc.Trace]) -> bool:
    """Return whether half the physics step changes the tip's rms error by over MAX_STEP_CHANGE, in
    the median run.
    """
    halves = [dataclasses.replace(s, physics_step=s.resolved.physics_step / 2.0) for s in scenarios]
    errors, finer = (
        np.array(
            [
                smc.metrics.tip_scores(trace)["rms_error"] if trace.failure is None else math.inf
                for trace in runs
            ]
        )
        for runs in (traces, smc.run(halves))
    )
    change = np.abs(finer / errors - 1.0)  # NaN where both fail, which counts as a change
    return not np.median(change) <= MAX_STEP_CHANGE


def cost(trace: smc.Trace) -> float:
    """Return the cost of the search: the tip's rms error, mm, times 1 + variation of u /
    ROUGH_TV_RATE.
    """
    if trace.failure is not None:
        return math.inf
    return (
        1e3
        * smc.metrics.tip_scores(trace)["rms_error"]
        * (1.0 + smc.score(trace)["tv_rate"] / ROUGH_TV_RATE)
    )


def search(name: str, draws: int = arms.DRAWS) -> tuple[dict[str, float], float]:
    """Return the best of random gains of a law, uniform in their logarithms, of two digits, and
    their cost.
    """
    rng = np.random.default_rng(SEARCH_SEED)
    ranges = RANGES[name]
    tried = []
    for _ in range(draws):
        tried.append(
            {
                gain: float(f"{math.exp(rng.uniform(*np.log(bounds))):.2g}")
                for gain, bounds in ranges.items()
            }
        )
    scenarios = []
    for gains in tried:
        scenarios.append(
            arms.scenario("sway", arms.gained(name, gains), SEARCH_SEED, SEARCH_PAYLOAD)
        )
    costs = [cost(trace) for trace in smc.run(scenarios)]
    best = int(np.argmin(costs))
    return tried[best], costs[best]


def measured(trace: smc.Trace) -> tuple[float, ...]:
    """The numbers of a run, NaN for one that failed."""
    if trace.failure is not None:
        return (float("nan"),) * len(COLUMNS)
    tip = smc.metrics.tip_scores(trace)
    joints = smc.metrics.joint_scores(trace).values()
    bound, rate, work = (
        max(scores[name] for scores in joints) for name in ("ultimate_bound", "tv_rate", "work")
    )
    return 1e3 * tip["rms_error"], 1e3 * tip["last_error"], 1e3 * bound, rate, work


def row(name: str, values: np.ndarray) -> str:
    """A line of the table: median and interval of each column."""
    cells = []
    for column in values.T:
        median, low, high, _ = median_of(np.sort(column)[None])
        cells.append(f"{median:.3g} [{low:.3g}, {high:.3g}]")
    return f"| {name} | {' | '.join(cells)} |"


def main() -> None:
    """Print the tables."""
    if "--search" in sys.argv:
        for name in RANGES:
            print(name, *search(name), flush=True)
    for task, payload in (("sway", PAYLOAD), ("payload", 0.0), ("blow", PAYLOAD)):
        print(
            f"\n{task}, {len(SEEDS)} seeds\n\n| law | {' | '.join(COLUMNS)} "
            f"|\n|---|{'---|' * len(COLUMNS)}"
        )
        for name in arms.GAINS:
            runs = [arms.scenario(task, arms.gained(name), seed, payload) for seed in SEEDS]
            traces = smc.run(runs)
            if unstable(runs, traces):
                print(f"| {name} | {' | '.join(['unstable'] * len(COLUMNS))} |", flush=True)
            else:
                print(row(name, np.array([measured(trace) for trace in traces])), flush=True)
    print(
        "\nwall\n\n| law | mean force, N | off the wanted force, % | in contact, % of the time "
        "| deepest, mm |"
    )
    print("|---|---|---|---|---|")
    laws = {"hybrid": arms.hybrid(), "hybrid, friction known": arms.hybrid(friction=True)}
    for name, law in laws.items():
        runs = smc.run([arms.scenario("wall", law, seed) for seed in SEEDS])
        scores = np.array(
            [
                [tip["mean_force"], tip["force_error"], tip["touching"], 1e3 * tip["depth"]]
                for tip in (smc.metrics.tip_scores(trace) for trace in runs)
            ]
        )
        print(row(name, scores), flush=True)


if __name__ == "__main__":
    main()
