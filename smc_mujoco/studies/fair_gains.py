"""Trials of laws on plants: their gains, all by one rule, their runs and their worst cases.

A law has the gains that the user gave it, else those that come with the package for the plant, else
those that a search by the same rule finds: with the same bound on u, the same starts, as many
searches and as many evaluations. A law that cannot be tuned keeps its defaults, and its remark says
why. Each search ends with its own gains. The run of seed s has those of search s modulo their
number, so that a comparison holds over the gains with which a tuning may end.
"""

import contextlib
import dataclasses
import math
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.analysis.ranking import needed_to_win
from smc_mujoco.analysis.step_halving import doubled
from smc_mujoco.analysis.tuning import quick_search, result, search, search_space
from smc_mujoco.analysis.tuning.effort import Search
from smc_mujoco.analysis.tuning.objective import BUDGET, Objective, objectives
from smc_mujoco.analysis.tuning.run_limits import RunLimit, shows_limits
from smc_mujoco.common import fingerprint
from smc_mujoco.common.aliases import AnyPath, ProgressTo
from smc_mujoco.common.cache import cached
from smc_mujoco.common.errors import (
    MAX_ITEMS,
    BrokenLawError,
    ScenarioError,
    ScenarioWarning,
)
from smc_mujoco.common.progress import bar
from smc_mujoco.common.text import counted, joined
from smc_mujoco.control import gain_sets, source
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.law import all_laws, checked_name, law_catalogue
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import plant_catalogue as plants_known
from smc_mujoco.robustness.uncertainty import Uncertainty
from smc_mujoco.robustness.worst_case import WorstCase, cached_worst_case
from smc_mujoco.simulation import coerce, run_key
from smc_mujoco.simulation.conditions import NAMED, Condition, applicable
from smc_mujoco.simulation.grid import (
    Draws,
    Starts,
    all_combinations,
    check_moving,
    check_names,
    listed_conditions,
)
from smc_mujoco.simulation.grid import case as run_of_grid
from smc_mujoco.simulation.law_checks import blind
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.scenario_checks import event_times
from smc_mujoco.studies.leaderboard import Holdout
from smc_mujoco.studies.study import REPEATED_SEEDS, study
from smc_mujoco.studies.table import Table

NOISE = "noise"  # a quick search adds it where no condition that was asked for has any
SEARCHED = 2 / 3  # of the duration of a run: that of the runs of a quick search; chosen
NOT_TUNED = "not tuned: "  # at the start of a remark
Laws = Sequence[Component | Template]  # those without given gains are templates


class Candidate(NamedTuple):
    """A law with its gains for a plant."""

    law: Component  # with the best gains
    sets: tuple[Component, ...]  # the law with the gains of each search; the runs take them in turn
    remark: str = ""  # on the gains, besides their source

    def __call__(self, seed: int) -> Component:
        """Return the law with the gains of the run with this seed."""
        return self.sets[seed % MAX_ITEMS % len(self.sets)]

    def holdout(
        self, plant: Plant, goal: Objective, instances: Sequence[int], threads: int | None
    ) -> tuple[np.ndarray, ...]:
        """Return J on instances, whether their runs have arrived, J of one in four at half the
        physics step, and the sets' numbers.
        """
        laws = list(map(self, instances))
        values, arrived = objectives(plant, laws, goal, instances, threads)
        repeated = slice(None, None, REPEATED_SEEDS)
        halves = np.full(len(laws), math.nan)
        halves[repeated], _ = objectives(
            plant, laws[repeated], goal, instances[repeated], threads, halved=True
        )
        return values, arrived, halves, np.arange(len(laws)) % len(self.sets)


def law_or_template(law: Component | Template | str) -> Component | Template:
    """Return the law if the user gave its gains, else its template."""
    if isinstance(law, str):
        return all_laws()[law]
    if isinstance(law, Template):
        return law
    bound = coerce.coerced_law(law)
    if bound.template and bound.source.kind == source.DEFAULT:
        return bound.template
    return bound


