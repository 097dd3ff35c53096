"""Margins: what is found is a boundary, the first one from below, and theory's where there is
one.
"""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.robustness import margin_kinds, margins
from smc_mujoco.robustness.level_search import COARSE, FINE
from smc_mujoco.simulation import gaber_study

BASE = gaber_study.scenario("duffing", "observer_free", duration=4.0)


def kind_of(put):
    return margin_kinds.MarginKind(
        label="push",
        unit="{u}",
        levels=(1.0, 2.0, 4.0),
        put=put,
    )


def pushed(level):
    """A scenario that tolerates the level or not: without a push, or with one of more than the law
    has. MuJoCo runs it: the fast engine would compile for 5 s.
    """
    push = smc.Constant(0.0 if level else 50.0)
    by_mujoco = dataclasses.replace(BASE, integrator="implicitfast")
    return dataclasses.replace(by_mujoco, duration=0.5, x0=0.0, disturbance=push)


# what a margin is


@pytest.mark.quick
def test_a_run_tolerates_what_leaves_it_within_five_percent_of_its_start():
    held = smc.run(dataclasses.replace(BASE, disturbance=smc.Constant(1.2)))
    carried = smc.run(dataclasses.replace(BASE, disturbance=smc.Constant(1.4)))
    assert abs(held.x[-1, 0]) < 0.05 * 1.5 < abs(carried.x[-1, 0])
    assert (margin_kinds.tolerates(held), margin_kinds.tolerates(carried)) == (True, False)


def test_a_run_tolerates_nothing_if_its_pole_has_fallen_though_the_cart_is_home():
    trace = smc.run(
        smc.Scenario(
            plant="cart_pole",
            law="none",
            x0=(0.0, 0.0),
            duration=1.0,
        )
    )
    fallen = trace.x.copy()
    assert margin_kinds.tolerates(trace)
    fallen[:, 1] = np.linspace(0.0, 3.0, len(fallen))
    assert not margin_kinds.tolerates(dataclasses.replace(trace, x=fallen))


@pytest.mark.quick
def test_a_column_holds_what_its_heading_says():
    margin = margins.Margin(
        plant="duffing",
        law="pid",
        kind="delay",
        value=0.031,
        unit="s",
        resolution=0.002,
        searched=0.5,
        theory=0.043,
        sets=12,
        low=0.011,
        high=0.037,
    )
    (printed,) = margins.Margins([margin]).tables
    table: Any = printed.about()
    assert dict(zip(table["columns"], table["rows"][0], strict=True)) == {
        "plant": "duffing",
        "law": "pid",
        "margin": 0.031,
        "to within": 0.002,
        "all sets": "0.0110 to 0.0370",
        "theory": 0.043,
        "unit": "s",
    }


# the search

SEARCHED = [  # whether a level is tolerated, of 1, 2 and 4 first, and the margin
    (
        lambda level: not 1.3 < level < 2.5,
        pytest.approx(1.3, rel=FINE),
        "ends at the first level that is not tolerated",
    ),
    (lambda level: not 1.3 < level < 1.9, 4.0, "an island between two levels goes unseen"),
    (lambda level: True, 4.0, "has the searched level where no run fails"),
    (
        lambda level: level < 0.3,
        pytest.approx(0.3, abs=FINE),
        "is also found below the smallest level",
    ),
]


@pytest.mark.parametrize(
    ("tolerated", "value", "words"), SEARCHED, ids=[row[-1] for row in SEARCHED]
)
def test_a_margin(tolerated, value, words, monkeypatch):
    monkeypatch.setitem(
        margin_kinds.MARGIN_KINDS, "push", kind_of(lambda base, level: pushed(tolerated(level)))
    )
    (margin,) = margins.margins_of([pushed(True)], ["push"])
    assert (margin.value, margin.searched) == (value, 4.0), words
    assert (margin.open, margin.resolution == 0.0) == (value == 4.0,) * 2


