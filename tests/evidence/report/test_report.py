"""The report: one file from real runs that needs no other, with the numbers of `compare`, and alive
in a real browser.

The browser is Chromium (Debian, Ubuntu: apt-get install chromium). Without it these tests are
skipped, but not in CI.
"""

import dataclasses
import html.parser
import re
from types import SimpleNamespace
from typing import Any

import pytest
from helpers.browser import browser
from helpers.commands import python

import smc_mujoco as smc
from smc_mujoco.common import extras
from smc_mujoco.common.tabular import Cell
from smc_mujoco.evidence.audit.verdict import Claim
from smc_mujoco.evidence.report import page, report, sections
from smc_mujoco.evidence.report.plan import QUICK
from smc_mujoco.studies.table import Table

LAWS = ("observer_free", "classical", "super_twisting")
GRID = dataclasses.replace(
    QUICK.grid,
    plants=("duffing",),
    laws=LAWS,
    conditions=("nominal", "noise"),
    seeds=2,
    duration=0.3,
)
TINY = dataclasses.replace(
    QUICK,
    grid=GRID,
    kinds=("delay",),
    claims=("3", "18"),
    scenes=("duffing",),
    scene=0.1,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("report")


@pytest.fixture(scope="module")
def made(folder):
    """A report of tiny but real runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sections, "FILM_SIZE", (320, 180))
        yield report(folder, plan=TINY)


class Reader(html.parser.HTMLParser):
    """Ids and references of a page."""

    def __init__(self, text):
        super().__init__()
        self.ids = []
        self.targets = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            elif name in ("src", "href", "srcset", "poster", "action", "data"):
                self.targets.append(value)


def check_page(text):
    """Refuse a page that needs another file, or has a link without target."""
    found = Reader(text)
    outside = []
    for at in found.targets:
        if not at.startswith(("#", "data:")):
            outside.append(at)
    assert outside == []
    assert "default-src 'none'" in text.split("<title>")[0]
    assert sorted(found.ids) == sorted(set(found.ids))
    assert {at[1:] for at in found.targets if at.startswith("#")} <= set(found.ids)


def test_the_report_is_one_file_that_needs_no_other(made):
    assert made.name == "report.html"
    check_page(made.read_text(encoding="utf-8"))


def test_its_tables_are_those_of_compare(made, folder):
    runs = Table.read(folder / "compared")
    text = made.read_text(encoding="utf-8")
    assert f"{len(runs)} runs of 0.3 s: 1 plants, 3 laws, 2 conditions, 2 seeds of each" in text
    for table in smc.leaderboard(runs, ["itae"], by=("plant", "condition")).tables:
        for _, cell in table.rows:
            assert f"{cell.text}<br>" in text  # each median, above its interval


def test_a_second_call_computes_nothing(made, folder, monkeypatch):
    before = made.read_bytes()
    monkeypatch.delattr(sections, "audit")
    monkeypatch.delattr(sections.margin_search, "margins")
    monkeypatch.setattr(sections, "FILM_SIZE", (320, 180))
    monkeypatch.setattr(sections.video, "film", None)
    assert len(report(folder, plan=TINY).read_bytes()) == pytest.approx(len(before), rel=0.01)


def block(condition="nominal", plant="duffing", winner=None, **unbeaten):
    """Boards of one cell: metric -> the laws that no other beats; all settle by default."""
    boards = []
    for metric, best in ({"settles": "a b c"} | unbeaten).items():
        its = SimpleNamespace(
            plant=plant,
            condition=condition,
            best=best.split(),
            winner=winner if best else None,
        )
        boards.append(SimpleNamespace(metric=metric, blocks=[its]))
    return boards


def leading(*cells) -> Any:
    """The first line of the first screen: its cell of ITAE."""
    boards = []
    for cell in cells:
        for board in cell:
            boards.append(board)
    return sections.leaders(boards).rows[0][1 + sections.METRICS.index("itae")]


@pytest.mark.parametrize(
    ("cells", "cell"),
    [
        ([block(itae="a", winner="a")], Cell("a", "unbeaten in 1 of 1, 1 won", strong=True)),
        ([block(itae="a b")], Cell("a, b", "unbeaten in 1 of 1")),
        (
            [block(itae="a", winner="a"), block("noise", itae="a b")],
            Cell("a", "unbeaten in 2 of 2, 1 won"),
        ),
        (
            [block(itae="a b c d e", settles="a b c d e")],
            Cell("any of 5 laws", "unbeaten in 1 of 1"),
        ),
        ([block(itae="a b", settles="b c")], Cell("b", "unbeaten in 1 of 1")),
        ([block(itae="")], Cell("no law")),
    ],
    ids=["winner", "level", "most", "many", "a calm law that never settles", "nobody"],
)
def test_the_first_screen_names_the_laws_that_are_unbeaten_in_the_most_conditions(cells, cell):
    assert leading(*cells) == cell


def test_what_comes_from_outside_is_escaped():
    evil = "<script>alert(1)</script>"
    texts = dict.fromkeys(("text", "where", "measured", "holds_if", "note", "how"), evil)
    checks = {
        evil: {
            "value": 1.0,
            "relation": "<",
            "limit": 2.0,
            "holds": True,
        }
    }
    claim = Claim(
        id="1",
        **texts,
        verdict="supported",
        numbers={"tuned": checks},
        beside={"tuned": {}},
        verdicts={"tuned": "supported"},
        flips=False,
    )
    shown = page.claims([claim]) + page.text(evil) + page.heading(evil)
    assert evil not in shown
    assert shown.count("&lt;script&gt;alert(1)") == 10


def test_a_report_needs_its_packages(tmp_path, monkeypatch):
    monkeypatch.setattr(extras, "missing", lambda *_: "install it")
    with pytest.raises(extras.MissingPackageError, match="install it"):
        report(tmp_path)


def test_the_command_is_light_to_import():
    code = "import smc_mujoco.evidence.commands.report, sys; print(*sys.modules)"
    heavy = {"mujoco", "numba", "jinja2", "pyarrow", "scipy"}
    assert heavy & set(python("-c", code).stdout.split()) == set()


@pytest.fixture(scope="module")
def seen(made):
    """The page in a browser, and all errors and requests."""
    with browser() as chromium:
        tab = chromium.new_page(viewport={"width": 420, "height": 900})
        errors = []
        asked = []
        tab.on("console", lambda message: errors.append(message.text))
        tab.on("pageerror", lambda error: errors.append(str(error)))
        tab.on("request", lambda request: asked.append(request.url))
        tab.goto(made.as_uri())
        yield SimpleNamespace(page=tab, errors=errors, asked=asked)


def test_the_page_has_no_error_asks_for_nothing_and_fits_a_phone(seen, made):
    outside = []
    for url in seen.asked:
        if not url.startswith("data:"):
            outside.append(url)
    assert outside == [made.as_uri()]
    assert seen.errors == []
    assert seen.page.evaluate("document.documentElement.scrollWidth") == 420
    broken = "all => all.filter(image => !image.naturalWidth).length"
    assert seen.page.eval_on_selector_all("img", broken) == 0


def test_claims_are_filtered_by_verdict_and_open_to_their_numbers(seen):
    tab = seen.page
    for pick in tab.locator("input.only").all():
        pick.check()
        shown = tab.locator(".claim:visible")
        verdicts = set()
        for row in shown.all():
            verdicts.add(row.get_attribute("data-verdict"))
        assert verdicts == {pick.get_attribute("data-of")}
    first = tab.locator(".claim:visible").first
    assert not first.locator("table").first.is_visible()
    first.locator("summary").click()
    assert re.search(r"[✓✗]", first.inner_text())
