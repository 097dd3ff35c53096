"""Fronts of error under a load against price: what each law's best gains reach on a plant.

    python benchmarks/fronts.py duffing inverted_pendulum van_der_pol --keep benchmarks/fronts.json
    python benchmarks/fronts.py duffing --model nominal --law pid super_twisting
    python benchmarks/fronts.py arm.xml:elbow
    python benchmarks/fronts.py van_der_pol --lot 12345678 --keep lot.json
    python benchmarks/fronts.py duffing --search 12 --second benchmarks/second_fronts.json
    python benchmarks/fronts.py --read two.json lot.json     # the sentences of the page, judged

The accuracy of a law depends on its gains, so two laws are compared at one price. There are two. J
is what gains are tuned for: ITAE and variation of the command in seven conditions of 5 s. Its share
of noise saturates where the command jumps from bound to bound at every sample. So the rate of
variation in calm, with sensor noise of 1e-3 of the start, stands beside it, and still rises for
another decade of slope. Each plant is run at control periods of 1 and 5 ms.

Half of a law's sets of gains are drawn over the box of a search and half a decade beyond it, a
decade for the widths of slopes and the bandwidths of observers. The other half are bred from the
fronts of the first. The input gain that an implicit law assumes is searched as well. Sets are
chosen on one instance. All results come from twelve others, with other starts, phases and noise.

A set that misses a condition of its theorem is drawn again, and a chosen gain at the edge of where
it was drawn is named. The error is the rms of the true position over whole periods, of 2 s or one
period at least, as a share of the start. A set whose error in the window before differs by more
than 25 % has not settled, and is not chosen. The load is a sixth of the bound on u, and its
frequency is given in units of wc, the bandwidth of the tuned ADRC.

A lead is the ratio of two errors, with the interval of that ratio. A sentence of the page stands at
a price if the whole interval is above 1 and the lead is beyond what another search would find. It
is contradicted if both say the reverse, and else open. Errors below a ten-thousandth of the start
are not ranked. If both are below it, nothing is said; if one is, that is said, without a ratio.
With --lot, loads, prices, phases, starts and noise are drawn.

The fast engine runs everything. MuJoCo also runs each point that a sentence rests on, unless a lot
drew it. A plant of more than one equation is run by MuJoCo alone, with 40 sets a law and fewer
conditions.
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
from smc_mujoco.control.units import AHEAD_B, INPUT_GAIN
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics import catalogue as metrics
from smc_mujoco.simulation import state
from smc_mujoco.simulation.grid import case
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.workers import opened

SECOND_ORDER = ("hodob",)
OBSERVERS = ("adrc", "pd_observer", *SECOND_ORDER)
RIVALS = (*OBSERVERS, "pid")
SMOOTH = ("boundary_layer",)
TWISTING = ("super_twisting", "implicit_super_twisting")
LAWS = (*TWISTING, "classical", *SMOOTH, *RIVALS)
TOLD = ("lqi", "mpc", "loop_shaping")  # told the plant's line at rest, whatever --model says
GOAL = OBJECTIVES["balanced"]
PERIODS = (1e-3, 5e-3)  # s, of control
SETS, SETS_BY_MUJOCO = 400, 40
FIRST_SEARCH = 11  # seed of the search that the page rests on
KINDS_BY_MUJOCO = ("middle", "middle, noise", "calm")
GENERATIONS = (0.5, 0.35, 0.25, 0.15, 0.1)  # spread of the bred sets, of log gains
WIDER = 0.5  # decades beyond the box of a search
STEEPER = ("phi", "w", "l")  # slopes and bandwidths of observers, which go a decade beyond
CAP = 15.0  # s^2: runs that stay where they start cost more
UNSEEN = 12  # instances
SETTLING, WINDOW = 4.0, 2.0  # s: before the two windows, and each of them at least
CHANGED = math.log(1.25)  # of the error from one window to the next
FORCE, NOISE = 1 / 6, 1e-3  # of u_max; of the start
VELOCITY_NOISE_RATIO = 5.0  # 1/s, as in margins
FLOOR = 1e-4  # of the start: smaller errors are not ranked
# prices: times the least J of all laws, or the rate of variation in calm over u_max, 1/s
LEVELS = {
    "J": (1.25, 1.5, 2.0, 3.0, 5.0),
    "rate": (30.0, 100.0, 300.0),
}
MARGIN = 0.97  # of a level that sets are chosen within, so that unseen runs cost about the level
ITAE, TV, RMS, BEFORE, RATE = range(5)
SUMS = ("itae", "tv", "rms_error", "rms_before", "tv_rate")


class Condition(NamedTuple):
    """A load and a sensor, without a unit."""

    kind: str
    force: float = FORCE  # of u_max
    ratio: float = 0.5  # of wc
    noise: float = 0.0  # of the start


CONDITIONS = (
    Condition("middle"),
    Condition("strong", force=4 * FORCE),
    Condition("fast", ratio=2.0),
    Condition("middle, noise", noise=NOISE),
    Condition("strong, noise", force=4 * FORCE, noise=NOISE),
    Condition("fast, noise", ratio=2.0, noise=NOISE),
    Condition("calm", force=0.0, noise=NOISE),
)
# factors that a lot draws: of the force, of its frequency, of the noise
DRAWN = ((0.5, 1.4), (0.7, 1.4), (0.5, 2.0))
CALM = -1  # the last condition


class Job(NamedTuple):
    """A law on a plant, and the runs that its gains are judged in."""

    plant: str
    law: str
    wc: float  # rad/s
    conditions: tuple[Condition, ...] = CONDITIONS
    period: float = PERIODS[0]
    model: str = "none"
    sets: int = SETS
    device: str = "cpu"
    lot: int | None = None
    search: int = FIRST_SEARCH


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
        factors = [between(*ends) for ends in DRAWN]
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
        goal = dataclasses.replace(GOAL, control_period=job.period)
        task = task_of(self.plant, smc.law(job.law), goal, BUDGET, 0, 1)
        self.task: TuningTask = task._replace(box={**task.box, **assumed(task)})
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
        lot = self.job.lot
        seed = instance if lot is None else instance + (1 + UNSEEN) * (1 + lot % 999)
        if seed == 0:
            cases = self.goal.scenarios(self.plant, law)
        else:
            cases = self.goal.holdout(self.plant, law, seed)
        for one in cases:
            self.cases.append(dataclasses.replace(one, model=self.job.model))
            self.windows.append(round(1.0 / one.control_period))
        rng = np.random.default_rng([2027, seed])
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
                seed=seed,
                changes={
                    "control_period": self.job.period,
                    "disturbance": load if condition.force else (),
                    "noise": smc.Noise(noise, VELOCITY_NOISE_RATIO * noise),
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


def assumed(task: TuningTask) -> dict[str, tuple[float, float]]:
    """Return the box of the input gain that an implicit law assumes, which tuning leaves at 1."""
    declared = catalogue()[task.law.name].gains
    if declared.get("b") != AHEAD_B:
        return {}
    scale = INPUT_GAIN.of(task.scales)
    return {"b": (scale * 10**-search_space.HALF_WIDTH, scale * 10**search_space.HALF_WIDTH)}


def drawn_from(task: TuningTask) -> dict[str, tuple[float, float]]:
    """Return gain -> lowest, highest, of the sets that are drawn and bred."""
    found = {}
    for name, (low, high) in task.box.items():
        wider = 10.0 if name in STEEPER else 10.0**WIDER
        found[name] = low / wider, high * wider
    return found


def search(job: Job) -> Sets:
    """Draw and breed sets of gains of a law, and judge them on the instance that chooses."""
    bench = Bench(job)
    count = job.sets
    rng = np.random.default_rng([job.search, zlib.crc32(job.law.encode()), job.lot or 0])
    low, high = np.log(list(drawn_from(bench.task).values())).T

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
            "period": job.period,
            "lot": job.lot,
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
        point["edges"] = search_space.at_bound(point["gains"], drawn_from(bench.task))
        found.append(point)
    return found


def repeated(job: Job, points: Sequence[dict]) -> list[list[float]]:
    """Return J and error of points of one job on its first unseen instance by MuJoCo, each as a
    share of the fast engine's, less 1.
    """
    bench = Bench(job)
    kinds = [condition.kind for condition in job.conditions]
    priced, loaded = bench.runs_of(1)
    members: dict[tuple[float, ...], set[str]] = {}
    for point in points:
        members.setdefault(tuple(point["gains"].values()), set()).add(point["condition"])
    found: dict[tuple[tuple[float, ...], str], list[float]] = {}
    for gains, needed in members.items():
        runs = [*priced, *(loaded[kinds.index(kind)] for kind in needed)]
        sums = bench.by_mujoco(np.array([gains]), runs)
        J = float(bench.prices(sums, 1)[0])
        for kind, one in zip(needed, sums[0, len(priced) :], strict=True):
            found[gains, kind] = [J, float(one[RMS]) / bench.start]
    apart = []
    for point in points:
        theirs = found[tuple(point["gains"].values()), point["condition"]]
        ours = point["J"][0], point["errors"][0]
        apart.append([a / b - 1.0 for a, b in zip(theirs, ours, strict=True)])
    return apart


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
# factor by which a second search, of another seed, may move an error and a least J: chosen from a
# pilot with 3,000 sets, where fronts of two searches were up to 1.5 times apart. With 400 sets they
# are that far apart in the median, see `second`.
SEARCH = {"J": 1.5, "rate": 1.5, "least": 1.1}


VERDICTS = {
    "stands": "by a ratio",
    "below the floor": "the first is below the floor, the second is not",
    "unopposed": "the second laws have no gains at this price",
    "open": "",
    "not ranked": "the floor decides",
    "contradicted": "",
}


class Verdict(NamedTuple):
    """What a point of the fronts says of a sentence."""

    sentence: str
    plant: str
    period: float  # s
    condition: str
    level: float
    laws: tuple[str, str]  # the best of both sides, or "none" at this price
    errors: tuple[float, float]  # medians, of the start; J of the cheapest
    lead: float  # ratio of the second's to the first's; NaN if the floor decides
    low: float
    high: float
    verdict: str  # one of VERDICTS


def best(points: Iterable[dict], laws: Sequence[str]) -> dict | None:
    """Return the point of some laws whose error was the least where it was chosen, or whose J is if
    it is the cheapest.
    """
    its = [point for point in points if point["law"] in laws]
    if its and its[0]["price"] == "least":
        return min(its, key=lambda point: np.median(values(point)))
    return min(its, key=lambda point: point["chose"], default=None)


def values(point: dict | None) -> np.ndarray:
    """Return what a point is judged by: J of the cheapest, else errors, inf after a failure."""
    if point is None:
        return np.array([np.nan])
    what = "J" if point["price"] == "least" else "errors"
    return np.nan_to_num(point[what], nan=np.inf)


def verdict(sentence: Sentence, first: dict | None, second: dict | None) -> tuple:
    """Return the lead of the first point over the second with its interval, and what it says."""
    none = math.nan, math.nan, math.nan
    if first is None or second is None:
        return *none, "unopposed" if first else "contradicted"
    ours, theirs = values(first), values(second)
    beyond = SEARCH[sentence.price]
    if second["price"] != "least":
        below = np.median(ours) <= FLOOR, np.median(theirs) <= FLOOR
        if any(below):
            other = theirs if below[0] else ours
            _, low, _ = np.exp(interval(np.log(other), ERROR))
            if all(below) or low <= beyond * FLOOR:
                return *none, "not ranked"
            return *none, "below the floor" if below[0] else "contradicted"
    with np.errstate(invalid="ignore"):
        lead, low, high = np.exp(interval(np.log(theirs) - np.log(ours), ERROR)).tolist()
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
        names = "lot", "plant", "period", "model", "condition", "price", "level"
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
    """Yield a verdict for every level that a sentence is about."""
    for sentence, first, second in compared(points, sentences):
        laws = first["law"] if first else "none", second["law"] if second else "none"
        its = first or second or {}
        place = its["plant"], its["period"], its["condition"], its["level"]
        errors = float(np.median(values(first))), float(np.median(values(second)))
        yield Verdict(sentence.name, *place, laws, errors, *verdict(sentence, first, second))


NAMES = ("lot", "plant", "period", "model", "law", "price", "level", "condition", "within", "edges")


def rounded(point: dict) -> dict:
    """Return what is kept of a point, rounded, with what is read of its settings."""
    settings = point.get("settings", point)
    kept = {"wc": settings["wc"], "least": settings["least"]}
    for name in NAMES:
        kept[name] = point.get(name)
    if "apart" in point:
        kept["apart"] = [float(f"{value:.2g}") for value in point["apart"]]
    kept["gains"] = {name: float(f"{value:.5g}") for name, value in point["gains"].items()}
    for name in ("J", "errors", "rates"):
        its = point[name]
        if name == "rates" or (name == "J" and point["price"] != "least"):
            its = [float(np.median(its))]
        kept[name] = [float(f"{value:.4g}") for value in its]
    return kept | {"chose": point["chose"], "settled": point["settled"]}


def line(point: dict) -> str:
    """Return a point as a row of a table."""
    gains = ", ".join(f"{name} {value:.3g}" for name, value in point["gains"].items())
    price = f"{point['price']} {point['level']:.3g}"
    model = point["model"] + ", its line" * (point["law"] in TOLD)
    period = f"{1e3 * point['period']:g} ms"
    cells = [point["plant"], period, model, point["law"], point["condition"], price]
    errors = np.nan_to_num(point["errors"], nan=np.inf)
    cells += [f"{np.median(point['J']):.3g}", f"{np.median(errors):.2g}"]
    cells += [f"{np.median(point['rates']):.3g}", f"{point['settled']} of {UNSEEN}"]
    cells += [{None: "", True: "within", False: "beyond"}[point["within"]], gains]
    return f"| {' | '.join(cells)} |"


HEADS = "plant, period, model, law, condition, price, J, error / start, rate / u_max, settled, "
HEADS += "theorem, gains"


def at_edges(points: Sequence[dict]) -> Iterator[str]:
    """Yield a sentence for each gain of a law that is at the edge of its box on a plant, of the
    first such point, with how many there are.
    """
    members: dict[tuple[str, str], list[dict]] = {}
    for point in points:
        members.setdefault((point["plant"], point["law"]), []).append(point)
    for (plant, law), its in members.items():
        for edge in dict.fromkeys(edge for point in its for edge in point["edges"].items()):
            there = [point for point in its if edge in point["edges"].items()]
            (words,) = search_space.edges_in_words(there[0]["gains"], dict([edge]))
            yield f"{law} on {plant}: {words} ({len(there)} of {len(its)} points)"


def summary(points: Sequence[dict]) -> Iterator[str]:
    """Yield how far MuJoCo is from the fast engine, which gains are at the edge of their box, how
    many sets their theorems admit, and the verdicts.
    """
    apart = np.abs([point["apart"] for point in points if "apart" in point])
    if len(apart):
        share = 100.0 * (apart.max(axis=1) < 0.05).mean()
        most = ", ".join(f"{one:.2g}" for one in apart.max(axis=0))
        yield (
            f"MuJoCo: {len(apart)} points, J and error within 5 % in {share:.0f} %, farthest {most}"
        )
    yield from at_edges(points)
    for law in dict.fromkeys(point["law"] for point in points):
        its = [point["within"] for point in points if point["law"] == law and point["price"] == "J"]
        if its and its[0] is not None:
            yield f"{law}: {sum(its)} of {len(its)} points within the theorem"
    counts: dict[str, dict[str, int]] = {}
    for one in judged(points):
        found = counts.setdefault(one.sentence, dict.fromkeys(VERDICTS, 0))
        found[one.verdict] += 1
        ours, theirs = one.errors
        yield (
            f"{one.sentence}: {one.plant}, {1e3 * one.period:g} ms, {one.condition}, "
            f"{one.level:.3g}: {' over '.join(one.laws)} {ours:.2g}, {theirs:.2g}, "
            f"{one.lead:.3g} ({one.low:.3g} to {one.high:.3g}), {one.verdict}"
        )
    for name, found in counts.items():
        yield f"{name}: {', '.join(f'{count} {word}' for word, count in found.items() if count)}"


SHOWN = (
    Sentence("of super-twisting, without noise", TWISTING, RIVALS, QUIET),
    Sentence("of super-twisting, with sensor noise", TWISTING, RIVALS, NOISY),
    Sentence("of smooth sliding, without noise", SMOOTH, RIVALS, QUIET),
    Sentence("of smooth sliding, with sensor noise", SMOOTH, RIVALS, NOISY),
)


def cell(one: Verdict) -> str:
    """Return what a table of the page says of a verdict."""
    first, second = one.laws
    if first == "none" or second == "none":
        return "no gains" if first == "none" else "no rival"
    if one.verdict == "not ranked":
        return "not ranked"
    if math.isnan(one.lead):
        ours, theirs = (f"{error:.1e}" if error > FLOOR else "below" for error in one.errors)
        return f"{ours}; `{second}` {theirs}"
    lead = f"{one.lead:.2g} ({one.low:.2g} to {one.high:.2g})"
    return f"{lead if one.verdict == 'open' else f'**{lead}**'} `{second}`"


def tables(points: Sequence[dict]) -> Iterator[str]:
    """Yield the lines of the page's tables: at each price, the best rival's error over a law's."""
    for shown in SHOWN:
        levels = " | ".join(f"{level:g}" for level in LEVELS["J"])
        yield f"| {shown.name}: plant, period, load | {levels} |"
        yield "|---" * (1 + len(LEVELS["J"])) + "|"
        rows: dict[tuple, dict[float, str]] = {}
        for one in judged([point for point in points if point["lot"] is None], [shown]):
            place = one.plant, one.period, one.condition.removesuffix(", noise")
            rows.setdefault(place, {})[one.level] = cell(one)
        for (plant, period, condition), cells in rows.items():
            told = " | ".join(cells.get(level, "") for level in LEVELS["J"])
            yield f"| `{plant}`, {1e3 * period:g} ms, {condition} | {told} |"


