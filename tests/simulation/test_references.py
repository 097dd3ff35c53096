"""References and how laws follow them: derivatives are exact, and with the model r'' is fed
forward.
"""

import dataclasses
import math

import numpy as np
import pytest
from helpers import reference
from helpers.runs import at_defaults

import smc_mujoco as smc
from smc_mujoco.control.law import law_catalogue
from smc_mujoco.simulation.signals import MinimumJerk, Ramp, Sine

REFERENCES = [
    Ramp(0.7, 0.3),
    Ramp(-2.0),
    MinimumJerk(1.5, 0.2, 0.9),
    MinimumJerk(-0.4, -0.1, 2.0),
    Sine(0.5, 3.0, 0.2),
]
# Laws of e and its rate, on any plant, that act: their theory is the same for every reference.
FOLLOWING = [
    n for n, t in law_catalogue().items() if t.relative_degree < 3 and not t.plants and n != "none"
]


def at(signal, t):
    """Value and both derivatives."""
    return np.array(type(signal).value(float(t), signal))


@pytest.mark.quick
@pytest.mark.parametrize("signal", REFERENCES, ids=repr)
def test_derivatives_are_those_of_the_value(signal):
    """Central differences of step h miss the slope by h^2/6 times a third derivative."""
    h = 1e-4
    for t in np.linspace(0.0, 2.0, 41) + 0.0123:  # no corner
        before, here, after = (at(signal, t + k * h) for k in (-1, 0, 1))
        np.testing.assert_allclose((after[:2] - before[:2]) / (2 * h), here[1:], atol=1e-5)


def test_a_ramp_is_zero_then_a_line():
    ramp = Ramp(0.7, 0.3)
    assert at(ramp, 0.299).tolist() == [0.0, 0.0, 0.0]
    assert at(ramp, 0.3).tolist() == [0.0, 0.7, 0.0]
    assert at(ramp, 10.3) == pytest.approx([7.0, 0.7, 0.0])


def test_minimum_jerk_moves_from_rest_to_rest_and_stays():
    move = MinimumJerk(1.5, 0.2, 0.9)
    for t in (-1.0, 0.0, 0.2):
        assert at(move, t).tolist() == [0.0, 0.0, 0.0]
    for t in (1.1 + 1e-12, 5.0):
        assert at(move, t) == pytest.approx([1.5, 0.0, 0.0], abs=1e-12)
    # halfway: 15/8 of the mean speed
    assert at(move, 0.65) == pytest.approx([0.75, 1.5 * 1.875 / 0.9, 0.0])


def test_no_other_move_between_the_same_rests_has_less_jerk():
    """The integral of the squared third derivative: 720 A^2/T^5, and more for the quintic plus any
    a^3 (1 - a)^3.
    """
    move = MinimumJerk(1.0, 0.0, 1.0)
    h = 1e-3
    t = np.arange(0.0, 1.0 + h / 2, h)
    ddr = np.array([at(move, ti)[2] for ti in t])
    bump = 6 * t - 36 * t**2 + 60 * t**3 - 30 * t**4  # second derivative of a^3 (1 - a)^3

    def jerk(acceleration):
        return np.sum(np.diff(acceleration) ** 2) / h

    assert jerk(ddr) == pytest.approx(720.0, rel=1e-4)
    for size in (-0.5, -0.1, 0.1, 0.5):
        assert jerk(ddr + size * bump) > jerk(ddr)


@pytest.mark.parametrize("signal", [Ramp(0.1, 0.05), MinimumJerk(0.4, 0.05, 0.3)], ids=repr)
def test_a_reference_is_followed_alike_in_both_loops(signal):
    scenario = smc.Scenario(
        plant="pendulum_network",
        law=smc.law("computed_torque"),
        model="nominal",
        reference=signal,
        duration=0.5,
    )
    fast = smc.run(scenario)
    slow = reference.run(scenario)
    for name in ("x", "v", "u", "r"):
        np.testing.assert_array_equal(getattr(fast, name), getattr(slow, name))
    np.testing.assert_array_equal(fast.r[:, 0], [at(signal, t)[0] for t in fast.t])
    again = dataclasses.replace(scenario, reference=dataclasses.replace(signal))
    assert again == scenario


# laws that follow


def test_the_reference_s_acceleration_is_fed_forward_with_the_model_and_only_with_it():
    """u changes by r''/g with the model; published model-free laws do not know r''.

    At the top of a sine r is the same at every frequency, r' is 0 and r'' = -r omega^2.
    """
    common = {
        "plant": smc.plant("duffing", M=0.625),
        "x0": 0.3,
        "v0": -0.2,
        "duration": 1e-3,
        "u_max": math.inf,
    }
    for model, expected in (
        ("nominal", -0.2 * (5.0**2 - 1.0) * 0.625),
        ("none", 0.0),
    ):
        slow, quick = (
            smc.run(
                [
                    smc.Scenario(
                        law=at_defaults(law),
                        model=model,
                        reference=Sine(0.2, omega, math.pi / 2),
                        **common,
                    )
                    for law in FOLLOWING
                ]
            )
            for omega in (1.0, 5.0)
        )
        changes = {}
        for name, a, b in zip(FOLLOWING, slow, quick, strict=True):
            changes[name] = b.u[0, 0] - a.u[0, 0]
        assert changes == pytest.approx(dict.fromkeys(FOLLOWING, expected), abs=1e-9)
