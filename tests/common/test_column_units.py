"""Units in the headings of logs."""

import math

import numpy as np
import pytest
from helpers.machine_logs import chain

import smc_mujoco as smc
from smc_mujoco.common import column_units
from smc_mujoco.identification import records
from smc_mujoco.identification.own_rig import own_rig


@pytest.mark.quick
@pytest.mark.parametrize(
    ("heading", "name", "factor"),
    [
        ("x", "x", 1.0),
        ("x [rad]", "x", 1.0),
        ("x (deg)", "x", math.pi / 180.0),
        ("x_elbow[°]", "x_elbow", math.pi / 180.0),
        ("# t [ms]", "t", 1e-3),
        ("u_j1 (mNm)", "u_j1", 1e-3),
        ("u [A]", "u [A]", 1.0),
        ("x_elbow(motor)", "x_elbow(motor)", 1.0),
    ],
)
def test_a_known_unit_becomes_a_factor_and_another_stays_in_the_name(heading, name, factor):
    assert column_units.headings([heading], "a log") == ([name], [pytest.approx(factor)])


def test_a_file_in_degrees_and_milliseconds_is_read_in_si_units(tmp_path):
    (tmp_path / "log.csv").write_text("t (ms),x [deg],u [N m]\n0,0,1\n2,90,2\n")
    log = records.as_columns(tmp_path / "log.csv")
    np.testing.assert_allclose(log["t"], [0.0, 0.002])
    np.testing.assert_allclose(log["x"], [0.0, math.pi / 2.0])
    np.testing.assert_allclose(log["u"], [1.0, 2.0])


def test_two_columns_of_one_name_and_a_foreign_unit_are_refused(tmp_path, refused):
    (tmp_path / "twice.csv").write_text("t,x,x [deg],u\n0,0,0,1\n1,1,1,1\n")
    refused(lambda: records.as_columns(tmp_path / "twice.csv"), "two columns x", "rename")
    rig = own_rig(smc.plant_from(chain([0.4], [1.0]), ["j1"]), ["j1.damping"])
    t = 0.002 * np.arange(100)
    log = {"t": t, "x": np.sin(9.0 * t), "u [A]": t}
    refused(lambda: rig.checked(log), "'u [A]'", "JOINT.gain", "--columns")
    named = records.as_columns(log, {"u": "u [A]"})
    np.testing.assert_array_equal(rig.checked(named)["u"], t)


def test_units_of_columns_are_read_wherever_the_log_comes_from(tmp_path):
    """Of columns by name `x (deg)` was refused as none of the units that have it."""
    log = {"t [ms]": np.array([0.0, 2.0]), "x (deg)": np.array([0.0, 90.0]), "u": [1.0, 2.0]}
    np.savez(tmp_path / "log.npz", **log)
    for source in (log, tmp_path / "log.npz"):
        read = records.as_columns(source)
        assert list(read) == ["t", "x", "u"]
        np.testing.assert_allclose(read["t"], [0.0, 2e-3])
        np.testing.assert_allclose(read["x"], [0.0, math.pi / 2.0])
        np.testing.assert_array_equal(read["u"], [1.0, 2.0])
