"""Hanging pendulums in a chain: m l^2 x_i'' = -m grav l sin x_i - b x_i' + kc (x_(i-1) - 2 x_i +
x_(i+1)) + u_i + d.

i = 0 .. n-1 with free ends. They hang on one shaft, neighbours joined by torsion springs kc: the
coupling is -kc times the path graph's Laplacian. Numbers: chosen for the paper study, those of
`inverted_pendulum_network`.
"""

import dataclasses
from math import sin

from smc_mujoco.mechanisms.geometry import pendulum_chain
from smc_mujoco.mechanisms.plants import inverted_pendulum_network as inverted


def build(n):
    return pendulum_chain.compose("hanging_pendulum.xml", n, inverted.X0)


def nominal(x, v, i, p):
    pull = 0.0
    if i > 0:
        pull += p.kc * (x[i - 1] - x[i])
    if i < len(x) - 1:
        pull += p.kc * (x[i + 1] - x[i])
    inertia = p.m * p.l**2
    return (-p.m * p.grav * p.l * sin(x[i]) - p.b * v[i] + pull) / inertia, 1.0 / inertia


PENDULUM_NETWORK = dataclasses.replace(
    inverted.INVERTED_PENDULUM_NETWORK,
    name="pendulum_network",
    build=build,
    nominal=nominal,
    jumps={"mild": {"mass": 2.0}, "hard": {"mass": 11.062}},
)
