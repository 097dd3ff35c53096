"""The sentence that answers a scene: computed from its runs, ties named as ties, and told by every
scene.
"""

import dataclasses
import functools
import re
from pathlib import Path

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.simulation.state import LOGGED
from smc_mujoco.studies import scene as scenes
from smc_mujoco.studies import scene as words
from smc_mujoco.studies.scene import Outcome, summary

pytestmark = pytest.mark.quick

FILES = sorted((Path(smc.__file__).parents[1] / "scenes").glob("*.py"))
RUN = smc.Scenario(plant="duffing", law="classical", x0=1.0, duration=2.0)


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
    arrays = {name: np.ascontiguousarray(columns.get(name, np.zeros_like(x))) for name in LOGGED}
    return smc.Trace(t=t, **arrays, scenario=scenario, **fields)


def single(**settled: float) -> Outcome:
    """One condition whose runs settle at these shares of 2 s."""
    return Outcome(
        traces={"nominal": {label: made(RUN, share) for label, share in settled.items()}}
    )


def several(**settled: dict[str, float]) -> Outcome:
    traces = {}
    for name, runs in settled.items():
        traces[name] = {label: made(RUN, share) for label, share in runs.items()}
    return Outcome(traces=traces)


FAILED = made(RUN, 0.2, diverged_at=0.1, failure="a law raised")
NEVER = 2.0  # of the duration: after its end


# one condition


@pytest.mark.parametrize(
    ("settled", "text"),
    [
        ({"a": 0.2, "b": 0.4}, "a (0.400 s)"),
        ({"a": 0.4, "b": 0.2}, "b (0.400 s)"),
        ({"a": 0.50, "b": 0.51, "c": 0.8}, "a and b tied (1.00 to 1.02 s)"),  # 2 % apart
        ({"a": 0.50, "b": 0.52, "c": 0.8}, "a (1.00 s)"),  # 4 % apart
        ({"a": 0.5, "b": 0.5}, "both tied (1.00 s)"),
        ({"a": 0.5, "b": 0.5, "c": 0.5}, "all 3 tied (1.00 s)"),
        ({"a": NEVER, "b": 0.5}, "b (1.00 s)"),
        ({"a": NEVER, "b": NEVER}, "none"),
    ],
)
def test_least_names_who_is_ahead_by_a_relevant_difference(settled, text):
    assert single(**settled).least("settling_time") == text


def test_most_names_who_never_settles():
    assert single(a=0.2, b=NEVER, c=0.3).most("settling_time") == "b (never)"
    assert single(a=NEVER, b=NEVER, c=0.3).most("settling_time") == "a and b tied (never)"
    assert single(a=0.50, b=0.51, c=0.2).most("settling_time") == "a and b tied (1.00 to 1.02 s)"


def test_positions_that_the_sensor_does_not_tell_apart_are_tied_as_on_leaderboards():
    runs = {label: made(RUN, 0.2, size) for label, size in {"a": 1.0, "b": 4.0, "c": 7.0}.items()}
    # 1.1e-3, 4.4e-3 and 7.7e-3 m
    assert Outcome(traces={"nominal": runs}).least("ultimate_bound") == "a (0.00110 m)"
    noise = smc.Noise(position=5e-3)
    runs = {
        label: dataclasses.replace(run, scenario=dataclasses.replace(run.scenario, noise=noise))
        for label, run in runs.items()
    }
    assert (
        Outcome(traces={"nominal": runs}).least("ultimate_bound")
        == "a and b tied (0.00110 to 0.00440 m)"
    )


def test_a_run_that_failed_has_no_value_and_nothing_holds_for_it():
    runs = Outcome(traces={"nominal": {"a": FAILED, "b": made(RUN, 0.5)}})
    assert runs.least("settling_time") == runs.most("settling_time") == "b (1.00 s)"
    assert runs.who("runs", "run", lambda trace: True) == "b runs, a does not"
    assert runs.only("a").least("settling_time") == "none"
    assert summary(runs) == "b settles, a does not; first: b (1.00 s); failed: a (nominal)"
    assert runs.size("settling_time") == "1.00 s, 1 failed"


@pytest.mark.parametrize(
    ("settled", "text"),
    [
        ({"a": 0.2}, "a settles"),
        ({"a": NEVER}, "a does not settle"),
        ({"a": 0.2, "b": 0.2}, "both settle"),
        ({"a": 0.2, "b": 0.2, "c": 0.9}, "all 3 settle"),
        ({"a": 0.2, "b": NEVER, "c": 0.9}, "a and c settle, b does not"),
        ({"a": NEVER, "b": NEVER, "c": 0.9}, "c settles, a and b do not"),
        ({"a": NEVER, "b": NEVER, "c": NEVER}, "none of the 3 settles"),
    ],
)
def test_who_names_the_runs_for_which_something_holds(settled, text):
    assert single(**settled).who("settles", "settle") == text
    assert summary(single(**settled)).startswith(text)


