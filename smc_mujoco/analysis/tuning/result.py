"""The result of a tuning and everything that it depends on. It is saved as JSON."""

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.analysis.tuning.objective import Evaluation, Objective, restored_objective
from smc_mujoco.answers.answer import Answer
from smc_mujoco.answers.command import again, instead, typed
from smc_mujoco.answers.facts import Fact, NextStep, Screen
from smc_mujoco.common.aliases import AnyPath, Data, Fields
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.files import read_json, reading, sealed, unsealed, with_ending, write_json
from smc_mujoco.common.tabular import Tabular
from smc_mujoco.common.text import counted
from smc_mujoco.control import source
from smc_mujoco.control.component import Component
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import scenario_json

FAR_APART = 1.0  # a spread of J beyond which a search was stuck, as in a race
RIVALS = ("pid", "adrc")
HEADINGS = ("gain", "tuned", "searched from", "to", "")  # of a tuning's table
SAVED_FIELDS = ("before", "rule", "budget", "seed", "scales", "bounds", "searched", "versions")


@keyword_dataclass
class SearchResult:
    """What one search found. Searches share nothing: each has its own starts, noise and runs."""

    best: Evaluation  # its J is MuJoCo's, on the runs of this search
    history: tuple[Evaluation, ...]  # the accurate evaluations, in order, by the engine
    evaluations: int  # number of sets of gains that were evaluated, cheaply or accurately
    engine: (
        str  # see `evaluator`; its J may differ from MuJoCo's by what chattering makes of rounding
    )

    @property
    def chosen(self) -> Evaluation:
        """The best gains, as evaluated by the engine."""
        return min(self.history, key=lambda one: one.objective)

    def save(self, path: Path) -> Path:
        """Write a .json file that `load_search` reads back."""
        return write_json(path, vars(self))


def load_search(path: Path) -> SearchResult:
    """Read what `SearchResult.save` wrote."""
    return _search_result(read_json(path))


def _search_result(data: Data) -> SearchResult:
    history = tuple(map(_evaluation, data["history"]))
    best = _evaluation(data["best"])
    return SearchResult(**dict(data) | {"best": best, "history": history})


def _evaluation(row: Sequence[Any]) -> Evaluation:
    gains, *costs = row
    return Evaluation(tuple(gains), *costs)


