"""Which parts of mechanisms have scores that are right at the default physics step, and which
scores the marks find.

    python benchmarks/steps.py [--other] [PART ...]

Three plants x the four laws of the paper's study, or eight `--other` laws, x five scores, of runs
of 4 s. A score is off if it is apart from that at an eighth of the step, by the rule of
`smc_mujoco/analysis/differ.py`; it is marked if it is apart from those of the runs' repetitions, as
in scenes; it wanders if a nudged start alone does that. The script prints the tables that
docs/design.md sums up. They take two minutes of processor time.
"""

import dataclasses
import sys
from collections.abc import Sequence

from smc_mujoco.analysis.differ import differ, relative_range
from smc_mujoco.analysis.paired_runs import floor
from smc_mujoco.analysis.step_halving import first_order, halved, repetitions
from smc_mujoco.common.text import number
from smc_mujoco.metrics.catalogue import score
from smc_mujoco.simulation import gaber_study as paper
from smc_mujoco.simulation.grid import grid
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario

PARTS = (
    "nominal",
    "lag_20ms",
    "dc_motor",
    "coulomb",
    "encoder",
    "friction",
    "contact",
    "lugre",
    "backlash",
)
PLANTS = ("inverted_pendulum", "duffing", "van_der_pol")
SCORES = ("settling_time", "rms_error", "ultimate_bound", "steady_error", "tv_rate")
OTHER = (
    "twisting",
    "terminal",
    "quasi_continuous",
    "implicit_super_twisting",
    "suboptimal",
    "adrc",
    "integral",
    "continuous_twisting",
)
DURATION = 4.0  # s


def finest(scenario: Scenario) -> Scenario:
    """Return the same scenario at an eighth of its physics step."""
    return halved(halved(halved(scenario)))


def row(part: str, laws: Sequence[str], gains: str) -> str:
    """Return the line of a part in the table."""
    made = []
    for scenario in grid(PLANTS, laws, part, 1, gains=gains):
        made.append(dataclasses.replace(scenario, duration=DURATION))
    traces = run(made)
    fine = run([finest(scenario) for scenario in made])
    off = 0
    marked = 0
    wandering = 0
    found = 0
    runs = 0
    errors = [0.0]
    wrong_laws = set()
    for trace, truth in zip(traces, fine, strict=True):
        scenario = trace.scenario
        order = first_order(scenario)
        again = run(repetitions(trace))
        for same in (trace, *again):
            runs += scenario.resolved.physics_step / same.scenario.resolved.physics_step
        scores = [score(same) for same in (trace, *again)]
        right = score(truth)
        for name in SCORES:
            least = floor(scenario, name)
            values = [of_run[name] for of_run in scores]
            wrong = differ((values[0], right[name]), least)
            mark = differ(values, least, order)
            off += wrong
            marked += mark
            found += wrong and mark
            wandering += differ((values[0], values[2]), least)
            errors.append(relative_range((values[0], right[name]), least))
            if wrong:
                wrong_laws.add(scenario.law.name)
    resolved = made[0].resolved
    step = f"{resolved.integrator}, {1e3 * resolved.physics_step:g} ms"
    if max(errors) <= 10.0:
        worst = f"{number(100 * max(errors), 2)} %"
    else:
        worst = "> 1000 %"
    counts = f"{len(made) * len(SCORES)} | {off} | {found} | {marked} | {wandering}"
    cost = runs / len(made)
    names = ", ".join(sorted(wrong_laws))
    return f"| {part} | {step} | {counts} | {worst} | {cost:.1f} | {names} |"


def main() -> None:
    """Print the table."""
    print("| part | step | scores | off | found | marked | wander | largest | cost | laws off |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    parts = sys.argv[1:]
    laws = paper.LAWS
    gains = "study"
    if "--other" in parts:
        parts.remove("--other")
        laws = OTHER
        gains = "tuned"
    for part in parts or PARTS:
        print(row(part, laws, gains), flush=True)


if __name__ == "__main__":
    main()
