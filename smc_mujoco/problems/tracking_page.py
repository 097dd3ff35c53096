"""The page of a board of tracking problems, Markdown and one picture, made from its results.

python -m smc_mujoco.problems.tracking_page smc-friction@1 docs/leaderboard_friction.md
"""

import sys
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from smc_mujoco.common.files import replacing
from smc_mujoco.common.text import joined, number
from smc_mujoco.control.component import gains_text
from smc_mujoco.problems.tracking_entry import tracking_entry
from smc_mujoco.problems.tracking_results import (
    ProblemBoard,
    TrackingBoard,
    bounds,
    tracking_board,
)
from smc_mujoco.problems.tracking_search import SEARCHES, SETS, UNSEEN

TAGS = Path(__file__).parent / "boards_tags.toml"
FIRST = 5  # entries of a problem's table; those level with the first are named besides
NAMED = 12  # entries of the picture; the best of each law
TITLES = {"load": "Leaderboard: an unknown load", "friction": "Leaderboard: dry friction"}


def page(board: TrackingBoard, picture: str) -> str:
    """Return the page as Markdown; `picture` is the name of its file."""
    suite = board.suite
    lines = [f"# {TITLES[suite.without]}", "", summary(board), ""]
    lines += [f"![Error of each entry over the least of its problem]({picture})", ""]
    lines += [
        f"{suite.about} Each entry has the gains of {SEARCHES} searches of {SETS} sets in each "
        f"problem, within the problem's limit on the variation of u. The error is the rms over "
        f"whole periods in {UNSEEN} unseen runs, in counts of the encoder; printed are the worse "
        "search, and the better one in brackets. An entry leads another if it is better in every "
        "pairing of their searches, by the [paired test](winners.md). A star marks the entries "
        f"that no other leads. `without`: the same gains without the {suite.without}; `=` marks an "
        f"error that is not of the {suite.without}, as it is the same without it.",
        "",
        "Nothing here is about laws that did not enter, other machines or other limits. To enter "
        "yours, with its own 15 lines or beside a compensation:",
        "",
        "```sh",
        f"smc-mujoco enter my_law.py --suite {suite.name}",
        "```",
        "",
        "It searches for your law alone, and writes this page with your row.",
        "",
        "## By what an entry has",
        "",
        *tag_table(board),
        "",
    ]
    for problem, result in zip(suite.problems, board.problems, strict=True):
        lines += [f"## {problem.name}", "", f"{problem.why}: {_told(problem.load)}.", ""]
        lines += [*problem_table(board, result), ""]
    return "\n".join(lines)


def _told(load: str) -> str:
    return f"`{load}`"


def summary(board: TrackingBoard) -> str:
    """Return the first line: who stands where."""
    shares = board.shares()
    count = len(board.problems)
    first = next(iter(shares))
    level = [name for name in shares if shares[name] == shares[first]]
    names = joined(f"`{name}`" for name in level)
    led = round(shares[first] * count)
    date = max(entry.date for entry in board.entries.values())
    stands = "stands" if len(level) == 1 else "stand"
    return (
        f"**{names} {stands} first, or level with the first, in {led} of {count} problems, of "
        f"{len(board.entries)} entries** (`{board.suite.name}`, {date})."
    )


def problem_table(board: TrackingBoard, result: ProblemBoard) -> Iterator[str]:
    """Yield the table of a problem: the first entries, and those that no other leads."""
    yield "| entry | error, counts | without | gains |"
    yield "|---|---|---|---|"
    stands = [*result.names[:FIRST]]
    stands += [name for name in result.leaders if name not in stands]
    for name in stands:
        better, worse = result.errors[name]
        star = "*" if name in result.leaders else ""
        same = "" if result.of_load(name) else " ="
        searches = board.entries[name].searches[result.problem]
        chosen = max(searches, key=lambda found: np.median(found.errors))
        values = f"{number(worse)}{star} ({number(better)})"
        yield (
            f"| `{name}` | {values} | {number(result.without[name])}{same} "
            f"| `{gains_text(chosen.gains)}` |"
        )
    share = f"{100 * result.told_apart:.0f} %"
    more = len(result.names) - len(stands)
    still, oracle = bounds(next(p for p in board.suite.problems if p.name == result.problem))
    yield ""
    yield f"With u = 0 the error is {number(still)}, of an oracle {number(oracle)} counts."
    yield f"{more} more entries; {share} of all pairs can be told apart."


