"""A trace on disk is the trace in memory, to the last bit; what cannot be written or read costs one
sentence.
"""

import contextlib
import copy
import csv
import dataclasses
import errno
import json
import math
import os
import re
import sys
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from helpers.commands import python
from helpers.runs import scenario
from pyarrow import parquet
from scipy.io import loadmat

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioWarning

pytestmark = pytest.mark.quick

ARRAYS = ("t", "x", "v", "u", "applied", "s", "d", "r", "force", "reaction")
FORCES = ("u", "applied", "d", "force", "reaction")


@dataclasses.dataclass(frozen=True)
class Ramp(smc.Signal):
    """A user's own signal."""

    slope: float = 1.0

    @staticmethod
    def value(t, p):
        """p.slope * t."""
        return p.slope * t, p.slope, 0.0


@smc.law_function(gains={"k": 2.0, "c": 1.0}, memory=3)
def my_law(y, gains, memory):
    """A user's own law."""
    memory[2] += y.dt
    return -gains.k * y.e - gains.c * y.de, memory[2]


@smc.law_function(gains={"k": 4.0, "c": 3.0})
def classical(y, gains, memory):
    """A user's own law under the name and with the gains of one of the library."""
    return 0.0, 0.0


def network(**fields):
    return scenario(
        plant=smc.plant("pendulum_network", n=3, m=0.4, kc=0.3),
        law=smc.law("super_twisting", k1=0.1 + 0.2),
        velocity=smc.estimator("filtered_difference", tau=1e-2),
        control_period=2e-3,
        physics_step=1e-3,
        x0=(0.1, 0.2, -0.3),
        v0=1 / 3,
        reference=smc.Sine(0.1, 2.0, 0.3),
        disturbance=[
            smc.Constant(0.1),
            smc.Step(0.1, 0.005),
            smc.signals.Pulse(0.1, 0.005, 0.01),
            smc.signals.OrnsteinUhlenbeck(0.1, 0.1, 2e-3),
            Ramp(0.5),
        ],
        noise=smc.Noise(0.01, 0.05),
        input_delay=3e-3,
        mismatch={"mass": 1.3, "kc": 0.5},
        jump=smc.Jump(0.01, {"b": 2.0}),
        seed=2**53 - 1,
        integrator="implicitfast",
        u_max=math.inf,
        **fields,
    )


SCENARIOS = {
    "plain": scenario(),
    "network": network(),
    "own law": scenario(law=my_law(k=3.0)),
    "diverged": scenario(law="none", plant=smc.plant("duffing", alpha=-1e6, beta=0.0)),
    "diverged at once": scenario(x0=1e6),
    "numpy": scenario(
        x0=np.float32(0.3),
        duration=np.float32(0.02),
        noise=smc.Noise(np.float32(0.1), np.int64(0)),
        jump=smc.Jump(np.float32(0.01), {"M": np.float32(1.1)}),
        mismatch={"delta": np.int64(2)},
        disturbance=smc.Sine(np.float32(0.1), np.int64(2)),
    ),
}


@pytest.fixture(scope="module")
def traces():
    return dict(zip(SCENARIOS, smc.run(list(SCENARIOS.values())), strict=True))


@pytest.fixture
def trace(traces):
    return traces["network"]


def identical(a, b) -> bool:
    return all(
        getattr(a, name).tobytes() == getattr(b, name).tobytes()
        and getattr(a, name).shape == getattr(b, name).shape
        for name in ARRAYS
    )


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


# there and back


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_trace_comes_back_to_the_last_bit(name, traces, tmp_path):
    trace = traces[name]
    again = smc.load(trace.save(tmp_path / "a.npz"))
    assert identical(again, trace)
    assert again.diverged_at == trace.diverged_at
    assert again.failure == trace.failure
    assert names(tmp_path) == ["a.npz"]


@pytest.mark.parametrize("name", ["plain", "network", "diverged", "numpy"])
def test_its_scenario_comes_back_equal_and_gives_the_same_trace(name, traces, tmp_path):
    trace = traces[name]
    again = smc.load(trace.save(tmp_path / "a.npz"))
    assert again.scenario == trace.scenario
    assert identical(smc.run(again.scenario), trace)


def test_a_law_of_one_s_own_keeps_its_name_and_gains_but_not_its_code(traces, tmp_path, refused):
    again = smc.load(traces["own law"].save(tmp_path / "a.npz")).scenario
    assert again.law.name == "my_law"
    assert dict(again.law.gains) == {"k": 3.0, "c": 1.0}
    assert again.law.memory == 3
    refused(lambda: smc.run(again), "my_law")
    assert smc.run(dataclasses.replace(again, law=my_law(**again.law.gains))).diverged_at is None


