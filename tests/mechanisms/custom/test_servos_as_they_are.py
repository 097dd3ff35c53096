"""Position servos of a user's file that stay as they are: u is their set-point, about the goal."""

import dataclasses
import math
import warnings
from typing import Any

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.engine.group import why_not
from smc_mujoco.common.errors import ScenarioError, ScenarioWarning
from smc_mujoco.draw import panels
from smc_mujoco.draw.film import arrows
from smc_mujoco.hardware import PositionServo, RateLimit
from smc_mujoco.mechanisms.custom.plant_from import restored
from smc_mujoco.mechanisms.named import from_text
from smc_mujoco.metrics.tip import knows_contacts
from smc_mujoco.robustness.margin_kinds import MARGIN_KINDS
from smc_mujoco.simulation import scenario_json
from smc_mujoco.simulation.conditions import applicable

# many runs here are of default gains; their own test asks for it
pytestmark = pytest.mark.filterwarnings("ignore:.*the default gains of pid are for a force")
ARM = """<mujoco model="arm"><compiler angle="radian"/><worldbody>
  <body><joint name="a" axis="0 1 0" damping=".1" armature=".02"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass=".6" contype="0" conaffinity="0"/>
    <body pos=".3 0 0"><joint name="b" axis="0 1 0" damping=".05" armature=".01" range="-2 2"/>
      <geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" mass=".3" contype="0" conaffinity="0"/>
    </body></body></worldbody>
  <actuator>
    <position joint="a" kp="30" kv="1.5" gear="-2" ctrlrange="-2 1" forcerange="-4 3"/>
    <position joint="b" kp="20" dampratio="1"/>
  </actuator>
  <keyframe><key name="home" qpos=".2 .4"/></keyframe></mujoco>"""
# of the size of a hobby servo's arm: with its set-point at rest it hangs by load over kp
HOBBY = """<mujoco model="hobby"><compiler angle="radian"/><worldbody><body>
  <joint name="j" axis="0 -1 0" damping=".6" armature=".028" frictionloss=".052" range="-1.9 1.9"/>
  <geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" mass=".3" contype="0" conaffinity="0"/>
  </body></worldbody><actuator>%s</actuator></mujoco>"""
POSITION = '<position joint="j" kp="17.8" kv=".1" forcerange="-2.94 2.94" ctrlrange="-1.9 1.9"/>'
MOTOR = """<dcmotor joint="j" motorconst=".05" resistance="2" gear="9" ctrlrange="-12 12"
  saturation=".22" cogging=".002 12 0"%s/>"""
MINE = '<motor joint="j" ctrlrange="-3 3"/>'
BY_EULER = 0.04  # s, of a filter that is not exact
LOAD, RUBS, KP = 0.3 * 9.81 * 0.1, 0.052, 17.8


@smc.law_function(gains={"ki": 0.0, "kp": 0.0}, memory=1)
def on_set_point(y, gains, memory):
    """Command the reference as set-point, and correct it by an outer PI."""
    memory[0] += y.e * y.dt
    return y.r - gains.kp * y.e - gains.ki * memory[0], y.e


def servo(xml, joint="j", name="servo", **fields):
    return smc.plant_from(xml, {joint: smc.Channel(servo=True, **fields)}, name=name)


def run(**fields):
    (trace,) = smc.run([smc.Scenario(**fields)])
    return trace


