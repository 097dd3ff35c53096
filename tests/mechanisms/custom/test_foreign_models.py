"""A road of models that nobody here wrote: a plant, a run, a picture, margins, gains and C from
each.
"""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.common import gl
from smc_mujoco.common.errors import ScenarioWarning
from smc_mujoco.draw.figure import MAX_WORST
from smc_mujoco.mechanisms.named import as_plant

ARM = """
<mujoco model="spatial arm">
  <compiler angle="radian"/>
  <default><default class="visual"><geom group="2" contype="0" conaffinity="0"/></default>
    <default class="collision"><geom group="3" type="capsule"/></default>
    <joint armature="0.1" damping="1"/><position kp="100" kv="10" inheritrange="1"/></default>
  <asset><material name="white" rgba="1 1 1 1"/></asset>
  <worldbody><light pos="0 0 3"/><geom name="floor" type="plane" size="0 0 .05"/>
    <body name="base" pos="0 0 .3">
    <geom class="visual" type="cylinder" size=".08 .3" material="white" pos="0 0 -.3"/>
      <body name="shoulder"><joint name="pan" axis="0 0 1" range="-3 3"/>
        <geom class="visual" type="sphere" size=".09" material="white"/>
        <inertial pos="0 0 0" mass="3" diaginertia=".1 .1 .1"/>
        <body name="upper"><joint name="lift" axis="0 1 0" range="-2 2"/>
          <geom class="visual" type="capsule" size=".05" fromto="0 0 0 0 0 .4" material="white"/>
          <geom class="collision" size=".06" fromto="0 0 0 0 0 .4"/>
          <body name="fore" pos="0 0 .4"><joint name="elbow" axis="0 1 0" range="-2.5 2.5"/>
            <geom class="visual" type="capsule" size=".04" fromto="0 0 0 .3 0 0" material="white"/>
            <geom class="collision" size=".05" fromto="0 0 0 .3 0 0"/></body></body></body></body>
  </worldbody>
  <actuator><position joint="pan" forcerange="-80 80"/><position joint="lift" forcerange="-80 80"/>
    <position joint="elbow" forcerange="-40 40"/></actuator>
# as those of mujoco_menagerie: visual geoms in group 2, collision geoms in group 3, position servos
</mujoco>"""
SERVO = smc.Channel(motor=True)
ROAD = {  # name -> package, file, channels
    "menagerie-like": (
        None,
        ARM,
        {"pan": SERVO, "lift": SERVO, "elbow": SERVO},
    ),
    "dm acrobot": ("dm_control", "suite/acrobot.xml", ["elbow"]),
    "manipulator": (
        "dm_control",
        "suite/manipulator.xml",
        ["arm_root", "arm_shoulder", "arm_elbow", "arm_wrist"],
    ),
    "gym reacher": ("gymnasium", "envs/mujoco/assets/reacher.xml", ["joint0", "joint1"]),
    "gym cheetah": (
        "gymnasium",
        "envs/mujoco/assets/half_cheetah.xml",
        ["bthigh", "bshin", "fthigh", "fshin"],
    ),
}


def model(name: str) -> tuple:
    """Return what `plant_from` takes, for a model of the road."""
    package, file, channels = ROAD[name]
    if package is None:
        return file, channels
    module = importlib.util.find_spec(package)
    if module is None or not module.submodule_search_locations:
        pytest.skip(f"{package} is not installed")
    return Path(module.submodule_search_locations[0]) / file, channels


FOREIGN = pytest.mark.filterwarnings(
    "ignore:.*settotalmass", "ignore:.*Attach conflict", "ignore:no set of gains tried"
)


def ran(name):
    """Return the traces of two laws on a foreign model, from a start off rest."""
    plant = smc.plant_from(*model(name))
    ranges = plant.ranges or [("", 0.0, np.inf)] * plant.n
    start = []
    for x, (_, _, high) in zip(plant.x0, ranges, strict=True):
        start.append(x + (0.05 if x + 0.05 < high else -0.05))
    traces = smc.run(
        [
            smc.Scenario(
                plant=plant,
                law=law,
                x0=start,
                duration=0.3,
            )
            for law in ("pid", "super_twisting")
        ]
    )
    assert not [trace.failure for trace in traces if trace.failure]
    return traces


@pytest.mark.quick
@FOREIGN
@pytest.mark.parametrize("name", ROAD)
def test_laws_run_on_a_foreign_model_and_its_columns_are_its_joints(name):
    traces = ran(name)
    joints = list(ROAD[name][2])
    if len(joints) > 1:
        assert list(traces[0].columns())[1 : 1 + len(joints)] == [f"x_{joint}" for joint in joints]


@FOREIGN
@pytest.mark.parametrize(
    "name", ["menagerie-like", pytest.param("gym cheetah", marks=pytest.mark.slow)]
)
def test_a_foreign_model_is_drawn_seen_tuned_and_written_in_c(name, tmp_path):
    traces = ran(name)
    joints = list(ROAD[name][2])
    plant = traces[0].scenario.plant
    start = traces[0].scenario.x0
    labels = []
    for ax in smc.figure(traces, tmp_path / "a.png").axes:
        labels.append(ax.get_ylabel())
    labelled = {label.split(" e ")[0] for label in labels} & {*joints}
    assert len(labelled) == min(len(joints), MAX_WORST), labels  # of many those with large errors
    for label in labels:
        assert "mean" not in label
    if gl.missing_renderer() is None:
        picture = np.asarray(
            Image.open(
                smc.film(
                    traces,
                    tmp_path / "b.png",
                    at=0.2,
                    size=(640, 360),
                )
            )
        ).astype(int)
        assert picture[60:200].std() > 5.0
        assert (picture[60:230].min(axis=2) > 250).mean() < 0.5  # the floor is not burnt white
    brief = Objective(conditions=("nominal",), duration=0.2)
    begin = smc.starts(x0=start)
    law = smc.tune(plant, "pid", budget=4, objective=brief, searches=1, starts=begin).law
    assert law.source.kind in ("tuned here", "default")  # where no set of gains tried is better


def test_a_plant_is_named_by_its_file_and_joints(tmp_path, monkeypatch):
    (tmp_path / "arm.xml").write_text(ARM)
    monkeypatch.chdir(tmp_path)
    for text, words in (
        ("arm.xml", "no joint of arm.xml is chosen"),
        ("no.xml:a", "no model at"),
        ("arm.xml:ift", "mean 'lift'"),
    ):
        with pytest.raises(smc.ScenarioError, match=words):
            as_plant(text)
    for text in ("arm.xml: lift, elbow", "arm.xml:lift+elbow"):  # a menagerie's servos stay
        with pytest.warns(ScenarioWarning, match="set-point of its servo"):
            assert as_plant(text).argument == "arm.xml:lift(servo)+elbow(servo)"
    with pytest.raises(
        smc.ScenarioError,
        match=r"arm.xml:pan or channels=\['pan'\]; its actuators drive pan, lift, elbow",
    ):
        smc.plant_from("arm.xml")
