"""The stages of a report: grid, claims, margins, maps, fronts, scenes.

    findings = find(QUICK, Path("report"), threads=2, bars=Bars(True))

Killed and called again, the grid goes on within itself, the other stages with the first plant, map, film or list of
claims that is missing.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from smc_mujoco.analysis.tuning import result
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import read_json, write_json
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation.grid import grid as make_grid
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.paper import scenarios
from smc_mujoco.studies.report import about, films, scores, words
from smc_mujoco.studies.report.findings import Field, Findings, Front, Scene
from smc_mujoco.studies.report.plan import GAINS, Bars, Plan, Report, Work, cached, counted
from smc_mujoco.studies.study import study
from smc_mujoco.studies.table import Table

PAPER = "observer_free"
FIELD_POINTS = 121  # of a map of V', along each axis


def find(plan: Plan, folder: Path, threads: int | None, bars: Bars) -> Findings:
    """Return everything that a report tells, computed or read from the folder."""
    work = Work(plan=plan, folder=folder, threads=threads, bars=bars)
    table = grid(work)
    judged = claims(work, table)
    margins = all_margins(work)
    compared, basins, scenes = margins_by_set(work, margins), all_basins(work), all_scenes(work)
    no_film = films.missing() if plan.filmed else None
    with bars.stage("statistics"):
        return Findings(
            scores=scores.scores(table),
            places=scores.places(table),
            claims=judged,
            fields=fields(plan),
            fronts=fronts(plan),
            margins=margins,
            by_set=compared,
            basins=basins,
            scenes=scenes,
            about=about.about(plan, table, bars.spent, no_film and no_film.removeprefix("no film: ")),
        )


def grid(work: Work) -> Table:
    """Return the table of the grid's runs."""
    plan = work.plan
    runs = make_grid(plan.plants, plan.laws, plan.conditions, plan.seeds, GAINS, plan.duration)
    with work.bars.stage("grid", f"{len(runs)} runs", bar=False):
        return study(runs, work.folder / "study", threads=work.threads, progress=work.bars.shown)


def claims(work: Work, table: Table) -> tuple[Any, ...]:
    """Return the claims, judged; the table's runs are not made again."""
    from smc_mujoco.studies.paper.claims.audit import claims as judge
    from smc_mujoco.studies.paper.claims.audit import evaluations
    from smc_mujoco.studies.paper.claims.verdict import Claim

    plan = work.plan
    total = evaluations(plan.claims, None, plan.quick)
    with work.bars.stage("claims", f"{total} judgements") as report:
        told = counted(report, total)
        return cached(
            work.folder / "claims.json",
            [plan.claims, plan.quick, plan.plants, plan.laws, plan.conditions, plan.seeds, plan.duration],
            lambda: tuple(judge(table, plan.claims, None, plan.quick, None, work.threads, told)),
            lambda found, path: write_json(path, [dataclasses.asdict(claim) for claim in found]),
            lambda path: tuple(Claim(**entry) for entry in read_json(path)),
        )


def all_margins(work: Work) -> tuple[Any, ...]:
    """Return every law's margins, plant by plant."""
    plan = work.plan
    plants = plan.plants if plan.kinds else ()
    return _margins(work, "margins", GAINS, [(plant, plan.laws) for plant in plants], plan.kinds)


def margins_by_set(work: Work, found: Sequence[Any]) -> dict[str, tuple[Any, ...]]:
    """Return set of gains -> margins of the kinds that are compared, of the laws that the set has gains for."""
    plan = work.plan
    if not plan.compared:
        return {}
    by_set = {GAINS: tuple(margin for margin in found if margin.kind in plan.compared)}
    for name in (name for name in sets.SETS if name != GAINS):
        laws = [(plant, tuple(law for law in plan.laws if _has(plant, law, name))) for plant in plan.plants]
        by_set[name] = _margins(work, f"margins-{name}", name, [one for one in laws if one[1]], plan.compared)
    return by_set


def _has(plant: str, law: str, gains: str) -> bool:
    try:
        sets.law(plant, law, gains)
    except ScenarioError:
        return False
    return True


