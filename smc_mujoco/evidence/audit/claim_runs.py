"""The runs that claims rest on. A claim's function is called with a `ClaimRuns`.

    def settles(runs):
        scenarios = runs.grid()                        # (plant, law, condition) -> Scenario
        scores = runs.scores(scenarios.values())       # every metric of each, in order
        times = {}
        for (plant, *_), score in zip(scenarios, scores):
            times[plant] = score["settling_time"]
        return {"settling time, s": times}

A run is made once: scores are kept by the scenario's key. Runs in a study's table are taken from
it.
"""

import copy
import dataclasses
import hashlib
import itertools
import math
from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from smc_mujoco.common.aliases import Data, Fields, Names, Numbers
from smc_mujoco.common.errors import find
from smc_mujoco.common.files import from_json
from smc_mujoco.common.frozen import frozen
from smc_mujoco.control.component import Component
from smc_mujoco.evidence.audit.paper import ClaimEntry, Paper
from smc_mujoco.evidence.audit.verdict import Check, Threshold, check
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.simulation.conditions import DURATION, Condition
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.run_key import Hashes, run_key
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import ARRAYS, Trace
from smc_mujoco.studies.batches import result_columns

if TYPE_CHECKING:
    from smc_mujoco.studies.table import Table

Scores = dict[str, float]
Name = TypeVar("Name")
Value = TypeVar("Value")
# law's name -> function from the law to its mutant
Substitute = Mapping[str, Callable[[Component], Component]]


class RunResult(NamedTuple):
    """What is kept of a run: its law's name, gains and scores, which are inf if the run failed."""

    law: str
    gains: Numbers
    scores: Scores

    @classmethod
    def of(cls, law: str, gains: Numbers, outcome: Data) -> "RunResult":
        """Return what is kept of an outcome, or of a row of a study's table."""
        scores = {}
        for metric in metrics():
            if outcome["failure"] is not None:
                scores[metric.name] = math.inf
            elif outcome.get(metric.name) is not None:
                scores[metric.name] = float(outcome[metric.name])
        return cls(law, gains, scores)


class Used(NamedTuple):
    """A run that a claim has used: its scenario, and hashes of the scores and of the trace that it
    read.
    """

    scenario: Scenario
    scores: str = ""
    trace: str = ""


