"""An adviser: which law suits a plant, its conditions and the needs of a user, with which gains,
and how sure that is.

A need is a metric to compare (fast, accurate, calm ...) or a property that a law must have
(continuous, two-gains ...). With "no-velocity", laws that read a velocity get one that is
differentiated from the position.

Every law that suits gets gains by one rule, and runs in each condition from the same seeds. Laws
are compared by the rules of `ranking`; a block is a need in a condition. No law is dropped early,
because a few seeds would then decide which law may be first. A law is not fit, and not compared, if
in some condition it settles in less than half as many runs as the law that settles most often: else
a law that does nothing would be the calmest. For "robust" an adversary attacks each law. There is
no test then, because a worst case is no sample.

A law dominates another if it is better in some block and worse in none. Laws are ordered by their
runs that fail, then by mean rank, but none comes before a law that dominates it. Laws that tie with
the next law are ordered by the metrics of `ties`, less first. The first law is advised, unless all
are level.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.bootstrap import Interval, median_of
from smc_mujoco.analysis.paired_runs import SETTLES, Group, Scores
from smc_mujoco.analysis.ranking import RELEVANT, Comparison, Rank, Relevant, linked, ranked, ranks
from smc_mujoco.analysis.tuning import search
from smc_mujoco.analysis.worst_case.uncertainty import Uncertainty, default_class
from smc_mujoco.common.constraints import FilePath, Positive, Whole, constrained
from smc_mujoco.common.errors import ScenarioError, unknown
from smc_mujoco.control import gain_sets, source
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.properties import PROPERTIES, suitable
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.conditions import DIFFERENCED, Condition, applicable, find_condition
from smc_mujoco.simulation.grid import Starts, case, check_moving, listed, listed_laws
from smc_mujoco.studies.advice import NEEDS, ROBUST, Advice, Choice, ties
from smc_mujoco.studies.fair_gains import Candidate, Trial, law_or_template
from smc_mujoco.studies.table import Table
from smc_mujoco.studies.worst_case import DURATION, WorstCase, default_budget

DEFAULT_NEEDS = ("fast", "accurate", "calm")
DEFAULT_CONDITIONS = ("nominal", "noise", "sine")
NO_VELOCITY = "no-velocity"
RELIABLE = 0.9  # share of the runs of every condition in which a reliable law settles; chosen
MIN_BUDGET = 16  # runs of an adversary in a condition, and as many random ones; chosen
MIN_SETTLED = 0.5  # of the share of runs that settle under the best law; chosen


class Extent(NamedTuple):
    """How much is run."""

    duration: float  # s, of a run
    searches: int  # of a tuning
    budget: int  # sets of gains that a search tries, for each gain
    parts: int  # divisor of an adversary's budget


FULL = Extent(5.0, search.SEARCHES, search.BUDGET, 1)
QUICK = Extent(3.0, 3, 16, 3)


@constrained
def which(
    plant: str | Plant,
    conditions: str | Condition | Sequence[str | Condition] | None = None,
    needs: str | Sequence[str] = (),
    laws: str | Component | Template | Sequence[str | Component | Template] | None = None,
    seeds: Annotated[int, Whole(low=1, high=10_000)] = 24,
    duration: Positive | None = None,
    starts: Starts | None = None,
    out: Annotated[str | Path, FilePath()] = "which",
    quick: bool = False,
    threads: int | None = None,
    progress: bool = False,
    defaults: bool = False,
    relevant: Relevant = RELEVANT,
    within: Uncertainty | None = None,
) -> Advice:
    """Advise a law for a plant: compare all laws that suit, with gains for the plant, and say how
    sure the answer is.

    Args:
      plant: a name, a Plant, or your own MJCF and its joints, as "arm.xml:shoulder,elbow".
      conditions: names, texts or Conditions, see `condition`. Default: nominal, noise and sine.
      needs: what to compare: "fast", "accurate" (at the end), "on-track" (on the way), "calm",
        "gentle", "frugal",
        "no-overshoot", "robust" (in the worst case); by default fast, accurate and calm. And what
        every law must have: "no-velocity", "continuous" and the other names in
        `smc_mujoco.control.properties.PROPERTIES`.
      laws: the laws to compare, by name or with your own gains. Default: all that suit.
      seeds: runs of a law in each condition, each with another start and other noise.
      duration: of a run, s. Default: 5, or 3 if quick; 8 under an adversary.
      out: folder for gains and runs, which another call reads.
      quick: shorter runs, three searches of 16 evaluations a gain in place of 12 of 64, and a third
        of an adversary's runs.
      defaults: whether a law may be advised over rivals whose gains are their defaults.
      starts, relevant, threads, progress: as in `compare`.
      within: the class for the need "robust". Default: that of `worst_case`.

    Raises:
      ScenarioError: an unknown name, no law that suits, or a need without a number on this plant.
    """
    extent = QUICK if quick else FULL
    machine = as_plant(plant)
    compared, properties = _needs(needs, machine)
    if duration is None:
        length = extent.duration
    else:
        length = duration
    tested = _conditions(conditions, machine, length, NO_VELOCITY in properties)
    trial = Trial([machine], tested, length, starts, Path(out), threads, progress)
    effort = _effort(trial)
    wanted = [name for name in properties if name != NO_VELOCITY]
    candidates = _candidates(trial, _suited(machine, wanted, laws), extent, defaults)
    table = trial.run({machine.name: [*candidates.values()]}, seeds)
    if ROBUST in compared:
        worst = _worst(trial, candidates, duration, within, extent.parts)
    else:
        worst = {}
    comparison, choices = _contest(table, worst, candidates, machine, compared, relevant)
    return Advice(
        plant=machine,
        conditions=tuple(condition.name for condition in tested),
        needs=compared,
        wanted=tuple(PROPERTIES[name].words for name in wanted),
        choices=choices,
        comparison=comparison,
        table=table,
        effort=effort,
        untuned=()
        if defaults
        else tuple(n for n, c in candidates.items() if c.law.source.kind == source.DEFAULT),
    )


# the question


def _needs(needs: str | Sequence[str], plant: Plant) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the needs that are metrics, and those that are properties."""
    if isinstance(needs, str):
        needs = [name.strip() for name in needs.split(",") if name.strip()]
    if needs:
        names = list(dict.fromkeys(listed("needs", needs)))
    else:
        names = []
    for name in names:
        if name not in NEEDS and name not in PROPERTIES:
            raise unknown("need", name, [*NEEDS, *PROPERTIES])
    compared = [name for name in names if name in NEEDS]
    for name in compared:
        if why := NEEDS[name].refusal(plant):
            raise ScenarioError(f"need {name!r} cannot be compared on {plant.name}: {why}")
    compared = compared or [name for name in DEFAULT_NEEDS if not NEEDS[name].refusal(plant)]
    return tuple(compared), tuple(name for name in names if name in PROPERTIES)


