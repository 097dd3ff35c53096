"""The report: one file from real runs that needs no other, counted from the data, and alive in a
real browser.

The browser is Chromium (Debian, Ubuntu: apt-get install chromium); without it these tests are
skipped, but not in CI.
"""

import dataclasses
import html.parser
import importlib
import itertools
import json
import math
import os
import re
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.commands import python

import smc_mujoco as smc
from smc_mujoco.analysis import chattering
from smc_mujoco.common import gl
from smc_mujoco.common.cache import cached
from smc_mujoco.control import gain_sets as gains
from smc_mujoco.evidence.report import answer, films, page, report, stages, words
from smc_mujoco.evidence.report import scores as scores_of
from smc_mujoco.evidence.report.plan import QUICK, Bars, Work
from smc_mujoco.evidence.report.scores import Score
from smc_mujoco.studies.leaderboard import leaderboard
from tests.evidence.report.test_report_page import Place, boards_of

TINY = dataclasses.replace(
    QUICK,
    plants=("duffing",),
    laws=("observer_free", "classical", "super_twisting"),
    conditions=("nominal", "noise"),
    seeds=2,
    duration=0.3,
    kinds=("delay",),
    attacks=2,
    compared=("delay",),
    basins=("duffing",),
    basin_laws=("observer_free", "classical"),
    points=(3, 2),
    region=5.0,
    claims=("3", "18"),
    scenes=(("duffing", "nominal"),),
    scene_laws=("observer_free", "classical"),
    scene=0.1,
    rigs=("qube_servo",),
    flights=("payload of 19 %",),
    flight_seeds=2,
    periods=(4e-3, 2e-3),
)
BROWSERS = (
    "chromium",
    "chromium-headless-shell",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
)
SWITCHES = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("report")