@pytest.mark.parametrize("integrator", ["RK4", "implicitfast"])
@pytest.mark.parametrize("late", [0, 2])
@pytest.mark.parametrize("timeconst", [0.0, 0.05, BY_EULER])
def test_a_servo_moves_as_that_of_the_file_whose_ctrl_is_the_set_point(integrator, late, timeconst):
    step = 0.01
    xml = ARM.replace('kv="1.5"', f'kv="1.5" timeconst="{timeconst}"')
    if timeconst == BY_EULER:
        gains = 'gainprm="30" biastype="affine" biasprm="0 -30 -1.5"'
        xml = ARM.replace("<position", f'<general dyntype="filter" dynprm="{timeconst}" {gains}', 1)
        xml = xml.replace('kp="30" kv="1.5"', "", 1)
    channels = {
        "a": smc.Channel(servo=True, x0=0.5),
        "b": smc.Channel(servo=True, x0=-0.3, set_point_step=step),
    }
    arm = smc.plant_from(xml, channels, keyframe="home")
    law = on_set_point(kp=0.7, ki=2.0)
    fields = {"reference": smc.Sine(0.6, 5.0), "control_period": 5e-3, "physics_step": 1e-3}
    trace = run(
        plant=arm,
        law=law,
        duration=2.0,
        integrator=integrator,
        input_delay=late * 5e-3,
        **fields,
    )
    assert trace.failure is None
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.timestep = 1e-3
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    data = mujoco.MjData(model)
    data.qpos[:] = 0.5, -0.3
    data.act[:] = -2.0 * 0.2  # the goal
    for k in range(len(trace.t) - 1):
        np.testing.assert_allclose(data.qpos, trace.x[k], rtol=0, atol=1e-12)
        u = trace.u[k - late] if k >= late else np.zeros(2)
        aim = np.array([0.2, 0.4]) + u
        aim[1] = step * math.floor(aim[1] / step + 0.5)
        data.ctrl[:] = -2.0 * aim[0], aim[1]
        for _ in range(5):
            mujoco.mj_step(model, data)
    assert trace.force[:, 0].min() == -6.0  # gear times an end of the forcerange


def test_a_servo_hangs_by_its_load_and_an_outer_integral_removes_that():
    fields = {"plant": servo(HOBBY % POSITION), "reference": smc.Constant(0.0), "x0": 0.3}
    alone = run(law=on_set_point(), duration=4.0, **fields)
    assert abs(alone.x[-1, 0] + LOAD / KP) <= 1.01 * RUBS / KP  # -.0165 +- .0029
    outer = run(law=on_set_point(kp=0.5, ki=5.0), control_period=0.02, duration=6.0, **fields)
    assert abs(outer.x[-1, 0]) < 1e-6
    assert outer.units()["u"] == "rad"
    assert outer.units()["force"] == "N m"
    late = run(law=on_set_point(), duration=0.1, input_delay=0.03, **fields | {"x0": 0.0})
    assert late.scenario.efforts == ("rad",)


@pytest.mark.quick
def test_a_bound_and_a_goal_follow_from_the_file():
    arm = smc.plant_from(
        ARM, {"a": smc.Channel(servo=True), "b": smc.Channel(servo=True)}, keyframe="home"
    )
    a, b = smc.Scenario(plant=arm, law="pid").actuator
    assert (a.kp, a.kv, a.forcerange, a.ctrlrange, a.goal) == (
        120.0,
        6.0,
        (-6.0, 8.0),
        (-0.5, 1.0),
        0.2,
    )
    far = smc.Scenario(plant=arm, law="pid", reference=[smc.Constant(2.0), smc.Constant(-2.0)])
    assert far.limits == (0.8, 2.4)  # ctrlrange or range, about the goal
    assert b.kp == 20.0
    assert b.kv > 0.0
    assert b.bound is None
    bounded = servo(HOBBY % POSITION, u_max=0.7)
    assert smc.Scenario(plant=bounded, law="pid").limits == (0.7,)
    assert arm.argument == "FILE.xml:a(servo)+b(servo)@home"


@pytest.mark.quick
def test_what_a_joint_bears_bounds_its_servo_and_what_is_sized_by_it():
    """Friction was sized by kp times the set-point's bound, 12 N m where the joint takes 10."""
    limited = HOBBY.replace("<joint ", '<joint actuatorfrcrange="-3 2" ')
    arm = servo(limited % '<position joint="j" kp="900" kv="9" forcerange="-50 50"/>')
    (scenario,) = smc.grid(arm, smc.law("pid"), "coulomb")
    assert scenario.actuator[0].forcerange == (-3.0, 2.0)
    assert scenario.friction[0].level == pytest.approx(2.0 / 60.0)


