"""The words of answers: a template for each kind of fact.

A field is filled with a value of its name: `{law}`, with a format of `as_text` behind a colon, as
in `{runs:run}`. A part in square brackets is left out if one of its values is not known; of
`[a|b]` it is the first part whose values all are. A fact is not said if a value that its text has
in no brackets is not known.
"""

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from smc_mujoco.answers.command import PROGRAM
from smc_mujoco.answers.facts import Fact, Lead, Settles, Span
from smc_mujoco.common.text import counted, joined, number

FIELD = re.compile(r"\{(\w+):?([^}]*)\}")
OPTIONAL = re.compile(r"\[([^\]]*)\]")
OVER = "over 99"  # percent, of larger shares
LARGEST = 0.995  # a share that is printed: of the leads that might not show; chosen
PART = "[ ({raced} of {named} laws tried)]"
IN_FILE = "[ for u in {unit}][   {file}]"
BEYOND = "a value beyond may do better"
# a kind of fact -> the label of its line, and the text
TEXTS = {
    # of several commands
    "further": ("further", "{count:line} in the report and by --full"),
    "names": ("{label}", "{names:,}"),
    "sentence": ("{label}", "{text}"),
    "star": ("", "* best of these laws (95 % sure)."),
    "lower": ("", "Lower is better."),
    # compare
    "sample": (
        "",
        "{seeds:run} a law[ ({distinct} distinct)], [gains of {sets} searches|gains of at least "
        "{least} searches|one set of gains][{single} (some laws: one set)]",
    ),
    "contest": ("", "{plant} under {condition}: {sample}"),
    "contests": ("", "{count} plants and conditions: {sample}"),
    "winners": (
        "",
        "The winner and its least lead, or the laws that are tied or open. All are judged "
        "together: fewer at once show smaller leads.",
    ),
    "of plant": ("", "[{advice} {verdict}|{advice}|{verdict}]"),
    "least": ("", "{law}[ {low:%}]"),
    "use": (
        "",
        "[Undecided by {metric} between {rivals}. For now|Level by {metric}: {level}. Use|Use] "
        "{law}[ ({gains})][, unless {unless:; or}].",
    ),
    "unless": ("", "{aims} matters most: then {law}[ ({gains})]"),
    "of law": ("", "{law} {runs}"),
    "settled runs": (
        "",
        "[All {all} runs settled|No run of {none} settled|Settled runs: {short:,}][{others}, all "
        "of the others].",
    ),
    "size": (
        "",
        "{metric}[ (which {rival} lacks in {gaps} runs)| {share:%}][ (lower median: {lower:,})]",
    ),
    "lead": (
        "{law}",
        "[{settled}more settled runs than any rival|{metrics} below {rival}|{metrics} below every "
        "rival]",
    ),
    "trails": (
        "{law}",
        "[{metric} {times} times {leader}'s; behind {behind}|{metric} {times} times {leader}'s|"
        "behind {behind}]",
    ),
    "evidence": (
        "",
        "{label}: {text}[; ratio {ratio}, {ends}][; below the floor of {floor}][; ahead in {ahead} "
        "of {samples} {unit}][; {charged:%} is taken off the lead]",
    ),
    "tied": ("tied", "{metrics}: {laws:,}"),
    "open": (
        "open",
        "{metrics}: [{perhaps}perhaps ]{laws:,}[ (deciding takes {needed} {unit})|{none} (no lead "
        "would show)| (leads below {hidden:%} might not show)]",
    ),
    "barred": (
        "no winner",
        "{metrics}: [{defaults}no law may win over the default gains of {laws}|every law has runs "
        "that fail, do not arrive or lack it]",
    ),
    "not ranked": ("not ranked", "{laws}: {samples} {unit}, of {needed} that it takes"),
    "defaults": ("gains", "the defaults of {laws}, not searched"),
    # which: its first line, in seven forms
    "law": ("Use {law}", f"[{{gains}}]{IN_FILE}"),
    "untried": (
        "Open",
        "No law was tried to the end[: this machine needs {minutes:minute} for one law]",
    ),
    "unneeded": ("No law", f"needed: u = 0 settles {{runs}} runs[, and J is {{lead}}]{PART}"),
    "unbeaten": (
        "No law",
        f"is better than u = 0, which settles {{runs}} runs[, and J is {{lead}}]{PART}",
    ),
    "unsettled": ("No law", f"settles under {{never}}; the nearest is {{law}}{PART}"),
    "unkept": ("No law", f"keeps {{limits}} so far; the nearest is {{law}}{PART}"),
    "undecided": (
        "Undecided",
        "[{raced} of {named} laws|each law] got [{shorter:shorter set}|{sets:set}][; deciding "
        "takes {least} or more|; deciding takes {needed}][ ({minutes:minute} more)][{close}, too "
        "close for more to tell];[ open between {laws};] for now {law}",
    ),
    # which: the law
    "gains": ("{law}", f"{{gains}}{IN_FILE}"),
    "best": (
        "best of {laws:law}",
        "J {lead}, [after {searches} searches of each|with these gains] (95 %)",
    ),
    "settles": (
        "settles",
        "{runs} runs[, in {times} s][; all conditions at once {together}]",
    ),
    "added": ("added", "{condition}, to J and gains, as no condition asked for has noise"),
    "withstands": (
        "withstands",
        "[{levels:,}; no time for {untried}|{levels:,}|no time for {untried}]",
    ),
    "level": ("", "{what}[{open} ≥] [x {factor}|{time:ms}|{value} {unit}]"),
    "without": ("without a law", "{runs} runs settle[; the law's J is {below:%} below]"),
    # which: what to know before use
    "rare": ("beware", "{runs} runs settle under {where}"),
    "never": ("beware", "no law settles under {where}"),
    "leans": ("beware", "u stays at its bound under {where}: more force, or an easier goal"),
    "together": ("beware", "{where}: {runs} runs settle; if yours has all, ask for that"),
    "unreliable": ("beware", "{law} has the lower J, and settles too seldom"),
    "shakes": (
        "at rest",
        "u swings by {size:.3g} {unit} ({share:%} of its bound) at {frequency:.3g} Hz under "
        "{where}: --need calm",
    ),
    "overshoots": (
        "overshoot",
        "{percent:.3g} % under {where}[, above the limit of {limit:g} %|: --need 'overshoot<10']",
    ),
    "limit": ("limit", "{runs} runs break {limits}, or fail"),
    "late": ("beware", "it fails beyond a delay of {delay:ms}: measure that of your loop"),
    "no room": ("no room", "tuned at a delay of {delay:ms}, it fails at {fails:ms}"),
    "no margin": ("margins", "none: the error does not end below 5 % of its start"),
    "helped": (
        "friction",
        "a load helps {joints}; from the other side it withstands [{value} {unit}|none]",
    ),
    "at end": ("gains", f"{{gains}} at an end of its search: {BEYOND}"),
    "needless": ("without", "all runs settle with u = 0 under {where}: no law is needed there"),
    "no time": ("no time", "for {laws}"),
    "left out": ("left out", "{law}: {reason}"),
    # tune
    "law on plant": ("", "{law} on {plant}"),
    "J": (
        "J",
        "{objective} s², [{lower:%} below the law's own gains|{before} s² with the law's own "
        "gains|the law's own gains fail]",
    ),
    "searches": (
        "searches",
        "{count}[; J of the worst is {above:%} above the best|; J of the worst is {times} times "
        "the best]",
    ),
    "at bound": ("at bound", f"{{gain}}, at the {{end}} end: {BEYOND}"),
    # margins
    "tolerated": (
        "",
        "The most that each law tolerates in runs of {duration:g} s[{ranges}; a range is over its "
        "sets of gains]",
    ),
    "tolerates": ("{law}", "tolerates the most {places:;}"),
    "on plant": ("", "{kinds} on {plant}"),
    "gains are": ("", "{gains}."),
    "most": ("", "* more than any other of these laws, by more than the search resolves."),
    "no most": ("open", "no law is shown to tolerate the most {kinds}"),
    "fails": ("fails", "unchanged: {laws:,}"),
    # worst
    "attacked": (
        "",
        "{plant}, {metric}, worst of {runs:run} a law, half of them drawn at random; bounds: "
        "{bounds}",
    ),
    "may be worse": (
        "",
        "Lower is better. One search: a worse case may exist, and no lead is tested.",
    ),
    # sensitivity
    "explains": (
        "",
        "{law} on {plant}: [{axis} explains {share:%} of the variance of {metric}|open which axis "
        "explains most of the {metric}]",
    ),
    "spread": (
        "{metric}",
        "{low} to {high} in 90 % of {runs:run}[; {unscored} have none, and count as the worst]",
    ),
    "fail": ("fail", "{runs} runs ({share:%})"),
    "narrow": (
        "narrow",
        "{half} first: the median is then {median}, not {before}[, and {fail:%} fail, not "
        "{failed:%}]",
    ),
    "first": (
        "explains",
        "[{axis}, {median:%} ({share:%}), alone and with others|{open}open, as intervals overlap "
        "(give more points)|no axis, as the scores do not differ, or most runs have none]",
    ),
    "fail where": (
        "fail",
        "where {where}: {runs} runs ({share:%}), elsewhere {outside}, of those that did not choose "
        "these bounds",
    ),
    "fail anywhere": ("fail", "{fails}no bounds on one or two axes tell where"),
    # identify
    "fits": (
        "",
        "± is one standard error; fits {fit}[, held out {held_out}] ([{pieces}pieces of 1 s|whole "
        "logs], worst column)",
    ),
    "files": (
        "",
        "[{condition} (--condition {condition})     ]{figure}     report {report}",
    ),
    # claims
    "every gain": (
        "every gain",
        "{holds} supported sentences hold under every set of gains that was run",
    ),
    # enter
    "entered": (
        "",
        "{entry} in {suite}: [not led by any of {others:other} in {level} problems|led in each of "
        "{problems} problems by some of {others:other}]",
    ),
    "leaders": ("", "* no other entry leads."),
    "counts": ("", "Errors are in counts; lower is better."),
    # list
    "listed": ("more", f"{PROGRAM} list laws has a line about each, list NAME a page"),
}
BELOW = "[below {rival}'s, which fails or breaks a limit in {gaps} runs|{share:%} below {rival}]"


