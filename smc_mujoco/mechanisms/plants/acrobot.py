"""Acrobot: a double pendulum that is driven at the elbow, with a free shoulder.

The equation, the parameters and their source are in double_pendulum.py, with u = (0, u). A
disturbance d is an external torque on the lower link, so both rows have it: (d, d). It is not
matched, because u turns the links against each other. Driven channels come first: channel 0 is the
elbow's angle q2; channel 1, which is only measured, the shoulder's angle q1, from hanging. (0, pi)
is upright. Dry friction is left out of the nominal f and g.
"""

import dataclasses
import math

from smc_mujoco.mechanisms.plants import double_pendulum as double


def build(n):
    spec = double.build(n)
    spec.delete(spec.actuator("u1"))
    return spec


def nominal(x, v, i, p):
    f1, f2, _, g1, g2 = double.accelerations(
        x[1],
        x[0],
        v[1],
        v[0],
        p.m1,
        p.m2,
        p.l1,
        p.r1,
        p.r2,
        p.I1,
        p.I2,
        p.Ir,
        p.gear,
        p.b1,
        p.b2,
        p.grav,
    )
    return (f2, g2) if i == 0 else (f1, g1)


ACROBOT = dataclasses.replace(
    double.DOUBLE_PENDULUM,
    name="acrobot",
    x0=(0.5, 1.0),
    build=build,
    nominal=nominal,
    underactuated=True,
    goal=(math.pi,),
    limits=(double.TORQUE_LIMIT,),
)
