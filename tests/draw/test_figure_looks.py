"""Looks of figures, measured: words apart and inside, one width of line, no colour twice, no
clipped reference.
"""

import dataclasses
import itertools
import json
import re
import warnings

import matplotlib.pyplot as plt
import numpy as np
import pytest
from helpers.boxes import words_of
from helpers.sketch import failed
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.text import Text

import smc_mujoco as smc
from smc_mujoco.draw import coincidence, colouring, horizon, panels, quantities, style, wording
from smc_mujoco.draw import page as pages
from smc_mujoco.draw.figure import figure

PAGE = "ieee-page"
COLUMN = "ieee-column"
TEN = (  # each has a sliding variable
    "observer_free",
    "classical",
    "adaptive",
    "super_twisting",
    "boundary_layer",
    "fixed_time",
    "integral",
    "nonsingular_terminal",
)
TEN += ("twisting", "terminal")


@pytest.fixture(scope="module")
def one() -> smc.Trace:
    scenario = smc.Scenario(
        plant="duffing",
        law=smc.law("classical"),
        duration=1.5,
        reference=smc.Step(0.5, time=0.3),
    )
    return smc.run(scenario)


def under(trace: smc.Trace, law: str, factor: float) -> smc.Trace:
    """The trace as if another law had made it, a little otherwise."""
    scenario = dataclasses.replace(trace.scenario, law=smc.law(law))
    x = trace.r + factor * (trace.x - trace.r)
    changed = {}
    for name in "vus":
        changed[name] = factor * getattr(trace, name)
    return dataclasses.replace(
        trace,
        scenario=scenario,
        x=x,
        **changed,
    )


def ten(trace: smc.Trace) -> list[smc.Trace]:
    return [under(trace, law, 1.0 - 0.05 * k) for k, law in enumerate(TEN)]


@pytest.fixture(scope="module")
def arm(tmp_path_factory) -> list[smc.Trace]:
    """Seven joints under two laws."""
    link = (
        '<body pos="0 0 .2"><joint name="front_left_shoulder_joint_{}" axis="0 1 '
        '0"/><geom size=".03" mass=".3" contype="0"/>'
    )
    bodies = "".join(link.format(i) for i in range(7)) + "</body>" * 7
    motors = "".join(f'<motor joint="front_left_shoulder_joint_{i}"/>' for i in range(7))
    path = tmp_path_factory.mktemp("arm") / "arm.xml"
    path.write_text(
        f"<mujoco><worldbody>{bodies}</worldbody><actuator>{motors}</actuator></mujoco>"
    )
    plant = smc.plant_from(path, [f"front_left_shoulder_joint_{i}" for i in range(7)])
    trace = smc.run(
        smc.Scenario(
            plant=plant,
            law=smc.law("classical"),
            duration=0.3,
            x0=0.2,
            reference=smc.Step(0.3),
        )
    )
    return [trace, under(trace, "super_twisting", 0.8)]


@pytest.mark.parametrize(
    ("kind", "size"),
    [
        ("one", None),
        ("ten", COLUMN),
        ("failed", COLUMN),
        ("jump", COLUMN),
        ("arm", PAGE),
        ("arm", COLUMN),
        ("long", PAGE),
    ],
)
def test_words_are_apart_and_on_the_page(kind, size, one, arm, monkeypatch):
    jumps = []
    for jump_time in (0.5, 0.6):
        jumps.append(dataclasses.replace(one.scenario, jump=smc.Jump(jump_time, {"mass": 2.0})))
    traces = {
        "one": [one],
        "ten": ten(one),
        "failed": [
            one,
            failed(under(one, "pid", 0.5), 400),
            failed(under(one, "adaptive", 0.5), 1),
        ],
        "jump": [dataclasses.replace(one, scenario=jump) for jump in jumps],
        "arm": arm,
        "long": [one, one],
    }[kind]
    if kind == "long":
        labels = ["_x $6: " + "a law that a paper proposes, " * 3, "x" * 80]
    else:
        labels = None
    page = figure(traces, labels=labels, size=size)
    assert page.get_figwidth() == (8.8 if size is None else pages.NAMED[size][0])
    assert len(words_of(page, monkeypatch)) > 5


