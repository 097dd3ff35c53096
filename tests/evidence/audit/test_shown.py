"""What an audit shows of claims that were made up: figure, table of a notebook, lines."""

import math
import re

import pytest

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
    totals_line,
)

NEAR = check("duffing: ripple, m", 0.25, "<", 1.0)
FAR = check("duffing: settling time, s", math.inf, "<", 3.0)
LOST = check("arm: deviation", math.inf, "<=", 0.02)
NONE = check("arm: rate, 1/s", math.nan, ">", 4.0)
EXPONENT = Threshold.read("exponent", "2 +- 0.25")
SHARE = Threshold.read("share", "2 to 15")
BESIDE = Beside("theory", 7.0)


def claim(id, evidence, **about):
    reported = {
        "text": f"sentence {id} of <this> & $that$",
        "where": "p. 1",
        "measured": "m",
        "holds_if": "h",
        "read": "abstract",
    }
    return judged(Statement(id=id, **reported | about), evidence)


@pytest.fixture(scope="module")
def claims():
    slow_evidence = [*EXPONENT.evidence({"": 2.0288, "late": 2.5}), *SHARE.evidence({"arm": 1.0})]
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
            claim("5", {"slow": slow_evidence, "tuned": list(EXPONENT.evidence({"": 2.0}))}),
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


@pytest.mark.quick
def test_an_audit_says_verdicts_what_decides_and_how_far_a_check_is_from_its_limit(claims):
    for claim in claims:
        verdict, slow, tuned, first, second, slack = VERDICTS[claim.id]
        assert claim.verdict == verdict
        assert claim.verdicts == {"slow": slow, "tuned": tuned}
        assert claim.flips == (slow != tuned)
        assert first in str(claim.decided("slow"))
        assert second in str(claim.decided("tuned"))
        slacks = []
        for gains in claim.verdicts:
            for audit_check in claim.checks(gains):
                slacks.append(audit_check.slack)
        assert slacks == pytest.approx(slack, abs=1e-9)
    assert re.findall("(.) ([0-9])", totals_line(claims)) == [*zip("●◐–○◧", "22111", strict=True)]
    assert re.findall("(.) ([0-9])", totals_line([])) == []


PRINTED = {  # value, relation, limit -> as it is printed
    "far apart": (0.25, "<", 1.0, "0.25 (< 1"),
    "alike in three digits": (0.02801, ">", 0.02804, "0.02801 (> 0.02804"),
    "alike in fifteen digits": (0.25 + 2e-16, "<=", 0.25, "0.2500000000000002 (<= 0.25"),
    "a tie that fails": (0.028, ">", 0.028, "0.028, equal (> 0.028"),
    "a tie that holds": (0.0, "<=", 0.0, "0 (<= 0"),
    "never": (math.inf, "<", math.inf, "never, equal (< never"),
}


@pytest.mark.parametrize("case", PRINTED)
def test_a_comparison_is_printed_so_that_it_can_be_read(case):
    value, relation, limit, words = PRINTED[case]
    assert str(check("time, s", value, relation, limit)) == f"time, s = {words} asked)"


def test_a_number_outside_a_range_is_not_printed_as_its_end():
    (audited,) = [claim("1", {"slow": list(SHARE.evidence({"": 15.0004}))})]
    assert audited.decided("slow") == "share = 15.0004 (2 to 15 asked)"
