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
        limits=limits(plan),
        conditions=conditions(plan),
        versions=run,
        gains=tuple(row for name in sets.SETS for row in gains(plan, name)),
        spent=dict(spent),
        no_film=no_film,
    )


def settings(plan: Plan, table: Table) -> dict[str, str]:
    """The grid and the rest in words."""
    across, up = plan.points
    looked = Objective()
    tuned_on = ", ".join(words.condition(one.name) for one in looked.conditions)
    return {
        "grid": f"{len(plan.plants)} plants × {len(plan.conditions)} conditions × {len(plan.laws)} laws × {plan.seeds} "
        f"seeds = {len(table)} runs of {plan.duration:g} s, of which {scores.failed(table)} failed",
        "seeds": f"0 to {plan.seeds - 1}; seed 0 starts at the plant’s own x0, every other within 20 % of it, all laws "
        "alike",
        "gains": f"set {GAINS}, listed below; found on {tuned_on}, in runs of {looked.duration:g} s from starts and "
        "with noise that no seed of the study has; all other conditions are new to them",
        "bound on u": f"|u| ≤ {scenarios.U_MAX:g} N·m or N, the same for every law",
        "control period": f"{1e3 * scenarios.CONTROL_PERIOD:g} ms; physics in RK4 steps of 1 ms, with real parts in "
        "implicitfast steps of 0.25 ms",
        "what laws know": "the measured state only, no model of the plant",
        "margins": f"{', '.join(words.kind(kind) for kind in plan.kinds) or 'none'}, "
        f"{'quick' if plan.quick else 'in full'}, seed 0",
        "region maps": f"{across} × {up} initial states each" if plan.basins else "none",
        "claims": "quick: coarser grids, one set of gains" if plan.quick else "in full, every set of gains",
        "statistics": "seeds are the sample; conditions and plants are fixed",
    }


def limits(plan: Plan) -> tuple[str, ...]:
    """What was not done, and so is not told."""
    left = [words.condition(name) for name in FULL.conditions if name not in plan.conditions]
    found = [
        "Nothing was tried on hardware: all of it is simulation, of the plants’ equations and of models of friction, "
        "actuators and sensors.",
        "Velocity is measured but where a condition has an encoder; what estimators cost is not compared here.",
        f"{len(plan.laws)} of the package’s {len(laws())} laws, with one bound on u and one control period: under "
        "others the order may be another.",
        "Seeds vary the start and the noise. What else varies, the plant’s parameters among it, does so by condition.",
        "The answer over all runs weighs every condition alike, as no application does: see the tables by condition.",
        "Tuning sees runs from x0 alone. A law whose best gains there use little of the bound on u, as a small "
        "switching gain does, has smaller margins and regions than the bound would allow it.",
    ]
    return (*found, f"Left out by this plan: {', '.join(left)}.") if left else tuple(found)


def conditions(plan: Plan) -> dict[str, str]:
    """Condition -> the fields of a Scenario that it sets, in words."""
    found = {}
    for name in plan.conditions:
        each = {words.plant(p): _fields(scenarios.fields(name, p, plan.duration)) for p in plan.plants}
        same = len(set(each.values())) == 1
        found[name] = next(iter(each.values())) if same else "; ".join(f"{p}: {told}" for p, told in each.items())
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
    its = result.shipped(plant, law, sets.OBJECTIVES[name])
    bounds = f"; at a bound: {', '.join(its.at_bound)}" if its.at_bound else ""
    widened = f"; widened: {', '.join(its.widened)}" if its.widened else ""
    return f"objective {its.objective:.4g} s², {its.budget} sets of gains tried, seed {its.seed}{bounds}{widened}"
