"""What a user reads has none of the phrases that CONTRIBUTING lists as read twice, and calls no law
best without saying beside which rivals, under what, and with what noise.
"""

import ast
import re

import pytest
from helpers.pages import PAGES, ROOT

import smc_mujoco as smc

pytestmark = pytest.mark.quick

RULES = ROOT / "CONTRIBUTING.md"
TWICE = dict(re.findall(r'^\| "(.+?)" \| "(.+?)" \|$', RULES.read_text(), re.MULTILINE))
SOURCES = [*(ROOT / "smc_mujoco").rglob("*.py"), *(ROOT / "scenes").glob("*.py")]


def texts(path):
    """The words of a page, or those in a source's strings, in one line each."""
    if path.suffix == ".md":
        return [" ".join(path.read_text().split())]
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.append(" ".join(node.value.split()))
    return found


def test_no_page_and_no_message_has_a_phrase_that_reads_twice():
    assert len(TWICE) >= 10
    for path in [*PAGES, *SOURCES]:
        for text in texts(path):
            for phrase, better in TWICE.items():
                assert phrase.lower() not in text.lower(), f'{path}: "{phrase}": say "{better}"'


# names of laws, as they stand in a sentence
KNOWN = "|".join({*smc.laws(), *smc.laws(kind="joint")} - {"none"})
LAW = rf"(?:`?(?:{KNOWN})`?|"
LAW += r"[Ss]uper-twisting|[Ss]liding mode|[Ss]liding laws?|ADRC|PID|INDI|[Oo]bservers?|hodob)"
# "A is the best", "A, the first on ..", "A wins", "A beats B"
CALLED = re.compile(
    rf"(?<![\w-]){LAW}(?![\w-])[^.:;|]{{0,60}}?"
    r"(?:\b(?:is|are|was|were|comes?|ranks?|be)\b[^.:;|]{0,30}(?<!of )\b(?:best|first|winners?)\b(?!-)"
    r"|, the (?:best|first|winner)\b|\b(?:wins|beats)\b)"
)
OTHERS = re.compile(rf"rival|other law|{LAW}")
UNDER = re.compile(r"load|condition|friction|delay|spring|calm|task|theorem|sine|\bJ\b")


def unqualified(text):
    """The sentences that call a law best, without rivals, condition and noise."""
    found = []
    for sentence in re.split(r"(?<=[.:;!?])\s", text):
        if CALLED.search(sentence) and not (
            len(OTHERS.findall(sentence)) > 1 and UNDER.search(sentence) and "noise" in sentence
        ):
            found.append(sentence)
    return found


@pytest.mark.parametrize(
    ("sentence", "is_said"),
    [
        ("Super-twisting is best at rejecting a load.", False),
        ("`adrc` wins.", False),
        ("Super-twisting, the first on the rigid joint, falls behind.", False),
        ("Under a load and without noise `hodob` beats `pid`.", True),
        ("The classical first-order sliding mode is the sign of s.", True),
        ("ADRC, whose observer is of first order.", True),
    ],
)
def test_a_law_that_is_called_best_is_found(sentence, is_said):
    assert bool(unqualified(sentence)) != is_said


def test_no_law_is_called_best_without_its_rivals_the_condition_and_the_noise():
    for path in [*PAGES, *SOURCES]:
        for text in texts(path):  # what a command prints has its own tests
            assert not unqualified(re.sub(r"```.*?```", "", text)), path
