"""Duffing oscillator: M x'' = -delta x' - alpha x - beta x^3 + u + d  (alpha < 0: two wells).

The joint's polynomial spring is the restoring force, exactly. Wells at +-sqrt(-alpha/beta).
Source: G. Duffing, Erzwungene Schwingungen bei veraenderlicher Eigenfrequenz, 1918. Numbers: chosen
for the
paper study, so that the wells lie at +-1 m.

Mechanism `springs`: two springs of stiffness k and rest length L from the cart to anchors at a
distance a on either side, V = k (sqrt(x^2 + a^2) - L)^2, which snaps through. L^2 = a^2 -
alpha/beta and k = beta L^2 give the wells their positions and their stiffness -2 alpha. The hill
between them is 19 % too high for a = 1.5 m.
"""

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.geometry import cart, coil
from smc_mujoco.mechanisms.hardware.contact import bar
from smc_mujoco.mechanisms.plant import Field, Plant, Variant, model_spec

# m, a: chosen, so that the springs are visible and the wells have nearly the equation's shape
ANCHOR_Y = 1.5
SPRING_Z = 0.45  # m, height of the springs above the floor, over the block and the landscape
# m, |x| at the end stops and x at the post: chosen, outside x0, and between x0 and 0
STOP_X, PEG_X = (1.7, 0.5)
HALF_RAIL = 2.07  # m, half the length of the rail between its posts


def build(n):
    return model_spec("duffing.xml")


def fields(model, p):
    joint = model.joint("slide").id
    yield from body_fields(model, p)
    yield Field("jnt_stiffness", joint, p.alpha)
    yield Field("jnt_stiffnesspoly", joint, (0.0, p.beta))


def body_fields(model, p):
    yield Field("body_mass", model.body("cart").id, p.M)
    yield Field("dof_damping", model.joint("slide").dofadr[0], p.delta)


def nominal(x, v, i, p):
    return (-p.delta * v[i] - p.alpha * x[i] - p.beta * x[i] ** 3) / p.M, 1.0 / p.M


def on_floor(spec):
    cart.bed(spec, HALF_RAIL)
    stops(spec)


def stops(spec):
    cart.stops(spec, STOP_X)


def peg(spec):
    cart.peg(spec, PEG_X)


def add_springs(spec):
    machine = spec.body("machine")
    body = spec.body("cart")
    joint = spec.joint("slide")
    up = SPRING_Z - body.pos[2]
    joint.stiffness = [0.0, 0.0, 0.0]
    bar(body, "spring_post", ((0, 0, 0.13), (0, 0, up + 0.03)), 0.022, "steel")
    body.add_site(name="snap", pos=(0, 0, up))
    for side, y in (("front", -ANCHOR_Y), ("back", ANCHOR_Y)):
        bar(machine, f"{side}_anchor_foot", ((0, y, 0), (0, y, 0.028)), 0.13, "graphite")
        bar(machine, f"{side}_anchor", ((0, y, 0.028), (0, y, SPRING_Z + 0.03)), 0.028, "graphite")
        machine.add_site(name=f"{side}_anchor", pos=(0, y, SPRING_Z))
        spring = spec.add_tendon(name=f"{side}_spring", group=5, rgba=(0, 0, 0, 0))
        spring.wrap_site(f"{side}_anchor")
        spring.wrap_site("snap")
        ends = ("machine", (0, 0, 0), (0, y, SPRING_Z)), ("cart", body.pos, (0, 0, SPRING_Z))
        coil.draw(spec, f"{side}_coil", *ends, radius=0.04, turns=24, wire=0.008, material="brass")


def spring_fields(model, p):
    if p.beta > 0.0:
        rest = ANCHOR_Y**2 - p.alpha / p.beta
    else:
        rest = 0.0
    if rest <= 0.0:
        given = f"alpha {p.alpha:g} with beta {p.beta:g}"
        raise ScenarioError(
            f"duffing has no springs for {given}: give beta > 0 and alpha < {ANCHOR_Y**2:g} beta"
        )
    springs = [model.tendon("front_spring").id, model.tendon("back_spring").id]
    yield from body_fields(model, p)
    yield Field("tendon_stiffness", springs, p.beta * rest)
    yield Field("tendon_lengthspring", springs, rest**0.5)


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
    mechanisms={"springs": Variant(add_springs, spring_fields)},
)
