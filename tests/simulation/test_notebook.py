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
        smc.Scenario(
            plant="cart_pole",
            law="hierarchical",
            model="nominal",
            duration=0.1,
        )
    )


def cells(shown: object) -> dict[str, str]:
    """The fields of a table: name -> value. The HTML must be well-formed."""
    root = ElementTree.fromstring(f"<div>{shown._repr_html_()}</div>")
    rows = []
    for row in root.iter("tr"):
        rows.append(["".join(cell.itertext()) for cell in row if cell.tag == "td"])
    return {row[0]: row[-1] for row in rows if row}


@pytest.mark.quick
def test_a_scenario_shows_what_it_was_given():
    assert cells(GIVEN) == {
        "plant": "inverted_pendulum (m = 0.5, l = 0.5, b = 0.02, grav = 9.81)",
        "law": "classical(k=2, c=3)",
        "gains": "given",
        "duration": "0.2",
        "x0": "(0.3,)",
        "noise": "Noise(position=0.01, velocity=0.05)",
        "mismatch": "{'mass': 1.3}",
    }
    assert list(cells(smc.Scenario(plant="duffing", law=smc.law("classical")))) == [
        "plant",
        "law",
        "gains",
        "duration",
    ]


# tables of other packages


@pytest.mark.parametrize(
    ("method", "name"),
    [
        ("to_pandas", "pandas"),
        ("to_xarray", "xarray"),
    ],
)
def test_a_package_that_is_missing_is_named_with_its_cure(trace, monkeypatch, method, name):
    monkeypatch.setitem(__import__("sys").modules, name, None)
    with pytest.raises(
        MissingPackageError, match=rf"Trace\.{method} needs {name} .*: pip install {name}$"
    ):
        getattr(trace, method)()


def test_pandas_has_every_column_bit_for_bit_with_units(trace, cart):
    pandas = pytest.importorskip("pandas")
    for run_shown in (trace, cart):
        frame = run_shown.to_pandas()
        columns = run_shown.columns()
        assert isinstance(frame, pandas.DataFrame)
        assert frame.index.name == "t"
        assert np.array_equal(frame.index, run_shown.t)
        assert list(frame.columns) == [name for name in columns if name != "t"]
        for name in frame.columns:
            assert np.array_equal(frame[name], columns[name])
        assert frame.attrs["units"] == run_shown.units()
        assert json.loads(frame.attrs["scenario"])["plant"]["name"] == run_shown.scenario.plant.name


def test_arrow_has_every_column_bit_for_bit(cart):
    columns = cart.columns()
    table = pyarrow.table(cart)
    assert table.column_names == list(columns)
    for name in columns:
        assert np.array_equal(table[name].to_numpy(), columns[name])


def test_xarray_has_every_array_bit_for_bit_with_units(trace, cart):
    pytest.importorskip("xarray")
    data = trace.to_xarray()
    assert set(data.data_vars) == set(ARRAYS) - {"t"}
    for name in data.data_vars:
        assert np.array_equal(data[name].values, getattr(trace, name))
    assert np.array_equal(data["t"].values, trace.t)
    units = {name: data[name].attrs["units"] for name in ("t", "x", "v", "u", "s")}
    assert units == {
        "t": "s",
        "x": "rad",
        "v": "rad/s",
        "u": "N m",
        "s": "",
    }
    dataset = cart.to_xarray()
    assert dataset["x"].dims == ("t", "channel")
    assert dataset["x"].attrs["units"] == "m, rad"
    assert float(dataset["x"].sel(t=0.05, method="nearest", channel=1)) == cart.x[50, 1]
