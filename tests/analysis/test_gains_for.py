"""Gains from a wanted amplitude or frequency of chattering."""

import math

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.chattering import Chattering
from smc_mujoco.analysis.gains_for import SPEEDS, _force_headroom, _forces, _largest
from smc_mujoco.metrics.limit_cycle import channel_cycle

COARSELY = pytest.mark.usefixtures("coarse_grid")
LAG = {"actuator": smc.Lag(0.01)}


@pytest.mark.slow
@COARSELY
def test_super_twisting_gets_the_largest_gains_in_the_proportion_of_its_theorem():
    design = smc.design.gains_for("super_twisting", "duffing", amplitude=1e-3, **LAG)
    assert 0.99e-3 < design.chattering.amplitude_range[1] <= 1e-3
    run = smc.run(
        smc.Scenario(
            plant="duffing",
            law=design.law,
            x0=0.02,
            duration=6.0,
            **LAG,
        )
    )
    assert channel_cycle(run)[0] == pytest.approx(1e-3, rel=0.1)
    own = smc.law("super_twisting").gains
    gains = design.law.gains
    assert gains["k1"] / own["k1"] == pytest.approx(math.sqrt(design.size), rel=1e-9)
    assert gains["k2"] / own["k2"] == pytest.approx(design.size, rel=1e-9)
    assert gains["c"] == own["c"]
    assert design.speed == 1.0
    assert 4.0 < design.disturbance <= 6.0  # N, as u is at most 6 N


def test_forces_among_the_gains_stay_at_the_limit_of_every_channel():
    """With the model a gain is an acceleration, of which each joint has its own limit."""
    law = smc.law("classical", k=2.0)
    limits = (6.0, 0.5)
    rest = np.zeros(2)
    base = smc.Scenario(
        plant="double_pendulum",
        law=law,
        model="nominal",
        u_max=limits,
    )
    least = min(
        u * base.plant.nominal(rest, rest, i, base.plant.values({}))[1]
        for i, u in enumerate(limits)
    )
    assert _force_headroom(base) == pytest.approx(least / 2.0)


FAST = smc.law("classical", k=1.0, c=20.0)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:classical with these gains")
def test_an_amplitude_and_a_frequency_decide_size_and_speed():
    wanted = 60.0
    fields = {"u_max": 10.0, **LAG}
    both = smc.design.gains_for(FAST, "duffing", amplitude=5e-3, frequency=wanted, **fields)
    assert both.chattering.amplitude_range[1] <= 5e-3
    assert both.chattering.frequency <= wanted
    gains = dict(both.law.gains) | {"k": 1.01 * both.law.gains["k"]}
    larger = smc.design.chattering(smc.law("classical", **gains), plant="duffing", **fields)
    assert larger.amplitude_range[1] > 5e-3 or larger.frequency > wanted
    assert both.law.gains["k"] == pytest.approx(both.size * both.speed**2)


def predicted(frequency, amplitude):
    return Chattering(frequency=frequency, amplitude_range=(0.0, amplitude))


def test_the_speed_is_that_of_the_largest_forces_at_most_as_fast_as_wanted(refused):
    """Cycles of 20 w Hz and 0.1 / w, then with a dip about w = 4, and with none below w = 0.5 or
    above 2.
    """

    def steady(w):
        return predicted(20.0 * w, 0.1 / w)

    def dipping(w):
        return predicted(20.0 * w * (0.1 if 3.9 < w < 4.1 else 1.0), 0.1 / w)

    def narrow(w):
        return steady(w) if 0.5 <= w <= 2.0 else Chattering()

    def shrinking(w):
        return predicted(20.0 * w, 0.1 * w**3)

    speeds = {k: 10.0 ** (0.1 * k) for k in range(-10, 11)}
    for cycle, amplitude, frequency, headroom, chosen in (
        (steady, None, 20.1, math.inf, 0),
        (steady, None, 200.1, math.inf, 10),
        (steady, None, 200.1, speeds[3] ** 2, 3),
        (dipping, None, 20.1, math.inf, 6),
        (narrow, None, 11.0, math.inf, -3),
        (narrow, None, 9.0, math.inf, -4),  # no cycle, and slower than the first with one
        (shrinking, 1e-3, 200.1, math.inf, -10),  # force ~ 1 / w
        (shrinking, 1e3, 200.1, 4.0, 3),  # all 4: the fastest
    ):
        assert next(iter(_forces(cycle, amplitude, frequency, headroom))) == speeds[chosen]
    refused(lambda: _forces(steady, None, 1.9, math.inf), "oscillates at 2 Hz at least")
    refused(
        lambda: _forces(lambda w: steady(w) if w < 2.0 else Chattering(), None, 1.9, math.inf),
        "2 Hz at least",
    )
    refused(lambda: _forces(steady, None, 9.0, 1e-3))


def test_size_and_speed_are_those_of_the_largest_forces_within_both_bounds(refused):
    """Cycles that are faster at larger sizes, so that the fastest speed by its cycle at size 1 is
    out of reach.

    The truth is a search over all sizes at each speed.
    """
    sizes = np.geomspace(1e-3, 1e3, 60001)
    for power, amplitude, frequency in (
        (0.1, 0.5, 60.0),
        (0.1, 0.05, 60.0),
        (0.5, 2.0, 25.0),
    ):

        def cycle(q, w, power=power):
            return predicted(20.0 * w * q**power, 0.1 * q / w)

        forces = _forces(lambda w: cycle(1.0, w), amplitude, frequency, math.inf)
        size, speed = _largest(cycle, forces, amplitude, frequency, math.inf)
        within = [
            (20.0 * w * sizes**power <= frequency) & (0.1 * sizes / w <= amplitude) for w in SPEEDS
        ]
        best = max(
            sizes[its].max() * w**2 for w, its in zip(SPEEDS, within, strict=True) if its.any()
        )
        assert size * speed**2 == pytest.approx(best, rel=2e-3)
    never = {1.0: 1.0, 0.5: 0.5}
    refused(
        lambda: _largest(lambda q, w: predicted(70.0, 0.1), never, 1.0, 60.0, math.inf),
        "too fast",
    )
    only_slow = {1.0: 1.0, 0.5: 0.5}
    found = _largest(lambda q, w: predicted(61.0 * w, 0.1 * q), only_slow, 1.0, 60.0, math.inf)
    assert found == (pytest.approx(10.0, rel=1e-3), 0.5)