@pytest.fixture(scope="module", autouse=True)
def small_films_and_coarse_grid():
    """Films of a ninth of the pixels, and limit cycles on a sixth of the grid's points."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(films, "SIZE", (320, 180))
        patch.setattr(chattering, "GRID_FREQUENCIES", 24)
        patch.setattr(chattering, "GRID_AMPLITUDES", 15)
        yield


@pytest.fixture(scope="module")
def made(folder):
    """A report of tiny but real runs."""
    return report(folder, plan=TINY)


@pytest.fixture(scope="module")
def text(made):
    return made.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def findings(made, folder):
    """What that report tells, read back from its folder."""
    return stages.find(TINY, folder, None, Bars(False))


def test_the_worst_run_of_a_law_of_flight_is_its_largest_error(findings):
    payload = smc.condition("payload of 19 %", mismatch={"payload": 0.006})
    runs = smc.grid("quadrotor", "geometric", payload, seeds=2, gains="default", duration=6.0)
    bounds = [smc.score(trace)["ultimate_bound"] for trace in smc.run(runs)]
    assert findings.flight.worst["payload of 19 %", "geometric"] == max(bounds) > min(bounds)


class Reader(html.parser.HTMLParser):
    """Ids and references of a page, and the cells of its tables."""

    def __init__(self, text):
        super().__init__()
        self.ids = []
        self.targets = []
        self.rows = {}
        self.table = ""
        self.cell = None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        its = dict(attrs)
        self.ids += [its["id"]] if "id" in its else []
        names = ("src", "href", "srcset", "poster", "action", "data", "xlink:href")
        self.targets += [its[name] for name in names if its.get(name)]
        if tag == "table":
            self.table = its.get("id", "")
        elif tag == "tr":
            self.rows.setdefault(self.table, []).append((its, []))
        elif tag == "td" and self.table:
            self.cell = [its, ""]
            self.rows[self.table][-1][1].append(self.cell)

    def handle_endtag(self, tag):
        if tag == "td":
            self.cell = None

    def handle_data(self, data):
        if self.cell is not None:
            self.cell[1] += data


@pytest.fixture(scope="module")
def reader(text):
    return Reader(text)


# one file


def test_the_report_is_one_file_under_20_megabytes(made):
    assert made.name == "report.html"
    assert made.stat().st_size < 20e6


def test_it_refers_to_nothing_outside_itself(text, reader):
    outside = [target for target in reader.targets if not target.startswith(("#", "data:"))]
    assert outside == []
    styles = "".join(re.findall(r"<style>.*?</style>", text, re.S))
    assert "url(" not in styles
    assert "@import" not in styles


def test_a_policy_in_the_file_forbids_what_is_not_in_it(text):
    assert "default-src 'none'" in text.split("<title>")[0]


def test_every_link_within_the_page_has_its_target_and_every_id_is_there_once(reader):
    assert sorted(reader.ids) == sorted(set(reader.ids))
    assert {target[1:] for target in reader.targets if target.startswith("#")} <= set(reader.ids)


def test_every_column_of_numbers_and_every_number_links_to_a_definition(text):
    for table in re.findall(r'<table class="sortable.*?</table>', text, re.S):
        heads = re.findall(r'<th [^>]*class="number".*?</th>', table, re.S)
        cells = re.findall(r'<td class="number[^>]*>(.*?)</td>', table, re.S)
        assert all('href="#' in head for head in heads)
        assert all('href="#' in cell or cell == "–" for cell in cells)


def test_tables_have_captions_pictures_texts_and_the_page_a_language(text):
    assert '<html lang="en"' in text
    assert len(re.findall(r"<table[ >]", text)) == text.count("<caption>")
    assert all('alt="' in image for image in re.findall(r"<img [^>]*>", text))
    assert all('aria-label="' in plot for plot in re.findall(r'<div class="plot"[^>]*>', text))


# what it says is what was found


def test_the_leaderboard_has_the_numbers_of_the_scores(reader, findings):
    known = {(s.plant, s.condition, s.law): {} for s in findings.scores}
    for s in findings.scores:
        known[s.plant, s.condition, s.law][s.metric] = s
    rows = [row for row in reader.rows["leaderboard"] if row[1]]
    assert len(rows) == len(known) == 6
    for its, cells in rows:
        scores = known[its["data-plant"], its["data-condition"], its["data-law"]]
        for metric, (attributes, shown) in zip(words.TABLE_METRICS, cells[3:], strict=True):
            assert float(attributes["data-v"]) == scores[metric].median
            assert shown.startswith(words.number(scores[metric].median))


def test_scores_are_the_medians_of_the_tables_runs(folder, findings):
    from smc_mujoco.studies.table import Table

    table = Table.read(folder / "study").select(law="classical", condition="noise")
    score = next(
        s
        for s in findings.scores
        if (s.law, s.condition, s.metric) == ("classical", "noise", "itae")
    )
    assert score.median == pytest.approx(np.median(table.column("itae")), rel=1e-12)
    assert score.seeds == 2


def test_a_score_counts_its_law_s_failed_runs(made, folder):
    from smc_mujoco.studies.table import Table

    table = Table.read(folder / "study")
    cells = list(zip(*(table.column(name) for name in ("plant", "condition", "law")), strict=True))
    at = table.data.schema.get_field_index("failure")
    failed = table.data.set_column(at, "failure", [["it failed", *[None] * (len(table) - 1)]])
    table = dataclasses.replace(table, data=failed)
    rows = scores_of.scores(table, leaderboard(table, words.TABLE_METRICS, by=("plant",)))
    assert {(s.plant, s.condition, s.law) for s in rows if s.failed == 1} == {cells[0]}
    assert {s.failed for s in rows} == {0, 1}


def test_the_first_line_counts_what_was_run(text, findings):
    (line,) = re.findall(r'<p class="sub">(\d+) runs .*?>(\w+) failed</a>(.*?) seeds each', text)
    runs = int(line[0])
    failed = line[1]
    factors = [int(number) for number in re.findall(r"\d+", line[2])]
    assert (runs, failed, factors) == (12, "none", [1, 3, 2, 2])  # plants, laws, conditions, seeds
    assert math.prod(factors) == runs == findings.about.runs


def test_a_scene_has_the_gains_of_the_report(folder, findings, monkeypatch):
    drawn = []
    monkeypatch.setattr(films, "curves", lambda traces, title: drawn.extend(traces) or b"")
    work = Work(
        plan=dataclasses.replace(TINY, filmed=0), folder=folder, threads=None, bars=Bars(False)
    )
    (scene,) = stages.all_scenes(work)
    assert scene.laws == findings.scenes[0].laws == TINY.scene_laws
    assert [trace.scenario.law for trace in drawn] == [
        gains.law("duffing", law, seed=0) for law in TINY.scene_laws
    ]


def test_margins_are_found_under_every_set_of_gains(findings):
    assert list(findings.by_set) == ["tuned", "study", "tracking"]
    assert findings.by_set["tuned"] == findings.margins


def test_the_gains_of_every_set_stand_beside_each_other(reader, findings):
    rows = {its["data-law"]: cells for its, cells in reader.rows["gains-table"] if cells}
    assert list(rows) == list(TINY.laws)
    sets = list(dict.fromkeys(row.set for row in findings.about.gains))
    for row in findings.about.gains:
        assert row.gains in rows[row.law][2 + sets.index(row.set)][1]


THIRTEEN = (
    *(
        "observer_free",
        "classical",
        "boundary_layer",
        "adaptive",
        "super_twisting",
        "conditioned_super_twisting",
    ),
    *(
        "implicit_super_twisting",
        "twisting",
        "nonsingular_terminal",
        "fixed_time",
        "integral",
        "disturbance_observer",
    ),
    "pid",
)


def test_thirteen_laws_have_colours_and_short_names_of_their_own(monkeypatch):
    monkeypatch.setattr(gains, "COMPARED", THIRTEEN)
    assert len({words.colour(law) for law in THIRTEEN}) == 13
    assert len({words.short(law) for law in THIRTEEN}) == 13
    assert max(len(words.short(law)) for law in THIRTEEN) <= 3
    assert words.colour("classical") == words.style.law_colour("classical")
    assert words.law("pid") == "PID"
    near = (
        words.style.distance(words.colour(f"law_{k}"), words.colour("super_twisting"))
        for k in range(300)
    )
    assert min(near) > words.style.MIN_DISTANCE  # a user's law, of any name
    mine = [f"law_{k}" for k in range(8)]  # of installed packages, in one report
    monkeypatch.setattr(words, "known_laws", lambda: SimpleNamespace(added=mine), raising=False)
    several = itertools.combinations(map(words.colour, mine), 2)
    assert min(words.style.distance(*pair) for pair in several) > 11.0


def test_what_comes_from_outside_is_escaped(findings):
    evil = "<script>alert(1)</script>"
    scores = tuple(s._replace(law=evil) if s.law == "classical" else s for s in findings.scores)
    boards = boards_of([Place(evil, wins=2)], 2)
    shown = page.page(dataclasses.replace(findings, scores=scores, boards=boards))
    assert evil not in shown
    assert "&lt;script&gt;alert(1)" in shown


def test_a_law_and_a_verdict_that_nobody_foresaw_are_shown(findings):
    claim = dataclasses.replace(
        findings.claims[0], verdict="not testable", numbers={}, beside={}, verdicts={}, note="x"
    )
    scores = tuple(s._replace(law="mine") for s in findings.scores if s.law == "classical")
    boards = boards_of([Place("mine")], 2)
    few = dataclasses.replace(
        findings,
        claims=(claim,),
        scores=scores,
        boards=boards,
        margins=(),
        basins=(),
        fronts=(),
        scenes=(),
        fields=(),
    )
    assert "mine" in page.page(few)


# the answer


def scores(condition="nominal", plant="duffing", runs=16, **medians):
    """One cell's scores of settling time; the laws within 0.1 of the best are level with it."""
    level = [law for law, m in medians.items() if m <= min(medians.values()) + 0.1]
    wins = {law: level == [law] and len(medians) > 1 for law in medians}
    return [
        Score(
            *(
                plant,
                condition,
                law,
                "settling_time",
                m,
                m,
                m,
                best,
                not best,
                wins[law],
                "",
                16,
                0,
                runs,
                "16 seeds",
            ),
            floor=0.0,
        )
        for law, m in medians.items()
        for best in [law in level]
    ]


