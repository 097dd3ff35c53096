"""The runs that claims rest on: what a claim's function is called with.

    def settles(runs):
        scenarios = runs.grid()                        # (plant, law, condition) -> Scenario, of the claim's names
        scores = runs.scores(scenarios.values())       # every metric of each, in order
        return {"settling time, s": {plant: one["settling_time"] for (plant, *_), one in zip(scenarios, scores)}}

A run is made once: scores are kept by the scenario's key. Those in a study's table are taken from it.
"""

import copy
import dataclasses
import hashlib
import itertools
import math
from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from smc_mujoco.common.errors import find
from smc_mujoco.common.files import from_json
from smc_mujoco.control.component import Component
from smc_mujoco.evidence.audit.paper import Entry, Paper, duration_of
from smc_mujoco.evidence.audit.verdict import Check, Threshold, check
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.simulation.conditions import Condition
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import ARRAYS, Trace
from smc_mujoco.studies.executors import result_columns
from smc_mujoco.studies.run_key import Hashes, key

if TYPE_CHECKING:
    from smc_mujoco.studies.table import Table

Scores = dict[str, float]
Name = TypeVar("Name")
Substitute = Mapping[str, Callable[[Component], Component]]  # law's name -> what makes its mutant of it


class Result(NamedTuple):
    """What is kept of a run: its law's name and gains, and its scores, each inf if the run failed."""

    law: str
    gains: Mapping[str, float]
    scores: Scores

    @classmethod
    def of(cls, law: str, gains: Mapping[str, float], outcome: Mapping[str, Any]) -> "Result":
        """Return what is kept of an outcome, or of a row of a study's table."""
        names = [m.name for m in metrics()]
        if outcome["failure"] is not None:
            return cls(law, gains, dict.fromkeys(names, math.inf))
        return cls(law, gains, {name: float(outcome[name]) for name in names if outcome.get(name) is not None})


class Used(NamedTuple):
    """A run that a claim has used: its scenario, and hashes of the scores and of the trace that it read."""

    scenario: Scenario
    scores: str = ""
    trace: str = ""


