"""Signals: their formulas, their statistics, what they refuse, and that what is compiled computes
what is written.
"""

import ctypes
import dataclasses
import gc
import json
import math

import numpy as np
import pytest
from helpers import reference

import smc_mujoco as smc
from smc_mujoco.common.registry import subclasses
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.simulation import cfunctions, scenario_json
from smc_mujoco.simulation.signals import (
    SINUSOIDS,
    BandLimited,
    Constant,
    Dryden,
    Gust,
    Impulse,
    MinimumJerk,
    OrnsteinUhlenbeck,
    PerChannel,
    Pulse,
    Push,
    Ramp,
    Relay,
    Signal,
    Sine,
    Step,
    Wind,
    bounds_of,
)
from smc_mujoco.simulation.time_series import Held, TimeSeries, Waypoints

pytestmark = pytest.mark.quick

FUNCTION = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * 4)
NOISE = BandLimited(0.3, 5.0, 15.0)
UNEVEN = TimeSeries([0.1, 0.2, 0.25, 0.7, 1.3], [1.0, -2.0, 0.5, 0.0, 3.0])
MOVE = MinimumJerk(1.0, 0.2, 0.5)
EVERY = [
    Constant(1.5),
    Sine(0.7, 11.0, 0.3),
    Step(1.5, 0.3),
    Pulse(-2.0, 0.3, 0.2),
    Impulse(0.02, 0.3),
    Gust(2.0, 0.3, 0.7),
    OrnsteinUhlenbeck(0.5, 0.1),
    NOISE,
    UNEVEN,
    Constant(-1.5) + Sine(0.7, 11.0, 0.3) + Step(1.5, 0.3) + Ramp(2.0, 0.3) + MOVE,
    Ramp(2.0, 0.3),
    MOVE,
    Waypoints((0.1, 0.3, 0.7, 1.3), (0.2, 1.0, -0.5, 0.4)),
    Held((0.1, 0.2, 0.7), (1.0, -2.0, 0.5)),
    Relay(
        0.5,
        s=0.3,
        rate=1.0,
        error=-0.2,
        slope=0.1,
    ),
]
# on a body, which not every plant has
BLOW = Push(
    "cart",
    x=2.0,
    z=-1.0,
    time=0.3,
    width=0.2,
)
IN_SPACE = [
    BLOW,
    Wind(
        1.0,
        -2.0,
        time=0.3,
        width=0.4,
    ),
    Dryden(7.0, dt=5e-3),
]
SEEN = 0.3, -0.2, 0.1  # e, e' and s
# what a reference may be
LED = [signal for signal in EVERY if not (signal.random or signal.cartesian or signal.sees)]


def scenario(**fields):
    return smc.Scenario(
        **{"plant": "duffing", "law": smc.law("classical"), "duration": 0.2} | fields
    )


def written(signal, times, seed=3, channel=1, stream=2):
    """Its values and derivatives at some times, (K, 3), by the Python function that it is."""
    memory = np.zeros(max(signal.memory, 1))
    value = type(signal).value
    if signal.random:
        state = (memory, seed, channel, stream)
    else:
        state = (signal.data,) if signal.series else ()
    state = (memory, *SEEN) if signal.sees else state
    return np.array([value(float(t), signal, *state) for t in times])


def compiled(signal, times, seed=3, channel=1, stream=2):
    """The same, by the C function that the callback calls."""
    function = cfunctions.compile_signal(signal)
    call = FUNCTION(function.address)
    inputs = np.array([0.0, seed, channel, stream, *SEEN])
    values = np.array([*cfunctions.signal_values(signal), 0.0])
    memory = np.zeros(max(signal.memory, 1))
    outputs = np.empty(3)
    rows = []
    for t in times:
        inputs[0] = t
        assert call(*(array.ctypes.data for array in (inputs, values, memory, outputs))) == 0
        rows.append(outputs.copy())
    return np.array(rows)


def path(signal, times, **key):
    return written(signal, times, **key)[:, 0]


