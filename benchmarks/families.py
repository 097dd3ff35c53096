"""Where sliding mode loses: its best law against the best rival, as a load, a delay, noise or
friction grows.

    python benchmarks/families.py PLANT [PLANT ...] [--lot SEED] [--out families.json]

A plant is a name, FILE.xml:joint, or FILE.py:plant of a file that defines it. Each law has the
gains of twelve searches, run i those of search i, from start i: shipped ones, or searches of the
same rule and budget, which are kept beside --out. A level has no unit: the load's frequency and the
delay count by the bandwidth wc of the tuned ADRC, noise by the start, dry friction by u_max. Only
the force of a load is in N or N m; where u_max is not 6, it is more or less in proportion. With
`--lot`, levels are drawn within the range of each sentence of the page, to check it. The error is
rms_error, of the last three quarters of 8 s, at least 1e-4 of the start. The cost is what the gains
were searched for, ITAE/|x0| plus the weighted variation of u, of this one run.

One half of the runs chooses the law of a family for the other half, whose scores count, so the
larger family has no advantage. A lead is the ratio of the two scores, run by run, with its 95 %
interval (signed ranks), also at half the physics step. A plant of one channel takes about 6 minutes
of processor time, and 4 for searches.

What the page shows, call by call:

    table         duffing inverted_pendulum --out two.json
    no cost of u  duffing inverted_pendulum --only pid implicit_first_order boundary_layer --gains
    tracking
    picture       van_der_pol --lot 1795620293 --read two.json --figure where.svg
    check, border van_der_pol inverted_pendulum_network pendulum_network --lot 1795620293 --read
    two.json
    the cart      examples/my_smc_package/my_smc_package/plants.py --lot 1795620293
    slide by lot  benchmarks/drawn_plants.py:drawn_slide --lot 584051958 --condition differenced_5ms
    pendulum, too benchmarks/drawn_plants.py:drawn_pendulum --lot 584110175 --condition light
    their sums    --read FILE FILE FILE, with what these three wrote by --out
"""

import argparse
import itertools
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.paired_runs import EPS
from smc_mujoco.analysis.ranking import LEVEL_SHARE, interval, linked
from smc_mujoco.analysis.step_halving import halved
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.common.errors import find
from smc_mujoco.common.scripts import execute
from smc_mujoco.control.gain_sets import COMPARED, OBJECTIVES
from smc_mujoco.control.law import catalogue
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style
from smc_mujoco.mechanisms.hardware.friction import Coulomb
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.metrics.conventions import by_group
from smc_mujoco.simulation.grid import case
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import U_MAX, Scenario, default_u_max
from smc_mujoco.simulation.signals import Noise, Sine
from smc_mujoco.studies.fair_gains import Candidate, Trial
from smc_mujoco.studies.table import Table

FAMILIES = {
    "switching": (
        "classical",
        "adaptive",
        "super_twisting",
        "conditioned_super_twisting",
        "implicit_first_order",
        "twisting",
        "terminal",
    ),
    "smoothed": (
        "observer_free",
        "boundary_layer",
    ),  # the same surface, and a steep slope in place of the sign
    "rivals": ("pid", "extended_state", "adrc", "pd_observer", "lqi", "mpc", "loop_shaping"),
}
ERROR = 0.025  # beyond each end of an interval

