"""Traces of made-up data, the same on all processors, and a pen that notes what a film draws."""

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from typing import ClassVar

import numpy as np
from PIL import ImageDraw

import smc_mujoco as smc
from helpers.reference import PLANT_DIVERGED
from smc_mujoco.simulation.trace import ARRAYS


def number(value: float) -> str:
    """Return a number with three digits, and rounding as 0."""
    return f"{round(float(value), 9) + 0.0:.3g}"


def numbers(values: Iterable) -> str:
    """Return numbers in brackets."""
    return f"({', '.join(map(number, np.ravel(np.asarray(values, float))))})"


def made(scenario: smc.Scenario) -> smc.Trace:
    """Return a trace of a scenario that was not run: decaying waves, other ones for each array and
    channel.
    """
    t = np.arange(scenario.samples + 1) * scenario.control_period
    n = scenario.plant.n
    waves = {}
    for k, name in enumerate(ARRAYS[1:]):
        waves[name] = (
            0.7**k
            * np.exp(-2.0 * t)[:, None]
            * np.cos((4.0 + k) * t[:, None] + 0.3 + 0.7 * np.arange(n))
        )
    return smc.Trace(t=t, **waves, scenario=scenario)


def failed(trace: smc.Trace, at: int, failure: str = "") -> smc.Trace:
    """Return the trace as if it had failed at sample `at`; by default the plant diverged."""
    failure = failure or f"{PLANT_DIVERGED}, at t = {trace.t[at]:g} s"
    arrays = {}
    for name in ARRAYS[1:]:
        arrays[name] = getattr(trace, name).copy()
    for array in arrays.values():
        array[at:] = np.nan
    return dataclasses.replace(trace, **arrays, diverged_at=float(trace.t[at]), failure=failure)


class Pen(ImageDraw.ImageDraw):
    """A pen of Pillow that also notes what it draws, in `notes`; in the place of
    `ImageDraw.Draw`.
    """

    notes: ClassVar[list[str]] = []
    busy: ClassVar[bool] = False  # within a shape, which is made of others


def _noted(name: str) -> Callable:
    """Return a method of the pen that notes its call."""
    draw = getattr(ImageDraw.ImageDraw, name)

    def method(self, *given, **options):
        first, Pen.busy = not Pen.busy, True
        if first:
            named = []
            for key, value in options.items():
                named.append(f"{key}={_plain(value)}")
            many = name == "polygon" or (name == "line" and len(given[0]) > 4)
            if many:
                shape = [_outline(given[0]), *given[1:]]
            else:
                shape = given
            Pen.notes.append(" ".join([name, *map(_plain, shape), *named]))
        try:
            return draw(self, *given, **options)
        finally:
            Pen.busy = not first

    return method


def _outline(points: Sequence) -> np.ndarray:
    """Return the number of the points of an outline, the first, the middle one, their means and
    spreads.
    """
    line = np.array(points, float)
    return np.array(
        [len(line), *line[0], *line[len(line) // 2], *line.mean(axis=0), *line.std(axis=0)]
    )


def _plain(part: object) -> str:
    """Return an argument of a drawing as text: places to a tenth of a px."""
    if hasattr(part, "getname"):
        return f"{part.getname()[1]} {number(part.size)}"
    if isinstance(part, str | type(None)):
        return repr(part)
    return numbers(np.round(np.asarray(part, float), 1))


for _name in ("text", "line", "rectangle", "rounded_rectangle", "ellipse", "polygon"):
    setattr(Pen, _name, _noted(_name))
