"""The swing-up of the Furuta pendulum: its surface is that of the Riccati equation, and it gets up
from hanging.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

import smc_mujoco as smc

pytestmark = pytest.mark.quick


def surface(plant, torque_per_command=1.0, back_emf=0.0):
    """b'P of the Riccati equation upright, over the weight of u, 2000 for a torque, on a level
    table.
    """
    p = SimpleNamespace(**plant.parameters | {"tx": 0.0, "ty": 0.0})
    rest = np.zeros(2)
    e = 1e-6
    A = np.zeros((4, 4))
    b = np.zeros((4, 1))
    A[:2, 2:] = np.eye(2)
    for i in range(2):
        b[2 + i] = torque_per_command * plant.nominal(rest, rest, i, p)[1]
        for j, d in enumerate(e * np.eye(2)):
            A[2 + i, j] = (plant.nominal(d, rest, i, p)[0] - plant.nominal(-d, rest, i, p)[0]) / (
                2 * e
            )
            A[2 + i, 2 + j] = (
                plant.nominal(rest, d, i, p)[0] - plant.nominal(rest, -d, i, p)[0]
            ) / (2 * e)
        A[2 + i, 2] -= b[2 + i, 0] * back_emf
    weight = 2000.0 * torque_per_command**2
    return (
        b.T @ solve_continuous_are(A, b, np.diag([1.0, 10.0, 0.05, 0.05]), [[weight]]) / weight
    ).ravel()


def test_the_default_surface_solves_the_riccati_equation_of_the_default_plant():
    plant = smc.plant("furuta")
    p = SimpleNamespace(**plant.parameters)
    rest = np.zeros(2)
    gains = smc.law("rotary_swing_up").gains
    np.testing.assert_allclose(
        [gains[name] for name in ("c1", "c2", "c3", "c4")], surface(plant), rtol=1e-5
    )
    inertia = p.Jc + p.m * p.l**2
    lever = p.m * p.grav * p.l
    assert gains["w0"] == pytest.approx(np.sqrt(lever / inertia), rel=1e-6)
    assert gains["J"] == pytest.approx(1.0 / plant.nominal(rest, rest, 0, p)[1], rel=1e-3)


@pytest.mark.parametrize("start", [-np.pi, np.pi, 2.0])
def test_it_swings_up_and_stays(start):
    """From hanging, at rest, and from another angle: upright at the end, with the arm within a
    degree of 0.
    """
    common = {
        "plant": "furuta",
        "law": "rotary_swing_up",
        "x0": (0.0, start),
        "control_period": 2e-3,
        "duration": 6.0,
    }
    trace = smc.run(smc.Scenario(**common))
    assert np.cos(trace.x[-500:, 1]).min() > 0.9999
    assert np.abs(trace.x[-500:, 0]).max() < np.radians(1.0)
    assert np.cos(trace.x[0, 1]) < 0.0
