"""What tuning promises: one rule for every law, the same gains for the same seed, never worse for a
larger budget.
"""

import dataclasses
import json
import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.engine import scored_runs
from smc_mujoco.analysis.tuning import search, search_space, stages
from smc_mujoco.analysis.tuning.evaluator import EQUATION, MUJOCO
from smc_mujoco.analysis.tuning.objective import FAILURE_COST, Objective
from smc_mujoco.analysis.tuning.result import load_tuned
from smc_mujoco.analysis.tuning.search import tune
from smc_mujoco.control.law import law_catalogue
from smc_mujoco.control.units import Gain, Unit
from smc_mujoco.metrics.catalogue import itae, tv


@pytest.fixture(autouse=True, scope="module")
def engine_for_short_runs():
    """So short runs are MuJoCo's elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scored_runs, "MIN_WORK", 0)
        yield


SHORT = Objective(duration=0.5)
LEAN = Objective(conditions=("nominal",), duration=0.25)


@smc.law_function(gains={"when": 0.1, "k": 3.0})
def failing(y, gains, memory):
    return math.nan if y.t > gains.when else -gains.k * (y.de + 2.0 * y.e), y.e


@pytest.fixture(scope="module")
def found():
    """One tuning, for those tests that only look at it."""
    return tune(
        "duffing",
        "observer_free",
        budget=16,
        seed=3,
        objective=SHORT,
        searches=3,
    )


# searches


def test_the_same_seed_gives_the_same_gains_to_the_last_bit_at_any_thread_count(found):
    assert (
        tune(
            "duffing",
            "observer_free",
            16,
            3,
            SHORT,
            threads=1,
            searches=3,
        )
        == found
    )


def test_more_searches_repeat_those_of_fewer_and_share_nothing(found, monkeypatch):
    drawn = []
    draw = np.random.default_rng
    monkeypatch.setattr(
        search.np.random, "default_rng", lambda seed: drawn.append(seed) or draw(seed)
    )
    first = tune(
        "duffing",
        "observer_free",
        budget=16,
        seed=3,
        objective=SHORT,
        searches=1,
    )
    assert first.searches == found.searches[:1]
    assert [3, 0] in drawn
    gains = [{tried.gains for tried in search_result.history} for search_result in found.searches]
    assert not gains[0] & gains[1]
    seeds = []
    for i in range(3):
        for case in search.task_of("duffing", found.law, SHORT, 16, 3, 1).cases(i):
            seeds.append(case.seed)
    assert len(set(seeds)) == len(seeds) == 21


@pytest.mark.parametrize("killed_in", [1, 2])
def test_a_tuning_that_is_killed_goes_on_and_ends_with_the_same_bytes(
    found, killed_in, monkeypatch, tmp_path
):
    searches = []
    real = search.TuningTask.search

    def killed(task, i, *rest):
        if i == killed_in and len(searches) == killed_in:
            searches.append("killed")
            raise KeyboardInterrupt
        searches.append(i)
        return real(task, i, *rest)

    monkeypatch.setattr(search.TuningTask, "search", killed)
    again = {
        "budget": 16,
        "seed": 3,
        "objective": SHORT,
        "searches": 3,
        "out": tmp_path / "kept",
    }
    with pytest.raises(KeyboardInterrupt):
        tune("duffing", "observer_free", **again)
    tuned = tune("duffing", "observer_free", **again)
    assert searches == [*range(killed_in), "killed", *range(killed_in, 3)]
    content, resumed = (
        tuning.save(tmp_path / name)
        for tuning, name in ((found, "whole.json"), (tuned, "resumed.json"))
    )
    assert content.read_bytes() == resumed.read_bytes()
    tune("duffing", "observer_free", **again)
    assert len(searches) == 4
    assert len(list((tmp_path / "kept").iterdir())) == 3
    tune("duffing", "observer_free", **again | {"budget": 17})
    assert searches[4:] == [0, 1, 2]


def test_each_objective_on_record_is_that_of_the_runs_of_its_own_search(found):
    traces = []
    for i, search_result in enumerate(found.searches):
        law = dataclasses.replace(
            found.law, gains=dict(zip(found.bounds, search_result.best.gains, strict=True))
        )
        traces = smc.run(found.definition.scenarios(found.plant, law, found.seed, i))
        again = sum(itae(t) / abs(t.x[0, 0]) + 1e-3 * tv(t) / (6.0 * 0.5) for t in traces)
        assert again == pytest.approx(search_result.best.objective, rel=1e-12)
    assert [t.scenario.input_delay for t in traces] == [0.0, 0.0, 0.01, *[0.0] * 4]
    assert [t.scenario.noise.position > 0.0 for t in traces] == [False, True, *[False] * 5]
    assert [bool(t.scenario.disturbance) for t in traces] == [False] * 3 + [True] * 2 + [False] * 2
    assert [t.scenario.mismatch.get("mass", 1.0) for t in traces] == [1.0] * 5 + [0.7, 1.3]


def test_a_search_whose_equation_differs_from_mujoco_is_made_again_by_mujoco(found, monkeypatch):
    """A wrong nominal model cannot decide gains: here it has another inertia."""
    plant = smc.plant("duffing")
    wrong = dataclasses.replace(plant, nominal=_of_twice_the_force)

    def searched():
        tuned = tune(
            wrong,
            "observer_free",
            budget=16,
            seed=3,
            objective=SHORT,
            searches=1,
        )
        return tuned.searches[0]

    assert found.searches[0].engine == EQUATION
    again = searched()
    assert again.engine == MUJOCO
    assert again.best.objective < 1.1 * found.searches[0].best.objective
    monkeypatch.setattr(search, "AGREEMENT", math.inf)
    assert searched().engine == EQUATION


def _of_twice_the_force(x, v, i, p):
    return (p.alpha * x[i] - p.beta * x[i] ** 3 - p.delta * v[i]) / p.M, 2.0 / p.M


def test_what_needs_a_shorter_step_keeps_its_own():
    late = smc.Scenario(
        plant="duffing",
        law="none",
        friction=smc.Viscous(0.3),
        input_delay=5e-4,
    )
    assert search._coarse(late) is late
    dry = search._coarse(smc.Scenario(plant="duffing", law="none", friction=smc.Coulomb(0.3)))
    # MuJoCo's friction
    assert dry.resolved.integrator == "implicitfast"
    assert dry.resolved.physics_step == 1e-3
    plain = search._coarse(smc.Scenario(plant="duffing", law="none"))
    assert plain.resolved.integrator == "Euler"


STANDING = """<mujoco><worldbody><geom type="plane" size="1 1 .1"/><body pos="0 0 .1">{base}
<geom type="box" size=".1 .1 .1" mass="2"/><body pos="0 0 .2"><joint name="j" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 .2" size=".02" mass=".1"/></body></body></worldbody>
<actuator><motor joint="j" ctrlrange="-1 1"/></actuator></mujoco>"""


def test_coarse_runs_keep_the_floor_on_which_a_base_stands():
    for base, only in (("", True), ("<freejoint/>", False)):
        plant = smc.plant_from(STANDING.format(base=base), ["j"], name="standing")
        assert search._only_limits(smc.Scenario(plant=plant, law="pid")) is only


REACHING = """<mujoco><worldbody><geom type="plane" size="1 1 .1"/><body pos="0 0 {height}">{base}
<body><joint name="j" axis="0 1 0" range="-120 120"/>
<geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" mass=".1"/></body></body></worldbody>
<actuator><motor joint="j" ctrlrange="-1 1"/></actuator></mujoco>"""


@pytest.mark.filterwarnings("ignore:at the goal of .* overlap by 2.0 mm")
def test_coarse_runs_under_friction_leave_out_contacts_of_what_touches_nothing():
    """At its start, straight up, it touches nothing; at its goal, it does in one case."""
    flags = mujoco.mjtDisableBit
    joint = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><freejoint/>'
    for height, base, off in ((0.5, "", flags.mjDSBL_CONTACT), (0.018, "", 0), (0.5, joint, 0)):
        text = REACHING.format(height=height, base=base)
        plant = smc.plant_from(text, {"j": smc.Channel(x0=-1.5)}, name="reaching")
        plain = smc.Scenario(plant=plant, law="pid")
        rubs = dataclasses.replace(plain, friction=smc.Coulomb(0.1))
        assert search._left_out([plain, rubs]) == int(off)
    assert search._left_out([plain]) == 0
    assert search._left_out([smc.Scenario(plant="duffing", law="pid")]) == flags.mjDSBL_CONSTRAINT
    assert (
        search._left_out([smc.Scenario(plant="duffing", law="pid", friction=smc.Coulomb(0.1))]) == 0
    )


@pytest.mark.filterwarnings("ignore:no set of gains")
@pytest.mark.parametrize("budget", [1, 4, 32])
def test_a_search_stops_at_its_budget_and_no_set_of_gains_is_paid_for_twice(budget):
    (search_result,) = tune(
        "duffing",
        "observer_free",
        budget=budget,
        objective=LEAN,
        searches=1,
    ).searches
    assert 1 <= search_result.evaluations <= 2 * budget
    assert len({e.gains for e in search_result.history}) == len(search_result.history)


@pytest.mark.parametrize(
    ("slope", "least", "most"),
    [
        (1e-5, 13, 13),
        (1.0, 14, 60),
    ],
)
def test_a_descent_ends_when_it_gains_too_little(slope, least, most):
    """With two gains after 2 (2 n + 2) evaluations and the first, unless J falls: it ends at the
    least J then.
    """
    costs = []

    class Bowl:
        def cost(self, logs):
            costs.append(1.0 + slope * float(logs @ logs))
            return costs[-1]

        def drawn_back(self, logs, inside):
            return logs

    stages.descend(Bowl(), {"a": (0.1, 10.0), "b": (0.1, 10.0)}, np.array([0.9, -0.8]), 200)
    assert least <= len(costs) <= most
    assert min(costs) < 1.001


def test_the_front_is_what_no_other_evaluation_beats(found):
    front = found.front
    assert found.searches[0].chosen in front
    for e in front:
        for o in found.history:
            assert not (o.tracking <= e.tracking and o.variation < e.variation)
    assert [e.variation for e in front] == sorted((e.variation for e in front), reverse=True)


# the search space


@pytest.mark.quick
def test_a_law_is_searched_about_the_bound_on_its_command():
    """In N m, V or rad/s^2, with the inertia per unit of it. A motor's winding changes neither."""
    motor = smc.DCMotor(command="voltage", voltage=12.0)
    per_volt = motor.constant / motor.resistance
    stepper = smc.condition("steps", actuator=smc.hardware.Stepper(torque=20.0, ramp=50.0))
    for condition, F, M in (
        ("nominal", 6.0, 0.125),
        (smc.condition("volts", actuator=motor), 12.0, 0.125 / per_volt),
        (stepper, 50.0, 1.0),
    ):
        goal = Objective(conditions=(condition,))
        task = search.task_of("inverted_pendulum", smc.law("pid"), goal, 8, 0, 1)
        T = math.sqrt(M * 0.5 / F)
        assert task.scales == {
            "X": 0.5,
            "F": F,
            "M": pytest.approx(M),
            "T": pytest.approx(T),
        }
        assert task.goal.u_max == F
        assert math.sqrt(math.prod(task.box["kp"])) == pytest.approx(F / 0.5)
    with pytest.raises(
        smc.ScenarioError, match=r"commands in N and m/s\^2: tune for each drive alone"
    ):
        search.task_of(
            "duffing", smc.law("pid"), Objective(conditions=("nominal", stepper)), 8, 0, 1
        )


