"""Models that nobody here wrote become plants: they move as in MuJoCo, laws get f and g, mistakes
get a sentence.
"""

import collections
import dataclasses
import importlib.util
import math
import os
import pickle
import re
import shutil
import sys
import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from helpers import reference as plain

import smc_mujoco as smc
from smc_mujoco.envs import episode, tasks
from smc_mujoco.mechanisms.custom import channels as own_channels
from smc_mujoco.mechanisms.custom import mjcf
from smc_mujoco.mechanisms.custom.scales import needs
from smc_mujoco.mechanisms.custom.user_model import UserModel
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation import run_key, scenario_json
from smc_mujoco.simulation.conditions import NAMED
from smc_mujoco.simulation.model import mechanism

TORQUE = smc.law("computed_torque", kp=100.0, kd=20.0)
ARRAYS = ("x", "v", "u", "applied", "s", "d", "force", "reaction")
LINKS = """
<mujoco>
  <default><geom type="capsule" size="0.03" contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="upper" pos="0 0 1"><joint name="shoulder" axis="0 1 0"/>
    <geom fromto="0 0 0 0 0 -.5" mass="1"/>
      <body name="lower" pos="0 0 -.5"><joint name="elbow" axis="0.6 0.8 0"/>
      <geom fromto="0 0 0 .1 0 -.4" mass="1"/>
      </body>
    </body>
    {bodies}
  </worldbody>
  {rest}
</mujoco>
"""
MOTORS = (
    '<motor name="a" joint="shoulder" gear="-4" ctrlrange="-1 2"/><motor name="b" joint="elbow"/>'
)
ACTUATED = f"<actuator>{MOTORS}</actuator>"
MORE_KEYS = """
  <actuator><motor joint="shoulder"/></actuator>
  <keyframe><key name="home" qpos="0.2 -0.5" ctrl="1"/><key ctrl="1"/></keyframe>
"""
BALL = '<body name="ball"><joint name="ball" type="ball"/><geom size=".1 .1" mass="1"/></body>'


def installed(package: str, path: str) -> Path:
    """A file of an installed package, which is not imported."""
    if (
        module := importlib.util.find_spec(package)
    ) is None or not module.submodule_search_locations:
        pytest.skip(f"{package} is not installed")
    return Path(module.submodule_search_locations[0]) / path


def suite(name: str) -> Path:
    return installed("dm_control", f"suite/{name}.xml")


def gym(name: str) -> Path:
    return installed("gymnasium", f"envs/mujoco/assets/{name}.xml")


def cartpole() -> Plant:
    return smc.plant_from(suite("cartpole"), {"slider": smc.Channel(partner="hinge_1")})


def acrobot() -> Plant:
    return smc.plant_from(suite("acrobot"), {"elbow": smc.Channel(partner="shoulder")})


def both_links() -> Plant:
    return smc.plant_from(
        suite("acrobot"), {j: smc.Channel(motor=True) for j in ("shoulder", "elbow")}
    )


def reacher() -> Plant:
    return smc.plant_from(gym("reacher"), ["joint0", "joint1"])


def pusher() -> Plant:
    path = gym("pusher_v5")
    raw = mujoco.MjModel.from_xml_path(str(path))
    names = [name for i in range(raw.njnt) if (name := raw.joint(i).name).startswith("r_")]
    return smc.plant_from(path, dict.fromkeys(names, smc.Channel(motor=True)))


@pytest.fixture
def arm(tmp_path):
    """A function that writes an arm and makes a plant of it."""

    def make(channels=("shoulder", "elbow"), rest=ACTUATED, bodies="", **given) -> Plant:
        path = tmp_path / "arm.xml"
        path.write_text(LINKS.format(rest=rest, bodies=bodies))
        return smc.plant_from(path, channels, **given)

    return make


def joints_of(plant: Plant, raw: mujoco.MjModel) -> list:
    """The plant's channels in the model as its file has it."""
    assert isinstance(plant.build, UserModel)
    names = own_channels.joints_of(plant.build.channels)
    return [raw.joint(name) for name in names]


def read(plant: Plant) -> mujoco.MjModel:
    """The model as its file has it."""
    assert isinstance(plant.build, UserModel)
    return mujoco.MjModel.from_xml_path(plant.build.source.path)


# it moves as in MuJoCo

FOREIGN = {"cartpole": cartpole, "acrobot": acrobot, "reacher": reacher}


CHAINS = FOREIGN | {"pusher": pusher, "both links": both_links}


@pytest.mark.parametrize("name", CHAINS)
def test_f_and_g_are_the_accelerations_of_the_file(name):
    plant = CHAINS[name]()
    raw = read(plant)
    raw.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT.value
    data = mujoco.MjData(raw)
    values = plant.values({})
    rng = np.random.default_rng(0)
    joints = joints_of(plant, raw)
    dofs = [j.dofadr[0] for j in joints]
    for _ in range(20):
        x, v, u = rng.uniform(-1, 1, (3, plant.n))
        u[plant.driven :] = 0.0
        data.qpos[[j.qposadr[0] for j in joints]] = x
        data.qvel[dofs] = v
        data.qfrc_applied[:] = 0.0
        data.qfrc_applied[dofs] = u
        mujoco.mj_forward(raw, data)
        for i in range(plant.n):
            f, g = plant.nominal(x, v, i, values, u)
            np.testing.assert_allclose(
                f + g * u[i % plant.driven], data.qacc[dofs[i]], rtol=1e-8, atol=1e-8
            )


# laws get f and g


@pytest.mark.quick
def test_seven_coupled_joints_settle_as_the_error_equation_says():
    """e'' + 20 e' + 100 e = 0: critically damped, e = (1 + 10 t) e0 exp(-10 t)."""
    plant = pusher()
    reference = smc.Constant(-0.3)
    e0 = 0.01  # within the ctrlrange of its motors
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law=TORQUE,
            model="nominal",
            reference=reference,
            u_max=1e3,
            duration=1.0,
            x0=-0.29,
        )
    )
    solution = e0 * (1 + 10 * trace.t) * np.exp(-10 * trace.t)
    assert np.abs(trace.x + 0.3 - solution[:, None]).max() < 1e-4
    assert np.abs(trace.x[-1] + 0.3).max() < 1e-4


