"""A table's runs by group, and in each the cells - plant, condition, seed - in which every law ran.

for group in groups(table, by=("plant",)):
    group.scores(values(table, "itae"))        # law -> (blocks, seeds), as `ranking` takes them
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol

import numpy as np

from smc_mujoco.errors import ScenarioError, unknown

SETTLES = "settles"  # no metric of a run: whether its settling time is finite
GROUPS = ("plant", "condition")


class Columns(Protocol):
    """A table, a row a run: plant, law, condition, seed, failure, diverged_at, and metrics."""

    def column(self, name: str) -> np.ndarray:
        """Values by row; None or NaN where there is none."""
        ...


def values(table: Columns, metric: str) -> np.ndarray:
    """A metric by row, inf for a run that failed, NaN where it does not apply; of "settles" 0.0 or, if not, 1.0.

    It does not apply to a plant whose runs all lack it, but for those that failed.
    """
    found = np.array(table.column("settling_time" if metric == SETTLES else metric), float)
    failed = np.array([failure is not None for failure in table.column("failure")], bool)
    failed |= ~np.isnan(np.array(table.column("diverged_at"), float))
    plants, lacking = np.asarray(table.column("plant"), str), np.isnan(found) & ~failed
    without = set(plants[lacking]) - set(plants[~lacking & ~failed])
    found[failed] = np.inf
    found[np.isin(plants, list(without))] = np.nan
    return np.isinf(found).astype(float) if metric == SETTLES else found


@dataclasses.dataclass(frozen=True, kw_only=True)
class Group:
    """The runs that share a plant, a condition, or both.

    Attributes:
      name: what they share.
      rows: of the table.
      laws: that ran, by name.
      plants: in how many plants.
      shape: laws, blocks (a plant in a condition each), seeds.
      places: where among these each row is, flat.
    """

    name: Mapping[str, str]
    rows: np.ndarray
    laws: tuple[str, ...]
    plants: int
    shape: tuple[int, int, int]
    places: np.ndarray

    def scores(self, by_row: np.ndarray) -> dict[str, np.ndarray]:
        """Law -> (blocks, seeds), NaN in cells that not all laws have; {} where the metric does not apply at all.

        Raises:
          ScenarioError: the laws share no cell.
        """
        if np.isnan(by_row[self.rows]).all():
            return {}
        cube = np.full(self.shape, np.nan)
        cube.flat[self.places] = by_row[self.rows]
        common = ~np.isnan(cube).any(axis=0)
        if not common.any():
            where = f" of {', '.join(self.name.values())}" if self.name else ""
            laws = ", ".join(self.laws)
            raise ScenarioError(f"{laws} have no run{where} in common: run them in the same conditions and seeds")
        cube[:, ~common] = np.nan
        return dict(zip(self.laws, cube[:, :, common.any(axis=0)], strict=True))


def groups(table: Columns, by: Sequence[str]) -> Iterator[Group]:
    """The groups of a table, in the order of its rows; () is all of it.

    Raises:
      ScenarioError: no runs, an unknown group, or two runs in a cell.
    """
    for name in by:
        if name not in GROUPS:
            raise unknown("group of a leaderboard", name, GROUPS)
    columns = {name: np.asarray(table.column(name), str) for name in (*GROUPS, "law")}
    seeds = np.asarray(table.column("seed"), int)
    if not seeds.size:
        raise ScenarioError("the table has no runs: run a study first")
    keys = np.stack([columns[name] for name in by]) if by else np.zeros((1, seeds.size), str)
    shared, first, which = np.unique(keys, axis=1, return_index=True, return_inverse=True)
    for i in np.argsort(first):
        rows = np.flatnonzero(which.ravel() == i)
        name = dict(zip(by, shared[:, i].tolist(), strict=True)) if by else {}
        yield _group(name, rows, {name: texts[rows] for name, texts in columns.items()}, seeds[rows])


def _group(name: dict[str, str], rows: np.ndarray, columns: dict[str, np.ndarray], seeds: np.ndarray) -> Group:
    laws, law = np.unique(columns["law"], return_inverse=True)
    blocks, block = np.unique(np.stack([columns["plant"], columns["condition"]]), axis=1, return_inverse=True)
    numbers, seed = np.unique(seeds, return_inverse=True)
    shape = len(laws), blocks.shape[1], len(numbers)
    places = np.ravel_multi_index((law, block.ravel(), seed), shape)
    if (twice := np.bincount(places) > 1).any():
        a, b, c = np.unravel_index(int(np.argmax(twice)), shape)
        cell = f"{laws[a]} on {blocks[0, b]}, {blocks[1, b]}, seed {numbers[c]}"
        raise ScenarioError(f"the table has several runs of {cell}: give those of one set of gains and one duration")
    plants = len(set(blocks[0].tolist()))
    return Group(name=name, rows=rows, laws=tuple(laws.tolist()), plants=plants, shape=shape, places=places)
