"""Identification returns what made the records, and says what records cannot tell."""

import csv
import dataclasses
import math

import numpy as np
import pytest
from helpers import machines
from helpers.machines import AXIS, PENDULUM
from matplotlib.figure import Figure
from scipy.stats import chi2

import smc_mujoco as smc
from smc_mujoco.identification import published_rig as rigs
from smc_mujoco.identification import records, standard_errors
from smc_mujoco.identification.own_rig import own_rig
from smc_mujoco.identification.replays import Point, Replays
from smc_mujoco.identification.residual_figure import residual_figure
from smc_mujoco.identification.rig import Fall, Quantity

FIXED = dataclasses.replace(AXIS, name="fixed", free=())


def carriage(x, v, force, time, m, b, dry, constant):
    """An axis under a constant force, s later, in closed form between its stops: an independent
    oracle.
    """
    while time > 1e-15:
        net = force - constant
        if v == 0.0 and abs(net) <= dry:
            break
        sign = math.copysign(1.0, v or net)
        final = (net - dry * sign) / b
        lag = m / b
        if v and final * sign < 0.0:
            stop = lag * math.log((v - final) / -final)
        else:
            stop = math.inf
        spent = min(time, stop)
        decay = math.exp(-spent / lag)
        x, v = x + final * spent + (v - final) * lag * (1.0 - decay), final + (v - final) * decay
        v, time = (0.0 if spent == stop else v), time - spent
    return x, v


def axis_record(seconds, begin=0.0, speed=4.0):
    """Columns of the real axis on a sine from rest, as its encoder, cascade and amplifier would
    write them.
    """
    quantum = AXIS.values["count"]
    gains = AXIS.scenario().law.gains
    t = 1e-3 * np.arange(round(seconds / 1e-3) + 1)
    r = 0.05 * np.sin(speed * t)
    y, u = np.zeros((2, len(t)))
    x = 0.0
    v = 0.0
    for k in range(len(t)):
        y[k] = quantum * math.floor(x / quantum + 0.5)
        rate = (y[k] - y[k - 1]) / 1e-3 if k else 0.0
        u[k] = min(10.0, max(-10.0, gains["kv"] * (gains["kp"] * (r[k] - y[k]) - rate)))
        x, v = carriage(
            x, v, AXIS.values["force_per_volt"] * u[k], 1e-3, *map(AXIS.values.get, AXIS.free)
        )
    first = round(begin / 1e-3)
    return {
        "t": t[first:] - begin,
        "x": y[first:],
        "u": u[first:],
        "r": r[first:],
    }


@pytest.mark.parametrize(
    "begin",
    [pytest.param(0.0, marks=pytest.mark.slow), 0.25],
    ids=["with a jump from rest", "in motion"],
)
def test_columns_of_the_axis_give_all_four_however_they_begin(begin):
    """By another simulator without steps; a cubic through the first samples would err by 8 % in the
    offset.
    """
    near = AXIS.with_values({name: 1.05 * AXIS.values[name] for name in AXIS.free})
    result = smc.identify(
        near,
        axis_record(0.6 + begin, begin),
        starts=1,
        most=3,
    )
    for name, value in result.values.items():
        assert value == pytest.approx(AXIS.values[name], rel=0.02)
    assert min(result.fits[0].values()) > 99.0


@pytest.fixture(scope="module")
def moved():
    """0.6 s of the axis on a sine, read by its encoder."""
    return smc.run(AXIS.scenario(duration=0.6, reference=smc.Sine(0.05, 4.0), x0=0.0))


@pytest.fixture(scope="module")
def swung():
    """1.5 s of the pendulum under a torque, with noise."""
    return smc.run(
        PENDULUM.scenario(
            "none",
            feedforward=smc.Sine(2.0, 4.5),
            duration=1.5,
            x0=-math.pi,
            noise=smc.Noise(1e-3),
            seed=3,
        )
    )