TWO_JOINTS = """<mujoco><compiler inertiafromgeom="true"/><worldbody><body>
<joint name="upper" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="2"/>
<body pos="0 0 -.4"><joint name="fore" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass=".2"/></body></body></worldbody>
<actuator>{motors}</actuator></mujoco>"""


def test_a_search_has_the_bounds_that_a_run_has_without_it():
    """A bound that a channel gives, below that of the file or in its place; and what each joint
    needs, where nothing gives one.
    """
    motors = '<motor joint="upper" ctrlrange="-{0} {0}"/><motor joint="fore" ctrlrange="-{0} {0}"/>'
    of_file = TWO_JOINTS.format(motors=motors.format(1000))
    unbounded = TWO_JOINTS.format(motors="")
    four, two = smc.Channel(u_max=4.0), smc.Channel(motor=True, u_max=2.0)
    ideal = smc.Channel(motor=True)
    for text, channels, largest in (
        (of_file, {"upper": four}, 4.0),
        (of_file, {"upper": four, "fore": smc.Channel(u_max=2.0)}, 4.0),
        (unbounded, {"upper": smc.Channel(motor=True, u_max=4.0), "fore": two}, 4.0),
        (unbounded, {"upper": ideal, "fore": ideal}, None),
    ):
        plant = smc.plant_from(text, channels, name="two joints")
        usual = smc.Scenario(plant=plant, law="pid").limits
        goal = Objective(conditions=("nominal", "sine"))
        task = search.task_of(plant, smc.law("pid"), goal, 8, 0, 1)
        assert len(set(usual)) == len(channels)
        assert task.scales["F"] == max(usual) == (largest or max(usual))
        for case in task.cases(0):
            assert case.limits == usual
        assert task.cases(0)[1].disturbance[0].amplitude <= max(usual)