FREE = '<position joint="j" kp="17.8"/>'
REFUSED = {
    "a motor": ('<motor joint="j"/>', {}, ["is a motor", "servo=True is for", "leave servo out"]),
    "a bounded lag": (
        '<position joint="j" kp="9" timeconst=".1" actlimited="true" actrange="-1 1"/>',
        {},
        ["actlimited"],
    ),
    "another gain": (
        '<general joint="j" gainprm="9" biastype="affine" biasprm="0 -8 0"/>',
        {},
        ["gain 9", "-8"],
    ),
    "a constant force": (
        '<general joint="j" gainprm="9" biastype="affine" biasprm="1 -9 0"/>',
        {},
        ["bias 1"],
    ),
    "one way": ('<position joint="j" kp="9" forcerange="0 3"/>', {}, ["0 to 3", "motor=True"]),
    "a pid of a speed": ('<pid joint="j" kv="9" input="vel"/>', {}, ["without a position"]),
    "a pid that moves": (
        '<pid joint="j" kp="9" kv="1" velrange=".1 2"/>',
        {},
        ["velrange 0.1 to 2", "leaves out 0"],
    ),
    "a late winding": (
        '<dcmotor joint="j" motorconst=".05" resistance="2" inductance=".04 0" delay=".02" nsample="10"/>',
        {},
        ["inductance and a delay"],
    ),
    "a controller": (
        '<dcmotor joint="j" motorconst=".05" resistance="2" lugre="1 1 .1 .2 .1"/>',
        {},
        ["controller, heat, friction"],
    ),
    "a slew rate": (
        '<dcmotor joint="j" motorconst=".05" resistance="2" saturation="0 0 3"/>',
        {},
        ["slew rate"],
    ),
    "a motor without a bound": (
        '<dcmotor joint="j" motorconst=".05" resistance="2"/>',
        {},
        ["<dcmotor>", "no ctrlrange", "u_max="],
    ),
    "steps of a voltage": (MOTOR % "", {"set_point_step": 0.1}, ["has no set-point"]),
    "uneven": (
        '<dcmotor joint="j" motorconst=".05" resistance="2" ctrlrange="-6 12"/>',
        {},
        ["-6 to 12"],
    ),
    "two things": (POSITION, {"motor": True}, ["motor=True", "servo=True"]),
    "a step without a servo": (POSITION, {"servo": False, "set_point_step": 0.1}, ["0.1", "servo"]),
    "no bound": (FREE, {"range": ""}, ["no ctrlrange", "u_max="]),
    "as a force": (POSITION, {"servo": False}, ["servo=False", "leave servo out", "j(motor)"]),
}


@pytest.mark.parametrize(
    ("drive", "u", "text"),
    [
        (POSITION, "the set-point of its servo, in rad from its goal at 0", "j(servo)"),
        (MOTOR % "", "the voltage of its motor, in V", "j(servo)"),
        (MINE, "", "j"),
    ],
)
def test_an_actuator_is_used_as_it_is_and_u_is_told_where_it_is_no_force(drive, u, text):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        taken = smc.plant_from(HOBBY % drive, ["j"], name="servo")
    sentences = [str(warning.message) for warning in caught if "u of 'j'" in str(warning.message)]
    assert len(sentences) == bool(u)
    assert all(u in sentence for sentence in sentences)
    # it is the plant of one who says so, also in texts and records
    said = smc.plant_from(HOBBY % drive, {"j": smc.Channel(servo=bool(u))}, name="servo")
    assert taken == said
    assert taken.argument == f"FILE.xml:{text}"
    build: Any = taken.build
    record = build.about()
    assert ("servo" in record["channels"]["j"]) == bool(u)  # as in older records
    assert restored(record, "servo") == taken


@pytest.mark.parametrize("case", REFUSED)
def test_what_servo_true_does_not_take_is_said(case):
    actuator, fields, words = REFUSED[case]
    xml = HOBBY % actuator
    if "range" in fields:
        xml = xml.replace('range="-1.9 1.9"/>', "/>")
    channel = {"servo": True} | {name: value for name, value in fields.items() if name != "range"}
    with pytest.raises(ScenarioError) as error:
        smc.plant_from(xml, {"j": channel})
    for word in words:
        assert word in str(error.value)


BESIDE = {
    "nominal": ({"model": "nominal"}, "give model='none'"),
    "of_model": ({"law": "mpc"}, "give model=.none."),
    "two": ({"actuator": (smc.Lag(0.01), RateLimit(9.0))}, "keeps the PositionServo"),
    "motor": ({"actuator": smc.DCMotor()}, "DCMotor, and the joint keeps the PositionServo"),
    "fault": ({"fault": smc.Fault(at=1.0, gain=0.5)}, "stuck=True"),
}


