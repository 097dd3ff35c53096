"""The worst that an adversary finds for a law within a class of uncertainty, beside the median of
random members.

Sliding mode promises that the error stays small whatever a disturbance does within its bound. A
median over random seeds does not test this. The user gives the class. The search has no parameters,
so that no law gets a milder adversary than another. `uncertainty` describes the class, and
`worst_case_search` the search. The worst run that is found is a lower bound of the worst case.
"""

import dataclasses
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from smc_mujoco.analysis.engine import Device
from smc_mujoco.analysis.engine.scored_runs import ScoredRuns, worth_compiling
from smc_mujoco.answers.answer import Answer
from smc_mujoco.answers.command import again, instead, typed
from smc_mujoco.answers.facts import Fact, Lead, NextStep, Screen
from smc_mujoco.common.aliases import Numbers, ProgressTo
from smc_mujoco.common.cache import cached
from smc_mujoco.common.constraints import Progress, Seed, Whole, constrained
from smc_mujoco.common.data import attributes
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.files import read_json, write_json
from smc_mujoco.common.progress import bar
from smc_mujoco.common.tabular import Cell, Tables, Tabular
from smc_mujoco.control.source import in_words
from smc_mujoco.draw.colouring import law_colour
from smc_mujoco.draw.wording import law_name, plant_name
from smc_mujoco.metrics.catalogue import CATALOGUE, metric_of
from smc_mujoco.metrics.conventions import Metric
from smc_mujoco.robustness.uncertainty import (
    Members,
    Uncertainty,
    default_class,
    dry_frictions,
    outside,
    words_of,
)
from smc_mujoco.robustness.worst_case_search import WorstCaseSearch
from smc_mujoco.simulation import run_key, scenario_json
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import warn_of_broken

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METRIC = "rms_error"
# s, default of attacked runs: the error counts from a quarter of it on, when laws have settled
DURATION = 8.0
DEFAULT_STEPS = (
    1_250_000  # physics steps of a search by default, for a plant of one channel: 4 s of a core
)
MIN_RUNS, MAX_RUNS = 24, 1024  # of the default budget
MAX_BUDGET = 1_000_000
PANELS = "error", "d", "u", "phase"  # of a figure
HEADINGS = "law", "worst found", "median", "place by median", "found by"
FIRST_MEMBERS = 2  # the worst random members, from which the search begins


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class WorstCase(Tables):
    """The worst run of a scenario that was found within a class.

    Attributes:
      value: the metric of the worst run; inf if it failed.
      median: the metric's median over as many random members as the search had runs.
      unit: of both.
      scenario: the worst run, an ordinary scenario that gives this value to the last bit. Its
        `disturbance` has the force that was found.
      found_by: the strategy that made the member, or the one of which it is a variation.
      tried: number of runs, half of them of random members.
      nominal: the scenario that was given.
      within: the class.
      metric: its name.
      outside: why the theorem of the law does not cover the class; "" if nothing is known against
        it.
      seed: of the search.
      checked: how far the fast engine's scores are from MuJoCo's.
      sets: number of sets of the machine's parameters that the adversary chose from.
      constants: name -> number: what is constant in the worst run, and may differ in the class,
        such as "mass".
    """

    value: float
    median: float
    unit: str
    scenario: Scenario
    found_by: str
    tried: int
    nominal: Scenario
    within: Uncertainty
    metric: str
    outside: str
    seed: int
    checked: str = ""
    sets: int = 1
    constants: Numbers = dataclasses.field(default_factory=dict)

    def __repr__(self) -> str:
        return f"WorstCase({self})"

    def __str__(self) -> str:
        s = self.nominal
        label = CATALOGUE[self.metric].label
        result = f"{label} {self.words}"
        having = [words_of(self.constants, s.plant)]
        if self.within.disturbance:
            having.append("the force that was found")
        if having := ", ".join(filter(None, having)):
            result += f" with {having}"
        drawn = f"median of random members {self.with_unit(self.median)}"
        words = "; ".join(
            filter(None, (result, drawn, f"searched: {self.class_words}", self.checked))
        )
        return f"{s.law.name} on {s.plant.name}: {words}"

    @property
    def heading(self) -> str:
        """The plant and the class. A picture crops it where it is too long."""
        return f"Worst found: {plant_name(self.nominal.plant)}, {self.class_words}"

    @property
    def class_words(self) -> str:
        """The class in words."""
        if self.sets > 1:
            sets = [f"any of {self.sets} parameter sets"]
        else:
            sets = []
        return ", ".join([*sets, self.within.words(self.nominal.plant)])

    def shown(self, value: float) -> str:
        """Return a value of the metric as text: "fails" or "not arrived" where there is none."""
        return CATALOGUE[self.metric].text(value)

    def with_unit(self, value: float) -> str:
        """Return a value of the metric with its unit, such as "0.98 m"."""
        return f"{self.shown(value)} {self.unit * (value < math.inf)}".strip()

    @property
    def words(self) -> str:
        """The worst value with its unit."""
        return self.with_unit(self.value)

    def about(self) -> dict[str, Any]:
        """Return it as JSON data, with the scenario as in a trace's file."""
        names = "value", "median", "unit", "found_by", "tried", "metric", "outside", "seed", "sets"
        return attributes(self, (*names, "checked", "constants")) | {
            "within": dataclasses.asdict(self.within),
            "scenario": scenario_json.describe(self.scenario),
        }

    @property
    def tables(self) -> list[Tabular]:
        """That of `WorstCases`, with one line."""
        return WorstCases([self]).tables

    def figure(self, path: str | os.PathLike | None = None, **options: Any) -> "Figure":
        """Draw the worst run beside the scenario as it was given; arguments as in `smc.figure`."""
        return WorstCases([self]).figure(path, **options)

    plot = figure


