"""Laws of many joints, held against their theorems on an arm whose model the law knows exactly."""

import numpy as np
import pytest
from helpers import arms

import smc_mujoco as smc
from smc_mujoco.control import joint_law
from smc_mujoco.mechanisms.plant import Values

SWING = smc.Sine(0.4, 3.0)
X0 = (0.1, 0.5, -0.3)


def run(law, **fields):
    """A run of the arm with strong motors, under RK4."""
    common = {"plant": arms.arm(), "law": law, "duration": 2.0, "u_max": 1e4, "reference": SWING, "x0": X0}
    trace = smc.run(smc.Scenario(**common | fields))
    assert trace.failure is None
    return trace


def inertia(x):
    """The nominal M of the arm."""
    plant = arms.arm()
    return plant.nominal.dynamics(np.array(x), np.zeros(3), Values(**plant.parameters)).M


@pytest.mark.parametrize("name", smc.joint_laws())
def test_every_joint_law_names_gains_units_and_source(name):
    template = joint_law.catalogue()[name]
    assert template.joint
    assert "Source:" in template.doc
    for gain in template.gains.values():
        assert gain.unit is not None or gain.held


def test_computed_torque_sliding_reaches_its_layer_when_it_should():
    k, width = 5.0, 0.05
    trace = run(smc.law("computed_torque_sliding", k=k, c=4.0, width=width), control_period=2e-4, duration=0.8)
    for i in range(3):
        start = abs(trace.s[0, i])
        reached = trace.t[np.argmax(np.abs(trace.s[:, i]) <= width)]
        assert reached == pytest.approx((start - width) / k, rel=2e-3)
        before = trace.t < 0.9 * reached
        np.testing.assert_allclose(np.abs(trace.s[before, i]), start - k * trace.t[before], atol=2e-3 * start)


def test_computed_torque_sliding_leaves_the_layer_times_the_share_of_the_disturbance():
    """At rest |s| = width M^-1 d / k and |e| = |s| / c, joint by joint, with gains of its own for each."""
    k, c, width, d = np.array([8.0, 20.0, 15.0]), np.array([4.0, 6.0, 5.0]), 0.1, 0.3
    law = smc.law("computed_torque_sliding", k=k, c=c, width=width)
    trace = run(law, reference=smc.Constant(0.3), disturbance=smc.Constant(d), duration=4.0)
    expected = width * np.linalg.solve(inertia(trace.x[-1]), np.full(3, d)) / k
    np.testing.assert_allclose(trace.s[-1], expected, rtol=1e-4)
    np.testing.assert_allclose((trace.x - trace.r)[-1], expected / c, rtol=1e-4)