@pytest.mark.parametrize("case", BESIDE)
def test_what_a_servo_does_not_stand_beside_is_said(case):
    fields, words = BESIDE[case]
    with pytest.raises(ScenarioError, match=words):
        smc.Scenario(plant=servo(HOBBY % POSITION), **{"law": "pid"} | fields)


def test_a_trace_of_a_servo_is_read_back(tmp_path):
    plant = servo(HOBBY % POSITION, set_point_step=0.01)
    trace = run(plant=plant, law="pid", x0=0.3, duration=0.1, actuator=smc.Backlash(0.01))
    back = smc.load(trace.save(tmp_path / "servo.npz"))
    assert back.scenario == trace.scenario
    assert [type(part) for part in back.scenario.actuator] == [PositionServo, smc.Backlash]
    np.testing.assert_array_equal(run_again(back.scenario).x, trace.x)


@pytest.mark.parametrize("recorded", [False, True])
def test_another_plant_has_its_own_servo(recorded):
    first = smc.Scenario(plant=servo(HOBBY % POSITION), law="pid", actuator=smc.Backlash(0.01))
    if recorded:
        first = scenario_json.restore(scenario_json.describe(first))
    weak = servo(HOBBY % POSITION.replace("17.8", "9"))
    second = dataclasses.replace(first, plant=weak)
    assert [part.kp for part in second.actuator[:1]] == [9.0]
    assert second.actuator[1:] == (smc.Backlash(0.01),)
    ideal = smc.plant_from(HOBBY % POSITION, {"j": smc.Channel(motor=True)})
    assert dataclasses.replace(first, plant=ideal).actuator == (smc.Backlash(0.01),)
    # one of the user's own stays
    stiff = dataclasses.replace(first.actuator[0], kp=40.0)
    own = dataclasses.replace(first, actuator=(stiff, smc.Backlash(0.01)))
    assert dataclasses.replace(own, plant=weak).actuator == own.actuator


def test_a_text_keeps_a_servo_and_its_steps(tmp_path):
    (tmp_path / "hobby.xml").write_text(HOBBY % POSITION)
    plant = from_text("hobby.xml:j(servo,set_point_step=0.01)", tmp_path)
    (part,) = smc.Scenario(plant=plant, law="pid").actuator
    assert (part.kp, part.step) == (17.8, 0.01)
    assert plant.argument.endswith("hobby.xml:j(servo,set_point_step=0.01)")


def test_contacts_of_a_run_with_steps_of_a_set_point_are_unknown():
    stops = {
        "contact": smc.Wall("arm", direction=(0, 0, -1), gap=0.05),
        "x0": 0.1,
        "duration": 0.1,
        "law": "pid",
    }
    xml = (HOBBY % POSITION).replace("<body>", '<body name="arm" pos="0 0 1">')
    assert knows_contacts(smc.Scenario(plant=servo(xml), **stops))
    assert not knows_contacts(smc.Scenario(plant=servo(xml, set_point_step=0.01), **stops))


@pytest.mark.parametrize("integrator", ["RK4", "implicitfast"])
def test_a_dcmotor_moves_as_that_of_the_file_whose_ctrl_is_the_voltage(integrator):
    xml = BARE.replace(POSITION, MOTOR % "")
    fields = {"control_period": 5e-3, "physics_step": 1e-3, "integrator": integrator}
    law = smc.law("pid", kp=40.0, ki=20.0, kd=2.0)
    plant = servo(xml)
    trace = run(plant=plant, law=law, x0=0.5, duration=2.0, reference=smc.Sine(0.6, 5.0), **fields)
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.timestep = 1e-3
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    data = mujoco.MjData(model)
    data.qpos[:] = 0.5
    for k in range(len(trace.t) - 1):
        np.testing.assert_allclose(data.qpos, trace.x[k], rtol=0, atol=1e-12)
        data.ctrl[:] = trace.u[k]
        for _ in range(5):
            mujoco.mj_step(model, data)
    assert trace.units()["u"] == "V"
    assert np.abs(trace.u).max() == 12.0
    assert 9 * 0.22 <= np.abs(trace.force).max() <= 9 * (0.22 + 0.002)  # cogging is not cut
    assert not plant.unmodelled


