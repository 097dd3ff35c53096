"""A paper is a folder: its template runs, its thresholds decide, and what is wrong with it is one
sentence.
"""

import math
import re
import shutil
from pathlib import Path

import pytest

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.evidence.audit import evidence
from smc_mujoco.evidence.audit.audit import audit, claims
from smc_mujoco.evidence.audit.claim_runs import ClaimRuns
from smc_mujoco.evidence.audit.paper import CODE_FILE, PAPER_FILE, new, paper
from smc_mujoco.evidence.audit.variants import with_gains
from smc_mujoco.evidence.audit.verdict import REFUTED, SUPPORTED, Beside, Check, Threshold

pytestmark = pytest.mark.quick

MINIMAL = """
title = "t"
authors = "a"
source = "s"
read = "full text"
[[claim]]
id = "1"
whose = "paper"
text = "it is small"
where = "p. 1"
function = "small"
holds_if = { size = "< 2" }
"""
SMALL = "def small(runs):\n    return {'size': 1.0}\n"


def test_no_paper_is_refused():
    with pytest.raises(ScenarioError, match="paper is None"):
        audit(paper=None)  # type: ignore[arg-type]


@pytest.fixture
def folder(tmp_path):
    """Write a folder of a paper: text of paper.toml and of claims.py; None for no such file."""

    def write(data: str | None = MINIMAL, code: str | None = SMALL) -> Path:
        home = tmp_path / "mine"
        shutil.rmtree(home, ignore_errors=True)
        home.mkdir()
        for name, text in (
            (PAPER_FILE, data),
            (CODE_FILE, code),
        ):
            if text is not None:
                (home / name).write_text(text)
        return home

    return write


# thresholds


@pytest.mark.parametrize(
    ("text", "value", "holds"),
    [
        ("< 2", 1.9, True),
        ("< 2", 2.0, False),
        ("<= 2", 2.0, True),
        ("> 2", 2.0, False),
        (">= 2", 2.0, True),
        ("2 +- 0.1", 2.05, True),
        ("2 +- 0.1", 1.95, True),
        ("2 +- 0.1", 2.11, False),
        ("2 ± 0.1", 1.89, False),
        ("2 to 15", 2.0, True),
        ("2 to 15", 15.5, False),
        ("2 to 15", 1.5, False),
        ("-1e-3 to .5", 0.0, True),
        ("< inf", 1e300, True),
        ("2 +- 0.1", math.nan, False),
        ("2 to 15", math.nan, False),
        ("2 to 15", math.inf, False),
    ],
)
def test_a_threshold_decides(text, value, holds):
    first, *beside = Threshold.read("size", text).evidence({"": value})
    assert isinstance(first, Check)
    assert first.holds == holds
    assert [number.value for number in beside] == (
        [] if text[0] in "<>" else [pytest.approx(value, nan_ok=True)]
    )


def test_each_case_has_its_check():
    checks = list(
        Threshold.read("size", "2 +- 0.1", "first").evidence({"duffing": 2.0, "arm": 3.0})
    )
    assert [type(check) for check in checks] == [Check, Beside] * 2
    assert [check.what for check in checks if isinstance(check, Beside)] == [
        "duffing: size",
        "arm: size",
    ]
    assert {check.sentence for check in checks if isinstance(check, Check)} == {"first"}


# the template


def test_the_template_runs_and_the_wrong_sign_loses_its_claims(tmp_path):
    written = new(tmp_path / "levant")
    assert [path.name for path in written] == [PAPER_FILE, CODE_FILE]
    template = paper(tmp_path / "levant")
    assert template.name == "levant"
    assert list(template.claims) == ["1", "2"]
    assert list(template.sets) == ["paper"]
    first, second = claims(paper=template)
    assert [first.verdict, second.verdict] == ["yes", SUPPORTED]  # a question, and a sentence
    assert list(first.numbers["paper"]) == [
        f"{plant}: ultimate bound / |x0|" for plant in template.claims["1"].plants
    ]
    assert list(second.numbers["paper"]) == ["exponent, distance from 2"]
    assert list(second.beside["paper"]) == ["exponent"] + [
        f"{k}: largest |s|" for k in template.claims["2"].values["periods"]
    ]
    with pytest.raises(ScenarioError, match="is there already"):
        new(tmp_path / "levant")


# laws of a paper's own

OWN = """
from smc_mujoco import law_function
@law_function(gains={{"k": 4.0}})
def {}(y, gains, memory):
    return -gains.k * y.e, y.e
"""