def test_those_are_the_runs_for_which_something_holds():
    runs = single(a=NEVER, b=0.5, c=0.4)
    assert runs.those().labels == ["b", "c"]
    assert runs.those().named == "b and c"
    assert runs.those().most("settling_time") == "b (1.00 s)"
    assert runs.those(lambda trace: False).named == "none"
    assert runs.those(lambda trace: False).least("itae") == "none"


def test_leaders_lead_or_are_tied_in_every_measure():
    runs = {}
    for label, share, size in (("a", 0.5, 9.0), ("b", 0.505, 1.0)):
        runs[label] = made(RUN, share, size)
    outcome = Outcome(traces={"nominal": runs})
    assert outcome.leaders("settling_time") == ["a", "b"]
    assert outcome.leaders("settling_time", "tv_rate") == ["b"]


# several conditions


def test_over_conditions_a_winner_of_all_has_a_range_and_others_their_conditions():
    same = several(near={"a": 0.2, "b": 0.4}, far={"a": 0.3, "b": 0.6})
    assert same.least("settling_time") == "a in both conditions (0.400 to 0.600 s)"
    assert same["far"].least("settling_time") == "a (0.600 s)"
    mixed = several(
        near={"a": 0.2, "b": 0.4}, far={"a": 0.6, "b": 0.3}, farther={"a": 0.5, "b": 0.5}
    )
    assert mixed.least("settling_time") == "a (near), b (far), both tied (farther)"


def test_who_says_in_which_conditions():
    runs = several(
        near={"a": 0.2, "b": 0.2, "c": NEVER},
        far={"a": 0.2, "b": 0.2, "c": NEVER},
        farther={"a": 0.2, "b": NEVER, "c": NEVER},
    )
    assert (
        runs.who("settles", "settle")
        == "a settles in all 3 conditions, b in all but farther, c in none"
    )
    assert runs.only("c").who("settles", "settle") == "c does not settle in any condition"
    assert runs.only("a").who("settles", "settle") == "a settles in all 3 conditions"
    few = several(near={"a": 0.2, "b": NEVER}, far={"a": NEVER, "b": NEVER})
    assert few.who("settles", "settle") == "a settles only in near, b in none"
    assert few["far"].who("settles", "settle") == "none of the 2 settles"
    none = several(near={"a": NEVER, "b": NEVER}, far={"a": NEVER, "b": NEVER})
    assert none.who("settles", "settle") == "none of the 2 settles in any condition"


def test_up_to_ends_before_the_first_failure_and_names_what_holds_again():
    runs = several(
        weak={"a": 0.2, "b": 0.2, "c": NEVER, "d": 0.2},
        middle={"a": 0.2, "b": NEVER, "c": NEVER, "d": NEVER},
        strong={"a": 0.2, "b": NEVER, "c": NEVER, "d": 0.2},
    )
    assert runs.up_to() == "a strong, b weak, d weak (and strong again), c none"


def test_changes_say_from_what_to_what_or_that_it_is_no_relevant_change():
    runs = several(near={"a": 0.2, "b": 0.50, "c": 0.2}, far={"a": 0.4, "b": 0.51, "c": NEVER})
    assert runs.changes("settling_time", "near", "far") == (
        "a 0.400 to 0.800 s, b no relevant change (1.00 to 1.02 s), c 0.400 s to never"
    )
    assert runs.changes("settling_time", "near", "near").count("no relevant change") == 3


def test_values_of_plants_with_other_units_have_no_common_range():
    angle = dataclasses.replace(RUN, plant="inverted_pendulum")
    runs = {"cart": {"a": made(RUN, 0.2)}, "pendulum": {"a": made(angle, 0.2)}}
    assert Outcome(traces=runs).least("ultimate_bound") == "a in both conditions"
    assert Outcome(traces=runs).least("settling_time") == "a in both conditions (0.400 s)"


def test_a_measure_may_be_a_function():
    runs = single(a=0.4, b=0.2)
    assert runs.least(lambda trace: trace.x[50, 0], unit="m") == "both tied (0.00110 m)"
    assert runs.least(
        lambda trace: trace.x[60 if trace is runs.traces["nominal"]["a"] else 10, 0]
    ).startswith("a (")


