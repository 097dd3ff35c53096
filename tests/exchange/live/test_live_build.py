"""Building the live page: what is in the folder, what is refused in one sentence, and packages pinned by hash."""

import json
import os
import re
import subprocess
from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers.commands import python

import smc_mujoco as smc
from smc_mujoco.cli import main
from smc_mujoco.control import gain_sets
from smc_mujoco.draw import style
from smc_mujoco.exchange.live import build, npm
from smc_mujoco.simulation import model as models

MY_LAW = """
import math
import smc_mujoco as smc

@smc.law_function(gains={"lam": 6.0, "k1": 3.0})
def tamed(y, gains, memory):
    s = y.de + gains.k1 * y.e
    return -gains.lam * math.tanh(s), s
"""


@pytest.fixture
def vendor(tmp_path, monkeypatch):
    """A stand-in for the packages from npm."""
    (tmp_path / "vendor").mkdir()
    (tmp_path / "vendor" / "mujoco.js").write_text("")
    monkeypatch.setattr(npm, "fetched", lambda: tmp_path / "vendor")


def facts(page: Path) -> dict:
    return json.loads((page.parent / "facts.json").read_text())


def test_what_is_known_of_a_law_is_that_of_the_catalogue(vendor, tmp_path):
    found = facts(smc.live("duffing", out=tmp_path / "page"))
    law = found["laws"]["super_twisting"]
    assert (law["label"], law["colour"]) == (style.law_name("super_twisting"), style.law_colour("super_twisting"))
    assert law["formula"].startswith("u = -k1 [s]^(1/2) + w")
    duffing = found["plants"]["duffing"]
    tuned = gain_sets.law("duffing", "super_twisting").gains
    assert duffing["gains"]["super_twisting"] == {**tuned, "w_max": "Infinity"}
    assert set(duffing["ranges"]["super_twisting"]) == {"k1", "k2", "c"}  # w_max is held
    assert all(
        low <= tuned[name] <= high and low > 0.0 for name, (low, high) in duffing["ranges"]["super_twisting"].items()
    )
    assert duffing["mjcf"] == (build.known.model_path("duffing.xml")).read_text()
    assert duffing["start"] == ["observer_free", "classical"]


def test_skins_follow_the_bodies_as_in_mujoco():
    skins, model = build.known._skins(smc.plant("van_der_pol")), smc.plant("van_der_pol").load()
    data, drawn = mujoco.MjData(model), mujoco.MjvScene(model, 100)
    data.qpos[0] = -1.2
    mujoco.mj_forward(model, data)
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, mujoco.MjvCamera(), mujoco.mjtCatBit.mjCAT_ALL, drawn)
    moved = []
    for skin in skins:
        vertices, weights = np.reshape(skin["vertices"], (-1, 3)), np.reshape(skin["weights"], (-1, len(skin["bones"])))
        assert all(bone["quaternion"] == [1.0, 0.0, 0.0, 0.0] for bone in skin["bones"])
        on = [data.body(bone["body"]).xpos - bone["position"] for bone in skin["bones"]]
        moved.append(vertices + weights @ on)
        assert np.max(skin["faces"]) == len(vertices) - 1
    assert len(skins) == 2
    assert np.concatenate(moved) == pytest.approx(drawn.skinvert.reshape(-1, 3), abs=1e-4)


@pytest.mark.slow
def test_every_plant_of_the_page_has_laws_and_an_opening(vendor, tmp_path):
    @smc.law_function(gains={"k": 1.0})
    def mine(y, gains, memory):
        return -gains.k * y.e, y.e

    page = smc.live(build.known.plants(), laws=[mine], out=tmp_path / "page")
    found = facts(page)
    assert {"inverted_pendulum", "cart_pole", "furuta"} <= set(found["plants"])
    assert set(build.DEFAULT_PLANTS) == {name for name in smc.paper.PLANTS if smc.plant(name).n == 1}
    for plant in found["plants"].values():
        assert (plant["start"][0], len(set(plant["start"]))) == ("mine", 2)  # beside a law that suits the plant
        assert set(plant["start"]) <= set(plant["laws"]) <= set(found["laws"])
        for condition in plant["conditions"]:
            assert condition["least"] <= condition["value"] <= condition["most"]
            if condition["name"] in ("friction", "delay", "noise", "amplitude"):  # a page begins without any
                assert condition["value"] == condition["least"] == 0.0


