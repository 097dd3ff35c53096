"""What is printed or drawn, without its numbers, for `assert words(...) == snapshot`.

Numbers have tests of their own, and their last digits differ between processors.
"""

import re
import sys
from collections.abc import Iterable
from pathlib import Path

NUMBER = re.compile(r"[-+−]?\b\d+(?:[.,]\d+)*(?:e[-+]?\d+)?\b")
SPACE = re.compile(r"[ \t─━-]{2,}")  # widths of columns depend on numbers


def recorded(file: str, names: Iterable[str]) -> list[str]:
    """Return those names that a test file's snapshots have as cases or at the start of a line; all
    while recording.

    So what is new needs no recording at once.
    """
    record = Path(file).parent / "__snapshots__" / f"{Path(file).stem}.ambr"
    if "--snapshot-update" in sys.argv or not record.exists():
        return list(names)
    text = record.read_text(encoding="utf-8")
    return [
        name
        for name in names
        if re.search(rf"(^  |\[|^ +'){re.escape(name)}(\(|\]$|':)", text, re.MULTILINE)
    ]


def words(text: str) -> str:
    """Return a text with # for its numbers, and one space for a run of spaces or of lines that rule
    a table.
    """
    lines = (SPACE.sub(" ", NUMBER.sub("#", line)).strip() for line in text.splitlines())
    return "\n".join(line for line in lines if line)
