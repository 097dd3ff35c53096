"""How well laws of many joints hold a seven-joint arm's tip on its path: medians with 95 % intervals over seeds.

    python benchmarks/arm_study.py [--quick] [--search]

The arm has the friction identified on a real Panda and 2 kg of payload, of which no law knows. Seeds are starts within
0.05 rad and noise, the same for each law. --search repeats the search of all gains first, and prints what it finds.
"""

import sys

import numpy as np

import smc_mujoco as smc
from smc_mujoco.analysis.bootstrap import median_of
from smc_mujoco.studies import arms

SEEDS = range(1, 4 if "--quick" in sys.argv else 13)
PAYLOAD = 2.0  # kg
COLUMNS = ("tip rms, mm", "tip at the end, mm", "worst joint, mrad", "TV rate, N m/s", "most work, J")


def measured(trace: smc.Trace) -> tuple[float, ...]:
    """The numbers of a run, NaN for one that failed."""
    if trace.failure is not None:
        return (float("nan"),) * len(COLUMNS)
    tip, joints = smc.metrics.tip_scores(trace), smc.metrics.joint_scores(trace).values()
    bound, rate, work = (max(scores[name] for scores in joints) for name in ("ultimate_bound", "tv_rate", "work"))
    return 1e3 * tip["rms_error"], 1e3 * tip["last_error"], 1e3 * bound, rate, work


def row(name: str, values: np.ndarray) -> str:
    """A line of the table: median and interval of each column."""
    cells = []
    for each in values.T:
        median, low, high, _ = median_of(np.sort(each)[None])
        cells.append(f"{median:.3g} [{low:.3g}, {high:.3g}]")
    return f"| {name} | {' | '.join(cells)} |"


def main() -> None:
    """Print the tables."""
    if "--search" in sys.argv:
        for name in arms.RANGES:
            print(name, *arms.search(name), flush=True)
    for task, payload in (("sway", PAYLOAD), ("payload", 0.0), ("blow", PAYLOAD)):
        print(f"\n{task}, {len(SEEDS)} seeds\n\n| law | {' | '.join(COLUMNS)} |\n|---|{'---|' * len(COLUMNS)}")
        for name in arms.GAINS:
            runs = [arms.scenario(task, arms.gained(name), seed, payload) for seed in SEEDS]
            traces = smc.run(runs)
            if arms.unstable(runs, traces):
                print(f"| {name} | {' | '.join(['unstable'] * len(COLUMNS))} |", flush=True)
            else:
                print(row(name, np.array([measured(trace) for trace in traces])), flush=True)
    print("\nwall\n\n| law | mean force, N | off the wanted force, % | in contact, % of the time | deepest, mm |")
    print("|---|---|---|---|---|")
    laws = {"hybrid": arms.hybrid(), "hybrid, friction known": arms.hybrid(friction=True)}
    for name, law in laws.items():
        runs = smc.run([arms.scenario("wall", law, seed) for seed in SEEDS])
        found = np.array(
            [
                [one["mean_force"], one["force_error"], one["touching"], 1e3 * one["depth"]]
                for one in (smc.metrics.tip_scores(trace) for trace in runs)
            ]
        )
        print(row(name, found), flush=True)


if __name__ == "__main__":
    main()
