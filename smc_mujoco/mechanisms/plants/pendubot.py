"""Pendubot: a double pendulum that is driven at the shoulder, with a free elbow.

The equation, the parameters and their source are in double_pendulum.py, with u = (u, 0). Channel 0
is the shoulder's angle q1, from hanging; channel 1, which is only measured, the elbow's angle q2.
(pi, 0) is upright. Dry friction is left out of the nominal f and g.
"""

import dataclasses

from smc_mujoco.mechanisms.plants import double_pendulum as double


def build(n):
    spec = double.build(n)
    spec.delete(spec.actuator("u2"))
    return spec


def nominal(x, v, i, p):
    f1, f2, g1, g2, _ = double.accelerations(
        x[0],
        x[1],
        v[0],
        v[1],
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
    return (f1, g1) if i == 0 else (f2, g2)


PENDUBOT = dataclasses.replace(
    double.DOUBLE_PENDULUM,
    name="pendubot",
    build=build,
    nominal=nominal,
    underactuated=True,
    limits=(double.TORQUE_LIMIT,),
)
