"""Problems: everybody draws the same instances, and measures say what they say."""

import dataclasses
import hashlib
import math

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.control.law import law_function
from smc_mujoco.problems import problem as problems

pytestmark = pytest.mark.quick

SEED = int("0123456789abcdef" * 4, 16)
WORD = 2**64


def philox(key: int, counter: int) -> list[int]:
    """The four words of a block of Philox4x64-10, from the paper:

    Salmon, Moraes, Dror, Shaw, SC 2011.
    """
    c0, c1, c2, c3 = ((counter >> 64 * i) % WORD for i in range(4))
    k0 = key % WORD
    k1 = key >> 64
    for _ in range(10):
        a = 0xD2E7470EE14C6C93 * c0
        b = 0xCA5A826395121157 * c2
        c0, c1, c2, c3 = (b >> 64) ^ c1 ^ k0, b % WORD, (a >> 64) ^ c3 ^ k1, a % WORD
        k0, k1 = (k0 + 0x9E3779B97F4A7C15) % WORD, (k1 + 0xBB67AE8584CAA73B) % WORD
    return [c0, c1, c2, c3]


@pytest.mark.parametrize(
    ("name", "index", "seed"),
    [
        ("van_der_pol/noise@1", 0, 0),
        ("pendulum_network/heavy@1", 7, 0),
        ("furuta/sine@1", 123_456, SEED),
    ],
)
def test_an_instance_is_drawn_as_the_rules_say(name, index, seed):
    number = "0123456789abcdef" * 4 if seed else ""
    key = int(hashlib.sha256((name + number).encode()).hexdigest()[:32], 16)
    words = philox(key, 4096 * index + 1) + philox(key, 4096 * index + 2)
    side, start, mass, disturbance, of_run, *_ = words
    drawn = smc.problem(name).instance(index, seed)
    assert drawn == problems.Instance(
        side=-1.0 if side < WORD // 2 else 1.0,
        start=pytest.approx(0.7 + 0.6 * start / WORD, rel=1e-14),
        mass=pytest.approx(0.85 + 0.3 * mass / WORD, rel=1e-14),
        disturbance=pytest.approx(0.5 + disturbance / WORD, rel=1e-14),
        seed=of_run % 2**52,
    )


def test_a_scenario_has_what_its_instance_drew_and_the_rules_bounds():
    for name, field in (
        ("duffing/sine@1", "amplitude"),
        ("duffing/process_noise@1", "sigma"),
    ):
        problem = smc.problem(name)
        drawn, (scenario,) = problem.instance(5, SEED), problem.scenarios("pid", [5], SEED)
        assert scenario.x0 == (drawn.side * drawn.start * 1.5,)
        assert scenario.mismatch == {"mass": drawn.mass}
        assert scenario.seed == drawn.seed
        assert getattr(scenario.disturbance[0], field) == 0.2 * drawn.disturbance
        assert scenario.u_max == problem.u_max
        assert scenario.duration == problem.duration
        assert scenario.control_period == 1e-3
        assert scenario.condition == problem.condition
    small = smc.problem("furuta/sine@1")  # whose u_max is 1/120 of the other machines'
    (scenario,) = small.scenarios("none", [5], SEED)
    amplitude = 0.2 / 120 * small.instance(5, SEED).disturbance
    assert scenario.disturbance[0].amplitude == pytest.approx(amplitude)
    (heavy,) = smc.problem("duffing/heavy@1").scenarios("pid", [3])
    assert heavy.mismatch == {
        "mass": pytest.approx(1.3 * smc.problem("duffing/heavy@1").instance(3).mass)
    }


def test_a_problem_with_an_adversary_has_the_rules_of_the_adversary():
    worst = problems.rules(1)["worst"]
    attacked = problems.problem("duffing/worst_forces@1")
    assert attacked.budget == worst["budget"]
    assert attacked.visible == worst["visible"] != problems.rules(1)["visible"]
    assert problems.problem("duffing/noise@1").budget == 1


@pytest.mark.parametrize(
    ("condition", "fields"),
    [
        ("wind", lambda k: {"disturbance": (smc.signals.Wind(3.0 * k),)}),
        ("gust", lambda k: {"disturbance": (smc.signals.Wind(6.0 * k, time=4.5, width=1.0),)}),
        ("payload", lambda k: {"mismatch": {"payload": 0.006 * k, "mass": 1.0}}),
        (
            "slow_rotors",
            lambda k: {"mismatch": {"rise": 0.625, "fall": 0.625, "mass": 1.0}},
        ),
    ],
)
def test_an_instance_of_flight_scales_what_its_condition_adds_and_its_distance_from_rest(
    condition, fields
):
    problem = smc.problem(f"quadrotor/{condition}@2")
    drawn, (scenario,) = problem.instance(3), problem.scenarios("geometric", [3])
    far = 0.2 * drawn.side * drawn.start
    assert scenario.x0 == pytest.approx((far, -far, 1.0 - far, 0.0, 0.0, 2.0 * far), abs=1e-15)
    assert {name: getattr(scenario, name) for name in fields(1.0)} == fields(drawn.disturbance)
    assert scenario.limits == smc.plant("quadrotor").limits
    assert scenario.samples == 6000


