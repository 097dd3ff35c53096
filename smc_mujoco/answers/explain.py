"""What the words of answers and tables mean, from docs/words.md."""

import re
import textwrap
from functools import cache

from smc_mujoco.common.errors import find
from smc_mujoco.common.files import shipped

WIDTH = 80  # characters of a line
LINK = re.compile(r"\[([^\]]*)\]\(([^)]*)\)")
LAST_LINKS = re.compile(rf":?\s+{LINK.pattern}(?:, {LINK.pattern})*\.?$")  # that only point on


@cache
def glossary() -> dict[str, str]:
    """Return word -> its entry, in Markdown, under the words of its heading as they stand there.

    A heading has several words, separated by commas; a remark in brackets is no word.
    """
    page = (shipped("docs") / "words.md").read_text(encoding="utf-8")
    entries = {}
    for section in page.split("\n## ")[1:]:
        heading, _, body = section.partition("\n")
        for word in re.sub(r"\(.*?\)", "", heading).split(","):
            entries[word.strip()] = body.strip()
    return entries


def meaning(word: str) -> str:
    """Return the first two sentences of what a word means."""
    paragraph, *_ = _paragraphs(glossary()[word])
    return " ".join(re.split(r"(?<=\.)\s(?=[A-Z`])", paragraph)[:2]).replace("`", "")


def _paragraphs(body: str) -> list[str]:
    """Return the paragraphs of an entry as text, each on one line."""
    paragraphs = []
    for paragraph in body.split("\n\n"):
        text = LINK.sub(r"\1", LAST_LINKS.sub(".", paragraph)).replace("$", "")
        paragraphs.append(" ".join(text.split()))
    return paragraphs


def explain(word: str) -> str:
    """Return what a word means, in lines of at most 80 characters.

    Raises:
      ScenarioError: a word that the glossary lacks. The message names near ones.
    """
    entries = glossary()
    plain = {name.casefold(): name for name in entries}
    typed = " ".join(word.split())
    entry = plain.get(typed.casefold()) or plain.get(typed.casefold().removesuffix("s")) or typed
    body = find("word", entry, entries)
    pages = dict.fromkeys(address for _, address in LINK.findall(body))
    lines = [entry]
    for paragraph in _paragraphs(body):
        lines += textwrap.wrap(paragraph, WIDTH, break_on_hyphens=False)
    if pages:
        places = [page if "/" in page else f"docs/{page}" for page in pages]
        lines += textwrap.wrap(f"See {', '.join(places)}.", WIDTH, break_on_hyphens=False)
    return "\n".join(lines)
