"""An .mcap file, read by its own library, has the trace's numbers, and the machine where MuJoCo
puts it.
"""

import collections
import json

import mujoco
import numpy as np
import pytest
from helpers import arms

import smc_mujoco as smc
from smc_mujoco.exchange import recording

pytest.importorskip("mcap_protobuf")
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

ARM = """
<mujoco model="two links"><worldbody>
  <geom type="plane" size="1 1 .1"/><geom type="box" size=".1 .1 .5" pos="0 0 .5"/>
  <body name="upper" pos="0 0 1" euler="0 0 30"><joint name="shoulder-pan" axis="0 1 0"/>
    <geom type="capsule" size=".03" fromto="0 0 0 .1 0 -.5"/>
    <body pos=".1 0 -.5"><joint name="2 elbow" axis="0 1 0"/><geom type="ellipsoid" size=".03 .04 .3" pos="0 0 -.2"/>
      <geom size=".1" group="3"/><geom size=".1" rgba="1 0 0 0"/></body></body>
</worldbody><actuator><motor joint="shoulder-pan"/><motor joint="2 elbow"/></actuator></mujoco>"""


def read(path) -> dict[str, list]:
    """Return topic -> (time in s, message)."""
    found = collections.defaultdict(list)
    with path.open("rb") as stream:
        for _, channel, message, decoded in make_reader(
            stream, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            found[channel.topic].append((1e-9 * message.log_time, decoded))
    return found


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    plant = smc.plant_from(ARM, ["shoulder-pan", "2 elbow"])
    trace = smc.run(smc.Scenario(plant=plant, law="super_twisting", x0=(0.3, -0.4), duration=0.5))
    return trace, trace.export(tmp_path_factory.mktemp("a") / "run.mcap")


def test_signals_have_every_number_of_the_trace_under_the_joints_names(run):
    trace, path = run
    found = read(path)
    for name in ("x", "v", "u", "s", "r", "applied", "d", "force", "reaction"):
        times, messages = zip(*found[f"/{name}"], strict=True)
        np.testing.assert_allclose(times, trace.t, atol=1e-9)
        read_back = [[message.shoulder_pan, message._2_elbow] for message in messages]
        np.testing.assert_array_equal(read_back, getattr(trace, name))


def test_bodies_are_where_mujoco_puts_them(run):
    """By a model that MuJoCo reads from the same text, without anything of this package."""
    trace, path = run
    model = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(model)
    messages = read(path)["/poses"]
    assert len(messages) == 51  # 100 a second
    for time, message in messages:
        data.qpos[:] = trace.x[round(time / trace.scenario.control_period)]
        mujoco.mj_forward(model, data)
        assert [each.child_frame_id for each in message.transforms] == ["upper", "body 2"]
        for each, body in zip(message.transforms, (1, 2), strict=True):
            assert (each.parent_frame_id, each.timestamp.ToNanoseconds()) == (
                "world",
                round(1e9 * time),
            )
            place = each.translation
            turn = each.rotation
            np.testing.assert_allclose([place.x, place.y, place.z], data.xpos[body], atol=1e-12)
            np.testing.assert_allclose(
                [turn.w, turn.x, turn.y, turn.z], data.xquat[body], atol=1e-12
            )


def test_shapes_are_those_that_mujoco_draws_and_move_with_their_bodies(run):
    model = mujoco.MjModel.from_xml_string(ARM)
    ((_, scene),) = read(run[1])["/machine"]
    world, upper, lower = scene.entities
    assert [(each.frame_id, each.frame_locked) for each in scene.entities] == [
        ("world", True),
        ("upper", True),
        ("body 2", True),
    ]
    assert [len(world.cubes), len(world.spheres), len(upper.cylinders), len(upper.spheres)] == [
        1,
        0,
        1,
        2,
    ]
    (ball,) = lower.spheres  # the others are hidden
    assert (ball.size.x, ball.size.z, ball.pose.position.z) == pytest.approx((0.06, 0.6, -0.2))
    ends = sorted((each.pose.position.x, each.pose.position.z) for each in upper.spheres)
    np.testing.assert_allclose(ends, [(0.0, 0.0), (0.1, -0.5)], atol=1e-9)
    assert upper.cylinders[0].size.z == pytest.approx(2.0 * model.geom_size[2, 1])
    cylinder = upper.cylinders[0]
    assert [getattr(cylinder.color, of) for of in "rgba"] == pytest.approx([0.5, 0.5, 0.5, 1.0])
    assert [getattr(cylinder.pose.orientation, of) for of in "wxyz"] == pytest.approx(
        model.geom_quat[2]
    )
    assert [getattr(cylinder.pose.position, of) for of in "xyz"] == pytest.approx(model.geom_pos[2])
    assert [getattr(cylinder.size, of) for of in "xy"] == pytest.approx([0.06, 0.06])
    assert [getattr(world.cubes[0].size, of) for of in "xyz"] == pytest.approx([0.2, 0.2, 1.0])


def test_the_scenario_is_in_the_metadata_and_a_failed_run_ends_where_it_failed(tmp_path):
    lost = smc.run(
        smc.Scenario(plant=arms.arm(), law="none", duration=0.3, disturbance=smc.Sine(1e9, 1.0))
    )
    assert lost.diverged_at is not None
    path = lost.export(tmp_path / "lost.mcap")
    with path.open("rb") as stream:
        (about,) = [
            each
            for each in make_reader(stream).iter_metadata()
            if each.name == "trace of smc_mujoco"
        ]
    assert json.loads(about.metadata["scenario"])["law"]["name"] == "none"
    assert about.metadata["failure"] == lost.failure
    found = read(path)
    assert len(found["/x"]) == np.isfinite(lost.x).all(axis=1).sum()
    assert max(time for time, _ in found["/poses"]) < lost.diverged_at


def test_names_that_become_the_same_are_numbered():
    fields = recording.message_of(["a b", "a-b", "c", "1"]).DESCRIPTOR.fields_by_name
    assert list(fields) == ["a_b_1", "a_b_2", "c", "_1"]


@pytest.mark.parametrize(
    ("joints", "named"),
    [
        (["a b", "a_b", "a_b_1"], ["a_b_1", "a_b_2", "a_b_1_3"]),
        (["arm_1", "arm1"], ["arm_1", "arm1"]),  # one in JSON, if protobuf makes the names there
        (["left_arm", "leftArm"], ["left_arm", "leftArm"]),
        (["\u00e9", "\u202e", "1"], ["__1", "__2", "_1"]),
        (["SerializeToString", "Clear"], ["SerializeToString_1", "Clear_2"]),
    ],
)
def test_every_name_that_a_joint_can_have_becomes_a_field(joints, named):
    message = recording.message_of(joints)
    assert list(message.DESCRIPTOR.fields_by_name) == named
    sent = message(**dict(zip(named, [1.5, -2.0, 3.0], strict=False)))
    assert [getattr(message.FromString(sent.SerializeToString()), name) for name in named] == [
        1.5,
        -2.0,
        3.0,
    ][: len(named)]
