"""Figures: x, u and s of several runs over time with their phase portrait; only u under several conditions."""

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.gridspec import SubplotSpec
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from smc_mujoco.common.errors import ScenarioError, find, items_of
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import panels as drawing
from smc_mujoco.draw import style
from smc_mujoco.draw.decimate import end, finite
from smc_mujoco.draw.page import Handle, Size
from smc_mujoco.draw.panels import Panel
from smc_mujoco.draw.states import MIN_STATE_TIME
from smc_mujoco.mechanisms.hardware.part import joint_names
from smc_mujoco.metrics import catalogue
from smc_mujoco.metrics.channel_groups import Group, group_trace
from smc_mujoco.simulation.trace import Trace

TIME_PANELS = {  # panel -> quantity
    "x": "x", "error": "e", "spread": "spread", "v": "v", "u": "u", "delivered": "force", "reaction": "reaction",
    "d": "d", "s": "s",
}  # fmt: skip
SIDE_PANELS = ("phase", "settling", "end")
PANEL_NAMES = {name: name for name in (*TIME_PANELS, "channels", *SIDE_PANELS)}  # of panels
ROW_HEIGHT = 1.5  # inches on a full page, height of a panel over time
SIDE_HEIGHTS = {"phase": 1.5, "settling": 1.0, "end": 1.0}  # relative heights of SIDE_PANELS
Row = tuple[Axes, Panel, Sequence[str]]  # axes, the panel with the traces that they show, and the traces' colours
LINE_ROW, LINES_ROW = 0.32, 0.45  # relative height of a row with one line, and with several
ROW_FILLED = 0.6  # part of a row below its name


def figure(
    traces: Trace | Sequence[Trace],
    path: str | os.PathLike[str] | None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    panels: Sequence[str] | None = None,
    size: Size = None,
    format: str | None = None,
    fig: Figure | SubFigure | None = None,
) -> Figure | SubFigure:
    """Draw traces of one plant: x, u and s over time, the phase portrait, |x - r|, and a close-up of the end of u.

    x, u and s are drawn until all comes to rest, |x - r| over the whole run on a logarithmic axis. Each run of a
    network has a row with a line for each channel, and there is the spread max x - min x. Each driven joint of your own
    model has small panels of x and its reference, of u, and of the error if a reference moves. Joints without an
    actuator, and channels in another unit, have their own panels. Realistic mechanisms have panels of the actuator's
    force and of the reaction of friction and contacts; diamonds show where friction holds them. The end of a failed run
    and the instant at which a plant changes are marked. Curves that coincide are dashed in turn.

    Args:
      traces: one or several traces.
      path: file to write; default: none. Without an ending, or with .svg or .png, an SVG and a PNG are written; with
        .pdf, a PDF.
      labels: one label per trace; default: the laws' labels, with the differences between runs of one law.
      title: default: the plant's label.
      panels: names among "x", "error", "spread", "v", "u", "delivered", "reaction", "d", "s", "channels" (small panels
        of every channel), "phase", "settling" (|x - r|), "end" (close-up of u). Default: those that suit the
        plant and the size.
      size: "ieee-column" (3.5 in wide), "ieee-page" (7.16 in), or (width, height) in inches. Default: 12.8 in wide.
      format: "svg", "png" or "pdf", of the file.
      fig: Figure or SubFigure to draw into; default: a new one.

    Raises:
      ScenarioError: no traces, traces of several plants, an unknown panel, size or format, or a path that cannot be
        written.
    """
    paths = pages.files(path, format)
    width, height = pages.measure(size, fig)
    traces = style.same_plant(traces)
    names, colours = style.labels(traces, labels), style.law_colours([trace.scenario.law for trace in traces])
    traces = [finite(trace) for trace in traces]
    if panels is None:
        chosen = _default(traces, width)
    else:
        chosen = [find("panel", name, PANEL_NAMES) for name in items_of("panels", panels)]
    with style.page(width):
        page = _composed_page(traces, names, colours, chosen, (width, height), title, fig)
        pages.write(page, paths)
    return page


