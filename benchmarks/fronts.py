"""Fronts of error under a load against price: what each law's best gains reach on a plant.

    python benchmarks/fronts.py duffing inverted_pendulum --out two.json --figure fronts.svg
    python benchmarks/fronts.py duffing --model nominal --law pid super_twisting
    python benchmarks/fronts.py arm.xml:elbow
    python benchmarks/fronts.py van_der_pol --lot 12345678 --out lot.json
    python benchmarks/fronts.py --read two.json lot.json     # the sentences of the page, judged

A law has as many accuracies as it has gains, so two laws are compared at one price. There are two.
J is what gains are tuned for: ITAE and variation of the command in seven conditions of 5 s. Its
share of noise ends where the command jumps from bound to bound at every sample. So the rate of
variation in calm, with a sensor's noise of 1e-3 of the start, stands beside it, and still rises
for another decade of slope.

Half of a law's sets of gains are drawn over the box of a search and half a decade beyond it, a
decade for the widths of slopes and the bandwidths of observers. The other half are bred from the
fronts of the first. Sets are chosen on one instance. All that is told of them comes from twelve
others, with other starts, phases and noise. A set that misses a condition of its theorem is drawn
again. The error is the rms of the true position over whole periods, of 4 s or one period at least,
as a share of the start. A set whose error in the window before differs by more than 25 % has not
settled, and is not chosen. The load is a sixth of the bound on u, and its frequency counts by the
bandwidth wc of the tuned ADRC.

A sentence of the page stands at a price if the lead's interval agrees and the lead is beyond what
another search would find. It is contradicted if both say the reverse, and else open. With --lot,
loads and prices are drawn.

Runs are by the suite's fast engine, and four sets of each front are run by MuJoCo too. A plant that
is more than one equation is run by MuJoCo alone, with 40 sets a law and fewer conditions.
"""

import argparse
import dataclasses
import json
import math
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import AbstractContextManager
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

import smc_mujoco as smc
from smc_mujoco.analysis.engine import scores
from smc_mujoco.analysis.engine.form import FAILURE, SCORES, SETTING, Form, layout
from smc_mujoco.analysis.engine.group import FormGroup, why_not
from smc_mujoco.analysis.engine.scores import log_in
from smc_mujoco.analysis.signed_rank import interval
from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.analysis.tuning.evaluator import with_gains
from smc_mujoco.analysis.tuning.objective import BUDGET, OBJECTIVES, Objective
from smc_mujoco.analysis.tuning.search import TuningTask, task_of
from smc_mujoco.common.jit import inlined
from smc_mujoco.common.scripts import execute
from smc_mujoco.control import gain_sets
from smc_mujoco.control.law import catalogue
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics import catalogue as metrics
from smc_mujoco.simulation import state
from smc_mujoco.simulation.grid import case
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.workers import opened

OBSERVERS = ("adrc", "pd_observer")
RIVALS = (*OBSERVERS, "pid", "lqi")
SMOOTH = ("boundary_layer", "observer_free")
TWISTING = ("super_twisting",)
LAWS = (*TWISTING, "classical", "implicit_first_order", "extended_state", *SMOOTH, *RIVALS)
TOLD = ("lqi", "mpc", "loop_shaping")  # told the plant's line at rest, whatever --model says
GOAL = OBJECTIVES["balanced"]
SETS, SETS_BY_MUJOCO = 1200, 40
KINDS_BY_MUJOCO = ("middle", "noisy", "calm")
GENERATIONS = (0.5, 0.35, 0.25, 0.15, 0.1)  # spread of the bred sets, of log gains
WIDER = 0.5  # decades beyond the box of a search
STEEPER = ("phi", "w", "l")  # slopes and bandwidths of observers, which go a decade beyond
CAP = 15.0  # s^2: runs that stay where they start cost more
UNSEEN = 12  # instances
SETTLING, WINDOW = 4.0, 4.0  # s: before the two windows, and each of them at least
CHANGED = math.log(1.25)  # of the error from one window to the next
FORCE, NOISE, DELAY = 1 / 6, 1e-3, 0.1  # of u_max; of the start; of 1 / wc
VELOCITY_NOISE_RATIO = 5.0  # 1/s, as in margins
FLOOR = 1e-4  # of the start: smaller errors are not ranked
# prices: times the least J of all laws, or the rate of variation in calm over u_max, 1/s
LEVELS = {
    "J": (1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 6.0, 10.0, 20.0),
    "rate": (10.0, 30.0, 100.0, 300.0, 1000.0),
}
MARGIN = 0.97  # of a level that sets are chosen within, so that unseen runs cost about the level
CHECKED = 4  # sets of a front that MuJoCo runs
ITAE, TV, RMS, BEFORE, RATE = range(5)
SUMS = ("itae", "tv", "rms_error", "rms_before", "tv_rate")