PUSHED = {
    "disturbance": smc.Sine(amplitude=1.0, omega=3.0),
    "friction": smc.Coulomb(0.1),
}


@pytest.mark.parametrize(
    ("channels", "fields"),
    [
        (("shoulder", "elbow"), PUSHED),
        (("elbow", "shoulder"), {}),
    ],
)
def test_the_plain_loop_gives_the_same_bits(arm, channels, fields):
    """Also where channels have another order than the joints in the file."""
    law = smc.law("super_twisting")
    common = {
        "duration": 0.2,
        "x0": (0.4, -0.3),
        "u_max": 20.0,
    }
    scenario = smc.Scenario(
        plant=arm(channels),
        law=law,
        model="nominal",
        **common,
        **fields,
    )
    fast = smc.run(scenario)
    slow = plain.run(scenario)
    assert fast.failure is None
    assert [
        name for name in ARRAYS if not np.array_equal(getattr(fast, name), getattr(slow, name))
    ] == []


# what is made of the file


def test_u_is_the_force_on_the_joint_within_the_motor_s_limits(arm):
    plant = arm()
    assert isinstance(plant.build, UserModel)
    # gear -4, ctrlrange -1 2: the weaker way; the other motor has none
    assert plant.limits == (4.0, math.inf)

    @smc.law_function
    def much(y, gains, memory):
        return 30.0, y.limit

    scenario = smc.Scenario(
        plant=plant,
        law=much(),
        duration=0.1,
        u_max=50.0,
    )
    assert scenario.limits == (4.0, 50.0)
    for trace in smc.run(scenario), plain.run(scenario):
        for reported in trace.u, trace.applied, trace.force[1:]:
            np.testing.assert_array_equal(reported, [[4.0, 30.0]] * len(reported))
        np.testing.assert_array_equal(trace.s, [[4.0, 50.0]] * len(trace.s))  # as the law was told
        assert smc.score(trace)["max_u"] == 30.0
    weaker = smc.run(dataclasses.replace(scenario, u_max=3.0))
    np.testing.assert_array_equal(weaker.u, 3.0)


LIMITS = {
    "ctrlrange": ('<motor joint="elbow" gear="3" ctrlrange="-2 2"/>', "", 6.0),
    "forcerange": ('<motor joint="elbow" gear="-3" forcerange="-1 2"/>', "", 3.0),
    "both": ('<motor joint="elbow" gear="3" ctrlrange="-2 2" forcerange="-.5 .5"/>', "", 1.5),
    "the joint's": ('<motor joint="elbow" ctrlrange="-9 9"/>', 'actuatorfrcrange="-2 1"', 1.0),
    "no clamp": ('<motor joint="elbow" ctrlrange="-2 2"/>', "", math.inf),
    "ideal": (
        '<position joint="elbow" kp="17.8" forcerange="-3.35 3.35"/>',
        "",
        3.35,
    ),  # as of an SO-101
    "ideal, with a gear": ('<position joint="elbow" gear="-2" forcerange="-3 4"/>', "", 6.0),
    "ideal, of two": (
        '<position joint="elbow" forcerange="-3 3"/><velocity joint="elbow" forcerange="-1 1"/>',
        "",
        4.0,
    ),
    "ideal, of one with a range": (
        '<position joint="elbow" forcerange="-3 3"/><velocity joint="elbow"/>',
        "",
        math.inf,
    ),
    "ideal, of one way": ('<motor joint="elbow" forcerange="0 3"/>', "", math.inf),
    "ideal, of the joint": ('<position joint="elbow"/>', 'actuatorfrcrange="-2 2"', 2.0),
}


@pytest.mark.parametrize("name", LIMITS)
def test_a_channel_s_limit_is_what_the_file_s_motor_gives(arm, tmp_path, name):
    motor, joint, limit = LIMITS[name]
    if name == "no clamp":
        flag = '<option><flag clampctrl="disable"/></option>'
    else:
        flag = ""
    arm(["shoulder"])
    text = LINKS.format(
        rest=f"<actuator>{motor}</actuator>{flag}",
        bodies="",
    ).replace('axis="0.6 0.8 0"', f'axis="0.6 0.8 0" {joint}')
    (tmp_path / "arm.xml").write_text(text)
    plant = smc.plant_from(
        tmp_path / "arm.xml", {"elbow": smc.Channel(motor=name.startswith("ideal"))}
    )
    assert plant.limits == ((limit,) if limit < math.inf else ())
    limits = needs(plant) if limit == math.inf else (limit,)
    assert smc.Scenario(plant=plant, law="none").limits == limits
    raw = read(plant)
    data = mujoco.MjData(raw)
    # MuJoCo agrees: with a large ctrl of either sign the weaker way gives the limit
    if not name.startswith("ideal"):
        forces = []
        for data.ctrl[0] in (-100.0, 100.0):
            mujoco.mj_forward(raw, data)
            forces.append(abs(data.qfrc_actuator[raw.joint("elbow").dofadr[0]]))
        assert min(forces) == min(limit, 100.0)


def test_a_law_with_anti_wind_up_knows_its_motor_s_limit(arm):
    """PID against a load: its integrator stays where u is at the bound, however large u_max is."""
    rest = '<option gravity="0 0 0"/><actuator><motor joint="elbow" ctrlrange="-1 1"/></actuator>'
    plant = arm(["elbow"], rest)
    law = smc.law(
        "pid",
        kp=4.0,
        ki=4.0,
        kd=2.0,
        tt=0.1,
    )
    load = smc.signals.Pulse(
        amplitude=-2.0,
        time=0.0,
        width=2.0,
    )
    base = smc.Scenario(
        plant=plant,
        law=law,
        duration=8.0,
        disturbance=load,
    )
    reported, large = smc.run([base, dataclasses.replace(base, u_max=100.0)])
    np.testing.assert_array_equal(reported.x, large.x)
    assert np.abs(large.u).max() == 1.0


