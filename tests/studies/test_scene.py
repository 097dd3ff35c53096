"""Every shipped scene asks its question and runs; the paper's study has its conditions and its
numbers.
"""

import contextlib
import dataclasses
import hashlib
import io
import json
from pathlib import Path

import pytest

import smc_mujoco as smc
from smc_mujoco.cli import run_scene as show
from smc_mujoco.common.scripts import execute
from smc_mujoco.control import gain_sets
from smc_mujoco.draw import page
from smc_mujoco.simulation.conditions import NAMED
from smc_mujoco.simulation.suite_conditions import REAL
from smc_mujoco.studies import scene as scenes

FOLDER = Path(smc.__file__).parents[1] / "scenes"
FILES = sorted(FOLDER.glob("*.py"))
EVERY = pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
TEN = {
    "inverted_pendulum",
    "van_der_pol",
    "duffing",
    "pendulum_network",
    "vdp_nominal",
    "vdp_noise",
    "vdp_disturbance",
    "control_signals",
    "delay",
    "parameter_jump",
}
LAWS = ["observer_free", "classical", "adaptive", "super_twisting"]


def shortened(scenario: smc.Scenario, duration: float = 0.1) -> smc.Scenario:
    """The scenario over 0.1 s, a jump or a fault still at half time."""
    jump = scenario.jump and dataclasses.replace(scenario.jump, time=duration / 2)
    fault = scenario.fault and dataclasses.replace(scenario.fault, at=duration / 2)
    return dataclasses.replace(scenario, duration=duration, jump=jump, fault=fault)


# the scenes


@pytest.mark.quick
def test_the_ten_scenes_of_the_study_are_there_and_are_found_by_name():
    assert set(scenes.scenes()) == {path.stem for path in FILES}
    for name in TEN:
        assert scenes.find(name).samefile(FOLDER / f"{name}.py")
    for path in FILES:
        assert scenes.question(path).endswith("?")


def declared_shortly(path: Path) -> smc.Scene:
    declared = scenes.read_scene(path)
    return dataclasses.replace(
        declared,
        conditions={
            condition: {label: shortened(scenario) for label, scenario in runs.items()}
            for condition, runs in declared.conditions.items()
        },
    )


@EVERY
def test_a_scene_runs_and_its_traces_are_saved(path, tmp_path):
    scene = declared_shortly(path)
    with contextlib.redirect_stdout(io.StringIO()):  # its progress bar
        traces = show.simulate(scene, threads=None)
    assert {c: list(runs) for c, runs in traces.items()} == {
        c: list(runs) for c, runs in scene.conditions.items()
    }
    for condition, runs in traces.items():
        for label, trace in runs.items():
            assert trace.scenario == scene.conditions[condition][label]
            assert trace.failure is None
            assert trace.t[-1] == pytest.approx(0.1)
    saved = show.save(traces, tmp_path)
    assert len(saved) == sum(map(len, traces.values()))
    for file, (_, _, scenario) in zip(saved, scene.runs(), strict=True):
        again = smc.load(file).scenario
        if again.law.function is None:
            own = scenario.law
        else:
            own = again.law
        assert dataclasses.replace(again, law=own) == scenario
    assert set(tmp_path.iterdir()) == {*saved}


@pytest.mark.usefixtures("coarse_grid")
@pytest.mark.parametrize("name", ["vdp_noise", "arm_wall", "chattering", "control_signals"])
def test_a_scene_of_each_kind_of_figure_is_drawn(name, tmp_path, monkeypatch):
    pages = []
    write = page.write_page

    def render_the_first(whole, paths):  # every figure is made; rendering is nine tenths of drawing
        pages.extend([paths] * bool(paths))
        return write(whole, paths[:1] if len(pages) == 1 else [])

    monkeypatch.setattr(page, "write_page", render_the_first)
    scene = declared_shortly(FOLDER / f"{name}.py")
    two = {}
    for condition, runs in [*scene.conditions.items()][:2]:
        two[condition] = dict([*runs.items()][:2])
    scene = dataclasses.replace(scene, conditions=two, film="")
    with contextlib.redirect_stdout(io.StringIO()):
        traces = show.simulate(scene, threads=None)
    drawn = show.figures(scene, traces, tmp_path)
    assert len(drawn) == 2 * (1 if scene.figure == "chattering" else len(traces))
    assert drawn == [path for paths in pages for path in paths]
    assert drawn[0].stat().st_size > 1000
    assert list(tmp_path.iterdir()) == [drawn[0]]


