"""Figures: x, u and s of several runs over time with their phase portrait; only u under several
conditions.
"""

import os
from collections.abc import Mapping, Sequence
from typing import NamedTuple

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
from smc_mujoco.mechanisms.hardware.part import joint_names
from smc_mujoco.simulation.trace import Trace

TIME_PANELS = {  # panel -> quantity, from top to bottom
    "x": "x",
    "error": "e",
    "spread": "spread",
    "v": "v",
    "u": "u",
    "delivered": "force",
    "reaction": "reaction",
    "d": "d",
    "tip": "tip",
    "contact": "contact",
    "s": "s",
}
SIDE_PANELS = {"phase": 1.5, "settling": 1.0, "end": 1.0}  # panel -> its relative height
PANEL_NAMES = {name: name for name in (*TIME_PANELS, "channels", *SIDE_PANELS)}  # of panels
BLOCK_WIDTHS = (1.7, 1.4, 1.0)  # relative: of panels over time, of sparklines, and of those beside
ROW_HEIGHT = 1.5  # inches on a full page, height of a panel over time
OWN_SHARE = 0.625  # height of a figure of many joints, of its width: 1,100 px of 1,760
SPARK_ROW, SPARK_ENDS = (
    0.25,
    0.3,
)  # relative heights: of a row of sparklines, and of what is above and below all
SPARK_SIZE = 9.5  # points on a full page, of the letters beside a sparkline
SPARK_NAME = 0.4  # of the width of a block of sparklines, of a channel's name
MAX_SPARKS = 10  # rows of sparklines: of more channels, those with the largest errors
LINE_ROW, LINES_ROW = 0.32, 0.45  # relative height of a row with one line, and with several
ROW_FILLED, BELOW_NAME = (
    0.82,
    0.6,
)  # part of a row that its axes fill, with its name in them or above
SLIDE_PANELS = "x", "u", "settling", "channels"
SIGNALS_HEIGHT = 5.6  # inches, of a page of `signals`


class Runs(NamedTuple):
    """Runs of a figure; `changes` are marks by time, s; `span` is the time that panels show, and
    the whole time, s.
    """

    traces: Sequence[Trace]
    names: Sequence[str]
    colours: Sequence[str]
    changes: Mapping[float, str]
    span: tuple[float, float]


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
    """Draw traces of one plant: x, u and s over time, the phase portrait, |x - r|, and a close-up
    of the end of u.

    x, u and s are drawn until all comes to rest, |x - r| over the whole run on a logarithmic axis.
    Each run of a network has a row with a line for each channel, and there is the spread max x -
    min x. Of a robot with several joints e and u of the worst one are large, and each other one has
    sparklines beside its largest |e| and |u|. Joints without an actuator, and channels in another
    unit, have their own panels. Realistic mechanisms have panels of the actuator's force and of the
    reaction of friction and contacts, arms of their tip. The end of a failed run and the instant at
    which a plant changes are marked. Curves that agree from the start are drawn once, in ink, until
    they part. What lines and bands mean is also the figure's `get_label()` and in its files, for a
    caption.

    Args:
      traces: one or several traces.
      path: file to write; default: none. Without an ending, or with .svg or .png, an SVG and a PNG
        are written; with .pdf, a PDF.
      labels: one label per trace; default: the laws' labels, with the differences between runs of
        one law.
      title: default: the plant's label, and the condition if all traces have one.
      panels: names among "x", "error", "spread", "v", "u", "delivered", "reaction", "d", "tip",
        "contact", "s", "channels" (e and u of the worst channel, sparklines of the others),
        "phase", "settling" (|x - r|), "end" (close-up of u). Default: those that suit the plant and
        the size.
      size: "ieee-column" (3.5 in wide, without the key of lines and bands, which is for its
        caption), "ieee-page" (7.16 in), "slide" (13.3 x 7.5 in, three panels, large letters), or
        (width, height) in inches. Default: 8.8 in wide.
      format: "svg", "png" or "pdf", of the file.
      fig: Figure or SubFigure to draw into; default: a new one.

    Raises:
      ScenarioError: no traces, traces of several plants, an unknown panel, size or format, or a
        path that cannot be written.
    """
    paths = pages.files(path, format)
    width, height = pages.measure(size, fig)
    traces = style.same_plant(traces)
    names = style.labels(traces, labels)
    colours = style.law_colours([trace.scenario.law for trace in traces])
    traces = [finite(trace) for trace in traces]
    if panels is None:
        chosen = _default(traces, width)
        if "channels" in chosen and width >= pages.NARROW and height is None:
            height = OWN_SHARE * width
        chosen = [name for name in chosen if size != "slide" or name in SLIDE_PANELS] or chosen
    else:
        chosen = [find("panel", name, PANEL_NAMES) for name in items_of("panels", panels)]
    runs = Runs(
        traces, names, colours, style.marks(traces, names), (drawing.horizon(traces), end(traces))
    )
    with style.page(width):
        page = _composed_page(runs, chosen, (width, height), title, fig)
        pages.write(page, paths)
    return page


