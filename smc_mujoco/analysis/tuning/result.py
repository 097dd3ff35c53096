"""The result of a tuning and everything that it depends on. It is saved as JSON."""

import dataclasses
import itertools
import math
import os
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.analysis.tuning.objective import FAILURE_COST, Objective, restore
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import read_json, reading, with_ending, write_json
from smc_mujoco.common.tabular import Tables, Tabular
from smc_mujoco.common.text import counted
from smc_mujoco.common.version import __version__
from smc_mujoco.control import source
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import serialise

COMPARED_FIELDS = ("rule", "plant", "definition", "budget", "seed", "versions")  # equal in tunings that are compared
HEADINGS = ("gain", "tuned", "searched from", "to", "")  # of a tuning's table
SAVED_FIELDS = (
    "objective", "before", "rule", "budget", "seed", "screened", "ends", "scales", "bounds", "searched", "versions",
)  # fmt: skip
AGREEING_STARTS, AGREEMENT_TOLERANCE = 3, 0.01  # a search has converged when so many starts end so close to the best J
NEAR_OPTIMAL_TOLERANCE = 0.03  # of the best J; as much as a metric must differ to be relevant
MAX_SETS = 24  # near-optimal sets of gains of a tuning: as many as runs of a law in a study
# Numbers of sets that laws may have. Each divides those before it. Runs use their sets in turn, so the runs of two laws
# are as many independent samples as the law with fewer sets has sets.
SET_COUNTS = (MAX_SETS, 12, 6, 3, 1)


class Evaluation(NamedTuple):
    """One set of gains, in the order of `Tuned.bounds`: J = tracking + weight variation, see `objective`."""

    gains: tuple[float, ...]
    objective: float
    tracking: float
    variation: float

    @property
    def failed(self) -> bool:
        """Whether one of its runs failed."""
        return self.tracking >= FAILURE_COST


