"""What an audit shows of claims that were made up: figure, badge, tables of a notebook, lines; recorded."""

import math
import re

import pytest
from helpers.sketch import sketch

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.evidence.audit.figure import badge, figure, save_badge
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

NEAR, FAR = check("duffing: ripple, m", 0.25, "<", 1.0), check("duffing: settling time, s", math.inf, "<", 3.0)
LOST, NONE = check("arm: deviation", math.inf, "<=", 0.02), check("arm: rate, 1/s", math.nan, ">", 4.0)
EXPONENT, SHARE = Threshold.read("exponent", "2 +- 0.25"), Threshold.read("share", "2 to 15")
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
            claim("2", {"slow": [NEAR], "tuned": [NEAR, FAR]}, note="Mind <the> gap.", read="full text"),
            claim("3", {"slow": [NEAR], "tuned": [LOST, NONE]}, quantifier=UNIVERSAL, whose=DERIVED, how="by (3)"),
            claim("4", {"slow": [FAR], "tuned": [NEAR]}, quantifier=EXISTENTIAL),
            claim("5", {"slow": both, "tuned": list(EXPONENT.evidence({"": 2.0}))}),
            claim("6", {"slow": [NEAR], "tuned": [NEAR._replace(sentence="a"), LOST]}, whose=OURS),
            claim("7", {"slow": [BESIDE], "tuned": []}, note="Nothing to see."),
        ]
    )


def test_an_audit_is_said_in_lines(claims, snapshot):
    lines = [summary(claims), summary(claims[2:4]), summary([])]
    for one in claims:
        lines += ["", f"{one.id}: {one.verdict}, {one.verdicts}, {one.flips}; {one.source}; {one.note}"]
        lines += [f"{gains}: {one.decided(gains)}; {'; '.join(map(str, one.checks(gains)))}" for gains in one.verdicts]
        lines += [f"{each.slack:.4g}" for gains in one.verdicts for each in one.checks(gains)]
    assert "\n".join(lines) == snapshot


def test_a_notebook_shows_claims_in_a_line_each_and_one_in_full(claims, snapshot):
    pages = [one._repr_html_() for one in (claims, claims[0], claims[2], claims[4])]
    plain = re.sub(' style="[^"]*"', lambda style: " right" * ("align:right" in style[0]), "".join(pages))
    assert re.sub("<(t[rh]|caption|/tbody)", r"\n<\1", plain) == snapshot


def test_a_badge_has_a_field_for_each_verdict_of_the_paper_s_own_sentences(claims, snapshot):
    assert badge("a <b>", claims).replace("><", ">\n<") == snapshot
    with pytest.raises(ScenarioError, match=r"end the name in \.svg"):
        save_badge("a", claims, "badge.png")


def drawn(page):
    """A sketch of the figure, and its ticks."""
    (axes,) = page.axes
    ticks = [*axes.get_xticklabels(), *axes.get_yticklabels()]
    return "\n".join([sketch(page), *(f"{one.get_text()} {one.get_size():.3g} {one.get_color()}" for one in ticks)])


def test_the_figure_has_a_row_for_each_claim_and_a_dot_for_each_check(claims, snapshot):
    assert drawn(figure(claims, "Claims of nobody")) == snapshot


def test_a_narrow_figure_of_one_set_of_gains_names_none(snapshot):
    long = claim("1", {"slow": [NEAR]}, text="a sentence as long as papers write them")
    assert drawn(figure([long], "One", size=(4.0, 5.0))) == snapshot