def told(findings, *cells):
    """The answer, of these cells alone."""
    few = dataclasses.replace(
        findings, scores=tuple(score for cell in cells for score in cell), boards=()
    )
    return sentences(few, ["settling_time"])


def sentences(findings, metrics):
    return " ".join([answer.first(findings, metrics), answer.sure(findings, metrics)])


def test_a_law_that_is_level_with_one_that_seldom_settles_keeps_it_from_winning(findings):
    cell = []
    for s in scores(observer_free=1.0, classical=math.inf):
        cell.append(s._replace(best=True, wins=False))
    assert answer.leaders(answer.cells(cell), "duffing", "nominal", "settling_time") == [
        "observer_free",
        "classical",
    ]
    assert "wins" not in told(findings, cell)


def test_a_law_alone_does_not_win(findings):
    assert "wins" not in told(findings, scores(classical=1.0))


def test_where_the_papers_law_loses_is_listed_worst_first():
    lost = answer.losses(
        answer.cells(scores(observer_free=3.0, classical=1.0, adaptive=2.0)), ["settling_time"]
    )
    assert [(loss.law, loss.times) for loss in lost] == [("classical", 3.0)]
    assert (
        answer.losses(answer.cells(scores(observer_free=1.0, classical=3.0)), ["settling_time"])
        == []
    )
    calm = scores(observer_free=1.0, classical=math.inf)
    calm += [s._replace(metric="tv_rate") for s in scores(observer_free=2.0, classical=1.0)]
    (one,) = answer.losses(answer.cells(calm), ["tv_rate"])
    assert (one.law, one.settles) == ("classical", False)
    small = [s._replace(floor=0.5) for s in scores(observer_free=3.0, classical=0.1)]
    (one,) = answer.losses(answer.cells(small), ["settling_time"])
    assert (one.times, one.rounded) == (6.0, True)  # over the least difference that counts
    never = answer.losses(
        answer.cells(scores(observer_free=math.inf, classical=1.0)), ["settling_time"]
    )
    assert never[0].times == math.inf


