"""Every plant says of itself what is recorded, and its machine looks so, with each contact and
other mechanism.

Tests of the equation do not see what is only drawn, nor names, scales of jumps, limits and places
in a film. Of a contact or another mechanism the record has what it changes. What is added to the
catalogue is tested once it is recorded.
"""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.words import recorded

from smc_mujoco.common.mjcb import compiled_spec
from smc_mujoco.common.rebuild import rebuild
from smc_mujoco.mechanisms.plant import plant, plant_catalogue, write_fields

PLANTS = {
    name: machine_of_name if machine_of_name.n == machine_of_name.sizes[0] else plant(name, n=12)
    for name, machine_of_name in plant_catalogue().items()
}
NOT_READ = {"reach", "friction", "n", "contacts", "mechanisms"}
PHYSICS = {  # what blows and springs are made of
    "body": ("pos", "quat", "mass", "inertia"),
    "geom": ("pos", "quat", "size", "type", "contype"),
    "pair": ("friction", "solref", "solimp", "dim"),
    "tendon": ("stiffness", "damping", "lengthspring"),
    "jnt": ("stiffness", "range"),
    "dof": ("damping", "armature", "frictionloss"),
    "site": ("pos",),
    "key": ("qpos",),
    "actuator": ("biasprm", "ctrlrange"),
}
SEEN = {
    "geom": ("rgba", "matid", "group"),
    "skin": ("vert", "matid"),
    "site": ("group",),
    "cam": ("pos", "quat"),
}


def moved(value):
    return 1.07 * value if value else 0.3


def said(one):
    """What the rest of the package reads of a plant, except its functions."""
    fields = {}
    for field in dataclasses.fields(one):
        fields[field.name] = getattr(one, field.name)
    plain = {}
    for name, value in fields.items():
        if not callable(value) and name not in NOT_READ:
            plain[name] = value
    return ", ".join(
        f"{name} {value}" for name, value in plain.items() if value not in ((), {}, "", False)
    )


def parameters(one):
    """The plant's parameters, each moved."""
    return SimpleNamespace(**{name: moved(value) for name, value in one.parameters.items()})


def equation(one):
    """A weighted sum of f and g of all channels in one state."""
    nominal, (x, v) = (
        rebuild(one.nominal, lambda plain: plain),
        np.random.default_rng(3).uniform(-1.0, 1.0, (2, one.n)),
    )
    return f"f and g {weighed([nominal(x, v, i, parameters(one)) for i in range(one.n)])}"


def machine(one, how):
    """What a plant's file and its code name, and the compiled model with each parameter moved."""
    spec = one.spec()
    fields = one.fields
    values = parameters(one)
    if how in one.contacts:
        one.contacts[how](spec)
    if how in one.mechanisms:
        one.mechanisms[how].edit(spec)
        fields = one.mechanisms[how].fields
    kinds = (
        spec.bodies,
        spec.geoms,
        spec.joints,
        spec.sites,
        spec.tendons,
        spec.skins,
        spec.actuators,
        spec.sensors,
    )
    names = []
    for kind in kinds:
        for joint_kind in kind:
            if joint_kind.name:
                names.append(joint_kind.name)
    model = compiled_spec(spec)
    write_fields(model, fields(model, values))
    return names, model


def sizes(model):
    """What moves a machine, and what is only seen of it, in a number each: to see that one has
    changed, not which.
    """
    parts = [[[*model.opt.gravity]], [[*model.stat.center, model.stat.extent]]]
    for counts, arrays in zip(parts, (PHYSICS, SEEN), strict=True):
        counts += [
            getattr(model, f"{kind}_{array}") for kind, names in arrays.items() for array in names
        ]
    return [
        weighed(np.concatenate([np.ravel(np.asarray(array, float)) for array in counts]))
        for counts in parts
    ]


def weighed(array):
    values = np.asarray(array, float).ravel()
    return (
        f"{values @ np.random.default_rng(values.size).uniform(0.5, 1.5, values.size) + 0.0:.10g}"
    )


@pytest.mark.quick
@pytest.mark.parametrize("name", recorded(__file__, PLANTS))
def test_a_machine_says_and_shows_what_is_recorded(name, snapshot):
    machine_plant = PLANTS[name]
    lines = [said(machine_plant), equation(machine_plant)]
    for how in ("alone", *machine_plant.contacts, *machine_plant.mechanisms):
        names, model = machine(machine_plant, how)
        lines.append(f"{how}: {len(names)} names, {' '.join(sizes(model))}")
    assert "\n".join(lines) == snapshot
