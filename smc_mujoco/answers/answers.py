"""The lines of all answers: records of facts in, lines out. Nothing else joins sentences.

A line has a label of one or two words and a text, from `templates`. Numbers have three digits at
most.
"""

import dataclasses
import itertools
import math
import shlex
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from smc_mujoco.answers.command import PROGRAM, doubted
from smc_mujoco.answers.facts import (
    Barred,
    Contest,
    Fact,
    Lead,
    NextStep,
    NotRanked,
    Open,
    Sample,
    Screen,
    Settles,
    Tied,
    Trails,
    Use,
    Verdict,
)
from smc_mujoco.answers.templates import LARGEST, percent, said
from smc_mujoco.common.tabular import Tabular, as_cell
from smc_mujoco.common.text import joined, number

WIDTH = 80  # characters of a line
LINES = 24  # of a screen
BELOW = 2  # lines that a command prints below a screen, such as its files
MAX_CONTESTS = 5  # that have a block each; more have one table of winners
MAX_NAMED = 8  # conditions that a verdict names; chosen
MAX_SUMMED = 2  # conditions that a block names as those of J; chosen
GAP = "  "  # between columns
HEADING = 12  # characters of a line of a heading; chosen
NAMES = 24  # characters of a plant and a condition beside winners; chosen
SHARE = "settled runs"  # the metric that is a share
ON_PLANT = "J"  # the metric that is of all conditions of a plant
Labelled = tuple[str, str]  # the label of a line, and its text
T = TypeVar("T")


def screen_lines(screen: Screen) -> list[str]:
    """Return the answer of a result: what was asked, its tables, what is best, what to do next.

    Facts for which a screen has no room are counted.
    """
    lines = []
    if len(screen.contests) > MAX_CONTESTS:
        lines += winners_lines(screen.contests)
    else:
        for contest in screen.contests:
            lines += [*([""] if lines else []), *contest_lines(contest)]
    if screen.heading:
        lines += textwrap.wrap(" ".join(said(screen.heading)).strip(), WIDTH)
    omitted = []
    for table in screen.tables:
        numbers, of_table = table_lines(table)
        lines += [*([""] if lines else []), *filter(None, [table.title]), *numbers]
        omitted += of_table
    notes = [*screen.notes, *_omitted(omitted)]
    lines += textwrap.wrap(" ".join(said(note)[1] for note in notes), WIDTH)
    pairs = list(map(line_of, screen.facts))
    ends = []
    if screen.next:
        ends.append(next_step(screen.next))
    if screen.report or screen.word:
        ends.append(more(screen.report, screen.word))
    gap = [""] if lines and (screen.contests or screen.tables) and (pairs or ends) else []
    room = LINES - BELOW - len([*lines, *gap, *labelled(ends)])
    if not screen.contests:
        pairs = fitting(pairs, room)
    return [*lines, *gap, *labelled([*pairs, *ends])]


def line_of(fact: Fact | Lead) -> Labelled:
    """Return the line of a fact."""
    if isinstance(fact, Lead):
        ((law, text),) = leads([fact])
        return law, text
    return said(fact)


def fitting(pairs: Sequence[Labelled], room: int) -> list[Labelled]:
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
        head = label.ljust(indent)
        if "\n" in text:
            command, *below = text.splitlines()
            first, *rest = _pasted(command, width - indent)
            lines += [head + first, *(" " * indent + line for line in (*rest, *below))]
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


def use(fact: Use) -> str:
    """Return "Use adrc (wc=30), unless settling time matters most: then my_law (k1=8)."."""
    aims_by_law: dict[str, list[str]] = {}
    for aim, law, gains in fact.unless:
        aims_by_law.setdefault(_with_gains(law, gains), []).append(aim)
    exceptions = []
    for law, aims in aims_by_law.items():
        exceptions.append(f"{joined(aims, 'or')} matters most: then {law}")
    unless = f", unless {'; or '.join(exceptions)}" if exceptions else ""
    first = "Use"
    if fact.rivals:
        first = f"Undecided by {fact.metric} between {joined(fact.rivals)}. For now"
    return f"{first} {_with_gains(fact.law, fact.gains)}{unless}."


def _with_gains(law: str, gains: str) -> str:
    return f"{law} ({gains})" if gains else law


def _grouped(facts: Iterable[T], *names: str) -> list[list[T]]:
    """Return the facts that agree in these fields together."""
    groups: dict[tuple[Any, ...], list[T]] = {}
    for fact in facts:
        groups.setdefault(tuple(getattr(fact, name) for name in names), []).append(fact)
    return list(groups.values())


def _metrics(facts: Iterable[Verdict]) -> str:
    return joined(fact.metric for fact in facts)


