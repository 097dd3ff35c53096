"""Which engine runs a scenario on a device: the plant decides.

A plant with an equation runs in the fast engine's loop, on both devices. On a CUDA device MuJoCo
Warp runs many other plants, in worlds; MuJoCo runs the rest.
"""

from collections.abc import Sequence

from smc_mujoco.analysis.engine import group, worlds
from smc_mujoco.analysis.engine.group import FormGroup
from smc_mujoco.simulation.scenario import Scenario


def chosen(
    scenario: Scenario, metrics: Sequence[str], device: str, many: bool = True
) -> tuple[type[FormGroup] | None, str]:
    """Return the kind of group that runs a scenario on a device, "cpu" or "cuda", and ""; or None
    and why MuJoCo has to run it, in one sentence.

    MuJoCo Warp needs about as long for one world as for a thousand, so it is chosen only for `many`
    runs at once.
    """
    why = group.why_not(scenario, metrics, device)
    if not why:
        return FormGroup, ""
    if device == "cuda" and many:
        why = worlds.why_not(scenario, metrics) or _of_model(scenario)
        if not why:
            return worlds.WorldGroup, ""
    return None, why


def _of_model(scenario: Scenario) -> str:
    from smc_mujoco.analysis.engine import warp

    return warp.why_not(scenario)
