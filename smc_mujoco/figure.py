"""Figures: x, u and s of several runs on one time axis with their phase portrait, and u alone under several conditions.

Written as SVG and PNG; the same traces give the same files.
"""

import os
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from smc_mujoco import metrics, panels, style
from smc_mujoco.errors import ScenarioError
from smc_mujoco.files import replacing
from smc_mujoco.trace import Trace

WIDTH = 12.8  # inches: 1280 px of SVG, 1920 of PNG
DPI = 150


def figure(
    traces: Sequence[Trace],
    path: str | os.PathLike,
    labels: Sequence[str] | None = None,
    title: str | None = None,
) -> list[Path]:
    """Draw traces of one plant: x, u and s over time, the phase portrait, the last samples of u.

    Of a network: the mean of the channels, single channels light, and the spread max x - min x. A run that diverged is
    drawn to its end, which is marked.

    Args:
      path: its ending, if any, gives way to .svg and .png.
      labels: one a trace; default: the laws' names.
      title: default: the plant's name.

    Returns:
      The two files.

    Raises:
      ScenarioError: no traces, several plants, or a path that cannot be written.
    """
    names, colours = style.labels(style.same_plant(traces), labels), style.colours(traces)
    network = any(trace.x.shape[1] > 1 for trace in traces)
    rows = ["x", "spread", "u", "s"] if network else ["x", "u", "s"]
    with style.page():
        page = _page(7.2)
        left, right = page.add_gridspec(1, 2, width_ratios=(1.7, 1.0))
        column = left.subgridspec(len(rows), 1)
        axes: dict[str, Axes] = {}
        for i, name in enumerate(rows):
            axes[name] = page.add_subplot(column[i], sharex=axes.get("x"))
            if name == "x":
                panels.target(axes[name], traces)
            panels.over_time(axes[name], traces, colours, name)
            axes[name].set_ylabel(_name(traces[0], name, network))
            axes[name].tick_params(labelbottom=name == "s")
        axes["s"].set_xlabel("time (s)")
        axes["s"].set_xlim(0.0, max(trace.t[-1] for trace in traces))
        page.align_ylabels(list(axes.values()))

        portrait, close = (page.add_subplot(cell) for cell in right.subgridspec(2, 1, height_ratios=(1.5, 1.0)))
        panels.phase(portrait, traces, colours)
        portrait.set_xlabel(_name(traces[0], "x", network))
        portrait.set_ylabel(_name(traces[0], "v", network))
        panels.last_samples(close, traces, colours)
        close.set_xlabel("time before the end (ms)")
        close.set_ylabel(_name(traces[0], "u", False) + (", channel 1" if network else ""))
        _head(page, title or style.plant_name(traces[0]), _key(traces, names, colours))
        return _write(page, path)


def signals(
    traces: Sequence[Trace],
    path: str | os.PathLike,
    labels: Sequence[str],
    title: str | None = None,
) -> list[Path]:
    """Draw u alone: a column for each condition, a row for each law.

    Args:
      labels: the condition of each trace; traces under the same condition share it.

    Returns, raises: as `figure`; also ScenarioError for two traces of one law under one condition.
    """
    given = style.labels(style.same_plant(traces), labels)
    cells = {(trace.scenario.law.name, label): trace for trace, label in zip(traces, given, strict=True)}
    if len(cells) < len(traces):
        raise ScenarioError("two traces of one law under one condition: give each condition a label of its own")
    laws, conditions = (list(dict.fromkeys(keys)) for keys in zip(*cells, strict=True))
    with style.page():
        page = _page(max(3.4, 1.4 + 1.5 * len(laws)))
        axes = page.subplots(len(laws), len(conditions), sharex=True, sharey=True, squeeze=False)
        for (law, condition), trace in cells.items():
            ax = axes[laws.index(law), conditions.index(condition)]
            panels.over_time(ax, [trace], [style.law_colour(law)], "u")
            ax.set_title(_variation(trace), loc="right", fontweight="normal", fontsize=9.5, color=style.MUTED)
        for law, ax in zip(laws, axes[:, 0], strict=True):
            ax.set_ylabel(_name(traces[0], "u", False).replace("control ", ""))
            ax.set_title(style.law_name(law), color=style.law_colour(law))
        for condition, top, bottom in zip(conditions, axes[0], axes[-1], strict=True):
            top.annotate(condition, (0.5, 1.0), (0, 22), "axes fraction", "offset points", ha="center", fontsize=13)
            bottom.set_xlabel("time (s)")
        axes[0, 0].set_ylim(panels.limits(traces, "u"))
        axes[0, 0].set_xlim(0.0, max(trace.t[-1] for trace in traces))
        meaning = (
            Patch(color=style.MUTED, alpha=0.3, label="range of u"),
            Line2D([], [], color=style.MUTED, label="mean of u"),
            Line2D([], [], lw=0, label="at the right: total variation per second over the last 20 %"),
        )
        _head(page, title or f"{style.plant_name(traces[0])}: control", meaning)
        return _write(page, path)


def _page(height: float) -> Figure:
    """An empty page, its height in inches."""
    layout = ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.07, wspace=0.02, hspace=0.02)
    return Figure(figsize=(WIDTH, height), layout=layout)


def _head(page: Figure, title: str, handles: Sequence[Line2D | Patch]) -> None:
    """The title, with the legend in one row under it."""
    page.legend(
        handles=handles,
        title=title,
        title_fontproperties={"size": 17, "weight": "bold"},
        alignment="left",
        loc="outside upper left",
        ncols=len(handles),
        fontsize=11,
        borderpad=0.2,
    )


def _name(trace: Trace, name: str, network: bool) -> str:
    """An axis' name with its unit."""
    unit = style.units(trace)["x" if name == "spread" else name]
    if name == "spread":
        return f"max x − min x ({unit})"
    words = {"x": style.quantity(trace), "v": "velocity", "u": "control", "s": "sliding variable"}
    return f"{'mean' if network else words[name]} {name} ({unit})"


def _key(traces: Sequence[Trace], names: Sequence[str], colours: Sequence[str]) -> list[Line2D | Patch]:
    """What the legend shows: the traces, and the reference with its band."""
    handles: list[Line2D | Patch] = []
    for trace, name, colour in zip(traces, names, colours, strict=True):
        end = "" if trace.diverged_at is None else f" (diverged at {trace.diverged_at:.3g} s)"
        handles.append(Line2D([], [], color=colour, lw=3, label=name + end))
    return [*handles, Patch(color=style.BAND, label="reference ± 2 %")]


def _variation(trace: Trace) -> str:
    """How much u moves in the last part of a run."""
    if trace.diverged_at is not None:
        return f"diverged at {trace.diverged_at:.3g} s"
    rate = metrics.tv_rate(trace)
    return f"{rate:,.{0 if rate >= 10 else 2}f} {style.units(trace)['u']}/s"


def _write(page: Figure, path: str | os.PathLike) -> list[Path]:
    base = Path(path)
    base = base.with_suffix("") if base.suffix in (".svg", ".png", ".pdf") else base
    written = []
    for suffix in (".svg", ".png"):
        written.append(base.with_name(base.name + suffix))
        with replacing(written[-1]) as part:
            page.savefig(part, dpi=DPI, metadata={"Date": None} if suffix == ".svg" else None)
    return written
