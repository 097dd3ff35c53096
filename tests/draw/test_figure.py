"""Figures: readable, small, and honest about what failed."""

import dataclasses
import re
import types
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from helpers import reference
from helpers.sketch import failed
from matplotlib.figure import Figure
from matplotlib.text import Text

import smc_mujoco as smc
from smc_mujoco.draw import decimate, horizon, panels, quantities
from smc_mujoco.draw import figure as draw_figure
from smc_mujoco.draw.page import FORMATS, files, write_page
from smc_mujoco.metrics.conventions import groups

LAWS = ("observer_free", "classical")


def figure(traces, path, format="svg", **options) -> list:
    """The files that a figure is written to: an SVG, whose words can be read, to save the time of
    the PNG.
    """
    draw_figure.figure(
        traces,
        path,
        format=format,
        **options,
    )
    return files(path, format)


def runs(
    plant: str = "duffing", condition: str = "nominal", duration: float = 1.0
) -> list[smc.Trace]:
    return smc.run(
        list(
            smc.paper.comparison(
                plant,
                condition,
                LAWS,
                duration=duration,
            ).values()
        )
    )


@pytest.fixture(scope="module")
def pair() -> list[smc.Trace]:
    return runs()


def broken(trace: smc.Trace, at: int, failure: str = reference.PLANT_DIVERGED) -> smc.Trace:
    """The trace as if it had diverged at sample `at`, on its way to 1e5."""
    x = trace.x.copy()
    x[max(at - 5, 0) : at] = 1e5
    return failed(dataclasses.replace(trace, x=x), at, f"{failure}, at t = {trace.t[at]:g} s")


def words(page) -> str:
    """The text of a figure; in a file letters are paths, with what they say in comments."""
    if isinstance(page, Figure):
        return " ".join(text.get_text() for text in page.findobj(Text) if text.get_visible())
    ET.parse(page)
    return " ".join(re.findall(r"<!-- (.*?) -->", page.read_text()))


def test_a_file_does_not_say_when_it_was_written(tmp_path, monkeypatch):
    written = []
    for second in ("0", "86400"):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", second)
        paths = []
        for ending in FORMATS:
            paths.append(tmp_path / f"{second}.{ending}")
        write_page(Figure(), paths)
        written.append([path.read_bytes() for path in paths])
    assert written[0] == written[1]


def test_a_run_that_fails_at_once_is_an_x_where_it_started(tmp_path):
    good, bad = runs("pendulum_network", duration=0.5)
    gone = broken(bad, 0, "law 'classical' raised ValueError (no)")
    assert "Classical (failed at 0 s)" in words(draw_figure.figure([gone]))
    draw_figure.figure([good, gone])
    draw_figure.figure([good, broken(bad, 1)], panels=["u"])  # one finite sample
    cut = decimate.finite(gone)
    assert cut.x.tolist() == [list(gone.scenario.resolved.x0)]
    assert np.isnan(cut.u).all()
    low, high = quantities.limits([cut], "x")
    assert low < min(gone.scenario.resolved.x0) <= max(gone.scenario.resolved.x0) < high


@pytest.mark.quick
def test_short_impacts_are_marked_beyond_the_range_of_lasting_reactions_and_told(pair):
    """Two of the first run, to both sides; the other run has none."""
    spikes = np.zeros_like(pair[0].u)
    spikes[100:103], spikes[200] = 900.0, -400.0
    calm = []
    for trace in pair:
        calm.append(dataclasses.replace(trace, reaction=trace.reaction * 0.0 + 20.0))
    for first, title in (
        (dataclasses.replace(calm[0], reaction=20.0 + spikes), "|reaction| up to 920 N"),
        (dataclasses.replace(calm[0], reaction=spikes), "|reaction| up to 900 N"),
        (calm[0], ""),
    ):
        ax = Figure().add_subplot()
        panel_stub = types.SimpleNamespace(
            traces=[first, calm[1]], group=groups(first.scenario.plant)[0]
        )
        panels.clip_impacts(ax, panel_stub, ["r", "b"])  # pyright: ignore[reportArgumentType]
        # pyright: ignore
        marks = []
        for line in ax.lines:
            marks.append((line.get_color(), line.get_marker(), *line.get_xydata().tolist()))
        sides = [
            ("r", 2, [first.t[100], 23.2]),
            ("r", 3, [first.t[200], -23.2]),
            ("b", 2),
            ("b", 3),
        ]
        assert ax.get_title(loc="right") == title
        assert marks == (sides if title else [])
    alike = [dataclasses.replace(trace, reaction=20.0 + spikes) for trace in pair]
    (ax,) = draw_figure.figure(alike, panels=["reaction"]).axes
    assert ax.get_ylim() == pytest.approx((-23.2, 23.2)), "words would lie over what is cut"
    (ax,) = draw_figure.figure(calm, panels=["reaction"]).axes
    assert [text.get_text() for text in ax.texts] == ["both agree"]


