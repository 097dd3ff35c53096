"""Where a figure or a film of made-up data draws what, for `assert sketch(page) == snapshot`.

Data that a formula makes are the same on all processors, so a record of them has places and sizes, to three digits.
"""

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from typing import ClassVar

import numpy as np
from matplotlib import colors
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import Collection
from matplotlib.figure import Figure, SubFigure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Annotation, Text
from PIL import ImageDraw

import smc_mujoco as smc
from smc_mujoco.simulation.reference import PLANT_DIVERGED
from smc_mujoco.simulation.trace import ARRAYS


def number(value: float) -> str:
    """Return a number with three digits, and rounding as 0."""
    return f"{round(float(value), 9) + 0.0:.3g}"


def numbers(values: Iterable) -> str:
    """Return numbers in brackets."""
    return f"({', '.join(map(number, np.ravel(np.asarray(values, float))))})"


def made(scenario: smc.Scenario) -> smc.Trace:
    """Return a trace of a scenario that was not run: decaying waves, other ones for each array and channel."""
    t = np.arange(scenario.samples + 1) * scenario.control_period
    n = scenario.plant.n
    waves = {
        name: 0.7**k * np.exp(-2.0 * t)[:, None] * np.cos((4.0 + k) * t[:, None] + 0.3 + 0.7 * np.arange(n))
        for k, name in enumerate(ARRAYS[1:])
    }
    return smc.Trace(t=t, **waves, scenario=scenario)


def failed(trace: smc.Trace, at: int, failure: str = "") -> smc.Trace:
    """Return the trace as if it had failed at sample `at`; by default the plant diverged."""
    failure = failure or f"{PLANT_DIVERGED}, at t = {trace.t[at]:g} s"
    arrays = {name: getattr(trace, name).copy() for name in ARRAYS[1:]}
    for array in arrays.values():
        array[at:] = np.nan
    return dataclasses.replace(trace, **arrays, diverged_at=float(trace.t[at]), failure=failure)


def sketch(page: Figure | SubFigure) -> str:
    """Return all that a figure shows: its size, texts, legends and axes, with what these show."""
    lines = [f"page {numbers([page.bbox.width / page.dpi, page.bbox.height / page.dpi])}"]
    lines += [_text(text) for text in page.texts + page.artists if isinstance(text, Text)]
    for legend in page.legends:
        lines += _legend(legend)
    for axes in page.axes:
        lines += _axes(axes)
    return "\n".join(lines)


def _axes(axes: Axes) -> list[str]:
    """Return what axes show, and those within them; of lines of one look, their data together."""
    lines = [f"axes {axes.get_aspect()}{', bare' * (not axes.get_frame_on())}{', hidden' * (not axes.get_visible())}"]
    lines[0] += f"; x {_axis(axes.xaxis)}; y {_axis(axes.yaxis)}"
    titles = [axes._left_title, axes.title, axes._right_title]
    lines += [f"{text}" for text in map(_text, (*titles, *axes.texts)) if not text.startswith("''")]
    looks: dict[str, list[Line2D]] = {}
    for line in axes.lines:
        looks.setdefault(f"{_look(line)} layer {number(line.get_zorder())}", []).append(line)
    for look, alike in looks.items():
        data = [_data(np.concatenate([np.asarray(line.get_data()[k], float) for line in alike])) for k in range(2)]
        lines.append(f"{f'{len(alike)} ' * (len(alike) > 1)}{look}: {' '.join(data)}")
    for patch in axes.patches:
        box = patch.get_path().transformed(patch.get_patch_transform()).get_extents()
        lines.append(f"{type(patch).__name__} {numbers(box.extents)} {_face(patch)}")
    lines += [_collection(one) for one in axes.collections]
    lines += [part for legend in filter(None, [axes.get_legend()]) for part in _legend(legend)]
    return [*lines, *(f"  {part}" for child in axes.child_axes for part in _axes(child))]


def _axis(axis: Axis) -> str:
    """Return an axis's scale, ends and label, and its grid, ticks and their texts where they are not as usual."""
    grid = [line.get_visible() for line in axis.get_gridlines()[:1]]
    ticks = [(one.label1.get_visible(), one.tick1line.get_markersize()) for one in axis.get_major_ticks()[:1]]
    kind = type(axis.get_major_formatter()).__name__
    kind += f" {[text.get_text() for text in axis.get_ticklabels()]}" if kind == "FuncFormatter" else ""
    unusual = _unless([True], grid=grid) + _unless([(True, 3.5)], ticks=ticks) + _unless("ScalarFormatter", by=kind)
    label = _text(axis.label).replace("(0.5, 0) ", "").replace("(0, 0.5) ", "")
    label = label.replace(" center top", "").replace(" center bottom", "")  # the usual places
    told = f" {label}" if axis.label.get_text() else ""
    return f"{axis.get_scale()} {numbers(axis.get_view_interval())}{told}{unusual}"


def _unless(usual: object, **given: object) -> str:
    """Return what is not as usual, as text."""
    return "".join(f" {name} {value}" for name, value in given.items() if value != usual)


