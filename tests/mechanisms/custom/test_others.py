"""Joints without a channel, the scales of joints with one, goals and starts, on three machines."""

import contextlib
import dataclasses
import math
import re
import warnings

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import search, search_space
from smc_mujoco.analysis.tuning.evaluator import Evaluator
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.common.errors import ScenarioWarning
from smc_mujoco.mechanisms import layout
from smc_mujoco.mechanisms.custom import others, scales
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.metrics.catalogue import arrived
from smc_mujoco.metrics.conventions import leans
from smc_mujoco.simulation import scenario_json
from smc_mujoco.simulation.run import poses

# servos and motors, a frame, two joints on one body, a spring, a range away from 0
ARM = """<mujoco model="arm"><compiler angle="radian"/>
<default><geom type="capsule" size=".03"/><general ctrllimited="true" ctrlrange="-1 1"/></default>
<worldbody><frame pos="0 0 1" euler=".3 0 .2"><body name="base" euler="0 .2 0">
 <joint name="a" axis="0 0 1"/><geom fromto="0 0 0 .1 0 -.3"/><frame pos="0 .02 0">
 <body name="upper" pos=".1 0 -.3" euler=".1 0 0"><joint name="b" axis="0 1 0" damping=".2"/>
  <joint name="roll" axis="1 0 0" stiffness="2"/><geom fromto="0 0 0 0 .1 -.3"/>
  <body name="lower" pos="0 .1 -.3"><joint name="c" axis="1 0 0" range="-2.4 -.5"/>
   <geom fromto="0 0 0 0 0 -.25"/></body></body></frame></body></frame></worldbody>
<actuator><position joint="a" kp="300" kv="20" ctrlrange="-4 4"/><motor joint="b" gear="40"/>
 <motor joint="c" gear="20"/><motor joint="roll" gear="9"/></actuator>
<keyframe><key name="home" qpos=".8 -.6 .2 -1.1" ctrl=".8 0 0 0"/></keyframe></mujoco>"""
# a gripper: a tendon with a servo, an equality, a channel that slides
HAND = """<mujoco model="hand"><option timestep=".001"/><worldbody>
<body name="wrist" pos="0 0 .5"><joint name="lift" type="slide" axis="0 0 1"/>
 <geom size=".05" mass=".8"/>
 <body name="left" pos=".1 0 0"><joint name="l" type="slide" axis="1 0 0" range="-.04 .04"/>
  <geom size=".02" mass=".1"/></body>
 <body name="right" pos="-.1 0 0"><joint name="r" type="slide" axis="-1 0 0" range="-.04 .04"/>
  <geom size=".02" mass=".1"/></body></body></worldbody>
<tendon><fixed name="both"><joint joint="l" coef=".5"/><joint joint="r" coef=".5"/></fixed></tendon>
<equality><joint joint1="l" joint2="r"/></equality>
<actuator><position tendon="both" kp="50" kv="3"/><motor joint="lift"/></actuator>
<keyframe><key name="home" qpos=".1 .01 .01"/></keyframe></mujoco>"""
# it stands on wide feet with its knees bent, and falls if nothing holds them
WALKER = """<mujoco model="walker"><option timestep=".002"/><worldbody><geom type="plane" size="9 9 1"/>
<body name="torso" pos="0 0 .6"><freejoint name="free"/><geom type="box" size=".15 .2 .05" mass="5"/>
 {legs}</body></worldbody><actuator>{motors}</actuator>
<keyframe><key name="home" qpos="0 0 {high} 1 0 0 0 {bent}"/></keyframe></mujoco>"""
LEG = """<body name="thigh{i}" pos="0 {y} 0"><joint name="hip{i}" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".04" mass="1"/><body name="shin{i}" pos="0 0 -.3">
<joint name="knee{i}" axis="0 1 0" armature=".05"/><geom type="capsule" fromto="0 0 0 0 0 -.25"
 size=".03" mass=".5"/><geom type="box" pos="0 0 -.28" size=".2 .07 .02" mass=".5"/></body></body>"""
LEGS = "".join(LEG.format(i=i, y=0.2 - 0.4 * i) for i in range(2))
MOTORS = "".join(f'<motor joint="hip{i}"/><motor joint="knee{i}"/>' for i in range(2))
MACHINES = {
    "arm": (ARM, "b"),
    "hand": (HAND, "lift"),
    "walker": (
        WALKER.format(
            legs=LEGS,
            motors=MOTORS,
            high=0.601,
            bent="0 0 0 0",
        ),
        "knee0",
    ),
}
PID = smc.law("pid", kp=9.0, ki=1.0, kd=2.0)
FAST = {"duration": 2.0, "conditions": ("nominal",)}


