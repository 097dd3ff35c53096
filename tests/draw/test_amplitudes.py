"""Amplitude of chattering over the actuator's lag."""

import math

import pytest

import smc_mujoco as smc
from smc_mujoco.draw.amplitudes import crossover, lag


@pytest.mark.quick
def test_the_lag_is_what_all_drives_and_the_delay_add_up_to():
    drives = (smc.Lag(0.01), smc.Lag(0.02), smc.Backlash(0.01))
    assert lag(
        smc.Scenario(
            plant="duffing",
            law="none",
            actuator=drives,
            input_delay=0.005,
        )
    ) == pytest.approx(0.035)


def test_amplitudes_that_grow_with_the_lag_and_with_its_square_cross_where_they_are_equal():
    lags = [1.0, 10.0, 100.0]
    assert crossover(lags, [2.0 * x for x in lags], [0.1 * x * x for x in lags]) == pytest.approx(
        20.0
    )
    assert math.isnan(crossover(lags, [1.0, 2.0, 3.0], [2.0, 3.0, 4.0]))
    assert crossover(lags, [20.0, math.nan, 2000.0], [1.0, 1.0, 1e5]) == pytest.approx(
        100.0 ** (math.log(20.0) / math.log(1000.0))  # between the two lags where both are known
    )
    assert math.isnan(crossover(lags, [math.nan] * 3, lags))
