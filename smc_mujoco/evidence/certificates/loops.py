"""Loops of a law and a plant of one channel, as functions of position x and of s = v + c x.

M x'' = A sin x + B x + C x^3 - (E + F x^2) x' - sigma(s) + d
"""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from smc_mujoco.common.aliases import Data, Floats, Pair
from smc_mujoco.common.data import named_data

Function = Callable[[np.ndarray], np.ndarray]
# The plant's parameters -> M, and A, B, C, E, F of phi = A sin x + B x + C x^3 and D = E + F x^2.
ONE_JOINT_TERMS: dict[str, Callable[[Any], Floats]] = {
    "inverted_pendulum": lambda p: (p.m * p.l**2, p.m * p.grav * p.l, 0.0, 0.0, p.b, 0.0),
    "pendulum_network": lambda p: (p.m * p.l**2, -p.m * p.grav * p.l, 0.0, 0.0, p.b, 0.0),
    "inverted_pendulum_network": lambda p: (p.m * p.l**2, p.m * p.grav * p.l, 0.0, 0.0, p.b, 0.0),
    "duffing": lambda p: (p.M, 0.0, -p.alpha, -p.beta, p.delta, 0.0),
    "van_der_pol": lambda p: (p.M, 0.0, -p.k, 0.0, -p.mu, p.mu),
}


@named_data
class Loop:
    """A loop of one channel, as functions of arrays in SI units."""

    M: float  # mass
    c: float  # slope of the surface, 1/s
    d0: float  # bound of |d|
    phi: Function  # force of the plant
    D: Function  # its damping
    sigma: Function  # the law's force
    steep: float  # sigma'(0); infinite for a law that switches

    @property
    def switches(self) -> bool:
        """Whether the law switches at s = 0."""
        return bool(np.isinf(self.steep))

    def fall(self, x, s, d):
        """Return s' at states. At s = 0 a law that switches keeps s = 0 if it can."""
        v = s - self.c * x
        force = self.phi(x) - self.D(x) * v + self.M * self.c * v + d
        law = self.sigma(s)
        if self.switches:
            k = self.sigma(np.ones(()))
            law = np.where(s == 0.0, np.clip(force, -k, k), law)
        return (force - law) / self.M


def loop_of(data: Data) -> tuple[Loop, list[float], SimpleNamespace]:
    """Return the loop of a certificate's data, A, B, C, E, F of its plant, and the law's name and
    gains.
    """
    law = SimpleNamespace(name=data["law"]["name"], **data["law"]["gains"])
    M, *terms = ONE_JOINT_TERMS[data["plant"]["name"]](
        SimpleNamespace(**data["plant"]["parameters"])
    )
    return _loop(M, terms, law, data["u_max"], data["disturbance"]), terms, law


def _loop(
    M: float, terms: list[float], law: SimpleNamespace, u_max: float | None, d0: float
) -> Loop:
    """Return a loop as functions of arrays."""
    A, B, C, E, F = terms
    top = math.inf if u_max is None else u_max
    if law.name == "observer_free":
        steep = law.lam
        c = law.k1

        def sigma(s):  # pyright: ignore[reportRedeclaration]
            return np.clip(law.lam * np.tanh(s), -top, top)

    elif law.name == "classical":
        k = min(law.k, top)
        steep = math.inf
        c = law.c

        def sigma(s):  # pyright: ignore[reportRedeclaration]
            return k * np.sign(s)

    else:
        kp, steep = linear_gains(law)
        c = kp / steep
        if law.name == "boundary_layer":
            top = min(law.k, top)

        def sigma(s):
            return np.clip(steep * s, -top, top)

    return Loop(
        M=M,
        c=c,
        d0=d0,
        phi=lambda x: A * np.sin(x) + x * (B + C * x * x),
        D=lambda x: E + F * x * x,
        sigma=sigma,
        steep=steep,
    )


def linear_gains(law: SimpleNamespace) -> Pair:
    """Return kp and kd of a law that is -(kp x + kd x') within its bound."""
    if law.name == "boundary_layer":
        return law.k * law.c / law.phi, law.k / law.phi
    kp = (law.a1 + math.sqrt(law.a1**2 + law.b**2 * law.q1 / law.r)) / law.b
    kd = (law.a2 + math.sqrt(law.a2**2 + 2.0 * law.b * kp + law.b**2 * law.q2 / law.r)) / law.b
    return kp, kd