@dataclasses.dataclass(frozen=True, kw_only=True, repr=False)
class Tuned(Tables):
    """A law's best gains, and how they were tuned."""

    law: Component  # with the best gains
    objective: float  # their objective J, s^2
    history: tuple[Evaluation, ...]  # the accurate evaluations of the search, in order
    screened: int  # number of cheap evaluations, with which starts were chosen
    ends: tuple[float, ...]  # best J of each start, s^2
    before: float  # J of the law's original gains, which the search does not use, s^2
    plant: Plant
    definition: Objective  # with its conditions and u_max
    rule: str  # the search, in words
    budget: int  # largest number of sets of gains that could be evaluated
    seed: int  # of search and noise
    scales: dict[str, float]  # the plant's X, F, M and T, SI units
    bounds: search_space.Box  # gain -> lowest, highest, by the rule; starts are drawn from this box
    searched: search_space.Box  # the wider bounds of the search, up to a decade beyond the box
    versions: dict[str, str]  # of the packages that the numbers depend on

    def __repr__(self) -> str:
        return f"Tuned({self.plant.name}, {self.law}, objective={self.objective:.4g}, {self.verdict})"

    @property
    def tables(self) -> list[Tabular]:
        """One table, a line for each gain: its value, the bounds of its search, and whether it is at one of them."""
        rows = []
        for name, (low, high) in self.searched.items():
            remark = f"at its {self.at_bound[name]} bound" if name in self.at_bound else ""
            rows.append((name, f"{self.gains[name]:g}", f"{low:.3g}", f"{high:.3g}", remark))
        notes = (
            str(self.definition),
            f"{self.verdict}; {counted(len(near_optimal(self.history)), 'near-optimal set')}",
            f"objective {self.objective:.4g} s², with the law's own gains {self.before:.4g} s²; "
            f"{counted(self.evaluations, 'set')} of gains, seed {self.seed}",
        )
        return [Tabular(headings=HEADINGS, rows=rows, title=f"{self.law.name} on {self.plant.name}", notes=notes)]

    def sourced(self) -> "Tuned":
        """Return the tuning with a law that names this search as the source of its gains."""
        about_defaults = bool(search_space.without_unit(self.law))
        search = source.Search(
            rule=self.rule, evaluations=self.evaluations, converged=self.converged, about_defaults=about_defaults
        )
        return dataclasses.replace(self, law=self.law.sourced(source.TUNED, search))

    @property
    def gains(self) -> dict[str, float]:
        """The gains that were tuned."""
        return {name: self.law.gains[name] for name in self.bounds}

    @property
    def at_bound(self) -> dict[str, str]:
        """Gain -> "lower" or "upper", if it is within 2 % of a bound of the search, or at the actuator's limit."""
        u_max = math.inf if self.definition.u_max is None else self.definition.u_max
        limits = search_space.actuator_limits(self.law, self.law.gains, u_max)
        tight = 1.0 - search_space.ROUNDING_TOLERANCE
        full = {name: "upper" for name, gain in self.gains.items() if gain >= limits.get(name, math.inf) * tight}
        return search_space.at_bound(self.gains, self.searched) | full

    @property
    def evaluations(self) -> int:
        """Number of sets of gains that were evaluated, cheaply or accurately."""
        return self.screened + len(self.history)

    @property
    def converged(self) -> bool | None:
        """Whether three starts ended within 1 % of the best J; None if there were fewer."""
        return converged(self.ends)

    @property
    def verdict(self) -> str:
        """Whether the search has converged, in words."""
        agreeing = sum(end <= min(self.ends) * (1.0 + AGREEMENT_TOLERANCE) for end in self.ends)
        near = f"starts within {100 * AGREEMENT_TOLERANCE:g} % of the best: {agreeing} of {len(self.ends)}"
        return f"{source.ENDED[self.converged]}, {near}"

    @property
    def sets(self) -> list[Evaluation]:
        """24, 12, 6, 3 or 1 near-optimal evaluations, whose gains runs use in turn: the best, then the others.

        They cover the near-optimal gains: each is the one that is farthest, in log gains, from those taken before.
        Then those after the best are shuffled, so that the first few are not the most extreme ones.
        """
        near = near_optimal(self.history)
        logs = np.log10([one.gains for one in near])
        taken, distances = [0], np.linalg.norm(logs - logs[0], axis=1)
        while len(taken) < next(count for count in SET_COUNTS if count <= len(near)):
            taken.append(int(np.argmax(distances)))
            distances = np.minimum(distances, np.linalg.norm(logs - logs[taken[-1]], axis=1))
        order = np.random.default_rng(self.seed).permutation(taken[1:])
        return [near[0], *(near[k] for k in order)]

    @property
    def front(self) -> list[Evaluation]:
        """The Pareto front of the history in tracking and variation, by tracking, without failed ones."""
        front: list[Evaluation] = []
        for one in sorted(self.history, key=lambda e: (e.tracking, e.variation)):
            if not one.failed and (not front or one.variation < front[-1].variation):
                front.append(one)
        return front

    def record(self) -> dict[str, Any]:
        """Return what `control.gain_sets` stores of it, without the history."""
        best = self.sets[0]
        return {
            "gains": list(self.bounds),
            "sets": [one.gains for one in self.sets],
            "objective": _short(self.objective),
            "converged": self.converged,
            "ends": [_short(end) for end in self.ends],
            "evaluations": self.evaluations,
            "seed": self.seed,
            "at_bound": self.at_bound,
            "front": [(_short(one.tracking), _short(one.variation)) for one in self.front],
            "best": (_short(best.tracking), _short(best.variation)),
            "rule": self.rule,
            "versions": self.versions,
        }

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write a .json file that `load` reads back."""
        path = with_ending(path, ".json")
        scenario = self.definition.scenarios(self.plant, self.law, self.seed)[0]
        data = {name: getattr(self, name) for name in SAVED_FIELDS} | {
            "definition": self.definition.describe(),
            "at_bound": self.at_bound,
            "scenario": serialise.describe(scenario),
            "record": self.record(),
            "history": self.history,
        }
        return write_json(path, data)


def load(path: str | os.PathLike[str]) -> Tuned:
    """Read the tuning that `Tuned.save` wrote."""
    with reading(path, "tuning", "give a .json file that Tuned.save wrote") as file:
        data = read_json(file)
        scenario = serialise.restore(data["scenario"])
        fields: dict[str, Any] = {name: data[name] for name in SAVED_FIELDS}
        fields["ends"] = tuple(fields["ends"])
        fields |= {name: {k: tuple(v) for k, v in data[name].items()} for name in ("bounds", "searched")}
        return Tuned(
            **fields,
            history=tuple(Evaluation(tuple(gains), *costs) for gains, *costs in data["history"]),
            law=scenario.law,
            plant=scenario.plant,
            definition=restore(data["definition"]),
        )


def _short(value: float) -> float:
    return float(f"{value:.6g}")


def converged(ends: Sequence[float]) -> bool | None:
    """Return whether three starts ended within 1 % of the best J, given the best J of each; None if there are fewer."""
    if len(ends) < AGREEING_STARTS:
        return None
    return sorted(ends)[AGREEING_STARTS - 1] <= min(ends) * (1.0 + AGREEMENT_TOLERANCE)


def near_optimal(history: Sequence[Evaluation]) -> list[Evaluation]:
    """Return the evaluations within 3 % of the best J, best first; only the best one if its runs failed."""
    ranked = sorted(history, key=lambda e: e.objective)
    if ranked[0].failed:
        return ranked[:1]
    return [one for one in ranked if one.objective <= ranked[0].objective * (1.0 + NEAR_OPTIMAL_TOLERANCE)]


def compare(tuned: Sequence[Tuned]) -> list[Tuned]:
    """Return the tunings, best first. Raise ScenarioError unless all were made in the same way."""
    if not tuned:
        raise ScenarioError("cannot compare []: give a list of tunings")
    for one, field in itertools.product(tuned, COMPARED_FIELDS):
        if (value := getattr(one, field)) != (other := getattr(tuned[0], field)):
            name = field.replace("definition", "objective")
            words = f"{name} cannot be compared, {one.law.name} has {value}, {tuned[0].law.name} {other}"
            raise ScenarioError(f"laws tuned with unequal {words}: tune them in the same way")
    return sorted(tuned, key=lambda one: one.objective)


def versions() -> dict[str, str]:
    """Return the versions of the packages that the numbers of a tuning depend on."""
    return {"smc_mujoco": __version__} | {
        name: version(name) for name in ("mujoco", "numba", "numpy", "scipy", "cmaes")
    }
