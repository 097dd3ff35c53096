"""The pendulum on a stepper: its firmware's laws are those that are told, and its figures those of
known signals.
"""

import csv
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import reference
from helpers.runs import assert_same

import smc_mujoco as smc
from benchmarks import stepper_figures as reported
from smc_mujoco.evidence.rigs import firmware
from smc_mujoco.evidence.rigs.firmware import FOUR_STATES, LINEAR, STEPS, TICK, TWO_STATES
from smc_mujoco.evidence.rigs.machines.stepper_furuta import LAWS

# of the machine; not part of the package
RECORDS = Path(__file__).parents[4] / "shared" / "rigs" / "stepper_furuta"


def memory(**values):
    m = np.zeros(14)
    for name, value in values.items():
        m[getattr(firmware, name)] = value
    return m


# theta'' per alpha, alpha', theta and theta' as read from the firmware, 1/s^2 and 1/s
LAYER = {
    LINEAR: (163.3, 16.5, 7.1, 6.4),
    TWO_STATES: (174.6, 15.9, 7.1, 6.4),
    FOUR_STATES: (234.7, 21.3, 18.1, 12.6),
}


@pytest.mark.quick
@pytest.mark.parametrize("kind", LAYER)
def test_a_law_is_within_its_layer_the_linear_law_that_was_read(kind):
    linearised_at = {
        "ALPHA": 0.6,
        "ALPHA_RATE": 2.0,
        "THETA": 1.0,
        "THETA_RATE": -3.0,
    }
    h = 1e-3

    def of(**moved):
        return firmware.acceleration(kind, moved["ALPHA"], memory(**moved), 1.0, 0.0)[0] / STEPS

    slopes = []
    for name, value in linearised_at.items():
        slopes.append(
            (of(**linearised_at | {name: value + h}) - of(**linearised_at | {name: value - h}))
            / (2.0 * h)
        )
    assert slopes == pytest.approx(LAYER[kind], abs=0.1)


def test_the_linear_law_has_a_dead_band_and_the_sliding_modes_a_gate():
    assert firmware.acceleration(LINEAR, 0.49, memory(), 1.0, 0.0)[0] == 0.0
    tilted = memory(THETA=10.0)
    for kind, gate in (
        (TWO_STATES, 150.0),
        (FOUR_STATES, 250.0),
    ):
        inside, outside = (
            firmware.acceleration(kind, 0.0, memory(THETA=10.0, ALPHA_RATE=rate), 1.0, 0.0)[0]
            - firmware.acceleration(kind, 0.0, memory(THETA=0.0, ALPHA_RATE=rate), 1.0, 0.0)[0]
            for rate in (gate - 1.0, gate + 1.0)
        )
        assert inside - outside == pytest.approx(315.0)
        early = []
        for m in (tilted, memory()):
            early.append(firmware.acceleration(kind, 0.0, m, 0.0, 0.0)[0])
        assert early[0] == early[1]


def test_rates_are_tustins_filter_with_the_nominal_period():
    from scipy.signal import bilinear

    b, a = bilinear([1.0, 0.0], [1.0 / 450.0, 1.0], 1.0 / TICK)
    assert pytest.approx(b[0], rel=1e-5) == firmware.SLOPE
    assert pytest.approx(a[1], abs=1e-4) == firmware.OLD_RATE
    m = memory(STARTED=1.0, ALPHA=1.0, ALPHA_RATE=10.0)
    passed = firmware.measure(SimpleNamespace(q=math.radians(1.1), x=0.0, t=0.0123), m)
    assert passed == 0.0123
    assert m[firmware.ALPHA_RATE] == pytest.approx(211.7647 * 0.1 - 0.588)


