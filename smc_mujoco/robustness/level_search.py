"""Searches for the largest level that is tolerated, which advance together."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeVar

FINE, COARSE = 0.02, 0.1  # resolution of a full and of a quick search, of the level
# the same in quanta, for levels that are multiples of one, such as control periods
QUANTA = {FINE: 1, COARSE: 5}
EXPECTED_HALVINGS = 6  # of an interval between two levels, for the progress bar

Key = TypeVar("Key")


@dataclasses.dataclass(kw_only=True)
class LevelSearch:
    """The search for the largest tolerated level below the first one that is not tolerated."""

    # tried first, from small to large, up to the first that is not tolerated
    levels: Sequence[float]
    # largest tolerated level -> the interval at which the search ends
    resolution: Callable[[float], float]
    rounded: Callable[[float], float] = float  # level -> the nearest one that a run can have
    low: float = 0.0  # largest level known to be tolerated; at first the level without any effect
    high: float = math.inf  # smallest level known not to be tolerated; inf until there is one

    @property
    def next(self) -> float | None:
        """The level to try next; None when the search is done."""
        if self.high == math.inf:
            for level in self.levels:
                if level > self.low:
                    return level
            return None
        if self.high - self.low <= self.resolution(self.low) * (1.0 + 1e-9):
            return None
        return self.rounded((self.low + self.high) / 2.0)

    @property
    def left(self) -> int:
        """The number of levels still to try, estimated."""
        if self.high == math.inf:
            return sum(level > self.low for level in self.levels) + EXPECTED_HALVINGS
        halvings = math.log2((self.high - self.low) / self.resolution(self.low))
        return math.ceil(max(0.0, halvings))


def find_boundaries(
    searches: Mapping[Key, LevelSearch],
    tolerated: Callable[[list[tuple[Key, float]]], Iterable[bool]],
) -> None:
    """Advance searches together until all are done; `tolerated` judges a level of each search that
    continues.
    """
    while True:
        tried = []
        for key, search in searches.items():
            level = search.next
            if level is not None:
                tried.append((key, level))
        if not tried:
            return
        for (key, level), good in zip(tried, tolerated(tried), strict=True):
            setattr(searches[key], "low" if good else "high", level)
