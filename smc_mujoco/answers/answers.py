"""The lines of all answers: records of facts in, lines out. Nothing else joins sentences.

A line has a label of one or two words and a text, from `templates`. Numbers have three digits at
most.
"""

import itertools
import math
import shlex
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from smc_mujoco.answers.command import PROGRAM, doubted
from smc_mujoco.answers.facts import (
    Barred,
    Contest,
    Fact,
    Lead,
    NextStep,
    NotRanked,
    Open,
    Screen,
    Span,
    Tied,
    Trails,
    Verdict,
)
from smc_mujoco.answers.templates import LARGEST, is_said, said
from smc_mujoco.common import html
from smc_mujoco.common.tabular import Tabular

WIDTH = 80  # characters of a line
LINES = 24  # of a screen
BELOW = 2  # lines that a command prints below a screen, such as its files
MAX_CONTESTS = 5  # that have a block each; more have one table of winners
SHARE = "settled runs"  # the metric that is a share
ON_PLANT = "J"  # the metric that is of all conditions of a plant
Labelled = tuple[str, str]  # the label of a line, and its text
Judged = Verdict | Trails | NotRanked
# in their order -> the kind of fact, and the fields in which those on one line agree
KINDS: dict[type, tuple[str, tuple[str, ...]]] = {
    Lead: ("lead", ("law", "rival")),
    Trails: ("trails", ("law", "metric")),
    Tied: ("tied", ("laws",)),
    Open: ("open", ("laws", "needed", "unit")),
    Barred: ("barred", ("laws", "defaults")),
    NotRanked: ("not ranked", ("samples", "needed", "unit")),
}


class ScreenPart(NamedTuple):
    """What is said of some numbers: their tables between a heading and notes, the law to use, and
    lines below it.
    """

    heading: Sequence[Fact] = ()
    tables: Sequence[Tabular] = ()
    notes: Sequence[Fact] = ()
    advice: Sequence[Fact] = ()
    pairs: Sequence[Labelled] = ()


def blocks(screen: Screen) -> list[ScreenPart]:
    """Return what a screen says: a block for each contest, or one for many; the rest; the next
    step, and where there is more.
    """
    contests = screen.contests
    said_of = [_winners(contests)] if len(contests) > MAX_CONTESTS else [*map(block_of, contests)]
    if screen.heading or screen.tables or screen.notes:
        heading = [screen.heading] if screen.heading else []
        said_of.append(ScreenPart(heading, screen.tables, screen.notes))
    pairs = lines_of(screen.facts)
    if screen.next:
        pairs.append(next_step(screen.next))
    if screen.report or screen.word:
        explained = f"{PROGRAM} explain {screen.word}" if screen.word else ""
        pairs.append(("more", "; ".join(filter(None, (screen.report, explained)))))
    return [*said_of, ScreenPart(pairs=pairs)] if pairs else said_of


def screen_lines(screen: Screen) -> list[str]:
    """Return the answer of a result: what was asked, its tables, what is best, what to do next.

    Facts for which a screen has no room are counted.
    """
    *said_of, last = blocks(screen) or [ScreenPart()]
    parts = ["\n".join(_part_lines(block)) for block in said_of]
    lines = "\n\n".join(parts).splitlines()
    gap = [""] if any(block.tables for block in said_of) else []
    if not screen.contests and screen.facts:
        count = len(lines_of(screen.facts))
        ends = last.pairs[count:]
        room = LINES - BELOW - len([*lines, *gap, *labelled(ends)])
        last = last._replace(pairs=[*_fitting(last.pairs[:count], room), *ends])
    return [*lines, *gap, *_part_lines(last)]


def _part_lines(block: ScreenPart) -> list[str]:
    """Return the lines of a block."""
    lines = _paragraph(block.heading)
    for k, table in enumerate(block.tables):
        lines += [*[""] * (k > 0), *str(table).splitlines()]
    lines += _paragraph(block.notes)
    if block.advice:
        lines += ["", *_paragraph(block.advice)]
    return [*lines, *labelled(block.pairs)]