def test_a_free_body_comes_back_under_a_law_of_one_s_own(tmp_path, refused):
    law = smc.law_function(joint=True, plants=("a free body",))(
        lambda y, gains, memory: (y.h, y.e)
    )()
    trace = smc.run(smc.Scenario(plant="quadrotor", law=law, duration=0.01))
    again = smc.load(trace.save(tmp_path / "a.npz"))
    np.testing.assert_array_equal(again.x, trace.x)
    refused(lambda: smc.run(again.scenario), law.name)


def test_a_law_of_one_s_own_is_never_taken_for_the_library_s(tmp_path, refused):
    again = smc.load(smc.run(scenario(law=classical())).save(tmp_path / "a.npz")).scenario
    assert again.law != smc.law("classical")
    refused(lambda: smc.run(again), "classical")


def test_a_file_brings_the_parts_and_signals_that_nothing_has_used(tmp_path):
    scenario_of_code = smc.Scenario(
        plant="duffing",
        law="none",
        duration=0.01,
        friction=smc.hardware.Sigmoid(1.0, 2.0),
        reference=smc.signals.TimeSeries((0.0, 1.0), (0.0, 0.1)),
    )
    path = smc.run(scenario_of_code).save(tmp_path / "a.npz")
    code = (
        f"import smc_mujoco as smc; s = smc.load({str(path)!r}).scenario; print(s.reference, "
        "s.friction)"
    )
    done = python("-c", code)
    assert done.stdout.strip() == f"{scenario_of_code.reference} {scenario_of_code.friction}"


def test_the_arrays_are_read_only_wherever_a_trace_comes_from(trace, tmp_path):
    for copied in (
        trace,
        smc.load(trace.save(tmp_path / "a.npz")),
        copy.deepcopy(trace),
        dataclasses.replace(trace),
    ):
        for name in ARRAYS:
            with pytest.raises(ValueError, match="read-only"):
                getattr(copied, name)[0] = 1.0


# names


# exports


@pytest.mark.parametrize("name", ["plain", "network", "diverged"])
def test_csv_holds_every_number_to_the_last_bit(name, traces, tmp_path):
    trace = traces[name]
    with open(trace.export(tmp_path / "a.csv"), newline="") as file:
        rows = []
        for row in csv.DictReader(file):
            rows.append({re.sub(r" \[.*\]", "", head): cell for head, cell in row.items()})
    assert len(rows) == len(trace.t)
    # no digit more than it takes
    for row in rows:
        for cell in row.values():
            assert cell == repr(float(cell))
    n = trace.x.shape[1]
    columns = ["t"] + [f"{name}{i if n > 1 else ''}" for name in ARRAYS[1:] for i in range(n)]
    assert list(rows[0]) == columns
    for column, expected in zip(
        columns,
        [trace.t, *(getattr(trace, a)[:, i] for a in ARRAYS[1:] for i in range(n))],
        strict=True,
    ):
        np.testing.assert_array_equal([float(row[column]) for row in rows], expected)


@smc.law_function(gains={"kp": 20.0, "kd": 4.0})
def reading(y, gains, memory):
    """A PD law whose s is the position that it reads."""
    return -gains.kp * y.e - gains.kd * y.de, y.x


SEEN = {
    "counts and noise": {"sensor": smc.Encoder(1024, bias=0.01), "noise": smc.Noise(2e-3)},
    "late and lost": {"sensor": smc.Encoder(1024, delay=3e-3, dropout=0.2)},
    "a clock of its own": {"sensor": smc.Encoder(1024, period=4e-3), "noise": smc.Noise(1e-3)},
    "the motor's side": {
        "sensor": smc.Encoder(4096, side="motor"),
        "actuator": smc.Backlash(0.05),
    },
}


@pytest.mark.parametrize("case", SEEN)
def test_readings_are_what_the_law_read(case, tmp_path):
    trace = smc.run(smc.Scenario(plant="duffing", law=reading(), duration=0.3, **SEEN[case]))
    exported = {}
    for seen, run in ((False, trace), (True, smc.measured(trace))):
        with open(run.export(tmp_path / "a.csv"), newline="") as file:
            rows = list(csv.DictReader(file))
        exported[seen] = np.array([float(row["x [m]"]) for row in rows])
        assert [float(row["v [m/s]"]) for row in rows] == trace.v[:, 0].tolist()
    np.testing.assert_array_equal(exported[False], trace.x[:, 0])
    np.testing.assert_array_equal(exported[True], trace.s[:, 0])
    assert abs(exported[True] - trace.x[:, 0]).max() > 1e-4