def curves(ax) -> list:
    """The lines of traces, without those of single channels of several."""
    return [
        line
        for line in ax.lines
        if len(line.get_xdata()) > 20 and line.get_gid() is None and not line.get_alpha()
    ]


def calm(trace: smc.Trace) -> smc.Trace:
    return dataclasses.replace(trace, u=0.0 * trace.u + np.exp(-trace.t)[:, None])


def rows(ax) -> list:
    """The rows of a panel that has one for each trace."""
    return ax.child_axes or [ax]


def test_controls_whose_bands_would_hide_each_other_have_a_row_each(one):
    three = []
    for k, trace in enumerate(ten(one)[:3]):
        three.append(dataclasses.replace(trace, u=(1.0 - 0.1 * k) * trace.u))
    (ax,) = figure([*map(calm, three[:2]), three[2]], panels=["u"]).axes
    assert len(rows(ax)) == 1
    bang = [dataclasses.replace(trace, u=6.0 * np.sign(trace.u + 1e-9)) for trace in three]
    (ax,) = figure(bang, panels=["u"]).axes
    assert {tuple(row.get_yticks()) for row in rows(ax)} == {(-6.0, 6.0)}, "the bound"
    page = figure(three, size=COLUMN, panels=["x", "u", "s", "end"])
    assert [len(rows(ax)) for ax in page.axes] == [1, 3, 1, 3]
    names = []
    colours = []
    for row in rows(page.axes[1]):
        names.append(row.get_legend().get_texts()[0].get_text())
        colours.append(curves(row)[0].get_color())
    assert names == ["Observer-free", "Classical", "Adaptive"]
    assert colours == colouring.law_colours(["observer_free", "classical", "adaptive"])
    assert len({row.get_ylim() for row in rows(page.axes[1])}) == 1


@pytest.mark.quick
@pytest.mark.parametrize(("size", "count"), [(0.02, 3), (1e-7, 1)])
def test_a_close_up_of_small_switching_has_a_row_each_but_not_of_round_off(one, size, count):
    signs = np.where(np.arange(len(one.t)) % 2, 1.0, -1.0)[:, None]
    swing = np.exp(-20.0 * one.t)[:, None]
    runs = []
    for trace in ten(one)[:3]:
        runs.append(dataclasses.replace(trace, u=swing + size * signs))
    over_time, end = figure(runs, panels=["u", "end"]).axes
    assert [len(rows(over_time)), len(rows(end))] == [1, count]


def test_a_run_that_fails_does_not_set_the_range_of_the_rows_of_others(one):
    three = []
    for k, trace in enumerate(ten(one)[:3]):
        three.append(dataclasses.replace(trace, u=(1.0 - 0.1 * k) * trace.u - 20.0))
    lost = failed(dataclasses.replace(under(one, "pid", 1.0), u=1e4 * one.u), 400)
    over_time, end = figure([*three, lost], panels=["u", "end"]).axes
    assert len(rows(over_time)) == 4
    assert {row.get_ylim() for row in rows(over_time)} == {quantities.limits(three, "u")}
    (cross,) = [line for row in rows(over_time) for line in row.lines if line.get_marker() == "X"]
    # at the edge of the range: it lies far outside
    assert cross.get_ydata()[0] in quantities.limits(three, "u")
    assert end.get_ylim()[1] < 0.0
    (alone,) = figure([lost], panels=["end"]).axes
    assert [text.get_text() for text in alone.texts] == ["the run failed"]


def test_the_reference_is_drawn_over_the_curves_and_never_clipped(one):
    far = dataclasses.replace(one, r=one.r + 100.0)
    page = figure([far, under(one, "pid", 0.9)], size=COLUMN, panels=["x", "error", "channels"])
    drawn = [
        (ax, line) for ax in page.axes for line in ax.lines if line.get_gid() == panels.REFERENCE
    ]
    assert drawn
    for ax, line in drawn:
        low, high = ax.get_ylim()
        assert low < line.get_ydata().min() <= line.get_ydata().max() < high
        assert line.get_zorder() > max(
            curve.get_zorder() for curve in ax.lines if curve.get_gid() != panels.REFERENCE
        )