def screen_html(screen: Screen) -> str:
    """Return an answer as HTML, whose lines the browser breaks."""
    parts = []
    for block in blocks(screen):
        parts += [_html(block.heading), *(table._repr_html_() for table in block.tables)]
        parts += [_html(block.notes), _html(block.advice)]
        if block.pairs:
            lines = Tabular(headings=("", ""), rows=block.pairs, name_columns=2)
            parts.append(lines._repr_html_())
    return "\n".join(parts)


def _html(facts: Sequence[Fact]) -> str:
    """Return the texts of facts as a paragraph of HTML."""
    text = _joined(facts)
    return f"<p>{html.text(text)}</p>" if text else ""


def _paragraph(facts: Sequence[Fact]) -> list[str]:
    """Return the texts of facts after each other, on lines of a screen."""
    return textwrap.wrap(_joined(facts), WIDTH, break_on_hyphens=False)


def _joined(facts: Sequence[Fact]) -> str:
    """Return the texts of facts after each other."""
    return " ".join(text for _, text in lines_of(facts))


def lines_of(facts: Iterable[Fact | Judged]) -> list[Labelled]:
    """Return the lines of facts, of those that are said."""
    pairs = []
    for fact in facts:
        if not isinstance(fact, Fact):
            pairs += verdict_lines([fact])
        elif is_said(fact):
            pairs.append(said(fact))
    return pairs


def _fitting(pairs: Sequence[Labelled], room: int) -> list[Labelled]:
    """Return lines, of which those without room on a screen are counted."""
    if len(labelled(pairs)) <= room:
        return list(pairs)
    most = len(pairs) - 1
    while most > 0 and len(labelled(pairs[:most])) >= room:
        most -= 1
    return [*pairs[:most], said(Fact("further", count=len(pairs) - most))]


def labelled(pairs: Iterable[Labelled], width: int = WIDTH) -> list[str]:
    """Return lines with their labels at the left. A longer text goes on below itself. A text of
    several lines begins with a command, which is broken so that it can be pasted.
    """
    pairs = list(pairs)
    indent = max((len(label) for label, _ in pairs), default=0) + 2
    lines = []
    for label, text in pairs:
        command, *below = text.split("\n")
        if below:
            parts = [*_pasted(command, width - indent), *below]
        else:
            parts = textwrap.wrap(
                text, width - indent, break_long_words=False, break_on_hyphens=False
            )
        for head, part in itertools.zip_longest([label], parts or [""], fillvalue=""):
            lines.append(f"{head.ljust(indent)}{part}".rstrip())
    return lines


def _pasted(command: str, width: int) -> list[str]:
    """Return a command of a shell on lines of a width."""
    lines = [""]
    parts: list[str] = []
    for word in map(shlex.quote, shlex.split(command)):
        if parts and parts[-1].startswith("-") and not word.startswith("-"):
            parts[-1] += f" {word}"  # an option with its value
        else:
            parts.append(word)
    for part in parts:
        if lines[-1] and len(f"{lines[-1]} {part} \\") > width:
            lines[-1] += " \\"
            lines.append(f"  {part}")
        else:
            lines[-1] = f"{lines[-1]} {part}" if lines[-1] else part
    return lines


# comparisons


def verdict_lines(facts: Iterable[Judged]) -> list[Labelled]:
    """Return a line for each law that leads or trails, and one of those that are tied, open or not
    ranked; facts that differ by their metric alone stand together.
    """
    groups: dict[tuple[Any, ...], list[Any]] = {}
    for fact in sorted(facts, key=lambda fact: [*KINDS].index(type(fact))):
        kind, names = KINDS[type(fact)]
        share = isinstance(fact, Lead) and fact.metric == SHARE
        alike = kind, share, *(getattr(fact, name) for name in names)
        groups.setdefault(alike, []).append(fact)
    texts_by_label: dict[str, list[str]] = {}
    for (kind, *_), of_group in groups.items():
        label, text = said(Fact(kind, **_values(of_group)))
        texts_by_label.setdefault(label, []).append(text)
    return [(label, "; ".join(texts)) for label, texts in texts_by_label.items()]


