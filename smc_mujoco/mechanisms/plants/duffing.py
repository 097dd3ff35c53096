"""Duffing oscillator: M x'' = -delta x' - alpha x - beta x^3 + u + d  (alpha < 0: two wells).

The joint's polynomial spring is the restoring force, exactly. Wells at +-sqrt(-alpha/beta).
Source: G. Duffing, Erzwungene Schwingungen bei veraenderlicher Eigenfrequenz, 1918. Numbers: chosen
for the paper study, so that the wells lie at +-1 m.
"""

from smc_mujoco.mechanisms.geometry import cart
from smc_mujoco.mechanisms.plant import Field, Plant, model_spec

# m, |x| at the end stops and x at the post: chosen, outside x0, and between x0 and 0
STOP_X = 1.7
PEG_X = 0.5
HALF_RAIL = 2.07  # m, half the length of the rail between its posts


def build(n):
    return model_spec("duffing.xml")


def fields(model, p):
    joint = model.joint("slide").id
    yield Field("body_mass", model.body("cart").id, p.M)
    yield Field("dof_damping", model.joint("slide").dofadr[0], p.delta)
    yield Field("jnt_stiffness", joint, p.alpha)
    yield Field("jnt_stiffnesspoly", joint, (0.0, p.beta))


def nominal(x, v, i, p):
    return (-p.delta * v[i] - p.alpha * x[i] - p.beta * x[i] ** 3) / p.M, 1.0 / p.M


def on_floor(spec):
    cart.bed(spec, HALF_RAIL)
    stops(spec)


def stops(spec):
    cart.stops(spec, STOP_X)


def peg(spec):
    cart.peg(spec, PEG_X)


DUFFING = Plant(
    name="duffing",
    label="Duffing oscillator",
    short="Duffing",
    parameters={"M": 1.0, "delta": 0.2, "alpha": -1.0, "beta": 1.0},  # kg, N s/m, N/m, N/m^3
    mass="M",
    unit="m",
    x0=(1.5,),
    build=build,
    fields=fields,
    nominal=nominal,
    jumps={"mild": {"alpha": 3.0}, "hard": {"alpha": 27.684}},
    contacts={"floor": on_floor, "stops": stops, "peg": peg},
)