def tallies(points: Sequence[dict]) -> list[dict[str, int]]:
    """Return verdict -> how often it is that of a cell, and the number of cells with laws on both
    sides, for each table of the page.
    """
    counts = []
    for shown in SHOWN:
        had = [one.verdict for one in judged(points, [shown]) if "none" not in one.laws]
        counts.append({word: had.count(word) for word in VERDICTS} | {"all": len(had)})
    return counts


def second(points: Sequence[dict], first: Sequence[dict]) -> dict:
    """Return how far the fronts of another search are from those of the first, as ratios of errors
    above the floor, and the verdicts of the other search.
    """
    names = "plant", "period", "model", "law", "level", "condition"
    errors: list[dict[tuple, float]] = []
    for its in (points, first):
        found = {}
        for point in its:
            if point["lot"] is None and point["price"] == "J":
                error = max(float(np.median(values(point))), FLOOR)
                found[tuple(point[name] for name in names)] = error
        errors.append(found)
    both = [[found[place] for found in errors] for place in errors[0].keys() & errors[1].keys()]
    ratios = np.array([max(pair) / min(pair) for pair in both if max(pair) > FLOOR])
    verdicts: dict[str, dict[str, int]] = {}
    for one in judged(points):
        counts = verdicts.setdefault(one.sentence, dict.fromkeys(VERDICTS, 0))
        counts[one.verdict] += 1
    return {
        "compared": len(ratios),
        "median": float(np.median(ratios)),
        "tenth": float(np.quantile(ratios, 0.9)),
        "tallies": tallies(points),
        "verdicts": verdicts,
    }


