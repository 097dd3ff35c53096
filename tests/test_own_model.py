"""Models that nobody here wrote become plants: they move as in MuJoCo, laws get f and g, mistakes get a sentence."""

import dataclasses
import importlib.util
import math
import pickle
from pathlib import Path

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco import identity, plain
from smc_mujoco.own_model import OwnModel

TORQUE = smc.law("computed_torque", kp=100.0, kd=20.0)
ARRAYS = ("x", "v", "u", "applied", "s", "d", "force", "reaction")
LINKS = """
<mujoco>
  <default><geom type="capsule" size="0.03" contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="upper" pos="0 0 1"><joint name="shoulder" axis="0 1 0"/><geom fromto="0 0 0 0 0 -.5" mass="1"/>
      <body name="lower" pos="0 0 -.5"><joint name="elbow" axis="0.6 0.8 0"/><geom fromto="0 0 0 .1 0 -.4" mass="1"/>
      </body>
    </body>
    {bodies}
  </worldbody>
  {rest}
</mujoco>
"""
MOTORS = '<motor name="a" joint="shoulder" gear="-4" ctrlrange="-1 2"/><motor name="b" joint="elbow"/>'
ACTUATED = f"<actuator>{MOTORS}</actuator>"
BALL = '<body name="ball"><joint name="ball" type="ball"/><geom size=".1 .1" mass="1"/></body>'


def installed(package: str, path: str) -> Path:
    """A file of an installed package, which is not imported."""
    if (found := importlib.util.find_spec(package)) is None or not found.submodule_search_locations:
        pytest.skip(f"{package} is not installed")
    return Path(found.submodule_search_locations[0]) / path


def suite(name: str) -> Path:
    return installed("dm_control", f"suite/{name}.xml")


def gym(name: str) -> Path:
    return installed("gymnasium", f"envs/mujoco/assets/{name}.xml")


def cartpole() -> smc.Plant:
    return smc.plant_from(suite("cartpole"), {"slider": smc.Channel(partner="hinge_1")})


def acrobot() -> smc.Plant:
    return smc.plant_from(suite("acrobot"), {"elbow": smc.Channel(partner="shoulder")})


def both_links() -> smc.Plant:
    return smc.plant_from(suite("acrobot"), {j: smc.Channel(motor=True) for j in ("shoulder", "elbow")})


def reacher() -> smc.Plant:
    return smc.plant_from(gym("reacher"), ["joint0", "joint1"])


def pusher() -> smc.Plant:
    path = gym("pusher_v5")
    raw = mujoco.MjModel.from_xml_path(str(path))
    names = [name for i in range(raw.njnt) if (name := raw.joint(i).name).startswith("r_")]
    return smc.plant_from(path, dict.fromkeys(names, smc.Channel(motor=True)))


def test_every_channel_has_the_unit_of_its_joint():
    assert (cartpole().units, cartpole().network) == (("m", "rad"), False)
    assert (acrobot().units, acrobot().unit) == (("rad", "rad"), "rad")
    assert both_links().network


@pytest.fixture
def arm(tmp_path):
    """A function that writes an arm and makes a plant of it."""

    def make(channels=("shoulder", "elbow"), rest=ACTUATED, bodies="", **given) -> smc.Plant:
        path = tmp_path / "arm.xml"
        path.write_text(LINKS.format(rest=rest, bodies=bodies))
        return smc.plant_from(path, channels, **given)

    return make


def joints_of(plant: smc.Plant, raw: mujoco.MjModel) -> list:
    """The plant's channels in the model as its file has it."""
    assert isinstance(plant.build, OwnModel)
    names = [d.joint for d in plant.build.drives] + [d.partner for d in plant.build.drives if d.partner]
    return [raw.joint(name) for name in names]


def read(plant: smc.Plant) -> mujoco.MjModel:
    """The model as its file has it."""
    assert isinstance(plant.build, OwnModel)
    return mujoco.MjModel.from_xml_path(plant.build.path)


