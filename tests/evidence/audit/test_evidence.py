"""The evidence of an audit: written twice it is the same, it leads from claims to runs, and its
seal shows changes.
"""

import dataclasses
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

import smc_mujoco as smc
from smc_mujoco.cli import main
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import from_json
from smc_mujoco.evidence.audit import claim_runs, evidence
from smc_mujoco.evidence.audit.audit import audit
from smc_mujoco.evidence.audit.verdict import REFUTED
from smc_mujoco.simulation import scenario_json
from smc_mujoco.simulation.run_key import portable_key

DATA = """
title = "Small"
authors = "A. Nobody"
source = "nowhere, 2026"
read = "full text"
access = "a library"
note = "Nothing is known."
runs = "duration=0.2"
sets = ["slow", "tuned"]
[conditions]
pushed = "disturbance=Sine(amplitude=0.5, omega=2.0)"
[plants]
bent = { plant = "duffing", beta = 0.75 }
[gains.slow]
classical = { k = 3.0, c = 2.0 }
[[claim]]
id = "1"
whose = "paper"
text = "the law is calm"
where = "p. 1"
function = "calm"
plants = ["bent"]
laws = ["classical"]
conditions = ["pushed", "noise"]
holds_if = { "TV rate" = "< 1e9", "largest |x|" = "< 1e-9" }
[[claim]]
id = "2"
whose = "paper"
text = "it is fast"
where = "p. 2"
function = "fast"
varies = "a timing"
holds_if = { "time" = "< 1" }
"""
CODE = """
import time
import numpy as np
def calm(runs):
    grid = runs.grid()
    rates = {name: one["tv_rate"] for (_, _, name), one in zip(grid, runs.scores(grid.values()))}
    return {"TV rate": rates, "largest |x|": float(np.abs(runs.traces(grid.values())[0].x).max())}
def fast(runs):
    return {"time": time.perf_counter() % 1.0}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    home = tmp_path_factory.mktemp("papers") / "small"
    home.mkdir()
    (home / "paper.toml").write_text(DATA)
    (home / "claims.py").write_text(CODE)
    return home


@pytest.fixture(scope="module")
def done(folder):
    return audit(folder)


@pytest.fixture(scope="module")
def reported(done):
    return evidence.document(done)


@pytest.mark.slow
def test_a_clean_process_writes_the_same_file_of_another_folder(done, folder, tmp_path):
    here = done.save(tmp_path / "here.json")
    copy = tmp_path / "elsewhere" / "small"
    copy.mkdir(parents=True)
    for file in folder.glob("*.*"):
        (copy / file.name).write_bytes(file.read_bytes().replace(b"\n", b"\r\n"))
    code = "import sys, smc_mujoco as smc; smc.audit(sys.argv[1], threads=1).save(sys.argv[2])"
    elsewhere = tmp_path / "there.json"
    subprocess.run(
        [sys.executable, "-c", code, str(copy), str(elsewhere)],
        check=True,
        cwd=Path(__file__).parents[3],
    )
    assert here.read_bytes() == elsewhere.read_bytes()


def test_a_claim_leads_to_its_runs_numbers_threshold_and_verdict(reported):
    first, second = reported["claims"]
    assert first["verdict"] == REFUTED
    assert first["verdicts"] == {"slow": REFUTED, "tuned": REFUTED}
    assert set(first["numbers"]["slow"]) == {"pushed: TV rate", "noise: TV rate", "largest |x|"}
    assert [len(names) for names in first["runs"].values()] == [2, 2]
    runs = []
    for name in first["runs"]["slow"]:
        runs.append(reported["runs"][name])
    assert {run["condition"] for run in runs} == {"pushed", "noise"}
    assert [run["gains"] for run in runs] == [{"k": 3.0, "c": 2.0}] * 2
    for run in runs:
        assert len(run["scores"]) == len(run["trace"]) == 16
    assert len({run["trace"] for run in reported["runs"].values()}) == len(reported["runs"]) == 4
    assert "not_sealed" in second
    assert "a timing" in second["not_sealed"]
    assert {"numbers", "verdict"}.isdisjoint(second)
    assert reported["counts"] == {REFUTED: 1}
    assert set(reported["paper"]["files"]) == {"paper.toml", "claims.py"}


def test_it_holds_what_is_recorded(reported, snapshot):
    """Its fields and words.

    Hashes, numbers of runs, versions and the order of runs, by their hashes, are left out.
    """
    runs = sorted(
        reported["runs"].values(), key=lambda run: json.dumps([run["condition"], run["gains"]])
    )
    lines = [f"claim {json.dumps(item)}" for item in reported["claims"]] + [
        f"run {json.dumps(item)}" for item in runs
    ]
    lines += [
        f"{name} {json.dumps(item)}"
        for name, item in reported.items()
        if name not in ("claims", "runs", "software")
    ]
    text = "\n".join([*lines, f"software {' '.join(reported['software'])}"])
    text = re.sub('"[0-9a-f]{16}(?:[0-9a-f]{48})?"', '"HASH"', text)
    assert re.sub(r'("(?:value|k|c)": )[\d.e-]+', r"\1#", text) == snapshot


def test_nothing_of_the_machine_is_in_it(reported, folder):
    text = json.dumps(reported)
    assert str(folder.parent) not in text
    assert "arithmetic" not in text
    assert "/" not in "".join(reported["paper"]["files"])


def test_a_run_has_one_name_with_all_versions_and_under_all_names_of_its_condition(monkeypatch):
    scenario = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.1)
    name = portable_key(scenario)
    monkeypatch.setattr(
        scenario_json, "_versions", lambda: {"mujoco": "another", "arithmetic": "another"}
    )
    assert portable_key(scenario) == portable_key(scenario.named("calm")) == name
    assert portable_key(dataclasses.replace(scenario, seed=1)) != name


def test_a_run_tells_the_parameters_and_the_size_that_differ_from_the_suite_s():
    plants = (
        smc.plant("pendulum_network"),
        smc.plant("pendulum_network", n=3),
        smc.plant("duffing", beta=0.75),
    )
    runs = []
    for plant in plants:
        runs.append(evidence._run(smc.Scenario(plant=plant, law="none")))
    assert [run["parameters"] for run in runs] == [{}, {"n": 3}, {"beta": 0.75}]


def test_a_claim_has_its_own_runs_alone(done):
    assert [len(done.used[id]["slow"]) for id in ("1", "2")] == [2, 0]


def test_a_quick_audit_has_the_quick_sets(folder):
    assert list(audit(folder, only=["2"], quick=True).claims[0].verdicts) == ["slow"]


def test_a_change_breaks_the_seal(done, tmp_path):
    path = done.save(tmp_path / "evidence.json")
    assert evidence.read_sealed(path)["counts"] == {REFUTED: 1}
    path.write_text(path.read_text().replace('"verdict": "refuted"', '"verdict": "supported"'))
    with pytest.raises(ScenarioError, match="was changed, since it was written"):
        evidence.read_sealed(path)
    data = from_json(path.read_text())
    path.write_text(json.dumps(data | {"format": "another"}))
    with pytest.raises(ScenarioError, match="its format is 'another'"):
        evidence.read_sealed(path)
    with pytest.raises(ScenarioError, match="no file of evidence"):
        evidence.read_sealed(tmp_path / "none.json")


# table


def test_an_audit_shows_its_claims(done):
    assert done._repr_html_() == done.claims._repr_html_()


# the command


def test_the_command_writes_evidence_and_checks_the_seal(folder, tmp_path):
    file = tmp_path / "evidence.json"
    words = ["claims", "--paper", str(folder), "--evidence", str(file)]
    written = CliRunner().invoke(main.app, words)
    assert written.exit_code == 0, written.output
    assert "the law is calm" in written.stdout
    assert file.is_file()
    checked = CliRunner().invoke(main.app, ["claims", "--check", str(file)])
    assert "the seal is whole: A. Nobody, Small: 1 refuted" in " ".join(checked.stdout.split())
    listed = CliRunner().invoke(main.app, ["claims", "--papers"])
    assert "gaber" in listed.stdout
    begun = CliRunner().invoke(main.app, ["claims", "--new", str(tmp_path / "mine")])
    assert begun.exit_code == 0
    assert (tmp_path / "mine" / "claims.py").is_file()
    sentences = CliRunner().invoke(main.app, ["claims", "--list", *words[1:3]])
    assert sentences.stdout.splitlines()[1].split() == ["1", "the", "law", "is", "calm"]
    broken = CliRunner().invoke(main.app, ["claims", "--paper", str(tmp_path)])
    assert broken.exit_code == 2
    assert "no paper at" in broken.stderr


@pytest.mark.quick
def test_the_hash_of_some_bytes_depends_on_each_of_them():
    hashes = {
        claim_runs._hash(*parts) for parts in ((b"a", b"b"), (b"c", b"b"), (b"a", b"c"), (b"a",))
    }
    assert len(hashes) == 4
