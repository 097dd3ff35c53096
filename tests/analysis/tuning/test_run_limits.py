"""Limits that searches keep: what they measure, what they cost, and that gains keep them."""

import dataclasses
import math

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.evaluator import Evaluator
from smc_mujoco.analysis.tuning.objective import FAILURE_COST, Objective, restored_objective
from smc_mujoco.analysis.tuning.run_limits import (
    LIMIT_COST,
    RunLimit,
    limits_in,
    only_limits,
    overshoot,
    quiet_until,
    swing,
)

BASE = smc.Scenario(plant="duffing", law=smc.law("pid", kp=30.0, ki=0.0, kd=1.0), duration=2.0)
STEPS = BASE.samples + 1


@pytest.mark.quick
def test_overshoot_is_of_the_way_and_only_before_an_event():
    goal = 0.2
    case = dataclasses.replace(BASE, reference=smc.Constant(goal), x0=1.2)
    x = np.full((STEPS, 1), goal)
    x[0] = 1.2
    x[300] = goal - 0.13
    assert overshoot(case, x) == pytest.approx(13.0)
    late = dataclasses.replace(case, fault=smc.Fault(0.25))
    assert overshoot(late, x) == 0.0
    pushed = dataclasses.replace(case, disturbance=(smc.signals.Impulse(1.0, time=0.31),))
    assert overshoot(pushed, x) == pytest.approx(13.0)
    assert overshoot(case, 2.0 * goal - x) == pytest.approx(13.0)  # from the other side


def test_runs_that_move_by_themselves_tell_nothing():
    noisy = dataclasses.replace(BASE, noise=smc.Noise(position=0.01))
    shaken = dataclasses.replace(BASE, disturbance=(smc.Sine(0.2, 5.0),))
    moved = dataclasses.replace(BASE, reference=smc.Sine(0.2, 5.0))
    constant = dataclasses.replace(BASE, disturbance=(smc.Constant(0.2),))
    assert [quiet_until(case) for case in (noisy, shaken, moved)] == [0.0, 0.0, 0.0]
    assert quiet_until(BASE) == quiet_until(constant) == 2.0
    assert math.isnan(overshoot(shaken, np.zeros((STEPS, 1))))
    assert math.isnan(swing(shaken, np.zeros((STEPS, 1))).share)


def test_a_swing_is_of_the_last_fifth_with_its_frequency():
    t = 1e-3 * np.arange(STEPS)
    u = np.where(t < 1.6, 5.0, 0.3 * np.sin(2.0 * np.pi * 20.0 * t))[:, None]
    measured = swing(BASE, u)
    assert measured.size == pytest.approx(0.6, rel=1e-2)
    assert measured.share == pytest.approx(0.6 / BASE.limits[0], rel=1e-2)
    assert measured.frequency == pytest.approx(20.0, rel=0.05)


def test_gains_that_break_a_limit_cost_more_than_any_that_keep_it_and_less_than_a_failure():
    """In every engine, by the same numbers."""
    goal = Objective(conditions=("nominal",), duration=1.0)
    with_limit = dataclasses.replace(goal, limits=(RunLimit("overshoot", 5.0),))
    gains = [(30.0, 0.1, 0.5), (30.0, 0.1, 9.0)]
    cases = goal.scenarios(BASE.plant, smc.law("pid"))
    names = ("kp", "ki", "kd")
    plain = Evaluator(goal, cases, names)(gains)
    bounded = Evaluator(with_limit, cases, names, by_equation=True)(gains)
    assert LIMIT_COST < bounded[0].objective < FAILURE_COST
    assert bounded[1] == plain[1]
    law = dataclasses.replace(
        cases[0].law, gains=dict(cases[0].law.gains) | dict(zip(names, gains[0], strict=True))
    )
    traces = [smc.run(dataclasses.replace(case, law=law)) for case in cases]
    assert with_limit.evaluation(cases[0], traces).objective == pytest.approx(bounded[0].objective)
    over = overshoot(cases[0], traces[0].x)
    assert bounded[0].objective - plain[0].objective == pytest.approx(LIMIT_COST * over / 5.0)


def test_an_objective_keeps_its_limits_in_a_file_and_without_any_says_nothing_of_them():
    assert "limits" not in Objective().describe()
    goal = dataclasses.replace(Objective(), limits=limits_in("overshoot<10,calm"))
    assert restored_objective(goal.describe()).limits == goal.limits


@pytest.mark.parametrize("needs", ["overshoot", "overshoot<0", "overshoot<x", "fast"])
def test_a_need_that_is_no_limit_is_refused(needs, refused):
    refused(lambda: only_limits(needs), "overshoot<10")


def test_a_limit_that_no_run_shows_is_refused(refused):
    refused(
        lambda: smc.tune("duffing", "pid", conditions=["noise"], needs="calm", searches=1),
        "no run shows",
        "nominal",
    )


def test_tuned_gains_keep_the_overshoot():
    """Where the same search without the limit goes far beyond it."""
    common = {"budget": 6, "searches": 1, "conditions": ["nominal"], "quick": True}
    cases = Objective(conditions=("nominal",)).scenarios(smc.plant("servo_axis"), smc.law("pid"))
    overshoots = {}
    for needs in (None, "overshoot<4"):
        tuned = smc.tune("servo_axis", "pid", needs=needs, **common)
        trace = smc.run(dataclasses.replace(cases[0], law=tuned.law))
        overshoots[needs] = overshoot(cases[0], trace.x)
    assert overshoots["overshoot<4"] <= 4.0 < overshoots[None]