def leads(facts: Sequence[Lead]) -> list[Labelled]:
    """Return a line for each law: by how much it leads, and over which runner-up."""
    parts_by_law: dict[str, list[str]] = {}
    for alike in _grouped(facts, "law", "rival"):
        parts = parts_by_law.setdefault(alike[0].law, [])
        if any(fact.metric == SHARE for fact in alike):
            parts.append("more settled runs than any rival")
        if sizes := [lead_size(fact) for fact in alike if fact.metric != SHARE]:
            parts.append(f"{joined(sizes)} below {alike[0].rival or 'every rival'}")
    return [(law, "; ".join(parts)) for law, parts in parts_by_law.items()]


def lead_size(fact: Lead) -> str:
    """Return "J 21 to 25 %"; in words where no share is known."""
    if fact.gaps:
        return f"{fact.metric} (which {fact.rival} lacks in {fact.gaps} runs)"
    if math.isnan(fact.low):
        return fact.metric
    differ = " (not its median)" if fact.medians_differ else ""
    return f"{fact.metric} {percent(*fact.share)}{differ}"


def trails(fact: Trails) -> Labelled:
    """Return by how much a law is behind: "J 1.78 times adrc's; behind adrc and pid"."""
    parts = []
    if not math.isnan(fact.times):
        parts.append(f"{fact.metric} {number(fact.times)} times {fact.leader}'s")
    if not parts or len(fact.ahead) > 1:
        parts.append(f"behind {joined(fact.ahead)}")
    return fact.law, "; ".join(parts)


def ties(facts: Sequence[Tied]) -> list[str]:
    """Return the laws that are level or below a floor, by metric."""
    return [f"{_metrics(alike)}: {', '.join(alike[0].laws)}" for alike in _grouped(facts, "laws")]


def opens(facts: Sequence[Open]) -> list[str]:
    """Return the laws of which none is shown to be better, by metric, and what it takes to decide,
    or which leads would not have been seen.
    """
    parts = []
    for alike in _grouped(facts, "laws", "needed", "unit"):
        fact = alike[0]
        hidden = max(fact.hidden for fact in alike)
        doubt = ""
        if fact.needed:
            doubt = f" (deciding takes {fact.needed} {fact.unit})"
        elif hidden >= LARGEST:
            doubt = " (no lead would show)"
        elif not math.isnan(hidden):
            doubt = f" (leads below {percent(hidden, hidden)} might not show)"
        perhaps = "perhaps " if len(fact.laws) == 1 else ""
        parts.append(f"{_metrics(alike)}: {perhaps}{', '.join(fact.laws)}{doubt}")
    return parts


def not_ranked(facts: Sequence[NotRanked]) -> list[str]:
    """Return the laws with too few samples to be ranked."""
    parts = []
    for alike in _grouped(facts, "samples", "needed", "unit"):
        fact = alike[0]
        laws = joined(dict.fromkeys(fact.law for fact in alike))
        parts.append(f"{laws}: {fact.samples} {fact.unit}, of {fact.needed} that it takes")
    return parts


def barred(facts: Sequence[Barred]) -> list[str]:
    """Return the metrics in which no law may win."""
    parts = []
    for alike in _grouped([fact for fact in facts if fact.defaults], "laws"):
        laws = joined(alike[0].laws)
        parts.append(f"{_metrics(alike)}: no law may win over the default gains of {laws}")
    if lost := [fact for fact in facts if not fact.defaults]:
        parts.append(f"{_metrics(lost)}: every law has runs that fail, do not arrive or lack it")
    return parts


def verdict(fact: Verdict) -> str:
    """Return one fact as a line of evidence, with its ratio, interval and samples."""
    match fact:
        case Lead():
            ((law, text),) = leads([fact])
            numbers = []
            if not math.isnan(fact.ratio):
                ends = f"{number(1 - fact.high)} to {number(1 - fact.low)}"
                numbers.append(f"ratio {number(fact.ratio)}, {ends}")
            if fact.floor:
                numbers.append(f"below the floor of {fact.floor}")
            if fact.samples:
                numbers.append(f"ahead in {fact.ahead} of {fact.samples} {fact.unit}")
            evidence = f" ({'; '.join(numbers)})" if numbers else ""
            return f"{law} wins: {text}{evidence}"
        case Tied():
            floor = f", below the floor of {fact.floor}" if fact.floor else ""
            return f"tied in {ties([fact])[0]}{floor}"
        case Open():
            charge = f"; {percent(fact.charged, fact.charged)} is taken off the lead"
            return f"open in {opens([fact])[0]}{charge if fact.charged > 0.0 else ''}"
        case Barred():
            return f"no winner in {barred([fact])[0]}"


