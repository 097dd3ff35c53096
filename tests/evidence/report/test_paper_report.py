"""The report of a paper: one file with every claim, its numbers, gains and figure, and the evidence beside it."""

import re
from html.parser import HTMLParser
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
DATA += CLAIM.format(3, "derived", "it is fast", 3, "duffing", "1e9") + 'how = "by sec. 2"\nvaries = "it is timed"\n'
CODE = """
def calm(runs):
    return {"TV rate": runs.scores(runs.grid().values())[0]["tv_rate"], "beside it": 0.125}
"""


class Page(HTMLParser):
    def __init__(self):
        super().__init__()
        self.ids, self.links, self.words, self.outside = [], [], [], []

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.ids += [found["id"]] if "id" in found else []
        target = found.get("href") or found.get("src") or ""
        (self.links if target.startswith("#") else self.outside).append(target)

    def handle_data(self, data):
        self.words.append(data)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    home = tmp_path_factory.mktemp("report") / "small"
    home.mkdir()
    (home / "paper.toml").write_text(DATA)
    (home / "claims.py").write_text(CODE)
    path = report(home, home / "out")
    page = Page()
    page.feed(path.read_text())
    return home, page


def test_the_page_has_every_claim_its_numbers_and_gains(made):
    _, page = made
    text = " ".join(" ".join(page.words).split())
    assert {"claim-1", "claim-2", "gains-slow", "gains-study", "verdict"} <= set(page.ids)
    assert all(part in text for part in ("k = 3", "TV rate < 1.0e9", "0.125"))


def test_the_page_of_an_audit_says_what_is_recorded(made, snapshot):
    home, _ = made
    text = re.sub('base64,[^"]*', "", (home / "out" / "report.html").read_text())
    assert words(said(re.sub("[0-9a-f]{16}…", "HASH", text))) == snapshot


def test_every_link_of_the_page_leads_to_a_part_of_it_and_nothing_comes_from_outside(made):
    _, page = made
    assert {link[1:] for link in page.links} <= set(page.ids)
    assert len(set(page.ids)) == len(page.ids)
    assert all(target.startswith(("data:", "")) and "//" not in target.partition(",")[0] for target in page.outside)


def test_evidence_badge_and_figure_are_beside_it(made):
    home, page = made
    found = evidence.check(home / "out" / "evidence.json")
    assert f"{found['seal'][:16]}…" in " ".join(page.words)
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
        (0.1, "<", 1.0, -1.0), (10.0, "<", 1.0, 1.0), (100.0, ">", 1.0, -2.0), (0.1, ">=", 1.0, 1.0),
        (1e-9, "<", 1.0, -MAX_DECADES), (1e9, "<=", 1.0, MAX_DECADES), (0.0, "<=", 0.0, -MAX_DECADES),
        (1e-9, "<=", 0.0, MAX_DECADES), (float("nan"), "<", 1.0, MAX_DECADES), (float("inf"), ">", 1.0, -MAX_DECADES),
        (-1.0, "<", 1.0, -MAX_DECADES), (1.0, "<", 1.0, 0.0),
    ],
)  # fmt: skip
def test_a_check_is_left_of_1_where_it_holds(value, relation, limit, expected):
    assert place(check("x", value, relation, limit)) == pytest.approx(expected)


def test_a_figure_without_claims_is_refused():
    with pytest.raises(ScenarioError, match="no claims to draw"):
        figure([], "nothing")