def test_runs_of_one_law_are_told_apart_by_what_differs(one):
    scenario = one.scenario
    slow = dataclasses.replace(
        one, scenario=dataclasses.replace(scenario, law=smc.law("classical", k=3.0, c=2.0))
    )
    fast = dataclasses.replace(
        one, scenario=dataclasses.replace(scenario, law=smc.law("classical", k=3.0, c=5.0))
    )
    pid_run = under(one, "pid", 0.5)
    assert wording.run_names([slow, fast, pid_run], None) == [
        "Classical: c = 2",
        "Classical: c = 5",
        "PID",
    ]
    noisy = dataclasses.replace(
        slow, scenario=dataclasses.replace(slow.scenario, input_delay=0.005)
    )
    assert wording.run_names([slow, noisy], None) == [
        "Classical: input delay = 0",
        "Classical: input delay = 0.005",
    ]
    assert wording.run_names([slow, slow], None) == ["Classical 1", "Classical 2"]


def test_words_above_the_curves_tell_which_agree_and_until_when(one):
    """Until 1.9 s a relay covered three other laws of the Furuta pendulum."""
    half = one.t[-1] / 2
    later = dataclasses.replace(
        one, x=one.x + 0.5 * np.where(one.t > half, one.t - half, 0.0)[:, None]
    )
    same = [one, later, dataclasses.replace(later, u=-one.u)]
    page = figure(same, labels=list("abc"), panels=["x", "settling"])
    page.draw_without_rendering()
    for ax in page.axes:
        (text,) = ax.texts
        until = re.fullmatch(r"all agree until (\S+) s; b and c agree", text.get_text())
        assert until
        assert float(until[1]) == pytest.approx(half, rel=0.1)
        for line in curves(ax):
            heights = ax.transData.transform(line.get_xydata())[:, 1]
            assert heights.max() < text.get_window_extent().y0
    zero = 0.0 * one.t
    brief = [
        (one.t, zero),
        (one.t, np.where(one.t < 0.9 * one.t[-1], 0.0, 1.0)),
        (one.t, np.where(one.t < 0.1, 0.0, -1.0)),
    ]
    assert coincidence.agreements(brief, (0.0, 1.0)) == [], (
        "for a short time alone, or not to the end"
    )


def test_words_in_the_panel_of_s_name_the_laws_without_a_surface(one):
    none = dataclasses.replace(one, s=np.full_like(one.s, np.nan))
    mirrored = dataclasses.replace(one, s=-one.s)
    for runs, words in (
        ([one, none, mirrored, none], ["no s: b and d"]),
        ([one, none, one], ["a and c agree; no s: b"]),
        ([one, mirrored], []),
    ):
        (ax,) = figure(runs, labels=list("abcd")[: len(runs)], panels=["s"]).axes
        assert [text.get_text() for text in ax.texts] == words


def test_controls_of_which_one_chatters_do_not_agree(one):
    chatters = dataclasses.replace(one, u=one.u + 0.5 * (-1.0) ** np.arange(len(one.t))[:, None])
    (ax,) = figure([one, chatters], panels=["u"]).axes
    assert not ax.texts


@pytest.mark.parametrize("panel", ["reaction", "u", "x", "settling"])
@pytest.mark.parametrize("share", [1.03, 0.9, 0.97, 1.005])
def test_runs_whose_peaks_differ_by_3_percent_do_not_agree(one, panel, share):
    """A blow takes .4 % of the run, and a third run makes the panel ten times as high."""
    name = {"settling": "x"}.get(panel, panel)
    blow = np.where(np.abs(one.t - 0.5 * one.t[-1]) < 0.002 * one.t[-1], 300.0, 0.0)[:, None]
    runs = []
    for factor in (1.0, share, -10.0):
        runs.append(dataclasses.replace(one, r=0.0 * one.r, **{name: factor * blow + 1e-3}))
    (ax,) = figure(runs, labels=list("abc"), panels=[panel]).axes
    (words,) = [text.get_text() for text in ax.texts]
    assert "until" in words
    assert ("a and b agree" in words) is (abs(share - 1.0) < 0.01)