def test_equal_seeds_give_equal_results_and_another_seed_begins_elsewhere():
    """From a mass so far off that a random start is better, and with a single step from it."""
    far = AXIS.with_values({"mass": 2000.0})
    brief = smc.run(AXIS.scenario(duration=0.5, reference=smc.Sine(0.05, 8.0), x0=0.0))
    seed_5, again, seed_6 = (
        smc.identify(
            far,
            brief,
            ["mass"],
            starts=2,
            seed=seed,
            most=1,
        )
        for seed in (5, 5, 6)
    )
    assert seed_5.values == again.values
    assert seed_5.errors == again.errors
    assert seed_5.values != seed_6.values
    for identified in (seed_5, seed_6):
        assert identified.values["mass"] == pytest.approx(AXIS.values["mass"], rel=0.02)


@pytest.mark.quick
def test_noise_is_read_off_a_moving_record():
    t = 1e-3 * np.arange(4000)
    rng = np.random.default_rng(5)
    record = {"x": 0.3 * np.sin(20.0 * t) + rng.normal(0.0, 2e-4, len(t))}
    record["x"][2000:] += 0.1  # a jump
    assert records.noise(record, records.Columns()) == pytest.approx(2e-4, rel=0.05)


def test_parameters_that_cannot_be_told_apart_are_named(swung):
    with pytest.raises(smc.ScenarioError, match="in the records depends on torque_limit"):
        smc.identify(
            PENDULUM,
            swung,
            ("inertia", "torque_limit"),
            starts=1,
        )
    still = smc.run(AXIS.scenario(duration=0.06, x0=0.0))
    with pytest.raises(smc.ScenarioError, match=r"cannot tell|nothing in the records depends on"):
        smc.identify(AXIS, still, starts=1)


@pytest.mark.parametrize(
    ("rig", "names", "words"),
    [
        ("axis", ["weight"], "unknown quantity of axis 'weight': "),
        ("axis", ["mass", "mass"], "quantities have mass 2 times"),
        ("axis", [], "axis has no quantities to find"),
        (FIXED, None, "fixed has no quantities to find"),
        (
            "servo_axis",
            None,
            "no number of servo_axis is named. There are M, b, cf, offset.* give names=",
        ),
        (3, None, "cannot identify 3: give a plant"),
    ],
)
def test_what_cannot_be_found_is_named(rig, names, words, monkeypatch):
    monkeypatch.setattr(rigs, "rig_catalogue", machines.catalogue)
    t = np.arange(0.0, 1.0, 0.002)
    log = {"t": t, "x": np.sin(5.0 * t), "u": np.cos(t)}
    with pytest.raises(smc.ScenarioError, match=words):
        smc.identify(rig, log, names)


def test_records_of_two_kinds_and_none_are_refused(moved):
    for records_given in (
        [],
        [moved, {"t": [0]}],
    ):
        with pytest.raises(smc.ScenarioError, match=r"logs|records"):
            smc.identify(AXIS, records_given)


def test_a_search_stays_within_its_ranges_to_the_last_bit():
    """1e-4 / 0.042 * 0.042 is less than 1e-4."""
    quantities = dict(AXIS.quantities) | {"coulomb": Quantity(0.042, "N", "chosen", 1e-4, 1.0)}
    twin = dataclasses.replace(AXIS, quantities=quantities)
    replays = Replays(twin, ["coulomb"], [], True, lambda count: None)
    assert (replays.low * replays.scales)[0] < 1e-4
    assert replays.rig(Point(replays.low, replays.start.states)).values["coulomb"] == 1e-4


CARRIAGE = {
    "M": 3.2,
    "b": 4.1,
    "cf": 1.7,
    "offset": 0.6,
}
# m, of the positions of `pushed`, with their rounding to counts
NOISE = math.hypot(1e-5, 2e-5 / math.sqrt(12.0))


def positions(u, quantities, x=0.0, v=0.0):
    """Positions of a carriage under held forces, from its exact motion."""
    exact = np.zeros(len(u))
    for k, force in enumerate(u):
        exact[k] = x
        x, v = carriage(x, v, force, 1e-3, *quantities)
    return exact


def pushed(seed, seconds=1.5):
    """Columns of a carriage under four sines, from its exact motion, with noise of 10 um and counts
    of 20 um.
    """
    rng = np.random.default_rng(seed)
    t = 1e-3 * np.arange(round(seconds / 1e-3) + 1)
    sines = zip(
        (4.0, 3.0, 3.0, 2.0), rng.uniform(3.0, 33.0, 4), rng.uniform(0.0, 6.28, 4), strict=True
    )
    u = sum(size * np.sin(speed * t + phase) for size, speed, phase in sines)
    exact = positions(u, CARRIAGE.values())
    return {
        "t": t,
        "x": 2e-5 * np.round((exact + rng.normal(0.0, 1e-5, len(t))) / 2e-5),
        "u": u,
    }


