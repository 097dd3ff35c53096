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
from PIL import Image

import smc_mujoco as smc
from smc_mujoco.draw import decimate, panels, style
from smc_mujoco.draw import figure as draw_figure
from smc_mujoco.draw.page import FORMATS, files, write
from smc_mujoco.metrics.conventions import groups

LAWS = ("observer_free", "classical")


def figure(traces, path, format="svg", **options) -> list:
    """The files that a figure is written to: an SVG, whose words can be read, to save the time of
    the PNG.
    """
    draw_figure.figure(traces, path, format=format, **options)
    return files(path, format)


def runs(
    plant: str = "duffing", condition: str = "nominal", duration: float = 1.0
) -> list[smc.Trace]:
    return smc.run(list(smc.paper.comparison(plant, condition, LAWS, duration=duration).values()))


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


def test_a_figure_that_was_written_is_laid_out_again_when_it_is_shown(pair, tmp_path):
    page = draw_figure.figure(pair, tmp_path / "a", format="svg")
    assert page.get_layout_engine() is not None


def test_a_file_does_not_say_when_it_was_written(tmp_path, monkeypatch):
    written = []
    for second in ("0", "86400"):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", second)
        paths = [tmp_path / f"{second}.{ending}" for ending in FORMATS]
        write(Figure(), paths)
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
    low, high = panels.limits([cut], "x")
    assert low < min(gone.scenario.resolved.x0) <= max(gone.scenario.resolved.x0) < high


def test_a_jump_is_marked_with_what_has_changed(tmp_path):
    factors = {"jump": smc.Jump(0.5, {"mass": 25.9, "delta": 2.0})}
    jumping = smc.run(smc.Scenario(plant="duffing", law="classical", duration=1.0, **factors))
    assert "mass × 25.9, delta × 2" in words(draw_figure.figure([jumping]))
    still = dataclasses.replace(jumping, scenario=dataclasses.replace(jumping.scenario, jump=None))
    assert style.marks([jumping, still], ["A", "B"]) == {0.5: "A: mass × 25.9, delta × 2"}


def cart_and_pole(**fields) -> smc.Trace:
    return smc.run(
        smc.Scenario(plant="cart_pole", law="hierarchical", model="nominal", duration=1.0, **fields)
    )


def test_the_band_around_each_joint_is_that_of_its_own_scale():
    trace = cart_and_pole()
    shown = []
    for name in ("x", "spread", "u", "force", "s"):
        for panel in panels.over_groups([trace], name):
            shown.append(panel)
    widths = []
    for row in shown[:2]:
        ax = Figure().subplots()
        panels.target(ax, row)
        (band,) = ax.collections
        widths.append(band.get_datalim(ax.transData).height)
    assert [row.quantity for row in shown] == ["x", "x", "u", "s"]
    assert widths == pytest.approx(
        [2 * 0.02, 2 * 0.02 * 0.3]
    )  # the cart starts at 0: 1 m; the pole at 0.3 rad


def test_a_film_has_a_chart_of_each_joint():
    trace = cart_and_pole()
    parts = panels.strip([trace])
    assert [(name, group.unit) for name, group, *_ in parts] == [
        ("x", "m"),
        ("x", "rad"),
        ("settling", "m"),
        ("u", "m"),
    ]
    np.testing.assert_array_equal(parts[1][2][0].x[:, 0], trace.x[:, 1])


def test_commands_in_volts_and_in_newton_metres_share_no_axes(tmp_path):
    motor = smc.DCMotor(8.4, 1e-3, 0.042, 1.0, 4e-6, voltage=10.0)
    torque = smc.Scenario(plant="furuta", law="none", duration=0.01, actuator=motor)
    volts = dataclasses.replace(torque, actuator=dataclasses.replace(motor, command="voltage"))
    with pytest.raises(
        smc.ScenarioError, match="traces of furuta have u in N m and V: draw those of one unit"
    ):
        figure(smc.run([volts, torque]), tmp_path / "c")


def test_short_impacts_are_marked_beyond_the_range_of_lasting_reactions_and_told(pair):
    """Two of the first run, to both sides; the other run has none."""
    spikes = np.zeros_like(pair[0].u)
    spikes[100:103], spikes[200] = 900.0, -400.0
    calm = []
    for one in pair:
        calm.append(dataclasses.replace(one, u=0.0 * one.u + 5.0, reaction=one.reaction * 0.0))
    for first, title in (
        (dataclasses.replace(calm[0], reaction=spikes), "|reaction| up to 900 N"),
        (calm[0], ""),
    ):
        ax = Figure().add_subplot()
        shown = types.SimpleNamespace(
            traces=[first, calm[1]], group=groups(first.scenario.plant)[0]
        )
        panels.clip_impacts(ax, shown, ["r", "b"])  # pyright: ignore[reportArgumentType]
        # pyright: ignore
        marks = []
        for line in ax.lines:
            marks.append((line.get_color(), line.get_marker(), *line.get_xydata().tolist()))
        sides = [("r", 2, [first.t[100], 5.8]), ("r", 3, [first.t[200], -5.8]), ("b", 2), ("b", 3)]
        assert (ax.get_title(loc="right"), marks) == (title, sides if title else [])


