"""The sentences and tables of docs/what_wins_under_friction.md, by the points of
benchmarks/friction.py, and its figure.

    python -m benchmarks.friction_sentences benchmarks/friction.json --figure friction.svg

A lead counts if it is larger than another search may change it, SEARCH. A sentence is contradicted
if the other side leads by as much, and else it is open. Below one count of the encoder nothing is
ranked. A median whose interval spans more than SEARCH is no number, and its interval is printed.
"""

import argparse
import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.friction import AMPLITUDES, BY_MUJOCO, LAWS, OBSERVERS, RATES, SLOPES
from benchmarks.friction_figure import draw
from benchmarks.fronts_sentences import with_interval

FLOOR = 1.0  # count
SEARCH = 1.5  # factor by which another search may move an error, chosen
HUNTS, STANDS_STILL = 0.4, 0.1  # shares of admitted sets
DRY = ("coulomb10", "coulomb30", "stribeck", "identified")
LEVEL = ("coulomb10", "coulomb30", "identified")  # whose feedforward has errors
WITHOUT_INTEGRAL = ("pd", "boundary_layer")
JUDGED = RATES[:2]  # levels of R that the sentences are about
SLOPED, SLOPE = 1.1, 0.01  # factor within which a slope leaves an error as it is; its width

VERDICTS = "stands", "open", "contradicted", "not ranked"
JOINTS_OF = {
    "friction": "the three above",
    "friction_drawn": "drawn",
    "friction_drawn_first": "drawn first",
}  # file -> its name on the page


class Verdict(NamedTuple):
    """What the points say of a sentence on a joint, in one condition."""

    sentence: str
    joint: str
    about: str
    values: tuple[float, float]  # of its first laws, and of its second or its limit
    verdict: str  # stands, open, contradicted, not ranked


def error(point: dict | None) -> float:
    """Return the median error of a point, counts; inf without one."""
    if point is None or point["errors"] is None:
        return math.inf
    return float(np.median(np.nan_to_num(point["errors"], nan=math.inf)))


def interval(point: dict) -> tuple[float, float]:
    """Return the ends of the interval of a point's median error, counts."""
    values = [math.nan if one is None else one for one in point["errors"]]
    return with_interval(values)[1:]


def is_settled(point: dict) -> bool:
    """Return whether the runs give a point's error as a number, or as one below a count. What
    MuJoCo alone ran, on two instances, has no interval.
    """
    low, high = interval(point)
    few = len(point["errors"]) == BY_MUJOCO
    return few or low == high or high <= SEARCH * max(low, FLOOR)


def leads(ours: float, theirs: float, factor: float = 1.0) -> str:
    """Return the verdict on a lead of a factor: with as much as another search may move an error
    on top it stands, without any lead it is contradicted.
    """
    if max(ours, theirs) <= FLOOR:
        return "not ranked"
    ours, theirs = max(ours, FLOOR), max(theirs, FLOOR)
    if ours == theirs == math.inf:
        return "not ranked"
    if theirs > max(factor, SEARCH) * ours:
        return "stands"
    return "contradicted" if ours > SEARCH * theirs else "open"


class Points:
    """Points by what they are about."""

    def __init__(self, points: Sequence[dict]):
        self.kept = {self._key(**point): point for point in points}
        self.joints = list(dict.fromkeys(point["joint"] for point in points))

    @staticmethod
    def _key(joint, law, price, friction, level=0.0, task="rest", share=0.0, **others):
        more = others.get("on", "reference"), others.get("size", 0.0)
        return joint, law, price, level, friction, task, share, *more

    def find(self, joint: str, law: str, friction: str, price: str = "J", **about: Any):
        """Return a point; without more, that of the set of the least J at rest."""
        return self.kept.get(self._key(joint, law, price, friction, **about))

    def best(self, joint: str, laws: Sequence[str], friction: str, **about: Any) -> float:
        """Return the least error of some laws."""
        return min(error(self.find(joint, law, friction, **about)) for law in laws)

    def share(self, joint: str, law: str, friction: str) -> float:
        """Return the share of sets that still move; NaN without sets."""
        point = self.find(joint, law, friction, price="hunting") or {}
        return point.get("moving", math.nan)

    def frictions(self, joint: str, names: Sequence[str]) -> list[str]:
        """Return those frictions that the points of a joint have."""
        return [name for name in names if self.find(joint, LAWS[0], name)]


