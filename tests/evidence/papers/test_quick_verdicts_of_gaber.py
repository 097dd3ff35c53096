"""The quick verdicts of Gaber's paper under the study's gains, a module of its claims at a time."""

import pytest

from smc_mujoco.evidence.audit.paper import paper
from tests.evidence.papers.test_quick_verdicts import TIMINGS, golden, quick_verdicts

SEARCHES = ["12", "20", "24", "61", "T"]  # of millions of steps each; with stubbed runs they are in test_gaber.py
MODULES: dict[str, list[str]] = {}  # module -> claims that it measures
for one in paper("gaber").claims.values():
    if ("gaber", one.id) not in TIMINGS and one.id not in SEARCHES:
        MODULES.setdefault(one.evidence.__module__.rpartition(".")[2], []).append(one.id)


def check(ids: list[str]) -> None:
    expected = golden("gaber")
    assert quick_verdicts("gaber", ids) == {id: expected[id] for id in ids}


@pytest.mark.parametrize("module", MODULES)
def test_quick_verdicts_of_a_module_are_those_of_the_golden(module):
    check(MODULES[module])


@pytest.mark.slow
def test_quick_verdicts_of_searches_are_those_of_the_golden():
    check(SEARCHES)
