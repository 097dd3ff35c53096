"""Which traces share axes, and the units of those."""

import math
from collections.abc import Sequence

from smc_mujoco.common.errors import ScenarioError, items_of, shown
from smc_mujoco.mechanisms.plant import EFFORT
from smc_mujoco.metrics.conventions import ChannelGroup, group_trace, groups
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

MANY_DIGITS = 1e5  # from it on, matplotlib writes numbers with an exponent
# of units, by the power of 1000 that a number is given
PREFIXES = {-2: "M", -1: "k", 0: "", 1: "m", 2: "µ", 3: "n"}


def traces_of_one_plant(traces: Trace | Sequence[Trace]) -> list[Trace]:
    """Return the traces as a list; refuse those that cannot share axes."""
    if isinstance(traces, str):
        raise ScenarioError(
            f"traces is {shown(traces)}, no trace: give what smc.run or smc.load returns"
        )
    traces = [traces] if isinstance(traces, Trace | Scenario) else items_of("traces", traces)
    for item in traces:
        if not isinstance(item, Trace):
            raise ScenarioError(
                f"traces has {shown(item)}, no trace: give what smc.run or smc.load returns"
            )
    if not traces:
        raise ScenarioError(
            "no traces to draw: give at least one, from smc.run(...) or smc.load(...)"
        )
    plants = sorted({trace.scenario.plant.name for trace in traces})
    if len(plants) > 1:
        raise ScenarioError(
            f"traces of {' and '.join(plants)} share no axes: draw one plant at a time, "
            f"such as [t for t in traces if t.scenario.plant.name == {plants[0]!r}]"
        )
    kinds = set()
    for trace in traces:
        kind = tuple((group.name, group.unit) for group in groups(trace.scenario))
        kinds.add(kind)
    if len(kinds) > 1:
        raise ScenarioError(
            f"traces of {plants[0]} differ in their kinds of channels: "
            "draw those with the same ones at a time"
        )
    if len(units := sorted({trace.scenario.efforts[0] for trace in traces})) > 1:
        raise ScenarioError(
            f"traces of {plants[0]} have u in {' and '.join(units)}: "
            "draw those of one unit at a time"
        )
    return traces


def split(traces: Sequence[Trace]) -> dict[ChannelGroup, list[Trace]]:
    """Return the traces of each group of channels, which share a pair of axes.

    All traces are of one plant.
    """
    kinds = zip(*(groups(trace.scenario) for trace in traces), strict=True)
    parts = {}
    for kind in kinds:
        parts[kind[0]] = list(map(group_trace, traces, kind))
    return parts


def units(group: ChannelGroup) -> dict[str, str]:
    """Return the units of x, v, u and s of a group's channels, and of a force on them."""
    x = group.unit
    u = group.effort.replace(" ", "·")
    force = EFFORT[x].replace(" ", "·")
    speed = f"{x.removesuffix('/s')}/s"
    return {"x": x, "v": speed, "u": u, "s": speed, "force": force}


def prefixed(largest: float, unit: str) -> tuple[float, str]:
    """Return a factor and the unit with a prefix, with which values up to `largest` need no
    exponent.
    """
    if 0.0 < largest < 0.1 or largest >= MANY_DIGITS:
        power = -math.floor(math.log10(largest) / 3.0)
    else:
        power = 0
    power = min(max(power, min(PREFIXES)), max(PREFIXES))
    return 1e3**power, PREFIXES[power] + unit
