"""Which parts of mechanisms have scores that are right at the default physics step, and which
scores the marks find.

    python benchmarks/steps.py [PART ...]

Three plants x the four laws of the paper's study x five scores make 60 scores a part, of runs of 4
s. A score is off if it is apart from that at an eighth of the step, by the rule of
`smc_mujoco/analysis/apart.py`; it is marked if it is apart from that at half the step or from a
nudged start, as in scenes; it wanders if the nudge alone does that. The script prints the table
that docs/design.md sums up. It takes 40 s of processor time.
"""

import dataclasses
import sys

from smc_mujoco.analysis.apart import apart, relative_range
from smc_mujoco.analysis.paired_runs import floor
from smc_mujoco.analysis.step_halving import first_order, halved, nudged
from smc_mujoco.common.text import number
from smc_mujoco.evidence.papers.gaber import scenarios as paper
from smc_mujoco.metrics.catalogue import score
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
DURATION = 4.0  # s


def finest(scenario: Scenario) -> Scenario:
    """Return the same scenario at an eighth of its physics step."""
    return halved(halved(halved(scenario)))


def row(part: str) -> str:
    """Return the line of a part in the table."""
    made = [
        dataclasses.replace(one, duration=DURATION)
        for one in grid(PLANTS, paper.LAWS, part, 1, gains="study")
    ]
    same, halves, moved, fine = (
        [score(trace) for trace in run([change(one) for one in made])]
        for change in (lambda one: one, halved, nudged, finest)
    )
    off = 0
    marked = 0
    wandering = 0
    found = 0
    errors = [0.0]
    laws = set()
    order = first_order(made[0])
    for scenario, *its in zip(made, same, halves, moved, fine, strict=True):
        for name in SCORES:
            (value, half, nudge, truth), least = (one[name] for one in its), floor(scenario, name)
            wrong = apart((value, truth), least)
            mark = apart((value, half, nudge), least, order)
            off, marked, found = off + wrong, marked + mark, found + (wrong and mark)
            wandering += apart((value, nudge), least)
            errors.append(relative_range((value, truth), least))
            laws |= {scenario.law.name} if wrong else set()
    resolved = made[0].resolved
    step = f"{resolved.integrator}, {1e3 * resolved.physics_step:g} ms"
    if max(errors) <= 10.0:
        worst = f"{number(100 * max(errors), 2)} %"
    else:
        worst = "> 1000 %"
    counts = f"{off} | {found} | {marked} | {wandering}"
    return f"| {part} | {step} | {counts} | {worst} | {', '.join(sorted(laws))} |"


def main() -> None:
    """Print the table."""
    print(
        "| part | step | off, of 60 | of them marked | marked | wander | largest change | laws "
        "with scores off |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for part in sys.argv[1:] or PARTS:
        print(row(part), flush=True)


if __name__ == "__main__":
    main()