def _composed_page(
    traces: Sequence[Trace],
    names: Sequence[str],
    colours: Sequence[str],
    chosen: Sequence[str],
    size: tuple[float, float | None],
    title: str | None,
    fig: Figure | SubFigure | None,
) -> Figure | SubFigure:
    """Return a page with the chosen panels of traces."""
    (width, height), shown = size, drawing.horizon(traces)
    early = [drawing.until(trace, shown) for trace in traces]
    overview = _overview(early, chosen)
    by_group = style.split(early) if "channels" in chosen else ()
    small = [row for group in by_group for row in drawing.small(early, group)]
    small.sort(key=lambda row: row[0].channel or 0)
    beside = [name for name in chosen if name in SIDE_PANELS]
    groups = [Panel("x", *each) for each in style.split(traces).items()]
    places = _by_joint(groups)
    rests = [drawing.rests(trace) for trace in traces] if "phase" in beside else []
    key, gains = _key(traces, names, colours, [*overview, *(panel for row in small for panel in row)], any(rests))
    column = [name for name in beside for _ in (places if name == "phase" else "x")]
    space, narrow = pages.head_height(width, key), width < pages.NARROW
    last = Panel("u", *next(iter(style.split(traces).items())))
    heights = [_height(panel) for panel in overview], [_height(last) if n == "end" else SIDE_HEIGHTS[n] for n in column]
    parts = [0.62 * len(small), *map(sum, heights)]
    if not any(parts):
        raise ScenarioError(f"panels is {list(chosen)}: give a panel that the plant has, or leave panels out")
    rows = sum(parts) if narrow else max(parts[0], parts[1], 4.0 if beside else 1.0)
    tall = height or max(0.5625 * width * (not narrow), space + style.points(ROW_HEIGHT) * rows + 0.5)
    page = pages.blank(width, tall, fig)
    pitch = 72 * (page.bbox.height / page.dpi - space - 0.4) / (rows if narrow else max(parts[1], 1))
    first, cells, others = _cells(page, narrow, parts, heights)
    changes, span = style.marks(traces, names), (shown, end(traces))
    if first is not None:
        _draw_small(page, first, small, colours, changes, span)
    if overview:
        words = drawing.titles(overview, [pitch * part for part in heights[0]])
        _draw_over_time(page, cells, overview, words, names, colours, changes, span)
    _draw_beside(page, others, column, (groups[0], *places), names, colours, rests)
    pages.set_head(page, width, title or style.plant_name(traces[0].scenario.plant), key, gains)
    pages.space_ticks(page)
    return page


def _cells(
    page: Figure | SubFigure, narrow: bool, parts: Sequence[float], heights: tuple[Sequence[float], Sequence[float]]
) -> tuple[SubplotSpec | None, list[SubplotSpec], list[SubplotSpec]]:
    """Return the cells of the small panels, of those over time and of those beside, as high as their parts."""
    if narrow:  # one below the other
        several = [*parts[:1], *heights[0], *heights[1]] if parts[0] else [*heights[0], *heights[1]]
        grid = page.add_gridspec(len(several), 1, height_ratios=several)
        rest = [grid[i] for i in range(len(several))]
        first = rest.pop(0) if parts[0] else None
        return first, rest[: len(heights[0])], rest[len(heights[0]) :]
    there = [i for i, part in enumerate(parts) if part]
    grid = page.add_gridspec(1, len(there), width_ratios=[(2.6, 1.7, 1.0)[i] for i in there])
    over, beside = (_column(grid[there.index(i)], tall) if tall else [] for i, tall in enumerate(heights, 1))
    return grid[0] if parts[0] else None, over, beside


def _height(panel: Panel) -> float:
    """Return the relative height of a panel over time."""
    if not drawing.crowded(panel):
        return 1.0
    return max(1.0, (LINE_ROW if len(panel.group.channels) == 1 else LINES_ROW) * len(panel.traces))


def _column(cell: SubplotSpec, heights: Sequence[float]) -> list[SubplotSpec]:
    """Return cells one below the other, with these relative heights."""
    grid = cell.subgridspec(len(heights), 1, height_ratios=heights)
    return [grid[i] for i in range(len(heights))]


def _default(traces: Sequence[Trace], width: float) -> list[str]:
    """Return the names of the panels that suit the plant and the page."""
    several = any(len(group.channels) > 1 for group in style.split(traces))
    if several and traces[0].scenario.plant.direct:
        return ["channels", "settling"]
    names = ["x", "spread", "u", "delivered", "reaction"]
    if several:
        return [*names, "settling"]
    names += ["s"] * any(np.nan_to_num(trace.s).any() for trace in traces)
    return [*names, "settling"] if width < pages.NARROW else [*names, *SIDE_PANELS]