RUNS, DURATION, LOAD = 12, 8.0, 1.0  # runs a cell; s; N or N m, for |u| <= 6 N or N m
FORCE_AT = 0.5  # of wc, the frequency of the loads whose force varies
DRAWN = 3  # levels a sentence, by lot
FORCE = "load at 0.5 wc, N or N m"
VELOCITY_NOISE_RATIO = 5.0  # 1/s, as in margins
LEVELS = {
    "load, omega / wc": (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0, 2.0, 4.0),
    FORCE: (0.25, 0.5, 1.0, 2.0, 3.0, 4.0),
    "delay x wc": (0.0, 0.05, 0.1, 0.2, 0.4, 0.8),
    "noise / start": (1e-5, 1e-4, 1e-3, 3e-3, 1e-2),
    "friction / u_max": (0.01, 0.02, 0.05, 0.1, 0.2),
}
# The sentences of docs/where_sliding_mode_loses.md: axis, lowest and highest level, score, kind,
# and what it does against the best rival. "is level at best": it is ahead by no more than the share
# within which laws are level.
SENTENCES = (
    ("load, omega / wc", 0.5, 2.0, "error", "switching", "leads"),
    (FORCE, 0.25, 0.5, "cost", "switching", "leads"),
    (FORCE, 0.25, 4.0, "error", "smoothed", "trails"),
    ("load, omega / wc", 1 / 16, 0.25, "cost", "smoothed", "trails"),
    ("friction / u_max", 0.01, 0.2, "cost", "smoothed", "trails"),
    ("noise / start", 1e-5, 1e-2, "cost", "switching", "is level at best"),
    ("noise / start", 1e-3, 1e-2, "cost", "smoothed", "is level at best"),
    ("delay x wc", 0.0, 0.4, "cost", "switching", "is level at best"),
)
# laws whose theorem bounds the load, or its rate
SURE = {"implicit_first_order": "d", "super_twisting": "d'"}
SCORES = ("error", "cost")
KINDS = ("switching", "smoothed")
COLOURS = "#0072B2", "#7CC0E8", "#D55E00", "#F0B080"
FIGURE_WIDTH, ROW_HEIGHT, LIMIT = 7.0, 1.75, 1e3  # inches; largest lead that is drawn
FAILED = 1e3  # score of a run that fails: chosen, beyond all others


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
    families: Mapping[str, Sequence[str]] = FAMILIES,
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


def leads(
    table: Table, metric: str, families: Mapping[str, Sequence[str]] = FAMILIES
) -> tuple[Lead, ...]:
    """Return the lead in every cell of a study's table that has one; families: name -> names of
    laws.
    """
    found = []
    by_row = paired_runs.by_row(table, metric)
    for group in paired_runs.groups(table, by=("plant", "condition")):
        ((plant, condition),) = group.blocks
        (ran,) = paired_runs.scenarios(table, group)
        if not (scored := group.scores(by_row)).values:
            continue
        there = ~np.isnan(np.array([row[0] for row in scored.values.values()])).any(axis=0)
        values, sets = (
            {law: row[0][there] for law, row in of.items()} for of in (scored.values, scored.sets)
        )
        if one := lead(values, sets, paired_runs.floor(ran, metric), families):
            found.append(one._replace(plant=plant, condition=condition))
    return tuple(found)


class Subject(NamedTuple):
    """A plant, and its laws with gains of twelve searches, run i those of search i."""

    plant: Plant
    laws: dict[str, Candidate]
    condition: str  # that a level changes

    @property
    def wc(self) -> float:
        """The bandwidth of the tuned ADRC, rad/s."""
        return self.laws["adrc"].law.gains["wc"]

    @property
    def bound(self) -> float:
        """The bound on |u|, N or N m."""
        return default_u_max(self.plant)

    def load(self, axis: str, level: float) -> tuple[float, float]:
        """Return the force of a load, N or N m, and its frequency, rad/s."""
        if axis == FORCE:
            force = level
            omega = FORCE_AT
        else:
            force = LOAD
            omega = level
        return force * self.bound / U_MAX, omega * self.wc

    def changes(self, axis: str, level: float, run: int) -> dict:
        """Return the fields of a scenario that a level sets."""
        if axis.startswith("load"):
            return {"disturbance": Sine(*self.load(axis, level), math.tau * run / RUNS)}
        if axis.startswith("delay"):
            return {"input_delay": round(1e3 * level / self.wc) * 1e-3}
        if axis.startswith("noise"):
            noise = level * max(map(abs, self.plant.x0))
            return {"noise": Noise(position=noise, velocity=VELOCITY_NOISE_RATIO * noise)}
        return {"friction": [Coulomb(level * self.bound)]}

    def scenarios(self, axis: str, level: float, law: str) -> list[Scenario]:
        """Return the runs of a law at a level."""
        changes = [self.changes(axis, level, run) for run in range(RUNS)]
        laws = [self.laws[law](run) for run in range(RUNS)]
        return [
            case(self.plant, laws[i], self.condition, DURATION, seed=i, changes=changes[i])
            for i in range(RUNS)
        ]

    def admitted(self, axis: str, level: float) -> dict[str, list[bool]]:
        """Return whether the gains of each run admit a load from FORCE_AT wc on, for the laws of
        SURE.
        """
        if not axis.startswith("load") or (axis != FORCE and level < FORCE_AT):
            return {}
        force, omega = self.load(axis, level)
        sizes = {"d": force, "d'": force * omega}
        its = {}
        for law, what in SURE.items():
            if law in self.laws:
                its[law] = (what, catalogue()[law].admits[what])
        return {
            law: [
                sizes[what] < most(SimpleNamespace(**self.laws[law](run).gains))
                for run in range(RUNS)
            ]
            for law, (what, most) in its.items()
        }


