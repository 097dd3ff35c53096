"""What a claim rests on: checks, each a measured number against its limit, and the runs that they are measured on.

    runs = Runs("tuned")
    value = runs.score("duffing", "observer_free")["tv_rate"]
    check("duffing tv_rate / classical", value / runs.score("duffing", "classical")["tv_rate"], "<", 0.01)

A run is made once: scores are kept by the scenario's key, and those that a study's table holds are taken from it.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import from_json
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.control.component import Component
from smc_mujoco.metrics.catalogue import metrics, score
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.paper import scenarios as paper
from smc_mujoco.studies.paper.claims.checks import Beside, Check, check, ratio
from smc_mujoco.studies.run_key import key

if TYPE_CHECKING:
    from smc_mujoco.studies.table import Table

__all__ = ["Beside", "Check", "Held", "Runs", "Scores", "Substitute", "check", "of_table", "ratio", "scale", "scored"]

Scores = dict[str, float]
Substitute = Mapping[str, Callable[[Component], Component]]  # law's name -> what makes its mutant of it


def scale(scenario: Scenario) -> float:
    """The largest |x0_i|, of which percentages are, as `measure.scale` of a run that is to come to rest at 0."""
    return max(map(abs, scenario.x0)) or 1.0


class Held(NamedTuple):
    """What is kept of a run: its law's name and gains, and its scores."""

    law: str
    gains: Mapping[str, float]
    scores: Scores


class Runs:
    """Runs under one set of gains, made as they are asked for and kept by their scenario's key.

    Attributes:
      gains: the set, one of `gains.SETS`.
      quick: whether a claim is to look at coarser grids, and at no network above 50 pendulums.
      threads: simulations at once.
    """

    def __init__(
        self,
        gains: str = "tuned",
        quick: bool = False,
        substitute: Substitute | None = None,
        threads: int | None = None,
        table: Mapping[str, Held] | None = None,
        shared: dict[str, Held] | None = None,
    ):
        self.gains, self.quick, self.threads = gains, quick, threads
        self._substitute = dict(substitute or {})
        self._table = table or {}
        self._shared = {} if shared is None else shared  # with the Runs of other sets
        self._asked: dict[str, Held] = {}

    def law(self, plant: str, name: str) -> Component:
        """The law with the set's gains for a plant, or its mutant; one that the set does not tune, with its own."""
        found = sets.law(plant, name, self.gains if name in (*sets.LAWS, *sets.SAME) else "default")
        return self.mutated(found)

    def mutated(self, law: Component) -> Component:
        """What stands for a law in this audit: the law, or its mutant."""
        return self._substitute.get(law.name, lambda same: same)(law)

    def scenario(self, plant: str, law_name: str, /, condition: str = "nominal", **changes: Any) -> Scenario:
        """The study's scenario of a plant under a law in a condition, with some of its fields changed.

        A change of `plant` gives it other parameters or another size; the gains stay those of its name.
        """
        fields = {"law": self.law(plant, law_name)} | changes
        return paper.scenario(plant, "none", condition, changes=fields)

    def scores(self, scenarios: Iterable[Scenario]) -> list[Scores]:
        """Every metric of every scenario, in order; a run that fails has inf in every metric."""
        wanted = [(key(scenario), scenario) for scenario in scenarios]
        new = {name: scenario for name, scenario in wanted if name not in self._table and name not in self._shared}
        names = list(new)
        for index, trace in stream(list(new.values()), self.threads):
            law = trace.scenario.law
            self._shared[names[index]] = Held(law.name, law.gains, scored(trace))
        for name, _ in wanted:
            self._asked[name] = self._table[name] if name in self._table else self._shared[name]
        return [self._asked[name].scores for name, _ in wanted]

    def score(self, plant: str, law_name: str, condition: str = "nominal") -> Scores:
        """Every metric of one run of the study."""
        return self.scores([self.scenario(plant, law_name, condition)])[0]

    def traces(self, scenarios: Sequence[Scenario]) -> list[Trace]:
        """The traces of scenarios, in order; they are not kept."""
        found: dict[int, Trace] = dict(stream(scenarios, self.threads))
        return [found[i] for i in range(len(scenarios))]

    def held(self) -> Iterator[Held]:
        """Every run of which the scores were asked for, and every run of the table."""
        yield from (self._asked | dict(self._table)).values()


def scored(trace: Trace) -> Scores:
    """Every metric of a trace; inf in each where the run failed."""
    try:
        return score(trace)
    except ScenarioError:
        return {m.name: math.inf for m in metrics() if not m.refusal(trace.scenario.plant)}


def of_table(table: "Table") -> dict[str, Held]:
    """The runs that a study's table holds, by key."""
    names = [m.name for m in metrics()]
    found = {}
    for row in table.rows():
        failed = row["failure"] is not None
        scores = {n: math.inf if failed else float(row[n]) for n in names if failed or row.get(n) is not None}
        found[row["hash"]] = Held(row["law"], from_json(row["gains"]), scores)
    return found
