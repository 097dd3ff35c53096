"""The text that answers a scene is computed from its runs, and ties are named as ties."""

import dataclasses
import functools
import re
from pathlib import Path

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.simulation.state import LOGGED
from smc_mujoco.studies import scene as scenes
from smc_mujoco.studies.scene import Outcome, scene_answer

pytestmark = pytest.mark.quick

FILES = sorted((Path(smc.__file__).parents[1] / "scenes").glob("*.py"))
RUN = smc.Scenario(
    plant="duffing",
    law=smc.law("classical"),
    x0=1.0,
    duration=2.0,
)
NEVER = 2.0  # of the duration: after its end


def made(scenario: smc.Scenario, settled: float, size: float = 1.0, **fields: object) -> smc.Trace:
    """A trace without a run: it reaches 0.1 % of its start, times `size`, at the share `settled` of
    the duration.

    Command, force, speed and reaction grow with `size`; there is no reaction up to a size of 3.
    """
    t = np.linspace(0.0, scenario.duration, 101)
    flip = np.where(np.arange(101) % 2, 1.0, -1.0)
    start = np.abs(np.array(scenario.resolved.x0)) + 0.1
    x = np.where(t[:, None] < settled * t[-1], start, 1e-3 * size * start)
    columns = {
        "x": x,
        "v": np.broadcast_to((flip * size * (np.arange(101) % 5 > size))[:, None], x.shape),
        "u": np.broadcast_to((flip * size)[:, None], x.shape),
        "force": np.broadcast_to((flip * size)[:, None], x.shape),
        "reaction": np.broadcast_to((flip * 10.0 * size * (size > 3.0))[:, None], x.shape),
    }
    arrays = {}
    for name in LOGGED:
        arrays[name] = np.ascontiguousarray(columns.get(name, np.zeros_like(x)))
    return smc.Trace(
        t=t,
        **arrays,
        scenario=scenario,
        **fields,
    )


def several(**settled: dict[str, float]) -> Outcome:
    """Conditions whose runs settle at these shares of 2 s."""
    traces: dict[str, dict[str, smc.Trace]] = {}
    for name, runs in settled.items():
        traces[name] = {label: made(RUN, share) for label, share in runs.items()}
    return Outcome(traces=traces)


def single(**settled: float) -> Outcome:
    return several(nominal=settled)


FAILED = made(RUN, 0.2, diverged_at=0.1, failure="a law raised")
LEAST = [  # the shares at which runs settle, whose is least, and whose is most
    ({"a": 0.2, "b": 0.4}, "a (0.400 s)", "b (0.800 s)"),
    (
        {"a": 0.50, "b": 0.51, "c": 0.8},
        "a and b tied (1.00 to 1.02 s)",
        "c (1.60 s)",
    ),  # 2 % apart
    (
        {"a": 0.50, "b": 0.52, "c": 0.2},
        "c (0.400 s)",
        "b (1.04 s)",
    ),  # 4 % apart
    ({"a": NEVER, "b": 0.5}, "b (1.00 s)", "a (never)"),
    ({"a": NEVER, "b": NEVER}, "none", "a and b tied (never)"),
]


@pytest.mark.parametrize(("settled", "least", "most"), LEAST)
def test_least_and_most_name_who_is_ahead_by_a_relevant_difference(settled, least, most):
    runs = single(**settled)
    assert runs.least("settling_time") == least
    assert runs.most("settling_time") == most


def test_positions_that_the_sensor_does_not_tell_apart_are_tied_as_on_leaderboards():
    quiet = {}
    noisy = {}
    noise = dataclasses.replace(RUN, noise=smc.Noise(position=5e-3))
    for label, size in (
        ("a", 1.0),
        ("b", 4.0),
        ("c", 7.0),
    ):  # 1.1e-3, 4.4e-3 and 7.7e-3 m
        quiet[label] = made(RUN, 0.2, size)
        noisy[label] = made(noise, 0.2, size)
    runs = Outcome(traces={"quiet": quiet, "noisy": noisy})
    ahead = "a (0.00110 m) under quiet, a and b tied (0.00110 to 0.00440 m) under noisy"
    assert runs.least("ultimate_bound") == ahead


def test_a_run_that_failed_has_no_value_and_nothing_holds_for_it():
    runs = Outcome(traces={"nominal": {"a": FAILED, "b": made(RUN, 0.5)}})
    assert runs.least("settling_time") == runs.most("settling_time") == "b (1.00 s)"
    assert runs.count("run", lambda trace: True) == "1 of 2 run (not a)"
    assert runs.only("a").least("settling_time") == "none"
    assert scene_answer(runs) == "1 of 2 settle (not a); first: b (1.00 s); failed: a"
    assert runs.size("settling_time") == "1.00 s, 1 failed"


