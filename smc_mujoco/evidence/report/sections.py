"""The sections of a report: tables of `compare`, pictures of `draw`, films, and a paper's claims.

If the work is killed and started again, the comparison continues where it stopped, and all else
with the first margin, film or list of claims that is missing.
"""

import dataclasses
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from markupsafe import Markup

from smc_mujoco.analysis.paired_runs import SETTLES
from smc_mujoco.common.files import read_json, shipped, write_json
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.common.text import number
from smc_mujoco.draw import dot_plot, figure
from smc_mujoco.draw.film import film as video
from smc_mujoco.evidence.audit.audit import audit
from smc_mujoco.evidence.audit.verdict import Claim, Claims, summary
from smc_mujoco.evidence.report import page
from smc_mujoco.evidence.report.page import Section, heading, picture, tables, text
from smc_mujoco.evidence.report.plan import GAINS, Work
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.metrics.catalogue import CATALOGUE, metrics
from smc_mujoco.robustness import margins as margin_search
from smc_mujoco.robustness.margins import MARGIN_KINDS, Margin
from smc_mujoco.simulation import gaber_study
from smc_mujoco.simulation.conditions import find_condition
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.board import Board
from smc_mujoco.studies.compare import Compared, compare

METRICS = ("settling_time", "itae", "ultimate_bound", "tv_rate")  # one a wish: fast, calm, ...
FILM_SIZE, FILM_RATE = (960, 540), 20  # px; 1/s
UNBEATEN = (
    "A law is unbeaten in a condition if no other is shown to be better there, if each of its runs "
    "arrives, and if no other is shown to settle in more runs. It wins if it is shown to be better "
    "than every other. A table names the laws that are unbeaten in the most conditions: 'unbeaten "
    "in 5 of 9, 2 won' counts conditions, and a law in bold wins in all of them."
)
FRONTS = (
    "Vertical axis: the least rms error under a load, of all gains within a price. Horizontal: "
    "the price, which is J over the least J of any law, or u's variation a second over its bound. "
    "In grey: below a 10,000th of the start, not ranked. From benchmarks/fronts.py, not from this "
    "report's runs."
)
LIMITS = (
    "Nothing was tried on hardware: all is simulated, from equations of the plants and models of "
    "friction, drives and sensors.",
    "Seeds change the start, the noise, and the search from which gains come. Everything else "
    "changes by condition only.",
    "All laws have one bound on u and one control period. With others the order may change.",
    "A margin is what runs showed. It is no proof.",
)


def write(work: Work) -> Path:
    """Compute a study and write it as OUT/report.html."""
    grid = work.plan.grid
    compared = compare(
        grid.laws,
        grid.plants,
        grid.conditions,
        grid.seeds,
        worst=work.plan.worst,
        out=work.folder / "compared",
        metrics=(SETTLES, *METRICS),
        duration=grid.duration,
        threads=work.threads,
        progress=work.progress,
    )
    judged = claims_of(work)
    shown = scenes(work)
    quick = " --quick" if work.plan.quick else ""
    return page.write(
        work.folder / "report.html",
        title="Which controller, where, and how certain?",
        over="Sliding-mode control on MuJoCo mechanisms" + (", a quick look" if quick else ""),
        about=f"{len(compared.table)} runs of {grid.duration:g} s: {len(grid.plants)} plants, "
        f"{len(grid.laws)} laws, {len(grid.conditions)} conditions, {grid.seeds} seeds of each",
        made_by=f"smc-mujoco report{quick}",
        sections=[
            overview(compared, judged),
            comparison(compared),
            Section("claims", "The paper's claims", [page.claims(judged)]),
            margins(work),
            Section("films", "Films and traces", shown),
            method(work, compared),
        ],
    )


def overview(compared: Compared, judged: Sequence[Claim]) -> Section:
    """Return the first screen: the unbeaten laws, the verdicts on the paper, and the fronts of
    docs/where_sliding_mode_loses.md.
    """
    fronts = (shipped("docs") / "where_sliding_mode_loses.svg").read_bytes()
    parts = [
        text(UNBEATEN),
        *tables([leaders(compared.leaderboard)]),
        text(f"The paper, in claims: {summary(judged)}.", "strong"),
        picture(lambda path, size: path.write_bytes(fronts), FRONTS),
    ]
    return Section("overview", "The answer", parts)