def test_a_law_of_the_paper_has_the_gains_of_the_set_and_its_mutants(folder):
    data = MINIMAL + (
        'plants = ["duffing"]\nlaws = ["soft"]\n[gains.hard.duffing]\nsoft = { k = 7.0 '
        "}\n[gains.own]"
    )
    code = (
        OWN.format("soft")
        + "def small(runs):\n    return {'size': runs.law('duffing', 'soft').gains['k'] / 4.0}\n"
    )
    (claim,) = claims(paper=folder(data, code))
    assert claim.numbers["hard"]["size"]["value"] == 7.0 / 4.0
    assert claim.numbers["own"]["size"]["value"] == 1.0
    mutants = ClaimRuns(
        paper(folder(data, code)), "own", substitute={"soft": lambda law: with_gains(law, k=12.0)}
    )
    assert mutants.law("duffing", "soft").gains["k"] == 12.0


def test_laws_plants_and_conditions_are_the_paper_s_the_suite_s_or_written_out(folder):
    data = MINIMAL + (
        '[plants]\nbent = { plant = "duffing", beta = 0.75 }\n[gains.paper]\nclassical = '
        "{ k = 3.0 }\n"
    )
    code = OWN.format("soft") + "made = soft(k=5.0)\n" + SMALL
    folder_paper = paper(folder("sets = ['paper', 'tuned', 'default']\n" + data, code))
    gains = lambda *names: dict(folder_paper.law(*names).gains)  # noqa: E731
    assert gains("duffing", "soft", "tuned") == gains("duffing", "soft", "paper") == {"k": 5.0}
    assert gains("duffing", "fixed_time", "tuned") == gains("duffing", "fixed_time", "default")
    assert gains("duffing", "classical", "tuned") != gains("duffing", "classical", "default")
    with pytest.raises(
        ScenarioError,
        match=r"the gains 'paper' of classical lack some.*write in .gains.paper. what.* c = ",
    ):
        folder_paper.law("duffing", "classical", "paper")
    assert folder_paper.plant("bent").parameters["beta"] == 0.75
    assert folder_paper.plant("duffing").name == "duffing"
    assert folder_paper.condition("noise").name == "noise"
    assert folder_paper.condition("far: x0=0.25").on(folder_paper.plant("bent"), 1.0)["x0"] == 0.25
    assert folder_paper.contents == "1 of its sentences; full text read"


def test_fields_are_the_paper_s_then_the_condition_s_the_claim_s_and_the_changes(folder):
    data = (
        'runs = "duration=1.0, seed=1, x0=0.1, u_max=1.0"\n'
        + MINIMAL
        + 'runs = "seed=3, u_max=3.0"\n'
    )
    folder_paper = paper(folder(data + '[conditions]\nfar = "x0=0.2, u_max=2.0"'))
    fields = (
        ClaimRuns(folder_paper, "default")
        .of(folder_paper.claims["1"])
        .scenario("duffing", "pid", "far", u_max=4.0)
    )
    assert fields.duration == 1.0
    assert fields.x0 == (0.2,)
    assert fields.seed == 3
    assert fields.u_max == 4.0
    assert fields.condition == "far"


def test_claims_may_import_other_files_of_their_folder(folder):
    home = folder(
        MINIMAL, "from .shared import VALUE\ndef small(runs):\n    return {'size': VALUE * 1.5}\n"
    )
    (home / "shared.py").write_text("VALUE = 1.0\n")
    (claim,) = claims(paper=home)
    assert claim.numbers["default"]["size"]["value"] == 1.5
    assert set(evidence.files(paper(home))) == {"paper.toml", "claims.py", "shared.py"}


# broken folders

