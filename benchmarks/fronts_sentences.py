"""The sentences and tables of docs/where_sliding_mode_loses.md, by the points of
benchmarks/fronts.py.

    python -m benchmarks.fronts_sentences benchmarks/fronts.json
    python -m benchmarks.fronts_sentences benchmarks/fronts.json --figure fronts.svg

A lead is the ratio of two errors, medians of many runs, with the interval of that ratio. A sentence
stands at a price if the whole interval is above 1 and the lead is beyond a factor of 2. It is
contradicted if both say the reverse, and else open. Errors below a ten-thousandth of the start are
not ranked. If both are below it, nothing is said; if one is, that is said, without a ratio. An
error whose interval is not within 3 % of it is no number: it is not settled, and no lead is counted
from it.

Where several searches were run, a lead is told only if each of them found it, and then the smallest
is told, with an interval that holds those of all. A sentence is struck out if any search
contradicts it anywhere.
"""

import argparse
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from smc_mujoco.analysis.tuning import search_space

SECOND_ORDER = ("hodob",)
OBSERVERS = ("adrc", "pd_observer", *SECOND_ORDER)
RIVALS = (*OBSERVERS, "pid")
SMOOTH = ("boundary_layer",)
TWISTING = ("super_twisting", "implicit_super_twisting")
LAWS = (*TWISTING, "classical", *SMOOTH, *RIVALS)
FLOOR = 1e-4  # of the start: smaller errors are not ranked
# largest share of a median that its interval may reach to either side, so that as many runs of
# another loop give the median within 5 %
NARROW = 0.03
# prices: times the least J of all laws, or the rate of variation in calm over u_max, 1/s
LEVELS = {
    "J": (1.25, 1.5, 2.0, 3.0, 5.0),
    "rate": (30.0, 100.0, 300.0),
}


class Sentence(NamedTuple):
    """One of the page: at one price, the best of the first laws has less error than the best of the
    second; if the price is "least", the cheapest set is cheaper.
    """

    name: str
    first: tuple[str, ...]
    second: tuple[str, ...]
    conditions: tuple[str, ...]
    price: str = "J"
    low: float = 0.0  # level
    high: float = math.inf
    model: str = "none"
    within: bool | None = None  # only where super-twisting's theorem admits the load, or does not


QUIET = ("middle", "strong", "fast")
NOISY = tuple(f"{kind}, noise" for kind in QUIET)
CHEAP = ("calm",)  # of the cheapest set, whatever the load
SWITCHING = (*TWISTING, "classical")
SENTENCES = (
    Sentence("twisting, quiet", TWISTING, RIVALS, QUIET, within=True),
    Sentence("twisting, noise", TWISTING, RIVALS, NOISY, within=True),
    Sentence("second order, noise", SECOND_ORDER, TWISTING, NOISY),
    Sentence("second order, observers", SECOND_ORDER, ("adrc", "pd_observer"), QUIET),
    Sentence("smooth, quiet", RIVALS, SMOOTH, QUIET),
    Sentence("smooth, noise", RIVALS, SMOOTH, NOISY),
    Sentence("smooth, by rate", RIVALS, SMOOTH, (*QUIET, *NOISY), "rate"),
    Sentence("sign", SMOOTH, ("classical",), (*QUIET, *NOISY)),
    Sentence("cheap", OBSERVERS, SWITCHING, CHEAP, "least"),
)
ERROR = 0.025 / len(SENTENCES)  # beyond each end of an interval
# factor beyond which a lead counts, of errors and of the least J: chosen from two searches, so that
# both tell two equal laws apart in less than one cell of twenty, see `between`
SEARCH = {"J": 2.0, "rate": 2.0, "least": 1.1}
ROWS = ((1e-3, "middle"), (1e-3, "middle, noise"), (5e-3, "middle"), (5e-3, "middle, noise"))


def read(path: Path) -> list[dict]:
    """Return the points of a file that benchmarks/fronts.py wrote."""
    names, *rows = json.loads(path.read_text())
    return [dict(zip(names, row, strict=True)) for row in rows]


def of_figure(point: dict) -> bool:
    """Return whether the figure has a point."""
    shown = (point["period"], point["condition"]) in ROWS
    return shown and point["price"] == "J" and point["draw"] is None