def least_errors(u):
    """Standard errors of least squares of the exact motion and its start, with the noise known: of
    the quantities.
    """
    truth = np.array([*CARRIAGE.values(), 0.0, 0.0])
    steps = 1e-4 * np.diag([*CARRIAGE.values(), 0.1, 0.1])
    ends = []
    for step in steps:
        ends.append([positions(u, moved[:4], *moved[4:]) for moved in (truth + step, truth - step)])
    J = np.column_stack(
        [
            (ahead - back) / (2.0 * step.sum())
            for (ahead, back), step in zip(ends, steps, strict=True)
        ]
    )
    return NOISE * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))[:4]


FAR = {
    "M": 95.0,
    "b": 203.0,
    "cf": 20.4,
    "offset": -3.2,
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("start", "seconds"),
    [
        ({}, 0.4),
        (FAR, 1.5),
    ],
    ids=["near", "95 kg"],
)
def test_standard_errors_cover_the_truth_from_any_start(start, seconds):
    """The full coverage, of more machines and seeds, is in benchmarks/identify.py.

    Seed and bounds were fixed before this record was identified. A quantity lies within four
    standard errors but for 1 in 16,000. The square of a jackknife's error, of n blocks, is the true
    one times chi squared / (n - 1), and what the steps add is at most half of it.
    """
    record = pushed(2026, seconds)
    rare = math.erfc(4.0 / math.sqrt(2.0))
    axis = smc.plant("servo_axis", **CARRIAGE | start)
    identified = smc.identify(axis, record, list(CARRIAGE), corrected=True)
    assert min(identified.fits[0].values()) >= min(identified.fits_before[0].values())
    free = standard_errors.BLOCKS[0] - 1
    low, high = np.sqrt(chi2.ppf([rare / 2.0, 1.0 - rare / 2.0], free) / free) * [
        1.0,
        math.hypot(1.0, 0.5),
    ]
    for (name, truth), least in zip(CARRIAGE.items(), least_errors(record["u"]), strict=True):
        assert abs(identified.values[name] - truth) < 4.0 * identified.errors[name]
        assert low * least < identified.errors[name] < high * least


def test_masses_and_frictions_stay_physical():
    ranges = own_rig(smc.plant("servo_axis"), list(CARRIAGE)).quantities
    assert {name: quantity.least for name, quantity in ranges.items()} == {
        "M": 1e-6,
        "b": 0.0,
        "cf": 0.0,
        "offset": -math.inf,
    }


def test_columns_of_a_plant_s_record_are_those_of_its_channels():
    columns = own_rig(smc.plant("pendulum_network"), ["m"]).columns
    assert columns.x == ("x0", "x1", "x2", "x3", "x4")
    assert columns.inputs == ("u0", "u1", "u2", "u3", "u4")


def test_a_command_beyond_the_default_bound_is_replayed_as_it_was():
    plant = smc.plant("duffing")
    run = smc.run(
        smc.Scenario(
            plant=plant,
            law="none",
            feedforward=smc.Sine(20.0, 3.0),
            u_max=30.0,
            duration=1.0,
        )
    )
    record = {
        "t": run.t,
        "x": run.x[:, 0],
        "u": run.u[:, 0],
    }
    assert abs(record["u"]).max() > 15.0
    assert own_rig(plant, ["M"]).fit(record)["x"] > 99.9


def test_drawn_sets_have_the_errors_and_correlations_found(moved):
    identified = smc.identify(AXIS, moved, ["mass", "viscous"], starts=1, most=1)
    rig = identified.drawn(1000, seed=1, floor=0.0)
    names = list(identified.values)
    sets = np.array([[drawn[name] for name in names] for drawn in rig.ensemble])
    np.testing.assert_allclose(
        sets.std(axis=0), [identified.errors[name] for name in names], rtol=0.1
    )
    np.testing.assert_allclose(np.corrcoef(sets.T), identified.correlations, atol=0.1)
    assert rig.values == identified.rig.values
    assert identified.drawn(3, seed=1, floor=0.0).ensemble == rig.ensemble[:3]
    wide = np.array([drawn["mass"] for drawn in identified.drawn(1000, seed=1).ensemble])
    assert wide.std() == pytest.approx(0.05 * identified.values["mass"], rel=0.1)