def test_joints_without_a_channel_keep_the_actuators_of_the_model(arm):
    servo = (
        '<actuator><motor name="b" joint="elbow"/>'
        '<position joint="shoulder" kp="500" dampratio="1"/></actuator>'
    )
    plant = arm(["elbow"], servo, keyframe=None)
    assert plant.n == 1
    assert "'shoulder'" in plant.unmodelled
    fields = {"law": "none", "duration": 2.0, "x0": 0.3}
    held = smc.run(smc.Scenario(plant=plant, **fields))
    loose = smc.run(smc.Scenario(plant=arm(["elbow"]), **fields))
    assert np.abs(held.x - loose.x).max() > 0.05


def test_a_keyframe_is_where_runs_start(arm):
    rest = ACTUATED + '<keyframe><key name="home" qpos="0.2 -0.5"/></keyframe>'
    assert arm(rest=rest, keyframe="home").x0 == (0.2, -0.5)
    assert arm({"elbow": smc.Channel(x0=1.0), "shoulder": None}, rest, keyframe="home").x0 == (
        1.0,
        0.2,
    )
    trace = smc.run(
        smc.Scenario(
            plant=arm(["elbow"], rest, keyframe="home"),
            law="none",
            duration=0.1,
        )
    )
    assert trace.x[0, 0] == -0.5
    moving = rest.replace('-0.5"', '-0.5" qvel="1 1"').replace(
        "</keyframe>", '<key name="other" qpos="9 9"/></keyframe>'
    )
    with_motor = arm({"elbow": smc.Channel(motor=True)}, MORE_KEYS, keyframe="home")
    trace = smc.run(smc.Scenario(plant=with_motor, law="none", duration=0.1))
    assert trace.failure is None
    for part in (None, smc.Backlash(0.02)):  # which adds joints
        scenario = smc.Scenario(
            plant=arm(["elbow"], moving, keyframe="home"), law="none", actuator=part
        )
        qpos, qvel = models.initial_state(model := models.compile_model(scenario), scenario)
        assert [qpos[model.joint(joint).qposadr[0]] for joint in ("shoulder", "elbow")] == [
            0.2,
            -0.5,
        ]
        assert not qvel.any()
    with pytest.raises(
        smc.ScenarioError, match=r"unknown keyframe of arm.xml 'hme': did you mean 'home'"
    ):
        arm(rest=rest, keyframe="hme")


def test_includes_and_their_contents_count(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "motors.xml").write_text(f"<mujoco>{ACTUATED}</mujoco>")
    (tmp_path / "arm.xml").write_text(
        LINKS.format(
            rest='<include file="parts/motors.xml"/>',
            bodies="",
        )
    )
    plant = smc.plant_from(tmp_path / "arm.xml", ["elbow"])
    scenario = smc.Scenario(
        plant=plant,
        law="none",
        duration=0.01,
    )
    assert smc.run(scenario).failure is None
    assert mechanism(scenario) is mechanism(scenario)  # compiled once
    (tmp_path / "parts" / "motors.xml").write_text(f"<mujoco>{ACTUATED}<!-- other --></mujoco>")
    with pytest.raises(smc.ScenarioError, match=r"has changed: call smc.plant_from again"):
        smc.run(scenario)


def test_files_that_others_name_in_folders_of_their_own_count(tmp_path):
    """An attached model has its own meshdir, and a compiler that is included sets that of the
    whole.
    """
    body = (
        '<asset><mesh name="c" file="c.obj"/></asset><worldbody><body name="b"><joint name="j"/>'
        '<geom type="mesh" mesh="c" mass="1"/></body></worldbody>'
    )
    (tmp_path / "sub" / "assets").mkdir(parents=True)
    (tmp_path / "sub" / "assets" / "c.obj").write_text("\n".join([*CORNERS, *FACES]))
    (tmp_path / "sub" / "child.xml").write_text(
        f'<mujoco><compiler meshdir="assets"/>{body}</mujoco>'
    )
    (tmp_path / "attaching.xml").write_text(
        '<mujoco><asset><model name="m" file="sub/child.xml"/></asset>'
        '<worldbody><attach model="m" body="b" prefix="left/"/></worldbody></mujoco>'
    )
    (tmp_path / "compiler.xml").write_text('<mujoco><compiler meshdir="sub/assets"/></mujoco>')
    (tmp_path / "including.xml").write_text(
        f'<mujoco><include file="compiler.xml"/>{body}</mujoco>'
    )
    motor = smc.Channel(motor=True)
    plants = {
        "attaching": {"left/j": motor},
        "including": {"j": motor},
    }
    built = []
    for name, joints in plants.items():
        built.append(smc.plant_from(tmp_path / f"{name}.xml", joints))
    with (tmp_path / "sub" / "assets" / "c.obj").open("a") as mesh:
        mesh.write("\n# another")
    for plant in built:
        with pytest.raises(smc.ScenarioError, match=r"has changed: call smc.plant_from again"):
            plant.spec()


def test_the_file_s_own_sensors_are_no_channels(arm):
    sensors = (
        '<sensor><jointpos joint="elbow"/>'
        '<jointvel joint="elbow" delay="0.01" nsample="20"/></sensor>'
    )
    plant = arm(["shoulder"], ACTUATED + sensors)
    scenario = smc.Scenario(
        plant=plant,
        law=smc.law("classical"),
        duration=0.1,
        x0=0.3,
    )
    trace = smc.run(scenario)
    plainly = smc.run(dataclasses.replace(scenario, plant=arm(["shoulder"])))
    assert trace.x.shape == (101, 1)
    np.testing.assert_array_equal(trace.x, plainly.x)


LINK = (
    '<geom type="capsule" fromto="0 0 0 {} 0 0" size=".02" mass="{}" contype="0" conaffinity="0"/>'
)
FOREARM = f'<body pos=".3 0 0"><joint name="b" axis="0 1 0" {{}}/>{LINK.format(0.2, 0.5)}</body>'
ACROSS = """<tendon><fixed frictionloss="9"><joint joint="a" coef="1"/><joint joint="b" coef=".3"/>
  </fixed></tendon>"""
