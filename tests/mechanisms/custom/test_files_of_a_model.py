"""What is hashed of a model is what MuJoCo reads: the file, what it names, as it is now."""

import os

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.custom import mjcf

# files that MuJoCo reads and that are no XML: what stands around an included wall
NO_XML = {
    "plain": ("", "inc.xml", b""),
    "two dashes in a comment": ("<!-- arm -- by hand -->", "inc.xml", b""),
    "a bare ampersand": ("", "inc.xml", b'<!-- --><custom><text name="a" data="x & y"/></custom>'),
    "a Latin-1 byte": ("", "inc.xml", b"<!-- \xe9 -->"),
    "a line before the declaration": ('\n<?xml version="1.0"?>', "inc.xml", b""),
    "a second root": ("", "inc.xml", b"</mujoco><mujoco>"),
    "a backslash": ("", ".\\inc.xml", b""),
    "a file of another ending": ("", "inc.txt", b""),
}


@pytest.mark.quick
@pytest.mark.parametrize("kind", NO_XML)
def test_what_a_file_includes_counts_though_the_file_is_no_xml(kind, tmp_path):
    before, name, tail = NO_XML[kind]
    body = '<body><joint name="j"/><geom size=".1"/></body></worldbody>'
    content = f'{before}<mujoco><worldbody><include file="{name}"/>{body}'.encode()
    (tmp_path / "m.xml").write_bytes(content + tail + b"</mujoco>")
    included = tmp_path / name.removeprefix(".\\")
    hashes = []
    for place in (0.3, 0.4):
        wall = f'<geom name="wall" size=".1" pos="{place} 0 0"/>'
        included.write_text(f"<mujocoinclude>{wall}</mujocoinclude>")
        source = mjcf.model_source(tmp_path / "m.xml")
        assert mjcf.unedited_model(source).geom("wall").pos[0] == place
        hashes.append(source.sha256)
    assert hashes[0] != hashes[1]


def test_a_mesh_that_is_written_again_in_the_same_second_is_the_one_that_runs(tmp_path):
    """MuJoCo keeps what it has read of a file by its whole second. The last one is the first again,
    whose hash is known, and it is compiled as a part with an edit is, not taken from another run.
    """
    (tmp_path / "m.xml").write_text(
        '<mujoco><compiler meshdir="far" strippath="true"/><asset><mesh name="a" '
        'file="away/a.obj"/></asset><worldbody><body><joint name="j"/><geom type="mesh" mesh="a"/>'
        "</body></worldbody></mujoco>"
    )
    (tmp_path / "far").mkdir()
    masses = []
    sizes = 1, 2, 3, 1
    for k, size in enumerate(sizes):
        mesh = tmp_path / "far/a.obj"
        mesh.write_text(
            f"v 0 0 0\nv {size} 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
        )
        os.utime(mesh, ns=(0, 10**9 + k))
        masses.append(mjcf.model_source(tmp_path / "m.xml").spec().compile().body_mass[1])
    assert masses == pytest.approx(np.array(sizes) * masses[0])


def test_a_height_field_that_is_written_again_in_the_same_second_is_the_one_that_runs(tmp_path):
    (tmp_path / "m.xml").write_text(
        '<mujoco><asset><hfield name="h" file="h.bin" size="1 1 .1 .1"/></asset><worldbody>'
        '<geom type="hfield" hfield="h"/><body pos="0 0 1"><joint name="j"/><geom size=".1"/>'
        "</body></worldbody></mujoco>"
    )
    heights = 0.2, 0.3, 0.4, 0.2
    middles = []
    for k, height in enumerate(heights):
        grid = np.array([[0.0, height, 1.0]] * 3, np.float32)
        content = np.array([3, 3], np.int32).tobytes() + grid.tobytes()
        (tmp_path / "h.bin").write_bytes(content)
        os.utime(tmp_path / "h.bin", ns=(0, 10**9 + k))
        model = mjcf.model_source(tmp_path / "m.xml").spec().compile()
        middles.append(model.hfield_data[1])
    assert middles == pytest.approx(heights)


def test_a_pipe_beside_a_model_that_cannot_be_read_is_not_waited_for(tmp_path):
    if not hasattr(os, "mkfifo"):
        pytest.skip("Windows has no such pipes")
    os.mkfifo(tmp_path / "pipe.xml")
    (tmp_path / "m.xml").write_text("<mujoco><worldbody><nonsense/></worldbody></mujoco>")
    with pytest.raises(ScenarioError, match="nonsense"):
        smc.plant_from(tmp_path / "m.xml", ["j"])


@pytest.mark.parametrize("inertia", ["auto", "true"])
def test_meshes_that_are_only_seen_are_not_kept_beside_those_of_runs(tmp_path, inertia):
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    (tmp_path / "m.xml").write_text(
        f'<mujoco><compiler inertiafromgeom="{inertia}"/><asset><mesh name="a" file="a.obj"/>'
        '</asset><worldbody><body><joint name="j"/><geom type="mesh" mesh="a" contype="0" '
        'conaffinity="0"/></body></worldbody></mujoco>'
    )
    plant = smc.plant_from(tmp_path / "m.xml", {"j": smc.Channel(motor=True)})
    model = mjcf.unedited_model(mjcf.model_source(tmp_path / "m.xml"))
    assert plant.load().nmesh == 1
    assert model.nmesh == (inertia == "true")  # where its inertia is of the mesh alone
    assert model.body_mass.tolist() == plant.load().body_mass.tolist()
