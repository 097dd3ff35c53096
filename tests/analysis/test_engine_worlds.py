"""The callback of a world around MuJoCo's own physics step, in double precision, against a run."""

import math
import random

import numpy as np
import pytest
from helpers import mujoco_worlds
from helpers.arms import arm

import smc_mujoco as smc
from smc_mujoco.analysis.engine import worlds
from smc_mujoco.analysis.engine.form import FAILED_STEP, FAILURE, SCORES
from smc_mujoco.analysis.engine.scores import RESTING, engine_metrics, holds
from smc_mujoco.control.law import law_catalogue as laws
from smc_mujoco.hardware import RateLimit
from smc_mujoco.metrics import catalogue
from smc_mujoco.signals import MinimumJerk, OrnsteinUhlenbeck, Relay
from smc_mujoco.simulation import state

EVERY = frozenset(engine_metrics())  # metrics
AGREES = 1e-12  # relative: both take the same steps in double precision
FEW = frozenset(("energy", "iae", "max_u", "steady_error", "tv"))  # of x, v and u
WALL = """
<mujoco model="wall">
  <default><geom type="capsule" size="0.03" contype="1" conaffinity="2"/></default>
  <worldbody>
    <geom name="wall" type="box" size=".05 .5 .5" pos=".3 0 .5" contype="2" conaffinity="1"/>
    <body pos="0 0 1.2">
      <joint name="shoulder" axis="0 1 0" damping="0.1"/>
      <geom fromto="0 0 0 0 0 -0.5" mass="1.5"/>
      <body name="hand" pos="0 0 -0.5">
        <joint name="elbow" axis="0 1 0" damping="0.1" range="-60 60"/>
        <geom name="fore" fromto="0 0 0 0 0 -0.4" mass="0.8"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="shoulder" ctrlrange="-40 40"/><motor joint="elbow" ctrlrange="-20 20"/>
  </actuator>
</mujoco>
"""
CART = """
<mujoco model="cart">
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <body>
      <joint name="cart" type="slide" axis="1 0 0"/><geom type="box" size=".1 .1 .1" mass="1"/>
      <body><joint name="pole" axis="0 1 0"/><geom type="capsule" size=".02" fromto="0 0 0 0 0 -.6" mass=".2"/></body>
    </body>
  </worldbody>
  <actuator><motor joint="cart"/></actuator>
</mujoco>
"""
SINE = smc.Sine(0.5, 5.0)
CONDITIONS = {
    "nominal": {},
    "noise": {"noise": smc.Noise(1e-4, 1e-3)},
    "delay": {"input_delay": 3e-3, "control_period": 2e-3},
    "missed": {"clock": smc.Clock(missed=0.1)},
    "late": {"clock": smc.Clock(jitter=5e-4), "physics_step": 2.5e-4},
    "encoder": {"sensor": smc.Encoder(4096, bias=1e-3, dropout=0.1), "velocity": "levant"},
    "late sensor": {"sensor": smc.Encoder(2048, period=4e-3, delay=3e-3)},
    "sine": {"disturbance": SINE},
    "relay": {"disturbance": (Relay(0.2, rate=1.0), OrnsteinUhlenbeck(0.2, 0.1))},
    "lag": {"actuator": smc.Lag(0.01), "disturbance": SINE},
    "rate": {"actuator": (smc.Lag(0.01), RateLimit(200.0))},
    "friction": {"friction": (smc.Coulomb(0.5), smc.Viscous(0.25))},
    "mass": {"mismatch": {"m": 1.2}},
    "fault": {"fault": smc.Fault(0.1, gain=0.6)},
    "moving": {"reference": MinimumJerk(0.2, 0.1, 0.2), "feedforward": smc.Constant(0.1)},
}
LAWS = [name for name, law in laws().items() if not law.plants and law.function is not None]


PLANTS = {
    "arm": arm,
    "panda": lambda: smc.plant("panda"),
    "wall": lambda: smc.plant_from(
        WALL, {"shoulder": smc.Channel(x0=0.3), "elbow": smc.Channel(x0=-0.3)}
    ),
    "cart": lambda: smc.plant_from(CART, ["cart"], name="own cart"),
}