def test_no_force_is_a_scale_that_a_servo_does_not_give_or_that_is_over_before_u_answers():
    """A set-point moves a servo with kp = 500 until its force is 3 N m; 10 N m move a light joint
    by X / 2 long before a command that is 10 ms late.
    """
    servo = '<position joint="fore" kp="500" kv="5" forcerange="-3 3" ctrlrange="-3 3"/>'
    motor = '<motor joint="fore" ctrlrange="-10 10"/>'
    goal = Objective(conditions=("nominal", "delay_10ms"))
    scales = {}
    for motors in (servo, motor):
        plant = smc.plant_from(
            TWO_JOINTS.format(motors=motors),
            {"fore": smc.Channel(servo=motors == servo)},
            name="fore arm",
            others="locked",
        )
        task = search.task_of(plant, smc.law("pid"), goal, 8, 0, 1)
        assert task.goal.u_max == max(smc.Scenario(plant=plant, law="pid").limits)
        scales[motors] = task.scales
    assert scales[servo]["F"] == pytest.approx(3.0 / 500.0)
    late = 0.010 + 0.001
    F, X, M, T = (scales[motor][name] for name in "FXMT")
    assert pytest.approx(late) == T
    assert pytest.approx(M * X / late**2) == F
    assert F < 10.0