def signals(
    conditions: Mapping[str, Mapping[str, Trace]], path: str | os.PathLike[str] | None, title: str
) -> Figure | SubFigure:
    """Draw only u, a column for each condition: condition -> label -> Trace."""
    page = pages.blank(style.FULL_WIDTH, SIGNALS_HEIGHT)
    with style.page():
        page.suptitle(
            title, x=0.01, ha="left", size=pages.TITLE_SIZE, weight="bold", parse_math=False
        )
    columns = page.subfigures(1, len(conditions), squeeze=False)[0]
    for column, (condition, runs) in zip(columns, conditions.items(), strict=True):
        figure([*runs.values()], labels=[*runs], title=condition, panels=["u"], fig=column)
    pages.write(page, pages.files(path))
    return page


def _composed_page(
    runs: Runs,
    chosen: Sequence[str],
    size: tuple[float, float | None],
    title: str | None,
    fig: Figure | SubFigure | None,
) -> Figure | SubFigure:
    """Return a page with the chosen panels of traces."""
    (width, height), traces = size, runs.traces
    early = [drawing.until(trace, runs.span[0]) for trace in traces]
    shown = (quantity for name, quantity in TIME_PANELS.items() if name in chosen)
    overview = _by_joint(
        [panel for quantity in shown for panel in drawing.over_groups(early, quantity)]
    )
    if "channels" in chosen:
        errors = drawing.worst_first(early)
    else:
        errors = []
    worst, *others = _spark_rows(errors, early) or [[]]
    overview, sparks = [*worst, *overview], others[:MAX_SPARKS]
    sparks.sort(key=lambda row: row[0].channel or 0)
    groups = [Panel("x", *each) for each in style.split(traces).items()]
    places = _by_joint(groups)
    beside = []
    for name in chosen:
        if name in SIDE_PANELS:
            for _ in places if name == "phase" else "x":
                beside.append(name)
    handles, gains = pages.run_handles(runs.traces, runs.names, runs.colours)
    key = _key([*overview, *(panel for row in sparks for panel in row)])
    narrow = width < pages.NARROW
    handles += [] if narrow else key
    last = _height(groups[0]._replace(quantity="u"))
    blocks = (
        [*map(_height, overview)],
        [SPARK_ROW * len(sparks) + SPARK_ENDS] * bool(sparks),
        [last if n == "end" else SIDE_PANELS[n] for n in beside],
    )
    columns = [(0, 1, 2)] if narrow else [(0,), (1, 2)]  # of blocks
    parts = {column: sum(sum(blocks[k]) for k in column) for column in columns}
    if not any(parts.values()):
        raise ScenarioError(
            f"panels is {list(chosen)}: give a panel that the plant has, or leave panels out"
        )
    rows = max(*parts.values(), 0.0 if narrow else 4.0 if beside else 1.0)
    space = pages.head_height(width, handles)
    tall = height or max(
        0.5625 * width * (not narrow), space + style.points(ROW_HEIGHT) * rows + 0.5
    )
    page = pages.blank(width, tall, fig)
    pitch = 72 * (page.bbox.height / page.dpi - space - 0.4) / max(parts[columns[0]], 1.0)
    cells = _cells(page, [column for column in columns if parts[column]], blocks)
    words = drawing.titles(overview, [pitch * part for part in blocks[0]])
    _draw_over_time(page, cells[0], list(zip(overview, words, strict=True)), runs)
    if sparks:
        _draw_sparks(page, cells[1][0], sparks, runs, len(others))
    _draw_beside(page, cells[2], beside, (groups[0], *places), runs)
    pages.set_head(
        page, width, title or style.head([trace.scenario for trace in traces]), handles, gains
    )
    page.set_label("; ".join(str(one.get_label()) for one in key))
    pages.space_ticks(page)
    return page


