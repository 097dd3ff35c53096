"""Delays, filters and `<pid>`s of a user's file that stay as they are, against MuJoCo's own loop."""

import dataclasses

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.hardware import CommandDelay, PositionServo
from smc_mujoco.simulation import scenario_json

STEP = 1e-3
PERIOD = 5e-3
ARM = """<mujoco model="arm"><compiler angle="radian"/><option timestep="1e-3"/><worldbody>
  <body><joint name="a" axis="0 1 0" damping=".1" armature=".02"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass=".6" contype="0" conaffinity="0"/>
    <body pos=".3 0 0"><joint name="b" axis="0 1 0" damping=".05" armature=".01" range="-2 2"/>
      <geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" mass=".3" contype="0" conaffinity="0"/>
    </body></body></worldbody>
  <actuator>%s %s</actuator>
  <keyframe><key name="home" qpos=".2 .4"/></keyframe></mujoco>"""
SERVO = '<position joint="a" kp="30" kv="1.5" gear="-2" ctrlrange="-2 1" forcerange="-4 3"%s/>'
MOTOR = '<motor joint="b" gear="3" ctrlrange="-.6 .6"%s/>'
PID = """<pid joint="a" kp="30" kv="1.5" ki="40" imax=".02" slewmax="3" gear="-2"
  posrange="-2 1" forcerange="-4 3"/>"""
LATE = ' delay="%g" nsample="%d"'
GOAL = 0.2


@smc.law_function(gains={"kp": 2.0})
def on_command(y, gains, memory):
    """Command the reference, and a share of the error."""
    return y.r - gains.kp * y.e, y.e


def run(plant, **fields):
    fields = {"reference": smc.Sine(0.5, 5.0), "control_period": PERIOD, "x0": (0.5, -0.3)} | fields
    (trace,) = smc.run([smc.Scenario(plant=plant, law=on_command(), physics_step=STEP, **fields)])
    assert trace.failure is None
    return trace


def arm(first, second, timestep="1e-3", step=0.0):
    channels = {"a": smc.Channel(servo=True, set_point_step=step), "b": smc.Channel()}
    text = ARM.replace("1e-3", timestep) % (first, second)
    return smc.plant_from(text, channels, keyframe="home")


def by_mujoco(xml, trace, integrator, begin=lambda model, data: None, step=0.0):
    """Return positions at the samples of a plain loop of MuJoCo with a trace's commands."""
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.timestep = STEP
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    data = mujoco.MjData(model)
    data.qpos[:] = trace.x[0]
    begin(model, data)
    places = []
    for u in trace.u:
        places.append(data.qpos.copy())
        aim = GOAL + u[0]
        if step:
            aim = step * np.floor(aim / step + 0.5)
        data.ctrl[model.actuator_ctrladr] = -2.0 * aim, u[1] / 3.0
        for _ in range(round(PERIOD / STEP)):
            mujoco.mj_step(model, data)
    return np.array(places)


def at_goal(model, data):
    """Let MuJoCo remember the set-point at the goal, as before the first command of a run."""
    for i in np.flatnonzero(model.actuator_delay):
        count = model.actuator_history[i, 0]
        times = STEP * np.arange(-count, 0.0)
        values = np.full(count, -2.0 * GOAL if i == 0 else 0.0)
        mujoco.mj_initCtrlHistory(model, data, i, times, values)


@pytest.mark.quick
@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_each_joint_keeps_the_delay_of_its_actuator(integrator):
    parts = SERVO % (LATE % (0.012, 12)), MOTOR % (LATE % (0.003, 3))
    trace = run(arm(*parts), duration=2.0, integrator=integrator)
    x = by_mujoco(ARM % parts, trace, integrator, at_goal)
    np.testing.assert_allclose(trace.x, x, rtol=0, atol=1e-12)
    prompt = by_mujoco(ARM % (SERVO % "", MOTOR % ""), trace, integrator)
    assert np.abs(trace.x - prompt).max() > 0.01


@pytest.mark.parametrize("sensor", [None, smc.Encoder(delay=0.004)])
@pytest.mark.parametrize("integrator", ["RK4", "implicitfast"])
def test_a_delay_of_all_actuators_is_an_input_delay_to_the_last_bit(integrator, sensor):
    late = LATE % (0.012, 12)
    # the file's timestep is none of the run's
    plant = arm(SERVO % late, MOTOR % late, timestep="4e-3")
    fields = {"duration": 1.0, "integrator": integrator, "sensor": sensor}
    own = run(plant, **fields)
    by_input_delay = run(arm(SERVO % "", MOTOR % ""), input_delay=0.012, **fields)
    np.testing.assert_array_equal(own.x, by_input_delay.x)