def test_calm_of_flight_is_of_the_rotors_commands():
    problem = smc.problem("quadrotor/wind@2")
    trace = smc.run(problem.scenarios("none", [0])[0])
    applied = np.zeros_like(trace.applied)
    # half of a rotor's bound; of the last channel there is no rotor
    applied[::2, 2], applied[::2, 5] = 0.06, 1.0
    assert problem.measures(dataclasses.replace(trace, applied=applied))["calm"] == pytest.approx(
        6000 * 0.5 / 6.0
    )


def test_visible_instances_are_the_first_and_a_name_has_its_best_shipped_gains():
    problem = smc.problem("duffing/noise@1")
    visible = problem.scenarios("pid")
    assert visible == problem.scenarios("pid", range(15))
    assert len({scenario.seed for scenario in visible}) == 15
    assert visible[7].law.source.kind == "shipped"


def made_trace(one: problems.Problem, e: np.ndarray, u: np.ndarray) -> smc.Trace:
    """A trace of a problem's first instance with errors, relative to the start, and commands."""
    (scenario,) = one.scenarios("pid", [0])
    trace = smc.run(scenario)
    return dataclasses.replace(trace, x=(e * trace.x[0, 0])[:, None], u=u[:, None])


def test_measures_by_hand():
    problem = smc.problem("duffing/noise@1")
    vars(problem)["_frozen"] = {
        "accuracy": [0.01, 0.1],
        "settling": [1.5, 2.5],
        "calm": [0.4, 0.6],
    }
    e = np.where(np.arange(4001) < 1000, 1.0, 0.05)  # 5 % of the start from 1 s on
    # eight changes by 1.5 in 4 s, of 6: 1/2 per second
    u = np.where(np.arange(4001) % 1000 < 500, 0.0, 1.5)
    measures = problem.measures(made_trace(problem, e, u))
    itae = 0.5 + 0.05 * (16 - 1) / 2  # the integral of t |e|
    assert measures == {
        "failed": 0.0,
        "accuracy": pytest.approx(0.05),
        "itae": pytest.approx(itae, abs=1e-3),
        "settling": math.inf,
        "calm": pytest.approx(0.5),
        "accuracy_1": pytest.approx(math.nan, nan_ok=True),
        "accuracy_2": 1.0,
        "settling_1": pytest.approx(math.nan, nan_ok=True),
        "settling_2": pytest.approx(math.nan, nan_ok=True),
        "calm_1": pytest.approx(math.nan, nan_ok=True),
        "calm_2": 1.0,
    }
    settled = problem.measures(
        made_trace(problem, e * np.where(np.arange(4001) < 2000, 1.0, 1e-9), u)
    )
    names = "settling", "accuracy", "accuracy_1", "settling_2", "calm_2"
    assert tuple(settled[name] for name in names) == (2.0, 1e-6, 2.0, 2.0, 1.0)
    assert math.isnan(settled["settling_1"])


def test_an_error_that_is_small_by_chance_at_the_end_is_not_kept():
    """As that of a pendulum which swings through its goal."""
    problem = smc.problem("duffing/noise@1")
    vars(problem)["_frozen"] = {
        "accuracy": [0.1],
        "settling": [4.0],
        "calm": [9.0],
    }
    measures = problem.measures(
        made_trace(problem, np.where(np.arange(4001) < 3900, 1.0, 0.0), np.zeros(4001))
    )
    assert measures.pop("settling") == math.inf
    assert {name for name, value in measures.items() if not math.isnan(value)} == {
        "failed",
        "accuracy",
        "itae",
        "calm",
    }


def test_a_failed_run_reaches_nothing():
    @law_function
    def broken(y, gains, memory):
        return math.nan, 0.0

    problem = smc.problem("duffing/sine@1")
    measures = problem.measures(smc.run(problem.scenarios(broken(), [0])[0]))
    assert measures.pop("failed") == 1.0
    assert measures.pop("accuracy") == math.inf
    assert measures.pop("calm") == math.inf
    assert [name for name, value in measures.items() if value < math.inf] == []


@pytest.mark.parametrize("contact", ['Wall("pendulum", (1, 0, 0), 0.2)', 'Ball("pendulum")'])
def test_a_text_is_a_cell_of_a_problem(contact, monkeypatch):
    more = {"conditions": ["hit"], "texts": {"hit": f"contact={contact}"}}
    rules = {**problems.rules(1), **more}
    monkeypatch.setattr(problems, "rules", lambda version: rules)
    runs = smc.problem("inverted_pendulum/hit@1").scenarios("pid", instances=[0, 1])
    assert {type(run.contact[0]).__name__ for run in runs} == {contact.partition("(")[0]}