def test_every_kind_of_the_library_is_tested_here():
    kinds = set()
    for kind in subclasses(Signal):
        if kind.__module__.startswith("smc_mujoco.simulation."):
            kinds.add(kind)
    assert kinds - {PerChannel} == {type(signal) for signal in [*EVERY, *IN_SPACE]}


@pytest.mark.parametrize("signal", [*EVERY, *IN_SPACE], ids=lambda s: type(s).__name__)
def test_the_compiled_function_gives_the_bits_of_the_written_one(signal):
    edges = np.array([0.1, 0.2, 0.25, 0.3, 0.305, 0.5, 0.7, 1.0, 1.3])
    times = np.sort(
        np.concatenate(
            [np.arange(0.0, 1.6, 1e-3), edges, np.nextafter(edges, 2), np.nextafter(edges, 0)]
        )
    )
    np.testing.assert_array_equal(compiled(signal, times), written(signal, times))


def test_bounds_of_a_signal_and_of_its_slope_are_reached_and_not_passed():
    times = np.linspace(0.0, 1.6, 16_001)
    bounded = [(signal, bounds) for signal in EVERY if (bounds := bounds_of(signal))]
    assert {type(signal) for signal, _ in bounded} == {
        Constant,
        Sine,
        Step,
        Pulse,
        MinimumJerk,
        Relay,
    }
    for signal, (bound, slope) in bounded:
        d = path(signal, times)
        steepest = np.abs(np.diff(d)).max() / times[1]
        assert np.abs(d).max() == pytest.approx(bound)
        assert steepest > 1e3 if slope == math.inf else steepest == pytest.approx(slope, rel=1e-3)


@pytest.mark.parametrize("signal", EVERY, ids=lambda s: type(s).__name__)
def test_a_signal_disturbs_alike_in_both_loops(signal):
    disturbed = scenario(
        plant=smc.plant("pendulum_network", n=2), disturbance=[signal, Sine(0.1, 3.0)], duration=0.4
    )
    fast = smc.run(disturbed)
    slow = reference.run(disturbed)
    assert fast.failure is None
    for name in ("x", "v", "u", "d"):
        np.testing.assert_array_equal(getattr(fast, name), getattr(slow, name))


def test_a_time_series_is_followed_alike_in_both_loops():
    fast, slow = (run(scenario(reference=UNEVEN)) for run in (smc.run, reference.run))
    np.testing.assert_array_equal(fast.x, slow.x)
    np.testing.assert_array_equal(fast.r[:, 0], path(UNEVEN, fast.t))


# gusts and blows


def test_a_gust_is_a_smooth_bump():
    gust = Gust(2.0, 0.3, 0.7)
    w = 2 * math.pi / 0.7
    inside = np.linspace(0.3, 1.0, 101)
    np.testing.assert_allclose(path(gust, inside), 1.0 - np.cos(w * (inside - 0.3)), atol=1e-14)
    assert path(gust, [0.65]) == 2.0
    for t in (0.0, 0.2999, 1.0001, 1e9):
        assert written(gust, [t]).tolist() == [[0.0, 0.0, 0.0]]
    assert path(gust, [0.3, 1.0, 0.3001, 0.9999]).max() < 1e-6  # it begins and ends without a kink


@pytest.mark.parametrize(
    ("step", "time"),
    [
        (1e-3, 0.0),
        (5e-4, 0.007),
        (2.5e-4, 1.001),
        (1e-4, 0.123),
    ],
)
def test_an_impulse_has_its_integral_under_every_step(step, time):
    times = np.arange(round(2.0 / step)) * step
    assert path(Impulse(-0.3, time), times).sum() * step == pytest.approx(-0.3, rel=1e-12)


# band-limited noise