class WorstCases(Answer, list[WorstCase]):
    """Worst cases of several laws on one plant within one class, the best law first."""

    def __init__(self, cases: Iterable[WorstCase]):
        super().__init__(sorted(cases, key=lambda case: (case.value, case.median)))

    @property
    def screen(self) -> Screen:
        """The answer: the worst run of each law, and by how much the first leads."""
        first = self[0]
        label = CATALOGUE[first.metric].label
        rows = []
        for case in self:
            rows.append((case.nominal.law.name, case.shown(case.value), case.shown(case.median)))
        facts: list[Fact | Lead] = []
        if len(self) > 1 and math.isfinite(first.value) and self[1].value > first.value:
            share = 1.0 - first.value / self[1].value
            names = first.nominal.law.name, self[1].nominal.law.name
            metric = f"worst {label}"
            facts.append(Lead(law=names[0], rival=names[1], metric=metric, low=share, high=share))
        headings = "", f"worst found ({first.unit})", f"median ({first.unit})"
        for case in self:
            facts.append(Fact("sentence", label=case.nominal.law.name, text=case.outside))
        step = NextStep(again({"--figure": "worst"}), "draws the worst runs")
        if typed("--figure"):
            command = instead("margins", {}, ("--law", "--gains", "--condition"))
            step = NextStep(command, "finds how much of each alone is tolerated")
        return Screen(
            heading=Fact(
                "attacked",
                plant=first.nominal.plant.name,
                metric=label,
                runs=first.tried,
                bounds=first.class_words,
            ),
            tables=[Tabular(headings=headings, rows=rows)],
            notes=[Fact("may be worse")],
            facts=facts,
            next=step,
            word="worst",
        )

    @property
    def title(self) -> str:
        """Plant, metric, number of runs and class."""
        return self._title(self[0].nominal.plant.name)

    def _title(self, plant: str) -> str:
        first = self[0]
        metric = CATALOGUE[first.metric].label
        if first.unit:
            metric += f" in {first.unit}"
        within = f"worst of {first.tried} runs, bounds: {first.class_words}"
        return f"{plant}: {metric}, {within}"

    @property
    def tables(self) -> list[Tabular]:
        """One table: the worst run of each law, the median of random members, and the place by
        median.
        """
        by_median = sorted(self, key=lambda case: case.median)
        rows = []
        for case in self:
            law = case.nominal.law
            name = Cell(law.name, colour=law_colour(law.name), label=law_name(law))
            place = str(by_median.index(case) + 1)
            rows.append(
                [name, case.shown(case.value), case.shown(case.median), place, case.found_by]
            )
        label = self._title(plant_name(self[0].nominal.plant))
        about = {"title": self.title, "label": label, "notes": self.notes}
        return [Tabular(headings=HEADINGS, rows=rows, **about)]

    @property
    def notes(self) -> list[str]:
        """The meaning of the numbers, and laws whose theorem does not cover the class."""
        notes = [
            "The median is that of random members of the class. The true worst case may be worse."
        ]
        for case in self:
            for words in filter(None, (case.outside, case.checked)):
                notes.append(f"{case.nominal.law.name}: {words}")
        gains = in_words({case.nominal.law.name: [case.nominal.law.source] for case in self})
        count = f"{sum(case.tried for case in self)} runs"
        notes.append(", ".join(filter(None, (count, gains))))
        return notes

    def figure(self, path: str | os.PathLike | None = None, **options: Any) -> "Figure":
        """Draw the worst runs of all laws, or of one law beside the given run; arguments as in
        `smc.figure`.
        """
        from smc_mujoco.draw.figure import figure

        first = self[0]
        metric = CATALOGUE[first.metric].label
        runs = {}
        for case in self:
            runs[f"{law_name(case.nominal.law)}: {metric} {case.words}"] = case.scenario
        if len(self) == 1:
            worst = f"worst found, {metric} {first.words}"
            runs = {"as given": first.nominal, worst: first.scenario}
        options = {"title": first.heading, "panels": PANELS} | options
        return figure(run([*runs.values()]), path, [*runs], **options)


