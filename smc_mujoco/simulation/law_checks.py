"""Whether a law suits the plant, the surface and the other fields of a scenario.

Here `s` is a scenario with its defaults, whose module imports this one.
"""

import dataclasses
from collections.abc import Iterable
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.text import joined
from smc_mujoco.control.component import Component, Template, gain_text
from smc_mujoco.control.law import Law, joint_law_catalogue, suits
from smc_mujoco.control.properties import reads
from smc_mujoco.control.surface import Surface
from smc_mujoco.control.written import StateFeedback
from smc_mujoco.mechanisms.plant import Plant

# Fields that no scenario of a free body sets, with their words
NOT_OF_FREE_BODIES = {
    "friction": "friction except on a joint that you name",
    "actuator": "actuator, as its thrusters are its drives",
    "sensor": "sensor, as sensors measure joints",
    "feedforward": "feedforward",
    "clock": "clock with late or missed samples",
    "velocity": "estimated velocity",
}
PARTNER = {"q", "dq", "fq", "gq"}  # fields of a measurement: those of the joint beside
MAX_CONDITION_NUMBER = 1e12  # of a mass matrix; chosen: its inverse has 4 digits


def check_law(s: Any) -> None:
    """Check that the law suits the plant, and the surface the law."""
    check_channels(s)
    check_free_body(s)
    if s.model == "true" and (s.law.joint or s.jump or s.accelerates or s.clock.jitter):
        raise ScenarioError(
            "model 'true' does not go with a law of many joints, a jump, acceleration as u or a "
            "clock with jitter: leave that out, or give model='nominal'"
        )
    for law in s.law.parts:
        if not suits(law, s.plant):
            cure = f"smc-mujoco list --plant {s.plant.argument} lists those for it"
            if s.plant.is_user_model and suits(
                law, dataclasses.replace(s.plant, underactuated=True)
            ):
                cure = "give each channel a partner"
            raise ScenarioError(
                f"law {law.name!r} is only for {', '.join(law.plants)}, not for {s.plant.name}: "
                f"{cure}"
            )
    if s.model != "none" and s.plant.unmodelled:
        raise ScenarioError(f"{s.plant.name} has no nominal model: {s.plant.unmodelled}")
    for law in s.law.parts:
        if s.surface is not None:
            check_surface(s.surface, law)
        period = getattr(law.function, "control_period", None)  # of a discrete controller
        if period is not None and abs(s.control_period - period) > 1e-9 * period:
            raise ScenarioError(
                f"law {law.name!r} is discretised for {period:g} s, and control_period is "
                f"{s.control_period:g} s: give control_period={period:g}, or the controller of "
                "continuous time"
            )


def check_surface(surface: Surface, law: Law) -> None:
    """Check that surface and law both have a sliding variable of relative degree 1."""
    if not law.relative_degree == surface.relative_degree == 1:
        raise ScenarioError(
            f"surface {surface.name!r} has relative degree {surface.relative_degree}, and law "
            f"{law.name!r} {law.relative_degree}: leave the surface out, or give a surface and a "
            "law of relative degree 1"
        )


def check_channels(s: Any) -> None:
    """Check that the law has as many numbers of each gain as channels, and that a law of many
    joints can run.
    """
    for name, value in s.law.gains.items():
        if isinstance(value, tuple) and len(value) != s.plant.driven:
            raise ScenarioError(
                f"gain {name} of {s.law.name} has {len(value)} values, {gain_text(value)}, and "
                f"{s.plant.name} has {s.plant.driven} driven channels: give one number, or "
                f"{s.plant.driven}"
            )
    if not s.law.joint:
        return
    plant = s.plant
    joints = getattr(s.law.function, "joints", s.plant.n)
    sized = f"write it for {plant.n}, with SMC_JOINTS, or --joints of export-c"
    driven = plant.driven
    if isinstance(s.law.function, StateFeedback):
        sized = f"give a K of {driven} x {2 * plant.n}"
        driven = len(s.law.function.K)
    for refused, why in (
        (
            plant.n == 1,
            f"{plant.name} has one: give a law of one channel, such as 'computed_torque'",
        ),
        (
            joints != plant.n,
            f"its code is for {joints}, where {plant.name} has {plant.n}: {sized}",
        ),
        (
            driven != plant.driven,
            f"drives {driven}, where {plant.name} drives {plant.driven}: {sized}",
        ),
        (
            plant.free and s.law.name in joint_law_catalogue(),
            f"drives all of them, and {plant.name} has {plant.free} without an actuator: give a "
            "law of your own, smc.design.lqr or smc.law_from(K)",
        ),
        (
            plant.free and s.model != "none" and not plant.by_mujoco,
            f"{plant.name} has no mass matrix for it: give model='none'",
        ),
        (s.surface is not None, "has its own surface: leave the surface out"),
    ):
        if refused:
            raise ScenarioError(f"law {s.law.name!r} is of many joints, and {why}")


def check_free_body(s: Any) -> None:
    """Check that a law, a signal or a part suits a free body, whose attitude is one thing of three
    numbers.
    """
    if s.plant.pose and s.tracks == "speed":
        raise ScenarioError(
            f"{s.plant.name} is a free body, which tracks a pose: leave tracks='speed' out"
        )
    if s.plant.base >= 0 and s.sensor is not None:
        raise ScenarioError(
            f"the base of {s.plant.name} is measured, and a sensor is of joints: leave sensor out"
        )
    if not s.plant.pose:
        return
    # the law of a trace may have no code
    if not s.law.joint and s.law.name != "none" and s.law.function is not None:
        raise ScenarioError(
            f"law {s.law.name!r} is of one channel, and {s.plant.name} is a free body, whose "
            "channels turn together: give a law of many joints, such as 'geometric'"
        )
    taken = {
        "clock": not s.clock.regular,
        "velocity": s.velocity.name != "measured",
        "friction": not all(part.on for part in s.friction),
    }
    refused = []
    for name, words in NOT_OF_FREE_BODIES.items():
        if taken.get(name, bool(getattr(s, name))):
            refused.append(words)
    if any(d.sees for d in s.disturbance):
        refused.append("disturbance that sees the loop")
    if refused:
        raise ScenarioError(
            f"{s.plant.name} is a free body, which takes no {refused[0]}: leave that out"
        )


def check_inertia(s: Any) -> None:
    """Check that the nominal M of a law of many joints can be inverted at the start."""
    if s.law.joint and s.model != "none" and s.plant.by_mujoco:
        x0 = np.array(s.x0)
        v0 = np.array(s.v0)
        values = s.plant.values({})
        M = s.plant.nominal.dynamics(x0, v0, values).M
        if not np.linalg.cond(M) < MAX_CONDITION_NUMBER:
            raise ScenarioError(
                f"the mass matrix of {s.plant.name} is singular at x0 {shown(s.x0)}, as where two "
                "joints move the same bodies in the same way: drive one of them, or give another "
                "x0"
            )


def blind(plant: Plant, laws: Iterable[Component | Template]) -> str:
    """Return a sentence on the laws of one joint that do not read the joint that nothing drives
    beside theirs, or "".
    """
    if plant.pose or not plant.free:
        return ""
    names = []
    for law in laws:
        template = law if isinstance(law, Template) else law.template
        if template is None or template.joint or template.name == "none":
            continue
        if not reads(template) & PARTNER:
            names.append(law.name)
    if not names:
        return ""
    return (
        f"{joined(dict.fromkeys(names))} of {plant.name} cannot see what nothing drives there, "
        "which may fall or swing on: a law that reads y.q, or one of many joints, can"
    )