class Runs:
    """Runs of a paper under one set of gains, made when they are needed and kept by their scenario's key.

    Attributes:
      paper: whose plants, laws, conditions and gains they have.
      gains: the set, one of the paper's.
      quick: whether a claim measures less: coarser grids, shorter runs.
      threads: simulations at once.
      used: key -> run that the claim has used.
      checked: measures whose thresholds the claim's function has asked for, see `check`.
    """

    def __init__(
        self,
        paper: Paper,
        gains: str,
        quick: bool = False,
        substitute: Substitute | None = None,
        threads: int | None = None,
        table: dict[str, Result] | None = None,
        shared: dict[str, Result] | None = None,
    ):
        self.paper, self.gains, self.quick, self.threads = paper, gains, quick, threads
        self.used: dict[str, Used] = {}
        self.checked: set[str] = set()
        self._entry: Entry | None = None
        self._searched: dict[str, dict[str, float]] = {}  # law -> gains in place of the set's
        self._substitute = substitute or {}
        self._table = table or {}
        self._known = ChainMap({} if shared is None else shared, self._table)  # shared with the Runs of other sets
        self._used: dict[str, Result] = {}

    def of(self, entry: Entry) -> "Runs":
        """Return these runs as a claim sees them: with its names and fields, and none used yet."""
        runs = copy.copy(self)
        runs._entry, runs.used, runs.checked = entry, {}, set()
        return runs

    def at(self, law: str, gains: Mapping[str, float], quick: bool) -> "Runs":
        """Return the claim's runs with some gains of a law in place of the set's; they count as used by the claim."""
        runs = copy.copy(self)
        runs._searched, runs.quick = {law: dict(gains)}, quick
        return runs

    def on(self, plant: str) -> "Runs":
        """Return the claim's runs on one of its plants; they count as used by the claim."""
        runs = copy.copy(self)
        runs._entry = self._entry and dataclasses.replace(self._entry, plants=(plant,))
        return runs

    @property
    def plants(self) -> tuple[str, ...]:
        """Names of the claim's plants."""
        return self._entry.plants if self._entry else ()

    @property
    def plant(self) -> str:
        """Name of the plant of a claim that has one."""
        return self.plants[0]

    @property
    def laws(self) -> tuple[str, ...]:
        """Names of the claim's laws."""
        return self._entry.laws if self._entry else ()

    @property
    def conditions(self) -> tuple[str, ...]:
        """Names of the claim's conditions; the nominal one if it names none."""
        return (self._entry.conditions if self._entry else ()) or ("nominal",)

    @property
    def thresholds(self) -> dict[str, Threshold]:
        """The claim's thresholds, by measure."""
        return {threshold.measure: threshold for threshold in (self._entry.thresholds if self._entry else ())}

    @property
    def values(self) -> Mapping[str, Any]:
        """The claim's numbers, such as the levels of a sweep."""
        return self._entry.values if self._entry else {}

    def check(self, measure: str, what: str, value: float, times: float = 1.0, sentence: str = "") -> Check:
        """Return the check of a number against the threshold of a measure, `holds_if` in the paper's file.

        A function returns checks instead of numbers if a limit depends on runs, or if it has a name for each number.

        Args:
          measure: of `holds_if`.
          what: was measured.
          times: what the limit is a multiple of: "<= 1.1" and a rival's time mean at most 1.1 times that time.
          sentence: of the claim that it is about; default: that of the threshold.
        """
        threshold = find("threshold", measure, self.thresholds)
        self.checked.add(measure)
        return check(what, value, threshold.relation, threshold.limit * times, sentence or threshold.sentence)

    def law(self, plant: str, name: str, **gains: float) -> Component:
        """Return a law, or its mutant in this audit, with the set's gains for a plant and some of them changed."""
        law = self.paper.law(plant, name, self.gains)
        gains = {**self._searched.get(name, {}), **gains}
        for gain in gains:
            find(f"gain of {name}", gain, law.gains)
        return self.mutated(dataclasses.replace(law, gains={**law.gains, **gains}))

    def mutated(self, law: Component) -> Component:
        """Return the law, or its mutant in this audit under the law's name, by which a claim may look for its run."""
        mutant = self._substitute.get(law.name)
        return dataclasses.replace(mutant(law), name=law.name) if mutant else law

    def scenario(
        self, plant: str, law_name: str, /, condition: str | Condition = "nominal", **changes: Any
    ) -> Scenario:
        """Return the scenario of a plant under a law in a condition, with some of its fields changed.

        The fields are the paper's, the condition's, the claim's and then the changes. A change of `plant` may have
        other parameters or another size; the gains stay those of the named plant.
        """
        paper, entry = self.paper, self._entry
        machine = paper.plant(plant)
        conditioned = paper.condition(condition).on(machine, duration_of(paper, entry, changes))
        fields: dict[str, Any] = {"plant": machine, **paper.fields, **conditioned, **(entry.fields if entry else {})}
        if "law" not in changes:
            fields["law"] = self.law(plant, law_name)
        scenario = Scenario(**fields | changes)
        return scenario.named(condition if isinstance(condition, str) else condition.name)

    def grid(self, **changes: Any) -> dict[tuple[str, str, str], Scenario]:
        """Return (plant, law, condition) -> scenario for all that the claim names, with some fields changed."""
        cells = itertools.product(self.plants, self.laws, self.conditions)
        return {cell: self.scenario(*cell, **changes) for cell in cells}

    def scores(self, scenarios: Iterable[Scenario]) -> list[Scores]:
        """Return every metric of every scenario, in order; a run that fails has inf in every metric."""
        plants: Hashes = {}
        wanted = [(_key(scenario, plants), scenario) for scenario in scenarios]
        new = {name: scenario for name, scenario in wanted if name not in self._known}
        names = list(new)
        for index, trace in stream(list(new.values()), self.threads):
            law = trace.scenario.law
            self._known[names[index]] = Result.of(law.name, law.gains, result_columns(trace))
        self._used |= {name: self._known[name] for name, _ in wanted}
        for name, scenario in wanted:
            hashed = _hash_of_scores(self._known[name].scores)
            self.used[name] = self.used.get(name, Used(scenario))._replace(scores=hashed)
        return [self._known[name].scores for name, _ in wanted]

    def score(self, plant: str, law_name: str, condition: str = "nominal") -> Scores:
        """Return every metric of one run."""
        return self.scores([self.scenario(plant, law_name, condition)])[0]

    def traces(self, scenarios: Iterable[Scenario]) -> list[Trace]:
        """Return the traces of scenarios, in order; they are not kept."""
        wanted: Sequence[Scenario] = list(scenarios)
        traces = dict(stream(wanted, self.threads))
        plants: Hashes = {}
        for i, scenario in enumerate(wanted):
            name = _key(scenario, plants)
            self.used[name] = self.used.get(name, Used(scenario))._replace(trace=_hash_of_trace(traces[i]))
        return [traces[i] for i in range(len(wanted))]

    def traced(self, scenarios: Mapping[Name, Scenario]) -> dict[Name, Trace]:
        """Return name -> trace of named scenarios, such as those of `grid`."""
        return dict(zip(scenarios, self.traces(scenarios.values()), strict=True))

    def results(self) -> Iterator[Result]:
        """Yield every run of the audit whose scores were used, and every run of the table."""
        yield from (self._used | self._table).values()


def of_table(table: "Table") -> dict[str, Result]:
    """Return the runs that a study's table holds, by key."""
    return {row["hash"]: Result.of(row["law"], from_json(row["gains"]), row) for row in table.rows()}


def _key(scenario: Scenario, plants: Hashes) -> str:
    """Return the key of a run without the name of its condition, which changes nothing in it."""
    return key(scenario.named(None), plants=plants)


def _hash_of_scores(scores: Scores) -> str:
    text = ",".join(f"{name}={float(value).hex()}" for name, value in sorted(scores.items()))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _hash_of_trace(trace: Trace) -> str:
    digest = hashlib.sha256()
    for name in ARRAYS:
        digest.update(getattr(trace, name).tobytes())
    return digest.hexdigest()[:16]
