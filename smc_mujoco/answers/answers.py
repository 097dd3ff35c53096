"""The templates of all answers: records of facts in, lines out. Nothing else joins sentences.

A line has a label of one or two words and a text. Numbers have three digits at most.
"""

import dataclasses
import itertools
import math
import shlex
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import PurePath
from typing import Any

from smc_mujoco.answers.command import PROGRAM
from smc_mujoco.answers.facts import (
    Barred,
    Beware,
    Caution,
    ClaimsFacts,
    CompareFacts,
    Contest,
    EnteredFacts,
    Grid,
    IdentifyFacts,
    Lead,
    Level,
    MarginsFacts,
    More,
    NextStep,
    NotRanked,
    Open,
    Sample,
    SensitivityFacts,
    Settles,
    Tied,
    Trails,
    TuneFacts,
    Use,
    Verdict,
    WhichFacts,
    WorstFacts,
)
from smc_mujoco.common.text import counted, joined, number

WIDTH = 80  # characters of a line
LINES = 24  # of a screen
MAX_CONTESTS = 5  # that have a block each; more have one table of winners
MAX_NAMED = 8  # conditions that a verdict names; chosen
MAX_REFUTED = 8  # claims that an answer names; chosen
MAX_SUMMED = 2  # conditions that a block names as those of J; chosen
GAP = "  "  # between columns
HEADING = 12  # characters of a line of a heading; chosen
NAMES = 24  # characters of a plant and a condition beside winners; chosen
OVER = "over 99"  # percent, of larger shares
LARGEST = 0.995  # a share that is printed: of the leads that might not show; chosen
SHARE = "settled runs"  # the metric that is a share
ON_PLANT = "J"  # the metric that is of all conditions of a plant
Labelled = tuple[str, str]  # the label of a line, and its text


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


def percent(low: float, high: float = math.nan) -> str:
    """Return shares as text: "21 to 25 %", "21 %", "at least 21 %", "over 99 %"."""
    least, most = (f"{100 * share:.2g}" if abs(share) < LARGEST else OVER for share in (low, high))
    if math.isnan(high):
        return f"{OVER} %" if least == OVER else f"at least {least} %"
    return f"{least} %" if least == most else f"{least} to {most} %"


# comparisons


def use(fact: Use) -> str:
    """Return "Use adrc (wc=30), unless settling time matters most: then my_law (k1=8)."."""
    gains = f" ({fact.gains})" if fact.gains else ""
    aims_by_law: dict[str, list[str]] = {}
    for aim, law, its_gains in fact.unless:
        with_gains = f"{law} ({its_gains})" if its_gains else law
        aims_by_law.setdefault(with_gains, []).append(aim)
    exceptions = []
    for law, aims in aims_by_law.items():
        exceptions.append(f"{joined(aims, 'or')} matters most: then {law}")
    unless = f", unless {'; or '.join(exceptions)}" if exceptions else ""
    if fact.rivals:
        undecided = f"Undecided by {fact.metric} between {joined(fact.rivals)}."
        return f"{undecided} For now {fact.law}{gains}{unless}."
    return f"Use {fact.law}{gains}{unless}."


def leads(facts: Sequence[Lead]) -> list[Labelled]:
    """Return a line for each law: by how much it leads, and over which runner-up."""
    by_rival: dict[tuple[str, str], list[str]] = {}
    parts_by_law: dict[str, list[str]] = {}
    for fact in facts:
        if fact.metric == SHARE:
            parts_by_law.setdefault(fact.law, []).append("more settled runs than any rival")
        else:
            by_rival.setdefault((fact.law, fact.rival), []).append(lead_size(fact))
    for (law, rival), sizes in by_rival.items():
        parts_by_law.setdefault(law, []).append(f"{joined(sizes)} below {rival or 'every rival'}")
    return [(law, "; ".join(parts)) for law, parts in parts_by_law.items()]


