"""A controller of opensmc is a law in one line."""

import numpy as np
import pytest

import smc_mujoco as smc

controllers = pytest.importorskip("opensmc.controllers")


@pytest.mark.quick
@pytest.mark.filterwarnings("ignore::smc_mujoco.errors.PlainLoopWarning")
def test_their_controller_is_a_law_in_one_line():
    theirs = smc.law_from(
        controllers.LQR(
            A=[[0.0, 1.0], [0.0, 0.0]],
            B=[[0.0], [1.0]],
            Q=np.diag([9.0, 1.0]),
        )
    )
    ours = smc.law(
        "lqr",
        q1=9.0,
        q2=1.0,
        r=1.0,
        a1=0.0,
        a2=0.0,
        b=1.0,
    )
    plain = {
        "plant": "duffing",
        "reference": smc.Sine(0.3, 2.0),
        "duration": 1.0,
    }
    runs = smc.run([smc.Scenario(law=law, **plain) for law in (theirs, ours)])
    np.testing.assert_allclose(
        runs[0].u,
        runs[1].u,
        rtol=1e-6,
        atol=1e-8,
    )
