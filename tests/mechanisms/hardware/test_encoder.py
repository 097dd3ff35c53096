"""The encoder reads what its formula says: to the count, to the physics step, and by the odds of
its losses.

What the controller reads is seen through laws that do nothing and return it as their s. The plant
is a Duffing oscillator that swings across both wells, so that a reading of another instant is
another number.
"""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from helpers import reference

import smc_mujoco as smc
from smc_mujoco.simulation.trace import ARRAYS


@smc.law_function
def position(y, gains, memory):
    """Does nothing, and shows the position it reads."""
    return 0.0, y.x


@smc.law_function
def speed(y, gains, memory):
    """Does nothing, and shows the velocity it is given."""
    return 0.0, y.v


def scenario(sensor, **changes):
    fields = {
        "plant": "duffing",
        "law": position(),
        "duration": 1.0,
        "v0": 0.7,
    }
    return smc.Scenario(**(fields | {"sensor": sensor} | changes))


def read(sensor, **changes):
    """The trace, the positions and the velocities that a law read."""
    traces = smc.run([scenario(sensor, law=law(), **changes) for law in (position, speed)])
    assert [trace.failure for trace in traces] == [None, None]
    return traces[0], *(trace.s for trace in traces)


def same(a, b, names=ARRAYS):
    for name in names:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


PERFECT = smc.Encoder(counts=math.inf)


# quantisation and bias


@pytest.mark.quick
@pytest.mark.parametrize(
    ("plant", "turn", "counts"),
    [
        ("duffing", 1.0, 2),
        ("duffing", 1.0, 2**32),
        ("van_der_pol", 1.0, 100),
        ("inverted_pendulum", 2 * math.pi, 3),
        ("inverted_pendulum", 2 * math.pi, 4096),
    ],
)
def test_a_reading_is_the_nearest_count(plant, turn, counts):
    trace, x, _ = read(smc.Encoder(counts=counts), plant=plant)
    q = turn / counts
    np.testing.assert_array_equal(x, q * np.floor(trace.x / q + 0.5))
    assert np.abs(x - trace.x).max() <= q / 2 * (1 + 1e-9)


def test_a_reading_of_more_counts_than_integers_have_bits_is_the_position():
    trace, x, _ = read(smc.Encoder(counts=2**32, bias=1e12))
    assert x == pytest.approx(1e12)
    same(trace, reference.run(trace.scenario))


def test_a_bias_is_added_before_the_rounding():
    trace, x, _ = read(smc.Encoder(counts=10, bias=0.04))
    np.testing.assert_array_equal(x, 0.1 * np.floor((trace.x + 0.04) / 0.1 + 0.5))
    trace, x, _ = read(smc.Encoder(counts=math.inf, bias=-0.3))
    np.testing.assert_array_equal(x, trace.x - 0.3)


def test_noise_comes_before_the_rounding():
    """Noise of more than a count dithers: the mean of the error then is far below a count."""
    noise = smc.Noise(position=0.2)
    trace, x, _ = read(
        smc.Encoder(counts=5),
        noise=noise,
        duration=10.0,
        seed=5,
    )
    assert set(np.unique(np.round(x * 5, 9)) % 1) == {0.0}
    error = (x - trace.x)[:, 0]
    assert error.std() == pytest.approx(math.hypot(0.2, 0.2 / math.sqrt(12)), rel=0.03)
    assert abs(error.mean()) < 4 * error.std() / 100
    _, exact, _ = read(
        PERFECT,
        noise=noise,
        duration=10.0,
        seed=5,
    )
    np.testing.assert_allclose(x, np.round(exact * 5) / 5, atol=1e-9)


# the velocity


def test_the_velocity_is_the_filtered_difference_of_the_readings():
    _, x, v = read(smc.Encoder(counts=200))
    tau = 5e-3
    dt = 1e-3
    a = tau / (tau + dt)
    estimate = 0.0
    expected = [0.0]
    for before, now in zip(x[:-1, 0], x[1:, 0], strict=True):
        estimate = a * estimate + (1 - a) * (now - before) / dt
        expected.append(estimate)
    np.testing.assert_allclose(
        v[:, 0],
        expected,
        rtol=1e-12,
        atol=1e-12,
    )


# loss


@pytest.mark.parametrize("rate", [0.05, 0.5, 0.9])
def test_readings_get_lost_at_their_rate(rate):
    """A binomial count, within four standard deviations; runs of losses are geometric."""
    trace, x, _ = read(
        smc.Encoder(math.inf, dropout=rate), duration=20.0, velocity="measured", seed=11
    )
    lost = (x != trace.x)[1:, 0]
    n = len(lost)
    assert abs(lost.mean() - rate) < 4 * math.sqrt(rate * (1 - rate) / n)
    again = lost[1:][lost[:-1]]  # after a loss, the next is as likely as ever
    assert abs(again.mean() - rate) < 4 * math.sqrt(rate * (1 - rate) / len(again))


def test_a_lost_reading_holds_the_last_one_with_its_noise_and_rounding():
    _, x, _ = read(
        smc.Encoder(50, dropout=0.5, bias=0.1),
        noise=smc.Noise(position=0.1),
        seed=3,
    )
    _, all_of_them, _ = read(
        smc.Encoder(50, bias=0.1),
        noise=smc.Noise(position=0.1),
        seed=3,
    )
    arrived = x == all_of_them
    held = x[1:] == x[:-1]
    assert (arrived[1:] | held).all()
    assert 0.4 < (~arrived).mean() < 0.55
    trace, x, _ = read(smc.Encoder(math.inf, dropout=1.0))
    assert (x == trace.x[0]).all()  # the first is never lost