@pytest.mark.parametrize("name", sorted(TEN))
def test_a_scene_of_the_study_compares_all_laws_of_the_paper_under_the_same_conditions(name):
    for runs in scenes.read_scene(FOLDER / f"{name}.py").conditions.values():
        assert [scenario.law.name for scenario in runs.values()] == LAWS
        first, *other_runs = runs.values()
        for scenario in other_runs:
            assert dataclasses.replace(scenario, law=first.law) == first


def test_a_seed_reaches_every_run_of_a_scene():
    scene = scenes.read_scene(FOLDER / "vdp_noise.py").seeded(7)
    assert {scenario.seed for _, _, scenario in scene.runs()} == {7}


# the study's conditions

SINE = (smc.Sine(amplitude=0.2, omega=5.0),)
CONDITIONS = {
    "nominal": {},
    "noise": {"noise": smc.Noise(position=0.01, velocity=0.05)},
    "sine": {"disturbance": SINE},
    "constant": {"disturbance": (smc.Constant(0.2),)},
    "step": {"disturbance": (smc.Step(0.2, time=5.0),)},
    "pulse": {"disturbance": (smc.signals.Pulse(2.0, time=5.0, width=0.1),)},
    "process_noise": {"disturbance": (smc.signals.OrnsteinUhlenbeck(sigma=0.2, tau=0.1),)},
    "delay_1ms": {"input_delay": 0.001},
    "delay_5ms": {"input_delay": 0.005},
    "delay_10ms": {"input_delay": 0.01},
    "delay_20ms": {"input_delay": 0.02},
    "delay_50ms": {"input_delay": 0.05},
    "light": {"mismatch": {"mass": 0.7}},
    "heavy": {"mismatch": {"mass": 1.3}},
    "period_10ms": {"control_period": 0.01, "physics_step": 0.001},
    "period_20ms": {"control_period": 0.02, "physics_step": 0.001},
    "period_50ms": {"control_period": 0.05, "physics_step": 0.001},
    "differenced_5ms": {"velocity": smc.estimator("filtered_difference", tau=0.005)},
    "differenced_5ms_noise": {
        "velocity": smc.estimator("filtered_difference", tau=0.005),
        "noise": smc.Noise(position=0.01, velocity=0.0),
    },
}
JUMPS = {
    "jump_mild": {
        "inverted_pendulum": {"mass": 2.0},
        "pendulum_network": {"mass": 2.0},
        "inverted_pendulum_network": {"mass": 2.0},
        "van_der_pol": {"mu": 3.0},
        "duffing": {"alpha": 3.0},
    },
    "jump_hard": {
        "inverted_pendulum": {"mass": 25.912},
        "pendulum_network": {"mass": 11.062},
        "inverted_pendulum_network": {"mass": 22.681},
        "van_der_pol": {"mu": 9.0},
        "duffing": {"alpha": 27.684},
    },
}
COMMON = {
    "duration": 10.0,
    "control_period": 0.001,
    "physics_step": 0.001,
    "u_max": 6.0,
    "integrator": "RK4",
    "seed": 0,
    "reference": smc.Constant(0.0),
    "disturbance": (),
    "noise": smc.Noise(),
    "input_delay": 0.0,
    "velocity": smc.estimator("measured"),
    "mismatch": {},
    "jump": None,
}
PLANTS = {
    "inverted_pendulum": (
        {
            "m": 0.5,
            "l": 0.5,
            "b": 0.02,
            "grav": 9.81,
        },
        (0.5,),
    ),
    "van_der_pol": (
        {"M": 1.0, "mu": 1.0, "k": 1.0},
        (2.0,),
    ),
    "duffing": (
        {
            "M": 1.0,
            "delta": 0.2,
            "alpha": -1.0,
            "beta": 1.0,
        },
        (1.5,),
    ),
    "pendulum_network": (
        {
            "m": 0.5,
            "l": 0.5,
            "b": 0.02,
            "grav": 9.81,
            "kc": 0.5,
        },
        (0.8, -0.4, 0.6, -0.2, 0.5),
    ),
    "inverted_pendulum_network": (
        {
            "m": 0.5,
            "l": 0.5,
            "b": 0.02,
            "grav": 9.81,
            "kc": 0.5,
        },
        (0.8, -0.4, 0.6, -0.2, 0.5),
    ),
}
GAINS = json.loads((Path(gain_sets.__file__).parent / "tuned_gains" / "study.json").read_text())


def stated(plant: str, condition: str) -> dict:
    """The fields of a scenario of the study, without its plant and law."""
    if condition in JUMPS:
        return COMMON | {
            "disturbance": SINE,
            "jump": smc.Jump(time=5.0, factors=JUMPS[condition][plant]),
        }
    return COMMON | CONDITIONS[condition]