def test_every_format_has_the_units_of_each_column(tmp_path):
    """Of the cart and of its pole, of which one moves in m and the other in rad."""
    trace = smc.run(smc.Scenario(plant="cart_pole", law="hierarchical", duration=0.01))
    units = {
        "t": "s",
        "x0": "m",
        "x1": "rad",
        "v0": "m/s",
        "v1": "rad/s",
        "s0": "",
        "s1": "",
        "r0": "m",
        "r1": "rad",
    }
    units |= {f"{name}{i}": unit for name in FORCES for i, unit in enumerate(("N", "N m"))}
    assert {name: trace.units()[name] for name in units} == units
    assert list(trace.units()) == list(trace.columns())
    heads = trace.export(tmp_path / "a.csv").read_text().partition("\n")[0].split(",")
    assert heads == [f"{name} [{units[name]}]" if units[name] else name for name in trace.columns()]
    schema = parquet.read_schema(trace.export(tmp_path / "a.parquet"))
    assert {field.name: field.metadata[b"unit"].decode() for field in schema} == units
    held = loadmat(trace.export(tmp_path / "a.mat"), simplify_cells=True)["units"]
    assert {name: held[name] for name in ("x", "v", "u")} == {
        "x": "m, rad",
        "v": "m/s, rad/s",
        "u": "N, N m",
    }
    single = smc.run(smc.Scenario(plant="duffing", law="none", duration=0.01))
    assert loadmat(single.export(tmp_path / "b.mat"), simplify_cells=True)["units"]["u"] == "N"


# what is no trace


def test_parquet_holds_every_number_to_the_last_bit_and_the_scenario(traces, tmp_path):
    trace = traces["network"]
    table = parquet.read_table(trace.export(tmp_path / "a.parquet"))
    assert table.column_names == list(trace.columns())
    rows = list(trace)  # as pandas.DataFrame(trace) reads it
    for column, expected in trace.columns().items():
        np.testing.assert_array_equal([row[column] for row in rows], expected)
        np.testing.assert_array_equal(table[column].to_numpy(), expected)
    described = json.loads(table.schema.metadata[b"scenario"])
    assert described["plant"]["name"] == trace.scenario.plant.name


def test_pickled_objects_are_not_loaded(tmp_path, refused):
    np.savez(tmp_path / "a.npz", about=np.array([{"a": 1}], dtype=object))
    refused(lambda: smc.load(tmp_path / "a.npz"), "a.npz")


def test_a_file_with_a_flipped_byte_is_no_trace_or_the_same_one(trace, tmp_path):
    path = trace.save(tmp_path / "a.npz")
    good = path.read_bytes()
    for place in range(0, len(good), len(good) // 100):
        path.write_bytes(good[:place] + bytes([good[place] ^ 0xFF]) + good[place + 1 :])
        with contextlib.suppress(smc.ScenarioError):
            assert identical(smc.load(path), trace)


def tampered(trace, folder, about=None, **arrays) -> Path:
    """The file of a trace, with another description or other arrays."""
    path = trace.save(folder / "a.npz")
    with np.load(path) as file:
        held = dict(file)
    np.savez(
        path,
        **held | {"about": np.array(json.dumps(about(json.loads(str(held["about"])))))}
        if about
        else held | arrays,
    )
    return path


def test_a_description_that_makes_no_sense_is_no_trace(trace, tmp_path, refused):
    for about in (
        lambda about: [],
        lambda about: 1,
        lambda about: {},
        lambda about: {"diverged_at": None, "failure": None},
        *(
            lambda about, key=key: {k: v for k, v in about.items() if k != key}
            for key in ("law", "plant", "noise", "x0", "failure")
        ),
        *(
            lambda about, key=key: about | {key: 5}
            for key in ("law", "plant", "reference", "disturbance", "mismatch", "jump")
        ),
        lambda about: about | {"noise": {"colour": 1.0}},
        lambda about: about | {"plant": {"name": "dufing"}},
        lambda about: about | {"duration": -1.0},
        lambda about: about | {"reference": {"kind": "Sinus"}},
    ):
        path = tampered(trace, tmp_path, about)
        refused(lambda path=path: smc.load(path), path)


def with_member(trace, folder, name: str, content: bytes) -> Path:
    """The file of a trace, one member of which has other bytes."""
    path = trace.save(folder / "a.npz")
    with zipfile.ZipFile(path) as old:
        held = {member: old.read(member) for member in old.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for member, data in (held | {f"{name}.npy": content}).items():
            new.writestr(member, data)
    return path


def array(header: str, data: bytes = b"") -> bytes:
    """A .npy file with such a header."""
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + data


def test_an_array_too_large_is_refused_before_it_is_read(trace, tmp_path, refused):
    for name, shape, kind in [
        ("x", (11, 3 * 10**6), "<f8"),
        ("t", (10**12,), "<f8"),
        ("about", (), "<U400000000"),
    ]:
        header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}}}"
        path = with_member(trace, tmp_path, name, array(header, bytes(3 * 10**7)))
        tracemalloc.start()
        try:
            refused(lambda path=path, name=name: smc.load(path), "a.npz", f"its {name} is")
            assert tracemalloc.get_traced_memory()[1] < 10**7
        finally:
            tracemalloc.stop()


