"""The signed-rank test against an enumeration of all signs, and its interval against the test."""

import itertools

import numpy as np
import pytest
from scipy.stats import rankdata

from smc_mujoco.analysis import signed_rank
from smc_mujoco.analysis.signed_rank import interval, p_values, units_needed

pytestmark = pytest.mark.quick

NAN = np.nan
SAMPLES = [
    [0.1, 0.3, 0.2, 0.4],
    [1.0, 1.1, -2.0, 3.0, 3.1, 3.2, -0.5],
    [NAN, 0.7, -0.2, NAN, 0.2, 0.9],
    [np.inf, 2.0, -1.0, np.inf],
]


def share_of_signs(differences) -> float:
    """The share of all choices of signs with a rank sum as large as that of these differences."""
    finite = np.array([d for d in differences if not np.isnan(d)])
    ranks = rankdata(np.minimum(np.abs(finite), 1e300))
    sums = []
    for signs in itertools.product((0.0, 1.0), repeat=len(ranks)):
        sums.append(np.dot(ranks, signs))
    return float(np.mean(np.array(sums) >= ranks[finite > 0].sum() - 1e-9))


@pytest.mark.parametrize("differences", SAMPLES, ids=len)
def test_a_p_value_is_the_share_of_signs_with_as_large_a_rank_sum(differences):
    assert p_values(differences) == pytest.approx(share_of_signs(differences), abs=1e-12)


@pytest.mark.parametrize(
    "differences",
    [
        [1.0, 1.0, -2.0, 3.0, 3.0, 3.0, -0.5],
        [0.0, 0.0, 1.0, -1.0, 2.0],
    ],
    ids=len,
)
def test_ties_and_zeros_only_raise_a_p_value(differences):
    pairs = list(itertools.combinations_with_replacement(differences, 2))
    untied = np.arange(1.0, len(differences) + 1)
    as_many = sum(a + b > 0 for a, b in pairs)
    sums = []
    for signs in itertools.product((0.0, 1.0), repeat=len(untied)):
        sums.append(np.dot(untied, signs))
    assert p_values(differences) == pytest.approx(np.mean(np.array(sums) >= as_many), abs=1e-12)
    assert p_values(differences) >= share_of_signs(differences)


@pytest.mark.parametrize("error", [0.025, 0.1])
def test_an_interval_has_the_centres_that_the_test_does_not_reject(error):
    differences = np.random.default_rng(5).standard_normal(9) ** 3
    centre, low, high = interval(differences, error)
    assert low < centre < high
    for end, side in (
        (low, 1.0),
        (high, -1.0),
    ):
        outside, inside = (
            float(p_values(side * (differences - end) + shift)) for shift in (1e-9, -1e-9)
        )
        assert outside <= error < inside


def test_more_samples_than_are_enumerated_have_the_normal_approximation(monkeypatch):
    differences = np.random.default_rng(6).standard_normal(61) + 0.2
    approximate = p_values(differences)
    monkeypatch.setattr(signed_rank, "MAX_EXACT", 61)
    assert 0.0 < abs(approximate - p_values(differences)) < 1e-3


def test_four_samples_reject_no_centre_at_five_percent():
    assert interval([0.1, 0.3, 0.2, 0.4], 0.05)[1:] == (-np.inf, np.inf)


@pytest.mark.parametrize(("spread", "lead"), [(0.25, 0.3), (0.1, 0.08)])
def test_so_many_units_as_are_said_to_be_needed_see_a_lead_in_four_of_five_samples(spread, lead):
    """With far fewer it is seen seldom, and a lead that is not relevant with no number."""
    error, relevant = 0.0125, 0.03
    random = np.random.default_rng(3)
    needed = units_needed(lead + spread * random.standard_normal(400), error, relevant)
    seen = []
    for n in (needed, needed // 2):
        leads = lead + spread * random.standard_normal((2000, int(n)))
        seen.append(np.mean(p_values(leads + np.log1p(-relevant)) <= error))
    assert 0.7 < seen[0] < 0.9
    assert seen[1] < 0.5
    assert units_needed([0.02, 0.03, 0.01], error, relevant) == np.inf
    assert units_needed([9.0, 9.1, 9.2], error, relevant) == 7  # 2^-7 is below the level
