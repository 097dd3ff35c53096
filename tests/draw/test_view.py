"""The page of `smc.view` without a browser: what its panel, its mouse and its pictures do."""

import base64
import re
import struct
import threading
import types

import mujoco
import numpy as np
import pytest

pytest.importorskip("viser")
import msgspec
import zstandard
from helpers.pages import ROOT

import smc_mujoco as smc
from smc_mujoco.common import html
from smc_mujoco.draw import style, view_machine, view_panel, view_shapes
from smc_mujoco.draw.session import Session
from smc_mujoco.draw.view import LiveView, runs_of

RUN = smc.Scenario(plant="inverted_pendulum", law=smc.law("pid", kp=40.0), duration=0.3)
RIVAL = smc.Scenario(plant="inverted_pendulum", law=smc.law("super_twisting"), duration=0.3)
SHAPES = """<mujoco><asset><mesh name="wedge" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>
<worldbody><body><joint/>
  <geom type="sphere" size=".3"/>
  <geom type="ellipsoid" size=".3 .2 .1" pos="1 0 0" euler="0 0 30"/>
  <geom type="capsule" size=".1 .4" pos="0 1 0" euler="40 0 0"/>
  <geom type="cylinder" size=".1 .4" pos="0 0 1" euler="0 50 0"/>
  <geom type="box" size=".1 .2 .3" pos="0 -1 0" euler="10 20 30"/>
  <geom type="mesh" mesh="wedge" pos="0 0 -1"/>
</body></worldbody></mujoco>"""

PI = np.pi
VOLUMES = [  # m^3, of these shapes
    PI * 4.0 / 3.0 * 0.3**3,
    PI * 4.0 / 3.0 * 0.3 * 0.2 * 0.1,
    PI * (4.0 / 3.0 * 0.1**3 + 0.1**2 * 0.8),
    PI * 0.1**2 * 0.8,
    8.0 * 0.1 * 0.2 * 0.3,
    1.0 / 6.0,
]


def volume(mesh):
    """The volume within triangles that look outwards, m^3: by Gauss's theorem."""
    a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
    return float(np.sum(a * np.cross(b, c)) / 6.0)


@pytest.fixture
def live():
    """A view of two runs."""
    live = LiveView(Session([RUN, RIVAL]), 0)
    yield live
    live.close()


def move(live, run, name, number):
    """Move a slider as a person does in a tab."""
    handle = live.panel.sliders[run][name]
    handle.value = number
    live.panel.moved(run, name, handle)(types.SimpleNamespace(client="a tab"))
    live.answer()


def watched(session):
    """The samples of a session's first run to its end."""
    session.advance_to(session.samples)
    return session.log(0)["x"].copy()


ARM = """<mujoco><worldbody><body><joint name="shoulder" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" contype="0"/>
  <body pos=".3 0 0"><joint name="elbow" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" contype="0"/></body></body></worldbody>
  <actuator><motor joint="shoulder" ctrllimited="true" ctrlrange="-30 30"/>
  <motor joint="elbow" ctrllimited="true" ctrlrange="-15 15"/></actuator></mujoco>"""
WATCHED = [
    RUN,
    smc.Scenario(
        plant=smc.plant_from(ARM, ["shoulder", "elbow"], name="arm"), law="adrc", duration=0.3
    ),
    smc.Scenario(plant="quadrotor", law=smc.law("cascaded_pid"), duration=0.3),
]
SLIDERS = [(run, name) for run in WATCHED for name in sorted(Session([run]).sliders[0])]


@pytest.mark.quick
@pytest.mark.parametrize(("run", "name"), SLIDERS)
def test_every_slider_changes_the_run(run, name):
    live = LiveView(Session([run]), 0)
    try:
        nominal = watched(live.session)
        slider = live.session.sliders[0][name]
        move(live, 0, name, slider.low if slider.value > slider.low else slider.high)
        assert not live.session.message
        assert not np.array_equal(watched(live.session), nominal)
    finally:
        live.close()


def test_while_paused_a_slider_repeats_the_run_up_to_now(live):
    live.session.advance(0.2)
    live.session.pause()
    move(live, 0, "kp", 60.0)
    assert live.session.time == pytest.approx(0.2)
    changed = live.session.log(0)["x"].copy()
    live.session.begin(live.session.scenarios, live.session.sample)
    assert np.array_equal(live.session.log(0)["x"], changed)


