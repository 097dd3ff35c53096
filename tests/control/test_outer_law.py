"""A law of one channel on computed torque meets the double integrator of its theorem, in each
joint.
"""

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.law import law_catalogue
from smc_mujoco.control.units import INPUT_GAIN


def run(law, **changes):
    fields = {
        "plant": "double_pendulum",
        "x0": [0.3, -0.2],
        "u_max": 200.0,
        "duration": 2.0,
        "control_period": 2e-4,
    }
    return smc.run(smc.Scenario(law=law.on_computed_torque(), **(fields | changes)))


def test_each_joint_obeys_the_outer_loop_whatever_the_others_do():
    """e'' + 2 w e' + w^2 e = 0 from rest, with a gain for each joint, is e0 (1 + w t) exp(-w t)."""
    w = np.array([3.0, 5.0])
    trace = run(
        smc.law(
            "computed_torque",
            kp=(w**2).tolist(),
            kd=(2.0 * w).tolist(),
        )
    )
    wt = w * trace.t[:, None]
    np.testing.assert_allclose(trace.x, np.array([0.3, -0.2]) * (1.0 + wt) * np.exp(-wt), atol=2e-3)


SLOWLY = pytest.param("mpc", {}, marks=pytest.mark.slow)  # compiled


@pytest.mark.parametrize(
    ("name", "gains"),
    [
        ("adrc", {}),
        ("pd_observer", {}),
        ("lqi", {"q0": 5e3}),
        SLOWLY,
    ],
)
def test_an_outer_law_leaves_no_error_under_a_constant_force(name, gains):
    trace = run(
        smc.law(name, **gains), disturbance=smc.Constant(1.0), duration=8.0, control_period=1e-3
    )
    assert np.abs(trace.x[-1]).max() < 1e-3
    proportional = run(
        smc.law("computed_torque"),
        disturbance=smc.Constant(1.0),
        duration=8.0,
    )
    assert np.abs(proportional.x[-1]).max() > 1e-2


@pytest.mark.quick
def test_an_observer_knows_the_acceleration_that_the_motor_can_give():
    """Where the motors saturate for long, its estimate stays bounded; told of no bound it would
    swing up.
    """
    law = smc.law("adrc", wc=20.0, w=60.0)
    changes = {"x0": [1.0, 0.5], "duration": 6.0}
    trace = run(law, **changes, control_period=1e-3)
    assert (np.abs(trace.u) == 6.0).sum() > 200  # the limit of its motors
    assert np.abs(trace.x[-1]).max() < 1e-3


def test_what_has_no_one_law_of_one_channel_is_refused():
    for law in (smc.law("unit_vector"), smc.law("swing_up")):
        with pytest.raises(ScenarioError, match=rf"(?s){law.name}.*one law of one channel"):
            law.on_computed_torque()


@pytest.mark.parametrize("name", law_catalogue())
def test_a_gain_that_an_outer_law_keeps_acts_and_one_that_it_drops_is_refused(name, refused):
    template = law_catalogue()[name]
    if template.plants:
        return
    with_outer_law = template.on_computed_torque()
    for gain in {*template.gains} - {*with_outer_law.gains}:
        refused(lambda gain=gain: template(**{gain: 7.0}).on_computed_torque(), gain, 7)
    assert not {gain for gain in with_outer_law.gains.values() if gain.unit == INPUT_GAIN}