def in_words(points: Sequence[dict]) -> tuple[str, str]:
    """Return what README and the page say first of the points that no lot drew."""
    own = [point for point in points if point["lot"] is None]
    counts = tallies(own)
    quiet, noisy, *smooth = counts
    leads = [its["stands"] + its["below the floor"] for its in counts]
    readme = (
        f"In {noisy['all']} cases with sensor noise, super-twisting leads the best of its rivals "
        f"`adrc`, `pd_observer`, `hodob` and `pid` in {leads[1]} and trails it in "
        f"{noisy['contradicted']}. In {quiet['all']} cases without noise it leads in {leads[0]} "
        f"and trails in {quiet['contradicted']}; in {quiet['not ranked']} the errors are below a "
        "ten-thousandth of the start, or near it, and are not ranked. Smooth first-order sliding "
        f"leads the best rival in {sum(leads[2:])} of {sum(its['all'] for its in smooth)} cases, "
        f"with and without noise, and trails in {sum(its['contradicted'] for its in smooth)}."
    )
    within = list(judged(own, SENTENCES[1:2]))
    admitted = [one.verdict for one in within]
    loads = [one.condition.removesuffix(", noise") for one in within]
    under = [f"{loads.count(load)} under *{load}*" for load in QUIET]
    plants = len({one.plant for one in within})
    page = (
        f"Where its theorem admits the load and the sensor has noise, super-twisting leads the "
        f"best of its rivals in {admitted.count('stands') + admitted.count('below the floor')} of "
        f"{len(admitted)} cases and trails it in {admitted.count('contradicted')}. These are "
        f"on {plants} plants, {', '.join(under)}."
    )
    return readme, page