def test_names_that_are_not_there_are_refused():
    runs = single(first=0.2)
    for call, near in (
        (lambda: runs["nominl"], "nominal"),
        (lambda: runs.only("frist"), "first"),
        (lambda: runs.least("setling_time"), "settling_time"),
    ):
        with pytest.raises(smc.ScenarioError, match=near):
            call()
    with pytest.raises(smc.ScenarioError, match="give the name of a metric"):
        runs.least(3.0)


# of a scene


def scene(answer: object = summary) -> smc.Scene:
    return smc.Scene(title="Two", conditions={"nominal": {"a": RUN, "b": RUN}}, answer=answer)


def test_a_sentence_begins_with_a_capital_or_a_label_and_ends_with_a_full_stop():
    traces = single(a=0.2, b=0.4).traces
    assert scene().sentence(traces) == "Both settle; first: a (0.400 s)."
    assert scene(lambda runs: f"b is\n  {len(runs.labels)}nd").sentence(traces) == "b is 2nd."
    assert scene(lambda runs: "Is it?").sentence(traces) == "Is it?"


def test_what_the_answer_of_a_scene_raises_reaches_its_author():
    with pytest.raises(AttributeError, match="nothing"):
        scene(lambda runs: runs.nothing).sentence(single(a=0.2).traces)


@pytest.mark.parametrize(
    ("answer", "says"), [(lambda runs: 3, "is 3"), (lambda runs: " ", "returns text")]
)
def test_an_answer_that_is_none_is_refused_in_a_sentence(answer, says):
    with pytest.raises(smc.ScenarioError, match=f"the answer of scene 'Two' .*{says}"):
        scene(answer).sentence(single(a=0.2).traces)
    with pytest.raises(smc.ScenarioError, match="give a function"):
        scene("a wins")


# every scene that is shipped


@functools.cache
def declared(path: Path) -> tuple[smc.Scene, dict[str, dict[str, smc.Trace]]]:
    """A scene, and traces that differ from label to label and from condition to condition."""
    found = scenes.read(path)
    traces = {}
    for k, (condition, runs) in enumerate(found.conditions.items()):
        traces[condition] = {
            label: made(
                scenario, 0.1 + 0.11 * i + 0.2 * k if i < 2 + k else NEVER, 0.5 + 2.5 * i + k
            )
            for i, (label, scenario) in enumerate(runs.items())
        }
    return found, traces


EVERY = pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)


@EVERY
def test_a_scene_has_an_answer_of_its_own_in_one_sentence_that_singles_out_none_of_equal_runs(path):
    found, traces = declared(path)
    sentence = found.sentence(traces)
    assert found.answer is not summary
    assert re.search(r"\d", sentence)
    assert not re.search(r"\.\s", sentence)
    assert sentence.endswith(".")
    assert len(sentence) < 480  # six lines of a terminal
    equal = {}
    for name, runs in traces.items():
        equal[name] = dict.fromkeys(runs, made(next(iter(runs.values())).scenario, 0.3))
    labels = "|".join(re.escape(label) for label in Outcome(traces=traces).labels)
    assert not re.search(rf"(?:: |under |with )(?:{labels}) (?:\(|in )", found.sentence(equal))


@EVERY
def test_a_scene_s_sentence_changes_when_any_number_behind_it_does(path, monkeypatch):
    found, traces = declared(path)
    sentence = found.sentence(traces)
    function = words._function
    true = words._true
    seen: set[object] = set()

    def noted(measure):
        seen.add(measure if isinstance(measure, str) else measure.__name__)
        return function(measure)

    monkeypatch.setattr(words, "_function", noted)
    found.sentence(traces)
    for name in seen:

        def other(measure, name=name):
            value = function(measure)
            of_this = name == (measure if isinstance(measure, str) else measure.__name__)
            if of_this:
                return lambda run: 1.0 / (0.7 + min(value(run), 1e9))
            return value

        monkeypatch.setattr(words, "_function", other)
        assert found.sentence(traces) != sentence, name
    monkeypatch.setattr(words, "_function", function)
    asked: set[object] = set()

    def counted(holds, run):
        asked.add(holds.__code__)
        return true(holds, run)

    monkeypatch.setattr(words, "_true", counted)
    found.sentence(traces)
    for code in asked:
        monkeypatch.setattr(
            words,
            "_true",
            lambda holds, run, code=code: true(holds, run) != (holds.__code__ is code),
        )
        assert found.sentence(traces) != sentence, code.co_name
    assert seen | asked
