"""Static pages of results: an index, the boards of each suite, and a page for each entry.

The pages are HTML and SVG in a few files, without scripts, and need neither network nor server.
"""

import dataclasses
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from smc_mujoco.common import html
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import replacing, slug
from smc_mujoco.common.html import Html
from smc_mujoco.common.tabular import Tabular, as_cell
from smc_mujoco.common.text import number
from smc_mujoco.problems import suite
from smc_mujoco.problems.results import MEASURE, TITLES, QuestionBoard, Results, sound

WIDTH, HEIGHT = 320.0, 120.0  # of a picture of curves, in its own units
ASKS = {
    "forces": "Who stays nearest to the goal while something pushes?",
    "sensors": "Who stays nearest to the goal with a poor sensor?",
    "speed": "Who gets there first?",
    "calm": "Who moves the actuator least?",
}
SHOWN = 5  # best and worst problems on an entry's page


def build_pages(results: Path, out: Path) -> tuple[Path, list[str]]:
    """Write the pages of all results in a folder.

    Return the first page, and why results are left out.

    Raises:
      ScenarioError: no results there, or a folder that cannot be written.
    """
    suites, refused = sound(results)
    if not suites:
        if refused:
            why = str(refused[0])
        else:
            why = "enter a law first, with smc-mujoco enter FOLDER"
        raise ScenarioError(f"no results in {str(results)!r}: {why}")
    left_out = [str(error).replace(f"{results}{os.sep}", "") for error in refused]
    for of_suite in suites:
        folder = suite.folder(of_suite.suite, of_suite.seed)
        _write(out / f"{folder}.html", of_suite.title, _suite_page(of_suite, folder))
        for name in of_suite.entries:
            file = out / folder / f"{slug(name)}.html"
            _write(file, name, _entry_page(of_suite, name, folder))
    _write(out / "index.html", "Which law, for what?", _index(suites, left_out))
    return out / "index.html", left_out


