"""Leaderboards: comparison of a study's laws on equal runs, with the uncertainty of every number.

A board is one metric in one group of runs. Laws are compared by the rules of `analysis.ranking` in
each of its blocks, a plant in a condition. Winners are corrected for all blocks of the boards in
this metric. The winner of a board with several blocks wins in every one. The conclusions hold for
the plants and conditions of the table, over initial states and noise, and over the gains with which
the laws ran.
"""

import dataclasses
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.bootstrap import Interval, median_of, share_interval
from smc_mujoco.analysis.paired_runs import (
    EPS,
    OBJECTIVE,
    OF_J,
    SETTLES,
    UNITS,
    RunColumns,
    RunGroup,
    Scores,
)
from smc_mujoco.analysis.ranking import Comparison, corrected, linked, ranks
from smc_mujoco.analysis.relevant import RELEVANT
from smc_mujoco.analysis.step_halving import first_order, repeats_every_run
from smc_mujoco.answers.facts import Lead, Trails
from smc_mujoco.common.aliases import Array, Names
from smc_mujoco.common.errors import ScenarioError, find, items_of, shown
from smc_mujoco.common.text import joined
from smc_mujoco.control.source import DEFAULT, Source
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.studies.board import Block, Board, BoardEntry, label_of
from smc_mujoco.studies.board_tables import Boards

METRICS = (SETTLES, "settling_time", "ultimate_bound", "itae", "tv_rate")
MAX_RATIO = 4.0  # of the ends of a median's interval, above which it says too little; chosen
Sources = Mapping[str, tuple[Source, ...]]  # law -> those of its gains


class Holdout(NamedTuple):
    """J of the laws on one plant, on instances that no search has seen: law -> (instances,)."""

    values: Mapping[str, Array]  # s^2
    arrived: Mapping[str, Array]  # whether all runs of an instance have arrived
    halves: Mapping[str, Array]  # at half the physics step, NaN where it was not computed
    sets: Mapping[str, Array]  # the number of the set of gains
    least: float  # s^2, J of an error that is X0 throughout
    conditions: Names  # whose runs J sums


def leaderboard(
    table: RunColumns,
    metrics: Sequence[str] = METRICS,
    by: Sequence[str] = ("plant",),
    defaults: bool = False,
    relevant: float = RELEVANT,
) -> Boards:
    """Compare the laws of a table in each metric within each group.

        table = smc.study(smc.grid("duffing", ["pid", "adrc"], "noise", duration=1.0), "study")
        print(smc.leaderboard(table, ["itae"]))

    Only cells (plant, condition, seed) that every law of the group has are compared. A failed run
    is inf in all metrics. Of two laws, a seed that gives both the same results as an earlier seed
    tells nothing new, and is not counted. Runs that share one of several sets of gains of a law are
    one sample. For an ensemble of machines give each seed a `mismatch` of its own, and name all
    these runs alike with `Scenario.named`: a condition for each machine adds no sample. Where the
    seeds are too few for a verdict, the board says how many it takes. A metric that does not apply
    to a group has no board for it.

    Args:
      table: a study's runs, as `smc.Table.read` returns them.
      metrics: names of metrics, for which lower is better, or "settles".
      by: what the runs of a group have in common: ("plant",), or ("plant", "condition").
      defaults: whether a winner may be named over laws whose gains are their defaults.
      relevant: the least relevant difference, as a share of the larger value. Values below
        `paired_runs.floor` count as equal, and a lead that is less than it is called that.

    Returns:
      A list of `Board`, one for each group and metric, which prints as tables.

    Raises:
      ScenarioError: no runs, an unknown metric or group, two runs in a cell, or laws without a
        common cell.
    """
    if isinstance(metrics, str) or not items_of("metrics", metrics):
        raise ScenarioError(f"metrics is {shown(metrics)}: give names, such as ('itae', 'tv_rate')")
    units = dict(UNITS)
    del units[OBJECTIVE]
    for name in metrics:
        find("metric", name, units)
    paired_runs.check_table(table)
    boards = Boards()
    boards.failures = paired_runs.failures(table)
    boards.untouched = paired_runs.untouched(table)
    boards.labels = paired_runs.labels(table)
    boards.plants = plants = {}
    ranked = []
    for group in paired_runs.groups(table, by):
        sources = paired_runs.sources(table, group.rows[group.rows >= 0])
        ran = paired_runs.scenarios(table, group)
        for scenario in filter(None, ran):
            plants[scenario.plant.name] = scenario.plant
        ranked.append(RankedGroup(group, ran, sources))
    boards.commands = _commands(ranked)
    by_metric = {}
    for metric in dict.fromkeys(metrics):
        by_metric[metric] = _boards_of(table, metric, ranked, defaults, relevant)
    for i in range(len(ranked)):
        for boards_of_metric in by_metric.values():
            if i in boards_of_metric:
                boards.append(boards_of_metric[i])
    boards.absent = _absent(metrics, ranked)
    return boards