def test_windows_have_the_range_and_mean_of_what_is_held_in_them():
    t = np.arange(5) * 0.1
    y = np.array([[0.0], [4.0], [2.0], [6.0], [1.0]])
    e = decimate.windows(t, y, np.array([-0.05, 0.0, 0.25, 0.26, 0.4]))
    assert e.low.ravel().tolist() == [0.0, 0.0, 2.0, 1.0]
    assert e.high.ravel().tolist() == [0.0, 4.0, 2.0, 6.0]
    assert e.mean.ravel().tolist() == [0.0, 2.0, 2.0, 3.0]


def test_chattering_is_drawn_as_its_mean_without_teeth():
    t = np.arange(10_001) * 1e-3
    rng = np.random.default_rng(0)
    # each value held 1 sample, or more
    switching = np.where(np.cumsum(rng.integers(1, 3, 10_001)) % 2, 6.0, -6.0)
    drift = np.clip(np.cumsum(rng.normal(size=10_001)), -0.1, 0.1)
    for u in (
        np.where(np.arange(10_001) % 2, 6.0, -6.0),
        np.tile([6.0, 6.0, -6.0, -6.0, 6.0, -6.0], 1667)[:10_001],
    ):
        mean = decimate.smooth(u, 100)
        assert np.abs(mean).max() < 0.15  # to the ends
        assert np.abs(mean[50:-50]).max() < 0.02
        band_times, low, high = decimate.band(t, u[:, None])
        assert len(band_times) <= 360
        assert low.min() == -6.0
        assert high.max() == 6.0
    assert (
        np.abs(decimate.smooth(switching, 100) - decimate.smooth(switching + drift, 100)).max()
        < 0.2
    )


def test_a_band_has_its_whole_width_at_the_end_of_a_run_that_ends_soon_after_a_switch():
    u = switching([15] * 38)[:569]  # the last value is held for 14 samples
    _, low, high = decimate.band(1e-3 * np.arange(569), u[:, None])
    assert (low[-1], high[-1]) == (-6.0, 6.0)


def test_chattering_is_six_reversals_close_together_and_reaches_over_short_rests():
    """For a window of 40 samples: each within 10 of the one before, rests of up to 10, 39 and 40
    samples.
    """

    def parts(*pieces):
        return [
            (int(part.start), int(part.stop))
            for part in decimate.chattering_parts(np.concatenate(pieces), 40)
        ]

    def switching(count, size=1.0):
        return np.resize([size, -size], count)

    rest = np.zeros(50)
    low = np.full(50, -1.0)
    high = np.ones(50)
    assert parts(rest[:10], switching(100), rest[:40]) == [(0, 150)]
    assert parts(rest[:11], switching(100), rest[:41]) == [(11, 111)]
    assert parts(switching(40), low[:39], switching(40)) == [(0, 119)]
    assert parts(switching(40), rest[:40], switching(40)) == [(0, 120)]
    assert parts(switching(40), rest[:41], switching(40)) == [(0, 40), (81, 121)]
    assert parts(np.repeat(switching(20), 10)) == [(0, 200)]
    assert parts(np.repeat(switching(20), 11)) == []
    assert parts(rest, switching(7), high) == [(50, 56)]
    assert parts(rest, switching(6), low) == []
    assert parts(high, rest, switching(20, 1.1e-3)) == [(101, 120)]
    assert parts(high, rest, switching(20, 0.9e-3)) == []


def triangle(y: np.ndarray, half: int) -> np.ndarray:
    """Each mean of y that is whole, with weights 1, 2, ... half, ... 2, 1."""
    weights = np.convolve(np.ones(half), np.ones(half))
    return np.convolve(y, weights / weights.sum(), "valid")


def switching(lengths) -> np.ndarray:
    """+-6, each held as long as told."""
    return np.concatenate([np.full(n, 6.0 if i % 2 else -6.0) for i, n in enumerate(lengths)])