def _conditions(
    given: Any, plant: Plant, duration: float, without_velocity: bool
) -> list[Condition]:
    """Return the given conditions, or the default ones that have numbers for the plant."""
    if given is None:
        names = applicable(DEFAULT_CONDITIONS, [plant], duration)
    else:
        names = listed("conditions", given)
    chosen = [find_condition(name) for name in names]
    if without_velocity:
        return [_without_velocity(condition) for condition in chosen]
    return chosen


def _without_velocity(condition: Condition) -> Condition:
    """Return a condition without a velocity sensor, unless it has its own sensor or velocity."""

    def fields(plant: Plant, duration: float) -> dict[str, Any]:
        given = condition.on(plant, duration)
        if given.keys() & {"velocity", "sensor"}:
            return given
        return given | {"velocity": DIFFERENCED}

    return Condition(f"{condition.name} (no velocity sensor)", fields)


def _effort(trial: Trial) -> str:
    """Return the unit of u, or "" where conditions differ; refuse conditions in which nothing
    moves.
    """
    plant = trial.plants[0]
    efforts = set()
    for condition in trial.conditions:
        scenario = case(plant, "none", condition, trial.duration, starts=trial.starts)
        check_moving([scenario])
        efforts.add(scenario.efforts[0])
    return efforts.pop() if len(efforts) == 1 else ""


