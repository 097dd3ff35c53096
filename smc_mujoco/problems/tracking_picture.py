"""The picture of a board of tracking problems: a row for each entry, a dot for each problem."""

from pathlib import Path

import numpy as np

from smc_mujoco.common.files import replacing
from smc_mujoco.draw import colouring, style
from smc_mujoco.problems.tracking_results import TrackingBoard, relative_errors

ROWS = 15  # entries at most: those that stand first in some problem, and those with the least mean
WIDTH = 5.0  # inches: letters of 8 points can be read on a phone, too
ROW_HEIGHT = 0.29  # inches
OVER = 0.43  # rows, from an entry's dots to the middle of its words
LARGEST = 100.0  # an error over the least; larger ones, and those of failed runs, count as this one


def means(board: TrackingBoard) -> dict[str, float]:
    """Return entry -> the geometric mean of its errors over the least of each problem, least
    first.
    """
    typical = {}
    for entry, ratios in relative_errors(board).items():
        typical[entry] = float(np.exp(np.mean(np.log(np.minimum(ratios, LARGEST)))))
    return dict(sorted(typical.items(), key=lambda pair: pair[1]))


def entries_drawn(board: TrackingBoard, own: str) -> list[str]:
    """Return the entries in the picture, `own` among them, those with the least mean first."""
    typical = means(board)
    leading = {own, *(entry for result in board.problems for entry in result.leaders)}
    in_order = sorted(typical, key=lambda entry: entry not in leading)
    return sorted(in_order[:ROWS], key=lambda entry: typical[entry])


def draw_board(board: TrackingBoard, path: Path, own: str = "") -> None:
    """Draw the picture as SVG: in colour the entries that no other leads in some problem."""
    errors = relative_errors(board)
    typical = means(board)
    rows = entries_drawn(board, own)
    count = len(board.problems)
    with style.page(WIDTH):
        import matplotlib.pyplot as plt

        figure, ax = plt.subplots(figsize=(WIDTH, ROW_HEIGHT * len(rows) + 0.6))
        for row, entry in enumerate(rows):
            led = sum(entry in result.leaders for result in board.problems)
            words, colour, weight = entry, style.MUTED, "normal"
            if led:
                words = f"{entry}: led by no other in {led} of {count}"
                colour, weight = colouring.law_colour(board.entries[entry].law), "bold"
            dots = np.minimum(errors[entry], LARGEST)
            size = style.points(6)
            look = {"color": colour, "mew": 0, "clip_on": False}
            ax.plot(dots, [row] * len(dots), "o", ms=size, alpha=0.5, **look)
            ax.plot([typical[entry]], [row], "D", ms=1.6 * size, **look)
            ax.text(1.0, row - OVER, words, color=colour, weight=weight, va="center")
        ax.set_xscale("log")
        ax.set_xlim(0.95, 1.05 * LARGEST)
        ax.set_ylim(len(rows) - 0.6, -2 * OVER)
        ticks = [1, 2, 5, 10, 20, 50, 100]
        ax.set_xticks(ticks, [*map(str, ticks[:-1]), "≥ 100"])
        ax.minorticks_off()
        ax.set_yticks([])
        ax.spines["left"].set_visible(False)
        ax.set_xlabel("error over the least of its problem: a dot a problem, a diamond their mean")
        ax.grid(axis="x", color=style.GRID)
        ax.set_axisbelow(True)
        figure.tight_layout(pad=0.4)
        with replacing(path) as file:
            figure.savefig(file, format="svg", metadata={"Date": None})
        plt.close(figure)
