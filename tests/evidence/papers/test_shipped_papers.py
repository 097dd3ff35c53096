"""The papers that ship beside Gaber's: what each says of itself, and that a broken law loses each
of its claims.
"""

import math

import numpy as np
import pytest
from evidence.helpers.broken_laws import survivors
from papers.acary_2012.claims import observed_twisting_60
from papers.aldana_lopez_2019.claims import (
    BAND,
    classical_bound,
    general_margins,
    least_bound,
)
from papers.huber_2014.claims import implicit_twisting
from papers.perez_ventura_2017.claims import predicted
from papers.seeber_2024.claims import flip, slopes

import smc_mujoco as smc
from smc_mujoco.control.component import Template
from smc_mujoco.evidence.audit.audit import audit
from smc_mujoco.evidence.audit.paper import paper, shipped
from smc_mujoco.evidence.papers.measures import END_SAMPLES, exponent, late, late_step, settled
from smc_mujoco.simulation.trace import Trace
from tests.evidence.papers.test_quick_verdicts import runs_made_once

PAPERS = [name for name in shipped() if name != "gaber"]


@pytest.mark.quick
def test_at_least_five_papers_ship_with_4_to_12_claims_each():
    assert len(PAPERS) >= 5
    for name in PAPERS:
        shipped_paper = paper(name)
        assert 4 <= len(shipped_paper.claims) <= 12, name
        assert shipped_paper.access, name
        for claim in shipped_paper.claims.values():
            assert claim.where, name
            assert claim.thresholds, name


@pytest.mark.parametrize("name", PAPERS)
@pytest.mark.slow
def test_a_broken_law_loses_each_claim(name):
    with runs_made_once():
        assert survivors(name) == {}


# measures


def test_an_exponent_is_that_of_a_power_and_nan_of_runs_that_failed():
    levels = [1.0, 2.0, 4.0]
    assert exponent(
        levels, [3.0 * level**1.5 for level in levels for _ in range(2)]
    ) == pytest.approx(1.5)
    for broken in (math.nan, math.inf, 0.0):
        assert math.isnan(exponent(levels, [1.0, broken, 3.0]))


def run_of(signal):
    """A trace that has times alone, and a signal, (samples, 1)."""
    trace = object.__new__(Trace)
    object.__setattr__(trace, "t", 0.1 * np.arange(len(signal)))
    return trace, np.reshape(signal, (-1, 1))


@pytest.mark.parametrize(
    ("signal", "time"),
    [
        ([3.0, 1.0, 0.5, -0.5], 0.1),
        ([3.0, 1.0, 2.0, 0.5], 0.3),
        ([0.5, 0.5, 0.5, 0.5], 0.0),
        ([3.0, 1.0, 0.5, 2.0], math.inf),
        ([3.0, 1.0, math.nan, math.nan], math.inf),
    ],
)
def test_a_signal_is_settled_from_where_it_stays_within_a_band(signal, time):
    assert settled(*run_of(signal), 1.0) == pytest.approx(time)


def test_late_values_are_those_of_the_last_samples():
    signal = np.concatenate([np.full(10, 9.0), np.arange(END_SAMPLES + 2) % 3]).reshape(-1, 1)
    assert late(signal) == 2.0
    assert late_step(signal) == 2.0
    assert math.isnan(late(np.full((5, 1), math.nan)))


# formulas


def test_the_least_bound_of_fixed_time_is_the_integral():
    from scipy.integrate import quad

    from smc_mujoco.control.law import library_law

    for k1, k2, a, b in (
        (2.0, 2.0, 0.5, 1.5),
        (1.0, 2.0, 0.5, 2.0),
        (3.0, 1.0, 0.3, 1.5),
    ):
        fixed_time = library_law(
            "fixed_time",
            k1=k1,
            k2=k2,
            a=a,
            b=b,
        )
        integral, _ = quad(  # over s = e^z
            lambda z, k1=k1, k2=k2, a=a, b=b: (
                1.0 / (k1 * math.exp((a - 1.0) * z) + k2 * math.exp((b - 1.0) * z))
            ),
            -80.0,
            80.0,
            limit=400,
        )
        assert least_bound(fixed_time) == pytest.approx(integral, rel=1e-6)
        assert classical_bound(fixed_time) > integral
    # at the end of what the general formula is for
    without = {
        "A": 1.0,
        "B": 1.0,
        "p": 0.5,
        "q": 2.0,
        "k": 0.5,
    }
    assert general_margins(without) == {"k p < 1": 0.75, "k q > 1": 0.0}


@pytest.mark.slow
def test_fixed_time_is_sampled_finely_enough_for_the_band_that_was_fixed_before_the_first_run():
    (claim,) = audit("aldana_lopez_2019", ["3"], gains=["skew"], quick=True).claims
    assert BAND == 1e-6
    assert claim.verdict == "supported"


