"""Units in headings are converted or refused."""

import math

import pytest

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.file_units import UNITS, heading


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x", ("x", "", 1.0)),
        ("x [deg]", ("x", "angle", math.pi / 180.0)),
        ("x_elbow (mrad)", ("x_elbow", "angle", 1e-3)),
        ("t[ms]", ("t", "time", 1e-3)),
        ("u [A]", ("u", "current", 1.0)),
        ("speed [rpm]", ("speed", "angular speed", math.pi / 30.0)),
        ("u []", ("u", "", 1.0)),
    ],
)
def test_a_heading_is_a_name_and_what_its_numbers_are_multiplied_by(text, expected):
    assert heading(text) == pytest.approx(expected)


def test_a_unit_of_another_quantity_or_none_is_refused():
    assert heading("x [deg]", ("angle", "length")).quantity == "angle"
    for text in ("x [deg]", "x [furlong]"):
        with pytest.raises(ScenarioError, match=r"give it in s\b"):
            heading(text, ("time",))


def test_a_unit_is_of_one_quantity():
    units = [unit for sizes in UNITS.values() for unit in sizes]
    assert len(units) == len(set(units))