# joint a, what it carries beside its link, the rest of the file
DRY = {
    "hinge": ('axis="0 1 0" frictionloss="3"', "", ""),
    "light hinge": ('axis="0 1 0" frictionloss="3" damping=".01" stiffness="2"', "", ""),
    "slide": ('type="slide" axis="0 0 1" frictionloss="25"', "", ""),
    "arm": ('axis="0 1 0" frictionloss="9"', FOREARM.format('frictionloss=".8"'), ""),
    "default masks": ('axis="0 1 0" frictionloss="9"', FOREARM.format('frictionloss=".8"'), ""),
    "geared": ('axis="0 1 0" frictionloss="9" armature=".2"', FOREARM.format(""), ""),
    "tendon": ('axis="0 1 0"', FOREARM.format('frictionloss=".8"'), ACROSS),
}


NO_CONTACT = '<option><flag contact="disable"/></option>'


def dry_arm(kind):
    """The text and plant of an arm with dry friction, which needs a force to stay level."""
    joint, carried, more = DRY[kind]
    motors = '<motor joint="a"/>'
    if carried:
        motors += '<motor joint="b"/>'
    if kind == "geared":
        more = '<equality><joint joint1="b" polycoef="0 1 0 0 0"/></equality>'
    text = f"""<mujoco><worldbody><body><joint name="a" {joint}/>{LINK.format(0.3, 0.5)}{carried}
      </body></worldbody>{more}<actuator>{motors}</actuator></mujoco>"""
    if kind == "default masks":  # by which a link and its parent would meet, were they not kin
        text = text.replace(' contype="0" conaffinity="0"', "")
    return text, smc.plant_from(text, ["a", "b"] if carried else ["a"])


@pytest.mark.parametrize(
    "fields",
    [{}, {"physics_step": 1e-3}, {"integrator": "RK4"}, {"integrator": "implicitfast"}],
    ids=str,
)
@pytest.mark.parametrize("kind", DRY)
def test_dry_friction_of_the_file_holds_what_weighs_less(kind, fields):
    """MuJoCo's default sank by up to a radian in 10 s, its hardest by 1e-4 h times what it holds."""
    _, plant = dry_arm(kind)
    held = smc.run(smc.Scenario(plant=plant, law="none", x0=0.0, duration=3.0, **fields))
    scenario = held.scenario
    alone = len(DRY[kind][1]) == 0 and scenario.integrator != "implicitfast"
    assert scenario.exact_friction == alone
    assert np.abs(held.x[1000:] - held.x[1000]).max() < 2e-7
    assert np.abs(held.x).max() < (3e-3 if kind == "geared" else 1e-6)  # the file's gear is soft


@pytest.mark.filterwarnings("always:the dry friction of")
@pytest.mark.parametrize(
    ("kind", "solref"),
    [
        pytest.param("default masks", ".02 1.5", marks=pytest.mark.slow),
        pytest.param("default masks", "-100 -50", marks=pytest.mark.slow),
        ("default masks", ""),
        ("arm", ".02 1.5"),
        ("tendon", ".05 1"),
        ("hinge", "-100 -50"),
    ],
)
def test_dry_friction_that_creeps_is_told_with_its_speed_and_each_cure_holds(kind, solref):
    hard, plant = dry_arm(kind)
    joints = ["a", "b"][: plant.n]
    hard = hard.replace("<worldbody>", '<worldbody><geom type="plane" size="9 9 1" pos="0 0 -9"/>')
    text = hard
    if solref:
        text = re.sub(r'(frictionloss="[39]")', rf'\1 solreffriction="{solref}"', hard)
    cure = "leave out the solreffriction" if solref else "nothing creeps without contacts"
    with pytest.warns(smc.errors.ScenarioWarning, match=cure) as caught:
        plant = smc.plant_from(text, joints)
    sentence = next(str(w.message) for w in caught if "creeps" in str(w.message))
    assert ("solreffriction" in sentence) == bool(solref)
    speed, bound = (float(text) for text in re.findall(r"by ([0-9.e-]+)", sentence))
    trace = smc.run(smc.Scenario(plant=plant, law="none", duration=0.3))
    assert speed == pytest.approx(np.abs(trace.v[-1]).max(), rel=0.1)
    assert speed < bound
    cured = hard if solref else text.replace("<worldbody>", f"{NO_CONTACT}<worldbody>")
    with warnings.catch_warnings():
        warnings.simplefilter("error" if not solref else "ignore")
        held = smc.run(smc.Scenario(plant=smc.plant_from(cured, joints), law="none"))
    assert np.abs(held.v[-1]).max() < (2e-5 if solref else 1e-9)


HANGING = """<mujoco><worldbody><body><joint name="j" axis="0 1 0" frictionloss="9"
 solreffriction="-100 -50"/><geom type="capsule" fromto="0 0 0 0 0 -.4" size=".02" mass="1"/></body>
</worldbody><actuator><motor joint="j"/></actuator></mujoco>"""


@pytest.mark.filterwarnings("always:the dry friction of")
@pytest.mark.parametrize("x0", [None, 1.2])
def test_dry_friction_creeps_under_the_weight_where_runs_start(x0):
    with pytest.warns(smc.errors.ScenarioWarning, match="creeps") as caught:
        plant = smc.plant_from(HANGING, {"j": smc.Channel(x0=x0)})
    sentence = next(str(w.message) for w in caught if "creeps" in str(w.message))
    reported = re.search(r"by ([0-9.e-]+) rad/s \(m/s\) under the weight", sentence)
    if x0 is None:
        assert reported is None  # it hangs, and nothing pulls
        return
    trace = smc.run(smc.Scenario(plant=plant, law="none", duration=0.3))
    assert float(reported[1]) == pytest.approx(np.abs(trace.v[-1]).max(), rel=0.1)  # pyright: ignore[reportOptionalSubscript]


