"""Duffing oscillator: M x'' = -delta x' - alpha x - beta x^3 + u + d  (alpha < 0: two wells).

The joint's polynomial spring is the restoring force, exactly. Wells at +-sqrt(-alpha/beta).
Source: G. Duffing, Erzwungene Schwingungen bei veraenderlicher Eigenfrequenz, 1918. Numbers: chosen for the
paper study, so that the wells lie at +-1 m.
"""

import mujoco

from smc_mujoco.plant import Field, Plant, model_path


def build(n):
    return mujoco.MjSpec.from_file(str(model_path("duffing.xml")))


def fields(model, p):
    joint, dof = model.joint("slide").id, model.joint("slide").dofadr[0]
    yield Field("body_mass", model.body("cart").id, p.M)
    yield Field("dof_M0", dof, p.M)  # MuJoCo reads a lone slide's inertia here
    yield Field("dof_damping", dof, p.delta)
    yield Field("jnt_stiffness", joint, p.alpha)
    yield Field("jnt_stiffnesspoly", joint, (0.0, p.beta))


def nominal(x, v, i, p):
    return (-p.delta * v[i] - p.alpha * x[i] - p.beta * x[i] ** 3) / p.M, 1.0 / p.M


DUFFING = Plant(
    name="duffing",
    parameters={"M": 1.0, "delta": 0.2, "alpha": -1.0, "beta": 1.0},  # kg, N s/m, N/m, N/m^3
    mass="M",
    unit="m",
    x0=(1.5,),
    build=build,
    fields=fields,
    nominal=nominal,
    lane=(0.0, 1.0, 0.0),
)
