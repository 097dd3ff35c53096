"""Units of the gains of surfaces and estimators: converted by their units, they do the same in
every system of units.

Those of laws are tested the same way in tests/analysis/tuning/test_search_space.py.
"""

import dataclasses
import math

import numpy as np
import pytest
from helpers.plants_ab import measured

from smc_mujoco.control import estimator, surface
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.law import laws

pytestmark = pytest.mark.quick

SYSTEMS = [
    {"F": 4.0, "X": X, "T": T} for X, T in ((4.0, 1.0), (1.0, 4.0), (16.0, 0.25), (0.25, 0.25))
]
# exp(|e|^p) has a special unit
ALIKE = {"predefined_time": [{"F": 1.0, "X": 1.0, "T": T} for T in (4.0, 0.25)]}
WAY = np.random.default_rng(0).normal(size=(20, 4))


def converted(component, system):
    """The component with its gains in another system of units."""
    units = {name: gain.unit_at(component.gains) for name, gain in component.template.gains.items()}
    gains = {}
    for name, value in component.gains.items():
        if units[name]:
            gains[name] = value * units[name].of(system)
        else:
            gains[name] = value
    return dataclasses.replace(component, gains=gains)


def called(component, ys):
    """What the component returns at each sample, (k, 2)."""
    memory = np.zeros(component.memory)
    gains = type("Gains", (), dict(component.gains))
    return np.array([component.function(y, gains, memory) for y in ys])


@pytest.mark.parametrize("name", laws(kind="surface"))
def test_surface_does_the_same_in_every_system_of_units(name):
    def seen(X, T):
        return [
            measured(
                t=0.01 * i * T,
                dt=0.01 * T,
                e=e * X,
                de=de * X / T,
                a=a * X / T**2,
            )
            for i, (e, de, a, _) in enumerate(WAY)
        ]

    plain = called(surface.surface(name), seen(1.0, 1.0))
    for system in ALIKE.get(name, SYSTEMS):
        X = system["X"]
        T = system["T"]
        s, eq = called(converted(surface.surface(name), system), seen(X, T)).T
        ratio = s[-1] / plain[-1, 0]  # s has its own unit
        np.testing.assert_allclose(
            s,
            plain[:, 0] * ratio,
            rtol=1e-9,
            atol=1e-12,
        )
        np.testing.assert_allclose(
            eq,
            plain[:, 1] * X / T**2,
            rtol=1e-9,
            atol=1e-12,
        )


@pytest.mark.parametrize(
    ("name", "gains"),
    [*((name, {}) for name in laws(kind="estimator")), *(("levant", {"order": n}) for n in (1, 3))],
)
def test_estimator_does_the_same_in_every_system_of_units(name, gains):
    def seen(X, T):
        return [
            Reading(
                dt=0.01 * T,
                x=X * (math.sin(0.3 * i) + x),
                v=v * X / T,
            )
            for i, (x, v, *_) in enumerate(WAY)
        ]

    of_gains = estimator.estimator(name, **gains)
    plain = called(of_gains, seen(1.0, 1.0)).reshape(len(WAY), -1)
    for system in SYSTEMS:
        X = system["X"]
        T = system["T"]
        units = [X / T, X / T**2][: plain.shape[1]]
        outputs = called(converted(of_gains, system), seen(X, T)).reshape(len(WAY), -1)
        np.testing.assert_allclose(
            outputs,
            plain * units,
            rtol=1e-9,
            atol=1e-9,
        )
