"""The stages of a report: records, grid, claims, margins, maps, rigs, flight, chattering, scenes,
statistics.

    findings = find(QUICK, Path("report"), threads=2, bars=Bars(True))

If it is killed and called again, the grid continues where it stopped. The other stages continue
with the first plant, map, film or list of claims that is missing.
"""

import contextlib
import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.analysis import margins as margin_search
from smc_mujoco.analysis import region_of_attraction as regions
from smc_mujoco.analysis.margins import Margin
from smc_mujoco.analysis.paired_runs import SETTLES
from smc_mujoco.analysis.region_of_attraction import Basin
from smc_mujoco.common.cache import cached
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import read_json, write_json
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.draw.film import film as video
from smc_mujoco.evidence.accuracy.accuracy import AccuracyTable, accuracy
from smc_mujoco.evidence.accuracy.accuracy import load as load_accuracy
from smc_mujoco.evidence.audit.audit import audit
from smc_mujoco.evidence.audit.verdict import Claim, Claims
from smc_mujoco.evidence.papers.gaber import lyapunov, scenarios
from smc_mujoco.evidence.report import (
    about,
    families,
    films,
    flight,
    oscillation,
    rigs,
    scores,
    words,
)
from smc_mujoco.evidence.report.plan import GAINS, Bars, Plan, Report, Work
from smc_mujoco.evidence.report.scores import Score
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation.grid import case
from smc_mujoco.simulation.grid import grid as make_grid
from smc_mujoco.simulation.run import run
from smc_mujoco.studies.board import Board
from smc_mujoco.studies.leaderboard import leaderboard
from smc_mujoco.studies.study import study
from smc_mujoco.studies.table import Table
from smc_mujoco.studies.worst_case import DURATION, WorstCase, cached_worst_case

ACCURACY_CONDITIONS = ("constant", "coulomb")  # a steady force, and dry friction
FIELD_POINTS = 121  # of a map of V', along each axis


@dataclasses.dataclass(frozen=True, kw_only=True)
class Front:
    """Gains of a law that none beats in both tracking (s^2) and variation (1/s), and those of the
    study (`chosen`).
    """

    plant: str
    law: str
    tracking: tuple[float, ...]
    variation: tuple[float, ...]
    chosen: tuple[float, float]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Field:
    """V' = s s' on the state plane under the paper's law."""

    plant: str
    x: np.ndarray  # (nx,)
    v: np.ndarray  # (nv,)
    vdot: np.ndarray  # (nv, nx)
    s: np.ndarray  # (nv, nx)

    @property
    def rises(self) -> np.ndarray:
        """Where V' is positive off s = 0, bool."""
        return (self.vdot > 0) & (np.abs(self.s) > lyapunov.SURFACE_TOLERANCE)

    @property
    def share(self) -> float:
        """The share of the plane in which V rises."""
        return float(self.rises.mean())


@dataclasses.dataclass(frozen=True, kw_only=True)
class Findings:
    """Everything that a report shows."""

    medians: bytes  # SVG, of the laws under the first condition
    scores: tuple[Score, ...]
    leads: tuple[families.Lead, ...]  # of families of laws, in each cell that has two of them
    boards: Sequence[Board]  # of each plant and metric, over the conditions
    claims: Sequence[Claim]
    fields: tuple[Field, ...]
    fronts: tuple[Front, ...]
    worst: tuple[WorstCase, ...]
    margins: tuple[Margin, ...]
    by_set: Mapping[
        str, tuple[Margin, ...]
    ]  # set of gains -> the margins that are searched under every set
    oscillations: tuple[oscillation.Oscillation, ...]
    accuracies: AccuracyTable
    basins: tuple[Basin, ...]
    machines: tuple[rigs.Machine, ...]
    repeated: tuple[rigs.Repeated, ...]
    flight: flight.Flight
    scenes: tuple[films.Scene, ...]
    about: about.About

    def _names(self, what: str) -> list[str]:
        return list(dict.fromkeys(getattr(score, what) for score in self.scores))

    @property
    def plants(self) -> list[str]:
        """The plants in the order of the grid."""
        return self._names("plant")

    @property
    def laws(self) -> list[str]:
        """The laws in the order of the grid."""
        return self._names("law")

    @property
    def conditions(self) -> list[str]:
        """The conditions in the order of the grid."""
        return self._names("condition")


