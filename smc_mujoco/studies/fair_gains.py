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
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from smc_mujoco.analysis.tuning.objective import BUDGET, SEARCHES, Objective
from smc_mujoco.common import fingerprint
from smc_mujoco.common.cache import cached
from smc_mujoco.common.errors import BrokenLawError, ScenarioError, ScenarioWarning
from smc_mujoco.common.progress import about, bar, note
from smc_mujoco.common.text import joined
from smc_mujoco.control import gain_sets, source
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.law import catalogue, known_laws
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import catalogue as plants_known
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.conditions import Condition, applicable
from smc_mujoco.simulation.grid import Starts, all_combinations
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.studies import run_key
from smc_mujoco.studies.board import first_of
from smc_mujoco.studies.leaderboard import Unseen
from smc_mujoco.studies.study import REPEATED_SEEDS, study
from smc_mujoco.studies.table import Table

if TYPE_CHECKING:
    from smc_mujoco.analysis.tuning.result import Tuned
    from smc_mujoco.analysis.worst_case.uncertainty import Uncertainty
    from smc_mujoco.studies.worst_case import WorstCase

LONG = 120.0  # s of tuning, from which on it is said what takes less; chosen
NOT_TUNED, UNTUNABLE = "not tuned: ", "tuning is not possible here: "  # at the start of a remark


