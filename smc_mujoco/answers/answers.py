"""The templates of all answers: records of facts in, lines out. Nothing else joins sentences.

A line has a label of one or two words and a text. Numbers have three digits at most.
"""

import math
import textwrap
from collections.abc import Iterable, Sequence

from smc_mujoco.answers.facts import (
    Beware,
    Lead,
    More,
    NextStep,
    Open,
    Settles,
    Tied,
    Trails,
    Unranked,
    Use,
)
from smc_mujoco.common.text import joined, number

WIDTH = 80  # characters of a line
LINES = 24  # of a screen
Labelled = tuple[str, str]  # the label of a line, and its text


def labelled(pairs: Iterable[Labelled], width: int = WIDTH) -> list[str]:
    """Return lines with their labels at the left. A longer text goes on below itself. A text with
    ends of lines keeps them: a piece of a command cannot be pasted.
    """
    pairs = list(pairs)
    indent = max((len(label) for label, _ in pairs), default=0) + 2
    lines = []
    for label, text in pairs:
        head = label.ljust(indent)
        if "\n" in text:
            first, *below = text.splitlines()
            lines += [head + first, *(" " * indent + line for line in below)]
            continue
        hanging = textwrap.wrap(
            text,
            width,
            initial_indent=head,
            subsequent_indent=" " * indent,
            break_long_words=False,
            break_on_hyphens=False,
        )
        lines += hanging or [head.rstrip()]
    return lines


def percent(low: float, high: float = math.nan) -> str:
    """Return shares as text: "21 to 25 %", "21 %", "at least 21 %"."""
    least, most = (f"{100 * share:.2g}" if abs(share) < 0.995 else "100" for share in (low, high))
    if math.isnan(high):
        return f"at least {least} %"
    return f"{least} %" if least == most else f"{least} to {most} %"


def use(fact: Use) -> str:
    """Return "Use adrc (wc=30), unless settling first matters most: then my_law."."""
    gains = f" ({fact.gains})" if fact.gains else ""
    laws_by_aim: dict[str, list[str]] = {}
    for aim, law in fact.unless:
        laws_by_aim.setdefault(law, []).append(aim)
    exceptions = []
    for law, aims in laws_by_aim.items():
        matters = "matters" if len(aims) == 1 else "matter"
        exceptions.append(f"{joined(aims)} {matters} most: then {law}")
    unless = f", unless {'; or '.join(exceptions)}" if exceptions else ""
    return f"Use {fact.law}{gains}{unless}."


def leads(facts: Sequence[Lead]) -> list[Labelled]:
    """Return a line for each law: by how much it leads, and over which runner-up."""
    parts_by_law: dict[str, list[str]] = {}
    by_rival: dict[tuple[str, str], list[Lead]] = {}
    for fact in facts:
        by_rival.setdefault((fact.law, fact.rival), []).append(fact)
    for (law, rival), of_rival in by_rival.items():
        shares = []
        for fact in of_rival:
            if fact.gaps:
                shares.append(f"{fact.metric} defined in all runs, not in {fact.gaps}")
            else:
                shares.append(f"{fact.metric} {percent(fact.low, fact.high)}")
        parts_by_law.setdefault(law, []).append(f"{joined(shares)} below {rival}")
    return [(law, "; ".join(parts)) for law, parts in parts_by_law.items()]


def trails(fact: Trails) -> Labelled:
    """Return by how much a law is behind: "J 1.78 times adrc's; behind adrc and pid"."""
    times = f"{fact.metric} {number(fact.times)} times {fact.leader}'s"
    others = [law for law in fact.ahead if law != fact.leader]
    behind = f"; behind {joined(others)} too" if others else ""
    return fact.law, times + behind


def ties(facts: Sequence[Tied]) -> list[Labelled]:
    """Return the line of laws that are level, by metric."""
    parts = []
    for fact in facts:
        floor = f" (below {fact.floor})" if fact.floor else ""
        parts.append(f"{fact.metric}{floor}: {', '.join(fact.laws)}")
    return [("tied", "; ".join(parts))] if parts else []


def opens(facts: Sequence[Open]) -> list[Labelled]:
    """Return the line of laws of which none is shown to be better, by metric."""
    parts = []
    for fact in facts:
        doubt = ""
        if fact.sets_needed:
            doubt = f" (needs {fact.sets_needed} sets of gains)"
        elif fact.hidden < 1:
            doubt = f" (a lead below {percent(fact.hidden, fact.hidden)} would not show)"
        parts.append(f"{fact.metric}: {', '.join(fact.laws)}{doubt}")
    return [("open", "; ".join(parts))] if parts else []


def unranked(fact: Unranked) -> Labelled:
    """Return why no law can win in a metric."""
    return "no winner", f"{fact.metric}: {fact.reason}"


def settled(facts: Sequence[tuple[str, Settles]]) -> str:
    """Return how many runs of each law settled, in one sentence."""
    count = sum(fact.count for _, fact in facts)
    total = sum(fact.of for _, fact in facts)
    if count == total:
        return f"All {total} runs settled."
    if not count:
        return f"None of {total} runs settled."
    short = [f"{law} {fact.count} of {fact.of}" for law, fact in facts if fact.count < fact.of]
    return f"Settled: {joined(short)}; all runs of the others."


def beware(fact: Beware) -> Labelled:
    """Return what to know before use."""
    return fact.about, fact.sentence


def next_step(fact: NextStep) -> Labelled:
    """Return the one next step: a whole command, and what it is for."""
    return "next", f"{fact.command}\n{fact.purpose}"


def more(fact: More) -> Labelled:
    """Return where the evidence stands, and where words are explained."""
    contents = f" ({fact.contents})" if fact.contents else ""
    places = [f"{fact.report}{contents}"] if fact.report else []
    if fact.words:
        places.append(f"smc-mujoco explain {fact.words[0]}")
    return "more", "; ".join(places)