def _cells(
    page: Figure | SubFigure, columns: Sequence[Sequence[int]], blocks: Sequence[Sequence[float]]
) -> list[list[SubplotSpec]]:
    """Return the cells of each block of panels, of these relative heights, in columns that have one
    block or more.
    """
    widths = [max(BLOCK_WIDTHS[k] for k in column if blocks[k]) for column in columns]
    grid = page.add_gridspec(1, len(columns), width_ratios=widths)
    cells: list[list[SubplotSpec]] = [[] for _ in blocks]
    for i, column in enumerate(columns):
        heights = [height for k in column for height in blocks[k]]
        rows = grid[i].subgridspec(len(heights), 1, height_ratios=heights)
        owners = [k for k in column for _ in blocks[k]]
        for row, k in enumerate(owners):
            cells[k].append(rows[row])
    return cells


def _height(panel: Panel) -> float:
    """Return the relative height of a panel over time."""
    if not drawing.crowded(panel):
        return 1.0
    return max(1.0, (LINE_ROW if len(panel.group.channels) == 1 else LINES_ROW) * len(panel.traces))


def _default(traces: Sequence[Trace], width: float) -> list[str]:
    """Return the names of the panels that suit the plant and the page."""
    several = any(len(group.channels) > 1 for group in style.split(traces))
    if several and traces[0].scenario.plant.direct:
        return ["channels", "tip", "contact", "settling"]
    names = ["x", "spread", "u", "delivered", "reaction"]
    if several:
        return [*names, "settling"]
    names += ["s"] * any(np.nan_to_num(trace.s).any() for trace in traces)
    if width < pages.NARROW:
        return [*names, "settling"]
    return [*names, *SIDE_PANELS]


def _by_joint(panels: Sequence[Panel]) -> list[Panel]:
    """Return the panels, with one for each joint of a robot, because joints have nothing in
    common.
    """
    direct = any(panel.traces[0].scenario.plant.direct for panel in panels)
    return [part for panel in panels for part in (drawing.by_channel(panel) if direct else [panel])]


def _draw_over_time(
    page, cells: Sequence[SubplotSpec], overview: Sequence[tuple[Panel, str]], runs: Runs
) -> None:
    """Draw panels over time with their labels in the cells of a column.

    Changes are told above the first.
    """
    frames: list[Axes] = []
    axes: list[Axes] = []
    for cell, (panel, words) in zip(cells, overview, strict=True):
        frame, rows = _rows(page, cell, panel, runs, axes[0] if axes else None)
        frame.set_ylabel(words)
        frames.append(frame)
        for ax, part, colours in rows:
            axes.append(ax)
            ax.set_xlim(0.0, runs.span[0])
            drawing.over_time(ax, part, colours, among=panel.traces, names=runs.names)
            drawing.mark(ax, runs.changes, named=ax is axes[0])
            ax.tick_params(labelbottom=False)
        _equal_ranges(frame, rows)
    if axes:
        shown, whole = runs.span
        axes[-1].tick_params(labelbottom=True)
        axes[-1].set_xlabel(
            "time (s)" if shown == whole else f"time (s), the first {shown:.2g} s of {whole:g} s"
        )
    page.align_ylabels(frames)


