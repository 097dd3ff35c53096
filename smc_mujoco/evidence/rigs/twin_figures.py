"""What simulation said of real machines, and what these did: a row for each figure of each public
record.

    for one in rows("qube_servo"):
        one.machine, one.twin, one.use            # of theta in record 11: 0.2638, 0.2628, "held out"

A twin is a distribution over its parameter sets and seeds, so that each figure has a range. Whether
a record was used is not written down with the figure but follows from the rig: one that was
identified from no record here is "unfitted"; of others the records of `Rig.identified_from` are
"fitted on", and all the rest are "held out".

The records do not come with the package. `python benchmarks/machines.py FOLDER` computes the rows
from them.
"""

import dataclasses
import functools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common.errors import find
from smc_mujoco.common.files import read_json
from smc_mujoco.evidence.rigs.rig import catalogue

FILE = Path(__file__).with_suffix(".json")
ABOUT = (
    "A figure of a signal is its rms about its mean. Range: over the twin's parameter sets, or 5 to 95 % of its runs. "
    "Public: by published numbers. Held out: the twin was identified from other records. Unfitted: from none here."
)
UNFITTED = "unfitted"
FITTED = "fitted on"
HELD_OUT = "held out"


@dataclasses.dataclass(frozen=True, kw_only=True)
class TwinFigure:
    """A figure of a record of a law on a machine, and the same figure of the machine's twin.

    Attributes:
      rig, record, law: names; the law is "none" where a command was repeated.
      figure, unit: what is compared, such as "theta rms", and its unit.
      machine: the recorded figure; NaN where it is kept aside, and only the order of laws is known
        here.
      twin: the figure by the rig's own quantities, or the median of all runs where there are
        several seeds; inf if the twin falls.
      low, high: the least and the largest over parameter sets; of runs from several seeds 5 and 95
        %.
      runs: number of these runs.
      fit: of the whole signal, percent, see `Rig.fit`; NaN for a figure that is not of a signal.
      published: the figure by published numbers of the machine; NaN without any, inf if they let it
        fall.
      variant: what of the twin is left out or changed, as "without the commutator"; "" for the
        whole twin.
    """

    rig: str
    record: str
    law: str
    figure: str
    unit: str
    machine: float
    twin: float
    low: float
    high: float
    runs: int
    fit: float = math.nan
    published: float = math.nan
    variant: str = ""

    @property
    def use(self) -> str:
        """What the record was for the twin: "unfitted", "fitted on" or "held out"."""
        sources = catalogue()[self.rig].identified_from
        if self.record in sources:
            return FITTED
        return HELD_OUT if sources else UNFITTED

    @property
    def apart(self) -> float:
        """How far the twin's figure is from the machine's, as a share of this; NaN if it is kept
        aside.
        """
        return abs(self.twin / self.machine - 1.0)

    @property
    def inside(self) -> bool:
        """Whether the machine's figure is within the twin's range."""
        return self.low <= self.machine <= self.high


@dataclasses.dataclass(frozen=True, kw_only=True)
class Order:
    """In how many of a twin's parameter sets its laws stand in the machine's order.

    `laws`: in that order, the least `figure` first. `tau`: Kendall's, over machine and twin, the
    mean over sets.
    """

    rig: str
    condition: str
    figure: str
    laws: tuple[str, ...]
    ordered: int
    sets: int
    tau: float
    variant: str = ""


class Summary(NamedTuple):
    """The figures of a machine's records with one use that are known, by the whole twin."""

    rig: str
    use: str
    rows: Sequence[TwinFigure]

    @property
    def records(self) -> set[str]:
        """Names of the records."""
        return {row.record for row in self.rows}

    @property
    def median(self) -> float:
        """The median of how far the twin is from the machine, a share."""
        return float(np.median([row.apart for row in self.rows]))

    @property
    def largest(self) -> float:
        """The largest of the same."""
        return max(row.apart for row in self.rows)

    @property
    def inside(self) -> int:
        """Number of the machine's figures that are within the twin's range."""
        return sum(row.inside for row in self.rows)

    @property
    def published(self) -> float:
        """How far published numbers are from the machine, the median, a share; NaN without any."""
        known = []
        for row in self.rows:
            if not math.isnan(row.published):
                known.append(abs(row.published / row.machine - 1.0))
        return float(np.median(known)) if known else math.nan

    @property
    def cells(self) -> list[str]:
        """The summary as the cells of a table: rig, use, rows, median, largest, within its range,
        published.
        """
        median, largest, published = map(percent, (self.median, self.largest, self.published))
        return [
            self.rig,
            self.use,
            f"{len(self.rows)}",
            median,
            largest,
            f"{self.inside}",
            published,
        ]


def percent(share: float) -> str:
    """Return a share as percent; "" for none, and "falls" for a twin that falls."""
    if math.isnan(share):
        return ""
    if math.isinf(share):
        return "falls"
    return f"{100.0 * share:.1f}"


def summaries(rows: Sequence[TwinFigure]) -> list[Summary]:
    """Return the figures of whole twins by machine and use, without those that are kept aside."""
    groups: dict[tuple[str, str], list[TwinFigure]] = {}
    for row in rows:
        if not row.variant and not math.isnan(row.machine):
            groups.setdefault((row.rig, row.use), []).append(row)
    return [Summary(rig, use, its) for (rig, use), its in groups.items()]


@functools.cache
def _stored() -> dict[str, Any]:
    return read_json(FILE)


def rows(rig: str = "") -> list[TwinFigure]:
    """Return the rows of a rig, or of all, in the order of the file.

    Raises:
      ScenarioError: an unknown rig.
    """
    every = [TwinFigure(**_numbers(row)) for row in _stored()["figures"]]
    if not rig:
        return every
    return [row for row in every if row.rig == find("rig", rig, catalogue()).name]


def orders(rig: str = "") -> list[Order]:
    """Return the orders of laws on the machines that ran several, of a rig, or of all; raises as
    `rows`.
    """
    every = [Order(**row | {"laws": tuple(row["laws"])}) for row in _stored()["orders"]]
    if not rig:
        return every
    return [row for row in every if row.rig == find("rig", rig, catalogue()).name]


def described(row: TwinFigure | Order) -> dict[str, Any]:
    """Return a row as JSON data, without fields that have their default; None stands for NaN, and
    "falls" for inf.
    """
    fields = {f.name: (getattr(row, f.name), f.default) for f in dataclasses.fields(row)}
    told = {}
    for name, (value, default) in fields.items():
        if value is not default and value != default:
            told[name] = value
    return {name: _as_data(value) for name, value in told.items()}


def _as_data(value: Any) -> Any:
    if isinstance(value, float):
        if math.isnan(value):
            return None
        if math.isinf(value):
            return "falls"
        return float(f"{value:.4g}")
    return value


def _numbers(row: dict[str, Any]) -> dict[str, Any]:
    meaning: dict[Any, float] = {None: math.nan, "falls": math.inf}
    return {name: meaning.get(value, value) for name, value in row.items()}
