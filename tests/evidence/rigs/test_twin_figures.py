"""What simulation said of real machines, and what these did: the rows that come with the package."""

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest
from helpers.pages import ROOT
from matplotlib.figure import Figure
from typer.testing import CliRunner

import smc_mujoco as smc
from smc_mujoco.cli.main import app
from smc_mujoco.evidence.rigs import figure, rig, twin_figures
from smc_mujoco.evidence.rigs.figure import twins_figure
from smc_mujoco.evidence.rigs.machines import emps

DATA = Path(smc.__file__).resolve().parents[2] / "shared" / "rigs"


def row(machine, record, figure, variant=""):
    every = twin_figures.rows(machine)
    (one,) = [r for r in every if (r.record, r.figure, r.variant) == (record, figure, variant)]
    return one


def test_whether_a_record_was_used_follows_from_the_rig(monkeypatch):
    held = row("qube_servo", "11", "theta rms")
    assert (held.use, row("qube_servo", "06", "theta rms").use) == (
        twin_figures.HELD_OUT,
        twin_figures.FITTED,
    )
    assert {one.use for one in twin_figures.rows("emps")} == {twin_figures.UNFITTED}
    other = dataclasses.replace(smc.rig("qube_servo"), identified_from=("11",))
    monkeypatch.setattr(twin_figures, "catalogue", lambda: {**rig.catalogue(), "qube_servo": other})
    assert (held.use, row("qube_servo", "06", "theta rms").use) == (
        twin_figures.FITTED,
        twin_figures.HELD_OUT,
    )


def test_every_record_that_a_rig_was_identified_from_has_rows():
    # two rigs are one double pendulum, with the same records
    told = set()
    for one in twin_figures.rows():
        told.add(one.record)
    for name in smc.rigs():
        assert set(smc.rig(name).identified_from) <= told, name


def test_the_rows_of_emps_are_those_of_its_program():
    rms, largest = emps.tracking(smc.rig("emps"))
    assert row("emps", "program of 24.8 s", "rms error").twin == pytest.approx(1e3 * rms, rel=1e-3)
    assert row("emps", "program of 24.8 s", "largest error").twin == pytest.approx(
        1e3 * largest, rel=1e-3
    )


@pytest.mark.skipif(not DATA.exists(), reason="the public records are not at hand")
def test_rows_are_those_of_the_records():
    record = dict(np.load(DATA / "double_pendulum-acrobot-mcpilco-01.npz"))
    twin = smc.rig("realaigym_acrobot")
    told = row("realaigym_acrobot", "acrobot 2", "tau_meas2 rms")
    ((predicted, measured, _),) = twin.predictions([record])
    assert told.machine == pytest.approx(np.std(measured["tau_meas2"]), rel=1e-3)
    assert told.twin == pytest.approx(np.std(predicted["tau_meas2"]), rel=1e-3)
    assert told.fit == pytest.approx(twin.fit(record)["tau_meas2"], abs=0.05)
    sets = [np.std(one.predictions([record])[0][0]["tau_meas2"]) for one in twin.members().values()]
    assert (told.low, told.high) == (
        pytest.approx(min(sets), rel=1e-3),
        pytest.approx(max(sets), rel=1e-3),
    )


def test_a_summary_is_over_the_known_figures_of_whole_twins():
    common = {
        "rig": "emps",
        "record": "one",
        "law": "none",
        "unit": "m",
        "machine": 2.0,
        "low": 1.0,
        "high": 3.0,
    }
    rows = [
        twin_figures.TwinFigure(figure="a", twin=2.2, runs=1, published=3.0, **common),
        twin_figures.TwinFigure(figure="b", twin=1.0, runs=1, **common | {"low": 0.5, "high": 1.5}),
        twin_figures.TwinFigure(figure="b", twin=90.0, runs=1, variant="without a part", **common),
        twin_figures.TwinFigure(figure="c", twin=90.0, runs=1, **common | {"machine": math.nan}),
    ]
    (one,) = twin_figures.summaries(rows)
    assert (one.rig, one.use, len(one.rows), one.inside) == ("emps", twin_figures.UNFITTED, 2, 1)
    assert (one.median, one.largest, one.published) == (
        pytest.approx(0.3),
        pytest.approx(0.5),
        pytest.approx(0.5),
    )
    assert [
        twin_figures.TwinFigure(**twin_figures._numbers(twin_figures.described(r)))
        for r in rows[:3]
    ] == rows[:3]


