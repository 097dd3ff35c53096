"""What is a record of a rig: its columns, its times on both sides of each bound, and runs as
records.
"""

import dataclasses
import json
import math

import numpy as np
import pytest
from helpers.sketch import made

import smc_mujoco as smc
from smc_mujoco.evidence.rigs import records
from smc_mujoco.evidence.rigs.identify import Identified
from smc_mujoco.evidence.rigs.records import Columns, checked
from smc_mujoco.evidence.rigs.rig import Fall

pytestmark = pytest.mark.quick

NAMES = Columns(x=("x", "q"), reference="r", feedforward="f", others=("rq",), offset=(0.25, -0.5))


def record(t):
    """Columns at times t, all linear in time."""
    t = np.asarray(t, float)
    return {"t": t, "x": 2.0 * t, "q": 3.0 * t, "u": 4.0 * t, "r": 5.0 * t, "strange": t}


def gap(step, periods):
    """Times with one gap of so many steps after the fourth sample."""
    return np.concatenate([step * np.arange(4), step * (3 + periods + np.arange(40))])


@pytest.mark.parametrize(
    ("times", "period", "refused"),
    [
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
        (gap(0.01, 10.1), None, "has a gap after sample 3, from 0.03 s to 0.131 s"),
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


def test_columns_that_a_replay_needs_may_turn_and_knows():
    assert NAMES.needed(False) == ("t", "x", "q", "u")
    assert NAMES.needed(True) == ("t", "x", "q", "u", "r")
    assert NAMES.known == ("t", "x", "q", "u", "r", "rq", "f")
    torques = dataclasses.replace(NAMES, torque=("a", "b"), state=("p", "v"))
    assert torques.needed(False) == torques.needed(True) == ("t", "x", "q", "a", "b")
    assert torques.known == ("t", "x", "q", "a", "b", "r", "rq", "f", "p", "v")
    turned = records.in_radians(record([0.0, 1.0]), NAMES, ("q", "rq"))
    assert turned["q"].tolist() == [0.0, math.radians(3.0)]
    assert turned["x"].tolist() == [0.0, 2.0]


def test_a_missing_column_is_named_with_a_cure():
    with pytest.raises(smc.ScenarioError) as error:
        checked({"t": [0.0, 1.0], "x": [1.0, 2.0], "angle": [0.0, 1.0]}, NAMES, 1.0, "axis")
    assert str(error.value) == (
        "the record of axis has no column q, u, r (it has t, x, angle): add it, or say which it is, as --columns "
        "q=angle (in Python names={'q': 'angle'})"
    )
    with pytest.raises(
        smc.ScenarioError,
        match=r"column x of axis is \[\[1.0\], \[2.0\]\]: give one number a sample",
    ):
        checked(record([0.0, 1.0]) | {"x": [[1.0], [2.0]]}, NAMES, 1.0, "axis")


def test_a_state_comes_from_a_cubic_about_it_and_at_the_start_from_the_first_sample():
    t = 0.01 * np.arange(100)
    data = {"t": t, "x": 1.0 + 2.0 * t - 3.0 * t**2 + 4.0 * t**3, "q": np.where(t > 0.505, 9.0, t)}
    for at in (0, 3, 50, 99):
        x, v = records.state(data, NAMES, 0.01, at)
        assert (x[0], v[0]) == (
            pytest.approx(data["x"][at]),
            pytest.approx(2.0 - 6.0 * t[at] + 12.0 * t[at] ** 2),
        )
    assert records.state(data, NAMES, 0.01, 35)[1][1] == pytest.approx(
        1.0
    )  # 15 samples on each side, and no further
    assert abs(records.state(data, NAMES, 0.01, 36)[1][1] - 1.0) > 0.01
    np.testing.assert_allclose(records.rate(data["x"], 0.01), 2.0 - 6.0 * t + 12.0 * t**2)
    known = dataclasses.replace(NAMES, state=("x", "q", "t", "t"))
    x, v = records.state(data, known, 0.01, 50)
    assert (*x, *v) == (data["x"][50], data["q"][50], t[50], t[50])


def test_a_run_becomes_the_record_that_the_machine_would_write():
    plain = smc.Scenario(
        plant="pendulum_network",
        law="pid",
        duration=0.2,
        sensor=smc.Encoder(500, bias=0.1),
        feedforward=smc.Sine(0.3, 9.0),
    )
    trace = made(plain)
    names = dataclasses.replace(NAMES, state=("px", "pq", "vx", "vq"))
    quantum = math.tau / 500
    noisy = dataclasses.replace(plain, noise=smc.Noise(0.05), seed=4)
    found, other = (
        records.of_trace(dataclasses.replace(trace, scenario=one), names) for one in (plain, noisy)
    )
    for i, (name, offset) in enumerate(zip(("x", "q"), names.offset, strict=True)):
        counts = (found[name] - offset) / quantum
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
        np.testing.assert_allclose(found[name] - offset - 0.1, trace.x[:, i], atol=0.5001 * quantum)
        assert np.std(other[name] - found[name]) == pytest.approx(0.05, rel=0.15)
    assert (
        abs(np.corrcoef(other["x"] - found["x"], other["q"] - found["q"])[0, 1]) < 0.3
    )  # each has its own noise
    for name, column in {
        "u": trace.u[:, 0],
        "r": trace.r[:, 0],
        "px": trace.x[:, 0],
        "pq": trace.x[:, 1],
    }.items():
        np.testing.assert_array_equal(found[name], column)
    np.testing.assert_allclose(found["f"], 0.3 * np.sin(9.0 * trace.t))


# what is said of quantities


def told(changes=(), errors=(), fits=((99.0,),), before=((99.0,),)):
    """The notes on quantities of the axis whose values changed by factors."""
    rig = smc.rig("emps")
    values = {name: rig.values[name] * dict(changes).get(name, 1.0) for name in rig.free}
    its = dict.fromkeys(rig.free, 1e-9) | dict(errors)
    many, first = ([{"x": one[0]} for one in each] for each in (fits, before))
    found = Identified(
        rig=rig.with_values(values),
        before=rig,
        values=values,
        errors=its,
        correlations=np.eye(4),
        fits=tuple(many),
        fits_before=tuple(first),
        predictions=(),
        evaluations=1,
        independent=100.0,
    )
    return found.notes


def test_a_fall_is_a_text_in_a_file(tmp_path):
    found = Identified(
        rig=smc.rig("emps"),
        before=smc.rig("emps"),
        values={},
        errors={},
        correlations=np.eye(0),
        fits=({"x": Fall(8.44), "u": 1.5},),
        fits_before=(),
        predictions=(),
        evaluations=1,
        independent=1.0,
    )
    assert json.loads(found.save(tmp_path / "a.json").read_text())["fits"] == [
        {"x": "falls at 8.4 s", "u": 1.5}
    ]


def test_slow_residuals_are_noted_unless_the_fit_is_perfect_or_the_loop_closed():
    pendulum = smc.rig("simple_pendulum_ak80")
    value = {"inertia": pendulum.values["inertia"]}
    found = Identified(
        rig=pendulum,
        before=pendulum,
        values=value,
        errors={"inertia": 1e-9},
        correlations=np.eye(1),
        fits=({"position": 98.0},),
        fits_before=({"position": 98.0},),
        predictions=(),
        evaluations=1,
        independent=12.0,
    )
    assert found.notes == [
        "the residuals are slow, with 12 independent samples, as where a force was not recorded: true errors may be "
        "several standard errors"
    ]
    for change in (
        {"independent": 60.0},
        {"fits": ({"position": 99.995},)},
        {"rig": smc.rig("emps")},
    ):
        assert not any("slow" in note for note in dataclasses.replace(found, **change)._doubts())


def scaled(**factors):
    return {"changes": factors.items()}


@pytest.mark.parametrize(
    ("quiet", "loud", "said"),
    [
        (scaled(mass=4.99), scaled(mass=5.01), "mass is 5.01 times its value before"),
        (scaled(mass=0.201), scaled(mass=0.199), "mass is 0.199 times its value"),
        (
            scaled(offset=9.0),
            scaled(mass=9.0, viscous=9.8),
            "mass and viscous are 9.4 times what they were before",
        ),
        ({}, scaled(mass=9.0, viscous=12.0), "mass is 9 times its value before and viscous is 12"),
        (
            {"errors": [("mass", 95.1089)]},
            {"errors": [("mass", 95.2)]},
            "mass may as well be 0 (95.1 ± 95)",
        ),
        (
            {"before": [[99.1]]},
            {"before": [[99.11]]},
            "record 1, repeated as a whole, fits by 99 % and by 99 %",
        ),
        (
            {"fits": [[80.0]], "before": [[80.0]]},
            {"fits": [[79.9]], "before": [[79.9]]},
            "the worst fit is 80 %",
        ),
    ],
)
def test_what_to_doubt_is_said_from_each_bound_on(quiet, loud, said):
    assert told(**quiet) == []
    (note,) = told(**loud)
    assert note.startswith(said)