def test_a_cell_without_leaders_says_of_which_kind_it_is():
    def why(*cell):
        return answer.nobody(answer.cells(cell), cell[0].plant, cell[0].condition, cell[0].metric)

    a, b = scores(observer_free=3.0, classical=1.0)
    failing = [one._replace(failed=1) for one in (a, b)]
    assert why(*failing) == why(failing[0], b._replace(median=math.inf)) != why(failing[0], b)
    assert "beaten" in why(failing[0], b)


def picked(findings, *places):
    one = answer.pick(dataclasses.replace(findings, boards=boards_of(places, 4)), "itae", "duffing")
    assert one
    return one


def test_the_law_to_take_is_beaten_in_the_fewest_conditions_then_has_the_best_mean_rank(findings):
    one = picked(
        findings,
        Place("a", 2, 2, 1.0),
        Place("b", 1, 0, 3.0),
        Place("c", 1, 0, 2.0),
        Place("d", plant="x"),
    )
    assert (one.law, one.others) == ("c", ("b",))
    assert one.sure == "unbeaten in 3 of 4"
    assert (
        picked(findings, Place("a", 4, median=2.0), Place("b", 1, 1)).sure
        == "unbeaten in 3 of 4, wins in 1"
    )
    assert picked(findings, Place("a", 0, 4)).sure == "wins in all 4"
    failing = Place("a", 1, mean=1.0)._replace(failed=2)
    assert picked(findings, failing, Place("b", 1, mean=2.0)).law == "b"
    unbeaten = picked(findings, Place("a"), Place("b"), Place("c"))
    assert (unbeaten.law, unbeaten.sure) == (
        "",
        "all 3 laws unbeaten in each of 4",
    )  # none is named, by the alphabet
    boards = boards_of([Place("a"), Place("b")], 2)
    for block in boards[0].blocks:
        block.level = True
    level = answer.pick(dataclasses.replace(findings, boards=boards), "itae", "duffing")
    assert level is not None
    assert level.sure == "all 2 laws level in each of 2"
    assert picked(findings, Place("a", 4)).sure == "unbeaten in none of 4"
    assert answer.pick(dataclasses.replace(findings, boards=()), "itae", "duffing") is None


def test_a_law_that_seldom_settles_is_not_one_to_take(findings):
    def settling(law, share):
        return Place(law, metric="settles", median=share)

    calm = Place("idle")
    other = Place("pid", 3)
    assert picked(findings, calm, other, settling("idle", 0.39), settling("pid", 0.8)).law == "pid"
    calm = Place("idle", wins=1)
    assert picked(findings, calm, other, settling("idle", 0.41), settling("pid", 0.8)).law == "idle"


