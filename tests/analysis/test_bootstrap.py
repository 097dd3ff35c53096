"""Intervals of medians and shares: their two ends are treated in the same way, and they cover what
they say.
"""

import numpy as np
import pytest
from scipy.stats import binom

from smc_mujoco.analysis.bootstrap import median_of, share_interval

pytestmark = pytest.mark.quick

# two blocks each: the values of one are sorted first
SAMPLES = np.random.default_rng(0).normal(size=(20, 2, 15))


def test_an_interval_of_negated_values_is_the_mirror_image():
    for values in SAMPLES:
        _, low, high, _ = median_of(values)
        mirrored = median_of(-values)
        assert mirrored.low == -high
        assert mirrored.high == -low


@pytest.mark.parametrize("n", [6, 40])
def test_the_interval_of_a_share_covers_as_often_as_its_docstring_says(n):
    """By the binomial distribution. The coverage is least beside the ends of intervals."""
    intervals = []
    for k in range(n + 1):
        intervals.append(share_interval(k / n, n))

    def coverage(shares):
        covered = np.array(
            [(bounds.low <= shares) & (shares <= bounds.high) for bounds in intervals]
        )
        return (binom.pmf(np.arange(n + 1)[:, None], n, shares) * covered).sum(axis=0)

    ends = np.array([(bounds.low, bounds.high) for bounds in intervals])
    beside = np.concatenate([ends - 1e-9, ends + 1e-9]).ravel()
    assert coverage(beside[(beside > 0.0) & (beside < 1.0)]).min() == pytest.approx(0.83, abs=0.01)
    assert coverage(np.linspace(0.0005, 0.9995, 2000)).mean() == pytest.approx(0.95, abs=0.01)
