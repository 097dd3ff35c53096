"""Van der Pol oscillator: M x'' = mu (1 - x^2) x' - k x + u + d  (a limit cycle of amplitude 2 m).

The joint gives -k x + mu x', a damper across the rail gives -mu x^2 x' to 4e-12: see
models/van_der_pol.xml.
Source: B. van der Pol, On relaxation-oscillations, 1926. Numbers: chosen for the paper study.

Mechanism `springs`: two springs of stiffness k/2 along the rail, a motor in the cart that pushes
with +mu x', and a damper c to an anchor at a distance h to the side, which pushes with -c x^2/(x^2
+ h^2) x'. c = mu (1 + h^2) puts the change of sign at |x| = 1. Further out the damper is weaker
than mu x^2, by 23 % at 2 m for h = 3 m, and the limit cycle reaches 2.12 m.
"""

import mujoco

from smc_mujoco.mechanisms.geometry import cart, coil
from smc_mujoco.mechanisms.hardware.contact import bar
from smc_mujoco.mechanisms.plant import Field, Plant, Variant, model_spec

ANCHOR_Y = 3.0  # m, h: chosen, so that the limit cycle stays inside the stops
DAMPER_Z = 0.45  # m, height of the damper above the floor, over the block
POST_END, CART_END = 2.57, 0.175  # m, |x| of the springs' ends on the posts and on the cart
REST_LENGTH = 0.35  # m, their rest length: chosen, so that both pull while |x| < 2.045 m
SPRINGS = (("left_spring", -1), ("right_spring", 1))
# m, |x| at end stops and x at the post: chosen, outside the limit cycle, and between x0 and 0
STOP_X, PEG_X = (2.2, 0.5)


def build(n):
    spec = model_spec("van_der_pol.xml")
    draw_springs(spec, spec.body("cart").pos[2], 0.05)
    return spec


def draw_springs(spec, height, radius):
    for name, side in SPRINGS:
        start = "machine", (0, 0, 0), (side * POST_END, 0, height)
        end = "cart", (0, 0, cart.RAIL_Z), (side * CART_END, 0, height)
        coil.draw(spec, name, start, end, radius=radius, turns=20, wire=0.010, material="brass")


def fields(model, p):
    far = model.site("far")
    yield Field("body_mass", model.body("cart").id, p.M)
    yield Field("jnt_stiffness", model.joint("slide").id, p.k)
    yield Field("dof_damping", model.joint("slide").dofadr[0], -p.mu)
    yield Field("tendon_damping", model.tendon("across").id, p.mu * model.site_pos[far.id, 1] ** 2)


def nominal(x, v, i, p):
    return (p.mu * (1.0 - x[i] ** 2) * v[i] - p.k * x[i]) / p.M, 1.0 / p.M


def on_floor(spec):
    cart.bed(spec, POST_END)
    for name, _ in SPRINGS:
        spec.delete(next(skin for skin in spec.skins if skin.name == name))
    draw_springs(spec, cart.MIDDLE_Z, 0.040)
    stops(spec)


def stops(spec):
    cart.stops(spec, STOP_X)


def peg(spec):
    cart.peg(spec, PEG_X)


def add_springs(spec):
    machine = spec.body("machine")
    body = spec.body("cart")
    joint = spec.joint("slide")
    joint.stiffness = [0.0, 0.0, 0.0]
    joint.damping = [0.0, 0.0, 0.0]
    for name, side in SPRINGS:
        machine.add_site(name=f"{name}_post", pos=(side * POST_END, 0, cart.RAIL_Z))
        body.add_site(name=f"{name}_cart", pos=(side * CART_END, 0, 0))
        spring = spec.add_tendon(
            name=name, springlength=(REST_LENGTH, REST_LENGTH), group=5, rgba=(0, 0, 0, 0)
        )
        spring.wrap_site(f"{name}_post")
        spring.wrap_site(f"{name}_cart")
    spec.site("far").pos, spec.site("near").pos = (
        (0, ANCHOR_Y, DAMPER_Z),
        (0, 0, DAMPER_Z - cart.RAIL_Z),
    )
    motor = spec.add_actuator(
        name="passive:active_damper", target="slide", trntype=mujoco.mjtTrn.mjTRN_JOINT
    )
    motor.gaintype = mujoco.mjtGain.mjGAIN_FIXED
    motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    motor.gainprm[0] = 0.0  # takes no command
    bar(body, "damper_post", ((0, 0, 0.13), (0, 0, DAMPER_Z - cart.RAIL_Z + 0.03)), 0.022, "steel")
    bar(machine, "damper_foot", ((0, ANCHOR_Y, 0), (0, ANCHOR_Y, 0.028)), 0.13, "graphite")
    bar(
        machine,
        "damper_anchor",
        ((0, ANCHOR_Y, 0.028), (0, ANCHOR_Y, DAMPER_Z + 0.03)),
        0.028,
        "graphite",
    )
    ends = ("machine", (0, 0, 0), (0, ANCHOR_Y, DAMPER_Z)), ("cart", body.pos, (0, 0, DAMPER_Z))
    coil.tube(spec, "damper_rod", *ends, span=(0.0, 1.0), radius=0.010, material="steel")
    coil.tube(spec, "damper_barrel", *ends, span=(0.12, 0.55), radius=0.034, material="graphite")


def spring_fields(model, p):
    springs = [model.tendon(name).id for name, _ in SPRINGS]
    yield Field("body_mass", model.body("cart").id, p.M)
    yield Field("tendon_stiffness", springs, 0.5 * p.k)
    yield Field("tendon_damping", model.tendon("across").id, p.mu * (1.0 + ANCHOR_Y**2))
    yield Field("actuator_biasprm", (model.actuator("passive:active_damper").id, 2), p.mu)


VAN_DER_POL = Plant(
    name="van_der_pol",
    label="Van der Pol oscillator",
    short="Van der Pol",
    parameters={"M": 1.0, "mu": 1.0, "k": 1.0},  # kg, N s/m, N/m
    mass="M",
    unit="m",
    x0=(2.0,),
    build=build,
    fields=fields,
    nominal=nominal,
    jumps={"mild": {"mu": 3.0}, "hard": {"mu": 9.0}},
    contacts={"floor": on_floor, "stops": stops, "peg": peg},
    mechanisms={"springs": Variant(add_springs, spring_fields)},
)
