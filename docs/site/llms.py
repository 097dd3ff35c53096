"""llms.txt: the pages of the site and their headings, for language models (llmstxt.org)."""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

MAX_HEADINGS = 8  # of a page


def text(nav: Iterable, docs: Path) -> str:
    """Return llms.txt for the site's contents and the folder of its pages."""
    head = "# smc_mujoco\n\n> A MuJoCo benchmark suite for sliding-mode controllers."
    return "\n".join([head, *_lines(nav, docs)]) + "\n"


def _lines(nav: Iterable, docs: Path) -> Iterator[str]:
    for group in nav:
        for title, pages in group.items():
            yield f"\n## {title}\n"
            for page in _written(pages, docs):
                yield _line(page, (docs / page).read_text(encoding="utf-8"))


def _written(pages: Iterable, docs: Path) -> Iterator[str]:
    """Yield the pages of a group that are files of docs, and not made by the build."""
    for page in pages:
        if isinstance(page, dict):
            for below in page.values():
                yield from _written([below] if isinstance(below, str) else below, docs)
        elif (docs / page).exists() and page.count("/") == 0:
            yield page


def _line(page: str, markdown: str) -> str:
    """Return the line of a page: its title, its address and its headings."""
    prose = re.sub(r"^```.*?^```", "", markdown, flags=re.MULTILINE | re.DOTALL)
    title = re.search(r"^# (.*)", prose, re.MULTILINE)
    headings = re.findall(r"^## (.*)", prose, re.MULTILINE)[:MAX_HEADINGS]
    name = title[1] if title else "Overview"
    return f"- [{name}]({page.removesuffix('.md')}.html): {'; '.join(headings)}".removesuffix(": ")