def test_the_range_over_sets_is_that_of_their_own_margins(monkeypatch):
    """Of a first set of 1.3, beside sets that hold less, the same and more; open, and failing."""
    laws = [smc.law("observer_free", lam=lam, k1=2.0) for lam in (1.3, 0.4, 1.3, 2.7, 1.31)]

    def put(base, level):
        return dataclasses.replace(pushed(level <= base.law.gains["lam"]), law=base.law)

    monkeypatch.setitem(margin_kinds.MARGIN_KINDS, "push", kind_of(put))
    first, *variants = (dataclasses.replace(pushed(True), law=law) for law in laws)

    def found(siblings):
        return margins.margins_of([first], ["push"], siblings=[siblings])[0]

    own = [margins.margins_of([base], ["push"])[0] for base in (first, *variants)]
    margin = found(variants)
    assert margin.value == own[0].value
    assert margin.sets == 5
    assert margin.low == pytest.approx(min(set_margin.value for set_margin in own), rel=2 * FINE)
    assert margin.high == pytest.approx(max(set_margin.value for set_margin in own), rel=2 * FINE)
    same = found(variants[1:2])
    assert (same.low, same.high) == (margin.value, margin.value)
    assert found([]).over_sets == ""
    wide = dataclasses.replace(variants[0], law=smc.law("observer_free", lam=9.0, k1=2.0))
    assert found([wide]).over_sets.endswith(" to ≥ 4.00")
    broken = dataclasses.replace(variants[0], disturbance=(smc.Constant(50.0),))
    assert found([broken]).over_sets == f"fails to {margin.text}"


def test_other_sets_are_the_shipped_ones_of_a_law_that_was_named():
    base = smc.grid("duffing", "classical")[0]
    siblings = margins._other_sets(base, "classical", "tuned")
    sets = {tuple(run.law.gains.values()) for run in (base, *siblings)}
    assert len(sets) == len(siblings) + 1 == 12
    assert margins._other_sets(base, base.law, "tuned") == []
    assert margins._other_sets(base, "classical", "default") == []


@pytest.mark.slow
def test_both_signs_of_a_disturbance_are_tolerated(monkeypatch):
    onesided = kind_of(lambda base, level: pushed(level > -1.5))
    monkeypatch.setitem(
        margin_kinds.MARGIN_KINDS, "onesided", dataclasses.replace(onesided, signed=True)
    )
    (margin,) = margins.margins_of([pushed(True)], ["onesided"])
    assert margin.value == pytest.approx(1.5, rel=FINE)
    law = smc.law("super_twisting", k1=7.634, k2=28.49, c=2.5)  # winds up when pushed towards 0
    wound = dataclasses.replace(BASE, law=law, actuator=smc.Lag(0.01), duration=5.0)
    (margin,) = margins.margins_of([wound], ["disturbance"], COARSE)
    runs = smc.run(
        [dataclasses.replace(wound, disturbance=smc.Constant(sign * 4.5)) for sign in (1.0, -1.0)]
    )
    assert [margin_kinds.tolerates(run) for run in runs] == [True, False]
    assert margin.value < 4.5


def test_a_law_that_fails_anyway_has_no_margin():
    (margin,) = margins.margins_of([dataclasses.replace(BASE, law=smc.law("none"))], ["mass"])
    assert margin.text == "fails at 1"
    assert not margin.open


# theory beside it


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["van_der_pol", "pendulum_network"])
def test_the_disturbance_tolerated_is_the_one_of_theory(plant):
    (margin,) = margins.margins([plant], ["observer_free"], ["disturbance"], "study", quick=True)
    assert margin.theory is not None
    assert margin.value <= margin.theory * 1.001
    assert margin.value + margin.resolution >= margin.theory * 0.999


def test_dry_friction_up_to_theory_is_tolerated():
    (friction,) = margins.margins_of([BASE], ["friction"], COARSE)
    assert friction.theory is not None
    assert friction.value >= friction.theory - friction.resolution


