"""The picture of a board of tracking problems: a row for each entry, a dot for each problem."""

from pathlib import Path

import numpy as np

from smc_mujoco.common.files import replacing
from smc_mujoco.draw import style
from smc_mujoco.problems.tracking_results import TrackingBoard, relative_errors

ROWS = 20  # entries, those with the least mean
LARGEST = 100.0  # an error over the least; larger ones, and those of failed runs, count as this one


def means(board: TrackingBoard) -> dict[str, float]:
    """Return entry -> the geometric mean of its errors over the least of each problem, least
    first.
    """
    typical = {}
    for entry, ratios in relative_errors(board).items():
        typical[entry] = float(np.exp(np.mean(np.log(np.minimum(ratios, LARGEST)))))
    return dict(sorted(typical.items(), key=lambda pair: pair[1]))


def draw(board: TrackingBoard, path: Path) -> None:
    """Draw the picture as SVG: in colour the entries that no other leads in some problem."""
    errors = relative_errors(board)
    typical = means(board)
    rows = list(typical)[:ROWS][::-1]
    leading = {entry for result in board.problems for entry in result.leaders}
    with style.page():
        import matplotlib.pyplot as plt

        figure, ax = plt.subplots(figsize=(style.FULL_WIDTH, 0.34 * len(rows) + 1.2))
        for row, entry in enumerate(rows):
            colour = style.MUTED
            if entry in leading:
                colour = style.law_colour(board.entries[entry].law)
            dots = np.minimum(errors[entry], LARGEST)
            ax.plot(dots, [row] * len(dots), "o", ms=4.5, alpha=0.45, color=colour, mew=0)
            ax.plot([typical[entry]], [row], "D", ms=8, color=colour, mew=0)
        ax.set_xscale("log")
        ax.set_xlim(0.9, 1.2 * LARGEST)
        ticks = [1, 2, 5, 10, 20, 50, 100]
        ax.set_xticks(ticks, [*map(str, ticks[:-1]), "≥ 100"])
        ax.minorticks_off()
        ax.set_yticks(range(len(rows)), rows)
        ax.set_xlabel("error over the least of its problem: a dot a problem, a diamond their mean")
        ax.grid(axis="x", color=style.GRID)
        ax.set_axisbelow(True)
        figure.tight_layout()
        with replacing(path) as file:
            figure.savefig(file, format="svg", metadata={"Date": None})
        plt.close(figure)
