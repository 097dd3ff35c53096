"""Films show what moves and its arrows, as large as the picture allows, each machine in its own
place.
"""

import contextlib
import dataclasses
import itertools

import mujoco
import numpy as np
import pytest
from helpers.films import staged, without_charts
from helpers.runs import at_defaults
from helpers.sketch import made

import smc_mujoco as smc
from smc_mujoco.common import gl
from smc_mujoco.draw.film import arrow_lines, arrows, camera, film, puppet, sheet, track, world
from smc_mujoco.draw.film.pace import FilmClock
from smc_mujoco.simulation import model as models

pytestmark = pytest.mark.skipif(
    gl.missing_renderer() is not None, reason=str(gl.missing_renderer())
)
SIZE = (1280, 720)
TWO_LINKS = """<mujoco model="two"><worldbody><body pos="0 0 1"><joint name="a" axis="0 1 0"/>
  <geom type="capsule" size=".03" fromto="0 0 0 0 0 .5" mass="1"/>
  <body pos="0 0 .5"><joint name="b" axis="0 1 0"/>
  <geom type="capsule" size=".02" fromto="0 0 0 0 0 .4" mass=".5"/></body></body></worldbody>
  <actuator><motor joint="a" ctrlrange="-5 5"/><motor joint="b"
    ctrlrange="-5 5"/></actuator></mujoco>"""


def dog(free):
    """A body with four legs of two links, one of which is driven."""
    legs = ""
    for k, (x, y) in enumerate(itertools.product((-0.2, 0.2), (-0.1, 0.1))):
        legs += f"""<body pos="{x} {y} 0"><joint name="hip{k}" axis="0 1 0" stiffness="200"/>
          <geom type="capsule" size=".02" fromto="0 0 0 .05 0 -.2" mass=".5"/><body pos=".05 0 -.2">
          <joint name="{"knee" if k == 3 else f"knee{k}"}" axis="0 1 0" stiffness="200"/><geom
          type="capsule" size=".015" fromto="0 0 0 -.05 0 -.2" mass=".2"/></body></body>"""
    return f"""<mujoco model="dog"><worldbody><geom type="plane" size="0 0 .1"/>
      <body pos="0 0 .45">{"<freejoint/>" if free else ""}
      <geom type="box" size=".22 .08 .05" mass="6"/>{legs}</body></worldbody>
      <actuator><motor joint="knee" ctrlrange="-20 20"/></actuator></mujoco>"""


def two(plant, **fields):
    """Two runs of made-up motion, with u as large as its limit."""
    laws = ("super_twisting", "pid")
    return [
        made(smc.Scenario(plant=plant, law=at_defaults(law), **{"duration": 1.0} | fields))
        for law in laws
    ]


@contextlib.contextmanager
def filmed(traces, monkeypatch, times=(0.1, 0.2)):
    """Give the stages of a film of the traces, whose first two pictures were drawn, and its
    placement.
    """
    seen = []
    places = []
    made_by = film.staged

    def kept(tracks, placed, times):
        places.append(placed)
        for stage in made_by(tracks, placed, times):
            seen.append(stage)
            yield stage

    with without_charts, monkeypatch.context() as patch:
        patch.setattr(film, "staged", kept)
        frames = film.Frames(traces, size=SIZE, at=0.0)
        frames.clock = FilmClock(np.array(times), np.ones(len(times)))
        made_of = iter(frames)
        assert [*itertools.islice(made_of, 2)]
        yield seen, places[0]
        made_of.close()