def test_linear_theory_is_only_for_the_loop_that_it_describes():
    """None for a plant that is pushed or changed, a law that reads an encoder or the model, or
    another reference.
    """
    base, noisy, *undescribed = (
        smc.grid("duffing", "observer_free", condition)[0]
        for condition in ("nominal", "noise", "constant", "heavy", "encoder")
    )
    for fields in (
        {"model": "nominal"},
        {"reference": smc.Constant(0.1)},
        {"reference": smc.Sine(0.1, 1.0)},
        {"feedforward": smc.Constant(2.0)},
    ):
        undescribed.append(dataclasses.replace(base, **fields))
    for kind in ("delay", "disturbance", "friction"):
        expected = margin_kinds.MARGIN_KINDS[kind].expected
        assert None not in map(expected, (base, noisy))
        assert {*map(expected, undescribed)} == {None}
    estimated = dataclasses.replace(base, velocity="filtered_difference")  # changes nothing at rest
    assert margin_kinds.MARGIN_KINDS["delay"].expected(estimated) is None
    assert margin_kinds.MARGIN_KINDS["disturbance"].expected(estimated) is not None


POLES = """
<mujoco><option integrator="RK4"/><worldbody>
  <body><joint name="a" axis="0 1 0"/><geom size=".1" pos="0 0 1" mass="1" contype="0"/></body>
  <body pos="0 2 0">
    <joint name="b" axis="0 1 0"/><geom size=".1" pos="0 0 1" mass="1" contype="0"/>
  </body>
</worldbody><actuator>{motors}</actuator>{rest}</mujoco>"""
MOTORS = (
    '<motor joint="a" gear="40" ctrlrange="-1 1"/><motor joint="b" gear="15" ctrlrange="-1 1"/>'
)


@pytest.fixture
def poles(tmp_path):
    """A function that makes a plant of two poles whose motors are of unlike strength."""

    def make(rest="", channels=("a", "b")) -> Plant:
        path = tmp_path / f"{'tied' if rest else 'free'}.xml"
        path.write_text(POLES.format(motors=MOTORS, rest=rest))
        return smc.plant_from(path, channels)

    return make


def test_theory_knows_the_weakest_motor(poles):
    strong = smc.law("boundary_layer", k=30.0, phi=0.01, c=5.0)
    base = smc.Scenario(plant=poles(), law=strong, x0=(1.0, 1.0))
    # rad: there it gives its 15 N m, of which gravity takes m g l sin(x) and ever more
    angle = 15.0 / (30.0 * 5.0 / 0.01)
    expected = margin_kinds.MARGIN_KINDS["disturbance"].expected(base)
    assert expected == pytest.approx(15.0 - 9.81 * math.sin(angle), rel=1e-3)


@pytest.mark.parametrize("kind", margin_kinds.MARGIN_KINDS)
def test_a_level_of_each_kind_changes_the_run(kind):
    """A margin of what is never put into the run would be the largest level."""
    base = dataclasses.replace(BASE, duration=1.0)
    level = margin_kinds.MARGIN_KINDS[kind].levels[-1]
    plain, *changed = smc.run([base, *margin_kinds.MARGIN_KINDS[kind].scenarios(base, level)])
    for trace in changed:
        assert np.abs(trace.x - plain.x).max() > 1e-5  # half a step changes 1e-10


def test_the_mass_ratio_is_of_the_nominal_mass_under_whichever_name():
    heavier = margin_kinds.MARGIN_KINDS["mass"].put
    for name in ("mass", "M"):
        named = dataclasses.replace(BASE, mismatch={name: 1.5, "alpha": 2.0})
        assert heavier(named, 2.0).mismatch == {name: 2.0, "alpha": 2.0}
    assert heavier(BASE, 2.0).mismatch == {"mass": 2.0}
    (margin,) = margins.margins_of(
        [dataclasses.replace(BASE, mismatch={"M": 1.1}, duration=1.0)], ["mass"], COARSE
    )
    assert margin.kind == "mass"