def subject(
    text: str,
    folder: Path,
    condition: str = "nominal",
    gains: str = "tuned",
    laws: Sequence[str] = COMPARED,
) -> Subject:
    """Return the plant of a name, FILE.xml:joint or FILE.py:plant, with its laws; the folder keeps
    what is tuned.
    """
    file, _, name = text.partition(".py")
    if text != file:
        plant = of_file(Path(f"{file}.py"), name.removeprefix(":"))
    else:
        plant = as_plant(text)
    templates = [catalogue()[law] for law in dict.fromkeys((*laws, "adrc"))]
    trial = Trial([plant], (), DURATION, None, folder, None, progress=True)
    tuned = trial.gains({plant.name: templates}, defaults=False, gains=gains)[plant.name]
    for its in tuned:
        if its.remark:
            print(f"{plant.name}, {its.law.name}: {its.remark}", file=sys.stderr)
    return Subject(plant, {its.law.name: its for its in tuned}, condition)


def of_file(path: Path, name: str = "") -> Plant:
    """Return the plant that a Python file defines; if several, that of a name."""
    plants = {value.name: value for value in execute(path).values() if isinstance(value, Plant)}
    if name or len(plants) != 1:
        return find(f"plant of {path}", name, plants)
    return plants.popitem()[1]


def by_lot(seed: int) -> dict[str, list[float]]:
    """Return levels of each axis, drawn within the range of each sentence; equal ratios are equally
    likely.
    """
    rng = np.random.default_rng(seed)
    levels = {axis: [] for axis in LEVELS}
    for axis, lowest, highest, *_ in SENTENCES:
        first = lowest or LEVELS[axis][1]  # no delay has no ratio to others
        levels[axis] += np.exp(rng.uniform(math.log(first), math.log(highest), DRAWN)).tolist()
    return {axis: sorted(its) for axis, its in levels.items()}


def scores(made: Sequence[Scenario]) -> np.ndarray:
    """Return the rms error and the cost of each run, (2, runs)."""
    values = np.full((2, len(made)), FAILED)
    cost = Objective(duration=DURATION)
    for i, trace in stream(made):
        if trace.failure is None:
            tracking, variation = cost.terms_of_run(trace)
            error = CATALOGUE["rms_error"].worst(by_group(trace))
            values[:, i] = (
                max(error, EPS * max(map(abs, trace.scenario.plant.x0))),
                tracking + cost.weight * variation,
            )
    return values