def _absent(metrics: Sequence[str], ranked: Sequence["RankedGroup"]) -> list[str]:
    """Return why metrics have no single value in the runs of groups, or are not compared there."""
    reasons = []
    unjudged: dict[tuple[str, str], list[str]] = {}  # plant and condition -> metrics
    for metric in metrics:
        for group in ranked:
            scenario = next(filter(None, group.ran), None)
            if scenario and metric in CATALOGUE:
                reasons.append(CATALOGUE[metric].refusal(scenario))
            for block, ran in zip(group.group.blocks, group.ran, strict=True):
                if not paired_runs.is_judged(ran, metric):
                    unjudged.setdefault(block, []).append(metric)
    for (plant, condition), names in unjudged.items():
        verb = "is" if len(names) == 1 else "are"
        reasons.append(
            f"{joined(names)} {verb} not compared on {plant} under {condition}: the last part of a "
            "run needs two periods of the load, so give a longer duration"
        )
    return list(dict.fromkeys(filter(None, reasons)))


class RankedGroup(NamedTuple):
    """A group whose laws are compared."""

    group: RunGroup
    ran: Sequence[Scenario | None]  # a scenario of each block
    sources: Sources


def _commands(ranked: Sequence[RankedGroup]) -> list[str]:
    """Return what the commands of the drives mean, and that default gains are for a force."""
    words: list[str] = []
    for ranked_group in ranked:
        for scenario in filter(None, ranked_group.ran):
            words += scenario.drive_train.words
        if words and any(map(_is_default, itertools.chain(*ranked_group.sources.values()))):
            words.append("Default gains are for a force: tune them for this u first.")
    return [*dict.fromkeys(words)]


def _boards_of(
    table: RunColumns,
    metric: str,
    ranked: Sequence[RankedGroup],
    defaults: bool,
    relevant: float,
) -> dict[int, Board]:
    """Return the board of a metric for each group, by its number, to which the metric applies.
    Winners are corrected for all of them.
    """
    by_row = paired_runs.by_row(table, metric)
    scores = []
    compared = {}
    for i, ranked_group in enumerate(ranked):
        judged = [paired_runs.is_judged(scenario, metric) for scenario in ranked_group.ran]
        of_group = ranked_group.group.scores(by_row, judged)
        scores.append(of_group)
        if of_group.blocks:
            compared[i] = _compared(of_group, ranked_group.ran, metric, relevant)
    corrected([*compared.values()])
    family = _family(compared.values())
    boards = {}
    for i, comparison in compared.items():
        group, ran, sources = ranked[i]
        untuned = _untuned(sources, defaults)
        boards[i] = _board(group, scores[i], ran, metric, comparison, untuned, sources, family)
    return boards


def objective_boards(
    holdout: Mapping[str, Holdout], sources: Mapping[str, Sources], defaults: bool, relevant: float
) -> list[Board]:
    """Return a board of J on unseen instances for each plant.

    `sources` is by plant. Others as in `leaderboard`.
    """
    compared = {}
    for plant, runs in holdout.items():
        compared[plant] = Comparison(
            runs.values,
            EPS * runs.least,
            sets=runs.sets,
            relevant=relevant,
            halves=runs.halves,
            arrived=runs.arrived,
        )
    corrected([*compared.values()])
    boards = []
    for plant, comparison in compared.items():
        untuned = _untuned(sources[plant], defaults)
        sets = {}
        for law, numbers in holdout[plant].sets.items():
            sets[law] = np.atleast_2d(numbers)
        about = (plant, "unseen runs"), int(comparison.seeds[0]), comparison, 0
        block = _block(*about, untuned, "", OBJECTIVE)
        boards.append(
            Board(
                group={"plant": plant},
                metric=OBJECTIVE,
                unit=UNITS[OBJECTIVE],
                entries=_entries(comparison, sets, sources[plant]),
                blocks=(block,),
                family=_family(compared.values()),
                relevant=relevant,
                by_step=False,
                summed=holdout[plant].conditions,
            )
        )
    return boards


def _family(comparisons: Iterable[Comparison]) -> int:
    """Return the number of blocks for which winners are corrected."""
    count = 0
    for comparison in comparisons:
        if len(comparison.laws) > 1:
            count += len(comparison.floors)
    return count or 1