def lead_size(fact: Lead) -> str:
    """Return "J 21 to 25 %"; in words where no share is known."""
    if fact.gaps:
        return f"{fact.metric} (which {fact.rival} lacks in {fact.gaps} runs)"
    if math.isnan(fact.low):
        return fact.metric
    differ = " (not its median)" if fact.medians_differ else ""
    return f"{fact.metric} {percent(fact.low, fact.high)}{differ}"


def trails(fact: Trails) -> Labelled:
    """Return by how much a law is behind: "J 1.78 times adrc's; behind adrc and pid"."""
    parts = []
    if not math.isnan(fact.times):
        parts.append(f"{fact.metric} {number(fact.times)} times {fact.leader}'s")
    if not parts or len(fact.ahead) > 1:
        parts.append(f"behind {joined(fact.ahead)}")
    return fact.law, "; ".join(parts)


def ties(facts: Sequence[Tied]) -> list[Labelled]:
    """Return the line of laws that are level or below a floor, by metric."""
    metrics_by_laws: dict[tuple[str, ...], list[str]] = {}
    for fact in facts:
        metrics_by_laws.setdefault(fact.laws, []).append(fact.metric)
    parts = [f"{joined(names)}: {', '.join(laws)}" for laws, names in metrics_by_laws.items()]
    return [("tied", "; ".join(parts))] if parts else []


def opens(facts: Sequence[Open]) -> list[Labelled]:
    """Return the line of laws of which none is shown to be better, by metric."""
    alike: dict[tuple[tuple[str, ...], int, str], list[Open]] = {}
    for fact in facts:
        alike.setdefault((fact.laws, fact.needed, fact.unit), []).append(fact)
    parts = []
    for (laws, _, _), of_laws in alike.items():
        metrics = joined([fact.metric for fact in of_laws])
        names = ", ".join(laws)
        if len(laws) == 1:
            names = f"perhaps {names}"
        parts.append(f"{metrics}: {names}{doubt(of_laws)}")
    return [("open", "; ".join(parts))] if parts else []


def doubt(facts: Sequence[Open]) -> str:
    """Return what it takes to decide, or which leads would not have been seen."""
    fact = facts[0]
    if fact.needed:
        return f" (deciding takes {fact.needed} {fact.unit})"
    hidden = max(fact.hidden for fact in facts)
    if math.isnan(hidden):
        return ""
    if hidden >= LARGEST:
        return " (no lead would show)"
    return f" (leads below {percent(hidden, hidden)} might not show)"


def not_ranked(facts: Sequence[NotRanked]) -> list[Labelled]:
    """Return the line of laws with too few samples to be ranked."""
    laws_by_cause: dict[tuple[int, int, str], dict[str, None]] = {}
    for fact in facts:
        laws_by_cause.setdefault((fact.samples, fact.needed, fact.unit), {})[fact.law] = None
    parts = []
    for (samples, needed, unit), laws in laws_by_cause.items():
        parts.append(f"{joined(laws)}: {samples} {unit}, of {needed} that it takes")
    return [("not ranked", "; ".join(parts))] if parts else []


def barred(facts: Sequence[Barred]) -> list[Labelled]:
    """Return the line of metrics in which no law may win."""
    defaults: dict[tuple[str, ...], list[str]] = {}
    lost = []
    for fact in facts:
        if fact.defaults:
            defaults.setdefault(fact.laws, []).append(fact.metric)
        else:
            lost.append(fact.metric)
    parts = []
    for laws, metrics in defaults.items():
        parts.append(f"{joined(metrics)}: no law may win over the default gains of {joined(laws)}")
    if lost:
        parts.append(f"{joined(lost)}: every law has runs that fail, do not arrive or lack it")
    return [("no winner", "; ".join(parts))] if parts else []


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
            ((_, text),) = ties([fact])
            return f"tied in {text}{f', below the floor of {fact.floor}' if fact.floor else ''}"
        case Open():
            ((_, text),) = opens([fact])
            charge = f"; {percent(fact.charged, fact.charged)} is taken off the lead"
            return f"open in {text}{charge if fact.charged > 0.0 else ''}"
        case Barred():
            ((_, text),) = barred([fact])
            return f"no winner in {text}"


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
    runs = f"{counted(fact.seeds, 'run')} a law"
    if fact.runs < fact.seeds:
        runs += f" ({fact.runs} distinct)"
    if fact.sets < 2:
        return f"{runs}, one set of gains"
    gains = f"gains of {'at least ' if fact.more else ''}{fact.sets} searches"
    return f"{runs}, {gains}{' (some laws: one set)' if fact.single else ''}"