def counted(points: Sequence[dict]) -> Iterator[str]:
    """Yield the lines of the table of how often each sentence of the page holds."""
    yield f"| sentence, plant, period, draw | {' | '.join(VERDICTS)} |"
    yield "|---" * (1 + len(VERDICTS)) + "|"
    counts: dict[tuple, dict[str, int]] = {}
    lots = dict.fromkeys(point["lot"] for point in points)
    for lot in lots:
        for one in judged([point for point in points if point["lot"] == lot]):
            place = one.sentence, one.plant, one.period, lot
            found = counts.setdefault(place, dict.fromkeys(VERDICTS, 0))
            found[one.verdict] += 1
    for (name, plant, period, lot), found in counts.items():
        draw = "none" if lot is None else lot
        told = " | ".join(str(count) for count in found.values())
        yield f"| {name}, `{plant}`, {1e3 * period:g} ms, {draw} | {told} |"


ROWS = ((1e-3, "middle"), (1e-3, "middle, noise"), (5e-3, "middle"), (5e-3, "middle, noise"))
TICKS = (1.25, 2, 3, 5)
WIDTH, ROW = 6.4, 1.7  # inches


def draw(points: Sequence[dict], path: Path, laws: Sequence[str]) -> None:
    """Draw the fronts of error over J: a column a plant, a row a period and condition."""
    from smc_mujoco.draw import page, style

    points = [one for one in points if one["model"] == "none" and one["price"] == "J"]
    plants = list(dict.fromkeys(point["plant"] for point in points))
    with style.page(WIDTH):
        handles = []
        for law, colour, mark in zip(laws, style.law_colours(laws), style.MARKS, strict=False):
            look = {"marker": mark, "lw": 1.2, "ms": 4}
            handles.append(page.entry(style.law_name(law), colour, **look))
        height = page.head_height(WIDTH, handles) + ROW * len(ROWS) + 0.2
        figure = page.blank(WIDTH, height, None)
        panels = figure.subplots(len(ROWS), len(plants), squeeze=False, sharey=True, sharex=True)
        for row, (period, condition) in zip(panels, ROWS, strict=True):
            for ax, plant in zip(row, plants, strict=True):
                wanted = {"plant": plant, "condition": condition, "period": period}
                for law, line in zip(laws, handles, strict=True):
                    its = [one for one in points if (wanted | {"law": law}).items() <= one.items()]
                    its.sort(key=lambda one: one["level"])
                    x = [one["level"] for one in its]
                    y = [np.median(one["errors"]) for one in its]
                    look = {"color": line.get_color(), "marker": line.get_marker()}
                    ax.plot(x, y, ms=3, lw=1, **look)
                ax.axhspan(1e-9, FLOOR, color=style.BAND, lw=0, zorder=0)
                ax.set(xscale="log", yscale="log", ylim=(1e-6, 1.0))
                ax.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
                ax.minorticks_off()
                place = {"transform": ax.transAxes, "ha": "right", "color": style.MUTED}
                ax.text(0.98, 0.03, "not ranked", fontsize=style.points(9.0), **place)
            noise = "sensor's noise" if "noise" in condition else "no noise"
            row[0].set_ylabel(f"{1e3 * period:g} ms, {noise}\nrms error / start")
        for ax, plant in zip(panels[0], plants, strict=True):
            ax.set_title(style.plant_name(plant))
        for ax in panels[-1]:
            ax.set_xlabel("J / least J")
        page.set_head(figure, WIDTH, "The price of following a load", handles)
        page.write(figure, page.files(path))