def _rows(
    page,
    cell: SubplotSpec,
    panel: Panel,
    runs: Runs,
    share: Axes | None = None,
    above: bool = False,
) -> tuple[Axes, list[tuple[Axes, Panel, Sequence[str]]]]:
    """Return the axes that have the label of a panel, and its rows: axes, the panel they show, and
    its colours.

    A crowded panel has a row for each trace, with the trace's name in it, or `above`. Others have
    one row.
    """
    if not drawing.crowded(panel):
        ax = page.add_subplot(cell, sharex=share)
        return ax, [(ax, panel, runs.colours)]
    frame = page.add_subplot(cell, frameon=False, xticks=[])
    pitch = 1.0 / len(panel.traces)
    size = style.points(8.5)
    rows = []
    filled = BELOW_NAME if above else ROW_FILLED
    for i, (trace, name, colour) in enumerate(
        zip(panel.traces, runs.names, runs.colours, strict=True)
    ):
        ax = frame.inset_axes((0.0, 1.0 - (i + 1) * pitch, 1.0, filled * pitch), sharex=share)
        room = 72 * cell.get_position(page).width * page.bbox.width / page.dpi - 4.0 * size
        look = {
            "fontsize": size,
            "frameon": not above,
            "framealpha": 0.75,
            "edgecolor": "none",
            "borderaxespad": 0.2,
        }
        if above:
            look |= {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0)}
        else:
            look |= {"loc": "upper right"}
        key = ax.legend(
            [Line2D([], [], color=colour, lw=style.points(3))],
            ["."],
            handlelength=1.0,
            borderpad=0.0,
            **look,
        )
        key.get_texts()[0].set_text(style.cropped(name, room, size))
        key.get_texts()[0].set_parse_math(False)
        key.set_in_layout(False)
        rows.append((ax, panel._replace(traces=[trace]), [colour]))
        share = ax
    return frame, rows


def _equal_ranges(frame: Axes, rows: Sequence[tuple[Axes, Panel, Sequence[str]]]) -> None:
    """Give several rows of a panel the range of the runs that last, and ticks near its ends: of u,
    at its bounds.
    """
    if len(rows) == 1:
        return
    lasting = [ax for ax, part, _ in rows if part.traces[0].diverged_at is None]
    ranges = [ax.get_ylim() for ax in lasting or [ax for ax, *_ in rows]]
    low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
    places = []
    for tick in np.asarray(MaxNLocator(3).tick_values(low, high)).tolist():
        if low <= tick <= high:
            places.append(tick)
    bound = max(max(part.traces[0].scenario.limits) for _, part, _ in rows)
    if rows[0][1].quantity == "u" and low <= -bound and bound <= high:
        places = [-bound, bound]
    for ax in (frame, *(ax for ax, *_ in rows)):
        ax.set(ylim=(low, high), yticks=[places[0], places[-1]])
    for ax, *_ in rows[:-1]:
        ax.tick_params(labelbottom=False, length=0)
    frame.tick_params(
        labelcolor="none", length=0
    )  # invisible numbers, which keep its label beside those of the rows


def _spark_rows(errors: Sequence[Panel], traces: Sequence[Trace]) -> list[list[Panel]]:
    """Return the panels of each channel: its error, and its u if it is driven; on a free body that
    of an actuator.
    """
    plant = traces[0].scenario.plant
    if not plant.pose:
        return [[error, *[error._replace(quantity="u")] * error.group.driven] for error in errors]
    places = (plant.scored_channels.index(error.channel or 0) for error in errors)
    if errors:
        of_actuators = drawing.actuators(traces)
    else:
        of_actuators = []
    return [[error, *of_actuators[k : k + 1]] for error, k in zip(errors, places, strict=True)]