def _untuned(sources: Sources, defaults: bool) -> Names:
    """Return the laws with default gains, over which no winner is named; none if `defaults`."""
    if defaults:
        return ()
    untuned = []
    for law, of_law in sources.items():
        if any(map(_is_default, of_law)):
            untuned.append(law)
    return tuple(untuned)


def _is_default(source: Source) -> bool:
    return source.kind == DEFAULT


def _board(
    group: RunGroup,
    scores: Scores,
    ran: Sequence[Scenario | None],
    metric: str,
    comparison: Comparison,
    untuned: Names,
    sources: Sources,
    family: int,
) -> Board:
    """Return the board of a comparison, whose winners are corrected for `family` blocks."""
    blocks = []
    of_blocks = []
    for block_number, k in enumerate(scores.blocks):
        of_blocks.append(ran[k])
        floor = paired_runs.floor_words(ran[k], metric)
        about = group.blocks[k], group.seeds[k], comparison, block_number
        block = _block(*about, untuned, floor, metric)
        blocks.append(dataclasses.replace(block, bound=_bound(ran[k])))
    repeated = not np.isnan(comparison.halves).all()
    return Board(
        group=group.name,
        metric=metric,
        unit=_unit(metric, of_blocks),
        entries=_entries(comparison, scores.sets, sources),
        blocks=tuple(blocks),
        family=family,
        relevant=comparison.relevant,
        by_step=not repeated and any(map(repeats_every_run, filter(None, ran))),
        x=paired_runs.unit_of_x(group.name["plant"], ran),
    )


def _bound(scenario: Scenario | None) -> float:
    """Return the bound on |u|; NaN where it is not one finite number for all joints."""
    bounds = set() if scenario is None else set(scenario.limits)
    bound = bounds.pop() if len(bounds) == 1 else math.nan
    return bound if math.isfinite(bound) else math.nan


def _unit(metric: str, ran: Sequence[Scenario | None]) -> str:
    """Return the unit of a metric, with that of u where it is no force and the same in all
    blocks.
    """
    effort = paired_runs.unit_of_u(ran)
    if not effort:
        return UNITS[metric]
    bracketed = effort if effort.isalpha() else f"({effort})"
    return UNITS[metric].replace("({u})", bracketed).replace("{u}", effort)


def _compared(
    scores: Scores, ran: Sequence[Scenario | None], metric: str, relevant: float
) -> Comparison:
    """Compare the scores of laws in a metric; `ran` has a scenario of each block of the group."""
    floors = []
    of_first_order = []
    powers = []
    for k in scores.blocks:
        scenario = ran[k]
        powers.append(paired_runs.trend_power(scenario))
        floors.append(paired_runs.floor(scenario, metric))
        of_first_order.append(scenario is not None and first_order(scenario))
    return Comparison(
        scores.values,
        floors,
        shares=metric == SETTLES,
        outcomes=scores.outcomes,
        sets=scores.sets,
        relevant=relevant,
        halves=scores.halves,
        trends=scores.trends,
        arrived=scores.arrived,
        first_order=of_first_order,
        powers=powers,
    )


def _block(
    name: tuple[str, str],
    seeds: int,
    comparison: Comparison,
    at: int,
    untuned: Names,
    floor: str,
    metric: str,
) -> Block:
    """Return block `at` of a comparison, with its plant and condition, and the number of seeds."""
    laws = np.array(comparison.laws)
    sets = comparison.sets[:, at]
    by_step = {}
    for law in comparison.laws:
        change = comparison.step_change(at, law)
        if change:
            by_step[law] = change
    centres = comparison.centres[:, at].tolist()
    medians = dict(zip(comparison.laws, centres, strict=True))
    without = comparison.without_value[:, at].tolist()
    lacking = dict(zip(comparison.laws, without, strict=True))
    best = comparison.best[:, at]
    below = comparison.below[:, at]
    low = comparison.centres[:, at] <= comparison.floors[at]
    units = comparison.units[:, at]
    away = comparison.away[:, at].any(axis=1)
    few = ~comparison.ranked[:, at]
    sets_of_few = dict(zip(laws[few].tolist(), units[few].tolist(), strict=True))
    runs = int(comparison.seeds[at])
    winner = comparison.winners[at]
    # by failed runs, then by median
    order = sorted(comparison.laws, key=lambda law: (law != winner, lacking[law], medians[law]))
    unbeaten = []
    ranked = []
    for law in order:
        if law in laws[best]:
            unbeaten.append(law)
        if law not in laws[few]:
            ranked.append(law)
    resolves, charged = _resolves(comparison, at, unbeaten)
    return Block(
        plant=name[0],
        condition=name[1],
        medians=medians,
        lacking=lacking,
        best=tuple(laws[best].tolist()),
        below=tuple(laws[below].tolist()),
        rising=tuple(laws[low & ~below].tolist()),
        floor=floor,
        away=tuple(laws[away].tolist()),
        worse=tuple(laws[comparison.worse[:, at]].tolist()),
        ahead=winner,
        lead=_lead(comparison, at, ranked, floor, metric),
        behind=_behind(comparison, at, order, label_of(metric)),
        level=bool(comparison.level[at][np.ix_(best, best)].all()),
        resolves=resolves,
        charged=charged,
        by_step=by_step,
        seeds=seeds,
        runs=runs,
        samples=int(comparison.samples[at].max()) if len(laws) > 1 else runs,
        sets=min(sets[sets > 1].tolist(), default=1),
        few=sets_of_few,
        single_set=bool((sets == 1).any()),
        untuned=untuned,
    )