class Condition(NamedTuple):
    """A load, a sensor and a delay, without a unit."""

    kind: str
    force: float = FORCE  # of u_max
    ratio: float = 0.5  # of wc
    noise: float = 0.0  # of the start
    delay: float = 0.0  # of 1 / wc


CONDITIONS = (
    Condition("slow", ratio=0.125),
    Condition("middle"),
    Condition("fast", ratio=2.0),
    Condition("noisy", noise=NOISE),
    Condition("delayed", delay=DELAY),
    Condition("strong", force=4 * FORCE),
    Condition("calm", force=0.0, noise=NOISE),
)
# factors that a lot draws: of the force, of its frequency, of the noise or the delay
DRAWN = ((0.5, 1.4), (0.7, 1.4), (0.5, 2.0))
CALM = -1  # the last condition


class Job(NamedTuple):
    """A law on a plant, and the runs that its gains are judged in."""

    plant: str
    law: str
    model: str
    wc: float  # rad/s
    conditions: tuple[Condition, ...]
    sets: int
    device: str


class Sets(NamedTuple):
    """Gains of a law, and what they reach on the instance that chooses."""

    gains: np.ndarray  # (sets, gains)
    J: np.ndarray  # (sets,), NaN beyond CAP
    errors: np.ndarray  # (sets, conditions), of the start
    settled: np.ndarray  # (sets, conditions)
    rates: np.ndarray  # (sets,), of variation in calm, of u_max a second


def by_lot(seed: int, plant: str) -> tuple[tuple[Condition, ...], dict[str, tuple[float, ...]]]:
    """Return conditions and levels of price that a lot draws for a plant; equal ratios are equally
    likely.
    """
    rng = np.random.default_rng([seed, zlib.crc32(plant.encode())])

    def between(low: float, high: float) -> float:
        return float(math.exp(rng.uniform(math.log(low), math.log(high))))

    conditions = []
    for kind, *levels in CONDITIONS[:CALM]:
        force, ratio, other = (between(*ends) for ends in DRAWN)
        factors = force, ratio, other, other
        conditions.append(Condition(kind, *np.multiply(levels, factors).tolist()))
    prices = {}
    for price, its in LEVELS.items():
        prices[price] = tuple(sorted(between(its[0], its[-1]) for _ in its))
    return (*conditions, CONDITIONS[CALM]), prices


def plant_of(text: str) -> Plant:
    """Return the plant of a name, FILE.xml:joint or FILE.py:variable."""
    file, _, variable = text.rpartition(":")
    if file.endswith(".py"):
        return execute(Path(file))[variable]
    return as_plant(text)


def bandwidth(made: Plant) -> float:
    """Return the bandwidth of the tuned ADRC on a plant, rad/s."""
    if gain_sets.in_set(made, "adrc", "tuned"):
        return gain_sets.law(made, "adrc").gains["wc"]
    return smc.tune(made, "adrc", searches=1).law.gains["wc"]


def _rms_before(form: Form, at: int) -> tuple[Any, Any]:
    """Return the rms of e over the window before that of rms_error, as long."""
    now = layout(form).work.now

    @inlined
    def take(row, work, k):
        early = row[SETTING.early]
        length = row[SETTING.samples] + 1.0 - early
        if early - length <= k < early:
            sample = log_in(work, now)
            e = sample.x - sample.r
            work[at] += e * e / length

    return take, inlined(lambda row, work: math.sqrt(work[at]))


def sums_of(trace: smc.Trace, window: int) -> list[float]:
    """Return the same five sums of a run by MuJoCo; `window` in samples."""
    if trace.failure is not None:
        return [math.nan] * len(SUMS)
    e = trace.e[:, 0]
    late = np.abs(np.diff(trace.u[-window - 1 :, 0])).sum()
    return [
        metrics.itae(trace),
        metrics.tv(trace),
        float(np.sqrt(np.mean(e[-window:] ** 2))),
        float(np.sqrt(np.mean(e[-2 * window : -window] ** 2))),
        float(late / (window * trace.scenario.control_period)),
    ]