def test_the_winding_of_a_dcmotor_is_kept():
    xml = BARE.replace(POSITION, MOTOR.replace("cogging", 'inductance=".04 0" cogging') % "")
    (part,) = smc.Scenario(plant=servo(xml), law="pid").actuator
    assert part.delay == pytest.approx(0.02)
    lagged = smc.Scenario(plant=servo(xml), law="pid", actuator=smc.Lag(0.01))
    assert lagged.actuator == (smc.Lag(0.01), part)
    with pytest.raises(ScenarioError, match="RateLimit, and the joint keeps the DCMotor"):
        smc.Scenario(plant=servo(xml), law="pid", actuator=RateLimit(9.0))
    trace = run(plant=servo(xml), law=smc.law("pid"), x0=0.5, duration=0.5, physics_step=1e-4)
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.timestep = 1e-4
    data = mujoco.MjData(model)
    data.qpos[:] = 0.5
    for k in range(len(trace.t) - 1):
        data.ctrl[:] = trace.u[k]
        for _ in range(10):
            mujoco.mj_step(model, data)
    assert abs(data.qpos[0] - trace.x[-1, 0]) < 1e-4


def run_again(scenario):
    (trace,) = smc.run([scenario])
    return trace


# without weight and friction
BARE = (HOBBY % POSITION).replace("<worldbody>", '<option gravity="0 0 0"/><worldbody>', 1)
BARE = BARE.replace('frictionloss=".052" range="-1.9 1.9"', "")


@smc.law_function(gains={"one": 1.0})
def follow(y, gains, memory):
    return gains.one * y.r, y.e


def test_a_lag_before_a_servo_filters_its_set_point():
    tau, fine = 0.05, 1e-5
    fields = {"reference": smc.Sine(0.6, 5.0), "x0": 0.5, "duration": 1.0, "control_period": 5e-3}
    lag = {"actuator": smc.Lag(tau), "physics_step": 1e-3}
    trace = run(plant=servo(BARE), law=on_set_point(kp=0.7, ki=2.0), **fields, **lag)
    model = mujoco.MjModel.from_xml_string(BARE)
    model.opt.timestep = fine
    data = mujoco.MjData(model)
    data.qpos[:] = 0.5
    aim = 0.0
    for k in range(len(trace.t) - 1):
        assert abs(data.qpos[0] - trace.x[k, 0]) < 5e-5
        for _ in range(500):  # the lag's output in the middle of a step, and at its end
            data.ctrl[:] = trace.u[k] + (aim - trace.u[k]) * math.exp(-0.5 * fine / tau)
            aim = trace.u[k, 0] + (aim - trace.u[k, 0]) * math.exp(-fine / tau)
            mujoco.mj_step(model, data)
    with pytest.raises(ScenarioError, match=r"steps of 0\.1, and not behind a Lag"):
        smc.Scenario(plant=servo(BARE, set_point_step=0.1), law="pid", actuator=smc.Lag(tau))


def test_a_rate_limit_before_a_servo_is_its_profile_velocity():
    """As a file's own slewmax, and as MuJoCo alone moves with a set-point that is moved by hand."""
    fields = {"reference": smc.Constant(1.0), "x0": 0.0, "duration": 3.0, "control_period": 5e-3}
    fields |= {"law": follow()}
    limited = run(plant=servo(BARE), actuator=RateLimit(0.48), **fields)
    model = mujoco.MjModel.from_xml_string(BARE)
    model.opt.timestep = fine = 1e-4
    data = mujoco.MjData(model)
    for k in range(len(limited.t) - 1):
        assert abs(data.qpos[0] - limited.x[k, 0]) < 1e-4
        for i in range(50):
            data.ctrl[:] = min(1.0, 0.48 * (limited.t[k] + fine * (i + 0.5)))
            mujoco.mj_step(model, data)
    by_file = BARE.replace("<position", "<pid").replace('kv=".1"', 'kv=".1" slewmax=".48"')
    slewed = run(plant=servo(by_file), **fields)
    assert np.abs(slewed.x - limited.x).max() < 1e-3
    assert 1.5 < limited.t[np.argmax(limited.x[:, 0] > 0.9)] < 2.1
    for plant in (servo(BARE, set_point_step=0.1), servo(by_file)):
        with pytest.raises(ScenarioError, match="RateLimit: leave one of them out"):
            smc.Scenario(plant=plant, law="pid", actuator=RateLimit(0.48))