def check(plant, law, conditions, duration=0.3, seeds=2, of=EVERY):
    """Compare the scores of runs, in worlds of one model, with those of their traces."""
    cases = []
    for seed in range(seeds):
        x0 = tuple(x + 0.1 - 0.02 * seed for x in plant.x0)
        cases.append(
            smc.Scenario(plant=plant, law=law, duration=duration, seed=seed, x0=x0, **conditions)
        )
    moving = not all(isinstance(signal, smc.Constant) for signal in cases[0].references)
    metrics = catalogue.CATALOGUE.keys() & of
    metrics = sorted(metrics.difference(RESTING if moving else ()))
    metrics = [
        name for name in metrics if not (holds(name) or catalogue.CATALOGUE[name].refusal(plant))
    ]
    assert worlds.why_not(cases[0], metrics, "cpu") == ""
    assert len(set(map(worlds.WorldGroup.key_of, cases))) == 1
    world_group = worlds.WorldGroup(cases, metrics)
    scores_found = mujoco_worlds.run_rows(world_group, world_group.rows)
    for scores, trace in zip(scores_found, smc.run(cases), strict=True):
        if trace.diverged_at is not None:
            assert scores[FAILURE] != state.FINE
            step = trace.scenario.resolved.physics_step
            assert scores[FAILED_STEP] * step == pytest.approx(trace.diverged_at)
            continue
        assert scores[FAILURE] == state.FINE
        for name, value in zip(metrics, scores[SCORES:], strict=True):
            expected = getattr(catalogue, name)(trace)
            assert value == pytest.approx(expected, rel=AGREES, nan_ok=True), name


def test_runs_in_worlds_are_those_of_mujoco():
    plant = PLANTS["wall"]()
    fields = ("noise", "delay", "missed", "encoder", "lag", "friction", "mass")
    mixed = {name: value for key in fields for name, value in CONDITIONS[key].items()}
    check(plant, smc.law("super_twisting"), mixed, of=FEW)


@pytest.mark.slow
@pytest.mark.parametrize("condition", CONDITIONS)
def test_runs_in_worlds_of_each_condition_are_those_of_mujoco(condition):
    check(PLANTS["wall"](), smc.law("pid"), CONDITIONS[condition])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_runs_in_worlds_that_are_drawn_are_those_of_mujoco(seed):
    draw = random.Random(seed)
    plant = PLANTS[draw.choice(sorted(PLANTS))]()
    fields = {}
    for name in draw.sample(sorted(CONDITIONS), 4):
        fields |= CONDITIONS[name]
    check(plant, smc.law(draw.choice(LAWS)), fields)


REFUSED = {
    "nominal model": {"law": "computed_torque", "model": "nominal"},
    "base": {"plant": "quadrotor", "law": "geometric"},
    "callback": {"friction": smc.hardware.Sigmoid(0.4, 50.0)},
    "actuator": {"actuator": smc.DCMotor()},
    "jump": {"jump": smc.Jump(0.1, {"m": 2.0})},
    "body": {"disturbance": smc.signals.Push("hand", x=1.0)},
}


@pytest.mark.quick
@pytest.mark.parametrize("what", REFUSED)
def test_what_a_world_cannot_run_is_told(what):
    fields = {"plant": PLANTS["wall"](), "law": "pid"} | REFUSED[what]
    scenario = smc.Scenario(duration=0.3, **fields)
    assert what in worlds.why_not(scenario, (), "cpu")


def test_a_metric_that_is_not_summed_up_is_told():
    scenario = smc.Scenario(plant=PLANTS["wall"](), law="pid", duration=0.3)
    assert "overshoot" in worlds.why_not(scenario, ("overshoot",), "cpu")


def test_a_metric_of_friction_that_holds_is_told():
    scenario = smc.Scenario(plant=PLANTS["wall"](), law="pid", duration=0.3)
    assert "holds" in worlds.why_not(scenario, ("stick_time",), "cpu")


def test_a_metric_that_has_no_one_value_is_mujocos():
    scenario = smc.Scenario(plant=arm(), law="pid", duration=0.3)
    assert "m and rad" in worlds.why_not(scenario, ("itae", "energy"), "cpu")


@smc.law_function(gains={"k": 0.5, "reach": math.inf})
def raising(y, gains, memory):
    if abs(y.x) > gains.reach:
        raise ValueError("too far")
    return -gains.k * (y.e + y.de), y.e


def test_a_world_that_fails_leaves_the_others_as_they_are():
    plant = PLANTS["wall"]()
    cases = []
    for law, duration in [(raising(), 0.1), (raising(reach=0.0), 0.1), (raising(k=-1e4), 0.1)]:
        cases.append(smc.Scenario(plant=plant, law=law, duration=duration, u_max=1e9))
    cases.append(smc.Scenario(plant=plant, law=raising(), duration=0.03))
    world_group = worlds.WorldGroup(cases, ("itae",))
    scores = mujoco_worlds.run_rows(world_group, world_group.rows)
    assert scores[:, FAILURE].tolist()[:2] == [state.FINE, state.RAISED]
    assert scores[3, FAILURE] == state.FINE
    traces = smc.run([cases[0], cases[3]])
    expected = [catalogue.score(trace)["itae"] for trace in traces]
    np.testing.assert_allclose(scores[[0, 3], SCORES], expected, rtol=AGREES)