def plant(name, mode, key="home", **channel):
    text, joint = MACHINES[name]
    fields = {"motor": True} | channel
    return smc.plant_from(
        text,
        {joint: smc.Channel(**fields)},
        keyframe=key,
        others=mode,
    )


def posed(name, x):
    """The file's own model at its keyframe, with its channel at x."""
    text, joint = MACHINES[name]
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[model.joint(joint).qposadr[0]] = x
    mujoco.mj_forward(model, data)
    return model, data, model.joint(joint).dofadr[0]


@pytest.mark.quick
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", MACHINES)
def test_a_locked_joint_leaves_every_pose_and_the_channel_s_load(name, seed):
    x = np.random.default_rng(seed).uniform(-1.0, 1.0)
    model, data, dof = posed(name, x)
    locked = plant(name, "locked").load()
    assert locked.nv == locked.nu == 1
    data_locked = mujoco.MjData(locked)
    data_locked.qpos[:] = x
    mujoco.mj_forward(locked, data_locked)
    np.testing.assert_allclose(data_locked.xpos, data.xpos, atol=1e-12)
    np.testing.assert_allclose(data_locked.xmat, data.xmat, atol=1e-12)
    load = data.qfrc_bias[dof] - data.qfrc_passive[dof]
    assert data_locked.qfrc_bias[0] - data_locked.qfrc_passive[0] == pytest.approx(load, abs=1e-10)
    # links that never met do not meet now
    pairs = {tuple(model.geom_bodyid[contact.geom]) for contact in data.contact}
    assert {tuple(locked.geom_bodyid[contact.geom]) for contact in data_locked.contact} <= pairs
    assert plant(name, "locked").unmodelled == ""


def moved(made):
    """How far each other joint goes while a PD of the test's own moves the channel to its goal, and
    the channel's error at the end.
    """
    model = made.load()
    model.opt.timestep = 2.5e-4
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data = mujoco.MjData(model)
    data.qpos[:] = model.key_qpos[0] if model.nkey else model.qpos0
    first = data.qpos.copy()
    joint = model.joint(model.actuator_trnid[-1, 0])
    address = joint.qposadr[0]
    dof = joint.dofadr[0]
    (goal,), (data.qpos[address],) = made.origin, scales.beside_goal(made)
    far = np.zeros(model.nq)
    load = scales.at_goal(made).load[0]
    for _ in range(4000):
        data.ctrl[-1] = load + model.dof_M0[dof] * (
            400.0 * (goal - data.qpos[address]) - 40.0 * data.qvel[dof]
        )
        mujoco.mj_step(model, data)
        far = np.maximum(far, np.abs(data.qpos - first))
    names = [model.joint(i).name for i in range(model.njnt)]
    return {n: far[i] for i, n in enumerate(names) if n != joint.name}, data.qpos[address] - goal


@pytest.mark.parametrize("mode", [None, *others.OTHERS])
@pytest.mark.parametrize("name", ["arm", "hand"])
def test_servos_hold_the_start_and_held_motors_too(name, mode):
    far, error = moved(plant(name, mode))
    limp = {"c", "roll"} if mode in (None, "file") else set()
    assert max([0.0, *(far[joint] for joint in set(far) - limp)]) < 0.1
    assert not limp or name == "hand" or far["c"] > 0.3
    assert mode == "locked" or far
    assert mode not in ("held", "locked") or abs(error) < 0.05


KNEE = """<mujoco model="leg"><compiler angle="radian"/><worldbody><body pos="0 0 1">
<joint name="hip" axis="0 1 0" damping="1"/><geom type="capsule" size=".02" fromto="0 0 0 0 0 -.3"/>
<body pos="0 0 -.3"><joint name="knee" axis="0 1 0" damping="1"/><geom type="capsule" size=".02"
fromto="0 0 0 0 0 -.3" contype="0"/></body></body></worldbody><actuator><motor joint="hip"/>
<{servo} joint="knee" kp="60" kv="6" {limits}/></actuator>
<keyframe><key name="home" qpos=".4 -1.8" {ctrl}/></keyframe></mujoco>"""