def leaders(boards: Iterable[Board]) -> Tabular:
    """Return the laws that are unbeaten in the most conditions, for each plant and metric."""
    cells: dict[str, dict[str, Cell]] = {}
    for (plant, metric), outcomes in _outcomes(boards).items():
        cells.setdefault(plant, {})[metric] = _leading(list(outcomes.values()))
    rows = []
    for plant, by_metric in cells.items():
        rows.append([plant, *(by_metric.get(metric, "") for metric in METRICS)])
    heads = [f"{CATALOGUE[metric].need}: {CATALOGUE[metric].label}" for metric in METRICS]
    return Tabular(headings=["plant", *heads], rows=rows, title="What to use", left=5)


Outcome = tuple[str | None, tuple[str, ...]]  # the winner of a cell, and its unbeaten laws


def _outcomes(boards: Iterable[Board]) -> dict[tuple[str, str], dict[str, Outcome]]:
    """Return plant and metric -> condition -> outcome."""
    blocks = {}
    for board in boards:
        for block in board.blocks:
            blocks[board.metric, block.plant, block.condition] = block
    found: dict[tuple[str, str], dict[str, Outcome]] = {}
    for (metric, plant, name), block in blocks.items():
        if metric in METRICS:
            settling = blocks[SETTLES, plant, name].best
            unbeaten = tuple(law for law in block.best if law in settling)
            found.setdefault((plant, metric), {})[name] = block.winner, unbeaten
    return found


def _leading(outcomes: Sequence[Outcome]) -> Cell:
    """Return the laws that are unbeaten in the most of several conditions."""
    unbeaten: Counter[str] = Counter()
    for _, laws in outcomes:
        unbeaten.update(laws)
    if not unbeaten:
        return Cell("no law")
    most = max(unbeaten.values())
    laws = []
    for law, count in unbeaten.items():
        if count == most:
            laws.append(law)
    wins = sum(winner in laws for winner, _ in outcomes)
    return Cell(
        _few(laws),
        f"unbeaten in {most} of {len(outcomes)}" + (f", {wins} won" if wins else ""),
        strong=wins == len(outcomes),
    )


def _few(laws: Sequence[str]) -> str:
    """Return the names of laws, or of more than three their number: none of these stands out."""
    if len(laws) > 3:
        return f"any of {len(laws)} laws"
    return ", ".join(laws)


def comparison(compared: Compared) -> Section:
    """Return the winners by condition, the tables of the comparison, and its medians."""
    outcomes = _outcomes(compared.leaderboard)
    plants = list(dict.fromkeys(plant for plant, _ in outcomes))
    conditions = list(dict.fromkeys(name for by_name in outcomes.values() for name in by_name))
    matrices = []
    for metric in METRICS:
        rows = []
        for name in conditions:
            row = [Cell(name)]
            for plant in plants:
                winner, unbeaten = outcomes[plant, metric].get(name, (None, ()))
                row.append(Cell(winner or _few(unbeaten) or "no law", strong=winner is not None))
            rows.append(row)
        matrices.append(
            Tabular(
                headings=["condition", *plants],
                rows=rows,
                title=f"By {CATALOGUE[metric].label}: the winner in bold, or the unbeaten laws",
                left=1 + len(plants),
            )
        )
    first = conditions[0]
    medians = picture(
        lambda path, size: dot_plot.plot(
            compared.table.select(condition=first),
            path,
            METRICS,
            f"Medians, {first}",
            size,
            winners=compared.leaderboard.winners,
        ),
        f"The median of each law in condition {first}, with its 95 % interval. A ring: it wins.",
    )
    every = page.folded("All medians, intervals, verdicts and gains", tables(compared.tables))
    parts = [*tables(matrices), medians, every]
    return Section("laws", "Laws compared", parts)


def claims_of(work: Work) -> Claims:
    """Return the claims of the paper with their verdicts."""
    plan = work.plan
    return work.kept(
        "claims.json",
        [plan.claims, plan.quick],
        lambda report: (
            audit(only=plan.claims, quick=plan.quick, threads=work.threads, report=report).claims
        ),
        lambda claims, path: write_json(path, [dataclasses.asdict(claim) for claim in claims]),
        lambda path: Claims(Claim(**entry) for entry in read_json(path)),
    )


