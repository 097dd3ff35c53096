"""Scenarios and traces as notebooks show them.

Their classes import this module, so their types are not named here.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from smc_mujoco.common.html import Html, fields, panel
from smc_mujoco.mechanisms.plant import Plant

FIELDS_IN_SECONDS = ("duration", "control_period", "physics_step", "input_delay")
MAX_CHANNELS = 8  # of one unit in a panel
MAX_CHARACTERS = 200  # of a value


def scenario(s: Any) -> Html:
    """Return the fields that differ from their defaults, and below them the defaults that depend on other fields."""
    defaults = {f.name: f.default for f in dataclasses.fields(s)}
    values = {name: getattr(s, name) for name in defaults if name not in ("plant", "law")}
    absent = {"noise": _all_zero(s.noise), "clock": _all_zero(s.clock), "contact": s.contact.kind == "none"}
    shown = {
        name: value
        for name, value in values.items()
        if value not in (None, (), {}) and value != defaults[name] and not absent.get(name, False)
    }
    rows = {"plant": s.plant, "law": s.law, "gains": s.law.source, "duration": s.duration} | shown
    resolved = {name: getattr(s.resolved, name) for name, value in values.items() if value is None}
    by_default = {name: value for name, value in resolved.items() if value is not None}
    note = ", ".join(f"{name.replace('_', ' ')} {_value_text(name, value, s)}" for name, value in by_default.items())
    texts = {name.replace("_", " "): _value_text(name, value, s) for name, value in rows.items()}
    return fields(texts, "Scenario", f"by default: {note}" if note else "")


def trace(run: Any) -> Html:
    """Return what was run, how it ended, and small figures of x with its reference, and of u."""
    s = run.scenario
    about = {
        "plant": _value_text("plant", s.plant, s),
        "law": str(s.law),
        "gains": str(s.law.source),
        "samples": f"{len(run.t)}, every {s.control_period:g} s",
    }
    last = np.flatnonzero(np.isfinite(run.x).all(axis=1))
    if run.failure:
        about["failed"] = run.failure
    elif len(last) and s.plant.n <= MAX_CHANNELS:
        ends = (f"{x:.3g} {unit}" for x, unit in zip(run.x[last[-1]], s.plant.units, strict=True))
        about["ends at x"] = ", ".join(ends)
    return Html(f"{fields(about, 'Trace')}<div>{''.join(_panels(run))}</div>")


def _panels(run: Any) -> list[Html]:
    """Return a panel of x for each unit, and one of u for each unit of the driven channels."""
    s, plant, panels = run.scenario, run.scenario.plant, []
    for unit in dict.fromkeys(plant.units):
        channels = [i for i, name in enumerate(plant.units) if name == unit][:MAX_CHANNELS]
        reference = run.r[:, channels[0]] if np.nan_to_num(run.r[:, channels]).any() else None
        panels.append(panel(run.t, list(run.x[:, channels].T), f"x ({unit})", reference))
    for unit in dict.fromkeys(s.efforts[: plant.driven]):
        channels = [i for i, name in enumerate(s.efforts[: plant.driven]) if name == unit][:MAX_CHANNELS]
        panels.append(panel(run.t, list(run.u[:, channels].T), f"u ({unit})"))
    return panels


def _all_zero(field: object) -> bool:
    """Return whether all numbers of a field are 0."""
    return dataclasses.is_dataclass(field) and not any(vars(field).values())


def _value_text(name: str, value: object, s: Any) -> str:
    """Return the value of a scenario's field as text."""
    plant = s.plant
    if isinstance(value, Plant):
        parameters = ", ".join(f"{key} = {number:g}" for key, number in value.parameters.items())
        return f"{value.name}{f', n = {value.n}' if value.n > 1 else ''} ({parameters})" if parameters else value.name
    if name in ("x0", "v0") and isinstance(value, tuple):
        text = _state(value, plant.units, "/s" * (name == "v0"))
    elif isinstance(value, Mapping):
        text = plant.change(value)
    elif isinstance(value, tuple):
        text = ", ".join(map(str, value))
    elif isinstance(value, float):
        efforts = dict.fromkeys(s.efforts[: plant.driven])
        unit = " or ".join(efforts) if name == "u_max" else "s" if name in FIELDS_IN_SECONDS else ""
        text = f"{value:g} {unit}".rstrip()
    else:
        text = str(value).removesuffix("()")
    return text if len(text) <= MAX_CHARACTERS else f"{text[: MAX_CHARACTERS - 3]}..."


def _state(values: tuple[float, ...], units: tuple[str, ...], rate: str) -> str:
    """Return positions or velocities with their units, and one number where all are equal."""
    texts = [f"{value:g} {unit}{rate}" for value, unit in zip(values, units, strict=True)]
    return texts[0] if len(set(texts)) == 1 else ", ".join(texts)