def test_panels_over_time_do_not_end_before_each_run_has_settled(one):
    """What is left of the second run's error is little beside the first's, but not of its own."""
    runs = []
    for size, rate in ((4.0, 30.0), (0.4, 10.0)):
        x = size * np.exp(-rate * one.t)[:, None]
        runs.append(dataclasses.replace(one, x=x, r=0.0 * one.r, d=0.0 * one.d))
    assert horizon.horizon(runs) == pytest.approx(1.3 * np.log(50.0) / 10.0, abs=2e-3)


def test_panels_over_time_end_where_all_rest_and_never_before_something_happens(one):
    rest_sample = int(0.2 * len(one.t))
    still = dataclasses.replace(
        one, x=np.where(np.arange(len(one.t)) < rest_sample, 1.0, 0.01)[:, None], d=0.0 * one.d
    )
    assert horizon.horizon([still]) == pytest.approx(1.3 * one.t[rest_sample - 1])
    end_time = one.t[-1]
    late = np.where(np.arange(len(one.t)) < 0.9 * len(one.t), 0.0, 1.0)[:, None]
    jump = dataclasses.replace(one.scenario, jump=smc.Jump(0.9 * end_time, {"mass": 2.0}))
    for change in (
        {"x": still.x + late},
        {"d": late},
        {"r": late},
        {"scenario": jump},
    ):
        assert horizon.horizon([still, dataclasses.replace(still, **change)]) == pytest.approx(
            end_time
        )
    lost = failed(under(still, "pid", 0.5), int(0.9 * len(one.t)))
    assert horizon.horizon([still, lost]) == pytest.approx(end_time)
    over_time, settling = figure([still], panels=["x", "settling"]).axes
    assert over_time.get_xlim()[1] == pytest.approx(1.3 * one.t[rest_sample - 1])
    assert settling.get_xlim()[1] == pytest.approx(end_time)


def test_words_tell_of_a_band_only_where_one_is_seen(one):
    """A control that falls steeply, with reversals too small to see, has a mean beside it."""
    count = len(one.t)
    tiny = 0.004 * (-1.0) ** np.arange(count)
    fall = 1.0 - np.tanh((one.t - 0.5) / 0.004)
    for swing, seen in ((0.0, False), (1.0, False), (50.0, True)):
        u = fall + swing * tiny
        trace = dataclasses.replace(one, u=u[:, None])
        page = figure([trace], size=COLUMN, panels=["u"])
        assert bool(page.axes[0].get_title(loc="right")) == seen
        assert ("band: range of u" in str(page.get_label())) == seen


def test_an_empty_title_draws_none(one):
    (legend,) = figure([one], size=COLUMN, title=" ", panels=["u"]).legends
    assert not legend.get_title().get_text()


def test_the_error_is_the_largest_within_its_window_on_a_logarithmic_axis(one):
    ax = figure([one], panels=["settling"]).axes[0]
    assert ax.get_yscale() == "log"
    t, y = curves(ax)[0].get_data()
    width = quantities.peak_window([one])
    assert ax.get_xlabel() == f"time (s)\nlargest over the preceding {1e3 * width:.3g} ms"
    e = np.abs(one.x - one.r)[:, 0]
    for time, value in zip(t[::17], y[::17], strict=True):
        ago = time - one.t
        past = ago >= -1e-9
        assert value <= e[past & (ago <= width) | (one.t <= width)].max() + 1e-12
        recent = past & (ago <= width - 2 * one.scenario.control_period)
        assert value >= e[recent].max(initial=quantities.MIN_ERROR)


def test_a_figure_is_returned_in_any_size_and_written_where_asked(one, tmp_path):
    page = figure(one, size=(5.0, 4.0), panels=["x"])
    assert isinstance(page, Figure)
    assert tuple(page.get_size_inches()) == (5.0, 4.0)
    figure(
        one,
        tmp_path / "a",
        format="pdf",
        size="ieee-column",
        panels=["x"],
    )
    figure(one, tmp_path / "b.pdf", panels=["x"])
    assert {path.name for path in tmp_path.iterdir()} == {"a.pdf", "b.pdf"}
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    mine = Figure(figsize=(9.0, 6.0))
    assert figure(one, fig=mine, panels=["x"]) is mine
    left_part, right = Figure(figsize=(12.0, 6.0), layout="constrained").subfigures(
        1, 2, squeeze=False
    )[0]
    assert figure(one, fig=left_part) is left_part.get_figure(root=True)
    assert len(right.axes) == 0