def test_the_fields_of_a_model_follow_the_mass_as_in_a_run(vendor, tmp_path):
    fields = facts(smc.live("inverted_pendulum", out=tmp_path / "page"))["plants"]["inverted_pendulum"]["fields"]
    for at, mass in enumerate((1.0, 2.0)):
        scenario = smc.Scenario(plant="inverted_pendulum", law="none", mismatch={"mass": mass})
        model = models.with_values(models.compile_model(scenario), scenario)
        for name, values in fields.items():
            if not name.startswith("opt."):
                assert np.ravel(getattr(model, name))[: len(values[at])] == pytest.approx(values[at], rel=1e-12), name


def test_the_command_takes_a_file_of_laws_gains_and_a_name(vendor, tmp_path, capsys):
    (tmp_path / "mine.py").write_text(MY_LAW)
    laws = ["--law", str(tmp_path / "mine.py"), "--law", "slow: classical(k=2)", "--law", "pid(kp=50)"]
    with pytest.raises(SystemExit) as ended:
        main.main(["export", "duffing", *laws, str(tmp_path / "page" / "index.html")])
    assert ended.value.code == 0
    assert "python -m http.server --directory" in capsys.readouterr().out
    found = facts(tmp_path / "page" / "index.html")
    gains = found["plants"]["duffing"]["gains"]
    assert found["own"] == ["tamed", "slow", "pid"]
    assert found["plants"]["duffing"]["start"] == ["tamed", "slow"]
    assert (gains["slow"]["k"], gains["pid"]["kp"]) == (2.0, 50.0)
    assert "Math.tanh" in (tmp_path / "page" / "components.js").read_text()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (
            ["nosuchplant", "live/index.html"],
            "unknown plant 'nosuchplant': choose from cart_pole, duffing, furuta, inverted_pendulum, ",
        ),
        (
            ["double_pendulum", "live/index.html"],
            "cannot show double_pendulum, which has 2 motors: choose from cart_pole, ",
        ),
        (["servo_axis", "live/index.html"], "which has dry friction in its equation"),
        (["--law", __file__, "live/index.html"], "has no law: write @smc.law_function"),
        (["--law", "computed_torque_sliding", "live/index.html"], "is of several joints"),
        (["page.html"], "it is index.html in a folder, such as live/index.html"),
        (["duffing"], "no files to write: give one that ends in .c, .fmu, .html"),
        (["live/index.html", "--type", "float"], "--type is for OUT.c"),
        (["live/index.html", "--gains", "k=2"], "give --law a law with gains"),
        (["index.html"], "something else is there, choose another folder"),
    ],
)
def test_what_the_page_cannot_have_is_one_sentence(vendor, tmp_path, monkeypatch, capsys, words, sentence):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main.main(["export", *words])
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert sentence in " ".join(said.split())
    assert len(said.splitlines()) == 1
    assert not (tmp_path / "live").exists()


@pytest.mark.slow
def test_a_live_page_is_replaced_and_another_folder_is_not(vendor, tmp_path):
    page = smc.live("duffing", out=tmp_path / "page")
    assert list(facts(smc.live("van_der_pol", out=tmp_path / "page"))["plants"]) == ["van_der_pol"]
    (page.parent / "facts.json").unlink()
    with pytest.raises(smc.ScenarioError, match="something else is there"):
        smc.live("duffing", out=tmp_path / "page")


