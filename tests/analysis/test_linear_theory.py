"""Theory at rest against MuJoCo, on the study's five plants; its closed forms against
eigenvalues.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import smc_mujoco as smc
from smc_mujoco.analysis import linear_theory
from smc_mujoco.control import gain_sets as gains
from smc_mujoco.control.law import Law
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import steady_error
from smc_mujoco.simulation import gaber_study

H = 1e-3  # s, control period
SMALL = 1e-4  # of the plant's x0: there tanh is linear to 1e-8
PLANTS = [smc.plant(name) for name in gaber_study.PLANTS]
each_plant = pytest.mark.parametrize("plant", PLANTS, ids=lambda p: p.name)


def growth(plant: Plant, lam: float, k1: float, control_period: float, periods: int = 0) -> float:
    """Return the growth per period of the loop with a delay of whole control periods, in the end:
    stable below 1.

    The largest |eigenvalue| of (x, x', u_-1, .. u_-m), worst mode.
    """
    linear_model = linear_theory.linear(plant)
    largest = 0.0
    for stiffness in linear_model.modes:
        e, gamma = linear_theory.sampled_mode(linear_model, stiffness, control_period)
        transition = np.zeros((2 + periods, 2 + periods))
        transition[:2, :2] = np.eye(2) + e
        if periods:
            transition[:2, -1] = gamma
            transition[2, :2] = -lam * k1, -lam
            transition[3:, 2:-1] = np.eye(periods - 1)
        else:
            transition -= lam * np.outer(gamma, (k1, 1.0))
        largest = max(largest, float(np.abs(np.linalg.eigvals(transition)).max()))
    return largest


def own(plant: Plant, name: str = "observer_free") -> Law:
    return gains.law_with_gains(plant.name, name, "study")


def from_near_rest(
    plant: Plant, law: Law, delay: float = 0.0, duration: float = 24.0
) -> np.ndarray:
    """|x| of the worst channel at the samples, after a push that leaves every mode moving."""
    x0 = [SMALL * x for x in plant.x0]
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law=law,
            x0=x0,
            input_delay=delay,
            duration=duration,
        )
    )
    return np.abs(trace.x).max(axis=1)


def grows(size: np.ndarray) -> bool:
    """Whether the envelope of the last third is above that of the second."""
    third = len(size) // 3
    return bool(size[-third:].max() > size[-2 * third : -third].max())


# what a plant is at rest


@pytest.mark.quick
def test_a_single_pendulum_has_its_textbook_coefficients():
    p = smc.plant("inverted_pendulum").parameters
    linear_model = linear_theory.linear(smc.plant("inverted_pendulum"))
    assert linear_model.inertia == pytest.approx(p["m"] * p["l"] ** 2)
    assert linear_model.damping == pytest.approx(p["b"])
    assert linear_model.modes == pytest.approx([-p["m"] * p["grav"] * p["l"]])


def test_a_network_has_the_modes_of_its_path_graph():
    plant = smc.plant("pendulum_network", n=7)
    p = plant.parameters
    graph = 2.0 - 2.0 * np.cos(np.pi * np.arange(7) / 7)  # its Laplacian's eigenvalues
    assert linear_theory.linear(plant).modes == pytest.approx(
        p["m"] * p["grav"] * p["l"] + p["kc"] * graph
    )


# smallest lambda


@pytest.mark.slow
@each_plant
def test_the_measured_smallest_lambda_is_the_one_of_theory_within_one_percent(plant):
    k1 = own(plant).gains["k1"]
    least = linear_theory.smallest_lam(plant, k1)
    if least == 0.0:  # any lambda stabilises it
        assert plant.name == "pendulum_network"
        assert not grows(from_near_rest(plant, smc.law("observer_free", lam=1e-3, k1=k1)))
        return
    assert grows(from_near_rest(plant, smc.law("observer_free", lam=0.99 * least, k1=k1)))
    assert not grows(from_near_rest(plant, smc.law("observer_free", lam=1.01 * least, k1=k1)))


@each_plant
def test_sampling_fast_leaves_the_smallest_lambda_and_bounds_the_largest(plant):
    k1 = own(plant).gains["k1"]
    h = 1e-6
    # above: v+ = -v
    low, high = linear_theory.smallest_lam(plant, k1), 2.0 * linear_theory.linear(plant).inertia / h
    for lam, stable in (
        (low * 1.00001 + 1e-9, True),
        (0.99999 * low, False),
        (0.999 * high, True),
        (1.001 * high, False),
    ):
        assert (linear_theory.critical_delay(plant, lam, k1, h) > 0.0) == stable


# critical delay


@pytest.mark.slow
@each_plant
def test_the_measured_critical_delay_is_the_one_of_theory_within_one_control_period(plant):
    law = own(plant)
    critical = linear_theory.critical_delay(plant, law.gains["lam"], law.gains["k1"], H)
    periods = math.ceil(critical / H) - 1  # the last one that is stable
    assert not grows(from_near_rest(plant, law, delay=periods * H))
    assert grows(from_near_rest(plant, law, delay=(periods + 1) * H))


def test_the_theory_is_that_of_a_saturated_laws_middle_too():
    plant = smc.plant("inverted_pendulum")
    law = own(plant, "boundary_layer")
    critical = linear_theory.critical_delay(
        plant, *linear_theory.linear_gains(law) or (0.0, 0.0), H
    )
    periods = math.ceil(critical / H) - 1
    assert not grows(from_near_rest(plant, law, delay=periods * H))
    assert grows(from_near_rest(plant, law, delay=(periods + 1) * H))


@each_plant
def test_holding_the_command_costs_half_a_period_of_delay(plant):
    law = own(plant)
    few, more = (
        linear_theory.critical_delay(plant, law.gains["lam"], law.gains["k1"], h)
        for h in (1e-4, 1e-3)
    )
    assert few - more == pytest.approx(4.5e-4, abs=2e-6)


@settings(max_examples=40)
@given(
    plant=st.sampled_from(PLANTS),
    lam=st.floats(0.05, 40.0),
    k1=st.floats(0.2, 30.0),
    h=st.sampled_from([1e-3, 5e-3, 0.02, 0.1]),
)
def test_the_closed_form_of_the_critical_delay_agrees_with_eigenvalues(plant, lam, k1, h):
    critical = linear_theory.critical_delay(plant, lam, k1, h) / h
    # of the unstable ones, in periods
    if critical:
        first = math.ceil(min(critical, 60.0) + 1e-9)
    else:
        first = 0
    for periods in {0, 1, 2, 3, 7, 12, first - 1}:
        if 0 <= periods < first:
            assert growth(plant, lam, k1, h, periods) < 1.0 + 1e-9
    if critical < 60.0:
        assert growth(plant, lam, k1, h, first) > 1.0 - 1e-9


# at rest under a constant disturbance


@each_plant
def test_the_measured_steady_error_is_the_one_of_theory_within_one_percent(plant):
    d = 0.2
    law = own(plant)
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law=law,
            disturbance=smc.Constant(d),
            x0=0.01,
            duration=15.0,
        )
    )
    measured = steady_error(trace)
    assert measured == pytest.approx(
        linear_theory.steady_error(plant, law.gains["lam"], law.gains["k1"], d), rel=0.01
    )


@each_plant
def test_under_the_tolerated_force_the_plant_comes_to_rest_at_the_limit(plant):
    law = own(plant)
    most = 0.02
    push = smc.Constant(linear_theory.tolerated_force(plant, law, most) or math.nan)
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law=law,
            disturbance=push,
            x0=0.01,
            duration=15.0,
        )
    )
    assert steady_error(trace) == pytest.approx(most, rel=1e-3)


@settings(max_examples=15)
@given(plant=st.sampled_from(PLANTS), k1=st.floats(1.0, 10.0), most=st.floats(1e-3, 0.5))
def test_the_tolerated_force_is_the_largest_up_to_the_limit(plant, k1, most):
    """Of the law's pull less the plant's own, on a grid that ends at `most`."""
    law = smc.law("observer_free", lam=5.0, k1=k1)
    force = linear_theory.restoring_force(plant, law)
    assert force is not None
    rises = force(np.linspace(0.0, most, 2_001)[1:])
    first = int(np.argmax(np.r_[np.diff(rises) < 0.0, True]))
    assert linear_theory.tolerated_force(plant, law, most) == pytest.approx(
        max(rises[first], 0.0), rel=1e-6, abs=1e-9
    )


def test_beyond_what_the_law_can_hold_a_pendulum_rests_nowhere():
    plant = smc.plant("inverted_pendulum")
    law = smc.law("observer_free", lam=2.0, k1=9.7)
    summit = linear_theory.tolerated_force(plant, law, 3.0)
    assert summit is not None
    for factor in (0.99, 1.01):
        push = smc.Constant(factor * summit)
        trace = smc.run(
            smc.Scenario(
                plant=plant,
                law=law,
                x0=0.1,
                disturbance=push,
                duration=20.0,
            )
        )
        assert (abs(trace.x[-1, 0]) < 0.5) == (factor < 1.0)
