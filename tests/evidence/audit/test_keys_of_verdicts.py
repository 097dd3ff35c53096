"""The key of an audit's verdicts changes with its papers, the key of a run does not."""

import shutil

import pytest

import smc_mujoco as smc
from smc_mujoco.common import fingerprint
from smc_mujoco.simulation.run_key import run_key


@pytest.mark.quick
def test_a_paper_changes_the_key_of_verdicts_and_no_key_of_a_run(monkeypatch, tmp_path):
    scenario = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=1.0)
    package = tmp_path / "smc_mujoco"
    without = shutil.ignore_patterns("__pycache__", "tuned_gains")
    shutil.copytree(fingerprint.PACKAGE, package, ignore=without)
    monkeypatch.setattr(fingerprint, "PACKAGE", package)

    def now() -> tuple[str, str]:
        fingerprint.package.cache_clear()
        return run_key(scenario), fingerprint.package()

    of_run, of_verdicts = now()
    (package / "evidence" / "commands" / "words.py").write_text("# other words")
    assert now() == (of_run, of_verdicts)
    (package / "evidence" / "papers" / "measures.py").write_text("# other measures")
    assert now()[0] == of_run
    _, before = now()
    (package / "evidence" / "papers" / "gaber" / "paper.toml").write_text("# other thresholds")
    assert now()[0] == of_run
    assert now()[1] != before
    fingerprint.package.cache_clear()
