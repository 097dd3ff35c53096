"""What a user reads has none of the phrases that CONTRIBUTING lists as read twice."""

import ast
import re

import pytest
from helpers.pages import PAGES, ROOT

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
