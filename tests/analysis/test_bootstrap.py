"""Intervals of medians: their two ends are treated in the same way, and another seed draws other resamples."""

import math

import numpy as np
import pytest

from smc_mujoco.analysis.bootstrap import Interval, median_interval, share_interval

pytestmark = pytest.mark.quick

SAMPLES = np.random.default_rng(0).normal(size=(20, 2, 15))  # two blocks each: the values of one are sorted first


def test_an_interval_of_negated_values_is_the_mirror_image():
    for values in SAMPLES:
        _, low, high, _ = median_interval(values, resamples=99)
        mirrored = median_interval(-values, resamples=99)
        assert (mirrored.low, mirrored.high) == (-high, -low)


def test_a_share_is_of_at_least_one_seed_and_a_median_of_two_has_an_interval(refused):
    for share, n in ((-0.1, 3), (1.1, 3), (0.5, 0), (0.5, 2.5)):
        refused(lambda share=share, n=n: share_interval(share, n))
    assert median_interval([1.0, 3.0]) == (2.0, 1.0, 3.0, 2)
    assert repr(median_interval([3.0])) == repr(Interval(3.0, math.nan, math.nan, 1))


def test_an_interval_depends_on_the_seed_of_its_draws():
    found = [[median_interval(values, resamples=99, seed=seed) for values in SAMPLES] for seed in (0, 0, 1)]
    assert found[0] == found[1]
    assert found[0] != found[2]
