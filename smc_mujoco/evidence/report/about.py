"""How a report was computed, in words: the grid, the conditions, the gains with their provenance,
the versions.
"""

import contextlib
import dataclasses
import functools
import itertools
import json
from collections.abc import Mapping
from importlib.metadata import version
from typing import NamedTuple

from smc_mujoco.analysis import paired_runs
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.control.component import Component
from smc_mujoco.control.source import in_words
from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.plan import FULL, Plan
from smc_mujoco.mechanisms.plant import catalogue as plants
from smc_mujoco.simulation.conditions import find_condition
from smc_mujoco.studies.table import Table

SHOWN_PACKAGES = (
    "pyarrow",
    "scipy",
)  # packages whose versions are shown beside those that each run records


class Gains(NamedTuple):
    """A law's gains on a plant in a set, and where they are from."""

    set: str
    plant: str
    law: str
    gains: str
    source: str


@dataclasses.dataclass(frozen=True, kw_only=True)
class About:
    """How the report was computed; templates/method.jinja has the sentences."""

    plan: Plan
    runs: int  # of the grid
    failed: int  # of these
    seeds: int  # of a cell of the grid, the largest number where cells differ
    sources: str  # where the gains of the grid's laws come from, in words
    versions: Mapping[str, str]  # of packages
    spent: Mapping[str, float]  # stage -> s of this call; less where results were there already
    no_film: str | None = None  # why there are no films

    @property
    def left_out(self) -> list[str]:
        """The conditions of the full report that this one lacks."""
        return [name for name in FULL.conditions if name not in self.plan.conditions]

    @functools.cached_property
    def conditions(self) -> dict[str, str]:
        """Condition -> the Scenario fields that it sets, in words."""
        texts = {}
        duration = self.plan.duration
        for name in self.plan.conditions:
            known = find_condition(name)
            fields = {}
            for p in self.plan.plants:
                fields[words.plant(p)] = known.brief(plants()[p], duration) or "nothing"
            same = len(set(fields.values())) == 1
            if same:
                texts[name] = next(iter(fields.values()))
            else:
                texts[name] = "; ".join(f"{p}: {t}" for p, t in fields.items())
        return texts

    @functools.cached_property
    def gains(self) -> list[Gains]:
        """The gains of every set, with where they are from."""
        return [
            Gains(
                name,
                plant,
                law,
                ", ".join(f"{k} {v:g}" for k, v in its.gains.items()),
                _source(plant, law, name),
            )
            for name in sets.SETS
            for plant, laws in laws_of(self.plan, name).items()
            for law, its in laws.items()
        ]


def about(plan: Plan, table: Table, spent: Mapping[str, float], no_film: str | None) -> About:
    """Return how the report was computed."""
    return About(
        plan=plan,
        runs=len(table),
        failed=sum(failure is not None for failure in table.column("failure")),
        seeds=len(set(table.column("seed").tolist())),
        sources=in_words(paired_runs.sources(table)),
        versions=json.loads(table.column("versions")[0])
        | {name: version(name) for name in SHOWN_PACKAGES},
        spent=dict(spent),
        no_film=no_film,
    )


def laws_of(plan: Plan, gains: str) -> dict[str, dict[str, Component]]:
    """Return plant -> law's name -> law, for the laws that a set has gains for on that plant."""
    laws: dict[str, dict[str, Component]] = {}
    for plant, law in itertools.product(plan.plants, plan.laws):
        with contextlib.suppress(ScenarioError):
            laws.setdefault(plant, {})[law] = sets.law(plant, law, gains)
    return laws


def _source(plant: str, law: str, name: str) -> str:
    """Return where the gains of a law in a set come from, in words."""
    if name not in sets.OBJECTIVES:
        return "chosen by hand before any comparison"
    its = sets.tuned(plant, law, name)
    if its.at_bound:
        bounds = f"; at a bound: {', '.join(its.at_bound)}"
    else:
        bounds = ""
    return f"shipped ({its.search}); least objective {its.objective:.4g} s²{bounds}"
