"""The flanks of a Backlash do not bounce; limit cycles in it are those between plastic stops."""

import dataclasses
import math

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.mechanisms.plant import field_array
from smc_mujoco.simulation import model as models

GAP = 0.01
AXIS = """<mujoco><worldbody><body><joint name="slide" type="slide" axis="1 0 0"/>
<geom size="0.05" mass="0.6" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="slide" ctrlrange="-6 6"/></actuator></mujoco>"""


@pytest.mark.quick
@pytest.mark.parametrize("divisor", [1, 16])
@pytest.mark.parametrize("plant", ["duffing", "inverted_pendulum"])
def test_a_flank_rebounds_at_less_than_one_percent_of_its_speed(plant, divisor):
    scenario = smc.Scenario(
        plant=plant,
        law="none",
        actuator=smc.Backlash(GAP),
    )
    step = scenario.resolved.physics_step / divisor
    scenario = dataclasses.replace(scenario, physics_step=step)
    model = models.with_values(models.compile_model(scenario), scenario)
    model.dof_damping[:] = 0.0
    for field in ("opt.gravity", "jnt_stiffness", "jnt_stiffnesspoly"):
        field_array(model, field)[:] = 0.0
    joint, rotor = models.moving_joints(model)[:, 0]
    rebounds = []
    for phase in np.arange(20) / 20:  # of the blow in its step
        data = mujoco.MjData(model)
        data.qvel[model.jnt_dofadr[rotor]] = 1.0
        data.qpos[model.jnt_qposadr[rotor]] = GAP / 2 - step * (5 + phase)
        mujoco.mj_step(model, data, 60)
        assert data.qvel[model.jnt_dofadr[joint]] > 0.0  # it was struck
        rebounds.append(data.qvel[model.jnt_dofadr[joint]] - data.qvel[model.jnt_dofadr[rotor]])
    assert max(rebounds) < 0.01


def between_plastic_stops(scenario, parts):
    """Positions of Van der Pol's cart at the samples, (K + 1,), under super-twisting: the flanks do
    not bounce.
    """
    gains = scenario.law.gains
    h = scenario.control_period / parts
    bound = scenario.limits[0]
    inertia = scenario.actuator[0].rotor_inertia
    play = scenario.actuator[0].gap / 2
    x = y = scenario.resolved.x0[0]
    v = w = integral = 0.0
    positions = [x]
    for _ in range(scenario.samples):
        s = v + gains["c"] * x
        u = integral - gains["k1"] * math.copysign(math.sqrt(abs(s)), s)
        integral -= scenario.control_period * math.copysign(gains["k2"], s)
        integral = min(max(integral, -bound), bound)
        u = min(max(u, -bound), bound)
        for _ in range(parts):
            v = v + h * ((1.0 - x * x) * v - x)
            w = w + h * u / inertia
            apart = y - x + h * (w - v)
            if abs(apart) > play:
                blow = (apart - math.copysign(play, apart)) / h / (1.0 + 1.0 / inertia)
                v = v + blow
                w = w - blow / inertia
            x = x + h * v
            y = y + h * w
        positions.append(x)
    return np.array(positions)


def test_a_limit_cycle_is_that_between_plastic_stops_at_the_default_step():
    (scenario,) = smc.grid(["van_der_pol"], ["super_twisting"], ["backlash"], 1, "study")
    assert scenario.resolved.physics_step == 1.25e-4
    traces = smc.run(
        [dataclasses.replace(scenario, physics_step=1.25e-4 / k) for k in (1, 2, 4, 8)]
    )
    exact = between_plastic_stops(dataclasses.replace(scenario, duration=8.0), 20)[-2000:].mean()
    assert exact == pytest.approx(3.55e-4, rel=0.02)
    for trace in traces:
        assert trace.x[-2000:].mean() == pytest.approx(exact, rel=0.02)


def test_a_cycle_of_the_adaptive_law_does_not_depend_on_the_step():
    compared = smc.paper.comparison(
        "inverted_pendulum", duration=3.0, changes={"actuator": smc.Backlash(GAP)}
    )
    scenario = next(scenario for scenario in compared.values() if scenario.law.name == "adaptive")
    steps = []
    for k in (1, 2, 4):
        steps.append(scenario.resolved.physics_step / k)
    for trace in smc.run([dataclasses.replace(scenario, physics_step=step) for step in steps]):
        assert smc.score(trace)["ultimate_bound"] == pytest.approx(2.1e-3, rel=0.05)


@smc.law_function(gains={})
def seen(y, gains, memory):
    return 0.0, y.x


def test_friction_is_on_the_side_of_the_gap_that_it_names():
    """A push of a tenth of the friction: on the motor's side it holds the rotor, and the joint stops at
    the flank; on the link's side it holds the joint, and the rotor crosses the play.
    """
    axis = smc.plant_from(AXIS, ["slide"], name="axis")
    fields = {"plant": axis, "law": seen(), "feedforward": smc.Constant(0.5), "duration": 1.0}
    fields |= {"actuator": smc.Backlash(GAP, rotor_inertia=0.4), "v0": 0.02}
    fields |= {"sensor": smc.Encoder(math.inf, side="motor"), "velocity": "measured"}
    motor, link = smc.run(
        [smc.Scenario(friction=smc.Coulomb(5.0, side=side), **fields) for side in ("motor", "link")]
    )
    ends = [(trace.x[-1, 0], trace.s[-1, 0]) for trace in (motor, link)]  # joint, rotor
    assert ends[0] == pytest.approx((GAP / 2, 0.0), abs=0.1 * GAP)
    assert ends[1] == pytest.approx((0.0, GAP / 2), abs=0.1 * GAP)


def test_the_mass_of_a_rotor_on_a_hinge_is_on_its_axis():
    scenario = smc.Scenario(
        plant="inverted_pendulum", law="none", actuator=smc.Backlash(GAP, rotor_inertia=1e-9)
    )
    model = models.with_values(models.compile_model(scenario), scenario)
    rotor = models.moving_joints(model)[1, 0]
    data = mujoco.MjData(model)
    for angle in (0.0, 1.0, math.pi / 2):
        data.qpos[model.jnt_qposadr[rotor]] = angle
        mujoco.mj_forward(model, data)
        assert abs(data.qfrc_bias[model.jnt_dofadr[rotor]]) < 1e-13
    assert model.dof_M0[model.jnt_dofadr[rotor]] == pytest.approx(1e-9, rel=1e-3)