def _draw_sparks(
    page, cell: SubplotSpec, sparks: Sequence[Sequence[Panel]], runs: Runs, channels: int
) -> None:
    """Draw a row of sparklines for each of the worst of so many channels, with the largest
    magnitude beside each.
    """
    rows = cell.subgridspec(len(sparks), 2)
    size = style.points(SPARK_SIZE)
    frames = []
    room = SPARK_NAME * 72 * cell.get_position(page).width * page.bbox.width / page.dpi
    for i, row in enumerate(sparks):
        for k, panel in enumerate(row):
            ax, (factor, unit) = page.add_subplot(rows[i, k]), panel.scale
            beside = {"fontsize": size, "va": "center", "parse_math": False}
            drawing.over_time(ax, panel, runs.colours, reported=False)
            ax.set(xlim=(0.0, runs.span[0]), yticks=[], frame_on=False)
            ax.set_xticks(
                [0.0, runs.span[0]],
                ["0", f"{runs.span[0]:.2g} s"] if i == len(sparks) - 1 else ["", ""],
            )
            ax.tick_params(length=0)
            if k == 0:
                name = style.cropped(panel.label.removesuffix(f" e{unit}"), room, size)
            else:
                name = ""
            of_actuator = (
                panel.traces[0].scenario.plant.pose
                and panel.quantity == "u"
                and panel.group.unit == "m"
            )
            if of_actuator:
                letter = f"u {panel.group.channels[0] + 1}"
            else:
                letter = panel.quantity
            ax.set_ylabel(f"{name} {letter}".strip(), rotation=0, ha="right", **beside)
            largest = factor * max(map(abs, drawing.span(panel.traces, panel.quantity)))
            words = f"{style.short(largest, 3)} {unit.strip(' ()')}"
            ax.text(1.03, 0.5, words, transform=ax.transAxes, **beside)
            frames += [ax] * (k == 0)
            if i == 0:
                above = {
                    "xytext": (0.0, 0.75 * size),
                    "textcoords": "offset points",
                    "va": "bottom",
                }
                ax.annotate(
                    "largest",
                    (1.03, 0.5),
                    xycoords="axes fraction",
                    fontsize=size,
                    color=style.MUTED,
                    **above,
                )
    if len(sparks) < channels:
        frames[-1].set_xlabel(
            f"the worst {len(sparks)} of {channels} other channels", fontsize=size, loc="left"
        )
    page.align_ylabels(frames)


def _draw_beside(
    page, cells: Sequence[SubplotSpec], column: Sequence[str], places: Sequence[Panel], runs: Runs
) -> None:
    """Draw phase portraits and close-ups in the cells of a column; `places`: the first group, then
    the portraits.
    """
    portraits = iter(places[1:])
    for cell, name in zip(cells, column, strict=True):
        if name == "end":
            panel = places[0]._replace(quantity="u")
            frame, rows = _rows(page, cell, panel, runs, above=True)
            for ax, part, colours in rows:
                drawing.last_samples(ax, part, colours, panel.traces, runs.names)
            _equal_ranges(frame, rows)
            plant = panel.traces[0].scenario.plant
            if plant.driven > 1 or plant.direct:
                letter = f"{joint_names(plant)[0]} u"
            else:
                letter = "control u"
            frame.set_ylabel(letter + panel.scale[1])
            rows[-1][0].set_xlabel("time before the end (ms)")
            continue
        ax = page.add_subplot(cell)
        if name == "phase":
            panel = next(portraits)
            drawing.phase(ax, panel, runs.colours)
        else:
            panel = places[0]._replace(quantity="settling")
            drawing.over_time(ax, panel, runs.colours, names=runs.names)
            words = f"time (s)\nthe largest in {1e3 * drawing.peak_window(panel.traces):.3g} ms"
            ax.set(xlabel=words, ylabel=panel.label, xlim=(0.0, runs.span[1]))


def _key(shown: Sequence[Panel]) -> list[Handle]:
    """Return a legend's entries for the reference, and for lines and bands."""
    handles: list[Handle] = []
    if any(
        panel.quantity in ("x", "e") and np.isfinite(trace.r).any()
        for panel in shown
        for trace in panel.traces
    ):
        look = {"color": style.INK, "lw": style.points(0.8), "ls": (0, (4, 4))}
        handles += [Line2D([], [], **look, label="dashes: reference")]
        handles += [Patch(color=style.BAND, label="grey: reference ± 2 %")]
    looks = {
        "band": Patch(color=style.MUTED, alpha=0.3),
        "line": Line2D([], [], color=style.MUTED, lw=style.points(drawing.LINE)),
        "thin lines": Line2D([], [], color=style.MUTED, lw=style.points(drawing.LIGHT_LINE)),
    }
    words = drawing.meaning(shown)
    for name, look in looks.items():
        look.set_label(f"{name}: {words.get(name)}")
    return [*handles, *(look for name, look in looks.items() if name in words)]
