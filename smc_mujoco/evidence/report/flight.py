"""Flight in a report: who holds a quadrotor where, in the median and in the worst run."""

import dataclasses
import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

from smc_mujoco.analysis import paired_runs
from smc_mujoco.control import gain_sets
from smc_mujoco.control.law import laws
from smc_mujoco.draw import dot_plot
from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.films import WIDTH, picture
from smc_mujoco.evidence.report.plan import GAINS, Work
from smc_mujoco.mechanisms.plant import plant
from smc_mujoco.simulation.conditions import Condition, find_condition
from smc_mujoco.simulation.grid import grid
from smc_mujoco.simulation.signals import Constant, Dryden, Noise, Sine, Wind
from smc_mujoco.studies.board import Board
from smc_mujoco.studies.leaderboard import leaderboard
from smc_mujoco.studies.study import study
from smc_mujoco.studies.table import Table

PLANT, METRIC, DURATION = "quadrotor", "ultimate_bound", 6.0  # s
W = 6.2832 / 4.0  # rad/s, of a figure of eight in 4 s
EIGHT = (Sine(1.0, W), Sine(0.5, 2.0 * W), Constant(1.0), *[Constant(0.0)] * 3)
CONDITIONS: dict[str, dict[str, Any]] = {
    "noise of 10 mm and 50 mm/s": {"noise": Noise(0.01, 0.05)},
    "delay of 5 ms": {"input_delay": 5e-3},
    "steady wind of 3 m/s": {"disturbance": Wind(3.0)},
    "gust of 6 m/s for 1 s": {"disturbance": Wind(6.0, time=4.5, width=1.0)},
    "turbulence on 3 m/s": {"disturbance": (Wind(3.0), Dryden(15.0, speed=3.0))},
    "payload of 19 %": {"mismatch": {"payload": 0.006}},
    "weak battery": {"mismatch": {"sag": 0.32}},
    "a rotor loses 20 %": {"mismatch": {"fade": 0.2}},
    "rotors with a lag of 0.1 s": {"mismatch": {"rise": 0.625, "fall": 0.625}},
    "figure of eight in 4 s": {"reference": EIGHT, "v0": (W, W, 0.0, 0.0, 0.0, 0.0)},
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Flight:
    """Laws of flight compared over conditions."""

    board: Board  # of the ultimate bound, whose blocks are the conditions
    worst: Mapping[
        tuple[str, str], float
    ]  # condition and law -> the largest of its runs, m; inf for one that fails
    medians: bytes  # SVG
    gains: str  # "tuned" or "default"

    @property
    def laws(self) -> list[str]:
        """The laws, by name."""
        return sorted(entry.law for entry in self.board.entries)

    def sentence(self) -> str:
        """Return who is unbeaten how often, in the median, and whose worst run is the smallest how
        often.
        """
        count = len(self.board.blocks)
        blocks = self.board.blocks
        unbeaten = [law for law in self.laws for block in blocks if law in block.best]
        least = [
            min(self.laws, key=lambda law: self.worst[block.condition, law]) for block in blocks
        ]
        told, calm = (
            ", ".join(f"{words.law(law)} in {n}" for law, n in Counter(sorted(laws)).most_common())
            for laws in (unbeaten, least)
        )
        return f"Of {count} conditions these laws are unbeaten: {told or 'none'}. The smallest worst run is of: {calm}."


def condition(name: str) -> Condition:
    """Return a condition of flight by its name."""
    if name in CONDITIONS:
        return Condition(name, CONDITIONS[name])
    return find_condition(name)


def flight(work: Work) -> Flight:
    """Return the comparison of all laws of flight, with tuned gains where all have some, else with
    default ones.
    """
    plan = work.plan
    drone = plant(PLANT)
    names = [name for name in laws(drone) if name != "none"]
    conditions = plan.flights or ("nominal", *CONDITIONS)
    if all(gain_sets.in_set(drone, name, GAINS) for name in names):
        gains = GAINS
    else:
        gains = "default"
    runs = grid(
        drone, names, [condition(name) for name in conditions], plan.flight_seeds, gains, DURATION
    )
    with work.bars.stage("flight", f"{len(runs)} runs", bar=False):
        table = study(runs, work.folder / "flight", threads=work.threads, progress=work.bars.shown)
    (board,) = leaderboard(table, (METRIC,), relevant=plan.relevant)
    size = WIDTH, 1.3 + dot_plot.LINE_HEIGHT * (len(names) + 1) * len(conditions)
    drawn = picture(
        lambda path: dot_plot.plot(
            table, path, (METRIC, "tv_rate"), "Flight: medians", size, format="svg"
        )
    )
    return Flight(board=board, worst=worst(table), medians=drawn, gains=gains)


def worst(table: Table) -> dict[tuple[str, str], float]:
    """Return condition and law -> the largest ultimate bound of its runs, m; inf where one fails."""
    found: dict[tuple[str, str], float] = {}
    columns = (table.column(name).tolist() for name in ("condition", "law"))
    for *cell, value in zip(*columns, paired_runs.values(table, METRIC).tolist(), strict=True):
        key = cell[0], cell[1]
        found[key] = max(found.get(key, 0.0), math.inf if math.isnan(value) else value)
    return found
