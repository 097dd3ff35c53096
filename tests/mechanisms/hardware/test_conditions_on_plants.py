"""Every condition of the suite on every plant of the library, and on a wheel: it compiles, or is
refused.
"""

import contextlib

import mujoco
import pytest

import smc_mujoco as smc
from smc_mujoco.simulation.conditions import NAMED
from smc_mujoco.simulation.model import compile_model

WHEEL = """<mujoco><worldbody><body><joint name="hinge" axis="0 1 0"/>
<geom type="cylinder" size="0.1 0.01" euler="90 0 0" mass="1"/></body></worldbody>
<actuator><motor joint="hinge" ctrlrange="-3 3"/></actuator></mujoco>"""


@pytest.mark.quick
@pytest.mark.filterwarnings("ignore:LuGre's bristles")  # those of the wheel, which is light
@pytest.mark.parametrize("name", [*smc.plants(), "wheel"])
def test_every_condition_fits_a_plant_or_is_refused(name):
    wheel = name == "wheel"  # its centre of mass is on its hinge
    if wheel:
        machine = smc.plant_from(WHEEL, ["hinge"], name=name)
    else:
        machine = name
    compiled = 0
    starts = smc.starts(x0=0.1) if wheel else None
    for condition in NAMED:
        with contextlib.suppress(smc.ScenarioError):
            (scenario,) = smc.grid(
                machine, "none", condition, starts=starts, gains="default", duration=0.1
            )
            compiled += isinstance(compile_model(scenario), mujoco.MjModel)
    assert compiled > len(NAMED) / 2