@pytest.mark.slow
def test_chattering_that_cannot_be_seen_has_no_words(pair, tmp_path):
    """A ripple of a thousandth of the largest |u|, on a run that is long enough to be averaged."""
    (trace,) = runs(duration=1.0)[:1]
    for ripple, told in ((1e-3, False), (0.1, True)):
        u = (
            trace.u
            + ripple
            * np.abs(trace.u).max()
            * np.where(np.arange(len(trace.t)) % 2, 1.0, -1.0)[:, None]
        )
        text = words(draw_figure.figure([dataclasses.replace(trace, u=u)]))
        assert ("where it chatters" in text) == told


def test_labels_are_the_laws_names_unless_given(pair):
    assert style.labels([*pair, pair[0]], None) == [
        "Observer-free 1",
        "Classical",
        "Observer-free 2",
    ]
    assert style.labels(pair, ["observer_free", "heavy"]) == [
        "observer_free",
        "heavy",
    ]  # as they are given

    @smc.law_function
    def my_law(y, gains, memory):
        return 0.0, y.e

    own = smc.run(smc.Scenario(plant="duffing", law=my_law, duration=0.01))
    assert style.labels([own], None) == style.labels([own], ["my_law"]) == ["my_law"]


def test_long_and_odd_labels_stay_inside(pair, tmp_path):
    labels = ["_lambda $6: " + "the law that the paper proposes, " * 3, "x" * 80]
    text = words(draw_figure.figure(pair, labels=labels, title="A long title " * 20))
    assert "_lambda $6" in text
    assert labels[0] not in text
    assert text.count("…") == 3
    assert style.cropped("short", 100.0, 11) == "short"
    assert style.width(style.cropped("x" * 80, 100.0, 11), 11) <= 100.0


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
    switching = np.where(
        np.cumsum(rng.integers(1, 3, 10_001)) % 2, 6.0, -6.0
    )  # each value held 1 sample, or more
    drift = np.clip(np.cumsum(rng.normal(size=10_001)), -0.1, 0.1)
    for u in (
        np.where(np.arange(10_001) % 2, 6.0, -6.0),
        np.tile([6.0, 6.0, -6.0, -6.0, 6.0, -6.0], 1667)[:10_001],
    ):
        mean = decimate.smooth(u, 100)
        assert np.abs(mean).max() < 0.15  # to the ends
        assert np.abs(mean[50:-50]).max() < 0.02
        at, low, high = decimate.band(t, u[:, None])
        assert len(at) <= 360
        assert (low.min(), high.max()) == (-6.0, 6.0)
    assert (
        np.abs(decimate.smooth(switching, 100) - decimate.smooth(switching + drift, 100)).max()
        < 0.2
    )