class Candidate(NamedTuple):
    """A law with its gains for a plant."""

    law: Component  # with the best gains
    sets: tuple[Component, ...]  # the law with the gains of each search; the runs take them in turn
    remark: str = ""  # on the gains, besides their source

    def __call__(self, seed: int) -> Component:
        """Return the law with the gains of the run with this seed."""
        return self.sets[seed % len(self.sets)]

    def unseen(
        self, plant: Plant, goal: Objective, count: int, threads: int | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return J on instances 0, 1, ..., that of one in four at half the physics step, and the
        sets' numbers.
        """
        from smc_mujoco.analysis.tuning.evaluator import objectives

        instances = range(count)
        again = range(0, count, REPEATED_SEEDS)
        options = {"threads": threads}
        values = objectives(plant, [self(i) for i in instances], goal, instances, **options)
        halves = np.full(count, math.nan)
        halves[::REPEATED_SEEDS] = objectives(
            plant, [self(i) for i in again], goal, again, halved=True, **options
        )
        return values, halves, np.arange(count) % len(self.sets)


def law_or_template(law: Component | Template | str) -> Component | Template:
    """Return the law if the user gave its gains, else its template."""
    if isinstance(law, str):
        return known_laws()[law]
    if isinstance(law, Template):
        return law
    given = coerce.law(law)
    if given.template and given.source.kind == source.DEFAULT:
        return given.template
    return given


def _without_search(plant: Plant, law: Component | Template, gains: str) -> Candidate | None:
    """Return a law whose gains need no search; None for one that must be tuned."""
    if isinstance(law, Component):
        return Candidate(law, (law,))
    if not law.gains or gains == "default":
        return _default(law)
    library = plants_known().get(plant.name)
    ours = (
        catalogue().get(law.name) is law
        and library is not None
        and library.parameters == plant.parameters
    )
    if ours and not plant.unscaled and gain_sets.in_set(plant, law.name, gains):
        if gains == "study":
            count = 1
        else:
            count = len(gain_sets.tuned(plant, law.name, gains).sets)
        sets = tuple(gain_sets.law(plant, law.name, gains, seed) for seed in range(count))
        return Candidate(gain_sets.law(plant, law.name, gains), sets)
    if plant.unscaled:
        return _default(law, f"{UNTUNABLE}{plant.unscaled.partition(':')[0]}")
    return None


def _default(law: Component | Template, remark: str = "") -> Candidate:
    """Return a law with its default gains."""
    made = coerce.law(law)
    return Candidate(made, (made,), remark)


def candidate_of(default: Component, tuned: "Tuned") -> Candidate:
    """Return a law with the gains of each search, or with those that it had if no search found
    better ones.
    """
    from smc_mujoco.analysis.tuning import search_space

    its = tuned.law.source
    if tuned.before < tuned.objective:
        if default.source.kind == source.DEFAULT:
            its_own = "defaults"
        else:
            its_own = "own gains"
        default = default.sourced(its.kind, its.search)
        return Candidate(default, (default,), f"its {its_own}, better than those tried")
    gains = []
    for tried in tuned.sets:
        gains.append(dict(default.gains) | dict(zip(tuned.bounds, tried.gains, strict=True)))
    sets = tuple(
        dataclasses.replace(default, gains=values).sourced(its.kind, its.search) for values in gains
    )
    without_unit = list(search_space.without_unit(default))
    if len(without_unit) > 1:
        have = "have no unit, so their"
    else:
        have = "has no unit, so its"
    words = f"{joined(without_unit)} {have} search is about the defaults and not by the rule"
    best = dataclasses.replace(default, gains=tuned.law.gains).sourced(its.kind, its.search)
    return Candidate(best, sets, words * bool(without_unit))


class Trial(NamedTuple):
    """The plants and conditions of a comparison, and its folder; `threads` and `progress` are as in
    `run`.
    """

    plants: Sequence[Plant]
    conditions: Sequence[Condition]
    duration: float  # of a run, s
    starts: Starts | None
    folder: Path
    threads: int | None
    progress: bool

    def gains(
        self, laws: Mapping[str, Sequence[Component | Template]], defaults: bool, **options: Any
    ) -> dict[str, list[Candidate]]:
        """Return plant -> its laws with gains, see `gains_on` for the options.

        Raises:
          ScenarioError: none of several laws can be tuned on a plant, so that there could be no
            winner, unless `defaults`. It is raised before the first search.
        """
        for plant in () if defaults else self.plants:
            self._check_tunable(plant, laws[plant.name], **options)
        if self.progress:
            self._announce(laws, **options)
        return {
            plant.name: self.gains_on(plant, laws[plant.name], **options) for plant in self.plants
        }

    def gains_on(
        self,
        plant: Plant,
        laws: Sequence[Component | Template],
        searches: int = SEARCHES,
        budget: int = BUDGET,
        tune: bool = True,
        gains: str = "tuned",
    ) -> list[Candidate]:
        """Return laws with gains for a plant: given, shipped, tuned or default ones, in this order
        of preference.

        If some laws have shipped gains, the others are tuned from the starts of those. Laws without
        given gains come as templates. The folder keeps each search.
        """
        known, starts = self._known(plant, laws, gains)

        def missing(law: Component | Template) -> Candidate:
            if tune:
                return self.tuned(plant, law, starts, searches, budget)
            return _default(law)

        return [candidate or missing(law) for law, candidate in zip(laws, known, strict=True)]

    def _known(
        self, plant: Plant, laws: Sequence[Component | Template], gains: str
    ) -> tuple[list[Candidate | None], Starts | None]:
        """Return the laws that need no search, None for others, and the starts of the searches for
        those.
        """
        known = [_without_search(plant, law, gains) for law in laws]
        shipped = any(
            candidate and candidate.law.source.kind == source.SHIPPED for candidate in known
        )
        return known, None if shipped else self.starts

    def _check_tunable(
        self,
        plant: Plant,
        laws: Sequence[Component | Template],
        tune: bool = True,
        gains: str = "tuned",
        **_: Any,
    ) -> None:
        """Raise ScenarioError, with the first reason, if none of several laws can be tuned on a
        plant.
        """
        if len(laws) < 2 or not tune:
            return
        known, starts = self._known(plant, laws, gains)
        reasons = []
        for law, candidate in zip(laws, known, strict=True):
            if candidate is not None and not candidate.remark.startswith(UNTUNABLE):
                return
            if not (why := candidate.remark if candidate else self._why_not(plant, law, starts)):
                return
            reasons.append(why)
        raise ScenarioError(
            f"{reasons[0]}; or give laws with gains, or defaults=True (--defaults) for default gains"
        )

    def _announce(
        self,
        laws: Mapping[str, Sequence[Component | Template]],
        searches: int = SEARCHES,
        budget: int = BUDGET,
        tune: bool = True,
        gains: str = "tuned",
    ) -> None:
        """Say which laws are tuned on which plants, by how many searches, and for about how long,
        on stderr.
        """
        seconds = 0.0
        named = dict[str, list[str]]()
        for plant in self.plants if tune else ():
            known, starts = self._known(plant, laws[plant.name], gains)
            new = [
                law
                for law, candidate in zip(laws[plant.name], known, strict=True)
                if candidate is None
            ]
            files = [self._file(plant, law, searches, budget) for law in new]
            new = [
                law
                for law, file in zip(new, files, strict=True)
                if not any(file.parent.glob(f"{file.stem}-*"))
            ]
            if new := [law for law in new if not self._why_not(plant, law, starts)]:
                from smc_mujoco.analysis.tuning import search

                goal = self._goal(plant, starts)
                seconds += searches * search.expected_seconds(
                    plant, new, goal, budget, self.threads
                )
                for law in new:
                    named.setdefault(law.name, []).append(plant.name)
        if named:
            groups: dict[str, list[str]] = {}
            for law, plants in named.items():
                groups.setdefault(joined(plants), []).append(law)
            what = "; ".join(f"{first_of(its)} on {plants}" for plants, its in groups.items())
            if searches > 1:
                each = f"{searches} searches each"
            else:
                each = "1 search each"
            cures = ["name some of the laws (laws=, --law)"] * (len(named) > 1)
            cures += ["quick=True (--quick)"] * (searches >= SEARCHES)
            less = f". For less time: {' or '.join(cures)}" * (seconds > LONG and bool(cures))
            note(f"tuning {what}: {each}, {about(seconds)}{less}")

    def _file(self, plant: Plant, law: Component | Template, searches: int, budget: int) -> Path:
        """Return the path of a tuning, without its hashes."""
        return self.folder / "gains" / f"{plant.name}-{law.name}-{searches}-{budget}.json"

    def _why_not(self, plant: Plant, law: Component | Template, starts: Starts | None) -> str:
        """Return why a law cannot be tuned on a plant, "" if it can, as `search.why_not`."""
        from smc_mujoco.analysis.tuning import search

        return search.why_not(plant, law, self._goal(plant, starts))

    def _goal(self, plant: Plant, starts: Starts | None) -> Objective:
        """Return the objective of searches on a plant."""
        usual = Objective()
        conditions = tuple(
            c for c in usual.conditions if applicable([c.name], [plant], usual.duration)
        )
        return dataclasses.replace(usual, conditions=conditions, starts=starts or usual.starts)

    def tuned(
        self,
        plant: Plant,
        law: Component | Template,
        starts: Starts | None,
        searches: int,
        budget: int,
    ) -> Candidate:
        """Return a law with gains that `tune` finds, or found in an earlier call; its defaults if
        it cannot.
        """
        from smc_mujoco.analysis.tuning import result, search

        goal = self._goal(plant, starts)
        default = coerce.law(law)
        try:
            (first, *_) = goal.scenarios(plant, default)
            if isinstance(law, Template):
                template = law
            else:
                template = default.template
            ranges = template and (dict(template.gains), dict(template.conditions))
            depends = [
                run_key.key(first),
                goal.describe(),
                fingerprint.of((default.function, ranges)),
            ]
            with warnings.catch_warnings():
                for words in (
                    "no set of gains tried",
                    ".* no unit, and so a search",
                ):  # the remark says so
                    warnings.filterwarnings("ignore", words, ScenarioWarning)
                file = self._file(plant, law, searches, budget)
                options = {"searches": searches, "folder": file.parent / "searches"}
                tuned = cached(
                    file,
                    depends,
                    lambda: search.tune(
                        plant, law, budget, 0, goal, self.threads, self.progress, **options
                    ),
                    lambda made, path: made.save(path),
                    lambda path: result.load(path, plant),
                )
        except BrokenLawError:
            raise
        except ScenarioError as error:
            return _default(law, f"{NOT_TUNED}{error}")
        return candidate_of(default, tuned)

    def run(
        self, candidates: Mapping[str, Sequence[Candidate]], seeds: int, **options: Any
    ) -> Table:
        """Run the laws of each plant in each condition from the seeds 0, 1, ..., with the options
        of `study`.
        """
        grid = self.plants, lambda plant: candidates[plant.name], self.conditions, range(seeds)
        runs = all_combinations(*grid, self.duration, self.starts)
        options |= {"half_steps": True, "threads": self.threads, "progress": self.progress}
        return study(runs, self.folder, **options)

    def unseen(
        self, candidates: Mapping[str, Sequence[Candidate]], count: int
    ) -> dict[str, Unseen]:
        """Return plant -> J of its laws on `count` instances; a plant on which J is not defined is
        left out.
        """
        found = {}
        several = [(plant, c) for plant in self.plants for c in candidates[plant.name]]
        with bar(
            "J on runs that no search has seen", len(several), self.progress, counted=True
        ) as shown:
            for plant in self.plants:
                goal = self._goal(plant, self.starts)
                its = {}
                for candidate in candidates[plant.name]:
                    with contextlib.suppress(ScenarioError):
                        its[candidate.law.name] = candidate.unseen(plant, goal, count, self.threads)
                    shown.advance(1.0)
                if len(its) == len(candidates[plant.name]):
                    values, halves, sets = (
                        {law: one[k] for law, one in its.items()} for k in range(3)
                    )
                    found[plant.name] = Unseen(
                        values, halves, sets, len(goal.conditions) * goal.duration**2 / 2.0
                    )
        return found

    def attack(
        self, name: str, scenario: Scenario, within: "Uncertainty | None", budget: int | None = None
    ) -> "WorstCase":
        """Return the worst case of a scenario, which the folder keeps under a name."""
        from smc_mujoco.studies.worst_case import cached_worst_case

        file = self.folder / "worst" / f"{name}.json"
        return cached_worst_case(file, scenario, within, budget, self.threads, self.progress)