class Rows:
    """A table of made-up runs."""

    def __init__(
        self,
        laws=("classical", "super_twisting", "pid"),
        seeds=6,
        still="",
        away=(),
    ):
        self.still = still
        self.away = away
        cells = itertools.product(
            ("duffing", "van_der_pol"), ("nominal", "noise"), laws, range(seeds)
        )
        self.rows = [(*cell, 1.0 + 0.1 * k % 0.7) for k, cell in enumerate(cells)]

    def scenario(self, i):
        raise smc.ScenarioError("its runs were never made")

    def sets(self, seed):
        """Each run has gains of its own."""
        return seed

    def column(self, name):
        n = len(self.rows)
        gains = [json.dumps({"plant": {}, "law": self.sets(row[3])}) for row in self.rows]
        empty = {"scenario": np.array(gains, object), "source": np.full(n, "default", object)}
        nothing = ("failure", "half_step", "trends", "search", "touched")
        empty |= dict.fromkeys(nothing, np.full(n, None, object))
        empty["diverged_at"] = np.full(n, np.nan)
        empty["duration"] = np.full(n, 10.0)
        empty["arrived"] = np.array([row[2] not in self.away for row in self.rows])
        if name in empty:
            return empty[name]
        if name in ("plant", "condition", "law", "seed"):
            return np.array(
                [row[("plant", "condition", "law", "seed").index(name)] for row in self.rows],
                object,
            )
        never = []
        for row in self.rows:
            never.append(name == "settling_time" and (row[2] == "pid" or row[0] == self.still))
        sizes = [float(row[4]) for row in self.rows]
        return np.where(never, np.inf, sizes)


@pytest.mark.parametrize(
    "size",
    [
        None,
        PAGE,
        COLUMN,
    ],
)
@pytest.mark.filterwarnings("ignore:size=.* makes the figure")
def test_a_board_has_a_dot_and_an_interval_for_each_law_and_condition(size, monkeypatch):
    page = smc.plot(
        Rows(),
        size=size,
        metrics=[
            "settling_time",
            "tv_rate",
            "settles",
        ],
    )
    words_of(page, monkeypatch, whole=True)
    assert len(page.axes) == 6
    assert [label.get_text() for label in page.axes[0].get_yticklabels()] == ["nominal", "noise"]
    dots = [line for line in page.axes[1].lines if line.get_marker() not in ("None", None)]
    assert len(dots) == 6
    assert len({to_hex(dot.get_color()) for dot in dots}) == 3
    assert [ax.get_title(loc="right") for ax in page.axes[:3]] == ["never", "", ""]
    grid = page.axes[0].get_gridspec()
    assert grid is not None
    assert grid.ncols == (1 if size == COLUMN else 3)
    with pytest.raises(smc.ScenarioError, match="unknown metric 'itaee': did you mean 'itae'"):
        smc.plot(Rows(), metrics=["itaee"])


def test_a_board_that_is_higher_than_a_page_warns_with_a_cure():
    words = (
        r'size="ieee-column" makes the figure 11\.8 in high, and a journal\'s page holds 9 in: '
        r'take size="ieee-page", or fewer metrics, plants or conditions'
    )
    with pytest.warns(smc.errors.ScenarioWarning, match=words):
        page = smc.plot(Rows(), size=COLUMN)
    assert page.get_figheight() == pytest.approx(11.8, abs=0.05)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert smc.plot(Rows(), size=COLUMN, metrics=["itae"]).get_figheight() < 9.0
        assert smc.plot(Rows(), size=PAGE).get_figheight() < 9.0


