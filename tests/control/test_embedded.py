"""The paper's law as embedded controllers compute it: how far from tanh."""

import numpy as np
import pytest
from helpers.plants_ab import measured

import smc_mujoco as smc
from smc_mujoco.control.laws import observer_free_q15 as q15
from smc_mujoco.simulation import python_functions

FORMS = ("observer_free_table", "observer_free_taylor", "observer_free_single", "observer_free_q15")
LAM = 6.0
K1 = 2.5
HALF = np.linspace(0.0, 12.0, 6001)
GRID = np.concatenate([-HALF[:0:-1], HALF])


def forces(law, e, de):
    """u and s at many states, (N, 2)."""
    gains = python_functions.gains_of(law)
    memory = np.zeros(law.memory)
    return np.array(
        [
            law.function(measured(float(a), float(b)), gains, memory)
            for a, b in zip(e, de, strict=True)
        ]
    )


def squash(name, s=GRID, **gains):
    """What stands in for tanh in a law, at s."""
    return -forces(smc.law(name, lam=1.0, **gains), np.zeros_like(s), s)[:, 0]


# error against tanh: what the docstrings say, and no less


@pytest.mark.parametrize("size", [8, 32, 256])
def test_the_table_is_as_close_as_linear_interpolation_allows(size):
    error = np.abs(squash("observer_free_table", size=size) - np.tanh(GRID)).max()
    bound = max(0.0963 * (5.0 / size) ** 2, 9.1e-5)
    assert 0.85 * bound < error <= bound


@pytest.mark.parametrize(
    ("terms", "error"),
    [
        (1, 3.3e-3),
        (3, 5.5e-6),
        (5, 2.3e-7),
    ],
)
def test_the_series_is_as_close_as_its_terms_allow(terms, error):
    assert (
        0.75 * error
        < np.abs(squash("observer_free_taylor", terms=terms) - np.tanh(GRID)).max()
        <= error
    )


@pytest.mark.parametrize("name", FORMS)
def test_every_form_is_odd_bounded_and_rises(name):
    T = squash(name)
    np.testing.assert_array_equal(T, -T[::-1])
    assert np.abs(T).max() <= 1.0
    # their last bits ripple
    slack = {"observer_free_single": 2e-7, "observer_free_taylor": 1e-6}.get(name, 0.0)
    assert np.diff(T).min() >= -slack


# single precision


@pytest.mark.quick
def test_single_precision_rounds_every_operation_to_24_bits():
    """The same operations on numpy's float32 arrays, bit by bit."""
    rng = np.random.default_rng(0)
    f = np.float32
    e, de = rng.normal(scale=2.0, size=(2, 5000))
    s = de.astype(f) + f(K1) * e.astype(f)
    a = f(0.25) * np.clip(s, f(-9.0), f(9.0))
    z = a * a
    T = a * (f(105.0) + f(10.0) * z) / (f(105.0) + z * (f(45.0) + z))
    for _ in range(2):
        T = (T + T) / (f(1.0) + T * T)
    assert T.dtype == f
    commands = forces(
        smc.law(
            "observer_free_single",
            lam=LAM,
            k1=K1,
        ),
        e,
        de,
    )
    np.testing.assert_array_equal(commands[:, 0], -(f(LAM) * T).astype(float))
    np.testing.assert_array_equal(commands[:, 1], s.astype(float))


# fixed point


def firmware(e, de, lam=LAM, k1=K1, e_range=4.0, de_range=8.0, u_range=8.0):
    """The fixed-point law as its C would run: int16 words and int32 sums of numpy, where an
    overflow would wrap.
    """
    word = np.int16
    wide = np.int32

    def held(n):
        return np.clip(n, -32767, 32767).astype(word)

    def convert(a, unit):
        scaled = np.clip(np.asarray(a) / unit * 32768.0, -32767.0, 32767.0)
        return held(np.copysign(np.floor(np.abs(scaled) + 0.5), scaled))

    def multiply(a, b, bits):
        full = a.astype(wide) * b.astype(wide)
        assert np.array_equal(full, a.astype(np.int64) * b.astype(np.int64))
        return np.sign(full) * ((np.abs(full) + wide(1 << (bits - 1))) >> bits)

    gain = [
        convert([g], unit)
        for g, unit in ((k1 * e_range / 8, 16.0), (de_range / 8, 16.0), (lam, u_range))
    ]
    total = multiply(gain[0], convert(e, e_range), 11) + multiply(
        gain[1], convert(de, de_range), 11
    )
    s = held(total)
    table = q15.TABLE.astype(word)
    assert np.array_equal(table, q15.TABLE)
    size = np.abs(s.astype(wide))
    i = size >> 7
    part = size & 127
    T = table[i] + multiply(table[i + 1] - table[i], part.astype(word), 7)
    u = held(multiply(gain[2], held(np.sign(s) * T), 15))
    return -u * (u_range / 32768.0), s * (8.0 / 32768.0)


def test_fixed_point_is_what_16_bit_words_and_32_bit_sums_compute():
    rng = np.random.default_rng(0)
    e, de = rng.normal(
        scale=(0.5, 3.0),
        size=(20_000, 2),
    ).T
    e[:100], de[:100] = 1e4 * e[:100], 1e4 * de[:100]  # far out of range
    u, s = firmware(e, de)
    commands = forces(
        smc.law(
            "observer_free_q15",
            lam=LAM,
            k1=K1,
        ),
        e,
        de,
    )
    np.testing.assert_array_equal(commands[:, 0], u)
    np.testing.assert_array_equal(commands[:, 1], s)


def test_fixed_point_is_as_close_as_its_words_allow():
    rng = np.random.default_rng(1)
    e = rng.uniform(-1.2, 1.2, 40_000)
    de = rng.uniform(-4.0, 4.0, 40_000)
    u = forces(
        smc.law(
            "observer_free_q15",
            lam=LAM,
            k1=K1,
        ),
        e,
        de,
    )[:, 0]
    error = np.abs(u + LAM * np.tanh(de + K1 * e)).max()
    bound = LAM * (1.6e-4 + (K1 * 4.0 + 8.0 + 16.0) / 2**16) + 8.0 / 2**16
    assert 0.3 * bound < error <= bound
