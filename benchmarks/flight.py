"""Which law of flight is first where, on the quadrotor: a table in docs/flight.md.

    python benchmarks/flight.py [--seeds 24] [--tuned | --twins] [--out FOLDER]

Every law has its default gains, or with --tuned those that the same searches find for it, which
takes an hour and a half of processor time. Runs start within 0.2 m and 0.2 rad, in each number, of
the plant's own start beside a hover, and last 6 s. No law is told what a row changes. With --twins
two sliding laws stand beside the same law without what is sliding or adaptive in it.

The measure is the ultimate bound: the largest error along x, y or z, from the place or from the
path, in the last fifth of a run. Below the table, sliding mode against its rivals: the ratio of the
families' scores, run by run, with its 95 % interval; a family's law is chosen by the other half of
the runs.
"""

import argparse
import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

import smc_mujoco as smc
from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.ranking import linked
from smc_mujoco.analysis.signed_rank import interval
from smc_mujoco.control.law import Law
from smc_mujoco.simulation.signals import Constant, Dryden, Noise, Sine, Wind
from smc_mujoco.studies.table import Table

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

FAMILIES = {
    "sliding": ("quaternion_sliding", "adaptive_quaternion_sliding", "super_twisting_attitude"),
    "rivals": ("geometric", "cascaded_pid", "indi_attitude", "adrc_attitude"),
}
DRONE = smc.plant("quadrotor")
MEASURE = "ultimate_bound"
ERROR = 0.025  # beyond each end of an interval


class Lead(NamedTuple):
    """The lead of the first family over the second in a cell, a plant in a condition."""

    plant: str
    condition: str
    first: str  # family
    second: str
    times: float  # the second's score over the first's
    low: float
    high: float
    laws: tuple[str, ...]  # of the first family: of both halves of the runs

    @property
    def sure(self) -> bool:
        """Whether the interval leaves no doubt of which of the two is better."""
        return self.low > 1.0


