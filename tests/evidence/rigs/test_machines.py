"""The machines that ship: their numbers, sources and words as recorded, and a quantity that each of
them feels.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.control.component import Component
from smc_mujoco.identification.published_rig import PublishedRig
from smc_mujoco.identification.rig import Quantity, Values
from smc_mujoco.mechanisms.plant import Plant

pytestmark = pytest.mark.quick

MACHINES = (
    *(
        "emps",
        "qube_servo",
        "qube_servo_2",
        "qube_servo_3",
        "realaigym_acrobot",
        "simple_pendulum_ak80",
    ),
    *("srv02", "stepper_furuta"),
)


def reported(value):
    """Return a value of a rig as text: what its plant, laws and parts differ in from their
    defaults.
    """
    match value:
        case Quantity():
            text = f"{value.value:.9g} {value.unit} in [{value.least:.9g}, {value.most:.9g}]"
        case Plant():
            text = f"{value.name} {reported(value.parameters)}"
        case Component():
            text = f"{value.name} {reported(value.gains)}, {value.source}"
        case Mapping():
            text = (
                "{" + ", ".join(f"{name}: {reported(part)}" for name, part in value.items()) + "}"
            )
        case tuple():
            text = f"({', '.join(map(reported, value))})"
        case float():
            text = f"{value:.9g}"
        case _ if dataclasses.is_dataclass(value):
            parts = {}
            for field in dataclasses.fields(value):
                parts[field.name] = getattr(value, field.name)
            plain = {field.name: field.default for field in dataclasses.fields(value)}
            text = (
                f"{type(value).__name__} "
                f"{reported({key: part for key, part in parts.items() if part is not plain[key]})}"
            )
        case _:
            text = "a function" if callable(value) else str(value)
    return text


def lines(rig):
    """Yield a line for each source with its quantities, for each other field of a rig, and for its
    scenarios.
    """
    sources: dict[str, list[str]] = {}
    for name, quantity in rig.quantities.items():
        sources.setdefault(quantity.source, []).append(f"{name} {reported(quantity)}")
    yield from (f"{source}: {'; '.join(quantities)}" for source, quantities in sources.items())
    for field in dataclasses.fields(PublishedRig):
        value = getattr(rig, field.name)
        if field.name not in ("quantities", "machine") and value:
            if field.name in ("ensemble", "laws", "reached"):
                parts = value
            else:
                parts = (value,)
            yield from (f"{field.name}: {reported(part)}" for part in parts)
    parts = (f"{name}: {reported(part)}" for name, part in machine(rig).items())
    yield f"scenario {'; '.join(parts)}"
    if rig.dynamics:
        yield f"dynamics: {reported(rig.dynamics(Values(**rig.values)))}"


def machine(rig):
    return rig.machine(Values(**rig.values))


@pytest.mark.parametrize("name", MACHINES)
def test_the_numbers_of_a_machine_and_their_sources_are_as_recorded(name, snapshot):
    assert "\n".join(lines(smc.rig(name))) == snapshot


@pytest.mark.parametrize("name", smc.rigs())
def test_each_quantity_changes_the_machine(name):
    """From values where no term is 0."""
    rig = smc.rig(name)
    ends = {
        key: np.clip([quantity.value, 2 * quantity.value, 0.01], quantity.least, quantity.most)
        for key, quantity in rig.quantities.items()
    }
    rig = rig.with_values({key: float(clipped[1] or clipped[2]) for key, clipped in ends.items()})
    for key in rig.quantities:
        halved = rig.with_values({key: 0.5 * rig.values[key]})
        assert reported(machine(halved)) != reported(machine(rig)), key