def _without_search(
    plant: Plant, law: Component | Template, gains: str, asked: int | None
) -> Candidate | None:
    """Return a law whose gains need no search; None for one that must be tuned, which is also one
    with fewer shipped sets of gains than are `asked` for. Of more sets the first are used.
    """
    if isinstance(law, Component):
        return Candidate(law, (law,))
    if not law.gains or gains == "default":
        return default_of(law)
    library = plants_known().get(plant.name)
    of_library = library is not None and library.parameters == plant.parameters
    ours = of_library and law_catalogue().get(law.name) is law
    if ours and gain_sets.in_set(plant, law.name, gains):
        count = 1
        if gains != "study":
            count = len(gain_sets.tuned(plant, law.name, gains).sets)
            if asked and gains == "tuned":
                if count < asked:
                    return None
                count = asked
        sets = []
        for seed in range(count):
            sets.append(gain_sets.law_with_gains(plant, law.name, gains, seed))
        return Candidate(gain_sets.law_with_gains(plant, law.name, gains), tuple(sets))
    return None


def default_of(law: Component | Template, remark: str = "") -> Candidate:
    """Return a law with its default gains."""
    bound = coerce.coerced_law(law)
    return Candidate(bound, (bound,), remark)


class GainRule(NamedTuple):
    """How gains are searched on a plant."""

    goal: Objective
    budget: int  # sets of gains that a search tries at most, for each gain
    quick: bool  # whether by `quick_search`


class GainChoice(NamedTuple):
    """Which gains the laws of a comparison have that were given without."""

    of_package: str = "tuned"  # the set of the package's gains
    tune: bool = True  # whether laws without gains are tuned
    defaults: bool = False  # whether a law may win over rivals that have their defaults
    # whether laws with fewer shipped sets than searches are tuned, too, as their number was asked
    # for
    as_many: bool = False