def test_a_gain_given_as_0_stays_0():
    scales = {
        "X": 2.0,
        "F": 6.0,
        "M": 1.0,
        "T": 0.5,
    }
    assert set(search_space.box(smc.law("pid"), scales)) == {"kp", "ki", "kd", "tt"}
    assert set(search_space.box(smc.law("pid", ki=0.0), scales)) == {"kp", "kd", "tt"}


def test_a_gain_is_searched_three_decades_wide_and_further_above_if_of_more_than_two_rates():
    scales = {
        "X": 2.0,
        "F": 6.0,
        "M": 1.0,
        "T": 0.5,
    }
    law = smc.law("super_twisting")
    box = search_space.box(law, scales)
    gains = {"k1": 6.0 / 4.0**0.5, "k2": 12.0, "c": 2.0}
    for name, (low, high) in box.items():
        assert low == pytest.approx(gains[name] / 10**1.5)
        assert high == pytest.approx(gains[name] * 10 ** (2.5 if name == "k2" else 1.5))
    low, high = box["c"]
    assert search_space.widened(law, box)["c"] == pytest.approx((low / 10, 10 * high))
    regulator = smc.law("lqr")
    squares = search_space.box(regulator, scales)
    low, high = squares["q1"]  # N^2/m^2: the root is a slope
    wide = search_space.widened(regulator, squares)["q1"]
    assert wide == pytest.approx((low / 100, 100 * high))