def cells(
    subject: Subject, axis: str, level: float, families: dict[str, list[str]]
) -> Iterator[dict]:
    """Yield the lead of sliding mode at a level, of each kind in each score: above 1, it is that
    many times better.
    """
    made = {law: subject.scenarios(axis, level, law) for laws in families.values() for law in laws}
    values = {law: scores(its) for law, its in made.items()}
    fine: dict[str, np.ndarray] = {}
    for k, score in enumerate(SCORES):
        family_scores = {}
        best = {}
        fine_scores = {}
        for family, laws in families.items():
            family_scores[family], picked = chosen_by_halves(
                np.array([values[law][k] for law in laws])
            )
            best[family] = [laws[i] for i in picked]
            for law in set(best[family]) - set(fine):
                fine[law] = scores([halved(one) for one in made[law]])
            fine_scores[family] = np.empty(RUNS)
            for half in (0, 1):
                fine_scores[family][half::2] = fine[best[family][half]][k, half::2]
        medians = {law: float(np.median(its[k])) for law, its in values.items()}
        for kind in KINDS:
            lead, low, high = map(
                math.exp, interval(np.log(family_scores["rivals"] / family_scores[kind]), 0.025)
            )
            at_half = math.exp(
                interval(np.log(fine_scores["rivals"] / fine_scores[kind]), 0.025)[0]
            )
            cell = {
                "plant": subject.plant.name,
                "axis": axis,
                "level": level,
                "score": score,
                "kind": kind,
            }
            cell |= {"lead": lead, "low": low, "high": high, "half": at_half, "law": best[kind]}
            runs = {law: its[k].tolist() for law, its in values.items()}
            cell |= {"rival": best["rivals"], "medians": medians, "runs": runs}
            yield cell | {"admitted": subject.admitted(axis, level)}


def draw(known: Sequence[dict], path: Path) -> None:
    """Draw the leads over the levels: a row an axis, a column a plant."""
    plants = list(dict.fromkeys(one["plant"] for one in known))
    with style.page(FIGURE_WIDTH):
        figure = pages.blank(FIGURE_WIDTH, ROW_HEIGHT * len(LEVELS) + 0.8, None)
        panels = figure.subplots(len(LEVELS), len(plants), squeeze=False, sharex="row", sharey=True)
        for (i, axis), (k, plant) in itertools.product(enumerate(LEVELS), enumerate(plants)):
            ax = panels[i, k]
            for (score, kind), colour in zip(
                itertools.product(SCORES, KINDS), COLOURS, strict=True
            ):
                wanted = {"plant": plant, "axis": axis, "score": score, "kind": kind}
                its = [one for one in known if wanted.items() <= one.items()]
                # no delay is drawn at half of the smallest
                x = []
                for one in its:
                    x.append(one["level"] or LEVELS[axis][1] / 2)
                ends = [
                    [one["lead"] - one["low"] for one in its],
                    [one["high"] - one["lead"] for one in its],
                ]
                ax.errorbar(
                    x, [one["lead"] for one in its], ends, fmt="o-", color=colour, ms=4, lw=1.2
                )
            ax.axhline(1.0, color=style.INK, lw=0.8)
            ax.set(xscale="log", yscale="log", ylim=(1 / LIMIT, LIMIT), xlabel=axis)
            ax.xaxis.set_minor_formatter(NullFormatter())
        for ax, plant in zip(panels[0], plants, strict=True):
            ax.set_title(style.plant_name(plant))
        for ax in panels[:, 0]:
            ax.set_ylabel("lead (ratio)")
        names = [f"{score}, {kind}" for score, kind in itertools.product(SCORES, KINDS)]
        handles = []
        for name, c in zip(names, COLOURS, strict=True):
            handles.append(Line2D([], [], color=c, marker="o", label=name))
        pages.set_head(figure, FIGURE_WIDTH, "Sliding mode ahead above 1, a rival below", handles)
        pages.write(figure, pages.files(path))


def borders(known: Sequence[dict]) -> Iterator[str]:
    """Yield by how much a law leads in error where its gains admit a load from 0.5 wc on, and where
    they do not.
    """
    for law, what in SURE.items():
        leads: dict[bool, list[float]] = {True: [], False: []}
        for one in known:
            if one["score"] != "error" or one["kind"] != KINDS[0] or law not in one["admitted"]:
                continue
            runs = one["runs"]
            rivals, _ = chosen_by_halves(
                np.array([runs[rival] for rival in FAMILIES["rivals"] if rival in runs])
            )
            for within, rival, own in zip(one["admitted"][law], rivals, runs[law], strict=True):
                leads[within].append(rival / own)
        for within, its in leads.items():
            if its:
                low, middle, high = np.quantile(its, [0.25, 0.5, 0.75])
            else:
                low, middle, high = [math.nan] * 3
            where = "within" if within else "beyond"
            yield (
                f"{law}, {what} {where} what its gains admit: {middle:.3g} ({low:.3g} to "
                f"{high:.3g}), {len(its)} runs"
            )


