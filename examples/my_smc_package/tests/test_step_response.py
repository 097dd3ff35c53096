"""Tests that the package is found by name, that its plant obeys its equation, and that its law
brings it to a step.
"""

import numpy as np
import pytest

import smc_mujoco as smc


def test_the_catalogue_lists_the_entries():
    assert "arctan_switching" in smc.laws("sprung_cart")
    assert "sprung_cart" in smc.plants()


def test_the_law_brings_the_cart_to_a_step(step_response):
    r = step_response("sprung_cart", "arctan_switching", step=0.2, duration=4.0)
    r.check(settling_time=2.5, overshoot=5, ultimate_bound=0.01)


def test_noise_moves_the_cart_by_a_centimetre_at_most(step_response):
    r = step_response("sprung_cart", "arctan_switching", step=0.2, condition="noise", duration=4.0)
    r.check(ultimate_bound=0.01)


def test_the_cart_moves_as_its_equation_says():
    trace = smc.run(smc.Scenario(plant="sprung_cart", law="none", duration=1.0))
    p = smc.plant("sprung_cart").parameters
    acceleration = (-p["b"] * trace.v[:, 0] - p["k"] * trace.x[:, 0]) / p["M"]
    assert trace.v[-1, 0] - trace.v[0, 0] == pytest.approx(
        np.trapezoid(acceleration, trace.t), abs=1e-5
    )