def test_a_gain_over_another_is_searched_as_far_as_a_force():
    law = smc.law("extended_state")
    assert search_space.force_limits(law, {"b": 2.0}, 6.0) == {"k": pytest.approx(12.0 * 10**2.5)}
    task = search.task_of("duffing", law, LEAN, 4, 0, 1)
    trials = search.Trials(None, None, tuple(task.box), None, None)
    trials.limit = lambda gains: search_space.force_limits(law, gains, 6.0)
    gains = dict(zip(task.box, trials.gains([5.0] * len(task.box)), strict=True))
    assert gains["k"] == pytest.approx(6.0 * 10**2.5 * gains["b"], rel=1e-3) or gains["k"] == 1e5


@pytest.mark.usefixtures("by_mujoco")
def test_gains_without_units_are_searched_about_their_defaults_with_a_warning():
    with pytest.warns(
        smc.errors.ScenarioWarning, match=r"gains .* of failing have no unit.*Gain\("
    ):
        tuned = tune(
            "duffing",
            failing(),
            budget=2,
            objective=LEAN,
            searches=1,
        )
    for name, (low, high) in tuned.bounds.items():
        assert low * high == pytest.approx(failing().gains[name] ** 2)


@pytest.mark.slow
def test_a_search_leaves_a_box_that_lacks_the_optimum_by_a_decade_and_says_so():
    own = law_catalogue()["observer_free"]
    odd = dataclasses.replace(
        own, gains=dict(own.gains) | {"lam": Gain(6.0, Unit(force=-2), positive=True)}
    )
    goal = Objective(conditions=("nominal",), duration=1.5)
    tuned = tune(
        "duffing",
        odd,
        objective=goal,
        searches=1,
    )
    low, high = tuned.bounds["lam"]
    assert tuned.searched["lam"] == (pytest.approx(low / 10), pytest.approx(10 * high))
    assert high < tuned.gains["lam"] <= 10 * high
    assert tuned.at_bound == {"lam": "upper"}
    said = f"lam = {tuned.gains['lam']:.4g} is at the upper end of where it was searched: a larger one may be"
    assert said in " ".join(str(tuned.full).split())


# conditions of theorems


@smc.law_function(
    gains={"k": 5.0, "gamma": 1.4},
    conditions={"1 < gamma < 2": lambda g: 1.0 < g.gamma < 2.0},
    advice={"k < 1e-9": lambda g: g.k < 1e-9},
)
def narrow(y, gains, memory):
    s = y.e + abs(y.de) ** gains.gamma * math.copysign(0.25, y.de)
    return -math.copysign(gains.k, s), s


CONSTRAINED = ("quasi_continuous", "twisting", "conditioned_super_twisting", narrow)


# by the equation; the others by MuJoCo
SETS = [pytest.param("twisting", "duffing", marks=pytest.mark.slow)]
SETS += [(law, "double_pendulum") for law in CONSTRAINED]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("law", "plant"), SETS, ids=str)
def test_every_set_that_a_search_evaluates_holds_the_theorem_unless_the_user_lifts_it(
    law, plant, monkeypatch
):
    evaluated = []
    costs = search.Trials._costs

    def seen(trials, candidates, *rest):
        evaluated.extend(candidates)
        return costs(trials, candidates, *rest)

    monkeypatch.setattr(search.Trials, "_costs", seen)
    tuning = tune(
        plant,
        law,
        24,
        objective=LEAN,
        searches=1,
    )
    template = tuning.law.template
    assert template is not None
    names = tuple(tuning.bounds)
    held = dict(tuning.law.gains)

    def missed():
        return [
            bool(template.unmet(held | dict(zip(names, gains, strict=True)))) for gains in evaluated
        ]

    assert len(evaluated) > 20
    assert not any(missed())
    assert "outside its theorem" not in str(tuning.law.source)
    evaluated.clear()
    tune(
        plant,
        law,
        24,
        objective=LEAN,
        searches=1,
        outside_theorem=True,
    )
    assert any(missed())


@pytest.mark.usefixtures("by_mujoco")
def test_a_theorem_that_no_gains_of_the_search_hold_is_refused(refused):
    with pytest.warns(smc.errors.GainWarning):
        law = smc.law("terminal", p=0.3)  # held
    refused(
        lambda: tune(
            "duffing",
            law,
            2,
            objective=LEAN,
            searches=1,
        ),
        "terminal",
        "theorem",
    )
    tune(
        "duffing",
        law,
        2,
        objective=LEAN,
        searches=1,
        outside_theorem=True,
    )