@pytest.mark.parametrize(
    ("servo", "limits", "ctrl", "held"),
    [
        ("position", 'ctrlrange="-2.8 -.9"', 'ctrl="0 -1.8"', -1.8),
        ("position", 'ctrlrange="-2.8 -.9"', "", -1.8),
        ("position", 'ctrlrange="-1.5 -.9"', 'ctrl="0 -1.8"', -1.5),  # which MuJoCo clamps
        ("intvelocity", 'ctrlrange="-1 1" actrange="-2.8 -.9"', "", -1.8),
    ],
)
def test_a_servo_whose_range_leaves_out_0_holds_as_in_mujoco_alone(servo, limits, ctrl, held):
    """Against a loop of MuJoCo's own, whose servo has the keyframe's place as its command."""
    text = KNEE.format(servo=servo, limits=limits, ctrl=ctrl)
    machine = smc.plant_from(text, ["hip"], keyframe="home", others="file")
    trace = smc.run(smc.Scenario(plant=machine, law="none", x0=0.4, duration=8.0))
    plain = text.replace(limits, "").replace(f"<{servo} ", "<position ")
    model = mujoco.MjModel.from_xml_string(plain)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[1] = held
    mujoco.mj_step(model, data, round(8.0 / model.opt.timestep))
    knee = poses(trace, trace.t[-1:])[0, 1]
    assert knee == pytest.approx(data.qpos[1], abs=1e-4)
    assert abs(knee - held) < 0.1


@pytest.mark.parametrize("mode", others.OTHERS)
@pytest.mark.parametrize("name", MACHINES)
def test_text_and_record_make_the_same_plant_again(name, mode, tmp_path, monkeypatch):
    text, joint = MACHINES[name]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.xml").write_text(text)
    machine = as_plant(f"m.xml:{joint}(motor)@home+{mode}")
    assert machine.argument == f"m.xml:{joint}(motor)@home+{mode}"
    assert as_plant(machine.argument).spec().to_xml() == machine.spec().to_xml()
    again = scenario_json.restore(
        scenario_json.describe(smc.Scenario(plant=machine, law="pid"))
    ).plant
    assert again.spec().to_xml() == machine.spec().to_xml()
    assert again.rest == machine.rest
    assert again.argument == machine.argument