def _suited(plant: Plant, properties: Sequence[str], laws: Any) -> Sequence[Component | Template]:
    """Return the laws to compare. Those without given gains are templates."""
    if laws is None:
        left_out = {
            "none",
            *gain_sets.ALIASES,
        }  # aliases have the gains of laws that are there already
        chosen = [law for law in suitable(properties, plant=plant) if law.name not in left_out]
    else:
        chosen = [law for law in map(law_or_template, listed_laws(laws)) if _has(law, properties)]
    if not chosen and not properties:
        raise ScenarioError(
            f"the package has no law for {plant.name}: give your own with laws, as [my_law]"
        )
    if not chosen:
        words = " and ".join(PROPERTIES[name].words for name in properties)
        raise ScenarioError(f"no law for {plant.name} is among those that {words}: ask for less")
    return chosen


def _has(law: Component | Template, properties: Sequence[str]) -> bool:
    """Return whether a law has the properties, as far as that is known."""
    if isinstance(law, Template):
        template = law
    else:
        template = law.template
    return template is None or all(PROPERTIES[name].holds(template) for name in properties)


def _candidates(
    trial: Trial, laws: Sequence[Component | Template], extent: Extent, defaults: bool
) -> dict[str, Candidate]:
    """Return name of the law -> the law with gains; raise ScenarioError if two laws have one name."""
    options = {"defaults": defaults, "searches": extent.searches, "budget": extent.budget}
    (candidates,) = trial.gains({trial.plants[0].name: laws}, **options).values()
    by_name = {candidate.law.name: candidate for candidate in candidates}
    if len(by_name) < len(candidates):
        raise ScenarioError(
            "two laws have one name: name one of them, as smc.law(...).named('slow')"
        )
    return by_name


# the comparison