def test_gains_tables_figures_and_files_have_the_unit_of_the_set_point(tmp_path):
    plant = servo(HOBBY % POSITION, name="hobby")
    units = smc.design.objective(plant, "pid").units
    assert units == {"kp": "1", "ki": "1/s", "kd": "s", "tt": "s"}
    trace = run(plant=plant, law="pid", x0=0.3, duration=0.5)
    header = trace.export(tmp_path / "run.csv").read_text().splitlines()[0]
    assert "u [rad]" in header
    assert "force [N m]" in header
    labels = [ax.get_ylabel() for ax in smc.figure(trace).axes]
    assert "j u (rad)" in labels
    assert "j delivered (N·m)" in labels
    table = smc.study(
        smc.grid(plant, [smc.law("pid")], "nominal", seeds=2, duration=0.1), tmp_path / "runs"
    )
    labels = [ax.get_xlabel().replace("\n", " ") for ax in smc.plot(table).axes]
    assert "variation of u (rad/s)" in labels
    said = "u of 'j' of hobby is the set-point of its servo, in rad from its goal at 0."
    printed = " ".join(str(smc.leaderboard(table, ["tv_rate"])).split())
    assert said in printed
    assert "Default gains are for a force: tune them for this u first." in printed


def test_default_gains_before_a_servo_are_told_when_they_run():
    fields = {"plant": servo(HOBBY % POSITION, name="hobby"), "x0": 0.3, "duration": 0.01}
    words = "u of 'j' of hobby is the set-point .*, and the default gains of pid are for a force"
    with pytest.warns(ScenarioWarning, match=words):
        run(law="pid", **fields)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*default gains of pid are for a force")
        run(law=smc.law("pid", kp=0.5, ki=0.0, kd=0.0), **fields)
        run(law=on_set_point(), **fields)
        run(law="pid", **fields | {"plant": smc.plant_from(HOBBY % MINE, ["j"])})


def test_a_tuning_is_silent_on_gains_that_it_only_tries():
    plant = servo(HOBBY % POSITION, name="hobby")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        smc.tune(plant, "pid", conditions=["nominal"], budget=2, searches=1)
    assert not [warning for warning in caught if "default gains" in str(warning.message)]


def test_sizes_of_conditions_and_blows_follow_from_the_servo_s_force():
    plant = servo(HOBBY % POSITION, name="hobby")
    (friction,) = smc.grid(plant, [smc.law("pid")], "coulomb", duration=0.1)
    assert friction.friction[0].level == pytest.approx(2.94 / 60.0)
    assert friction.drive_train.forces == [2.94]
    ideal = smc.plant_from(HOBBY % POSITION, {"j": smc.Channel(motor=True)}, name="hobby")
    blows = [
        MARGIN_KINDS["blow"].size(smc.Scenario(plant=machine, law="pid", x0=0.3))
        for machine in (plant, ideal)
    ]
    assert blows[0] == pytest.approx(blows[1])


def test_joints_with_a_servo_and_with_a_motor_are_not_tuned_together():
    channels = {"a": smc.Channel(servo=True), "b": smc.Channel(motor=True)}
    with pytest.raises(ScenarioError, match=r"commands in rad and N m.* give a\(motor\)"):
        smc.design.objective(smc.plant_from(ARM, channels, keyframe="home"), "pid")


def test_the_fast_engine_says_what_of_a_servo_it_cannot():
    scenario = smc.Scenario(plant="duffing", law="pid", actuator=PositionServo(kp=9.0))
    assert "an actuator other than" in why_not(scenario)


def test_a_comparison_leaves_out_the_conditions_with_another_drive():
    remaining = applicable(
        ["nominal", "dc_motor", "lag_20ms", "fault", "backlash"], [servo(BARE)], 1.0
    )
    assert remaining == ["nominal", "lag_20ms", "backlash"]


