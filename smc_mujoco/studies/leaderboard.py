"""Leaderboards: comparison of a study's laws on equal runs, with the uncertainty of every number.

A board is one metric in one group of runs. Laws are compared by the rules of `analysis.ranking` in
each of its blocks, a plant in a condition. Winners are corrected for all blocks of the boards in
this metric. The winner of a board with several blocks wins in every one. The conclusions hold for
the plants and conditions of the table, over initial states and noise, and over the gains with which
the laws ran.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.analysis import paired_runs
from smc_mujoco.analysis.paired_runs import (
    EPS,
    OBJECTIVE,
    SETTLES,
    UNITS,
    RunColumns,
    RunGroup,
)
from smc_mujoco.analysis.ranking import Comparison, corrected
from smc_mujoco.analysis.relevant import RELEVANT
from smc_mujoco.analysis.step_halving import first_order, repeats_every_run
from smc_mujoco.common.aliases import Array, Names
from smc_mujoco.common.errors import ScenarioError, find, items_of, shown
from smc_mujoco.common.text import joined
from smc_mujoco.control.source import DEFAULT, Source
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.studies.block import Block
from smc_mujoco.studies.board import Board, Sources
from smc_mujoco.studies.board_tables import Boards

METRICS = (SETTLES, "settling_time", "ultimate_bound", "itae", "tv_rate")


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
    boards.labels = paired_runs.labels(table)
    groups = []
    for group in paired_runs.groups(table, by):
        sources = paired_runs.sources(table, group.rows[group.rows >= 0])
        groups.append(SourcedGroup(group, paired_runs.scenarios(table, group), sources))
    boards.plants = {run.plant.name: run.plant for group in groups for run in group.runs}
    boards.remarks = [
        *_commands(groups),
        *paired_runs.failures(table),
        *paired_runs.untouched(table),
    ]
    by_metric = []
    for metric in dict.fromkeys(metrics):
        by_row = paired_runs.by_row(table, metric)
        of_metric = [_board(group, by_row, metric, relevant, defaults) for group in groups]
        corrected([board.comparison for board in filter(None, of_metric)])
        by_metric.append(of_metric)
    for of_group in zip(*by_metric, strict=True):
        boards += filter(None, of_group)
    boards.absent = _absent(metrics, groups)
    return boards


class SourcedGroup(NamedTuple):
    """A group whose laws are compared, with the sources of their gains."""

    group: RunGroup
    ran: Sequence[Scenario | None]  # a scenario of each block
    sources: Sources

    @property
    def runs(self) -> list[Scenario]:
        """The scenarios that are known."""
        return list(filter(None, self.ran))


def _absent(metrics: Sequence[str], groups: Sequence[SourcedGroup]) -> list[str]:
    """Return why metrics have no single value in the runs of groups, or are not compared there."""
    reasons = []
    unjudged: dict[tuple[str, str], list[str]] = {}  # plant and condition -> metrics
    for metric in metrics:
        for group in groups:
            if group.runs and metric in CATALOGUE:
                reasons.append(CATALOGUE[metric].refusal(group.runs[0]))
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


def _commands(groups: Sequence[SourcedGroup]) -> list[str]:
    """Return what the commands of the drives mean, and that default gains are for a force."""
    words: list[str] = []
    for group in groups:
        for scenario in group.runs:
            words += scenario.drive_train.words
        if words and any(map(_is_default, itertools.chain(*group.sources.values()))):
            words.append("Default gains are for a force: tune them for this u first.")
    return [*dict.fromkeys(words)]


def _board(
    group: SourcedGroup, by_row: paired_runs.ByRow, metric: str, relevant: float, defaults: bool
) -> Board | None:
    """Compare the laws of a group in a metric; None where it does not apply."""
    judged = [paired_runs.is_judged(scenario, metric) for scenario in group.ran]
    scores = group.group.scores(by_row, judged)
    if not scores.blocks:
        return None
    ran = [group.ran[k] for k in scores.blocks]
    comparison = Comparison(
        scores.values,
        [paired_runs.floor(scenario, metric) for scenario in ran],
        shares=metric == SETTLES,
        outcomes=scores.outcomes,
        sets=scores.sets,
        relevant=relevant,
        halves=scores.halves,
        trends=scores.trends,
        arrived=scores.arrived,
        first_order=[scenario is not None and first_order(scenario) for scenario in ran],
        powers=list(map(paired_runs.trend_power, ran)),
    )
    untuned = () if defaults else _untuned(group.sources)
    blocks = []
    for index, (k, scenario) in enumerate(zip(scores.blocks, ran, strict=True)):
        plant, condition = group.group.blocks[k]
        blocks.append(
            Block(
                comparison=comparison,
                index=index,
                metric=metric,
                plant=plant,
                condition=condition,
                seeds=group.group.seeds[k],
                floor=paired_runs.floor_words(scenario, metric),
                untuned=untuned,
                bound=_bound(scenario),
            )
        )
    repeated = not np.isnan(comparison.halves).all()
    return Board(
        group=group.group.name,
        metric=metric,
        unit=_unit(metric, ran),
        comparison=comparison,
        sets=scores.sets,
        sources=group.sources,
        blocks=tuple(blocks),
        by_step=not repeated and any(map(repeats_every_run, filter(None, ran))),
        x=paired_runs.unit_of_x(group.group.name["plant"], group.ran),
    )


def objective_boards(
    holdout: Mapping[str, Holdout], sources: Mapping[str, Sources], defaults: bool, relevant: float
) -> list[Board]:
    """Return a board of J on unseen instances for each plant.

    `sources` is by plant. Others as in `leaderboard`.
    """
    boards = []
    for plant, runs in holdout.items():
        comparison = Comparison(
            runs.values,
            EPS * runs.least,
            sets=runs.sets,
            relevant=relevant,
            halves=runs.halves,
            arrived=runs.arrived,
        )
        block = Block(
            comparison=comparison,
            metric=OBJECTIVE,
            plant=plant,
            condition="unseen runs",
            seeds=int(comparison.seeds[0]),
            untuned=() if defaults else _untuned(sources[plant]),
        )
        board = Board(
            group={"plant": plant},
            metric=OBJECTIVE,
            unit=UNITS[OBJECTIVE],
            comparison=comparison,
            sets=runs.sets,
            sources=sources[plant],
            blocks=(block,),
            by_step=False,
            summed=runs.conditions,
        )
        boards.append(board)
    corrected([board.comparison for board in boards])
    return boards


def _untuned(sources: Sources) -> Names:
    """Return the laws with default gains."""
    return tuple(law for law, of_law in sources.items() if any(map(_is_default, of_law)))


def _is_default(source: Source) -> bool:
    return source.kind == DEFAULT


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
