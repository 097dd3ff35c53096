"""Double pendulum: two links in a vertical plane, driven at the shoulder and at the elbow.

    M(q) q'' + C(q, q') + G(q) + B q' + F sgn(q') = u + d,    a = m2 l1 r2,    h = a sin(q2)
    M = [I1 + I2 + m2 l1^2 + 2 a cos(q2) + (gear^2 + 1) Ir,   I2 + a cos(q2) - gear Ir]
        [I2 + a cos(q2) - gear Ir,                            I2 + gear^2 Ir          ]
    C = [-h (2 q1' + q2') q2', h q1'^2]
    G = [(m1 r1 + m2 l1) grav sin(q1) + m2 r2 grav sin(q1 + q2), m2 r2 grav sin(q1 + q2)]

Channel 0 is the shoulder's angle q1 in rad from hanging, channel 1 the elbow's angle q2 of the
lower link from the upper one. Seen from the front, both are counter-clockwise; (pi, 0) is upright.
The disturbances are external torques: d1 of the shoulder acts on the upper link, d2 of the elbow on
the lower link. d2 turns the shoulder, too, so that
d = (d1 + d2, d2). `pendubot` drives only the shoulder, `acrobot` only the elbow. I1 and I2 are
about the joints, Ir is a motor's rotor before its gear, B = (b1, b2) and F = (cf1, cf2). A motor
gives at most 6 N m. Each channel's nominal f has the effect of the other's command. MuJoCo computes
it, without the dry friction.
Source: dfki-ric-underactuated-lab/double_pendulum (BSD-3-Clause), design C.1: model 1.1, the
default here, is model 1.0 without friction and rotors. `MODEL_1_0` has these. Its published dry
friction is cf arctan(100 q'), which reaches
cf pi/2 at speed: F here.
"""

from math import cos, pi, sin

from numba import njit

from smc_mujoco.mechanisms.custom.nominal_model import NominalModel
from smc_mujoco.mechanisms.plant import Field, Plant, geom_fields, model_spec

TORQUE_LIMIT = 6.0  # N m, of a motor on the published boards
L2 = 0.3  # m, length of the lower link: the equation has only where its centre of mass lies
# kg, kg, m, m, m, kg m^2, kg m^2, kg m^2, -, N m s/rad, N m s/rad, N m, N m, m/s^2
MODEL_1_1 = {
    "m1": 0.5234602302310271,
    "m2": 0.6255677234174437,
    "l1": 0.2,
    "r1": 0.2,
    "r2": 0.25569305436052964,
    "I1": 0.031887199591513114,
    "I2": 0.05086984812807257,
    "Ir": 0.0,
    "gear": 6.0,
    "b1": 0.0,
    "b2": 0.0,
    "cf1": 0.0,
    "cf2": 0.0,
    "grav": 9.81,
}
MODEL_1_0 = MODEL_1_1 | {
    "Ir": 6.287203962819607e-5,
    "b1": 0.001,
    "b2": 0.001,
    "cf1": 0.16 * pi / 2,
    "cf2": 0.12 * pi / 2,
}


def build(n):
    return model_spec("double_pendulum.xml")


def fields(model, p):
    upper = model.body("upper").id
    lower = model.body("lower").id
    dofs = [model.joint(name).dofadr[0] for name in ("shoulder", "elbow")]
    rotor = model.tendon("rotor").id
    # of each link about its own centre of mass
    across = (p.I1 - p.m1 * p.r1**2, p.I2 - p.m2 * p.r2**2)
    yield Field("body_mass", [upper, lower], (p.m1, p.m2))
    yield Field("body_ipos", [upper, lower], [(0.0, 0.0, -p.r1), (0.0, 0.0, -p.r2)])
    yield Field("body_inertia", [upper, lower], [(inertia, inertia, inertia) for inertia in across])
    yield Field("body_pos", lower, (0.0, 0.0, -p.l1))
    yield Field("dof_armature", dofs[0], p.gear**2 * p.Ir)
    yield Field("tendon_armature", rotor, p.Ir)
    yield Field("wrap_prm", model.tendon_adr[rotor] + 1, -p.gear)
    yield Field("dof_damping", dofs, (p.b1, p.b2))
    yield Field("dof_frictionloss", dofs, (p.cf1, p.cf2))
    yield Field("opt.gravity", 2, -p.grav)
    yield from geom_fields(model, "elbow_cap", (0.0, 0.0, -p.l1))
    yield from geom_fields(model, "upper_rod", (0.0, 0.0, -p.l1 / 2), (1, p.l1 / 2))


@njit
def accelerations(q1, q2, v1, v2, m1, m2, l1, r1, r2, I1, I2, Ir, gear, b1, b2, grav):
    """Return q'' of shoulder and elbow without torques, and M^-1 as its three numbers (1, 1), (1,
    2) and (2, 2).
    """
    a = m2 * l1 * r2
    M11 = I1 + I2 + m2 * l1 * l1 + 2.0 * a * cos(q2) + (gear * gear + 1.0) * Ir
    M12 = I2 + a * cos(q2) - gear * Ir
    M22 = I2 + gear * gear * Ir
    h = a * sin(q2)
    outer = m2 * r2 * grav * sin(q1 + q2)
    F1 = h * (2.0 * v1 + v2) * v2 - (m1 * r1 + m2 * l1) * grav * sin(q1) - outer - b1 * v1
    F2 = -h * v1 * v1 - outer - b2 * v2
    determinant = M11 * M22 - M12 * M12
    W11 = M22 / determinant
    W12 = -M12 / determinant
    W22 = M11 / determinant
    return W11 * F1 + W12 * F2, W12 * F1 + W22 * F2, W11, W12, W22


DOUBLE_PENDULUM = Plant(
    name="double_pendulum",
    parameters=MODEL_1_1,
    mass="m2",
    unit="rad",
    x0=(1.0, 0.5),
    n=2,
    sizes=(2, 2),
    build=build,
    fields=fields,
    nominal=NominalModel(build, fields),
    limits=(TORQUE_LIMIT, TORQUE_LIMIT),
    dry=("cf1", "cf2"),
)
