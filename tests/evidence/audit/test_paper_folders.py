"""A paper is a folder: its template runs, its thresholds decide, and what is wrong with it is one sentence."""

import math
import re
import shutil
from pathlib import Path

import pytest

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.evidence.audit import evidence, template
from smc_mujoco.evidence.audit.audit import claims
from smc_mujoco.evidence.audit.paper import CODE, FILE, new, paper
from smc_mujoco.evidence.audit.runs import Runs
from smc_mujoco.evidence.audit.variants import with_gains
from smc_mujoco.evidence.audit.verdict import REFUTED, SUPPORTED, Beside, Check, Threshold

pytestmark = pytest.mark.quick

TEMPLATE = Path(template.__file__).parent
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


@pytest.fixture
def folder(tmp_path):
    """Write a folder of a paper: text of paper.toml and of claims.py; None for no such file."""

    def write(data: str | None = MINIMAL, code: str | None = SMALL) -> Path:
        home = tmp_path / "mine"
        shutil.rmtree(home, ignore_errors=True)
        home.mkdir()
        for name, text in ((FILE, data), (CODE, code)):
            if text is not None:
                (home / name).write_text(text)
        return home

    return write


# thresholds


@pytest.mark.parametrize(
    ("text", "value", "holds"),
    [
        ("< 2", 1.9, True), ("< 2", 2.0, False), ("<= 2", 2.0, True), ("> 2", 2.0, False), (">= 2", 2.0, True),
        ("2 +- 0.1", 2.05, True), ("2 +- 0.1", 1.95, True), ("2 +- 0.1", 2.11, False), ("2 ± 0.1", 1.89, False),
        ("2 to 15", 2.0, True), ("2 to 15", 15.5, False), ("2 to 15", 1.5, False), ("-1e-3 to .5", 0.0, True),
        ("< inf", 1e300, True), ("2 +- 0.1", math.nan, False), ("2 to 15", math.nan, False),
        ("2 to 15", math.inf, False),
    ],
)  # fmt: skip
def test_a_threshold_decides(text, value, holds):
    first, *beside = Threshold.read("size", text).evidence({"": value})
    assert isinstance(first, Check)
    assert first.holds == holds
    assert [one.value for one in beside] == ([] if text[0] in "<>" else [pytest.approx(value, nan_ok=True)])


@pytest.mark.parametrize("text", ["2", "== 2", "2 +- ", "15 to 2", "a to b", "", 2, None, "< 2 %"])
def test_what_is_no_threshold_is_refused(text):
    with pytest.raises(ScenarioError, match="the threshold of 'size' is"):
        Threshold.read("size", text)


def test_each_case_has_its_check():
    checks = list(Threshold.read("size", "2 +- 0.1", "first").evidence({"duffing": 2.0, "arm": 3.0}))
    assert [type(one) for one in checks] == [Check, Beside] * 2
    assert [one.what for one in checks if isinstance(one, Beside)] == ["duffing: size", "arm: size"]
    assert {one.sentence for one in checks if isinstance(one, Check)} == {"first"}


# the template


def test_the_template_runs_and_the_wrong_sign_loses_its_claims(tmp_path):
    written = new(tmp_path / "levant")
    assert [path.name for path in written] == [FILE, CODE]
    found = paper(tmp_path / "levant")
    assert (found.name, list(found.claims), list(found.sets)) == ("levant", ["1", "2"], ["paper"])
    assert [one.verdict for one in claims(paper=found)] == ["yes", SUPPORTED]  # a question, and a sentence
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
    data = MINIMAL + 'plants = ["duffing"]\nlaws = ["soft"]\n[gains.hard.duffing]\nsoft = { k = 7.0 }\n[gains.own]'
    code = OWN.format("soft") + "def small(runs):\n    return {'size': runs.law('duffing', 'soft').gains['k'] / 4.0}\n"
    (one,) = claims(paper=folder(data, code))
    assert one.numbers["hard"]["size"]["value"] == 7.0 / 4.0
    assert one.numbers["own"]["size"]["value"] == 1.0
    (other,) = claims(paper=folder(data, code), substitute={"soft": lambda law: with_gains(law, k=12.0)})
    assert other.numbers["own"]["size"]["value"] == 3.0


