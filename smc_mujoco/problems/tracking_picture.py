"""The picture of a board of tracking problems: error over variation of u, a mark an entry."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.files import replacing
from smc_mujoco.draw import style
from smc_mujoco.problems.tracking_results import TrackingBoard

LARGEST = 1e3  # an error over the least; larger ones, and those of failed runs, count as this one


class Mark(NamedTuple):
    """An entry in the picture: means over the problems."""

    entry: str
    rate: float  # share of the limit
    error: float  # over the least of the problem
    on_front: bool  # whether no entry has less of one and no more of the other


def marks(board: TrackingBoard) -> list[Mark]:
    """Return the entries as the picture has them, least error first."""
    means = {}
    limits = {problem.name: problem.limit for problem in board.suite.problems}
    for entry in board.entries:
        logs = []
        for result in board.problems:
            least = min(worse for _, worse in result.errors.values())
            error = min(result.errors[entry][1] / least, LARGEST)
            rate = min(result.rates[entry] / limits[result.problem], 1.0)
            logs.append(np.log([max(rate, 1e-3), error]))
        means[entry] = np.exp(np.mean(logs, axis=0)).tolist()
    marked = []
    for entry, (rate, error) in means.items():
        led = any(rival[0] <= rate and rival[1] < error for rival in means.values())
        marked.append(Mark(entry, rate, error, not led))
    return sorted(marked, key=lambda mark: mark.error)


def draw(board: TrackingBoard, path: Path) -> None:
    """Draw the picture as SVG: in colour the entries on the front, the others grey."""
    with style.page():
        import matplotlib.pyplot as plt

        figure, ax = plt.subplots(figsize=(style.FULL_WIDTH, 5.2))
        for mark in marks(board):
            law = board.entries[mark.entry].law
            colour = style.law_colour(law) if mark.on_front else style.MUTED
            x = 100.0 * mark.rate
            ax.plot([x], [mark.error], "o", ms=9 if mark.on_front else 5, color=colour, mew=0)
            weight = "bold" if mark.on_front else "normal"
            ax.annotate(
                mark.entry,
                (x, mark.error),
                (7, 0),
                textcoords="offset points",
                va="center",
                color=colour,
                fontweight=weight,
                fontsize=9.0 if mark.on_front else 7.0,
            )
        ax.set_yscale("log")
        ax.set_xlabel("variation of u, % of the limit (mean of the problems)")
        ax.set_ylabel("error over the least of the problem (mean)")
        ax.grid(color=style.GRID)
        ax.set_axisbelow(True)
        figure.tight_layout()
        with replacing(path) as file:
            figure.savefig(file, format="svg", metadata={"Date": None})
        plt.close(figure)
