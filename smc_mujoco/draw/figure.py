"""Figures: x, u and s of several runs over time with their phase portrait."""

import operator
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.gridspec import SubplotSpec
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from smc_mujoco.common.aliases import AnyPath, Pair
from smc_mujoco.common.errors import ScenarioError, find, items_of
from smc_mujoco.control.source import by_words
from smc_mujoco.draw import (
    colouring,
    dark,
    horizon,
    lanes,
    lettering,
    quantities,
    shared_axes,
    style,
    timed_events,
    wording,
)
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import panels as drawing
from smc_mujoco.draw.decimate import end, finite, window
from smc_mujoco.draw.page import Handle, Size
from smc_mujoco.draw.panels import Panel
from smc_mujoco.draw.quantities import span
from smc_mujoco.mechanisms.layout import channel_names
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
PANEL_NAMES = {name: name for name in (*TIME_PANELS, "channels", *SIDE_PANELS)}
BLOCK_WIDTHS = (1.4, 1.0, 1.0)  # relative: of panels over time, of single controls, of those beside
ROW_HEIGHT = 1.5  # inches on a full page, height of a panel over time
MAX_WORST = 3  # channels of a robot that are drawn, those with the largest errors
LINE_ROW, LINES_ROW = 0.37, 0.45  # relative height of a row with one line, and with several
REFERENCE_WORDS = "thin dashes: reference"
GREY_WORDS = "grey: settling band"
END_TIME = "time before the end (ms)"
NOTES = {  # above panels of a column, which has no key
    "target": f"{REFERENCE_WORDS}; {GREY_WORDS}",
    "chattering": "band: range; line: mean where it chatters",
}
SLIDE_PANELS = "x", "u", "settling", "channels"


class DrawnRuns(NamedTuple):
    """Runs of a figure or a film, with their names and colours; `events` are what happens to
    their plants; `span` is the time that panels show, and the whole time, s.
    """

    traces: Sequence[Trace]
    names: Sequence[str]
    entries: Sequence[str]  # these; default names with the sources of gains where those differ
    colours: Sequence[str]
    head: str  # what they are of
    gains: str  # where these come from
    events: Sequence[timed_events.Event]
    marks: Mapping[float, str]  # what happens by its time, s
    span: Pair

    @classmethod
    def of(cls, traces: Trace | Sequence[Trace], labels: Sequence[str] | None) -> "DrawnRuns":
        """Return traces of one plant, up to where they are finite, as they are drawn."""
        traces = shared_axes.traces_of_one_plant(traces)
        names = wording.run_names(traces, labels)
        scenarios = [trace.scenario for trace in traces]
        sources = [scenario.law.source for scenario in scenarios]
        entries = names
        if labels is None:
            behind, _ = pages.gain_sources([[source] for source in sources])
            entries = list(map(operator.add, names, behind))
        words = [source.words for source in sources]
        finite_traces = list(map(finite, traces))
        events = timed_events.events(traces, names)
        return cls(
            finite_traces,
            names,
            entries,
            colouring.trace_colours(traces),
            wording.head(scenarios),
            by_words(dict(zip(wording.numbered(names), words, strict=True))),
            events,
            timed_events.marks(events),
            (horizon.horizon(finite_traces), end(finite_traces)),
        )

    @property
    def early(self) -> list[Trace]:
        """The traces over the time that panels show, and as far beyond it as means reach."""
        early_traces = []
        for trace in self.traces:
            beyond = 0.5 * window(trace) * trace.scenario.control_period
            early_traces.append(horizon.until(trace, self.span[0] + beyond))
        return early_traces