def _write(path: Path, title: str, parts: Iterable[str]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as file:
        file.write_text(html.page(title, parts), encoding="utf-8", errors="replace")


def _index(suites: Sequence[Results], left_out: Sequence[str]) -> Iterator[str]:
    """Yield the parts of the first page."""
    yield _paragraph(
        "Laws that anybody can enter, on problems that everybody draws alike. No number joins the "
        "boards: what a law gains on one, it may pay on another."
    )
    for of_suite in suites:
        folder = suite.folder(of_suite.suite, of_suite.seed)
        rows = [["all boards", _link(of_suite.title, f"{folder}.html")]]
        for question, board in of_suite.boards().items():
            first = [standing.entry for standing in board.standings if standing.best]
            links = Html(", ".join(_link(name, _address(folder, name)) for name in first))
            rows.append([TITLES[question], links])
        counts = f"{len(of_suite.problems)} problems, {len(of_suite.entries)} entries"
        title = f"{of_suite.title}: {counts}"
        heads = "question", "first on its board"
        yield Tabular(headings=heads, rows=rows, title=title, name_columns=2).as_html()
    if left_out:
        yield Tabular(headings=("left out",), rows=[[why] for why in left_out]).as_html()


def _suite_page(of_suite: Results, folder: str) -> Iterator[str]:
    """Yield the parts of a suite's page: a board for each question."""
    yield _paragraph(
        "A star: no other entry is better over the problems, in a paired test. The interval of the "
        "mean rank is over the problems."
    ) + _paragraph(_link("all suites", "index.html"))
    for question, board in of_suite.boards().items():
        (table,) = board.tables
        rows = []
        for place, name, *numbers in table.rows:
            cell = as_cell(name)
            link = _link(cell.text, _address(folder, cell.text))
            rows.append([place, cell._replace(text=link), *numbers])
        table = dataclasses.replace(table, rows=rows, notes=[ASKS[question]])
        yield table.as_html() + _curves(of_suite, board)


def _entry_page(of_suite: Results, name: str, folder: str) -> Iterator[str]:
    """Yield the parts of an entry's page."""
    about = of_suite.entries[name].about
    entry = about["entry"]
    authors = ", ".join(entry["authors"])
    yield _paragraph(_link(of_suite.title, f"../{folder}.html")) + _paragraph(
        f"{authors} · {entry['source']} · {entry['licence']} · division “{entry['division']}”"
    )
    if about["failed"]:
        yield _paragraph(f"failed runs: {about['failed']}, as {'; '.join(about['failures'])}")
    yield of_suite.places(name).as_html()
    for kind, rows in extremes(of_suite, name).items():
        heads = "problem", "question", "place", "median"
        title = f"Where it is {kind}"
        yield Tabular(headings=heads, rows=rows, title=title, name_columns=2).as_html()
    ran = f"{about['instances']} instances of each problem, of the seed {about['seed']}."
    if about["sample"]:
        median, high, times = about["sample"]
        ran += (
            f" {1e9 * median:.0f} ns a sample (99 %: {1e9 * high:.0f} ns), {times:.1f} times pid’s."
        )
    yield _paragraph(
        f"{ran} Whoever wrote the table could invent it with its hash: smc-mujoco enter FOLDER "
        "--verify runs the entry again and compares each number."
    )
    hashes = {**about["hashes"], "entry": entry["digest"]}
    parts = [f"{what} {hashes[what][:16]}" for what in ("table", "rules", "entry")]
    versions = ", ".join(f"{package} {version}" for package, version in about["versions"].items())
    yield _paragraph(" · ".join([*parts, about["machine"], versions]))


def _paragraph(text: str) -> str:
    return f"<p>{html.text(text)}</p>"


def _link(text: str, address: str) -> Html:
    return Html(f'<a href="{html.text(address)}">{html.text(text)}</a>')


def _address(folder: str, entry: str) -> str:
    """Return the address of an entry's page from that of its suite."""
    return f"{folder}/{slug(entry)}.html"


def _curves(of_suite: Results, board: QuestionBoard) -> str:
    """Return the curve of targets of each entry as SVG, the first one's dark; "" if none is
    reached.
    """
    names = [standing.entry for standing in board.standings]
    if not any(standing.reached for standing in board.standings):
        return ""
    lines = []
    t, _ = of_suite.curve(names[0], board.question)
    x = WIDTH * t / t[-1]
    for name in names[::-1]:
        y = HEIGHT * (1.0 - of_suite.curve(name, board.question)[1])
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        look = 'stroke-width="2"' if name == names[0] else 'opacity="0.4"'
        title = f"<title>{html.text(name)}</title>"
        lines.append(f'<polyline points="{points}" {look}>{title}</polyline>')
    about = "Share of the targets that are reached by a time and kept"
    size = f'viewBox="-2 -4 {WIDTH + 4} {HEIGHT + 8}" style="display:block;max-width:30em"'
    svg = f'<svg {size} role="img" aria-label="{about}" fill="none" stroke="currentColor">'
    axis = f'<line x2="{WIDTH}" y1="{HEIGHT}" y2="{HEIGHT}" opacity="0.4"/>'
    words = f"{about}, from 0 to {t[-1]:g} s and 0 to 100 %. Dark: {names[0]}."
    return f"{svg}{axis}{''.join(lines)}</svg>{_paragraph(words)}"


def extremes(of_suite: Results, name: str) -> dict[str, list[tuple[str, str, str, str]]]:
    """Return "best" and "worst" -> where an entry stands so: problem, question, place among the
    entries, median.
    """
    index = list(of_suite.entries).index(name)
    places = []
    for question in of_suite.boards():
        ranks = of_suite.ranks(question)[index]
        for cell, rank in zip(of_suite.on(question), ranks, strict=True):
            median = of_suite.entries[name].medians[cell][MEASURE[question]]
            places.append((int(np.ceil(rank)), cell, TITLES[question], number(median)))
    places.sort(key=lambda row: row[0])
    rows = [(cell, title, f"{place}", median) for place, cell, title, median in places]
    return {"best": rows[:SHOWN], "worst": rows[::-1][:SHOWN]}
