"""The lead of a family of laws over the next, by hand."""

import math
from typing import Any

import numpy as np
import pytest

from smc_mujoco.control import gain_sets
from smc_mujoco.evidence.report import families

pytestmark = pytest.mark.quick
RUNS = 12


def lead(sets=None, floor=0.0, **scores) -> Any:
    its = {law: np.broadcast_to(np.asarray(values, float), RUNS).copy() for law, values in scores.items()}
    return families.lead(its, {law: np.arange(RUNS) if sets is None else sets for law in its}, floor)


def test_every_law_that_is_compared_is_in_one_family():
    assert sorted(law for laws in families.FAMILIES.values() for law in laws) == sorted(gain_sets.COMPARED)


def test_a_law_is_scored_in_the_half_of_the_runs_that_did_not_choose_it():
    even = np.arange(RUNS) % 2 == 0
    own, other = np.where(even, 1.0, 100.0), np.where(even, 100.0, 1.0)
    scores, best = families.told(np.array([own, other]))
    assert best == [1, 0]  # the odd runs choose the second law, for the even ones
    assert (scores == 100.0).all()


def test_the_lead_is_the_ratio_to_the_next_family_and_sure_where_its_interval_is_above_1():
    noise = np.exp(np.linspace(-0.2, 0.2, RUNS))
    found = lead(classical=3.0 * noise, observer_free=9.0, adrc=2.0, pid=5.0)
    assert (found.first, found.second, found.laws) == ("rivals", "switching", ("adrc",))
    assert found.low < found.times < found.high
    assert found.times == pytest.approx(1.5, rel=0.02)
    assert found.sure
    assert not lead(classical=2.0 * noise, adrc=2.0).sure


def test_runs_that_share_gains_count_once():
    sets = np.arange(RUNS) % 6  # a run and the sixth after it
    values = np.exp(np.linspace(0.1, 1.2, RUNS))
    found, by_set = lead(sets, classical=values, adrc=1.0), np.log(values).reshape(2, 6).mean(axis=0)
    assert math.log(found.low) == pytest.approx(by_set.min())
    assert math.log(found.high) == pytest.approx(by_set.max())


def test_what_nobody_can_see_is_no_lead_and_one_family_has_none():
    assert lead(floor=1e-3, classical=1e-5, adrc=1e-9).times == 1.0
    assert lead(classical=1.0, adaptive=2.0) is None
