"""Conditions and starts: named, combined, read from text without being evaluated, and used on any
plant.
"""

import dataclasses
import math
import pickle

import numpy as np
import pytest
import wild

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.simulation import gaber_study as paper
from smc_mujoco.simulation.conditions import NAMED, applicable, find_condition, from_file, parse
from smc_mujoco.simulation.grid import GRID_SEEDS
from smc_mujoco.simulation.run_key import condition as reported
from smc_mujoco.simulation.run_key import run_key

pytestmark = pytest.mark.quick

ARM = """<mujoco model="arm">
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" type="hinge" axis="0 1 0" damping="0.1"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.03" mass="1.0"
        contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator>
    <motor name="shoulder" joint="shoulder" ctrllimited="true" ctrlrange="-20 20"/>
  </actuator>
</mujoco>"""
WORN = smc.condition(
    "worn gear",
    friction=smc.Coulomb(0.05),
    actuator=smc.Backlash(0.02),
    sensor=smc.Encoder(counts=4096),
)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    return path


@pytest.fixture
def arm(file):
    return smc.plant_from(file, ["shoulder"])


# names, text, combinations


def test_text_says_a_condition_whole():
    for condition in (
        WORN,
        smc.condition("a", mismatch={"mass": 1.1}, input_delay=0.003),
        smc.condition("b", velocity=smc.estimator("levant", L=30.0), noise=smc.Noise(0.01)),
        smc.condition(
            "c",
            disturbance=(smc.Sine(0.2, 5.0), smc.Constant(-0.1)),
            contact="stops",
            u_max=math.inf,
        ),
        smc.condition("d", jump=smc.Jump(0.5, {"mass": 2.0}), x0=[0.3], reference=smc.Step(0.1)),
    ):
        assert parse(str(condition)) == condition


def test_the_suites_conditions_go_by_their_names():
    assert [str(condition_of_suite) for condition_of_suite in NAMED.values()] == list(NAMED)
    assert find_condition("noise") is NAMED["noise"]


def test_conditions_add_up(refused):
    duffing = smc.plant("duffing")
    together = find_condition("sine + coulomb + constant").on(duffing, 4.0)
    assert together == {
        "disturbance": (smc.Sine(0.2, 5.0), smc.Constant(0.2)),
        "friction": smc.Coulomb(0.1),
    }
    assert find_condition("noise + noise").on(duffing, 4.0) == {"noise": smc.Noise(0.01, 0.05)}
    refused(lambda: find_condition("light + heavy").on(duffing, 4.0), "'heavy'", "mismatch")
    awkward = smc.condition("awkward", input_delay=wild.Awkward())
    late = smc.condition("late", input_delay=1e-3)
    refused(lambda: (awkward + late).on(duffing, 4.0), "'late'", "input_delay")
    assert (WORN + find_condition("noise")).on(duffing, 4.0)["noise"] == smc.Noise(0.01, 0.05)
    assert (WORN + "noise").name == "worn gear + noise"
    refused(lambda: WORN + 3, "condition is 3")  # pyright: ignore[reportOperatorIssue]


def test_a_condition_of_any_values_has_a_text_and_joins_others(refused):
    array = smc.condition("array", x0=np.array([0.3]))
    assert parse(str(array)) == array
    (run,) = smc.grid("duffing", "none", array + smc.condition("again", x0=np.array([0.3])))
    assert run.resolved.x0 == (0.3,)
    odd = smc.condition("odd", noise=np.zeros(1, "f4,i4"))
    refused(lambda: smc.grid("duffing", "none", odd + find_condition("noise")), "both set noise")


def test_what_happens_once_does_so_at_half_time():
    assert NAMED["pulse"].on(smc.plant("duffing"), 3.0)["disturbance"].time == 1.5


