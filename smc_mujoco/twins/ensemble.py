"""Runs of laws over a rig's ensemble of parameter sets, as over conditions: does a ranking survive what is not known?

table = smc.study(ensemble.runs(smc.rig("emps"), ["pid", "super_twisting"]), "emps")
print(ensemble.verdict(smc.leaderboard(table)))
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.law import Law
from smc_mujoco.simulation.grid import grid
from smc_mujoco.simulation.initial_states import Starts
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.twins.rig import Rig, Values

PLANT_ALONE = ("x0", "v0")  # fields that the starts of a grid decide


def runs(
    rig: Rig,
    laws: Sequence[str | Law],
    seeds: int = 20,
    gains: str = "default",
    duration: float = 10.0,
    starts: Starts | None = None,
) -> list[Scenario]:
    """Return runs of every law on every parameter set from every seed; the set is the run's condition.

    Args:
      rig: a rig with an ensemble.
      laws: laws or their names.
      seeds, gains, duration, starts: as in `smc.grid`.

    Raises:
      ScenarioError: a rig without an ensemble, or arguments that `smc.grid` refuses.
    """
    if not rig.ensemble:
        raise ScenarioError(f"{rig.name} has one set of parameters: choose a rig with an ensemble, such as qube_servo")
    found = []
    for name, member in rig.members().items():
        fields: dict[str, Any] = member.machine(Values(**member.values))
        own = {key: value for key, value in fields.items() if key not in PLANT_ALONE}
        plant = own.pop("plant")
        base = grid([plant], laws, ["nominal"], seeds, gains, duration, starts)
        free: dict[str, Any] = {"u_max": None, "physics_step": None} | own
        found += [dataclasses.replace(scenario, **free).named(name) for scenario in base]
    return found


def verdict(boards: Sequence[Any]) -> str:
    """Return in a line for each metric whether one law wins on every parameter set."""
    lines = []
    for board in boards:
        sets = list(board.blocks)
        if board.winner:
            lines.append(f"{board.metric}: {board.winner} wins on all {len(sets)} parameter sets")
            continue
        wins = [f"{block.winner} on {block.condition}" for block in sets if block.winner]
        lines.append(
            f"{board.metric}: no law wins on all {len(sets)} parameter sets ({', '.join(wins) or 'none on any'})"
        )
    return "\n".join(lines)