def test_a_file_is_hashed_parsed_and_compiled_once_for_a_plant(tmp_path, monkeypatch):
    counts = collections.Counter()

    def counted(owner, name):
        function = getattr(owner, name)

        def counting(*args, **kwargs):
            counts[name] += 1
            return function(*args, **kwargs)

        monkeypatch.setattr(owner, name, counting)

    counted(mjcf, "digest")
    counted(mjcf.ModelSource, "read")
    counted(mjcf.ModelSource, "compiled")
    path = tmp_path / "hanging.xml"
    path.write_text(HANGING.replace("-.4", f"-.{tmp_path.stat().st_ino}"))  # none that is known
    plant = smc.plant_from(path, ["j"])
    assert counts == {"digest": 1, "read": 1, "compiled": 1}
    scenario = smc.Scenario(plant=plant, law="pid", duration=0.01)
    smc.run([scenario, dataclasses.replace(scenario, law="classical")])
    smc.plant_from(path, ["j"], others="locked")
    assert counts == {"digest": 2, "read": 1, "compiled": 2}  # of the file as edited, the second
    path.touch()
    smc.run(scenario)
    assert counts["read"] == 1
    assert counts["digest"] == 3


ACTUATORS = {
    '<dcmotor joint="j" motorconst=".05" resistance="2" lugre="1 1 .1 .2 .1"/>': "<dcmotor>",
    '<intvelocity joint="j" kp="9" actrange="-3 3"/>': "<intvelocity>, .* a speed",
    '<velocity joint="j" kv="5"/>': "<velocity> servo, .* a speed",
    '<pid joint="j" kp="9" input="ff"/>': "<pid> without a position",
    '<cylinder joint="j" area="1"/>': "<cylinder>",
    '<damper joint="j" kv="5" ctrlrange="0 1"/>': "<damper>",
    '<general joint="j" dyntype="integrator"/>': "dyntype integrator",
}


@pytest.mark.parametrize("element", ACTUATORS)
def test_an_actuator_that_is_no_motor_is_called_what_it_is(element):
    text = HANGING.replace('<motor joint="j"/>', element)
    with pytest.raises(smc.ScenarioError, match=f"{ACTUATORS[element]}.*motor=True"):
        smc.plant_from(text, ["j"])
    assert smc.plant_from(text, {"j": smc.Channel(motor=True)}).driven == 1


@pytest.mark.filterwarnings("always:.* give way by")
@pytest.mark.parametrize("solref", [".02 1", ".04 .5", "-900 -60"])
def test_a_warning_says_how_far_an_equality_gives_way(solref):
    text = f"""<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="j" type="slide"
      axis="1 0 0"/>{LINK.format(0.3, 0.5)}</body></worldbody>
      <equality><joint joint1="j" solref="{solref}"/></equality></mujoco>"""
    with pytest.warns(smc.errors.ScenarioWarning, match="equality constraints") as caught:
        plant = smc.plant_from(text, {"j": {"motor": True}})
    (reported,) = map(float, re.findall(r"by ([0-9.]+) m", str(caught[0].message)))
    trace = smc.run(smc.Scenario(plant=plant, law="none", v0=1.0, duration=0.5))
    assert 1e-3 * reported == pytest.approx(trace.x.max(), rel=0.15)


@pytest.mark.filterwarnings("default:.* give way by")
@pytest.mark.parametrize("solref", [".02 1", ".03 .5", ".01 2", "-2500 -100"])
@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_a_warning_says_how_far_a_limit_gives_way_before_the_run(solref, speed):
    text = f"""<mujoco><worldbody><body><joint name="j" type="slide" axis="1 0 0" range="-50 40"
      solreflimit="{solref}" limited="true"/>{LINK.format(0.3, 0.5)}</body></worldbody>
      <compiler angle="radian"/><actuator><motor joint="j"/></actuator></mujoco>"""
    with pytest.warns(smc.errors.ScenarioWarning, match="solreflimit") as caught:
        plant = smc.plant_from(text, ["j"])
    (reported,) = map(float, re.findall(r"by ([0-9.]+) m", str(caught[0].message)))
    trace = smc.run(smc.Scenario(plant=plant, law="none", x0=39.9, v0=speed, duration=0.5))
    assert 1e-3 * reported * speed == pytest.approx(trace.x.max() - 40.0, rel=0.1)
    hard = text.replace(solref, ".004 1")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        smc.plant_from(hard, ["j"])


@pytest.mark.filterwarnings("always:.* give way by")
def test_contacts_give_way_under_the_weight_too():
    text = f"""<mujoco><worldbody><geom size=".05" pos="0 2 0"/><body><joint name="j" type="slide"
      axis="1 0 0"/>{LINK.format(0.3, 0.5)}</body></worldbody>
      <actuator><motor joint="j"/></actuator></mujoco>""".replace('contype="0"', "")
    with pytest.warns(smc.errors.ScenarioWarning, match="by 7.4 mm if .* by 0.2 mm under"):
        smc.plant_from(text, ["j"])


def test_a_motor_moves_a_joint_whatever_groups_the_file_turns_off(arm):
    plant = arm(
        {"elbow": smc.Channel(motor=True)},
        ACTUATED + '<option actuatorgroupdisable="0 1 2 3 4 5"/>',
    )
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law=smc.law("classical"),
            duration=0.05,
            x0=0.3,
        )
    )
    np.testing.assert_array_equal(trace.force[1:, 0], trace.u[:-1, 0])


def test_twice_the_mass_is_twice_all_masses_and_inertias_and_no_armature(arm):
    plant = arm(rest='<default><joint armature="0.1"/></default>' + ACTUATED)
    raw = read(plant)
    raw.body_mass[:] *= 2.0
    raw.body_inertia[:] *= 2.0
    data = mujoco.MjData(raw)
    mujoco.mj_setConst(raw, data)
    raw.opt.timestep, raw.opt.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_RK4
    base = smc.Scenario(
        plant=plant,
        law="none",
        duration=0.5,
        x0=(0.3, -0.3),
    )
    heavy, light = smc.run([dataclasses.replace(base, mismatch={"mass": 2.0}), base])
    mujoco.mj_resetData(raw, data)
    data.qpos[:] = 0.3, -0.3
    for _ in range(500):
        mujoco.mj_step(raw, data)
    np.testing.assert_allclose(heavy.x[-1], data.qpos, atol=1e-12)
    assert np.abs(heavy.x[-1] - light.x[-1]).max() > 1e-3


# joints without an actuator


