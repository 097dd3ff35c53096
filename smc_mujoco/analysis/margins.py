"""Margins: the largest delay, disturbance, friction, mass ratio and noise that a law tolerates on a plant.

    for margin in margins(["duffing"], ["observer_free", "classical"], ["delay"]):
        print(margin.law, margin.value, margin.unit, margin.theory)
    of([smc.Scenario(plant="duffing", law=my_law)], ["noise"])        # a law of your own

A run tolerates a level if it does not fail and its ultimate bound is at most 5 % of its scale (`conventions`): what is
left after 10 s. (The envelope is then below its start too, as the paper's claim on delay asks: it starts at the scale.)
The search runs nine levels from small to large. Then it halves the interval below the FIRST level that is not
tolerated, until it is within one control period of delay, or 2 % of anything else. The tolerated levels need not be one
interval: above a level that is not tolerated there may be larger ones that are, and between two that are one that is
not. Noise is one realisation, seed 0, the same for every law. A disturbance is positive and acts on every channel.
Theory says from which delay rest is unstable: a smooth law then swings with an amplitude that grows from 0, and so
tolerates a little more. It also says from where a push, or friction that sticks, holds the plant 5 % off: the plant may
still stick further in. All pairs and kinds advance together, one batch of runs a round.
"""

import dataclasses
import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from smc_mujoco.analysis.margin_kinds import MARGIN_KINDS, tolerates
from smc_mujoco.common.errors import ScenarioError, find
from smc_mujoco.common.files import ended, read_json, reading, write_json
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.control.component import Template
from smc_mujoco.control.law import Law
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.grid import DURATION, case, listed
from smc_mujoco.simulation.initial_states import Starts
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario

KINDS = tuple(MARGIN_KINDS)
FINE, COARSE = 0.02, 0.1  # of the level: where a search ends, in full and quick
PERIODS = {FINE: 1, COARSE: 5}  # of control, likewise for a delay
QUICK = 5.0  # s, of a quick search's runs

Report = Callable[[float, float], None]  # told the work done and the whole, as far as it is known


@dataclasses.dataclass(frozen=True, kw_only=True)
class Margin:
    """The largest level of one kind that one law tolerates on one plant.

    Attributes:
      plant, law: their names.
      kind: one of KINDS.
      value: the largest level tolerated; NaN: the law fails without any. Equal to `searched`: no failure was found.
      unit: of value, resolution, searched and theory.
      resolution: the first level not tolerated is at most this much larger.
      searched: the largest level tried.
      theory: the same by linear theory, or None where there is none.
    """

    plant: str
    law: str
    kind: str
    value: float
    unit: str
    resolution: float
    searched: float
    theory: float | None

    @property
    def open(self) -> bool:
        """Whether every level that was tried is tolerated."""
        return self.value == self.searched


def margins(
    plants: str | Plant | Sequence[str | Plant] = tuple(sets.STUDY),
    laws: str | Law | Template | Sequence[str | Law | Template] = sets.LAWS,
    kinds: str | Sequence[str] = KINDS,
    gains: str = "tuned",
    quick: bool = False,
    threads: int | None = None,
    report: Report = lambda done, whole: None,
    condition: str | Condition = "nominal",
    starts: Starts | None = None,
) -> list[Margin]:
    """Return the margins of laws on plants: plant by plant, law by law, kind by kind.

    Args:
      plants, laws: names, or plants and laws of your own, one or several.
      kinds: of KINDS, one or several.
      gains: a set of `gains.SETS`.
      quick: runs of 5 s, to within 5 control periods or 10 %: for a look.
      threads: as of `run`.
      report: called with the work done and the whole, in simulated steps; the whole grows while it is being found out.
      condition: what holds besides, such as "coulomb".
      starts: where runs begin. Default: the plant's own x0.

    Raises:
      ScenarioError: an unknown plant, law, kind, set or condition, or a plant that starts at 0.
    """
    duration = QUICK if quick else DURATION
    bases = [
        case(plant, law, condition, duration, gains, starts=starts)
        for plant in listed("plants", plants)
        for law in listed("laws", laws)
    ]
    for base in bases:
        if not any(base.x0):
            cure = "say where its runs begin, with starts=smc.starts(x0=0.5) or --x0 0.5"
            raise ScenarioError(f"{base.plant.name} starts at 0, of which no margin is a part: {cure}")
    return of(bases, [kinds] if isinstance(kinds, str) else kinds, COARSE if quick else FINE, threads, report)


