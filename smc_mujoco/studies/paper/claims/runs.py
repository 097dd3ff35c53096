"""The runs that claims rest on, and the checks that several claims share.

    runs = Runs("tuned")
    value = runs.score("duffing", "observer_free")["tv_rate"]
    check("duffing tv_rate / classical", value / runs.score("duffing", "classical")["tv_rate"], "<", 0.01)

A run is made once: scores are kept by the scenario's key. Those in a study's table are taken from it.
"""

import math
from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from smc_mujoco.analysis.differences import OF_SCALE, OF_VALUE
from smc_mujoco.analysis.margins import TOLERATED_ERROR
from smc_mujoco.common.files import from_json
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.audit.verdict import Check, check, ratio
from smc_mujoco.studies.executors import outcome
from smc_mujoco.studies.paper import scenarios as paper
from smc_mujoco.studies.paper.claims.variants import with_gains
from smc_mujoco.studies.paper.scenarios import LAWS, PLANTS
from smc_mujoco.studies.run_key import key

if TYPE_CHECKING:
    from smc_mujoco.studies.table import Table

OURS = LAWS[0]  # the paper's law
RIVALS = LAWS[1:]  # classical, adaptive, and the paper's HOSMC
HOSMC = LAWS[3]
UNCLAMPED = "super_twisting_unclamped"  # as published; in the first gains its integral is clamped
CONDITIONED = "conditioned_super_twisting"  # not the paper's: without the wind-up of the plain one
NETWORKS = tuple(plant for plant in PLANTS if plant.endswith("network"))  # the paper does not say which way up
LIKE = 0.25  # a settling time like another: within this share of it
LONG, PERIOD = 40.0, 5e-3  # s; s, of control and physics: runs near rest, where the smooth law asks no more

Scores = dict[str, float]
Substitute = Mapping[str, Callable[[Component], Component]]  # law's name -> what makes its mutant of it


def scale(scenario: Scenario) -> float:
    """Return the largest |x0|, of which percentages are; the scale of a run that is to come to rest at 0."""
    return max(map(abs, scenario.resolved.x0)) or 1.0


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


class Runs:
    """Runs under one set of gains, made when they are needed and kept by their scenario's key.

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
        table: dict[str, Result] | None = None,
        shared: dict[str, Result] | None = None,
    ):
        self.gains, self.quick, self.threads = gains, quick, threads
        self._substitute = substitute or {}
        self._table = table or {}
        self._known = ChainMap({} if shared is None else shared, self._table)  # shared with the Runs of other sets
        self._used: dict[str, Result] = {}

    def law(self, plant: str, name: str) -> Component:
        """Return the law, or its mutant, with the set's gains for a plant; a law that is not tuned has its own."""
        return self.mutated(sets.law(plant, name, self.gains if name in (*sets.LAWS, *sets.SAME) else "default"))

    def mutated(self, law: Component) -> Component:
        """Return the law, or its mutant in this audit."""
        return self._substitute.get(law.name, lambda same: same)(law)

    def scenario(self, plant: str, law_name: str, /, condition: str = "nominal", **changes: Any) -> Scenario:
        """Return the study's scenario of a plant under a law in a condition, with some of its fields changed.

        A change of `plant` gives it other parameters or another size; the gains stay those of its name.
        """
        return paper.scenario(plant, "none", condition, changes={"law": self.law(plant, law_name)} | changes)

    def scores(self, scenarios: Iterable[Scenario]) -> list[Scores]:
        """Return every metric of every scenario, in order; a run that fails has inf in every metric."""
        wanted = [(key(scenario), scenario) for scenario in scenarios]
        new = {name: scenario for name, scenario in wanted if name not in self._known}
        names = list(new)
        for index, trace in stream(list(new.values()), self.threads):
            law = trace.scenario.law
            self._known[names[index]] = Result.of(law.name, law.gains, outcome(trace))
        self._used |= {name: self._known[name] for name, _ in wanted}
        return [self._known[name].scores for name, _ in wanted]

    def score(self, plant: str, law_name: str, condition: str = "nominal") -> Scores:
        """Return every metric of one run of the study."""
        return self.scores([self.scenario(plant, law_name, condition)])[0]

    def traces(self, scenarios: Sequence[Scenario]) -> list[Trace]:
        """Return the traces of scenarios, in order; they are not kept."""
        traces = dict(stream(scenarios, self.threads))
        return [traces[i] for i in range(len(scenarios))]

    def results(self) -> Iterator[Result]:
        """Yield every run whose scores were used, and every run of the table."""
        yield from (self._used | self._table).values()


def of_table(table: "Table") -> dict[str, Result]:
    """Return the runs that a study's table holds, by key."""
    return {row["hash"]: Result.of(row["law"], from_json(row["gains"]), row) for row in table.rows()}


def long_run(runs: Runs, plant: str, lam: float, position: float, rate: float = 0.0) -> Scenario:
    """Return a run of 40 s with another lambda, from position times x0 with every channel at rate times |x0| per s."""
    x0 = find_plant(plant).x0
    return runs.scenario(
        plant,
        OURS,
        law=with_gains(runs.law(plant, OURS), lam=lam),
        x0=[position * x for x in x0],
        v0=rate * max(map(abs, x0)),
        duration=LONG,
        control_period=PERIOD,
        physics_step=PERIOD,
    )


def command_bound(runs: Runs, plant: str) -> float:
    """Return min(lambda, u_max), the bound on the u of the paper's law, N or N m; of a mutant with its |lambda|."""
    return min(abs(runs.law(plant, OURS).gains["lam"]), runs.scenario(plant, OURS).resolved.u_max)


def comes_to_rest(runs: Runs, grid: Mapping[str, Scenario]) -> list[Check]:
    """Check for every named scenario that its ultimate bound is at most 5 % of |x0|."""
    return [
        check(f"{name}: ultimate bound / |x0|", scores["ultimate_bound"] / scale(scenario), "<=", TOLERATED_ERROR)
        for (name, scenario), scores in zip(grid.items(), runs.scores(grid.values()), strict=True)
    ]


def larger_than(value: float, of: float = 0.0) -> float:
    """Return the least value that is relevantly larger: by 3 % of the larger one, and by 0.5 % of a scale."""
    return max(value / (1.0 - OF_VALUE), value + OF_SCALE * of)


def overshoot(runs: Runs, plant: str, law: str) -> float:
    """Return the overshoot of the nominal run, %; inf if it does not settle."""
    scores = runs.score(plant, law)
    return scores["overshoot"] if math.isfinite(scores["settling_time"]) else math.inf


def slower(runs: Runs, plant: str, law: str, sentence: str = "") -> Check:
    """Check that a law settles later than the paper's by a relevant difference; if neither settles, none does."""
    times = [runs.score(plant, name)["settling_time"] for name in (law, OURS)]
    what = f"{plant}: settling time of {law}, over that of {OURS}"
    return check(what, ratio(*times), ">", larger_than(1.0), sentence)


def alike(runs: Runs, plant: str, law: str, other: str, sentence: str = "") -> Check:
    """Check that a law settles within 25 % of the other's time."""
    times = [runs.score(plant, name)["settling_time"] for name in (law, other)]
    what = f"{plant}: settling time of {law} apart from {other}'s, share of that"
    return check(what, abs(ratio(*times) - 1.0), "<=", LIKE, sentence)


def deviation(trace: Trace, other: Trace) -> float:
    """Return the largest |x - x'| of two traces over all channels, as a share of |x0|; inf if one failed."""
    apart = float(np.abs(trace.x - other.x).max())
    return math.inf if math.isnan(apart) else apart / scale(other.scenario)
