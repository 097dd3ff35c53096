"""The QUBE-Servo's twin against public measurements, where they are at hand."""

from pathlib import Path

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.evidence.rigs.machines.qube_servo import zero
from smc_mujoco.evidence.rigs.rig import Values

DATA = Path(smc.__file__).resolve().parents[2] / "shared" / "rigs"
RECORDS = ("12", "36")
RIG = smc.rig("qube_servo")

pytestmark = pytest.mark.skipif(not DATA.exists(), reason="the public records are not at hand")


@pytest.fixture(scope="module")
def records():
    return [dict(np.load(DATA / f"qube-{name}.npz")) for name in RECORDS]


def test_the_twin_fits_records(records):
    for fit in RIG.fits(records):
        assert fit["theta"] > 94.0
        assert fit["alpha"] > 93.0
        assert fit["u"] > 87.0


def test_rounding_to_counts_lowers_the_fit_of_u_but_not_of_joints(records):
    for fit in RIG.fits(records, rounded=True):
        assert fit["theta"] > 91.0
        assert fit["alpha"] > 91.0
        assert fit["u"] > 81.0


def test_published_numbers_let_it_fall_or_fit_less(records):
    for fit in RIG.set("driver").fits(records):
        assert 70.0 < fit["theta"] < 90.0
        assert 45.0 < fit["alpha"] < 65.0
        assert 35.0 < fit["u"] < 52.0
    for fit in RIG.set("quanser").fits(records):
        assert max(fit.values()) < -100.0


def test_all_sets_stand_on_record_11_which_is_not_one_of_those_identified_from():
    record = dict(np.load(DATA / "qube-11.npz"))
    for name, member in RIG.members().items():
        (fit,) = member.fits([record])
        assert fit["theta"] > 90.0, name
        assert fit["alpha"] > 77.0, name
        assert fit["u"] > 75.0, name


def test_a_fall_is_told_with_its_time_in_place_of_a_number():
    """With an even torque the twin falls."""
    (fit,) = smc.rig("qube_servo", ripple=0.0).fits([dict(np.load(DATA / "qube-11.npz"))])
    assert {str(value) for value in fit.values()} == {"falls at 8.6 s"}


def test_each_half_of_a_record_has_its_brushes_at_the_same_angle(records):
    for record in map(RIG.checked, [*records, dict(np.load(DATA / "qube-18.npz"))]):
        values, middle = Values(**RIG.values), len(record["t"]) // 2
        parts = [
            {name: column[part] for name, column in record.items()} for part in (slice(middle), slice(middle, None))
        ]
        found = [zero(values, part)["brush"] for part in (record, *parts) if zero(values, part)]
        assert len(found) > 1
        assert np.ptp(found) < np.radians(1.5)


@pytest.mark.parametrize(("brush", "amplitude"), [(0.3, 0.5), (0.6, 0.8), (0.0, 0.5)])
def test_a_brush_is_read_from_a_run_and_is_unknown_if_the_torque_is_even(brush, amplitude):
    machine = smc.rig("qube_servo", brush=brush)
    trace = smc.run(machine.scenario(duration=20.0, reference=smc.Sine(amplitude, 3.0)))
    measured = {"theta": trace.x[:, 0], "alpha": trace.x[:, 1], "plant_input": trace.u[:, 0]}
    found = zero(Values(**RIG.values), measured)
    assert found == ({"brush": pytest.approx(brush, abs=np.radians(1.0))} if brush else {})


def test_degrees_are_told_from_radians(records):
    angles = ("theta", "alpha", "target_theta", "target_alpha")
    degrees = records[0] | {name: np.rad2deg(records[0][name]) for name in angles}
    with pytest.raises(smc.ScenarioError, match="look like degrees"):
        RIG.fit(degrees)