def grid_lines(fact: Grid, width: int = WIDTH) -> tuple[list[str], list[str]]:
    """Return a table of numbers, a star at each winner's, and the columns that have no room."""
    columns = [["", "", "", *(law for law, _ in fact.rows)]]
    omitted = []
    for i, (name, unit) in enumerate(fact.columns):
        words = textwrap.wrap(name, HEADING)[:2]
        room = " " if fact.winners[i] else ""  # for the star
        column = [part + room for part in ([""] * (2 - len(words)) + words + [unit])]
        for law, numbers in fact.rows:
            column.append(numbers[i] + ("*" if room and law == fact.winners[i] else room))
        if sum(map(_width, columns)) + _width(column) + len(GAP) * len(columns) > width:
            omitted.append(name)
        else:
            columns.append(column)
    lines = []
    for law, *numbers in zip(*columns, strict=True):
        cells = [law.ljust(_width(columns[0]))]
        for text, column in zip(numbers, columns[1:], strict=True):
            cells.append(text.rjust(_width(column)))
        lines.append(GAP.join(cells).rstrip())
    return list(filter(None, lines)), omitted


def _width(column: Sequence[str]) -> int:
    return max(map(len, column))


def contest_lines(contest: Contest) -> list[str]:
    """Return the block of a plant in a condition: the table, the law to use, who leads."""
    heading = f"{contest.plant} under {contest.condition}: {sample(contest.sample)}"
    table, omitted = grid_lines(contest.grid)
    notes = ["Lower is better."]
    if any(contest.grid.winners):
        notes.insert(0, "* best of these laws (95 % sure).")
    if contest.settled:
        notes.append(settled(contest.settled))
    if contest.summed:
        count = len(contest.summed)
        judged = f"{count} tuning conditions" if count > MAX_SUMMED else joined(contest.summed)
        notes.append(f"J is over {judged}, the rest under {contest.condition}.")
    if omitted:
        notes.append(f"In the report: {joined(omitted)}.")
    lines = [*textwrap.wrap(heading, WIDTH), *table, *textwrap.wrap(" ".join(notes), WIDTH)]
    if contest.use:
        lines += ["", *textwrap.wrap(use(contest.use), WIDTH, break_on_hyphens=False)]
    facts_of: dict[type, list[Any]] = {Lead: [], Tied: [], Open: [], Barred: []}
    for fact in contest.verdicts:
        facts_of[type(fact)].append(fact)
    texts_by_law: dict[str, list[str]] = {}
    for law, text in [*leads(facts_of[Lead]), *map(trails, contest.trails)]:
        texts_by_law.setdefault(law, []).append(text)
    pairs = [(law, "; ".join(texts)) for law, texts in texts_by_law.items()]
    pairs += [*ties(facts_of[Tied]), *opens(facts_of[Open]), *barred(facts_of[Barred])]
    return [*lines, *labelled([*pairs, *not_ranked(contest.not_ranked)])]


def winners_lines(contests: Sequence[Contest]) -> list[str]:
    """Return one table of the winners on many plants in many conditions, and what holds on each
    plant.
    """
    names = [name for name, _ in contests[0].grid.columns if name != ON_PLANT]
    head = min(NAMES, max(len(f"{row.plant} {row.condition}") for row in contests))
    room = (WIDTH - head) // max(len(names), 1) - 1
    rows = [("", [textwrap.wrap(name, room) for name in names])]
    of_plants: dict[str, str] = {}
    for contest in contests:
        fact_of = {fact.metric: fact for fact in contest.verdicts}
        cells = []
        _, numbers = contest.grid.rows[0]
        columns = [name for name, _ in contest.grid.columns]
        number_of = dict(zip(columns, numbers, strict=True))
        for name in names:
            text = winner(fact_of[name], len(contest.grid.rows)) if name in fact_of else ""
            if len(contest.grid.rows) == 1:  # nothing to compare it with
                text = number_of.get(name, "")  # a condition may leave a column out
            cells.append(textwrap.wrap(text, room))
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