def test_a_move_is_a_trapezoid_that_ends_at_its_target():
    m = memory()
    rates = []
    for k in range(600):
        target = 20.0 if k < 400 else 19.0
        firmware.move(target, m, TICK)
        rates.append(m[firmware.REF_RATE])
        if k == 399:
            assert m[firmware.REF] == 20.0
    assert max(rates) == 12.0
    assert np.abs(np.diff(rates)).max() <= 3.0 * 60.0 * TICK
    assert m[firmware.REF] == 19.0
    assert m[firmware.REF_RATE] == 0.0


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_the_compiled_run_is_that_of_the_reference_loop(law):
    fields = {
        "x0": reported.start(3),
        "seed": 3,
        "duration": 2.5,
    } | {"reference": smc.Step(0.2, 1.0)}
    scenario = smc.rig("stepper_furuta").scenario(law, **fields)
    trace = smc.run(scenario)
    assert_same(trace, reference.run(scenario))
    assert np.abs(trace.x[-200:, 1]).max() < 0.2  # it stands
    assert np.ptp(trace.x[:, 0]) > 0.02  # and moves


@pytest.mark.parametrize("name", [*smc.rig("stepper_furuta").members(), "second_search"])
def test_no_run_falls_before_its_law_acts(name):
    """A hand holds the pendulum until the firmware engages, however noisy the sensor is."""
    rig = smc.rig("stepper_furuta")
    twin = rig.set(name) if name in rig.published else rig.members()[name]
    for law in rig.laws[:3]:
        scenario = twin.scenario(
            law,
            x0=reported.start(8),
            seed=8,
            duration=0.1,
        )
        assert np.abs(smc.run(scenario).u[:, 0]).max() > 0.0


def test_a_machine_that_tips_stops_its_motor():
    # too weak to move the arm
    rig = smc.rig("stepper_furuta", holding_torque=1e-3, arm_friction=0.05)
    trace = smc.run(rig.scenario(x0=(0.0, 0.03), duration=2.0))
    assert abs(trace.x[-1, 1]) > 1.0
    assert (trace.u[-100:] == 0.0).all()
    assert reported.fallen(reported.figures(record(alpha=lambda t: 40.0 + 0.0 * t)))


def record(
    alpha=lambda t: 0.0 * t, theta=lambda t: 0.0 * t, speed=lambda t: 0.0 * t, duration=60.0
):
    """A record of known signals, degrees and steps/s, in rows of 20 ms."""
    t = 0.02 * np.arange(round(duration / 0.02))
    h = 1e-6
    rates = ((f(t + h) - f(t - h)) / (2.0 * h) for f in (alpha, theta))
    measured = (alpha(t), next(rates), theta(t), next(rates))
    columns = (1e3 * t, *measured, 10.0 + 0.0 * t, speed(t), STEPS * theta(t), 0.0 * t)
    return dict(zip(reported.COLUMNS, columns, strict=True))


def test_the_figures_of_known_signals_are_theirs():
    """In degrees, alpha = 2 sin(5.08 Hz) is opposite to theta = sin; theta' lags the speed command
    by 80 degrees.
    """
    w = 2.0 * math.pi * 50.0 * 26.0 / 256.0
    lag = math.radians(80.0)
    figures = reported.figures(
        record(
            lambda t: 2.0 * np.sin(w * t),
            lambda t: -np.sin(w * t),
            lambda t: STEPS / 1.2 * w * -np.cos(w * t + lag),
        )
    )
    assert figures["alpha_rms"] == pytest.approx(math.sqrt(2.0), rel=1e-3)
    assert figures["centroid"] == pytest.approx(50.0 * 26.0 / 256.0, abs=0.02)
    assert figures["ratio"] == pytest.approx(2.0, rel=1e-6)
    assert figures["phase"] == pytest.approx(-180.0, abs=1e-6)
    assert figures["gain"] == pytest.approx(1.2, rel=1e-3)
    assert figures["lag"] == pytest.approx(-80.0, abs=0.1)
    assert figures["acceleration_rms"] == 10.0


def test_rests_count_from_a_fifth_of_a_second():
    """Runs of 0.1 s after 0.14 s and after 0.3 s of rest: only the long rests count."""

    def speed(t):
        phase = np.round(t / 0.02) % 32
        return np.where((phase < 5) | ((phase >= 12) & (phase < 17)), 60.0, 49.0)

    figures = reported.figures(record(speed=speed, duration=67.0))
    assert figures["running"] == pytest.approx(10 / 32, abs=0.01)
    assert figures["resting"] == pytest.approx(15 / 32, abs=0.01)
    assert figures["starts"] == pytest.approx(60.0 * 2 / 0.64, rel=0.02)


