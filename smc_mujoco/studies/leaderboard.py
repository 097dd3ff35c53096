"""Leaderboards: comparison of a study's laws on equal runs, with the uncertainty of every number.

A board is one metric in one group of runs. Laws are compared by the rules of `analysis.ranking` in
each of its blocks, a plant in a condition. The tests are corrected for all blocks of the table in
this metric, so the verdict on a block is the same on every board that has it. The winner of a board
with several blocks wins in every one. The conclusions hold for the plants and conditions of the
table, over initial states and noise, and over the gains with which the laws ran.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.bootstrap import median_of, share_interval
from smc_mujoco.analysis.paired_runs import (
    EPS,
    OBJECTIVE,
    SETTLES,
    UNITS,
    ByRow,
    Columns,
    Group,
    Scores,
)
from smc_mujoco.analysis.ranking import (
    RELEVANT,
    Comparison,
    Limits,
    corrected_limits,
    linked,
    ranks,
)
from smc_mujoco.analysis.step_halving import first_order, repeats_all
from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.control.source import DEFAULT, Source
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.studies.board import Block, Board, Boards, Entry, Lead

if TYPE_CHECKING:
    from smc_mujoco.studies.worst_case import WorstCase

METRICS = (SETTLES, "settling_time", "ultimate_bound", "itae", "tv_rate")


class Unseen(NamedTuple):
    """J of the laws on one plant, on instances that no search has seen: law -> (instances,)."""

    values: Mapping[str, np.ndarray]  # s^2
    halves: Mapping[
        str, np.ndarray
    ]  # the same at half the physics step, NaN where it was not computed
    sets: Mapping[str, np.ndarray]  # the number of the set of gains
    least: float  # s^2, J of an error that is X0 throughout


def leaderboard(
    table: Columns,
    metrics: Sequence[str] = METRICS,
    by: Sequence[str] = ("plant",),
    defaults: bool = False,
    relevant: float = RELEVANT,
    worst: "Mapping[str, Mapping[str, WorstCase]] | None" = None,
) -> Boards:
    """Compare the laws of a table in each metric within each group.

    Only cells (plant, condition, seed) that every law of the group has are compared. A failed run
    is inf in all metrics. For two laws, a seed in which both repeat their results of an earlier
    seed is not counted. Runs that share one of several sets of gains of a law are one sample. A
    metric that does not apply to a group has no board for it.

    Args:
      table: a study's runs, as `smc.Table.read` returns them.
      metrics: names of metrics, for which lower is better, or "settles".
      by: what the runs of a group have in common: ("plant",), or ("plant", "condition").
      defaults: whether a winner may be named over laws whose gains are their defaults.
      relevant: the least relevant difference, as a share of the larger value. Values below
        `paired_runs.floor` count as equal, and a lead that is less than it is called that.
      worst: plant -> law -> its `worst_case`, for a column of the tables of a plant.

    Raises:
      ScenarioError: no runs, an unknown metric or group, two runs in a cell, laws without a common
        cell, or a worst case of a plant or law that has no run.
    """
    if isinstance(metrics, str) or not metrics:
        raise ScenarioError(f"metrics is {shown(metrics)}: give names, such as ('itae', 'tv_rate')")
    for name in metrics:
        find("metric", name, {known: unit for known, unit in UNITS.items() if known != OBJECTIVE})
    _check_worst(table, worst or {})
    boards = Boards()
    boards.worst = worst or {}
    boards.failures = paired_runs.failures(table)
    by_row = {name: paired_runs.by_row(table, name) for name in dict.fromkeys(metrics)}
    groups = list(paired_runs.groups(table, by))
    if set(by) == set(paired_runs.GROUPS):
        every = groups
    else:
        every = list(paired_runs.groups(table, paired_runs.GROUPS))
    families = {
        name: _family(table, every, values, name, relevant) for name, values in by_row.items()
    }
    for group in groups:
        ran = paired_runs.scenarios(table, group)
        sources = paired_runs.sources(table, group.rows[group.rows >= 0])
        at_default = (
            law for law, its in sources.items() if any(source.kind == DEFAULT for source in its)
        )
        untuned = () if defaults else tuple(at_default)
        for metric, values in by_row.items():
            limits, family = families[metric]
            scores = group.scores(values)
            if scores.blocks:
                comparison = _compared(scores, ran, metric, relevant, limits)
                boards.append(
                    _board(group, scores, ran, metric, comparison, untuned, sources, family)
                )
    return boards


def objective_boards(
    unseen: Mapping[str, Unseen],
    sources: Mapping[str, Mapping[str, tuple[Source, ...]]],
    defaults: bool,
    relevant: float,
) -> list[Board]:
    """Return a board of J on unseen instances for each plant.

    `sources` is plant -> law -> those of its gains. Others as in `leaderboard`.
    """

    def compared(plant: str, limits: Limits) -> Comparison:
        its = unseen[plant]
        return Comparison(
            its.values,
            EPS * its.least,
            sets=its.sets,
            relevant=relevant,
            limits=limits,
            halves=its.halves,
        )

    alone = [compared(plant, Limits(0.0, 0.0)) for plant in unseen]
    limits = corrected_limits(alone)
    boards = []
    for plant in unseen:
        comparison = compared(plant, limits)
        its = sources.get(plant, {})
        if defaults:
            untuned = ()
        else:
            untuned = tuple(law for law in its if any(one.kind == DEFAULT for one in its[law]))
        count = len(next(iter(unseen[plant].values.values())))
        block = _block((plant, "unseen runs"), count, comparison, 0, untuned)
        sets = {law: np.atleast_2d(numbers) for law, numbers in unseen[plant].sets.items()}
        boards.append(
            Board(
                group={"plant": plant},
                metric=OBJECTIVE,
                unit=UNITS[OBJECTIVE],
                entries=_entries(comparison, sets, its),
                blocks=(block,),
                family=sum(len(one.laws) > 1 for one in alone) or 1,
                relevant=relevant,
                resolution=float(comparison.floors.max()),
                by_step=False,
            )
        )
    return boards


def _check_worst(table: Columns, worst: Mapping[str, Mapping[str, "WorstCase"]]) -> None:
    """Raise ScenarioError for the worst case of a law that has no run on the plant."""
    if worst:
        ran = set(zip(table.column("plant").tolist(), table.column("law").tolist(), strict=True))
    else:
        ran = set()
    for plant, cases in worst.items():
        for law in cases:
            if (plant, law) not in ran:
                raise ScenarioError(
                    f"worst has {law} on {plant}, which has no run in the table: leave it out"
                )


def _board(
    group: Group,
    scores: Scores,
    ran: Sequence[Scenario | None],
    metric: str,
    comparison: Comparison,
    untuned: tuple[str, ...],
    sources: Mapping[str, tuple[Source, ...]],
    family: int,
) -> Board:
    """Return the board of a comparison, whose limits are corrected for `family` comparisons."""
    unit = UNITS[metric]
    others = {
        one.efforts[0] if (one := ran[k]) is not None and not one.force_command else ""
        for k in scores.blocks
    }
    if len(others) == 1 and (other := others.pop()):
        unit = unit.replace("({u})", other if other.isalpha() else f"({other})").replace(
            "{u}", other
        )
    blocks = tuple(
        _block(group.blocks[k], group.seeds[k], comparison, at, untuned)
        for at, k in enumerate(scores.blocks)
    )
    return Board(
        group=group.name,
        metric=metric,
        unit=unit,
        entries=_entries(comparison, scores.sets, sources),
        blocks=blocks,
        family=family,
        relevant=comparison.relevant,
        resolution=float(comparison.floors.max()),
        by_step=bool(np.isnan(comparison.halves).all())
        and any(map(repeats_all, filter(None, ran))),
        x=paired_runs.unit_of_x(group.name["plant"], ran),
    )


def _compared(
    scores: Scores, ran: Sequence[Scenario | None], metric: str, relevant: float, limits: Limits
) -> Comparison:
    """Compare the scores of laws in a metric; `ran` has a scenario of each block of the group."""
    return Comparison(
        scores.values,
        [paired_runs.floor(ran[k], metric) for k in scores.blocks],
        shares=metric == SETTLES,
        outcomes=scores.outcomes,
        sets=scores.sets,
        relevant=relevant,
        limits=limits,
        halves=scores.halves,
        trends=scores.trends,
        first_order=[(of := ran[k]) is not None and first_order(of) for k in scores.blocks],
    )


def _family(
    table: Columns, blocks: Sequence[Group], by_row: ByRow, metric: str, relevant: float
) -> tuple[Limits, int]:
    """Return the limits of the p-values of a metric, corrected for all blocks of a table, and the
    number of these.
    """
    comparisons = []
    for group in blocks:
        try:
            scores = group.scores(by_row)
        except ScenarioError:  # laws that share no run: there is nothing to compare
            continue
        if scores.values:
            ran = paired_runs.scenarios(table, group)
            comparisons.append(_compared(scores, ran, metric, relevant, Limits(0.0, 0.0)))
    return corrected_limits(comparisons), sum(
        len(comparison.laws) > 1 for comparison in comparisons
    ) or 1


def _block(
    name: tuple[str, str],
    seeds: int,
    comparison: Comparison,
    at: int,
    untuned: tuple[str, ...],
) -> Block:
    """Return block `at` of a comparison, with its plant and condition and the number of seeds."""
    sets = comparison.sets[:, at]
    return Block(
        plant=name[0],
        condition=name[1],
        medians=dict(zip(comparison.laws, comparison.centres[:, at].tolist(), strict=True)),
        lacking=dict(zip(comparison.laws, comparison.without_value[:, at].tolist(), strict=True)),
        best=comparison.best[at],
        undecided=tuple(np.array(comparison.laws)[comparison.undecided[:, at]].tolist()),
        worse=tuple(np.array(comparison.laws)[comparison.worse[:, at]].tolist()),
        ahead=comparison.winners[at],
        lead=_lead(comparison, at),
        level=_level(comparison, at),
        visible=_visible(comparison, at),
        by_step={
            law: change for law in comparison.laws if (change := comparison.step_change(at, law))
        },
        seeds=seeds,
        runs=int(comparison.seeds[at]),
        samples=int(comparison.samples[at].max())
        if len(comparison.laws) > 1
        else int(comparison.seeds[at]),
        sets=int(sets[sets > 1].min()) if (sets > 1).any() else 1,
        given=tuple(
            law for law, n in zip(comparison.laws, sets, strict=True) if n == 1 and (sets > 1).any()
        ),
        untuned=untuned,
    )


def _lead(comparison: Comparison, at: int) -> Lead | None:
    """Return how the law in front of a block compares with its closest rival, that with the largest
    p-value.
    """
    if len(comparison.laws) < 2 or comparison.shares:
        return None
    lacking = comparison.without_value[:, at]
    winner = comparison.winners[at]
    order = sorted(
        range(len(comparison.laws)), key=lambda i: (lacking[i], comparison.centres[i, at])
    )
    if winner is None:
        first = order[0]
    else:
        first = comparison.laws.index(winner)
    if lacking[first]:
        return None
    rival = max((i for i in order if i != first), key=lambda i: comparison.p[at, first, i])
    names = comparison.laws[first], comparison.laws[rival]
    effect = comparison.effect(at, *names)
    apart = abs(float(comparison.centres[rival, at] - comparison.centres[first, at]))
    if effect.samples:
        return Lead(*names, effect, apart < float(comparison.floors[at]))
    return None


def _level(comparison: Comparison, at: int) -> bool:
    """Return whether the laws of a block that are not beaten are all level with each other."""
    best = [comparison.laws.index(law) for law in comparison.best[at]]
    return (
        bool(comparison.level[at][np.ix_(best, best)].all())
        and not comparison.undecided[:, at].any()
    )


def _visible(comparison: Comparison, at: int) -> dict[str, float]:
    """Return law -> the least lead that would have been seen between it and the law in front; {}
    without a test.

    For the law in front it is that over its closest rival.
    """
    if len(comparison.laws) < 2 or comparison.shares or comparison.untested[at]:
        return {}
    lacking = comparison.without_value[:, at]
    order = sorted(
        range(len(comparison.laws)), key=lambda i: (lacking[i], comparison.centres[i, at])
    )
    first, *others = order
    rival = max(others, key=lambda i: comparison.p[at, first, i])
    pairs = {first: (first, rival)} | {other: (first, other) for other in others}
    names = comparison.laws
    return {
        names[i]: comparison.visible(at, names[a], names[b]) for i, (a, b) in sorted(pairs.items())
    }


def _entries(
    comparison: Comparison,
    sets: Mapping[str, np.ndarray],
    sources: Mapping[str, tuple[Source, ...]],
) -> tuple[Entry, ...]:
    """Return the entries of all laws."""
    entries = []
    for rank in ranks(comparison):
        at = comparison.laws.index(rank.law)
        values = comparison.cells[at]
        samples = linked(*sets[rank.law])
        if comparison.shares:
            if samples is None:
                n = values.shape[1]
            else:
                n = max(samples) + 1
            interval = share_interval(float(1 - np.nanmean(values, axis=1).mean()), n)
        else:
            interval = median_of(values, samples)
        failed = int(comparison.without_value[at].sum())
        runs = int((~np.isnan(values)).sum())
        its = sources.get(rank.law, ())
        known = {"law": rank.law, "sources": its}
        entries.append(Entry(interval=interval, rank=rank, failed=failed, runs=runs, **known))
    return tuple(entries)