def test_a_text_that_is_none_is_one_sentence(refused):
    for text, word in (
        ("worn: friction=Coulomb(k=3)", "takes level"),
        ("worn: friction=xyzzyx('x')", "'xyzzyx'"),
        ("worn: friction=().__class__", "'().__class__'"),
        ("worn: friction=[i for i in (1,)]", "'[i for i in (1,)]'"),
        ("worn: friction=Coulomb(0.05", "'worn: friction=Coulomb(0.05'"),
        ("worn: friction=Coulomb(-'a')", "value is 'a'"),
        ("worn: Coulomb(1)", "'worn: Coulomb(1)'"),
        ("worn: **{'a': 1}", "cannot be read"),
        ("worn: frction=1", "'frction'"),
        ("worn: plant='duffing'", "sets plant"),
        ("worn:", "no fields"),
        ("worn: x0=1, x0=2", "x0 twice"),
        ("worn: friction=Coulomb(level=1, level=2)", "level twice"),
        ("worn: mismatch={'mass': 1.3, **{'mass': 2}}", "**{'mass': 2}"),
        ("worn: mismatch={'mass': 1.3, 'mass': 2}", "'mass' twice"),
        ("worn: x0=1_0", "x0=1_0"),
        (": input_delay=0.01", "name is ''"),
        ("noise: input_delay=0.01", "'noise'"),
        ("noisy", "'noisy'"),
        ("worn friction=Coulomb(0.05)", "no colon"),
        ("noise + ", "condition ''"),
        ("a" * 10**5 + ": x=" + "(" * 10**4, "aaa..."),
    ):
        refused(lambda text=text: find_condition(text), word)
    refused(lambda: find_condition("worn: input_delay=10ms"), "'10ms'", "without a unit")
    refused(lambda: find_condition("worn: x0=1e3 2"), "friction=Coulomb(0.05)")


def test_a_condition_of_your_own_needs_its_own_option(refused):
    for text in ("friction,noise,worn: friction=Coulomb(0.3)", "noise+worn: input_delay=0.01"):
        refused(lambda text=text: find_condition(text), "needs its own --condition")


def test_a_file_holds_a_condition_a_line(tmp_path, refused):
    path = tmp_path / "conditions.txt"
    path.write_text(f"# of the workshop\n\n{WORN}\nnoise + coulomb\n")
    assert [of_line.name for of_line in from_file(path)] == ["worn gear", "noise + coulomb"]
    path.write_text("# two\n\nworn x0=1\n")
    refused(lambda: from_file(path), "line 3", path, "colon")
    refused(lambda: from_file(tmp_path / "none.txt"), tmp_path / "none.txt")


# grids


def test_conditions_suit_a_plant_that_they_have_numbers_for(arm):
    names = ["nominal", "jump_mild", "coulomb", "contact"]
    duffing = smc.plant("duffing")
    assert applicable(names, [duffing], 1.0) == names
    assert applicable(names, [duffing, arm], 1.0) == ["nominal", "coulomb", "contact"]


def test_a_condition_that_starts_at_0_is_nothing_to_tune_for(refused):
    refused(
        lambda: smc.tune(
            "duffing", "classical", 2, conditions=["nominal", smc.condition("rest", x0=0.0)]
        ),
        "under 'rest'",
    )


def test_a_grid_has_conditions_of_ones_own_under_their_names():
    scenarios = smc.grid(
        "duffing",
        "classical",
        ["nominal", WORN, "noise + coulomb"],
        2,
        gains="default",
        duration=1.0,
    )
    assert [reported(s) for s in scenarios] == ["nominal"] * 2 + ["worn gear"] * 2 + [
        "noise + coulomb"
    ] * 2
    assert scenarios[2].friction == (smc.Coulomb(0.05),)
    # the name goes with the fields
    assert dataclasses.replace(scenarios[2], friction=None).condition is None