def test_band_limited_noise_has_its_variance_over_seeds_and_channels():
    """In 4000 paths: to 3 standard errors of a Gaussian's mean, variance and kurtosis."""
    d = np.array(
        [
            path(
                NOISE,
                [0.37],
                seed=s,
                channel=c,
            )[0]
            for s in range(1000)
            for c in range(4)
        ]
    )
    assert abs(np.mean(d)) < 3 * 0.3 / math.sqrt(4000)
    assert np.mean(d**2) == pytest.approx(0.09, rel=3 * math.sqrt(2 / 4000))
    assert np.mean(d**4) / np.mean(d**2) ** 2 == pytest.approx(
        3.0 - 3.0 / (2 * SINUSOIDS), abs=3 * math.sqrt(24 / 4000)
    )


def test_band_limited_noise_has_no_power_outside_its_band():
    h = 5e-3
    n = 40_000
    window = np.blackman(n)
    power = np.abs(np.fft.rfft(window * path(NOISE, h * np.arange(n)))) ** 2
    f = np.fft.rfftfreq(n, h)
    assert power[(f < 4.9) | (f > 15.1)].sum() < 1e-9 * power.sum()
    quarters = []
    for a in (5.0, 7.5, 10.0, 12.5):
        quarters.append(power[(f >= a) & (f < a + 2.5)].sum() / power.sum())
    np.testing.assert_allclose(quarters, 0.25, atol=0.04)  # a spectral line may sit on a border


def test_a_phase_of_band_limited_noise_does_not_tell_its_frequency():
    memory = np.zeros(NOISE.memory)
    BandLimited.value(0.0, NOISE, memory, 3, 0, 1)
    part = (memory[:SINUSOIDS] / (2 * math.pi) - 5.0) / 10.0 * SINUSOIDS
    assert np.floor(part).tolist() == list(range(SINUSOIDS))
    assert abs(np.corrcoef(part % 1.0, memory[SINUSOIDS:])[0, 1]) < 0.5


def test_band_limited_noise_is_a_function_of_time_alone():
    times = np.random.default_rng(0).uniform(0.0, 10.0, 200)
    alone = [path(NOISE, [t])[0] for t in times]
    np.testing.assert_array_equal(path(NOISE, times), alone)
    common = {"law": "none", "disturbance": NOISE, "control_period": 1e-3}
    coarse, fine = (smc.run(scenario(**common, physics_step=h)).d for h in (1e-3, 2.5e-4))
    np.testing.assert_allclose(coarse, fine, atol=1e-12)  # sums of decimal times differ by an ulp


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 4},
        {"channel": 2},
        {"stream": 3},
    ],
    ids=str,
)
def test_band_limited_noise_is_independent_in_seeds_channels_and_streams(other):
    times = np.arange(0.0, 2000.0, 0.05)
    assert abs(np.corrcoef(path(NOISE, times), path(NOISE, times, **other))[0, 1]) < 0.02


# time series


def test_a_time_series_is_straight_between_its_points_and_zero_outside():
    rng = np.random.default_rng(1)
    for n in (2, 3, 4, 7, 100):
        times = np.cumsum(rng.exponential(size=n))
        values = rng.normal(size=n)
        instants = np.concatenate([rng.uniform(0.0, times[-1] + 1.0, 200), times])
        expected = np.interp(
            instants,
            times,
            values,
            left=0.0,
            right=0.0,
        )
        np.testing.assert_allclose(
            path(TimeSeries(times, values), instants), expected, rtol=1e-12, atol=1e-12
        )


def test_a_time_series_has_its_values_at_its_times_and_the_slope_behind_them():
    values = written(UNEVEN, UNEVEN.times)
    assert values[:-1, 0].tolist() == list(UNEVEN.values[:-1])
    assert values[-1, 0] == pytest.approx(UNEVEN.values[-1], rel=1e-15)
    slopes = np.diff(UNEVEN.values) / np.diff(UNEVEN.times)
    assert values[:, 1].tolist() == [*slopes, slopes[-1]]
    assert not values[:, 2].any()


