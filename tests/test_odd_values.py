"""Odd values end in one sentence, and those that would be taken for others are refused."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.step_halving import step_halving
from smc_mujoco.common import gl


@pytest.fixture(scope="module")
def trace():
    return smc.run(smc.Scenario(plant="duffing", law=smc.law("pid"), duration=0.1))


def case(**fields):
    return smc.Scenario(plant="duffing", law=smc.law("pid"), **fields)


class Awkward:
    """A value whose every attribute fails."""

    def __getattr__(self, name):
        raise ZeroDivisionError(name)


MASKED = np.ma.masked
EMPTY = np.zeros(0)
REFUSED = {
    "x0 masked": (lambda: case(x0=MASKED), "x0 is None"),
    "number masked": (lambda: smc.Noise(position=MASKED), "position is masked"),
    "gain masked": (lambda: smc.law("pid", kp=MASKED), "kp is masked"),
    "delay below a step": (lambda: case(input_delay=1e-9), "input_delay 1e-09"),
    "sum of a number": (lambda: smc.signals.Sum(np.inf), "Sum is inf"),
    "report": (lambda: smc.margins("duffing", "pid", report=()), r"report is \(\)"),
    "no traces": (lambda: step_halving(5), "traces is 5"),  # pyright: ignore[reportArgumentType]
    "one that is none": (lambda: step_halving([5]), "traces has 5"),  # pyright: ignore
    "bound masked": (lambda: case(u_max=MASKED), "u_max is None"),
    "one weight": (lambda: smc.design.lqr("duffing", q=1), "q is 1"),  # pyright: ignore
    "film of a name": (lambda: smc.film("duffing", "a.mp4"), "'duffing', no trace"),
    "numbers": (
        lambda: smc.hardware.friction_function(numbers=np.zeros(2))(lambda y, p, m: 0.0),
        "is no mapping",
    ),
    "metrics as a text": (lambda: smc.score([case(duration=0.1)], metrics="itae"), "give a list"),
    "a word of several names": (lambda: smc.plant("pendulum"), "'double_pendulum' or 'inverted"),
    "a short word": (lambda: smc.law("smc"), "near it are mpc"),
    "gains of a law": (lambda: smc.law("pid")(kp=-3), "kp is -3"),
    "a value on which all fails": (lambda: smc.Coulomb(Awkward()), "level is <"),  # pyright: ignore
    "no text": (lambda: smc.Sine(1.0, 1.0, about=EMPTY), "about is array"),  # pyright: ignore
    "no name of a model": (lambda: case(model=EMPTY), "unknown model array"),
    "no scenarios": (lambda: smc.score(MASKED), "cannot score masked"),
    "beyond floats": (lambda: smc.identify_friction([10**400, -1], [1, 2]), "give one number"),
    "a number for names": (lambda: smc.design.excitation("duffing", np.nan), "names is nan"),  # pyright: ignore
    "no names": (lambda: smc.design.excitation("duffing", []), "There are M, delta"),
    "endless points": (
        lambda: smc.signals.cartesian_path("panda", [0.0, 1.0], range(10**9), body="link7"),  # pyright: ignore
        "give fewer",
    ),
    "endless names": (lambda: smc.identify("emps", "a.csv", range(10**9)), "give fewer"),  # pyright: ignore
}


@pytest.mark.quick
@pytest.mark.parametrize("name", REFUSED)
def test_it_is_refused_in_a_sentence(name):
    call, words = REFUSED[name]
    with pytest.raises(smc.ScenarioError, match=words) as refused:
        call()
    assert "\n" not in str(refused.value)


def test_a_figure_s_path_is_a_text(trace):
    with pytest.raises(smc.ScenarioError, match="the path is "):
        smc.figure(trace, path=("a.png",))  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("given", [np.nan, b"1", "\ud800"])
def test_a_title_is_a_text(trace, given):
    with pytest.raises(smc.ScenarioError, match=r"title is .*: give a text"):
        smc.figure(trace, title=given)


def test_a_title_of_two_lines_is_drawn_on_one(trace):
    smc.figure(trace, title="two\nlines")


def test_a_trace_has_the_metrics_that_are_asked_for(trace):
    all_metrics = smc.score(trace)
    assert smc.score(trace, ["itae", "peak"]) == {
        "itae": all_metrics["itae"],
        "peak": all_metrics["peak"],
    }
    with pytest.raises(smc.ScenarioError, match="unknown metric 'peeks'"):
        smc.score(trace, ["peeks"])


@pytest.mark.parametrize("channel", [np.nan, -1, 1, "0"])
def test_a_channel_to_compare_is_one_of_the_run(trace, channel):
    with pytest.raises(smc.ScenarioError, match=r"channel is .*: give a whole number from 0 to 0"):
        step_halving([trace], channel=channel)


TWO_MOTORS = """<mujoco><worldbody><body><joint name="a" axis="0 1 0"/><geom size=".1"/>
<body pos=".5 0 0"><joint name="b" axis="0 1 0"/><geom size=".1"/></body></body></worldbody>
<actuator><motor joint="a" ctrlrange="-3 3"/><motor joint="b" ctrlrange="-3 3"/></actuator></mujoco>"""


def test_measured_joints_may_come_from_a_generator():
    """They were read twice: the second reader found none, and warned of a limp joint."""
    assert smc.plant_from(TWO_MOTORS, ["a"], measured=iter(["b"])).n == 2


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: smc.Scenario("duffing", "pid"), "takes its fields by name"),  # pyright: ignore
        (lambda: smc.Sine(frequenzy=1.0), "'frequenzy': choose from about, amplitude"),  # pyright: ignore
        (lambda: smc.compare(["pid"], metric="itae"), "did you mean 'metrics'"),  # pyright: ignore
    ],
)
def test_unknown_arguments_are_named_with_those_that_are_meant(call, words):
    with pytest.raises(TypeError, match=words):
        call()


def test_a_metric_and_a_parameter_that_are_not_there_say_where_they_are(trace):
    scored = smc.score(trace)
    with pytest.raises(KeyError, match="did you mean 'settling_time'"):
        scored["settle"]
    assert scored.get("settle") is None
    with pytest.raises(AttributeError, match=r"plant\.parameters\['m'\]"):
        _ = smc.plant("inverted_pendulum").m


def test_gains_in_brackets_change_a_law():
    assert smc.law("pid")(kp=3.0) == smc.law("pid", kp=3.0)


def test_numba_without_its_compiler_is_named():
    done = subprocess.run(
        [sys.executable, "-c", "import smc_mujoco as smc; smc.run"],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "ScenarioError: NUMBA_DISABLE_JIT is set" in done.stderr


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.filterwarnings("ignore:.*use of fork")
def test_a_child_of_a_process_that_drew_draws_nothing(monkeypatch):
    monkeypatch.setattr(gl, "missing_renderer", lambda: None)
    monkeypatch.setattr(gl, "_begun", True)
    child = os.fork()
    if child == 0:
        signal.alarm(20)
        try:
            gl.renderer(None, 8, 8)  # pyright: ignore[reportArgumentType]
        except smc.ScenarioError as error:
            os._exit("forked" not in str(error))
        os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
