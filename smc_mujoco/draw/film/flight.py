"""A map of flights in place of a film's second panel: the paths of free bodies and of their
references.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw import panels, quantities, shared_axes, style
from smc_mujoco.simulation.trace import Trace

PATH = 1.5  # points, width of a path


def plane(traces: Sequence[Trace]) -> Array:
    """Return the two of the axes x, y and z along which the references of free bodies vary most,
    (2,); where these stand still, the bodies themselves.
    """
    goals = np.concatenate([trace.r for trace in traces])
    if not np.ptp(goals, axis=0).any():
        goals = np.concatenate([trace.x for trace in traces])
    sides = np.ptp(goals, axis=0)
    order = np.argsort(-sides, kind="stable")
    widest = order[:2]
    return np.sort(widest)


class Flight(NamedTuple):
    """A run on a map: its path until now, the path of its reference, which lies over it, and its
    dot, with times in s and places, (2, m), in the map's unit.
    """

    past: Line2D
    goal: Line2D
    dot: Line2D
    times: Array
    places: Array


def draw_map(ax: Axes, panel: panels.Panel, colours: Sequence[str]) -> list[Flight]:
    """Draw the paths of free bodies and of their references in `plane`, to one scale, with a title
    that has the unit, and return what moves.
    """
    axes = plane(panel.traces)
    letters = np.array(["x", "y", "z"])
    across, along = letters[axes]
    goals = [trace.r for trace in panel.traces]
    flown = quantities.lasting(panel.traces, "x")
    seen = np.concatenate([*flown, *goals])[:, axes]
    factor, unit = shared_axes.prefixed(float(np.ptp(seen, axis=0).max()), "m")
    ax.set_title(f"{along} over {across} ({unit})", fontweight="normal")
    low = factor * seen.min(axis=0)
    high = factor * seen.max(axis=0)
    sides = np.array(ax.get_window_extent().size)
    scale = ((high - low) / sides).max()
    half = (0.5 + quantities.MARGIN) * scale * sides
    around = np.array([-half, half])
    ends = np.transpose((low + high) / 2 + around)
    ax.set(xlim=ends[0], ylim=ends[1])
    flights = []
    looks = style.looks(panel.traces)
    rows = zip(panel.traces, colours, looks, strict=True)
    for trace, colour, look in reversed(list(rows)):
        places = factor * trace.x[:, axes].T
        thin = {"color": style.INK, "lw": style.points(0.8), "ls": panels.DASHES, "animated": True}
        if not np.ptp(trace.r[:, axes], axis=0).any():  # it stands still
            thin |= {"marker": "+", "ms": style.points(9)}
        (goal,) = ax.plot(*(factor * trace.r[:, axes].T), **thin)
        wide = {"color": colour, "lw": style.points(PATH), "animated": True, **look}
        (past,) = ax.plot([], [], **wide)
        dot = panels.dot(ax, colour)
        flight = Flight(past, goal, dot, trace.t, places)
        flights.append(flight)
    return flights