def verdicts(fact_by_condition: Mapping[str, Verdict | None]) -> list[str]:
    """Return the verdicts of a metric, condition -> fact: what several conditions share, once."""
    facts = list(filter(None, fact_by_condition.values()))
    if len(fact_by_condition) == 1:
        return list(map(verdict, facts))
    conditions_by_text: dict[str, list[str]] = {}
    for condition, fact in fact_by_condition.items():
        if isinstance(fact, Lead):
            text = f"{fact.law} wins in {fact.metric}"
        elif fact:
            text = verdict(fact)
        else:
            continue
        conditions_by_text.setdefault(text, []).append(condition)
    lines = []
    for text, conditions in conditions_by_text.items():
        names = joined(conditions)
        if len(conditions) > MAX_NAMED:
            names = f"{len(conditions)} conditions"
        lines.append(f"{text} under {names}")
    won = [fact for fact in facts if isinstance(fact, Lead) and fact.rival]
    if len(won) == len(fact_by_condition) and len({fact.law for fact in won}) == 1:
        lines.append(f"at worst {verdict(min(won, key=lambda fact: fact.low))}")
    return lines


def printed_verdicts(facts: Sequence[Verdict], name: Callable[[str], str]) -> str:
    """Return what a table in print says below itself: who wins in what, what is level, what might
    go undetected. `name` has a law's name in print.
    """
    metrics_by_law: dict[str, list[str]] = {}
    level = []
    unseen = []
    for fact in facts:
        match fact:
            case Lead():
                metrics_by_law.setdefault(name(fact.law), []).append(fact.metric)
            case Tied() if not fact.floor and fact.metric != SHARE:
                level.append(fact.metric)
            case Open() if fact.hidden < LARGEST:
                unseen.append(f"{percent(fact.hidden, fact.hidden)} in {fact.metric}")
            case _:
                pass
    sentences = [f"{law} wins: {joined(metrics)}." for law, metrics in metrics_by_law.items()]
    if not sentences:
        sentences.append("No law wins.")
    if level:
        sentences.append(f"The best laws are level within 10 %: {joined(level)}.")
    if unseen:
        sentences.append(f"Leads below {joined(unseen)} might go undetected.")
    return " ".join(sentences)


def settled(facts: Sequence[tuple[str, Settles]]) -> str:
    """Return how many runs of each law settled, in one sentence."""
    count = sum(fact.count for _, fact in facts)
    total = sum(fact.total for _, fact in facts)
    if count == total:
        return f"All {total} runs settled."
    if not count:
        return f"No run of {total} settled."
    short = [
        f"{law} {fact.count} of {fact.total}" for law, fact in facts if fact.count < fact.total
    ]
    ending = "" if len(short) == len(facts) else ", all of the others"
    return f"Settled runs: {', '.join(short)}{ending}."


def sample(fact: Sample) -> str:
    """Return what a number of a table is of: "12 runs a law, gains of 12 searches"."""
    sets = fact.sets if fact.sets > 1 else None
    values = {
        "seeds": fact.seeds,
        "distinct": fact.runs if fact.runs < fact.seeds else None,
        "least" if fact.more else "sets": sets,
        "single": bool(sets and fact.single),
    }
    return said(Fact("sample", **values))[1]


def table_lines(table: Tabular) -> tuple[list[str], list[str]]:
    """Return a table of numbers with the units below its headings, a star at each strong one; and
    the columns that have no room.
    """
    columns = []
    omitted = []
    for i, heading in enumerate(table.headings):
        cells = [as_cell(row[i]) for row in table.rows]
        name, _, unit = heading.partition(" (")
        room = " " if any(cell.strong for cell in cells) else ""  # for the star
        words = textwrap.wrap(name, HEADING)[:2]
        above = [""] * (2 - len(words)) + words + [unit.removesuffix(")")]
        column = [part + room for part in above]
        column += [cell.text + ("*" if cell.strong else room) for cell in cells]
        width = max(map(len, column))
        side = str.ljust if i < table.name_columns else str.rjust
        if sum(len(texts[0]) + len(GAP) for texts in columns) + width > WIDTH:
            omitted.append(name)
        else:
            columns.append([side(part, width) for part in column])
    lines = [GAP.join(parts).rstrip() for parts in zip(*columns, strict=True)]
    return list(filter(None, lines)), omitted


def _omitted(columns: Sequence[str]) -> list[Fact]:
    return [Fact("omitted", names=columns)] if columns else []