# it moves as in MuJoCo

FOREIGN = {"cartpole": cartpole, "acrobot": acrobot, "reacher": reacher}
CTRL = {"cartpole": 0.3, "acrobot": 0.4, "reacher": 0.002}  # of each motor of the file


@pytest.mark.parametrize("name", FOREIGN)
def test_a_foreign_model_moves_as_its_file_does_in_mujoco(name):
    plant = FOREIGN[name]()
    raw = read(plant)
    data = mujoco.MjData(raw)
    raw.opt.timestep, raw.opt.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_RK4
    raw.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY.value

    @smc.law_function(gains={"u": 0.0})
    def constant(y, gains, memory):
        return gains.u, 0.0

    u = CTRL[name] * raw.actuator_gear[0, 0]
    scenario = smc.Scenario(
        plant=plant, law=constant(u=u), duration=1.0, u_max=100.0, x0=0.3, integrator="RK4", physics_step=1e-3
    )
    trace = smc.run(scenario)
    joints = joints_of(plant, raw)
    places = [j.qposadr[0] for j in joints]
    data.qpos[places], data.ctrl[:] = 0.3, CTRL[name]
    energies = []
    for k in range(scenario.samples + 1):
        np.testing.assert_allclose(trace.x[k], data.qpos[places], atol=1e-11)
        np.testing.assert_allclose(trace.v[k], data.qvel[[j.dofadr[0] for j in joints]], atol=1e-10)
        ours = mujoco.MjData(raw)
        ours.qpos[:], ours.qvel[:] = data.qpos, data.qvel
        ours.qpos[places], ours.qvel[[j.dofadr[0] for j in joints]] = trace.x[k], trace.v[k]
        mujoco.mj_forward(raw, ours)
        mujoco.mj_forward(raw, data)
        energies.append((ours.energy.sum(), data.energy.sum()))
        mujoco.mj_step(raw, data)
    np.testing.assert_allclose(*np.array(energies).T, atol=1e-10)
    assert np.ptp(trace.x) > 0.01


@pytest.mark.parametrize("name", [*FOREIGN, "pusher"])
def test_f_and_g_are_the_accelerations_of_the_file(name):
    plant = (FOREIGN | {"pusher": pusher})[name]()
    raw = read(plant)
    raw.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT.value
    data, values, rng = mujoco.MjData(raw), plant.values({}), np.random.default_rng(0)
    joints = joints_of(plant, raw)
    dofs = [j.dofadr[0] for j in joints]
    for _ in range(20):
        x, v, u = rng.uniform(-1, 1, (3, plant.n))
        u[plant.driven :] = 0.0
        data.qpos[[j.qposadr[0] for j in joints]], data.qvel[dofs] = x, v
        data.qfrc_applied[:] = 0.0
        data.qfrc_applied[dofs] = u
        mujoco.mj_forward(raw, data)
        for i in range(plant.n):
            f, g = plant.nominal(x, v, i, values, u)
            np.testing.assert_allclose(f + g * u[i % plant.driven], data.qacc[dofs[i]], rtol=1e-8, atol=1e-8)


# laws get f and g

TRACKING = {
    "cartpole": (cartpole, 10.0, (0.0, 0.1)),
    "acrobot": (acrobot, 2.0, (0.0, math.pi)),
    "both links": (both_links, 1e4, (0.0, 0.0)),
    "reacher": (reacher, 200.0, (0.0, 0.0)),
}


@pytest.mark.parametrize("name", TRACKING)
def test_computed_torque_tracks_within_a_thousandth(name):
    make, u_max, x0 = TRACKING[name]
    plant, rate = make(), 0.2
    scenario = smc.Scenario(
        plant=plant,
        law=TORQUE,
        model="nominal",
        reference=smc.Sine(amplitude=0.1, omega=2.0),
        u_max=u_max,
        duration=4.0,
        x0=x0,
        v0=[rate] * plant.driven + [0.0] * plant.free,
    )
    trace = smc.run(scenario)
    error = np.abs(trace.x - trace.r)[:, : plant.driven].max()
    assert error < 1e-3
    blind = smc.run(dataclasses.replace(scenario, model="none"))
    assert np.abs(blind.x - blind.r)[:, : plant.driven].max() > 10 * error