# runs that fail


def test_a_run_that_fails_costs_more_than_any_other_and_less_the_later_it_fails():
    goal = Objective(conditions=("nominal",), duration=0.2)
    laws = []
    for when in (0.0, 0.05, 0.1, 0.15, 1.0):
        laws.append(failing(when=when))
    traces = smc.run([goal.scenarios("duffing", law, 0)[0] for law in laws])
    costs = []
    for trace in traces:
        costs.append(goal.terms_of_run(trace)[0])
    assert all(map(math.isfinite, costs))
    assert costs == sorted(costs, reverse=True)
    assert len(set(costs)) == 5
    assert costs[-1] < 1.0 < FAILURE_COST <= costs[-2]


# files


def test_a_tuning_is_saved_and_read_back_as_it_was(found, tmp_path):
    path = found.save(tmp_path / "new" / "it.json")
    assert load_tuned(path) == found
    held = json.loads(path.read_text())
    assert held["budget"] == 16
    assert list(found.gains.values()) in held["record"]["sets"]
    assert set(held["versions"]) == {"smc_mujoco", "mujoco", "numba", "numpy", "scipy", "cmaes"}
    path.write_text(json.dumps(held | {"budget": 17}))
    with pytest.raises(smc.ScenarioError, match="changed, since it was written"):
        load_tuned(path)


# bad input


@pytest.mark.usefixtures("by_mujoco")
@pytest.mark.filterwarnings("ignore:.* no unit")
def test_a_law_that_fails_later_is_refused_if_no_gains_mend_it(refused):
    def made(limit):
        @smc.law_function(gains={"k": 3.0})
        def sensor_lost(y, gains, memory):
            if y.t > 0.01 and gains.k > limit:
                raise ValueError("sensor lost")
            return -gains.k * y.e, y.e

        return sensor_lost

    refused(
        lambda: tune(
            "duffing",
            made(0.0),
            objective=LEAN,
            searches=1,
        ),
        "ValueError (sensor lost)",
    )
    assert (
        not tune(
            "duffing",
            made(2.0),
            budget=8,
            objective=LEAN,
            searches=1,
        )
        .sets[0]
        .failed
    )


WORSE = (
    r"no set of gains tried for observer_free on duffing is better than the law's own, with an "
    r"objective of \S+ s² instead "
    r"of \S+ s²: give a larger budget"
)


def test_warns_if_and_only_if_the_laws_own_gains_are_better():
    first = tune(
        "duffing",
        smc.law("observer_free", lam=0.5),
        objective=SHORT,
        searches=1,
    )
    assert first.objective < first.before
    with pytest.warns(smc.errors.ScenarioWarning, match=WORSE) as caught:
        again = tune(
            "duffing",
            first.law,
            budget=1,
            objective=SHORT,
            searches=1,
        )
    assert again.objective > again.before
    assert [Path(warning.filename).name for warning in caught] == ["test_search.py"]
    # as good as its own: a warning would be an error
    tune(
        "duffing",
        first.law,
        objective=SHORT,
        searches=1,
    )


def test_a_law_with_the_name_of_one_of_the_library_is_refused_before_any_search(refused):
    @smc.law_function(gains={"k": 1.0})
    def terminal(y, gains, memory):
        return -gains.k * y.e, y.e

    refused(lambda: tune("duffing", terminal), "'terminal' has the name of a law of the library")


def test_a_short_search_is_mujocos_and_does_not_depend_on_the_number_of_searches(monkeypatch):
    """Compiling the form of a plant takes longer."""
    task = search.task_of("duffing", smc.law("observer_free"), SHORT, 16, 3, 1)
    work = search.SEARCHES * task.size * sum(case.work for case in task.cases(0))
    engines = []
    for least in (work + 1, work):
        monkeypatch.setattr(scored_runs, "MIN_WORK", least)
        tuned = tune("duffing", "observer_free", 16, 3, SHORT, searches=1)
        engines.append(tuned.searches[0].engine)
    assert engines == [MUJOCO, EQUATION]
