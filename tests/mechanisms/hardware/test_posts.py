"""A film shows a stop where the body that it holds touches it."""

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.mechanisms.hardware import obstacles

pytestmark = pytest.mark.quick

CART = """<mujoco model="cart"><worldbody><body><joint name="slide" type="slide" axis="1 0 0"/>
<geom type="box" size=".1 .1 .1" mass="1" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="slide" ctrlrange="-6 6"/></actuator></mujoco>"""


def test_a_post_stands_beyond_the_body_at_each_end():
    cart = smc.plant_from(CART, ["slide"])
    (_, low), (_, high) = obstacles._posts(smc.Stops({"slide": (-0.3, 0.5)}), cart)
    beyond = 0.1 + obstacles.POST_RADIUS
    np.testing.assert_allclose(low, [-0.3 - beyond, 0.0, 0.0], atol=1e-3)
    np.testing.assert_allclose(high, [0.5 + beyond, 0.0, 0.0], atol=1e-3)