def test_seven_coupled_joints_settle_as_the_error_equation_says():
    """e'' + 20 e' + 100 e = 0: critically damped, e = (1 + 10 t) e0 exp(-10 t)."""
    plant = pusher()
    reference, e0 = smc.Constant(-0.3), 0.1
    trace = smc.run(
        smc.Scenario(plant=plant, law=TORQUE, model="nominal", reference=reference, u_max=1e3, duration=1.0, x0=-0.2)
    )
    wanted = e0 * (1 + 10 * trace.t) * np.exp(-10 * trace.t)
    assert np.abs(trace.x + 0.3 - wanted[:, None]).max() < 1e-3
    assert np.abs(trace.x[-1] + 0.3).max() < 1e-3


@pytest.mark.parametrize(
    "fields", [{}, {"disturbance": smc.Sine(amplitude=1.0, omega=3.0), "friction": smc.Coulomb(0.1)}]
)
def test_the_plain_loop_gives_the_same_bits(arm, fields):
    law = smc.law("super_twisting")
    scenario = smc.Scenario(plant=arm(), law=law, model="nominal", duration=0.2, x0=(0.4, -0.3), u_max=20.0, **fields)
    fast, slow = smc.run(scenario), plain.run(scenario)
    assert fast.failure is None
    assert [name for name in ARRAYS if not np.array_equal(getattr(fast, name), getattr(slow, name))] == []


def test_threads_change_nothing(arm):
    base = smc.Scenario(plant=arm(), law=TORQUE, model="nominal", duration=0.2, u_max=20.0)
    many = [dataclasses.replace(base, x0=(0.1 * i, -0.1 * i), mismatch={"mass": 1.0 + 0.1 * i}) for i in range(6)]
    for one, two in zip(smc.run(many, threads=1), smc.run(many, threads=4), strict=True):
        np.testing.assert_array_equal(one.x, two.x)


def test_a_disturbance_is_the_force_on_its_joint_alone(arm):
    """A constant d in every channel is what the same u does."""
    plant = arm(rest='<option gravity="0 0 0"/>' + ACTUATED)

    @smc.law_function
    def one(y, gains, memory):
        return 1.0, 0.0

    pushed = smc.run(smc.Scenario(plant=plant, law="none", duration=0.3, disturbance=smc.Constant(1.0)))
    driven = smc.run(smc.Scenario(plant=plant, law=one(), duration=0.3))
    np.testing.assert_allclose(pushed.x, driven.x, atol=1e-12)
    np.testing.assert_array_equal(pushed.d, 1.0)


def test_a_mismatch_is_in_the_true_model_alone(arm):
    plant = arm()
    base = smc.Scenario(plant=plant, law=TORQUE, model="nominal", duration=2.0, u_max=50.0, reference=smc.Constant(0.3))
    right, wrong = smc.run([base, dataclasses.replace(base, mismatch={"mass": 1.3})])
    assert np.abs(right.x[-1] - 0.3).max() < 1e-5
    assert np.abs(wrong.x[-1] - 0.3).max() > 1e-3
    assert plant.parameters["m"] == pytest.approx(2.0)


# what is made of the file


def test_u_is_the_force_on_the_joint_within_the_motor_s_limits(arm):
    plant = arm()
    assert isinstance(plant.build, OwnModel)
    (_, motor, _), (_, free, _) = plant.build.drives
    assert (motor.low, motor.high) == (-8.0, 4.0)  # gear -4, ctrlrange -1 2
    assert (free.low, free.high) == (-math.inf, math.inf)

    @smc.law_function
    def much(y, gains, memory):
        return 30.0, 0.0

    trace = smc.run(smc.Scenario(plant=plant, law=much(), duration=0.1, u_max=50.0))
    np.testing.assert_allclose(trace.force[5:], [[4.0, 30.0]] * len(trace.force[5:]))