@pytest.mark.parametrize("base", ["free", "fixed"])
@pytest.mark.parametrize("count", [1, 3])
def test_a_stranger_that_goes_far_is_followed_and_fills_half_of_its_tile(base, count, monkeypatch):
    """A quadruped whose knee is driven: on a free base it slides away by ten of its lengths."""
    plant = smc.plant_from(dog(base == "free"), ["knee"])
    traces = [smc.run(smc.Scenario(plant=plant, law=smc.law("pid"), duration=2.0, x0=0.3))] * count
    if base == "free":
        poses = []
        monkeypatch.setattr(track, "motion", lambda trace, times: poses[0])
        scenario = traces[0].scenario
        start = models.initial_state(models.compile_model(scenario), scenario)[0]
        times = np.linspace(0.0, 2.0, 60)
        moved = np.tile(start, (60, 1))
        moved[:, 0] += 5.0 * times
        poses.append(track.Motion(times, moved))
    with filmed(traces, monkeypatch) as (stages, _):
        for stage in stages:
            boxes = world.boxes(stage.model, stage.data)
            plane = stage.model.geom_type == world.PLANE
            moves = ~world.still(stage.model) & ~plane
            if base == "fixed":  # the other legs stand around the one that is driven
                moves = stage.links
            moving = boxes[moves].reshape(-1, 3)
            box = np.ptp(stage.project(moving), axis=0) / stage.size
            assert box.max() > 0.5
            assert (stage.project(moving) > -1.0).all()


def test_a_rail_is_cut_to_what_moves_and_its_posts_and_marks_stay_true(monkeypatch):
    """The cart stays within 1 m of 0 on a rail of 4.2 m."""
    with filmed(two("cart_pole"), monkeypatch) as (stages, _):
        stage = stages[0]
        uncut = smc.plant("cart_pole").load()
        cut = stage.model
        rail, post, mark = (
            cut.geom(f"m/{name}").id for name in ("front_rail", "left_post", "half5")
        )
        assert cut.geom_size[rail, 1] < 0.7 * uncut.geom("front_rail").size[1]
        end = stage.data.geom_xpos[rail, 0] - cut.geom_size[rail, 1]
        assert stage.data.geom_xpos[post, 0] == pytest.approx(end)
        assert stage.data.geom_xpos[mark, 0] == pytest.approx(0.5)  # m
        board = cut.geom("m/board").id
        assert stage.data.geom_xpos[board, 0] == pytest.approx(stage.data.geom_xpos[rail, 0])
        rod = cut.geom("m/rod").id
        ends = stage.data.geom_xpos[rod] + np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]])
        # px of a pole of 1 m: 81 with the whole rail
        assert np.ptp(stage.project(ends)[:, 1]) > 120.0


def test_the_posts_of_a_network_come_closer_with_their_feet(monkeypatch):
    """They stand 0.22 m beside the outer pendulums."""
    with filmed(two("pendulum_network"), monkeypatch) as (stages, _):
        stage = stages[0]
        places = {}
        for name in ("front_post", "front_foot", "p0/bob"):
            places[name] = stage.data.geom_xpos[stage.model.geom(f"m/{name}").id]
        assert 0.1 < places["p0/bob"][1] - places["front_post"][1] < 0.19
        assert places["front_foot"][1] == pytest.approx(places["front_post"][1])


def test_a_pendulum_s_picture_is_of_the_bob_s_arc(monkeypatch):
    stands, falls = two("inverted_pendulum")
    falls = dataclasses.replace(falls, x=falls.x + 3.0)
    with filmed([stands, falls], monkeypatch) as (stages, _):
        stage = stages[0]
        assert stages[1].puppet.height == stage.puppet.height  # their stands are cut alike
        foot = stage.model.geom("m/foot")
        assert stage.data.geom_xpos[foot.id, 2] == pytest.approx(0.014, abs=1e-3)  # on the floor
        assert stage.model.geom("m/face").rgba[3] == pytest.approx(world.DIAL_OPACITY)
        bob = stage.model.geom("m/bob")
        assert bob.size[0] == pytest.approx(1.3 * 0.065)
    rods = []
    for share in (puppet.OWN_STAND_SHARE, 0.8):
        monkeypatch.setattr(puppet, "OWN_STAND_SHARE", share)
        with filmed([stands], monkeypatch) as (stages, _):
            stage = stages[0]
            ends = stage.data.geom_xpos[[stage.model.geom("m/bob").id]]
            rod = stage.project(ends)[0] - stage.project(stage.data.xanchor[:1])[0]
            rods.append(np.linalg.norm(rod))
    assert rods[0] > 1.2 * rods[1]