def fronts(job: Job, laws: Sequence[str], executor: Executor) -> list[dict]:
    """Return the points of the fronts of some laws in place of the job's, which workers search side
    by side.
    """
    levels = LEVELS
    if job.lot is not None:
        conditions, levels = by_lot(job.lot, job.plant)
        job = job._replace(conditions=conditions)
    made = plant_of(job.plant)
    job = job._replace(wc=bandwidth(made))
    if why := why_not(smc.Scenario(plant=made, law=smc.law("pid"), duration=1.0)):
        conditions = tuple(one for one in job.conditions if one.kind in KINDS_BY_MUJOCO)
        job = job._replace(conditions=conditions, sets=min(job.sets, SETS_BY_MUJOCO))
        print(f"{job.plant} is run by MuJoCo: {why}")
    jobs = [job._replace(law=law) for law in laws]
    searched = list(executor.map(search, jobs))
    J = np.concatenate([its.J for its in searched])
    if np.isnan(J).all():
        raise SystemExit(f"no set of gains costs less than {CAP:g} s²: give more --sets")
    least = float(np.nanmin(J))
    work = [
        executor.submit(told, one, its, levels, least)
        for one, its in zip(jobs, searched, strict=True)
    ]
    found = []
    for one in work:
        found += one.result()
    settings = {"wc": job.wc, "least": least, "job": job}
    print(
        f"{job.plant}, {1e3 * job.period:g} ms: wc {job.wc:.3g} rad/s, least J {least:.3g}, "
        f"{job.sets} sets a law",
        flush=True,
    )
    return [point | {"settings": settings} for point in found]