def test_hierarchical_brings_in_a_foreign_cart_with_its_pole():
    plant = smc.plant_from(
        suite("cartpole"), {"slider": smc.Channel(partner="hinge_1", partner_x0=0.3)}
    )
    assert plant.x0 == (0.0, 0.3)
    scenario = smc.Scenario(plant=plant, law="hierarchical")
    assert scenario.resolved.model == "nominal"
    assert scenario.resolved.u_max == 10.0
    trace = smc.run(scenario)
    assert np.abs(trace.x[-1]).max() < 1e-5
    assert "hierarchical" in smc.laws(plant)
    assert "hierarchical" not in smc.laws(acrobot_alone())


def acrobot_alone() -> Plant:
    return smc.plant_from(suite("acrobot"), {"elbow": None})


# swing-ups

POLE = """
<mujoco model="pole"><worldbody>
  <body><joint name="slide" type="slide" axis="1 0 0"/><geom size=".1" mass="1" contype="0"/>
    <body><joint name="pole" axis="0 1 0" {range}/>
    <geom size=".1" pos="0 0 1" mass="2" contype="0"/></body></body>
</worldbody>
<actuator><motor name="s" joint="slide" gear="20" ctrlrange="-1 1"/><motor joint="pole"/>
</actuator></mujoco>"""


def test_a_swing_up_has_half_the_torque_of_its_heaviest_pendulum_and_no_slide(tmp_path):
    (tmp_path / "pole.xml").write_text(POLE.format(range=""))
    for order in (
        ("slide", "pole"),
        ("pole", "slide"),
    ):
        assert tasks.tasks(smc.plant_from(tmp_path / "pole.xml", order)) == ["regulate", "track"]
    body = (
        '<body pos="0 {y} 0"><joint name="{name}" axis="{axis}"/>'
        '<geom size=".01" pos="0 0 1" mass="{mass}"/></body>'
    )
    three = [("light", "0 1 0", 1.0), ("heavy", "0 1 0", 2.0), ("upright", "0 0 1", 1.0)]
    bodies = []
    for y, (name, axis, mass) in enumerate(three):
        bodies.append(
            body.format(
                y=y,
                name=name,
                axis=axis,
                mass=mass,
            )
        )
    (tmp_path / "three.xml").write_text(
        f"<mujoco><worldbody>{''.join(bodies)}</worldbody></mujoco>"
    )
    for order in (
        ("upright", "light", "heavy"),
        ("heavy", "light", "upright"),
    ):
        plant = smc.plant_from(
            tmp_path / "three.xml", dict.fromkeys(order, smc.Channel(motor=True))
        )
        scenario = episode.Setting(plant, "swing_up").scenario
        assert scenario.resolved.u_max == pytest.approx(0.5 * 2.0 * 9.81)


# errors

SERVO = '<actuator><position name="p" joint="shoulder"/></actuator>'
TWO = f'<actuator>{MOTORS}<motor name="c" joint="elbow"/></actuator>'
TENDON = (
    '<tendon><fixed name="t"><joint joint="elbow" coef="1"/></fixed></tendon>'
    '<actuator><motor tendon="t"/></actuator>'
)
ONE_WAY = '<body><joint name="j" actuatorfrcrange="0 2"/><geom size=".1 .1" mass="1"/></body>'
ROTATING = '<body><joint name="rotor:a"/><geom size=".1 .1" mass="1"/></body>'
WRONG = {
    "no joint": {"channels": ["elbwo"]},
    "ball": {"channels": ["ball"], "bodies": BALL},
    "none": {"rest": ""},
    "tendon": {"channels": ["elbow"], "rest": TENDON},
    "several": {"rest": TWO},
    "servo": {"channels": ["shoulder"], "rest": SERVO},
    "unknown field": {"channels": {"elbow": {"gear": 2}}},
    "twice": {"channels": ["elbow", "elbow"]},
    "empty": {"channels": []},
    "text": {"channels": "elbow"},
    "number": {"channels": {"elbow": 3}},
    "partner's x0": {"channels": {"elbow": {"partner_x0": 1.0}}},
    "set": {"channels": {"elbow"}},
    "motor": {"channels": {"elbow": {"motor": "no"}}},
    "one way": {
        "channels": ["elbow"],
        "rest": '<actuator><motor name="m" joint="elbow" ctrlrange="0 2"/></actuator>',
    },
    "one way at the joint": {
        "channels": {"j": {"motor": True}},
        "bodies": ONE_WAY,
    },
    "slow motor": {
        "channels": ["elbow"],
        "rest": '<actuator><general joint="elbow" dyntype="filter" actearly="true"/></actuator>',
    },
    "no gear": {
        "channels": ["elbow"],
        "rest": '<actuator><motor joint="elbow" gear="0"/></actuator>',
    },
    "off": {"rest": ACTUATED + '<option actuatorgroupdisable="0"/>'},
    "rotor": {
        "channels": {"rotor:a": smc.Channel(motor=True)},
        "bodies": ROTATING,
    },
    "no keyframe": {"keyframe": "home"},
    "no site": {"tip": "tip"},
    "half a law": {"channels": {"elbow": {"law": "none"}, "shoulder": None}},
    "half a partner": {
        "channels": {"elbow": {"partner": "shoulder"}, "j": None},
        "bodies": ONE_WAY,
    },
    "u_max": {"channels": {"elbow": {"u_max": 0.0}}},
    "x0": {"channels": {"elbow": {"x0": "a"}}},
    "partner's x0 beyond": {"channels": {"elbow": {"partner": "shoulder", "partner_x0": -2e6}}},
    "name": {"name": "duffing"},
    "flag": {"rest": f'{ACTUATED}<option><flag actuation="disable"/></option>'},
    "broken": {"rest": "<actuator>\n<mtor/></actuator>"},
    "unclosed": {"rest": "<actuator>\n<motor></actuator>"},
    "attribute": {"rest": '<actuator>\n<motor joint="elbow" gaer="1"/></actuator>'},
    "target": {"rest": '<actuator><motor joint="elbwo"/></actuator>'},
    "compile": {"bodies": "<body><joint/></body>"},
}


