"""Laws with an observer of the disturbance, held to what is proved of them on plant B: x1' = x2,
x2' = f + g u + d.
"""

import math

import numpy as np
import pytest
from helpers.plants_ab import called, constant, measured, plant_b, sine

import smc_mujoco as smc

pytestmark = pytest.mark.quick

H = 1e-3  # s
LAWS = ("extended_state", "disturbance_observer")
OBSERVERS = pytest.mark.parametrize("name", LAWS)
ESTIMATE = {"extended_state": 3, "disturbance_observer": 1}  # cell of the memory that holds it
SPEED = {"extended_state": "w", "disturbance_observer": "l"}


def observer(name, **gains):
    """The law with b = g = 1."""
    return smc.law(name, **({"b": 1.0, "c": 2.5} | gains))


def estimate(name, run):
    """d^ at every sample, as the law left it."""
    return run.memory[1:, ESTIMATE[name]]


def slid(run, c=2.5):
    """s = x2 + c x1 at every sample."""
    return run.x[:, 1] + c * run.x[:, 0]


@OBSERVERS
def test_a_constant_disturbance_is_found_and_taken_away(name):
    """Exactly, and so whatever k: k = 0 leaves no steady error."""
    run = plant_b(observer(name, k=0.0), constant(2.0))
    assert estimate(name, run)[-1] == pytest.approx(2.0, abs=1e-9)
    assert run.u[-1] == pytest.approx(-2.0, abs=1e-9)


@OBSERVERS
@pytest.mark.parametrize("speed", [20.0, 60.0])
@pytest.mark.parametrize("omega", [1.0, 5.0, 50.0])
def test_the_estimate_is_within_the_bound_that_the_rate_of_the_disturbance_gives(
    name, speed, omega
):
    """|d - d^| <= J / l, or 3 J / w, J = 2 omega, and half a period's change that sampling adds to
    each.
    """
    run = plant_b(observer(name, **{SPEED[name]: speed}), sine(2.0, omega))
    J = 2.0 * omega
    share = 3.0 if name == "extended_state" else 1.0
    miss = np.abs(2.0 * np.sin(omega * run.t[:-1]) - estimate(name, run))[3000:]
    assert miss.max() <= share * J / speed + J * H


@OBSERVERS
def test_a_gain_above_the_estimate_s_error_keeps_the_surface_though_it_is_far_below_the_disturbance(
    name,
):
    """d = 5 sin t: k = 1 > |d - d^|, and the residual is k's, not d's.

    Classical needs k > 5 and chatters with it.
    """
    d = sine(5.0, 1.0)
    ours = np.abs(slid(plant_b(observer(name, k=1.0, **{SPEED[name]: 60.0}), d))[8000:]).max()
    assert ours <= 2.0 * H * (1.0 + 3.0 * 5.0 / 60.0)
    for k in (1.0, 6.0):
        classical = np.abs(slid(plant_b(smc.law("classical", k=k, c=2.5), d))[8000:]).max()
        assert ours < classical / 3


def test_the_extended_state_law_s_observer_has_all_its_poles_where_it_says():
    """Without input its error moves by a matrix whose characteristic polynomial is (z - exp(-w
    h))^3.
    """
    for w, h in 10.0 ** np.random.default_rng(3).uniform((0, -4), (3, -1), (200, 2)):
        law = smc.law("extended_state", w=w)
        moved = np.empty((3, 3))
        for column in range(3):
            memory = np.zeros(law.memory)
            memory[0], memory[1 + column] = 1.0, h**-column  # so that the columns are of one size
            called(law, measured(dt=h, limit=0.0), memory)
            moved[:, column] = memory[1:4] * (1.0, h, h * h)
        pole = math.exp(-w * h)
        np.testing.assert_allclose(
            np.poly(moved),
            np.poly([pole] * 3),
            rtol=0,
            atol=1e-11,
        )