def tags_of(name: str) -> dict[str, str]:
    """Return what an entry has: tag -> its value."""
    about = tomllib.loads(TAGS.read_text(encoding="utf-8"))
    entry = tracking_entry(name)
    tags = {}
    for tag, groups in about.items():
        tags[tag] = next((value for value in groups if entry.law.name in groups[value]), "other")
    tags["beside it"] = {"": "nothing", "Dither": "a square wave"}.get(entry.kind, "the friction")
    return tags


def tag_table(board: TrackingBoard) -> Iterator[str]:
    """Yield the table of tags: how many entries have each, and how often one of them is not led."""
    values: dict[tuple[str, str], set[str]] = {}
    for name, entry in board.entries.items():
        for pair in tags_of(entry.text).items():
            values.setdefault(pair, set()).add(name)
    yield "| tag | | entries | not led in problems | median error over the least |"
    yield "|---|---|---|---|---|"
    ratios = relative_errors(board)
    for (tag, value), names in sorted(values.items()):
        problems = sum(bool(names & {*result.leaders}) for result in board.problems)
        typical = np.median([np.median(ratios[name]) for name in names])
        problem_count = f"{problems} of {len(board.problems)}"
        yield f"| {tag} | {value} | {len(names)} | {problem_count} | {number(float(typical))} |"


def relative_errors(board: TrackingBoard) -> dict[str, list[float]]:
    """Return entry -> its error over the least of each problem, of its worse search."""
    ratios: dict[str, list[float]] = {name: [] for name in board.entries}
    for result in board.problems:
        least = min(worse for _, worse in result.errors.values())
        for name, (_, worse) in result.errors.items():
            ratios[name].append(worse / least)
    return ratios


def draw(board: TrackingBoard, path: Path) -> None:
    """Draw the entries, the one with the least typical error on top: a dot for each problem."""
    from smc_mujoco.draw import style

    ratios = relative_errors(board)
    typical = {name: float(np.exp(np.mean(np.log(ratios[name])))) for name in ratios}
    order = sorted(typical, key=typical.__getitem__)[:NAMED][::-1]
    with style.page():
        import matplotlib.pyplot as plt

        figure, ax = plt.subplots(figsize=(style.FULL_WIDTH, 0.36 * len(order) + 1.2))
        for row, name in enumerate(order):
            finite = [min(ratio, 1e3) for ratio in ratios[name]]
            last = row == len(order) - 1
            colour = style.law_colour(board.entries[name].law) if last else style.MUTED
            ax.plot(finite, [row] * len(finite), "o", ms=4, alpha=0.5, color=colour, mew=0)
            ax.plot([typical[name]], [row], "D", ms=7, color=colour)
        ax.set_xscale("log")
        ax.set_yticks(range(len(order)), order)
        ax.set_xlabel("error over the least of the problem; a dot a problem, a diamond their mean")
        ax.grid(axis="x", color=style.GRID)
        ax.set_axisbelow(True)
        figure.tight_layout()
        with replacing(path) as file:
            figure.savefig(file, format="svg", metadata={"Date": None})
        plt.close(figure)


def write(board: TrackingBoard, path: Path) -> Path:
    """Write the page and its picture beside it. Return the page."""
    picture = path.with_suffix(".svg")
    draw(board, picture)
    with replacing(path) as file:
        file.write_text(page(board, picture.name), encoding="utf-8")
    return path


def main(arguments: Sequence[str]) -> None:
    """Write the page of a suite's shipped entries."""
    suite, path = arguments
    write(tracking_board(suite), Path(path))


if __name__ == "__main__":
    main(sys.argv[1:])
