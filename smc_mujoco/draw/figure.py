"""Figures: x, u and s of several runs over time with their phase portrait; u alone under several conditions.

They are written as SVG and PNG. The same traces give the same files.
"""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import replacing
from smc_mujoco.draw import panels, style
from smc_mujoco.draw.decimate import end, finite
from smc_mujoco.draw.panels import Panel
from smc_mujoco.draw.states import HOLD
from smc_mujoco.metrics import catalogue
from smc_mujoco.metrics.channel_groups import Group, cut
from smc_mujoco.simulation.trace import Trace

WIDTH = 12.8  # inches: 1280 px of SVG, 1920 of PNG
DPI = 150
HEAD = 1.2  # inches, above and below the panels
LETTERS = 11  # points, in the legend


def figure(
    traces: Trace | Sequence[Trace],
    path: str | os.PathLike,
    labels: Sequence[str] | None = None,
    title: str | None = None,
) -> list[Path]:
    """Draw traces of one plant: x, u and s over time, the phase portrait, the last samples of u.

    A network is drawn as the mean of its channels with light single channels, and the spread max x - min x. Joints
    without an actuator, and channels in another unit, have their own panels. Realistic mechanisms have panels of what
    the actuator delivers and of what friction and contacts exert; diamonds show where friction holds them. The end of
    a failed run and the instant at which a plant changes are marked.

    Args:
      traces: several, or a single one.
      path: without an ending, or with .svg or .png: both are written.
      labels: one a trace; default: the laws' labels.
      title: default: the plant's name.

    Returns:
      The two files.

    Raises:
      ScenarioError: no traces, several plants, another ending, or a path that cannot be written.
    """
    base = _base(path)
    traces = style.same_plant(traces)
    names, colours = style.labels(traces, labels), style.law_colours([trace.scenario.law for trace in traces])
    traces = [finite(trace) for trace in traces]
    overview, rests = panels.overview(traces), [panels.rests(trace) for trace in traces]
    with style.page():
        realism = sum(panel.quantity in panels.REALISM for panel in overview)
        page = _page(7.2 + 1.3 * (realism + max(0, len(overview) - realism - 4)))
        left, right = page.add_gridspec(1, 2, width_ratios=(1.7, 1.0))
        column, axes = left.subgridspec(len(overview), 1), []
        words = panels.titles(overview, 72 * (page.get_figheight() - HEAD) / len(overview))
        for i, panel in enumerate(overview):
            ax = page.add_subplot(column[i], sharex=axes[0] if axes else None, ylabel=words[i])
            axes.append(ax)
            if panel.quantity == "x":
                panels.target(ax, panel.traces)
            panels.over_time(ax, panel, colours)
            panels.jumps(ax, style.jumps(traces, names), named=i == 0)
            ax.tick_params(labelbottom=i == len(overview) - 1)
        axes[-1].set(xlabel="time (s)", xlim=(0.0, end(traces)))
        page.align_ylabels(axes)
        places = [panel for panel in overview if panel.quantity == "x"]
        column = right.subgridspec(len(places) + 1, 1, height_ratios=(*[1.5] * len(places), 1.0))
        for i, panel in enumerate(places):
            portrait = page.add_subplot(column[i], xlabel=panel.label, ylabel=panel._replace(quantity="v").label)
            panels.phase(portrait, panel.traces, colours, rests)
        first = next(panel for panel in overview if panel.quantity == "u")
        channel = ", channel 0" if traces[0].scenario.plant.driven > 1 else ""
        name = f"control u ({style.units(first.group)['u']}){channel}"
        close = page.add_subplot(column[-1, 0], xlabel="time before the end (ms)", ylabel=name)
        panels.last_samples(close, first.traces, colours)
        _head(page, title or style.plant_name(traces[0]), _key(traces, names, colours, overview, any(rests)))
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

    Returns:
      The two files.

    Raises:
      ScenarioError: as `figure`; also two traces of one law under one condition, or u in two units.
    """
    base = _base(path)
    traces = style.same_plant(traces)
    columns = style.labels(traces, labels)
    traces = [finite(trace) for trace in traces]
    cells = {(trace.scenario.law.name, column): trace for trace, column in zip(traces, columns, strict=True)}
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
            panels.over_time(ax, Panel("u", group, [cut(trace, group)]), [colours[law]])
            panels.jumps(ax, style.jumps([trace], [law]), named=law == laws[0])
            ax.set_title(_variation(trace, group), loc="right", fontweight="normal", fontsize=9.5, color=style.MUTED)
        control = Panel("u", group, style.split(traces)[group])
        for law, ax in zip(laws, axes[:, 0], strict=True):
            ax.set_ylabel(control.label.replace("control ", ""))
            words = style.cropped(style.law_name(law), 0.55 * room, 11, bold=True)
            ax.set_title(words, color=colours[law], parse_math=False)
        for condition, top, bottom in zip(conditions, axes[0], axes[-1], strict=True):
            words = style.cropped(condition, 0.85 * room, 13)
            place = (0.5, 1.0), (0, 22), "axes fraction", "offset points"
            top.annotate(words, *place, ha="center", fontsize=13, parse_math=False)
            bottom.set_xlabel("time (s)")
        axes[0, 0].set(xlim=(0.0, end(traces)), ylim=panels.limits(control.traces, "u"))
        note = Line2D([], [], lw=0, label="at the right: total variation per second over the last 20 %")
        _head(page, title or f"{style.plant_name(traces[0])}: control", [*_meaning([control]), note])
        return _write(page, base)


def _page(height: float) -> Figure:
    """Return an empty page; height in inches."""
    layout = ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.07, wspace=0.02, hspace=0.02)
    return Figure(figsize=(WIDTH, height), layout=layout)


def _head(page: Figure, title: str, handles: Sequence[Line2D | Patch]) -> None:
    """Draw the title with the legend below it: in as few rows as fit."""
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
    traces: Sequence[Trace], names: Sequence[str], colours: Sequence[str], overview: Sequence[Panel], rests: bool
) -> list[Line2D | Patch]:
    """Return the entries of a legend: the traces, the reference with its band, the meaning of lines and bands."""
    handles: list[Line2D | Patch] = []
    for trace, name, colour in zip(traces, names, colours, strict=True):
        how = style.ending(trace)
        words = style.cropped(name, 0.3 * 72 * WIDTH, LETTERS) + (f" ({how})" if how else "")
        handles.append(Line2D([], [], color=colour, lw=3, label=words))
    if rests:
        diamond = {"marker": "D", "ms": 5, "lw": 0, "color": style.MUTED, "mec": style.PAPER}
        handles.append(Line2D([], [], **diamond, label=f"held by friction for {HOLD:g} s or longer"))
    return [*handles, Patch(color=style.BAND, label="reference ± 2 %"), *_meaning(overview)]


def _meaning(overview: Sequence[Panel]) -> list[Line2D | Patch]:
    """Return the entries of a legend that say what bands and lines are."""
    looks = {
        "band": Patch(color=style.MUTED, alpha=0.3),
        "line": Line2D([], [], color=style.MUTED, lw=1.5),
        "light": Line2D([], [], color=style.MUTED, alpha=0.5, lw=0.8),
    }
    words = panels.meaning(overview)
    for name, look in looks.items():
        look.set_label(f"{name}: {words.get(name)}")
    return [look for name, look in looks.items() if name in words]


def _variation(trace: Trace, group: Group) -> str:
    """Return the total variation of u per second in the last part of a run, or how the run failed."""
    if trace.diverged_at is not None:
        return style.ending(trace)
    rate = catalogue.tv_rate(trace)
    return f"{rate:,.{0 if rate >= 10 else 2}f} {style.units(group)['u']}/s"


def _base(path: str | os.PathLike) -> Path:
    """Return the path without .svg or .png; the 5 in "lam_0.5" and the "b c" in "a.b c" are no endings."""
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