def test_the_extended_state_observer_s_loop_rings_above_nine_times_its_input_gain():
    """(g / b - 1) w^3 / (p + w)^3 has the gain margin 8; sampled at w h = 0.04 a little less."""
    law = smc.law(
        "extended_state",
        k=0.0,
        c=0.0,
        b=1.0,
    )
    for ratio, stable in (
        (8.0, True),
        (10.0, False),
    ):
        run = plant_b(
            law,
            constant(1.0),
            x=(0.0, 0.0),
            g=ratio,
            limit=50.0,
        )
        assert (np.abs(run.u[-500:] * ratio + 1.0).max() < 0.1) == stable


def test_the_disturbance_observer_s_loop_is_stable_just_where_its_condition_says():
    """g / b < 2 / (1 - exp(-l h)), 2.3 for l h = 2."""
    q = 1.0 - math.exp(-2.0)
    for ratio, stable in (
        (1.9 / q, True),
        (2.1 / q, False),
    ):
        law = smc.law(
            "disturbance_observer",
            k=0.0,
            c=0.0,
            b=1.0,
            l=2000.0,
        )
        run = plant_b(
            law,
            constant(1.0),
            x=(0.0, 0.0),
            g=ratio,
            duration=0.5,
            limit=50.0,
        )
        assert (np.abs(run.u[-50:] * ratio + 1.0).max() < 0.1) == stable


@OBSERVERS
def test_saturation_does_not_wind_the_estimate_up(name):
    """Thrown at 2 m/s with |u| <= 0.7, the estimate stays at the d there is, and the way back does
    not overshoot.
    """
    run = plant_b(
        observer(name, k=0.5, c=0.2), constant(0.3), x=(0.0, 2.0), limit=0.7, duration=50.0
    )
    assert (run.u == -0.7).sum() > 1000
    assert np.abs(estimate(name, run)[500:] - 0.3).max() < 1e-4
    assert run.x[:, 0].min() >= -1e-3
    assert run.residual() < 0.01


@OBSERVERS
def test_with_the_model_gravity_and_the_reference_s_acceleration_are_fed_forward_and_not_estimated(
    name,
):
    """At rest on a reference that accelerates with the plant's own f + g u, u is (r'' - f) / g and
    d^ stays 0.
    """
    law = smc.law(name)
    memory = np.zeros(law.memory)
    for _ in range(50):
        u, s = called(law, measured(f=-3.0, g=4.0, model=1.0)._replace(ddr=2.0), memory)
        assert u == pytest.approx((2.0 + 3.0) / 4.0, abs=1e-12)
        assert s == 0.0
        assert abs(memory[ESTIMATE[name]]) < 1e-12


def test_with_two_integrals_the_estimate_is_within_the_bound_of_the_second_derivative():
    """|d - z| <= J / l^2, J = 2 omega^2, and what sampling adds."""
    for speed, omega in ((20.0, 1.0), (60.0, 5.0)):
        rule = observer("second_order_disturbance_observer", k=0.0, l=speed)
        run = plant_b(rule, sine(2.0, omega))
        miss = np.abs(2.0 * np.sin(omega * run.t[1:]) - run.memory[1:, 3])[3000:]
        assert miss.max() <= 2.0 * omega**2 / speed**2 + 2.0 * omega * H


def test_with_two_integrals_a_smaller_switching_gain_keeps_the_surface():
    """k above J / l^2 does, where the observer of first order needs more than J' / l."""
    load = sine(2.0, 2.0)
    k = 1.5 * 8.0 / 20.0**2  # of J = 8 and l = 20
    for name, stays in (
        ("second_order_disturbance_observer", True),
        ("disturbance_observer", False),
    ):
        rule = observer(name, k=k, l=20.0)
        run = plant_b(rule, load, x=(0.0, 0.0), model=1.0, duration=20.0)
        assert (np.abs(slid(run))[15000:].max() < 0.005) == stays