def rests(points: Points, joint: str) -> Iterator[tuple]:
    """Tuned by J without friction, super-twisting and the PD with an observer rest within a count
    under dry friction; a law without an integral does not.
    """
    for friction in points.frictions(joint, DRY):
        for law in ("pd_observer", "super_twisting"):
            found = points.best(joint, (law,), friction)
            verdict = "stands" if found <= FLOOR else "open"
            yield (
                f"{law}, {friction}",
                found,
                FLOOR,
                ("contradicted" if found > SEARCH * FLOOR else verdict),
            )
        found = points.best(joint, WITHOUT_INTEGRAL, friction)
        yield f"without an integral, {friction}", FLOOR, found, leads(FLOOR, found)


def hunts(points: Points, joint: str) -> Iterator[tuple]:
    """Of the admitted sets of the second-order observer at least 40 % still move after 40 s, of its
    twin with one integral at most 10 %.
    """
    for friction in points.frictions(joint, DRY):
        two, one = (points.share(joint, law, friction) for law in ("hodob", "pd_observer"))
        verdict = "open"
        if math.isnan(two + one):
            verdict = "not ranked"
        elif two >= HUNTS and one <= STANDS_STILL:
            verdict = "stands"
        elif two <= one:
            verdict = "contradicted"
        yield friction, two, one, verdict


def compare(first: Any, second: Any, factor: float = 1.0, levels: Sequence[float] = JUDGED) -> Any:
    """Return the function of a sentence that the best of some laws has less error through reversals
    than the best of others: (laws, what is fed forward; the worst of these counts).
    """

    def said(points: Points, joint: str) -> Iterator[tuple]:
        for friction in points.frictions(joint, LEVEL):
            for level in levels:
                about = {"price": "R", "level": level, "task": "sine"}
                sides = []
                for laws, feeds in (first, second):
                    errors = [points.best(joint, laws, friction, **about, **one) for one in feeds]
                    sides.append(max(errors))
                ours, theirs = sides
                yield f"{friction}, R {level:g}", ours, theirs, leads(ours, theirs, factor)

    return said


def dithers(points: Points, joint: str) -> Iterator[tuple]:
    """Of three square waves only that of 1.5 times the friction brings a PD within a count at rest,
    with gains of the least J.
    """
    for friction in points.frictions(joint, LEVEL):
        alone = points.best(joint, ("pd",), friction)
        about = {"price": "dither", "size": AMPLITUDES[-1]}
        found = points.best(joint, ("pd",), friction, **about)
        smaller = points.best(joint, ("pd",), friction, **about | {"size": AMPLITUDES[-2]})
        verdict = "open"
        if alone <= FLOOR or found == math.inf:
            verdict = "not ranked"
        elif smaller <= FLOOR or found > SEARCH * FLOOR:
            verdict = "contradicted"
        elif found <= FLOOR:
            verdict = "stands"
        yield friction, found, FLOOR, verdict


def slopes(points: Points, joint: str) -> Iterator[tuple]:
    """A slope of a hundredth in place of super-twisting's sign does not worsen its reversals."""
    for friction in points.frictions(joint, LEVEL):
        about = {"level": RATES[0], "task": "sine"}
        sign = points.best(joint, TWISTING, friction, price="R", **about)
        found = points.best(joint, TWISTING, friction, price="slope", size=SLOPE, **about)
        verdict = "stands" if found <= SLOPED * max(sign, FLOOR) else "open"
        if sign == math.inf:
            verdict = "not ranked"
        elif found > SEARCH * max(sign, FLOOR):
            verdict = "contradicted"
        yield friction, found, sign, verdict


PLAIN, RIGHT = ({"share": 0.0},), ({"share": 1.0},)
WRONG = {"share": 0.7}, {"share": 1.3}
AT_SPEED = ({"share": 1.0, "on": "speed"},)
TWISTING = ("super_twisting",)
SENTENCES = {
    "rest": rests,
    "hunting": hunts,
    "reversals": compare((OBSERVERS, PLAIN), (TWISTING, PLAIN)),
    "smooth": compare((OBSERVERS, PLAIN), (("boundary_layer",), PLAIN), 3.0),
    "right": compare((("pd",), RIGHT), (TWISTING, PLAIN), levels=RATES[:1]),
    "wrong": compare((OBSERVERS, PLAIN), (("pd",), WRONG), levels=RATES[:1]),
    "speed": compare((("pd",), RIGHT), (("pd",), AT_SPEED), levels=RATES[:1]),
    "dither": dithers,
    "slope": slopes,
}