def _lead(
    comparison: Comparison, at: int, order: Sequence[str], floor: str, metric: str
) -> Lead | None:
    """Return the least lead of the law in front of a block, which comes first in `order`, over the
    rival over which it is least by the upper end of the interval.
    """
    if len(order) < 2 or comparison.shares:
        return None
    first, *rivals = order
    effects = {}
    for rival in rivals:
        effects[rival] = comparison.effect(at, first, rival)
    rival = max(rivals, key=lambda rival: effects[rival].high)
    a = comparison.laws.index(first)
    b = comparison.laws.index(rival)
    lacking = comparison.without_value[:, at]
    effect = effects[rival]
    if lacking[a] or not effect.samples or comparison.pairs_below_floor[at, a, b]:
        return None
    low, high = 1.0 - effect.high, 1.0 - effect.low
    interval = {"low": low, "high": high, "ratio": effect.value}
    gaps = ""
    if lacking[b]:
        interval = {}
        gaps = f"{lacking[b]} of {comparison.seeds[at]}"
    elif effect.below and floor:
        interval = {"low": low}
    unit = OF_J if metric == OBJECTIVE else "runs"
    return Lead(
        law=first,
        rival=rival,
        metric=label_of(metric),
        gaps=gaps,
        floor=floor if effect.below else "",
        ahead=effect.ahead,
        samples=effect.samples,
        unit="sets of gains" if effect.sets else unit,
        medians_differ=bool(comparison.centres[a, at] > comparison.centres[b, at]),
        **interval,
    )


def _behind(comparison: Comparison, at: int, order: Sequence[str], label: str) -> dict[str, Trails]:
    """Return the laws of a block that others are better than; the law in front is first in
    `order`.
    """
    better = comparison.better[at]
    behind = {}
    for law in order[1:]:
        b = comparison.laws.index(law)
        ahead = tuple(rival for rival in order if better[comparison.laws.index(rival), b])
        if not ahead:
            continue
        times = math.nan
        if not comparison.shares:
            effect = comparison.effect(at, ahead[0], law)
            if not effect.below and effect.value > 0.0:
                times = 1.0 / effect.value
        times = times if math.isfinite(times) else math.nan
        behind[law] = Trails(law=law, leader=ahead[0], metric=label, times=times, ahead=ahead)
    return behind


def _resolves(comparison: Comparison, at: int, unbeaten: Sequence[str]) -> tuple[float, float]:
    """Return the least lead of the first of the unbeaten laws with which it would have been seen to
    be better than all others of them, and what half the step and trends take from it, shares; NaN
    and 0 without a test.
    """
    seen = [(math.nan, 0.0)]
    if not comparison.shares:
        for rival in unbeaten[1:]:
            pair = at, unbeaten[0], rival
            seen.append((comparison.visible(*pair), comparison.charged(*pair)))
    return max(seen, key=lambda found: (not math.isnan(found[0]), found[0]))


def _entries(
    comparison: Comparison, sets: Mapping[str, Array], sources: Sources
) -> tuple[BoardEntry, ...]:
    """Return the entries of all laws."""
    entries = []
    for rank in ranks(comparison):
        i = comparison.laws.index(rank.law)
        values = comparison.cells[i]
        interval = median_of(values, linked(*sets[rank.law]))
        if comparison.shares:
            share = float(1 - np.nanmean(values, axis=1).mean())
            interval = share_interval(share, interval.n)
        entries.append(
            BoardEntry(
                law=rank.law,
                interval=interval,
                vague=not comparison.shares and _vague(interval, comparison.floors.min()),
                rank=rank,
                failed=int(comparison.without_value[i].sum()),
                runs=int((~np.isnan(values)).sum()),
                sources=sources.get(rank.law, ()),
            )
        )
    return tuple(entries)


def _vague(interval: Interval, floor: float) -> bool:
    """Return whether a median is not known within a factor of MAX_RATIO."""
    return interval.high > MAX_RATIO * max(interval.low, floor)