def test_a_name_of_the_suite_changes_no_runs_key_and_ones_own_does():
    (ours,) = smc.grid("duffing", "classical", "noise", 1, gains="default")
    by_hand = paper.scenario("duffing", "classical", "noise", gains="default")
    assert ours == by_hand
    assert run_key(ours) == run_key(by_hand)
    (scenario,) = smc.grid(
        "duffing",
        "classical",
        smc.condition("one", noise=smc.Noise(0.01, 0.05)),
        1,
        gains="default",
    )
    assert scenario == ours
    assert run_key(scenario) != run_key(ours)


def test_starts_are_around_the_plants_own_or_around_a_given_one():
    near = smc.grid("pendulum_network", "none", "nominal", 3)
    x0 = np.array(smc.plant("pendulum_network").x0)
    assert near[0].resolved.x0 == tuple(x0)
    for s in near:
        assert (np.abs(np.array(s.resolved.x0) / x0 - 1.0) <= 0.2).all()
    away = smc.grid("duffing", "none", "nominal", 4, starts=smc.starts(x0=0.0, by=0.3))
    assert away[0].resolved.x0 == (0.0,)
    assert 0.0 < max(abs(s.resolved.x0[0]) for s in away) <= 0.3
    assert len({s.resolved.x0 for s in away}) == 4


def test_no_grid_has_the_starts_and_the_noise_of_tuning(refused):
    tuned = {s.seed for s in Objective().scenarios("duffing", smc.law("classical"), 0)}
    assert min(tuned) >= GRID_SEEDS
    assert len(tuned) == 7
    refused(lambda: smc.grid("duffing", "none", "nominal", [GRID_SEEDS]), "seed", GRID_SEEDS)
    starts = []
    for s in Objective().scenarios("duffing", smc.law("classical"), 0):
        starts.append(s.resolved.x0[0])
    assert len(set(starts)) == 7
    for x in starts:
        assert abs(x / 1.5 - 1.0) <= 0.2


# any plant


def test_a_model_of_ones_own_is_compared_like_any_other(arm, tmp_path):
    law = smc.law("boundary_layer", k=10.0, c=4.0, phi=0.5)
    scenarios = smc.grid(
        [arm, "duffing"],
        law,
        ["nominal", WORN],
        2,
        duration=0.5,
        starts=smc.starts(x0=0.4),
    )
    table = smc.study(scenarios, tmp_path / "study")
    assert sorted(set(table.column("plant"))) == ["arm", "duffing"]
    assert sorted(set(table.column("condition"))) == ["nominal", "worn gear"]
    assert set(table.column("failure")) == {None}


@smc.law_function(gains={"k": 1.0})
def pid(y, gains, memory):
    return -gains.k * y.e, y.e


SLOW = smc.law("classical", k=2.0)
QUICK = smc.law("classical", k=6.0)


def test_grid_refuses_two_things_of_one_name(refused):
    for changed, *names in [
        ({"laws": [SLOW, QUICK]}, "laws", "'classical'"),
        ({"laws": ["classical", QUICK]}, "laws", "'classical'"),
        ({"plants": ["duffing", smc.plant("duffing", beta=5.0)]}, "plants", "'duffing'"),
        (
            {"conditions": [WORN, smc.condition("worn gear", u_max=3.0)]},
            "conditions",
            "'worn gear'",
        ),
        ({"laws": [pid(k=2.0)]}, "law 'pid'"),
    ]:
        refused(
            lambda given={"plants": "duffing", "laws": "classical"} | changed: smc.grid(**given),
            *names,
        )
    assert (
        len(smc.grid(["duffing"] * 2, [SLOW, smc.law("classical", k=2.0), pid().named("my pid")]))
        == 6
    )
    assert (
        len(smc.grid("duffing", "classical", [WORN, WORN, "noise + coulomb", "noise + coulomb"]))
        == 4
    )


