"""The film's camera, chosen by name or by angles; and what it sees of a user's own model."""

import itertools

import numpy as np
import pytest
from helpers.films import tracks

import smc_mujoco as smc
from smc_mujoco.draw.film import camera, puppet, track, viewpoint

MODEL = """
<mujoco model="arm">
  <visual><headlight ambient="0.3 0.2 0.1"/></visual>
  <worldbody>
    {lights}
    <camera name="first" pos="0 -3 1" xyaxes="1 0 0 0 0 1"/>
    <camera name="side" pos="4 0 1" xyaxes="0 1 0 0 0 1"/>
    <body name="post" pos="0 0 1">
      <joint name="j" axis="0 1 0"/><geom type="capsule" size=".05" fromto="0 0 0 0 0 .5"
        rgba=".5 .5 .5 1"/>
    </body>
    <body name="ball" pos="1 0 2"><freejoint name="fall"/><geom size=".1" rgba=".2 .9 .2 1"/></body>
  </worldbody>
  <actuator><motor joint="j"/></actuator>
</mujoco>"""
LAMPS = """<light name="own" type="directional" dir="0 0.3 -1"/><light name="lamp" pos="0 0 3"/>"""


@pytest.fixture(scope="module", params=["", LAMPS], ids=["dark", "lit"])
def trace(request, tmp_path_factory) -> smc.Trace:
    path = tmp_path_factory.mktemp("arm") / "arm.xml"
    path.write_text(MODEL.format(lights=request.param))
    return smc.run(
        smc.Scenario(
            plant=smc.plant_from(path, ["j"]),
            law="none",
            x0=0.3,
            duration=0.4,
        )
    )


FRONT = np.array([0.0, -1.0, 0.0])


@pytest.mark.quick
def test_angles_are_those_of_mujoco_s_free_camera():
    turn = camera.turn(90.0, -30.0)
    assert -turn[:, 2] == pytest.approx([0.0, 0.75**0.5, -0.5])
    assert turn[:, 0] == pytest.approx([1.0, 0.0, 0.0])
    assert turn.T @ turn == pytest.approx(np.eye(3))
    assert np.linalg.det(turn) == pytest.approx(1.0)


def test_an_own_model_s_camera_is_found_by_its_name(trace):
    own = puppet.Puppet.of(trace.scenario)
    side = own.turn("side")
    assert -side[:, 2] == pytest.approx([-1.0, 0.0, 0.0])
    azimuth = -own.turn(None)[:2, 2]
    down = -own.turn(None)[2, 2]
    # the first that stands still, which
    assert azimuth / np.linalg.norm(azimuth) == pytest.approx([0.0, 1.0])
    assert down == pytest.approx(np.sin(np.radians(viewpoint.LOWEST)))  # looks along the floor
    with pytest.raises(smc.ScenarioError, match="sid"):
        own.turn("sid")


def test_joints_without_a_channel_move_as_in_the_run(trace):
    """The ball falls freely. The run is that of the trace: its channel moves alike."""
    times = np.array([0.0, 0.1, 0.3, 0.4])
    motion = track.motion(trace, times)
    assert motion is not None
    arm = motion.poses[:, 0]
    assert arm == pytest.approx(np.interp(times, trace.t, trace.x[:, 0]), abs=1e-9)
    assert motion.poses[:, 3] == pytest.approx(2.0 - 9.81 * times**2 / 2, abs=1e-2)
    assert motion.at(0.2)[3] == motion.poses[1, 3]
    machine = puppet.Puppet.of(trace.scenario)
    assert machine.qpos(np.array([1.0]), rest=motion.poses[2])[[0, 3]] == pytest.approx(
        [1.0, motion.poses[2, 3]]
    )
    (run,) = tracks([trace], ["#0072B2"])
    run.motion = motion
    points, placed = machine.placed(run, machine.course(run), False, FRONT)
    low = points[:, 2].min() - placed.height
    # the ball is in the picture
    assert low == pytest.approx(motion.poses[:, 3].min() - 0.1, abs=0.2)


