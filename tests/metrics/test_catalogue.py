"""Every metric on signals with known values, against python-control, and under invariances."""

import dataclasses
import gc
import math
import weakref
from types import SimpleNamespace

import control
import numpy as np
import pytest
from helpers.sketch import made
from hypothesis import given, settings
from hypothesis import strategies as st

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.plant import Plant, plant
from smc_mujoco.metrics import catalogue as m
from smc_mujoco.metrics import conventions, fold, limit_cycle
from smc_mujoco.metrics.conventions import group_trace, groups, scale, turns
from smc_mujoco.simulation.trace import Trace

pytestmark = pytest.mark.quick

CYCLE = {"chattering_amplitude", "chattering_frequency"}
SYNC = {"mean_settling_time", "spread_settling_time", "spread_bound"}


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A trace's fields, without a simulator."""

    t: np.ndarray
    x: np.ndarray
    v: np.ndarray
    u: np.ndarray
    applied: np.ndarray
    s: np.ndarray
    d: np.ndarray
    r: np.ndarray
    force: np.ndarray
    reaction: np.ndarray
    scenario: SimpleNamespace
    held: None = None
    damping: None = None
    compensation: None = None
    tension: None = None
    diverged_at: float | None = None
    failure: str | None = None
    plant_diverged = Trace.plant_diverged
    arrays = Trace.arrays
    holding = Trace.holding


def run(
    t,
    x=0.0,
    *,
    r=0.0,
    u=0.0,
    s=0.0,
    v=0.0,
    reaction=0.0,
    units=(),
    free=False,
    noise=0.0,
    period=0.0,
    **fields,
):
    """A Run; a signal may be a scalar, (K+1,) for one channel or (K+1, n).

    Without units all channels are in m; `free` if the second half of them has no actuators.
    """
    t = np.asarray(t, float)
    columns = []
    for a in (x, r, u, s, v, reaction):
        columns.append(np.asarray(a, float))
    columns = [a[:, None] if a.ndim == 1 else a for a in columns]
    n = max(a.shape[1] if a.ndim else 1 for a in columns)
    x, r, u, s, v, reaction = (np.broadcast_to(a, (t.size, n)) for a in columns)
    zero = np.zeros((t.size, n))
    units = units or ("m",) * n
    mixed = dataclasses.replace(
        plant("cart_pole"),
        name="duffing",
        unit=units[0],
        mixed=units,
        n=n,
        underactuated=free,
    )
    scenario = SimpleNamespace(
        plant=mixed,
        efforts=mixed.efforts,
        law=SimpleNamespace(name="classical"),
        noise=SimpleNamespace(position=noise),
        sensor=None,
        encoder=lambda joint: None,
        tracks="position",
        friction=(),
        scored_channels=tuple(range(n)),
        duration=t[-1],
        load_period=period,
    )
    more = {"force": u, "reaction": reaction, "scenario": scenario} | fields
    return Run(
        t=t,
        x=x,
        v=v,
        u=u,
        applied=u,
        s=s,
        d=zero,
        r=r,
        **more,
    )


def clock(duration, h):
    return np.arange(round(duration / h) + 1) * h


def second_order(zeta, omega, t):
    """Unit step response of omega^2 / (p^2 + 2 zeta omega p + omega^2)."""
    system = control.tf([omega**2], [1, 2 * zeta * omega, omega**2])
    return control.step_response(system, t).y[0, 0]


# Runs of a few samples, by hand