def _values(alike: Sequence[Any]) -> dict[str, Any]:
    """Return what the template says of facts that stand together."""
    first = alike[0]
    values = {**vars(first), "metrics": [fact.metric for fact in alike]}
    match first:
        case Lead():
            values |= {"settled": first.metric == SHARE, "metrics": list(map(_size, alike))}
        case Trails():
            alone = len(first.ahead) == 1 and not math.isnan(first.times)
            values["behind"] = () if alone else first.ahead
        case Open():
            hidden = max(fact.hidden for fact in alike)
            values |= {"hidden": hidden, "none": hidden >= LARGEST, "needed": first.needed or None}
            values["perhaps"] = len(first.laws) == 1
        case NotRanked():
            values["laws"] = list(dict.fromkeys(fact.law for fact in alike))
    return values


def evidence(fact: Verdict) -> str:
    """Return a verdict with its ratio, interval and samples."""
    ((label, text),) = verdict_lines([fact])
    values = {**vars(fact), "label": label, "text": text}
    values["charged"] = values.get("charged") or None
    if isinstance(fact, Lead):
        ends = Span(1.0 - fact.high, 1.0 - fact.low)
        values |= {"ends": ends, "samples": fact.samples or None}
    return said(Fact("evidence", **values))[1]


def _size(lead: Lead) -> Fact:
    """Return by how much a law leads: "J 21 to 25 %"; without a number where no share is known."""
    return Fact("size", **{**vars(lead), "share": lead.share})


def block_of(contest: Contest) -> ScreenPart:
    """Return what is said of a plant in a condition: the table, the law to use, who leads."""
    about = {"plant": contest.plant, "condition": contest.condition}
    notes = [Fact("star")] * contest.table.starred + [Fact("lower")]
    return ScreenPart(
        [Fact("contest", **about, sample=contest.sample)],
        [contest.table],
        [*notes, contest.settled] if contest.settled else notes,
        [contest.use] if contest.use else [],
        verdict_lines([*contest.verdicts, *contest.trails, *contest.not_ranked]),
    )


def _winners(contests: Sequence[Contest]) -> ScreenPart:
    """Return one table of the winners on many plants in many conditions, and what holds on each
    plant.
    """
    metrics = [name for name in contests[0].metrics if name != ON_PLANT]
    rows = []
    of_plants: dict[str, str] = {}
    for contest in contests:
        fact_of = {fact.metric: fact for fact in contest.verdicts}
        texts = {name: _winner(fact, contest) for name, fact in fact_of.items()}
        if len(contest.table.rows) == 1:  # nothing to compare it with: its numbers
            _, *numbers = contest.table.rows[0]
            texts = dict(zip(contest.metrics, numbers, strict=True))
        rows.append([contest.plant, contest.condition, *(texts.get(name, "") for name in metrics)])
        if (fact := fact_of.get(ON_PLANT)) and contest.plant not in of_plants:
            advice = contest.use and Fact("use", **contest.use.values | {"unless": ()})
            ((label, text),) = verdict_lines([fact])
            undecided = advice and (advice.values.get("rivals") or advice.values.get("level"))
            verdict = None if undecided else f"{label}: {text}"
            if isinstance(fact, Barred):  # as its cells say
                verdict = text
            of_plants[contest.plant] = said(Fact("of plant", advice=advice, verdict=verdict))[1]
    heads = ["", "", *metrics]
    return ScreenPart(
        [Fact("contests", count=len(contests), sample=contests[0].sample)],
        [Tabular(headings=heads, rows=rows, name_columns=len(heads))],
        [Fact("winners")],
        pairs=[*of_plants.items()],
    )


def _winner(fact: Verdict, contest: Contest) -> str:
    """Return a cell of the table of winners."""
    match fact:
        case Lead():
            return said(Fact("least", law=fact.law, low=fact.low))[1]
        case Tied() | Open():
            laws = "all" if len(fact.laws) == len(contest.table.rows) else ", ".join(fact.laws)
            return f"{KINDS[type(fact)][0]}: {laws}"
        case Barred():
            return "none"


def next_step(fact: NextStep) -> Labelled:
    """Return the one next step: a whole command to paste, and what it does; first the value of the
    command that is doubted, which a further command would repeat.
    """
    if slip := doubted():
        return "next", f"look at a value first: {slip}"
    if not fact.command.startswith(PROGRAM):
        return "next", f"{fact.command}: {fact.purpose}"
    return "next", f"{fact.command}\n{fact.purpose[:1].upper()}{fact.purpose[1:]}."
