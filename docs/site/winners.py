"""The picture of docs/winners.md: four comparisons of made-up laws A and B, decided by the package
itself.

`python docs/site/winners.py` draws docs/winners.svg again.
"""

from pathlib import Path

import numpy as np

from smc_mujoco.analysis.ranking import LEVEL_SHARE, RELEVANT, Comparison

FILE = Path(__file__).parents[1] / "winners.svg"
UNITS = 12
WIDTH = 4.6  # inches: letters are read on a phone
BLUE = "#0072B2"  # of runs
NUMBER = 3  # of the draw; any shows the same four verdicts


def cases() -> list[tuple[str, Comparison]]:
    """Return four comparisons of A with B, each with what is particular about it."""
    drawn = np.random.default_rng(NUMBER).normal(size=(4, UNITS))
    comparisons = []
    particular = {  # the spread of A's runs, its lead, the change by half the step
        "A leads by about 20 %": (0.05, 0.2, 0.0),
        "A and B are alike": (0.02, 0.0, 0.0),
        "the searches differ much": (0.3, 0.1, 0.0),
        "half the step undoes the lead": (0.04, 0.2, 0.3),
    }
    for name, (spread, lead, step) in particular.items():
        a = np.exp(spread * drawn[len(comparisons)]) * (1.0 - lead)
        b = np.ones(UNITS)
        sets = dict.fromkeys("AB", np.arange(UNITS))
        comparisons.append(
            (name, Comparison({"A": a, "B": b}, halves={"A": a * (1 + step), "B": b}, sets=sets))
        )
    return comparisons


def verdict(comparison: Comparison) -> str:
    """Return the verdict on A and B in words."""
    if winner := comparison.winners[0]:
        return f"{winner} beats B"
    if comparison.level[0, 0, 1]:
        return f"level within {100 * LEVEL_SHARE:.0f} %"
    return f"no verdict (resolves {100 * comparison.visible(0, 'A', 'B'):.0f} %)"


def draw(file: Path = FILE) -> None:
    """Draw a row for each comparison and a dot for each unit, at its lead."""
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    from smc_mujoco.draw import page, style

    with style.page(WIDTH):
        matplotlib.rcParams["svg.hashsalt"] = "winners"
        figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
        ax = figure.subplots()
        ax.axvspan(-100 * LEVEL_SHARE, 100 * LEVEL_SHARE, color=style.GRID, lw=0)
        ax.axvline(100 * RELEVANT, color=style.INK, ls="--", lw=1)
        ax.text(100 * RELEVANT, 0.8, f" {100 * RELEVANT:.0f} %", va="bottom")
        for row, (name, comparison) in enumerate(cases()):
            as_run = 1.0 - comparison.cells[0, 0] / comparison.cells[1, 0]
            charged = 1.0 - np.exp(-comparison.leads[0, 0, 1])
            rows = np.full(UNITS, -row) + np.linspace(-0.22, 0.22, UNITS)
            ax.hlines(rows, 100 * charged, 100 * as_run, color=style.MUTED, lw=1)
            ax.plot(100 * as_run, rows, "o", ms=3, mfc="none", color=style.MUTED)
            ax.plot(100 * charged, rows, "o", ms=3, color=BLUE)
            ax.text(-65, -row + 0.3, name, va="bottom", color=style.MUTED)
            ax.text(66, -row + 0.3, verdict(comparison), va="bottom", ha="right", weight="bold")
        ax.set(xlim=(-67, 67), ylim=(-3.4, 0.8), yticks=[], xlabel="lead of A over B in a run (%)")
        ax.set_xticks([-50, -25, 0, 25, 50])
        look = {"ls": "", "marker": "o", "ms": 3}
        key = [
            page.entry("a run", BLUE, **look),
            page.entry("the run before half the step counts", mfc="none", **look),
            page.entry("least lead of a winner", style.INK, ls="--", lw=1),
            Patch(color=style.GRID, label=f"level: within {100 * LEVEL_SHARE:.0f} %"),
        ]
        figure.legend(handles=key, loc="outside lower center", ncols=2)
        ax.spines["left"].set_visible(False)
        figure.savefig(file, metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    draw()