# of the reference
STEP = [9, 9, 13, 13, 13]
PULSE = [
    0,
    2,
    2,
    2,
    0,
    0,
    0,
]
# r turns back at 0.4 s, and after a rest at 0.8 s
TURNS = np.array([0, 1, 2, 3, 4, 3, 2, 1, 1, 2, 3])
OFF = [0, 9, 9, 9, 9, -5, 9, 9, 9, 3, 9]
# the time for which friction held: two slips in the last part, one before, and two stops
SLIPPING = np.array([0, 1, 0, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 1, 0.5, 0, 0.0])[:, None]
LAST = np.zeros((11, 2))
# the last part is t = 8, 9, 10
LAST[8:] = (
    [-1, 2],
    [-2, -2],
    [
        -3,
        0,
    ],
)
UNEVEN = {
    "t": [0, 1, 3],
    "x": [[3, -1], [1, 0], [0, 0]],
}
STOPS = np.array([1, 0, 1, 0, 0, 1, 0, 0])  # a speed: at rest from sample 3 to 4, and from 6 to 7
BOTH = np.column_stack([STOPS, np.ones(8)])
LONG = clock(10, 1e-2)
STOPPED = np.where(LONG < 2, 1.0, 1e-3)
# metric, its value, of a run with these signals, at t = 0, 1, 2, ... s if t is not given
BY_HAND = [
    (
        m.settling_time,
        4.0,
        {"x": [1, 0, 0, 0.5, 0, 0]},
        "the last exit counts, not the first entry",
    ),
    (
        m.settling_time,
        4.0,
        {"t": np.arange(7, 13), "x": [1, 0, 0, 0.5, 0, 0]},
        "time counts from the first sample",
    ),
    (m.settling_time, 1.0, {"x": [100, 2, -2]}, "the band is closed"),
    (m.settling_time, 2.0, {"x": [100, 2.01, -2]}, "the band is two percent of the scale"),
    (m.settling_time, math.inf, {"x": [1, 0, 0, 0.03]}, "never, if the last sample is outside"),
    (m.settling_time, 0.0, {"x": [0, 0, 0]}, "at once, if none is outside"),
    (
        m.settling_time,
        3.0,
        {"x": np.array([[10, 10, 0, 0, 0], [1, 1, 1, 0.1, 0]]).T},
        "slowest of all in one band",
    ),
    (
        m.settling_time,
        3.0,
        {"x": [9, 9, 9, 12.93, 13], "r": STEP},
        "the scale of a start on r is its range",
    ),
    (m.settling_time, 2.0, {"x": [0, 0.03, 0.02, 0, 0]}, "and 1 where r does not move"),
    (m.overshoot, 0.0, {"x": [1, 3, 1, 0]}, "further away on the near side is none"),
    (m.overshoot, 10.0, {"x": [1, 3, -0.1, 0]}, "the far side counts"),
    (
        m.overshoot,
        0.0,
        {"x": [0, 0, 0, -0.5, 2, 2], "r": [0, 0, 2, 2, 2, 2]},
        "an inverse response is none",
    ),
    (m.overshoot, 0.0, {"x": [0, 0, 2, 2, 2, 1, 0], "r": PULSE}, "the way back of a pulse is none"),
    (m.overshoot, 25.0, {"x": [0, 0, 2, 2, 2, -0.5, 0], "r": PULSE}, "beyond the end of a pulse"),
    (
        m.overshoot,
        15.0,
        {"x": np.array([[2, 1, 0, 0], [0, 0.3, 0, 0]]).T},
        "above, for a channel that begins on r",
    ),
    (m.peak, 3.0, {"x": [0, -3, 2], "r": 2.0}, "of x, not of e"),
    (m.steady_error, 2.0, {"x": LAST}, "each channel has its own sign"),
    (m.ripple, 4.0, {"x": LAST}, "the channel with the largest range"),
    (m.ultimate_bound, 3.0, {"x": LAST}, "of either sign"),
    (m.rest_share, 0.25, {"x": [12, 99, 0, 0, 0, 0, 0, 0, 1, -3, 2]}, "of the start"),
    (m.iae, 4 / 2 + 1 + 0.5, UNEVEN, "trapezoids, summed over channels"),
    (m.ise, 10 / 2 + 1 + 0.5, UNEVEN, "trapezoids of squares"),
    (m.itae, 1 / 2 + 1, UNEVEN, "trapezoids of t |e|"),
    (m.itae, 1 / 2 + 1, UNEVEN | {"t": [5, 6, 8]}, "of the time since the first sample"),
    # the command at the last sample is held for no time
    (
        m.energy,
        (1 + 4) * 1 + 9 * 2,
        {"t": [0, 1, 3], "u": [[1, 2], [3, 0], [100, 100]]},
        "of the held command",
    ),
    (
        m.tv_rate,
        81 - 64,
        {"u": np.arange(10) ** 2},
        "from 7.2 s on, so between the last two samples",
    ),
    (m.reaching_time, 4.0, {"s": [1, 0, 0, -0.5, 0, 0]}, "the last entry of s counts"),
    (m.reaching_time, 3.0, {"s": [1, 9, 0.1, 0.01, 0]}, "against the start, not the later 9"),
    (
        m.reaching_time,
        3.0,
        {"s": np.array([[10, 0, 0, 0, 0], [1, 1, 0.3, 0.2, 0]]).T},
        "against the largest start",
    ),
    (
        m.reaching_time,
        3.0,
        {"s": [0, 1, 0.5, 0.01, 0]},
        "against the largest |s|, from a start on the surface",
    ),
    (
        m.stick_time,
        2.0,
        {"v": STOPS, "reaction": 1.0},
        "an instant of rest is no time, and stretches add up",
    ),
    (m.stick_time, 2.0, {"v": BOTH, "reaction": 1.0}, "the channel that sticks longest"),
    (
        m.stick_time,
        0.0,
        {"v": BOTH, "reaction": np.column_stack([0 * STOPS, STOPS])},
        "with its own reaction",
    ),
    (
        m.stick_time,
        1.0,
        {"v": STOPS, "reaction": [0, 0, 0, 0, 0, 0, 0, 5]},
        "of the step that ends at the sample",
    ),
    (
        m.stick_time,
        10.0,
        {"t": LONG, "v": 0.9e-5, "reaction": 1.0},
        "it never moved: |v| <= 1e-5",
    ),
    (
        m.stick_time,
        0.0,
        {"t": LONG, "v": 1.1e-5, "reaction": 1.0},
        "it crept for long",
    ),
    (
        m.stick_time,
        8.0,
        {"t": LONG, "v": STOPPED, "reaction": 1.0},
        "0.1 % of the largest speed is rest",
    ),
    (m.slip_rate, 2 / 4, {"t": np.arange(21), "held": SLIPPING}, "from 16 s on, and no stop"),
    (m.slip_rate, 0.0, {"t": np.arange(21), "held": 0 * SLIPPING}, "what never sticks"),
    (
        m.reversal_error,
        5.0,
        {"t": 0.1 * np.arange(11), "r": TURNS, "x": TURNS + OFF},
        "in the sample after a turn, in neither sample beside it, and after a rest",
    ),
    (m.reversal_error, 0.0, {"x": [0, 1, 2, 3], "r": [0, 1, 1, 2]}, "a rest is no turn"),
    (
        m.stick_time,
        0.0,
        {
            "t": LONG,
            "v": np.where(LONG < 2, 1.0, 1.01e-3),
            "reaction": 1.0,
        },
        "more is not",
    ),
    (
        m.peak_reaction,
        7.0,
        {"reaction": [[1, 0], [0, -7], [2, 2]]},
        "of either sign and any channel",
    ),
    (m.spread_settling_time, 0.0, {"x": np.ones((3, 3))}, "channels in step have no spread"),
    (m.mean_settling_time, 0.0, {"x": [[1, -1]] * 3}, "opposite channels have no mean"),
]


