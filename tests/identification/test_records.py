"""What is a record of a rig: its columns, its times on both sides of each bound, and runs as
records.
"""

import dataclasses
import json
import math

import numpy as np
import pytest
from helpers.machines import AXIS, PENDULUM
from helpers.sketch import made

import smc_mujoco as smc
from smc_mujoco.identification import records
from smc_mujoco.identification.identify import POOR, SLOW, Identified
from smc_mujoco.identification.records import Columns, checked
from smc_mujoco.identification.rig import Fall

pytestmark = pytest.mark.quick

NAMES = Columns(
    x=("x", "q"),
    reference="r",
    feedforward="f",
    other_references=("rq",),
    offset=(0.25, -0.5),
)


def record(t):
    """Columns at times t, all linear in time."""
    t = np.asarray(t, float)
    return {
        "t": t,
        "x": 2.0 * t,
        "q": 3.0 * t,
        "u": 4.0 * t,
        "r": 5.0 * t,
        "strange": t,
    }


def gap(step, periods):
    """Times with one gap of so many steps after the fourth sample."""
    return np.concatenate([step * np.arange(4), step * (3 + periods + np.arange(40))])


@pytest.mark.parametrize(
    ("times", "period", "refused"),
    [
        (gap(0.01, 10.1), None, "has a gap after sample 3, from 0.03 s to 0.131 s"),
        (0.2 * np.arange(9), None, ""),
        (0.201 * np.arange(9), None, "is sampled every 0.201 s and lasts 1.608 s: give time in s"),
        (1.019e-3 * np.arange(60), 1e-3, ""),
        (
            1.021e-3 * np.arange(60),
            1e-3,
            "every 0.001021 s and the rig's controller runs every 0.001 s",
        ),
        (0.981e-3 * np.arange(60), 1e-3, ""),
        (
            0.979e-3 * np.arange(60),
            1e-3,
            "every 0.000979 s and the rig's controller runs every 0.001 s",
        ),
        (gap(0.01, 9.9), None, ""),
        (gap(0.01, 1.4), 0.01, ""),
        (gap(0.01, 1.6), 0.01, "has a gap after sample 3, from 0.03 s to 0.046 s"),
        ([0.0, 0.1, 0.1, 0.2], None, "runs backward after sample 1, from 0.1 s to 0.1 s"),
        ([0.0], None, "has 1 samples: give at least two"),
    ],
)
def test_times_are_those_of_a_record_up_to_each_bound(times, period, refused):
    if refused:
        with pytest.raises(smc.ScenarioError) as error:
            checked(record(times), NAMES, period, "axis")
        assert refused in str(error.value)
        return
    data = checked(record(times), NAMES, period, "axis")
    assert set(data) == {"t", "x", "q", "u", "r"}
    np.testing.assert_allclose(data["x"], 2.0 * data["t"] - 0.25)
    np.testing.assert_allclose(data["q"], 3.0 * data["t"] + 0.5)
    np.testing.assert_allclose(data["u"], 4.0 * data["t"])
    if period is None:  # its own even rate, from the first sample to the last
        step = records.step_of(np.asarray(times))
        np.testing.assert_allclose(np.diff(data["t"]), step)
        assert times[-1] - step < data["t"][-1] <= times[-1] + 1e-9
    else:
        np.testing.assert_array_equal(data["t"], times)


def test_columns_that_a_replay_needs_and_knows():
    assert NAMES.needed(False) == ("t", "x", "q", "u")
    assert NAMES.needed(True) == ("t", "x", "q", "u", "r")
    assert NAMES.readable == ("t", "x", "q", "u", "r", "rq", "f")
    torques = dataclasses.replace(NAMES, torque=("a", "b"), state=("p", "v"))
    assert torques.needed(False) == torques.needed(True) == ("t", "x", "q", "a", "b")
    assert torques.readable == ("t", "x", "q", "a", "b", "r", "rq", "f", "p", "v")


def test_a_state_comes_from_a_cubic_about_it_and_at_the_start_from_the_first_sample():
    t = 0.01 * np.arange(100)
    data = {
        "t": t,
        "x": 1.0 + 2.0 * t - 3.0 * t**2 + 4.0 * t**3,
        "q": np.where(t > 0.505, 9.0, t),
    }
    for sample in (0, 3, 50, 99):
        x, v = records.state(data, NAMES, 0.01, sample)
        assert x[0] == pytest.approx(data["x"][sample])
        assert v[0] == pytest.approx(2.0 - 6.0 * t[sample] + 12.0 * t[sample] ** 2)
    # 15 samples on each side, and no further
    assert records.state(data, NAMES, 0.01, 35)[1][1] == pytest.approx(1.0)
    assert abs(records.state(data, NAMES, 0.01, 36)[1][1] - 1.0) > 0.01
    np.testing.assert_allclose(records.rate(data["x"], 0.01), 2.0 - 6.0 * t + 12.0 * t**2)
    with_states = dataclasses.replace(NAMES, state=("x", "q", "t", "t"))
    x, v = records.state(data, with_states, 0.01, 50)
    assert (*x, *v) == (data["x"][50], data["q"][50], t[50], t[50])


