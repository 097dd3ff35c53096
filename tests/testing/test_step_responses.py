"""Step responses of the laws of the study, tested with the plugin as users test their laws."""

import json

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.testing import golden

pytestmark = pytest.mark.quick

STEP = 0.2  # rad or m
SETTLES = {  # s, chosen: a tenth above the slowest of the discontinuous laws
    "inverted_pendulum": 0.45,
    "van_der_pol": 2.0,
    "duffing": 1.35,
    "pendulum_network": 2.0,
    "inverted_pendulum_network": 1.3,
}


def law(plant, name):
    """A law with the study's gains."""
    return smc.law(name, **smc.paper.GAINS[plant][name])


@pytest.mark.smc(
    plants=["inverted_pendulum", "van_der_pol", "pendulum_network"], conditions=["sine", "heavy"]
)
@pytest.mark.parametrize("name", ["classical", "adaptive", "super_twisting"])
def test_discontinuous_laws_settle_whatever_the_load_and_stay_within_one_percent(
    step_response, plant, condition, name
):
    r = step_response(plant, law(plant, name), STEP, condition, duration=4.0)
    r.check(settling_time=SETTLES[plant], ultimate_bound=0.01 * STEP, max_u=smc.paper.U_MAX)


@pytest.mark.smc(
    plants=["inverted_pendulum", "duffing", "pendulum_network"], conditions=["nominal", "heavy"]
)
def test_the_observer_free_law_is_smooth_and_stops_short_of_a_place_that_takes_force_to_hold(
    step_response, plant, condition
):
    r = step_response(plant, law(plant, "observer_free"), STEP, condition, duration=4.0)
    r.check(steady_error=(0.04 * STEP, 0.16 * STEP), tv_rate=1.0, hf_share=0.05)


@pytest.mark.smc(plants=["inverted_pendulum", "van_der_pol"])
def test_super_twisting_varies_its_command_ten_times_less_than_the_classical_law(
    step_response, plant
):
    first, second = (
        step_response(plant, law(plant, name), STEP, duration=4.0)
        for name in ("classical", "super_twisting")
    )
    assert second.tv_rate < 0.1 * first.tv_rate


@pytest.mark.smc(plants=["duffing", "pendulum_network"])
def test_a_step_down_is_a_step_up_mirrored(step_response, plant):
    up, down = (
        step_response(plant, law(plant, "boundary_layer"), step, duration=2.0)
        for step in (STEP, -STEP)
    )
    assert down.trace.x == pytest.approx(-up.trace.x, abs=1e-9)


@pytest.mark.smc(plants=["inverted_pendulum", "duffing"])
def test_in_friction_the_boundary_layer_answers_as_it_always_has(step_response, smc_golden, plant):
    narrow = smc.law("boundary_layer", k=6.0, c=6.0, phi=0.3)
    r = step_response(plant, narrow, STEP, friction=smc.Coulomb(0.05), duration=4.0)
    smc_golden(
        r,
        settling_time=0.002,
        rise_time=0.002,
        overshoot=0.05,
        steady_error=1e-5,
        max_u=1e-3,
    )


def test_an_arm_steps_from_its_rest_on_every_joint(step_response):
    law = smc.law("computed_torque_sliding", k=60.0, c=10.0, width=0.5)
    r = step_response("panda", law, step=0.1, duration=1.0, friction=None)
    trace = r.trace
    rest = np.array(smc.plant("panda").rest)
    np.testing.assert_array_equal(trace.x[0], rest)
    np.testing.assert_allclose(trace.r - rest, 0.1)
    assert r.settling_time < 0.8
    assert np.abs(trace.x[-1] - rest - 0.1).max() < 1e-3


def test_a_metric_that_a_response_lacks_is_no_attribute(step_response):
    r = step_response("duffing", law("duffing", "boundary_layer"), STEP, duration=0.5)
    assert r.itae == r.metrics["itae"]
    assert "spread_bound" in CATALOGUE
    assert not hasattr(r, "spread_bound")


def test_with_tolerances_only_their_metrics_count(step_response, tmp_path):
    r = step_response("duffing", law("duffing", "boundary_layer"), STEP, duration=0.5)
    recorded_metrics = {
        "itae": {"value": r.itae, "tolerance": 0.0, "unit": "m s^2"},
        "max_u": {"value": 0.0, "tolerance": 0.0, "unit": "N"},
    }
    (tmp_path / "a.json").write_text(json.dumps({"one": recorded_metrics}))
    golden.compare_with_record(tmp_path / "a.json", "one", r, {"itae": 1e-9})
    with pytest.raises(AssertionError, match="max_u"):
        golden.compare_with_record(tmp_path / "a.json", "one", r, {})
    with pytest.raises(smc.ScenarioError, match="tolerance of itae"):
        golden.compare_with_record(tmp_path / "a.json", "one", r, {"itae": -1.0})