def test_levels_take_the_place_of_a_conditions_own_or_come_on_top():
    own = {
        "input_delay": 0.01,
        "mismatch": {"mass": 1.5},
        "noise": smc.Noise(0.1),
        "clock": dataclasses.replace(BASE.clock, jitter=2.5e-4, missed=0.2),
        "fault": smc.Fault(at=1.0, gain=0.9),
    }
    added = {"disturbance": smc.Constant(1.0), "friction": smc.Coulomb(1.0)}
    under = dataclasses.replace(BASE, physics_step=1.25e-4, **own, **added)
    put = {}
    for name, kind in margin_kinds.MARGIN_KINDS.items():
        put[name] = kind.put(under, 0.5)
    kinds = margin_kinds.MARGIN_KINDS
    replaced = "delay", "mass", "noise", "jitter", "missed"
    begins = [kinds[name].search(under, COARSE).low for name in (*replaced, "friction")]
    # what the scenario itself has, the run that is tried first; friction comes on top
    assert begins == pytest.approx([0.01, 1.5, 0.1, 2.5e-4 / BASE.control_period, 0.2, 0.0])
    assert put["delay"].input_delay == 0.5
    assert put["mass"].mismatch == {"mass": 0.5}
    assert put["noise"].noise.position == 0.5
    assert put["jitter"].clock.jitter == 0.5 * BASE.control_period
    assert put["missed"].clock.missed == 0.5
    assert put["loss"].fault.gain == 0.5
    assert put["disturbance"].disturbance == (smc.Constant(1.0), smc.Constant(0.5))
    assert put["blow"].disturbance[0] == smc.Constant(1.0)
    assert put["friction"].friction == (smc.Coulomb(1.5),)


def test_levels_of_time_are_multiples_of_the_shortest_that_a_run_can_have():
    """Of a delay one control period, of jitter an eighth of one; others may have any level."""
    for kind, least in {"delay": BASE.control_period, "jitter": 0.125}.items():
        search = margin_kinds.MARGIN_KINDS[kind].search(BASE, FINE)
        assert search.rounded(0.6 * least) == search.rounded(1.4 * least) == least
        assert search.rounded(1.6 * least) == 2.0 * least
        assert np.allclose(
            search.levels, np.round(np.divide(search.levels, least)) * least, rtol=1e-12, atol=0.0
        )
        assert search.resolution(0.0) % least == pytest.approx(0.0)


def test_an_error_of_ones_own_machine_is_from_its_goal():
    text = """<mujoco model="mass"><worldbody><body><joint name="slide" type="slide" axis="1 0 0"/>
    <geom size=".1" mass="1" contype="0" conaffinity="0"/></body></worldbody><actuator>
    <motor joint="slide" ctrlrange="-6 6"/></actuator></mujoco>"""
    law = smc.law("pid", kp=200.0, ki=0.0, kd=25.0)
    away = smc.plant_from(text, {"slide": smc.Channel(reference=smc.Constant(0.3))})
    (margin,) = smc.margins(away, law, ["delay"], starts=smc.starts(x0=0.0), quick=True)
    assert margin.value > 0.0
    for x0, plant in ((0.3, away), (0.0, smc.plant_from(text, ["slide"]))):
        with pytest.raises(smc.ScenarioError, match="mass starts at its goal, and margins need"):
            smc.margins(plant, law, ["delay"], starts=smc.starts(x0=x0, by=0.2), quick=True)


@pytest.mark.parametrize("size", [1e-3, 50.0])
def test_levels_of_force_are_shares_of_the_bound_of_ones_own_machine(size):
    def mass(size):
        text = f"""<mujoco model="mass"><worldbody><body><joint name="slide" type="slide" axis="1 0 0"/>
<geom size=".1" mass="{size}" contype="0" conaffinity="0"/></body></worldbody><actuator>
<motor joint="slide" ctrlrange="{-6 * size} {6 * size}"/></actuator></mujoco>"""
        law = smc.law("pid", kp=200.0 * size, ki=0.0, kd=25.0 * size)
        return smc.plant_from(text, ["slide"]), law

    kinds = ["disturbance", "friction"]
    ours = smc.margins(*mass(1.0), kinds, quick=True)
    theirs = smc.margins(*mass(size), kinds, quick=True)
    assert [m.value / size for m in theirs] == pytest.approx([m.value for m in ours], rel=1e-6)
    assert all(0.0 < m.value < 6.0 for m in ours)
    (run,) = smc.grid(*mass(size), "sine")
    assert run.disturbance[0].amplitude == pytest.approx(0.2 * size)