def test_the_packages_are_pinned_by_version_and_hash_and_name_no_host():
    asked = json.loads((npm.PACKAGE_FOLDER / "package.json").read_text())["dependencies"]
    text = (npm.PACKAGE_FOLDER / "package-lock.json").read_text()
    locked = json.loads(text)["packages"]
    assert "://" not in text
    assert {f"node_modules/{name}" for name in asked} == set(locked) - {""}
    for name, version in asked.items():
        assert re.fullmatch(r"\d+\.\d+\.\d+", version)
        entry = locked[f"node_modules/{name}"]
        assert entry["version"] == version
        assert entry["integrity"].startswith("sha512-")


def test_without_npm_one_sentence_says_how_to_get_it(tmp_path, monkeypatch):
    live = smc.live  # found before nothing is
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(npm.shutil, "which", lambda name: None)
    monkeypatch.setattr(npm.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(
        smc.ScenarioError, match=r"needs npm once, .*: install Node\.js, or pip install 'smc-mujoco\[live"
    ):
        live("duffing", out=tmp_path / "page")
    assert not (tmp_path / "page").exists()


@pytest.mark.skipif(os.name == "nt", reason="the stand-in for npm is a shell script")
def test_an_npm_that_fails_is_quoted_and_leaves_no_cache(tmp_path, monkeypatch):
    stand_in = tmp_path / "npm"
    stand_in.write_text("#!/bin/sh\necho 'npm error code E404' >&2\necho 'npm error 404 Not Found' >&2\nexit 1\n")
    stand_in.chmod(0o755)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(npm, "npm", lambda: [str(stand_in)])
    for _ in range(2):
        with pytest.raises(smc.ScenarioError, match=r"could not fetch the live page's packages \(404 Not Found\)"):
            npm.fetched()
    assert not npm.cached().exists()
    assert list((tmp_path / "cache" / "smc_mujoco").iterdir()) == []
    monkeypatch.setenv("XDG_CACHE_HOME", str(stand_in))
    with pytest.raises(smc.ScenarioError, match=r"cannot be kept in .* \(Not a directory\): set XDG_CACHE_HOME to"):
        npm.fetched()


def test_the_command_is_light_to_import():
    code = "import smc_mujoco.exchange.commands, sys; print(*sys.modules)"
    assert {"mujoco", "numba", "scipy", "smc_mujoco.draw"} & set(python("-c", code).stdout.split()) == set()


def test_what_npm_fetches_is_kept_with_its_licences_and_fetched_once(tmp_path, monkeypatch):
    orders = []

    def install(command, timeout, cwd):
        orders.append((command, timeout, sorted(path.name for path in cwd.iterdir() if path.is_file())))
        for name in (*npm.VENDOR_FILES, "three/LICENSE"):
            file = cwd / "node_modules" / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(f"text of {name}")
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(npm.shutil, "which", lambda name: name)
    monkeypatch.setattr(npm, "timed", install)
    folder = npm.fetched()
    assert npm.fetched() == folder == npm.cached()
    assert (folder.parent, len(orders)) == (tmp_path / "smc_mujoco", 1)
    ((command, timeout, files),) = orders
    assert (command[:2], command[2:], timeout) == (["npm", "ci"], list(npm.NPM_FLAGS), 600.0)
    assert files == ["package-lock.json", "package.json"]
    texts = {file.name: file.read_text() for file in folder.iterdir()}
    licences = texts.pop("licences.txt")
    assert texts == {ours: f"text of {name}" for name, ours in npm.VENDOR_FILES.items()}
    assert licences.startswith("mujoco.js, mujoco.wasm: MuJoCo, Copyright DeepMind Technologies Limited, Apache-2.0\n")
    assert licences.endswith("\nthree.module.js, three.core.js: three.js, MIT\n\ntext of three/LICENSE")
    assert [file.name for file in folder.parent.iterdir()] == [folder.name]


def test_an_npm_that_does_not_end_is_told(tmp_path, monkeypatch):
    def late(*_, **__):
        raise npm.TimedOut

    monkeypatch.setattr(npm, "timed", late)
    with pytest.raises(smc.ScenarioError, match=r"^npm did not fetch .* within 10 minutes: try again later$"):
        npm._install(["npm"], tmp_path)