def _overview(traces: Sequence[Trace], chosen: Sequence[str]) -> list[Panel]:
    """Return the chosen panels over time, from top to bottom: the plant's default ones first."""
    by_default = drawing.overview(traces)
    panels = [panel for panel in by_default if any(TIME_PANELS.get(name) == panel.quantity for name in chosen)]
    shown = {panel.quantity for panel in by_default} | {"spread", "force", "reaction"}  # only if the plant has them
    for name in chosen:
        if (quantity := TIME_PANELS.get(name)) and quantity not in shown:
            parts = style.split(traces).items()
            panels += [Panel(quantity, *each) for each in parts if each[0].driven or name in ("v", "error")]
    return _by_joint(panels)


def _by_joint(panels: Sequence[Panel]) -> list[Panel]:
    """Return the panels, divided into one for each joint of a robot: these have nothing in common."""
    direct = any(panel.traces[0].scenario.plant.direct for panel in panels)
    return [part for panel in panels for part in (drawing.by_channel(panel) if direct else [panel])]


def _time(span: tuple[float, float]) -> str:
    """Return the label of a time axis: the time shown, and that of the run, s."""
    shown, whole = span
    return "time (s)" if shown == whole else f"time (s), the first {shown:.2g} s of {whole:g} s"


def _draw_over_time(
    page, cells: Sequence[SubplotSpec], overview: Sequence[Panel], words, names, colours, changes, span
) -> None:
    """Draw panels over time in the cells of a column, labelled `words`; `span`: the time shown, and the run's, s."""
    frames: list[Axes] = []
    axes: list[Axes] = []
    for i, panel in enumerate(overview):
        frame, rows = _rows(page, cells[i], panel, names, colours, axes[0] if axes else None)
        frame.set_ylabel(words[i])
        frames.append(frame)
        for ax, part, row_colours in rows:
            axes.append(ax)
            ax.set_xlim(0.0, span[0])
            drawing.over_time(ax, part, row_colours, among=panel.traces)
            drawing.mark(ax, changes, named=ax is axes[0])
            ax.tick_params(labelbottom=False)
        for ax in (frame, *(ax for ax, *_ in rows)):
            drawing.scale_ticks(ax.yaxis, panel)
        _equal_ranges(frame, rows)
    axes[-1].tick_params(labelbottom=True)
    axes[-1].set_xlabel(_time(span))
    page.align_ylabels(frames)


def _rows(page, cell: SubplotSpec, panel: Panel, names, colours, share: Axes | None = None) -> tuple[Axes, list[Row]]:
    """Return the axes that have the label of a panel, and its rows.

    A crowded panel has a row for each trace, under the trace's name. Others have one row.
    """
    if not drawing.crowded(panel):
        ax = page.add_subplot(cell, sharex=share)
        return ax, [(ax, panel, colours)]
    frame = page.add_subplot(cell, frameon=False, xticks=[])
    pitch, size, rows = 1.0 / len(panel.traces), style.points(8.5), []
    for i, (trace, name, colour) in enumerate(zip(panel.traces, names, colours, strict=True)):
        ax = frame.inset_axes((0.0, 1.0 - (i + 1) * pitch, 1.0, ROW_FILLED * pitch), sharex=share)
        words = style.cropped(name, 72 * cell.get_position(page).width * page.bbox.width / page.dpi, size)
        ax.set_title(words, fontsize=size, fontweight="normal", color=colour, pad=1.0, parse_math=False)
        rows.append((ax, panel._replace(traces=[trace]), [colour]))
        share = ax
    return frame, rows


def _equal_ranges(frame: Axes, rows: Sequence[Row]) -> None:
    """Give several rows of a panel the range of the runs that last, and ticks near its ends."""
    if len(rows) == 1:
        return
    lasting = [ax for ax, part, _ in rows if part.traces[0].diverged_at is None]
    ranges = [ax.get_ylim() for ax in lasting or [ax for ax, *_ in rows]]
    low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
    places = [tick for tick in MaxNLocator(3).tick_values(low, high).tolist() if low <= tick <= high]
    for ax in (frame, *(ax for ax, *_ in rows)):
        ax.set(ylim=(low, high), yticks=[places[0], places[-1]])
    for ax, *_ in rows[:-1]:
        ax.tick_params(labelbottom=False, length=0)
    frame.tick_params(labelcolor="none", length=0)  # invisible numbers, which keep its label beside those of the rows