def test_all_stages_of_rk4_read_one_command_where_the_last_of_mujoco_reads_the_next():
    parts = SERVO % (LATE % (0.012, 12)), MOTOR % (LATE % (0.003, 3))
    trace = run(arm(*parts), duration=2.0, integrator="RK4")

    def held(model, data):
        at_goal(model, data)
        model.actuator_delay += 0.25 * STEP

    x = by_mujoco(ARM % parts, trace, "RK4", held)
    np.testing.assert_allclose(trace.x, x, rtol=0, atol=1e-12)
    x = by_mujoco(ARM % parts, trace, "RK4", at_goal)
    assert 1e-4 < np.abs(trace.x - x).max() < 1e-2


@pytest.mark.parametrize("integrator", ["RK4", "implicitfast"])
@pytest.mark.parametrize("left_out", ["", 'slewmax="3"', 'ki="40" imax=".02"'])
def test_a_pid_moves_as_that_of_the_file(integrator, left_out):
    parts = PID.replace(left_out, ""), MOTOR % ""
    step = 0.01 if left_out else 0.0  # rad, of the set-point
    trace = run(arm(*parts, step=step), duration=2.0, integrator=integrator)

    def slewed_from_the_goal(model, data):
        if "slewmax" in parts[0]:
            data.act[0] = -2.0 * GOAL

    x = by_mujoco(ARM % parts, trace, integrator, slewed_from_the_goal, step)
    np.testing.assert_allclose(trace.x, x, rtol=0, atol=1e-12)
    assert trace.scenario.efforts == ("rad", "N m")
    plain = by_mujoco(ARM % (SERVO % "", MOTOR % ""), trace, integrator)
    assert np.abs(trace.x - plain).max() > 0.01


@pytest.mark.parametrize("slew", ["", 'slewmax="3"'])
def test_a_pid_goes_on_from_what_it_has_integrated(slew):
    """In the file's gear of -2."""
    parts = PID.replace('slewmax="3"', slew), MOTOR % ""
    plant = arm(*parts)
    servo = next(part for part in smc.Scenario(plant=plant, law="pid").actuator if part.unit)
    begun = dataclasses.replace(servo, on=("a",), integral=0.008)
    trace = run(plant, duration=1.0, integrator="implicitfast", actuator=begun)

    def integrated(model, data):
        data.act[-1] = -2.0 * 0.008
        if slew:
            data.act[0] = -2.0 * GOAL

    x = by_mujoco(ARM % parts, trace, "implicitfast", integrated)
    np.testing.assert_allclose(trace.x, x, rtol=0, atol=1e-12)


LINK = """<mujoco><compiler angle="radian"/><option timestep="2e-3"/><worldbody><body>
  <joint name="j" axis="0 -1 0" damping=".1" range="-2 2"/>
  <geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" mass=".3" contype="0" conaffinity="0"/>
  </body></worldbody><actuator>%s</actuator></mujoco>"""
LATE_MOTOR = '<motor joint="j" ctrlrange="-3 3" delay=".02" nsample="%d"/>'


def link(actuator, **channel):
    return smc.plant_from(LINK % actuator, {"j": smc.Channel(**channel)}, name="link")


@pytest.mark.parametrize(
    ("delay", "samples", "dead_time"), [(0.02, 10, 0.02), (0.021, 20, 0.022), (0.02, 4, 0.008)]
)
def test_a_delay_is_that_which_mujoco_has_at_the_timestep_of_the_file(delay, samples, dead_time):
    part = f'<motor joint="j" ctrlrange="-3 3" delay="{delay}" nsample="{samples}"/>'
    scenario = smc.Scenario(plant=link(part), law="pid")
    (of_file,) = scenario.actuator
    assert isinstance(of_file, CommandDelay)
    assert of_file.dead_time == pytest.approx(dead_time)
    assert scenario.efforts == ("N m",)
    assert scenario.limits == (3.0,)


def test_a_delay_is_kept_in_texts_and_records_and_goes_with_an_ideal_motor():
    late = link(LATE_MOTOR % 10)
    assert late.argument == "FILE.xml:j"
    assert smc.Scenario(plant=link(LATE_MOTOR % 10, motor=True), law="pid").actuator == ()
    scenario = smc.Scenario(plant=late, law="pid")
    back = scenario_json.restore(scenario_json.describe(scenario))
    assert back == scenario
    assert back.actuator == (CommandDelay(0.02),)
    # one of the user's own stands in its place
    own = smc.Scenario(plant=late, law="pid", actuator=CommandDelay(0.05))
    assert own.actuator == (CommandDelay(0.05),)
    with pytest.raises(ScenarioError, match="Lag and PositionServo, and the joint keeps the Com"):
        smc.Scenario(plant=late, law="pid", actuator=(smc.Lag(0.01), PositionServo(9.0)))


