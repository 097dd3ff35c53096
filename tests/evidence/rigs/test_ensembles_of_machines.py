"""What published machines rank and tune: their own laws, surfaces and starts."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import search
from smc_mujoco.identification import ensemble


@pytest.mark.quick
def test_a_published_machine_has_laws_and_a_start_of_its_own():
    qube = smc.rig("qube_servo")
    runs = ensemble.runs(qube, seeds=1, duration=0.1)
    assert {run.law.name for run in runs} == {law.name for law in qube.laws}
    assert {run.resolved.x0 for run in runs} == {(0.0, 0.1)}
    with pytest.raises(
        smc.ScenarioError, match="no laws have gains for realaigym_acrobot: give some"
    ):
        ensemble.runs(smc.rig("realaigym_acrobot"))


@pytest.mark.parametrize("name", ["qube_servo", "qube_servo_3", "stepper_furuta"])
def test_the_laws_of_a_rotary_pendulum_slide_on_its_own_surface_of_least_cost(name):
    """With the weights of `rotary_swing_up`, by a Riccati equation of the linear machine, in its
    unit of u.
    """
    rig = smc.rig(name)
    if name == "stepper_furuta":  # of the firmware's model
        rig = smc.rig(name, pendulum_inertia=1.0215e-4)
    scenario = rig.scenario("none")
    p = scenario.plant.values({})
    Jp = p.Jc + p.m * p.l**2
    lever = p.m * p.L * p.l
    weight = p.m * p.grav * p.l
    A = np.zeros((4, 4))
    b = np.zeros((4, 1))
    A[0, 2] = A[1, 3] = 1.0
    if name == "stepper_furuta":  # the arm has the wanted acceleration
        torque = rig.values["arm_inertia"]
        A[3, 1] = weight / Jp
        b[2:, 0] = [1.0, -lever / Jp]
    else:  # a motor on a voltage turns the arm
        (motor,) = scenario.actuator
        torque = motor.torque_constant / motor.resistance
        arm = p.J + motor.rotor_inertia + p.m * p.L**2
        inverse = np.linalg.inv([[arm, lever], [lever, Jp]])
        drag = -p.b - torque * motor.torque_constant
        forces = np.array([[-p.k, 0.0, drag, 0.0], [0.0, weight, 0.0, -p.bq]])
        A[2:] = inverse @ forces
        b[2:, 0] = inverse @ [torque, 0.0]
    R = 2000.0 * torque**2
    (c,) = b.T @ solve_continuous_are(A, b, np.diag([1.0, 10.0, 0.05, 0.05]), [[R]]) / R
    laws = [law for law in rig.laws if "catch" in law.gains]
    assert len(laws) == 4
    for law in laws:
        assert [law.gains[f"c{i}"] for i in (1, 2, 3, 4)] == pytest.approx(c, rel=1e-4)
        assert law.gains["catch"] == pytest.approx(0.05 / torque)


def test_laws_are_tuned_on_every_set_of_the_machine_by_one_rule():
    """A volt and an acceleration are searched about their bounds; absent terms stay away."""
    for name, bound, count in (
        ("qube_servo", 10.0, 4),
        ("stepper_furuta", 20e3 * math.tau / 1600.0, 8),
    ):
        rig = smc.rig(name)
        goal = ensemble.objective(rig)
        assert goal.u_max == pytest.approx(bound)
        assert goal.weight == goal.control_period == rig.scenario("none").control_period
        cases = goal.scenarios(rig.scenario("none").plant, rig.laws[-1])
        assert len(cases) == count
        assert {case.limits for case in cases} == {rig.scenario("none").limits}
        assert [case.plant for case in cases] == [
            member.scenario("none").plant for member in rig.members().values()
        ]
    goal = ensemble.objective(smc.rig("qube_servo"))
    boxes = {
        law.name: set(search.task_of(rig.scenario("none").plant, law, goal, 8, 0, 1, False).box)
        for rig in [smc.rig("qube_servo")]
        for law in rig.laws
    }
    assert boxes["relay"] == boxes["boundary layer"] == boxes["regulator"] == {"k"}
    assert boxes["super-twisting"] == {"k1", "k2"}
    assert boxes["state_feedback"] == {"kp", "kd", "kp_free", "kd_free"}


def test_runs_take_the_gains_of_the_searches_in_turn_and_firmware_keeps_its_own():
    rig = smc.rig("stepper_furuta")
    regulator = next(law for law in rig.laws if law.name == "regulator")
    two = []
    for k in (300.0, 600.0):
        two.append(dataclasses.replace(regulator, gains=dict(regulator.gains) | {"k": k}))
    candidate = ensemble.Candidate(two[1], tuple(two))
    (linear,) = ensemble.tuned(rig, ["linear"], searches=1, budget=1)
    assert linear.sets == (rig.laws[0],)
    assert linear.remark == "not tuned: law 'linear' has no gain to tune: choose another"
    runs = []
    for scenario in ensemble.runs(rig, [candidate, linear], seeds=3, duration=0.5):
        if scenario.condition == "set 2":
            runs.append(scenario)
    assert [scenario.law.gains["k"] for scenario in runs if scenario.law.name == "regulator"] == [
        300.0,
        600.0,
        300.0,
    ]
    # are alike
    assert {scenario.law.name: scenario.limits[0] for scenario in runs} == {
        "regulator": math.inf,
        "linear": math.inf,
    }
