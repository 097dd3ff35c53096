"""Figures: readable, small, and honest about what failed."""

import dataclasses
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from PIL import Image

import smc_mujoco as smc
from smc_mujoco import envelope, panels, style
from smc_mujoco.figure import figure, signals

LAWS = ("observer_free", "classical")


def runs(plant: str = "duffing", condition: str = "nominal", duration: float = 1.0) -> list[smc.Trace]:
    return smc.run(list(smc.paper.comparison(plant, condition, LAWS, duration=duration).values()))


@pytest.fixture(scope="module")
def pair() -> list[smc.Trace]:
    return runs()


def broken(trace: smc.Trace, at: int) -> smc.Trace:
    """The trace as if it had diverged at sample `at`, on its way to 1e5."""
    arrays = {name: getattr(trace, name).copy() for name in ("x", "v", "u", "applied", "s", "d")}
    arrays["x"][at - 5 : at] = 1e5
    for array in arrays.values():
        array[at:] = np.nan
    return dataclasses.replace(trace, **arrays, diverged_at=float(trace.t[at]), failure="it blew up")


def words(path) -> str:
    """The text of a figure: letters are paths, with what they say in comments."""
    ET.parse(path)
    return " ".join(re.findall(r"<!-- (.*?) -->", path.read_text()))


def test_writes_svg_and_png_with_names_and_units(pair, tmp_path):
    svg, png = figure(pair, tmp_path / "deep" / "a.svg", title="A title")
    assert [svg.name, png.name] == ["a.svg", "a.png"]
    text = words(svg)
    for word in (
        "A title",
        "Observer-free",
        "Classical",
        "position x (m)",
        "velocity v (m/s)",
        "control u (N)",
        "time (s)",
    ):
        assert word in text
    with Image.open(png) as image:
        assert image.size == (1920, 1080)
    assert [p.name for p in svg.parent.iterdir()] in (["a.svg", "a.png"], ["a.png", "a.svg"])  # nothing else


def test_same_traces_give_the_same_files(pair, tmp_path):
    first, second = figure(pair, tmp_path / "a"), figure(pair, tmp_path / "b")
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]


def test_network_shows_mean_and_spread_and_stays_small(tmp_path):
    svg, _ = figure(runs("pendulum_network", "noise", 10.0), tmp_path / "a")
    assert "mean x (rad)" in words(svg)
    assert "max x − min x (rad)" in words(svg)
    assert svg.stat().st_size < 1_000_000


def test_a_diverged_run_is_named_and_does_not_squash_the_others(pair, tmp_path):
    traces = [pair[0], broken(pair[1], 400)]
    svg, _ = figure(traces, tmp_path / "a")
    assert "Classical (diverged at 0.4 s)" in words(svg)
    assert panels.limits(traces, "x") == panels.limits(pair[:1], "x")
    figure([broken(pair[1], 1)], tmp_path / "b")  # one finite sample


def test_signals_has_a_column_for_each_condition(pair, tmp_path):
    noisy = runs(condition="noise")
    svg, _ = signals([*pair, *noisy], tmp_path / "a", ["nominal", "nominal", "noise", "noise"])
    text = words(svg)
    assert all(word in text for word in ("nominal", "noise", "Observer-free", "Classical", "u (N)"))
    with pytest.raises(smc.ScenarioError, match="one law under one condition"):
        signals([pair[0], pair[0]], tmp_path / "a", ["nominal", "nominal"])


def test_refuses_what_shares_no_axes(pair, tmp_path):
    with pytest.raises(smc.ScenarioError, match="no traces"):
        figure([], tmp_path / "a")
    with pytest.raises(smc.ScenarioError, match="share no axes"):
        figure([pair[0], runs("van_der_pol", duration=0.1)[0]], tmp_path / "a")
    with pytest.raises(smc.ScenarioError, match="one string a trace"):
        figure(pair, tmp_path / "a", labels=["one"])
    (tmp_path / "file").write_text("")
    with pytest.raises(smc.ScenarioError, match="cannot write"):
        figure(pair, tmp_path / "file" / "a")


def test_laws_keep_their_colours_and_traces_never_share_one(pair):
    assert style.colours(pair) == [style.COLOURS[law] for law in LAWS]
    assert len(set(style.colours(pair * 4))) == 8
    assert style.law_colour("my_own") == style.law_colour("my_own") in style.OTHERS


def test_labels_are_the_laws_names_unless_given(pair):
    assert style.labels([*pair, pair[0]], None) == ["Observer-free 1", "Classical", "Observer-free 2"]
    assert style.labels(pair, ["observer_free", "heavy"]) == ["Observer-free", "heavy"]


def test_windows_have_the_range_and_mean_of_what_is_held_in_them():
    t, y = np.arange(5) * 0.1, np.array([[0.0], [4.0], [2.0], [6.0], [1.0]])
    e = envelope.windows(t, y, np.array([-0.05, 0.0, 0.25, 0.26, 0.4]))
    assert e.low.ravel().tolist() == [0.0, 0.0, 2.0, 1.0]
    assert e.high.ravel().tolist() == [0.0, 4.0, 2.0, 6.0]
    assert e.mean.ravel().tolist() == [0.0, 2.0, 2.0, 3.0]


def test_switching_at_every_sample_has_mean_zero():
    t, u = np.arange(10_001) * 1e-3, np.where(np.arange(10_001) % 2, 6.0, -6.0)[:, None]
    e = envelope.columns(t, u, 360)
    assert len(e.t) <= 360
    assert np.abs(e.mean[:-1]).max() < 1e-12
    assert (e.low.min(), e.high.max()) == (-6.0, 6.0)