def test_the_papers_verdict_is_one_line_that_counts(findings):
    cells = [
        *scores(observer_free=2.0, classical=1.0),
        *scores("noise", observer_free=1.0, classical=3.0),
        *scores("sine", observer_free=1.0, classical=1.0),
    ]
    claims = []
    for v in ("supported", "refuted", "refuted"):
        claims.append(dataclasses.replace(findings.claims[0], verdict=v))
    beside = dataclasses.replace(claims[0], whose="derived")  # not counted
    few = dataclasses.replace(findings, scores=tuple(cells), claims=(*claims, beside))
    for quick, less in ((False, ""), (True, " audited quickly under one set of gains,")):
        about = dataclasses.replace(
            findings.about, plan=dataclasses.replace(findings.about.plan, quick=quick)
        )
        assert answer.verdict(dataclasses.replace(few, about=about), ["settling_time"]) == (
            "The paper: its observer-free law is beaten in 1 of 3 comparisons and wins in 1; of its 3 checked claims,"
            f"{less} 1 is supported and 2 are refuted."
        )
    failing = []
    for s in scores("step", observer_free=math.inf, classical=math.inf):
        failing.append(s._replace(best=False, beaten=True))
    with_failing = dataclasses.replace(few, scores=(*cells, *failing), claims=())
    assert "beaten in 1 of 4 comparisons" in answer.verdict(
        with_failing, ["settling_time"]
    )  # as the table of losses
    unclear = [s._replace(best=False, beaten=False) for s in failing]
    few_samples = dataclasses.replace(with_failing, scores=(*cells, *unclear))
    assert "too few samples to tell in 1" in answer.verdict(few_samples, ["settling_time"])
    none = dataclasses.replace(few, scores=(), claims=())
    assert answer.verdict(none, ["settling_time"]) == ""


def test_the_report_tells_what_was_not_done(text, findings):
    assert "Nothing was tried on hardware" in text
    assert "encoder" in findings.about.left_out  # a condition of the full grid that this one lacks
    assert re.search(r"Left out by this plan: [^<]*\bencoder\b", text)


@pytest.mark.parametrize(
    ("what", "target"),
    [
        ("duffing: settling time, s", "metric-settling_time"),
        ("duffing tv_rate / classical", "metric-tv_rate"),
        ("inverted_pendulum: TV rate, over that of classical", "metric-tv_rate"),
        ("largest step with noise, over lambda", "verdict"),  # there is a metric called ise
    ],
)
def test_a_check_leads_to_the_metric_that_it_names(what, target):
    assert page.link(what) == target


def test_a_cell_in_which_nothing_settles_has_no_leader():
    found = answer.cells(scores(observer_free=math.inf, classical=math.inf))
    assert answer.leaders(found, "duffing", "nominal", "settling_time") == []


def test_the_chosen_gains_of_a_front_are_on_it():
    for front in stages.fronts(TINY):
        assert front.chosen in set(zip(front.tracking, front.variation, strict=True))


# started again


@pytest.mark.slow
def test_what_is_there_is_not_computed_again(made, folder, monkeypatch):
    for name in (
        "analysis.region_of_attraction.basin",
        "analysis.margins.margins",
        "evidence.report.stages.audit",
        "evidence.report.films.film",
        "studies.executors.result_columns",
    ):
        module, _, function = f"smc_mujoco.{name}".rpartition(".")
        monkeypatch.setattr(importlib.import_module(module), function, None)  # not to be called
    before = made.read_text(encoding="utf-8")
    again = report(folder, plan=TINY).read_text(encoding="utf-8")
    line = re.compile(r"<tr><th scope=\"row\">time</th>.*")
    assert line.sub("", again) == line.sub("", before)


def test_a_killed_stage_leaves_nothing_and_other_arguments_repeat_a_stage(tmp_path):
    def killed():
        raise KeyboardInterrupt

    def keep(depends, make):
        write = lambda found, path: path.write_text(json.dumps(found))  # noqa: E731
        return cached(
            tmp_path / "a.json", depends, make, write, lambda path: json.loads(path.read_text())
        )

    with pytest.raises(KeyboardInterrupt):
        keep([1], killed)
    assert list(tmp_path.iterdir()) == []
    assert keep([1], lambda: "one") == keep([1], killed) == "one"
    assert keep([2], lambda: "two") == "two"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.slow
def test_without_a_renderer_the_report_says_so_in_one_sentence(folder, findings, monkeypatch):
    monkeypatch.setattr(gl, "missing", lambda: "no film: nothing renders here: install a renderer")
    without = stages.find(dataclasses.replace(TINY, filmed=1), folder, None, Bars(False))
    assert without.scenes[0].film is None
    shown = page.page(without)
    assert "There are no films here: nothing renders here: install a renderer" in shown
    assert "<video" not in shown


