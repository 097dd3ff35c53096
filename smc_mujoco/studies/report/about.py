"""How a report was computed, in words: the grid, the conditions, the gains with their provenance, the versions."""

import dataclasses
import json
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from smc_mujoco.analysis.tuning import result
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.control.law import laws
from smc_mujoco.studies.paper import scenarios
from smc_mujoco.studies.report import scores, words
from smc_mujoco.studies.report.findings import About, Gains
from smc_mujoco.studies.report.plan import FULL, GAINS, Plan
from smc_mujoco.studies.table import Table

SHOWN = ("plotly", "pyarrow", "scipy")  # versions told beside those that each run records


def about(plan: Plan, table: Table, spent: Mapping[str, float], no_film: str | None) -> About:
    """Return how the report was computed, for its last section; templates/method.jinja has the sentences."""
    run = json.loads(table.column("versions")[0]) | {name: version(name) for name in SHOWN}
    return About(
        plan=plan,
        runs=len(table),
        failed=scores.failed(table),
        seeds=scores.seeds(table),
        gains_set=GAINS,
        objective=Objective(),
        left_out=tuple(name for name in FULL.conditions if name not in plan.conditions),
        laws=len(laws()),
        u_max=scenarios.U_MAX,
        control_period=scenarios.CONTROL_PERIOD,
        conditions=conditions(plan),
        versions=run,
        gains=tuple(row for name in sets.SETS for row in gains(plan, name)),
        spent=dict(spent),
        no_film=no_film,
    )


def conditions(plan: Plan) -> dict[str, str]:
    """Return condition -> the fields of a Scenario that it sets, in words."""
    found = {}
    for name in plan.conditions:
        each = {words.plant(p): _fields(scenarios.fields(name, p, plan.duration)) for p in plan.plants}
        same = len(set(each.values())) == 1
        found[name] = next(iter(each.values())) if same else "; ".join(f"{p}: {told}" for p, told in each.items())
    return found


def _fields(fields: Mapping[str, Any]) -> str:
    return ", ".join(f"{name.replace('_', ' ')} {_short(value)}" for name, value in fields.items()) or "nothing"


def _short(value: Any) -> str:
    """Return a field's value as it would be written, without what it leaves at its default."""
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return " ".join(str(value).split())
    shown = [
        f"{field.name}={_short(getattr(value, field.name))}"
        for field in dataclasses.fields(value)
        if field.init and getattr(value, field.name) != field.default
    ]
    return f"{type(value).__name__}({', '.join(shown)})"


def gains(plan: Plan, name: str) -> list[Gains]:
    """Return the gains of a set, with where they are from; what the set lacks is left out."""
    found = []
    for plant in plan.plants:
        for law in plan.laws:
            try:
                its = sets.law(plant, law, name)
                text = ", ".join(f"{gain} {value:g}" for gain, value in its.gains.items())
                found.append(Gains(name, plant, law, text, _source(plant, law, name)))
            except ScenarioError:
                continue
    return found


def _source(plant: str, law: str, name: str) -> str:
    if name not in sets.OBJECTIVES:
        return "chosen by hand before any comparison"
    its = result.shipped(plant, law, sets.OBJECTIVES[name])
    bounds = f"; at a bound: {', '.join(its.at_bound)}" if its.at_bound else ""
    widened = f"; widened: {', '.join(its.widened)}" if its.widened else ""
    return f"objective {its.objective:.4g} s², {its.budget} sets of gains tried, seed {its.seed}{bounds}{widened}"