def kept(points: Sequence[dict], executor: Executor) -> list[dict]:
    """Return the points that sentences rest on, which MuJoCo repeats unless a lot drew them, and
    those of the figure.
    """
    sides = {}
    for _, *both in compared(points):
        sides.update((id(side), side) for side in both if side)
    members: dict[Job, list[dict]] = {}
    printed = [point for point in sides.values() if point["lot"] is None]
    for point in printed:
        job = point["settings"]["job"]._replace(law=point["law"])
        members.setdefault(job, []).append(point)
    work = [executor.submit(repeated, job, its) for job, its in members.items()]
    for its, one in zip(members.values(), work, strict=True):
        for point, apart in zip(its, one.result(), strict=True):
            point["apart"] = apart
    for point in points:
        drawn = (point["period"], point["condition"]) in ROWS and point["lot"] is None
        if drawn and point["price"] == "J":
            sides.setdefault(id(point), point)
    return list(sides.values())


def workers(processes: int, address: str | None) -> AbstractContextManager[Executor]:
    """Return the workers of a dask scheduler, or that many processes of this machine."""
    if address:
        return opened(address)
    return ProcessPoolExecutor(processes, mp_context=get_context("spawn"))


def write(points: Sequence[dict], path: Path) -> None:
    """Write what is kept of points, a line each."""
    path.write_text("[\n" + ",\n".join(json.dumps(rounded(one)) for one in points) + "\n]\n")