def test_a_pole_is_seen_all_the_way_round_and_its_arrow_is_in_its_plane():
    """Below the rail it was hidden by the cart, by the scale and by the floor."""
    run = made(smc.Scenario(plant="cart_pole", law=at_defaults("lqr"), duration=1.0))
    angles = np.linspace(0.0, 2.0 * np.pi, len(run.t))
    x = np.column_stack([np.zeros_like(angles), angles])
    with staged(dataclasses.replace(run, x=x, r=0.0 * x), (400, 215)) as stage:
        model = stage.model
        pole = [model.geom(f"m/{name}").id for name in ("rod", "tip")]
        hit = np.zeros(1, np.int32)
        for sample in range(0, len(angles), 50):
            stage.arrange(x[sample])
            stage.forward()
            along = np.linspace(-0.9, 0.9, 10)[:, None] * model.geom_size[pole[0], 1]
            middle = stage.data.geom_xpos[pole[0]]
            turn = stage.data.geom_xmat[pole[0]].reshape(3, 3)
            points = middle + along * turn[:, 2]
            seen = stage.project(points)
            assert ((seen > 0.0) & (seen < stage.size)).all()
            for point in points:
                way = point - stage.place
                mujoco.mj_ray(model, stage.data, stage.place, way, None, 1, -1, hit)
                assert hit[0] in pole, angles[sample]
            arrow = arrows.Arrow(0.0, 1.0, arrows.WHITE)
            arrow_path = arrow_lines.path(model, stage.data, stage.mounts[1], arrow)
            assert arrow_path
            assert arrow_path[0][:, 1] == pytest.approx(middle[1])


def test_bent_arrows_are_around_their_joint_and_stay_in_the_tile(monkeypatch):
    plant = smc.plant_from(TWO_LINKS, ["a", "b"])
    traces = []
    for law in ("super_twisting", "pid"):
        traces.append(
            smc.run(smc.Scenario(plant=plant, law=at_defaults(law), duration=0.3, x0=0.1))
        )
    with filmed(traces, monkeypatch) as (stages, _):
        assert len({stage.puppet.height for stage in stages}) == 1  # they stand on one floor
        for stage, mount in itertools.product(stages, stages[0].mounts):
            for part in (-1.0, 1.0):
                bent_arrow = arrows.Arrow(0.0, part, (0.0,) * 4)
                arrow_path = arrow_lines.path(stage.model, stage.data, mount, bent_arrow)
                assert arrow_path
                line, _ = arrow_path
                anchor = stage.project(stage.data.xanchor[[mount.joint]])
                radius = np.linalg.norm(stage.project(line) - anchor, axis=1)
                assert radius.max() == pytest.approx(
                    arrow_lines.MAX_BENT_SHARE * stage.size[1], rel=0.15
                )
                assert stage.project(line).min() > 0.0


@pytest.mark.quick
def test_five_machines_keep_room_above_their_words():
    turn = camera.turn(90.0, -12.0)
    cube = world.CORNERS
    room = camera.Room(0.0, 54.0, 800.0, 342.0)
    tiles, labels, view = camera.layout(
        5, room, lambda wide: (np.array([[min(wide, 150.0), 33.0]]), 1.0), cube, turn
    )
    seen = camera.project(cube, turn, view.place, view.size)
    assert ((seen >= 0.0) & (seen <= view.size)).all()
    assert len(tiles) == len(labels) == 5
    assert tiles[:, 1].min() >= 54
    assert labels[:, 3].max() <= 342