@pytest.mark.parametrize(
    ("place", "half", "seen"),
    [
        (0.05, 0.01, True),
        (0.2, 0.01, False),
        (0, 1.9, True),
        (0, 2.1, False),
    ],
)
def test_fixed_things_that_are_apart_or_larger_than_four_times_what_moves_may_leave_the_picture(
    place, half, seen
):
    """The ball that moves is 1 m thick, and does not move away."""
    plant = smc.plant_from(
        f"""<mujoco><worldbody><body pos="0 0 3"><joint name="j" axis="0 1 0"/><geom
          size=".5"/></body>
        <geom type="box" size="{half} .1 .1" contype="0" conaffinity="0"
          pos="{place + 0.5 - half if place else 0} 0 3"/></worldbody>
        <actuator><motor joint="j"/></actuator></mujoco>""",
        ["j"],
    )
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law="none",
            duration=0.01,
            x0=0.0,
        )
    )
    machine = puppet.Puppet.of(trace.scenario)
    (run,) = tracks([trace], ["#0072B2"])
    course = machine.course(run)
    points, placed = machine.placed(run, course, False, FRONT)
    reach, _ = placed.surrounded(points, [course], camera.turn(90.0, -12.0))
    assert bool(np.ptp(reach[:, 0]) > 1.01) is seen


def test_camera_sees_all_points_as_near_as_it_can():
    points = np.random.default_rng(0).uniform((-3, 0, 0), (3, 2, 1), (200, 3))
    turn = np.array([[1.0, 0, 0], [0, 0.3, -(0.91**0.5)], [0, 0.91**0.5, 0.3]])
    room = camera.Room(100, 50, 1200, 400)
    px = camera.project(points, turn, camera.fit(points, turn, (1280, 460), room), (1280, 460))
    (leftmost, top), (right, bottom) = px.min(axis=0), px.max(axis=0)
    assert leftmost >= 100 - 1e-6
    assert right <= 1200 + 1e-6
    assert top >= 50 - 1e-6
    assert bottom <= 400 + 1e-6
    assert right - leftmost == pytest.approx(1100) or bottom - top == pytest.approx(350)


def test_a_camera_that_follows_goes_back_while_the_reference_is_far_but_not_for_one_that_flees():
    """A drone's outline left the picture when it was farthest from it."""
    turn = camera.turn(120.0, -20.0)
    points = np.array(list(itertools.product((-0.2, 0.2), (-0.1, 0.1), (-0.05, 0.05))))
    inside = camera.Room(20.0, 40.0, 380.0, 200.0)
    size = (400, 220)
    view = camera.View(size, turn, camera.fit(points, turn, size, inside), inside)
    away = 0.4 * np.array([[0.0, 0.0, 0.0], [1.0, -1.0, 0.5], [-1.4, 0.2, 0.0], [30.0, 0.0, 0.0]])
    home, moved = camera.widened(view, points, np.array([0.0 * away, away]))
    back = np.array([home, moved]) @ turn[:, 2]
    assert back[0] == pytest.approx(back[1])
    assert (back[:, 1:3] > 0.1).all()
    assert np.abs(moved[[0, 3]]).max() < 1e-9
    middle = inside.left_end + inside.right, inside.top + inside.bottom
    for frame, way in enumerate(away[:3]):
        for move, seen in ((moved, points), (moved, points + way), (home, points)):
            x, y = camera.project(seen, turn, view.place + move[frame], size).T
            assert inside.left_end - 1e-6 <= x.min() < x.max() <= inside.right + 1e-6
            assert inside.top - 1e-6 <= y.min() < y.max() <= inside.bottom + 1e-6
        # one that is at home stays where it is in its tile
        assert (x.min() + x.max(), y.min() + y.max()) == pytest.approx(middle, rel=0.02)
