"""The report of a paper: one file with every claim, its numbers, gains and figure, and the evidence
beside it.
"""

import re
from xml.etree import ElementTree

import pytest
from helpers.words import words
from typer.testing import CliRunner

from smc_mujoco.cli.main import app
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.evidence.audit import evidence
from smc_mujoco.evidence.audit.figure import MAX_DECADES, figure, place
from smc_mujoco.evidence.audit.verdict import check
from smc_mujoco.evidence.report.paper import report
from tests.evidence.report.test_report import Reader
from tests.evidence.report.test_report_page import said

DATA = """
title = "A <small> paper"
authors = "A. Nobody"
source = "nowhere, 2026"
read = "full text"
runs = "duration=0.1"
sets = ["slow", "study"]
[gains.slow]
classical = { k = 3.0, c = 2.0 }
"""
CLAIM = """
[[claim]]
id = "{}"
whose = "{}"
text = "{}"
where = "p. {}"
function = "calm"
plants = ["{}"]
laws = ["classical"]
holds_if = {{ "TV rate" = "< {}" }}
"""
DATA += CLAIM.format(1, "paper", "the law & its plant are calm", 1, "duffing", "1e9")
DATA += CLAIM.format(2, "paper", "nothing moves", 2, "van_der_pol", "0")
DATA += (
    CLAIM.format(3, "derived", "it is fast", 3, "duffing", "1e9")
    + 'how = "by sec. 2"\nvaries = "it is timed"\n'
)
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


def test_the_page_of_an_audit_says_what_is_recorded(made, snapshot):
    text = re.sub('base64,[^"]*', "", made[1])
    assert words(said(re.sub("[0-9a-f]{16}…", "HASH", text))) == snapshot


def test_every_link_of_the_page_leads_to_a_part_of_it_and_nothing_comes_from_outside(made):
    page = Reader(made[1])
    within = {target[1:] for target in page.targets if target.startswith("#")}
    assert within <= set(page.ids)
    assert len(set(page.ids)) == len(page.ids)
    assert all(target.startswith(("#", "data:")) for target in page.targets)


def test_evidence_badge_and_figure_are_beside_it(made):
    home, text = made
    found = evidence.check(home / "out" / "evidence.json")
    assert f"{found['seal'][:16]}…" in text
    assert found["counts"] == {"refuted": 1, "supported": 1}
    for name in ("badge.svg", "checks.svg"):
        ElementTree.parse(home / "out" / name)


def test_the_command_refuses_what_is_of_the_study(made):
    home, _ = made
    done = CliRunner().invoke(app, ["report", "--paper", str(home), "--seeds", "3"])
    assert (done.exit_code, "leave them out with --paper" in done.stderr) == (2, True)


@pytest.mark.parametrize(
    ("value", "relation", "limit", "expected"),
    [
        (0.1, "<", 1.0, -1.0),
        (10.0, "<", 1.0, 1.0),
        (100.0, ">", 1.0, -2.0),
        (0.1, ">=", 1.0, 1.0),
        (1e-9, "<", 1.0, -MAX_DECADES),
        (1e9, "<=", 1.0, MAX_DECADES),
        (0.0, "<=", 0.0, -MAX_DECADES),
        (1e-9, "<=", 0.0, MAX_DECADES),
        (float("nan"), "<", 1.0, MAX_DECADES),
        (float("inf"), ">", 1.0, -MAX_DECADES),
        (-1.0, "<", 1.0, -MAX_DECADES),
        (1.0, "<", 1.0, 0.0),
    ],
)
def test_a_check_is_left_of_1_where_it_holds(value, relation, limit, expected):
    assert place(check("x", value, relation, limit)) == pytest.approx(expected)


def test_a_figure_without_claims_is_refused():
    with pytest.raises(ScenarioError, match="no claims to draw"):
        figure([], "nothing")