def test_a_slider_that_is_refused_goes_back(live):
    mass = live.panel.sliders[0]["mass, factor"]
    mass._impl.value = -1.0  # what a person types beside it
    live.panel.moved(0, "mass, factor", mass)(types.SimpleNamespace(client="a tab"))
    live.answer()
    assert "mass" in live.session.message
    assert mass.value == 1.0
    assert live.session.scenarios == (RUN, RIVAL)


def test_a_number_that_the_page_sets_asks_for_nothing(live):
    handle = live.panel.sliders[0]["kp"]
    live.panel.moved(0, "kp", handle)(types.SimpleNamespace(client=None))
    assert live.asked.empty()


def test_of_what_is_asked_for_under_one_key_the_last_is_done(live):
    done = []
    for key, number in ((0, 1), (1, 2), (0, 3)):
        live.ask(key, lambda number=number: done.append(number))
    live.answer()
    assert done == [3, 2]


def test_a_law_of_the_list_has_its_own_sliders_and_reset_brings_the_first_back(live):
    live.panel.take_law(0, "adrc")
    assert live.scenarios[0].law.name == "adrc"
    assert set(live.panel.sliders[0]) == set(live.session.sliders[0])
    assert "wc" in live.panel.sliders[0]
    live.panel.reset()
    assert live.scenarios == (RUN, RIVAL)


def test_a_second_run_has_a_machine_of_another_colour():
    live = LiveView(Session([RUN]), 0)
    try:
        live.panel.add_run()
        assert live.scenarios == (RUN, RUN)
        assert len(set(live.machines.colours)) == 2
    finally:
        live.close()


def test_the_mouse_pushes_a_body_once_when_it_lets_go(live):
    (machine, _) = live.machines.runs
    drag = machine.dragged("pendulum")
    for phase, end in (("start", 0.0), ("update", 0.1), ("end", 0.2)):
        drag(
            types.SimpleNamespace(
                phase=phase, start_position=(0.0, 0.0, 1.0), end_position=(end, 0.0, 1.0)
            )
        )
        live.answer()
    for scenario in live.scenarios:
        (push,) = scenario.disturbance
        assert push.body == "pendulum"
        assert push.x == pytest.approx(0.2 * live.machines.weight / live.machines.size)
        assert push.y == push.z == 0.0


def test_a_push_of_a_machine_without_named_bodies_says_how_to_name_one():
    plant = smc.plant_from(ARM, ["shoulder", "elbow"])
    live = LiveView(Session([smc.Scenario(plant=plant, law="none", duration=0.1)]), 0)
    try:
        live.ask("run", lambda: live.machines.push(1.0))
        live.answer()
        assert "<body name=" in live.session.message
    finally:
        live.close()


def test_a_push_and_u_have_arrows(live):
    live.session.advance(0.1)
    live.machines.push(live.panel.force.value)
    live.answer()
    live.session.advance(0.05)
    live.machines.show()
    for machine in live.machines.runs:
        assert machine.push_arrows.visible
        assert machine.control_arrows.visible
    live.session.begin([RUN, RIVAL])
    live.machines.show()
    assert not live.machines.runs[0].push_arrows.visible


def test_a_machine_stands_where_its_run_is_in_its_law_s_colour(live):
    live.session.advance(0.1)
    live.machines.show()
    for run, machine in enumerate(live.machines.runs):
        (body,) = machine.bodies
        x = live.session.log(run)["x"][-1, 0]
        model, data = live.machines.model, live.machines.data
        data.qpos[:] = live.session.state(run)[0]
        mujoco.mj_kinematics(model, data)
        assert machine.bodies[body].wxyz == pytest.approx(data.xquat[body])
        assert abs(x) < 0.5
        accent = model.geom("bob").id
        shade = 255 * machine.painted()[accent, :3]
        assert shade == pytest.approx(style.rgb(live.machines.colours[run]))


def test_the_second_machine_is_beside_the_first_or_its_ghost(live):
    first, second = live.machines.runs
    width = np.ptp(live.machines.points @ live.machines.turn[:, 0])
    assert (second.frame.position - first.frame.position) @ live.machines.turn[:, 0] > width
    assert {mesh.opacity for mesh, own in second.meshes if own == 1.0} == {None}
    live.machines.stand(beside=False)
    assert np.array_equal(second.frame.position, first.frame.position)
    assert all(mesh.opacity < 0.5 for mesh, _ in second.meshes)
    assert {mesh.opacity for mesh, own in first.meshes if own == 1.0} == {None}


