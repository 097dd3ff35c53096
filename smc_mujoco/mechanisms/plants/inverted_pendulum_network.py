"""Inverted pendulums in a chain: m l^2 x_i'' = m grav l sin x_i - b x_i' + kc (x_(i-1) - 2 x_i +
x_(i+1)) + u_i + d.

i = 0 .. n-1 with free ends. They stand on one shaft, neighbours joined by torsion springs kc: the
coupling is -kc times the path graph's Laplacian. Numbers: chosen for the paper study.
"""

from math import sin

from smc_mujoco.mechanisms.geometry import pendulum_chain
from smc_mujoco.mechanisms.plant import Plant, Variant

X0 = (0.8, -0.4, 0.6, -0.2, 0.5)  # rad


def build(n):
    return pendulum_chain.compose("inverted_pendulum.xml", n, X0)


def nominal(x, v, i, p):
    pull = 0.0
    if i > 0:
        pull += p.kc * (x[i - 1] - x[i])
    if i < len(x) - 1:
        pull += p.kc * (x[i + 1] - x[i])
    inertia = p.m * p.l**2
    return (p.m * p.grav * p.l * sin(x[i]) - p.b * v[i] + pull) / inertia, 1.0 / inertia


INVERTED_PENDULUM_NETWORK = Plant(
    name="inverted_pendulum_network",
    parameters={
        "m": 0.5,
        "l": 0.5,
        "b": 0.02,
        "grav": 9.81,
        "kc": 0.5,
    },  # kg, m, N m s/rad, m/s^2, N m/rad
    mass="m",
    unit="rad",
    x0=X0,
    n=5,
    sizes=(2, 1000),
    build=build,
    fields=pendulum_chain.fields,
    nominal=nominal,
    jumps={"mild": {"mass": 2.0}, "hard": {"mass": 22.681}},
    contacts={"bobs": pendulum_chain.bobs},
    mechanisms={"springs": Variant(pendulum_chain.springs, pendulum_chain.spring_fields)},
)