@pytest.mark.filterwarnings("ignore:no set of gains")
def test_named_law_is_another_in_tables(tmp_path):
    slow = SLOW.named("slow")
    assert pickle.loads(pickle.dumps(slow)) == slow
    runs = smc.grid("duffing", [slow, QUICK], duration=0.1)
    table = smc.study(runs, tmp_path)
    assert table.column("law").tolist() == ["slow", "classical"]
    again = smc.Table.read(tmp_path).scenario(0)
    assert again == runs[0]
    assert again.law.function is QUICK.function
    assert smc.tune("duffing", slow, 2, conditions="nominal", searches=1).law.name == "slow"


def test_start_is_set_by_condition_or_starts(refused):
    for search in (smc.grid, smc.margins, smc.tune, smc.design.basin):
        far = smc.condition("far", x0=1.0)
        if search in (smc.grid, smc.tune):
            fields = {"conditions": far}
        else:
            fields = {"condition": far}
        if search is smc.design.basin:
            more = {}
        else:
            more = {"starts": smc.starts(x0=0.5)}
        refused(
            lambda search=search, fields=fields, more=more: search(
                "duffing", "classical", **fields, **more
            ),
            "'far'",
        )
        assert [
            s.resolved.x0
            for s in smc.grid("duffing", "classical", far, starts=smc.starts(spread=0.1))
        ] == [(1.0,)]


def test_grid_asks_where_a_model_at_rest_starts(arm, refused):
    law = smc.law("classical")
    at_rest = smc.starts(x0=0.0)
    refused(lambda: smc.grid([arm], law, ["noise", "nominal"], 2, starts=at_rest), "'nominal'")
    moved = smc.condition("a", reference=smc.Step(0.1)), smc.condition("b", v0=0.1)
    moved += (smc.condition("c", feedforward=smc.Step(0.1)),)
    assert len(smc.grid(arm, law, [*moved, "noise", "sine", "encoder"], 2)) == 12
    # seed 0 alone starts at 0
    assert len(smc.grid(arm, law, "nominal", 2, starts=smc.starts(by=0.1))) == 2
    held = ARM.replace('fromto="0 0 0 0 0 -0.4"', 'fromto="0 0 0 0.4 0 0"')
    assert smc.grid(smc.plant_from(held, ["shoulder"]), law, "nominal")  # gravity moves it


def test_a_model_is_tuned_in_conditions_of_ones_own(arm, refused):
    at_rest = smc.starts(x0=0.0)
    refused(
        lambda: smc.tune(arm, "pid", budget=4, conditions="nominal", starts=at_rest), "'nominal'"
    )
    goal = Objective(conditions=("nominal",), duration=0.5)
    tuned = smc.tune(
        arm,
        "observer_free",
        4,
        objective=goal,
        conditions=[WORN],
        starts=smc.starts(x0=0.4),
        searches=1,
    )
    assert [own.name for own in tuned.definition.conditions] == ["worn gear"]
    assert tuned.scales["X"] == 0.4


# the command line


WHEEL = """<mujoco model="w"><worldbody><body><joint name="j" axis="0 1 0" armature="{inertia}"/>
<geom size="1e-2" mass="1e-6"/></body></worldbody><actuator><motor joint="j"
ctrlrange="-{bound} {bound}"/></actuator></mujoco>"""
GRIP = """<mujoco model="g"><worldbody><body><joint name="j" type="slide" axis="1 0 0"
range="0 {way}"/><geom size=".01" mass=".1"/></body></worldbody><actuator><motor joint="j"
ctrlrange="-5 5"/></actuator></mujoco>"""


@pytest.mark.parametrize(("inertia", "bound"), [(1e-5, 0.05), (0.125, 6.0), (1600.0, 9e3)])
def test_play_and_motors_are_as_large_beside_a_joint_as_those_of_the_study(inertia, bound):
    wheel = smc.plant_from(WHEEL.format(inertia=inertia, bound=bound), ["j"])
    rotor = find_condition("backlash").on(wheel, 1.0)["actuator"].rotor_inertia
    assert rotor == pytest.approx(0.008 * inertia, rel=1e-3)
    motor = find_condition("dc_motor").on(wheel, 1.0)["actuator"]
    assert motor.stall == pytest.approx(smc.DCMotor().stall * bound / 6.0)
    usual = smc.DCMotor().gear ** 2 * smc.DCMotor().rotor_inertia
    assert motor.gear**2 * motor.rotor_inertia < 1.01 * usual * inertia / 0.125
    assert find_condition("encoder").on(wheel, 1.0)["sensor"] == smc.Encoder(4096)