# sentence -> field of points that the first draw does not have, and its value
NEEDS = {"speed": ("on", "speed"), "dither": ("price", "dither"), "slope": ("price", "slope")}


def judged(points: Sequence[dict]) -> list[Verdict]:
    """Return a verdict for each condition of each sentence, on each joint; a file may be older
    than a sentence.
    """
    by_key = Points(points)
    found = []
    for name, says in SENTENCES.items():
        field, value = NEEDS.get(name, (None, None))
        if field and all(point.get(field) != value for point in points):
            continue
        for joint in by_key.joints:
            for about, ours, theirs, verdict in says(by_key, joint):
                found.append(Verdict(name, joint, about, (ours, theirs), verdict))
    return found


def counts(verdicts: Sequence[Verdict]) -> dict[str, dict[str, int]]:
    """Return how often a sentence stands, is open, contradicted, or not ranked."""
    found: dict[str, dict[str, int]] = {}
    for one in verdicts:
        its = found.setdefault(one.sentence, {})
        its[one.verdict] = its.get(one.verdict, 0) + 1
    return found


def agreement(points: Sequence[dict]) -> np.ndarray:
    """Return MuJoCo's median error over the engine's on the same instances, for each point above a
    count that both ran.
    """
    found = []
    for point in points:
        if point.get("mujoco"):
            engine = np.median(point["errors"][:BY_MUJOCO])
            if engine > FLOOR:
                found.append(np.median(point["mujoco"]) / engine)
    return np.array(found)


def cell(point: dict | None) -> str:
    """Return a point's error as the page prints it, counts, or its interval where the runs do not
    settle it; "–" where no set is had.
    """
    found = error(point)
    if point is None or found == math.inf:
        return "–"
    if not is_settled(point):
        return " to ".join(map(two_digits, interval(point)))
    return two_digits(found)


def two_digits(value: float) -> str:
    """Return a number of two digits, without the zero before the point."""
    text = f"{value:.2g}" if value < 100.0 else f"{value:.0f}"
    return text.removeprefix("0") if text.startswith("0.") else text


def rest_rows(points: Sequence[dict], joint: str, frictions: Sequence[str]) -> Iterator[str]:
    """Yield the rows of the table of rest, by the gains of the least J."""
    by_key = Points(points)
    for law in LAWS:
        cells = [cell(by_key.find(joint, law, friction)) for friction in frictions]
        yield f"| `{law}` | {' | '.join(cells)} |"


def reversal_rows(points: Sequence[dict], joint: str, frictions: Sequence[str]) -> Iterator[str]:
    """Yield the rows of the table of reversals: for each friction the error at each level of R, and
    the share of sets that still move.
    """
    by_key = Points(points)
    for law in LAWS:
        cells = []
        for friction in frictions:
            errors = []
            for level in RATES:
                about = {"price": "R", "level": level, "task": "sine"}
                errors.append(cell(by_key.find(joint, law, friction, **about)))
            share = by_key.share(joint, law, friction)
            moving = "–" if math.isnan(share) else f"{100 * share:.0f} %"
            cells.append(f"{'; '.join(errors)} | {moving}")
        yield f"| `{law}` | {' | '.join(cells)} |"


def compensated_rows(points: Sequence[dict], joint: str, frictions: Sequence[str]) -> Iterator[str]:
    """Yield the rows of the table of compensation at the low level of R: for each friction without,
    right, 70 % and 130 %.
    """
    by_key = Points(points)
    for law in LAWS:
        cells = []
        for friction in frictions:
            errors = []
            for share in (0.0, 1.0, 0.7, 1.3):
                about = {"price": "R", "level": RATES[0], "task": "sine", "share": share}
                errors.append(cell(by_key.find(joint, law, friction, **about)))
            cells.append("; ".join(errors))
        yield f"| `{law}` | {' | '.join(cells)} |"