def judged(known: Sequence[dict]) -> Iterator[str]:
    """Yield for each sentence and plant how many of its levels stand, are open, and are
    contradicted.
    """
    counts = np.zeros(3, int)
    most = {"trails": 1.0, "is level at best": 1.0 / (1.0 - LEVEL_SHARE)}
    for axis, lowest, highest, score, kind, does in SENTENCES:
        for plant in dict.fromkeys(one["plant"] for one in known):
            wanted = {"plant": plant, "axis": axis, "score": score, "kind": kind}
            its = []
            for one in known:
                if wanted.items() <= one.items() and lowest <= one["level"] <= highest:
                    its.append(one)
            leads = does == "leads"
            stand = sum(one["low"] > 1.0 if leads else one["high"] < most[does] for one in its)
            against = sum(one["high"] < 1.0 if leads else one["low"] > most[does] for one in its)
            counts += len(its), stand, against
            what = f"{kind} {does} in {score}, {axis} {lowest:g} to {highest:g}"
            yield f"{plant}: {what}: {stand} of {len(its)} stand, {against} contradicted"
    yield f"in all: {counts[1]} of {counts[0]} stand, {counts[2]} contradicted"


def main() -> None:
    """Print a line a cell, and write them all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "plants", nargs="*", help="names, FILE.xml:joint of your model, or FILE.py:plant"
    )
    parser.add_argument(
        "--lot", type=int, metavar="SEED", help="levels drawn by lot, to check the page's sentences"
    )
    parser.add_argument(
        "--condition", default="nominal", help="a condition of the suite, which the levels change"
    )
    parser.add_argument(
        "--only",
        nargs="+",
        default=COMPARED,
        metavar="LAW",
        help="some laws, of each kind one or more",
    )
    parser.add_argument("--without", metavar="LAW", help="leave this law out")
    parser.add_argument(
        "--gains", default="tuned", choices=OBJECTIVES, help="the set of shipped gains"
    )
    parser.add_argument(
        "--read",
        nargs="+",
        type=Path,
        default=[],
        metavar="FILE",
        help="cells of earlier calls, too",
    )
    parser.add_argument("--figure", type=Path, help="draw the cells, as this file")
    parser.add_argument("--out", type=Path, default=Path("families.json"))
    asked = parser.parse_args()
    known = [one for path in asked.read for one in json.loads(path.read_text())]
    read = len(known)
    laws = [law for law in asked.only if law != asked.without]
    compared = {family: [law for law in names if law in laws] for family, names in FAMILIES.items()}
    for text in asked.plants:
        it = subject(text, asked.out.with_suffix(""), asked.condition, asked.gains, laws)
        for axis, levels in (LEVELS if asked.lot is None else by_lot(asked.lot)).items():
            for level in levels:
                for one in cells(it, axis, level, compared):
                    its = (
                        f"{one['lead']:.3g} ({one['low']:.3g} to {one['high']:.3g}; half "
                        f"step {one['half']:.3g})"
                    )
                    laws = " | ".join("/".join(dict.fromkeys(one[who])) for who in ("law", "rival"))
                    print(
                        f"| {it.plant.name} | {axis} {level:.3g} | {one['score']} | "
                        f"{one['kind']} | {its} | {laws} |",
                        flush=True,
                    )
                    known.append(one)
                asked.out.write_text(json.dumps(known[read:], indent=1))
    print(*judged(known), *borders(known), sep="\n")
    if asked.figure:
        draw(known, asked.figure)


if __name__ == "__main__":
    main()