class Bench:
    """The runs of a job: for each instance those of J, then those of the conditions."""

    def __init__(self, job: Job):
        scores.WRITTEN_OUT["rms_before"] = _rms_before  # in each process
        self.job = job
        self.plant = plant_of(job.plant)
        self.task: TuningTask = task_of(self.plant, smc.law(job.law), GOAL, BUDGET, 0, 1)
        self.goal: Objective = self.task.goal
        self.start = self.task.scales["X"]
        self.bound = float(self.goal.u_max or math.nan)
        self.names = tuple(self.task.box)
        self.cases: list[smc.Scenario] = []
        self.windows: list[int] = []  # samples
        for instance in range(1 + UNSEEN):
            self._add(instance)
        self.size = len(self.cases) // (1 + UNSEEN)  # of an instance
        self.priced = self.size - len(job.conditions)
        self.fast = not any(map(why_not, self.cases))
        if self.fast:
            self.group = FormGroup(self.cases, SUMS)
            rows = self.group.rows
            rows[:, SETTING.early] = rows[:, SETTING.samples] + 1 - self.windows
            rows[:, SETTING.late] = rows[:, SETTING.samples] - self.windows

    def _add(self, instance: int) -> None:
        law = self.task.law
        if instance == 0:
            cases = self.goal.scenarios(self.plant, law)
        else:
            cases = self.goal.holdout(self.plant, law, instance)
        for one in cases:
            self.cases.append(dataclasses.replace(one, model=self.job.model))
            self.windows.append(round(1.0 / one.control_period))
        rng = np.random.default_rng([2027, instance])
        for condition in self.job.conditions:
            omega = condition.ratio * self.job.wc
            period = math.tau / omega
            window = period * max(1, math.ceil(WINDOW / period))
            load = smc.Sine(condition.force * self.bound, omega, rng.uniform(0.0, math.tau))
            noise = condition.noise * self.start
            made = case(
                self.plant,
                law,
                duration=round(SETTLING + 2.0 * window, 2),
                seed=instance,
                changes={
                    "disturbance": load if condition.force else (),
                    "noise": smc.Noise(noise, VELOCITY_NOISE_RATIO * noise),
                    "input_delay": round(condition.delay / self.job.wc, 3),
                    "model": self.job.model,
                },
            )
            self.cases.append(made)
            self.windows.append(round(window / made.control_period))

    def sums(self, gains: np.ndarray, runs: Sequence[int]) -> np.ndarray:
        """Return the sums of gains in some runs, (sets, runs, sums); NaN after a failure."""
        if not self.fast:
            return self.by_mujoco(gains, runs)
        rows = np.tile(self.group.rows[runs], (len(gains), 1))
        for name, values in zip(self.names, gains.T, strict=True):
            rows[:, self.group.gain_columns(name)] = np.repeat(values, len(runs))[:, None]
        scores = self.group.run(rows, threads=1, device=self.job.device)
        found = np.where(scores[:, [FAILURE]] == state.FINE, scores[:, SCORES:], np.nan)
        return found.reshape(len(gains), len(runs), len(SUMS))

    def by_mujoco(self, gains: np.ndarray, runs: Sequence[int]) -> np.ndarray:
        """Return the same of MuJoCo's runs."""
        made = []
        for values in gains:
            law = with_gains(self.task.law, self.names, values.tolist())
            made += [dataclasses.replace(self.cases[run], law=law) for run in runs]
        found = np.full((len(made), len(SUMS)), np.nan)
        for i, trace in stream(made, threads=1):
            found[i] = sums_of(trace, self.windows[runs[i % len(runs)]])
        return found.reshape(len(gains), len(runs), len(SUMS))

    def runs_of(self, instance: int) -> tuple[list[int], list[int]]:
        """Return the numbers of the runs of J, and of those of the conditions."""
        first = instance * self.size
        middle = first + self.priced
        return list(range(first, middle)), list(range(middle, first + self.size))

    def prices(self, sums: np.ndarray, instance: int) -> np.ndarray:
        """Return J of sums, (sets, runs of J, sums)."""
        total = np.zeros(len(sums))
        for i, run in enumerate(self.runs_of(instance)[0]):
            one = self.cases[run]
            start = np.abs(np.subtract(one.resolved.x0, one.plant.origin)).sum()
            total += sums[:, i, ITAE] / start
            total += self.goal.weight * sums[:, i, TV] / (self.bound * self.goal.duration)
        return total

    def judged(self, gains: np.ndarray, instance: int) -> Sets:
        """Return what gains reach on an instance; only those within CAP run under loads."""
        priced, loaded = self.runs_of(instance)
        J = self.prices(self.sums(gains, priced), instance)
        if instance == 0:
            J[np.nan_to_num(J, nan=np.inf) > CAP] = np.nan
        errors = np.full((len(gains), len(loaded)), np.nan)
        settled = np.zeros(errors.shape, bool)
        rates = np.full(len(gains), np.nan)
        fine = np.flatnonzero(~np.isnan(J))
        if fine.size:
            sums = self.sums(gains[fine], loaded)
            errors[fine] = sums[:, :, RMS] / self.start
            both = np.maximum(sums[:, :, (RMS, BEFORE)], FLOOR * self.start)
            settled[fine] = np.abs(np.diff(np.log(both), axis=2)[:, :, 0]) < CHANGED
            rates[fine] = sums[:, CALM, RATE] / self.bound
        return Sets(gains, J, errors, settled, rates)

    def admitted(self, gains: np.ndarray) -> list[bool | None]:
        """Return whether a law's theorem admits the load of each condition; None if it names no
        bound. Its theorem is about accelerations, so without a model each force counts g times.
        """
        law = with_gains(self.task.law, self.names, gains.tolist())
        g = 1.0 / self.task.scales["M"]
        its = SimpleNamespace(**law.gains)
        if self.job.model == "none":
            for name, value in law.gains.items():
                if unit := search_space.unit(law, name):
                    setattr(its, name, value * g**unit.force)
        bounds = catalogue()[self.job.law].admits
        found: list[bool | None] = []
        for condition in self.job.conditions:
            force = g * condition.force * self.bound
            sizes = {"d": force, "d'": force * condition.ratio * self.job.wc}
            fits = [sizes[what] < most(its) for what, most in bounds.items()]
            found.append(all(fits) if fits else None)
        return found