@pytest.mark.usefixtures("present_objects_frozen")
def test_a_time_series_lives_as_long_as_its_scenario():
    def made(k):
        t = np.linspace(0.0, 0.2, 201)
        return scenario(law="none", disturbance=TimeSeries(t, k * np.sin(20.0 * t)))

    many = [made(k) for k in range(20)]
    gc.collect()
    for k, trace in enumerate(smc.run(many)):
        np.testing.assert_allclose(trace.d[:, 0], k * np.sin(20.0 * trace.t), atol=1e-12)


@dataclasses.dataclass(frozen=True)
class Staircase(Signal):
    """A user's series: the last value, times a gain."""

    gain: float = 2.0
    series = True
    data = np.array([[0.0, 0.1], [1.0, 2.0]])

    @staticmethod
    def value(t, p, data):
        """A staircase."""
        return p.gain * (data[1, 1] if t >= data[0, 1] else data[1, 0]), 0.0, 0.0


def test_a_user_s_series_has_parameters_beside_its_data():
    np.testing.assert_array_equal(compiled(Staircase(), [0.05, 0.15])[:, 0], [2.0, 4.0])
    staircase = scenario(law="none", disturbance=Staircase(3.0))
    np.testing.assert_array_equal(smc.run(staircase).d, reference.run(staircase).d)


def test_data_that_compiled_code_would_misread_are_refused(monkeypatch, refused):
    for data in (np.zeros(3), np.zeros((3, 2)), np.zeros((2, 3), int), np.zeros((3, 2)).T):
        monkeypatch.setattr(Staircase, "data", data)
        refused(lambda: cfunctions.signal_values(Staircase()), "Staircase", data.shape)


# CSV files

GOOD = "t,d,e\n0,1,5\n0.1,2,6\n0.2,3,7\n0.3,4,8\n"


@pytest.fixture
def file(tmp_path):
    def write(content, name="wind.csv"):
        where = tmp_path / name
        where.write_bytes(content if isinstance(content, bytes) else content.encode())
        return where

    return write


def test_a_csv_file_is_read(file):
    for content, column, values in (
        (GOOD, {}, (1.0, 2.0, 3.0, 4.0)),
        (GOOD, {"column": "e"}, (5.0, 6.0, 7.0, 8.0)),
        (GOOD.replace("t,", "seconds,"), {}, (1.0, 2.0, 3.0, 4.0)),
        (GOOD.replace("\n", "\r\n"), {}, (1.0, 2.0, 3.0, 4.0)),
        ("\ufeff" + GOOD, {}, (1.0, 2.0, 3.0, 4.0)),
        ("\ufeff" + GOOD.replace(",", ";").replace(".", ","), {}, (1.0, 2.0, 3.0, 4.0)),
        (GOOD.replace("t,d,e", "t [s],d [N m],e"), {"column": "d"}, (1.0, 2.0, 3.0, 4.0)),
        (GOOD.replace("t,d,e", "time [s],d [N],e [m]"), {"column": "e [m]"}, (5.0, 6.0, 7.0, 8.0)),
        ("t [ms],d [kN]\n0,.001\n100,.002\n200,.003\n300,.004", {}, (1.0, 2.0, 3.0, 4.0)),
        ("t,d [mm]\n0,1000\n.1,2000\n.2,3000\n.3,4000", {"column": "d [mm]"}, (1.0, 2.0, 3.0, 4.0)),
        ('"t","d, N"\n0,1\n0.1,2\n0.2,3\n0.3,4e0', {"column": "d, N"}, (1.0, 2.0, 3.0, 4.0)),
    ):
        series = TimeSeries.from_csv(file(content), **column)
        assert series == TimeSeries((0.0, 0.1, 0.2, 0.3), values)