def test_residuals_are_what_was_measured_less_what_was_predicted(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: drawn.append(figure))
    t = np.arange(3.0)
    measured = {"x": np.array([1.0, 2.0, 6.0]), "u": np.array([0.5, 0.0, 4.0])}
    twins = {"twin": {"x": t, "u": t}, "driver": {"x": 0.0 * t, "u": t}}
    fits = {"twin": {"x": 87.6, "u": 3.25}, "driver": dict.fromkeys("xu", Fall(8.44))}
    residual_figure("A", t, measured, twins, fits, {"x": "m", "u": "V"}, tmp_path / "a.png")
    _, residuals, column_axes, _ = drawn[0].axes
    assert residuals.lines[1].get_ydata().tolist() == [1.0, 1.0, 4.0]
    assert residuals.lines[2].get_ydata().tolist() == [1.0, 2.0, 6.0]
    assert column_axes.get_title(loc="left") == "fit: twin 3.2 %, driver falls at 8.4 s"
    assert column_axes.get_ylabel() == "u (V)"
    assert residuals.get_ylabel() == "residual (m)"
    assert residuals.get_title(loc="left") == "rms: twin 2.45, driver 3.7"


def test_small_residuals_have_the_prefix_of_their_unit(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: drawn.append(figure))
    t = np.arange(3.0)
    measured = {"x": t + 2e-3}
    twins = {"twin": {"x": t}}
    residual_figure("A", t, measured, twins, {"twin": {"x": -16.62}}, {"x": "rad"}, tmp_path / "a")
    column_axes, residual_axes = drawn[0].axes
    assert column_axes.get_title(loc="left") == "fit: −16.6 %"
    assert residual_axes.get_ylabel() == "residual (mrad)"
    np.testing.assert_allclose(residual_axes.lines[1].get_ydata(), 2.0)


def test_files_of_columns_and_traces_are_read_alike(moved, tmp_path):
    columns = records.of_trace(moved, AXIS.columns)
    np.savez(tmp_path / "a.npz", **columns)
    with (tmp_path / "a.csv").open("w") as file:
        writer = csv.writer(file)
        writer.writerow([f"{name} [s]" if name == "t" else name for name in columns])
        writer.writerows(zip(*columns.values(), strict=True))
    moved.save(tmp_path / "trace.npz")
    for name in ("a.npz", "a.csv"):
        read = dict(records.load_record(tmp_path / name))
        for key in columns:
            assert np.array_equal(read[key], columns[key])
    assert np.array_equal(
        records.of_trace(smc.load(tmp_path / "trace.npz"), AXIS.columns)["x"], columns["x"]
    )
    assert isinstance(records.load_record(tmp_path / "trace.npz"), smc.Trace)
    renamed = dict(records.load_record(tmp_path / "a.csv", {"position": "x"}))
    np.testing.assert_array_equal(renamed["position"], columns["x"])


@pytest.mark.parametrize("cut", [0, 200])
def test_a_damaged_npz_file_is_one_sentence(tmp_path, cut):
    file = tmp_path / "a.npz"
    np.savez(file, t=np.arange(99.0))
    file.write_bytes(file.read_bytes()[:cut])
    with pytest.raises(smc.ScenarioError, match="is not a record"):
        records.load_record(file)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("t,x\n0,1\n1\n", "line 3: 1 cells for 2 columns: give one for each"),
        ("t,x\n", "has 1 lines: give a first line with the columns' names, and samples"),
    ],
)
def test_files_that_are_no_columns_get_one_sentence(content, sentence, tmp_path):
    (tmp_path / "a.csv").write_text(content)
    with pytest.raises(smc.ScenarioError) as error:
        records.load_record(tmp_path / "a.csv")
    assert sentence in str(error.value)
    with pytest.raises(smc.ScenarioError, match="no record at"):
        records.load_record(tmp_path / "b.csv")
