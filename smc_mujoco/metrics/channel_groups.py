"""Groups: the channels of a plant that can share one number.

The driven channels are one group, the free joints, which have no actuator, another. Each is divided further if its
units differ, because metres and radians have no common maximum or sum.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from smc_mujoco.simulation.state import LOGGED

if TYPE_CHECKING:
    from smc_mujoco.mechanisms.plant import Plant
    from smc_mujoco.simulation.trace import Trace


@dataclasses.dataclass(frozen=True, kw_only=True)
class Group:
    """Channels of one kind and one unit.

    Attributes:
      name: "driven" or "free"; "driven rad" if several groups are driven.
      unit: of their x, "rad" or "m".
      driven: whether they have actuators.
      channels: their indices, ascending.
    """

    name: str
    unit: str
    driven: bool
    channels: tuple[int, ...]


def groups(plant: Plant) -> tuple[Group, ...]:
    """Return the plant's groups: driven ones first, each kind in the order of its channels."""
    members: dict[tuple[bool, str], list[int]] = {}
    for i, unit in enumerate(plant.units):
        members.setdefault((i < plant.driven, unit), []).append(i)
    kinds = [driven for driven, _ in members]
    return tuple(
        Group(
            name=("driven" if driven else "free") + (f" {unit}" if kinds.count(driven) > 1 else ""),
            unit=unit,
            driven=driven,
            channels=tuple(channels),
        )
        for (driven, unit), channels in members.items()
    )


def cut(trace: Trace, group: Group) -> Trace:
    """Return the trace of a group's channels; the same trace if these are all. Its scenario keeps all channels."""
    if len(group.channels) == trace.x.shape[1]:
        return trace
    columns = list(group.channels)
    return dataclasses.replace(trace, **{name: getattr(trace, name)[:, columns] for name in LOGGED})
