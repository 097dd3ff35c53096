"""Noise is numpy's Philox bit for bit, normal, independent where it must be, and a function of time
and seed alone.
"""

import itertools
import math

import numpy as np
import pytest
from helpers import python_controller

import smc_mujoco as smc
from smc_mujoco.simulation import philox

LARGEST_SEED = 2**53 - 1


def test_every_stream_of_a_seed_gives_the_numbers_it_always_gave(snapshot):
    """They are whole numbers over a power of two, the same on all machines: a run is repeated years
    later.
    """
    streams = philox.MEASUREMENT, philox.PROCESS, philox.DROPOUT, philox.JITTER, philox.MISSED
    assert [[philox.uniform(5, 1, stream, k) for k in (0, 1, 7)] for stream in streams] == snapshot


def numpys(seed, channel, stream, k):
    """Block k from numpy's generator, which counts up before it draws; key and counter as
    little-endian words.
    """
    counter = (k + (stream << 64) - 1) % 2**256
    return np.random.Philox(key=seed | channel << 64, counter=counter).random_raw(4)


def test_philox_blocks_equal_numpys_bit_for_bit():
    words = np.random.default_rng(0).integers(2**64, size=(500, 4), dtype=np.uint64)
    edges = []
    for w in (0, 1, 2**32 - 1, 2**32, LARGEST_SEED, 2**63, 2**64 - 1):
        edges.append(np.uint64(w))
    for seed, channel, stream, k in itertools.chain(words, itertools.product(edges, repeat=4)):
        ours = np.array(philox.block(seed, channel, stream, k))
        np.testing.assert_array_equal(ours, numpys(int(seed), int(channel), int(stream), int(k)))


def test_philox_takes_the_float_arguments_that_a_row_holds():
    for seed, channel, k in itertools.product((0, 1, LARGEST_SEED), (0, 999), (0, 1, 10**8)):
        floats = philox.block(float(seed), channel, philox.PROCESS, float(k))
        np.testing.assert_array_equal(np.array(floats), numpys(seed, channel, philox.PROCESS, k))


@pytest.mark.quick
def test_normals_are_box_muller_of_the_top_53_bits():
    for k in range(200):
        a, b, _, _ = (int(w) >> 11 for w in numpys(5, 2, philox.MEASUREMENT, k))
        radius = math.sqrt(-2 * math.log((a + 1) / 2**53))
        angle = 2 * math.pi * b / 2**53
        expected = radius * math.cos(angle), radius * math.sin(angle)
        np.testing.assert_allclose(
            philox.normals(5, 2, philox.MEASUREMENT, k), expected, rtol=1e-14, atol=1e-15
        )


@smc.law_function()
def show_position(y, gains, memory):
    return 0.0, y.x


@smc.law_function()
def show_velocity(y, gains, memory):
    return 0.0, y.v


def at_rest(law, **fields):
    """A run at the origin: what the law shows as s is the noise alone, exactly."""
    common = {
        "plant": "duffing",
        "x0": 0.0,
        "duration": 0.1,
        "noise": smc.Noise(position=0.5, velocity=3.0),
        "seed": 9,
    }
    trace = smc.run(smc.Scenario(law=law(), **(common | fields)))
    assert not trace.x.any()
    return trace.s[:, 0]


def test_sensors_show_the_truth_plus_the_normals_of_the_sample():
    expected = np.array(
        [python_controller.normals(9, 0, philox.MEASUREMENT, k) for k in range(101)]
    )
    np.testing.assert_allclose(at_rest(show_position), 0.5 * expected[:, 0], rtol=1e-15)
    np.testing.assert_allclose(at_rest(show_velocity), 3.0 * expected[:, 1], rtol=1e-15)


TAU = 0.05
SIGMA = 0.7


def path(signal, times, seed=0, channel=0):
    """The signal's values at rising times."""
    memory = np.zeros(signal.memory)
    return np.array(
        [
            type(signal).value(
                t,
                signal,
                memory,
                seed,
                channel,
                philox.PROCESS,
            )[0]
            for t in times
        ]
    )


def test_process_noise_has_its_standard_deviation_and_correlation_time():
    knots = 400_000
    dt = 5e-3
    d = path(smc.signals.OrnsteinUhlenbeck(SIGMA, tau=TAU, dt=dt), np.arange(knots) * dt, seed=3)
    independent = knots * dt / (2 * TAU)
    assert abs(d.mean()) < 4 * SIGMA / math.sqrt(independent)
    assert abs(d.std() / SIGMA - 1) < 4 / math.sqrt(independent)
    for lag in (1, 2, 5, 10, 20, 60):
        correlation = np.mean(d[lag:] * d[:-lag]) / SIGMA**2
        assert abs(correlation - math.exp(-lag * dt / TAU)) < 4 / math.sqrt(independent)


def test_process_noise_is_stationary_from_the_start():
    """Over many seeds the spread is sigma at time 0 and one correlation time later."""
    signal = smc.signals.OrnsteinUhlenbeck(SIGMA, tau=TAU)
    ends = np.array([path(signal, (0.0, TAU), seed=seed) for seed in range(4000)])
    assert np.all(np.abs(ends.std(axis=0) / SIGMA - 1) < 4 / math.sqrt(2 * 4000))
    assert abs(np.corrcoef(ends.T)[0, 1] - math.exp(-1)) < 4 / math.sqrt(4000)


def test_process_noise_is_a_path_that_does_not_depend_on_where_it_is_read():
    signal = smc.signals.OrnsteinUhlenbeck(SIGMA, tau=TAU, dt=1e-3)
    fine = np.arange(4001) * 2.5e-4
    values = path(signal, fine)
    np.testing.assert_allclose(
        path(signal, fine[::3]),
        values[::3],
        rtol=0,
        atol=1e-12,
    )
    np.testing.assert_allclose(
        path(signal, np.repeat(fine, 2)), np.repeat(values, 2), rtol=0, atol=1e-12
    )


def test_uniform_numbers_are_numpys_53_bits_of_a_block():
    for k in range(1, 50):
        word = int(numpys(7, 3, 5, k)[0])
        assert (
            philox.uniform(np.uint64(7), np.uint64(3), np.uint64(5), np.uint64(k))
            == (word >> 11) * 2.0**-53
        )