def find(
    plan: Plan, folder: Path, threads: int | None, bars: Bars, records: Path | None = None
) -> Findings:
    """Return everything that a report shows, computed or read from the folder; `records`: folder of
    rigs' records.
    """
    work = Work(plan=plan, folder=folder, threads=threads, bars=bars)
    repeated = rigs.repeated(
        work, records
    )  # first, so that bad files are refused before anything is computed
    table = grid(work)
    claims = judged_claims(work, table)
    worst = worst_cases(work)
    margins = all_margins(work)
    by_set = margins_by_set(work, margins)
    basins = all_basins(work)
    scenes = all_scenes(work)
    machines = rigs.machines(work)
    flown = flight.flight(work)
    oscillations = oscillation.oscillations(work)
    accurate = accuracies(work)
    no_film = video.missing() if plan.filmed else None
    with bars.stage("statistics"):
        boards = leaderboard(
            table, (SETTLES, *words.TABLE_METRICS), by=("plant",), relevant=plan.relevant
        )
        return Findings(
            medians=films.medians(table, plan.conditions[0]),
            scores=scores.scores(table, boards),
            leads=families.leads(table),
            boards=boards,
            claims=claims,
            fields=fields(plan),
            fronts=fronts(plan),
            worst=worst,
            margins=margins,
            by_set=by_set,
            oscillations=oscillations,
            accuracies=accurate,
            basins=basins,
            machines=machines,
            repeated=repeated,
            flight=flown,
            scenes=scenes,
            about=about.about(
                plan, table, bars.spent, no_film and no_film.removeprefix("no film: ")
            ),
        )


def grid(work: Work) -> Table:
    """Return the table of the grid's runs."""
    plan = work.plan
    runs = make_grid(plan.plants, plan.laws, plan.conditions, plan.seeds, GAINS, plan.duration)
    with work.bars.stage("grid", f"{len(runs)} runs", bar=False):
        options: dict[str, Any] = {"half_steps": True}
        return study(
            runs, work.folder / "study", threads=work.threads, progress=work.bars.shown, **options
        )


def judged_claims(work: Work, table: Table) -> Claims:
    """Return the claims with their verdicts; the table's runs are not made again."""
    plan = work.plan
    options: dict[str, Any] = {"quick": plan.quick, "threads": work.threads}
    with work.bars.stage("claims", "quick" * plan.quick) as bar:
        return cached(
            work.folder / "claims.json",
            [
                plan.claims,
                plan.quick,
                plan.plants,
                plan.laws,
                plan.conditions,
                plan.seeds,
                plan.duration,
            ],
            lambda: audit(only=plan.claims, **options, table=table, report=bar.reached).claims,
            lambda claims, path: write_json(path, [dataclasses.asdict(claim) for claim in claims]),
            lambda path: Claims(Claim(**entry) for entry in read_json(path)),
        )


def worst_cases(work: Work) -> tuple[WorstCase, ...]:
    """Return the worst case found for each law, within the usual uncertainty of its plant."""
    plan = work.plan

    def compute(pair: tuple[str, str], report: Report) -> WorstCase:
        plant, law = pair
        scenario = case(plant, law, "nominal", DURATION, GAINS)
        return cached_worst_case(
            work.folder / f"worst-{plant}-{law}.json", scenario, None, plan.attacks, work.threads
        )

    return tuple(
        work.each("worst", "searches", list(itertools.product(plan.attacked, plan.laws)), compute)
    )


def all_margins(work: Work) -> tuple[Margin, ...]:
    """Return every law's margins, plant by plant."""
    plan = work.plan
    laws = dict.fromkeys(plan.plants if plan.kinds else (), plan.laws)
    return _margins(work, "margins", GAINS, laws, plan.kinds)


def margins_by_set(work: Work, margins: Sequence[Margin]) -> dict[str, tuple[Margin, ...]]:
    """Return set of gains -> margins of the kinds that are compared, of the laws that the set has
    gains for.
    """
    plan = work.plan
    if not plan.compared:
        return {}
    by_set = {GAINS: tuple(margin for margin in margins if margin.kind in plan.compared)}
    for name in (name for name in sets.SETS if name != GAINS):
        laws = {plant: tuple(laws) for plant, laws in about.laws_of(plan, name).items()}
        by_set[name] = _margins(work, f"margins-{name}", name, laws, plan.compared)
    return by_set