@pytest.mark.parametrize("speaks", [True, False])
def test_words_of_a_machine_lie_over_neither_it_nor_its_arrows(speaks, monkeypatch):
    """A pendulum leans on a peg, or swings freely."""
    traces = two("inverted_pendulum", contact="peg" if speaks else ())
    with filmed(traces, monkeypatch) as (_, placed):
        size, turn, place, _ = placed.view
        seen = camera.project(placed.points, turn, place, size)
        said = sheet.STATE_HEIGHT * sheet.letters(SIZE)
        assert (seen[:, 1].min() >= said - 1e-6) == speaks


def robot(driven):
    """A robot on a free base whose arm, 0.3 m long, turns at a height of 1.5 m, or whose wheel."""
    arm, wheel = (
        f'''<body pos="{place}"><joint name="{name}" axis="0 1 0"/>
        <geom type="{kind}" size="{size}" {way} mass=".3"/></body>'''
        for name, place, kind, size, way in (
            ("elbow", "0 .1 1.5", "capsule", ".03", 'fromto="0 0 0 .3 0 0"'),
            ("wheel", "0 .1 .1", "cylinder", ".1 .02", 'euler="90 0 0"'),
        )
    )
    return f"""<mujoco model="robot"><worldbody><geom type="plane" size="0 0 .1"/>
      <body><freejoint/><geom type="capsule" size=".06" fromto="0 0 .1 0 0 1.7"
      mass="9"/>{arm}{wheel}</body></worldbody>
      <actuator><motor joint="{driven}" ctrlrange="-9 9"/></actuator></mujoco>"""


@pytest.mark.parametrize(("driven", "carried"), [("elbow", False), ("wheel", True)])
def test_all_of_a_robot_counts_only_if_its_driven_joint_carries_it(driven, carried, monkeypatch):
    plant = smc.plant_from(robot(driven), [driven])
    traces = [smc.run(smc.Scenario(plant=plant, law=smc.law("pid"), duration=0.2, x0=0.3))]
    with filmed(traces, monkeypatch) as (stages, _):
        stage = stages[0]
        boxes = world.boxes(stage.model, stage.data)
        seen = stage.project(boxes[stage.links].reshape(-1, 3))
        assert (seen > 0.0).all()
        assert (seen < stage.size).all()
        share = np.ptp(seen, axis=0).max() / stage.size[1]
        assert (share > 0.4) == (not carried)
        trunk = ~world.still(stage.model) & (stage.model.geom_type != world.PLANE)
        trunk_points = stage.project(boxes[trunk].reshape(-1, 3))
        assert (np.ptp(trunk_points[:, 1]) <= stage.size[1]) == carried


def test_labels_are_beside_machines_that_are_far_wider_than_high():
    turn = camera.turn(90.0, 0.0)
    sizes = lambda wide: (np.array([[120.0, 33.0]]), 1.0)  # noqa: E731
    rows = {}
    for name, wide in (("rail", 8.0), ("cube", 1.0)):
        room = camera.Room(0.0, 54.0, 800.0, 342.0)
        shape = world.CORNERS * (wide, 1.0, 1.0)
        tiles, labels, _ = camera.layout(4, room, sizes, shape, turn)
        rows[name] = len(set(tiles[:, 1].tolist())), bool((labels[:, 2] <= tiles[:, 0]).all())
    assert rows == {"rail": (4, True), "cube": (1, False)}


def test_a_label_has_all_the_width_that_it_asked_for():
    """Else its law's name is cut, though there is room beside it."""
    tall = world.CORNERS * (0.3, 0.3, 1.0)
    room = camera.Room(0.0, 54.0, 800.0, 342.0)
    for wide in np.linspace(80.0, 82.0, 21).tolist():
        sizes = lambda room, wide=wide: (np.array([[wide, 90.3]]), 1.0)  # noqa: E731
        _, labels, _ = camera.layout(1, room, sizes, tall, camera.turn(90.0, 0.0))
        left_edge, top, right, bottom = labels[0].tolist()
        assert right - left_edge >= wide
        assert bottom - top >= 90.3