def margins(work: Work) -> Section:
    """Return the largest levels of delay, disturbance and so on that the laws tolerate."""
    plan = work.plan
    parts = [
        text(
            "The largest level that a law tolerates, by bisection in simulation. Below it: what "
            "linear theory says. ≥: the search ended there, the law may tolerate more. None: the "
            "law does not stay within 5 % of its start even without it."
        )
    ]
    for plant in plan.grid.plants:
        laws = plan.grid.laws
        found = work.kept(
            f"margins-{plant}.json",
            [laws, plan.kinds, plan.quick, GAINS],
            lambda report, plant=plant, laws=laws: margin_search.margins(
                plant, laws, plan.kinds, GAINS, plan.quick, work.threads, report
            ),
            lambda found, path: write_json(path, [dataclasses.asdict(one) for one in found]),
            lambda path: [Margin(**entry) for entry in read_json(path)],
        )
        parts += tables([margin_table(plant, found)])
    return Section("margins", "Margins", parts)


def margin_table(plant: str, found: Sequence[Margin]) -> Tabular:
    """Return the margins of laws on a plant."""
    units = {margin.kind: margin.unit for margin in found}
    heads = []
    for kind, unit in units.items():
        label = MARGIN_KINDS[kind].label
        heads.append(label if unit == "1" else f"{label} ({unit})")
    rows: dict[str, list[Cell | str]] = {}
    for margin in found:
        theory = margin.theory
        if theory is None:
            below = ""
        else:
            below = f"theory {number(theory)}"
        rows.setdefault(margin.law, [margin.law]).append(Cell(margin.text, below))
    return Tabular(headings=["law", *heads], rows=list(rows.values()), title=plant)


def scenes(work: Work) -> list[Markup]:
    """Return films of the paper's laws side by side, and their traces."""
    plan = work.plan
    parts = []
    missing = video.missing() if plan.filmed else None
    if missing:
        parts.append(text(f"There are no films here: {missing}."))
    for k, plant in enumerate(plan.scenes):
        names = ", ".join(gaber_study.LAWS)
        runs = gaber_study.comparison(plant, duration=plan.scene, gains=GAINS)
        traces = run(list(runs.values()), work.threads)
        if k < plan.filmed and not missing:
            content = filmed(work, plant, traces)
            parts.append(page.film(content, f"{plant}, nominal, from the left: {names}."))
        parts.append(
            picture(
                lambda path, size, traces=traces: figure.figure(
                    traces, path, panels=("x", "u"), size=size
                ),
                f"{plant}, nominal: x and u of {names}.",
            )
        )
    return parts


def filmed(work: Work, plant: str, traces: Sequence[Trace]) -> bytes:
    """Return a film of traces, as MP4."""
    kept: Any = work.kept
    return kept(
        f"film-{plant}.mp4",
        [gaber_study.LAWS, work.plan.scene, GAINS, FILM_SIZE, FILM_RATE],
        lambda report: traces,
        lambda shown, path: video.film(shown, path, size=FILM_SIZE, fps=FILM_RATE),
        Path.read_bytes,
    )


def method(work: Work, compared: Compared) -> Section:
    """Return how the report was computed, what it does not tell, and what its words mean."""
    plan = work.plan
    first = compared.table.scenario(0)
    versions = json.loads(compared.table.column("versions")[0]) | {"scipy": version("scipy")}
    failed = sum(failure is not None for failure in compared.table.column("failure"))
    facts = {
        "runs": f"{len(compared.table)}, of which {failed} failed",
        "starts": "seed 0 the plant's own x0, every other seed within 20 % of it",
        "bound on u": f"|u| ≤ {first.resolved.u_max:g}, the same for every law",
        "control period": f"{1e3 * first.control_period:g} ms",
        "margins and claims": "quick: coarser, one set of gains" if plan.quick else "in full",
        "versions": ", ".join(f"{name} {number}" for name, number in versions.items()),
    }
    plant = find_plant(plan.grid.plants[0])
    conditions = []
    for name in plan.grid.conditions:
        fields = find_condition(name).brief(plant, plan.grid.duration)
        conditions.append((name, fields or "nothing"))
    meanings = [(metric.label, metric.unit_for("rad"), metric.summary) for metric in metrics()]
    shown = [
        Tabular(headings=["fact", ""], rows=list(facts.items()), title="What was run", left=2),
        Tabular(
            headings=["condition", "adds to the nominal run"],
            rows=conditions,
            title=f"Conditions, on {plant.name}",
            left=2,
        ),
        Tabular(headings=["metric", "unit", "is"], rows=meanings, title="Metrics", left=3),
    ]
    parts = [heading("What it does not tell"), *map(text, LIMITS), *tables(shown)]
    return Section("method", "How it was computed", parts)