def compare_lines(facts: CompareFacts) -> list[str]:
    """Return a comparison: a block for each plant and condition, or one table of winners."""
    lines: list[str] = []
    if len(facts.contests) > MAX_CONTESTS:
        lines += winners_lines(facts.contests)
    else:
        for contest in facts.contests:
            lines += [*([""] if lines else []), *contest_lines(contest)]
    pairs = list(map(beware, facts.bewares))
    if facts.next:
        pairs.append(next_step(facts.next))
    if facts.more:
        pairs.append(more(facts.more))
    return [*lines, *([""] if lines and pairs else []), *labelled(pairs)]


# what a law bears


def margins_lines(facts: MarginsFacts) -> list[str]:
    """Return the most that laws tolerate: a table for each plant, and who tolerates the most."""
    about = f"The most that each law tolerates in runs of {facts.duration:g} s"
    lines = textwrap.wrap(f"{about}, or the range in which it lies", WIDTH)
    kinds_of: dict[str, dict[str, list[str]]] = {}  # law -> plant -> what it tolerates most of
    for plant, table in facts.grids:
        numbers, omitted = grid_lines(table)
        lines += ["", plant, *numbers]
        lines += [f"With --full: {joined(omitted)}."] if omitted else []
        for (kind, _), law in zip(table.columns, table.winners, strict=True):
            if law:
                kinds_of.setdefault(law, {}).setdefault(plant, []).append(kind)
    if kinds_of:
        lines.append("* more than any other of these laws, by more than the search resolves")
    if facts.gains:
        lines.append(f"{facts.gains[:1].upper()}{facts.gains[1:]}")
    pairs = []
    for law, by_plant in kinds_of.items():
        most = [f"{joined(kinds)} on {plant}" for plant, kinds in by_plant.items()]
        pairs.append((law, f"tolerates the most {'; '.join(most)}"))
    if facts.failing:
        pairs.append(("fails", f"unchanged: {', '.join(facts.failing)}"))
    pairs += [next_step(facts.next), more(More("", "", ("margin",)))]
    return [*lines, "", *labelled(pairs)]


def worst_lines(facts: WorstFacts) -> list[str]:
    """Return the worst runs found of laws on a plant."""
    runs = f"{facts.runs} runs a law, half of them drawn at random"
    about = f"{facts.about}, worst of {runs}; bounds: {facts.bounds}"
    numbers, _ = grid_lines(facts.grid)
    lines = [*textwrap.wrap(about, WIDTH), *numbers, "Lower is better. A worse case may exist.", ""]
    pairs = leads([facts.lead] if facts.lead else [])
    pairs += facts.outside
    return lines + labelled([*pairs, next_step(facts.next), more(More("", "", ("worst",)))])


def sensitivity_lines(facts: SensitivityFacts) -> list[str]:
    """Return what explains a score, where runs fail, and what to narrow first."""
    first = f"{facts.about}: open which axis explains most of the {facts.metric}"
    if facts.first:
        share = percent(*facts.share)
        first = f"{facts.about}: {facts.first} explains {share} of the variance of {facts.metric}"
    numbers, _ = grid_lines(facts.grid)
    lines = [*textwrap.wrap(first, WIDTH), "", *numbers, ""]
    pairs = [
        (
            facts.metric,
            f"{facts.spread[0]} to {facts.spread[1]} in 90 % of {facts.failed.total} runs",
        ),
        ("fail", f"{facts.failed.count} of {facts.failed.total} runs"),
    ]
    if facts.narrow:
        before, after = facts.medians
        pairs.append(("narrow", f"{facts.narrow} first: the median is then {after}, not {before}"))
    return lines + labelled([*pairs, next_step(facts.next), more(More("", "", ("sensitivity",)))])


