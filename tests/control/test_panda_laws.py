"""Laws on the Panda: perfect computed torque follows minimum jerk, and without a model gravity
remains.
"""

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.mechanisms.plant import Values

MOVE = np.array([0.3, 0.0, -0.2, 0.1, 0.4, -0.3, 0.0])  # rad, beyond the ready pose


def moving(period, **fields):
    """A run with the perfect model from home to beyond the ready pose, with minimum jerk in 1 s.

    Its largest error.
    """
    panda = smc.plant("panda")
    goal = np.array(panda.rest) + MOVE
    law = smc.law("computed_torque_sliding", k=200.0, c=100.0, width=0.5)
    common = {
        "control_period": period,
        "physics_step": period,
        "integrator": "RK4",
        "duration": 1.2,
    }
    reference = []
    for pair in zip(panda.x0, goal, strict=True):
        reference.append(smc.signals.Waypoints((0.0, 1.0), pair))
    trace = smc.run(smc.Scenario(plant=panda, law=law, reference=reference, **common, **fields))
    assert trace.failure is None
    assert np.abs(trace.u).max(axis=0).tolist() < list(trace.scenario.limits)
    return np.abs(trace.x - trace.r).max()


def test_computed_torque_with_the_perfect_model_follows_minimum_jerk_to_a_microradian():
    """What remains is that u is held between samples: the error is proportional to the period."""
    coarse = moving(1e-3)
    fine = moving(5e-4)
    assert fine < 1e-6
    assert coarse / fine == pytest.approx(2.0, rel=0.1)
    assert moving(5e-4, mismatch={"mass": 1.01}) > 5e-6


@pytest.mark.parametrize("name", ["observer_free_joint", "observer_free"])
def test_without_gravity_compensation_gravity_over_lam_k1_remains(name):
    lam = np.array([30.0, 400.0, 20.0, 150.0, 20.0, 20.0, 3.0])
    k1 = 2.0
    panda = smc.plant("panda")
    law = smc.law(name, lam=lam, k1=k1)
    trace = smc.run(smc.Scenario(plant=panda, law=law, model="none", x0=panda.rest, duration=6.0))
    assert np.abs(trace.v[-1]).max() < 1e-4
    gravity = panda.nominal.dynamics(trace.x[-1], np.zeros(7), Values(**panda.parameters)).g
    e = (trace.x - trace.r)[-1]
    assert np.abs(gravity).max() > 15.0
    np.testing.assert_allclose(e, -gravity / (lam * k1), rtol=0.02, atol=1e-5)
    np.testing.assert_allclose(
        lam * np.tanh(k1 * e), -gravity, rtol=1e-3, atol=1e-3
    )  # exactly, of any size