def test_a_chart_has_the_run_up_to_now_and_a_failed_one_its_last_value(live):
    live.session.advance(0.1)
    for turn, signal in enumerate(view_panel.CHARTS):
        live.panel.curve(turn)
        t, *curves = live.panel.charts[signal].data
        assert t[-1] == pytest.approx(live.session.time)
        for run, curve in enumerate(curves):
            assert curve[0] == live.session.log(run)[signal][0, 0]
    assert view_panel.held(np.array([1.0, 2.0, np.nan, np.nan])).tolist() == [1.0, 2.0, 2.0, 2.0]


def test_a_chart_of_small_numbers_has_a_smaller_unit_and_is_of_the_longest_way():
    plant = smc.plant("double_pendulum")
    run = smc.Scenario(plant=plant, law="none", x0=[0.0, 2e-3], duration=0.05)
    live = LiveView(Session([run]), 0)
    try:
        live.session.advance_to(run.samples)
        live.panel.curve(0)
        chart = live.panel.charts["x"]
        assert chart.title == "position x (mrad)"
        assert chart.data[1][0] == pytest.approx(2.0)  # of the second joint
    finally:
        live.close()


def test_shapes_are_as_large_as_mujoco_s_and_where_they_are():
    model = mujoco.MjModel.from_xml_string(SHAPES)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    paint = np.linspace(0.1, 0.9, model.ngeom)[:, None] * np.ones(4)
    meshes = view_shapes.geom_meshes(model)
    parts = list(view_shapes.body_meshes(model, 1, meshes, paint))
    assert len(parts) == model.ngeom  # a colour each
    for geom, (_, mesh) in enumerate(parts):
        local = (mesh.vertices - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
        centre, half = model.geom_aabb[geom].reshape(2, 3)
        low, high = centre - half, centre + half
        assert local.min(axis=0) == pytest.approx(low, abs=0.02 * half.max())
        assert local.max(axis=0) == pytest.approx(high, abs=0.02 * half.max())
        chords = 0.5 * (2.0 * PI / view_shapes.SIDES[0]) ** 2  # lie within a ball's two arcs
        assert volume(mesh) == pytest.approx(VOLUMES[geom], rel=chords)


def test_many_round_shapes_have_fewer_triangles_each_and_no_flat_ones():
    spec = mujoco.MjSpec()
    for _ in range(15):
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[0.1, 0.4, 0.0])
    capsule, *_ = view_shapes.geom_meshes(spec.compile())
    assert capsule
    assert 15 * len(capsule.faces) < view_shapes.MOST_ROUND
    a, b, c = capsule.vertices[capsule.faces].swapaxes(0, 1)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 1e-6
    assert volume(capsule) == pytest.approx(VOLUMES[2], rel=0.05)


def test_a_mesh_of_many_triangles_has_fewer_and_much_the_same_shape():
    trimesh = pytest.importorskip("trimesh")
    ball, box = trimesh.creation.icosphere(6), trimesh.creation.box()
    for _ in range(5):
        box = box.subdivide()
    spec = mujoco.MjSpec()
    for name, mesh in (("ball", ball), ("box", box)):
        spec.add_mesh(name=name, uservert=mesh.vertices.ravel(), userface=mesh.faces.ravel())
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name)
    model = spec.compile()
    assert model.nmeshface > 9 * view_shapes.MOST_TRIANGLES
    ball, box = view_shapes.geom_meshes(model)
    assert ball
    assert box
    assert len(ball.faces) + len(box.faces) < 1.1 * view_shapes.MOST_TRIANGLES
    assert volume(ball) == pytest.approx(4.0 / 3.0 * PI, rel=0.01)
    assert volume(box) == pytest.approx(1.0, rel=0.01)
    assert box.vertices.min() == pytest.approx(-0.5, abs=0.005)
    a, b, c = box.vertices[box.faces].swapaxes(0, 1)
    flat = np.cross(b - a, c - a)
    corners = np.zeros_like(box.vertices)
    for corner in box.faces.T:
        np.add.at(corners, corner, flat)
    shades = np.abs(corners).max(axis=1) / (np.linalg.norm(corners, axis=1) + 1e-12)
    assert np.median(shades) > 0.99  # its edges are not shaded round


