"""Scenarios and traces as notebooks show them. Their classes import this module, so their types are not named here."""

import dataclasses
from typing import Any

import numpy as np

from smc_mujoco.common.errors import shown
from smc_mujoco.common.html import Html, fields, panel
from smc_mujoco.mechanisms.hardware.contact import Contact
from smc_mujoco.simulation.signals import Clock, Noise

ABSENT = None, (), {}, Noise(), Clock(), Contact("none")  # values of fields that were left out
MAX_CHANNELS = 8  # of one unit in a panel


def scenario(s: Any) -> Html:
    """Return plant, law, duration and the fields that differ from their defaults, in SI units."""
    parameters = ", ".join(f"{name} = {value:g}" for name, value in s.plant.parameters.items())
    rows = {"plant": f"{s.plant.name} ({parameters})", "law": s.law, "gains": s.law.source, "duration": s.duration}
    for f in dataclasses.fields(s):
        value = getattr(s, f.name)
        if f.name not in rows and value != f.default and value not in ABSENT:
            rows[f.name.replace("_", " ")] = shown(value)
    return fields(rows, "Scenario")


def trace(run: Any) -> Html:
    """Return what was run, how it failed if it did, and small figures of x with its reference, and of u."""
    s, driven, panels = run.scenario, run.scenario.plant.driven, []
    about = {"plant": s.plant.name, "law": s.law, "gains": s.law.source}
    about["samples"] = f"{len(run.t)}, every {s.control_period:g} s"
    if run.failure:
        about["failed"] = run.failure
    for name, units in (("x", s.plant.units), ("u", s.efforts[:driven])):
        for unit in dict.fromkeys(units):
            channels = [i for i, other in enumerate(units) if other == unit][:MAX_CHANNELS]
            led = name == "x" and np.nan_to_num(run.r[:, channels]).any()
            curves = list(getattr(run, name)[:, channels].T)
            panels.append(panel(run.t, curves, f"{name} ({unit})", run.r[:, channels[0]] if led else None))
    return Html(f"{fields(about, 'Trace')}<div>{''.join(panels)}</div>")
