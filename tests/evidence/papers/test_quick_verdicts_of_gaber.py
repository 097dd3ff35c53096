"""The quick verdicts of Gaber's paper under the study's gains, a sixth of its claims at a time."""

import pytest

from smc_mujoco.evidence.audit.paper import paper
from tests.evidence.papers.test_quick_verdicts import (
    TIMINGS,
    check_golden,
    golden,
    quick_verdicts,
    runs_made_once,
)

# of millions of steps each; with stubbed runs they are in test_gaber.py
SEARCHES = ["12", "20", "24", "61", "T"]
OTHERS = [id for id in paper("gaber").claims if ("gaber", id) not in TIMINGS and id not in SEARCHES]
PARTS = [pytest.param(OTHERS[k::6], id=str(k), marks=pytest.mark.slow) for k in range(5)]


@pytest.fixture(scope="module", autouse=True)
def once():
    with runs_made_once():
        yield


@pytest.mark.parametrize(
    "ids", [OTHERS[5::6], *PARTS, pytest.param(SEARCHES, id="searches", marks=pytest.mark.slow)]
)
def test_quick_verdicts_of_some_claims_are_those_of_the_golden(ids):
    expected = golden("gaber")
    check_golden(quick_verdicts("gaber", ids), {id: expected[id] for id in ids})