@pytest.mark.parametrize(
    ("metric", "value", "signals", "words"), BY_HAND, ids=[row[-1] for row in BY_HAND]
)
def test_a_few_samples_have_the_value_that_a_hand_finds(metric, value, signals, words):
    samples = max(np.shape(signal)[0] for signal in signals.values() if np.shape(signal))
    assert metric(run(**{"t": np.arange(samples)} | signals)) == pytest.approx(value, rel=1e-12), (
        words
    )


# Settling, rise, overshoot


def test_a_slowly_moving_reference_is_one_approach():
    t = clock(10, 1e-3)
    r = np.sin(t)
    tracking = run(t, r + np.exp(-t) * np.cos(3 * t), r=r)
    regulating = run(t, np.exp(-t) * np.cos(3 * t))
    assert scale(tracking) == pytest.approx(2.0, rel=1e-6)  # the range of r exceeds |e(0)| = 1
    assert 2.0 * m.overshoot(tracking) == pytest.approx(m.overshoot(regulating), rel=1e-6)


def test_rise_time_of_an_exponential_is_ln_9_time_constants():
    tau = 0.3
    h = 1e-4
    t = clock(5, h)
    assert m.rise_time(run(t, 2 * np.exp(-t / tau))) == pytest.approx(tau * math.log(9), abs=h)
    late = np.where(t < 1, 0, 1.0)
    x = np.where(t < 1, 0, 1 - np.exp(-(t - 1) / tau))
    assert m.rise_time(run(t, x, r=late)) == pytest.approx(tau * math.log(9), abs=h)


def test_rise_time_is_that_of_the_slowest_channel_and_inf_if_one_never_rises():
    t = clock(5, 1e-3)
    fast = np.exp(-t / 0.1)
    slow = np.exp(-t / 0.4)
    still = np.zeros(t.size)
    three = run(t, np.column_stack([fast, slow, still]))
    assert m.rise_time(three) == m.rise_time(run(t, slow))
    assert m.rise_time(run(t, np.column_stack([fast, np.full(t.size, 0.2)]))) == math.inf
    assert m.rise_time(run(t)) == 0.0


def tone(t, hertz, size=1.0):
    return size * np.sin(2 * np.pi * hertz * (t - t[0]))


def alternating(t):
    return (-1.0) ** np.arange(t.size)


SECOND = clock(1, 1e-3)
ODD = np.arange(1002) / 1001
HF_SHARES = [  # share of the power, u over t, and why
    (
        0.1,
        SECOND,
        lambda t: 7.0 + tone(t, 20, 3.0) + tone(t, 120),
        "two sines have their shares, whatever the mean",
    ),
    (1.0, SECOND, lambda t: tone(t, 51), "all is above 50 Hz"),
    (0.0, SECOND, lambda t: tone(t, 50), "50 Hz itself is not"),
    (
        0.0,
        1000.1 + clock(0.3, 1e-3),
        lambda t: tone(t, 50),
        "where 15 periods over the time are 50 + 6e-12 Hz",
    ),
    (
        1 / 2,
        ODD,
        lambda t: tone(t, 500) + tone(t, 10),
        "the highest frequency of an odd number of samples counts",
    ),
    (
        0.1,
        SECOND,
        lambda t: np.column_stack([tone(t, 10, 3.0), tone(t, 100)]),
        "channels are pooled",
    ),
    (0.0, SECOND, lambda t: np.full(t.size, 0.1), "a constant has none"),
    (0.0, SECOND, lambda t: 3.0 + tone(t, 100, 1.2e-12), "nor has rounding, of a range of 0.8e-12"),
    (1.0, SECOND, lambda t: 3.0 + tone(t, 100, 1.8e-12), "a range of 1.2e-12 is more"),
]


