"""Groups: the channels of a plant that can share one number.

The driven channels are one group, the free joints, which have no actuator, another. Each is divided further if its
units differ, because metres and radians have no common maximum or sum.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.state import LOGGED

if TYPE_CHECKING:
    from smc_mujoco.simulation.scenario import Scenario
    from smc_mujoco.simulation.trace import Trace


@dataclasses.dataclass(frozen=True, kw_only=True)
class Group:
    """Channels of one kind and one unit."""

    name: str  # "driven" or "free"; "driven rad" if several groups are driven
    unit: str  # of their x, "rad" or "m"
    effort: str  # unit of their u: "N m", "N" or "V"
    driven: bool  # whether they have actuators
    channels: tuple[int, ...]  # their indices, ascending


def groups(machine: Plant | Scenario) -> tuple[Group, ...]:
    """Return the groups of a plant, or of a scenario's plant, driven groups first. A scenario's u may be a voltage."""
    plant = machine if isinstance(machine, Plant) else machine.plant
    members: dict[tuple[bool, str], list[int]] = {}
    for i, unit in enumerate(plant.units):
        members.setdefault((i < plant.driven, unit), []).append(i)
    kinds = [driven for driven, _ in members]
    return tuple(
        Group(
            name=("driven" if driven else "free") + (f" {unit}" if kinds.count(driven) > 1 else ""),
            unit=unit,
            effort=machine.efforts[channels[0]],
            driven=driven,
            channels=tuple(channels),
        )
        for (driven, unit), channels in members.items()
    )


def group_trace(trace: Trace, group: Group) -> Trace:
    """Return the trace of a group's channels; the same trace if these are all. Its scenario has all channels."""
    if len(group.channels) == trace.x.shape[1]:
        return trace
    columns = list(group.channels)
    return dataclasses.replace(trace, **{name: getattr(trace, name)[:, columns] for name in LOGGED})