def test_the_default_step_divides_the_delay_of_an_actuator():
    fields = {"plant": link(MOTOR.replace('"b"', '"j"') % ""), "law": "pid"}
    steps = []
    for delay in (0.02, 0.0025, 1.0 / 240.0):
        steps.append(smc.Scenario(actuator=CommandDelay(delay), **fields).resolved.physics_step)
    assert steps == [1e-3, 5e-4, 2.5e-4]
    with pytest.raises(ScenarioError, match=r"dead_time 0.003 s would be 0.005 s at .* divides it"):
        smc.Scenario(actuator=CommandDelay(0.003), physics_step=5e-3, control_period=5e-3, **fields)
    with pytest.raises(ScenarioError, match=r"before DCMotor, whose state .* give input_delay"):
        smc.Scenario(actuator=(CommandDelay(0.02), smc.DCMotor()), **fields)


def test_a_delay_that_is_interpolated_is_that_of_mujoco():
    late = ' delay="0.0105" nsample="20" interp="linear"'
    parts = SERVO % late, MOTOR % late
    trace = run(arm(*parts), duration=1.0, integrator="implicitfast")
    x = by_mujoco(ARM % parts, trace, "implicitfast", at_goal)
    np.testing.assert_allclose(trace.x, x, rtol=0, atol=1e-12)


@pytest.mark.parametrize("place", ["qpos", "ctrl"])
def test_another_joint_s_pid_holds_its_place(place):
    """It would pull to 0, as its integral counts from its command."""
    parts = PID, '<motor joint="b"/>'
    ctrl = 'qpos=".2 .4" ctrl="-.6 0 0"' if place == "ctrl" else 'qpos=".2 .4"'
    xml = ARM.replace('qpos=".2 .4"', ctrl) % parts
    plant = smc.plant_from(xml, {"b": smc.Channel(x0=-0.3)}, keyframe="home", measured=["a"])
    assert plant.unmodelled.startswith("a pid has an integral that is not measured")
    (trace,) = smc.run(
        [smc.Scenario(plant=plant, law="pid", physics_step=STEP, duration=1.0, integrator="Euler")]
    )
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.timestep = STEP
    data = mujoco.MjData(model)
    data.qpos[:] = 0.2, -0.3
    data.ctrl[0] = data.act[0] = -0.6 if place == "ctrl" else -2.0 * 0.2
    for x, u in zip(trace.x, trace.u[:, 0], strict=True):
        np.testing.assert_allclose(data.qpos, x[[1, 0]], rtol=0, atol=1e-12)
        data.ctrl[2] = u
        mujoco.mj_step(model, data)


def test_words_say_what_a_late_pid_is_given():
    late = PID.replace("<pid", "<pid delay='.006' nsample='6'")
    with pytest.warns(
        smc.errors.ScenarioWarning, match=r"set-point .*, which it gets 6 ms late, as"
    ):
        smc.plant_from(ARM % (late, MOTOR % ""), ["a", "b"])
    scenario = smc.Scenario(plant=arm(late, MOTOR % ""), law=on_command(), x0=(0.5, -0.3))
    assert scenario.drive_train.words == [
        "u of 'a' of arm is the set-point of its servo, in rad from its goal at 0.2.",
        "The actuator of 'a' of arm gets its command 6 ms late.",
    ]


@pytest.mark.parametrize("integrator", ["RK4", "implicitfast"])
@pytest.mark.parametrize("kind", ["filter", "filterexact"])
def test_a_motor_keeps_its_filter_and_its_delay(kind, integrator):
    late = f' dyntype="{kind}" dynprm=".05" delay=".003" nsample="3"'
    motor = (MOTOR % late).replace("motor", "general")
    trace = run(arm(SERVO % "", motor), duration=1.0, integrator=integrator)

    def held(model, data):
        model.actuator_delay[1] += 0.25 * STEP

    x = by_mujoco(ARM % (SERVO % "", motor), trace, integrator, held)
    np.testing.assert_allclose(trace.x, x, rtol=0, atol=1e-12)
    assert trace.scenario.efforts == ("rad", "N m")
    assert trace.scenario.limits[1] == pytest.approx(1.8)


def test_a_filter_that_is_limited_is_refused():
    motor = '<general joint="j" dyntype="filter" dynprm=".05" actlimited="true" actrange="-1 1"/>'
    with pytest.raises(ScenarioError, match=r"dyntype filter\) with actlimited or actearly"):
        link(motor)


@pytest.mark.parametrize(
    ("given", "needed"),
    [
        ({"imax": 1.0}, {"ki": 1.0}),
        ({"integral": 0.1}, {"ki": 1.0}),
        ({"euler": True}, {"timeconst": 0.1}),
    ],
)
def test_a_number_of_a_servo_that_does_nothing_alone_is_refused(given, needed):
    with pytest.raises(ScenarioError, match=f"does nothing without {min(needed)}"):
        PositionServo(10.0, **given)
    PositionServo(10.0, **given, **needed)