def test_the_command_is_light_to_import():
    code = "import smc_mujoco.evidence.commands.report, sys; print(*sys.modules)"
    assert {"mujoco", "numba", "jinja2", "pyarrow", "scipy"} & set(
        python("-c", code).stdout.split()
    ) == set()


# in a browser


@pytest.fixture(scope="module")
def browser():
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        hint = "no Chromium to open the report in: apt-get install chromium"
        pytest.fail(hint) if os.environ.get("CI") else pytest.skip(hint)
    sync = pytest.importorskip("playwright.sync_api")
    with sync.sync_playwright() as play:
        opened = play.chromium.launch(executable_path=path, args=SWITCHES)
        yield opened
        opened.close()


class Seen:
    """A page in the browser, with all that it said and asked for."""

    def __init__(self, browser, url, width=1400, scheme="light"):
        self.said = []
        self.asked = []
        self.page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
        self.page.on(
            "console",
            lambda m: self.said.append(m.text) if m.type in ("error", "warning") else None,
        )
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(url)
        self.page.wait_for_selector("html[data-ready]", timeout=60_000)


@pytest.fixture(scope="module")
def seen(browser, made):
    return Seen(browser, made.as_uri())


def test_the_page_has_no_error_and_asks_for_nothing(seen, made):
    assert seen.said == []
    assert [
        url for url in seen.asked if not url.startswith(("data:", "blob:")) and url != made.as_uri()
    ] == []


def test_every_chart_is_drawn(seen, findings):
    counts = seen.page.eval_on_selector_all(
        ".plot > svg", "all => all.map(svg => svg.querySelectorAll('path').length)"
    )
    # with medians, accuracy, field, fronts, machines and flight
    assert len(counts) == 6 + len(TINY.kinds) + len(TINY.basins) + len(TINY.scenes)
    assert min(counts) > 10


@pytest.mark.skipif(gl.missing() is not None, reason="nothing renders here")
def test_a_film_plays(seen):
    film = seen.page.locator("video").first
    played = film.evaluate(
        """async film => {
          await film.play();
          for (let k = 0; k < 100 && film.currentTime === 0; k++) await new Promise(done => setTimeout(done, 50));
          const found = [film.currentTime, film.videoWidth, film.videoHeight];
          film.pause();
          return found;
        }"""
    )
    assert played[0] > 0
    assert played[1:] == list(films.SIZE)


def column(page, table, k):
    """The shown values of a table's column k, from the top."""
    return page.eval_on_selector_all(
        f"#{table} tbody tr:not([hidden])", f"rows => rows.map(row => row.cells[{k}].dataset.v)"
    )


def test_clicking_a_header_sorts_and_clicking_again_sorts_the_other_way(seen):
    page = seen.page
    page.select_option('select[data-table="leaderboard"][data-column="condition"]', "")
    head = page.locator("#leaderboard th").nth(3 + words.TABLE_METRICS.index("itae"))
    head.locator("button").click()
    up = [float(v) for v in column(page, "leaderboard", 3 + words.TABLE_METRICS.index("itae"))]
    assert up == sorted(up)
    assert len(set(up)) > 1
    assert head.get_attribute("aria-sort") == "ascending"
    head.locator("button").click()
    assert [
        float(v) for v in column(page, "leaderboard", 3 + words.TABLE_METRICS.index("itae"))
    ] == up[::-1]
    page.locator("#leaderboard th button").nth(2).click()
    laws = column(page, "leaderboard", 2)
    assert laws == sorted(laws)


def test_filtering_hides_the_other_rows(seen):
    page = seen.page
    page.select_option('select[data-table="leaderboard"][data-column="condition"]', "noise")
    page.select_option('select[data-table="leaderboard"][data-column="law"]', "classical")
    assert column(page, "leaderboard", 1) == ["noise"]
    assert page.inner_text('[data-count="leaderboard"]') == "1 of 6 rows"
    page.select_option('select[data-table="leaderboard"][data-column="law"]', "")
    assert len(column(page, "leaderboard", 1)) == 3