def _worst(
    trial: Trial,
    candidates: Mapping[str, Candidate],
    duration: float | None,
    within: Uncertainty | None,
    parts: int,
) -> dict[str, list[WorstCase]]:
    """Return law -> its worst case in each condition; the default budget is divided by the
    conditions and by `parts`.

    All laws are attacked within one class, by default that of the first one.
    """
    (plant,), length = trial.plants, DURATION if duration is None else duration
    scenarios = {}
    for name, candidate in candidates.items():
        scenarios[name] = [
            case(plant, candidate.law, condition, length, starts=trial.starts)
            for condition in trial.conditions
        ]
    first = next(iter(scenarios.values()))[0]
    within = within or default_class(first)
    budget = max(MIN_BUDGET, default_budget(first, within) // (len(trial.conditions) * parts))
    return {
        name: [
            trial.attack(f"{i}-{plant.name}-{name}", attacked, within, budget)
            for i, attacked in enumerate(of_law)
        ]
        for name, of_law in scenarios.items()
    }


def _contest(
    table: Table,
    worst: Mapping[str, Sequence[WorstCase]],
    candidates: Mapping[str, Candidate],
    plant: Plant,
    needs: Sequence[str],
    relevant: float,
) -> tuple[Comparison, tuple[Choice, ...]]:
    """Compare laws over all needs and conditions; those that are not fit come last, with NaN for a
    rank.
    """
    (group,) = paired_runs.groups(table, by=("plant",))
    rows = paired_runs.values(table, SETTLES)[group.rows]
    settled = 1.0 - np.nanmean(
        np.where(group.rows >= 0, rows, np.nan), axis=2
    )  # (laws, conditions)
    enough = np.all(settled >= MIN_SETTLED * settled.max(axis=0), axis=1)
    fit = {law for law, settles in zip(group.laws, enough.tolist(), strict=True) if settles}
    laws = [law for law in group.laws if law in fit] or group.laws
    scores = {need: _scores(need, table, group, worst) for need in needs}
    for need, its in scores.items():
        if not its.blocks:
            raise ScenarioError(
                f"need {need!r} has no number in any run on {plant.name}: leave it out"
            )
    blocks = [(need, k) for need, its in scores.items() for k in its.blocks]
    ran = paired_runs.scenarios(table, group)
    comparison = Comparison(
        _stacked([its.values for its in scores.values()], laws, math.nan),
        [paired_runs.floor(ran[k], NEEDS[need].name) for need, k in blocks],
        outcomes=_stacked([its.outcomes for its in scores.values()], laws),
        sets=_stacked([its.sets for its in scores.values()], laws),
        relevant=relevant,
        untested=[need == ROBUST for need, _ in blocks],
        halves=_stacked([its.halves for its in scores.values()], laws, math.nan),
        trends=_stacked([its.trends for its in scores.values()], laws, math.nan),
    )
    order = _order(comparison, _restraint(table, group, ran, plant, relevant))
    order += [Rank(law, math.nan, math.nan, best=False) for law in group.laws if law not in laws]
    shares = dict(zip(group.laws, settled, strict=True))
    return comparison, tuple(
        Choice(
            law=candidates[rank.law].law,
            remark=candidates[rank.law].remark,
            rank=rank,
            settles=float(shares[rank.law].mean()),
            reliable=bool((shares[rank.law] >= RELIABLE).all()),
            fit=rank.law in fit,
            medians={need: _median(need, its, rank.law) for need, its in scores.items()},
            worst=tuple(worst.get(rank.law, ())),
        )
        for rank in order
    )


def _scores(
    need: str, table: Table, group: Group, worst: Mapping[str, Sequence[WorstCase]]
) -> Scores:
    """Return the scores of all laws on a need; for "robust" the values of their worst cases,
    (conditions, 1).
    """
    if need != ROBUST:
        return group.scores(paired_runs.by_row(table, NEEDS[need].name))
    values = {law: np.array([[case.value] for case in cases]) for law, cases in worst.items()}
    zeros = dict.fromkeys(values, np.zeros((len(group.blocks), 1), np.int64))
    unknown = dict.fromkeys(values, np.full((len(group.blocks), 1), math.nan))
    return Scores([*range(len(group.blocks))], values, zeros, zeros, unknown, unknown)


def _median(need: str, scores: Scores, law: str) -> Interval:
    """Return a law's median over the conditions; for "robust" its largest value."""
    if need == ROBUST:
        return Interval(float(scores.values[law].max()), math.nan, math.nan, 1)
    return median_of(scores.values[law], linked(*scores.sets[law]))


def _stacked(
    parts: Sequence[Mapping[str, np.ndarray]], laws: Sequence[str], fill: float = -1
) -> dict[str, np.ndarray]:
    """Return law -> the blocks of all parts, (blocks, columns).

    Parts with fewer columns are filled up.
    """
    columns = max(values.shape[1] for part in parts for values in part.values())

    def filled(values: np.ndarray) -> np.ndarray:
        return np.pad(values, ((0, 0), (0, columns - values.shape[1])), constant_values=fill)

    return {law: np.concatenate([filled(part[law]) for part in parts]) for law in laws}


def _restraint(
    table: Table, group: Group, ran: Sequence, plant: Plant, relevant: float
) -> dict[str, tuple[float, ...]]:
    """Return law -> its mean rank on each of the metrics of `ties`."""
    mean_ranks = []
    laws = group.laws
    for metric in ties(plant):
        scores = group.scores(paired_runs.by_row(table, metric.name))
        if scores.blocks:
            centres = np.array([np.nanmedian(scores.values[law], axis=1) for law in laws])
            floors = np.array([paired_runs.floor(ran[k], metric.name) for k in scores.blocks])
            mean_ranks.append(ranked(centres, floors, relevant=relevant).mean(axis=1))
    return {law: tuple(float(mean[i]) for mean in mean_ranks) for i, law in enumerate(laws)}


def _order(comparison: Comparison, restraint: Mapping[str, tuple[float, ...]]) -> list[Rank]:
    """Return the laws by mean rank, but none before a law that dominates it, and laws that tie by
    `restraint`.
    """
    ahead = np.any(comparison.better, axis=0)
    dominates = np.logical_and(ahead, ~ahead.T)
    place = {law: k for k, law in enumerate(comparison.laws)}
    left = ranks(comparison)
    ordered = []
    while left:
        at = [place[rank.law] for rank in left]
        undominated = [rank for rank in left if not dominates[at, place[rank.law]].any()]
        undominated = undominated or left[:1]  # laws may dominate each other in a circle
        next_law = place[undominated[0].law]
        tied = [rank for rank in undominated if comparison.tied[next_law, place[rank.law]]]
        ordered.append(min(tied, key=lambda rank: restraint[rank.law]))
        left.remove(ordered[-1])
    return ordered