def contest_lines(contest: Contest) -> list[str]:
    """Return the block of a plant in a condition: the table, the law to use, who leads."""
    heading = f"{contest.plant} under {contest.condition}: {sample(contest.sample)}"
    table, omitted = table_lines(contest.table)
    notes = [said(Fact("lower"))[1]]
    if any(as_cell(cell).strong for row in contest.table.rows for cell in row):
        notes.insert(0, said(Fact("star"))[1])
    if contest.settled:
        notes.append(settled(contest.settled))
    more_notes = _omitted(omitted)
    if summed := contest.summed:
        count = len(summed) if len(summed) > MAX_SUMMED else None
        judged = {"count": count, "conditions": summed, "condition": contest.condition}
        more_notes.insert(0, Fact("summed", **judged))
    text = " ".join([*notes, *(said(note)[1] for note in more_notes)])
    lines = [*textwrap.wrap(heading, WIDTH), *table, *textwrap.wrap(text, WIDTH)]
    if contest.use:
        lines += ["", *textwrap.wrap(use(contest.use), WIDTH, break_on_hyphens=False)]
    of_kind: dict[type, list[Any]] = {Lead: [], Tied: [], Open: [], Barred: []}
    for fact in contest.verdicts:
        of_kind[type(fact)].append(fact)
    texts_by_label: dict[str, list[str]] = {}
    for law, text in [*leads(of_kind[Lead]), *map(trails, contest.trails)]:
        texts_by_label.setdefault(law, []).append(text)
    texts_by_label |= {
        "tied": ties(of_kind[Tied]),
        "open": opens(of_kind[Open]),
        "no winner": barred(of_kind[Barred]),
        "not ranked": not_ranked(contest.not_ranked),
    }
    pairs = [(label, "; ".join(texts)) for label, texts in texts_by_label.items() if texts]
    return [*lines, *labelled(pairs)]


def winners_lines(contests: Sequence[Contest]) -> list[str]:
    """Return one table of the winners on many plants in many conditions, and what holds on each
    plant.
    """
    names = [_name(head) for head in contests[0].table.headings[1:] if _name(head) != ON_PLANT]
    head = min(NAMES, max(len(f"{row.plant} {row.condition}") for row in contests))
    room = (WIDTH - head) // max(len(names), 1) - 1
    rows = [("", [textwrap.wrap(name, room) for name in names])]
    of_plants: dict[str, str] = {}
    for contest in contests:
        fact_of = {fact.metric: fact for fact in contest.verdicts}
        laws = contest.table.rows
        texts = {name: winner(fact, len(laws)) for name, fact in fact_of.items()}
        if len(laws) == 1:  # nothing to compare it with: its numbers
            texts = {
                _name(head): as_cell(cell).text
                for head, cell in zip(contest.table.headings, laws[0], strict=True)
            }
        cells = [textwrap.wrap(texts.get(name, ""), room) for name in names]
        rows.append((f"{contest.plant} {contest.condition}", cells))
        if ON_PLANT in fact_of and contest.plant not in of_plants:
            of_plants[contest.plant] = verdict(fact_of[ON_PLANT])
            if contest.use:
                of_plant = dataclasses.replace(contest.use, unless=())
                of_plants[contest.plant] = f"{use(of_plant)} {of_plants[contest.plant]}."
    lines = [f"{len(contests)} plants and conditions: {sample(contests[0].sample)}"]
    for label, cells in rows:
        names_and_cells = textwrap.wrap(label, head) or [""], *cells
        for name, *parts in itertools.zip_longest(*names_and_cells, fillvalue=""):
            texts = [part.ljust(room) for part in parts]
            lines.append(" ".join([name.ljust(head), *texts]).rstrip())
    lines += [
        "The winner and its least lead, or the laws that are tied or open.",
        "All are judged together: fewer at once show smaller leads.",
        "",
    ]
    return lines + labelled(of_plants.items())


def _name(heading: str) -> str:
    """Return a heading without its unit."""
    return heading.partition(" (")[0]


def winner(fact: Verdict, count: int) -> str:
    """Return a cell of the table of winners, of that many laws."""
    match fact:
        case Lead():
            least = "" if math.isnan(fact.low) else f" {percent(fact.low, fact.low)}"
            return f"{fact.law}{least}"
        case Tied():
            return f"tied: {'all' if len(fact.laws) == count else ', '.join(fact.laws)}"
        case Open():
            return f"open: {'all' if len(fact.laws) == count else ', '.join(fact.laws)}"
        case Barred():
            return "none"


# lines that all answers have


def next_step(fact: NextStep) -> Labelled:
    """Return the one next step: a whole command to paste, and what it does; first the value of the
    command that is doubted, which a further command would repeat.
    """
    if slip := doubted():
        return "next", f"look at a value first: {slip}"
    if not fact.command.startswith(PROGRAM):
        return "next", f"{fact.command}: {fact.purpose}"
    return "next", f"{fact.command}\n{fact.purpose[:1].upper()}{fact.purpose[1:]}."


def more(report: str, word: str) -> Labelled:
    """Return where the evidence stands, and where words are explained."""
    explained = f"{PROGRAM} explain {word}" if word else ""
    return "more", "; ".join(filter(None, (report, explained)))