@pytest.mark.parametrize("size", [None, COLUMN])
def test_marks_of_a_board_are_medians_by_law_from_above_and_a_law_that_never_settles_is_hollow(
    size,
):
    laws = (
        "classical",
        "super_twisting",
        "adaptive",
    )
    rows = Rows(laws=laws, still="duffing" if size else "")
    rows.rows = [row for row in rows.rows if row[0] == "duffing"]
    page = smc.plot(
        rows,
        metrics=[
            "settling_time",
            "ultimate_bound",
            "settles",
        ],
        size=size,
    )
    settling, bound, settles = page.axes
    for k, (law, colour) in enumerate(zip(laws, colouring.law_colours(laws), strict=True)):
        sizes = []
        for name in ("nominal", "noise"):
            sizes.append([row[4] for row in rows.rows if row[1:3] == (name, law)])
        dots = [line for line in bound.lines if line.get_marker() not in ("None", None, "")]
        mine = [
            np.array(dot.get_xydata()).tolist()[0]
            for dot in dots
            if to_hex(dot.get_color()) == to_hex(colour)
        ]
        assert mine == [
            [pytest.approx(np.median(law_sizes)), k + 4 * i] for i, law_sizes in enumerate(sizes)
        ]
    fills = {
        str(dot.get_mfc()).lower() for dot in settling.lines if dot.get_marker() in ("o", "s", "D")
    }
    assert (fills == {style.PAPER.lower()}) == (size is not None)
    dots = [dot for dot in settles.lines if dot.get_marker() in ("o", "s", "D")]
    shares = {float(np.array(dot.get_xdata())[0]) for dot in dots}
    assert shares == {0.0 if size else 100.0}
    assert settles.get_xlabel() == "settled runs\n(%)"  # as in the tables


@pytest.mark.parametrize(
    "metric",
    [
        "tv_rate",
        "energy",
        "ultimate_bound",
        "settling_time",
    ],
)
def test_a_law_whose_runs_have_not_arrived_has_no_dot_among_others(metric, monkeypatch):
    page = smc.plot(Rows(away=("pid",)), metrics=[metric])
    for ax in page.axes:
        hollow = [line for line in ax.lines if str(line.get_mfc()).lower() == style.PAPER.lower()]
        if metric == "ultimate_bound":  # an error, which is known
            assert not hollow
            assert not ax.get_title(loc="right")
            continue
        assert [np.asarray(line.get_xdata())[0] for line in hollow] == [1.0, 1.0]
        words = "never" if metric == "settling_time" else "not arrived"
        assert ax.get_title(loc="right") == words
    words_of(page, monkeypatch)


def test_a_board_s_intervals_are_those_of_the_table_where_runs_share_gains(monkeypatch):
    class Shared(Rows):
        def sets(self, seed):
            return seed % 3

    rows = Shared(laws=("classical", "pid"), seeds=24)
    page = smc.plot(rows, metrics=["tv_rate"])
    boards = smc.leaderboard(rows, ["tv_rate"], by=("plant", "condition"))
    assert "range if under 6 samples" in " ".join(
        " ".join(text.split()) for text in words_of(page, monkeypatch)
    )
    drawn = set()
    for ax in page.axes:
        for line in ax.lines:
            if len(line.get_xdata()) == 2:
                drawn.add(tuple(line.get_xdata()))
    for board in boards:
        for entry in board.entries:
            assert entry.interval.n == 3
            assert (entry.interval.low, entry.interval.high) in drawn


@pytest.mark.parametrize(
    ("law", "unit", "drawn"),
    [
        ("boundary_layer", " (m/s)", 2),
        ("extended_state", "", 2),
        ("twisting", "", 2),
        ("pid", " (m/s)", 1),
        ("adrc", " (m/s)", 1),
        ("mpc", " (m/s)", 1),
    ],
)
def test_s_is_drawn_for_laws_with_a_surface_and_has_its_unit_if_all_are_speeds(
    law, unit, drawn, one
):
    page = figure([one, under(one, law, 0.9)], panels=["s"])
    (ax,) = page.axes
    assert ax.get_ylabel().replace("\n", " ") == f"sliding variable s{unit}"
    assert sum(np.isfinite(line.get_ydata()).any() for line in curves(ax)) == drawn
    if drawn == 1:
        alone = figure(under(one, law, 0.9)).axes
        assert not any("sliding" in ax.get_ylabel() for ax in alone)