def said(fact: Fact) -> tuple[str, str]:
    """Return the label of a fact's line, and its text."""
    label, template = TEXTS[fact.kind]
    return filled(label, fact.values), filled(template, fact.values)


def is_said(fact: Fact) -> bool:
    """Return whether all values are known that the text of a fact has in no brackets."""
    return _has(fact.values, OPTIONAL.sub("", TEXTS[fact.kind][1]))


def filled(template: str, values: Mapping[str, Any]) -> str:
    """Return a template with its values."""

    def chosen(match: re.Match[str]) -> str:
        return next((part for part in match[1].split("|") if _has(values, part)), "")

    def written(match: re.Match[str]) -> str:
        return as_text(values[match[1]], match[2])

    return FIELD.sub(written, OPTIONAL.sub(chosen, template))


def _has(values: Mapping[str, Any], part: str) -> bool:
    """Return whether all values of a part of a template are known."""
    return all(_is_known(values.get(name)) for name, _ in FIELD.findall(part))


def _is_known(value: Any) -> bool:
    if isinstance(value, float):
        return not math.isnan(value)
    if isinstance(value, Span):
        return not math.isnan(value.low)
    return value is not None and value is not False and value not in ("", (), [])


def as_text(value: Any, form: str = "") -> str:
    """Return a value as text.

    The form is "%" of shares, "ms" of a time in s, "," or ";" between the parts of a sequence, a
    noun of a count, or Python's own of a number. A flag has no text.
    """
    if type(value) in WRITERS:
        return WRITERS[type(value)](value)
    if isinstance(value, Span):
        ends = dict.fromkeys(map(number, value))
        return percent(*value) if form == "%" else " to ".join(ends)
    if isinstance(value, float):
        return _number(value, form)
    if isinstance(value, int):
        return counted(value, form) if form else str(value)
    if isinstance(value, Path):
        return str(value)
    parts = list(map(as_text, value))
    return f"{form} ".join(parts) if form else joined(parts)


def _number(value: float, form: str) -> str:
    if form == "%":
        return percent(value, value)
    if form == "ms":
        return f"{1e3 * value:.4g} ms"
    return format(value, form) if form else number(value)


def percent(low: float, high: float = math.nan) -> str:
    """Return shares as text: "21 to 25 %", "21 %", "at least 21 %", "over 99 %"."""
    least, most = (f"{100 * share:.2g}" if abs(share) < LARGEST else OVER for share in (low, high))
    if math.isnan(high):
        return f"{OVER} %" if least == OVER else f"at least {least} %"
    return f"{least} %" if least == most else f"{least} to {most} %"


def _lead(lead: Lead) -> str:
    """Return by how much J is below a rival's."""
    return filled(BELOW, {**vars(lead), "share": lead.share})


WRITERS: dict[type, Callable[[Any], str]] = {
    str: str,
    bool: lambda flag: "",
    Fact: lambda fact: said(fact)[1],
    Settles: lambda runs: f"{runs.count} of {runs.total}",
    Lead: _lead,
}
