"""The pages of results: complete, small, without scripts or network, and with links that lead
somewhere.
"""

import hashlib
import html
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import write_json
from smc_mujoco.problems import enter, entry_runs, pages, suite
from smc_mujoco.problems.enter import RESULT, TABLE

pytestmark = pytest.mark.quick
PROBLEMS = suite.suite("smc-30@1")
VOID = {"meta", "line", "rect", "polyline", "br", "wbr", "img", "link"}


def entered(folder, name, factor, failures=()):
    """Write what an entry did: every measure of every run is a factor times that of the others."""
    target = folder / "smc-30@1" / name
    target.mkdir(parents=True)
    rng = np.random.default_rng(3)
    groups = []
    for cell in PROBLEMS:
        group = []
        for i in range(3):
            row = {}
            for column in entry_runs.COLUMNS[1:]:
                row[column] = factor * rng.uniform(0.1, 1.0)
            group.append({"problem": cell, "instance": i, "failed": 0.0} | row)
        groups.append(group)
    entry_runs.write_rows(target / TABLE, groups)
    table = hashlib.sha256((target / TABLE).read_bytes()).hexdigest()
    entry = dict.fromkeys(("source", "licence", "division", "digest"), "here")
    about = {
        "suite": "smc-30@1",
        "seed": 0,
        "instances": 3,
        "entry": entry | {"name": name, "authors": ["A <b>"]},
        "failed": len(failures),
        "failures": list(failures),
        "sample": [1e-8, 2e-8, 1.5],
        "hashes": {"table": table} | enter.rules_digests(PROBLEMS),
        "machine": "m",
        "versions": {},
    }
    write_json(target / RESULT, about)


class Page(HTMLParser):
    """The tags, ids and links of a page."""

    def __init__(self, text):
        super().__init__()
        self.open = []
        self.ids = []
        self.links = []
        self.tags = set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.tags.add(tag)
        self.ids += [values["id"]] if "id" in values else []
        if "href" in values:
            self.links += [values["href"]]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    for name, factor in (
        ("slow", 2.0),
        ("fast", 1.0),
    ):
        entered(folder / "results", name, factor)
    entered(folder / "results", "odd", 3.0, ["duffing/noise@1#00: it diverged"])
    return pages.build_pages(folder / "results", folder / "site")[0].parent


def test_pages_are_complete_and_their_links_lead_to_pages(site):
    files = sorted(site.rglob("*.html"))
    assert [str(file.relative_to(site)) for file in files] == [
        "index.html",
        "smc-30@1/fast.html",
        "smc-30@1/odd.html",
        "smc-30@1/slow.html",
        "smc-30@1.html",
    ]
    for file in files:
        page = Page(file.read_text(encoding="utf-8"))
        assert page.open == []
        assert len(page.ids) == len(set(page.ids))
        assert not page.tags & {"script", "img", "link"}
        for link in page.links:
            assert (file.parent / link).exists(), page.links
    assert sum(file.stat().st_size for file in files) < 200_000


def test_a_table_is_read_once_for_the_medians_and_once_for_each_board(site, monkeypatch):
    """Whatever the number of pages: else 43 entries take minutes, and 430 days."""
    read = list[str]()
    columns = entry_runs.EntryRuns.columns
    monkeypatch.setattr(
        entry_runs.EntryRuns,
        "columns",
        lambda self, name: (read.append(name), columns(self, name))[1],
    )
    pages.build_pages(site.parent / "results", site)
    on_boards = sum(len(suite.boards(name)) for name in PROBLEMS)
    assert len(read) == 3 * (len(PROBLEMS) + on_boards)


def test_a_board_lists_the_better_law_first_and_its_page_says_where_it_is_best(site):
    text = (site / "smc-30@1.html").read_text(encoding="utf-8")
    for board in re.findall(r"<table.*?</table>", text):
        assert re.findall(r'/(\w+)\.html"', board) == ["fast", "slow", "odd"]
    page = (site / "smc-30@1" / "odd.html").read_text(encoding="utf-8")
    for name, place in (("fast", 1), ("slow", 2), ("odd", 3)):
        page = (site / "smc-30@1" / f"{name}.html").read_text(encoding="utf-8")
        assert re.findall(r"\b(\d) of 3\b", page) == [str(place)] * 4
    for words in ("it diverged", "A &lt;b&gt;", "Where it is best", "Where it is worst"):
        assert words in page


def with_row(folder, table):
    """Change a table, and its hash in the result that stands beside it."""
    about = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    table(folder / TABLE)
    about["hashes"]["table"] = hashlib.sha256((folder / TABLE).read_bytes()).hexdigest()
    write_json(folder / RESULT, about)


def said(**change):
    """Return a change of what a result says."""

    def forge(folder):
        about = json.loads((folder / RESULT).read_text(encoding="utf-8"))
        write_json(folder / RESULT, about | change)

    return forge


FORGED = {
    "a table of others": (lambda folder: (folder / TABLE).write_bytes(b"PAR1"), "not the table"),
    "no table": (
        lambda folder: with_row(folder, lambda table: table.write_bytes(b"PAR1")),
        "not a table of runs",
    ),
    "one problem": (
        lambda folder: with_row(
            folder,
            lambda table: entry_runs.write_rows(table, [[{"problem": PROBLEMS[0], "instance": 0}]]),
        ),
        rf"1 runs of {PROBLEMS[0]}, not 3",
    ),
    "no JSON": (lambda folder: (folder / RESULT).write_text("{"), "not a result"),
    "no time": (said(sample=0.1), "its sample is"),
    "no entry": (said(entry=[]), "its entry is"),
    "an unknown suite": (said(suite="smc-99@1"), "unknown suite"),
    "other rules": (said(hashes=dict.fromkeys(("table", "rules", "suite"), "0")), "another rules"),
}


@pytest.mark.parametrize(("forge", "words"), FORGED.values(), ids=FORGED)
def test_a_forged_result_is_left_out_and_the_others_stand(tmp_path, forge, words):
    for name, factor in (
        ("slow", 2.0),
        ("aforged", 0.5),
    ):
        entered(tmp_path / "results", name, factor)
    forge(tmp_path / "results" / "smc-30@1" / "aforged")
    page, refused = pages.build_pages(tmp_path / "results", tmp_path / "site")
    (why,) = refused
    assert re.search(words, why)
    assert str(tmp_path) not in why
    assert why in html.unescape(page.read_text(encoding="utf-8"))
    assert "aforged" not in (tmp_path / "site" / "smc-30@1.html").read_text(encoding="utf-8")
    assert not (tmp_path / "site" / "smc-30@1" / "aforged.html").exists()
    with pytest.raises(ScenarioError, match=words):
        smc.results(tmp_path / "results")


def test_a_folder_without_results_is_told(tmp_path):
    with pytest.raises(ScenarioError, match="enter a law first"):
        pages.build_pages(tmp_path, tmp_path / "site")


def test_an_array_is_no_source_of_results():
    with pytest.raises(smc.ScenarioError, match=r": (give|choose)"):
        smc.results(np.ones(3))  # type: ignore[arg-type]