@dataclasses.dataclass(eq=False)
class ClaimRuns:
    """Runs of a paper under one set of gains, made when they are needed and kept by their
    scenario's key.
    """

    paper: Paper
    gains: str
    quick: bool = False  # whether a claim measures less: coarser grids, shorter runs
    substitute: Substitute = dataclasses.field(default_factory=dict)
    threads: int | None = None
    # by key: runs that are not made again, those for the ClaimRuns of all sets, those that the
    # claim has used, and those whose scores any claim has used
    table: dict[str, RunResult] = dataclasses.field(default_factory=dict)
    shared: dict[str, RunResult] = dataclasses.field(default_factory=dict)
    used: dict[str, Used] = dataclasses.field(default_factory=dict)
    scored: dict[str, RunResult] = dataclasses.field(default_factory=dict)
    plants: Names = ()  # names of the claim's plants; below, of its laws and conditions
    laws: Names = ()
    conditions: Names = ("nominal",)
    values: Mapping[str, Any] = frozen({})  # the claim's numbers, such as the levels of a sweep
    thresholds: Mapping[str, Threshold] = frozen({})  # of the claim, by measure
    fields: Mapping[str, Any] = frozen({})  # of the claim's scenarios
    searched: Mapping[str, Numbers] = frozen({})  # law -> gains in place of the set's

    def of(self, entry: ClaimEntry) -> "ClaimRuns":
        """Return these runs as a claim sees them: with its names and fields, and none used yet."""
        runs = copy.copy(self)
        runs.used = {}
        runs.plants = entry.plants
        runs.laws = entry.laws
        runs.conditions = entry.conditions or ("nominal",)
        runs.values = entry.values
        runs.fields = entry.fields
        runs.thresholds = {threshold.measure: threshold for threshold in entry.thresholds}
        return runs

    def at(self, law: str, gains: Numbers, quick: bool) -> "ClaimRuns":
        """Return the claim's runs with some gains of a law in place of the set's; they count as
        used by the claim.
        """
        runs = copy.copy(self)
        runs.searched = {law: dict(gains)}
        runs.quick = quick
        return runs

    def on(self, plant: str) -> "ClaimRuns":
        """Return the claim's runs on one of its plants; they count as used by the claim."""
        runs = copy.copy(self)
        runs.plants = (plant,)
        return runs

    def few(self, values: Sequence[Value], part: slice = slice(1)) -> Sequence[Value]:
        """Return a part of some values in a quick audit, by default the first, else all."""
        return values[part] if self.quick else values

    @property
    def plant(self) -> str:
        """Name of the plant of a claim that has one."""
        return self.plants[0]

    def check(
        self, measure: str, what: str, value: float, times: float = 1.0, sentence: str = ""
    ) -> Check:
        """Return the check of what was measured against the threshold of a measure, `holds_if` in
        the paper's file.

        A function returns checks instead of numbers if a limit depends on runs, or if it has a name
        for each number. The limit is multiplied by `times`: with a rival's time, "<= 1.1" asks for
        at most 1.1 times that time.
        """
        threshold = find("threshold", measure, self.thresholds)
        return check(
            what, value, threshold.relation, threshold.limit * times, sentence or threshold.sentence
        )

    def law(self, plant: str, name: str, **gains: float) -> Component:
        """Return a law, or its mutant in this audit, with the set's gains for a plant and some of
        them changed.
        """
        law = self.paper.law(plant, name, self.gains)
        gains = {**self.searched.get(name, {}), **gains}
        for gain in gains:
            find(f"gain of {name}", gain, law.gains)
        return self.mutated(dataclasses.replace(law, gains={**law.gains, **gains}))

    def mutated(self, law: Component) -> Component:
        """Return the law, or its mutant in this audit, which keeps the law's name so that claims
        find its runs.
        """
        mutant = self.substitute.get(law.name)
        if mutant:
            return dataclasses.replace(mutant(law), name=law.name)
        return law

    def scenario(
        self, plant: str, law_name: str, /, condition: str | Condition = "nominal", **changes: Any
    ) -> Scenario:
        """Return the scenario of a plant under a law in a condition, with some of its fields
        changed.

        Fields come from the paper, the condition, the claim and the changes; the later replace the
        earlier. A changed `plant` may have other parameters or another size. The gains stay those
        of the named plant.
        """
        paper = self.paper
        own_fields = self.fields
        machine = paper.plant(plant)
        duration = {"duration": DURATION, **paper.fields, **own_fields, **changes}["duration"]
        fields: Fields = {"plant": machine, **paper.fields}
        fields |= {**paper.condition(condition).on(machine, duration), **own_fields}
        if "law" not in changes:
            fields["law"] = self.law(plant, law_name)
        scenario = Scenario(**fields | changes)
        return scenario.named(condition if isinstance(condition, str) else condition.name)

    def only(self, **changes: Any) -> Scenario:
        """Return the scenario of the claim's first plant, law and condition, with some of its
        fields changed.
        """
        plant, law, condition = self.plants[0], self.laws[0], self.conditions[0]
        return self.scenario(plant, law, condition, **changes)

    def grid(self, **changes: Any) -> dict[tuple[str, str, str], Scenario]:
        """Return (plant, law, condition) -> scenario for all that the claim names, with some fields
        changed.
        """
        cells = itertools.product(self.plants, self.laws, self.conditions)
        scenarios = {}
        for cell in cells:
            scenarios[cell] = self.scenario(*cell, **changes)
        return scenarios

    def scores(self, scenarios: Iterable[Scenario]) -> list[Scores]:
        """Return every metric of every scenario, in order; a run that fails has inf in every
        metric.
        """
        keyed = self._keyed(scenarios)
        results = ChainMap(self.shared, self.table)
        new = {}
        for name, scenario in keyed:
            if name not in results:
                new[name] = scenario
        names = list(new)
        for index, trace in stream(list(new.values()), self.threads):
            law = trace.scenario.law
            results[names[index]] = RunResult.of(law.name, law.gains, result_columns(trace))
        for name, scenario in keyed:
            self.scored[name] = result = results[name]
            parts = []
            for metric, value in sorted(result.scores.items()):
                parts.append(f"{metric}={float(value).hex()}")
            hashed = _hash(",".join(parts).encode())
            self.used[name] = self.used.get(name, Used(scenario))._replace(scores=hashed)
        return [results[name].scores for name, _ in keyed]

    def score(self, plant: str, law_name: str, condition: str = "nominal") -> Scores:
        """Return every metric of one run."""
        return self.scores([self.scenario(plant, law_name, condition)])[0]

    def by_plant(self, measure: Callable[[str], Value]) -> dict[str, Value]:
        """Return plant -> what is measured on it, for the claim's plants."""
        return dict(zip(self.plants, map(measure, self.plants), strict=True))

    def metric(
        self, name: str, plant: str, laws: Iterable[str], condition: str = "nominal"
    ) -> dict[str, float]:
        """Return law -> a metric of its run on a plant."""
        by_law = {}
        for law in laws:
            by_law[law] = self.score(plant, law, condition)[name]
        return by_law

    def traces(self, scenarios: Iterable[Scenario]) -> list[Trace]:
        """Return the traces of scenarios, in order; they are not kept."""
        keyed = self._keyed(scenarios)
        done = dict(stream([scenario for _, scenario in keyed], self.threads))
        traces = [done[i] for i in sorted(done)]
        for (name, scenario), trace in zip(keyed, traces, strict=True):
            parts = []
            for array in ARRAYS:
                parts.append(getattr(trace, array).tobytes())
            hashed = _hash(*parts)
            self.used[name] = self.used.get(name, Used(scenario))._replace(trace=hashed)
        return traces

    def _keyed(self, scenarios: Iterable[Scenario]) -> list[tuple[str, Scenario]]:
        """Return scenarios with their keys, without the name of their condition, which changes
        nothing in a run.
        """
        plants: Hashes = {}
        keyed = []
        for scenario in scenarios:
            keyed.append((run_key(scenario.named(None), plants=plants), scenario))
        return keyed

    def traced(self, scenarios: Mapping[Name, Scenario]) -> dict[Name, Trace]:
        """Return name -> trace of named scenarios, such as those of `grid`."""
        return dict(zip(scenarios, self.traces(scenarios.values()), strict=True))

    def measured(
        self, scenarios: Mapping[Name, Scenario], measure: Callable[[Trace], Value]
    ) -> dict[Name, Value]:
        """Return name -> what is measured on the trace of a named scenario."""
        by_name = {}
        for name, trace in self.traced(scenarios).items():
            by_name[name] = measure(trace)
        return by_name

    def results(self) -> Iterator[RunResult]:
        """Yield every run of the audit whose scores were used, and every run of the table."""
        yield from (self.scored | self.table).values()


def of_table(table: "Table") -> dict[str, RunResult]:
    """Return the runs that a study's table holds, by key."""
    runs = {}
    for row in table.rows():
        runs[row["hash"]] = RunResult.of(row["law"], from_json(row["gains"]), row)
    return runs


def _hash(*parts: bytes) -> str:
    """Return the hash of some bytes, 16 hex digits."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()[:16]
