"""Overhead crane: a load that hangs from a trolley, which u pushes: two joints, one force.

    (M + m) x'' - m l cos(q) q'' + m l sin(q) q'^2 = u + d - b x'
    -m l cos(q) x'' + m l^2 q'' + m grav l sin(q) = -bq q'

Channel 0 is the trolley's position x in m. Channel 1, which has no actuator, is the angle q in rad
of the rope from the vertical, with the direction of cart_pole's: the load is at x - l sin(q), to
the left of the trolley if q > 0. The rope is a massless rod and the load a point. b and bq, the
viscous friction of rail and hinge, are 0 by default.
Source: Y. Fang, W. E. Dixon, D. M. Dawson and E. Zergeroglu, Nonlinear coupling control laws for an
underactuated overhead crane system, IEEE/ASME Trans. Mechatronics 8(3):418, 2003: its equation in a
plane, and numbers like those of its testbed.
"""

from math import cos, sin

from smc_mujoco.mechanisms.geometry import cart
from smc_mujoco.mechanisms.plant import Field, Plant, geom_fields, model_spec

HOOK_HEIGHT = 0.095  # m, height of the hook above the load's middle
STOP_X = 1.7  # m, |x| at the end stops: chosen, before the bridge's ends


def build(n):
    return model_spec("overhead_crane.xml")


def fields(model, p):
    load = model.body("load").id
    yield Field("body_mass", model.body("cart").id, p.M)
    yield Field("body_mass", load, p.m)
    yield Field("body_ipos", load, (0.0, 0.0, -p.l))
    yield Field("dof_damping", model.joint("slide").dofadr[0], p.b)
    yield Field("dof_damping", model.joint("hinge").dofadr[0], p.bq)
    yield Field("opt.gravity", 2, -p.grav)
    yield from geom_fields(model, "rod", (0.0, 0.0, -p.l / 2), (1, p.l / 2))
    yield from geom_fields(model, "bob", (0.0, 0.0, -p.l))
    yield from geom_fields(model, "hook", (0.0, 0.0, HOOK_HEIGHT - p.l))


def nominal(x, v, i, p):
    lever = -p.m * p.l * cos(x[1])
    inertia = p.m * p.l * p.l
    determinant = (p.M + p.m) * inertia - lever * lever
    along = -p.m * p.l * sin(x[1]) * v[1] * v[1] - p.b * v[0]
    about = -p.m * p.grav * p.l * sin(x[1]) - p.bq * v[1]
    if i == 0:
        return (inertia * along - lever * about) / determinant, inertia / determinant
    return ((p.M + p.m) * about - lever * along) / determinant, -lever / determinant


def stops(spec):
    cart.stops(spec, STOP_X)


OVERHEAD_CRANE = Plant(
    name="overhead_crane",
    # kg, kg, m, N s/m, N m s/rad, m/s^2
    parameters={"M": 1.06, "m": 0.73, "l": 0.7, "b": 0.0, "bq": 0.0, "grav": 9.81},
    mass="m",
    unit="m",
    mixed=("m", "rad"),
    x0=(1.0, 0.0),
    n=2,
    sizes=(2, 2),
    build=build,
    fields=fields,
    nominal=nominal,
    contacts={"stops": stops},
    underactuated=True,
)
