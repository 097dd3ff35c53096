"""Panda: the arm of Franka Emika with seven joints, a payload on its flange, and a table or a wall to press on.

    M(q) q'' + C(q, q') q' + G(q) = u + d

Channel i, from 0, is the angle of the maker's joint i + 1, rad; u is the torque of its motor after the gear. M, C and G
are those of seven rigid links on the maker's modified Denavit-Hartenberg frames. The z axis of a frame is the axis of
its joint:

    joint        1      2      3      4       5       6      7      flange
    a, m         0      0      0      0.0825  -0.0825 0      0.088  0
    alpha, rad   0      -pi/2  pi/2   pi/2    -pi/2   pi/2   pi/2   0
    d, m         0.333  0      0.316  0       0.384   0      0      0.107

m is the mass of all links, and scales their masses and inertias. payload is the mass of a steel ball, whose centre is
on the flange's axis at the distance lp from the flange. It is 0 by default, and a mismatch or a jump adds kg to it. The
nominal f of a channel is computed by MuJoCo, with the commands of the other channels. The default reference is the
maker's ready pose, `rest`; runs start from the home pose of mujoco_menagerie. The joints have no friction by default;
`friction=smc.plant("panda").friction` is the friction that Gaz et al. identified.
Source: masses, centres and inertias of the links: C. Gaz, M. Cognetti, A. Oliva, P. Robuffo Giordano and A. De Luca,
Dynamic identification of the Franka Emika Panda robot with retrieval of feasible parameters using penalty-based
optimization, IEEE Robotics and Automation Letters 4(4), 2019, as in mujoco_menagerie's panda_nohand (Apache-2.0), which
also has the maker's limits of positions and torques. Steel: 7850 kg/m^3. lp, the probe, and the places of table and
wall are chosen. Left out: the maker's bounds on speed, 2.175 rad/s (joints 1 to 4) and 2.61 rad/s, and contacts between
links.
"""

import math

import mujoco

from smc_mujoco.mechanisms.custom.nominal_model import NominalModel
from smc_mujoco.mechanisms.hardware.contact import box, rub
from smc_mujoco.mechanisms.hardware.sliding import Sigmoid
from smc_mujoco.mechanisms.plant import Field, Plant, model_path

JOINTS = tuple(f"joint{i}" for i in range(1, 8))
LINKS = tuple(f"link{i}" for i in range(1, 8))
MASS = math.fsum((4.970684, 0.646926, 3.228604, 3.587895, 1.225946, 1.666555, 0.735522))  # kg, of the links
STEEL = 7850.0  # kg/m^3
FLANGE = 0.107  # m, from joint 7 to the flange
TABLE, WALL = 0.2, 0.65  # m: height of the table, and distance of the wall from the arm's first axis
RUBBING = 0.2  # coefficient of friction between the probe and table or wall: chosen
READY = (0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4)  # rad, the maker's
RANGES = ((-2.8973, 2.8973), (-1.7628, 1.7628), (-2.8973, 2.8973), (-3.0718, -0.0698), (-2.8973, 2.8973))
RANGES += ((-0.0175, 3.7525), (-2.8973, 2.8973))  # rad
# Friction of each joint, in N m, s/rad, rad/s: Gaz et al.
FRICTION = Sigmoid(
    p1=(0.54615, 0.87224, 0.64068, 1.2794, 0.83904, 0.30301, 0.56489),
    p2=(5.1181, 9.0657, 10.136, 5.5903, 8.3469, 17.133, 10.336),
    p3=(0.0395, 0.0259, -0.0461, 0.0362, 0.0262, -0.0210, 0.0036),
)


def build(n):
    return mujoco.MjSpec.from_file(str(model_path("panda.xml")))


def fields(model, p):
    links, ball = [model.body(name).id for name in LINKS], model.body("payload").id
    share, radius = p.m / MASS, math.cbrt(3.0 * p.payload / (4.0 * math.pi * STEEL))
    inertia = 0.4 * p.payload * radius * radius
    yield Field("body_mass", links, model.body_mass[links] * share)
    yield Field("body_inertia", links, model.body_inertia[links] * share)
    yield Field("body_mass", ball, p.payload)
    yield Field("body_inertia", ball, (inertia, inertia, inertia))
    yield Field("body_pos", ball, (0.0, 0.0, FLANGE + p.lp))
    yield Field("geom_size", (model.geom("ball").id, 0), max(radius, 0.001))
    yield Field("opt.gravity", 2, -p.grav)


def table(spec):
    """Add a table in front of the arm, on which the probe slides."""
    machine = spec.body("machine")
    box(machine, "table", (0.25, -0.45, TABLE - 0.03), (0.85, 0.45, TABLE), "steel")
    for i, (x, y) in enumerate(((0.30, -0.40), (0.80, -0.40), (0.30, 0.40), (0.80, 0.40))):
        box(machine, f"leg{i}", (x - 0.02, y - 0.02, 0.0), (x + 0.02, y + 0.02, TABLE - 0.03), "graphite")
    rub(spec, ("probe", "table"), RUBBING)


def wall(spec):
    """Add a wall in front of the arm, along which the probe slides."""
    machine = spec.body("machine")
    box(machine, "wall", (WALL, -0.45, 0.0), (WALL + 0.05, 0.45, 0.85), "steel")
    rub(spec, ("probe", "wall"), RUBBING)


PANDA = Plant(
    name="panda",
    label="Panda",
    parameters={"m": MASS, "payload": 0.0, "lp": 0.04, "grav": 9.81},  # kg, kg, m, m/s^2
    mass="m",
    unit="rad",
    x0=(0.0, 0.0, 0.0, -math.pi / 2, 0.0, math.pi / 2, -math.pi / 4),
    rest=READY,
    n=7,
    sizes=(7, 7),
    build=build,
    fields=fields,
    nominal=NominalModel(build, fields),
    lane=(1.1, 0.0, 0.0),
    contacts={"table": table, "wall": wall},
    added={"payload": "kg"},
    direct=True,
    tip="tip",
    friction=FRICTION,
    smooth=False,
    limits=(87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0),
    ranges=tuple((name, low, high) for name, (low, high) in zip(JOINTS, RANGES, strict=True)),
)
