"""The templates of all answers: records of facts in, lines out. Nothing else joins sentences.

A line has a label of one or two words and a text. Numbers have three digits at most.
"""

import math
import shlex
import textwrap
from collections.abc import Iterable, Sequence

from smc_mujoco.answers.facts import (
    Beware,
    Caution,
    Lead,
    Level,
    More,
    NextStep,
    Open,
    Settles,
    Tied,
    Trails,
    Unranked,
    Use,
    WhichFacts,
)
from smc_mujoco.common.text import counted, joined, number

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


# which

MORE_MINUTES = 30  # of a next step, where the time that is needed is not known
# kind of a caution -> its label, and what to know and do
CAUTIONS = {
    "unsettled": ("beware", "{count} of {of} runs settle under {where}"),
    "leans": ("beware", "u stays at its bound under {where}: more force, or an easier goal"),
    "together": ("beware", "{where}: {count} of {of} runs settle; if yours has all, ask for that"),
    "lower": ("beware", "{where} has the lower J, and settles too seldom"),
    "shakes": (
        "at rest",
        "u swings by {value:.3g} {unit} ({share:.2g} % of its bound) at {frequency:.3g} Hz under "
        "{where}: --need calm",
    ),
    "overshoots": ("overshoot", "{value:.3g} % under {where}: --need 'overshoot<10'"),
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
    """Return what to do, in one of five forms."""
    size = facts.size
    part = f" ({size.raced} of {size.named} laws tried)" if size.raced < size.named else ""
    if facts.form == "untried":
        needs = ""
        if not math.isnan(facts.minutes_needed):
            needs = f": this machine needs {_minutes(facts.minutes_needed)} for one law"
        return "Open", f"No law was tried to the end{needs}"
    if facts.form == "unneeded":
        below = f", and J is {_below(facts.lead)}" if facts.lead else ""
        return "No law", f"needed: u = 0 settles {_counts(facts.runs.runs)} runs{below}{part}"
    if facts.form == "unsettled":
        where = joined([c.where for c in facts.cautions if c.kind == "unsettled"])
        return "No law", f"settles under {where}; the nearest is {facts.law}{part}"
    if facts.form == "undecided":
        words = _sets(facts)
        if len(facts.undecided) > 1:
            words += f" open between {joined(facts.undecided)};"
        return "Undecided", f"{words} for now {facts.law}"
    return f"Use {facts.law}", _gains(facts)


def _sets(facts: WhichFacts) -> str:
    """Return how many sets of gains a verdict needs."""
    size = facts.size
    kind = "shorter set" if size.shorter else "set"
    of = f"{size.raced} of {size.named} laws" if size.raced < size.named else "each law"
    words = f"{of} got {counted(size.sets, kind)}"
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
    if facts.gains and facts.form in ("undecided", "unsettled"):
        pairs.append((facts.law, _gains(facts)))
    if facts.form == "law" and facts.lead:
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
        text = f"{_counts(facts.without.runs)} runs settle"
        if facts.over_none and not math.isnan(facts.over_none.low):
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
    return f"{fact.count} of {fact.of}"


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
        of=fact.of,
        reason=fact.reason,
        side=side,
    )
    return label, text


def _minutes(minutes: float) -> str:
    """Return a time as text, such as "80 minutes"."""
    return counted(math.ceil(minutes), "minute")


def which_next(facts: WhichFacts, call: Sequence[str]) -> NextStep:
    """Return the one thing to do next, given the command of the call without its minutes: more sets
    of gains, the conditions all at once, the laws that were not tried, or the law's code.
    """
    size = facts.size
    needed = facts.minutes_needed
    minutes = MORE_MINUTES if math.isnan(needed) else max(1, math.ceil(1.2 * needed))
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
    law = facts.file or f"{facts.law}({facts.gains.replace(' ', '')})"
    return NextStep(shlex.join(["smc-mujoco", "export", law, "controller"]), "writes it as C")


def _compared(facts: WhichFacts, call: Sequence[str]) -> list[str]:
    """Return the command that compares the laws that may be best."""
    words = _without(_without(call, "--minutes"), "--law")
    command, _, *rest = words
    return [command, "compare", *rest, "--law", ",".join(facts.undecided)]


def _without(call: Sequence[str], option: str) -> list[str]:
    """Return the words of a command without an option and its value."""
    words = []
    skip = False
    for word in call:
        if not skip and word != option:
            words.append(word)
        skip = word == option
    return words
