"""The search for the margins of scenarios, all cells together, also over sets of gains."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from smc_mujoco.common.errors import find
from smc_mujoco.common.progress import Report, summed
from smc_mujoco.robustness.level_search import LevelSearch, find_boundaries
from smc_mujoco.robustness.margin_kinds import MARGIN_KINDS, TOLERATED_ERROR
from smc_mujoco.simulation.scenario import Scenario

Tried = tuple[int, float | None]  # a cell and its level; None is the unchanged run


class Cells:
    """A search for the boundary of each kind of margin of each scenario."""

    def __init__(
        self, bases: Sequence[Scenario], kinds: Sequence[str], resolution: float, report: Report
    ):
        self.pairs = []  # scenario and kind, the kind varies faster
        for base in bases:
            for kind in kinds:
                self.pairs.append((base, find("kind of margin", kind, MARGIN_KINDS)))
        self.resolution = resolution
        self.report = report
        self.done = 0  # work
        self.searches = [kind.search(base, resolution) for base, kind in self.pairs]

    def begin(self, i: int) -> LevelSearch:
        """Begin the search of a cell again, and return it."""
        base, kind = self.pairs[i]
        self.searches[i] = kind.search(base, self.resolution)
        return self.searches[i]

    @property
    def left(self) -> int:
        """The work that the searches may still need."""
        work = 0
        for (base, kind), search in zip(self.pairs, self.searches, strict=True):
            signs = 2 if kind.signed else 1
            work += search.left * base.work * signs
        return work

    def tolerated(self, tried: Sequence[Tried], runner: Callable) -> list[bool]:
        """Return whether these levels are tolerated."""
        scenarios = []
        owners = []
        for k, (i, level) in enumerate(tried):
            base, kind = self.pairs[i]
            of_level = [base] if level is None else kind.scenarios(base, level)
            scenarios += of_level
            owners += [k] * len(of_level)
        now = sum(scenario.work for scenario in scenarios)
        expected = self.done + max(now, self.left)
        results = [True] * len(tried)
        scores = runner(scenarios, summed(self.report, self.done, expected))
        for k, ((share,), _) in zip(owners, scores, strict=True):
            results[k] &= share <= TOLERATED_ERROR
        self.done += now
        return results

    def ends_by(self, searches: Mapping[int, LevelSearch], covers: Callable) -> list[Tried]:
        """Return the ends of the intervals whose runs something covers."""
        ends = []
        for i, search in searches.items():
            base, kind = self.pairs[i]
            for level in (search.low, search.high):
                inside = kind.none < level < math.inf
                if inside and covers(kind.scenarios(base, level)[0]):
                    ends.append((i, level))
        return ends


class OverSets:
    """The least and the largest margin of each cell over several sets of gains.

    `cells` have been searched with the first set, `siblings` are the runs of each scenario with the
    others.
    """

    def __init__(
        self,
        cells: Cells,
        siblings: Sequence[Sequence[Scenario]],
        kinds: int,
        runner: Callable,
    ):
        self.cells = cells
        self.siblings = siblings
        self.kinds = kinds  # of each scenario
        self.runner = runner

    def ranges(self, cells: Iterable[int]) -> dict[int, tuple[float, float]]:
        """Return the range over all sets of each of these cells that has several."""
        with_sets = [i for i in cells if self.siblings[i // self.kinds]]
        ends: dict[tuple[int, str], float | None] = {}
        for i in with_sets:
            search = self.cells.searches[i]
            ends |= {(i, "none"): None, (i, "low"): search.low}
            if search.high < math.inf:
                ends[i, "high"] = search.high
        everyone = {key: range(len(self.siblings[key[0] // self.kinds])) for key in ends}
        holding = self.held(ends, everyone)
        ranges: dict[int, list[float]] = {}
        groups: dict[tuple[int, str], list[int]] = {}  # sets that hold less, or more
        for i in with_sets:
            value = self.cells.searches[i].low
            steady = bool(holding[i, "none"].all())
            ranges[i] = [value if steady else math.nan, value]
            if steady and not holding[i, "low"].all():
                groups[i, "less"] = np.flatnonzero(~holding[i, "low"]).tolist()
            if (i, "high") in holding and holding[i, "high"].any():
                groups[i, "more"] = np.flatnonzero(holding[i, "high"]).tolist()
        searches = {}
        for i, side in groups:
            own = self.cells.searches[i]
            base, kind = self.cells.pairs[i]
            begin = {"high": own.low} if side == "less" else {"low": own.high}
            fresh = kind.search(base, self.cells.resolution)
            searches[i, side] = dataclasses.replace(fresh, **begin)

        def tolerated(tried: list[tuple[tuple[int, str], float]]) -> list[bool]:
            held = self.held(dict(tried), groups)
            results = []
            for key, _ in tried:
                more = key[1] == "more"
                results.append(bool(held[key].any() if more else held[key].all()))
                # only those that hold least, or most, are searched further
                ahead = np.array(groups[key])[held[key] == more].tolist()
                groups[key] = ahead or groups[key]
            return results

        find_boundaries(searches, tolerated)
        for (i, side), search in searches.items():
            ranges[i][side == "more"] = search.low
        return {i: (low, high) for i, (low, high) in ranges.items()}

    def held(
        self,
        levels: Mapping[tuple[int, str], float | None],
        numbers: Mapping[tuple[int, str], Sequence[int]],
    ) -> dict[tuple[int, str], np.ndarray]:
        """Return (cell, word) -> whether the sets of these numbers tolerate its level."""
        scenarios = []
        owners = []
        results = {}
        for key, level in levels.items():
            _, kind = self.cells.pairs[key[0]]
            results[key] = np.ones(len(numbers[key]), bool)
            for place, k in enumerate(numbers[key]):
                base = self.siblings[key[0] // self.kinds][k]
                of_level = [base] if level is None else kind.scenarios(base, level)
                scenarios += of_level
                owners += [(key, place)] * len(of_level)
        scores = self.runner(scenarios, lambda work: None)
        for (key, place), ((share,), _) in zip(owners, scores, strict=True):
            results[key][place] &= share <= TOLERATED_ERROR
        return results