def test_chattering_is_six_reversals_close_together_and_reaches_over_short_rests():
    """For a window of 40 samples: each within 10 of the one before, rests of up to 10, 39 and 40
    samples.
    """

    def parts(*pieces):
        return [
            (int(each.start), int(each.stop))
            for each in decimate.chattering_parts(np.concatenate(pieces), 40)
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


def test_what_does_not_chatter_is_drawn_as_it_is():
    t = np.arange(10_001) * 1e-3
    bang = np.where(
        t < 1.2, -6.0, np.where(t < 2.0, 6.0, np.where(np.arange(10_001) % 2, 6.0, -6.0))
    )
    mean = decimate.smooth(bang, 100)
    assert (mean[:2000] == bang[:2000]).all()
    assert np.abs(mean[2002:]).max() < 0.15
    slow = 6 * np.sign(np.sin(2 * np.pi * 10 * t))  # ten times a second
    assert (decimate.smooth(slow, 100) == slow).all()
    x, y = decimate.line(t, slow, 100)
    assert len(x) <= 2 * decimate.LINE_PARTS + 2
    assert (x[0], x[-1]) == (t[0], t[-1])
    assert np.abs(np.diff(np.sign(y))).sum() == np.abs(np.diff(np.sign(slow))).sum()


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
    within = switching(
        [*rng.integers(1, 10, 6), *rng.integers(1, 41, 60), *rng.integers(1, 10, 6)]
    )  # 40: the window
    u = np.concatenate([np.full(300, 6.0), within, np.full(300, -within[-1])])
    (part,) = decimate.chattering_parts(u, 40)
    assert (part.start, part.stop) == (300, 300 + len(within))
    mean = triangle(within, 20)
    line = decimate.smooth(u, 40)
    np.testing.assert_allclose(line[319:-319], mean, atol=1e-12)
    np.testing.assert_allclose(
        line[300:319], mean[0]
    )  # no needle where it begins, no dip where it ends
    np.testing.assert_allclose(line[-319:-300], mean[-1])
    assert (np.delete(line, slice(300, -300)) == np.delete(u, slice(300, -300))).all()


def test_chattering_to_the_end_of_a_run_ends_in_a_whole_mean():
    u = switching([400, *[1, 2, 2, 1] * 100, 39])
    line = decimate.smooth(u, 40)
    assert (line[:400] == -6.0).all()
    np.testing.assert_allclose(line[-20:], triangle(u, 20)[-1])


@pytest.mark.parametrize("seed", range(4))
def test_the_line_is_the_same_read_backwards(seed):
    rng = np.random.default_rng(seed)
    lengths = rng.choice([1, 3, 8, 20, 39, 41, 80], 300, p=[0.3, 0.3, 0.2, 0.1, 0.04, 0.03, 0.03])
    u = switching(
        [*[1] * 9, *lengths, *[1] * 9]
    )  # a long hold is no chattering at the start, but is at the end
    u += np.sin(np.arange(len(u)) / 50) + rng.normal(0.0, 0.02, len(u))
    np.testing.assert_allclose(
        decimate.smooth(u[::-1], 40)[::-1], decimate.smooth(u, 40), atol=1e-12
    )


def test_a_noisy_ramp_starts_and_ends_where_it_does_and_a_first_hold_is_drawn():
    k = np.arange(2001)
    noise = np.random.default_rng(0).normal(0.0, 0.03, 2001)
    for y in (
        np.exp(-k / 40) + noise,
        np.exp((k - 2000) / 40) + noise,
    ):  # as s in the first and last 0.1 s
        line = decimate.smooth(y, 100)
        truth = y - noise
        assert np.abs(line - truth).max() < 0.13  # the nearest whole mean is 0.65 off
        assert np.abs(line - truth).mean() < 0.02
    u = switching([45, *[1, 2, 2, 1] * 200])
    assert (decimate.smooth(u, 100)[:45] == -6.0).all()


def test_the_legend_says_what_line_and_band_are(pair, tmp_path):
    chattering = runs(duration=1.5)
    text = words(draw_figure.figure(chattering))
    alone = words(draw_figure.figure(chattering, panels=["u"]))
    assert "band: range of u, s" in text
    assert "band: range of u" in alone
    assert "band: range of u, s" not in alone
    assert "line: mean over 40 ms where it chatters" in text
    assert "line: mean over 40 ms where it chatters" in alone
    assert "band:" not in words(draw_figure.figure(pair))


@pytest.mark.slow
def test_one_trace_is_drawn_like_a_list_of_one_and_the_same_traces_give_the_same_files(
    pair, tmp_path
):
    alone = figure(pair[0], tmp_path / "deep" / "lam_0.5", None)
    listed = figure(pair[:1], tmp_path / "b.png", None)
    assert [path.name for path in (*alone, *listed)] == [
        "lam_0.5.svg",
        "lam_0.5.png",
        "b.svg",
        "b.png",
    ]
    with Image.open(alone[1]) as image:
        assert image.size[0] == 1760
    assert [path.read_bytes() for path in alone] == [path.read_bytes() for path in listed]


@pytest.mark.parametrize("level", [-0.596, 0.0])
def test_the_close_up_shows_no_round_off(pair, level):
    """Of a run that ends in 1 part of 1e9 around a level; or that never leaves it."""
    held = level + 1e-9 * np.random.default_rng(0).normal(size=pair[0].u.shape)
    (shown,) = panels.over_groups(pair[:1], "x")
    ends = np.where(pair[0].t[:, None] < 0.5, pair[0].u, held)
    for u in (ends, held, np.full_like(held, level)):
        ax = Figure().subplots()
        panels.last_samples(
            ax, shown._replace(traces=[dataclasses.replace(pair[0], u=u)]), ["#000000"], pair[:1]
        )
        low, high = ax.get_ylim()
        assert high - low >= 0.0199 * np.abs(u).max()
        assert (low + high) / 2 == pytest.approx(level, abs=1e-6)
    full = Figure().subplots()
    switching = dataclasses.replace(pair[0], u=np.sign(held - level))
    panels.last_samples(full, shown._replace(traces=[switching]), ["#000000"], pair[:1])
    assert full.get_ylim() == pytest.approx((-1.24, 1.24))  # what is large fills it


def test_where_a_joint_is_is_drawn_as_it_is(pair):
    """x that chatters has no mean for a line: the legend speaks of none."""
    t = pair[0].t
    ripple = 0.01 * np.where(np.arange(len(pair[0].t)) % 2, 1.0, -1.0)
    x = np.exp(-t / 0.02) + ripple
    for name in ("x", "spread"):
        _, y = panels.curve(pair[0], x, name)
        assert (y[0], y.max(), y.min()) == (x[0], x.max(), x.min())
    assert panels.curve(pair[0], ripple, "u")[1].max() < 1e-9
