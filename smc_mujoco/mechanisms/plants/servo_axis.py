"""Servo axis: a carriage on a ball screw, M x'' = u + d - b x' - cf sgn(x') - offset.

The friction has a viscous part b, a dry one cf and a constant one, `offset`, as of an axis that is
not level. The dry friction is left out of the nominal f; at rest it holds the carriage against
whatever is less than cf.
Source: A. Janot, M. Gautier & M. Brunot, "Data set and reference models of EMPS", Workshop on
Nonlinear System Identification Benchmarks, 2019: its four identified parameters. The drive gives
35.1507 N/V at up to 10 V.
"""

from smc_mujoco.mechanisms.plant import Field, Plant, model_spec

FORCE_LIMIT = 35.1507 * 10.0  # N


def build(n):
    return model_spec("servo_axis.xml")


def fields(model, p):
    dof = model.joint("slide").dofadr[0]
    yield Field("body_mass", model.body("cart").id, p.M)
    yield Field("dof_damping", dof, p.b)
    yield Field("dof_frictionloss", dof, p.cf)
    yield Field("opt.gravity", 0, -p.offset / p.M)  # a slope


def nominal(x, v, i, p):
    return (-p.b * v[i] - p.offset) / p.M, 1.0 / p.M


SERVO_AXIS = Plant(
    name="servo_axis",
    parameters={"M": 95.1089, "b": 203.5034, "cf": 20.3935, "offset": -3.1648},  # kg, N s/m, N, N
    mass="M",
    unit="m",
    x0=(0.1,),
    build=build,
    fields=fields,
    nominal=nominal,
    limits=(FORCE_LIMIT,),
    smooth=False,
    dry=("cf",),
)
