"""A robot of one's own: what a text says of its channels, bounds, mistakes in laws, and the shapes
of a URDF.
"""

import re
import warnings

import mujoco
import numpy as np
import pytest
from helpers.commands import python

import smc_mujoco as smc
from smc_mujoco.common import gl
from smc_mujoco.draw.film import stage
from smc_mujoco.mechanisms.named import as_plant

MODEL = """<mujoco><worldbody><body><joint name="lift" type="slide" axis="0 0 1"/><geom size=".1" mass="3"/>
<body pos="0 0 -.1"><joint name="tilt" axis="0 1 0" damping=".1"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03"/></body></body></worldbody></mujoco>"""
ARM = """<robot name="arm"><link name="base"/>
<link name="l1"><inertial><origin xyz="0 0 -0.25"/><mass value="1.5"/>
<inertia ixx="0.03" iyy="0.03" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><origin xyz="0 0 -0.25"/><geometry><cylinder radius="0.03" length="0.5"/></geometry></visual>
<collision><origin xyz="0 0 -0.25"/><geometry><box size=".1 .1 .5"/></geometry></collision></link>
<link name="l2"><inertial><origin xyz="0 0 -0.2"/><mass value="0.8"/>
<inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><origin xyz="0 0 -0.2"/><geometry><cylinder radius="0.03" length="0.4"/></geometry></visual></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="l1"/><origin xyz="0 0 1.2"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="40" velocity="10"/></joint>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0 0 -0.5"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="20" velocity="10"/></joint></robot>"""
RUN = {"law": "classical", "duration": 0.01}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "mine.xml").write_text(MODEL)
    (tmp_path / "arm.urdf").write_text(ARM)
    (tmp_path / "one.xml").write_text(re.sub(r"<body pos.*?</body>", "", MODEL, flags=re.DOTALL))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_text_says_of_a_channel_what_python_says(folder):
    said = as_plant("mine.xml:lift(motor,partner=tilt,u_max=30,x0=0.1,partner_x0=-0.2)")
    channel = smc.Channel(motor=True, partner="tilt", u_max=30.0, x0=0.1, partner_x0=-0.2)
    assert said == smc.plant_from("mine.xml", {"lift": channel})
    assert said.argument == "mine.xml:lift(motor,partner=tilt,x0=0.1,partner_x0=-0.2)"
    both = as_plant("mine.xml:lift(motor,u_max=30)+tilt(motor, u_max=5)")
    assert smc.Scenario(plant=both, **RUN).resolved.u_max == (30.0, 5.0)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("mine.xml:lift(moto)", "unknown field of channel 'lift' 'moto': did you mean 'motor'?"),
        ("mine.xml:lift(u_max=a)", "u_max of channel 'lift' is 'a': give a number"),
        ("mine.xml:lift(motor)+lift", "names a joint twice"),
        ("mine.xml:lift(motor=2)", "Channel's motor is '2': give True or False"),
        (
            "mine.xml:lift",
            r"give smc.Channel\(motor=True\), or JOINT\(motor\) in a text, for one ideal motor",
        ),
        (MODEL, "plant is the text of a model: give smc.plant_from"),
    ],
)
def test_a_mistake_in_a_text_is_one_sentence(folder, text, sentence):
    with pytest.raises(smc.ScenarioError, match=sentence):
        as_plant(text)


def bounds(text, **fields):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        scenario = smc.Scenario(plant=as_plant(text), **(RUN | fields))
    return scenario.resolved.u_max, [str(warning.message) for warning in told]