def main() -> None:
    """Print a row a point and the verdicts, and write all points."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("plants", nargs="*", help="names, FILE.xml:joint or FILE.py:variable")
    parser.add_argument("--law", nargs="+", default=LAWS, help="names of laws")
    parser.add_argument("--model", default="none", choices=("none", "nominal"))
    parser.add_argument("--period", nargs="+", type=float, default=PERIODS, help="of control, s")
    parser.add_argument("--sets", type=int, default=SETS, help=f"of gains a law, {SETS}")
    parser.add_argument("--device", default="cpu", choices=("cpu", "cuda"))
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--executor", metavar="dask://HOST:PORT", help="in place of processes")
    parser.add_argument("--lot", type=int, metavar="SEED", help="draw loads, prices and seeds")
    parser.add_argument("--search", type=int, default=FIRST_SEARCH, metavar="SEED")
    parser.add_argument("--second", type=Path, help="file of how far these are from the page's")
    parser.add_argument("--read", nargs="+", type=Path, default=[], help="points kept earlier")
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--page", action="store_true", help="print the tables of the page")
    parser.add_argument("--keep", type=Path, help="file of the points that the page rests on")
    asked = parser.parse_args()
    points = [point for path in asked.read for point in json.loads(path.read_text())]
    with workers(asked.processes, asked.executor) as executor:
        for plant in asked.plants:
            for period in asked.period:
                job = Job(plant, "", 0.0, period=period, model=asked.model, sets=asked.sets)
                job = job._replace(device=asked.device, lot=asked.lot, search=asked.search)
                of_job = fronts(job, asked.law, executor)
                points += kept(of_job, executor)
                if asked.keep:
                    write(points, asked.keep)
    if asked.keep:
        write(points, asked.keep)
    print(f"| {HEADS.replace(', ', ' | ')} |", *map(line, points), *summary(points), sep="\n")
    if asked.second:
        of_page = json.loads(Path(__file__).with_suffix(".json").read_text())
        asked.second.write_text(json.dumps(second(points, of_page), indent=1) + "\n")
    if asked.page:
        print(*tables(points), *counted(points), *in_words(points), sep="\n")
    if asked.figure:
        known = {point["law"] for point in points}
        draw(points, asked.figure, [law for law in LAWS if law in known])


if __name__ == "__main__":
    main()