def test_the_gains_of_the_study_are_never_changed():
    text = json.dumps(GAINS, sort_keys=True)
    assert hashlib.sha256(text.encode()).hexdigest()[:16] == "98f6b432998cb8c0"


def test_the_study_has_these_conditions_and_no_other():
    assert set(NAMED) == {*CONDITIONS, *JUMPS, *REAL}


@pytest.mark.parametrize(
    ("plant", "condition"),
    [
        *(("duffing", name) for name in CONDITIONS),
        *((plant, name) for plant in PLANTS for name in JUMPS),
    ],
)
def test_a_condition_of_the_study_has_its_numbers_and_changes_nothing_else(plant, condition):
    comparison = smc.paper.comparison(plant, condition)
    assert list(comparison) == LAWS
    for name, scenario in comparison.items():
        fields = {}
        for field in COMMON:
            fields[field] = getattr(scenario.resolved, field)
        assert fields == stated(plant, condition)
        assert scenario.law.name == name
        assert dict(scenario.law.gains) == GAINS[plant][name]
        parameters, x0 = PLANTS[plant]
        assert scenario.plant.name == plant
        assert dict(scenario.plant.parameters) == parameters
        assert scenario.resolved.x0 == x0
        assert set(scenario.resolved.v0) == {0.0}


@pytest.mark.parametrize("plant", PLANTS)
def test_the_study_has_gains_for_six_laws_and_the_baseline(plant):
    for law, gains in GAINS[plant].items():
        assert smc.paper.scenario(plant, law).law == smc.law(law, **gains)
    assert smc.paper.scenario(plant, "none").law == smc.law("none")
    assert smc.paper.comparison(plant, changes={"seed": 3})["classical"].seed == 3
    assert set(smc.paper.GAINS[plant]) == set(GAINS[plant])
    assert set(smc.paper.GAINS) == set(PLANTS)


@pytest.mark.parametrize(
    ("names", "near"),
    [
        (("dufing", "classical", "nominal"), "'duffing'"),
        (("duffing", "clasical", "nominal"), "'classical'"),
        (("duffing", "classical", "noize"), "'noise'"),
    ],
)
def test_a_name_that_the_study_does_not_have_is_answered_with_the_nearest(names, near):
    with pytest.raises(smc.ScenarioError, match=near):
        smc.paper.scenario(*names)


@pytest.mark.parametrize(
    ("scene", "conditions"),
    [
        ("vdp_nominal", {"nominal": "nominal"}),
        ("vdp_noise", {"nominal": "nominal", "noise": "noise"}),
        ("vdp_disturbance", {"nominal": "nominal", "sine": "sine"}),
        (
            "control_signals",
            {"nominal": "nominal", "noise": "noise", "sine": "sine"},
        ),
    ],
)
def test_the_van_der_pol_scenes_are_the_study_s_conditions(scene, conditions):
    declared = scenes.read_scene(FOLDER / f"{scene}.py").conditions
    assert declared == {
        name: smc.paper.comparison("van_der_pol", options) for name, options in conditions.items()
    }


def ends_of(name):
    """The traces of the condition that a scene films, and the names in its file."""
    path = FOLDER / f"{name}.py"
    runs = (scene := scenes.read_scene(path)).conditions[scene.film]
    return dict(zip(runs, smc.run(runs.values()), strict=True)), execute(path)


def test_a_drone_upside_down_loses_the_height_of_another_coding():
    traces, names = ends_of("quadrotor_flip")
    published = {"geometric": 6.30, "quaternion_sliding": 3.64, "adaptive_quaternion_sliding": 3.69}
    assert {law: names["lost"](traces[law]) for law in published} == pytest.approx(
        published, rel=0.1
    )


def test_a_quaternion_s_sign_turns_a_drone_by_40_degrees_and_its_absence_by_320():
    traces, names = ends_of("quadrotor_unwinding")
    assert [*map(names["turned"], traces.values())] == pytest.approx([40.0, 320.0], rel=0.01)


@pytest.mark.parametrize("plant", PLANTS)
def test_what_happens_once_happens_at_half_time(plant):
    for duration in (10.0, 4.0):
        jumping = smc.paper.scenario(plant, "observer_free", "jump_mild", duration=duration)
        assert jumping.jump is not None
        assert jumping.jump.time == duration / 2
        for condition in ("step", "pulse", "contact"):
            (signal,) = smc.paper.scenario(
                plant, "observer_free", condition, duration=duration
            ).disturbance
            assert signal.time == duration / 2