def test_those_are_the_runs_for_which_something_holds():
    runs = single(a=NEVER, b=0.5, c=0.4)
    assert runs.count("settle") == "2 of 3 settle (not a)"
    assert runs.select().named == "b and c"
    assert runs.select().most("settling_time") == "b (1.00 s)"
    assert runs.select(lambda trace: False).named == "none"
    assert runs.select(lambda trace: False).least("itae") == "none"


def test_over_several_conditions_each_is_told():
    runs = several(
        weak={
            "a": 0.2,
            "b": 0.4,
            "c": NEVER,
            "d": 0.2,
        },
        middle={
            "a": 0.2,
            "b": NEVER,
            "c": NEVER,
            "d": NEVER,
        },
        strong={
            "a": 0.3,
            "b": NEVER,
            "c": NEVER,
            "d": 0.2,
        },
    )
    assert runs.up_to() == "a strong, b and d weak, c none"
    reported = (
        "3 of 4 settle under weak (not c), 1 of 4 under middle (not b, c and d), 2 of 4 under "
    )
    assert runs.count("settle") == f"{reported}strong (not b and c)"
    assert runs["weak"].least("settling_time") == "a and d tied (0.400 s)"
    assert runs.changes("settling_time", "weak", "strong") == (
        "a 0.400 to 0.600 s, b 0.800 s to never, c never, d 0.400 s"
    )
    assert runs.leaders("settling_time") == []
    assert runs.only("a", "b").leaders("settling_time") == ["a"]


def test_leaders_lead_or_are_tied_in_every_measure():
    runs = {"a": made(RUN, 0.5, 9.0), "b": made(RUN, 0.505, 1.0)}
    outcome = Outcome(traces={"nominal": runs})
    assert outcome.leaders("settling_time") == ["a", "b"]
    assert outcome.leaders("settling_time", "tv_rate") == ["b"]


def test_who_never_arrives_is_not_the_calmest():
    runs = {"a": made(RUN, 0.5, 1.0), "idle": made(RUN, NEVER, 0.1)}
    outcome = Outcome(traces={"nominal": runs})
    assert outcome.least("tv_rate").startswith("a (")
    assert outcome.leaders("tv_rate") == ["a"]


def test_a_measure_may_be_a_function_and_a_range_has_a_unit_only_where_all_runs_have_it():
    assert (
        single(a=0.4, b=0.2).least(lambda trace: trace.t[-1], unit="s") == "a and b tied (2.00 s)"
    )
    angle = dataclasses.replace(RUN, plant="inverted_pendulum")
    runs = Outcome(traces={"cart": {"a": made(RUN, 0.2)}, "pendulum": {"a": made(angle, 0.2)}})
    assert runs.size("ultimate_bound").count("m") == 0
    assert runs.size("settling_time") == "0.400 s"


def test_names_that_are_not_there_are_refused():
    runs = single(first=0.2)
    for call, near in (
        (lambda: runs["nominl"], "nominal"),
        (lambda: runs.only("frist"), "first"),
        (lambda: runs.least("setling_time"), "settling_time"),
    ):
        with pytest.raises(smc.ScenarioError, match=near):
            call()


# every scene that is shipped


@functools.cache
def declared(path: Path) -> tuple[smc.Scene, dict[str, dict[str, smc.Trace]]]:
    """A scene, and traces that differ from label to label and from condition to condition."""
    scene = scenes.read_scene(path)
    traces: dict[str, dict[str, smc.Trace]] = {}
    for k, (condition, runs) in enumerate(scene.conditions.items()):
        traces[condition] = {}
        for i, (label, scenario) in enumerate(runs.items()):
            if i < 2 + k:
                settled = 0.1 + 0.11 * i + 0.2 * k
            else:
                settled = NEVER
            traces[condition][label] = made(scenario, settled, 0.5 + 2.5 * i + k)
    return scene, traces


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_scene_answers_with_numbers_and_singles_out_none_of_equal_runs(path):
    scene, traces = declared(path)
    answer = scene.sentence(traces)
    assert scene.answer is not scene_answer
    assert re.search(r"\d", answer)
    equal = {}
    for name, runs in traces.items():
        equal[name] = dict.fromkeys(runs, made(next(iter(runs.values())).scenario, 0.3))
    labels = "|".join(re.escape(label) for label in Outcome(traces=traces).labels)
    alone = rf"(?:: |under |with )(?:{labels}) \("
    if all(len(runs) > 1 for runs in equal.values()):
        assert not re.search(alone, scene.sentence(equal))
    # runs that failed change it
    lost: dict[str, dict[str, smc.Trace]] = {}
    for name, runs in traces.items():
        lost[name] = {}
        for label, run in runs.items():
            lost[name][label] = dataclasses.replace(run, failure="lost", diverged_at=0.1)
    assert scene.sentence(lost) != answer
