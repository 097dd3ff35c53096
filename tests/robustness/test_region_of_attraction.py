"""Regions of attraction: early leaving changes no verdict, and the analytic limits hold."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis import linear_theory
from smc_mujoco.analysis.engine import scored_runs
from smc_mujoco.control.law import Law
from smc_mujoco.robustness import region_of_attraction as maps
from smc_mujoco.robustness.region_of_attraction import CONVERGES, DOES_NOT, UNDECIDED, Basin


@pytest.fixture(autouse=True, scope="module")
def engine_for_short_runs():
    """So short runs are MuJoCo's elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scored_runs, "MIN_WORK", 0)
        yield


PENDULUM = smc.plant("inverted_pendulum")
WEAK = smc.law("observer_free", lam=1.5, k1=9.0)  # N m, of the 2.45 that hold a pendulum anywhere


def base(plant: str, law: Law, duration: float = 6.0, integrator="implicitfast") -> smc.Scenario:
    """A run by MuJoCo. The fast engine, which compiles for seconds, makes those by RK4."""
    return smc.Scenario(plant=plant, law=law, duration=duration, integrator=integrator)


def to_the_end(scenario, x, v):
    """The map of whole runs, none of which is decided early."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(maps, "HORIZONS", maps.HORIZONS[-1:])
        return maps.basin_of(scenario, x, v)


@pytest.fixture(scope="module")
def weak():
    """The inverted pendulum under a law that cannot lift it from everywhere."""
    fast = base("inverted_pendulum", WEAK, integrator="RK4")
    return maps.basin_of(fast, np.linspace(-1.5, 1.5, 12), np.linspace(-4.5, 4.5, 12))


@smc.law_function
def counts_no_turns(y, gains, memory):
    return -6.0 * math.tanh(y.de + 3.0 * math.sin(y.e)), y.de


# verdicts


def verdict(first, second, final, start=1.0, v=0.0, u=(0.0, 0.0), u_max=6.0, **ended):
    """The verdict on a run that is at `start`, then in both halves of the part that counts at
    `first` and `second`.

    X is 2 m and V 4 m/s, so that the band is 0.04 m and 0.08 m/s.
    """
    t = np.arange(301.0)
    late = t >= (240 if final else 201)
    second_half = t >= (270 if final else 251)
    x = np.where(second_half, second, np.where(late, first, start))
    signals = {
        "x": x,
        "v": np.where(late, v, 0.0),
        "u": np.where(second_half, *reversed(u)),
        "r": 0.0 * t,
    }
    scenario = SimpleNamespace(resolved=SimpleNamespace(u_max=u_max))
    columns = {}
    for name, values in signals.items():
        columns[name] = values[:, None]
    trace = SimpleNamespace(
        t=t,
        **columns,
        scenario=scenario,
        **{"failure": None, "diverged_at": None} | ended,
    )
    return maps.verdict_of(trace, np.array([-2.0, 1.0]), np.array([0.5, -4.0]), final)


@pytest.mark.quick
def test_an_early_verdict_needs_a_run_that_approaches_rests_or_fails():
    approaching = 0.03 * math.sqrt(0.9)
    assert [verdict(0.03, q * approaching, False) for q in (0.9999, 1.0001)] == [CONVERGES, None]
    assert [verdict(1e-4, x, False) for x in (0.00399, 0.00401)] == [CONVERGES, None]
    # it began near
    assert (
        verdict(
            1e-4,
            0.003,
            False,
            start=0.003,
        )
        is None
    )
    near = (0.99e-6, 1.01e-6)
    rests = [verdict(0.5, 0.5 + 2.0 * q, False) for q in near]
    for q in near:
        rests.append(verdict(0.5, 0.5, False, u=(1.0, 1.0 + 6.0 * q)))
    for q in near:
        rests.append(
            verdict(
                0.5,
                0.5,
                False,
                u=(2.0, 2.0 + 2.0 * q),
                u_max=math.inf,
            )
        )
    assert rests == [DOES_NOT, None] * 3
    assert verdict(0.03, 0.03, False) is None  # at rest in the band
    assert (
        verdict(0.0, 0.0, False, failure="raised")
        == verdict(0.0, 0.0, True, diverged_at=3.0)
        == DOES_NOT
    )


def test_a_law_below_the_smallest_lambda_converges_from_nowhere_else():
    law = smc.law("observer_free", lam=0.2, k1=3.0)
    assert law.gains["lam"] < linear_theory.smallest_lam(smc.plant("duffing"), 3.0)
    basin = maps.basin_of(base("duffing", law, 20.0), [-1.5, -0.5, 0.5, 1.5], [-1.0, 1.0])
    assert (basin.outcome == DOES_NOT).all()


def test_a_run_that_still_approaches_at_the_end_is_undecided():
    """The law is stable, with a slow pole at -0.35 /s, and 6 s are too short for it."""
    slow = base("duffing", smc.law("observer_free", lam=1.98, k1=0.83))
    assert np.roots([1.0, 0.2 + 1.98, -1.0 + 1.98 * 0.83]).max() == pytest.approx(-0.35, abs=0.005)
    assert (to_the_end(slow, [-1.5, 1.5], [0.0]).outcome == UNDECIDED).all()
    assert (
        maps.basin_of(dataclasses.replace(slow, duration=20.0), [-1.5, 1.5], [0.0]).outcome
        == CONVERGES
    ).all()


def test_a_run_that_leaves_slowly_does_not_converge_early():
    lam, k1 = 0.95, 1.0  # growing by 0.04 per s
    plant = smc.plant("duffing")
    assert lam < linear_theory.smallest_lam(plant, k1)
    slow = base("duffing", smc.law("observer_free", lam=lam, k1=k1), 10.0)
    basin = maps.basin_of(slow, [-3.0, -0.05, -0.02, 0.02, 0.05, 3.0], [-9.0, 0.0, 9.0])
    assert (basin.outcome[1] != CONVERGES).all()


def test_rest_a_turn_away_does_not_converge_and_the_way_back_from_there_takes_time():
    basin = maps.basin_of(
        base("inverted_pendulum", counts_no_turns, 3.0), [0.0, 2 * math.pi], [0.0]
    )
    assert basin.outcome.tolist() == [[CONVERGES, DOES_NOT]]
    for duration, outcome in (
        (3.0, UNDECIDED),
        (6.0, CONVERGES),
    ):
        basin = maps.basin_of(
            base("inverted_pendulum", smc.law("lqr"), duration), [2 * math.pi], [0.0]
        )
        assert basin.outcome.tolist() == [[outcome]]


def test_mujoco_decides_as_the_fast_engine_does(weak):
    assert weak.checked == "MuJoCo repeated 20 states, 0 with another outcome"
    fourths = slice(1, None, 4)
    basin = maps.basin_of(base("inverted_pendulum", WEAK), weak.x[fourths], weak.v[fourths])
    assert basin.checked == ""
    # the grid of fewer states has a smaller reach, so a run may be decided at another time
    assert (basin.outcome == weak.outcome[fourths, fourths]).all()


# analytic limits


def test_beyond_the_angle_that_the_torque_can_hold_a_pendulum_at_rest_falls():
    p = PENDULUM.parameters
    limit = math.asin(WEAK.gains["lam"] / (p["m"] * p["grav"] * p["l"]))
    basin = maps.basin_of(
        base("inverted_pendulum", WEAK), [0.9 * limit, 1.02 * limit, 2.0 * limit], [0.0, 9.0]
    )
    assert basin.outcome[0].tolist() == [CONVERGES, DOES_NOT, DOES_NOT]


def test_a_pendulum_beyond_the_saddle_of_full_torque_comes_back_only_by_a_swing(weak):
    """With u = -U, only friction changes E = J v^2 / 2 + m grav l cos x + U x; another u lowers it
    on the way.

    So there is no way back from beyond the saddle with less than its E. With more, a pendulum
    swings down and back.
    """
    p = PENDULUM.parameters
    torque = WEAK.gains["lam"]
    inertia = p["m"] * p["l"] ** 2
    weight = p["m"] * p["grav"] * p["l"]
    saddle = math.asin(torque / weight)
    x, v = np.meshgrid(weak.x, weak.v)
    energy = inertia * v**2 / 2 + weight * np.cos(x) + torque * np.abs(x)
    beyond = np.abs(x) > saddle
    low = energy < weight * math.cos(saddle) + torque * saddle
    assert (beyond & low).sum() > 10
    assert (weak.outcome[beyond & low] == DOES_NOT).all()
    assert (weak.outcome[beyond & ~low] == CONVERGES).any()


# files and pictures


def test_a_map_survives_its_file(weak, tmp_path):
    again = maps.load_basin(weak.save(tmp_path / "map.json"))
    for field in dataclasses.fields(Basin):
        assert np.array_equal(getattr(again, field.name), getattr(weak, field.name))
    assert again.outcome.dtype == np.int8
    assert repr(again).startswith(f"Basin({weak.law} on {weak.plant}: ")
    assert len(repr(again)) < 200


def test_few_states_are_left_to_mujoco_which_takes_less_than_compiling(monkeypatch):
    monkeypatch.setattr(scored_runs, "MIN_WORK", 10**9)
    monkeypatch.setattr(maps, "FormGroup", None)  # so the engine would fail
    fast = base("inverted_pendulum", WEAK, 1.0, "RK4")
    few = maps.basin_of(fast, np.linspace(-1.5, 1.5, 6), np.linspace(-4.5, 4.5, 6))
    assert few.checked == ""