def test_a_scenario_that_could_not_be_read_back_is_not_saved(trace, tmp_path, monkeypatch, refused):
    monkeypatch.setattr("smc_mujoco.simulation.trace.MAX_TEXT", 100)
    said = (
        "its scenario is a text of",
        "and more than 100 are not read back: give it shorter time series",
    )
    refused(lambda: trace.save(tmp_path / "a.npz"), *said)  # the text has the versions of packages
    assert names(tmp_path) == []


# disks


WRITERS = {
    "npz": lambda trace, path: trace.save(path),
    "csv": lambda trace, path: trace.export(path),
    "mat": lambda trace, path: trace.export(path),
    "parquet": lambda trace, path: trace.export(path),
}


@pytest.mark.skipif(sys.platform == "win32", reason="resource")
@pytest.mark.parametrize(
    ("ending", "samples", "room"),
    [
        ("npz", 20, 300),
        ("npz", 3000, 9000),
        ("csv", 3000, 9000),
        ("mat", 20, 300),
        ("parquet", 3000, 9000),
    ],
)  # at the end, and in the middle
def test_a_disk_that_is_full_leaves_the_old_file_and_no_other(ending, samples, room, tmp_path):
    import resource

    path = tmp_path / f"a.{ending}"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    trace = smc.run(
        smc.Scenario(plant="duffing", law=smc.law("classical"), duration=samples * 1e-3)
    )
    WRITERS[ending](trace, path)
    old = path.read_bytes()
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, limits[1]))
        with pytest.raises(smc.ScenarioError) as caught:
            WRITERS[ending](trace, path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert str(caught.value).startswith(f"cannot write {path}: {os.strerror(errno.EFBIG)}")
    assert str(caught.value).isprintable()
    assert path.read_bytes() == old
    assert names(tmp_path) == [path.name]


def test_a_voltage_and_a_feedforward_come_back_and_have_their_unit(tmp_path):
    motor = smc.DCMotor(
        8.4,
        1e-3,
        0.042,
        1.0,
        4e-6,
        voltage=10.0,
        command="voltage",
    )
    trace = smc.run(
        smc.Scenario(
            plant="furuta",
            law="none",
            actuator=motor,
            feedforward=smc.Sine(1.0, 9.0),
            duration=0.01,
        )
    )
    assert {name: trace.units()[f"{name}0"] for name in FORCES} == {
        "u": "V",
        "applied": "V",
        "d": "N m",
        "force": "N m",
        "reaction": "N m",
    }
    again = smc.load(trace.save(tmp_path / "a.npz"))
    assert again.scenario == trace.scenario
    assert "u0 [V]" in trace.export(tmp_path / "a.csv").read_text().partition("\n")[0]


def test_a_free_joint_has_the_goal_of_its_plant_as_reference():
    upright = (0.0, math.pi)
    trace = smc.run(
        smc.Scenario(
            plant="acrobot",
            law="none",
            x0=upright,
            duration=0.05,
        )
    )
    assert (trace.r == upright).all()
    assert smc.scores(trace)["free"]["ultimate_bound"] < 1e-9


@pytest.mark.parametrize("changed", ["about", "x"])
def test_a_file_whose_scenario_or_numbers_were_changed_is_refused(changed, trace, tmp_path):
    path = trace.save(tmp_path / "run.npz")
    content = dict(np.load(path))
    if changed == "about":
        content["about"] = np.array(str(content["about"]).replace('"duration"', ' "duration"'))
        assert smc.load(path).scenario == trace.scenario
    else:
        content["x"][1, 0] += 1e-9
    np.savez(path, **content)
    with pytest.raises(smc.ScenarioError, match="changed, since it was written"):
        smc.load(path)
    del content["seal"]  # of an older version
    np.savez(path, **content)
    with pytest.warns(ScenarioWarning, match="has no seal"):
        assert smc.load(path).scenario == trace.scenario