def _draw_small(page, cell: SubplotSpec, small, colours, changes, span: tuple[float, float]) -> None:
    """Draw a row of small panels for each channel; `span` as of `_draw_over_time`."""
    rows = cell.subgridspec(len(small), max(map(len, small)))
    for i, row in enumerate(small):
        for k, panel in enumerate(row):
            ax = page.add_subplot(rows[i, k], ylabel=panel.label)
            ax.set_xlim(0.0, span[0])
            ax.locator_params(axis="y", nbins=3)
            drawing.over_time(ax, panel, colours)
            drawing.scale_ticks(ax.yaxis, panel)
            drawing.mark(ax, changes, named=i == k == 0)
            ax.tick_params(labelbottom=i == len(small) - 1)
            if i == len(small) - 1:
                ax.set_xlabel(_time(span))


def _draw_beside(page, cells: Sequence[SubplotSpec], column: Sequence[str], places, names, colours, rests) -> None:
    """Draw phase portraits and close-ups in the cells of a column; `places`: the first group, then the portraits."""
    portraits = iter(places[1:])
    for i, name in enumerate(column):
        if name == "end":
            _draw_end(page, cells[i], places[0]._replace(quantity="u"), names, colours)
            continue
        ax = page.add_subplot(cells[i])
        if name == "phase":
            panel = next(portraits)
            drawing.phase(ax, panel.traces, colours, rests)
            for axis, part in ((ax.xaxis, panel), (ax.yaxis, panel._replace(quantity="v"))):
                drawing.scale_ticks(axis, part)
                axis.set_label_text(part.label)
        else:
            panel = places[0]._replace(quantity="settling")
            drawing.over_time(ax, panel, colours)
            words = f"time (s)\nthe largest in {1e3 * drawing.peak_window(panel.traces):.3g} ms"
            ax.set(xlabel=words, ylabel=panel.label, xlim=(0.0, end(panel.traces)))


def _draw_end(page, cell: SubplotSpec, panel: Panel, names, colours) -> None:
    """Draw the close-up of the last samples of u."""
    frame, rows = _rows(page, cell, panel, names, colours)
    period = drawing.last_period(panel.traces)
    for ax, part, row_colours in rows:
        drawing.last_samples(ax, part.traces, row_colours, period)
    _equal_ranges(frame, rows)
    plant = panel.traces[0].scenario.plant
    letter = f"{joint_names(plant)[0]} u" if plant.driven > 1 or plant.direct else "control u"
    frame.set_ylabel(f"{letter} ({style.units(panel.group)['u']})")
    rows[-1][0].set_xlabel("time before the end (ms)")


def signals(
    traces: Trace | Sequence[Trace],
    path: str | os.PathLike[str] | None,
    labels: Sequence[str],
    title: str | None = None,
    size: Size = None,
    format: str | None = None,
    fig: Figure | SubFigure | None = None,
) -> Figure | SubFigure:
    """Draw only u: a column for each condition, a row for each law.

    Args:
      traces: one or several traces.
      labels: condition of each trace; traces under the same condition have the same label.
      path, title, size, format, fig: as in `figure`.

    Raises:
      ScenarioError: as in `figure`; also two traces of one law under one condition, or u in several units.
    """
    paths = pages.files(path, format)
    width, height = pages.measure(size, fig)
    traces = style.same_plant(traces)
    columns = style.labels(traces, labels)
    traces = [finite(trace) for trace in traces]
    cells = _by_law_and_condition(traces, columns)
    group, *others = [group for group in style.split(traces) if group.driven]
    if others:
        raise ScenarioError(f"u of {traces[0].scenario.plant.name} has several units: draw it with smc.figure")
    laws, conditions = (list(dict.fromkeys(keys)) for keys in zip(*cells, strict=True))
    of_law = {trace.scenario.law.name: trace.scenario.law for trace in traces}
    colours = dict(zip(laws, style.law_colours([of_law[law] for law in laws]), strict=True))
    control = Panel("u", group, style.split(traces)[group])
    with style.page(width):
        points, room = style.points, 72 * width / len(conditions)  # room of a column, points
        page = pages.blank(width, height or points(max(3.4, 1.4 + 1.5 * len(laws))), fig)
        axes = page.subplots(len(laws), len(conditions), sharex=True, sharey=True, squeeze=False)
        axes[0, 0].set_xlim(0.0, end(traces))
        for (law, condition), trace in cells.items():
            ax = axes[laws.index(law), conditions.index(condition)]
            drawing.over_time(ax, Panel("u", group, [group_trace(trace, group)]), [colours[law]])
            drawing.mark(ax, style.jumps([trace], [law]), named=False)
            if room > points(250):
                drawing.note(ax, _variation(trace, group))
        drawing.scale_ticks(axes[0, 0].yaxis, control)  # which all share
        gains, shared = pages.gain_sources([[of_law[law].source] for law in laws])
        for law, source, ax in zip(laws, gains, axes[:, 0], strict=True):
            ax.set_ylabel(control.label.replace("control ", ""))
            words = style.cropped(f"{style.law_name(of_law[law])}{source}", 0.55 * room, points(11), bold=True)
            ax.set_title(words, color=colours[law], parse_math=False)
        for i, condition in enumerate(conditions):
            _name_condition(axes[0, i], condition, next(cells[key] for key in cells if key[1] == condition), room)
            axes[-1, i].set_xlabel("time (s)")
        axes[0, 0].set_ylim(drawing.limits(control.traces, "u"))
        if room > points(250):
            shared = "; ".join(filter(None, ["at the right: total variation per second over the last 20 %", shared]))
        title = title or f"{style.plant_name(traces[0].scenario.plant)}: control"
        pages.set_head(page, width, title, _line_key([control]), shared)
        pages.write(page, paths)
    return page


