"""A user's law runs on a card only where its indices are surely within its memory."""

import pytest
from helpers.runs import made, scenario
from numba import njit

from smc_mujoco.analysis.engine.group import why_not


@njit
def writes_at(memory, k):
    memory[k] = 1.0
    return memory[0], 1.0


def unpacks(y, gains, memory):
    u, s = y.e, 2.0
    memory[1] = u
    memory[-2] += s
    return u, s


@pytest.mark.quick
@pytest.mark.parametrize(
    ("law", "allowed"),
    [
        (unpacks, True),
        (lambda y, gains, memory: (-y.e, y.e), True),
        (lambda y, gains, memory: (memory[2], 0.0), False),  # of two
        (lambda y, gains, memory: (memory[-3], 0.0), False),
        (lambda y, gains, memory: (memory[int(y.x)], 0.0), False),
        (lambda y, gains, memory: (memory[1:].sum(), 0.0), False),
        (lambda y, gains, memory: writes_at(memory, 1), False),
    ],
)
def test_a_law_that_may_index_beyond_its_memory_is_not_for_a_card(law, allowed):
    case = scenario(made(law, memory=2))
    assert why_not(case) == ""
    assert ("beyond its memory" not in why_not(case, device="cuda")) == allowed