def tune_lines(facts: TuneFacts) -> list[str]:
    """Return the gains that searches found."""
    lower = 1.0 - facts.objective / facts.before if facts.before > 0.0 else 0.0
    own = f"{number(facts.before)} s² with the law's own gains"
    if facts.before == math.inf:
        own = "the law's own gains fail"
    elif lower > 0.0:
        own = f"{percent(lower, lower)} below the law's own gains"
    pairs = [
        ("gains", facts.gains),
        ("J", f"{number(facts.objective)} s², {own}"),
    ]
    ends = f"{facts.searches} ended within {facts.spread}" if facts.spread else "1"
    pairs.append(("searches", ends))
    for gain, end in facts.at_bound:
        pairs.append(("at bound", f"{gain}, at the {end} end: a value beyond may do better"))
    lines = [f"{facts.law} on {facts.plant}"]
    return lines + labelled([*pairs, next_step(facts.next), more(More("", "", ("J",)))])


# audits


def claims_lines(facts: ClaimsFacts) -> list[str]:
    """Return how many claims of a paper hold, and which are refuted; more of these than a screen
    has room for are counted.
    """
    pairs = [(whose, ", ".join(verdicts)) for whose, verdicts in facts.counts]
    if facts.supported.total:
        holds = f"{facts.supported.count} of {facts.supported.total} supported sentences hold"
        pairs.append(("every gain", f"{holds} under every set of gains that was run"))
    for name, text in facts.refuted[:MAX_REFUTED]:
        pairs.append((f"refuted {name}", text))
    if len(facts.refuted) > MAX_REFUTED:
        pairs.append(("refuted", f"{len(facts.refuted) - MAX_REFUTED} more, all by --full"))
    if facts.next:
        pairs.append(next_step(facts.next))
    return labelled(pairs)


# lists


def names_lines(names_by_kind: Iterable[tuple[str, Sequence[str]]]) -> list[str]:
    """Return the names of each kind, and how to see more about one of them."""
    pairs = []
    for kind, names in names_by_kind:
        pairs.append((kind, ", ".join(names)))
    pairs.append(("more", f"{PROGRAM} list laws has a line about each, list NAME a page"))
    return labelled(pairs)


# lines that all answers have


def beware(fact: Beware) -> Labelled:
    """Return what to know before use."""
    return fact.about, fact.sentence


def next_step(fact: NextStep) -> Labelled:
    """Return the one next step: a whole command to paste, and what it does."""
    if not fact.command.startswith(PROGRAM):
        return "next", f"{fact.command}: {fact.purpose}"
    return "next", f"{fact.command}\n{fact.purpose[:1].upper()}{fact.purpose[1:]}."


def more(fact: More) -> Labelled:
    """Return where the evidence stands, and where words are explained."""
    contents = f" ({fact.contents})" if fact.contents else ""
    places = [f"{fact.report}{contents}"] if fact.report else []
    if fact.words:
        places.append(f"smc-mujoco explain {fact.words[0]}")
    return "more", "; ".join(places)


# which

MOST_NAMED = 5  # laws that the first line names
MORE_MINUTES = 30  # of a next step, where the time that is needed is not known
# kind of a caution -> its label, and what to know and do
CAUTIONS = {
    "unsettled": ("beware", "{count} of {of} runs settle under {where}"),
    "never": ("beware", "no law settles under {where}"),
    "leans": ("beware", "u stays at its bound under {where}: more force, or an easier goal"),
    "together": ("beware", "{where}: {count} of {of} runs settle; if yours has all, ask for that"),
    "lower": ("beware", "{where} has the lower J, and settles too seldom"),
    "shakes": (
        "at rest",
        "u swings by {value:.3g} {unit} ({share:.2g} % of its bound) at {frequency:.3g} Hz under "
        "{where}: --need calm",
    ),
    "overshoots": ("overshoot", "{value:.3g} % under {where}: --need 'overshoot<10'"),
    "limit": ("limit", "{count} of {of} runs break {where}, or fail"),
    "breaks": ("overshoot", "{value:.3g} % under {where}, above the limit of {most:g} %"),
    "no room": ("no room", "tuned at a delay of {ms:g} ms, it fails at {most_ms:g} ms"),
    "no margin": ("margins", "none: the error does not end below 5 % of its start"),
    "helped": ("friction", "a load helps {where}; from the other side it withstands {side}"),
    "at bound": ("gains", "{where} at an end of its search: a value beyond may do better"),
    "needless": ("without", "all runs settle with u = 0 under {where}: no law is needed there"),
    "unsearched": ("no time", "for {where}"),
    "left out": ("left out", "{where}: {reason}"),
}
KINDS_OF_LEVELS = {
    "delay": "delay",
    "friction": "friction",
    "disturbance": "force",
    "mass": "mass",
    "blow": "blow",
}