def test_claims_are_filtered_by_verdict_and_open_to_their_numbers(seen, findings):
    page = seen.page
    for button in page.locator(".verdicts").all():
        button.click()
        wanted = button.get_attribute("data-verdict")
        shown = page.eval_on_selector_all(
            ".claim:not([hidden])", "all => all.map(one => one.dataset.verdict)"
        )
        if wanted not in ("", "flips"):
            assert shown
            assert set(shown) == {wanted}
    page.locator(".verdicts").first.click()
    first = page.locator(".claim").first
    assert not first.locator("dl").is_visible()
    first.locator("summary").click()
    assert words.pretty(findings.claims[0].holds_if) in first.inner_text()


def test_a_number_leads_to_its_definition(seen):
    seen.page.locator("#leaderboard tbody tr:not([hidden]) td.number a").first.click()
    assert seen.page.evaluate("location.hash") == "#metric-settling_time"
    assert seen.page.evaluate("document.querySelector(':target').tagName") == "DT"


def test_a_phone_shows_it_without_scrolling_sideways_and_what_scrolls_takes_the_keyboard(
    browser, made
):
    phone = Seen(browser, made.as_uri(), 420).page
    assert phone.evaluate("document.documentElement.scrollWidth") == 420
    assert (
        phone.eval_on_selector_all(
            ".chart, .wide",
            "all => all.filter(a => a.scrollWidth > a.clientWidth + 1 && a.tabIndex < 0).length",
        )
        == 0
    )
    box = phone.locator(".wide:has(#picks)")
    assert box.evaluate("a => a.scrollWidth > a.clientWidth + 50")
    shades = box.evaluate("a => getComputedStyle(a)")["backgroundAttachment"]
    assert (
        shades == "local, local, local, scroll, scroll, scroll"
    )  # shadows at edges, which ends of the table cover
    name = phone.locator("#picks tbody th").first
    left = name.evaluate("a => a.getBoundingClientRect().left")
    box.evaluate("a => a.scrollTo(200, 0)")
    assert name.evaluate("a => a.getBoundingClientRect().left") == left
    phone.close()


def contrast(a, b):
    """The contrast of two colours, 1 to 21 (WCAG 2.2)."""
    parts = [np.array(words.style.rgb(colour)) / 255 for colour in (a, b)]
    linear = []
    for c in parts:
        linear.append(
            np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
            @ (0.2126, 0.7152, 0.0722)
        )
    return (max(linear) + 0.05) / (min(linear) + 0.05)


def colours(page, selector, what):
    """The colours of what a selector finds, "#rrggbb"."""
    found = page.eval_on_selector_all(
        selector, f"all => [...new Set(all.map(e => getComputedStyle(e).{what}))]"
    )
    parts = []
    for one in found:
        if "rgb" in one:
            parts.append(([float(v) for v in re.findall(r"[\d.]+", one)[:3]], "srgb" in one))
    return {
        "#{:02x}{:02x}{:02x}".format(*(round(v * (255 if share else 1)) for v in rgb))
        for rgb, share in parts
    }


def test_in_the_dark_letters_and_laws_are_legible_in_charts_too(browser, made):
    night = Seen(browser, made.as_uri(), scheme="dark")
    (back,) = colours(night.page, "body", "backgroundColor")
    letters = colours(night.page, "#figure-medians g[transform*=scale]", "fill")
    assert min(contrast(colour, back) for colour in letters) > 4.5
    marks = colours(night.page, "#figure-medians g:has(> title) use", "fill") - {back}
    assert min(contrast(colour, back) for colour in marks) > 2.5
    assert len(marks) >= len(TINY.laws)
    for media in (
        {"media": "print"},
        {"media": "screen", "color_scheme": "light"},
    ):  # on paper all is dark on white
        night.page.emulate_media(**media)
        by_day = colours(night.page, "#figure-medians g[transform*=scale]", "fill")
        assert min(contrast(colour, "#ffffff") for colour in by_day) > 4.5
    assert colours(night.page, "body", "backgroundColor") == {"#ffffff"}
    assert night.said == []
    night.page.close()


@pytest.mark.slow
def test_it_prints_with_everything_open(seen, tmp_path):
    seen.page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    assert seen.page.locator(".claim:not([open])").count() == 0
    seen.page.evaluate("window.dispatchEvent(new Event('afterprint'))")
    printed = seen.page.pdf(path=str(tmp_path / "report.pdf"), prefer_css_page_size=True)
    assert printed.startswith(b"%PDF")
    assert seen.said == []
