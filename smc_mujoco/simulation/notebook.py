"""Scenarios and traces as notebooks show them. Their classes import this module, so their types are not named here."""

import dataclasses
import math
from typing import Any

import numpy as np

from smc_mujoco.common.errors import shown
from smc_mujoco.common.html import Html, fields
from smc_mujoco.mechanisms.hardware.contact import Contact
from smc_mujoco.simulation.signals import Clock, Noise

ABSENT = None, (), {}, Noise(), Clock(), Contact("none")  # values of fields that were left out


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
    """Return what was run, how it failed if it did, and the range of x and u in each unit."""
    s = run.scenario
    rows = {"plant": s.plant.name, "law": s.law, "gains": s.law.source}
    rows["samples"] = f"{len(run.t)}, every {s.control_period:g} s"
    if run.failure:
        rows["failed"] = run.failure
    for name, units in (("x", s.plant.units), ("u", s.efforts[: s.plant.driven])):
        for unit in dict.fromkeys(units):
            values = getattr(run, name)[:, [i for i, other in enumerate(units) if other == unit]]
            known = values[np.isfinite(values)].tolist() or [math.nan]
            rows[f"{name} ({unit})"] = f"{min(known):.3g} to {max(known):.3g}"
    return fields(rows, "Trace")