@constrained
def worst_case(
    scenario: Scenario | Sequence[Scenario],
    metric: str = METRIC,
    within: Uncertainty | None = None,
    budget: Annotated[int, Whole(low=1, high=MAX_BUDGET)] | None = None,
    seed: Seed = 0,
    threads: int | None = None,
    progress: Progress = False,
    device: Device = "cpu",
) -> WorstCase:
    """Search for the worst run of a scenario within a class of uncertainty, and return it.

        scenario = smc.Scenario(plant="duffing", law="pid", duration=1.0)
        print(smc.worst_case(scenario, within=smc.Uncertainty(disturbance=0.5), budget=8))

    Where there are very many runs the fast engine makes most of them. The worst run that is
    returned, and its value, are MuJoCo's.

    Args:
      scenario: plant, law and conditions. The class adds to its disturbances, noise, delay and
        parameters. Or several, such as a rig's parameter sets: the first is the nominal one, and
        the adversary chooses.
      metric: name of any metric; more is worse. In metrics of u a run that has not arrived is the
        worst. "peak" is the largest |x| of the whole run, also at its start. Default: the rms
        error from a quarter of the run on.
      within: the class, such as smc.Uncertainty(disturbance=2.0, mass=(0.7, 1.3)). Default: what
        the plant declares as `uncertain`, such as an arm's payload, or else disturbances up to a
        sixth of the force of the weakest drive; and friction within 50 %.
      budget: number of runs of the search; random members get as many. A larger budget continues
        the same search. Default: as many as take about 10 s of one core together, by the number of
        physics steps.
      seed: of the random members and of the search.
      threads, progress: as in `run`. The result does not depend on threads.
      device: of the fast engine, "cpu", or "cuda" for any number of runs. On "cuda" MuJoCo Warp
        runs the random members of your own machine, if there are many.

    Returns:
      A `WorstCase`: `value` is the metric of the worst run, `median` that of random members of the
      class. `smc.run(found.scenario)` makes the worst run again, `found.figure(path)` draws it.

    Raises:
      ScenarioError: a class that the plant cannot have, an unknown metric, or one that the plant
        does not have.
    """
    scenarios = _listed(scenario)
    scenario = scenarios[0]
    within = _checked_class(scenario, within)
    entry = metric_of(scenario, metric)
    if budget is None:
        budget = default_budget(scenario, within)
    members = Members(scenarios, within)
    work = 2 * budget * scenario.work
    formulas = {metric: entry.formula, "rms_error": CATALOGUE["rms_error"].formula}
    fast = ScoredRuns(formulas, device, threads, worth_compiling(work), by_group=True, worlds=True)
    words = f"worst case of {scenario.law.name} on {scenario.plant.name}"
    with bar(words, work, shown=progress) as drawn:
        drawing = WorstCaseSearch(members, entry, budget, fast, drawn.advance)
        search = WorstCaseSearch(members, entry, budget, fast, drawn.advance)
        _attack(drawing, search, seed)
    return _worst_of(scenarios, entry, members, drawing, search, seed, fast.checked())


def _attack(drawing: WorstCaseSearch, search: WorstCaseSearch, seed: int) -> None:
    """Draw random members, then search from the worst of the first of them."""
    drawing.draw(np.random.default_rng([seed, 0]))
    early = sorted(drawing.tried[:MIN_RUNS], key=lambda tried: tried.key, reverse=True)
    search.search(np.random.default_rng([seed, 1]), early[:FIRST_MEMBERS])
    drawing.confirm()
    search.confirm()


