"""Everything that a report shows, as plain data: stages.py computes it, page.py and charts.py show it.

Units are SI; every `metric` is the name of one in `metrics`.
"""

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from smc_mujoco.analysis.margins import Margin
    from smc_mujoco.analysis.region_of_attraction import Basin
    from smc_mujoco.analysis.tuning.objective import Objective
    from smc_mujoco.studies.paper.claims.verdict import Claim
    from smc_mujoco.studies.report.plan import Plan


OFF = 1e-6  # in s: less is s = 0, as the claim on V' has it


class Score(NamedTuple):
    """A metric of a law on a plant in a condition over the seeds: median and 95 % interval; inf is never.

    `best`: no other law is better there, as `ranking` has it; several laws may be. `seeds`: of the runs, `runs`: how
    many of them are distinct, `failed`: how many have no score.
    """

    plant: str
    condition: str
    law: str
    metric: str
    median: float
    low: float
    high: float
    best: bool
    seeds: int
    failed: int
    runs: int


class Place(NamedTuple):
    """A law in a metric over all cells of a plant, "" of all plants.

    `mean`: its mean rank over the cells, 1 is the best; `low`, `high`: the 95 % interval of its place, NaN of all
    plants; `best`: no law is better in any cell; `median`: of the cells' medians, for "settles" the share of runs that
    does, NaN where units differ; `wins`, `losses`, `of`: in how many cells it wins, in how many another law is better,
    and how many there are; `why`: there can be no winner, "" if there can.
    """

    plant: str
    metric: str
    law: str
    mean: float
    low: float
    high: float
    best: bool
    median: float
    wins: int
    losses: int
    of: int
    why: str


@dataclasses.dataclass(frozen=True, kw_only=True)
class Front:
    """Gains of a law that none beats in both tracking (s^2) and variation (1/s), and those that the study takes."""

    plant: str
    law: str
    tracking: tuple[float, ...]
    variation: tuple[float, ...]
    chosen: tuple[float, float]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Field:
    """V' = s s' on the state plane under the paper's law; x (nx,), v (nv,), vdot (nv, nx), s (nv, nx)."""

    plant: str
    law: str
    x: np.ndarray
    v: np.ndarray
    vdot: np.ndarray
    s: np.ndarray

    @property
    def rises(self) -> np.ndarray:
        """Return where V' is positive off s = 0, bool."""
        return (self.vdot > 0) & (np.abs(self.s) > OFF)

    @property
    def share(self) -> float:
        """Return the share of the plane in which V rises."""
        return float(self.rises.mean())


@dataclasses.dataclass(frozen=True, kw_only=True)
class Curve:
    """One channel of a trace in few points: x(t), the line of u, and the band between the extremes of u.

    t, x: (k,); tu, u: the line, a mean where u chatters; tb, low, high: the band's windows.
    """

    law: str
    t: np.ndarray
    x: np.ndarray
    tu: np.ndarray
    u: np.ndarray
    tb: np.ndarray
    low: np.ndarray
    high: np.ndarray


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scene:
    """Runs of one plant in one condition, beside each other: curves of the channel that starts farthest out."""

    plant: str
    condition: str
    unit: str  # of x
    u_max: float
    curves: tuple[Curve, ...]
    film: bytes | None = None  # WebM
    poster: bytes | None = None  # JPEG
    seconds: float = 0.0  # of the film


class Gains(NamedTuple):
    """A law's gains on a plant in a set, and where they are from."""

    set: str
    plant: str
    law: str
    gains: str
    source: str


@dataclasses.dataclass(frozen=True, kw_only=True)
class About:
    """How the report was computed.

    Attributes:
      plan: how much of everything.
      runs, failed: of the grid.
      seeds: of every cell of the grid.
      gains_set: with which grid, margins and maps were made.
      objective: of the tuning of these gains.
      left_out: conditions of the full report that this one lacks.
      laws: how many the package has.
      u_max: the bound on u, N or N m.
      control_period: s.
      conditions: condition -> the Scenario fields that it sets, in words.
      versions: package -> version.
      gains: of every set.
      spent: stage -> s of this call; less where results were there already.
      no_film: why there are no films, or None.
    """

    plan: "Plan"
    runs: int
    failed: int
    seeds: int
    gains_set: str
    objective: "Objective"
    left_out: tuple[str, ...]
    laws: int
    u_max: float
    control_period: float
    conditions: Mapping[str, str]
    versions: Mapping[str, str]
    gains: tuple[Gains, ...]
    spent: Mapping[str, float]
    no_film: str | None = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class Findings:
    """Everything that a report shows; `by_set`: set of gains -> the margins that are found under every set."""

    scores: tuple[Score, ...]
    places: tuple[Place, ...]
    claims: "tuple[Claim, ...]"
    fields: tuple[Field, ...]
    fronts: tuple[Front, ...]
    margins: "tuple[Margin, ...]"
    by_set: "Mapping[str, tuple[Margin, ...]]"
    basins: "tuple[Basin, ...]"
    scenes: tuple[Scene, ...]
    about: About

    @property
    def plants(self) -> list[str]:
        """In the order of the grid."""
        return list(dict.fromkeys(score.plant for score in self.scores))

    @property
    def laws(self) -> list[str]:
        """In the order of the grid."""
        return list(dict.fromkeys(score.law for score in self.scores))

    @property
    def conditions(self) -> list[str]:
        """In the order of the grid."""
        return list(dict.fromkeys(score.condition for score in self.scores))
