"""Chattering behind the actuators of a user's file: servos, filters and delays that stay as they are,
and gains that are tuned within a bound on it.
"""

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.objective import FAILURE_COST, Objective
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.hardware import PositionServo

# without weight and friction: a limit cycle is about 0
LINK = """<mujoco><compiler angle="radian"/><option timestep="1e-3" gravity="0 0 0"/><worldbody>
  <body><joint name="j" axis="0 -1 0" damping=".6" armature=".028"/>
  <geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" mass=".3" contype="0" conaffinity="0"/>
  </body></worldbody><actuator>%s</actuator></mujoco>"""
SERVO = '<position joint="j" kp="17.8" kv=".1" ctrlrange="-1.9 1.9"%s/>'
MOTOR = '<general joint="j" ctrlrange="-3 3"%s/>'


def servo(more="", **fields):
    return smc.plant_from(LINK % SERVO % more, {"j": smc.Channel(servo=True, **fields)})


@pytest.mark.parametrize(
    ("law", "late"),
    [(smc.law("classical", k=0.2, c=8.0), 0.01), (smc.law("super_twisting", k1=0.5, k2=0.5), 0.02)],
)
def test_predicted_chattering_has_the_servo_s_spring(law, late):
    fields = {"law": law, "x0": 0.1, "duration": 6.0, "input_delay": late, "u_max": 1.9}
    scenario = smc.Scenario(plant=servo(), **fields)
    predicted = smc.design.chattering(scenario)
    ideal = smc.plant_from(LINK % SERVO % "", {"j": smc.Channel(motor=True)})
    part = PositionServo(kp=17.8, kv=0.1, forcerange=(-2.94, 2.94), ctrlrange=(-1.9, 1.9))
    weak = smc.design.chattering(smc.Scenario(plant=ideal, actuator=part, **fields))
    assert weak.frequency == pytest.approx(predicted.frequency)
    assert {*weak.assumptions} - {*predicted.assumptions} == {"no forcerange"}
    (trace,) = smc.run([scenario])
    x = trace.x[trace.t > 4.0, 0]
    assert predicted.amplitude_x == pytest.approx(0.5 * np.ptp(x), rel=0.02)
    turns = np.flatnonzero(np.diff(np.sign(x)) > 0)
    assert predicted.frequency == pytest.approx(1e3 * np.diff(turns).mean() ** -1, rel=0.02)


@pytest.mark.quick
def test_chattering_is_not_predicted_for_a_goal_or_steps_of_a_set_point():
    stepped = smc.Scenario(plant=servo(set_point_step=0.01), law="classical")
    with pytest.raises(ScenarioError, match=r"goal 0 and step 0.01: measure it in a run"):
        smc.design.chattering(stepped)


@pytest.mark.parametrize(
    ("own", "given"),
    [
        (' delay="0.01" nsample="10"', {"input_delay": 0.01}),
        (' dyntype="filterexact" dynprm=".01"', {"actuator": smc.Lag(0.01)}),
    ],
)
def test_predicted_chattering_has_the_delay_and_the_filter_of_an_actuator(own, given):
    fields = {"law": smc.law("classical", k=0.5, c=8.0), "x0": 0.1}
    of_file = smc.plant_from(LINK % MOTOR % own, ["j"])
    predicted = smc.design.chattering(smc.Scenario(plant=of_file, **fields))
    plain = smc.Scenario(plant=smc.plant_from(LINK % MOTOR % "", ["j"]), **fields, **given)
    assert predicted.frequency == pytest.approx(smc.design.chattering(plain).frequency)


LAGGING = smc.condition("lagging", actuator=smc.Lag(0.01))
LAGGED = Objective(conditions=(LAGGING,), duration=0.5)


def predicted(tuned) -> float:
    return smc.design.chattering(tuned.law, plant=tuned.plant, actuator=smc.Lag(0.01)).amplitude


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_grid")
def test_gains_are_tuned_within_a_bound_on_predicted_chattering():
    free = smc.tune(
        "duffing",
        "classical",
        20,
        objective=LAGGED,
    )
    bound = smc.tune(
        "duffing",
        "classical",
        20,
        objective=LAGGED,
        chattering=1e-4,
    )
    assert predicted(bound) <= 1e-4 < predicted(free)
    assert bound.objective < FAILURE_COST
    assert "predicted chattering of s <= 0.0001" in str(bound.definition)


@pytest.mark.usefixtures("coarse_grid", "by_mujoco")
@pytest.mark.filterwarnings("ignore:no set of gains")
def test_it_warns_if_all_gains_tried_chatter_too_much():
    with pytest.warns(
        smc.errors.ScenarioWarning, match="are predicted to chatter with more than 1e-12"
    ):
        tuned = smc.tune(
            "duffing",
            "classical",
            2,
            objective=LAGGED,
            chattering=1e-12,
            searches=1,
        )
    assert tuned.objective > 2.0 * FAILURE_COST