def test_a_mistake_is_one_sentence(arm, refused):
    for mistake in WRONG.values():
        refused(lambda mistake=mistake: arm(**mistake))


def test_a_broken_file_that_is_included_is_one_sentence(arm, tmp_path):
    (tmp_path / "part.xml").write_text("<mujoco>\n\n<foo></mujoco>")
    with pytest.raises(
        smc.ScenarioError, match=r"MuJoCo cannot read \S*arm.xml \(.*\): fix the file$"
    ):
        arm(rest='<include file="part.xml"/>')


@pytest.mark.skipif(sys.platform != "linux", reason="a name that is no UTF-8")
def test_a_model_in_a_folder_whose_name_is_no_utf_8_is_one_sentence(tmp_path):
    file = tmp_path / os.fsdecode(b"\xff") / "arm.xml"
    file.parent.mkdir()
    file.write_text("<mujoco/>")
    with pytest.raises(smc.ScenarioError, match=r"MuJoCo cannot read .*: rename it, or its folder"):
        smc.plant_from(file, {"j": None})


# models that harm a run

HARM = {  # what the model has, and words of the sentence
    "nan": (
        '<default><joint damping="nan"/></default>',
        r'arm.xml has damping="nan": give a number',
    ),
    "mass": (
        '<default><geom density="1e300"/></default>'
        '<worldbody><body name="b"><joint/><geom size=".1 .1"/></body></worldbody>',
        r"^\w+\[\d+\] of arm.xml is \S*e\S*: give finite numbers of at most 1e.15 in its MJCF",
    ),
    "text": (
        '<custom><text name="smc:direct" data="x"/></custom>',
        "arm.xml has a text 'smc:direct', and names that b",
    ),
    "tendon": (
        '<tendon><fixed name="lead:elbow"><joint joint="elbow" coef="1"/></fixed></tendon>',
        "arm.xml has a tendon 'lead:elbow', and names that begin with .*, lead:, .*rotor: are smc",
    ),
}


@pytest.mark.parametrize("name", HARM)
def test_a_model_that_would_harm_a_run_is_one_sentence(arm, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    rest, words = HARM[name]
    with pytest.raises(smc.ScenarioError, match=words) as caught:
        arm(rest=ACTUATED + rest)
    assert "\n" not in str(caught.value)


def test_numbers_that_may_be_infinite_are_ranges_alone(arm):
    rest = '<actuator><motor joint="shoulder" ctrlrange="-inf inf" ctrllimited="true"/></actuator>'
    assert arm(["shoulder"], rest).limits == ()


def test_names_that_refer_to_motors_and_sensors_do_no_harm(arm):
    named = (
        '<motor name="passive:elbow" joint="shoulder"/><motor joint="shoulder"/>'
        '<motor name="1" joint="shoulder"/>'
    )
    rest = f"""<actuator>{named}<motor name="b" joint="elbow"/></actuator>
      <sensor><jointpos name="x:elbow" joint="shoulder"/></sensor>
      <custom><tuple name="t"><element objtype="actuator" objname="b"/>
      <element objtype="sensor" objname="x:elbow"/>
      </tuple></custom>"""
    plant = arm(["elbow"], rest)
    friction = smc.hardware.LuGre(
        coulomb=0.05,
        static=0.08,
        stribeck=0.05,
    )
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law="none",
            duration=0.05,
            friction=friction,
            actuator=smc.Backlash(0.01),
        )
    )
    assert trace.failure is None


# models that are no files

CORNERS = [f"v {x} {y} {z}" for x in (0, 0.1) for y in (0, 0.1) for z in (0, -0.5)]
FACES = [
    f"f {a}"
    for a in (
        "1 2 3",
        "2 3 4",
        "5 6 7",
        "6 7 8",
        "1 2 5",
        "2 5 6",
        "3 4 7",
        "4 7 8",
        "1 3 5",
        "2 4 6",
    )
]
MESHED = """
<mujoco model="meshed">
  <compiler meshdir="meshes"/>
  <asset><mesh name="c" file="c.obj"/></asset>
  <worldbody>
    <body name="b" pos="0.33333333333333331 0 1">
      <joint name="j" axis="0 1 0" damping="0.12345678901234567"/>
      <geom type="mesh" mesh="c" density="432.10987654321"/>
    </body>
  </worldbody>
  <actuator><motor name="m" joint="j" gear="7.1234567890123"/></actuator>
</mujoco>
"""


@pytest.fixture
def meshed(tmp_path):
    """The file of a model with a mesh, and the mesh's content."""
    (tmp_path / "meshes").mkdir()
    content = "\n".join([*CORNERS, *FACES]).encode()
    (tmp_path / "meshes" / "c.obj").write_bytes(content)
    (tmp_path / "meshed.xml").write_text(MESHED)
    return tmp_path / "meshed.xml", content


def of_pymjcf(path, content):
    return pytest.importorskip("dm_control.mjcf").from_path(str(path)), None


FORMS = {  # of one model
    "text": lambda path, content: (MESHED, {"c.obj": content}),
    "spec": lambda path, content: (mujoco.MjSpec.from_file(str(path)), None),
    "spec with assets": lambda path, content: (
        mujoco.MjSpec.from_string(MESHED, assets={"c.obj": content}),
        None,
    ),
    "pymjcf": of_pymjcf,
}


@pytest.mark.parametrize("form", FORMS)
def test_a_model_that_is_no_file_moves_as_its_file_does_and_is_kept_with_its_run(
    meshed, tmp_path, form
):
    path, content = meshed
    model, assets = FORMS[form](path, content)
    channels = {"j": smc.Channel(x0=0.3)}
    plant = smc.plant_from(model, channels, assets=assets)
    from_file = smc.plant_from(path, channels)
    assert plant.name == "meshed"
    assert pickle.loads(pickle.dumps(plant)) == plant
    fields = {
        "law": "super_twisting",
        "duration": 0.2,
        "actuator": smc.Backlash(0.01),
        "model": "nominal",
    }
    scenario = smc.Scenario(plant=plant, **fields)
    trace = smc.run(scenario)
    same = smc.run(smc.Scenario(plant=from_file, **fields))
    np.testing.assert_allclose(trace.x, same.x, atol=1e-9)
    assert np.ptp(trace.x) > 0.01
    path.unlink()
    (path.parent / "meshes" / "c.obj").unlink()
    again = smc.load(trace.save(tmp_path / "run.npz"))
    assert again.scenario == trace.scenario
    assert run_key.run_key(again.scenario) == run_key.run_key(scenario)
    np.testing.assert_array_equal(smc.run(again.scenario).x, trace.x)
    edited = MESHED.replace("7.1234567890123", "7.1234567890124")
    changed = smc.plant_from(edited, channels, assets={"c.obj": content})
    assert run_key.run_key(dataclasses.replace(scenario, plant=changed)) != run_key.run_key(
        scenario
    )