def test_the_page_has_the_package_s_rows():
    page = (ROOT / "docs" / "rigs.md").read_text(encoding="utf-8")
    for one in twin_figures.summaries(twin_figures.rows()):
        (cells,) = re.findall(rf"^\| `{one.rig}` \| {one.use} \| (.*) \|$", page, re.MULTILINE)
        count, apart, inside, published = cells.split("|")
        told = [float(number) for number in re.findall(r"[\d.]+", apart)]
        assert told == pytest.approx([100.0 * one.median, 100.0 * one.largest], abs=0.5)
        assert (int(count), int(inside)) == (len(one.rows), one.inside)
        assert published.strip() == (
            "" if math.isnan(one.published) else f"{100.0 * one.published:.1f} %"
        )


@pytest.mark.parametrize("condition", ["hold", "nudges"])
def test_laws_stand_in_the_machines_order_in_three_of_four_sets(condition):
    """Of the stepper's twin, which was found from the linear law's figures; not of the plain one."""
    whole, plain = (
        next(
            one
            for one in twin_figures.orders("stepper_furuta")
            if (one.variant, one.condition) == (variant, under)
        )
        for variant, under in (
            ("", condition),
            ("without all of these, noise and vibration", "hold"),
        )
    )
    assert whole.ordered >= 0.75 * whole.sets
    assert plain.ordered == 0


def test_a_twin_that_falls_is_told_and_drawn(tmp_path):
    fell = row("qube_servo", "11", "theta rms", "without the commutator")
    assert math.isinf(fell.twin)
    drawn = [dataclasses.replace(fell, variant=""), row("emps", "program of 24.8 s", "rms error")]
    svg, png = twins_figure(drawn, tmp_path / "told.svg")
    assert "twin over machine" in svg.read_text(encoding="utf-8")
    assert png.exists()


def test_a_figure_has_one_row_for_all_its_records_and_is_read_on_a_phone(tmp_path):
    """Its page is no wider than a phone, with letters of 8 points: a page as wide as its column
    keeps their size.
    """
    rows = [one for one in twin_figures.rows("qube_servo") if not one.variant]
    svg, _ = twins_figure(rows, tmp_path / "told.svg")
    text = svg.read_text(encoding="utf-8")
    assert float(re.findall(r'width="([\d.]+)pt"', text)[0]) <= 0.75 * 390
    assert text.count("<!-- theta rms, 8 records -->") == 1
    assert text.count("<!-- theta rms -->") == 1  # of the record that is held out
    assert len(re.findall(r'<use [^>]*y="', text)) >= 2 * len(rows)  # a mark and a cross each


@pytest.mark.parametrize(("twin", "mark"), [(math.inf, ">"), (9.0, ">"), (0.1, "<"), (2.0, "D")])
def test_what_is_beyond_the_axis_is_a_triangle_at_its_end(twin, mark):
    ax = Figure().subplots()
    one = dataclasses.replace(row("emps", "program of 24.8 s", "rms error"), machine=1.0, twin=twin)
    figure._row(ax, 0.0, one, "#000000")
    (drawn,) = [line for line in ax.lines if line.get_marker() not in ("None", "x")]
    assert drawn.get_marker() == mark
    (at,) = np.asarray(drawn.get_xdata(), float)
    assert 0.25 <= at <= 4.0


def test_the_command_tells_all_machines_or_one(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    every = CliRunner().invoke(app, ["rig"]).output
    for name in {one.rig for one in twin_figures.rows()}:
        assert name in every
    assert "held out" in every
    orders = every.split("Laws in the machine's order")[1]
    assert orders.count("stepper_furuta") == len(twin_figures.orders())
    assert "qube_servo" not in orders  # which ran one law
    assert "falls" in CliRunner().invoke(app, ["rig", "qube_servo"]).output
    refused = CliRunner().invoke(app, ["rig", "srv02"])
    assert refused.exit_code != 0


@pytest.mark.slow
@pytest.mark.skipif(not DATA.exists(), reason="the public records are not at hand")
def test_rows_of_the_qube_servo_are_those_of_its_records():
    twin = smc.rig("qube_servo")
    record = dict(np.load(DATA / "qube-11.npz"))
    ((predicted, measured, _),) = twin.predictions([record])
    fit = twin.fit(record)
    driver = twin.set("driver").predictions([record])[0][0]
    for column, name in zip(measured, fit, strict=True):
        told = row("qube_servo", "11", f"{column} rms")
        values = np.std(measured[column]), np.std(predicted[column]), np.std(driver[column])
        assert (told.machine, told.twin, told.published) == pytest.approx(values, rel=1e-3)
        assert told.fit == pytest.approx(fit[name], abs=0.1)
    fell = twin.with_values({"ripple": 0.0}).fit(record)
    assert all(math.isinf(value) for value in fell.values())
