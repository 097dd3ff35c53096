"""Margins: the largest delay, disturbance, friction, mass ratio and noise that a law bears on a plant.

    for margin in margins(["duffing"], ["observer_free", "classical"], ["delay"]):
        print(margin.law, margin.value, margin.unit, margin.theory)
    of([smc.Scenario(plant="duffing", law=my_law)], ["noise"])        # a law of your own

A run bears a level if it does not fail and its ultimate bound is at most 5 % of its scale (`measure`): what is left
after 10 s. (The envelope is then below its start too, as the paper's claim on delay asks: it starts at the scale.)
The search looks at nine levels from small to large, then halves the interval below the FIRST that is not borne, until
it is within one control period of delay, or 2 % of anything else. What a law bears need not be one interval: beyond a
level that is not borne there may be larger ones that are, and between two that are borne one that is not. Noise is one
realisation, seed 0, the same for every law; a disturbance is positive and acts on every channel.
Theory says where rest turns unstable by delay: a smooth law then swings with an amplitude that grows from 0, and bears
a little more. And where a push, or friction that sticks, holds the plant 5 % off: it may yet stick further in.
All pairs and kinds advance together, a batch of runs a round.
"""

import dataclasses
import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from smc_mujoco.analysis.margin_kinds import SPECS, bears
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

KINDS = tuple(SPECS)
FINE, COARSE = 0.02, 0.1  # of the level: where a search ends, in full and quick
PERIODS = {FINE: 1, COARSE: 5}  # of control, likewise for a delay
QUICK = 5.0  # s, of a quick search's runs

Report = Callable[[float, float], None]  # told the work done and the whole, as far as it is known


@dataclasses.dataclass(frozen=True, kw_only=True)
class Margin:
    """What one law bears of one thing on one plant.

    Attributes:
      plant, law: their names.
      kind: one of KINDS.
      value: the largest level borne; NaN: not even none of it. Equal to `searched`: not found to fail.
      unit: of value, resolution, searched and theory.
      resolution: the first level not borne is at most so much larger.
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
        """Whether nothing that was tried was too much."""
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
    """The margins of laws on plants: plant by plant, law by law, kind by kind.

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
    """The margins of any scenarios, each as it stands but for what it has to bear; arguments as of `margins`.

    Args:
      resolution: FINE or COARSE.
    """
    for kind in kinds:
        find("kind of margin", kind, SPECS)
    find("resolution", str(resolution), {str(known): known for known in PERIODS})
    searches = [_Search(base, kind, resolution) for base in bases for kind in kinds]
    work = _Work(searches, threads, report)
    plain = work.borne(bases)
    for i, search in enumerate(searches):
        search.fine = plain[i // len(kinds)]
    while asked := [(search, level) for search in searches for level in search.asks()]:
        found = work.borne([search.scenario(level) for search, level in asked])
        for (search, level), borne in zip(asked, found, strict=True):
            search.known[level] = borne
    return [search.margin() for search in searches]


class _Search:
    """One pair and kind: the largest level known to be borne below the smallest known not to be."""

    def __init__(self, base: Scenario, kind: str, resolution: float):
        self.base, self.name, self.kind, self.resolution = base, kind, SPECS[kind], resolution
        self.fine: bool | None = None  # whether the scenario bears none of it
        self.known: dict[float, bool] = {}  # level -> whether it is borne
        self.levels = self.kind.scan(base)

    def scenario(self, level: float) -> Scenario:
        """The base with a level of what is to be borne."""
        return self.kind.put(self.base, level)

    @property
    def steps(self) -> int:
        """Simulated steps of a run, as `run` reports them."""
        return self.scenario(self.levels[0]).work

    @property
    def bracket(self) -> tuple[float, float]:
        """The largest level borne below the first that is not, and that; inf where none is known."""
        first = min((level for level, borne in self.known.items() if not borne), default=math.inf)
        return max((level for level in self.known if level < first), default=self.kind.none), first

    @property
    def step(self) -> float:
        """How far apart the two may stay."""
        if self.kind.periods:
            return PERIODS[self.resolution] * self.base.control_period
        return self.resolution * max(self.bracket[0], self.levels[0])

    @property
    def left(self) -> float:
        """How many runs are still to come, about."""
        if not self.fine:
            return 0 if self.fine is False else len(self.levels) + 6
        if not self.known:
            return len(self.levels) + 6
        low, high = self.bracket
        return math.ceil(max(0.0, math.log2((high - low) / self.step))) if high < math.inf else 0

    def asks(self) -> list[float]:
        """The levels to look at next; none when done."""
        if not self.fine:
            return []
        if not self.known:
            return self.levels
        low, high = self.bracket
        if high == math.inf or high - low <= self.step * (1.0 + 1e-9):
            return []
        return [self.kind.rounded(self.base, (low + high) / 2.0)]

    def margin(self) -> Margin:
        """What was found."""
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
    """Runs, and how much of them is done."""

    def __init__(self, searches: Sequence[_Search], threads: int | None, report: Report):
        self.searches, self.threads, self.report = searches, threads, report
        self.done = 0.0

    def borne(self, scenarios: Sequence[Scenario]) -> list[bool]:
        """Whether each of the scenarios is borne; their traces are dropped at once."""
        start = self.done
        now = sum(s.work for s in scenarios)
        later = sum(s.left * s.steps for s in self.searches)

        def told(steps: int) -> None:
            self.done += steps
            self.report(self.done, max(start + later, start + now))

        found = dict.fromkeys(range(len(scenarios)), False)
        for i, trace in stream(scenarios, self.threads, told):
            found[i] = bears(trace)
        self.done = start + now
        return list(found.values())


def save(found: Sequence[Margin], path: str | os.PathLike) -> Path:
    """Write margins to a .json file that `load` reads back; NaN and infinity are words there, see `files.plain`."""
    return write_json(ended(path, ".json"), [dataclasses.asdict(margin) for margin in found])


def load(path: str | os.PathLike) -> list[Margin]:
    """The margins that `save` wrote.

    Raises:
      ScenarioError: no such file, or not of margins.
    """
    with reading(path, "file of margins", "give a .json file that margins.save wrote") as file:
        return [_margin(entry) for entry in read_json(file)]


def _margin(entry: dict[str, Any]) -> Margin:
    """The margin in a file. Those of version 0.1 have null for NaN, and "inf"."""
    fields: dict[str, Any] = {name: math.inf if value == "inf" else value for name, value in entry.items()}
    if fields["value"] is None:
        fields["value"] = math.nan
    return Margin(**fields)