def test_the_predicted_cycle_of_super_twisting_balances_its_harmonics():
    """N(A, omega) = -1 / W(j omega) for N = c k1 / sqrt(A) + 4 k2 / (pi A j omega), W = 1 / (s (mu
    s + 1)^2).
    """
    from scipy.integrate import quad

    k1 = 1.5
    k2 = 1.1
    lag = 5e-3
    amplitude, frequency = predicted(k1, k2, lag)
    omega = math.tau * frequency
    half, _ = quad(lambda angle: math.sin(angle) ** 1.5, 0.0, math.pi)
    gain = 2.0 / math.pi * half * k1 / math.sqrt(amplitude) + 4.0 * k2 / (
        math.pi * amplitude * 1j * omega
    )
    assert gain * (1.0 / (1j * omega * (1.0 + 1j * omega * lag) ** 2)) == pytest.approx(
        -1.0, rel=1e-6
    )


# laws

FREE = {"alpha": 0.0, "beta": 0.0, "delta": 0.0}  # of a Duffing oscillator: a mass of 1 kg


def test_implicit_twisting_has_both_signs_at_the_end_of_the_period():
    h = 0.05
    rng = np.random.default_rng(1)
    starts = rng.uniform((-0.2, -1.0), (0.2, 1.0), (40, 2))
    fields = {
        "plant": smc.plant("duffing", **FREE),
        "law": implicit_twisting,
        "u_max": math.inf,
    }
    runs = [
        smc.Scenario(
            x0=x,
            v0=v,
            duration=h,
            control_period=h,
            physics_step=h,
            **fields,
        )
        for x, v in starts
    ]
    G, beta = (implicit_twisting.defaults[name] for name in ("G", "beta"))
    gains = np.array([G * (1.0 + beta * h / 2.0), G * beta])
    for (e, de), trace in zip(starts, smc.run(runs), strict=True):
        v = trace.u[0, 0]
        ends = np.array([e + 1.5 * h * de + h * h * v, de + h * v])
        least, largest = (
            v + gains @ np.where(abs(ends) > 1e-9, np.sign(ends), free) for free in (-1.0, 1.0)
        )
        assert least <= 1e-9
        assert largest >= -1e-9


def test_the_observer_of_equation_60_solves_its_equation_and_predicts_a_period_ahead():
    from scipy.optimize import root_scalar

    h, (k1, k2, k3, k4) = 0.02, (observed_twisting_60.defaults[f"k{i}"] for i in range(1, 5))
    trace = smc.run(
        smc.Scenario(
            plant=smc.plant("duffing", **FREE),
            law=observed_twisting_60,
            x0=0.5,
            v0=0.3,
            duration=2.0,
            control_period=h,
            physics_step=h,
            u_max=math.inf,
        )
    )
    position = velocity = 1.0
    for x, u, surface_value in zip(trace.x[:-1, 0], trace.u[:-1, 0], trace.s[:-1, 0], strict=True):
        b = x - position
        assert surface_value == pytest.approx(b, abs=1e-9)
        sign = b / (h * h * k3)
        error = 0.0
        if abs(sign) > 1.0:
            sign = math.copysign(1.0, b)

            def left(z, b=b):
                linear = z * (1.0 + h * k2 + h * h * k4)
                return linear + h * k1 * math.sqrt(z) + h * h * k3 - abs(b)

            error = sign * root_scalar(left, bracket=(0.0, abs(b)), xtol=1e-15).root
        velocity += h * (k3 * sign + k4 * error) + h * u
        position = x - error + h * velocity


# laws and disturbances of the papers' own


def test_a_paper_s_own_laws_are_those_recorded(snapshot):
    said = {}
    for name in PAPERS:
        for law, template in paper(name).laws.items():
            if isinstance(template, Template) and f"paper_{name}" in template.function.__module__:
                gains = ", ".join(
                    f"{gain} = {gain_range.default:g}{' > 0' * gain_range.positive}"
                    for gain, gain_range in template.gains.items()
                )
                said[f"{name} {law}"] = (
                    f"{gains}; memory {template.memory}, relative degree {template.relative_degree}"
                )
    assert said == snapshot


def test_random_slopes_are_of_one_size_and_keep_within_the_bound():
    d = slopes(0.125, 40.0, 3)
    t = np.array(d.times)
    values = np.array(d.values)
    assert t[0] == 0.0
    assert t[-1] == 40.0
    assert values[0] == 0.0
    assert len(t) == 321
    assert set(np.round(np.diff(values) / np.diff(t), 9)) == {-1.0, 1.0}
    assert np.abs(values).max() == 1.0
    assert slopes(0.125, 40.0, 3).values == d.values != slopes(0.125, 40.0, 4).values


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_triangle_has_mean_0_over_every_period_and_then_goes_on(sign):
    d = flip(0.1, sign)
    t = np.array(d.times)
    values = sign * np.array(d.values)
    assert len(t) == 42
    assert t[-1] == pytest.approx(4.1)
    np.testing.assert_allclose(np.diff(values) / 0.1, [*[-1.0, 1.0] * 20, 1.0])
    np.testing.assert_allclose(values[1:-1] + values[:-2], 0.0, atol=1e-12)