def _margins(
    work: Work, stage: str, gains: str, laws: Mapping[str, tuple[str, ...]], kinds: tuple[str, ...]
) -> tuple[Margin, ...]:
    """Return margins of kinds under a set of gains; `laws`: plant -> laws."""
    options: dict[str, Any] = {"gains": gains, "quick": work.plan.quick, "threads": work.threads}

    def search(plant: str, report: Report) -> list[Margin]:
        return margin_search.margins([plant], laws[plant], kinds, **options, report=report)

    plants = [(plant,) for plant in laws]
    depends = [laws, kinds, work.plan.quick, gains]
    by_plant = work.kept(
        stage, "plants", plants, depends, search, margin_search.save, margin_search.load
    )
    return tuple(margin for margins in by_plant for margin in margins)


def all_basins(work: Work) -> tuple[Basin, ...]:
    """Return the maps of regions of attraction, one for each plant and law."""
    plan = work.plan
    options: dict[str, Any] = {"gains": GAINS, "duration": plan.region, "threads": work.threads}

    def search(plant: str, law: str, report: Report) -> Basin:
        return regions.basin(plant, law, plan.points, **options, report=report)

    pairs = list(itertools.product(plan.basins, plan.basin_laws))
    depends = [plan.points, plan.region, GAINS]
    return tuple(work.kept("regions", "maps", pairs, depends, search, Basin.save, regions.load))


def accuracies(work: Work) -> AccuracyTable:
    """Return the accuracy of all laws on the plan's plants, condition by condition."""
    plan = work.plan
    periods = plan.periods
    starts = plan.accuracy_starts

    def measure(plant: str, condition: str, report: Report) -> AccuracyTable:
        return accuracy(
            plan.laws, plant, periods, condition, starts, GAINS, threads=work.threads, report=report
        )

    pairs = list(itertools.product(plan.accurate, ACCURACY_CONDITIONS))
    depends = [plan.laws, periods, starts, GAINS]
    tables = work.kept(
        "accuracy", "tables", pairs, depends, measure, AccuracyTable.save, load_accuracy
    )
    return AccuracyTable(row for rows in tables for row in rows)


def all_scenes(work: Work) -> tuple[films.Scene, ...]:
    """Return runs side by side: their curves, and films where they can be rendered."""
    plan = work.plan

    def compute(scene: tuple[str, str], report: Report) -> films.Scene:
        plant, condition = scene
        title = f"{words.plant(plant)}, {words.condition(condition)}"
        runs = scenarios.comparison(
            plant, condition, plan.scene_laws, duration=plan.scene, gains=GAINS
        )
        traces = run(list(runs.values()), work.threads)
        film = None
        its = {
            "plant": plant,
            "condition": condition,
            "laws": plan.scene_laws,
            "seconds": plan.scene,
        }
        if scene in plan.scenes[: plan.filmed] and video.missing() is None:
            film = cached(
                work.folder / f"film-{plant}-{condition}.webm",
                [plan.scene_laws, plan.scene, GAINS, films.SIZE, films.FPS],
                lambda: films.film(traces, title, report),
                lambda data, path: path.write_bytes(data),
                Path.read_bytes,
            )
        return films.Scene(**its, curves=films.curves(traces, title), film=film)

    return tuple(work.each("scenes", "scenes", plan.scenes, compute))


def fields(plan: Plan) -> tuple[Field, ...]:
    """Return V' of the paper's law on the state plane of every plant."""
    planes = []
    for name in plan.plants if words.PAPER_LAW in plan.laws else ():
        plant = find_plant(name)
        law = sets.law(name, words.PAPER_LAW, GAINS)
        lam = law.gains["lam"]
        k1 = law.gains["k1"]
        x, v = lyapunov.plane(plant, k1, FIELD_POINTS)
        rate = lyapunov.vdot(plant, lam, k1, x, v)
        s = lyapunov.surface(plant, lam, k1, x, v)
        planes.append(Field(plant=name, x=x[0], v=v[:, 0], vdot=rate, s=s))
    return tuple(planes)


def fronts(plan: Plan) -> tuple[Front, ...]:
    """Return the fronts of error against effort that the package's tunings found."""
    pairs = []
    for plant in plan.plants:
        for law in plan.laws:
            with contextlib.suppress(ScenarioError):
                tuned = sets.tuned(plant, law, GAINS)
                tracking, variation = zip(*tuned.front, strict=True)
                pairs.append(
                    Front(
                        plant=plant,
                        law=law,
                        tracking=tracking,
                        variation=variation,
                        chosen=tuned.first,
                    )
                )
    return tuple(pairs)