def figure(
    traces: Trace | Sequence[Trace],
    path: AnyPath | None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    panels: Sequence[str] | None = None,
    size: Size = None,
    format: str | None = None,
    fig: Figure | SubFigure | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Draw traces of one plant: x, u, s and a disturbance over time, the phase portrait (of the
    error where the reference moves), |x - r|, and a close-up of the end of u.

        trace = smc.run(smc.Scenario(plant="duffing", law="pid", duration=1.0))
        smc.figure(trace, "duffing.svg")

    x, u and s are drawn until a little after x has settled and moves by less than 2 % of its panel,
    |x - r| over the whole run on a logarithmic axis. Each run of a network has a row with a line
    for each channel, and there is the spread max x - min x. Several runs of a free body have such
    rows of u. Of several joints there are e and u of those with the largest errors. Joints without
    an actuator, and channels in another unit, have their own panels. Realistic mechanisms have
    panels of the actuator's force and of the reaction of friction and contacts, arms of their tip.
    The end of a failed run and the instant at which a plant changes are marked. Words say which
    curves agree, and so hide each other. The figure's `get_label()` and its files say what lines
    mean.

    Args:
      traces: one or several traces.
      path: file to write; default: none. Without an ending, or with .svg or .png, an SVG and a PNG
        are written; with .pdf, a PDF.
      labels: one per trace, drawn as given; default: the laws' labels, with what differs between
        runs of one law, and the sources of gains where these differ. With your labels these stand
        beside the title, or in the key where there is no room.
      title: None for the plant's label, and the condition if all traces have one; "" for no title,
        as in a journal, and the panels take its place. What stands beside the title then goes to
        the key.
      panels: names among "x", "error", "spread", "v", "u", "delivered", "reaction", "d", "tip",
        "contact", "s", "channels" (e and u of the channels with the largest errors, three at most),
        "phase", "settling" (|x - r|), "end" (close-up of u). Default: those that suit the plant and
        the size.
      size: "ieee-column" (252 pt wide; what lines and bands mean stands above x and u, and not in
        the key; it does not stand there where a change is named, or in a figure as high as a
        column), "ieee-page" (516 pt), "slide" (13.3 x 7.5 in, three panels, large letters), or
        (width, height) in inches. Default: 8.8 in wide.
      format: "svg", "png" or "pdf", of the file.
      fig: Figure or SubFigure to draw into; default: a new one.
      ax: axes to draw one panel into, by default "x", in your own style; `ax.legend()` then names
        the runs.

    Returns:
      The whole figure; of a SubFigure or of axes, the one that they are part of.

    Raises:
      ScenarioError: no traces, several plants, an unknown panel, size or format, or a bad path.
    """
    paths = pages.files(path, format)
    if ax is not None:
        quantity = pages.given_axes(ax, size, fig, panels)
        _draw_alone(ax, DrawnRuns.of(traces, labels), quantity, title)
        return pages.save(ax.figure, paths)
    width, height = pages.measure(size, fig)
    runs = DrawnRuns.of(traces, labels)
    chosen = _chosen(runs.traces, panels, size, width)
    with style.page(width):
        page = _composed_page(runs, chosen, (width, height), title, fig)
        return pages.write_page(page, paths)


def _chosen(
    traces: Sequence[Trace], panels: Sequence[str] | None, size: Size, width: float
) -> list[str]:
    """Return the names of the panels to draw: those asked for, or the usual ones of these runs."""
    if panels is not None:
        return [find("panel", name, PANEL_NAMES) for name in items_of("panels", panels)]
    chosen = []
    for name in _default(traces, width):
        if name == "phase" and traces[0].scenario.tracks == "speed":  # x is x': no portrait
            continue
        if size != "slide" or name in SLIDE_PANELS:
            chosen.append(name)
    return chosen


def _composed_page(
    runs: DrawnRuns,
    chosen: Sequence[str],
    size: tuple[float, float | None],
    title: str | None,
    fig: Figure | SubFigure | None,
) -> Figure | SubFigure:
    """Return a page with the chosen panels of traces: over time at the left; at the right the
    controls of single channels, and what is not over the same time.
    """
    width, height = size
    blocks = _blocks(runs, chosen)
    head = wording.titled(title, runs.head)
    handles = pages.run_handles(runs.traces, runs.entries, runs.colours)
    key = _key([*blocks.left_panels, *blocks.right], runs.events)
    if blocks.left_out:
        entry = pages.entry(blocks.left_out, lw=0)
        key.append(entry)
    gains = runs.gains if runs.entries == runs.names else ""
    fits = lettering.width(gains, style.points(pages.TEXT_SIZE)) <= pages.note_room(width)
    if gains and not (head and fits):  # there is no place beside a title
        key.append(pages.entry(runs.gains, lw=0))
        gains = ""
    narrow = width < pages.NARROW
    if not narrow:
        handles += key
    columns = _columns(blocks, narrow)
    if not columns:
        raise ScenarioError(
            f"panels is {list(chosen)}: give a panel that the plant has, or leave panels out"
        )
    least = 0.0
    if not narrow:
        least = 4.0 if blocks.beside else 1.0
    space = pages.head_height(width, handles, bool(head))
    rows = max(*columns.values(), least)
    heights = blocks.heights
    rows_of_all = sum(map(len, heights))
    tall = height or _usual_height(width, space, rows, rows_of_all)
    noted = narrow and tall < pages.MAX_HEIGHT  # a full column has no room
    page = pages.blank(width, tall, fig)
    inches = page.bbox.height / page.dpi
    free = 72 * (inches - space - 0.4)  # points
    cells = _cells(page, list(columns), heights)
    for k, panels in ((0, blocks.left_panels), (1, blocks.right)):
        rows = _height_of(columns, k)
        pitch = free / max(1.0, rows)
        room = (pitch * np.array(heights[k])).tolist()
        words = drawing.titles(panels, room)
        titled = list(zip(panels, words, strict=True))
        _draw_over_time(page, cells[k], titled, runs, k == 0, noted)
    _draw_beside(page, cells[2], blocks.beside, blocks.places, runs)
    pages.set_head(page, width, head, handles, gains)
    meaning = "; ".join(str(entry_of_key.get_label()) for entry_of_key in key)
    page.set_label(meaning)
    pages.space_ticks(page)
    return page


class Blocks(NamedTuple):
    """The panels of a page in its three blocks."""

    left_panels: list[Panel]  # over time
    right: list[Panel]  # over time, the controls of single channels
    beside: list[str]  # names of SIDE_PANELS, what is not over the same time
    places: list[Panel]  # of these: the first group, then the portraits
    left_out: str  # channels that have no panel, in words

    @property
    def heights(self) -> tuple[list[float], list[float], list[float]]:
        """The relative heights of the panels of each block."""
        beside = []
        for name in self.beside:
            high = SIDE_PANELS[name]
            if name == "end":
                controls = self.places[0]._replace(quantity="u")
                if lanes.end_in_lanes(controls):
                    high = max(high, LINE_ROW * len(controls.traces))
            beside.append(high)
        left_heights = list(map(_height, self.left_panels))
        right = list(map(_height, self.right))
        return left_heights, right, beside


def _height_of(columns: Mapping[tuple[int, ...], float], block: int) -> float:
    """Return the height of the column that has a block, in rows."""
    for blocks, high in columns.items():
        if block in blocks:
            return high
    return 1.0


def _blocks(runs: DrawnRuns, chosen: Sequence[str]) -> Blocks:
    """Return the chosen panels of traces."""
    early = runs.early
    left_panels: list[Panel] = []
    right: list[Panel] = []
    left_out = ""
    if "channels" in chosen:
        worst = drawing.worst_first(early)
        if len(worst) <= MAX_WORST:  # all have a place, as in the model
            worst.sort(key=lambda panel: panel.group.channels)
        left_panels += worst[:MAX_WORST]
        right += _controls(left_panels, early)
        if right and len(worst) > MAX_WORST:
            left_out = f"the {MAX_WORST} worst of {len(worst)} channels"
    for name, quantity in TIME_PANELS.items():
        if name in chosen:
            panels = drawing.over_groups(early, quantity)
            left_panels += panels if name == "d" else _by_joint(panels)
    groups = drawing.of_groups(runs.traces, "x")
    portraits = _by_joint(groups)
    beside = []
    for name in chosen:
        if name in SIDE_PANELS:
            count = len(portraits) if name == "phase" else 1
            beside += [name] * count
    return Blocks(left_panels, right, beside, [groups[0], *portraits], left_out)


def _columns(blocks: Blocks, narrow: bool) -> dict[tuple[int, ...], float]:
    """Return a page's columns, the numbers of their blocks, with their relative heights; those that
    have panels.
    """
    sums = list(map(sum, blocks.heights))
    if narrow:
        columns = {(0, 1, 2): sum(sums)}
    else:
        columns = {(0,): sums[0], (1, 2): sums[1] + sums[2]}
    filled = {}
    for column, high in columns.items():
        if high:
            filled[column] = high
    return filled


def _usual_height(width: float, space: float, rows: float, panels: int) -> float:
    """Return the height of a page of a width, inches, with so much space above its rows: a column
    is no higher than a journal's unless its panels need it.
    """
    row = style.points(ROW_HEIGHT)
    tall = space + row * rows + 0.5
    if width < pages.NARROW:
        needed = space + row * panels + 0.5
        return min(tall, max(pages.MAX_HEIGHT, needed))
    return max(0.5625 * width, tall)


def _controls(errors: Sequence[Panel], traces: Sequence[Trace]) -> list[Panel]:
    """Return the panels of u of the channels of these errors; of a free body, of its actuators, of
    several runs all in one.
    """
    if traces[0].scenario.plant.pose:
        panels = drawing.actuators(traces)
        many_panels = len(traces) > 1 and len(panels) > 1
        return drawing.together(panels) if many_panels else panels
    controls = []
    for error in errors:
        if error.group.driven:
            controls.append(error._replace(quantity="u"))
    return controls


def _cells(
    page: Figure | SubFigure, columns: Sequence[Sequence[int]], blocks: Sequence[Sequence[float]]
) -> dict[int, list[SubplotSpec]]:
    """Return the cells of each block of panels, of these relative heights, in columns that have one
    block or more.
    """
    widths = [BLOCK_WIDTHS[column[0]] for column in columns]
    grid = page.add_gridspec(1, len(columns), width_ratios=widths)
    cells: dict[int, list[SubplotSpec]] = {0: [], 1: [], 2: []}
    for i, column in enumerate(columns):
        heights = []
        owners = []
        for k in column:
            heights += blocks[k]
            owners += [k] * len(blocks[k])
        rows = grid[i].subgridspec(len(heights), 1, height_ratios=heights)
        for row, k in enumerate(owners):
            cells[k].append(rows[row])
    return cells


def _height(panel: Panel) -> float:
    """Return the relative height of a panel over time."""
    if drawing.is_shared(panel) or not lanes.crowded(panel):
        return 1.0
    row = LINE_ROW if len(panel.group.channels) == 1 else LINES_ROW
    return max(1.0, row * len(panel.traces))


def _default(traces: Sequence[Trace], width: float) -> list[str]:
    """Return the names of the panels that suit the plant and the page."""
    parts = shared_axes.split(traces)
    many_channels = any(len(group.channels) > 1 for group in parts)
    disturbed = any(np.nan_to_num(trace.d).any() for trace in traces)
    names = ["d"] if disturbed else []
    if many_channels and traces[0].scenario.plant.direct:
        return [*names, "channels", "tip", "contact", "settling"]
    names += ["x", "spread", "u", "delivered", "reaction"]
    if many_channels:
        return [*names, "settling"]
    s = np.concatenate([trace.s for trace in traces])
    if np.nan_to_num(s).any():
        names.append("s")
    if width < pages.NARROW:
        return [*names, "settling"]
    return [*names, *SIDE_PANELS]


def _by_joint(panels: Sequence[Panel]) -> list[Panel]:
    """Return the panels, with one for each joint of a robot, because joints have nothing in
    common.
    """
    parts = []
    for panel in panels:
        direct = panel.traces[0].scenario.plant.direct
        parts += drawing.by_channel(panel) if direct else [panel]
    return parts


def _draw_over_time(
    page,
    cells: Sequence[SubplotSpec],
    overview: Sequence[tuple[Panel, str]],
    runs: DrawnRuns,
    named: bool,
    noted: bool,
) -> None:
    """Draw panels over time with their labels in the cells of a column.

    If `named`, changes are named above the first. If `noted`, notes tell the lines and the grey of
    the first x or error, and of the first u that chatters, unless changes are named there.
    """
    notes = dict(NOTES) if noted else {}
    frames: list[Axes] = []
    axes: list[Axes] = []
    for cell, (panel, words) in zip(cells, overview, strict=True):
        above = axes[0] if axes else None
        frame, rows = _rows(page, cell, panel, runs, above)
        frame.set_ylabel(words)
        if (axes or not runs.marks) and (note := notes.pop(_noted(panel), "")):
            drawing.note(frame, note)
        frames.append(frame)
        for ax, part, colours in rows:
            axes.append(ax)
            ax.set_xlim(0.0, runs.span[0])
            drawing.over_time(ax, part, colours, among=panel.traces, names=runs.names)
            drawing.mark(ax, runs.marks, named=named and ax is axes[0])
            ax.tick_params(labelbottom=False)
        _equal_ranges(frame, rows)
    if axes:
        axes[-1].tick_params(labelbottom=True)
        axes[-1].set_xlabel(_time_words(runs))
    page.align_ylabels(frames)


def _noted(panel: Panel) -> str:
    """Return which of the NOTES a panel needs, or ""."""
    if drawing.aims(panel):
        return "target"
    if panel.quantity == "u" and drawing.mean_window(panel.traces):
        return "chattering"
    return ""


def _draw_alone(ax: Axes, runs: DrawnRuns, wanted: str, title: str | None) -> None:
    """Draw one panel into a caller's axes, which keep their look."""
    name = find("panel", wanted, PANEL_NAMES)
    head = wording.titled(title, "")
    before = set(ax.findobj())
    blocks = _blocks(runs, [name])
    if blocks.beside:
        places = blocks.places[1:] if name == "phase" else blocks.places[:1]
    else:
        places = blocks.left_panels
    if len(places) != 1 or len(blocks.beside) > 1:
        plant = runs.traces[0].scenario.plant.name
        count = len(blocks.beside or places) or "none"
        raise ScenarioError(
            f"{plant} has {count} of the panel {name!r}, and one ax: choose another, or give fig"
        )
    if blocks.beside:
        _draw_side(ax, name, places[0], runs)
    else:
        words = _time_words(runs)
        ax.set(xlim=(0.0, runs.span[0]), xlabel=words, ylabel=places[0].label)
        drawing.over_time(ax, places[0], runs.colours, names=runs.names)
        drawing.mark(ax, runs.marks, named=not head)
    if head:
        ax.set_title(head)
    handles = pages.run_handles(runs.traces, runs.entries, runs.colours)
    for handle in handles:
        ax.add_artist(handle)
    dark.suit_page(set(ax.findobj()) - before)


def _time_words(runs: DrawnRuns) -> str:
    """Return the label of the time axis of panels that may end before the runs do."""
    drawn_time, duration = runs.span
    if drawn_time < duration:
        return f"time (s), the first {drawn_time:.2g} s of {duration:g} s"
    return "time (s)"


def _rows(
    page,
    cell: SubplotSpec,
    panel: Panel,
    runs: DrawnRuns,
    share: Axes | None = None,
) -> tuple[Axes, list[lanes.Row]]:
    """Return the axes that have the label of a panel, and its rows.

    A crowded panel has a row for each trace, with the trace's name in it. Others have one row.
    """
    if drawing.is_shared(panel):
        ax = page.add_subplot(cell, sharex=share)
        drawing.note(ax, "the same in all runs")
        shared = panel._replace(traces=panel.traces[:1])
        return ax, [lanes.Row(ax, shared, [style.DISTURBANCE])]
    if not lanes.crowded(panel):
        ax = page.add_subplot(cell, sharex=share)
        return ax, [lanes.Row(ax, panel, runs.colours)]
    frame = page.add_subplot(cell, frameon=False, xticks=[])
    size = style.points(8.5)
    wide = 72 * cell.get_position(page).width * page.bbox.width / page.dpi
    room = wide - 4.0 * size
    look = {"fontsize": size, "edgecolor": "none", "borderaxespad": 0.2, "borderpad": 0.0}
    look |= {"loc": "upper right", "frameon": True, "framealpha": 0.75}
    rows = lanes.run_lanes(frame, panel, runs.colours, share=share)
    for row, name in zip(rows, runs.names, strict=True):
        sample = pages.entry(".", row.colours[0])
        key = row.axes.legend(handles=[sample], handlelength=1.0, **look)
        words = lettering.cropped(name, room, size)
        key.get_texts()[0].set_text(words)
        key.get_texts()[0].set_parse_math(False)
        key.set_in_layout(False)
    return frame, rows


def _equal_ranges(frame: Axes, rows: Sequence[lanes.Row]) -> None:
    """Give several rows of a panel the range of the runs that last, and ticks near its ends: of u,
    at its bounds.
    """
    if len(rows) == 1:
        return
    ranges = []
    lasting = []
    bound = 0.0
    for ax, part, _ in rows:
        trace = part.traces[0]
        bound = max(bound, *trace.scenario.limits)
        ranges.append(ax.get_ylim())
        if trace.diverged_at is None:
            lasting.append(ax.get_ylim())
    low, high = np.array(lasting or ranges).T
    low = low.min()
    high = high.max()
    if rows[0][1].quantity == "u" and low <= -bound and bound <= high:
        ticks = [-bound, bound]
    else:
        places = MaxNLocator(3).tick_values(low, high)
        visible = (places >= low) & (places <= high)
        seen = places[visible]
        ticks = seen[[0, -1]]
    frame.set(ylim=(low, high), yticks=ticks)
    for ax, *_ in rows:
        ax.set(ylim=(low, high), yticks=ticks)
    for ax, *_ in rows[:-1]:
        ax.tick_params(labelbottom=False, length=0)
    frame.tick_params(
        labelcolor="none", length=0
    )  # invisible numbers, which keep its label beside those of the rows


def _draw_beside(
    page,
    cells: Sequence[SubplotSpec],
    column: Sequence[str],
    places: Sequence[Panel],
    runs: DrawnRuns,
) -> None:
    """Draw phase portraits and close-ups in the cells of a column; `places`: the first group, then
    the portraits.
    """
    portraits = iter(places[1:])
    for cell, name in zip(cells, column, strict=True):
        place = next(portraits) if name == "phase" else places[0]
        controls = place._replace(quantity="u")
        if name == "end" and lanes.end_in_lanes(controls):
            _draw_ends(page, cell, controls, runs)
        else:
            _draw_side(page.add_subplot(cell), name, place, runs)


def _draw_ends(page: Figure | SubFigure, cell: SubplotSpec, panel: Panel, runs: DrawnRuns) -> None:
    """Draw a close-up of the end of u in a cell, each run in its row."""
    frame = page.add_subplot(cell, frameon=False, xticks=[])
    rows = lanes.run_lanes(frame, panel, runs.colours)
    largest = max(map(abs, span(panel.traces, "u")))
    for ax, part, colours in rows:
        drawing.last_samples(ax, part, colours, largest)
    _equal_ranges(frame, rows)
    frame.set_ylabel(_end_words(panel))
    rows[-1].axes.set_xlabel(f"{END_TIME}\nrows as in the key")


def _end_words(panel: Panel) -> str:
    """Return the label of a close-up of the end of u."""
    plant = panel.traces[0].scenario.plant
    letter = "control u"
    if plant.driven > 1 or plant.direct:
        letter = f"{channel_names(plant)[0]} u"
    return lettering.folded(letter + panel.scale[1])


def _draw_side(ax: Axes, name: str, place: Panel, runs: DrawnRuns) -> None:
    """Draw a panel that is not over the time of others, for the group of channels of `place`."""
    if name == "end":
        panel = place._replace(quantity="u")
        drawing.last_samples(ax, panel, runs.colours)
        ax.set(xlabel=END_TIME, ylabel=_end_words(panel))
    elif name == "phase":
        drawing.phase(ax, place, runs.colours)
    else:
        panel = place._replace(quantity="settling")
        drawing.over_time(ax, panel, runs.colours, names=runs.names)
        width = 1e3 * quantities.peak_window(panel.traces)
        words = f"time (s)\nlargest over the preceding {width:.3g} ms"
        least = min(quantities.QUANTITIES["settling"](trace).min() for trace in panel.traces)
        if least <= quantities.MIN_ERROR:
            words += ",\nat least $10^{-9}$"
        ax.set(xlabel=words, ylabel=panel.label, xlim=(0.0, runs.span[1]))


def _key(shown: Sequence[Panel], events: Sequence[timed_events.Event]) -> list[Handle]:
    """Return a legend's entries for the reference, for lines and bands, and for what happens."""
    handles: list[Handle] = []
    thin = style.points(drawing.LIGHT_LINE)
    for panel in shown:
        if drawing.aims(panel):
            dashes = {"lw": thin, "ls": drawing.DASHES}
            handles.append(pages.entry(REFERENCE_WORDS, style.INK, **dashes))
            band = Patch(color=style.BAND, label=GREY_WORDS)
            handles.append(band)
            break
    for name, words in drawing.meaning(shown).items():
        label = f"{name}: {words}"
        if name == "band":
            swatch = Patch(color=style.MUTED, alpha=0.3, label=label)
            handles.append(swatch)
        elif name == "line":
            width = style.points(drawing.LINE)
            handles.append(pages.entry(label, lw=width))
        else:
            handles.append(pages.entry(label, lw=thin))
    if events:
        kinds = dict.fromkeys(event.kind for event in events)
        label = f"dots: {' or '.join(kinds)}"
        handles.append(pages.entry(label, style.INK, lw=thin, ls=drawing.DOTS))
    return handles
