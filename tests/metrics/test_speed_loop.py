"""Scores of speed loops against the closed form of a damped mass."""

import math

import numpy as np
import pytest

import smc_mujoco as smc

MASS, DAMPING = 1.5, 0.6
SLIDE = f"""<mujoco model="mass"><worldbody><body>
<joint name="slide" type="slide" axis="1 0 0" damping="{DAMPING}"/>
<geom size=".1" mass="{MASS}" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="slide" ctrlrange="-500 500"/></actuator></mujoco>"""


@smc.law_function(gains={"k": 6.0, "share": 1.0})
def speed_loop(y, gains, memory):
    """A P controller of the speed, with a share of the damping fed forward."""
    return gains.k * (y.dr - y.v) + gains.share * 0.6 * y.dr, y.de


def ran(speed, tracks="speed", **fields):
    gains = {name: fields.pop(name) for name in ("k", "share") if name in fields}
    scenario = smc.Scenario(
        plant=smc.plant_from(SLIDE, ["slide"]),
        law=speed_loop(**gains),
        reference=smc.signals.Ramp(speed),
        duration=4.0,
        tracks=tracks,
        **fields,
    )
    return smc.run(scenario)


@pytest.mark.quick
@pytest.mark.parametrize("speed", [0.4, -3.0])
@pytest.mark.parametrize("k", [3.0, 9.0])
def test_the_speed_settles_when_its_error_has_fallen_to_two_percent(speed, k):
    trace = ran(speed, k=k)
    scores = smc.score(trace)
    period = trace.scenario.control_period
    free = math.exp(-DAMPING * period / MASS)  # of the speed in a period, under a held force
    rate = -math.log(free - k * (1.0 - free) / DAMPING) / period
    assert scores["settling_time"] == pytest.approx(math.log(50.0) / rate, abs=period)
    assert scores["overshoot"] == 0.0
    assert scores["iae"] == pytest.approx(abs(speed) / rate, rel=1e-2)


@pytest.mark.parametrize("share", [0.0, 2.0])
def test_the_ultimate_bound_and_the_overshoot_are_of_the_speed(share):
    trace = ran(2.0, share=share)
    end = 2.0 * (6.0 + share * DAMPING) / (6.0 + DAMPING)  # m/s
    scores = smc.score(trace)
    assert scores["ultimate_bound"] == pytest.approx(abs(end - 2.0), rel=1e-3)
    assert scores["overshoot"] == pytest.approx(100.0 * max(0.0, end - 2.0) / 2.0, rel=1e-3)
    assert scores["settling_time"] == math.inf


def test_by_default_the_same_run_is_scored_by_its_position():
    trace = ran(2.0, tracks="position")
    same = ran(2.0)
    assert np.array_equal(trace.x, same.x)
    assert math.isnan(smc.score(trace)["settling_time"])
    assert smc.figure(same).axes[0].get_ylabel().endswith("(m/s)")


def test_channels_of_several_joints_track_their_own_speeds():
    arm = smc.plant("double_pendulum")
    reference = [smc.signals.Ramp(0.1), smc.signals.Ramp(-0.3)]
    scenario = smc.Scenario(plant=arm, law="pid", reference=reference, duration=0.5, tracks="speed")
    trace = smc.run(scenario)
    last = trace.t >= 0.8 * trace.t[-1] - 1e-9
    off = np.abs(trace.v[last] - np.array([0.1, -0.3]))
    assert smc.score(trace)["ultimate_bound"] == pytest.approx(off.max())


@pytest.mark.parametrize("reference", [smc.Constant(3.0), smc.Step(3.0)])
def test_a_position_that_stands_still_as_a_speed_is_questioned(reference):
    with pytest.warns(smc.errors.ScenarioWarning, match=r"the speed 0: .*Ramp\(3\)"):
        smc.Scenario(plant="duffing", law="pid", reference=reference, tracks="speed")


def test_tuning_refuses_a_speed_that_its_objective_would_not_see():
    fast = smc.condition("fast", tracks="speed", reference=smc.signals.Ramp(1.0))
    with pytest.raises(smc.ScenarioError, match="'fast' tracks a speed"):
        smc.tune("duffing", "pid", conditions=[fast], searches=1, budget=1)