def test_a_voltage_beside_a_set_point_is_never_pooled_with_it():
    """A figure has the unit of each channel, and a metric of u has no one value."""
    text = ARM.replace(
        '<position joint="a" kp="30" kv="1.5" gear="-2" ctrlrange="-2 1" forcerange="-4 3"/>',
        '<dcmotor joint="a" motorconst=".05" resistance="2" gear="9" ctrlrange="-12 12"/>',
    )
    channels = {joint: smc.Channel(servo=True) for joint in "ab"}
    arm = smc.plant_from(text, channels, keyframe="home")
    trace = run(plant=arm, law=on_set_point(kp=0.1), duration=0.2, x0=0.1)
    labels = [ax.get_ylabel() for ax in smc.figure([trace]).axes]
    assert [label for label in labels if " u " in label] == ["a u (V)", "b u (rad)"]
    for quantity in ("u", "applied"):
        units = [panel.scale[1] for panel in panels.over_groups([trace], quantity)]
        assert units == [" (V)", " (rad)"]
    scales = arrows.scales_by_channel(arrows.scales([trace]))
    assert [scale.units[0] for scale in scales] == ["V", "rad"]
    motor, servo = scales
    assert motor.full == motor.control
    assert servo.control == 0.0  # a set-point has no arrow
    assert {"itae", "hf_share"} <= set(smc.score(trace))
    assert not {"tv_rate", "max_u", "energy"} & set(smc.score(trace))
    assert not {"tv_rate", "max_u", "energy"} & set(smc.scores(trace)["driven"])
    with pytest.raises(ScenarioError, match="u is in V and rad, as in arm: take a metric of the"):
        smc.metrics.catalogue.tv_rate(trace)
    assert smc.metrics.joint_scores(trace)["b"]["max_u"] == np.abs(trace.u[:, 1]).max()
    assert trace.scenario.drive_train.words == [
        "u of 'a' of arm is the voltage of its motor, in V.",
        "u of 'b' of arm is the set-point of its servo, in rad from its goal at 0.4.",
    ]


def test_a_text_is_no_file_in_what_is_said_of_it():
    broken = (HOBBY % POSITION).replace("<geom", "<goem")
    with pytest.raises(ScenarioError, match=r"the text of model 'hobby' \(.*: fix it$"):
        smc.plant_from(broken, ["j"])
    with pytest.raises(ScenarioError, match="unknown joint of the text of model 'hobby' 'k'"):
        smc.plant_from(HOBBY % POSITION, ["k"])
    assert smc.plant_from(HOBBY % POSITION, {"j": smc.Channel(servo=True)}).name == "hobby"


def test_traces_in_a_list_are_to_be_scored_one_at_a_time():
    trace = run(plant="duffing", law="pid", duration=0.1)
    with pytest.raises(ScenarioError, match="score a list of traces one at a time"):
        smc.score([trace])
    with pytest.raises(ScenarioError, match=r"in Python smc.law\('pid'\)"):
        smc.grid(servo(HOBBY % POSITION), ["pid"])


@pytest.mark.parametrize(
    ("fields", "farthest", "lead"),
    [
        ({}, 1.2 * 0.3, 0.0),
        ({"x0": -0.6}, 1.2 * 0.6, 0.0),
        ({"reference": smc.Constant(1.0)}, 1.0, 0.0),
        ({"reference": smc.Sine(0.5, 2.0)}, 0.5, 0.1 * 1.0 / KP),
    ],
)
def test_a_set_point_goes_no_farther_by_default_than_a_run_asks_for(fields, farthest, lead):
    """Beyond the farthest place of the joint by 2.94 N m / kp the servo gives all its force, so a
    law that drives the set-point on only winds it up: 1.9 rad past the goal in a step of 0.3.
    """
    plant = servo(HOBBY % POSITION)
    scenario = smc.Scenario(plant=plant, law="pid", duration=4.0, **fields)
    assert scenario.limits[0] == pytest.approx(farthest + lead + 2.94 / KP, rel=0.04)  # two digits
    own = servo(HOBBY % POSITION, u_max=1.7)
    assert smc.Scenario(plant=own, law="pid", **fields).limits == (1.7,)
    assert smc.Scenario(plant=plant, law="pid", u_max=1.6, **fields).limits == (1.6,)