def test_a_bound_that_nobody_gave_is_told_and_is_of_no_other_joint(folder):
    free = "nothing bounds the force on joint 'lift' of mine, so that |u| <= 6 N is taken: give u_max, what your motor"
    for text in ("mine.xml:lift(motor)", "mine.xml:lift(motor)+tilt(motor,u_max=5)"):
        assert [told.startswith(free) for told in bounds(text)[1]] == [True], text
    assert bounds("mine.xml:lift(motor)+tilt(motor,u_max=5)")[0] == (6.0, 5.0)
    both = bounds("mine.xml:lift(motor)+tilt(motor)")[1]
    assert [
        "joints 'lift' and 'tilt' of mine, so that |u| <= 6 N and 6 N m are taken" in told
        for told in both
    ] == [True]
    for text, fields in (
        ("mine.xml:lift(motor,u_max=30)", {}),
        ("mine.xml:lift(motor)", {"u_max": 30.0}),
    ):
        assert bounds(text, **fields) == (30.0, [])


def test_a_motor_s_own_range_bounds_its_joint_alone(folder):
    drive = '<actuator><motor joint="tilt" ctrlrange="-2 2"/></actuator></mujoco>'
    (folder / "mine.xml").write_text(MODEL.replace("</mujoco>", drive))
    assert bounds("mine.xml:lift(motor)+tilt")[0] == (6.0, 2.0)


def one(y, gains, memory):
    return -gains.k * y.e


def three(y, gains, memory):
    return -gains.k * y.e, y.e, 0.0


def theta(y, gains, memory):
    return -gains.k * y.theta, y.e


def gain(y, gains, memory):
    return -gains.kp * y.e, y.e


@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        (one, "law 'one' returns 1 number: return u and s"),
        (three, "law 'three' returns 3 numbers: return u and s"),
        (theta, "unknown field of y in law 'theta' 'theta': choose from a, ddr, "),
        (gain, "unknown gain in law 'gain' 'kp': did you mean 'k'"),
    ],
)
def test_a_law_that_can_never_run_raises_at_once(function, sentence):
    law = smc.law_function(gains={"k": 2.0})(function)()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(smc.ScenarioError, match=sentence):
            smc.run(smc.Scenario(plant="duffing", law=law, duration=0.01))


def test_what_is_nearly_right_names_its_cure(folder):
    scenario = smc.Scenario(plant="duffing", **RUN)
    for call, cure in (
        (lambda: smc.run("duffing"), r"give smc.Scenario\(plant='duffing'"),
        (lambda: smc.film(scenario, "a.mp4"), r"run it first, smc.run\(scenario\)"),
        (lambda: smc.Scenario(plant="duffing", law=one), r"give smc.law_function\(function\)"),
        (
            lambda: smc.Scenario(plant="duffing", law="pid", reference=lambda t: t),
            "smc.signals.TimeSeries",
        ),
    ):
        with pytest.raises(smc.ScenarioError, match=cure):
            call()


def test_files_of_a_text_are_bytes_of_any_kind_or_text():
    whole = smc.plant_from(MODEL, {"tilt": smc.Channel(motor=True)})
    start = MODEL.index("<body")
    end = MODEL.index("</worldbody>")
    outer = f'{MODEL[:start]}<include file="part.xml"/>{MODEL[end:]}'
    part = f"<mujoco>{MODEL[start:end]}</mujoco>"
    for content in (part, part.encode(), bytearray(part.encode())):
        made = smc.plant_from(
            outer, {"tilt": smc.Channel(motor=True)}, assets={"part.xml": content}
        )
        assert made.parameters == whole.parameters


def test_a_urdf_keeps_its_visual_shapes_and_its_motion(folder):
    plant = as_plant("arm.urdf:j1(motor)+j2(motor)")
    model = plant.build(2).compile()
    plain = mujoco.MjSpec.from_file("arm.urdf").compile()
    assert (plain.ngeom, model.ngeom) == (1, 3)
    assert sorted(model.geom_group.tolist()) == [
        1,
        1,
        3,
    ]  # the box, which is for contacts, is not seen
    np.testing.assert_array_equal(model.body_mass, plain.body_mass)
    np.testing.assert_array_equal(model.body_inertia, plain.body_inertia)


