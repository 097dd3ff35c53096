"""Orders of accuracy from errors alone: the slope, an interval that covers, and what does not
count.
"""

import inspect
import math

import numpy as np
import pytest

from smc_mujoco.evidence.accuracy import scaling as module
from smc_mujoco.evidence.accuracy.scaling import fit, scaling

pytestmark = pytest.mark.quick

PERIODS = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4)
H = np.array(PERIODS)


def steady(errors):
    """The parts of runs whose errors do not change any more."""
    return np.repeat(np.atleast_2d(errors)[..., None], 3, axis=2)


def measured(errors, theory=2.0):
    return scaling(steady(errors), PERIODS, theory, 1e-12)


def test_a_power_law_has_its_exponent_whatever_the_factors_of_its_starts():
    scaling_law = measured(np.array([[3.0], [0.2]]) * H**2)
    assert (scaling_law.order, scaling_law.low, scaling_law.high) == pytest.approx((2.0, 2.0, 2.0))
    assert scaling_law.used == PERIODS
    assert scaling_law.why == ""
    assert scaling_law.largest == pytest.approx(tuple(3.0 * H**2))


def test_the_interval_covers_where_errors_and_slopes_scatter():
    rng = np.random.default_rng(1)
    hits = 0
    draws = 400
    for _ in range(draws):
        slopes = 2.0 + 0.1 * rng.standard_normal((3, 1))
        errors = H**slopes * np.exp(0.2 * rng.standard_normal((3, 5)))
        _, low, high = fit(H, errors)
        hits += low <= 2.0 <= high
    assert 0.93 <= hits / draws <= 1.0, hits


def test_two_periods_have_an_order_without_an_interval_and_one_has_none():
    order, low, high = fit(H[:2], H[None, :2])
    assert order == pytest.approx(1.0)
    assert math.isnan(low)
    assert math.isnan(high)
    assert math.isnan(fit(H[:1], H[None, :1])[0])


def test_rounding_failed_and_unsettled_periods_are_left_out_and_said():
    parts = steady([H**2, H**2])
    parts[1, 0] = math.inf
    parts[0, 1] = 9.5e-6, 6e-6, 3.9e-6
    parts[0, 4, 2] = 1e-13
    scaling_law = scaling(parts, PERIODS, 2.0, 1e-12, ["1 of 10 runs failed"])
    assert scaling_law.used == PERIODS[2:4]
    assert scaling_law.order == pytest.approx(2.0)
    assert scaling_law.why.split("; ") == [
        "1 of 10 runs failed",
        "at 0.25 ms up to 1e-12, which is rounding",
        "at 2 ms still falling at the end of the run",
    ]
    growing = scaling(steady([H]) * np.array([1.0, 1.6, 2.6]), PERIODS, 1.0, 1e-12)
    assert math.isnan(growing.order)
    assert growing.why == "all periods: still growing at the end of the run"
    wavering = scaling(steady([H]) * np.array([9.0, 1.0, 1.2]), PERIODS, 1.0, 1e-12)
    assert wavering.used == PERIODS, "a transient that has ended"


@pytest.mark.parametrize(
    ("errors", "theory", "why"),
    [
        (H**2, 2.0, ""),
        (H**2 + 1e-5, 2.0, "falls slower than promised"),
        (H**1.7, 2.0, "falls slower than promised"),
        (H**2, 1.0, "falls faster than promised"),
        (np.array([H**2, 0.0 * H + 1e-4]), 2.0, "contains 0 and 2: the order cannot be told"),
        (np.array([H**3, 0.0 * H + 1e-4]), 1.5, "contains 0 and 1.5: the order cannot be told"),
        (H, None, ""),
    ],
)
def test_an_order_that_is_not_the_promised_one_has_a_remark(errors, theory, why):
    remark = measured(errors, theory=theory).why
    assert why in remark
    assert bool(why) == bool(remark)


def test_its_explanation_has_the_numbers_of_the_code():
    said = " ".join((inspect.getdoc(module) or "").split())
    assert f"by more than a factor of {module.TREND:g} from each" in said
    kind = " ".join((inspect.getdoc(module.Scaling) or "").split())
    assert f"its {100.0 * module.CONFIDENCE:g} % interval" in kind