def test_seconds_count_about_their_mean_and_rests_by_their_angle():
    """A rest at 2 degrees, a third of it at 4, then swings with the motor running."""

    def alpha(t):
        return np.where(t < 43.0, 2.0, np.where(t < 63.0, -4.0, 9.0 * np.sin(math.tau * t)))

    figures = reported.figures(
        record(alpha=alpha, speed=lambda t: np.where(t < 63.0, 0.0, 60.0), duration=73.0)
    )
    assert figures["second_50"] == pytest.approx(0.0, abs=1e-9)
    assert figures["second_90"] == pytest.approx(9.0 / math.sqrt(2.0), rel=1e-3)
    assert figures["resting_50"] == 2.0
    assert figures["resting_90"] == 4.0


def test_a_run_is_logged_as_the_firmware_sees_it():
    """Its rows are every fourth tick, its angles rounded and trimmed, its speed the sum of its
    accelerations.
    """
    rig = smc.rig("stepper_furuta")
    scenario = rig.scenario(x0=reported.start(1), seed=1, duration=25.0)
    trace = smc.run(scenario)
    rows = reported.logged(trace)
    gaps = np.diff(rows["timestamp_ms"])
    assert pytest.approx(np.median(gaps)) == 20.0
    assert np.sum(gaps > 25.0) == pytest.approx(25, abs=2)  # a pause a second
    assert gaps.max() == pytest.approx(27.25, abs=0.01)  # 7.3 ms in whole physics steps
    arm = np.interp(rows["timestamp_ms"] / 1e3 - 2e-3, trace.t, trace.x[:, 0])
    theta = np.degrees(arm + rig.values["upright_error"])
    assert np.abs(rows["theta_deg"] - theta).max() < 0.5 * 360.0 / 4096 + 0.02
    assert np.abs(rows["vel_cmd_steps_s"]).max() > 50.0
    loop = reported.figures(rows)
    assert loop["alpha_rms"] < 2.0


def test_a_recording_is_loaded_and_one_that_lacks_a_column_refused(tmp_path):
    rows = record(np.sin)
    path = tmp_path / "hold.csv"
    for names in (reported.COLUMNS, reported.COLUMNS[:-1]):
        with path.open("w", newline="") as file:
            out = csv.writer(file)
            out.writerow(names)
            out.writerows(np.column_stack([rows[name] for name in names]).tolist())
        if names == reported.COLUMNS:
            loaded = reported.load(path)
            for name in rows:
                assert np.array_equal(loaded[name], rows[name])
    with pytest.raises(smc.ScenarioError, match="lacks the column position_clamped"):
        reported.load(path)


@pytest.mark.parametrize("condition", reported.RECORDED)
def test_the_recorded_figures_are_those_of_the_machines_file(condition):
    file = RECORDS / f"linear_{condition}.csv"
    if not file.exists():
        pytest.skip("the recordings have no licence, and are not here")
    figures = reported.figures(reported.load(file))
    for name, value in reported.RECORDED[condition].items():
        assert figures[name] == pytest.approx(value, rel=0.05), name


@pytest.mark.parametrize(
    ("medians", "fell", "expected"),
    [
        ((1, 2, 3), (), (1, 1.0)),
        ((3, 2, 1), (), (0, -1.0)),
        ((1, 3, 2), (), (0, 1 / 3)),
        ((1, 2, 0), ("four_states",), (1, 1.0)),  # a fall is the worst
        ((1, 1, 2), (), (0, 2 / 3)),
    ],
)
def test_laws_are_in_the_machines_order_or_not(medians, fell, expected):
    by_law = {}
    for law, value in zip(reported.ORDER, medians, strict=True):
        run = {"alpha_rms": value, "alpha_max": 99.0 if law in fell else 1.0}
        by_law[law] = [run] * 3
        assert len(reported.standing([run], "alpha_rms")) == (law not in fell)
    assert reported.ordered({"set 1": by_law}) == (expected[0], pytest.approx(expected[1]))