@pytest.mark.skipif(bool(gl.missing()), reason="no OpenGL")
def test_machines_on_a_fused_base_have_the_colours_of_their_own_laws(folder, monkeypatch):
    plant = as_plant("arm.urdf:j1(motor)+j2(motor)")
    seen = []
    plain = stage.Stage.render
    monkeypatch.setattr(
        stage.Stage, "render", lambda self, drawn=(): seen.append(self) or plain(self, drawn)
    )
    traces = smc.run(
        [smc.Scenario(plant=plant, law=law, duration=0.01) for law in ("pid", "classical")]
    )
    smc.film(traces, "a.png", at=0.0, size=(320, 180))
    names = []
    for its in seen[0].links:
        names.append([seen[0].model.body(seen[0].model.geom_bodyid[i]).name for i in its])
    assert names == [["m0/l1", "m0/l2"], ["m1/l1", "m1/l2"]]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("mine.xml:tilt(motor,u_max=9)", "tuning is not possible here: it has no nominal model"),
        (
            "one.xml:lift(motor,u_max=60)",
            "one starts at 0 under 'nominal', where a law has nothing",
        ),
    ],
)
def test_what_no_tuning_can_answer_is_refused_before_the_first_run(folder, text, why):
    with pytest.raises(smc.ScenarioError, match=why) as refused:
        smc.which(
            text,
            laws=["classical", "pid"],
            conditions="noise",
            seeds=1,
            duration=0.05,
            out=folder / "out",
        )
    assert "defaults=True" in str(refused.value)
    assert not list(folder.glob("out/**/*.parquet"))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("text", "heads"),
    [
        (
            "arm.urdf:j1(motor)+j2(motor)",
            ["settling time (s)", "ultimate bound (rad)", "TV rate (N·m/s)"],
        ),
        ("mine.xml:lift(motor,u_max=60)+tilt(motor,u_max=9)", ["settling time (s)"]),
    ],
)
def test_tables_and_figures_of_two_joints_have_units(folder, text, heads):
    metrics = ["settling_time", "ultimate_bound", "tv_rate"][: len(heads)]
    runs = []
    for law in ("pid", "classical"):
        runs.append(smc.Scenario(plant=as_plant(text), law=law, duration=0.02, x0=0.1))
    table = smc.study(runs, "study", progress=False)
    (told,) = smc.leaderboard(table, metrics).tables
    assert told.headings[1:] == [head.replace("·", " ") for head in heads]
    assert [
        " ".join(ax.get_xlabel().split()) for ax in smc.plot(table, metrics=metrics).axes
    ] == heads


def test_what_mujoco_warns_of_a_model_is_told_once(folder):
    (folder / "old.xml").write_text(
        MODEL.replace("<mujoco>", '<mujoco><compiler settotalmass="5"/>')
    )
    script = """import dataclasses, smc_mujoco as smc
trace = smc.run(smc.Scenario(plant="old.xml:tilt(motor,u_max=9)", law="pid", duration=0.01, x0=0.1))
smc.worst_case(trace.scenario, budget=2, within=smc.Uncertainty(mass=(0.9, 1.1)))
smc.tune("duffing", "pid", budget=1, searches=1, progress=False)
smc.worst_case(dataclasses.replace(trace.scenario, law="classical"), budget=2)"""
    assert python("-c", script).stderr.count("settotalmass") == 1


def test_a_machine_without_shapes_cannot_be_filmed_and_says_so(folder):
    (folder / "bare.urdf").write_text(
        re.sub(r"<(visual|collision)>.*?</\1>", "", ARM, flags=re.DOTALL)
    )
    trace = smc.run(smc.Scenario(plant=as_plant("bare.urdf:j1(motor)+j2(motor)"), **RUN))
    with pytest.raises(
        smc.ScenarioError, match=r"nothing that moves on bare.* has a shape to be filmed: give"
    ):
        smc.film(trace, "a.png", at=0.0, size=(320, 180))
