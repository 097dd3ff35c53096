"""An arm that nobody here wrote: dm_control's Jaco, six joints with velocity servos, tracked by
laws of many joints.
"""

import warnings

import numpy as np
import pytest

import smc_mujoco as smc

START = (0.0, 2.5, 2.0, 0.0, 0.5, 0.0)  # rad
LIMITS = [30.5] * 3 + [6.8] * 3  # N m, of the large and the small joints in dm_control


@pytest.fixture(scope="module")
def jaco():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a display that is not there
        kinova = pytest.importorskip("dm_control.entities.manipulators.kinova")
    joints = {}
    for i, x in enumerate(START, start=1):
        joints[f"joint_{i}"] = smc.Channel(motor=True, x0=x)
    with pytest.warns(UserWarning, match="outside its range"):
        return smc.plant_from(kinova.JacoArm().mjcf_model, channels=joints, name="jaco")


def moving(jaco, law):
    """A scenario in which every joint goes 0.3 rad forth and 0.5 back."""
    moves = []
    for x in START:
        moves.append(smc.signals.Waypoints((0.0, 1.5, 3.0), (x, x + 0.3, x - 0.2)))
    return smc.Scenario(
        plant=jaco,
        law=law,
        reference=moves,
        model="nominal",
        u_max=LIMITS,
        duration=3.0,
        physics_step=1e-3,
    )


# law -> largest error on any joint, rad
FOLLOW = {
    "computed_torque_sliding": 2e-3,
    "super_twisting_computed_torque": 2e-3,
    "unit_vector": 2e-3,
    "time_delay_sliding": 0.01,
    "passivity_based": 0.1,
}


@pytest.mark.quick
def test_laws_of_many_joints_track_on_every_joint(jaco):
    for trace in smc.run([moving(jaco, law) for law in FOLLOW]):
        error = np.abs(trace.x - trace.r).max(axis=0)
        assert trace.failure is None
        assert error.max() < FOLLOW[trace.scenario.law.name], error
        assert np.ptp(trace.x, axis=0).min() > 0.4