def test_a_disturbance_that_all_runs_have_is_one_line_that_says_so(one):
    pushed = dataclasses.replace(one, d=np.sin(one.t)[:, None])
    (ax,) = figure([pushed, under(pushed, "pid", 0.9)], panels=["d"]).axes
    assert [line.get_color() for line in curves(ax)] == [style.DISTURBANCE]
    assert ax.get_title(loc="right") == "the same in all runs"
    half_pushed = dataclasses.replace(under(pushed, "pid", 0.9), d=0.5 * pushed.d)
    (ax,) = figure([pushed, half_pushed], panels=["d"]).axes
    assert len(curves(ax)) == 2


def contrast(one: str, other: str) -> float:
    """The contrast of WCAG 2.2."""
    low, high = sorted(style.luminance(colour) + 0.05 for colour in (one, other))
    return high / low


def test_a_page_is_dark_where_the_caller_s_style_is_and_all_on_it_can_be_seen(one):
    runs = [one, *(under(one, law, 0.9) for law in ("pid", "adrc", "super_twisting"))]
    with plt.style.context("dark_background"):
        page = figure(runs)
        board = smc.plot(Rows(), metrics=["settling_time"])
    for dark in (page, board):
        assert to_hex(dark.get_facecolor()) == "#000000"
        for words in dark.findobj(Text):
            if words.get_text():
                assert contrast(to_hex(words.get_color()), "#000000") > 4.5, words
                if behind := words.get_bbox_patch():
                    assert to_hex(behind.get_facecolor()) == "#000000"
        for ax in dark.axes:
            for line in curves(ax):
                assert contrast(to_hex(line.get_color()), "#000000") >= 3.0, line
    usual = figure(runs)
    assert to_hex(usual.get_facecolor()).upper() == style.PAPER


def test_a_panel_is_drawn_into_axes_of_the_caller_whose_legend_names_the_runs(one, tmp_path):
    runs = [one, under(one, "pid", 0.9)]
    fig, (left_axes, right) = plt.subplots(1, 2)
    assert figure(runs, ax=left_axes) is fig
    assert figure(runs, tmp_path / "two.png", format="png", ax=right, panels=["phase"]) is fig
    assert (tmp_path / "two.png").exists()
    for ax in (left_axes, right):
        assert [text.get_text() for text in ax.legend().get_texts()] == ["Classical", "PID"]
    assert left_axes.get_ylabel() == "position x (m)"
    assert any(np.array_equal(line.get_xdata(), (one.x - one.r)[:, 0]) for line in curves(right))
    plt.close(fig)


def test_a_metric_s_axis_is_of_one_kind_on_all_plants():
    class Two(Rows):
        def column(self, name):
            values = super().column(name)
            if name == "tv_rate":
                wide = self.column("plant") == "duffing"
                values = np.where(wide, np.geomspace(1.0, 1e4, len(values)), values)
            return values

    page = smc.plot(Two(), metrics=["tv_rate", "settling_time"])
    scales = [ax.get_xscale() for ax in page.axes]
    assert scales == ["log", "linear", "log", "linear"]
    assert [ax.get_xlabel().endswith(", log") for ax in page.axes] == [True, False] * 2


def test_errors_too_small_to_draw_are_at_a_least_one_and_the_axis_says_so(one):
    for least, said in ((1e-12, True), (1e-7, False)):
        e = np.geomspace(1.0, least, len(one.t))[:, None]
        (ax,) = figure([dataclasses.replace(one, x=one.r + e)], panels=["settling"]).axes
        assert ax.get_xlabel().endswith(" ms,\nat least $10^{-9}$") is said


def test_where_gains_come_from_is_a_sentence_beside_the_title_or_in_the_key(one):
    """It was "gains: given, given, default, given"."""
    own = dataclasses.replace(one.scenario, law=smc.law(one.scenario.law.name, k=3.0))
    runs = [one, *[dataclasses.replace(one, scenario=own)] * 2]
    for names in (["a", "b", "c"], ["that with default gains", "another relay", "a third relay"]):
        page = figure(runs, labels=names)
        first, *rest = names
        words = f"gains: default for {first}, given for {' and '.join(rest)}"
        beside = [text.get_text() for text in page.artists if isinstance(text, Text)]
        key = str(page.get_label())
        assert (words in beside) == (words not in key) == (first == "a")
