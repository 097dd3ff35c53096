"""Which parts of a scenario the callback simulates, and which of them exactly.

Here `s` is a Scenario, which imports this module.
"""

from typing import Any

from smc_mujoco.mechanisms.hardware.drives import in_series
from smc_mujoco.mechanisms.hardware.friction import DryFriction
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.mechanisms.hardware.rotors import Rotors, flies
from smc_mujoco.mechanisms.hardware.tendons import of_plant
from smc_mujoco.mechanisms.layout import moves_alone
from smc_mujoco.simulation.signals import Push


def plain_equation(s: Any) -> bool:
    """Return whether MuJoCo integrates only the plant's equation, with or without drives."""
    if s.friction or s.contact or s.mechanism != "equation":
        return False
    smooth = s.plant.smooth and not s.plant.rubs
    return smooth and all(part.smooth for part in s.actuator)


def exact_parts(s: Any) -> tuple[Part, ...]:
    """Return the parts whose dry friction is exact, see `Scenario.exact_friction`."""
    dry = []
    for part in s.friction:
        if not part.smooth:
            dry.append(part.exact)
    if s.plant.rubs:
        dry.append(DryFriction())
    exact = tuple(dict.fromkeys(dry))
    # the dry friction in the model is of all joints, and takes no formula beside it
    if not exact or None in exact or (len(exact) > 1 and DryFriction() in exact):
        return ()
    if s.contact or s.mechanism != "equation":
        return ()
    if s.integrator not in (None, "RK4") or not moves_alone(s.plant) or of_plant(s.plant):
        return ()
    if any(isinstance(d, Push) for d in s.disturbance):
        return ()
    for actuator in s.actuator:
        if not all(part.behind(actuator) for part in exact):
            return ()
    return exact


def acting(s: Any) -> tuple[tuple[Part, str], ...]:
    """Return the parts that the callback simulates, in the order in which they act, with what they
    do, see `Scenario.acting`.
    """
    drives: list[Part] = [Rotors()] if flies(s.plant) else []
    if tendons := of_plant(s.plant):
        drives.append(tendons)
    defaults = s.resolved
    chains = s.drive_train.chains
    drives += in_series(chains, defaults.physics_step, defaults.integrator == "RK4")
    acting = []
    for part in (*drives, *s.actuator):
        if part.act is not None:
            acting.append((part, "act"))
        elif part.force is not None:
            acting.append((part, "force"))
    for part in s.friction:
        if part in s.exact_parts:
            continue
        for kind in ("force", "brake"):
            if getattr(part, kind) is not None:
                acting.append((part, kind))
    for part in s.exact_parts:
        acting.append((part, "stage_force"))
    return tuple(acting)