def of(
    bases: Sequence[Scenario],
    kinds: Sequence[str] = KINDS,
    resolution: float = FINE,
    threads: int | None = None,
    report: Report = lambda done, whole: None,
) -> list[Margin]:
    """Return the margins of any scenarios, each left as it is but for the level that is searched.

    Args:
      resolution: FINE or COARSE. Other arguments as of `margins`.
    """
    for kind in kinds:
        find("kind of margin", kind, MARGIN_KINDS)
    find("resolution", str(resolution), {str(known): known for known in PERIODS})
    searches = [_Search(base, kind, resolution) for base in bases for kind in kinds]
    work = _Work(searches, threads, report)
    plain = work.tolerated(bases)
    for i, search in enumerate(searches):
        search.fine = plain[i // len(kinds)]
    while asked := [(search, level) for search in searches for level in search.asks()]:
        found = work.tolerated([search.scenario(level) for search, level in asked])
        for (search, level), tolerated in zip(asked, found, strict=True):
            search.known[level] = tolerated
    return [search.margin() for search in searches]


class _Search:
    """The search for one margin: the largest tolerated level below the smallest one that is not."""

    def __init__(self, base: Scenario, kind: str, resolution: float):
        self.base, self.name, self.kind, self.resolution = base, kind, MARGIN_KINDS[kind], resolution
        self.fine: bool | None = None  # whether the scenario itself is tolerated
        self.known: dict[float, bool] = {}  # level -> whether it is tolerated
        self.levels = self.kind.scan(base)

    def scenario(self, level: float) -> Scenario:
        """Return the base with a level of the disturbance, delay, ... that is searched."""
        return self.kind.put(self.base, level)

    @property
    def steps(self) -> int:
        """Simulated steps of a run, as `run` reports them."""
        return self.scenario(self.levels[0]).work

    @property
    def bracket(self) -> tuple[float, float]:
        """The largest tolerated level below the first that is not, and that one; inf where none is known."""
        first = min((level for level, tolerated in self.known.items() if not tolerated), default=math.inf)
        return max((level for level in self.known if level < first), default=self.kind.none), first

    @property
    def step(self) -> float:
        """The distance between the two at which the search ends."""
        if self.kind.periods:
            return PERIODS[self.resolution] * self.base.control_period
        return self.resolution * max(self.bracket[0], self.levels[0])

    @property
    def left(self) -> float:
        """About how many runs are still to come."""
        if not self.fine:
            return 0 if self.fine is False else len(self.levels) + 6
        if not self.known:
            return len(self.levels) + 6
        low, high = self.bracket
        return math.ceil(max(0.0, math.log2((high - low) / self.step))) if high < math.inf else 0

    def asks(self) -> list[float]:
        """Return the levels to run next; none when the search is done."""
        if not self.fine:
            return []
        if not self.known:
            return self.levels
        low, high = self.bracket
        if high == math.inf or high - low <= self.step * (1.0 + 1e-9):
            return []
        return [self.kind.rounded(self.base, (low + high) / 2.0)]

    def margin(self) -> Margin:
        """Return the result."""
        low, high = self.bracket
        return Margin(
            plant=self.base.plant.name,
            law=self.base.law.name,
            kind=self.name,
            value=low if self.fine else math.nan,
            unit=self.kind.unit_for(self.base.plant.unit),
            resolution=high - low if self.fine and high < math.inf else 0.0,
            searched=self.levels[-1],
            theory=self.kind.expected(self.base),
        )


class _Work:
    """The runs of all searches, and how much of them is done."""

    def __init__(self, searches: Sequence[_Search], threads: int | None, report: Report):
        self.searches, self.threads, self.report = searches, threads, report
        self.done = 0.0

    def tolerated(self, scenarios: Sequence[Scenario]) -> list[bool]:
        """Run scenarios, and return whether each is tolerated; their traces are dropped at once."""
        start = self.done
        now = sum(s.work for s in scenarios)
        later = sum(s.left * s.steps for s in self.searches)

        def told(steps: int) -> None:
            self.done += steps
            self.report(self.done, max(start + later, start + now))

        found = dict.fromkeys(range(len(scenarios)), False)
        for i, trace in stream(scenarios, self.threads, told):
            found[i] = tolerates(trace)
        self.done = start + now
        return list(found.values())


def save(found: Sequence[Margin], path: str | os.PathLike) -> Path:
    """Write margins to a .json file that `load` reads back; NaN and infinity are words there, see `files.plain`."""
    return write_json(ended(path, ".json"), [dataclasses.asdict(margin) for margin in found])


def load(path: str | os.PathLike) -> list[Margin]:
    """Read the margins that `save` wrote.

    Raises:
      ScenarioError: no such file, or not of margins.
    """
    with reading(path, "file of margins", "give a .json file that margins.save wrote") as file:
        return [_margin(entry) for entry in read_json(file)]


def _margin(entry: dict[str, Any]) -> Margin:
    """Return the margin in a file. Files of version 0.1 have null for NaN, and "inf"."""
    fields: dict[str, Any] = {name: math.inf if value == "inf" else value for name, value in entry.items()}
    if fields["value"] is None:
        fields["value"] = math.nan
    return Margin(**fields)
