"""Cart-pole: an inverted pole, free on a cart that u pushes: two joints, one force.

    (M + m) x'' + m l cos(q) q'' - m l sin(q) q'^2 = u + d - b x'
    m l cos(q) x'' + (4/3) m l^2 q'' - m grav l sin(q) = -bq q'

Channel 0 is the cart's position x in m. Channel 1, which has no actuator, is the angle q in rad of
the pole from upright, positive to the right. The pole is uniform, and l is half its length. b and
bq, the viscous friction of rail and hinge, are 0 by default.
Source: A. G. Barto, R. S. Sutton and C. W. Anderson, Neuronlike adaptive elements that can solve
difficult learning control problems, IEEE Trans. Systems, Man, and Cybernetics 13(5):834, 1983,
appendix: masses and length. Its friction (5e-4 N on the rail, 2e-6 N m s at the hinge) is left out.
"""

from math import cos, sin

from smc_mujoco.mechanisms.geometry import cart
from smc_mujoco.mechanisms.plant import Field, Plant, geom_fields, model_spec

MIN_INERTIA = 1e-13  # kg m^2, the pole's inertia about its own length, about which it never turns
BEFORE = -0.35  # m along the hinge: the pole is drawn before the rail and its scale
STOP_X = 1.7  # m, |x| at the end stops: chosen, before the posts


def build(n):
    return model_spec("cart_pole.xml")


def fields(model, p):
    pole = model.body("pole").id
    across = p.m * p.l**2 / 3
    yield Field("body_mass", model.body("cart").id, p.M)
    yield Field("body_mass", pole, p.m)
    yield Field("body_ipos", pole, (0.0, 0.0, p.l))
    yield Field("body_inertia", pole, (across, across, MIN_INERTIA))
    yield Field("dof_damping", model.joint("slide").dofadr[0], p.b)
    yield Field("dof_damping", model.joint("hinge").dofadr[0], p.bq)
    yield Field("opt.gravity", 2, -p.grav)
    yield from geom_fields(model, "rod", (0.0, BEFORE, p.l), (1, p.l))
    yield from geom_fields(model, "tip", (0.0, BEFORE, 2 * p.l))


def nominal(x, v, i, p):
    lever = p.m * p.l * cos(x[1])
    inertia = p.m * p.l * p.l * 4.0 / 3.0
    determinant = (p.M + p.m) * inertia - lever * lever
    along = p.m * p.l * sin(x[1]) * v[1] * v[1] - p.b * v[0]
    about = p.m * p.grav * p.l * sin(x[1]) - p.bq * v[1]
    if i == 0:
        return (inertia * along - lever * about) / determinant, inertia / determinant
    return ((p.M + p.m) * about - lever * along) / determinant, -lever / determinant


def stops(spec):
    cart.stops(spec, STOP_X)


CART_POLE = Plant(
    name="cart_pole",
    # kg, kg, m, N s/m, N m s/rad, m/s^2
    parameters={"M": 1.0, "m": 0.1, "l": 0.5, "b": 0.0, "bq": 0.0, "grav": 9.81},
    mass="M",
    unit="m",
    mixed=("m", "rad"),
    x0=(0.0, 0.3),
    n=2,
    sizes=(2, 2),
    build=build,
    fields=fields,
    nominal=nominal,
    contacts={"stops": stops},
    underactuated=True,
)
