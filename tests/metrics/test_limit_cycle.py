"""The measured limit cycle: sines and triangles are found, and what is none is NaN."""

import math

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.metrics.limit_cycle import limit_cycle

pytestmark = pytest.mark.quick

T = np.arange(0.0, 2.0, 1e-3)


def wave(frequency, amplitude=0.3, phase=0.3):
    return amplitude * np.sin(math.tau * frequency * T + phase)


@pytest.mark.parametrize("frequency", [3.1, 7.3, 19.37, 81.4])
def test_a_sine_has_its_amplitude_and_frequency(frequency):
    amplitude, measured = limit_cycle(T, wave(frequency))
    assert measured == pytest.approx(frequency, rel=1e-5)
    assert amplitude == pytest.approx(0.3, rel=0.04)  # a period is a whole number of samples


def test_a_wave_of_two_samples_is_found():
    assert limit_cycle(T, 0.2 * (-1.0) ** np.arange(len(T))) == pytest.approx((0.2, 500.0))


def test_a_cycle_of_two_samples_on_a_decay_is_found_without_a_warning():
    t = T[:679]
    with np.errstate(all="raise"):
        assert limit_cycle(
            t, np.exp(-100.0 * t) + 1e-5 * (-1.0) ** np.arange(len(t))
        ) == pytest.approx((1e-5, 500.0))


SHAPES = {
    "square": lambda angle: np.sign(np.sin(angle)),
    "saw": lambda angle: angle / math.pi % 2.0 - 1.0,
    "pulses": lambda angle: 2.0 * (angle % math.tau < 0.1 * math.tau) - 1.0,
    "half pulses": lambda angle: np.sign(np.sin(angle)) * (angle % math.pi < 0.2 * math.pi),
    "third harmonic": lambda angle: (np.sin(angle) + 0.5 * np.sin(3.0 * angle)) / 1.08,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_the_first_harmonic_counts_where_a_higher_one_is_larger_in_the_rate(shape):
    # 7.25: between bins
    for frequency, noise in (
        (3.1, 0.01),
        (7.25, 0.0),
        (7.25, 0.01),
        (19.37, 0.01),
        (
            81.4,
            0.01,
        ),
    ):
        wave = SHAPES[shape](math.tau * frequency * T + 0.3)
        amplitude, measured = limit_cycle(
            T, wave + noise * np.random.default_rng(0).normal(size=len(T))
        )
        assert measured == pytest.approx(frequency, rel=1e-3)
        assert amplitude == pytest.approx(1.0, rel=0.1)


def test_a_cycle_of_fourteen_periods_is_no_harmonic_of_slow_waves():
    rng = np.random.default_rng(1)
    wander = np.cumsum(rng.normal(size=len(T))) * 1e-3
    assert limit_cycle(T, wave(7.1) + wander)[1] == pytest.approx(7.1, rel=5e-3)


def test_a_slow_wave_is_no_first_harmonic_of_a_cycle_that_is_much_larger_in_the_rate():
    assert limit_cycle(T, wave(80.0) + wave(4.0, 0.5))[1] == pytest.approx(80.0, rel=1e-3)


def test_steps_of_an_encoder_at_random_times_are_no_limit_cycle():
    rng = np.random.default_rng(2)
    s = np.zeros(len(T))
    for sample in rng.choice(len(T), 40, replace=False):
        s[sample:] += rng.choice([-1.0, 1.0]) * np.exp(-(T[sample:] - T[sample]) / 6e-3)
    assert math.isnan(limit_cycle(T, s)[0])


def test_slow_waves_and_drifts_do_not_count():
    triangle = 1e-3 * (2.0 / math.pi) * np.arcsin(np.sin(math.tau * 50.0 * T))
    amplitude, frequency = limit_cycle(T, triangle + 0.5 * np.sin(6.0 * T) + 0.2 * T)
    assert frequency == pytest.approx(50.0, rel=1e-3)
    assert amplitude == pytest.approx(1e-3, rel=0.03)


@pytest.mark.parametrize(
    "s",
    [
        np.zeros(len(T)),
        np.exp(-3.0 * T),
        np.exp(-3.0 * T) * np.sin(60.0 * T),
        np.exp(3.0 * T) * np.sin(60.0 * T),
        0.5 * np.sin(6.0 * T),
        (2.0 / math.pi) * np.arcsin(np.sin(math.tau * 2.0 * T)),
        np.random.default_rng(0).normal(size=len(T)),
        1.0 + 1e-12 * wave(30.0),
        np.where(T < 1.0, wave(30.0), math.nan),
        wave(30.0)[:10],
        1e160 * wave(30.0),
    ],
    ids=[
        "zero",
        "decay",
        "dying",
        "growing",
        "slow",
        "slow triangle",
        "noise",
        "rounding",
        "broken",
        "short",
        "huge",
    ],
)
def test_what_does_not_oscillate_steadily_has_no_limit_cycle(s):
    amplitude, frequency = limit_cycle(T[: len(s)], s)
    assert math.isnan(amplitude)
    assert math.isnan(frequency)


CARTS = """<mujoco><option gravity="0 0 0"/><default><geom size=".1" mass="1" contype="0" conaffinity="0"/></default>
 <worldbody><body><joint name="A" type="hinge" axis="0 0 1"/><geom pos=".5 0 0"/></body>
 <body pos="0 1 0"><joint name="B" type="slide" axis="0 0 1"/><geom/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    "laws",
    [
        ("pid", "classical"),
        ("classical", "pid"),
    ],
)
def test_a_group_without_a_limit_cycle_hides_no_other_and_units_do_not_mix(laws, tmp_path):
    (tmp_path / "two.xml").write_text(CARTS)
    motors = {name: smc.Channel(motor=True) for name in "AB"}
    plant = smc.plant_from(str(tmp_path / "two.xml"), motors)
    scenario = smc.Scenario(
        plant=plant,
        law=[smc.law(law) for law in laws],
        x0=0.3,
        u_max=6.0,
        duration=6.0,
        input_delay=0.005,
    )
    trace = smc.run(scenario)
    of_group = smc.scores(trace)
    scores = smc.score(trace)
    frequencies = []
    for cycle in of_group.values():
        frequencies.append(cycle["chattering_frequency"])
    assert sum(map(math.isnan, frequencies)) == 1  # pid has none
    assert scores["chattering_frequency"] == max(f for f in frequencies if not math.isnan(f))
    assert "chattering_amplitude" not in scores  # m/s and rad/s
