"""Forces on bodies, and a map of flights in place of a film's second chart: the paths of free
bodies and of their references.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from smc_mujoco.common.aliases import Array
from smc_mujoco.draw import panels, style
from smc_mujoco.simulation.trace import Trace

FLIGHT_DISTANCE = 0.6  # of an arrow, from the middle of a free body to it
BLOW_DISTANCE = 1.1  # of an arrow, from the foot of that of a blow to the middle of its body
BLOW_TIME = 0.12  # s for which a blow is shown after its end; chosen


def blows(trace: Trace, start: float, stop: float) -> list[tuple[str, Array]]:
    """Return the bodies that blows hit between two times, s, or a little before, with the peak of
    each, (3,) N.
    """
    found = []
    for push in style.pushes([trace]):
        if start <= push.time + push.width + BLOW_TIME and stop >= push.time:
            found.append((push.body, np.array([push.x, push.y, push.z])))
    return found


def straight(model: mujoco.MjModel, data: mujoco.MjData, body: str | int, force: Array) -> Array:
    """Return the line of a force's arrow, (40, 3) m: out of a free body, whose number is given; or,
    of a blow on a body of a name, to its middle.
    """
    along = np.linspace(0.0, 1.0, 40)[:, None] * force
    if isinstance(body, str):
        names = [model.body(i).name.removeprefix("m/") for i in range(model.nbody)]
        return data.xipos[names.index(body)] + along - BLOW_DISTANCE * force
    return data.xpos[body] + along + FLIGHT_DISTANCE * force


def plane(traces: Sequence[Trace]) -> Array:
    """Return the two of the axes x, y and z along which the references of free bodies vary most,
    (2,).
    """
    sides = np.ptp(np.concatenate([trace.r for trace in traces]), axis=0)
    return np.sort(np.argsort(-sides, kind="stable")[:2])


def paths(ax: Axes, panel: panels.Panel, colours: Sequence[str]) -> list[Artist]:
    """Draw the paths of free bodies and of their references in `plane`, to one scale, with a title,
    and return the artists of the traces.
    """
    axes = plane(panel.traces)
    across, along = np.array(["x", "y", "z"])[axes]
    ax.set_title(f"{along} over {across} (m)")
    goals = [trace.r for trace in panel.traces]
    seen = np.concatenate([*panels.lasting(panel.traces, "x"), *goals])
    low = seen[:, axes].min(axis=0)
    high = seen[:, axes].max(axis=0)
    sides = np.array(ax.get_window_extent().size)
    half = (0.5 + panels.MARGIN) * ((high - low) / sides).max() * sides
    ends = np.transpose((low + high) / 2 + np.array([-half, half]))
    ax.set(xlim=ends[0], ylim=ends[1])
    artists = []
    rows = zip(panel.traces, colours, style.looks(panel.traces), strict=True)
    for trace, colour, look in reversed(list(rows)):
        artists += ax.plot(*trace.x[:, axes].T, color=colour, lw=style.points(panels.LINE), **look)
        goal = {"color": style.INK, "lw": style.points(0.8), "ls": panels.DASHES, "zorder": 3}
        ax.plot(*trace.r[:, axes].T, **goal)
    return artists


def flights(ax: Axes, traces: Sequence[Trace], height: int) -> list[tuple[Array, Array]]:
    """Return times, s, and places in the picture, (m, 2) px, of each trace on a map."""
    found = []
    for trace in traces:
        places = ax.transData.transform(trace.x[:, plane(traces)])
        found.append((trace.t, np.array([0.0, height]) + places * (1.0, -1.0)))
    return found