def search(job: Job) -> Sets:
    """Draw and breed sets of gains of a law, and judge them on the instance that chooses."""
    bench = Bench(job)
    count = job.sets
    rng = np.random.default_rng([11, zlib.crc32(job.law.encode())])
    low, high = np.log(list(bench.task.box.values())).T
    for i, name in enumerate(bench.names):
        wider = math.log(10.0) * (1.0 if name in STEEPER else WIDER)
        low[i] -= wider
        high[i] += wider

    def held(draw: Callable[[], np.ndarray], wanted: int) -> np.ndarray:
        found: list[np.ndarray] = []
        while len(found) < wanted:
            for row in np.exp(draw()):
                if bench.task.holds(tuple(row)):
                    found.append(row)
        return np.array(found[:wanted])

    first = count // 2
    known = [bench.judged(held(lambda: rng.uniform(low, high, (first, len(low))), first), 0)]
    for spread in GENERATIONS:
        so_far = joined(known)
        parents = np.log(so_far.gains[on_front(so_far)])
        if not len(parents):
            break
        size = max(1, count // (2 * len(GENERATIONS)))

        def bred(parents=parents, size=size, spread=spread) -> np.ndarray:
            steps = rng.normal(0.0, spread, (size, len(low)))
            steps *= rng.random(steps.shape) < 0.6
            return np.clip(parents[rng.integers(len(parents), size=size)] + steps, low, high)

        known.append(bench.judged(held(bred, size), 0))
    return joined(known)


def joined(parts: Sequence[Sets]) -> Sets:
    """Return sets as one."""
    return Sets(*(np.concatenate(its) for its in zip(*parts, strict=True)))


def on_front(sets: Sets) -> np.ndarray:
    """Return which sets have less error in some condition than every set of a lower price."""
    found = np.zeros(len(sets.J), bool)
    for price in (sets.J, sets.rates):
        for error in np.where(sets.settled, sets.errors, np.nan).T:
            least = math.inf
            for i in np.argsort(price):  # NaN is last
                if not np.isnan(price[i]) and error[i] < 0.98 * least:
                    found[i] = True
                    least = error[i]
    return found


def chosen(
    sets: Sets, levels: Mapping[str, Sequence[float]], least: float
) -> Iterator[tuple[str, float, int, int]]:
    """Yield price, level, condition and the set with the least error that the level affords; then
    the cheapest set.
    """
    for price, its in levels.items():
        for level in its:
            cost = sets.J / least if price == "J" else sets.rates
            affordable = cost <= MARGIN * level
            for condition in range(sets.errors.shape[1] - 1):
                fine = affordable & sets.settled[:, condition]
                errors = np.where(fine, sets.errors[:, condition], np.nan)
                if not np.isnan(errors).all():
                    yield price, level, condition, int(np.nanargmin(errors))
    if not np.isnan(sets.J).all():
        yield "least", 0.0, CALM, int(np.nanargmin(sets.J))


def told(job: Job, sets: Sets, levels: Mapping[str, Sequence[float]], least: float) -> list[dict]:
    """Return the points of a law's fronts, on instances that chose nothing."""
    bench = Bench(job)
    points = list(chosen(sets, levels, least))
    wanted = sorted({i for *_, i in points})
    if not wanted:
        return []
    runs = [bench.judged(sets.gains[wanted], 1 + i) for i in range(UNSEEN)]
    found = []
    for price, level, condition, i in points:
        at = wanted.index(i)
        errors = [float(run.errors[at, condition]) for run in runs]
        settled = sum(bool(run.settled[at, condition]) for run in runs)
        point: dict[str, Any] = {
            "plant": bench.plant.name,
            "model": job.model,
            "law": job.law,
            "price": price,
        }
        point |= {"level": level, "condition": job.conditions[condition].kind}
        point |= {"gains": dict(zip(bench.names, sets.gains[i].tolist(), strict=True))}
        point |= {"chose": float(sets.errors[i, condition]), "errors": errors, "settled": settled}
        point |= {"J": [float(run.J[at]) for run in runs]}
        point |= {"rates": [float(run.rates[at]) for run in runs]}
        point["within"] = bench.admitted(sets.gains[i])[condition]
        found.append(point)
    if bench.fast:
        check(bench, found)
    return found


def check(bench: Bench, points: Sequence[dict]) -> None:
    """Run CHECKED sets of the front of J by MuJoCo too, and note how far apart they are."""
    distinct = {}
    for point in points:
        if point["price"] == "J" and point["condition"] == "middle":
            distinct.setdefault(tuple(point["gains"].values()), point)
    front = list(distinct.values())
    picked = np.unique(np.linspace(0, len(front) - 1, min(CHECKED, len(front))).round().astype(int))
    at = [condition.kind for condition in bench.job.conditions].index("middle")
    runs = [*bench.runs_of(1)[0], bench.runs_of(1)[1][at]]
    for i in picked:
        gains = np.array([list(front[i]["gains"].values())])
        by_both = [bench.sums(gains, runs), bench.by_mujoco(gains, runs)]
        J = [float(bench.prices(sums, 1)[0]) for sums in by_both]
        errors = [float(sums[0, -1, RMS]) for sums in by_both]
        front[i]["apart"] = [J[0] / J[1] - 1.0, errors[0] / errors[1] - 1.0]


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


QUIET = ("slow", "middle")
CHEAP = ("calm",)  # of the cheapest set, whatever the load
SENTENCES = (
    Sentence("integral", TWISTING, RIVALS, (*QUIET, "fast", "strong"), within=True),
    Sentence("smooth", RIVALS, SMOOTH, QUIET, high=10.0),
    Sentence("smooth, by noise", RIVALS, SMOOTH, QUIET, "rate", high=300.0),
    Sentence("sign", SMOOTH, ("classical",), QUIET),
    Sentence("cheap", OBSERVERS, (*TWISTING, "classical", "implicit_first_order"), CHEAP, "least"),
)
ERROR = 0.025 / len(SENTENCES)  # beyond each end of an interval
# factor by which a second search, of another seed, may move an error and a least J; chosen from a
# pilot, where fronts of two searches were up to 1.5 times apart
SEARCH = {"J": 1.5, "rate": 1.5, "least": 1.1}


class Verdict(NamedTuple):
    """What a point of the fronts says of a sentence."""

    sentence: str
    plant: str
    condition: str
    level: float
    laws: tuple[str, str]  # the best of both sides, or "none" at this price
    lead: float
    low: float
    high: float
    verdict: str  # stands, alone (the second laws have nothing), open, contradicted, or not ranked


def best(points: Iterable[dict], laws: Sequence[str]) -> dict | None:
    """Return the point of some laws whose error was the least where it was chosen, or whose J is if
    it is the cheapest.
    """
    its = [point for point in points if point["law"] in laws]
    if its and its[0]["price"] == "least":
        return min(its, key=lambda point: np.median(values(point)))
    return min(its, key=lambda point: point["chose"], default=None)


def values(point: dict) -> np.ndarray:
    """Return what a point is judged by: J of the cheapest, else errors, none below the floor and
    inf after a failure.
    """
    if point["price"] == "least":
        return np.nan_to_num(point["J"], nan=np.inf)
    return np.maximum(np.nan_to_num(point["errors"], nan=np.inf), FLOOR)


def verdict(sentence: Sentence, first: dict | None, second: dict | None) -> tuple:
    """Return the lead of the first point over the second with its interval, and what it says."""
    if first is None or second is None:
        lead = math.nan
        return lead, lead, lead, "alone" if first else "contradicted"
    ours, theirs = values(first), values(second)
    if second["price"] != "least" and max(np.median(ours), np.median(theirs)) <= FLOOR:
        return 1.0, 1.0, 1.0, "not ranked"
    with np.errstate(invalid="ignore"):
        lead, low, high = np.exp(interval(np.log(theirs) - np.log(ours), ERROR)).tolist()
    beyond = SEARCH[sentence.price]
    said = "open"
    if low > 1.0 and lead > beyond:
        said = "stands"
    elif high < 1.0 and lead < 1.0 / beyond:
        said = "contradicted"
    return lead, low, high, said


def compared(
    points: Sequence[dict], sentences: Sequence[Sentence] = SENTENCES
) -> Iterator[tuple[Sentence, dict | None, dict | None]]:
    """Yield the best points of both sides at every level that a sentence is about, None where a
    side has none.
    """
    levels: dict[tuple, list[dict]] = {}
    for point in points:
        place = point["plant"], point["model"], point["condition"], point["price"], point["level"]
        levels.setdefault(place, []).append(point)
    known = {point["law"] for point in points}
    for sentence in sentences:
        if known.isdisjoint(sentence.first) or known.isdisjoint(sentence.second):
            continue
        for (_, model, condition, price, level), its in levels.items():
            about = condition in sentence.conditions and price == sentence.price
            if not (about and model == sentence.model and sentence.low <= level <= sentence.high):
                continue
            first, second = best(its, sentence.first), best(its, sentence.second)
            twisting = best(its, TWISTING)
            admitted = twisting["within"] if twisting else None
            if (first or second) and sentence.within in (None, admitted):
                yield sentence, first, second


def judged(points: Sequence[dict], sentences: Sequence[Sentence] = SENTENCES) -> Iterator[Verdict]:
    """Yield a verdict for every level that a sentence is about."""
    for sentence, first, second in compared(points, sentences):
        laws = first["law"] if first else "none", second["law"] if second else "none"
        place = first or second or {}
        found = verdict(sentence, first, second)
        yield Verdict(
            sentence.name, place["plant"], place["condition"], place["level"], laws, *found
        )


def rounded(point: dict) -> dict:
    """Return what is kept of a point, rounded, with what is read of its settings."""
    settings = point["settings"]
    kept = {"wc": settings["wc"], "least": settings["least"]}
    for name in ("plant", "model", "law", "price", "level", "condition", "within", "gains"):
        kept[name] = point[name]
    kept["gains"] = {name: float(f"{value:.5g}") for name, value in point["gains"].items()}
    for name in ("J", "errors", "rates"):
        kept[name] = [float(f"{value:.4g}") for value in point[name]]
    return kept | {"chose": point["chose"], "settled": point["settled"]}


def line(point: dict) -> str:
    """Return a point as a row of a table."""
    gains = ", ".join(f"{name} {value:.3g}" for name, value in point["gains"].items())
    price = f"{point['price']} {point['level']:.3g}"
    model = point["model"] + ", its line" * (point["law"] in TOLD)
    cells = [point["plant"], model, point["law"], point["condition"], price]
    errors = np.nan_to_num(point["errors"], nan=np.inf)
    cells += [f"{np.median(point['J']):.3g}", f"{np.median(errors):.2g}"]
    cells += [f"{np.median(point['rates']):.3g}", f"{point['settled']} of {UNSEEN}"]
    cells += [{None: "", True: "within", False: "beyond"}[point["within"]], gains]
    return f"| {' | '.join(cells)} |"


HEADS = "plant, model, law, condition, price, J, error / start, rate / u_max, settled, theorem, "
HEADS += "gains"


def summary(points: Sequence[dict]) -> Iterator[str]:
    """Yield how far MuJoCo is from the fast engine, how many sets their theorems admit, and the
    verdicts.
    """
    apart = np.abs([point["apart"] for point in points if "apart" in point])
    if len(apart):
        share = (apart.max(axis=1) < 0.03).mean()
        yield (
            f"MuJoCo: {len(apart)} sets, J and error within 3 % in {100 * share:.0f} %, farthest "
            f"{apart[:, 0].max():.2g} and {apart[:, 1].max():.2g}"
        )
    for law in dict.fromkeys(point["law"] for point in points):
        its = [point["within"] for point in points if point["law"] == law and point["price"] == "J"]
        if its and its[0] is not None:
            yield f"{law}: {sum(its)} of {len(its)} points within the theorem"
    counts: dict[str, dict[str, int]] = {}
    for one in judged(points):
        found = counts.setdefault(one.sentence, {})
        found[one.verdict] = found.get(one.verdict, 0) + 1
        yield (
            f"{one.sentence}: {one.plant}, {one.condition}, {one.level:.3g}: "
            f"{' over '.join(one.laws)} {one.lead:.3g} ({one.low:.3g} to {one.high:.3g}), "
            f"{one.verdict}"
        )
    for name, found in counts.items():
        yield f"{name}: {', '.join(f'{count} {word}' for word, count in found.items())}"


ROWS = (  # condition, price, words above the panel and below it
    ("middle", "J", "no noise", "J / least J"),
    ("noisy", "J", "sensor's noise", "J / least J"),
    ("middle", "rate", "no noise", "calm: TV rate / bound, 1/s"),
)
TICKS = {"J": (1.5, 3, 5, 10, 20), "rate": (10, 30, 100, 300, 1000)}
NOT_DRAWN = ("observer_free",)  # its line is that of boundary_layer
WIDTH, ROW = 4.6, 1.9  # inches: letters are read on a phone


def draw(points: Sequence[dict], path: Path, laws: Sequence[str]) -> None:
    """Draw the fronts: a column a plant, a row a price and condition."""
    from smc_mujoco.draw import page, style

    points = [point for point in points if point["model"] == "none"]
    plants = list(dict.fromkeys(point["plant"] for point in points))
    colours = style.law_colours(laws)
    with style.page(WIDTH):
        handles = []
        for law, colour, mark in zip(laws, colours, style.MARKS, strict=False):
            look = {"marker": mark, "lw": 1.2, "ms": 4}
            handles.append(page.entry(style.law_name(law), colour, **look))
        height = page.head_height(WIDTH, handles) + ROW * len(ROWS) + 0.2
        figure = page.blank(WIDTH, height, None)
        panels = figure.subplots(len(ROWS), len(plants), squeeze=False, sharey=True)
        for row, (condition, price, title, label) in zip(panels, ROWS, strict=True):
            for ax, plant in zip(row, plants, strict=True):
                wanted = {"plant": plant, "condition": condition, "price": price}
                for law, line in zip(laws, handles, strict=True):
                    its = [one for one in points if (wanted | {"law": law}).items() <= one.items()]
                    x = [one["level"] for one in its]
                    y = [np.median(one["errors"]) for one in its]
                    look = {"color": line.get_color(), "marker": line.get_marker()}
                    ax.plot(x, y, ms=3, lw=1, **look)
                ax.axhspan(1e-9, FLOOR, color=style.BAND, lw=0, zorder=0)
                ax.set(xscale="log", yscale="log", ylim=(3e-9, 1.0), xlabel=label)
                ax.set_xticks(TICKS[price], [f"{tick:g}" for tick in TICKS[price]])
                ax.minorticks_off()
                ax.set_title(title, fontsize=style.points(9.5), weight="normal")
                place = {"transform": ax.transAxes, "ha": "right", "color": style.MUTED}
                ax.text(0.98, 0.03, "not ranked", fontsize=style.points(9.0), **place)
            row[0].set_ylabel("rms error / start")
        for ax, plant in zip(panels[0], plants, strict=True):
            ax.set_title(f"{style.plant_name(plant)}\n{ROWS[0][2]}")
        page.set_head(figure, WIDTH, "The price of following a load", handles)
        page.write(figure, page.files(path))


def fronts(
    plant: str,
    laws: Sequence[str],
    model: str,
    sets: int | None,
    device: str,
    executor: Executor,
    lot: int | None = None,
) -> list[dict]:
    """Return the points of the fronts of some laws on a plant, which workers search side by
    side.
    """
    conditions, levels = (CONDITIONS, LEVELS) if lot is None else by_lot(lot, plant)
    made = plant_of(plant)
    wc = bandwidth(made)
    by_mujoco = why_not(smc.Scenario(plant=made, law="pid", duration=1.0))
    if by_mujoco:
        conditions = tuple(one for one in conditions if one.kind in KINDS_BY_MUJOCO)
        print(f"{plant} is run by MuJoCo: {by_mujoco}")
    sets = sets or (SETS_BY_MUJOCO if by_mujoco else SETS)
    jobs = [Job(plant, law, model, wc, conditions, sets, device) for law in laws]
    searched = list(executor.map(search, jobs))
    J = np.concatenate([its.J for its in searched])
    if np.isnan(J).all():
        raise SystemExit(f"no set of gains costs less than {CAP:g} s²: give more --sets")
    least = float(np.nanmin(J))
    work = [
        executor.submit(told, job, its, levels, least)
        for job, its in zip(jobs, searched, strict=True)
    ]
    found = []
    for one in work:
        found += one.result()
    settings = {"lot": lot, "wc": wc, "least": least, "sets": sets}
    settings["loads"] = [condition._asdict() for condition in conditions]
    print(f"{plant}: wc {wc:.3g} rad/s, least J {least:.3g}, {sets} sets a law")
    return [point | {"settings": settings} for point in found]


def workers(processes: int, address: str | None) -> AbstractContextManager[Executor]:
    """Return the workers of a dask scheduler, or that many processes of this machine."""
    if address:
        return opened(address)
    return ProcessPoolExecutor(processes, mp_context=get_context("spawn"))


def main() -> None:
    """Print a row a point and the verdicts, and write all points."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("plants", nargs="*", help="names, FILE.xml:joint or FILE.py:variable")
    parser.add_argument("--law", nargs="+", default=LAWS, help="names of laws")
    parser.add_argument("--model", default="none", choices=("none", "nominal"))
    parser.add_argument("--sets", type=int, help=f"sets of gains a law, {SETS} by default")
    parser.add_argument("--device", default="cpu", choices=("cpu", "cuda"))
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--executor", metavar="dask://HOST:PORT", help="in place of processes")
    parser.add_argument("--lot", type=int, metavar="SEED", help="draw loads and prices")
    parser.add_argument("--read", nargs="+", type=Path, default=[], help="points of earlier calls")
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--keep", type=Path, help="file of the points that sentences rest on")
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    points = [point for path in asked.read for point in json.loads(path.read_text())]
    read = len(points)
    with workers(asked.processes, asked.executor) as executor:
        for plant in asked.plants:
            points += fronts(
                plant, asked.law, asked.model, asked.sets, asked.device, executor, asked.lot
            )
            if asked.out:
                asked.out.write_text(json.dumps(points[read:]))
    print(f"| {HEADS.replace(', ', ' | ')} |", *map(line, points), *summary(points), sep="\n")
    if asked.keep:
        sides = (side for _, *both in compared(points) for side in both if side)
        rest = {json.dumps(rounded(side)): None for side in sides}
        asked.keep.write_text("[\n" + ",\n".join(rest) + "\n]\n")
    if asked.figure:
        known = {point["law"] for point in points}.difference(NOT_DRAWN)
        draw(points, asked.figure, [law for law in LAWS if law in known])


if __name__ == "__main__":
    main()