def _margins(
    work: Work, stage: str, gains: str, laws: Sequence[tuple[str, Sequence[str]]], kinds: Sequence[str]
) -> tuple[Any, ...]:
    """Return margins of kinds under a set of gains, of each plant's laws."""
    from smc_mujoco.analysis.margins import Margin, load, margins, save

    def compute(item: tuple[str, Sequence[str]], report: Report) -> list[Margin]:
        plant, names = item
        return cached(
            work.folder / f"{stage}-{plant}.json",
            [names, kinds, work.plan.quick, gains],
            lambda: margins(
                [plant], names, kinds, gains=gains, quick=work.plan.quick, threads=work.threads, report=report
            ),
            save,
            load,
        )

    return tuple(margin for found in work.each(stage, "plants", laws, compute) for margin in found)


def all_basins(work: Work) -> tuple[Any, ...]:
    """Return the maps of regions of attraction, one for each plant and law."""
    from smc_mujoco.analysis.region_of_attraction import Basin, basin, load

    plan = work.plan

    def compute(pair: tuple[str, str], report: Report) -> Basin:
        plant, law = pair
        return cached(
            work.folder / f"region-{plant}-{law}.json",
            [plan.points, plan.region, GAINS],
            lambda: basin(
                plant, law, plan.points, gains=GAINS, duration=plan.region, threads=work.threads, report=report
            ),
            Basin.save,
            load,
        )

    pairs = [(plant, law) for plant in plan.basins for law in plan.basin_laws]
    return tuple(work.each("regions", "maps", pairs, compute))


def all_scenes(work: Work) -> tuple[Scene, ...]:
    """Return runs beside each other: their curves, and films where something renders."""
    plan = work.plan

    def compute(at: tuple[str, str], report: Report) -> Scene:
        plant, condition = at
        runs = scenarios.comparison(plant, condition, plan.scene_laws, duration=plan.scene, gains=GAINS)
        traces = run(list(runs.values()), work.threads)
        film = poster = None
        if at in plan.scenes[: plan.filmed] and films.missing() is None:
            film, poster = _film(work, traces, plant, condition, report)
        first = traces[0].scenario
        return Scene(
            plant=plant,
            condition=condition,
            unit=first.plant.unit,
            u_max=first.u_max,
            curves=tuple(films.curve(trace) for trace in traces),
            film=film,
            poster=poster,
            seconds=plan.scene,
        )

    return tuple(work.each("scenes", "scenes", plan.scenes, compute))


def _film(work: Work, traces: Sequence[Trace], plant: str, condition: str, report: Report) -> tuple[bytes, bytes]:
    told = counted(report, round(work.plan.scene * films.FPS))
    return cached(
        work.folder / f"film-{plant}-{condition}.webm",
        [work.plan.scene_laws, work.plan.scene, GAINS, films.SIZE, films.FPS, films.VP9],
        lambda: films.film(traces, f"{words.plant(plant)}, {words.condition(condition)}", told),
        films.save,
        films.load,
    )


def fields(plan: Plan) -> tuple[Field, ...]:
    """Return V' of the paper's law on the state plane of every plant."""
    from smc_mujoco.studies.paper.claims import lyapunov

    found = []
    for name in plan.plants if PAPER in plan.laws else ():
        plant, law = find_plant(name), sets.law(name, PAPER, GAINS)
        lam, k1 = law.gains["lam"], law.gains["k1"]
        x, v = lyapunov.plane(plant, k1, FIELD_POINTS)
        rate, s = lyapunov.vdot(plant, lam, k1, x, v), lyapunov.surface(plant, lam, k1, x, v)
        found.append(Field(plant=name, law=PAPER, x=x[0], v=v[:, 0], vdot=rate, s=s))
    return tuple(found)


def fronts(plan: Plan) -> tuple[Front, ...]:
    """Return error against effort, of the tunings that come with the package."""
    found = []
    for plant in plan.plants:
        for law in plan.laws:
            try:
                its = result.shipped(plant, law)
            except ScenarioError:
                continue
            best = min(its.finals, key=lambda e: e.objective)  # whose gains are taken; the front is of these too
            found.append(
                Front(
                    plant=plant,
                    law=law,
                    tracking=tuple(e.tracking for e in its.front),
                    variation=tuple(e.variation for e in its.front),
                    chosen=(best.tracking, best.variation),
                )
            )
    return tuple(found)