@pytest.mark.parametrize(
    ("share", "t", "u", "words"), HF_SHARES, ids=[row[-1] for row in HF_SHARES]
)
def test_hf_share(share, t, u, words):
    assert m.hf_share(run(t, u=u(t))) == pytest.approx(
        share, abs=0.01 if "1.2e-12" in words else 1e-9
    )


# The sliding variable and the network


def test_network_settles_in_mean_and_spread_separately():
    t = clock(10, 1e-3)
    mean = np.exp(-t / 0.5)
    half = np.exp(-t / 0.1)
    x = np.column_stack([mean + half, mean, mean - half])  # scale 2
    trace = run(t, x)
    assert m.mean_settling_time(trace) == pytest.approx(0.5 * math.log(25), abs=1e-3)
    assert m.spread_settling_time(trace) == pytest.approx(0.1 * math.log(50), abs=1e-3)
    assert m.spread_bound(trace) == pytest.approx(2 * math.exp(-80))
    assert m.spread_bound(run(t, np.column_stack([t, -t]))) == pytest.approx(20)


def test_the_sample_at_which_a_part_begins_belongs_to_it():
    """Also where rounding puts it a little before."""
    t = 0.007 * np.arange(21)
    pulses = np.eye(21)
    assert [m.rms_error(run(t, pulses[k])) for k in (4, 5)] == [0.0, 0.25]
    assert [m.ultimate_bound(run(t, pulses[k])) for k in (15, 16)] == [0.0, 1.0]


@pytest.mark.parametrize("frequency", [1.0, 2.5, 20.0])
def test_a_limit_cycle_reverses_twice_a_period(frequency):
    t = clock(10, 1e-3)
    wave = np.sin(2 * np.pi * frequency * t + 0.3)
    # the last part, 2 s, may cut off a turn at either end
    assert m.reversal_rate(run(t, 0.3 + 0.01 * wave)) == pytest.approx(2 * frequency, abs=1.0)
    slips = np.clip(3 * wave, -1, 1)  # rests at its ends, as in stick-slip
    assert m.reversal_rate(run(t, slips)) == pytest.approx(2 * frequency, abs=1.0)


def test_small_teeth_on_a_cycle_are_no_reversals_and_large_ones_are():
    t = clock(10, 1e-3)
    slow = np.cos(2 * np.pi * t)
    teeth = np.where(np.arange(t.size) % 2, 1.0, -1.0)
    assert m.reversal_rate(run(t, slow + 0.2 * teeth)) == m.reversal_rate(run(t, slow))
    assert m.reversal_rate(run(t, teeth)) == pytest.approx(1000.0, abs=1.0)


def test_a_way_back_that_ends_the_run_is_a_reversal():
    assert turns(np.array([0.0, 1.0, 0.5, 0.2]), 0.0) == 1
    assert turns(np.array([0.0, 0.3, 1.0]), 0.0) == 0
    assert turns(np.array([0.0, 1.0, 0.5, 1.0]), 0.0) == 2  # by half of its range


def test_what_creeps_or_decays_does_not_hunt():
    t = clock(10, 1e-3)
    for x in (np.exp(-t), 0.45e-6 * np.sin(20 * t) + (t < 1), 0.2 + 0.01 * t, np.ones(t.size)):
        assert m.reversal_rate(run(t, x)) == 0.0
    # its ripple is above 1e-6 of the scale
    assert m.reversal_rate(run(t, 0.55e-6 * np.sin(20 * t) + (t < 1))) > 5.0


def test_reversals_are_those_of_the_channel_that_hunts_fastest():
    t = clock(10, 1e-3)
    x = np.column_stack([np.sin(2 * np.pi * t), 1e-3 * np.sin(2 * np.pi * 7 * t), 0 * t])
    assert m.reversal_rate(run(t, x)) == pytest.approx(14.0, abs=1.0)


# Against python-control


@pytest.mark.parametrize(
    ("zeta", "omega"),
    [
        (0.1, 5.0),
        (0.3, 1.0),
        (0.7, 5.0),
        (0.9, 5.0),
        (1.0, 5.0),
        (1.5, 5.0),
    ],
)
def test_step_response_agrees_with_python_control(zeta, omega):
    h = 1e-3
    t = clock(60 / omega, h)
    y = second_order(zeta, omega, t)
    info = control.step_info(y, t, final_output=1.0)
    trace = run(t, y, r=1.0)
    assert m.settling_time(trace) == pytest.approx(info["SettlingTime"], abs=1.01 * h)
    assert m.rise_time(trace) == pytest.approx(info["RiseTime"], abs=1.01 * h)
    assert m.overshoot(trace) == pytest.approx(info["Overshoot"], abs=1e-9)
    assert m.peak(trace) == pytest.approx(info["Peak"], rel=1e-12)


# The catalogue, score and refusals