def test_a_run_becomes_the_record_that_the_machine_would_write():
    plain = smc.Scenario(
        plant="pendulum_network",
        law=smc.law("pid"),
        duration=0.2,
        sensor=smc.Encoder(500, bias=0.1),
        feedforward=smc.Sine(0.3, 9.0),
    )
    trace = made(plain)
    names = dataclasses.replace(NAMES, state=("px", "pq", "vx", "vq"))
    quantum = math.tau / 500
    noisy = dataclasses.replace(plain, noise=smc.Noise(0.05), seed=4)
    plain_record, noisy_record = (
        records.of_trace(dataclasses.replace(trace, scenario=scenario), names)
        for scenario in (plain, noisy)
    )
    for i, (name, offset) in enumerate(zip(("x", "q"), names.offset, strict=True)):
        counts = (plain_record[name] - offset) / quantum
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
        np.testing.assert_allclose(
            plain_record[name] - offset - 0.1, trace.x[:, i], atol=0.5001 * quantum
        )
        assert np.std(noisy_record[name] - plain_record[name]) == pytest.approx(0.05, rel=0.15)
    noises = [noisy_record[name] - plain_record[name] for name in ("x", "q")]
    assert abs(np.corrcoef(noises)[0, 1]) < 0.3  # each has its own noise
    for name, column in {
        "u": trace.u[:, 0],
        "r": trace.r[:, 0],
        "px": trace.x[:, 0],
        "pq": trace.x[:, 1],
    }.items():
        np.testing.assert_array_equal(plain_record[name], column)
    np.testing.assert_allclose(plain_record["f"], 0.3 * np.sin(9.0 * trace.t))


def found(twin=AXIS, correlation=0.0, **changes):
    """An identification of a rig with values and errors of no doubt, but for the changes."""
    correlations = np.eye(len(twin.free))
    correlations[0, 1] = correlations[1, 0] = correlation
    plain = {
        "rig": twin,
        "before": twin,
        "values": {name: twin.values[name] + 1e-6 for name in twin.free},
        "errors": dict.fromkeys(twin.free, 1e-9),
        "correlations": correlations,
        "fits": ({"x": 99.0},),
        "fits_before": ({"x": 99.0},),
        "predictions": (),
        "evaluations": 1,
        "independent": 100.0,
    }
    return Identified(**plain | changes)


def test_a_fall_is_a_text_in_a_file(tmp_path):
    reported = found(fits=({"x": Fall(8.44), "u": Fall(8.44)},)).save(tmp_path / "a.json")
    assert json.loads(reported.read_text())["fits"] == [
        {"x": "falls at 8.4 s", "u": "falls at 8.4 s"}
    ]


FREE = {name: AXIS.values[name] for name in AXIS.free}
OPEN = {"twin": PENDULUM}  # its loop is not closed
LONG = OPEN | {"predictions": (({}, {}, np.arange(1000.0)),)}


@pytest.mark.parametrize(
    ("quiet", "loud", "note"),
    [
        ({"correlation": 0.979}, {"correlation": -0.981}, "mass and viscous are hardly told apart"),
        (
            {"values": FREE | {"mass": 1.001}},
            {"values": FREE | {"mass": 1.0}},
            "mass is at the end of its range",
        ),
        (
            {"errors": dict.fromkeys(FREE, 3.0)},
            {"errors": dict.fromkeys(FREE, 3.2)},
            "offset may as well be 0",
        ),
        ({"fits": ({"x": 80.0},)}, {"fits": ({"x": 79.9},)}, POOR),
        ({"fits": ({"x": 80.0},)}, {"fits": ({"x": Fall(8.44)},)}, POOR),
        (OPEN | {"independent": 60.0}, OPEN | {"independent": 59.0}, SLOW),
        (LONG | {"independent": 100.0}, LONG | {"independent": 99.0}, SLOW),
        (
            OPEN | {"independent": 9.0, "fits": ({"x": 99.995},)},
            OPEN | {"independent": 9.0},
            SLOW,
        ),
        ({"independent": 9.0}, OPEN | {"independent": 9.0}, SLOW),  # the loop is closed
    ],
)
def test_what_to_doubt_is_said_from_each_bound_on(quiet, loud, note):
    calm = found(**quiet).notes
    assert not [sentence for sentence in calm if sentence.startswith(note)]
    assert [sentence for sentence in found(**loud).notes if sentence.startswith(note)]


@pytest.mark.quick
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0.0,0.1,1\n0.1,0.2,2\n", "has numbers in its first line: give a first line with"),
        ("t,x,u\n0.0,0.1,1_0\n0.1,0.2,2\n", "column u of .* is nan at sample 0"),
    ],
)
def test_a_log_without_a_heading_and_what_python_alone_takes_for_a_number(tmp_path, text, words):
    file = tmp_path / "log.csv"
    file.write_text(text)
    with pytest.raises(smc.ScenarioError, match=words):
        smc.identify(smc.plant("duffing"), file, ["alpha"])