@pytest.mark.parametrize("way", [0.02, 0.04, 4.0])
def test_play_and_counts_suit_how_far_a_slide_goes(way, refused):
    grip = smc.plant_from(GRIP.format(way=way), ["j"])
    moved = min(0.3, 0.6 * way)
    gap = find_condition("backlash").on(grip, 1.0)["actuator"].gap
    assert gap == pytest.approx(moved / 30.0)
    counts = find_condition("encoder").on(grip, 1.0)["sensor"].counts
    assert counts == pytest.approx(4096 * 0.3 / moved, abs=1)
    if way < 1.0:
        refused(lambda: find_condition("stepper").on(grip, 1.0), "stepper", "'j' of g", "Stepper(")
    else:
        assert find_condition("stepper").on(grip, 1.0)["actuator"].torque == 150.0


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        (
            {"friction": (smc.Coulomb(0.1 + 0.2), smc.Viscous(0.05))},
            "(Coulomb(level=0.3), Viscous(b=0.05))",
        ),
        ({"disturbance": smc.Sine(0.2, 5.0)}, "Sine(amplitude=0.2, omega=5)"),
        ({"fault": smc.Fault(at=2.0, gain=0.0)}, "Fault(at=2, gain=0)"),
        ({"sensor": smc.Encoder()}, "Encoder(counts=4096)"),
    ],
)
def test_a_brief_text_has_every_number_but_zeros_that_nobody_gave(fields, words):
    (name,) = fields
    assert smc.condition("mine", **fields).brief(smc.plant("duffing"), 1.0) == f"{name}={words}"


def test_the_phase_of_a_sine_is_of_the_seed_alike_for_all_laws_and_that_of_seed_0_is_as_written():
    condition = "push: disturbance=(Sine(0.2, 5.0, 0.3), Constant(0.1))"
    runs = smc.grid("duffing", ["pid", "adrc"], condition, seeds=4, duration=1.0)
    phases = [run.disturbance[0].phase for run in runs]
    assert phases[0] == 0.3
    assert phases[:4] == phases[4:]
    assert len(set(phases)) == 4
    assert all(run.condition == "push" for run in runs)
    assert {run.disturbance[1] for run in runs} == {smc.Constant(0.1)}


def test_a_condition_may_be_written_as_everywhere_else():
    dry = smc.condition("dry", friction=smc.Coulomb(0.1), noise=smc.Noise(position=1e-3))
    assert smc.condition("dry: friction=Coulomb(0.1), noise=Noise(position=1e-3)") == dry
    assert str(smc.condition("noise+encoder")) == str(smc.condition("noise + encoder"))


def test_another_delay_is_refused_with_its_field(refused):
    refused(lambda: find_condition("noise + delay_7ms"), "delay_7ms", "late: input_delay=0.007")


def test_an_elastic_joint_resonates_at_the_multiple_of_its_own_rate_that_is_stated():
    plant = smc.plant("duffing")  # a mass of 1 kg, 1.5 m from its goal, and 6 N
    joint = find_condition("elastic").on(plant, 3.0)["actuator"]
    squared = joint.stiffness * (1.0 + 1.0 / joint.rotor_inertia)
    assert squared == pytest.approx(43.6**2 * 6.0 / 1.5, rel=5e-3)
    critical = 2.0 * math.sqrt(joint.stiffness / (1.0 + 1.0 / joint.rotor_inertia))
    assert joint.damping == pytest.approx(0.01 * critical, rel=5e-3)
