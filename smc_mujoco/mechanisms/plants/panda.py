"""Panda: the arm of Franka Emika with seven joints, a payload on its flange, and a table or a wall
to press on.

    M(q) q'' + C(q, q') q' + G(q) = u + d

Channel i, from 0, is the angle of the maker's joint i + 1, rad; u is the torque of its motor after
the gear. M, C and G are those of seven rigid links on the maker's modified Denavit-Hartenberg
frames. The z axis of a frame is the axis of its joint:

    joint        1      2      3      4       5       6      7      flange
    a, m         0      0      0      0.0825  -0.0825 0      0.088  0
    alpha, rad   0      -pi/2  pi/2   pi/2    -pi/2   pi/2   pi/2   0
    d, m         0.333  0      0.316  0       0.384   0      0      0.107

m is the mass of all links, and scales their masses and inertias. payload is the mass of a steel
ball, whose centre is on the flange's axis at the distance lp from the flange. It is 0 by default,
and a mismatch or a jump adds kg to it. The nominal f of a channel is computed by MuJoCo, with the
commands of the other channels. The default reference is the maker's ready pose, `rest`; runs start
from the home pose of mujoco_menagerie. The joints have no friction by default;
`friction=smc.plant("panda").friction` is the friction that Gaz et al. identified.

Gaz et al. published two full sets of masses, centres and inertias, which both explain their
records. The links have the first, the feasible set p, as in mujoco_menagerie's panda_nohand. delta
is the share of the second, the set delta of Tables VIII and IX: 0 (the default) is p, 1 is delta,
and between them masses, first and second moments are blended. In delta the links weigh 18.00 kg in
place of 16.06, and the wrist is 2 to 25 times lighter. A mismatch adds to delta, so
`mismatch={"delta": 1.0}` is an arm of the second set under a law that knows the first. Neither set
has the inertia of the motors' rotors. Under the friction of joint 7 this light wrist needs physics
steps of at most 0.25 ms, the default.

What to know of these numbers. The model that Gaz et al. use themselves is not p but the
coefficients from which p was fitted: their M differs from that of p by 2 % in the median over poses
and by up to 7 %, and their inertias of joints 5, 6 and 7 are smaller by factors of 1.8, 1.3 and 3.8
(medians). c6z of p, -0.010517 m, is suspect: it has the digits of c7x, and the coefficient c5y m5 -
c6z m6 that it gives, 0.0679 kg m, is printed as 0.0824 (other fits: 0.0771 to 0.0817). The effect
is at most 0.14 N m on joint 5. It is kept as published. The printed digits of delta leave link 2
with a principal inertia of -2.2e-5 kg m^2; M stays positive definite. Off-diagonal inertias of
delta's links 3 to 7, below 2e-8 kg m^2, are left out.
Source: masses, centres and inertias of the links: C. Gaz, M. Cognetti, A. Oliva, P. Robuffo
Giordano and A. De Luca, Dynamic identification of the Franka Emika Panda robot with retrieval of
feasible parameters using penalty-based optimization, IEEE Robotics and Automation Letters 4(4),
2019, with its supplement. mujoco_menagerie (Apache-2.0) also has the maker's limits of positions
and torques. Steel: 7850 kg/m^3. lp, the probe, and the places of table and wall are chosen. Left
out: the maker's bounds on speed, 2.175 rad/s (joints 1 to 4) and 2.61 rad/s, and contacts between
links.
"""

import math

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.custom.nominal_model import NominalModel
from smc_mujoco.mechanisms.hardware.contact import box, rub
from smc_mujoco.mechanisms.hardware.sliding import Sigmoid
from smc_mujoco.mechanisms.plant import Field, Plant, model_spec

JOINTS = tuple(f"joint{i}" for i in range(1, 8))
LINKS = tuple(f"link{i}" for i in range(1, 8))
# kg, of the links
LINK_MASS = math.fsum((4.970684, 0.646926, 3.228604, 3.587895, 1.225946, 1.666555, 0.735522))
STEEL_DENSITY = 7850.0  # kg/m^3
FLANGE_DISTANCE = 0.107  # m, from joint 7 to the flange
# m: height of the table, and distance of the wall from the arm's first axis
TABLE_HEIGHT = 0.2
WALL_DISTANCE = 0.65
PROBE_FRICTION = 0.2  # coefficient of friction between the probe and table or wall: chosen
# rad, the maker's
READY_POSE = (0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4)
JOINT_RANGES = (
    (-2.8973, 2.8973),
    (-1.7628, 1.7628),
    (-2.8973, 2.8973),
    (-3.0718, -0.0698),
    (-2.8973, 2.8973),
)
JOINT_RANGES += ((-0.0175, 3.7525), (-2.8973, 2.8973))  # rad
# Friction of each joint, in N m, s/rad, rad/s: Gaz et al.
FRICTION = Sigmoid(
    p1=(0.54615, 0.87224, 0.64068, 1.2794, 0.83904, 0.30301, 0.56489),
    p2=(5.1181, 9.0657, 10.136, 5.5903, 8.3469, 17.133, 10.336),
    p3=(0.0395, 0.0259, -0.0461, 0.0362, 0.0262, -0.0210, 0.0036),
)
# The second set of Gaz et al., delta: kg, centre in m, and inertia about the centre, kg m^2: xx,
# yy, zz, xy, xz, yz.
SECOND_SET = (
    (2.0643e-5, (5.2e-8, 5.2e-8, -0.1750), (0.6, 0.6, 2e-6, 0.0, 0.0, 0.0)),
    (9.2017, (0.0015, -0.0578, -0.0384), (0.028, 0.0291, 0.0011, 5.565e-5, 0.0056, -2.7636e-4)),
    (1.4575, (0.1096, 0.05, -0.1), (2e-6, 2e-6, 2e-6, 0.0, 0.0, 0.0)),
    (4.5856, (-0.0485, 0.15, 0.0147), (2e-6, 2e-6, 2e-6, 0.0, 0.0, 0.0)),
    (0.5231, (-0.004, 0.045, -0.05), (2e-6, 2e-6, 2e-6, 0.0, 0.0, 0.0)),
    (2.0604, (0.0732, -0.0251, -0.0276), (2e-6, 2e-6, 2e-6, 0.0, 0.0, 0.0)),
    (0.1718, (-0.0326, 0.0087, 0.0396), (2e-6, 2e-6, 2e-6, 0.0, 0.0, 0.0)),
)


