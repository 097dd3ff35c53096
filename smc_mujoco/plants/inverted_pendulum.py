"""Inverted pendulum: m l^2 x'' = m grav l sin x - b x' + u + d, x the angle from upright.

A point mass on a massless rod, driven at the pivot: the pendulum of H. K. Khalil, Nonlinear Systems, 2002,
section 1.2.1, its angle counted from the top. Numbers: chosen for the paper study.
"""

from math import sin

import mujoco

from smc_mujoco.plant import Field, Plant, model_path


def build(n):
    return mujoco.MjSpec.from_file(str(model_path("inverted_pendulum.xml")))


def fields(model, p):
    body = model.body("pendulum").id
    yield Field("body_mass", body, p.m)
    yield Field("body_ipos", body, (0.0, 0.0, p.l))
    yield Field("dof_damping", model.joint("hinge").dofadr[0], p.b)
    yield Field("opt.gravity", 2, -p.grav)
    yield Field("geom_pos", model.geom("rod").id, (0.0, 0.0, p.l / 2))
    yield Field("geom_size", (model.geom("rod").id, 1), p.l / 2)
    yield Field("geom_pos", model.geom("bob").id, (0.0, 0.0, p.l))


def nominal(x, v, i, p):
    inertia = p.m * p.l**2
    return (p.m * p.grav * p.l * sin(x[i]) - p.b * v[i]) / inertia, 1.0 / inertia


INVERTED_PENDULUM = Plant(
    name="inverted_pendulum",
    parameters={"m": 0.5, "l": 0.5, "b": 0.02, "grav": 9.81},  # kg, m, N m s/rad, m/s^2
    mass="m",
    unit="rad",
    x0=(0.5,),
    build=build,
    fields=fields,
    nominal=nominal,
    lane=(1.3, 0.0, 0.0),
)
