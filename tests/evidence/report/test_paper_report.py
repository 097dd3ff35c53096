"""The report of a paper: one file with every claim, its numbers and gains, and the evidence
beside it.
"""

import pytest
from typer.testing import CliRunner

from smc_mujoco.cli.main import app
from smc_mujoco.evidence.audit import evidence
from smc_mujoco.evidence.report.paper import report
from tests.evidence.report.test_report import check_page

DATA = """
title = "A <small> paper"
authors = "A. Nobody"
source = "nowhere, 2026"
read = "full text"
runs = "duration=0.1"
sets = ["slow", "study"]
[gains.slow]
classical = { k = 3.0, c = 2.0 }
[[claim]]
id = "1"
whose = "paper"
text = "the law & its plant are calm"
where = "p. 1"
function = "calm"
plants = ["duffing"]
laws = ["classical"]
holds_if = { "TV rate" = "< 1e9" }
"""
CODE = """
def calm(runs):
    return {"TV rate": runs.scores(runs.grid().values())[0]["tv_rate"], "beside it": 0.125}
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    home = tmp_path_factory.mktemp("report") / "small"
    home.mkdir()
    (home / "paper.toml").write_text(DATA)
    (home / "claims.py").write_text(CODE)
    return home, report(home, home / "out").read_text()


def test_the_page_has_claims_with_their_numbers_and_evidence_beside_it(made):
    home, text = made
    check_page(text)
    found = evidence.check(home / "out" / "evidence.json")
    assert found["counts"] == {"supported": 1}
    for piece in (f"{found['seal'][:16]}…", "A &lt;small&gt; paper", "are calm", "0.125"):
        assert piece in text


def test_the_command_refuses_what_is_of_the_study(made):
    done = CliRunner().invoke(app, ["report", "--paper", str(made[0]), "--seeds", "3"])
    assert (done.exit_code, "leave them out with --paper" in done.stderr) == (2, True)