def build(n):
    return model_spec("panda.xml")


def fields(model, p):
    links = [model.body(name).id for name in LINKS]
    ball = model.body("payload").id
    share = p.m / LINK_MASS
    radius = math.cbrt(3.0 * p.payload / (4.0 * math.pi * STEEL_DENSITY))
    inertia = 0.4 * p.payload * radius * radius
    masses, centres, frames, inertias = blended(model, links, p.delta)
    yield Field("body_mass", links, masses * share)
    yield Field("body_ipos", links, centres)
    yield Field("body_iquat", links, frames)
    yield Field("body_inertia", links, inertias * share)
    yield Field("body_mass", ball, p.payload)
    yield Field("body_inertia", ball, (inertia, inertia, inertia))
    yield Field("body_pos", ball, (0.0, 0.0, FLANGE_DISTANCE + p.lp))
    yield Field("geom_size", (model.geom("ball").id, 0), max(radius, 0.001))
    yield Field("opt.gravity", 2, -p.grav)


def blended(model, links, delta):
    """Return masses, centres, frames and principal inertias of the links, (7,), (7, 3), (7, 4), (7,
    3).

    The compiled model's links, bodies by index, have the first set. delta is the share of the
    second, in 0 .. 1.
    """
    if not 0.0 <= delta <= 1.0:
        raise ScenarioError(f"panda's delta is {delta:g}: give the share of the second set, 0 to 1")
    masses = model.body_mass[links]
    centres = model.body_ipos[links]
    frames = model.body_iquat[links]
    inertias = model.body_inertia[links]
    if not delta:
        return masses, centres, frames, inertias
    for i, (mass, centre, (xx, yy, zz, xy, xz, yz)) in enumerate(SECOND_SET):
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, frames[i])
        turn = turn.reshape(3, 3)
        first = moments(masses[i], centres[i], turn @ np.diag(inertias[i]) @ turn.T)
        second = moments(
            mass, np.array(centre), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        )
        masses[i], h, J = (
            (1.0 - delta) * a + delta * b for a, b in zip(first, second, strict=True)
        )
        centres[i] = h / masses[i]
        inertias[i], turn = np.linalg.eigh(J - moments(masses[i], centres[i], 0.0)[2])
        turn *= np.linalg.det(turn)  # a rotation, not a reflection
        mujoco.mju_mat2Quat(frames[i], turn.ravel())
    return masses, centres, frames, inertias


def moments(mass, centre, inertia):
    """Return mass, first moments and inertia about the origin of a link, from its inertia about the
    centre.
    """
    return (
        mass,
        mass * centre,
        inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre)),
    )


def table(spec):
    """Add a table in front of the arm, on which the probe slides."""
    machine = spec.body("machine")
    box(machine, "table", (0.25, -0.45, TABLE_HEIGHT - 0.03), (0.85, 0.45, TABLE_HEIGHT), "steel")
    for i, (x, y) in enumerate(((0.30, -0.40), (0.80, -0.40), (0.30, 0.40), (0.80, 0.40))):
        box(
            machine,
            f"leg{i}",
            (x - 0.02, y - 0.02, 0.0),
            (x + 0.02, y + 0.02, TABLE_HEIGHT - 0.03),
            "graphite",
        )
    rub(spec, ("probe", "table"), PROBE_FRICTION)


def wall(spec):
    """Add a wall in front of the arm, along which the probe slides."""
    machine = spec.body("machine")
    box(machine, "wall", (WALL_DISTANCE, -0.45, 0.0), (WALL_DISTANCE + 0.05, 0.45, 0.85), "steel")
    rub(spec, ("probe", "wall"), PROBE_FRICTION)


PANDA = Plant(
    name="panda",
    label="Panda",
    parameters={
        "m": LINK_MASS,
        "payload": 0.0,
        "lp": 0.04,
        "delta": 0.0,
        "grav": 9.81,
    },  # kg, kg, m, 1, m/s^2
    mass="m",
    unit="rad",
    x0=(0.0, 0.0, 0.0, -math.pi / 2, 0.0, math.pi / 2, -math.pi / 4),
    rest=READY_POSE,
    n=7,
    sizes=(7, 7),
    build=build,
    fields=fields,
    nominal=NominalModel(build, fields),
    contacts={"table": table, "wall": wall},
    added={"payload": "kg", "delta": ""},
    uncertain={
        "payload": (0.0, 2.0),
        "delta": (0.0, 1.0),
    },  # kg, as in the study of arms; both published sets
    direct=True,
    tip="tip",
    friction=FRICTION,
    smooth=False,
    limits=(87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0),
    ranges=tuple((name, low, high) for name, (low, high) in zip(JOINTS, JOINT_RANGES, strict=True)),
)
