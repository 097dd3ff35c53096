"""The runs that claims rest on, and how the scores of laws compare in them.

    runs = Runs("tuned")
    value = runs.score("duffing", "observer_free")["tv_rate"]
    check("duffing tv_rate / classical", value / runs.score("duffing", "classical")["tv_rate"], "<", 0.01)
    got = scores(runs, PLANTS, LAWS)                       # (plant, law) -> metric -> value; one batch

A run is made once: scores are kept by the scenario's key, and those that a study's table holds are taken from it.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from smc_mujoco.analysis.differences import OF_SCALE, OF_VALUE
from smc_mujoco.analysis.margin_kinds import TOLERATED_ERROR
from smc_mujoco.common.files import from_json
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.control.component import Component
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.executors import outcome
from smc_mujoco.studies.paper import scenarios as paper
from smc_mujoco.studies.paper.claims.verdict import Check, check, ratio
from smc_mujoco.studies.paper.scenarios import LAWS, PLANTS
from smc_mujoco.studies.run_key import key

if TYPE_CHECKING:
    from smc_mujoco.studies.table import Table

OURS = LAWS[0]  # the paper's law
RIVALS = LAWS[1:]  # classical, adaptive, and the paper's HOSMC
HOSMC = LAWS[3]
UNCLAMPED = "super_twisting_unclamped"  # as published; in the first gains its integral is clamped
NETWORKS = tuple(plant for plant in PLANTS if plant.endswith("network"))  # the paper does not say which way up

Scores = dict[str, float]
ScoresOfPairs = dict[tuple[str, str], Scores]  # of (plant, law)
Substitute = Mapping[str, Callable[[Component], Component]]  # law's name -> what makes its mutant of it


def scale(scenario: Scenario) -> float:
    """Return the largest |x0|, of which percentages are; the scale of a run that is to come to rest at 0."""
    return max(map(abs, scenario.x0)) or 1.0


class Held(NamedTuple):
    """What is kept of a run: its law's name and gains, and its scores, inf in each where the run failed."""

    law: str
    gains: Mapping[str, float]
    scores: Scores

    @classmethod
    def of(cls, law: str, gains: Mapping[str, float], outcome: Mapping[str, Any]) -> "Held":
        """Return what is kept of an outcome, or of a row of a study's table."""
        names = [m.name for m in metrics()]
        if outcome["failure"] is not None:
            return cls(law, gains, dict.fromkeys(names, math.inf))
        return cls(law, gains, {name: float(outcome[name]) for name in names if outcome.get(name) is not None})


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
        """Return the law, or its mutant, with the set's gains for a plant; a law that is not tuned has its own."""
        found = sets.law(plant, name, self.gains if name in (*sets.LAWS, *sets.SAME) else "default")
        return self.mutated(found)

    def mutated(self, law: Component) -> Component:
        """Return the law, or its mutant in this audit."""
        return self._substitute.get(law.name, lambda same: same)(law)

    def scenario(self, plant: str, law_name: str, /, condition: str = "nominal", **changes: Any) -> Scenario:
        """Return the study's scenario of a plant under a law in a condition, with some of its fields changed.

        A change of `plant` gives it other parameters or another size; the gains stay those of its name.
        """
        fields = {"law": self.law(plant, law_name)} | changes
        return paper.scenario(plant, "none", condition, changes=fields)

    def scores(self, scenarios: Iterable[Scenario]) -> list[Scores]:
        """Return every metric of every scenario, in order; a run that fails has inf in every metric."""
        wanted = [(key(scenario), scenario) for scenario in scenarios]
        new = {name: scenario for name, scenario in wanted if name not in self._table and name not in self._shared}
        names = list(new)
        for index, trace in stream(list(new.values()), self.threads):
            law = trace.scenario.law
            self._shared[names[index]] = Held.of(law.name, law.gains, outcome(trace))
        for name, _ in wanted:
            self._asked[name] = self._table[name] if name in self._table else self._shared[name]
        return [self._asked[name].scores for name, _ in wanted]

    def score(self, plant: str, law_name: str, condition: str = "nominal") -> Scores:
        """Return every metric of one run of the study."""
        return self.scores([self.scenario(plant, law_name, condition)])[0]

    def traces(self, scenarios: Sequence[Scenario]) -> list[Trace]:
        """Return the traces of scenarios, in order; they are not kept."""
        found: dict[int, Trace] = dict(stream(scenarios, self.threads))
        return [found[i] for i in range(len(scenarios))]

    def held(self) -> Iterator[Held]:
        """Yield every run of which the scores were asked for, and every run of the table."""
        yield from (self._asked | dict(self._table)).values()


def of_table(table: "Table") -> dict[str, Held]:
    """Return the runs that a study's table holds, by key."""
    return {row["hash"]: Held.of(row["law"], from_json(row["gains"]), row) for row in table.rows()}


def scores(runs: Runs, plants: Sequence[str], laws: Sequence[str], condition: str = "nominal") -> ScoresOfPairs:
    """Return (plant, law) -> scores, from one batch of runs."""
    pairs = [(plant, law) for plant in plants for law in laws]
    found = runs.scores([runs.scenario(plant, law, condition) for plant, law in pairs])
    return dict(zip(pairs, found, strict=True))


def bound(runs: Runs, plant: str) -> float:
    """Return lambda, the bound on u of the paper's law, N or N m; of a mutant its magnitude."""
    return abs(runs.law(plant, OURS).gains["lam"])


def comes_to_rest(runs: Runs, grid: Mapping[str, Scenario]) -> list[Check]:
    """Check of every named scenario that its ultimate bound is at most 5 % of |x0|."""
    return [
        check(f"{name}: ultimate bound / |x0|", scores["ultimate_bound"] / scale(scenario), "<=", TOLERATED_ERROR)
        for (name, scenario), scores in zip(grid.items(), runs.scores(grid.values()), strict=True)
    ]


def actual_bound(runs: Runs, plant: str) -> float:
    """Return min(lambda, u_max), the bound on u that is really there, N or N m."""
    return min(bound(runs, plant), runs.scenario(plant, OURS).u_max)


def larger_than(value: float, of: float = 0.0) -> float:
    """Return the least value that is relevantly larger: by 3 % of the larger one, and by 0.5 % of a scale."""
    return max(value / (1.0 - OF_VALUE), value + OF_SCALE * of)


def overshoot(got: Scores) -> float:
    """Return the overshoot of a run, %; inf where it does not settle."""
    return got["overshoot"] if math.isfinite(got["settling_time"]) else math.inf


def slower(plant: str, law: str, got: Mapping[tuple[str, str], Scores]) -> Check:
    """Check that a law settles later than the paper's by a relevant difference; where neither settles, none does."""
    times = [got[plant, name]["settling_time"] for name in (law, OURS)]
    return check(f"{plant}: settling time of {law}, over that of {OURS}", ratio(*times), ">", larger_than(1.0))


def alike(plant: str, law: str, other: str, got: Mapping[tuple[str, str], Scores], within: float) -> Check:
    """Check that a law settles within a share of the other's time."""
    apart = abs(ratio(got[plant, law]["settling_time"], got[plant, other]["settling_time"]) - 1.0)
    return check(f"{plant}: settling time of {law} apart from {other}'s, share of that", apart, "<=", within)


def deviation(trace: Trace, other: Trace) -> float:
    """Return the largest |x - x'| of two traces over all channels, as a share of |x0|; inf where one failed."""
    apart = float(np.abs(trace.x - other.x).max())
    return math.inf if math.isnan(apart) else apart / scale(other.scenario)