def test_fields_are_the_paper_s_then_the_condition_s_the_claim_s_and_the_changes(folder):
    data = 'runs = "duration=1.0, seed=1, x0=0.1, u_max=1.0"\n' + MINIMAL + 'runs = "seed=3, u_max=3.0"\n'
    found = paper(folder(data + '[conditions]\nfar = "x0=0.2, u_max=2.0"'))
    one = Runs(found, "default").of(found.claims["1"]).scenario("duffing", "pid", "far", u_max=4.0)
    assert (one.duration, one.x0, one.seed, one.u_max, one.condition) == (1.0, (0.2,), 3, 4.0, "far")


def test_claims_may_import_other_files_of_their_folder(folder):
    home = folder(MINIMAL, "from .shared import VALUE\ndef small(runs):\n    return {'size': VALUE * 1.5}\n")
    (home / "shared.py").write_text("VALUE = 1.0\n")
    (one,) = claims(paper=home)
    assert one.numbers["default"]["size"]["value"] == 1.5
    assert set(evidence.files(paper(home))) == {"paper.toml", "claims.py", "shared.py"}


# broken folders

BROKEN = [
    (None, SMALL, "no paper at .*paper.toml"),
    (MINIMAL, None, "no claims.py in .*mine"),
    (MINIMAL.replace('"p. 1"', "p. 1"), SMALL, r"paper.toml is no TOML: .*line 10"),
    (MINIMAL.replace('title = "t"', ""), SMALL, "paper.toml: no title: write one"),
    (MINIMAL.replace("title", "titel"), SMALL, "paper.toml: unknown field 'titel': did you mean 'title'"),
    (MINIMAL.split("[[claim]]", maxsplit=1)[0], SMALL, "no claims: write each under a line"),
    (MINIMAL.replace("holds_if", "# holds_if"), SMALL, "claim 1: it has no threshold"),
    (MINIMAL.replace("{ size", "{ } # { size"), SMALL, "claim 1: it has no threshold"),
    (MINIMAL.replace("< 2", "small"), SMALL, "claim 1: the threshold of 'size' is 'small'"),
    (MINIMAL.replace("where", "wher"), SMALL, "claim 1: unknown field 'wher': did you mean 'where'"),
    (MINIMAL.replace('"small"', '"smal"'), SMALL, "unknown function of claims.py 'smal': did you mean 'small'"),
    (MINIMAL + 'plants = ["dufing"]', SMALL, "claim 1: unknown plant 'dufing': did you mean 'duffing'"),
    (MINIMAL + 'laws = ["clasical"]', SMALL, "claim 1: unknown law 'clasical'"),
    (MINIMAL + 'conditions = ["noisy"]', SMALL, "claim 1: unknown condition 'noisy'"),
    (MINIMAL + 'plants = ["hevy"]\n[plants]\nheavy = { plant = "duffing" }', SMALL, "'hevy': did you mean 'heavy'"),
    (MINIMAL + 'conditions = ["farr"]\n[conditions]\nfar = "x0=2.0"', SMALL, "'farr': did you mean 'far'"),
    (MINIMAL + 'plants = "duffing"', SMALL, "claim 1: plants is 'duffing': write a list of names"),
    (MINIMAL + 'quantifier = "every"', SMALL, "claim 1: unknown quantifier 'every'"),
    (MINIMAL + 'runs = "durations=1"', SMALL, "unknown field of a scenario in runs 'durations'"),
    (MINIMAL + 'runs = "duration 1"', SMALL, "claim 1: runs is 'duration 1'"),
    (MINIMAL + MINIMAL.partition('s"\n')[2], SMALL, "claim 1 is there twice"),
    (MINIMAL + '[conditions]\nnoise = "seed=1"', SMALL, "condition 'noise' is a name of the suite"),
    (MINIMAL + '[conditions]\nworn = "friction=Coulom(1)"', SMALL, "conditions.worn: unknown part, signal or est"),
    (MINIMAL + '[plants]\nlight = { plant = "duffing", m = 1 }', SMALL, "plants.light: unknown parameter of duffing"),
    (MINIMAL + '[plants]\narm = { plant = "arm.xml:elbow" }', SMALL, "plants.arm: no .* at .*arm.xml"),
    (MINIMAL + "[gains.tuned]\npid = { kp = 1 }", SMALL, "gains.tuned is a set of the suite"),
    ('sets = ["mine"]\n' + MINIMAL, SMALL, "unknown set of gains in sets 'mine'"),
    (
        MINIMAL + 'plants = ["duffing"]\nlaws = ["twisting"]\n[gains.paper]\ntwisting = { r1 = 5 }',
        SMALL,
        "write in .gains.paper. what the paper has for r2 = 2.3",
    ),
    (
        MINIMAL + 'plants = ["duffing"]\nlaws = ["pid"]\n[gains.paper]\npid = { kq = 1 }',
        SMALL,
        "claim 1: unknown gain of pid 'kq'",
    ),
    (MINIMAL, "def small(runs)\n    pass", "claims.py, line 1: expected ':'"),
    (MINIMAL, "import sys\nsys.exit(3)", "claims.py, line 2: SystemExit, 3"),
    (MINIMAL, OWN.format("pid") + SMALL, "law 'pid' of claims.py has the name of a law of the library"),
    (MINIMAL, "import numppy\n" + SMALL, "claims.py, line 1: ModuleNotFoundError, No module named 'numppy'"),
]


