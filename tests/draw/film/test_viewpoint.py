"""A film of a user's machine looks across what its driven joints do, from a free side, and near."""

import numpy as np
import pytest
from helpers.films import staged
from PIL import Image

import smc_mujoco as smc
from smc_mujoco.common import gl
from smc_mujoco.draw import lettering
from smc_mujoco.draw.film import arrows, camera, flat_arrows, puppet, sheet, world

renders = pytest.mark.skipif(gl.missing_renderer() is not None, reason=str(gl.missing_renderer()))
ARM = """
<mujoco model="arm">
  <worldbody>
    {camera}
    <geom type="cylinder" size=".08 .05" pos="0 0 .05"/>
    <body name="column" pos="0 0 .1">
      <joint name="pan" axis="0 0 1" damping="5"/>
      <geom type="capsule" size=".05" fromto="0 0 0 0 0 .8"/>
      {plate}
      <body name="fore" pos="0 0 .9">
        <joint name="elbow" axis="{axis}" type="{kind}"/>
        <geom type="capsule" size=".03" fromto="0 0 0 .3 0 .05"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="pan"/><motor name="m" joint="elbow" ctrlrange="-9 9"/></actuator>
  <keyframe><key name="turned" qpos="-1.5708 0"/></keyframe>
</mujoco>"""


def arm(axis="0 1 0", kind="hinge", plate="", camera="", turned=True):
    """Return an arm whose elbow is driven, turned by 90 degrees about the vertical."""
    text = ARM.format(axis=axis, kind=kind, plate=plate, camera=camera)
    keyframe = "turned" if turned else None
    return smc.plant_from(text, ["elbow"], keyframe=keyframe, others="held")


def way(plant, **fields):
    """Return the direction in which the film of a run looks, (3,), and the joint's axis, (3,)."""
    run = smc.Scenario(plant=plant, law="none", duration=0.1, **fields)
    machine = puppet.Puppet.of(run)
    data = machine.data[0]
    data.qpos[:] = machine.start
    world.forward(machine.model, data)
    return -machine.turn(None)[:, 2], data.xaxis[machine.ids[0]]


@pytest.mark.quick
@pytest.mark.parametrize("turned", [True, False])
@pytest.mark.parametrize(
    ("axis", "within"),  # degrees: steps of 15, and 12 from above
    [("0 1 0", 12.1), ("1 0 0", 12.1), (".6 .8 0", 15.0), ("0 0 1", 20.1), (".5 0 .8", 10.0)],
)
def test_a_hinge_s_axis_points_at_the_camera(axis, within, turned):
    ahead, turns_about = way(arm(axis, turned=turned))
    assert np.degrees(np.arccos(abs(ahead @ turns_about))) <= within
    assert ahead[2] < -0.2  # from above


@pytest.mark.parametrize("axis", ["0 1 0", "1 0 0", "0 0 1"])
def test_a_slide_moves_across_the_picture(axis):
    ahead, slides_along = way(arm(axis, "slide"))
    assert abs(ahead @ slides_along) < 0.22


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_camera_is_where_no_other_part_is_in_front(side):
    plate = f'<geom type="box" size=".4 .01 .4" pos="0 {0.2 * side} .9"/>'
    ahead, _ = way(arm(plate=plate, turned=False))
    assert ahead[1] * side > 0.9
    ahead, _ = way(arm(plate=plate.replace("/>", ' group="3"/>'), turned=False))  # not drawn
    assert ahead[1] > 0.9


def test_nothing_else_hides_the_rest_of_the_machine():
    """A table before the column, which hides nothing of the forearm."""
    table = '<body name="table"><geom type="box" size=".8 .3 .35" pos="0 -1 .35"/></body>'
    text = ARM.format(axis="0 1 0", kind="hinge", plate="", camera=table)
    ahead, _ = way(smc.plant_from(text, ["elbow"], others="held"))
    assert ahead[1] < -0.9


def test_the_model_s_camera_is_taken_if_it_shows_the_motion():
    across = '<camera pos="0 3 1" xyaxes="-1 0 0 0 0 1"/>'
    along = '<camera pos="3 0 1" xyaxes="0 1 0 0 0 1"/>'
    assert way(arm(camera=across, turned=False))[0][1] < -0.9
    assert way(arm(camera=along, turned=False))[0][1] > 0.9