class Trial(NamedTuple):
    """A comparison: its plants and conditions, random numbers, gains and folder; `threads` and
    `progress` are as in `run`.
    """

    plants: Sequence[Plant]
    conditions: Sequence[Condition]
    duration: float  # of a run, s
    folder: Path
    draws: Draws
    search: Search = Search()
    gains: GainChoice = GainChoice()
    threads: int | None = None
    progress: ProgressTo = False

    @classmethod
    def of(
        cls,
        plants: Sequence[Plant],
        conditions: object,
        known: Sequence[str],
        duration: float,
        out: AnyPath,
        **fields: Any,
    ) -> "Trial":
        """Return a trial in conditions, or where these are None in those of the `known` ones that
        suit the plants, with other fields as given.
        """
        texts = conditions
        if texts is None:
            texts = applicable(known, plants, duration)
        parsed = listed_conditions(texts)
        return cls(plants=plants, conditions=parsed, duration=duration, folder=Path(out), **fields)

    def case(
        self, plant: Plant, law: Component | Template | str, condition: Condition | str
    ) -> Scenario:
        """Return a run of a law, from the start of the first seed."""
        return next(self.cases(plant, law, condition))

    def cases(
        self, plant: Plant, law: Component | Template | str, condition: Condition | str
    ) -> Iterator[Scenario]:
        """Yield the runs of a law, from the start of each seed."""
        starts = self.draws.starts
        for seed in self.draws.numbers():
            yield run_of_grid(plant, law, condition, self.duration, seed=seed, starts=starts)

    def check(self, laws: Mapping[str, Laws]) -> None:
        """Refuse, before gains are searched, two things of one name, your law with the name of a
        law of the library, conditions in which nothing moves, and starts out of range.
        """
        for of_plant in laws.values():
            components = [checked_name(coerce.coerced_law(law)) for law in of_plant]
            check_names(self.plants, components, self.conditions)
            for named in (self.plants, components, self.conditions):
                names = set()
                for item in named:
                    if item.name in names:
                        raise ScenarioError(f"{item.name!r} is there twice: give it once")
                    names.add(item.name)
        for plant in self.plants:
            for condition in self.conditions:
                check_moving(list(self.cases(plant, "none", condition)))
            if self.progress and (sentence := blind(plant, laws[plant.name])):
                print(sentence, file=sys.stderr)

    def candidates(self, laws: Mapping[str, Laws], seeds: int) -> dict[str, list[Candidate]]:
        """Return plant -> its laws with gains for that many runs in each condition: given, shipped,
        tuned or default ones, in this order of preference.

        If some laws have shipped gains, the others are tuned from the starts of those. The folder
        keeps each search.

        Raises:
          ScenarioError: none of several laws can be tuned on a plant, so that there could be no
            winner, unless `defaults`. It is raised before the first search.
        """
        without_search = {}
        for plant in self.plants:
            without_search[plant.name] = self.known(plant, laws[plant.name])
        if self.progress:
            few = dict.fromkeys(
                self._if_few(of_plant, seeds) for of_plant in without_search.values()
            )
            for sentence in filter(None, few):
                print(sentence, file=sys.stderr)
            for name, of_plant in without_search.items():
                to_search = [
                    law.name for law, ready in zip(laws[name], of_plant, strict=True) if not ready
                ]
                if to_search and self.gains.tune:
                    repeated = f"searches of these laws as they are now, which {self.folder} keeps"
                    sentence = f"gains to search on {name}: {joined(to_search)}; {repeated}"
                    print(f"{sentence}, are not repeated", file=sys.stderr)
        by_plant: dict[str, list[Candidate]] = {}
        for plant in self.plants:
            by_plant[plant.name] = []
            rule = self.rule(plant, without_search[plant.name])
            for law, known_candidate in zip(
                laws[plant.name], without_search[plant.name], strict=True
            ):
                candidate = known_candidate or default_of(law)
                if known_candidate is None and self.gains.tune:
                    candidate = self.search_gains(plant, law, rule)
                by_plant[plant.name].append(candidate)
        return by_plant

    def known(self, plant: Plant, laws: Laws) -> list[Candidate | None]:
        """Return the laws whose gains on a plant are known, None for each of the others.

        Raises:
          ScenarioError: see `candidates`.
        """
        count = self.search.searches if self.gains.tune and self.gains.as_many else None
        candidates = []
        for law in laws:
            candidates.append(_without_search(plant, law, self.gains.of_package, count))
        if self.gains.tune and not self.gains.defaults:
            self._check_tunable(plant, laws, candidates, self.rule(plant, candidates).goal)
        return candidates

    def rule(self, plant: Plant, known: Sequence[Candidate | None]) -> GainRule:
        """Return how the gains of the other laws are searched: as those of the package, from the
        same starts, if some laws have these.
        """
        kinds = [candidate.law.source.kind for candidate in known if candidate]
        shipped = source.SHIPPED in kinds
        if self.search.quick and not shipped:
            return GainRule(self.asked_goal(plant), quick_search.BUDGET, True)
        starts = None if shipped else self.draws.starts
        return GainRule(self._goal(plant, starts), self.search.budget, False)

    def _if_few(self, known: Sequence[Candidate | None], seeds: int) -> str:
        """Return a sentence, to be said before minutes of tuning, if so few sets of gains or runs
        can name no winner; else "".
        """
        samples = []
        for candidate in known:
            sets = self.search.searches if self.gains.tune else 1
            if candidate:
                sets = len(candidate.sets)
            samples.append(min(sets, seeds) if sets > 1 else seeds)
        least = needed_to_win(len(self.plants) * len(self.conditions))
        if len(samples) < 2 or (most := sorted(samples)[-2]) >= least:
            return ""
        where = counted(len(self.conditions), "condition")
        if len(self.plants) > 1:
            where += f" on each of {len(self.plants)} plants"
        few = f"{most} sets of gains or runs"
        return f"{few} cannot rank {len(samples)} laws in {where}; {least} can"

    def _check_tunable(
        self,
        plant: Plant,
        laws: Laws,
        known: Sequence[Candidate | None],
        goal: Objective,
    ) -> None:
        """Raise ScenarioError, with the first reason, if none of several laws can be tuned on a
        plant.
        """
        reasons = []
        for law, candidate in zip(laws, known, strict=True):
            if candidate:
                reason = candidate.remark
            else:
                reason = search.why_not_tuned(plant, law, goal)
            if not reason:
                return
            reasons.append(reason)
        if len(laws) > 1:
            raise ScenarioError(
                f"{reasons[0]}; or give laws with gains, "
                "or defaults=True (--allow-defaults) for default gains"
            )

    def asked_goal(self, plant: Plant, limits: tuple[RunLimit, ...] = ()) -> Objective:
        """Return the objective under the trial's conditions, and noise where none of them has any,
        in shorter runs, with limits; and without a condition where none of these shows a limit.
        Events are at half of these runs, too.
        """
        conditions = list(self.conditions)
        noisy = any("noise" in condition.on(plant, self.duration) for condition in conditions)
        if not noisy and applicable([NOISE], [plant], self.duration):
            conditions.append(NAMED[NOISE])
        usual = Objective()
        duration = SEARCHED * self.duration
        for condition in conditions:
            _check_events(condition.name, condition.on(plant, duration), duration)
        goal = dataclasses.replace(
            usual,
            conditions=tuple(conditions),
            starts=self.draws.starts or usual.starts,
            duration=duration,
            limits=limits,
        )
        if limits and not shows_limits(goal.scenarios(plant, coerce.coerced_law("none"))):
            goal = dataclasses.replace(goal, conditions=(NAMED["nominal"], *goal.conditions))
        return goal

    def _goal(self, plant: Plant, starts: Starts | None) -> Objective:
        """Return the objective of whole searches on a plant."""
        usual = Objective()
        fit = applicable([c.name for c in usual.conditions], [plant], usual.duration)
        suited = tuple(c for c in usual.conditions if c.name in fit)
        return dataclasses.replace(usual, conditions=suited, starts=starts or usual.starts)

    def search_gains(self, plant: Plant, law: Component | Template, rule: GainRule) -> Candidate:
        """Return a law with gains that searches find, or found in an earlier call, or with its
        defaults if it cannot be tuned.
        """
        goal = rule.goal
        default = coerce.coerced_law(law)
        if isinstance(law, Template):
            template = law
        else:
            template = default.template
        ranges = template and (dict(template.gains), dict(template.conditions))
        folder = self.folder / "gains"
        cached_gains = [f"gains of {default.name} for {plant.name} are kept in {folder}"]

        def searched() -> result.Tuned:
            cached_gains.clear()
            with warnings.catch_warnings():  # the remark says so
                warnings.filterwarnings("ignore", "no set of gains tried", ScenarioWarning)
                return search.tune(
                    plant,
                    law,
                    rule.budget,
                    0,
                    goal,
                    self.threads,
                    self.progress,
                    searches=self.search.searches,
                    out=folder / "searches",
                    device=self.search.device,
                    executor=self.search.executor,
                    quick=rule.quick,
                )

        try:
            (first,) = goal.scenarios(plant, default, count=1)
            code = fingerprint.of((default.function, ranges))
            tuned = cached(
                folder / f"{plant.name}-{law.name}-{self.search.searches}-{rule.budget}.json",
                [run_key.run_key(first), goal.describe(), code, rule.quick],
                searched,
                lambda made, path: made.save(path),
                lambda path: result.load_tuned(path, plant),
            )
        except BrokenLawError:
            raise
        except ScenarioError as error:
            return default_of(law, f"{NOT_TUNED}{error}")
        if self.progress:
            for words in cached_gains:
                print(words, file=sys.stderr)
        candidate = candidate_of(default, tuned)
        if rule.quick or rule.budget == BUDGET:
            return candidate
        tried = f"at most {rule.budget} sets were tried for each gain, where {BUDGET} are usual"
        where = "trails" if rule.budget < BUDGET else "leads"
        remarks = candidate.remark, f"{tried}: where it {where}, its search may be why"
        return candidate._replace(remark="; ".join(filter(None, remarks)))

    def run(
        self,
        candidates: Mapping[str, Sequence[Candidate]],
        seeds: int,
        coarse: bool = False,
    ) -> Table:
        """Run the laws of each plant in each condition from that many seeds; `coarse` runs have
        twice the usual step under RK4, where that fits, and are not repeated at half of theirs.
        """
        runs = all_combinations(
            self.plants,
            lambda plant: candidates[plant.name],
            self.conditions,
            self.draws.numbers(seeds),
            self.duration,
            self.draws.starts,
        )
        if coarse:
            runs = list(map(doubled, runs))
        return study(
            runs,
            self.folder,
            threads=self.threads,
            progress=self.progress,
            half_steps=not coarse,
            executor=self.search.executor,
        )

    def holdout(
        self, candidates: Mapping[str, Sequence[Candidate]], count: int
    ) -> dict[str, Holdout]:
        """Return plant -> J of its laws on `count` instances; a plant on which J is not defined is
        left out.
        """
        by_plant = {}
        words = "J on unseen runs"
        laws = sum(map(len, candidates.values()))
        with bar(words, laws, self.progress, counted=True) as progress_bar:
            for plant in self.plants:
                goal = self._goal(plant, self.draws.starts)
                if self.rule(plant, candidates[plant.name]).quick:
                    goal = self.asked_goal(plant)
                least = len(goal.conditions) * goal.duration**2 / 2.0
                names = tuple(condition.name for condition in goal.conditions)
                runs = Holdout({}, {}, {}, {}, least, names)
                with contextlib.suppress(ScenarioError):
                    for candidate in candidates[plant.name]:
                        parts = self._holdout(plant, candidate, goal, self.draws.numbers(count))
                        for of_law, values in zip(runs[:4], parts, strict=True):
                            of_law[candidate.law.name] = values  # pyright: ignore[reportIndexIssue] made as dicts
                        progress_bar.advance(1.0)
                    by_plant[plant.name] = runs
        return by_plant

    def _holdout(
        self, plant: Plant, candidate: Candidate, goal: Objective, instances: range
    ) -> tuple[np.ndarray, ...]:
        """Return what `Candidate.holdout` does, which the folder keeps."""
        keys = []
        for law in candidate.sets:
            keys.append(run_key.run_key(goal.scenarios(plant, law, count=1)[0]))

        def load(path: Path) -> tuple[np.ndarray, ...]:
            with np.load(path) as parts:
                return tuple(parts.values())

        return cached(
            self.folder / "unseen" / f"{plant.name}-{candidate.law.name}.npz",
            [keys, goal.describe(), str(instances)],
            lambda: candidate.holdout(plant, goal, instances, self.threads),
            lambda parts, path: np.savez(path, *parts),
            load,
        )

    def attack(
        self, name: str, scenario: Scenario, within: Uncertainty | None, budget: int | None = None
    ) -> WorstCase:
        """Return the worst case of a scenario, which the folder keeps under a name."""
        file = self.folder / "worst" / f"{name}.json"
        return cached_worst_case(
            file, scenario, within, budget, self.threads, self.progress, self.search.device
        )


