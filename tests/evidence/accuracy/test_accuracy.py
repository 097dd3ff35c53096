"""What `accuracy` promises: theory's exponents, the order of laws, and remarks on all others."""

import dataclasses
import math

import pytest
from helpers.runs import free_mass

import smc_mujoco as smc
from smc_mujoco.control.law import all_laws, law_catalogue
from smc_mujoco.evidence.accuracy import orders
from smc_mujoco.simulation.conditions import Condition

PERIODS = (4e-3, 2e-3, 1e-3, 5e-4)
SHORT = {"periods": PERIODS, "seeds": 1, "duration": 8.0}


def promised(found):
    """Whether an order is within 0.2 of theory's."""
    return abs(found.order - found.theory) <= 0.2


def defaults(names, **options):
    return smc.accuracy.orders(names, free_mass(), gains="default", **SHORT | options)


@smc.law_function(gains={"k": 4.0, "c": 2.5}, accuracy={"s": 1, "e": 1})
def my_relay(y, gains, memory):
    s = y.de + gains.c * y.e
    return (-gains.k if s > 0.0 else gains.k), s


@smc.law_function
def pushing_away(y, gains, memory):
    return 6.0 if y.e > 0.0 else -6.0, y.e


@pytest.mark.quick
def test_every_law_states_its_order_of_accuracy():
    orders = {}
    for name, law in all_laws().items():
        for q in ("s", "e"):
            orders[(name, q)] = law.order(q, law.defaults)
    assert {
        which: order for which, order in orders.items() if order is None or not order >= 0.0
    } == {}


@pytest.mark.slow
def test_second_order_laws_are_of_second_order_on_the_double_integrator_or_the_table_says_why_not():
    names = []
    for name, law in law_catalogue().items():
        if law.order("s", law.defaults) == 2.0:
            names.append(name)
    table = defaults(names)
    for row in table:
        assert promised(row.s) or "which is rounding" in row.s.why, str(table)
    assert sum(promised(row.s) for row in table) > len(names) / 2


@pytest.mark.slow
def test_relays_are_of_first_order_and_layers_of_none():
    table = defaults(["classical", "boundary_layer", my_relay])
    orders = {}
    for row in table:
        orders[row.law] = (row.s.order, row.s.theory)
    assert orders["classical"] == pytest.approx((1.0, 1.0), abs=0.1)
    assert orders["boundary_layer"] == pytest.approx((0.0, 0.0), abs=0.01)
    assert orders["my_relay"] == pytest.approx(orders["classical"], abs=1e-6)
    assert [row.law for row in table][-1] == "boundary_layer"


def test_laws_that_fail_come_last_and_say_so():
    table = defaults(
        [pushing_away, "boundary_layer"], duration=4.0, starts=smc.starts(x0=1e6 - 10.0)
    )
    failing = table[-1]
    assert failing.law == "pushing_away"
    assert failing.failed == failing.runs == 4
    assert "4 of 4 runs failed" in failing.why
    assert failing.error(0) == "failed"
    assert math.isnan(failing.e.order)


def test_theory_promises_nothing_behind_a_drive():
    drive = smc.condition("slow valve", actuator=smc.Lag(0.02))
    row = smc.accuracy.orders("twisting", "duffing", (4e-3, 2e-3), drive, seeds=1, duration=10.0)[0]
    assert row.e.theory is None
    assert "no promise behind a drive" in row.why
    assert abs(row.e.order) < 0.5, "the lag, not the period, sets the amplitude"


def test_every_period_has_every_start():
    fine = smc.condition("fine", physics_step=2.5e-4)
    setup = orders._setup(
        smc.plant("duffing"), fine, "twisting", (4e-3, 2e-3), (3, 5), "tuned", 1.5, None
    )
    runs = []
    for scenario in setup.scenarios:
        runs.append(
            (scenario.seed, scenario.control_period, scenario.physics_step, scenario.duration)
        )
    steps = []
    for seed in (3, 5):
        for period in (4e-3, 2e-3):
            steps.append((seed, period, 2.5e-4, 1.5))
    assert runs == steps
    assert setup.periods == (4e-3, 2e-3)
    assert setup.starts == 2


def test_laws_without_tuned_gains_get_their_defaults_and_the_table_says_so():
    table = smc.accuracy.orders(
        ["hierarchical"], "cart_pole", (4e-3, 2e-3), "nominal", seeds=2, duration=1.0
    )
    assert table[0].gains == "default"
    assert "nominal: |e| in m, gains: default" in str(table)

    beside = type(table)([table[0], dataclasses.replace(table[0], law="pid", gains="shipped")])
    assert "gains: default for hierarchical, shipped for pid" in " ".join(str(beside).split())


IDEAL = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=8.0)
PROMISED = [  # change of the run, what keeps theory from promising an order
    ({"actuator": smc.Lag(0.01)}, "drive"),
    ({"input_delay": 1e-3}, "delay"),
    ({"clock": smc.Clock(jitter=1e-4)}, "late"),
    ({"noise": smc.Noise(1e-3)}, "noise"),
    ({"sensor": smc.Encoder(counts=4096)}, "encoder"),
    ({"velocity": smc.estimator("filtered_difference")}, "velocity"),
    ({"law": smc.law("nested_third_order")}, "relative degree"),
]


@pytest.mark.parametrize(("change", "reason"), PROMISED, ids=lambda given: str(given)[:20])
def test_theory_promises_an_order_only_to_ideal_channels_of_the_law_s_relative_degree(
    change, reason
):
    assert reason in orders._why_no_promise(dataclasses.replace(IDEAL, **change))
    assert not orders._why_no_promise(IDEAL)


PERIOD = Condition("slow", lambda plant, duration: {"control_period": 0.01})


@pytest.mark.parametrize(
    ("name", "value", "word"),
    [
        ("periods", [1e-3], "[0.001]"),
        ("periods", [1e-3, 1e-3], "[0.001, 0.001]"),
        ("periods", [1e-3, 0.0], "period is 0"),
        ("seeds", 0, "seeds is 0"),
        ("seeds", 10_001, "10001"),
        ("conditions", PERIOD, "control_period"),
        ("conditions", "nois", "'nois'"),
    ],
)
def test_what_has_no_order_is_refused(name, value, word, refused):
    refused(lambda: smc.accuracy.orders("classical", "duffing", **{name: value}), word)