@renders
@pytest.mark.parametrize("size", [(640, 360), (300, 360)])
def test_what_moves_fills_half_of_the_picture_and_every_run_has_the_same_view(size):
    """The whole arm is three times as high as what its elbow moves."""
    plant = arm()
    turns = []
    for x0 in (0.3, -0.6):
        law = smc.law("pid", kp=9.0, kd=1.0, ki=0.0)
        trace = smc.run(smc.Scenario(plant=plant, law=law, duration=1.0, x0=x0))
        with staged(trace, size) as stage:
            turns.append(stage.turn)
            places = []
            for sample in np.linspace(0, len(trace.t) - 1, 20).astype(int):
                stage.arrange(trace.x[sample])
                stage.forward()
                boxes = world.boxes(stage.model, stage.data)[stage.links]
                places.append(stage.project(boxes.reshape(-1, 3)))
            box = np.ptp(np.concatenate(places), axis=0) / size
            assert box.max() > 0.5
            assert stage.puppet.height == pytest.approx(0.0, abs=1e-6)  # it stands on the floor
    assert turns[0] == pytest.approx(turns[1])


@renders
def test_a_machine_is_lit_alike_from_every_side():
    run = smc.Scenario(plant=arm(), law="none", duration=0.1)
    lit = []
    for azimuth in (90.0, 215.0):
        turn = camera.turn(azimuth, -12.0)
        model = world.compose(run, 0.0, (64, 64), turn)
        lit.append(model.light_dir @ turn)
    assert lit[0] == pytest.approx(lit[1])


def test_a_chart_keeps_the_unit_of_a_joint_with_a_long_name():
    words = sheet.joint_shortened("shoulder_pan_joint x (rad)", 200.0, 16.0)
    assert words.endswith("… x (rad)")
    assert lettering.width(words, 16.0) <= 200.0
    assert sheet.joint_shortened("elbow x (rad)", 200.0, 16.0) == "elbow x (rad)"


@pytest.mark.parametrize(
    ("free", "other", "place"),  # px; of the number's middle
    [
        ((100.0, 50.0), (60.0, 50.0), "beyond"),
        ((190.0, 50.0), (130.0, 50.0), "over"),
        ((100.0, 99.0), (100.0, 40.0), "beside"),
    ],
)
def test_an_arrow_s_number_hides_neither_the_arrow_nor_what_it_is_at(free, other, place):
    image = Image.new("RGB", (200, 100), "white")
    arrow = arrows.Arrow(0.0, 1.0, (0.0, 0.0, 0.0, 1.0), words="20 N")
    flat_arrows.write_number(image, arrow, np.array([other, free]), 0.5, [])
    y, x = np.nonzero(np.asarray(image)[..., 0] < 128)
    if place == "beyond":
        assert x.min() > free[0]
    elif place == "over":
        assert y.max() < free[1]
        assert x.min() > other[0]
    else:
        assert x.min() > free[0]
        assert y.min() > other[1]


def test_numbers_of_arrows_are_apart_and_none_is_written_twice():
    """Two wheels have four arrows so close that their numbers hid each other."""
    image = Image.new("RGB", (300, 200), "white")
    drawn = []
    black = (0.0, 0.0, 0.0, 1.0)
    for words, x in (("2.4 N", 150.0), ("2.4 N", 160.0), ("1.3 N", 152.0), ("9 N", 155.0)):
        arrow = arrows.Arrow(0.0, 1.0, black, words=words)
        line = np.linspace((x - 40.0, 100.0), (x, 100.0), 40)
        drawn.append(flat_arrows.stamp(image, line, 4.0, arrow))
    taken = flat_arrows.boxes(drawn, 0.5)
    before = np.asarray(image).copy()
    flat_arrows.write_numbers(image, drawn, 0.5, taken, image.width)
    numbers = taken[sum(len(drawn_arrow.edge) for drawn_arrow in drawn) :]
    assert len(numbers) == 3
    changed = (np.asarray(image) != before).any(axis=2)
    for number in numbers:
        left_edge, top, right, bottom = number.astype(int).ravel()
        assert changed[top:bottom, left_edge:right].any()
    for k, number in enumerate(numbers):
        written_numbers = [*taken[:-3], *numbers[:k]]
        assert flat_arrows.is_apart(number, written_numbers)
        assert not flat_arrows.is_apart(number, [*written_numbers, number])


@pytest.mark.parametrize(("wide", "count"), [(499.0, 1), (501.0, 2)])
def test_a_narrow_tile_has_the_number_of_its_longest_arrow_alone(wide, count):
    """Seven numbers lay over three robots on two wheels."""
    image = Image.new("RGB", (500, 200), "white")
    drawn = []
    for words, length, y in (("9 N", 2.0, 60.0), ("400 N", -3.0, 140.0)):
        arrow = arrows.Arrow(0.0, length, (0.0, 0.0, 0.0, 1.0), words=words)
        line = np.linspace((200.0, y), (260.0, y), 40)
        drawn.append(flat_arrows.stamp(image, line, 4.0, arrow))
    taken = []
    flat_arrows.write_numbers(image, drawn, 1.0, taken, wide)
    assert len(taken) == count
    assert any(number[:, 1].mean() > 100.0 for number in taken)
