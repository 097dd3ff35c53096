"""What a scenario of the fast engine has in its row of numbers."""

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.engine import group

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("turn", [1, -1])
def test_frictions_of_one_joint_add(turn):
    parts = (smc.Coulomb(0.2), smc.Viscous(0.1))[::turn]
    plant = smc.plant("pendulum_network", n=2)
    scenario = smc.Scenario(plant=plant, law="classical", friction=parts, duration=0.1)
    form_group = group.FormGroup([scenario], ["itae"])
    first = form_group.layout.row
    row = form_group.rows[0]
    np.testing.assert_allclose(row[first.damping : first.damping + 2], [0.1, 0.1])
    np.testing.assert_allclose(row[first.levels : first.levels + 2], [0.2, 0.2])
