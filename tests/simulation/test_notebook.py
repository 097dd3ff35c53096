"""Scenarios and traces in notebooks: what was given, what came of it, and as pandas and xarray with
units.
"""

import json
from xml.etree import ElementTree

import numpy as np
import pyarrow
import pytest

import smc_mujoco as smc
from smc_mujoco.common.extras import MissingPackageError
from smc_mujoco.simulation.trace import ARRAYS

GIVEN = smc.Scenario(
    plant="inverted_pendulum",
    law=smc.law("classical", k=2.0, c=3.0),
    duration=0.2,
    x0=0.3,
    noise=smc.Noise(0.01, 0.05),
    mismatch={"mass": 1.3},
)


@pytest.fixture(scope="module")
def trace() -> smc.Trace:
    return smc.run(GIVEN)


@pytest.fixture(scope="module")
def cart() -> smc.Trace:
    return smc.run(
        smc.Scenario(plant="cart_pole", law="hierarchical", model="nominal", duration=0.1)
    )


def cells(shown: object) -> dict[str, str]:
    """The fields of a table: name -> value. The HTML must be well-formed."""
    root = ElementTree.fromstring(f"<div>{shown._repr_html_()}</div>")
    rows = []
    for row in root.iter("tr"):
        rows.append(["".join(cell.itertext()) for cell in row if cell.tag == "td"])
    return {row[0]: row[-1] for row in rows if row}


def test_a_scenario_shows_what_it_was_given():
    assert cells(GIVEN) == {
        "plant": "inverted_pendulum (m = 0.5, l = 0.5, b = 0.02, grav = 9.81)",
        "law": "classical(k=2, c=3)",
        "gains": "yours",
        "duration": "0.2",
        "x0": "(0.3,)",
        "noise": "Noise(position=0.01, velocity=0.05)",
        "mismatch": "{'mass': 1.3}",
    }
    assert list(cells(smc.Scenario(plant="duffing", law="classical"))) == [
        "plant",
        "law",
        "gains",
        "duration",
    ]


def test_channels_in_two_units_have_each_its_own(cart):
    assert list(cells(cart))[-3:] == ["x (m)", "x (rad)", "u (N)"]


def test_a_trace_shows_its_ranges(trace):
    shown = cells(trace)
    assert shown["samples"] == "201, every 0.001 s"
    assert shown["x (rad)"] == f"{trace.x.min():.3g} to {trace.x.max():.3g}"
    assert shown["u (N m)"] == f"{trace.u.min():.3g} to {trace.u.max():.3g}"


def test_a_trace_that_failed_says_how():
    @smc.law_function
    def sour(y, gains, memory):
        if y.t > 0.01:
            raise ValueError("<sour>")
        return 0.0, 0.0

    failed = smc.run(smc.Scenario(plant="duffing", law=sour(), duration=0.05))
    assert cells(failed)["failed"] == failed.failure
    assert "&lt;sour&gt;" in failed._repr_html_()
    assert np.isnan(failed.x[-1, 0])
    assert cells(failed)["x (m)"].startswith(f"{np.nanmin(failed.x):.3g} to ")


def test_a_voltage_is_in_volts():
    motor = smc.DCMotor(8.4, 1e-3, 0.042, 1.0, 4e-6, voltage=10.0, command="voltage")
    rig = smc.plant("furuta", b=1e-4, bq=1e-5)
    volts = smc.Scenario(
        plant=rig, law="none", x0=(0.0, 0.05), actuator=motor, duration=0.01, u_max=9.0
    )
    assert "u (V)" in cells(smc.run(volts))


# tables of other packages


@pytest.mark.parametrize(("method", "name"), [("to_pandas", "pandas"), ("to_xarray", "xarray")])
def test_a_package_that_is_missing_is_named_with_its_cure(trace, monkeypatch, method, name):
    monkeypatch.setitem(__import__("sys").modules, name, None)
    with pytest.raises(
        MissingPackageError, match=rf"Trace\.{method} needs {name} .*: pip install {name}$"
    ):
        getattr(trace, method)()


def test_pandas_has_every_column_bit_for_bit_with_units(trace, cart):
    pandas = pytest.importorskip("pandas")
    for one in (trace, cart):
        frame = one.to_pandas()
        columns = one.columns()
        assert isinstance(frame, pandas.DataFrame)
        assert frame.index.name == "t"
        assert np.array_equal(frame.index, one.t)
        assert list(frame.columns) == [name for name in columns if name != "t"]
        assert all(np.array_equal(frame[name], columns[name]) for name in frame.columns)
        assert frame.attrs["units"] == one.units()
        assert json.loads(frame.attrs["scenario"])["plant"]["name"] == one.scenario.plant.name


def test_arrow_has_every_column_bit_for_bit(cart):
    columns = cart.columns()
    table = pyarrow.table(cart)
    assert table.column_names == list(columns)
    assert all(np.array_equal(table[name].to_numpy(), columns[name]) for name in columns)


def test_xarray_has_every_array_bit_for_bit_with_units(trace, cart):
    pytest.importorskip("xarray")
    data = trace.to_xarray()
    assert set(data.data_vars) == set(ARRAYS) - {"t"}
    assert all(np.array_equal(data[name].values, getattr(trace, name)) for name in data.data_vars)
    assert np.array_equal(data["t"].values, trace.t)
    units = {name: data[name].attrs["units"] for name in ("t", "x", "v", "u", "s")}
    assert units == {"t": "s", "x": "rad", "v": "rad/s", "u": "N m", "s": ""}
    both = cart.to_xarray()
    assert both["x"].dims == ("t", "channel")
    assert both["x"].attrs["units"] == "m, rad"
    assert float(both["x"].sel(t=0.05, method="nearest", channel=1)) == cart.x[50, 1]
