"""What an overview shows over time: quantities of groups of channels, one a row, and what their axes are called."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.draw import style
from smc_mujoco.metrics.channel_groups import Group
from smc_mujoco.simulation.trace import Trace

REALISM = ("force", "reaction")  # quantities of realistic mechanisms alone
GAP = 4  # points, between the names of two axes


class Row(NamedTuple):
    """A quantity of a group of channels."""

    name: str
    group: Group
    traces: Sequence[Trace]  # of these channels alone


def rows_of(traces: Sequence[Trace]) -> list[Row]:
    """What an overview shows over time, from top to bottom; realism adds what acts on the joints."""
    shown = style.split(traces)
    driven = {group: parts for group, parts in shown.items() if group.driven}
    drives = any(trace.scenario.actuator for trace in traces)
    rows = []
    for group, parts in shown.items():
        several = group.driven and len(group.channels) > 1
        rows += [Row(name, group, parts) for name in ("x", *["spread"] * several)]
    for group, parts in driven.items():
        rows += [Row(name, group, parts) for name in ("u", *["force"] * drives)]
    for group, parts in shown.items():
        rows += [Row("reaction", group, parts)] * any(np.nan_to_num(part.reaction).any() for part in parts)
    return rows + [Row("s", group, parts) for group, parts in driven.items()]


def titles(rows: Sequence[Row], pitch: float) -> list[str]:
    """The axes' names of rows `pitch` points apart: of two that would touch, the units stand on a second line."""
    words = [axis(row, row.name) for row in rows]
    wide = [style.width(text, style.RC["font.size"]) for text in words]
    close = {i for i, (a, b) in enumerate(itertools.pairwise(wide)) if (a + b) / 2 > pitch - GAP}
    return [text.replace(" (", "\n(") if {i - 1, i} & close else text for i, text in enumerate(words)]


def axis(row: Row, name: str) -> str:
    """An axis' name with its unit."""
    group, several = row.group, len(row.group.channels) > 1
    unit = style.units(group)[{"spread": "x", "force": "u", "reaction": "u"}.get(name, name)]
    if name in ("spread", *REALISM):
        words = {"spread": "max − min x", "force": "delivered", "reaction": "reaction" + " on q" * (not group.driven)}
        return f"{'mean ' * (several and name != 'spread')}{words[name]} ({unit})"
    if name == "s" and row.traces[0].scenario.plant.free:
        return f"{'mean ' * several}sliding variable s"  # of both joints, in a unit that the law alone knows
    if name == "s" and row.traces[0].scenario.plant.mixed:
        return f"{'mean ' * several}s ({unit})"  # rows of it are many, and low
    words = {"x": style.quantity(group), "v": "velocity", "u": "control", "s": "sliding variable"}
    letters = {"x": "q", "v": "q′"} if not group.driven else {}
    return f"{'mean' if several else words[name]} {letters.get(name, name)} ({unit})"
