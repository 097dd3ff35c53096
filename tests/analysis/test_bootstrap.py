"""Intervals of medians: their two ends are treated in the same way, and another seed draws other resamples."""

import numpy as np
import pytest

from smc_mujoco.analysis.bootstrap import median_interval

pytestmark = pytest.mark.quick

SAMPLES = np.random.default_rng(0).normal(size=(20, 2, 15))  # two blocks each: the values of one are sorted first


def test_an_interval_of_negated_values_is_the_mirror_image():
    for values in SAMPLES:
        _, low, high, _ = median_interval(values, resamples=99)
        mirrored = median_interval(-values, resamples=99)
        assert (mirrored.low, mirrored.high) == (-high, -low)


def test_an_interval_depends_on_the_seed_of_its_draws():
    found = [[median_interval(values, resamples=99, seed=seed) for values in SAMPLES] for seed in (0, 0, 1)]
    assert found[0] == found[1]
    assert found[0] != found[2]