def test_a_csv_file_that_is_not_sound_is_refused_with_its_line(file, refused):
    for content, column, parts in (
        (GOOD.replace("2,6", "nan,6"), {}, ("line 3", "d is 'nan'", "finite")),
        ("0,1\n0.1,\n0.2,3\n", {}, ("line 2", "column 2 is ''")),
        ("nan,nan\n0,1\n1,2\n", {}, ("line 1", "column 1 is 'nan'")),  # no header
        (GOOD.replace("0.1,2,6", "0.1,2"), {}, ("line 3", "2 cells for 3 columns")),
        (GOOD.replace("0.2,", "0.1,"), {}, ("line 4", "0.1 s comes after 0.1 s", "increase")),
        (
            GOOD + "0.5,1,1\n",
            {},
            ("gap after line 5", "0.3 s to 0.5 s", "0.1 s apart", "fill it in"),
        ),
        (GOOD.replace("0.1,2,6\n", ""), {}, ("gap after line 2", "0 s to 0.2 s")),
        (GOOD, {"column": "f"}, ("column", "'f'", "d, e, t")),
        (
            GOOD.replace("t,", "t [fortnights],"),
            {},
            ("time column 't [fortnights]'", "not known", "give times in s"),
        ),
        (GOOD.replace("t,d,e", "t,d,d"), {}, ("two columns d", "rename one")),
        (GOOD.replace("t,d,e", "t,d,e [A]"), {"column": "e"}, ("column", "'e'", "e [A]")),
        (GOOD.replace("t,d,e", "t,d [rad],e"), {"column": "d [deg]"}, ("column", "d [deg]")),
        ("t,d\n", {}, ("0 points", "two")),
        ("t d\n0 1\n0.1 2\n", {}, ("no two columns", "commas")),
        (b"\x89PNG\r\n\x1a\n\0\0", {}, ("not text", "commas")),
        (b"t,d\n0,1\0\n", {}, ("CSV", "commas")),
    ):
        refused(
            lambda content=content, column=column: TimeSeries.from_csv(file(content), **column),
            "wind.csv",
            *parts,
        )


# as data


def test_a_signal_survives_json():
    for signal in (*EVERY, BLOW):
        written_out = scenario(
            disturbance=[signal, Constant(1.0)], reference=signal if signal in LED else LED[0]
        )
        assert (
            scenario_json.restore(json.loads(json.dumps(scenario_json.describe(written_out))))
            == written_out
        )


@dataclasses.dataclass(frozen=True)
class Sticker(Part):
    """A user's part, with a tuple and an infinity among its values."""

    levels: tuple[float, ...] = (1.0, 2.0)
    limit: float = math.inf


def test_parts_survive_json():
    for value in (
        (),
        (Sticker(), Sticker((3.0,), 5.0)),
    ):
        assert scenario_json._restored(json.loads(json.dumps(scenario_json._data(value)))) == value


@pytest.mark.parametrize(
    ("loads", "period"),
    [
        ((), 0.0),
        ((smc.Constant(1.0),), 0.0),
        ((smc.Sine(1.0, 5.0),), 2 * math.pi / 5.0),
        ((smc.Sine(1.0, -5.0), smc.Step(1.0, time=0.5)), 2 * math.pi / 5.0),
        ((smc.Sine(0.0, 5.0),), 0.0),
        ((smc.Sine(1.0, 4.0), smc.Sine(1.0, 6.0)), math.pi),
        ((smc.Sine(1.0, 4.0) + smc.Sine(1.0, 6.0),), math.pi),
        ((smc.Sine(1.0, 1.0), smc.Sine(1.0, math.sqrt(2.0))), math.inf),
        ((smc.Sine(1.0, 1.0), smc.Sine(1.0, 1.001)), math.inf),
    ],
)
def test_loads_have_the_period_of_their_beat_or_none(loads, period):
    run = smc.Scenario(plant="duffing", law="pid", disturbance=loads)
    assert run.load_period == pytest.approx(period)


def test_a_signal_of_your_own_says_its_period():
    @dataclasses.dataclass(frozen=True)
    class Square(smc.Signal):
        period: float = 0.5

        @staticmethod
        def value(t, p):
            return 1.0 if t % p.period < 0.5 * p.period else -1.0, 0.0, 0.0

    run = smc.Scenario(plant="duffing", law="pid", disturbance=(Square(), smc.Sine(1.0, math.pi)))
    assert run.load_period == pytest.approx(2.0)