def test_score_has_every_metric_and_the_sync_metrics_for_networks_only():
    t = clock(1, 1e-2)
    names = [metric.name for metric in m.metrics()]
    assert list(m.score(run(t, np.cos(t)))) == [name for name in names if name not in SYNC]
    network = run(
        t, np.column_stack([np.cos(t), np.sin(t)]), u=np.column_stack([np.sin(90 * t), t]), s=0.5
    )
    assert list(m.score(network)) == names
    assert m.score(network) == {name: getattr(m, name)(network) for name in names}
    for value in m.score(network).values():
        assert type(value) is float


def cart_and_pole():
    """A cart that settles at 0.2 s from 1 m, its pole at 0.4 s from 0.1 rad."""
    x = np.array([[1.0, 0.5, 0.0, 0.0, 0.0], [0.1, -0.05, 0.01, 0.0015, 0.001]]).T
    u = np.array([[3.0, -1.0, 0.0, 0.0, 0.0], [0.0] * 5]).T
    t = np.arange(5) / 10
    return run(
        t,
        x,
        u=u,
        v=np.gradient(x, t, axis=0),
        reaction=[[0.5, 0.2]] * 5,
        units=("m", "rad"),
        free=True,
    )


def test_driven_channels_and_free_joints_are_scored_as_if_each_were_alone():
    trace = cart_and_pole()
    alone = []
    for i in (0, 1):
        columns = {}
        for name in ("x", "v", "u", "s", "r", "reaction"):
            columns[name] = getattr(trace, name)[:, [i]]
        alone.append(
            m.score(
                run(
                    trace.t,
                    columns.pop("x"),
                    units=("m", "rad")[i : i + 1],
                    **columns,
                )
            )
        )
    scores = m.scores(trace)
    assert list(scores) == ["driven", "free"]
    assert scores["driven"] == alone[0]
    commanded = []
    for metric in m.metrics():
        if metric.command:
            commanded.append(metric.name)
    assert scores["free"] == {
        name: value for name, value in alone[1].items() if name not in commanded
    }
    assert scores["driven"]["settling_time"] == 0.2
    assert scores["free"]["settling_time"] == 0.3
    assert scores["driven"]["overshoot"] == 0.0
    assert scores["free"]["overshoot"] == pytest.approx(50.0)


def test_what_u_or_s_changes_is_of_the_command():
    t = clock(1, 1e-3)
    still = {
        "t": t,
        "x": np.cos(t),
        "force": np.zeros((t.size, 1)),
    }
    scores = m.score(
        run(**still, u=np.sin(600 * t) * (2 - t), s=np.exp(-9 * t) + 0.01 * np.sin(60 * t))
    )
    changed = set()
    for name, value in m.score(run(**still)).items():
        if value != scores[name]:
            changed.add(name)
    assert changed == {metric.name for metric in m.metrics() if metric.command}


def test_trends_are_of_the_metrics_of_the_last_part_alone():
    """These do not feel what is before it, as limit cycles and reversals do not."""
    t = clock(10, 1e-3)
    early = ((t > 0.0) & (t < 5.0)) * 1.0
    x = np.exp(-t)[:, None] * [1.0, 2.0]
    more = early[:, None]
    u = 0.01 * np.sin(9 * t)[:, None] * [1.0, 2.0]
    plain = {
        "x": x,
        "u": u,
        "s": np.exp(-t),
        "v": 0.0,
        "reaction": 1.0 - early,
    }
    felt = plain | {
        "x": x + more * [-3.0, 4.0],
        "u": u + more * alternating(t)[:, None],
        "v": early,
    }
    felt |= {"s": np.exp(-t) + early, "reaction": 1.0 + early}
    of_plain, of_felt = (m.score(run(t, **signals)) for signals in (plain, felt))
    same = {name for name in of_plain if of_plain[name] == of_felt[name]}
    late = set()
    for metric in m.metrics():
        if metric.late:
            late.add(metric.name)
    assert late == same - {"reversal_rate", "reversal_error"}
    rho = m.trends(run(t, **plain))
    assert rho.keys() == late - {"slip_rate"}  # which is 0
    assert rho["ultimate_bound"] == pytest.approx(math.exp(6.4 - 8.0), rel=0.02)


@pytest.mark.parametrize(
    ("omega", "seconds"),
    [
        (5.0, 2 * 2 * math.pi / 5.0),  # two periods are the least that is as long as a fifth
        (2.2, 2 * math.pi / 2.2),
        (40.0, 13 * 2 * math.pi / 40.0),
    ],
)
def test_under_a_periodic_load_the_last_part_is_whole_periods_and_the_phase_decides_nothing(
    omega, seconds
):
    t = clock(10, 1e-3)
    values = []
    for phase in (0.0, 1.0, 2.5):
        x = np.sin(omega * t + phase)
        swinging = run(t, x, u=x, period=2 * math.pi / omega)
        values.append(m.score(swinging))
        part = t[conventions.last_part(swinging)]
        assert np.ptp(part) == pytest.approx(seconds, abs=2e-3)
        rho = m.trends(swinging)
        for name in ("ultimate_bound", "tv_rate", "ripple"):
            assert rho[name] == pytest.approx(1.0, abs=2e-3)
            assert values[-1][name] == pytest.approx(values[0][name], rel=2e-3)
        assert values[-1]["ultimate_bound"] == pytest.approx(1.0, abs=1e-4)
        assert values[-1]["tv_rate"] == pytest.approx(2 * omega / math.pi, rel=2e-3)


