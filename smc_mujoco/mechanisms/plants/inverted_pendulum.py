"""Inverted pendulum: m l^2 x'' = m grav l sin x - b x' + u + d, x the angle from upright.

A point mass on a massless rod, driven at the pivot: the pendulum of H. K. Khalil, Nonlinear
Systems, 2002,
section 1.2.1, its angle counted from the top. Numbers: chosen for the paper study.

Contacts, with a geometry for l = 0.5 m: the `floor` that a failed pendulum falls on, padded
`stops`, a hard `wall` on the right, and a `peg` on the dial that the rod hits on its way up from
the right.
"""

from math import asin, cos, sin

from smc_mujoco.mechanisms.hardware.contact import bar, box, hit, solid
from smc_mujoco.mechanisms.plant import Field, Plant, geom_fields, model_spec

STOP_DEPTH = 0.4  # m, depth of stops and wall behind their faces, enough for a blow of 80 m/s
LENGTH, BOB_RADIUS, ROD_RADIUS, HINGE_Z = 0.5, 0.065, 0.012, 0.8  # m

FLOOR_ANGLE, FLOOR_RESTITUTION = 2.44, 0.3  # rad (140 degrees), of the bob on the floor; chosen
STOP_ANGLE, STOP_RESTITUTION = 1.0, 0.4  # rad; restitution of rubber; both chosen
WALL_ANGLE, WALL_RESTITUTION = 0.7, 0.8  # rad; both chosen
# rad; m from the hinge; m; chosen
PEG_ANGLE = 0.2
PEG_ARM = 0.30
PEG_RADIUS = 0.020
PEG_RESTITUTION = 0.4


def build(n):
    return model_spec("inverted_pendulum.xml")


def fields(model, p):
    body = model.body("pendulum").id
    yield Field("body_mass", body, p.m)
    yield Field("body_ipos", body, (0.0, 0.0, p.l))
    yield Field("dof_damping", model.joint("hinge").dofadr[0], p.b)
    yield Field("opt.gravity", 2, -p.grav)
    yield from geom_fields(model, "rod", (0.0, 0.0, p.l / 2), (1, p.l / 2))
    yield from geom_fields(model, "bob", (0.0, 0.0, p.l))


def nominal(x, v, i, p):
    inertia = p.m * p.l**2
    return (p.m * p.grav * p.l * sin(x[i]) - p.b * v[i]) / inertia, 1.0 / inertia


def on_floor(spec):
    """Lower the machine so that the bob reaches the floor."""
    machine = spec.body("machine")
    down = HINGE_Z + LENGTH * cos(FLOOR_ANGLE) - BOB_RADIUS
    machine.pos = (0.0, 0.0, -down)
    for name in ("foot", "step"):
        spec.geom(name).pos[2] += down
    column = spec.geom("column")
    bottom = 0.03 + down
    top = column.pos[2] + column.size[1]
    column.pos[2] = (bottom + top) / 2
    column.size[1] = (top - bottom) / 2
    spec.stat.center[2] -= down
    hit(spec, ("floor", "bob"), FLOOR_RESTITUTION)


def stops(spec):
    machine = spec.body("machine")
    outer = asin(0.110 / LENGTH)  # rad, from the stopped bob to the arm that holds the pad
    for side, sign in (("left", -1), ("right", 1)):
        stop = machine.add_body(
            name=f"{side}_stop", pos=(0, 0, HINGE_Z), quat=turned(sign * STOP_ANGLE)
        )
        face = sorted((sign * BOB_RADIUS, sign * (BOB_RADIUS + 0.022)))
        plate = sorted((sign * (BOB_RADIUS + 0.022), sign * (BOB_RADIUS + 0.032)))
        box(
            stop,
            f"{side}_pad",
            (face[0], -0.045, LENGTH - 0.045),
            (face[1], 0.045, LENGTH + 0.045),
            "ink",
        )
        box(
            stop,
            f"{side}_plate",
            (plate[0], -0.055, LENGTH - 0.055),
            (plate[1], 0.055, LENGTH + 0.055),
            "steel",
        )
        bar(
            stop,
            f"{side}_finger",
            ((sign * 0.110, -0.02, LENGTH), (sign * 0.110, 0.12, LENGTH)),
            0.018,
            "steel",
        )
        arm = machine.add_body(
            name=f"{side}_arm", pos=(0, 0, HINGE_Z), quat=turned(sign * (STOP_ANGLE + outer))
        )
        box(arm, f"{side}_beam", (-0.018, 0.080, 0.0), (0.018, 0.110, LENGTH + 0.04), "graphite")
        deep = sorted((sign * BOB_RADIUS, sign * (BOB_RADIUS + STOP_DEPTH)))
        solid(
            stop, f"{side}_solid", (deep[0], -0.045, LENGTH - 0.20), (deep[1], 0.045, LENGTH + 0.10)
        )
        hit(spec, (f"{side}_solid", "bob"), STOP_RESTITUTION)


def wall(spec):
    machine = spec.body("machine")
    face = LENGTH * sin(WALL_ANGLE) + BOB_RADIUS
    box(machine, "wall_foot", (face - 0.02, -0.20, 0.0), (face + 0.16, 0.20, 0.028), "graphite")
    box(machine, "wall", (face, -0.15, 0.0), (face + 0.05, 0.15, 1.36), "ivory")
    for y in (-0.11, 0.11):
        edge = "front" if y < 0 else "back"
        box(
            machine,
            f"wall_{edge}_rib",
            (face + 0.05, y - 0.02, 0.0),
            (face + 0.09, y + 0.02, 1.30),
            "graphite",
        )
    solid(machine, "wall_solid", (face, -0.15, 0.0), (face + STOP_DEPTH, 0.15, 1.36))
    hit(spec, ("wall_solid", "bob"), WALL_RESTITUTION)


def peg(spec):
    machine = spec.body("machine")
    angle = PEG_ANGLE - asin((ROD_RADIUS + PEG_RADIUS) / PEG_ARM)
    x = PEG_ARM * sin(angle)
    z = HINGE_Z + PEG_ARM * cos(angle)
    bar(machine, "peg", ((x, 0.045, z), (x, -0.055, z)), PEG_RADIUS, "brass", round_ends=True)
    bar(machine, "peg_collar", ((x, 0.045, z), (x, 0.028, z)), 0.032, "graphite")
    hit(spec, ("peg", "rod"), PEG_RESTITUTION)


def turned(angle):
    """Return the quaternion that turns up towards x by an angle, rad."""
    return cos(angle / 2), 0.0, sin(angle / 2), 0.0


INVERTED_PENDULUM = Plant(
    name="inverted_pendulum",
    parameters={"m": 0.5, "l": 0.5, "b": 0.02, "grav": 9.81},  # kg, m, N m s/rad, m/s^2
    mass="m",
    unit="rad",
    x0=(0.5,),
    build=build,
    fields=fields,
    nominal=nominal,
    jumps={"mild": {"mass": 2.0}, "hard": {"mass": 25.912}},
    contacts={"floor": on_floor, "stops": stops, "wall": wall, "peg": peg},
    placed={"l": LENGTH},
)
