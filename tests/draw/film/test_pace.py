"""Playback speed: slow where things move fast and at blows, faster where they rest, real time where
asked.
"""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.sketch import failed, made

import smc_mujoco as smc
from smc_mujoco.draw import states, timed_events
from smc_mujoco.draw.film import pace

pytestmark = pytest.mark.quick

FPS = 30.0


@pytest.fixture(scope="module")
def base() -> smc.Trace:
    return smc.run(smc.Scenario(plant="duffing", law="none", duration=4.0))


def moving(base: smc.Trace, x) -> smc.Trace:
    """The trace with another motion, a function of time."""
    return dataclasses.replace(base, x=np.asarray(x(base.t))[:, None])


def at(trace_s, times) -> list[float]:
    """The playback speeds at times."""
    if isinstance(trace_s, list):
        traces = trace_s
    else:
        traces = [trace_s]
    film_clock = pace.clock(traces, FPS)
    return [
        float(film_clock.speeds[np.searchsorted(film_clock.times, t + 1e-9, side="right") - 1])
        for t in times
    ]


def test_a_number_is_the_speed_of_the_whole_film(base):
    real = pace.clock([base], FPS, 1.0)
    np.testing.assert_allclose(real.times, np.arange(121) / 30)
    half = pace.clock([base], FPS, 0.5)
    assert len(half.times) == 241
    assert np.diff(half.times) == pytest.approx(1 / 60)
    assert (half.speeds == 0.5).all()


def test_a_jump_of_position_is_slow_and_a_rest_fast(base):
    """1 m in 0.1 s is a third of the range a frame; 2 s of rest are shown four times as fast,
    except at its ends.
    """
    trace = moving(base, lambda t: np.clip((t - 2.0) / 0.1, 0.0, 1.0))
    assert at(trace, (0.5, 1.8, 2.05, 2.3, 3.0)) == [4.0, 1.0, 0.125, 1.0, 4.0]
    film_clock = pace.clock([trace], FPS)
    # a frame lasts as long as its speed says, but for the last
    np.testing.assert_allclose((np.diff(film_clock.times) * FPS)[:-1], film_clock.speeds[:-2])


@pytest.mark.parametrize(
    ("seconds", "speed"),
    [
        (3.0, 1.0),
        (1.2, 0.5),
        (0.5, 0.25),
        (0.3, 0.125),
    ],
)
def test_a_thing_takes_fifty_frames_or_more_to_cross_its_range(base, seconds, speed):
    trace = moving(base, lambda t: np.clip(t / seconds, 0.0, 1.0))
    assert at(trace, (0.1,)) == [speed]
    assert speed / (seconds * FPS) <= pace.MAX_TRAVEL < 2 * speed / (seconds * FPS) or speed == 1.0


def test_films_have_a_longest_duration(base, monkeypatch):
    # more than a fifth of its range a frame, all the time
    trace = moving(base, lambda t: np.sin(20.0 * t))
    film_clock = pace.clock([trace], FPS)
    assert 4.0 < len(film_clock.times) / FPS <= 8.1
    assert set(film_clock.speeds) == {0.5}
    monkeypatch.setattr(pace, "MAX_LENGTH", (1.5, 2.0))
    assert set(pace.clock([trace], FPS).speeds) == {1.0}


def test_impacts_are_slowest(monkeypatch):
    trace = smc.run(
        smc.Scenario(
            plant="duffing",
            law=smc.law("observer_free"),
            contact="stops",
            v0=3.0,
            duration=1.0,
        )
    )
    touch = trace.t[states.in_contact(trace)[:, 0]]
    first = float(touch[0])
    assert pace.impacts([trace])[0] == pytest.approx(first)
    assert at(trace, (first,)) == [0.125]
    monkeypatch.setattr(states, "in_contact", lambda trace: np.zeros(trace.x.shape, bool))
    assert at(trace, (first,)) == [0.25]


def test_frames_whose_middle_is_near_that_of_a_push_are_slowest(base, monkeypatch):
    monkeypatch.setattr(timed_events, "pushes", lambda runs: [SimpleNamespace(time=2.0, width=0.1)])
    grid, grid_speeds = pace.speeds([moving(base, np.zeros_like)], FPS)
    # of middles 2.017, 2.05 and 2.083 s
    assert (FPS * grid[grid_speeds == 0.125]).round().tolist() == [60, 61, 62]


def test_a_diverged_run_does_not_make_the_others_rest(base):
    good = moving(base, lambda t: np.clip(t / 0.3, 0.0, 1.0))
    bad = failed(dataclasses.replace(base, x=np.exp(40.0 * base.t)[:, None]), 2000)
    assert at([good, bad], (0.1,)) == [0.125]
    assert len(pace.clock([bad], FPS).times) > 10


CLOSE = {  # what runs do -> their motion over time, parts, and whether a close-up follows
    "a relay behind lags": (lambda t: 2e-4 * np.sin(TURN * t), {}, True),
    "a rattling backlash": (
        lambda t: 0.4 * np.exp(-9.0 * t) + 2e-4 * np.sin(TURN * t),
        {"actuator": smc.Backlash(0.01)},
        True,
    ),
    "motion that is seen": (lambda t: 0.2 * np.sin(TURN * t), {}, False),
    "rest": (lambda t: 0.0 * t, {}, False),
    "chatter below the floor": (lambda t: 2e-5 * np.sin(TURN * t), {}, False),
}
TURN = 2.0 * np.pi * 20.0  # rad/s


@pytest.mark.parametrize("kind", CLOSE)
def test_where_nothing_is_seen_to_move_the_last_three_periods_follow_slowly_and_large(kind):
    x, parts, follows = CLOSE[kind]
    trace = made(smc.Scenario(plant="duffing", law=smc.law("classical"), duration=2.0, **parts))
    place = x(trace.t)[:, None]
    run = dataclasses.replace(trace, x=place, s=20.0 * place, u=np.sign(place), r=0.0 * place)
    film_clock = pace.clock([run], FPS)
    assert (film_clock.close is not None) is follows
    if not film_clock.close:
        return
    span = film_clock.times[-1] - film_clock.close.times[0]
    assert span == pytest.approx(3 / 20.0, rel=0.1)
    size = float(pace.visible_sizes(run.scenario)[0])
    assert 0.3 * size < 2e-4 * film_clock.close.factor <= size
    assert len(film_clock.close.times) / FPS == pytest.approx(3.0, rel=0.5)
    assert not film_clock.part(0.0, 1.0).close
