"""Properties of laws are compared with what the laws do: what they read, where u jumps, how they
arrive.
"""

import functools
import itertools

import numpy as np
import pytest
from helpers.plants_ab import called, chain, measured, plant_a, rest

import smc_mujoco as smc
from smc_mujoco.control.law import Measurement, law_catalogue, law_function
from smc_mujoco.control.properties import PROPERTIES, reads, searched_gains, suitable

pytestmark = pytest.mark.quick

STEP = 1e-9  # s, control period: short, so that a layer as wide as a step is a jump
JUMP = 4e-3  # of the range of u; the words of the fixed-point law make steps of 1e-3


# what laws read


@functools.cache
def changes(name):
    """The fields of the measurement that change u or memory of a law in any of many states."""
    law = smc.law(name)
    changing = set()
    random = np.random.default_rng(0)
    for _ in range(40):
        numbers = random.normal(size=len(Measurement._fields))
        model, has_surface = random.choice([0.0, 1.0], size=2)
        fixed = {
            "t": abs(numbers[0]),
            "dt": 1e-3,
            "limit": 3.0,
            "model": model,
            "has_surface": has_surface,
            "g": 2.0,
        }
        y = Measurement(*numbers)._replace(**fixed)
        # at the first sample, and later
        memory = np.abs(random.normal(size=law.memory)) * random.choice([0.0, 1.0])
        memory_of_first = memory.copy()
        result = [*called(law, y, memory_of_first), *memory_of_first]
        for field in {*Measurement._fields} - changing:
            for value in (getattr(y, field) + 0.7, -getattr(y, field) - 0.3, 30.0):
                memory_of_second = memory.copy()
                if field != "dt":
                    again = [
                        *called(law, y._replace(**{field: value}), memory_of_second),
                        *memory_of_second,
                    ]
                    if not np.array_equal(again, result, equal_nan=True):
                        changing.add(field)
    return changing


@pytest.mark.slow
def test_a_law_is_changed_by_what_it_reads_and_by_nothing_else():
    for name in smc.laws():
        read = reads(law_catalogue()[name])
        assert changes(name) <= read, name
        assert {"e", "de", "v", "dq", "q", "a", "limit"} & read <= changes(name), name


def test_what_a_law_reads_is_found_through_functions_and_else_is_everything():
    @law_function
    def position_only(y, gains, memory):
        return -y.e * y.g, y.e

    @law_function
    def hands_on(y, gains, memory):
        z = y
        return -z.e, z.e

    assert reads(position_only) == {"e", "g"}
    assert PROPERTIES["no-velocity"].holds(position_only)
    assert reads(hands_on) == set(Measurement._fields)
    # in `sliding` and `command`
    assert {"has_surface", "model", "ddr"} <= reads(law_catalogue()["classical"])


# continuity


def jump(name, model):
    """The largest step of u, as a share of its range, along short dense lines through states where
    laws switch.
    """
    law = smc.law(name)
    random = np.random.default_rng(1)
    slope = next((value for gain, value in law.gains.items() if gain in ("c", "k1")), 2.5)
    on_surface = [(0.4, -0.4 * slope, 0.0), (-0.3, 0.3 * slope, 0.0)]
    centres = [(0.0, 0.0, 0.0), *on_surface, (2.0, 0.0, 0.0), (0.0, 0.5, 0.0), (0.0, -0.5, 0.0)]
    along = np.linspace(-1e-8, 1e-8, 101)
    common = {"limit": 6.0, "model": model, "g": 1.1}
    worst = 0.0
    for centre, fresh in itertools.product(centres, (True, False)):
        memory = np.zeros(law.memory)
        for k in range(20):  # what a run would leave in it
            e, de, a = random.normal(size=3) * 0.3
            if not fresh:
                called(
                    law,
                    measured(
                        e,
                        de,
                        a=a,
                        dt=1e-3,
                        t=1e-3 * k,
                        **common,
                    ),
                    memory,
                )
        called(
            law,
            measured(
                *centre[:2],
                a=centre[2],
                dt=STEP,
                t=7.31,
                **common,
            ),
            memory,
        )
        line = centre + np.outer(along, random.normal(size=3))
        us = [
            called(
                law,
                measured(
                    e,
                    de,
                    a=a,
                    dt=STEP,
                    t=7.31,
                    **common,
                ),
                memory.copy(),
            )[0]
            for e, de, a in line
        ]
        worst = max(worst, np.abs(np.diff(us)).max() / 6.0)
    return worst


@pytest.mark.slow
def test_u_is_continuous_where_a_law_says_so_and_jumps_where_it_does_not():
    for name in smc.laws():
        largest = max(jump(name, model) for model in (0.0, 1.0))
        assert (largest < JUMP) == law_catalogue()[name].continuous, (name, largest)


# finite time


@functools.cache
def arrival(name):
    """From 1, how long s (or e) takes from 0.01 to 0.001, over how long from 0.1 to 0.01: 1 if it
    falls as exp(-t).
    """
    law = smc.law(name)
    template = law_catalogue()[name]
    h = 1e-4 if template.relative_degree == 1 else 5e-4
    ran = plant_a(law, rest, h=h, duration=2.0)
    if template.relative_degree > 1:
        g = 20.0 if template.relative_degree == 3 else 1.0  # as behind a lag of 50 ms
        ran = chain(law, rest, (1.0, 0.0, 0.0)[: template.relative_degree], h, 15.0, g=g)
    values = np.abs(ran.s if template.finite_time == "e" else ran.sigma)
    times = []
    for level in (0.1, 0.01, 0.001):
        times.append(np.flatnonzero(np.append(True, values > level))[-1] * h)
    assert times[-1] < ran.t[-1], times
    if times[1]:
        return (times[2] - times[1]) / (times[1] - times[0])
    return 0.0


def test_laws_with_finite_time_approach_ever_faster():
    slow = {}
    for name, law in law_catalogue().items():
        if law.finite_time and arrival(name) >= 0.6:
            slow[name] = arrival(name)
    assert not slow


def test_laws_that_decay_exponentially_do_not_approach_ever_faster():
    names = (
        "observer_free",
        "observer_free_third",
        "boundary_layer",
        "pid",
        "lqr",
        "computed_torque",
    )
    for name in (*names, "barrier_adaptive"):
        assert arrival(name) > 0.7, name


# choosing


def names(*needs, **options):
    return [law.name for law in suitable(needs, **options)]


def test_an_unknown_property_is_named():
    with pytest.raises(smc.ScenarioError, match="unknown property of a law 'smooth'"):
        suitable(["smooth"])


def test_gains_that_are_held_are_not_counted():
    assert searched_gains(law_catalogue()["super_twisting"]) == ["k1", "k2", "c"]
