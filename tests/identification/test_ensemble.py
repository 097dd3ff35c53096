"""Rankings over a rig's parameter sets, and the commands that make them and identify rigs."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import machines
from helpers.machines import AXIS, PENDULUM
from typer.testing import CliRunner

import smc_mujoco as smc
from smc_mujoco.cli.main import app
from smc_mujoco.identification import ensemble, records
from smc_mujoco.identification import published_rig as rig

LAWS = (smc.law("pid", kp=30.0, kd=6.0), smc.law("super_twisting"))


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    """The command writes into the present folder."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.quick
def test_every_set_is_a_condition_with_its_own_numbers():
    runs = ensemble.runs(PENDULUM, LAWS, seeds=2, duration=1.0, starts=smc.starts(0.3))
    assert len(runs) == 2 * 2 * (1 + len(PENDULUM.ensemble))
    levels = {}
    for run in runs:
        levels[run.condition] = run.friction[0].level
    assert levels == {
        "set 1": 0.21,
        "set 2": 0.18,
        "set 3": 0.24,
        "set 4": 0.18,
        "set 5": 0.24,
    }
    assert {run.resolved.u_max for run in runs} == {12.0}
    assert len({run.resolved.x0 for run in runs}) == 2


def test_the_verdict_says_where_one_law_wins():
    won = SimpleNamespace(label="tv", winner="pid", blocks=[None, None])
    blocks = [SimpleNamespace(winner=name) for name in ("pid", None, "pid")]
    split = SimpleNamespace(label="iae", winner=None, blocks=blocks)
    assert ensemble.verdict([won, split]).splitlines() == [
        "tv: pid wins on all 2 parameter sets",
        "iae: no law wins on all 3 parameter sets (pid on 2)",
    ]


def test_a_rig_of_one_set_is_refused():
    sentence = "axis has only one parameter set: choose a rig with"
    with pytest.raises(smc.ScenarioError, match=sentence):
        ensemble.runs(AXIS, LAWS)


def test_a_rig_has_laws_and_a_start_of_its_own():
    runs = ensemble.runs(PENDULUM, seeds=1, duration=0.1)
    assert {run.law.name for run in runs} == {"classical", "pid"}
    many = ensemble.runs(PENDULUM, ["pid"])
    assert {run.duration for run in many} == {10.0}
    assert {run.seed for run in many} == {*range(20)}
    assert {
        len({run.resolved.x0 for run in many if run.condition == f"set {k}"}) for k in range(1, 6)
    } == {20}
    for run in many:
        assert 0.24 - 1e-9 <= run.resolved.x0[0] <= 0.36 + 1e-9


@pytest.mark.slow
def test_a_law_is_tuned_on_a_machine_and_compared_there(tmp_path, monkeypatch):
    monkeypatch.setattr(rig, "rig_catalogue", machines.catalogue)
    words = ["compare", "--rig", "lifted_pendulum", "--law", "pid,twisting", "--searches=1"]
    more = ["--seeds", "1", "--duration", "0.5", "--allow-defaults", "--out", str(tmp_path)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ensemble.tuned, "__defaults__", (None, 1, 1, None, None, None, False))
        done = CliRunner().invoke(app, [*words, *more])
    assert done.exit_code == 0, done.output
    assert "twisting(" in done.output
    assert list((tmp_path / "searches").glob("*-twisting-0*.json"))


def test_a_law_by_name_has_the_gains_of_the_rig():
    pid = next(law for law in PENDULUM.laws if law.name == "pid")
    laws_by_name = {}
    for run in ensemble.runs(PENDULUM, ["pid", "twisting"], seeds=1, duration=0.1):
        laws_by_name[run.law.name] = run.law
    assert laws_by_name["pid"] == pid
    assert laws_by_name["pid"].source.kind == "shipped"
    assert laws_by_name["twisting"].source.kind == "default"


def test_the_command_identifies_from_files(tmp_path, monkeypatch):
    monkeypatch.setattr(rig, "rig_catalogue", machines.catalogue)
    run = smc.run(AXIS.scenario(duration=0.3, reference=smc.Sine(0.05, 8.0), x0=0.0))
    np.savez(tmp_path / "run.npz", **records.of_trace(run, AXIS.columns))
    words = [
        "identify",
        "axis",
        str(tmp_path / "run.npz"),
        "--for",
        "mass",
        "--starts",
        "1",
    ]
    done = CliRunner().invoke(app, [*words, "--json", str(tmp_path / "found.json")])
    assert done.exit_code == 0, done.output
    assert "mass" in done.output
    written = json.loads((tmp_path / "found.json").read_text())
    assert written["quantities"]["mass"]["value"] == pytest.approx(95.1089, rel=0.02)
    wrong = CliRunner().invoke(app, [*words, "--columns", "x"])
    assert wrong.exit_code == 2
    assert "columns 'x' cannot be read: write it as x_elbow=angle,t=time" in wrong.output