@dataclasses.dataclass(frozen=True, kw_only=True, repr=False)
class Tuned(Answer):
    """A law's gains that independent searches found, and how."""

    law: Component  # with the gains of the least J
    searches: tuple[SearchResult, ...]  # in order
    # J of the law's original gains, from which no search starts, on the runs of the best search,
    # s^2
    before: float
    plant: Plant
    definition: Objective  # with its conditions and u_max
    rule: str  # the search, in words
    budget: int  # largest number of sets of gains that a search evaluates, for each gain
    seed: int  # of searches and noise
    scales: dict[str, float]  # the plant's X, F, M and T, SI units
    bounds: search_space.Box  # gain -> lowest, highest, by the rule; starts are drawn from this box
    searched: search_space.Box  # the wider bounds of the search, a decade beyond the box
    versions: dict[str, str]  # of the packages that the numbers depend on

    def __repr__(self) -> str:
        return (
            f"Tuned({self.plant.name}, {self.law}, objective={self.objective:.4g}, {self.verdict})"
        )

    @property
    def screen(self) -> Screen:
        """The answer: the gains, and how much better they are than the law's own."""
        name = self.law.name
        file = typed("--out")
        if file:
            rivals = ",".join([file, *(law for law in RIVALS if law != name)])
            command = instead("compare", {"--law": rivals}, ("--condition", "--x0"))
            step = NextStep(command, "compares it with rivals, with these gains")
        else:
            step = NextStep(
                again({"--out": f"{name}.json"}),
                "searches once more, and keeps the gains in a file",
            )
        if self.spread > FAR_APART:
            step = NextStep(again({"--budget": f"{4 * self.budget}"}), "searches longer")
        gains = ", ".join(f"{gain}={value:.4g}" for gain, value in self.gains.items())
        lower = 1.0 - self.objective / self.before if self.before > 0.0 else 0.0
        facts = [
            Fact("sentence", label="gains", text=gains),
            Fact(
                "J",
                objective=self.objective,
                lower=lower if lower > 0.0 and math.isfinite(self.before) else None,
                before=self.before if math.isfinite(self.before) else None,
            ),
            Fact(
                "searches",
                count=len(self.searches),
                above=self.spread if 0.0 < self.spread < 1.0 else None,
                times=1.0 + self.spread if self.spread >= 1.0 else None,
            ),
        ]
        for gain, end in self.at_bound.items():
            facts.append(Fact("at bound", gain=gain, end=end))
        heading = Fact("law on plant", law=name, plant=self.plant.name)
        return Screen(heading=heading, facts=facts, next=step, word="J")

    @property
    def tables(self) -> list[Tabular]:
        """One table, a line for each gain: its value, the bounds of its search, and whether it is
        at one of them.
        """
        rows = []
        for name, (low, high) in self.searched.items():
            if name in self.at_bound:
                remark = f"at its {self.at_bound[name]} bound"
            else:
                remark = ""
            rows.append((name, f"{self.gains[name]:g}", f"{low:.3g}", f"{high:.3g}", remark))
        notes = (
            str(self.definition),
            self.verdict,
            f"objective {self.objective:.4g} s², with the law's own gains {self.before:.4g} s²; "
            f"{counted(self.evaluations, 'set')} of gains, seed {self.seed}",
            *search_space.edges_in_words(self.gains, self.at_bound),
        )
        return [
            Tabular(
                headings=HEADINGS,
                rows=rows,
                title=f"{self.law.name} on {self.plant.name}",
                notes=notes,
            )
        ]

    def sourced(self) -> "Tuned":
        """Return the tuning with a law that names these searches as the source of its gains."""
        law = self.law.sourced(source.TUNED, self.search)
        return dataclasses.replace(self, law=law)

    def of_law(self, law: Component) -> "Tuned":
        """Return the tuning with another of its sets of gains as that of the law."""
        return dataclasses.replace(self, law=law)

    @property
    def search(self) -> source.GainSearch:
        """The searches: their rule, their number, their evaluations, and how far their J differ."""
        return source.GainSearch(
            rule=self.rule,
            searches=len(self.searches),
            evaluations=self.evaluations,
            spread=self.spread,
            about_defaults=bool(search_space.without_unit(self.law)),
        )

    @property
    def sets(self) -> list[Evaluation]:
        """The best set of each search, in order: run i uses set i, modulo their number."""
        return [result.best for result in self.searches]

    @property
    def best(self) -> SearchResult:
        """The search with the least J."""
        return min(self.searches, key=lambda found: found.best.objective)

    @property
    def objective(self) -> float:
        """The least J of any search, s^2."""
        return self.best.best.objective

    @property
    def gains(self) -> dict[str, float]:
        """The gains that were tuned."""
        return {name: self.law.gains[name] for name in self.bounds}

    @property
    def at_bound(self) -> dict[str, str]:
        """Gain -> "lower" or "upper", if it is within 2 % of a bound of the search."""
        limits = search_space.force_limits(
            self.law, self.law.gains, self.definition.u_max or self.scales["F"]
        )
        tight = 1.0 - search_space.ROUNDING_TOLERANCE
        full = {}
        for name, gain in self.gains.items():
            if gain >= limits.get(name, math.inf) * tight:
                full[name] = "upper"
        return search_space.at_bound(self.gains, self.searched) | full

    @property
    def evaluations(self) -> int:
        """Number of sets of gains that all searches evaluated, cheaply or accurately."""
        return sum(result.evaluations for result in self.searches)

    @property
    def spread(self) -> float:
        """By how much the largest J of a search exceeds the least one, as a share of it."""
        worst = max(result.best.objective for result in self.searches)
        return worst / self.objective - 1.0

    @property
    def verdict(self) -> str:
        """How many searches there are, and how far their J differ, in words."""
        return source.spread_in_words(len(self.searches), self.spread)

    @property
    def history(self) -> tuple[Evaluation, ...]:
        """The accurate evaluations of the first search, whose runs are the same for every law."""
        return self.searches[0].history

    @property
    def front(self) -> list[Evaluation]:
        """The Pareto front of the history in tracking and variation, by tracking, without failed
        ones.
        """
        front: list[Evaluation] = []
        for evaluation in sorted(self.history, key=lambda e: (e.tracking, e.variation)):
            if not evaluation.failed and (not front or evaluation.variation < front[-1].variation):
                front.append(evaluation)
        return front

    def record(self) -> Fields:
        """Return what `control.gain_sets` stores of it, without the history."""
        return {
            "gains": list(self.bounds),
            "sets": [evaluation.gains for evaluation in self.sets],
            "objectives": [float(f"{evaluation.objective:.6g}") for evaluation in self.sets],
            "evaluations": self.evaluations,
            "seed": self.seed,
            "rule": self.rule,
            "versions": self.versions,
        }

    def save(self, path: AnyPath) -> Path:
        """Write a .json file that `load_tuned` reads back."""
        path = with_ending(path, ".json")
        scenarios = self.definition.scenarios(self.plant, self.law, self.seed)
        scenario = scenarios[0]
        data = {name: getattr(self, name) for name in SAVED_FIELDS} | {
            "definition": self.definition.describe(),
            "at_bound": self.at_bound,
            "scenario": scenario_json.describe(scenario),
            "record": self.record(),
            "searches": list(map(vars, self.searches)),
        }
        return write_json(path, sealed(data))


def load_tuned(path: AnyPath, plant: Plant | None = None) -> Tuned:
    """Read the tuning that `Tuned.save` wrote, of this plant if it is given."""
    with reading(path, "tuning", "give a .json file that Tuned.save wrote") as file:
        data = unsealed(read_json(file))
        scenario = scenario_json.restore(data["scenario"], plant)
        fields: Fields = {name: data[name] for name in SAVED_FIELDS}
        for name in ("bounds", "searched"):
            fields[name] = {gain: tuple(ends) for gain, ends in data[name].items()}
        return Tuned(
            **fields,
            searches=tuple(map(_search_result, data["searches"])),
            law=scenario.law,
            plant=scenario.plant,
            definition=restored_objective(data["definition"]),
        )
