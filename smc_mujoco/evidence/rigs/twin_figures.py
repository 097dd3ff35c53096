"""What simulation said of real machines, and what these did: a row for each figure of each public
record.

    for one in rows("qube_servo"):
        one.machine, one.twin, one.use        # of theta in record 11: 0.2638, 0.2628, "held out"

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
    "A figure of a signal is its rms about its mean. Range: over the twin's parameter sets, or 5 "
    "to 95 % of its runs. Public: by published numbers. Held out: the twin was identified from "
    "other records. Unfitted: from none here."
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


@dataclasses.dataclass(frozen=True, kw_only=True)
class Order:
    """In how many of a twin's parameter sets its laws stand in the machine's order.

    `laws`: in that order, the least `figure` first. `tau`: Kendall's, over machine and twin, the
    mean over sets.
    """

    rig: str
    condition: str
    figure: str
    laws: Sequence[str]
    ordered: int
    sets: int
    tau: float
    variant: str = ""


class Summary(NamedTuple):
    """How far a machine's figures of records with one use are from those of its whole twin."""

    rig: str
    use: str
    count: int  # of figures that are known  # pyright: ignore[reportIncompatibleMethodOverride]
    median: float  # of how far the twin is from the machine, a share
    largest: float
    inside: int  # number of the machine's figures within the twin's range
    published: float  # median of how far published numbers are, a share; NaN without any

    @property
    def cells(self) -> list[str]:
        """The cells of a table."""
        shares = map(percent, (self.median, self.largest, self.published))
        median, largest, published = shares
        return [self.rig, self.use, str(self.count), median, largest, str(self.inside), published]


def percent(share: float) -> str:
    """Return a share as percent; "" for none, and "falls" for a twin that falls."""
    if math.isnan(share):
        return ""
    if math.isinf(share):
        return "falls"
    return f"{100.0 * share:.1f}"


def known(rows: Sequence[TwinFigure]) -> list[TwinFigure]:
    """Return the figures of whole twins, without those that are kept aside."""
    return [row for row in rows if not row.variant and not math.isnan(row.machine)]


def summaries(rows: Sequence[TwinFigure]) -> list[Summary]:
    """Return the known figures by machine and use."""
    groups: dict[tuple[str, str], list[TwinFigure]] = {}
    for row in known(rows):
        groups.setdefault((row.rig, row.use), []).append(row)
    found = []
    for (rig, use), group in groups.items():
        apart = [row.apart for row in group]
        published = np.array([abs(row.published / row.machine - 1.0) for row in group])
        published = published[~np.isnan(published)]
        found.append(
            Summary(
                rig=rig,
                use=use,
                count=len(group),
                median=float(np.median(apart)),
                largest=max(apart),
                inside=sum(row.low <= row.machine <= row.high for row in group),
                published=float(np.median(published)) if len(published) else math.nan,
            )
        )
    return found


@functools.cache
def _stored() -> tuple[list[TwinFigure], list[Order]]:
    """Return the rows of the file; None stands for NaN, and "falls" for inf."""
    meaning: dict[Any, Any] = {None: math.nan, "falls": math.inf}
    data = read_json(FILE)
    figures = []
    for row in data["figures"]:
        figures.append(TwinFigure(**{name: meaning.get(row[name], row[name]) for name in row}))
    return figures, [Order(**row) for row in data["orders"]]


def rows(rig: str = "") -> list[TwinFigure]:
    """Return the rows of a rig, or of all, in the order of the file.

    Raises:
      ScenarioError: an unknown rig.
    """
    name = rig and find("rig", rig, catalogue()).name
    return [row for row in _stored()[0] if name in ("", row.rig)]


def orders(rig: str = "") -> list[Order]:
    """Return the orders of laws on the machines that ran several, as `rows`."""
    name = rig and find("rig", rig, catalogue()).name
    return [row for row in _stored()[1] if name in ("", row.rig)]
