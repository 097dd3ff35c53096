"""What is printed or drawn, without its numbers, for `assert words(...) == snapshot`.

A snapshot holds everything that one page, figure or command says at once; `pytest --snapshot-update` records it anew.
Numbers have tests of their own, and their last digits differ between processors.
"""

import re
import sys
from collections.abc import Iterable
from pathlib import Path

NUMBER = re.compile(r"[-+−]?\b\d+(?:[.,]\d+)*(?:e[-+]?\d+)?\b")
SPACE = re.compile(r"[ \t─━-]{2,}")  # widths of columns depend on numbers


def recorded(file: str, names: Iterable[str]) -> list[str]:
    """Return those names that the snapshots of a test file have as cases, so that a new one needs no recording at once.

    All of them while recording.
    """
    record = Path(file).parent / "__snapshots__" / f"{Path(file).stem}.ambr"
    if "--snapshot-update" in sys.argv or not record.exists():
        return list(names)
    text = record.read_text(encoding="utf-8")
    return [name for name in names if f"[{name}]\n" in text]


def words(text: str) -> str:
    """Return a text with # for its numbers, and one space for a run of spaces or of lines that rule a table."""
    lines = (SPACE.sub(" ", NUMBER.sub("#", line)).strip() for line in text.splitlines())
    return "\n".join(line for line in lines if line)