def which_lines(facts: WhichFacts, step: NextStep | None) -> list[str]:
    """Return the answer to which law suits a plant, its first line first."""
    pairs = [
        _first_line(facts),
        *_evidence_of_law(facts),
        *map(_caution, facts.cautions),
    ]
    if step:
        pairs.append(next_step(step))
    if facts.folder:
        pairs.append(more(More(f"{facts.folder}/report.html", "", ("J",))))
    return labelled(pairs)


def _first_line(facts: WhichFacts) -> Labelled:
    """Return what to do, in one of six forms."""
    size = facts.size
    part = f" ({size.raced} of {size.named} laws tried)" if size.raced < size.named else ""
    if facts.form == "untried":
        needs = ""
        if not math.isnan(facts.minutes_needed):
            needs = f": this machine needs {_minutes(facts.minutes_needed)} for one law"
        return "Open", f"No law was tried to the end{needs}"
    if facts.form == "unneeded":
        below = f", and J is {_below(facts.lead)}" if facts.lead else ""
        settled = facts.runs.runs
        words = "needed: u = 0" if settled.count == settled.total else "is better than u = 0, which"
        return "No law", f"{words} settles {_counts(settled)} runs{below}{part}"
    if facts.form == "unsettled":
        never = joined(facts.never)
        return "No law", f"settles under {never}; the nearest is {facts.law}{part}"
    if facts.form == "unkept":
        return "No law", f"keeps {joined(facts.limits)} so far; the nearest is {facts.law}{part}"
    if facts.form == "undecided":
        words = _sets(facts)
        if len(facts.undecided) > 1:
            laws = joined(facts.undecided)
            if len(facts.undecided) > MOST_NAMED:
                laws = f"{len(facts.undecided)} laws"
            words += f" open between {laws};"
        return "Undecided", f"{words} for now {facts.law}"
    return f"Use {facts.law}", _gains(facts)


def _sets(facts: WhichFacts) -> str:
    """Return how many sets of gains a verdict needs."""
    size = facts.size
    kind = "shorter set" if size.shorter else "set"
    raced = f"{size.raced} of {size.named} laws" if size.raced < size.named else "each law"
    words = f"{raced} got {counted(size.sets, kind)}"
    if facts.sets_needed > size.sets:
        words += f"; deciding takes {facts.sets_needed}"
        if not math.isnan(facts.minutes_needed):
            words += f" ({_minutes(facts.minutes_needed)} more)"
    elif not facts.sets_needed:
        words += ", too close for more to tell"
    return f"{words};"


def _evidence_of_law(facts: WhichFacts) -> list[Labelled]:
    """Return the gains of the law, and what the runs say of it."""
    if facts.form == "untried":
        return []
    size = facts.size
    pairs = []
    if facts.gains and facts.form in ("undecided", "unsettled", "unkept"):
        pairs.append((facts.law, _gains(facts)))
    if facts.form in ("law", "unsettled") and facts.lead:
        how = "with these gains"
        if facts.over_sets and size.searched:
            how = f"after {size.sets} searches of each"
        rivals = counted(facts.rivals + 1, "law")
        pairs.append((f"best of {rivals}", f"J {_below(facts.lead)}, {how} (95 %)"))
    settles = f"{_counts(facts.runs.runs)} runs"
    if not math.isnan(facts.runs.first):
        first, last = number(facts.runs.first), number(facts.runs.last)
        settles += f", in {first} s" if first == last else f", in {first} to {last} s"
    if facts.runs.together:
        settles += f"; all conditions at once {_counts(facts.runs.together)}"
    pairs.append(("settles", settles))
    levels = [_level(level) for level in facts.levels if not math.isnan(level.value)]
    if levels or facts.untried:
        text = ", ".join(levels)
        if facts.untried:
            text += f"{'; ' if text else ''}no time for {joined(facts.untried)}"
        pairs.append(("withstands", text))
    if facts.without and facts.form != "unneeded":
        text = f"{_counts(facts.without)} runs settle"
        if facts.over_none and facts.over_none.low > 0.0:
            text += f"; the law's J is {percent(facts.over_none.low, facts.over_none.high)} below"
        pairs.append(("without a law", text))
    return pairs


