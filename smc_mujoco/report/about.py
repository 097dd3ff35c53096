"""How a report was computed, in words: the grid, the conditions, the gains with their provenance, the versions."""

import dataclasses
import json
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from smc_mujoco import gains as sets
from smc_mujoco import paper, tuned
from smc_mujoco.errors import ScenarioError
from smc_mujoco.report import scores, words
from smc_mujoco.report.findings import About, Gains
from smc_mujoco.report.plan import GAINS, Plan
from smc_mujoco.table import Table

SHOWN = ("plotly", "pyarrow", "scipy")  # versions told beside those that each run records


def about(plan: Plan, table: Table, spent: Mapping[str, float], no_film: str | None) -> About:
    """Everything that the last section tells."""
    run = json.loads(table.column("versions")[0]) | {name: version(name) for name in SHOWN}
    return About(
        quick=plan.quick,
        runs=len(table),
        failed=scores.failed(table),
        seeds=scores.seeds(table),
        duration=plan.duration,
        gains_set=GAINS,
        settings=settings(plan, table),
        conditions=conditions(plan),
        versions=run,
        gains=tuple(row for name in sets.SETS for row in gains(plan, name)),
        spent=dict(spent),
        no_film=no_film,
    )


def settings(plan: Plan, table: Table) -> dict[str, str]:
    """The grid and the rest in words."""
    across, up = plan.points
    return {
        "grid": f"{len(plan.plants)} plants × {len(plan.conditions)} conditions × {len(plan.laws)} laws × {plan.seeds} "
        f"seeds = {len(table)} runs of {plan.duration:g} s, of which {scores.failed(table)} failed",
        "bound on u": f"|u| ≤ {paper.U_MAX:g} N·m or N, the same for every law",
        "control period": f"{1e3 * paper.CONTROL_PERIOD:g} ms; physics in RK4 steps of 1 ms, with real parts in "
        "implicitfast steps of 0.25 ms",
        "what laws know": "the measured state only, no model of the plant",
        "margins": f"{', '.join(words.kind(kind) for kind in plan.kinds) or 'none'}, "
        f"{'quick' if plan.quick else 'in full'}, seed 0",
        "region maps": f"{across} × {up} initial states each" if plan.basins else "none",
        "claims": "quick: coarser grids, one set of gains" if plan.quick else "in full, every set of gains",
        "statistics": "seeds are the sample; conditions and plants are fixed",
    }


def conditions(plan: Plan) -> dict[str, str]:
    """Condition -> the fields of a Scenario that it sets, in words."""
    found = {}
    for name in plan.conditions:
        fields = paper.CONDITIONS[name]
        if callable(fields):
            each = {words.plant(plant): _fields(fields(plant)) for plant in plan.plants}
            same = len(set(each.values())) == 1
            text = next(iter(each.values())) if same else "; ".join(f"{plant}: {told}" for plant, told in each.items())
        else:
            text = _fields(fields)
        found[name] = text
    return found


def _fields(fields: Mapping[str, Any]) -> str:
    return ", ".join(f"{name.replace('_', ' ')} {_short(value)}" for name, value in fields.items()) or "nothing"


def _short(value: Any) -> str:
    """A field's value as it would be written, without what it leaves at its default."""
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return " ".join(str(value).split())
    shown = [
        f"{field.name}={_short(getattr(value, field.name))}"
        for field in dataclasses.fields(value)
        if field.init and getattr(value, field.name) != field.default
    ]
    return f"{type(value).__name__}({', '.join(shown)})"


def gains(plan: Plan, name: str) -> list[Gains]:
    """The gains of a set, with where they are from; what the set lacks is left out."""
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
    its = tuned.shipped(plant, law, sets.OBJECTIVES[name])
    bounds = f"; at a bound: {', '.join(its.at_bound)}" if its.at_bound else ""
    widened = f"; widened: {', '.join(its.widened)}" if its.widened else ""
    return f"objective {its.objective:.4g} s², {its.budget} sets of gains tried, seed {its.seed}{bounds}{widened}"
