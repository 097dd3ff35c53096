"""Figures: x, u and s of several runs on one time axis with their phase portrait, and u alone under several conditions.

Written as SVG and PNG; the same traces give the same files.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import replacing
from smc_mujoco.draw import panels, style
from smc_mujoco.draw.decimate import end, finite
from smc_mujoco.draw.rows import REALISM, Row, axis, rows_of, titles
from smc_mujoco.draw.states import HOLD
from smc_mujoco.metrics import catalogue
from smc_mujoco.metrics.channel_groups import Group, cut
from smc_mujoco.simulation.trace import Trace

WIDTH = 12.8  # inches: 1280 px of SVG, 1920 of PNG
DPI = 150
HEAD = 1.2  # inches: above and below the panels
LETTERS = 11  # points, of the legend


def figure(
    traces: Trace | Sequence[Trace],
    path: str | os.PathLike,
    labels: Sequence[str] | None = None,
    title: str | None = None,
) -> list[Path]:
    """Draw traces of one plant: x, u and s over time, the phase portrait, the last samples of u.

    Of a network: the mean of the channels, single channels light, and the spread max x - min x. Joints that no actuator
    drives, and channels in another unit, have panels of their own. Of realistic mechanisms also what an actuator
    delivers, what friction and contacts exert, and where friction holds it. A run that failed is drawn to its end,
    which is marked; the instant at which a plant changes is marked too.

    Args:
      traces: several, or a single one.
      path: without an ending, or with .svg or .png, which give way to both.
      labels: one a trace, shown as it is; default: the laws' names.
      title: default: the plant's name.

    Returns:
      The two files.

    Raises:
      ScenarioError: no traces, several plants, another ending, or a path that cannot be written.
    """
    base = _base(path)
    traces = style.same_plant(traces)
    names, colours = style.labels(traces, labels), style.colours(traces)
    traces = [finite(trace) for trace in traces]
    rows, held = rows_of(traces), [panels.rests(trace) for trace in traces]
    with style.page():
        extra = sum(row.name in REALISM for row in rows)
        page = _page(7.2 + 1.3 * (extra + max(0, len(rows) - extra - 4)))
        left, right = page.add_gridspec(1, 2, width_ratios=(1.7, 1.0))
        _overview(page, left, rows, style.jumps(traces, names), colours)
        places = [row for row in rows if row.name == "x"]
        column = right.subgridspec(len(places) + 1, 1, height_ratios=(*[1.5] * len(places), 1.0))
        for i, row in enumerate(places):
            portrait = page.add_subplot(column[i])
            panels.phase(portrait, row.traces, colours, held)
            portrait.set_xlabel(axis(row, "x"))
            portrait.set_ylabel(axis(row, "v"))
        first, close = next(row for row in rows if row.name == "u"), page.add_subplot(column[len(places)])
        panels.last_samples(close, first.traces, colours)
        close.set_xlabel("time before the end (ms)")
        several = traces[0].scenario.plant.driven > 1
        close.set_ylabel(f"control u ({style.units(first.group)['u']})" + (", channel 0" if several else ""))
        _head(page, title or style.plant_name(traces[0]), _key(traces, names, colours, rows))
        return _write(page, base)


def signals(
    traces: Trace | Sequence[Trace],
    path: str | os.PathLike,
    labels: Sequence[str],
    title: str | None = None,
) -> list[Path]:
    """Draw u alone: a column for each condition, a row for each law.

    Args:
      labels: the condition of each trace; traces under the same condition share it.

    Returns, raises: as `figure`; also ScenarioError for two traces of one law under one condition, or u in two units.
    """
    base = _base(path)
    traces = style.same_plant(traces)
    given = style.labels(traces, labels)
    traces = [finite(trace) for trace in traces]
    cells = {(trace.scenario.law.name, label): trace for trace, label in zip(traces, given, strict=True)}
    if len(cells) < len(traces):
        raise ScenarioError("two traces of one law under one condition: give each condition a label of its own")
    group, *others = [group for group in style.split(traces) if group.driven]
    if others:
        raise ScenarioError(f"u of {traces[0].scenario.plant.name} has several units: draw it with smc.figure")
    laws, conditions = (list(dict.fromkeys(keys)) for keys in zip(*cells, strict=True))
    colours = dict(zip(laws, style.law_colours(laws), strict=True))
    with style.page():
        page = _page(max(3.4, 1.4 + 1.5 * len(laws)))
        axes = page.subplots(len(laws), len(conditions), sharex=True, sharey=True, squeeze=False)
        room = 72 * WIDTH / len(conditions)  # points, a column's width
        for (law, condition), trace in cells.items():
            ax = axes[laws.index(law), conditions.index(condition)]
            panels.over_time(ax, [cut(trace, group)], [colours[law]], "u", group)
            panels.jumps(ax, style.jumps([trace], [law]), named=law == laws[0])
            ax.set_title(_variation(trace, group), loc="right", fontweight="normal", fontsize=9.5, color=style.MUTED)
        for law, ax in zip(laws, axes[:, 0], strict=True):
            ax.set_ylabel(axis(Row("u", group, traces), "u").replace("control ", ""))
            words = style.cropped(style.law_name(law), 0.55 * room, 11, bold=True)
            ax.set_title(words, color=colours[law], parse_math=False)
        for condition, top, bottom in zip(conditions, axes[0], axes[-1], strict=True):
            words = style.cropped(condition, 0.85 * room, 13)
            place = (0.5, 1.0), (0, 22), "axes fraction", "offset points"
            top.annotate(words, *place, ha="center", fontsize=13, parse_math=False)
            bottom.set_xlabel("time (s)")
        parts = style.split(traces)[group]
        axes[0, 0].set_ylim(panels.limits(parts, "u"))
        axes[0, 0].set_xlim(0.0, end(traces))
        note = Line2D([], [], lw=0, label="at the right: total variation per second over the last 20 %")
        _head(page, title or f"{style.plant_name(traces[0])}: control", [*_meaning([parts], "u"), note])
        return _write(page, base)


def _overview(
    page: Figure, place: SubplotSpec, rows: Sequence[Row], changes: Mapping[float, str], colours: Sequence[str]
) -> None:
    """The quantities over time, one below the other."""
    column, axes = place.subgridspec(len(rows), 1), []
    pitch = 72 * (page.get_figheight() - HEAD) / len(rows)
    for i, (row, words) in enumerate(zip(rows, titles(rows, pitch), strict=True)):
        ax = page.add_subplot(column[i], sharex=axes[0] if axes else None)
        axes.append(ax)
        if row.name == "x":
            panels.target(ax, row.traces)
        panels.over_time(ax, row.traces, colours, row.name, row.group)
        panels.jumps(ax, changes, named=ax is axes[0])
        ax.set_ylabel(words)
        ax.tick_params(labelbottom=row is rows[-1])
    axes[-1].set_xlabel("time (s)")
    axes[-1].set_xlim(0.0, end(rows[0].traces))
    page.align_ylabels(axes)


def _page(height: float) -> Figure:
    """An empty page, its height in inches."""
    layout = ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.07, wspace=0.02, hspace=0.02)
    return Figure(figsize=(WIDTH, height), layout=layout)


def _head(page: Figure, title: str, handles: Sequence[Line2D | Patch]) -> None:
    """The title, with the legend under it: in one row where it fits."""
    size, room = LETTERS, 72 * WIDTH - 16  # points
    words = [style.cropped(str(handle.get_label()), 0.45 * room, size) for handle in handles]
    widths = [style.width(text, size) + 4.4 * size for text in words]  # with the sample, and the gap to the next
    fitting = (n for n in range(len(words), 1, -1) if sum(map(max, np.array_split(widths, n))) < room)
    legend = page.legend(
        handles=handles,
        labels=["."] * len(words),  # matplotlib leaves out labels that begin with _
        title=style.cropped(title, room, 17, bold=True),
        title_fontproperties={"size": 17, "weight": "bold"},
        alignment="left",
        loc="outside upper left",
        ncols=next(fitting, 1),
        fontsize=size,
        borderpad=0.2,
        columnspacing=1.5,
    )
    legend.get_title().set_parse_math(False)
    for shown, text in zip(legend.get_texts(), words, strict=True):
        shown.set_text(text)
        shown.set_parse_math(False)


def _key(
    traces: Sequence[Trace], names: Sequence[str], colours: Sequence[str], rows: Sequence[Row]
) -> list[Line2D | Patch]:
    """What the legend shows: the traces, the reference with its band, what lines and bands are."""
    handles: list[Line2D | Patch] = []
    for trace, name, colour in zip(traces, names, colours, strict=True):
        how = style.ending(trace)
        words = style.cropped(name, 0.3 * 72 * WIDTH, LETTERS) + (f" ({how})" if how else "")
        handles.append(Line2D([], [], color=colour, lw=3, label=words))
    there = [row.name for row in rows]
    banded = ["u", *("delivered" if name == "force" else name for name in REALISM if name in there), "s"]
    if any(panels.rests(trace) for trace in traces):
        diamond = {"marker": "D", "ms": 5, "lw": 0, "color": style.MUTED, "mec": style.PAPER}
        handles.append(Line2D([], [], **diamond, label=f"held by friction for {HOLD:g} s or longer"))
    driven = [row.traces for row in rows if row.name == "u"]
    return [*handles, Patch(color=style.BAND, label="reference ± 2 %"), *_meaning(driven, ", ".join(banded))]


def _meaning(driven: Sequence[Sequence[Trace]], names: str) -> list[Line2D | Patch]:
    """What the bands and the lines of the named quantities are, where they need words."""
    n = max(traces[0].x.shape[1] for traces in driven)
    over = max(filter(None, map(panels.mean_window, driven)), default=None)
    handles: list[Line2D | Patch] = []
    if over or n > 1:
        handles.append(Patch(color=style.MUTED, alpha=0.3, label=f"band: range of {names}"))
    if over:
        words = f"line: mean over {1e3 * over:.3g} ms where it chatters"
        handles.append(Line2D([], [], color=style.MUTED, lw=1.5, label=words))
    if n > 1:
        shown = len(panels.light(n))
        which = "single channels" if shown == n else f"{shown} of {n} channels"
        handles.append(Line2D([], [], color=style.MUTED, alpha=0.5, lw=0.8, label=f"light: {which}"))
    return handles


def _variation(trace: Trace, group: Group) -> str:
    """How much u moves in the last part of a run."""
    if trace.diverged_at is not None:
        return style.ending(trace)
    rate = catalogue.tv_rate(trace)
    return f"{rate:,.{0 if rate >= 10 else 2}f} {style.units(group)['u']}/s"


def _base(path: str | os.PathLike) -> Path:
    """The path without .svg or .png. What follows a point in "lam_0.5" or "a.b c" is no ending."""
    base = Path(path)
    if not base.name:
        raise ScenarioError(f"cannot draw to {str(path)!r}: give the name of a file, such as network.svg")
    if base.suffix in (".svg", ".png"):
        return base.with_suffix("")
    if base.suffix[1:].isalnum() and base.suffix[1].isalpha():
        raise ScenarioError(f"cannot draw to {base.name!r}: end the name in .svg or .png, for both are written")
    return base


def _write(page: Figure, base: Path) -> list[Path]:
    written = []
    for suffix in (".svg", ".png"):
        written.append(base.with_name(base.name + suffix))
        with replacing(written[-1]) as part:
            page.savefig(part, dpi=DPI, metadata={"Date": None} if suffix == ".svg" else None)
        page.set_layout_engine("none")  # laid out once; the second file keeps it
    return written