def _worst_of(
    scenarios: Sequence[Scenario],
    entry: Metric,
    members: Members,
    drawing: WorstCaseSearch,
    search: WorstCaseSearch,
    seed: int,
    checked: str,
) -> WorstCase:
    """Return the worst run of a search and of the random members beside it."""
    scenario = scenarios[0]
    if broken := drawing.broken or search.broken:
        warn_of_broken({scenario.law.name: broken})
    by_mujoco = []
    for attempt in (*search.tried, *drawing.tried):
        if attempt.by_mujoco:
            by_mujoco.append(attempt)
    worst = max(by_mujoco, key=lambda tried: tried.key)
    constants = {}
    for constant, share in zip(members.constants, worst.member.shares.tolist(), strict=True):
        if constant.name != "set":  # the worst run's scenario is of it
            constants[constant.name] = constant.value(share)
    drawn = [tried.key[0] for tried in drawing.tried]
    return WorstCase(
        value=float(worst.key[0]),
        median=float(np.median(drawn)),
        unit=entry.unit_for(scenario.plant.units[0], scenario.efforts[0]),
        scenario=members.scenario_of(worst.member),
        found_by=worst.member.kind,
        tried=drawing.runs + search.runs,
        nominal=scenario,
        within=members.within,
        metric=entry.name,
        outside=outside(scenario, members.within),
        seed=seed,
        checked=checked,
        sets=len(scenarios),
        constants=constants,
    )


def _checked_class(scenario: Scenario, within: object) -> Uncertainty:
    """Return the class, by default `default_class`. Raise ScenarioError for one that no adversary
    can search.
    """
    if within is None:
        return default_class(scenario)
    if not isinstance(within, Uncertainty):
        raise ScenarioError(
            f"within is {shown(within)}: give a class, such as smc.Uncertainty(disturbance=2.0)"
        )
    if within.period != (1.0, 1.0):
        raise ScenarioError(
            "the adversary's forces have a value a sample, so period cannot differ: leave it out "
            "of within"
        )
    return within


def cached_worst_case(
    path: Path,
    scenario: Scenario,
    within: Uncertainty | None,
    budget: int | None,
    threads: int | None = None,
    progress: ProgressTo = False,
    device: str = "cpu",
) -> WorstCase:
    """Return the `worst_case` of a scenario, from the file of an earlier call if there is one."""
    if within is None:
        within = default_class(scenario)

    def load(file: Path) -> WorstCase:
        data = read_json(file)
        restored = scenario_json.restore(data.pop("scenario"))
        worst = dataclasses.replace(restored, law=scenario.law)
        return WorstCase(**data, scenario=worst, nominal=scenario, within=within)

    def save(worst: WorstCase, file: Path) -> None:
        about = worst.about()
        del about["within"]
        write_json(file, about)

    return cached(
        path,
        [run_key.run_key(scenario), dataclasses.asdict(within), budget],
        lambda: worst_case(
            scenario, METRIC, within, budget, threads=threads, progress=progress, device=device
        ),
        save,
        load,
    )


def _listed(given: object) -> list[Scenario]:
    """Return the scenario, or the scenarios, to attack."""
    scenarios: Any
    if isinstance(given, list | tuple):
        scenarios = list(given)
    else:
        scenarios = [given]
    for attacked in scenarios or [given]:
        if not isinstance(attacked, Scenario):
            raise ScenarioError(
                f"worst_case attacks a Scenario, not {shown(given)}: give smc.Scenario(...)"
            )
    if len({(s.samples, s.control_period, s.plant.n) for s in scenarios}) > 1:
        raise ScenarioError(
            "worst_case attacks one run on several parameter sets: give all the same duration"
        )
    return scenarios


def default_budget(scenario: Scenario, within: Uncertainty) -> int:
    """Return the number of runs of a search without a given budget.

    With n channels a physics step takes (1 + n) / 2 times as long as with one; MuJoCo's dry
    friction doubles that.
    """
    plant = scenario.plant
    dry = bool(scenario.friction or within.friction[1] or dry_frictions(plant))
    steps = scenario.samples * scenario.steps * (1 + plant.n)  # of all channels in a run
    runs = 2 * DEFAULT_STEPS // (steps * (1 + dry))
    return min(max(MIN_RUNS, runs), MAX_RUNS)