@pytest.mark.parametrize("seed", range(6))
def test_within_chattering_the_line_is_a_whole_mean_whatever_is_held_shorter_than_the_window(seed):
    rng = np.random.default_rng(seed)
    # 40: the window
    within = switching([*rng.integers(1, 10, 6), *rng.integers(1, 41, 60), *rng.integers(1, 10, 6)])
    u = np.concatenate([np.full(300, 6.0), within, np.full(300, -within[-1])])
    (part,) = decimate.chattering_parts(u, 40)
    assert part.start == 300
    assert part.stop == 300 + len(within)
    mean = triangle(within, 20)
    line = decimate.smooth(u, 40)
    np.testing.assert_allclose(line[319:-319], mean, atol=1e-12)
    # no needle where it begins, no dip where it ends
    np.testing.assert_allclose(line[300:319], mean[0])
    np.testing.assert_allclose(line[-319:-300], mean[-1])
    assert (np.delete(line, slice(300, -300)) == np.delete(u, slice(300, -300))).all()


@pytest.mark.parametrize("condition", ["nominal", "noise", "delay_10ms"])
def test_a_line_never_leaves_its_own_band_and_is_u_where_that_does_not_chatter(condition):
    laws = ["adrc", "boundary_layer", "adaptive", "twisting"]
    for trace in smc.run(smc.grid("inverted_pendulum", laws, condition, 1)):
        for run in trace, horizon.until(trace, 0.27), horizon.until(trace, 0.8):
            u = run.u[:, 0]
            t, line = panels.curve(run, u, "u")
            calm = np.ones(len(u), bool)
            for part in decimate.chattering_parts(u, panels.window(run)):
                calm[part] = False
            samples = np.rint(t / trace.scenario.control_period).astype(int)
            assert (line == u[samples])[calm[samples]].all()
            middles, low, high = decimate.band(run.t, run.u)
            inside = (line >= np.interp(t, middles, low)) & (line <= np.interp(t, middles, high))
            assert (inside | (line == u[samples])).all()


@pytest.mark.parametrize("level", [-0.596, 0.0])
def test_the_close_up_shows_no_round_off(pair, level):
    """Of a run that ends in 1 part of 1e9 around a level; or that never leaves it."""
    held = level + 1e-9 * np.random.default_rng(0).normal(size=pair[0].u.shape)
    (position_panel,) = panels.over_groups(pair[:1], "x")
    ends = np.where(pair[0].t[:, None] < 0.5, pair[0].u, held)
    for u in (ends, held, np.full_like(held, level)):
        ax = Figure().subplots()
        run = dataclasses.replace(pair[0], u=u)
        panels.last_samples(ax, position_panel._replace(traces=[run]), ["#000000"])
        low, high = ax.get_ylim()
        assert high - low >= 0.0199 * np.abs(u).max() <= np.ptp(quantities.limits([run], "u"))
        assert (low + high) / 2 == pytest.approx(level, abs=1e-6)
    full = Figure().subplots()
    switching = dataclasses.replace(pair[0], u=np.sign(held - level))
    panels.last_samples(full, position_panel._replace(traces=[switching]), ["#000000"])
    assert full.get_ylim() == pytest.approx((-1.24, 1.24))  # what is large fills it


def test_a_step_of_the_reference_is_no_peak_of_the_error_s_rate():
    scenario = smc.Scenario(plant="duffing", law="none", x0=0.0, duration=1.0)
    step = smc.Step(0.2, time=0.5)
    trace = smc.run(dataclasses.replace(scenario, reference=step))
    np.testing.assert_allclose(quantities.QUANTITIES["de"](trace), trace.v, atol=1e-12)
    trace = smc.run(dataclasses.replace(scenario, reference=smc.Sine(0.2, 3.0)))
    rate = trace.v - 0.6 * np.cos(3.0 * trace.t)[:, None]
    np.testing.assert_allclose(quantities.QUANTITIES["de"](trace), rate, atol=1e-3)


def test_a_row_of_no_control_takes_the_range_of_the_others(pair):
    relay = dataclasses.replace(pair[0], u=0.03 * np.sign(np.sin(9e3 * pair[0].t))[:, None])
    idle = dataclasses.replace(pair[1], u=np.zeros_like(pair[1].u))
    drawn = smc.figure([relay, idle], panels=["end"])
    limits = [ax.get_ylim() for ax in drawn.axes[0].child_axes]
    assert len(limits) == 2
    assert all(high - low < 0.1 for low, high in limits)