def test_what_is_no_channel_stays_as_the_model_has_it(arm):
    servo = '<actuator><motor name="b" joint="elbow"/><position joint="shoulder" kp="500" dampratio="1"/></actuator>'
    plant = arm(["elbow"], servo, keyframe=None)
    assert plant.n == 1
    assert "'shoulder'" in plant.unmodelled
    held = smc.run(smc.Scenario(plant=plant, law="none", duration=2.0, x0=0.3))
    loose = smc.run(smc.Scenario(plant=arm(["elbow"]), law="none", duration=2.0, x0=0.3))
    assert np.abs(held.x - loose.x).max() > 0.05


def test_a_keyframe_is_where_runs_start(arm):
    rest = ACTUATED + '<keyframe><key name="home" qpos="0.2 -0.5"/></keyframe>'
    assert arm(rest=rest, keyframe="home").x0 == (0.2, -0.5)
    assert arm({"elbow": smc.Channel(x0=1.0), "shoulder": None}, rest, keyframe="home").x0 == (1.0, 0.2)
    trace = smc.run(smc.Scenario(plant=arm(["elbow"], rest, keyframe="home"), law="none", duration=0.1))
    assert trace.x[0, 0] == -0.5
    with pytest.raises(smc.ScenarioError, match=r"unknown keyframe of arm.xml 'hme': did you mean 'home'"):
        arm(rest=rest, keyframe="hme")


@pytest.mark.parametrize("part", [smc.Lag(0.01), smc.Backlash(0.02), smc.DCMotor(), smc.RateLimit(100.0)])
def test_parts_fit_an_own_model(arm, part):
    trace = smc.run(smc.Scenario(plant=arm(), law="super_twisting", actuator=part, duration=0.2, x0=(0.3, 0.2)))
    assert trace.failure is None


def test_includes_and_their_contents_count(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "motors.xml").write_text(f"<mujoco>{ACTUATED}</mujoco>")
    (tmp_path / "arm.xml").write_text(LINKS.format(rest='<include file="parts/motors.xml"/>', bodies=""))
    plant = smc.plant_from(tmp_path / "arm.xml", ["elbow"])
    (tmp_path / "parts" / "motors.xml").write_text(f"<mujoco>{ACTUATED}<!-- other --></mujoco>")
    with pytest.raises(smc.ScenarioError, match=r"has changed: call smc.plant_from again"):
        smc.run(smc.Scenario(plant=plant, law="none", duration=0.01))


# errors

