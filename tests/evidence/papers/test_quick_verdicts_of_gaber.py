"""The quick verdicts of Gaber's paper under the study's gains, a module of its claims at a time."""

import pytest

from smc_mujoco.evidence.audit.paper import paper
from tests.evidence.papers.test_quick_verdicts import TIMINGS, golden, quick_verdicts

MODULES: dict[str, list[str]] = {}  # module -> claims that it measures
for one in paper("gaber").claims.values():
    if ("gaber", one.id) not in TIMINGS:
        MODULES.setdefault(one.evidence.__module__.rpartition(".")[2], []).append(one.id)


@pytest.mark.parametrize("module", MODULES)
def test_quick_verdicts_of_a_module_are_those_of_the_golden(module):
    expected = golden("gaber")
    assert quick_verdicts("gaber", MODULES[module]) == {id: expected[id] for id in MODULES[module]}