def at_speed_rows(points: Sequence[dict], joint: str, frictions: Sequence[str]) -> Iterator[str]:
    """Yield the rows of the table of compensation at the measured speed: for each friction at the
    two lower levels of R, right, 70 % and 130 %.
    """
    by_key = Points(points)
    for law in LAWS:
        cells = []
        for friction in frictions:
            for level in JUDGED:
                errors = []
                for share in (1.0, 0.7, 1.3):
                    about = {"price": "R", "level": level, "task": "sine", "share": share}
                    point = by_key.find(joint, law, friction, on="speed", **about)
                    errors.append(cell(point))
                cells.append("; ".join(errors))
        yield f"| `{law}` | {' | '.join(cells)} |"


def parted_rows(points: Sequence[dict], joint: str, frictions: Sequence[str]) -> Iterator[str]:
    """Yield the rows of the table of a PD beside a square wave and of super-twisting with a slope:
    for each friction the error at rest and through reversals, and R at rest.
    """
    by_key = Points(points)
    for law, price, sizes in (("pd", "dither", AMPLITUDES), ("super_twisting", "slope", SLOPES)):
        for size in (0.0, *sizes):
            cells = []
            for friction in frictions:
                for level, task in ((0.0, "rest"), (RATES[0], "sine")):
                    plain = "J" if task == "rest" else "R"
                    about = {"level": level, "task": task, "size": size}
                    point = by_key.find(joint, law, friction, price if size else plain, **about)
                    rate = f" (R {two_digits(point['R'])})" if point and point["errors"] else ""
                    cells.append(cell(point) + rate)
            yield f"| `{law}`, {price} {size:g} | {' | '.join(cells)} |"


def page_rows(points: Sequence[dict]) -> Iterator[str]:
    """Yield the rows of all tables of errors, joint by joint."""
    for joint in Points(points).joints:
        dry = Points(points).frictions(joint, DRY)
        others = Points(points).frictions(joint, ("load", "lugre"))
        yield from rest_rows(points, joint, (*dry, *others))
        yield from reversal_rows(points, joint, dry)
        level = Points(points).frictions(joint, LEVEL)
        yield from compensated_rows(points, joint, level)
        yield from at_speed_rows(points, joint, level)
        yield from parted_rows(points, joint, level)
        sides = Points(points).frictions(joint, ("play, link", "play, motor", "contact"))
        if sides:
            yield from rest_rows(points, joint, sides)


def verdict_rows(points: Sequence[dict], file: str) -> Iterator[str]:
    """Yield a row for each sentence: how often it stands, is open, contradicted, not ranked."""
    joints = JOINTS_OF.get(file, file)
    for name, found in counts(judged(points)).items():
        numbers = [str(found.get(word, 0)) for word in VERDICTS]
        yield f"| `{name}` | {joints} | {' | '.join(numbers)} |"


def search_noise(points: Sequence[dict]) -> np.ndarray:
    """Return the larger over the smaller of the errors that two searches chose, where either is
    more than a count; inf where one search found no set.
    """
    found = []
    for point in points:
        chose = point.get("chose")
        if point.get("price") == "R" and chose and len(chose) > 1:
            low, *_, high = sorted(math.inf if one is None else one for one in chose)
            if high > FLOOR:
                found.append(high / max(low, FLOOR))
    return np.array(found)


def main() -> None:
    """Print the verdicts, and how far MuJoCo is from the engine; draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("points", nargs="+", type=Path)
    parser.add_argument("--figure", type=Path)
    asked = parser.parse_args()
    points = [point for path in asked.points for point in json.loads(path.read_text())]
    verdicts = judged(points)
    print(*verdicts, sep="\n")
    ratios = agreement(points)
    if len(ratios):
        near = 100 * np.mean(np.abs(np.log(ratios)) < math.log(1.1))
        print(f"MuJoCo within 10 % of the engine in {near:.0f} % of {len(ratios)} points")
    ratios = search_noise(points)
    if len(ratios):
        print(f"searches apart: median {np.median(ratios):.3g}, largest {ratios.max():.3g}")
    print(*page_rows(points), *verdict_rows(points, asked.points[0].stem), sep="\n")
    if asked.figure:
        draw(points, asked.figure)


if __name__ == "__main__":
    main()