FIELD = """<mujoco><asset><hfield name="hill" nrow="3" ncol="301" size="3 1 .5 .1"/>
  <texture name="rows" type="2d" builtin="flat" rgb1=".2 .4 .6" width="8" height="8"/>
  <material name="rows" texture="rows" rgba="1 1 .5 1"/></asset>
  <worldbody><geom type="hfield" hfield="hill" pos="0 0 2"/>
  <body><joint name="j" axis="0 1 0"/><geom name="bar" material="rows" size=".1" contype="0"/>
  </body></worldbody>
  <actuator><motor joint="j" ctrllimited="true" ctrlrange="-9 9"/></actuator></mujoco>"""


def test_a_height_field_is_as_large_as_mujoco_s():
    model = mujoco.MjModel.from_xml_string(FIELD)
    model.hfield_data[:] = np.linspace(0.0, 1.0, 301)[None].repeat(3, axis=0).ravel()
    field, _ = view_shapes.geom_meshes(model)
    assert field
    assert field.vertices.min(axis=0) == pytest.approx([-3.0, -1.0, 2.0])
    assert field.vertices.max(axis=0) == pytest.approx([3.0, 1.0, 2.5])
    assert field.vertices[:, 2] == pytest.approx(2.25 + field.vertices[:, 0] / 12.0)
    assert len(field.faces) == 2 * 2 * (view_shapes.FIELD_LINES - 1)


def test_a_texture_is_its_mean_colour_and_the_page_says_so():
    plant = smc.plant_from(FIELD, ["j"], name="textured")
    live = LiveView(Session([smc.Scenario(plant=plant, law="none", duration=0.1)]), 0)
    try:
        bar = live.machines.model.geom("bar").id
        (machine,) = live.machines.runs
        assert machine.painted()[bar] == pytest.approx([0.2, 0.4, 0.3, 1.0], abs=0.01)
        assert view_machine.not_shown(live.machines.model).startswith("Textures are shown as")
    finally:
        live.close()


