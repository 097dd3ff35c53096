"""Van der Pol oscillator: M x'' = mu (1 - x^2) x' - k x + u + d  (a limit cycle of amplitude 2 m).

The joint gives -k x + mu x', a damper across the rail gives -mu x^2 x' to 4e-12: see
models/van_der_pol.xml.
Source: B. van der Pol, On relaxation-oscillations, 1926. Numbers: chosen for the paper study.
"""

from smc_mujoco.mechanisms.geometry import cart, coil
from smc_mujoco.mechanisms.plant import Field, Plant, model_spec

POST_END, CART_END = 2.57, 0.175  # m, |x| of the springs' ends on the posts and on the cart
SPRINGS = (("left_spring", -1), ("right_spring", 1))
# m, |x| at end stops and x at the post: chosen, outside the limit cycle, and between x0 and 0
STOP_X = 2.2
PEG_X = 0.5


def build(n):
    spec = model_spec("van_der_pol.xml")
    draw_springs(spec, spec.body("cart").pos[2], 0.05)
    return spec


def draw_springs(spec, height, radius):
    for name, side in SPRINGS:
        start = "machine", (0, 0, 0), (side * POST_END, 0, height)
        end = "cart", (0, 0, cart.RAIL_Z), (side * CART_END, 0, height)
        coil.add_coil(spec, name, start, end, radius=radius, turns=20, wire=0.010, material="brass")


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
)