def test_two_periods_and_the_two_before_fit_or_the_last_part_is_a_fifth_without_a_verdict():
    assert fold.late_periods(10.0, 0.0) == 0
    assert fold.late_periods(10.0, 2.0) == 1
    assert fold.late_periods(10.0, 1.99) == 2
    assert fold.late_periods(10.0, 4.25) == 1
    assert fold.late_periods(10.0, 4.26) == fold.late_periods(10.0, math.inf) == 0
    assert fold.judges_last_part(10.0, 0.0)
    assert fold.judges_last_part(10.0, 4.25)
    assert not fold.judges_last_part(10.0, 4.26)
    assert not fold.judges_last_part(10.0, math.inf)
    t = clock(10, 0.1)
    assert conventions.last_part(run(t, period=6.3)) == conventions.last_part(run(t))


def test_a_law_that_drops_the_pole_has_settled_nothing_also_where_both_have_one_unit():
    t = clock(1, 0.1)
    acrobot = run(
        t,
        np.column_stack([np.exp(-9 * t), 5.0 + t]),
        units=("rad", "rad"),
        free=True,
    )
    assert m.scores(acrobot)["driven"]["settling_time"] < 1.0
    assert m.settling_time(acrobot) == m.scores(acrobot)["free"]["settling_time"] == math.inf


def test_a_cart_with_its_pole_is_no_network():
    trace = cart_and_pole()
    assert not SYNC & set(m.score(trace))
    assert not SYNC & set(m.scores(trace)["free"])
    for name in SYNC:
        with pytest.raises(
            ScenarioError, match=f"{name} compares channels and duffing has one of a kind"
        ):
            getattr(m, name)(trace)


def test_carts_with_poles_side_by_side_are_compared_each_with_its_kind():
    trace = run(
        np.arange(2.0),
        np.array([[0.0, 1.0, 0.2, 0.5]] * 2),
        units=("m", "m", "rad", "rad"),
        free=True,
    )
    assert m.spread_bound(trace) == 1.0
    assert m.scores(trace)["free"]["spread_bound"] == pytest.approx(0.3)


def test_driven_channels_in_two_units_have_the_worst_time_and_no_number_in_either_unit():
    t = np.arange(5.0)
    arm = run(
        t,
        np.array([[10, 1, 0, 0, 0], [0.1, 0.1, 0.1, 0, 0], [0.05, 0, 0, 0, 0]]).T,
        units=("m", "rad", "rad"),
    )
    score = m.score(arm)
    ours = m.scores(arm)
    assert list(ours) == ["driven m", "driven rad"]
    assert (
        score["settling_time"]
        == ours["driven rad"]["settling_time"]
        == 3.0
        > ours["driven m"]["settling_time"]
    )
    assert "ultimate_bound" not in score
    assert ours["driven m"]["peak"] == 10.0
    assert ours["driven rad"]["peak"] == 0.1
    assert not SYNC & {*ours["driven m"]}
    assert {*ours["driven rad"]} > SYNC  # a slide and two hinges, which can be compared
    assert score["mean_settling_time"] == ours["driven rad"]["mean_settling_time"]
    for name in ("peak", "itae", "tv", "spread_bound"):
        with pytest.raises(
            ScenarioError, match=rf"{name} has no one value .* in m and rad, .*: use smc.scores"
        ):
            getattr(m, name)(arm)


def test_rest_is_measured_beside_the_largest_speed_of_the_group():
    """A pole at 100 rad/s does not put its cart at 0.05 m/s to rest."""
    v = np.array([[0.05, 100.0]] * 3)
    slow = run(
        np.arange(3.0),
        v=v,
        reaction=1.0,
        units=("m", "rad"),
        free=True,
    )
    assert m.stick_time(slow) == 0.0


def broken():
    t = clock(1, 0.01)
    late = np.where(t > 0.5, np.nan, 0.0)
    yield "diverged at t = 0.3 s", run(t, diverged_at=0.3)
    yield "law raised, at t = 0.3 s", run(t, diverged_at=0.3, failure="law raised, at t = 0.3 s")
    yield "law raised, at t = 0.3 s", run(t, failure="law raised, at t = 0.3 s")
    yield "not finite from t = 0.51 s", run(t, np.where(t > 0.5, np.inf, 0.0))
    for name in ("x", "r", "u", "s", "v", "reaction"):
        yield "not finite from t = 0.51 s", run(t, **{name: late})
    for name in ("d", "applied"):
        yield "not finite from t = 0.51 s", dataclasses.replace(run(t), **{name: late[:, None]})