def test_losses_are_independent_of_the_noise():
    sensor = smc.Encoder(math.inf, dropout=0.5)
    noisy = {
        "noise": smc.Noise(position=0.1),
        "duration": 10.0,
    }
    trace, x, _ = read(sensor, **noisy)
    _, full, _ = read(PERFECT, **noisy)
    arrived = (x == full)[1:, 0]
    z = (full - trace.x)[1:, 0]
    assert abs(np.corrcoef(arrived, np.abs(z))[0, 1]) < 4 / math.sqrt(len(z))
    assert abs(np.corrcoef(arrived, z)[0, 1]) < 4 / math.sqrt(len(z))


# period and delay


def expected(sensor, changes, name):
    """What a late sensor reads at the samples, from a run whose trace holds every physics step."""
    late = scenario(sensor, **changes)
    steps = dataclasses.replace(
        late, sensor=None, velocity="measured", control_period=late.resolved.physics_step
    )
    fine = getattr(smc.run(steps), name)
    h = late.resolved.physics_step
    delay = round(sensor.delay / h)
    readings = []
    for k in range(late.samples + 1):
        step = k * late.steps - delay
        if sensor.period:
            period_steps = round(sensor.period / h)
            step = step // period_steps * period_steps
        readings.append(fine[max(step, 0)])
    return np.array(readings)


TIMES = [
    {"delay": 2.5e-4},
    {"delay": 1e-3},
    {"delay": 7.5e-4},
    {"delay": 0.0335},
    {"period": 5e-3},
    {"period": 2.5e-3},
    {"period": 7.5e-4},
    {"period": 2.5e-4},
    {"period": 0.1},
    {"period": 5e-3, "delay": 2e-3},
    {"period": 5e-3, "delay": 5e-3},
    {"period": 3e-3, "delay": 0.01175},
    {"period": 0.0125, "delay": 2.5e-4},
]


@pytest.mark.parametrize(
    ("times", "integrator"), list(zip(TIMES, itertools.cycle(["RK4", "implicitfast"])))
)
def test_late_readings_are_those_of_their_instants(times, integrator):
    sensor = smc.Encoder(math.inf, **times)
    changes = {
        "physics_step": 2.5e-4,
        "integrator": integrator,
        "velocity": "measured",
        "duration": 0.3,
    }
    _, x, v = read(sensor, **changes)
    np.testing.assert_array_equal(x, expected(sensor, changes, "x"))
    np.testing.assert_array_equal(v, expected(sensor, changes, "v"))


def test_a_late_encoder_shows_no_speed_at_the_start_that_is_not_there():
    """From 0 to x0 in one reading would be a thousand metres a second."""
    _, _, v = read(smc.Encoder(math.inf, delay=0.01), v0=0.0)
    assert np.abs(v).max() < 5.0
    assert not v[:11].any()


def test_readings_are_held_between_periods_with_their_noise_and_losses():
    """One draw a reading, not a sample."""
    sensor = smc.Encoder(math.inf, period=0.01, dropout=0.3)
    trace, x, _ = read(
        sensor,
        noise=smc.Noise(position=0.1),
        duration=5.0,
    )
    blocks = x[:-1, 0].reshape(-1, 10)
    assert (blocks == blocks[:, :1]).all()
    changed = np.diff(blocks[:, 0]) != 0
    assert abs((~changed).mean() - 0.3) < 4 * math.sqrt(0.21 / len(changed))
    error = (blocks[:, 0] - trace.x[:-1, 0].reshape(-1, 10)[:, 0])[1:][changed]
    assert error.std() == pytest.approx(0.1, rel=0.15)


@pytest.mark.parametrize(
    ("period", "delay"),
    [
        (2.5e-3, 0.0),
        (5e-3, 2e-3),
        (5e-3, 2.5e-3),
    ],
)
def test_late_noise_changes_with_the_reading(period, delay):
    """A reading taken at t arrives at t + delay with one noise, until the next arrives.

    Samples are every 1 ms.
    """
    sensor = smc.Encoder(math.inf, period=period, delay=delay)
    changes = {
        "physics_step": 2.5e-4,
        "integrator": "implicitfast",
        "velocity": "measured",
        "duration": 0.5,
    }
    _, x, _ = read(sensor, noise=smc.Noise(position=0.5), **changes)
    error = x[:, 0] - expected(sensor, changes, "x")[:, 0]
    t = np.arange(len(error)) * 1e-3
    reading = np.maximum(np.floor((t - delay) / period + 1e-9), 0)
    np.testing.assert_array_equal(np.abs(np.diff(error)) > 1e-9, np.diff(reading) > 0)
    assert len(np.unique(error.round(5))) == reading[-1] + 1


def test_an_encoder_that_reads_once_a_sample_is_one_without_a_period():
    noise = smc.Noise(position=0.1)
    plainly, period = (
        read(smc.Encoder(100, dropout=0.2, period=p), noise=noise)[0] for p in (None, 1e-3)
    )
    same(plainly, period)


# all of it, both loops, networks


def test_a_skew_reads_each_channel_earlier_than_the_channel_before():
    plant = smc.plant("pendulum_network", n=3)
    trace, x, _ = read(
        smc.Encoder(math.inf, delay=2e-3, skew=3e-3), plant=plant, v0=(0.5, -0.5, 1.0)
    )
    for i, delay in enumerate((2, 5, 8)):
        late = np.append(trace.x[:1, i].repeat(delay), trace.x[:-delay, i])
        np.testing.assert_array_equal(x[:, i], late)
    with pytest.raises(smc.ScenarioError, match=r"period 0\.01 and skew 0\.003"):
        smc.Encoder(period=0.01, skew=3e-3)