def _by_law_and_condition(traces: Sequence[Trace], conditions: Sequence[str]) -> dict[tuple[str, str], Trace]:
    """Return law, condition -> trace; refuse two traces of one law under one condition."""
    cells = {(trace.scenario.law.name, name): trace for trace, name in zip(traces, conditions, strict=True)}
    if len(cells) < len(traces):
        raise ScenarioError("two traces of one law under one condition: give each condition its own label")
    return cells


def _name_condition(ax: Axes, condition: str, trace: Trace, room: float) -> None:
    """Print a condition above the axes of its column, with the changes of a plant; `room` in points."""
    changes, size = style.jumps([trace], [condition]), style.points(13)
    words = ", ".join([condition, *(f"{change} at {time:g} s" for time, change in changes.items())])
    place = (0.5, 1.0), (0, style.points(22)), "axes fraction", "offset points"
    look = {"ha": "center", "fontsize": size, "parse_math": False}
    ax.annotate(style.cropped(words, 0.85 * room, size), *place, **look)


def _key(
    traces: Sequence[Trace], names: Sequence[str], colours: Sequence[str], shown: Sequence[Panel], rests: bool
) -> tuple[list[Handle], str]:
    """Return a legend's entries for the traces, the reference, and lines and bands; and where all gains come from."""
    handles, gains = pages.run_handles(traces, names, colours)
    if rests:
        diamond = {"marker": "D", "ms": style.points(5), "lw": 0, "color": style.MUTED, "mec": style.PAPER}
        handles.append(Line2D([], [], **diamond, label=f"held by friction for {MIN_STATE_TIME:g} s or longer"))
    if any(panel.quantity == "x" and np.isfinite(trace.r).any() for panel in shown for trace in panel.traces):
        look = {"color": style.INK, "lw": style.points(0.8), "ls": (0, (4, 4))}
        handles += [Line2D([], [], **look, label="reference"), Patch(color=style.BAND, label="reference ± 2 %")]
    return [*handles, *(_line_key(shown) if shown else [])], gains


def _line_key(shown: Sequence[Panel]) -> list[Handle]:
    """Return the entries of a legend that explain bands and lines."""
    looks = {
        "play": Patch(color=style.REACTION, alpha=drawing.PLAY),
        "band": Patch(color=style.MUTED, alpha=0.3),
        "line": Line2D([], [], color=style.MUTED, lw=style.points(drawing.LINE)),
        "thin lines": Line2D([], [], color=style.MUTED, lw=style.points(drawing.LIGHT_LINE)),
    }
    words = drawing.meaning(shown)
    for name, look in looks.items():
        look.set_label(f"{name}: {words.get(name)}")
    return [look for name, look in looks.items() if name in words]


def _variation(trace: Trace, group: Group) -> str:
    """Return the total variation of u per second in the last part of a run, or how the run failed."""
    if trace.diverged_at is not None:
        return style.ending(trace)
    rate = catalogue.tv_rate(trace)
    return f"{rate:,.{0 if rate >= 10 else 2}f} {style.units(group)['u']}/s"
