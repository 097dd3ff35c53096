"""Drag against closed forms of one body in a fluid."""

import math

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.engine.group import why_not
from smc_mujoco.hardware import Drag

MASS = 4.0
BOAT = f"""<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="surge" type="slide"
axis="1 0 0"/><geom size=".1" mass="{MASS}" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="surge" ctrlrange="-50 50"/></actuator></mujoco>"""


@smc.law_function(gains={"force": 8.0})
def thrust(y, gains, memory):
    return gains.force, y.e


def trace(friction, **fields):
    plant = smc.plant_from(BOAT, ["surge"])
    fields = {"law": "none", "x0": 0.0, "duration": 3.0} | fields
    return smc.run(smc.Scenario(plant=plant, friction=friction, **fields))


@pytest.mark.quick
def test_a_body_slows_down_as_quadratic_and_linear_drag_say():
    v0, linear, quadratic = 2.0, 1.5, 3.0
    t = trace(Drag(0.0, quadratic), v0=v0)
    np.testing.assert_allclose(t.v[:, 0], v0 / (1.0 + quadratic * v0 * t.t / MASS), rtol=1e-9)
    t = trace(Drag(linear, quadratic), v0=v0)
    decay = np.exp(-linear * t.t / MASS)
    expected = linear * v0 * decay / (linear + quadratic * v0 * (1.0 - decay))
    np.testing.assert_allclose(t.v[:, 0], expected, rtol=1e-9)
    mean = 0.5 * (t.v[1:, 0] + t.v[:-1, 0])
    resists = -(linear + quadratic * mean) * mean
    np.testing.assert_allclose(t.damping[1:, 0], resists, rtol=1e-3)  # pyright: ignore[reportOptionalSubscript]


def test_thrust_ends_at_the_speed_at_which_drag_takes_it():
    end = math.sqrt(8.0 / 2.0)
    for friction in (Drag(0.0, 2.0), {"surge": Drag(0.0, 2.0)}):
        assert trace(friction, law=thrust(), duration=20.0).v[-1, 0] == pytest.approx(end)
    rubbing = trace((Drag(0.0, 2.0), smc.Coulomb(4.0)), law=thrust(), duration=20.0)
    assert rubbing.v[-1, 0] == pytest.approx(math.sqrt((8.0 - 4.0) / 2.0))


def test_drag_of_a_plant_of_the_library_is_simulated_by_mujoco_and_compensated():
    drag = Drag(0.5, 2.0)
    fields = {"plant": "duffing", "law": "none", "u_max": 50.0, "x0": 1.0, "v0": 0.5}
    fields |= {"duration": 1.0, "friction": drag, "reference": smc.Sine(1.0, 3.0)}
    feedforward = smc.Feedforward(drag, on="speed", eps=1e-6)
    compensated = smc.run(smc.Scenario(**fields, feedforward=feedforward, control_period=1e-3))
    free = smc.run(smc.Scenario(**fields | {"friction": None}, control_period=1e-3))
    assert np.abs(compensated.x - free.x).max() < 1e-3
    assert "drag" in why_not(compensated.scenario)  # the fast engine knows damping alone
