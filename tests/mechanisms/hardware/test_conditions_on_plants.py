"""Every part and every condition of the suite on every plant of the library: it compiles, or is refused in a sentence."""

import mujoco
import pytest

import smc_mujoco as smc
from smc_mujoco.mechanisms.plant import plant
from smc_mujoco.simulation.conditions import NAMED
from smc_mujoco.simulation.model import model

WHEEL = """<mujoco><worldbody><body><joint name="hinge" axis="0 1 0"/><geom type="cylinder" size="0.1 0.01" euler="90 0 0"
mass="1"/></body></worldbody><actuator><motor joint="hinge" ctrlrange="-3 3"/></actuator></mujoco>"""


@pytest.mark.parametrize("name", [*smc.plants(), "wheel"])
def test_every_condition_fits_a_plant_or_is_refused(name):
    machine = smc.plant_from(WHEEL, ["hinge"], name="wheel", x0=0.1) if name == "wheel" else plant(name)
    compiled = 0
    for condition in NAMED:
        try:
            scenario, *_ = smc.grid(machine, "none", condition, gains="default", duration=0.1)
            compiled += isinstance(model([scenario]), mujoco.MjModel)
        except smc.ScenarioError as error:
            assert len(str(error)) < 300 and "\n" not in str(error)
    assert compiled > len(NAMED) / 2
