"""The lead of a family of laws over the next, by hand."""

import numpy as np
import pytest

from benchmarks import flight

RUNS = 12
FAMILIES = {"sliding": ("classical", "observer_free"), "rivals": ("adrc", "pid")}


@pytest.mark.quick
def test_a_lead_is_of_laws_that_the_other_half_of_the_runs_chose():
    even = np.arange(RUNS) % 2 == 0
    scores, best = flight.chosen_by_halves(np.where([even, ~even], 1.0, 100.0))
    assert best == [1, 0]  # the odd runs choose the second law, for the even ones
    assert (scores == 100.0).all()
    noise = np.exp(np.linspace(-0.2, 0.2, RUNS))
    values = {"classical": 3.0 * noise, "observer_free": 9.0 * noise**0}
    values |= {"adrc": np.full(RUNS, 2.0), "pid": np.full(RUNS, 5.0)}
    sets = dict.fromkeys(values, np.arange(RUNS))
    flight_lead = flight.lead(values, sets, 0.0, FAMILIES)
    assert flight_lead is not None
    assert (flight_lead.first, flight_lead.second, flight_lead.laws) == (
        "rivals",
        "sliding",
        ("adrc",),
    )
    assert 1.0 < flight_lead.low < flight_lead.times < flight_lead.high
    assert flight_lead.times == pytest.approx(1.5, rel=0.02)
    unseen = flight.lead(values, sets, 100.0, FAMILIES)
    assert unseen is not None
    assert unseen.times == 1.0