def chosen_by_halves(values: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """Return a family's score in each run, of the law that the other half of the runs chose, and
    both laws.

    `values`: (laws, runs).
    """
    scores = np.empty(values.shape[1])
    best = []
    for half in (0, 1):
        best.append(int(np.median(values[:, 1 - half :: 2], axis=1).argmin()))
        scores[half::2] = values[best[-1], half::2]
    return scores, best


def lead(
    scores: Mapping[str, np.ndarray],
    sets: Mapping[str, np.ndarray],
    floor: float,
    families: Mapping[str, Sequence[str]],
) -> Lead | None:
    """Return the lead in a cell; None with fewer than two families, or two runs.

    Scores: law -> (runs,).
    """
    members = {family: [law for law in laws if law in scores] for family, laws in families.items()}
    members = {family: laws for family, laws in members.items() if laws}
    if len(members) < 2 or len(next(iter(scores.values()))) < 2:
        return None
    by_family = {
        family: chosen_by_halves(np.maximum([scores[law] for law in laws], floor))
        for family, laws in members.items()
    }
    first, second = sorted(by_family, key=lambda family: float(np.median(by_family[family][0])))[:2]
    with np.errstate(invalid="ignore"):
        ratios = np.log(by_family[second][0]) - np.log(by_family[first][0])  # NaN where both fail
    labels = linked(*sets.values()) or tuple(range(len(ratios)))
    with np.errstate(invalid="ignore"):
        samples = [ratios[np.equal(labels, label)].mean() for label in dict.fromkeys(labels)]
    times, low, high = map(math.exp, interval(np.array(samples), ERROR))
    laws = tuple(dict.fromkeys(members[first][i] for i in by_family[first][1]))
    return Lead("", "", first, second, times, low, high, laws)


def leads(table: Table, metric: str, families: Mapping[str, Sequence[str]]) -> tuple[Lead, ...]:
    """Return the lead in every cell of a study's table that has one; families: name -> names of
    laws.
    """
    lead_rows = []
    by_row = paired_runs.by_row(table, metric)
    for group in paired_runs.groups(table, by=("plant", "condition")):
        ((plant, condition),) = group.blocks
        (ran,) = paired_runs.scenarios(table, group)
        if not (scored := group.scores(by_row)).values:
            continue
        has_value = ~np.isnan(np.array([row[0] for row in scored.values.values()])).any(axis=0)
        values, sets = (
            {law: row[0][has_value] for law, row in columns.items()}
            for columns in (scored.values, scored.sets)
        )
        if lead_row := lead(values, sets, paired_runs.floor(ran, metric), families):
            lead_rows.append(lead_row._replace(plant=plant, condition=condition))
    return tuple(lead_rows)


def conditions() -> list[Any]:
    """Return the conditions, with the names of their rows; the first is the suite's own."""
    return ["nominal", *(smc.condition(name, **fields) for name, fields in CONDITIONS.items())]


def twins() -> list[Law]:
    """Return two laws with their default gains, and each without its idea.

    `quaternion_sliding` has a line of the same slope in place of each tanh, which below 90 degrees
    is `geometric` to a few per cent. The adaptive law keeps the gain that it starts with.
    """
    sliding, adaptive = (
        smc.law(name) for name in ("quaternion_sliding", "adaptive_quaternion_sliding")
    )
    gains = SimpleNamespace(**sliding.gains)
    line = {"kx": gains.Kx * gains.rhox * gains.c, "kv": gains.c + gains.Kx * gains.rhox}
    line |= {"kR": gains.K * gains.rho * gains.lam / 2, "kW": gains.K * gains.rho + gains.lam / 2}
    still = smc.law("adaptive_quaternion_sliding", Gx=0, mux=0, G=0, mu=0)
    as_they_are = [smc.law(law.name, **law.gains) for law in (sliding, adaptive)]
    return [
        as_they_are[0],
        smc.law("geometric", **line).named("its line"),
        as_they_are[1],
        still.named("its K fixed"),
    ]


def rows(boards: Sequence[Any], laws: Sequence[str]) -> Iterator[str]:
    """Yield the rows of a Markdown table: medians in mm, between stars where no law is better."""
    heads = [law.replace("_", " ") for law in laws]  # so that they wrap
    yield f"| {' | '.join(['condition', *heads])} |\n|{'---|' * (len(laws) + 1)}"
    for block in (block for board in boards if board.metric == MEASURE for block in board.blocks):
        cells = []
        for law in laws:
            mark = "*" if law in block.best else ""
            cells.append(
                "falls"
                if block.lacking.get(law)
                else f"{mark}{float(format(1e3 * block.medians[law], '.3g')):g}{mark}"
            )
        yield f"| {' | '.join([block.condition, *cells])} |"


def main() -> None:
    """Run, and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=24, help="runs of a law in a condition")
    parser.add_argument(
        "--tuned", action="store_true", help="gains by the suite's searches, not the default ones"
    )
    parser.add_argument("--out", help="folder that keeps searches and runs, to go on after a kill")
    parser.add_argument(
        "--twins", action="store_true", help="sliding laws, and each without its idea"
    )
    chosen = parser.parse_args()
    names = [name for name in smc.laws(DRONE) if name != "none"]
    if chosen.tuned:
        laws = names
    else:
        laws = [smc.law(name, **smc.law(name).gains) for name in names]
    if chosen.twins:
        laws = twins()
        names = [law.name for law in laws]
    with tempfile.TemporaryDirectory() as passing:
        compared = smc.compare(
            laws,
            DRONE,
            conditions(),
            seeds=chosen.seeds,
            duration=6.0,
            metrics=(MEASURE,),
            out=chosen.out or passing,
        )
    print("\n".join(rows(compared.leaderboard, names)))
    for lead_row in leads(compared.table, MEASURE, FAMILIES):
        sure = (
            f"{lead_row.first} by {lead_row.times:.3g} times "
            f"({lead_row.low:.3g} to {lead_row.high:.3g}), "
            f"{'/'.join(lead_row.laws)}"
        )
        print(f"{lead_row.condition}: {sure if lead_row.sure else 'no family is surely first'}")


if __name__ == "__main__":
    main()
