"""Rankings of laws over a rig's parameter sets: does a winner win whichever of them is true?

table = smc.study(ensemble.runs(smc.rig("qube_servo")), "qube")
print(ensemble.verdict(smc.leaderboard(table)))
"""

import dataclasses
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.frozen import frozen
from smc_mujoco.control.law import Law
from smc_mujoco.evidence.rigs.rig import Rig, Values
from smc_mujoco.simulation.grid import Starts, grid
from smc_mujoco.simulation.scenario import Scenario

BY_STARTS = ("x0", "v0")  # fields of a rig's machine that the starts of the grid replace


def runs(
    rig: Rig,
    laws: Sequence[str | Law] | None = None,
    seeds: int = 20,
    gains: str = "default",
    duration: float = 10.0,
    starts: Starts | None = None,
) -> list[Scenario]:
    """Return scenarios of every law on every parameter set from every seed. The set is the condition.

    `laws`: by default the rig's own; the name of one of these means it, with its gains. `seeds`, `gains`, `duration`
    and `starts` are as in `smc.grid`; starts are by default within 20 % of the rig's x0.
    """
    if not rig.ensemble:
        raise ScenarioError(
            f"{rig.name} has only one parameter set: choose a rig with an ensemble, such as qube_servo, or identify it "
            "from records and draw other sets with Identified.drawn"
        )
    shipped, given = {law.name: law for law in rig.laws}, rig.laws if laws is None else laws
    if not (chosen := [shipped.get(law, law) if isinstance(law, str) else law for law in given]):
        raise ScenarioError(f"no laws have gains for {rig.name}: give some, such as pid(kp=30,kd=6)")
    scenarios, around = [], Starts(x0=rig.x0) if starts is None else starts
    for name, member in rig.members().items():
        fields: dict[str, Any] = {"u_max": None, "physics_step": None} | member.machine(Values(**member.values))
        free = {key: value for key, value in fields.items() if key not in BY_STARTS}
        base = grid([free.pop("plant")], chosen, ["nominal"], seeds, gains, duration, around)
        scenarios += [dataclasses.replace(scenario, **free).named(name) for scenario in base]
    return scenarios


def verdict(boards: Sequence[Any]) -> str:
    """Return a line for each metric of `smc.leaderboard`: whether one law wins on every parameter set."""
    return "\n".join(f"{board.metric}: {sentence(board)}" for board in boards)


def sentence(board: Any, labels: Mapping[str, str] = frozen({})) -> str:
    """Return whether one law wins on every parameter set, and who wins on how many. `labels`: law -> its label."""
    count = len(board.blocks)
    if board.winner:
        return f"{labels.get(board.winner, board.winner)} wins on all {count} parameter sets"
    wins = Counter(block.winner for block in board.blocks if block.winner).most_common()
    others = ", ".join(f"{labels.get(law, law)} on {number}" for law, number in wins) or "none on any"
    return f"no law wins on all {count} parameter sets ({others})"
