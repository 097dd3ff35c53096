"""The figure of docs/where_sliding_mode_loses.md: the least error of each law over J."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.patches import Patch

from benchmarks.fronts_sentences import FLOOR, ROWS, is_settled, of_figure, value
from smc_mujoco.draw import page, style

TICKS = (1.25, 2, 3, 5)
WIDTH, ROW = 3.9, 1.3  # inches: letters are read on a phone


def draw(points: Sequence[dict], path: Path, laws: Sequence[str]) -> None:
    """Draw the fronts of error over J: a column a plant, a row a period and condition."""
    points = [one for one in points if of_figure(one) and one["model"] == "none"]
    plants = list(dict.fromkeys(point["plant"] for point in points))
    with style.page(WIDTH):
        handles = []
        for law, colour, mark in zip(laws, style.law_colours(laws), style.MARKS, strict=False):
            look = {"marker": mark, "lw": 1.2, "ms": 4}
            handles.append(page.entry(style.law_name(law), colour, **look))
        key = [*handles, Patch(color=style.BAND, label="not ranked")]
        height = page.head_height(WIDTH, key) + ROW * len(ROWS) + 0.2
        figure = page.blank(WIDTH, height, None)
        panels = figure.subplots(len(ROWS), len(plants), squeeze=False, sharey=True, sharex=True)
        for row, (period, condition) in zip(panels, ROWS, strict=True):
            for ax, plant in zip(row, plants, strict=True):
                wanted = {"plant": plant, "condition": condition, "period": period}
                for law, line in zip(laws, handles, strict=True):
                    wanted["law"] = law
                    least: dict[float, float] = {}  # of both searches
                    for one in points:
                        if wanted.items() <= one.items() and is_settled(value(one)):
                            error = value(one)[0]
                            least[one["level"]] = min(error, least.get(one["level"], error))
                    x, y = sorted(least), [least[level] for level in sorted(least)]
                    look = {"color": line.get_color(), "marker": line.get_marker()}
                    ax.plot(x, y, ms=3, lw=1, **look)
                ax.axhspan(1e-9, FLOOR, color=style.BAND, lw=0, zorder=0)
                ax.set(xscale="log", yscale="log", ylim=(1e-5, 0.1))
                ax.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
                ax.minorticks_off()
            noise = "sensor noise" if "noise" in condition else "no noise"
            row[0].set_ylabel(f"{1e3 * period:g} ms, {noise}\nrms error / start")
        for ax, plant in zip(panels[0], plants, strict=True):
            name = style.plant_name(plant, short=True)
            ax.set_title("\n".join(name.rsplit(" ", 1)))
        for ax in panels[-1]:
            ax.set_xlabel("J / least J")
        page.set_head(figure, WIDTH, "The price of rejecting a load", key)
        page.write(figure, page.files(path))