@pytest.mark.parametrize(("message", "trace"), list(broken()))
def test_a_broken_trace_is_refused_by_score_and_by_every_metric(message, trace):
    for function in (m.score, m.scores, *(getattr(m, metric.name) for metric in m.metrics())):
        with pytest.raises(ScenarioError) as refusal:
            function(trace)
        text = str(refusal.value)
        assert text.startswith("duffing under classical")
        assert message in text
        assert ("correct the law" if "raised" in message else "change the gains") in text
        assert "\n" not in text


@pytest.mark.parametrize("n", [1, 3])
@pytest.mark.parametrize("samples", [1, 2, 3])
def test_a_run_at_rest_scores_zero_however_short(n, samples):
    score = m.score(run(np.arange(samples) * 0.1, np.zeros((samples, n))))
    for name in CYCLE:
        assert math.isnan(score.pop(name))
    assert set(score.values()) == {0.0}


def test_a_run_of_one_step_by_hand():
    scores = m.score(
        run(
            [0, 0.5],
            [2.0, -1.0],
            u=[3.0, -1.0],
            s=[1.0, 0.5],
        )
    )
    assert {name: None if math.isnan(value) else value for name, value in scores.items()} == {
        "settling_time": math.inf,
        "rise_time": 0.0,  # 10 % and 90 % at the same sample
        "overshoot": 50.0,
        "peak": 2.0,
        "steady_error": 1.0,
        "ultimate_bound": 1.0,
        "rest_share": 0.5,
        "ripple": 0.0,
        "rms_error": 1.0,  # of the last sample alone
        "ise": 0.5 * (4 + 1) / 2,
        "iae": 0.5 * (2 + 1) / 2,
        "itae": 0.5 * (0 + 0.5) / 2,
        "reaching_time": math.inf,
        "max_u": 3.0,
        "max_step": 4.0,
        "tv": 4.0,
        "tv_rate": 0.0,
        "energy": 4.5,
        "hf_share": 0.0,
        "chattering_amplitude": None,  # no limit cycle
        "chattering_frequency": None,
        "stick_time": 0.0,
        "slip_rate": 0.0,
        "reversal_error": 0.0,
        "peak_reaction": 0.0,
        "reversal_rate": 0.0,
    }


def test_the_limit_cycle_of_the_worst_channel_is_scored_and_its_absence_is_nan():
    t = np.arange(2001) / 100
    fast = 0.01 * np.sin(math.tau * 20.3 * t)
    large = 0.1 * np.sin(math.tau * 5.1 * t)
    three = run(t, np.zeros((len(t), 3)), s=np.column_stack([fast, large, np.zeros(len(t))]))
    assert m.chattering_amplitude(three) == pytest.approx(0.1, rel=0.05)
    assert m.chattering_frequency(three) == pytest.approx(5.1, rel=1e-3)
    assert math.isnan(m.chattering_amplitude(run(t, np.cos(t))))


@pytest.mark.usefixtures("present_objects_frozen")
def test_scoring_keeps_no_trace_and_looks_once_in_each_group(monkeypatch):
    t = np.arange(2001) / 100
    looks = []
    trace = run(
        t,
        np.zeros((len(t), 2)),
        s=np.sin(60 * t)[:, None] * np.ones(2),
        units=("m", "rad"),
    )
    monkeypatch.setattr(
        limit_cycle,
        "largest_of",
        lambda t, s: looks.append(s.shape) or (0.1, 10.0),
    )
    m.scores(trace)
    m.score(trace)
    assert len(looks) == 4  # two groups, scored twice
    reference = weakref.ref(trace)
    del trace
    gc.collect()
    assert reference() is None


# Invariances

WHOLE = st.integers(-1000, 1000)


