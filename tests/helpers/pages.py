"""README and the pages of docs/, and the code blocks in them."""

import contextlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def blocks(text: str, language: str) -> list[str]:
    """The fenced blocks of one language."""
    return re.findall(
        rf"^```{language}(?: title=\"[^\"]+\")?\n(.*?)^```$", text, re.MULTILINE | re.DOTALL
    )


def titled(page: Path) -> dict[str, str]:
    """The files that a page has its reader write: name -> text."""
    titles_and_texts = re.findall(
        r"^```\w+ title=\"([^\"]+)\"\n(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL
    )
    return dict(titles_and_texts)


@contextlib.contextmanager
def beside(page: Path, folder: Path) -> Iterator[None]:
    """The page's files in a folder, and modules among them importable, for as long as it lasts."""
    path = sys.path[:]
    written = sys.dont_write_bytecode
    files = titled(page)
    for name, text in files.items():
        (folder / name).write_text(text)
    sys.path.insert(0, str(folder))
    sys.dont_write_bytecode = True
    try:
        yield
    finally:
        sys.path[:], sys.dont_write_bytecode = path, written
        for name in files:
            sys.modules.pop(Path(name).stem, None)
