"""Rankings over a rig's parameter sets, and the commands that make them and identify rigs."""

import dataclasses
import json
import math

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are
from typer.testing import CliRunner

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import search
from smc_mujoco.cli.main import app
from smc_mujoco.identification import ensemble

PENDULUM = smc.rig("simple_pendulum_ak80")
LAWS = (smc.law("pid", kp=30.0, kd=6.0), smc.law("super_twisting"))


@pytest.fixture(scope="module")
def boards(tmp_path_factory):
    runs = ensemble.runs(PENDULUM, LAWS, seeds=16, duration=0.75, starts=smc.starts(0.3))
    table = smc.study(runs, tmp_path_factory.mktemp("study"), progress=False)
    return smc.leaderboard(table, defaults=True)  # super_twisting has its default gains


def test_every_set_is_a_condition_with_its_own_numbers():
    runs = ensemble.runs(PENDULUM, LAWS, seeds=2, duration=1.0, starts=smc.starts(0.3))
    assert len(runs) == 2 * 2 * (1 + len(PENDULUM.ensemble))
    levels = {}
    for run in runs:
        levels[run.condition] = run.friction[0].level
    assert levels == {
        "set 1": 0.21,
        "set 2": 0.18,
        "set 3": 0.24,
        "set 4": 0.18,
        "set 5": 0.24,
    }
    assert {run.resolved.u_max for run in runs} == {12.0}
    assert len({run.resolved.x0 for run in runs}) == 2


@pytest.mark.slow
def test_the_verdict_says_where_one_law_wins(boards):
    lines = {}
    for line in ensemble.verdict(boards).splitlines():
        lines[line.partition(":")[0]] = line
    assert lines["tv_rate"] == "tv_rate: pid wins on all 5 parameter sets"
    assert set(lines) == {board.metric for board in boards}
    for board in boards:
        start = f"{board.metric}: {board.winner or 'no law'} wins on all 5"
        assert lines[board.metric].startswith(start)


def test_a_rig_of_one_set_is_refused():
    sentence = "emps has only one parameter set: choose a rig with"
    with pytest.raises(smc.ScenarioError, match=sentence):
        ensemble.runs(smc.rig("emps"), LAWS)


def test_a_rig_has_laws_and_a_start_of_its_own():
    qube = smc.rig("qube_servo")
    runs = ensemble.runs(qube, seeds=1, duration=0.1)
    assert {run.law.name for run in runs} == {law.name for law in qube.laws}
    assert {run.resolved.x0 for run in runs} == {(0.0, 0.1)}
    many = ensemble.runs(PENDULUM, ["pid"])
    assert {run.duration for run in many} == {10.0}
    assert {run.seed for run in many} == {*range(20)}
    assert {
        len({run.resolved.x0 for run in many if run.condition == f"set {k}"}) for k in range(1, 6)
    } == {20}
    for run in many:
        assert 0.24 - 1e-9 <= run.resolved.x0[0] <= 0.36 + 1e-9
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
            one.scenario("none").plant for one in rig.members().values()
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
    found = ensemble.Candidate(two[1], tuple(two))
    (linear,) = ensemble.tuned(rig, ["linear"], searches=1, budget=1)
    assert linear.sets == (rig.laws[0],)
    assert linear.remark == "not tuned: law 'linear' has no gain to tune: choose another"
    runs = []
    for one in ensemble.runs(rig, [found, linear], seeds=3, duration=0.5):
        if one.condition == "set 2":
            runs.append(one)
    assert [one.law.gains["k"] for one in runs if one.law.name == "regulator"] == [
        300.0,
        600.0,
        300.0,
    ]
    # are alike
    assert {one.law.name: one.limits[0] for one in runs} == {
        "regulator": math.inf,
        "linear": math.inf,
    }


@pytest.mark.slow
def test_a_law_is_tuned_on_a_machine_and_compared_there(tmp_path):
    words = ["compare", "--rig", "simple_pendulum_ak80", "--law", "pid,twisting", "--searches=1"]
    more = ["--seeds", "1", "--duration", "0.5", "--defaults", "--out", str(tmp_path)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ensemble.tuned, "__defaults__", (None, 1, 1, None, None, None, False))
        done = CliRunner().invoke(app, [*words, *more])
    assert done.exit_code == 0, done.output
    assert "twisting(" in done.output
    assert list((tmp_path / "searches").glob("*-twisting-0*.json"))


def test_a_law_by_name_has_the_gains_of_the_rig():
    pid = next(law for law in PENDULUM.laws if law.name == "pid")
    its = {}
    for run in ensemble.runs(PENDULUM, ["pid", "twisting"], seeds=1, duration=0.1):
        its[run.law.name] = run.law
    assert its["pid"] == pid
    assert its["pid"].source.kind == "shipped"
    assert its["twisting"].source.kind == "default"


def test_the_command_identifies_from_files(tmp_path):
    rig = smc.rig("emps")
    smc.run(rig.scenario(duration=0.3, reference=smc.Sine(0.05, 8.0), x0=0.0)).save(
        tmp_path / "run.npz"
    )
    words = [
        "identify",
        "emps",
        str(tmp_path / "run.npz"),
        "--for",
        "mass",
        "--starts",
        "1",
    ]
    done = CliRunner().invoke(app, [*words, "--json", str(tmp_path / "found.json")])
    assert done.exit_code == 0, done.output
    assert "mass" in done.output
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["quantities"]["mass"]["value"] == pytest.approx(95.1089, rel=0.02)
    wrong = CliRunner().invoke(app, [*words, "--columns", "x"])
    assert wrong.exit_code == 2
    assert "columns 'x' cannot be read: write it as x_elbow=angle,t=time" in wrong.output