BROKEN = [
    (None, SMALL),
    (MINIMAL, None),
    (MINIMAL.replace('"p. 1"', "p. 1"), SMALL),
    (MINIMAL, "def small(runs)\n    pass"),
    (MINIMAL, "import sys\nsys.exit(3)"),
    (MINIMAL, OWN.format("pid") + SMALL),
    (MINIMAL, "import numppy\n" + SMALL),
    (MINIMAL, "import smc_mujoco as smc\nsmc.plant('dufing')\n" + SMALL),
]
ADDED = [  # to the minimal paper.toml
    'over = "many"',
    'laws = ["pid"]\nover = "some"',
    'read = "some"',
    'plants = ["dufing"]',
    'plants = ["hevy"]\n[plants]\nheavy = { plant = "duffing" }',
    'conditions = ["farr"]\n[conditions]\nfar = "x0=2.0"',
    'conditions = ["friction=Coulom(1)+"]',
    'plants = "duffing"',
    'quantifier = "every"',
    'runs = "durations=1"',
    '[conditions]\nnoise = "seed=1"',
    '[plants]\nlight = { plant = "duffing", m = 1 }',
    '[plants]\narm = { plant = "arm.xml:elbow" }',
    "[gains.tuned]\npid = { kp = 1 }",
    'plants = ["duffing"]\nlaws = ["twisting"]\n[gains.paper]\ntwisting = { r1 = 5 }',
    "[allowed.pdi]\nkp = [1.0, 2.0]",
    '[allowed.pid]\nmargins = "larg"',
]
WRONG = [  # of paper.toml
    MINIMAL.replace('title = "t"', ""),
    MINIMAL.replace('source = "s"', 'source = " "'),
    MINIMAL.replace('"t"', "3"),
    MINIMAL.replace("title", "titel"),
    MINIMAL.replace('"full text"', '"most of it"'),
    MINIMAL.replace('"full text"', '"nothing"'),
    MINIMAL.split("[[claim]]", maxsplit=1)[0],
    MINIMAL.split("[[claim]]", maxsplit=1)[0] + "claim = 3",
    MINIMAL.split("[[claim]]", maxsplit=1)[0] + "claim = [3]",
    *(
        re.sub(f"\n{field} = .*", "", MINIMAL)
        for field in ("id", "text", "whose", "where", "function", "holds_if")
    ),
    MINIMAL.replace("{ size", "{ } # { size"),
    MINIMAL.replace("< 2", "small"),
    MINIMAL.replace('"< 2"', '{ aske = "< 2" }'),
    MINIMAL.replace("where", "wher"),
    MINIMAL.replace('"small"', '"smal"'),
    MINIMAL.replace('"paper"', '"mine"'),
    MINIMAL.replace('"paper"', '"derived"'),
    MINIMAL + MINIMAL.partition('s"\n')[2],
    'sets = ["mine"]\n' + MINIMAL,
    'quick_sets = ["mine"]\n' + MINIMAL,
    *(
        MINIMAL + f"[allowed.pid]\nkp = {ends}"
        for ends in ("[2.0, 1.0]", "[1, 1]", "[0, 1]", "[1]", '["a", 1]', "3")
    ),
    *(MINIMAL + added for added in ADDED),
]


def test_a_broken_folder_is_one_sentence(folder, refused):
    for data, code in (*BROKEN, *((data, SMALL) for data in WRONG)):
        refused(lambda data=data, code=code: paper(folder(data, code)))


def test_a_text_as_threshold_needs_checks(folder):
    data = MINIMAL.replace('{ size = "< 2" }', '"small"')
    with pytest.raises(ScenarioError, match="it returns numbers, and holds_if is a text"):
        claims(paper=folder(data))
    code = "from smc_mujoco.evidence.audit.verdict import check\n"
    code += "def small(runs):\n    return [check('size', 3, '<', 2)]\n"
    assert claims(paper=folder(data, code))[0].verdict == REFUTED


def test_a_check_takes_its_limit_from_the_file_and_may_be_relative_to_a_run(folder):
    data = MINIMAL.replace(
        '{ size = "< 2" }',
        '{ size = { asked = "< 2", sentence = "small" } }\nwords = "small, or so"',
    )
    code = "def small(runs):\n    it = runs.check('size', 'it', 5, times=3.0)\n"
    code += "    return [it, runs.check('size', 'other', 3)]\n"
    (claim,) = claims(paper=folder(data, code))
    assert claim.holds_if == "small, or so"
    assert claim.numbers["default"]["it"]["limit"] == 6.0
    assert claim.numbers["default"]["other"]["limit"] == 2.0
    assert {check.sentence for check in claim.checks("default")} == {"small"}
    assert [check.holds for check in claim.checks("default")] == [True, False]
    with pytest.raises(ScenarioError, match="unknown threshold 'sise'"):
        claims(paper=folder(data, code.replace("'size',", "'sise',")))


def test_an_edited_folder_is_read_again(folder):
    assert claims(paper=folder())[0].verdict == SUPPORTED
    (claim,) = claims(paper=folder(code=SMALL.replace("1.0", "7.0, 'also': {'a': 3}")))
    assert claim.verdict == REFUTED
    assert claim.beside == {"default": {"a: also": 3.0}}