@st.composite
def random_runs(draw):
    """Whole-number signals, so that scaling by a power of two and adding an offset are exact."""
    n = draw(st.integers(1, 4))
    samples = draw(st.integers(2, 30))
    block = st.lists(
        st.lists(WHOLE, min_size=n, max_size=n), min_size=samples, max_size=samples
    ).map(np.array)
    x = draw(block)
    u = draw(block)
    s = draw(block)
    r = np.where(np.arange(samples)[:, None] < draw(st.integers(0, samples)), 0, draw(WHOLE))
    if draw(st.booleans()):
        x[-max(1, samples // 2) :] = r[-1]  # settles
    more = {"v": draw(block), "reaction": draw(block)}
    return run(
        np.arange(samples) * 0.25,
        x,
        r=np.broadcast_to(r, x.shape),
        u=u,
        s=s,
        **more,
    )


@settings(max_examples=40)
@given(random_runs())
def test_metrics_respect_their_orders(trace):
    scores = m.score(trace)
    assert scores["steady_error"] <= scores["ultimate_bound"] * (1 + 1e-12)
    assert scores["ripple"] <= 2 * scores["ultimate_bound"]
    assert scores["max_step"] <= min(scores["tv"], 2 * scores["max_u"])
    assert 0 <= scores["hf_share"] <= 1
    for value in scores.values():
        assert value >= 0 or math.isnan(value)
    if trace.x.shape[1] > 1:
        assert scores["mean_settling_time"] <= scores["settling_time"]
        assert scores["spread_bound"] <= 2 * scores["ultimate_bound"]


TRAVELS = [  # a reference r(t) over 10 s, and whether it travels
    (lambda t: 100.0 * t, True),
    (lambda t: -0.01 * t, True),
    (lambda t: np.maximum(t - 2.0, 0.0), True),  # a ramp that begins later
    (lambda t: np.minimum(t, 2.0), False),  # and one that ends
    (lambda t: np.where(t < 5.0, 0.0, 1.0), False),
    (lambda t: np.sin(0.05 * t), False),
    (lambda t: 0.0 * t, False),
]


@pytest.mark.parametrize(("reference", "travels"), TRAVELS)
def test_a_speed_loop_is_never_settled_by_its_position_and_arrives_by_its_speed(reference, travels):
    """A loop that follows r with a lag of 0.2 s, and one that rests where r begins."""
    t = np.linspace(0.0, 10.0, 1001)
    r = reference(t)
    speed = np.gradient(r, t)
    following = run(
        t,
        r - 0.2 * speed,
        r=r[:, None],
        v=speed,
    )
    assert math.isnan(m.settling_time(following)) == travels
    assert m.arrived(following)
    if travels:
        resting = run(
            t,
            np.full(1001, r[0]),
            r=r[:, None],
            v=np.zeros(1001),
        )
        assert not m.arrived(resting)
        assert math.isnan(m.settling_time(resting))


@pytest.mark.parametrize(
    ("ending", "noise", "there"),
    [
        (0.0, 0.0, True),
        (0.149, 0.0, True),
        (0.151, 0.0, False),
        (-0.151, 0.0, False),
        (0.3, 0.1, True),
        (0.6, 0.1, False),
        (math.pi, 0.0, False),  # a pendulum that hangs
    ],
)
def test_a_run_has_arrived_within_ten_percent_of_its_start_or_five_sigma(ending, noise, there):
    t = np.linspace(0.0, 10.0, 101)
    assert m.arrived(run(t, np.where(t < 5.0, 1.5, ending), noise=noise)) is there


@pytest.mark.parametrize(("noise", "apart"), [(1e-3, 5e-3), (1e-2, 1e-2)])
def test_a_sensor_tells_apart_its_noise_or_half_a_count(noise, apart):
    sensed = smc.Scenario(
        plant="duffing", law="none", sensor=smc.Encoder(counts=100), noise=smc.Noise(noise)
    )
    (driven,) = groups(sensed)
    assert conventions.resolution(sensed, driven) == pytest.approx(apart)


@pytest.mark.parametrize("plant", ["inverted_pendulum", "van_der_pol", "cart_pole", "quadrotor"])
def test_without_a_law_no_plant_that_falls_or_swings_has_arrived(plant):
    assert not m.arrived(smc.run(smc.Scenario(plant=plant, law="none", duration=3.0)))


@pytest.mark.parametrize(
    ("sigma", "start", "settles"),
    [
        (0.0, 0.1, False),  # the rest, .003, is above 2 %
        (1e-3, 0.1, False),  # and far from the noise
        (1e-3, 0.0101, True),  # 55 of 10,000 runs missed their goal so, by less than the noise
        (1e-3, 0.0149, True),
        (1e-3, 0.0151, False),
    ],
)
def test_a_run_that_starts_near_the_noise_settles_within_five_of_its_deviations(
    sigma, start, settles
):
    run = smc.Scenario(plant="duffing", law="none", x0=start, duration=1.0, noise=smc.Noise(sigma))
    t = np.linspace(0.0, 1.0, 1001)
    x = np.where(t < 0.5, start, 0.003)[:, None]
    near = dataclasses.replace(smc.run(run), x=x)
    assert (m.settling_time(near) < math.inf) == settles
    if settles:
        assert m.settling_time(near) == pytest.approx(0.5)


def test_positions_of_a_pose_are_those_whose_distance_is_its_error():
    trace = made(smc.Scenario(plant="quadrotor", law=smc.laws(kind="joint")[0], duration=0.05))
    for group in groups(trace.scenario.plant):
        part = group_trace(trace, group)
        columns = [i for i in group.channels if i in trace.scenario.scored_channels]
        np.testing.assert_allclose(part.x - part.r, trace.e[:, columns], atol=1e-12)


@pytest.mark.quick
def test_a_large_network_is_grouped_with_as_few_looks_at_its_units_as_a_small_one(monkeypatch):
    looks = []
    units = Plant.units.__get__

    def counted(network):
        looks.append(network.n)
        return units(network)

    scenarios = [smc.Scenario(plant=plant("pendulum_network", n=n), law="pid") for n in (2, 6)]
    monkeypatch.setattr(Plant, "units", property(counted))
    assert [len(groups(scenario)) for scenario in scenarios] == [1, 1]
    assert looks.count(6) == looks.count(2)