SERVO = '<actuator><position name="p" joint="shoulder"/></actuator>'
TWO = f'<actuator>{MOTORS}<motor name="c" joint="elbow"/></actuator>'
TENDON = (
    '<tendon><fixed name="t"><joint joint="elbow" coef="1"/></fixed></tendon><actuator><motor tendon="t"/></actuator>'
)
WRONG = {
    "no joint": ({"channels": ["elbwo"]}, "unknown joint of arm.xml 'elbwo': did you mean 'elbow'"),
    "ball": ({"channels": ["ball"], "bodies": BALL}, "joint 'ball' of arm.xml is a ball joint: give one that is"),
    "none": ({"rest": ""}, "no actuator of arm.xml drives joint 'shoulder' alone: give smc.Channel"),
    "tendon": ({"channels": ["elbow"], "rest": TENDON}, "no actuator of arm.xml drives joint 'elbow' alone"),
    "several": ({"rest": TWO}, "joint 'elbow' of arm.xml has the actuators b, c: name one"),
    "servo": ({"channels": ["shoulder"], "rest": SERVO}, "actuator 'p' of joint 'shoulder' is a servo.*motor=True"),
    "wrong actuator": ({"channels": {"elbow": {"actuator": "a"}}}, "'a' of arm.xml does not drive joint 'elbow'"),
    "unknown actuator": ({"channels": {"elbow": {"actuator": "z"}}}, "unknown actuator of arm.xml 'z'"),
    "unknown field": ({"channels": {"elbow": {"gear": 2}}}, "unknown field of a Channel 'gear'"),
    "twice": ({"channels": ["elbow", "elbow"]}, "joint 'elbow' is two channels or partners: name it once"),
    "empty": ({"channels": []}, "channels is empty"),
    "text": ({"channels": "elbow"}, "channels is 'elbow': give joints' names"),
    "number": ({"channels": {"elbow": 3}}, "channel 'elbow' is 3: give smc.Channel"),
    "x0": ({"channels": {"elbow": {"x0": "a"}}}, "x0 of channel 'elbow' is 'a': give a number"),
    "name": ({"name": "duffing"}, "name is 'duffing': give one that is none of smc.plants"),
    "flag": (
        {"rest": f'{ACTUATED}<option><flag actuation="disable"/></option>'},
        'arm.xml has <flag actuation="disable"/>',
    ),
    "broken": ({"rest": "<actuator><mtor/></actuator>"}, r"MuJoCo cannot read .*arm.xml \(.*unrecognized element"),
    "compile": ({"bodies": "<body><joint/></body>"}, "MuJoCo cannot read .*mass and inertia of moving bodies"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_is_one_sentence(arm, name):
    given, message = WRONG[name]
    with pytest.raises(smc.ScenarioError, match=message) as caught:
        arm(**given)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_one_sentence(tmp_path):
    with pytest.raises(smc.ScenarioError, match=r"no model at .*arm.xml: give the path of an MJCF file"):
        smc.plant_from(tmp_path / "arm.xml", ["elbow"])
    with pytest.raises(smc.ScenarioError, match=r"path is 3: give the path"):
        smc.plant_from(3, ["elbow"])  # pyright: ignore[reportArgumentType]


def test_a_law_gets_no_model_that_there_is_not(arm):
    plant = arm(["elbow"])
    with pytest.raises(smc.ScenarioError, match=r"arm has no nominal model: joint 'shoulder' moves with its channels"):
        smc.Scenario(plant=plant, law=TORQUE, model="nominal")
    assert smc.run(smc.Scenario(plant=plant, law=TORQUE, duration=0.1)).failure is None
    tied = '<equality><joint joint1="elbow" joint2="shoulder"/></equality>' + ACTUATED
    assert "equality" in arm(rest=tied).unmodelled


def test_a_force_on_a_body_is_refused(arm):
    with pytest.raises(
        smc.ScenarioError, match=r"pushes a body, and those of arm, a model of yours, act on its joints"
    ):
        smc.Scenario(plant=arm(), law="none", disturbance=smc.Gust(amplitude=1.0, time=0.1, width=0.1))


# kept


def test_a_trace_loads_back_and_knows_its_file(arm, tmp_path):
    trace = smc.run(smc.Scenario(plant=arm({"elbow": smc.Channel(motor=True)}, name="mine"), law="none", duration=0.1))
    path = trace.save(tmp_path / "a.npz")
    again = smc.load(path)
    assert again.scenario == trace.scenario
    assert identity.key(again.scenario) == identity.key(trace.scenario)
    np.testing.assert_array_equal(smc.run(again.scenario).x, trace.x)
    arm(bodies=BALL)
    with pytest.raises(smc.ScenarioError, match=r"arm.xml, or a file that it names, is another than it was in the run"):
        smc.load(path)
    (tmp_path / "arm.xml").unlink()
    with pytest.raises(smc.ScenarioError, match=r"no model at .*arm.xml"):
        smc.load(path)


def test_a_plant_of_one_s_own_goes_to_another_process(arm):
    plant = arm()
    again = pickle.loads(pickle.dumps(plant))
    assert again == plant
    assert hash(again) == hash(plant)