def with_interval(values: Sequence[float] | np.ndarray) -> tuple[float, float, float]:
    """Return the median of values, NaN for a failed run, and its interval: two of the values, one
    of which the true median is beyond with a probability of ERROR at most. A failed run is beyond
    all others.
    """
    from scipy.stats import binom

    ordered = np.sort(np.nan_to_num(np.asarray(values, float), nan=math.inf))
    beyond = int(binom.ppf(ERROR / 2, ordered.size, 0.5))  # values on either side of the interval
    ends = ordered[max(beyond - 1, 0)], ordered[-max(beyond, 1)]
    middle = ordered[(ordered.size - 1) // 2], ordered[ordered.size // 2]
    return float(sum(middle) / 2.0), float(ends[0]), float(ends[1])


def is_settled(error: Sequence[float]) -> bool:
    """Return whether the runs settle a median with its interval: it is narrow, or below the floor
    as a whole.
    """
    middle, low, high = error
    if high <= FLOOR:
        return True
    return (1.0 - NARROW) * middle <= low and high <= (1.0 + NARROW) * middle < math.inf


VERDICTS = {
    "stands": "by a ratio",
    "below the floor": "the first is below the floor, the second is not",
    "unopposed": "the second laws have no gains at this price",
    "open": "",
    "not ranked": "the floor decides",
    "not settled": "the runs do not give an error as a number",
    "contradicted": "",
}


SAYS = {"stands": 1, "below the floor": 1, "unopposed": 1, "contradicted": -1}  # others say 0


class Verdict(NamedTuple):
    """What the points of a search say of a sentence at one price."""

    sentence: str
    search: int
    draw: int | None
    plant: str
    period: float  # s
    condition: str
    level: float
    laws: tuple[str, str]  # the best of both sides, or "none" at this price
    errors: tuple[float, float]  # medians, of the start; J of the cheapest
    lead: float  # ratio of the second's to the first's; NaN if the floor decides, or unsettled
    low: float
    high: float
    verdict: str  # one of VERDICTS

    @property
    def place(self) -> tuple:
        """Sentence, draw, plant, period, condition and level: all but what was found."""
        return self.sentence, self.draw, self.plant, self.period, self.condition, self.level


def best(points: Iterable[dict], laws: Sequence[str]) -> dict | None:
    """Return the point of some laws whose error, or J if it is the cheapest, was the least where it
    was chosen.
    """
    its = [point for point in points if point["law"] in laws]
    return min(its, key=lambda point: point["chose"], default=None)


def value(point: dict | None) -> Sequence[float]:
    """Return what a point is judged by, with its interval: J of the cheapest, else the error."""
    if point is None:
        return math.nan, math.nan, math.nan
    return point["J"] if point["price"] == "least" else point["error"]


def verdict(sentence: Sentence, first: dict | None, second: dict | None) -> tuple:
    """Return the lead of the first point over the second with its interval, and what it says."""
    none = math.nan, math.nan, math.nan
    if first is None or second is None:
        return *none, "unopposed" if first else "contradicted"
    ours, theirs = np.array(value(first)), np.array(value(second))
    beyond = SEARCH[sentence.price]
    with np.errstate(invalid="ignore", divide="ignore"):
        lead, low, high = (theirs / ours[[0, 2, 1]]).tolist()
    if second["price"] != "least":
        if not (is_settled(value(first)) and is_settled(value(second))):
            return math.nan, low, high, "not settled"
        below = ours[0] <= FLOOR, theirs[0] <= FLOOR
        if any(below):
            other = theirs if below[0] else ours
            if all(below) or other[1] <= beyond * FLOOR:
                return *none, "not ranked"
            return *none, "below the floor" if below[0] else "contradicted"
    said = "open"
    if low > 1.0 and lead > beyond:
        said = "stands"
    elif high < 1.0 and lead < 1.0 / beyond:
        said = "contradicted"
    return lead, low, high, said


def two_sides(
    points: Sequence[dict], sentences: Sequence[Sentence] = SENTENCES
) -> Iterator[tuple[Sentence, dict | None, dict | None]]:
    """Yield the best points of both sides at every level that a sentence is about, None where a
    side has none.
    """
    levels: dict[tuple, list[dict]] = {}
    for point in points:
        names = "search", "draw", "plant", "period", "model", "condition", "price", "level"
        levels.setdefault(tuple(point[name] for name in names), []).append(point)
    known = {point["law"] for point in points}
    for sentence in sentences:
        if known.isdisjoint(sentence.first) or known.isdisjoint(sentence.second):
            continue
        for (*_, model, condition, price, level), its in levels.items():
            about = condition in sentence.conditions and price == sentence.price
            if not (about and model == sentence.model and sentence.low <= level <= sentence.high):
                continue
            first, second = best(its, sentence.first), best(its, sentence.second)
            twisting = best(its, TWISTING)
            admitted = twisting["within"] if twisting else None
            if (first or second) and sentence.within in (None, admitted):
                yield sentence, first, second


def judged(points: Sequence[dict], sentences: Sequence[Sentence] = SENTENCES) -> Iterator[Verdict]:
    """Yield a verdict of each search for every level that a sentence is about."""
    for sentence, first, second in two_sides(points, sentences):
        laws = first["law"] if first else "none", second["law"] if second else "none"
        its = first or second or {}
        yield Verdict(
            sentence.name,
            its["search"],
            its["draw"],
            its["plant"],
            its["period"],
            its["condition"],
            its["level"],
            laws,
            (float(value(first)[0]), float(value(second)[0])),
            *verdict(sentence, first, second),
        )


def cells(
    points: Sequence[dict], sentences: Sequence[Sentence] = SENTENCES
) -> Iterator[tuple[Verdict, ...]]:
    """Yield the verdicts of all searches at each level that one of them has. A search that has no
    gains there, or none that the theorem admits, is open, without laws.
    """
    found: dict[tuple, list[Verdict]] = {}
    searches: dict[int | None, set[int]] = {}
    for one in judged(points, sentences):
        found.setdefault(one.place, []).append(one)
        searches.setdefault(one.draw, set()).add(one.search)
    none = {"laws": ("none", "none"), "lead": math.nan, "verdict": "open"}
    for its in found.values():
        missing = len(searches[its[0].draw]) - len(its)
        yield (*its, *[its[0]._replace(**none)] * missing)


def compared(points: Sequence[dict], sentence: Sentence) -> Iterator[Verdict]:
    """Yield what all searches say where all have laws on both sides."""
    for found in cells(points, [sentence]):
        if not any("none" in one.laws for one in found):
            yield weakest(found)


def weakest(cell: Sequence[Verdict]) -> Verdict:
    """Return what all searches say: the smallest lead, with an interval that holds those of all. It
    is open if they do not agree, and not settled if one is not.
    """
    ratios = [one for one in cell if not math.isnan(one.lead)]
    nearest = min(ratios or cell, key=lambda one: abs(np.log(one.lead)))
    said = nearest.verdict
    if len({SAYS.get(one.verdict, 0) for one in cell}) > 1 or said == "open":
        unranked = any(one.verdict == "not ranked" for one in cell)
        said = "not ranked" if unranked else "open"
    for one in cell:
        if one.verdict == "not settled":
            nearest, said = one, one.verdict
    known = [one for one in cell if not math.isnan(one.low)]
    low = min((one.low for one in known), default=math.nan)
    high = max((one.high for one in known), default=math.nan)
    return nearest._replace(low=low, high=high, verdict=said)


class Edge(NamedTuple):
    """A gain of a law that is at an end of its box on a plant."""

    plant: str
    law: str
    gain: str
    end: str  # lower or upper
    points: int  # at the end
    of: int  # points
    gains: dict[str, float]  # of the first such point


def edges(points: Sequence[dict]) -> Iterator[Edge]:
    """Yield each gain of a law that is at an end of its box on a plant."""
    members: dict[tuple[str, str], list[dict]] = {}
    for point in points:
        members.setdefault((point["plant"], point["law"]), []).append(point)
    for (plant, law), its in members.items():
        for gain, end in dict.fromkeys(edge for point in its for edge in point["edges"].items()):
            there = [point for point in its if point["edges"].get(gain) == end]
            yield Edge(plant, law, gain, end, len(there), len(its), there[0]["gains"])


def at_edges(points: Sequence[dict]) -> Iterator[str]:
    """Yield a sentence for each gain at an end of its box, of the first such point."""
    for one in edges(points):
        (words,) = search_space.edges_in_words(one.gains, {one.gain: one.end})
        yield f"{one.law} on {one.plant}: {words} ({one.points} of {one.of} points)"


def summary(points: Sequence[dict]) -> Iterator[str]:
    """Yield how far MuJoCo is from the fast engine, which gains are at the edge of their box, and
    the verdicts.
    """
    apart = np.abs([point["apart"] for point in points if point.get("apart")])
    if len(apart):
        share = 100.0 * (apart.max(axis=1) < 0.05).mean()
        most = ", ".join(f"{one:.2g}" for one in apart.max(axis=0))
        yield (
            f"MuJoCo: {len(apart)} points, J and error within 5 % in {share:.0f} %, farthest {most}"
        )
    yield from at_edges(points)
    for one in judged(points):
        ours, theirs = one.errors
        yield (
            f"{one.sentence}: search {one.search}, {one.plant}, {1e3 * one.period:g} ms, "
            f"{one.condition}, {one.level:.3g}: {' over '.join(one.laws)} {ours:.2g}, "
            f"{theirs:.2g}, {one.lead:.3g} ({one.low:.3g} to {one.high:.3g}), {one.verdict}"
        )


SHOWN = (
    Sentence("of super-twisting, without noise", TWISTING, RIVALS, QUIET),
    Sentence("of super-twisting, with sensor noise", TWISTING, RIVALS, NOISY),
    Sentence("of smooth sliding, without noise", SMOOTH, RIVALS, QUIET),
    Sentence("of smooth sliding, with sensor noise", SMOOTH, RIVALS, NOISY),
)


def plain(value: float) -> str:
    """Return a number with two digits, and without a power of ten if it is large."""
    text = f"{value:.2g}"
    return f"{float(text):.0f}" if "e+" in text else text


def cell(one: Verdict) -> str:
    """Return what a table of the page says of a verdict."""
    first, second = one.laws
    if first == "none" or second == "none":
        return "no gains" if first == "none" else "no rival"
    if one.verdict == "not ranked":
        return "not ranked"
    if one.verdict == "not settled":
        return f"not settled: {plain(one.low)} to {plain(one.high)}"
    if math.isnan(one.lead):
        ours, theirs = (f"{error:.1e}" if error > FLOOR else "below" for error in one.errors)
        return f"{ours}; `{second}` {theirs}"
    lead = f"{plain(one.lead)} ({plain(one.low)} to {plain(one.high)})"
    return f"{lead if one.verdict == 'open' else f'**{lead}**'} `{second}`"


def tables(points: Sequence[dict]) -> Iterator[str]:
    """Yield the lines of the page's tables: at each price, the best rival's error over a law's."""
    for shown in SHOWN:
        levels = " | ".join(f"{level:g}" for level in LEVELS["J"])
        yield f"| {shown.name}: plant, period, load | {levels} |"
        yield "|---" * (1 + len(LEVELS["J"])) + "|"
        rows: dict[tuple, dict[float, str]] = {}
        for found in cells([point for point in points if point["draw"] is None], [shown]):
            one = weakest(found)
            place = one.plant, one.period, one.condition.removesuffix(", noise")
            rows.setdefault(place, {})[one.level] = cell(one)
        for place in sorted(rows, key=lambda row: (*row[:2], QUIET.index(row[2]))):
            plant, period, condition = place
            its = rows[place]
            told = " | ".join(its.get(level, "") for level in LEVELS["J"])
            yield f"| `{plant}`, {1e3 * period:g} ms, {condition} | {told} |"


def tallies(points: Sequence[dict]) -> list[dict[str, int]]:
    """Return verdict -> how often all searches agree on it, and the number of cells in which all
    have laws on both sides, for each table of the page.
    """
    counts = []
    for shown in SHOWN:
        had = [one.verdict for one in compared(points, shown)]
        counts.append({word: had.count(word) for word in VERDICTS} | {"all": len(had)})
    return counts


class Between(NamedTuple):
    """How far the errors of one law at one price are apart in two searches, where both are settled
    and one is above the floor.
    """

    compared: int
    median: float  # ratio
    tenth: float  # that a tenth are beyond
    apart: float  # share beyond SEARCH

    @property
    def by_chance(self) -> float:
        """The share of cells in which both searches would tell two equal laws apart, to the same
        side.
        """
        return self.apart**2 / 2.0


def between(points: Sequence[dict]) -> Between:
    """Return how far two searches are apart."""
    names = "plant", "period", "model", "law", "level", "condition"
    errors: dict[tuple, list[float]] = {}
    for point in points:
        if point["draw"] is None and point["price"] == "J":
            place = tuple(point[name] for name in names)
            if is_settled(value(point)):
                errors.setdefault(place, []).append(max(value(point)[0], FLOOR))
    both = [pair for pair in errors.values() if len(pair) == 2 and max(pair) > FLOOR]
    ratios = np.array([max(pair) / min(pair) for pair in both])
    return Between(
        len(ratios),
        float(np.median(ratios)),
        float(np.quantile(ratios, 0.9)),
        float(np.mean(ratios > SEARCH["J"])),
    )


def contradicted(points: Sequence[dict]) -> set[str]:
    """Return the names of the sentences that some search contradicts somewhere."""
    return {one.sentence for one in judged(points) if one.verdict == "contradicted"}


def counted(points: Sequence[dict]) -> dict[tuple[str, bool], dict[str, int]]:
    """Return sentence and whether its cells were drawn -> verdict -> how many of them say so. A
    cell is contradicted if one search says so, else it says what all do.
    """
    counts: dict[tuple[str, bool], dict[str, int]] = {}
    for found in cells(points):
        said = weakest(found).verdict
        if any(one.verdict == "contradicted" for one in found):
            said = "contradicted"
        place = found[0].sentence, found[0].draw is not None
        counts.setdefault(place, dict.fromkeys(VERDICTS, 0))[said] += 1
    return counts


def count_table(points: Sequence[dict]) -> Iterator[str]:
    """Yield the lines of the table of how often each sentence of the page holds."""
    yield f"| sentence | plants | {' | '.join(VERDICTS)} |"
    yield "|---" * (2 + len(VERDICTS)) + "|"
    for (name, drawn), found in counted(points).items():
        told = " | ".join(str(count) for count in found.values())
        yield f"| {name} | {'drawn' if drawn else 'of the page'} | {told} |"


def how_often(points: Sequence[dict]) -> dict[str, str]:
    """Return sentence -> how often the page says that it holds."""
    against: dict[str, set[tuple]] = {}  # sentence -> places that contradict it
    for one in judged(points):
        if one.verdict == "contradicted":
            against.setdefault(one.sentence, set()).add(one.place)
    totals: dict[str, dict[str, int]] = {}
    for (name, _), found in counted(points).items():
        total = totals.setdefault(name, dict.fromkeys(VERDICTS, 0))
        for word, count in found.items():
            total[word] += count
    words = {}
    for name, total in totals.items():
        cases = sum(total.values())
        if name not in against:
            words[name] = (
                f"Never contradicted; it holds by a ratio in {total['stands']} of {cases} cases, "
                f"by the floor in {total['below the floor']}, unopposed in {total['unopposed']}."
            )
            continue
        its = against[name]
        strong = sum("strong" in place[4] for place in its)
        share = "only" if strong == len(its) else f"{strong or 'none'} of them"
        words[name] = f"Contradicted in {len(its)} of {cases} cases, {share} under *strong*."
    return words


def leads(count: dict[str, int]) -> int:
    """Return in how many cells of a table the first laws lead."""
    return count["stands"] + count["below the floor"]


def unranked(count: dict[str, int]) -> int:
    """Return in how many cells of a table an error is too small, or not settled."""
    return count["not ranked"] + count["not settled"]


def in_readme(points: Sequence[dict]) -> Iterator[str]:
    """Yield the lines of README's table of the points that were not drawn."""
    quiet, noisy, smooth, smooth_noisy = tallies([one for one in points if one["draw"] is None])
    yield (
        "| sliding law | sensor noise | cases | leads the best rival | trails it | neither | not "
        "ranked |"
    )
    yield "|---" * 7 + "|"
    rows = {
        "super-twisting, the better of explicit and implicit discretisation": (noisy, quiet),
        "smooth, first order (`boundary_layer`)": (smooth_noisy, smooth),
    }
    for law, counts in rows.items():
        for noise, count in zip(("yes", "no"), counts, strict=True):
            told = leads(count), count["contradicted"], count["open"], unranked(count)
            yield f"| {law} | {noise} | {count['all']} | {' | '.join(map(str, told))} |"


def first_words(points: Sequence[dict]) -> str:
    """Return what the page says first."""
    own = [point for point in points if point["draw"] is None]
    admitted = list(compared(own, SENTENCES[1]))
    verdicts = [one.verdict for one in admitted]
    ahead = verdicts.count("stands") + verdicts.count("below the floor")
    loads = [one.condition.removesuffix(", noise") for one in admitted]
    under = [f"{loads.count(load)} under *{load}*" for load in QUIET]
    alone = []
    for search in sorted({point["search"] for point in own}):
        alone.append(leads(tallies([point for point in own if point["search"] == search])[1]))
    noisy = tallies(own)[1]
    places = []
    for one in compared(own, SHOWN[1]):
        if one.verdict in ("stands", "below the floor"):
            load = one.condition.removesuffix(", noise")
            period = f"{1e3 * one.period:g} ms"
            places.append(f"`{one.plant}` at {period}, *{load}*, {one.level:g} times the least J")
    smooth = tallies(own)[2:]
    drawn = tallies([point for point in points if point["draw"] is not None])[2:]
    return (
        "Where its theorem admits the load and the sensor has noise, super-twisting leads the "
        f"best of its rivals in {ahead} of {len(admitted)} cases and trails it in "
        f"{verdicts.count('contradicted')}; these are {', '.join(under)}. With noise, theorem or "
        f"not, it leads in {leads(noisy)} of {noisy['all']} and trails in "
        f"{noisy['contradicted']}. Its leads: {' and '.join(places) or 'none'}. Alone, the two "
        f"searches have {alone[0]} and {alone[1]}. A smooth first-order law leads the best rival "
        f"in {sum(map(leads, smooth))} of {sum(its['all'] for its in smooth)} cases of the page, "
        f"and in {sum(map(leads, drawn))} of {sum(its['all'] for its in drawn)} that were drawn, "
        "each with one search."
    )


def of_searches(points: Sequence[dict]) -> str:
    """Return what the page says of its two searches."""
    its = between(points)
    return (
        f"The two searches found errors {its.median:.2g} times apart in the median of the "
        f"{its.compared} that both have and that lie above the floor, and {its.tenth:.2g} times "
        f"or more in a tenth. In {100 * its.apart:.0f} % they are more than "
        f"{SEARCH['J']:g} times apart. So by chance both tell two equal laws apart, and to the "
        f"same side, in {100 * its.by_chance:.0f} % of the cells."
    )


def of_runs(points: Sequence[dict]) -> str:
    """Return what the page says of errors that are no numbers, and of those that came out larger
    than where they were chosen.
    """
    own = []
    for point in points:
        if point["draw"] is None and point["price"] != "least":
            own.append(point)
    unsettled = [point for point in own if not is_settled(point["error"])]
    strong = [point for point in unsettled if point["condition"].startswith("strong")]
    runs = max(point["runs"] for point in points)
    above = [point for point in own if point["error"][0] > FLOOR]
    worse = sum(point["error"][0] > 2.0 * point["chose"] for point in above)
    return (
        f"Of {len(own)} errors {len(unsettled)} are not settled by {runs:,} runs, {len(strong)} of "
        f"them under *strong*. Of the {len(above)} above the floor, {worse} are more than twice "
        "what they were where they were chosen."
    )


def often_at_edges(points: Sequence[dict]) -> str:
    """Return what the page says of gains that a tenth of the points or more have at an end."""
    told = []
    for one in edges([point for point in points if point["draw"] is None]):
        if one.points >= 0.1 * one.of:
            share = f"{one.end}, {one.points} of {one.of}"
            told.append(f"`{one.gain}` of `{one.law}` on `{one.plant}` ({share})")
    return ", ".join(told)


def main() -> None:
    """Print the tables and sentences of the page, and draw its figure."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="+", type=Path, help="of points")
    parser.add_argument("--figure", type=Path, help="file to draw")
    asked = parser.parse_args()
    points = [point for path in asked.files for point in read(path)]
    print(*summary(points), *tables(points), *count_table(points), sep="\n")
    for name, words in how_often(points).items():
        print(f"{name}: {words}")
    print(
        *in_readme(points),
        first_words(points),
        of_searches(points),
        of_runs(points),
        often_at_edges(points),
        sep="\n",
    )
    if asked.figure:
        from benchmarks.fronts_figure import draw

        known = {point["law"] for point in points}
        draw(points, asked.figure, [law for law in LAWS if law in known])


if __name__ == "__main__":
    main()
