"""Laws on the Panda: perfect computed torque follows minimum jerk, and without a model gravity
remains.
"""

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.mechanisms.plant import Values


@pytest.mark.quick
@pytest.mark.parametrize("name", ["observer_free_joint", "observer_free"])
def test_without_gravity_compensation_gravity_over_lam_k1_remains(name):
    lam = np.array([30.0, 400.0, 20.0, 150.0, 20.0, 20.0, 3.0])
    k1 = 2.0
    panda = smc.plant("panda")
    law = smc.law(name, lam=lam, k1=k1)
    trace = smc.run(
        smc.Scenario(
            plant=panda,
            law=law,
            model="none",
            x0=panda.rest,
            duration=6.0,
        )
    )
    assert np.abs(trace.v[-1]).max() < 1e-4
    gravity = panda.nominal.dynamics(trace.x[-1], np.zeros(7), Values(**panda.parameters)).g
    e = (trace.x - trace.r)[-1]
    assert np.abs(gravity).max() > 15.0
    np.testing.assert_allclose(
        e,
        -gravity / (lam * k1),
        rtol=0.02,
        atol=1e-5,
    )
    # exactly, of any size
    np.testing.assert_allclose(lam * np.tanh(k1 * e), -gravity, rtol=1e-3, atol=1e-3)