def _gains(facts: WhichFacts) -> str:
    """Return the gains of the law, and the file that has them."""
    unit = f" for u in {facts.unit}" if facts.unit else ""
    file = f"   {facts.file}" if facts.file else ""
    return f"{facts.gains}{unit}{file}"


def _below(lead: Lead) -> str:
    """Return by how much J is below a rival's."""
    if lead.gaps:
        return f"below {lead.rival}'s, which fails or breaks a limit in {lead.gaps} runs"
    return f"{percent(lead.low, lead.high)} below {lead.rival}"


def _counts(fact: Settles) -> str:
    """Return a count of runs, such as "all 24" or "3 of 24"."""
    return f"{fact.count} of {fact.total}"


def _level(level: Level) -> str:
    """Return a level that is withstood, such as "mass x 1.6"."""
    least = "≥ " if level.open else ""
    name = KINDS_OF_LEVELS[level.kind]
    if level.unit == "1":
        return f"{name} x {least}{number(level.value)}"
    if level.unit == "s":
        return f"{name} {least}{number(1e3 * level.value)} ms"
    return f"{name} {least}{number(level.value)} {level.unit}"


def _caution(fact: Caution) -> Labelled:
    """Return what to know before the law is used, and what to do."""
    kind = "breaks" if fact.kind == "overshoots" and fact.most else fact.kind
    label, template = CAUTIONS[kind]
    side = "none" if math.isnan(fact.value) else f"{number(fact.value)} {fact.unit}"
    text = template.format(
        where=fact.where,
        value=fact.value,
        most=fact.most or math.nan,
        ms=1e3 * fact.value,
        most_ms=1e3 * (fact.most or math.nan),
        unit=fact.unit,
        share=100 * fact.share,
        frequency=fact.frequency,
        count=fact.count,
        of=fact.run_count,
        reason=fact.reason,
        side=side,
    )
    return label, text


def _minutes(minutes: float) -> str:
    """Return a time as text, such as "80 minutes"."""
    return counted(_whole_minutes(minutes), "minute")


def _whole_minutes(minutes: float) -> int:
    """Return a time that an estimate of it is likely to keep, min."""
    return max(1, math.ceil(1.2 * minutes))


def which_next(facts: WhichFacts, call: Sequence[str]) -> NextStep:
    """Return the one thing to do next, given the command of the call without its minutes: more sets
    of gains, the conditions all at once, the laws that were not tried, or the law's code.
    """
    size = facts.size
    needed = facts.minutes_needed
    minutes = MORE_MINUTES if math.isnan(needed) else _whole_minutes(needed)
    longer = [*_without(call, "--minutes"), "--minutes", f"{minutes}"]
    if facts.form in ("undecided", "untried") or size.raced < size.named:
        if facts.sets_needed:
            return NextStep(shlex.join(longer), "goes on from the sets that there are")
        return NextStep(shlex.join(_compared(facts, call)), "shows where the laws differ")
    if any(caution.kind == "together" for caution in facts.cautions):
        combined = [*_without(call, "--condition"), "--condition", "+".join(facts.conditions)]
        return NextStep(shlex.join(combined), "searches gains for all conditions at once")
    if size.untried:
        wide = [*_without(_without(call, "--law"), "--minutes"), "--minutes", f"{MORE_MINUTES}"]
        return NextStep(shlex.join(wide), f"tries the usual ones of {size.untried} other laws, too")
    gains = facts.file or facts.gains.replace(" ", "")
    law = facts.file or f"{facts.law}({gains})"
    for word in itertools.chain.from_iterable(part.split(",") for part in call):
        if PurePath(word).suffix == ".py" and PurePath(word).stem == facts.law:
            law = f"{word}({gains})"
    if facts.modelled or not facts.file:
        return NextStep(shlex.join([PROGRAM, "export", law, "controller.c"]), "writes it as C")
    words = [PROGRAM, "export", law, "controller", "--ros2"]
    return NextStep(shlex.join(words), "writes it for ros2_control; --plain writes a loop in C")


