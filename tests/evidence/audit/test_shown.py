"""What an audit shows of claims that were made up: figure, table of a notebook, lines."""

import math
import re

import numpy as np
import pytest

from smc_mujoco.evidence.audit.figure import COLOURS, figure
from smc_mujoco.evidence.audit.verdict import (
    DERIVED,
    EXISTENTIAL,
    OURS,
    UNIVERSAL,
    Beside,
    Claims,
    Statement,
    Threshold,
    check,
    judged,
    summary,
)

NEAR = check("duffing: ripple, m", 0.25, "<", 1.0)
FAR = check("duffing: settling time, s", math.inf, "<", 3.0)
LOST = check("arm: deviation", math.inf, "<=", 0.02)
NONE = check("arm: rate, 1/s", math.nan, ">", 4.0)
EXPONENT = Threshold.read("exponent", "2 +- 0.25")
SHARE = Threshold.read("share", "2 to 15")
BESIDE = Beside("theory", 7.0)


def claim(id, evidence, **about):
    told = {
        "text": f"sentence {id} of <this> & $that$",
        "where": "p. 1",
        "measured": "m",
        "holds_if": "h",
        "read": "abstract",
    }
    return judged(Statement(id=id, **told | about), evidence)


@pytest.fixture(scope="module")
def claims():
    both = [*EXPONENT.evidence({"": 2.0288, "late": 2.5}), *SHARE.evidence({"arm": 1.0})]
    return Claims(
        [
            claim("1", {"slow": [NEAR, BESIDE], "tuned": [NEAR]}),
            claim(
                "2",
                {"slow": [NEAR], "tuned": [NEAR, FAR]},
                note="Mind <the> gap.",
                read="full text",
            ),
            claim(
                "3",
                {"slow": [NEAR], "tuned": [LOST, NONE]},
                quantifier=UNIVERSAL,
                whose=DERIVED,
                how="by (3)",
            ),
            claim("4", {"slow": [FAR], "tuned": [NEAR]}, quantifier=EXISTENTIAL),
            claim("5", {"slow": both, "tuned": list(EXPONENT.evidence({"": 2.0}))}),
            claim("6", {"slow": [NEAR], "tuned": [NEAR._replace(sentence="a"), LOST]}, whose=OURS),
            claim("7", {"slow": [BESIDE], "tuned": []}, note="Nothing to see."),
        ]
    )


VERDICTS = {  # of each claim: verdict, by gains, what decides by gains, slack of the checks
    "1": (
        "supported",
        "supported",
        "supported",
        "ripple, m = 0.25 (< 1",
        "ripple, m = 0.25 (< 1",
        [0.75, 0.75],
    ),
    "2": (
        "partly supported",
        "supported",
        "refuted",
        "0.25 (< 1",
        "time, s = never (< 3",
        [0.75, 0.75, -math.inf],
    ),
    "3": (
        "refuted",
        "supported",
        "refuted",
        "0.25 (< 1",
        "= inf (<= 0.02",
        [0.75, -math.inf, -math.inf],
    ),
    "4": (
        "supported",
        "not shown",
        "supported",
        "time, s = never (< 3",
        "= 0.25 (< 1",
        [-math.inf, 0.75],
    ),
    "5": (
        "partly supported",
        "refuted",
        "supported",
        "late: exponent = 2.5 (2 +- 0.25",
        "exponent = 2 (2 +- 0.25",
        [0.8848, -1.0, -1.0, 1.0],
    ),
    "6": ("in part", "yes", "in part", "= 0.25 (< 1", "= inf (<= 0.02", [0.75, 0.75, -math.inf]),
    "7": ("not testable", "not testable", "not testable", "Nothing", "Nothing", []),
}
MARKS = {
    "supported": "●",
    "partly supported": "◐",
    "refuted": "○",
    "not testable": "–",
    "in part": "◧",
}


def test_an_audit_says_verdicts_what_decides_and_how_far_a_check_is_from_its_limit(claims):
    for one in claims:
        whole, slow, tuned, first, second, slack = VERDICTS[one.id]
        assert one.verdict == whole
        assert one.verdicts == {"slow": slow, "tuned": tuned}
        assert one.flips == (slow != tuned)
        assert first in str(one.decided("slow"))
        assert second in str(one.decided("tuned"))
        found = []
        for gains in one.verdicts:
            for each in one.checks(gains):
                found.append(each.slack)
        assert found == pytest.approx(slack, abs=1e-9)
    assert re.findall("(.) ([0-9])", summary(claims)) == [*zip("●◐–○◧", "22111", strict=True)]
    assert re.findall("(.) ([0-9])", summary([])) == []


def test_a_notebook_shows_claims_in_a_line_each(claims):
    listed = re.sub(' style="[^"]*"', "", claims._repr_html_())
    rows = re.findall("<tr><td>.*?</tr>", listed)
    assert len(rows) == len(claims)
    for one, row in zip(claims, rows, strict=True):
        assert row.startswith(
            f"<tr><td>{one.id}</td><td>sentence {one.id} of &lt;this&gt; &amp; $that$</td>"
        )
        assert f"<b>{MARKS[one.verdict]} {one.verdict}" in row
        assert (", flips" in row) == one.flips


def test_the_figure_has_a_row_for_each_claim_and_a_dot_for_each_check(claims):
    """At log10 of measured over asked, from a thousandth to a thousand; filled where it holds."""
    page = figure(claims, "Claims of nobody")
    (axes,) = page.axes
    labels = axes.get_yticklabels()
    assert [one.get_text()[:3] for one in labels] == [
        f"{MARKS[one.verdict]} {one.id}" for one in claims
    ]
    assert [one.get_color() for one in labels] == [COLOURS[one.verdict] for one in claims]
    dots = set()
    for line in axes.lines:
        if line.get_marker() == "o":
            for x, y in np.asarray(line.get_xydata()):
                dots.add((round(x, 3), round(y, 3), line.get_markerfacecolor() != "none"))
    above = -0.125
    below = 0.125
    holds = round(math.log10(0.25), 3)
    never = 3.0
    due = {(holds, k + above, True) for k in (0, 1, 2, 5)} | {
        (holds, k + below, True) for k in (0, 1, 3, 5)
    }
    due |= {
        (never, 1 + below, False),
        (never, 2 + below, False),
        (never, 3 + above, False),
        (never, 5 + below, False),
    }
    due |= {
        (round(math.log10(0.0288 / 0.25), 3), 4 + above, True),
        (0.301, 4 + above, False),
        (3.0, 4 + above, False),
    }
    due |= {(-3.0, 4 + below, True)}
    assert {(x, round(y, 3), filled) for x, y, filled in dots} == due
    (legend,) = page.legends
    assert [one.get_text() for one in legend.get_texts()] == list(MARKS)
    narrow = figure(
        [claim("1", {"slow": [NEAR]}, text="a sentence as long as papers write them")],
        "One",
        size=(4.0, 5.0),
    )
    assert narrow.axes[0].get_yticklabels()[0].get_text().endswith("…")