def test_a_blow_comes_at_half_time_in_shares_of_the_momentum_that_u_stops_in_its_time():
    """F T = sqrt(M X F), here with the pendulum's m l^2 about its hinge."""
    kind = margin_kinds.MARGIN_KINDS["blow"]
    (level, *_) = kind.search(BASE, COARSE).levels
    inertia = 1.0 / abs(BASE.plant.nominal(np.zeros(1), np.zeros(1), 0, BASE.plant.values({}))[1])
    full_impulse = np.sqrt(inertia * abs(BASE.resolved.x0[0]) * BASE.limits[0])
    assert level == pytest.approx(margin_kinds.BLOWS[0] * full_impulse)
    blows = [run.disturbance[-1] for run in kind.scenarios(BASE, level)]
    width = 5e-3  # s, as the help of `margins` and the answer of `which` say
    assert [(blow.impulse, blow.time, blow.width) for blow in blows] == [
        (level, BASE.duration / 2, width),
        (-level, BASE.duration / 2, width),
    ]


# the figure


def a_margin(**changes):
    usual = {"plant": "duffing", "law": "pid", "kind": "delay", "value": 0.02, "unit": "s"}
    usual |= {"resolution": 0.004, "searched": 0.5, "theory": None}
    return margins.Margin(**usual | changes)


DRAWN = [
    a_margin(theory=0.03),
    a_margin(law="classical", value=0.05, resolution=0.0, searched=0.05, theory=math.inf),
    a_margin(law="adaptive", value=math.nan, resolution=0.0, theory=0.04),
    a_margin(kind="mass", value=4.0, unit="1", resolution=0.5, searched=64.0),
]


def test_a_bar_ends_at_the_margin_and_a_line_at_what_is_not_tolerated():
    delay, mass, *extra_axes = margins.Margins(DRAWN).figure().axes
    assert extra_axes == []
    assert delay.get_xlabel() == "input delay (ms)"
    assert [label.get_text() for label in delay.get_yticklabels()] == [
        "PID",
        "Classical",
        "Adaptive",
    ]
    assert [bar.get_width() for bar in delay.patches] == pytest.approx([20.0, 50.0, 0.0])
    lines = [line[:, 0].tolist() for line in delay.collections[0].get_segments()]
    assert lines == [pytest.approx([20.0, 24.0]), [50.0, 50.0], [0.0, 0.0]]
    assert [text.get_text() for text in delay.texts] == ["20.0", "≥ 50.0", "fails at 0"]
    limits = delay.lines[-1].get_xdata()
    np.testing.assert_allclose(limits, [30.0, np.nan, np.nan])
    (bar,) = mass.patches
    assert (bar.get_x(), bar.get_x() + bar.get_width()) == (1.0, 4.0)
    assert mass.get_xlabel() == "mass, of the nominal"


def test_each_plant_has_its_own_panels_in_its_own_units():
    pendulum_margin = a_margin(plant="inverted_pendulum", kind="disturbance", unit="N m", value=2.0)
    page = margins.Margins([a_margin(kind="disturbance", unit="N"), pendulum_margin]).figure()
    first, second = page.axes
    titles = first.get_title(loc="left"), second.get_title(loc="left")
    assert titles == ("Duffing oscillator", "Inverted pendulum")
    assert first.get_xlabel().endswith("(mN)")
    assert second.get_xlabel().endswith("(N·m)")


def test_a_figure_of_no_margins_is_refused():
    with pytest.raises(smc.ScenarioError, match="no margins to draw: give at least one"):
        margins.Margins().figure()
