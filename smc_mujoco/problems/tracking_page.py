"""The page of a board of tracking problems, Markdown and one picture, made from its results.

python -m smc_mujoco.problems.tracking_page docs  # the pages of all shipped boards
"""

import sys
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from smc_mujoco.common.files import write_text
from smc_mujoco.common.text import capital, joined, number
from smc_mujoco.control.component import bounded, gains_text
from smc_mujoco.problems.tracking import tracking_suites
from smc_mujoco.problems.tracking_entry import beside_of
from smc_mujoco.problems.tracking_picture import draw_board, entries_drawn
from smc_mujoco.problems.tracking_results import (
    FLOOR,
    ProblemBoard,
    TrackingBoard,
    TrackingResult,
    relative_errors,
    shipped_bounds,
    tracking_board,
)
from smc_mujoco.problems.tracking_search import SEARCHES, SETS, UNSEEN

TAGS = Path(__file__).parent / "boards_tags.toml"
FIRST = 5  # entries of a problem's table; those that no other leads are named besides
ENOUGH = 1 / 3  # of the pairs of a problem: if fewer can be told apart, the page says so
BESIDE = {
    "friction": (
        "- **`+ Feedforward(1)`** is told the true friction; 0.7 and 1.3 are 30 % off. "
        "`+ Dither(1)` is a square wave as high as the friction.",
    )
}
TITLES = {"load": "Leaderboard: an unknown load", "friction": "Leaderboard: dry friction"}


def page(board: TrackingBoard, picture: str, own: str = "") -> str:
    """Return the page as Markdown; `picture` is the name of its file, and `own` an entry that every
    table has.
    """
    suite = board.suite
    load = suite.without
    lines = [
        f"# {TITLES[load]}",
        "",
        standings_line(board),
        "",
        f"![Error of each entry over the least of its problem]({picture})",
        "",
        f"*In colour: entries that no other leads in some problem.{_left_out(board, own)}*",
        "",
        suite.about,
        "",
        "```sh",
        f"smc-mujoco enter my_law.py --suite {suite.name}",
        "```",
        "",
        "It searches for your law alone, and writes this page with its row.",
        "",
        "## How to read it",
        "",
        f"- **An entry** gets {SEARCHES} searches of {SETS} sets of gains in each problem, within "
        "a limit on the variation of u. The worse search counts; `other` is the better one.",
        f"- **The error** is the rms over whole periods in counts of the encoder: the median of "
        f"{UNSEEN} unseen runs, with its 95 % interval. Below {FLOOR:g} counts all are equal.",
        "- **An entry leads another** if it is better in every pairing of their searches, by a "
        "paired test (`smc-mujoco explain lead`). A star: no other entry leads it.",
        f"- **`without`**: the error of the same gains without the {load}; `=`: it is no less.",
        "- **`never`**: u varies more than the limit, or a run failed.",
        "- **Told**: given a1, a2 and b of the plant, e'' = a1 e + a2 e' + b u.",
        "- **An oracle** knows state, friction and load, without noise and delay.",
        *BESIDE.get(load, ()),
        "",
        "## Limits",
        "",
        "- It ranks who entered, on these machines, under these limits.",
        "- A law whose searches differ much is seldom led, and seldom leads.",
        "- The searches' budget was chosen on `pid` and `adrc` alone, before others entered. Laws "
        "that need a longer search stand worse than they could.",
        *_hard_to_tell(board),
        "",
        "## By what an entry has",
        "",
        *tag_table(board),
        "",
    ]
    for problem, result in zip(suite.problems, board.problems, strict=True):
        limit = f"u may vary by {problem.limit:g} bounds a second"
        why = capital(problem.why)
        lines += [f"## {problem.name}", "", f"{why}. `{problem.load}`; {limit}.", ""]
        lines += [*problem_table(board, result, own), ""]
    return "\n".join(lines)


def _left_out(board: TrackingBoard, own: str) -> str:
    """Return how many entries the picture leaves out, in words; "" if none."""
    count = len(board.entries) - len(entries_drawn(board, own))
    return f" {count} more have larger errors." if count else ""


def _hard_to_tell(board: TrackingBoard) -> Iterator[str]:
    """Yield a limit that names the problems in which few entries can be told apart, if any."""
    hard = []
    for result in board.problems:
        if result.told_apart < ENOUGH and len(result.standings) > 1:
            hard.append(f"`{result.problem}`")
    if hard:
        yield f"- Fewer than a third of all pairs can be told apart in {joined(hard)}."


