"""Van der Pol oscillator: M x'' = mu (1 - x^2) x' - k x + u + d  (a limit cycle of amplitude 2 m).

The joint gives -k x + mu x', a damper across the rail gives -mu x^2 x' to 4e-12: see models/van_der_pol.xml.
Source: B. van der Pol, On relaxation-oscillations, 1926. Numbers: chosen for the paper study.
"""

import mujoco

from smc_mujoco import coil
from smc_mujoco.plant import Field, Plant, model_path


def build(n):
    spec = mujoco.MjSpec.from_file(str(model_path("van_der_pol.xml")))
    rail = spec.body("cart").pos[2]
    for name, side in (("left_spring", -1), ("right_spring", 1)):
        coil.draw(
            spec,
            name,
            start=("machine", (0, 0, 0), (side * 2.57, 0, rail)),
            end=("cart", (0, 0, rail), (side * 0.175, 0, rail)),
            radius=0.05,
            turns=20,
            wire=0.010,
            material="brass",
        )
    return spec


def fields(model, p):
    dof = model.joint("slide").dofadr[0]
    far = model.site("far")
    yield Field("body_mass", model.body("cart").id, p.M)
    yield Field("dof_M0", dof, p.M)  # MuJoCo reads a lone slide's inertia here
    yield Field("jnt_stiffness", model.joint("slide").id, p.k)
    yield Field("dof_damping", dof, -p.mu)
    yield Field("tendon_damping", model.tendon("across").id, p.mu * model.site_pos[far.id, 1] ** 2)


def nominal(x, v, i, p):
    return (p.mu * (1.0 - x[i] ** 2) * v[i] - p.k * x[i]) / p.M, 1.0 / p.M


VAN_DER_POL = Plant(
    name="van_der_pol",
    parameters={"M": 1.0, "mu": 1.0, "k": 1.0},  # kg, N s/m, N/m
    mass="M",
    unit="m",
    x0=(2.0,),
    build=build,
    fields=fields,
    nominal=nominal,
    lane=(0.0, 0.9, 0.0),
)