def test_an_mjspec_keeps_all_its_digits_and_is_taken_as_it_is_now(meshed):
    spec = mujoco.MjSpec.from_file(str(meshed[0]))
    plant = smc.plant_from(spec, ["j"])
    spec.joint("j").damping = [9.0, 0.0, 0.0]
    assert plant.load().dof_damping[0] == 0.12345678901234567
    assert plant.limits == smc.plant_from(meshed[0], ["j"]).limits
    assert smc.plant_from(spec, ["j"]).load().dof_damping[0] == 9.0
    # for others MuJoCo writes as it did
    assert "0.123457" in mujoco.MjSpec.from_file(str(meshed[0])).to_xml()


# kept


def test_a_trace_loads_back_and_knows_its_file(arm, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    trace = smc.run(
        smc.Scenario(
            plant=arm({"elbow": smc.Channel(motor=True)}, name="mine"), law="none", duration=0.1
        )
    )
    path = trace.save(tmp_path / "a.npz")
    again = smc.load(path)
    assert again.scenario == trace.scenario
    assert run_key.run_key(again.scenario) == run_key.run_key(trace.scenario)
    np.testing.assert_array_equal(smc.run(again.scenario).x, trace.x)
    arm(bodies=BALL)
    words = r"the scenario of \S*a.npz cannot be restored, its model \S*arm.xml"
    with pytest.raises(
        smc.ScenarioError, match=rf"{words}, or a file .* has changed since the run: put it back$"
    ):
        smc.load(path)
    (tmp_path / "arm.xml").unlink()
    with pytest.raises(smc.ScenarioError, match=rf"{words} is not there: put it back, or run"):
        smc.load(path)


def test_no_record_of_a_model_knows_its_folder(arm, tmp_path, monkeypatch):
    """Two people who have one file in two folders write the same, and read each other's."""
    original = arm().build.source.path
    records = []
    for name in ("anna", "others/bert"):
        folder = tmp_path / name / "models"
        folder.mkdir(parents=True)
        path = shutil.copy(original, folder)
        scenario = smc.Scenario(
            plant=smc.plant_from(path, ["shoulder"]), law=smc.law("pid"), duration=0.1
        )
        about = scenario_json.describe(scenario)
        records.append((run_key.row(scenario), run_key.portable_key(scenario), about))
    assert records[0] == records[1]
    assert str(tmp_path) not in str(records)
    monkeypatch.setattr(mjcf, "_known", {})  # as in another process
    monkeypatch.chdir(tmp_path / "anna")
    build: Any = scenario_json.restore(about).plant.build
    assert build.source.path == str(Path("models/arm.xml").resolve())
    monkeypatch.chdir(tmp_path / "others")
    monkeypatch.setattr(mjcf, "_known", {})
    with pytest.raises(smc.ScenarioError, match=r"arm.xml is not there: put it back, or run in"):
        scenario_json.restore(about)


DEFAULTS = {
    "joint": 'damping=".1" frictionloss=".05" limited="true" range="-2 2"',
    "motor": 'ctrlrange="-5 5" gear="5"',
    "tendon": 'stiffness="3" damping=".2"',
}
DEFAULTED = """<mujoco model="one"><compiler angle="radian"/><default>{0}</default><worldbody>
<body name="base" {1}><body><joint name="j" axis="0 1 0" {2}/><geom type="capsule" size=".02"
fromto="0 0 0 0 0 -.3" mass=".5" contype="0" conaffinity="0"/></body></body></worldbody><actuator>
<motor joint="j" {3}/></actuator></mujoco>"""


@pytest.mark.filterwarnings("ignore:LuGre's bristles")
@pytest.mark.parametrize("condition", ["lugre", "backlash", "elastic", "motor_side"])
def test_what_parts_add_to_a_model_takes_none_of_its_defaults(condition):
    """A rotor had the friction and the limits of the file's joints, a bristle the motor's gear."""
    joint, motor = DEFAULTS["joint"], DEFAULTS["motor"]
    classes = "".join(f"<{kind} {values}/>" for kind, values in DEFAULTS.items())
    of_joints = f'<default class="own"><joint {joint}/></default>'
    ends = []
    for text in (
        DEFAULTED.format("", "", joint, motor),
        DEFAULTED.format(classes, "", "", ""),
        DEFAULTED.format(of_joints, 'childclass="own"', "", motor),
    ):
        plant = smc.plant_from(text, {"j": smc.Channel(x0=0.3)})
        law = smc.law("pid", kp=20.0, ki=5.0, kd=2.0)
        fields = NAMED[condition].on(plant, 0.2)
        ends.append(smc.run(smc.Scenario(plant=plant, law=law, duration=0.2, **fields)).x[-1, 0])
    assert ends[0] == ends[1] == ends[2]


def test_a_run_compiles_its_model_and_that_of_its_plant_once(arm, monkeypatch):
    """Six times before: what only asks the model has that of the plant."""
    compiled = []
    compile_spec = mujoco.MjSpec.compile

    def counting(*arguments):
        compiled.append(arguments)
        return compile_spec(*arguments)

    plant = arm(rest=ACTUATED)
    scenario = smc.Scenario(plant=plant, law="pid", duration=0.01, friction=smc.Viscous(0.1))
    monkeypatch.setattr(mujoco.MjSpec, "compile", counting)
    smc.run(scenario)
    assert len(compiled) <= 2
