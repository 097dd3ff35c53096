"""Cart on a spring: M x'' = -k x - b x' + u + d.

The mechanism is models/sprung_cart.xml. The numbers are chosen for this template.
"""

from pathlib import Path

import mujoco

from smc_mujoco.mechanisms.plant import Field, Plant

MODEL = Path(__file__).parent / "models" / "sprung_cart.xml"


def build(n):
    return mujoco.MjSpec.from_file(str(MODEL))


def fields(model, p):
    yield Field("body_mass", model.body("cart").id, p.M)
    yield Field("jnt_stiffness", 0, p.k)
    yield Field("dof_damping", 0, p.b)


def nominal(x, v, i, p):
    return (-p.b * v[i] - p.k * x[i]) / p.M, 1.0 / p.M


SPRUNG_CART = Plant(
    name="sprung_cart",
    parameters={"M": 2.0, "k": 8.0, "b": 0.5},  # kg, N/m, N s/m
    mass="M",
    unit="m",
    x0=(0.3,),
    build=build,
    fields=fields,
    nominal=nominal,
)
