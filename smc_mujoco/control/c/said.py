"""What a file in C says of its law: names and defaults of gains, size of memory, and what it is, in a comment."""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from smc_mujoco.common.errors import ScenarioError, shown, unknown, whole

DEFAULT_MEMORY = 8


def gains(facts: Mapping[str, Any], file: str, given: Mapping[str, float] | None) -> dict[str, float]:
    """Names and defaults: the file's, changed by what is given; or what is given."""
    text = facts.get("smc_law_gains")
    if text is None:
        return dict(given or {})
    said = parsed(text, f"{file}'s smc_law_gains")
    for key in given or {}:
        if key not in said:
            raise unknown(f"gain of {file}", key, said)
    return said | dict(given or {})


def parsed(text: str, what: str) -> dict[str, float]:
    """Gains as text, "lam=6,k1=3", as a dict."""
    found: dict[str, float] = {}
    for part in filter(None, (p.strip() for p in text.split(","))):
        key, equals, value = (word.strip() for word in part.partition("="))
        if key in found:
            raise ScenarioError(f"{what} is {shown(text)}: give {key} once")
        try:
            found[key] = float(value)
        except ValueError:
            found[key] = math.nan
        if not (equals and key.isidentifier()) or math.isnan(found[key]):
            raise ScenarioError(f"{what} is {shown(text)}: give names and numbers, such as lam=6,k1=3")
    return found


def memory(facts: Mapping[str, Any], given: int | None) -> int:
    """How many numbers of state a channel has: those given, those that the file says, or DEFAULT_MEMORY."""
    said = facts.get("smc_law_memory")
    return whole("memory", given if given is not None else DEFAULT_MEMORY if said is None else max(said, 1), 1, 10_000)


def comment(path: Path) -> str | None:
    """The comment that a C file begins with."""
    text = path.read_text(encoding="utf-8", errors="replace") if path.suffix == ".c" else ""
    found = re.match(r"\s*/\*+(.*?)\*/", text, re.DOTALL)
    return re.sub(r"^ ?\* ?", "", found[1], flags=re.MULTILINE).strip() if found else None
