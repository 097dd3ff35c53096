"""A pose beside a keyframe: of models without keyframes, in Python and in texts."""

from typing import Any

import numpy as np
import pytest
from helpers.machine_logs import chain

import smc_mujoco as smc
from smc_mujoco.mechanisms.custom import plant_from
from smc_mujoco.mechanisms.named import as_plant

TWO = chain([0.4, 0.3], [1.0, 0.5]).replace('name="j1"', 'name="j1" range="-2 2"')


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "two.xml").write_text(TWO)
    return "two.xml"


@pytest.mark.quick
def test_joints_stand_where_the_pose_says_and_the_goal_is_there(file):
    arm = smc.plant_from(file, ["j2"], pose={"j1": -1.2, "j2": 0.3}, others="held")
    assert arm.rest == (0.3,)
    text = as_plant(f"{file}:j2@{{j1=-1.2;j2=0.3}}+held")
    np.testing.assert_array_equal(arm.load().key_qpos, [[-1.2, 0.3]])
    np.testing.assert_array_equal(text.load().key_qpos, [[-1.2, 0.3]])
    built: Any = arm.build
    assert built.argument == f"{file}:j2@{{j1=-1.2;j2=0.3}}+held"
    again = plant_from.restored(built.about(), arm.name)
    np.testing.assert_array_equal(again.load().key_qpos, [[-1.2, 0.3]])


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"pose": {"j9": 0.0}}, "unknown joint of two.xml 'j9'"),
        ({"pose": {"j1": 3.0}}, "beyond its range from -2 to 2"),
        ({"pose": {"j1": "a"}}, "pose of j1 is 'a'"),
        ({"pose": {"j1": 0.1}, "keyframe": "home"}, "give one of them"),
    ],
)
def test_a_pose_that_cannot_be_is_refused(file, fields, words, refused):
    refused(lambda: smc.plant_from(file, ["j2"], **fields), words)