def candidate_of(default: Component, tuned: result.Tuned) -> Candidate:
    """Return a law with the gains of each search, or with those that it had if no search found
    better ones.
    """
    tuned_source = tuned.law.source
    if tuned.before < tuned.objective:
        if default.source.kind == source.DEFAULT:
            own = "defaults"
        else:
            own = "own gains"
        unchanged = default.sourced(tuned_source.kind, tuned_source.search)
        return Candidate(unchanged, (unchanged,), f"its {own}, better than those tried")
    sets = []
    for tried in tuned.sets:
        gains = dict(default.gains) | dict(zip(tuned.bounds, tried.gains, strict=True))
        with_gains = dataclasses.replace(default, gains=gains)
        sets.append(with_gains.sourced(tuned_source.kind, tuned_source.search))
    best = dataclasses.replace(default, gains=tuned.law.gains).sourced(
        tuned_source.kind, tuned_source.search
    )
    remarks = search_space.edges_in_words(tuned.gains, tuned.at_bound)
    if names := list(search_space.without_unit(default)):
        unitless = f"no unit is given for {joined(names)}"
        remarks.append(f"{unitless}, so the search is centred on their defaults")
    return Candidate(best, tuple(sets), "; ".join(remarks))


def _check_events(name: str, fields: Mapping[str, Any], duration: float) -> None:
    """Raise ScenarioError if a condition's jump or fault comes after the end of a search's runs."""
    for field, time in event_times(fields.get("jump"), fields.get("fault")).items():
        if time >= duration:
            raise ScenarioError(
                f"condition {name!r} has its {field} at {time:g} s, and runs that judge gains end "
                f"at {duration:.3g} s, two thirds of the duration: give an earlier time, or a "
                f"duration above {time / SEARCHED:.3g} s"
            )
