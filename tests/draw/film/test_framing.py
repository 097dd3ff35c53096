"""Films show what moves and its arrows, as large as the picture allows, each machine in its own
place.
"""

import contextlib
import itertools

import numpy as np
import pytest
from helpers.films import without_charts
from helpers.sketch import made

import smc_mujoco as smc
from smc_mujoco.common import gl
from smc_mujoco.draw.film import arrows, caption, film, stage
from smc_mujoco.draw.film.pace import Clock

pytestmark = pytest.mark.skipif(gl.missing() is not None, reason=str(gl.missing()))
SIZE = (1280, 720)
STAGE = 460  # px, its height in a film 1280 px wide
CRATE = """<mujoco model="crate"><worldbody><geom type="plane" size="2 2 .1"/>
  <body pos="0 0 .5"><joint name="arm" axis="0 1 0"/><geom type="capsule" size=".03"
    fromto="0 0 0 0 0 .4"/></body>
  <body name="crate" pos=".5 0 .1"><freejoint/><geom type="box" size=".1 .1 .1"/></body></worldbody>
  <actuator><motor joint="arm" ctrlrange="-1 1"/></actuator></mujoco>"""
TWO_LINKS = """<mujoco model="two"><worldbody><body pos="0 0 1"><joint name="a" axis="0 1 0"/>
  <geom type="capsule" size=".03" fromto="0 0 0 0 0 .5" mass="1"/>
  <body pos="0 0 .5"><joint name="b" axis="0 1 0"/>
  <geom type="capsule" size=".02" fromto="0 0 0 0 0 .4" mass=".5"/></body></body></worldbody>
  <actuator><motor joint="a" ctrlrange="-5 5"/><motor joint="b"
    ctrlrange="-5 5"/></actuator></mujoco>"""


def two(plant, **fields):
    """Two runs of made-up motion, with u as large as its limit."""
    laws = ("super_twisting", "pid")
    return [made(smc.Scenario(plant=plant, law=law, **{"duration": 1.0} | fields)) for law in laws]


@contextlib.contextmanager
def filmed(traces, monkeypatch, times=(0.1, 0.2)):
    """Give the stage of a film of the traces, whose first two pictures were drawn, and its
    caption.
    """
    seen = {}
    made_by = stage.Stage
    with without_charts, monkeypatch.context() as patch:
        patch.setattr(film, "Stage", lambda *given: seen.setdefault("stage", made_by(*given)))
        patch.setattr(
            film, "Caption", lambda *given: seen.setdefault("caption", caption.Caption(*given))
        )
        frames = film.Frames(traces, size=SIZE, at=0.0)
        frames.clock = Clock(np.array(times), np.ones(len(times)))
        made_of = iter(frames)
        assert [*itertools.islice(made_of, 2)]
        yield seen["stage"], seen["caption"]
        made_of.close()


@pytest.mark.parametrize(
    "plant",
    ["inverted_pendulum", "cart_pole", "furuta", "pendulum_network", "overhead_crane", "panda"],
)
def test_machines_fill_the_height_or_the_width(plant, monkeypatch):
    law = {"furuta": "rotary_swing_up", "panda": "none"}.get(
        plant, "hierarchical" if smc.plant(plant).free else "classical"
    )
    traces = [made(smc.Scenario(plant=plant, law=law, duration=1.0))] * 3
    with filmed(traces, monkeypatch) as (shown, _):
        low = shown.boxes[:, :2].min(axis=0)
        high = shown.boxes[:, 2:].max(axis=0)
        wide, tall = high - low
        assert tall >= 0.7 * STAGE or wide >= 0.85 * SIZE[0]


def test_a_rail_is_cut_to_what_moves_and_its_posts_and_marks_stay_true(monkeypatch):
    """The cart stays within 1 m of 0 on a rail of 4.2 m."""
    with filmed(two("cart_pole"), monkeypatch) as (shown, _):
        whole = smc.plant("cart_pole").load()
        cut = shown.model
        rail, post, mark = (
            cut.geom(f"m0/{name}").id for name in ("front_rail", "left_post", "half5")
        )
        assert cut.geom_size[rail, 1] < 0.7 * whole.geom("front_rail").size[1]
        end = shown.data.geom_xpos[rail, 0] - cut.geom_size[rail, 1]
        assert shown.data.geom_xpos[post, 0] == pytest.approx(end)
        assert shown.data.geom_xpos[mark, 0] - shown.where[0][0] == pytest.approx(0.5)  # m
        board = cut.geom("m0/board").id
        assert shown.data.geom_xpos[board, 0] == pytest.approx(shown.data.geom_xpos[rail, 0])
        rod = cut.geom("m0/rod").id
        ends = shown.data.geom_xpos[rod] + np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]])
        # px of a pole of 1 m: 81 with the whole rail
        assert np.ptp(shown.project(ends)[:, 1]) > 120.0


def test_the_foot_of_a_pendulum_is_in_the_picture_and_its_label_is_below(monkeypatch):
    with filmed(two("inverted_pendulum"), monkeypatch) as (shown, words):
        foot = shown.model.geom("m0/foot")
        below = shown.project(shown.data.geom_xpos[[foot.id]] - [0.0, 0.0, foot.size[1]])[0]
        assert below[1] < words.pills[0, 1]
        assert shown.data.geom_xpos[foot.id, 2] == pytest.approx(0.014, abs=1e-3)  # on the floor
        assert shown.model.geom("m0/face").rgba[3] == pytest.approx(0.4)
        assert shown.model.geom("m0/bob").size[0] == pytest.approx(1.3 * 0.065)


def test_free_bodies_stand_beside_their_own_machines(monkeypatch):
    plant = smc.plant_from(CRATE, {"arm": smc.Channel(x0=0.5)})
    traces = []
    for law in ("super_twisting", "pid"):
        traces.append(smc.run(smc.Scenario(plant=plant, law=law, duration=0.3)))
    with filmed(traces, monkeypatch) as (shown, _):
        crates = np.array([shown.data.body(f"m{k}/crate").xpos for k in range(2)])
        assert crates - shown.where == pytest.approx(np.array([[0.5, 0.0, 0.1]] * 2), abs=0.01)
        assert abs(crates[1, 0] - crates[0, 0]) > 0.5


def test_bent_arrows_are_small_and_no_arrow_crosses_the_key(monkeypatch):
    plant = smc.plant_from(TWO_LINKS, ["a", "b"])
    traces = []
    for law in ("super_twisting", "pid"):
        traces.append(
            smc.run(
                smc.Scenario(
                    plant=plant,
                    law=law,
                    duration=0.3,
                    x0=0.1,
                )
            )
        )
    with filmed(traces, monkeypatch) as (shown, words):
        for mount in [mount for its in shown.mounts for mount in its]:
            for part in (-1.0, 1.0):
                line, _ = arrows.path(
                    shown.model, shown.data, mount, arrows.Arrow(0.0, part, (0.0,) * 4)
                ) or (None, 0)
                assert line is not None
                anchor = shown.project(shown.data.xanchor[[mount.joint]])
                radius = np.linalg.norm(shown.project(line) - anchor, axis=1)
                assert radius.max() <= 0.08 * STAGE + 1.0
                assert shown.project(line)[:, 1].min() > caption.KEY_TOP + caption.KEY_PITCH * len(
                    words.key
                )