def test_a_text_takes_the_keyframe_and_holds_other_motors_and_says_so(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.xml").write_text(ARM)
    with pytest.warns(ScenarioWarning) as caught:
        machine = as_plant("m.xml:b")
    assert machine == smc.plant_from("m.xml", ["b"], keyframe="home", others="held")
    assert machine.argument == "m.xml:b@home+held"
    said = " ".join(str(warning.message) for warning in caught)
    assert "@home after the joints" in said
    assert "nothing commands 2 motors of m.xml (c, roll), so a stiff PD holds" in said
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*without this line")
        assert as_plant(machine.argument) == machine
    # of Python's plant, which takes neither, the text says so
    with pytest.warns(ScenarioWarning, match="nothing commands"):
        drawn = smc.plant_from("m.xml", ["b"])
    assert drawn.argument == "m.xml:b@+file"
    again = as_plant(drawn.argument)
    assert (again.x0, again.spec().to_xml()) == (drawn.x0, drawn.spec().to_xml())


@pytest.mark.parametrize(
    ("keys", "taken"),
    [(["up"], "@up"), (["up", "home"], "@home"), (["up", "down"], ""), ([""], "")],
)
def test_a_text_takes_the_only_keyframe_or_home(keys, taken, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lines = "".join(f'<key name="{key}" qpos=".1 -.6 .2 -1.1"/>' for key in keys)
    text = re.sub("<keyframe>.*</keyframe>", f"<keyframe>{lines}</keyframe>", ARM)
    (tmp_path / "m.xml").write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert as_plant("m.xml:b+held").argument == f"m.xml:b{taken}+held"


def test_a_keyframe_without_a_name_is_told_in_a_text(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.xml").write_text(ARM.replace('<key name="home"', "<key"))
    with pytest.warns(ScenarioWarning, match="keyframe without a name.*give the keyframe a name"):
        machine = as_plant("m.xml:b+held")
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*without a name")
        assert as_plant("m.xml:b@+held") == machine


def test_motors_that_nothing_commands_are_told_with_a_cure_that_works():
    with pytest.warns(ScenarioWarning, match="nothing commands, 'c' and 'roll'") as caught:
        plant("arm", None)
    text = next(
        str(warning.message) for warning in caught if "nothing commands" in str(warning.message)
    )
    for word in re.findall(r"'(held|locked|file)'", text):
        with warnings.catch_warnings():
            warnings.filterwarnings("error", ".*nothing commands")
            plant("arm", word)


def two_links(stiffness):
    text = f"""<mujoco><option gravity="0 0 -9.81"/><worldbody><body><joint name="a" axis="0 1 0"
     stiffness="{stiffness}" springref="0"/><geom size=".05" pos=".4 0 0" mass="2"/>
     <body pos=".4 0 0"><joint name="b" axis="0 1 0" damping=".3" frictionloss=".2"/>
     <geom size=".05" pos=".3 0 0" mass="1"/></body></body></worldbody>
     <actuator><motor joint="b"/></actuator></mujoco>"""
    return smc.plant_from(text, ["b"])


def test_scales_are_those_of_two_links_by_hand():
    machine = two_links(0.0)
    moments = scales.at_goal(machine)
    ball = 0.4 * 0.05**2  # of each, over its mass
    b = 0.3**2 + ball
    M = np.array([[2 * 0.16 + 2 * ball + 0.7**2 + ball, 0.7 * 0.3 + ball], [0.7 * 0.3 + ball, b]])
    np.testing.assert_allclose(moments.M, M, rtol=1e-9)
    assert moments.load == pytest.approx(-9.81 * 0.3, rel=1e-9)
    assert moments.D[1, 1] == pytest.approx(0.3, rel=1e-6)
    need = 2 * 9.81 * 0.3 + (60 * b + 8 * 0.3) * 0.3 + 1.5 * 0.2
    assert scales.needs(machine) == (pytest.approx(need, rel=0.05),)
    assert smc.Scenario(plant=machine, law="pid").limits == scales.needs(machine)
    # a limp joint answers freely, a stiff one as if it were locked
    assert scales.mobility(machine, 1.0, 0.3)[0] == pytest.approx(np.linalg.inv(M)[1, 1], rel=1e-2)
    assert scales.mobility(two_links(1e6), 1.0, 0.3)[0] == pytest.approx(1.0 / b, rel=1e-3)


@pytest.mark.parametrize(
    ("key", "limits", "goal", "told"),
    [
        (None, "-1 1", 0.0, False),
        (None, "-2.7 -.8", -1.75, True),
        ("home", "-2.7 -.8", -1.1, False),
    ],
)
def test_the_goal_is_in_the_range_and_runs_start_beside_it(key, limits, goal, told):
    text = ARM.replace('range="-2.4 -.5"', f'range="{limits}"')
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        machine = smc.plant_from(
            text,
            ["c"],
            keyframe=key,
            others="locked",
        )
    assert any("outside its range" in str(w.message) for w in caught) == told
    assert machine.origin == machine.x0 == (goal,)
    assert np.all(smc.run(smc.Scenario(plant=machine, law="pid", duration=0.01)).r == goal)
    low, high = map(float, limits.split())
    room = max(high - goal, goal - low)
    for run in smc.grid(machine, PID, seeds=4):
        (x,) = run.resolved.x0
        assert abs(x - goal) == pytest.approx(min(0.3, 0.6 * room), rel=0.201)
        assert low < x < high
    started = smc.grid(
        machine,
        PID,
        starts=smc.starts(x0=goal + 0.01),
        seeds=3,
    )[2].resolved.x0[0]
    assert 0.008 <= started - goal <= 0.012
    for beyond in (smc.Constant(high + 0.1), smc.Sine(high - low, 9.0, about="goal")):
        with pytest.raises(smc.ScenarioError, match=f"'c' of arm .* {re.escape(f'{low:g}')}"):
            smc.Scenario(plant=machine, law="pid", reference=beyond)


def test_joints_left_out_hold_their_goal_and_a_sine_is_about_it():
    machine = smc.plant_from(
        ARM,
        {"b": {}, "c": {}},
        keyframe="home",
        others="locked",
    )
    sine = smc.Sine(0.1, 3.0, about="goal")
    runs = []
    for reference in ({"c": sine}, {"c": smc.Constant(-1.1) + smc.Sine(0.1, 3.0)}):
        runs.append(
            smc.Scenario(
                plant=machine,
                law="pid",
                reference=reference,
                duration=0.5,
            )
        )
    assert runs[0] == runs[1] == scenario_json.restore(scenario_json.describe(runs[0]))
    trace = smc.run(runs[0])
    expected = np.stack([0 * trace.t - 0.6, -1.1 + 0.1 * np.sin(3.0 * trace.t)], axis=1)
    np.testing.assert_allclose(trace.r, expected, atol=1e-12)
    with pytest.raises(smc.ScenarioError, match="only a reference"):
        dataclasses.replace(runs[0], disturbance=sine)


@pytest.mark.parametrize("mode", [pytest.param("held", marks=pytest.mark.slow), "locked"])
@pytest.mark.parametrize("name", ["arm", pytest.param("hand", marks=pytest.mark.slow)])
def test_a_joint_is_tuned_and_settles(name, mode):
    machine = plant(name, mode)
    goal = search.Objective(**FAST)
    tuned = smc.tune(
        machine,
        "pid",
        budget=8,
        searches=1,
        objective=goal,
        threads=1,
    )
    assert tuned.scales["X"] == pytest.approx(0.3)
    trace = smc.run(smc.grid(machine, tuned.law, duration=3.0)[0])
    assert np.abs(trace.e[-500:]).max() < 0.05
    assert arrived(trace)
    assert not leans(trace)


def test_a_joint_that_leans_on_its_stop_never_settles():
    stop = smc.plant_from(
        ARM,
        {"c": {}},
        keyframe="home",
        others="locked",
    )
    law = smc.law("pid", kp=1e3, ki=0.0, kd=1.0)
    weak = smc.Scenario(plant=stop, law=law, duration=1.0)
    for u_max, leaning in ((20.0, False), (0.05, True)):
        trace = smc.run(dataclasses.replace(weak, u_max=u_max))
        assert leans(trace) == leaning
        assert np.isinf(smc.score(trace)["settling_time"]) >= leaning


# a base lighter than its limb, on springs
LIGHT = """<mujoco><worldbody><body><joint type="slide" axis="1 0 0" stiffness="1e3"/>
<joint type="slide" axis="0 0 1" stiffness="1e3" damping="9"/><geom size=".1" mass=".01"/><body>
<joint name="h" axis="0 1 0"/><geom pos=".5 0 0" size=".05" mass="1"/></body></body></worldbody>
</mujoco>"""


def test_a_light_base_on_springs_does_not_fall_and_its_bound_is_told_once(capfd):
    light = smc.plant_from(LIGHT, {"h": {"motor": True}})
    assert scales.falls(light) == ""
    assert scales.at_goal(light).load == pytest.approx([0.5 * 9.81], rel=1e-2)
    assert capfd.readouterr().err == ""
    laws = [smc.law(name) for name in ("pid", "adrc")]
    smc.grid(light, laws)  # here the warning is ignored
    with pytest.warns(ScenarioWarning, match="nothing limits the force on joint 'h'") as caught:
        smc.grid(light, laws, seeds=2)
    assert len(caught) == 1


def test_a_robot_that_falls_is_told_so_and_never_settles(monkeypatch, tmp_path):
    standing = plant("walker", "held")
    assert scales.falls(standing) == ""
    text = WALKER.format(
        legs=LEGS,
        motors=MOTORS,
        high=0.68,
        bent=".4 0 .4 0",
    )
    limp = smc.plant_from(text, ["knee0"], keyframe="home", others="file")
    assert "locked" in scales.falls(limp)
    trace = smc.run(smc.Scenario(plant=limp, law="pid", duration=0.1))
    assert np.isinf(smc.score(trace)["settling_time"])
    assert not arrived(trace)
    monkeypatch.setattr(search, "failure_of_law", None)  # told before the first run of a search
    with pytest.warns(ScenarioWarning, match="'locked'"), pytest.raises(TypeError, match="NoneT"):
        smc.tune(limp, "pid", searches=1)
    fields = {"laws": ["pid"], "quick": True, "out": tmp_path}
    with pytest.raises(smc.ScenarioError, match=r"no law of a joint .* falling=True"):
        smc.which(limp, **fields)
    with (
        pytest.warns(ScenarioWarning, match="nothing lim"),
        pytest.raises(TypeError, match="NoneT"),
    ):
        smc.which(limp, falling=True, **fields)
    assert scales.falls(plant("walker", "locked")) == ""


TALL = """<mujoco><worldbody><geom type="plane" size="9 9 1"/><body pos="0 0 .2"><freejoint/>
<geom type="box" size=".03 .2 .2" mass="1"/><body pos="0 0 .2"><joint name="j" axis="0 1 0"/>
<geom pos="0 0 .15" size=".03" mass=".5"/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize(("x0", "tips"), [(0.02, False), (1.2, True)])
def test_a_run_whose_base_ends_on_its_side_has_failed(x0, tips):
    tall = smc.plant_from(TALL, {"j": {"motor": True}})
    assert not scales.falls(tall)  # it stands at the goal
    scenario = smc.Scenario(plant=tall, law=PID, x0=x0, u_max=9.0, duration=2.0)
    assert ("tipped over" in str(smc.run(scenario).failure)) == tips
    assert Evaluator(Objective(), [scenario], ("kp",))([(PID.gains["kp"],)])[0].failed == tips


BLOCK = """<mujoco model="block"><worldbody>
<geom name="wall" type="box" size=".05 .05 .3"/><body name="rod" pos="-.4 0 0"><joint name="j" axis="0 0 1"/>
<geom name="arm" type="capsule" fromto="0 0 0 .39 0 0" size=".02"/></body></worldbody>
<actuator><motor joint="j" ctrlrange="-9 9"/></actuator>{more}</mujoco>"""
INERTIAL = """<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0"
 iyz="0"/></inertial>"""
URDF = f"""<robot name="block"><link name="base"><collision><geometry><box size=".1 .1 .6"/></geometry>
</collision></link><link name="plate"/><link name="mid">{INERTIAL}</link><link name="arm">{INERTIAL}
{{shape}}</link><joint name="bolted" type="fixed"><parent link="base"/><child link="plate"/></joint>
<joint name="i" type="continuous"><parent link="plate"/><child link="mid"/><axis xyz="0 0 1"/></joint>
<joint name="j" type="continuous"><parent link="{{parent}}"/><child link="arm"/>
<origin xyz="-.4 0 0"/><axis xyz="0 0 1"/></joint></robot>"""
SHAPE = """<collision><origin xyz=".2 0 0"/><geometry><box size=".38 .04 .04"/></geometry>
</collision>"""
CLEAR = {
    "a keyframe": '<keyframe><key name="home" qpos="1"/></keyframe>',
    "<exclude .*/> in": "<contact>{line}</contact>",
}


@pytest.mark.parametrize("cure", CLEAR)
def test_a_goal_inside_something_is_refused_and_each_cure_works(cure):
    with pytest.raises(smc.ScenarioError, match=f"goal of .*'arm'.* mm inside .*{cure}") as said:
        smc.plant_from(BLOCK.format(more=""), ["j"])
    key = "home" if "keyframe" in cure else None
    line = re.search("<.*>(?= in)", str(said.value))
    text = BLOCK.format(more=CLEAR[cure].format(line=line and line[0]))
    assert smc.plant_from(text, ["j"], keyframe=key).n == 1
    inside = {"j": smc.Channel(x0=0.0)}
    if key:
        with pytest.raises(smc.ScenarioError, match=r"start of .* mm inside .*give another x0"):
            smc.plant_from(text, inside, keyframe=key)


@pytest.mark.parametrize(("where", "depth"), [("goal", 3.4), ("start", 1.5)])
def test_parts_that_overlap_a_little_are_told_before_any_run(where, depth):
    """An arm that does not stand on feet, which may lie this deep."""
    text = BLOCK.format(more=CLEAR["a keyframe"]).replace(
        "0 0 0 .39", f"0 0 0 {0.33 + 1e-3 * depth}"
    )
    rod = {"j": smc.Channel(x0=0.0)} if where == "start" else ["j"]
    said = f"at the {where} of .*'arm' and 'wall' overlap by {depth} mm, so contact"
    with pytest.warns(ScenarioWarning, match=said):
        smc.plant_from(text, rod, keyframe=None if where == "goal" else "home")


# a leg that stands on its floor; with a ski its knee can go nowhere
LEG = """<mujoco model="leg"><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
<body pos="0 0 .606"><geom type="box" size=".05 .05 .02" mass="5"/><body name="shank" pos="0 0 -.3">
<joint name="knee" axis="0 1 0" range="{low} 115"/><geom type="capsule" fromto="0 0 0 0 0 -.28"
size=".02" mass=".5"/><geom name="toe" type="box" size=".08 .02 .01" pos=".05 0 -.295" mass=".1"/>
{ski}</body></body></worldbody><actuator><motor joint="knee" ctrlrange="-40 40"/></actuator>
</mujoco>"""
SKI = '<geom name="ski" type="box" size=".5 .02 .01" pos="0 0 -.295" mass=".1"/>'


@pytest.mark.parametrize("low", [-3, -40])
def test_a_start_that_nobody_chose_is_clear_of_the_floor_too(low):
    leg = smc.plant_from(LEG.format(low=low, ski=""), ["knee"], others="locked")
    start = scales.beside_goal(leg)
    assert -0.3 <= start[0] < 0.0
    run = smc.grid(leg, PID, seeds=9, duration=0.05)
    assert len({scenario.x0 for scenario in run}) == len(run)
    for scenario in run:
        model = layout.loaded(leg)
        data = layout.posed(model, scenario.x0)
        mujoco.mj_forward(model, data)
        assert min((contact.dist for contact in data.contact), default=0.0) > -1e-3
    with pytest.raises(smc.ScenarioError, match=r"x0 \(0.3,\) of leg .*24 mm inside .*another x0"):
        dataclasses.replace(run[0], x0=0.3)


def test_a_joint_that_can_start_nowhere_is_refused_with_its_name():
    leg = smc.plant_from(LEG.format(low=-40, ski=SKI), ["knee"], others="locked")
    with pytest.raises(smc.ScenarioError, match=r"'knee' of leg .* mm inside .*starts=smc.starts"):
        smc.grid(leg, PID)


# a robot on four legs, whose keyframe has its feet 18 mm in the floor
DOG = """<mujoco model="dog"><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
<body name="base" pos="0 0 .12"><freejoint/><geom type="box" size=".2 .1 .03" mass="3"/>{legs}</body>
</worldbody><actuator>{motors}</actuator><keyframe><key name="home" qpos="0 0 .182 1 0 0 0 0 0 0 0"
/></keyframe></mujoco>"""
DOGS_LEG = """<body pos="{x} {y} -.03"><joint name="k{i}" axis="0 1 0" range="-60 60" damping=".2"/>
<geom type="capsule" fromto="0 0 0 0 0 -.15" size=".01" mass=".1"/><geom name="foot{i}" size=".02"
pos="0 0 -.15" mass=".05"/></body>"""
CORNERS = [(0.2, 0.1), (-0.2, 0.1), (0.2, -0.1), (-0.2, -0.1)]


# at rest they sink 10 mm into the floor, as those of public quadrupeds do
SOFT = 'priority="1" solimp=".015 1 .022" name="foot'


@pytest.mark.parametrize("foot", ['name="foot', SOFT], ids=["hard", "soft"])
@pytest.mark.parametrize(("mode", "x0"), [("held", None), ("file", 0.2)])
def test_a_robot_that_rises_from_its_floor_is_taken_and_told(mode, x0, foot):
    leg = DOGS_LEG.replace('name="foot', foot)
    legs = "".join(leg.format(i=i, x=x, y=y) for i, (x, y) in enumerate(CORNERS))
    servos = [f'<position joint="k{i}" kp="30" kv="1" forcerange="-20 20"/>' for i in range(4)]
    text = DOG.format(legs=legs, motors="".join(servos))
    knee = {"k0": smc.Channel(motor=True, x0=x0)}
    with pytest.warns(
        ScenarioWarning, match=r"start of the text of model 'dog' has 'floor' \d+ mm inside"
    ) as said:
        machine = smc.plant_from(text, knee, keyframe="home", others=mode)
    inside = next(str(warning.message) for warning in said if "inside" in str(warning.message))
    depth = 1e3 * (0.15 * math.cos(x0 or 0.0) + 0.05 - 0.182)
    assert int(re.search(r"(\d+) mm", inside)[1]) == pytest.approx(depth, abs=1)  # pyright: ignore[reportOptionalSubscript]
    assert smc.run(smc.Scenario(plant=machine, law=PID, duration=0.5)).failure is None
    with pytest.raises(smc.ScenarioError, match="18 mm inside 'foot0': give a keyframe"):
        smc.plant_from(text, knee, keyframe="home", others="locked")


def test_feet_that_stand_a_little_deep_are_not_told_of():
    """3 mm. The base that is locked there is pressed on."""
    legs = "".join(DOGS_LEG.format(i=i, x=x, y=y) for i, (x, y) in enumerate(CORNERS))
    text = DOG.format(legs=legs, motors="").replace(".182", ".197")
    knee = {"k0": smc.Channel(motor=True)}
    smc.plant_from(text, knee, keyframe="home", others="file")  # warns of nothing
    with pytest.warns(ScenarioWarning, match=r"'floor' and 'foot\d' overlap by 3.0 mm"):
        smc.plant_from(text, knee, keyframe="home", others="locked")


@pytest.mark.parametrize("mode", ["file", "locked"])
@pytest.mark.parametrize("parent", ["plate", "mid"])
def test_a_link_of_a_urdf_may_touch_all_but_the_one_that_carries_it(tmp_path, parent, mode):
    file = tmp_path / "block.xml"  # what it holds says what it is
    moved = []
    for shape in (SHAPE, ""):
        file.write_text(URDF.format(shape=shape, parent=parent))
        if shape and parent == "mid":
            with pytest.raises(smc.ScenarioError, match=r"mm inside .*one of these links no <coll"):
                smc.plant_from(file, {"j": smc.Channel(motor=True)}, others=mode)
            continue
        machine = smc.plant_from(file, {"j": smc.Channel(motor=True)}, others=mode)
        law = smc.law("pid", kp=9.0, ki=1.0, kd=2.0)
        moved.append(
            smc.run(smc.Scenario(plant=machine, law=law, x0=0.3, u_max=5.0, duration=0.3)).x
        )
    assert np.ptp(moved[0]) > 0.1
    np.testing.assert_allclose(moved[0], moved[-1], atol=2e-4)


@pytest.mark.parametrize("effort", [0, 80])
def test_joints_of_a_urdf_have_motors_where_it_bounds_their_force(tmp_path, effort):
    file = tmp_path / "block.urdf"
    text = URDF.format(shape="", parent="mid").replace('<axis xyz="0 0 1"', '<axis xyz="0 1 0"')
    bound = f'<joint name="i" type="continuous"><limit effort="{effort}"/>'
    file.write_text(text.replace('<joint name="i" type="continuous">', bound))
    with pytest.warns(ScenarioWarning) if effort else contextlib.nullcontext():
        smc.plant_from(file, {"j": {"motor": True}})
    held = smc.plant_from(file, {"j": {"motor": True}}, others="held")
    trace = smc.run(smc.Scenario(plant=held, law="none", duration=0.5))
    assert (np.ptp(trace.x) < 1e-3) == (effort > 0)


ROD = """<body pos="{x} 0 1"><joint name="{name}" axis="0 1 0"/><geom type="capsule" size=".02"
 fromto="0 0 0 0 0 -.3" contype="0"/><body name="{name}" pos="0 0 -.3"><geom size=".03"/>
<site name="{name}"/></body></body>"""
RODS = [ROD.format(name=name, x=x) for x, name in enumerate("abc")]
TIES = {
    "bodies": '<connect body1="a" body2="b" anchor="0 0 0"/>',
    "sites": '<connect site1="a" site2="b"/>',
    "weld": '<weld body1="a" body2="b"/>',
    "joints": '<joint joint1="a" joint2="b"/>',
    "tendons": '<tendon tendon1="ta" tendon2="tb"/>',
    "string": '<tendon tendon1="ab"/>',
}


@pytest.mark.parametrize("tie", TIES)
def test_a_tie_to_what_is_locked_is_cut_and_told_with_a_cure(tie):
    text = f"""<mujoco><worldbody>{"".join(RODS)}</worldbody><equality>{TIES[tie]}</equality>
    <tendon><fixed name="ta"><joint joint="a" coef="1"/></fixed><fixed name="tb"><joint joint="b"
    coef="2"/></fixed><spatial name="ab"><site site="a"/><site site="b"/></spatial></tendon>
    </mujoco>"""
    motor = {"motor": True}
    assert smc.plant_from(text, {"c": motor}, others="locked").unmodelled == ""
    with pytest.warns(ScenarioWarning, match="tie its channels to what is locked.*others='held'"):
        assert smc.plant_from(text, {"a": motor}, others="locked").unmodelled == ""
    for joints, mode in (("a", "held"), ("ab", "locked")):
        assert smc.plant_from(text, dict.fromkeys(joints, motor), others=mode).load().neq == 1


@pytest.mark.filterwarnings("ignore:.*(is assumed|ideal motor|give way by)")
@pytest.mark.parametrize("length", [0.04, 0.08, 0.3])
def test_an_assumed_bound_holds_a_joint_wherever_its_limits_let_it_be(length):
    """A light link that stands at its goal needs nothing there, and its weight elsewhere."""
    weight = 0.02 * 9.81 * length
    text = f"""<mujoco><compiler angle="radian"/><worldbody><body><joint name="j" axis="0 1 0"
     range="0 1.57"/><geom pos="0 0 {length}" size=".005" mass=".02" contype="0" conaffinity="0"/>
     </body></worldbody></mujoco>"""
    machine = smc.plant_from(text, {"j": smc.Channel(motor=True)})
    assert scales.needs(machine)[0] == pytest.approx(2.0 * weight, rel=0.06)
    law = smc.law("pid", kp=5.0, kd=0.02, ki=0.0)
    assert abs(smc.run(smc.Scenario(plant=machine, law=law, x0=0.3, duration=2.0)).x[-1, 0]) < 0.01


@pytest.mark.quick
def test_a_bound_far_beyond_what_a_joint_needs_is_no_scale_and_is_told():
    """A URDF of a desk arm gave 1000 N m where 2.1 are needed, and no law settled under its
    friction.
    """
    text = """<mujoco><worldbody><body><joint name="j" axis="0 1 0"/><geom type="capsule" mass="1"
     fromto="0 0 0 0 0 -.4" size=".03"/></body></worldbody>
     <actuator><motor joint="j" ctrlrange="-{0} {0}"/></actuator></mujoco>"""
    robot = smc.plant_from(text.format(6000), ["j"])
    need = scales.needs(robot)[0]
    with pytest.warns(ScenarioWarning, match=rf"{6000 / need:.0f} times .* elbow\(u_max=9\)"):
        assert search_space.scales(robot, 6000.0, 0.3)["F"] == 100.0 * need
    moderate = smc.plant_from(text.format(60), ["j"])
    assert search_space.scales(moderate, 60.0, 0.3)["F"] == 60.0