def test_what_the_page_does_not_show_is_said(live):
    skin = """<mujoco><deformable><skin vertex="0 0 0 1 0 0 0 1 0" face="0 1 2">
      <bone body="b" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1 2" vertweight="1 1 1"/></skin>
      </deformable><worldbody><body name="b"><geom size=".1"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(skin)
    assert view_machine.not_shown(model) == "Not shown: skins."
    assert not view_machine.not_shown(live.machines.model)


@pytest.mark.parametrize("bend", [0.0, 2.0])
def test_an_arrow_goes_along_its_line_and_is_closed(bend):
    turns = np.linspace(0.0, bend, 40) if bend else np.zeros(40)
    along = np.linspace(0.0, 1.0, 40)
    line = np.column_stack([along, np.sin(turns), np.zeros(40)])
    mesh = view_shapes.arrow_mesh(line, 0.05)
    assert np.abs(mesh.vertices - line[-1]).sum(axis=1).min() < 1e-9
    assert np.abs(mesh.vertices[:, 2]).max() == pytest.approx(2.25 * 0.025, rel=0.05)
    assert volume(mesh) > 0.0


def test_a_recording_plays_the_whole_run_without_a_server(tmp_path):
    path = tmp_path / "run.html"
    ended = smc.view([RUN, RIVAL], record=path)
    assert ended.scenarios == (RUN, RIVAL)
    page = path.read_text(encoding="utf-8")
    assert "127.0.0.1" not in page
    (text,) = re.findall(r'__VISER_EMBED_DATA__="([^"]+)"', page)
    packed = zstandard.ZstdDecompressor().decompressobj().decompress(base64.b64decode(text)[8:])
    (length,) = struct.unpack("<Q", packed[:8])
    recording = msgspec.msgpack.decode(packed[8 : 8 + length])
    assert recording["durationSeconds"] == pytest.approx(RUN.duration)
    turned = [
        time for time, message in recording["messages"] if message["type"].startswith("SetOri")
    ]
    times = sorted({round(time, 3) for time in turned})
    assert len(times) == 11  # 30 pictures a second
    assert times[1] == pytest.approx(1.0 / 30.0, abs=RUN.resolved.control_period)


def test_a_notebook_s_cell_shows_the_page_and_goes_on(monkeypatch):
    monkeypatch.setattr(html, "in_notebook", lambda: True)
    before = set(threading.enumerate())
    live = smc.view(RUN)
    assert f'src="{live.address}"' in live._repr_html_()
    assert live.thread
    assert live.thread.is_alive()
    live.close()
    for thread in set(threading.enumerate()) - before:
        thread.join(timeout=20)
        assert not thread.is_alive()


def test_a_machine_that_no_law_suits_is_shown_without_control():
    (run,) = runs_of("acrobot", ())
    assert run.law.name == "none"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([RUN, RUN, RIVAL], "3 runs to show"),
        ([], "give a Scenario or two"),
        (["duffing"], "give a Scenario or two"),
    ],
)
def test_what_cannot_be_shown_is_refused(given, words):
    with pytest.raises(smc.ScenarioError, match=words):
        runs_of(given, ())


def test_a_machine_without_a_shape_is_refused():
    text = """<mujoco><worldbody><body name="a"><joint name="j"/><inertial mass="1" pos="0 0 -1"
      diaginertia="1 1 1"/></body></worldbody><actuator><motor joint="j" ctrllimited="true"
      ctrlrange="-9 9"/></actuator></mujoco>"""
    plant = smc.plant_from(text, ["j"], name="bare")
    with pytest.raises(smc.ScenarioError, match="nothing that moves on bare has a shape"):
        smc.view(smc.Scenario(plant=plant, law=smc.law("pid"), duration=0.1))


ROPE = """<mujoco><worldbody>
  <geom name="drum" type="cylinder" size=".05 .1" pos="0 0 .5" euler="90 0 0" contype="0"/>
  <site name="a" pos="-.2 0 .3"/><site name="top" pos="0 0 .8"/>
  <body name="bar" pos="0 0 .2"><joint name="j" axis="0 1 0"/><site name="b" pos=".2 0 0"/>
    <geom size=".02" fromto="0 0 0 .3 0 0" type="capsule" contype="0"/></body></worldbody>
  <tendon><spatial><site site="a"/><geom geom="drum" sidesite="top"/><site site="b"/></spatial>
    <spatial><site site="a"/><site site="top"/><pulley divisor="2"/><site site="b"/>
      <site site="top"/></spatial></tendon>
  <actuator><motor joint="j" ctrlrange="-1 1"/></actuator></mujoco>"""


def test_tendons_are_lines_from_site_to_site_that_move(tmp_path):
    """One that lies around a drum touches it; from pulley to pulley there is none."""
    path = tmp_path / "rope.xml"
    path.write_text(ROPE)
    plant = smc.plant_from(path, ["j"])
    live = LiveView(Session([smc.Scenario(plant=plant, law="none", x0=0.3)]), 0)
    try:
        (run,) = live.machines.runs
        assert run.tendons is not None
        before = np.array(run.tendons.points)
        site = np.array([0.2 * np.cos(0.3), 0.0, 0.2 - 0.2 * np.sin(0.3)])
        a, top, drum = np.array([[-0.2, 0.0, 0.3], [0.0, 0.0, 0.8], [0.0, 0.0, 0.5]])
        first, around, last, left_side, right_side = before
        assert first[0] == pytest.approx(a, abs=1e-6)
        assert last[1] == pytest.approx(site, abs=1e-6)
        assert np.linalg.norm(around - drum, axis=1) == pytest.approx(0.05, abs=1e-3)
        assert left_side == pytest.approx(np.array([a, top]), abs=1e-6)
        assert right_side == pytest.approx(np.array([site, top]), abs=1e-6)
        live.session.advance(0.2)
        live.machines.show()
        assert np.abs(run.tendons.points - before).max() > 0.01
    finally:
        live.close()


def test_an_arm_whose_start_is_its_goal_begins_beside_it():
    """In view it stood still, and its charts were of rounding."""
    (run,) = runs_of(f"{ROOT}/examples/arm.xml:shoulder+elbow", ["pid"])
    assert run.resolved.x0 == (0.3, 0.3)
    (own,) = runs_of("duffing", ["pid"])
    assert own.resolved.x0 == smc.plant("duffing").x0