@pytest.mark.parametrize(("data", "code", "sentence"), BROKEN)
def test_a_broken_folder_is_one_sentence(folder, data, code, sentence):
    with pytest.raises(ScenarioError, match=sentence) as caught:
        paper(folder(data, code))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("returned", "sentence"),
    [
        ("1 / 0", "claims.py, line 2: function small of claim 1 raised ZeroDivisionError, division by zero"),
        ("None", "mine: function small of claim 1: it returns None: return measure -> number"),
        ("{'sizes': 1.0}", "it returns no 'size', of which holds_if is: its measures are sizes"),
        ("{'size': {}}", "it returns no 'size'"),
        ("{'size': 'large'}", "it returns 'large' for 'size'"),
        ("{'size': {'arm': None}}", "it returns None for 'size', 'arm'"),
        ("runs.scenario('dufing', 'pid')", "function small of claim 1: unknown plant 'dufing'"),
        ("runs.law('duffing', 'pid', kq=1)", "unknown gain of pid 'kq'"),
    ],
)
def test_a_function_that_fails_is_one_sentence(folder, returned, sentence):
    with pytest.raises(ScenarioError, match=re.escape(sentence)):
        claims(paper=folder(code=f"def small(runs):\n    return {returned}\n"))


def test_a_text_as_threshold_needs_checks(folder):
    data = MINIMAL.replace('{ size = "< 2" }', '"small"')
    with pytest.raises(ScenarioError, match="it returns numbers, and holds_if is a text"):
        claims(paper=folder(data))
    code = (
        "from smc_mujoco.evidence.audit.verdict import check\ndef small(runs):\n    return [check('size', 3, '<', 2)]\n"
    )
    assert claims(paper=folder(data, code))[0].verdict == REFUTED
    with pytest.raises(ScenarioError, match="it returns checks, and none for 'size' of holds_if: return numbers, or"):
        claims(paper=folder(code=code))


def test_a_check_takes_its_limit_from_the_file_and_may_be_relative_to_a_run(folder):
    data = MINIMAL.replace(
        '{ size = "< 2" }', '{ size = { asked = "< 2", sentence = "small" } }\nwords = "small, or so"'
    )
    code = "def small(runs):\n    return [runs.check('size', 'it', 5, times=3.0), runs.check('size', 'other', 3)]\n"
    (one,) = claims(paper=folder(data, code))
    assert one.holds_if == "small, or so"
    assert (one.numbers["default"]["it"]["limit"], one.numbers["default"]["other"]["limit"]) == (6.0, 2.0)
    assert {check.sentence for check in one.checks("default")} == {"small"}
    assert [check.holds for check in one.checks("default")] == [True, False]
    with pytest.raises(ScenarioError, match="unknown threshold 'sise'"):
        claims(paper=folder(data, code.replace("'size',", "'sise',")))


def test_an_edited_folder_is_read_again(folder):
    assert claims(paper=folder())[0].verdict == SUPPORTED
    (one,) = claims(paper=folder(code=SMALL.replace("1.0", "7.0, 'also': {'a': 3}")))
    assert (one.verdict, one.beside) == (REFUTED, {"default": {"a: also": 3.0}})


def test_a_paper_that_is_none_is_refused():
    with pytest.raises(ScenarioError, match="unknown paper 'levannt'"):
        paper("levannt")
    with pytest.raises(ScenarioError, match=r"no folder './levant' with a paper.toml"):
        paper("./levant")