def _compared(facts: WhichFacts, call: Sequence[str]) -> list[str]:
    """Return the command that compares the laws that may be best."""
    words = [*call]
    for option in ("--minutes", "--law", "--need", "--out"):
        words = _without(words, option)
    command, _, *rest = words
    return [command, "compare", *rest, "--law", ",".join(facts.undecided[:MOST_NAMED])]


def _without(call: Sequence[str], option: str) -> list[str]:
    """Return the words of a command without an option and its value."""
    words = []
    skip = False
    for word in call:
        if not skip and word != option:
            words.append(word)
        skip = word == option
    return words


# identify


def identify_lines(facts: IdentifyFacts) -> list[str]:
    """Return the numbers with their errors, the fit, and what to doubt; what does not fit on the
    screen is counted.
    """
    columns = []
    for field in ("name", "value", "error", "unit"):
        texts = [getattr(fact, field) for fact in facts.numbers]
        columns.append((texts, max(map(len, texts), default=0)))
    lines = []
    for name, value, error, unit in zip(
        *([text.ljust(width) for text in texts] for texts, width in columns), strict=True
    ):
        lines.append(f"{name}  {value}  ± {error}  {unit}".rstrip())
    parts = "pieces of 1 s" if facts.by_pieces else "whole logs"
    held_out = "" if facts.held_out is None else f", held out {_fit(facts.held_out)}"
    lines.append(f"fits {_fit(facts.fit)}{held_out} ({parts}, worst column)")
    for k, doubt in enumerate(facts.doubts):
        below = labelled([("doubt", doubt)])
        later = len(facts.doubts) - k - 1
        if len(lines) + len(below) + (later > 0) > IDENTIFY_LINES:
            count = counted(later + 1, "further doubt")
            return [*lines, *labelled([("doubt", f"{count}, all in the report and by --full")])]
        lines += below
    return lines


IDENTIFY_LINES = LINES - 2  # one below is for the files


def _fit(percent_of_log: float) -> str:
    """Return "99.4 %", or "falls at 3.1 s" of a twin that cannot hold its loop."""
    text = f"{percent_of_log:.1f}"
    return text if text.startswith("falls") else f"{text} %"


def identify_files(condition: str, figure: str, report: str) -> str:
    """Return the line of the files that `identify` has written; "" for none."""
    parts = [figure, f"report {report}" if report else ""]
    if condition:
        parts.insert(0, f"{condition} (--condition {condition})")
    return "     ".join(filter(None, parts))


# the boards of tracking problems


def entered_lines(facts: EnteredFacts) -> list[str]:
    """Return where an entry stands in a suite: a line a problem."""
    level = sum(standing.level for standing in facts.standings)
    count = f"{level} of {len(facts.standings)} problems"
    lines = [
        f"{facts.entry} in {facts.suite}: not led by any of {facts.entries - 1} others in {count}",
        "",
    ]
    rows = [("problem", "place", "error", "first", "its error")]
    for standing in facts.standings:
        place = f"{standing.place}{'*' if standing.level else ''}"
        rows.append((standing.problem, place, standing.error, standing.first, standing.least))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = []
        for cell, width in zip(row, widths, strict=True):
            cells.append(cell.ljust(width))
        lines.append("  ".join(cells).rstrip())
    lines += ["* no other entry leads. Errors are in counts; lower is better.", ""]
    return [*lines, *labelled([("more", facts.page)])]