def first_entries(board: TrackingBoard) -> tuple[list[str], int]:
    """Return the entries that no other leads in the most problems, and that number of problems."""
    shares = board.shares()
    most = max(shares.values())
    first = [name for name, share in shares.items() if share == most]
    return first, round(most * len(board.problems))


def _date(board: TrackingBoard) -> str:
    return max(entry.date for entry in board.entries.values())


def standings_line(board: TrackingBoard) -> str:
    """Return the first line: who stands where."""
    first, led = first_entries(board)
    names = joined(f"`{name}`" for name in first)
    verb = "is" if len(first) == 1 else "are"
    return (
        f"**Of {len(board.entries)} entries {names} {verb} led by no other in {led} of "
        f"{len(board.problems)} problems** (`{board.suite.name}`, {_date(board)})."
    )


def readme_line(board: TrackingBoard) -> str:
    """Return the line of README about a board."""
    (first, *level), led = first_entries(board)
    also = f"; level with it {joined(f'`{name}`' for name in level)}" if level else ""
    title = TITLES[board.suite.without].removeprefix("Leaderboard: ")
    return (
        f"- [{title.capitalize()}](docs/{page_name(board)}), `{board.suite.name}`, {_date(board)}: "
        f"of {len(board.entries)} entries `{first}` is led by no other in {led} of "
        f"{len(board.problems)} problems{also}."
    )


def page_name(board: TrackingBoard) -> str:
    """Return the name of the file of a board in docs/."""
    return f"leaderboard_{board.suite.without}.md"


def problem_table(board: TrackingBoard, result: ProblemBoard, own: str) -> Iterator[str]:
    """Yield the table of a problem: the first entries, those that no other leads, and `own`."""
    yield "| entry, its gains | error, counts | other | without | u varies |"
    yield "|---|---|---|---|---|"
    rows = [*result.standings[:FIRST]]
    rows += [
        standing for standing in result.standings[FIRST:] if standing.leads or standing.entry == own
    ]
    for row in rows:
        star = "*" if row.leads else ""
        same = "" if row.of_load else " ="
        low, high = map(number, row.interval)
        without, rate = number(row.counted.without), number(row.counted.rate)
        yield (
            f"| `{row.entry}`<br><small>{gains_text(bounded(row.counted.gains))}</small> "
            f"| {number(row.error)}{star} ({low} to {high}) | {number(row.better)} "
            f"| {without}{same} | {rate} |"
        )
    more = len(result.standings) - len(rows)
    still, oracle = shipped_bounds(board.suite.name)[result.problem]
    entries = "entry" if more == 1 else "entries"
    yield ""
    yield (
        f"{more} more {entries}. {100 * result.told_apart:.0f} % of all pairs can be told apart. "
        f"u = 0: {number(still)} counts; an oracle: {number(oracle)}."
    )


def tags_of(entry: TrackingResult) -> dict[str, str]:
    """Return what an entry has: tag -> its value."""
    about = tomllib.loads(TAGS.read_text(encoding="utf-8"))
    tags = {}
    for tag, groups in about.items():
        rest = "nothing" if tag == "told" else "other"
        tags[tag] = next((value for value in groups if entry.law in groups[value]), rest)
    kinds = {"": "nothing", "Dither": "a square wave", "Feedforward": "the friction"}
    tags["beside it"] = kinds[beside_of(entry.text)[0]]
    return tags


def tag_table(board: TrackingBoard) -> Iterator[str]:
    """Yield the table of tags: how many entries have each, in how many problems one of them is not
    led, and the median of their errors.
    """
    values: dict[tuple[str, str], set[str]] = {}
    for name, entry in board.entries.items():
        for pair in tags_of(entry).items():
            values.setdefault(pair, set()).add(name)
    yield f"| with | entries | not led, of {len(board.problems)} | error over the least |"
    yield "|---|---|---|---|"
    ratios = relative_errors(board)
    for (tag, value), names in sorted(values.items()):
        problems = sum(bool(names & {*result.leaders}) for result in board.problems)
        typical = np.median([np.median(ratios[name]) for name in names])
        yield f"| {tag}: {value} | {len(names)} | {problems} | {number(float(typical))} |"


def write_board(board: TrackingBoard, path: Path, own: str = "") -> Path:
    """Write the page and its picture beside it, both with the entry `own`. Return the page."""
    picture = path.with_suffix(".svg")
    draw_board(board, picture, own)
    return write_text(path, page(board, picture.name, own))


def main(arguments: Sequence[str]) -> None:
    """Write the pages of all shipped boards into a folder."""
    (folder,) = arguments
    for suite in tracking_suites():
        board = tracking_board(suite)
        write_board(board, Path(folder, page_name(board)))


if __name__ == "__main__":
    main(sys.argv[1:])