def _face(patch: Patch) -> str:
    """Return the look of a filled shape."""
    fill, edge = (colors.to_hex(one, keep_alpha=True) for one in (patch.get_facecolor(), patch.get_edgecolor()))
    return f"{fill} edge {edge} {number(patch.get_linewidth())} layer {number(patch.get_zorder())}"


def _text(text: Text) -> str:
    """Return a text with its place, size, colour, weight and alignment."""
    place = text.get_position()
    if isinstance(text, Annotation):
        place = (*text.xy, *text.xyann)
    look = f"{number(text.get_size())} {colors.to_hex(text.get_color())} {text.get_weight()}"
    box = f" box {_face(text.get_bbox_patch())}" if text.get_bbox_patch() else ""
    arrow = getattr(text, "arrow_patch", None)
    line = f" line {arrow.get_linestyle()} {number(arrow.get_linewidth())}" if arrow else ""
    math = _unless(True, math=text.get_parse_math())
    return f"{text.get_text()!r} {numbers(place)} {look} {text.get_ha()} {text.get_va()}{math}{box}{line}"


def _look(line: Line2D) -> str:
    """Return the look of a line, with its label."""
    look = f"line {colors.to_hex(line.get_color())} {number(line.get_linewidth())}"
    look += _unless((0, None), dashed=line._unscaled_dash_pattern) + _unless("default", drawn=line.get_drawstyle())
    if line.get_marker() not in ("None", None):
        fill, edge = (colors.to_hex(one) if one != "none" else one for one in (line.get_mfc(), line.get_mec()))
        look += f" mark {line.get_marker()} {number(line.get_ms())} {fill} {edge} {number(line.get_mew())}"
    label = "_" if str(line.get_label()).startswith("_") else line.get_label()
    look += _unless(None, alpha=line.get_alpha(), id=line.get_gid()) + _unless(True, clip=line.get_clip_on())
    return look + _unless("_", label=label)


def _data(values: np.ndarray) -> str:
    """Return values, or the number of many, the first, the last, the least, the largest and the mean."""
    if len(values) <= 4:
        return numbers(values)
    return f"{len(values)} {numbers([values[0], values[-1], np.nanmin(values), np.nanmax(values), np.nanmean(values)])}"


def _collection(one: Collection) -> str:
    """Return the look of filled areas, the box around them, and the mean of their edge."""
    places = np.concatenate([path.vertices for path in one.get_paths()] or [np.zeros((1, 2))])
    fill = [colors.to_hex(face, keep_alpha=True) for face in np.atleast_2d(one.get_facecolor())[:1]]
    values = (
        "" if one.get_array() is None else f" values {_data(np.ravel(one.get_array()))} {one.cmap.N} {one.get_clim()}"
    )
    look = f"{fill} {numbers(one.get_linewidth())} layer {number(one.get_zorder())}" + _unless(None, id=one.get_gid())
    box = numbers([*places.min(axis=0), *places.max(axis=0), *places.mean(axis=0)])
    return f"area {look}: {len(one.get_paths())} {box}{values}"


def _legend(legend: Legend) -> list[str]:
    """Return a legend's title and entries, with the samples of these."""
    lines = [f"legend {legend._ncols} columns, frame {legend.get_frame_on()}: {_text(legend.get_title())}"]
    for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True):
        sample = _look(handle).partition(" label ")[0] if isinstance(handle, Line2D) else _face(handle)
        lines.append(
            f"  {text.get_text()!r} {number(text.get_size())}{_unless(True, math=text.get_parse_math())}: {sample}"
        )
    return lines


class Pen(ImageDraw.ImageDraw):
    """A pen of Pillow that also notes what it draws, in `notes`; in the place of `ImageDraw.Draw`."""

    notes: ClassVar[list[str]] = []
    busy: ClassVar[bool] = False  # within a shape, which is made of others


def _noted(name: str) -> Callable:
    """Return a method of the pen that notes its call."""
    draw = getattr(ImageDraw.ImageDraw, name)

    def method(self, *given, **options):
        first, Pen.busy = not Pen.busy, True
        if first:
            named = [f"{key}={_plain(value)}" for key, value in options.items()]
            many = name == "polygon" or (name == "line" and len(given[0]) > 4)
            shape = [_outline(given[0]), *given[1:]] if many else given
            Pen.notes.append(" ".join([name, *map(_plain, shape), *named]))
        try:
            return draw(self, *given, **options)
        finally:
            Pen.busy = not first

    return method


def _outline(points: Sequence) -> np.ndarray:
    """Return the number of the points of an outline, the first, the middle one, their means and spreads."""
    line = np.array(points, float)
    return np.array([len(line), *line[0], *line[len(line) // 2], *line.mean(axis=0), *line.std(axis=0)])


def _plain(part: object) -> str:
    """Return an argument of a drawing as text: places to a tenth of a px."""
    if hasattr(part, "getname"):
        return f"{part.getname()[1]} {number(part.size)}"
    if isinstance(part, str | type(None)):
        return repr(part)
    return numbers(np.round(np.asarray(part, float), 1))


for _name in ("text", "line", "rectangle", "rounded_rectangle", "ellipse", "polygon"):
    setattr(Pen, _name, _noted(_name))
