"""The QUBE-Servo's twin against public measurements, where they are at hand."""

from pathlib import Path

import numpy as np
import pytest

import smc_mujoco as smc

DATA = Path(smc.__file__).resolve().parents[2] / "shared" / "rigs"
CHOICE = ("12", "36")  # records on which the model was chosen
RIG = smc.rig("qube_servo")

pytestmark = pytest.mark.skipif(not DATA.exists(), reason="the public records are not at hand")


@pytest.fixture(scope="module")
def records():
    return [dict(np.load(DATA / f"qube-{name}.npz")) for name in CHOICE]


def test_the_twin_fits_records_that_it_was_not_identified_from(records):
    for fit in RIG.fits(records):
        assert fit["theta"] > 92.0
        assert fit["alpha"] > 92.5
        assert fit["u"] > 86.0


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


def test_a_fall_is_told_with_its_time_in_place_of_a_number():
    """Not reached: the machine stands on this record. A torque per volt 3 % larger would hold the twin, too."""
    record = dict(np.load(DATA / "qube-11.npz"))
    (fit,) = RIG.fits([record])
    assert {str(value) for value in fit.values()} == {"falls at 8.6 s"}
    assert max(abs(record["alpha"][1000:])) < 0.3


def test_degrees_are_told_from_radians(records):
    angles = ("theta", "alpha", "target_theta", "target_alpha")
    degrees = records[0] | {name: np.rad2deg(records[0][name]) for name in angles}
    with pytest.raises(smc.ScenarioError, match="look like degrees"):
        RIG.fit(degrees)
