"""Furuta pendulum: an inverted pendulum on the end of an arm that u turns about the vertical: two
joints, one torque.

    (J + m L^2 + Jp sin(q)^2) x'' + m L l cos(q) q'' + 2 Jp sin(q) cos(q) x' q' - m L l sin(q) q'^2
         = u + d - k x - b x' - cf sgn(x') + m grav (L w(x) - l sin(q) (tx sin(x) - ty cos(x)))
    m L l cos(q) x'' + Jp q'' - Jp sin(q) cos(q) x'^2
        = m grav l (tz sin(q) + w(x) cos(q)) - bq q' - cfq sgn(q')
    w(x) = tx cos(x) + ty sin(x),    tz = sqrt(1 - tx^2 - ty^2),    Jp = Jc + m l^2

Channel 0 is the arm's angle x in rad about the vertical. Channel 1, which is only measured, is the
angle q in rad of the pendulum from upright, positive towards growing x; pi is hanging. J is the
inertia of arm and rotor about the vertical, L the arm's length, l the pendulum's centre of mass
from its hinge and Jc its inertia about this centre. It has none about its length. tx and ty are the
slopes of the table on which the base stands: gravity pulls the pendulum towards growing x at x = 0
by tx, and at x = 90 degrees by ty. k is the spring of a cable between base and arm, unbent at x =
0. Slopes, spring and the friction b, bq, cf, cfq are 0 by default.
The dry friction is left out of the nominal f and g.
Source: Quanser's QUBE-Servo 2 with the rotary pendulum, its published numbers: rotor 4e-6 kg m^2,
arm 0.095 kg of 0.085 m, pendulum 0.024 kg of 0.129 m, uniform. The arm's inertia is m r^2/12 as in
BlueRiverTech's quanser-openai-driver; Quanser's own file for the QUBE-Servo 3 has m r^2/3. The
motor gives at most k V / R = 0.05 N m at rest, with k = 0.042 N m/A, R = 8.4 ohm and V = 10 V.
"""

from math import cos, sin, sqrt

from smc_mujoco.mechanisms.plant import Field, Plant, geom_fields, model_spec

MIN_INERTIA = 1e-13  # kg m^2, the least inertia about its length that MuJoCo takes well
STALL_TORQUE = 0.042 * 10.0 / 8.4  # N m


def build(n):
    return model_spec("furuta.xml")


def fields(model, p):
    arm = model.body("arm").id
    pendulum = model.body("pendulum").id
    dofs = [model.joint(name).dofadr[0] for name in ("arm", "hinge")]
    yield Field("body_mass", pendulum, p.m)
    yield Field("body_inertia", arm, (p.J, p.J, p.J - MIN_INERTIA))
    # together with the arm's inertia: as if the pendulum had none about its length
    yield Field("body_inertia", pendulum, (p.Jc + MIN_INERTIA, p.Jc, MIN_INERTIA))
    yield Field("body_ipos", pendulum, (0.0, 0.0, p.l))
    yield Field("body_pos", pendulum, (0.0, -p.L, 0.0))
    yield Field("jnt_stiffness", model.joint("arm").id, p.k)
    yield Field("dof_damping", dofs, (p.b, p.bq))
    yield Field("dof_frictionloss", dofs, (p.cf, p.cfq))
    tz = sqrt(max(0.0, 1.0 - p.tx * p.tx - p.ty * p.ty))
    yield Field("opt.gravity", slice(3), (p.grav * p.tx, p.grav * p.ty, -p.grav * tz))
    yield from geom_fields(model, "rod", (0.0, 0.0, p.l), (1, p.l))


def nominal(x, v, i, p):
    s = sin(x[1])
    c = cos(x[1])
    Jp = p.Jc + p.m * p.l * p.l
    weight = p.m * p.grav
    tz = sqrt(max(0.0, 1.0 - p.tx * p.tx - p.ty * p.ty))
    w = p.tx * cos(x[0]) + p.ty * sin(x[0])
    out = p.tx * sin(x[0]) - p.ty * cos(x[0])
    around = p.J + p.m * p.L * p.L + Jp * s * s
    lever = p.m * p.L * p.l * c
    along = (
        p.m * p.L * p.l * s * v[1] * v[1] - 2.0 * Jp * s * c * v[0] * v[1] - p.b * v[0] - p.k * x[0]
    )
    along += weight * (p.L * w - p.l * s * out)
    about = Jp * s * c * v[0] * v[0] + weight * p.l * (tz * s + w * c) - p.bq * v[1]
    determinant = around * Jp - lever * lever
    if i == 0:
        return (Jp * along - lever * about) / determinant, Jp / determinant
    return (around * about - lever * along) / determinant, -lever / determinant


FURUTA = Plant(
    name="furuta",
    label="Furuta pendulum",
    # kg m^2, m, kg, m, kg m^2, N m s/rad, N m s/rad, N m, N m, N m/rad, m/s^2, 1, 1
    parameters={
        "J": 4e-6 + 0.095 * 0.085**2 / 12,
        "L": 0.085,
        "m": 0.024,
        "l": 0.129 / 2,
        "Jc": 0.024 * 0.129**2 / 12,
        "b": 0.0,
        "bq": 0.0,
        "cf": 0.0,
        "cfq": 0.0,
        "k": 0.0,
        "grav": 9.81,
        "tx": 0.0,
        "ty": 0.0,
    },
    mass="m",
    unit="rad",
    x0=(0.0, 0.2),
    n=2,
    sizes=(2, 2),
    build=build,
    fields=fields,
    nominal=nominal,
    underactuated=True,
    limits=(STALL_TORQUE,),
    dry=("cf", "cfq"),
)
