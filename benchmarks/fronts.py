"""Fronts of error under a load against price: what each law's best gains reach on a plant.

    python -m benchmarks.fronts duffing inverted_pendulum van_der_pol --keep benchmarks/fronts.json
    python -m benchmarks.fronts duffing --model nominal --law pid super_twisting
    python -m benchmarks.fronts arm.xml:elbow
    python -m benchmarks.fronts van_der_pol --draw 12345678 --search 11 --keep drawn.json

The accuracy of a law depends on its gains, so two laws are compared at one price. There are two. J
is what gains are tuned for: ITAE and variation of the command in seven conditions of 5 s. Its share
of noise saturates where the command jumps from bound to bound at every sample. So the rate of
variation in calm, with sensor noise of 1e-3 of the start, stands beside it, and still rises for
another decade of slope. Each plant is run at control periods of 1 and 5 ms.

Two searches have nothing in common but the plant: each draws its own sets of gains, and chooses
among them on three instances of its own, by the worst of the three: a set that holds from some
starts only is not chosen. Half of a law's sets are drawn over the box of a search and half a decade
beyond it, a decade for the widths of slopes and the bandwidths of observers. The
other half are bred from the fronts of the first. The input gain that an implicit law assumes is
searched as well. A set that misses a condition of its theorem is drawn again, and a chosen gain at
the edge of where it was drawn is named.

The error is the rms of the true position over whole periods, of 2 s or one period at least, as a
share of the start. A set whose error in the window before differs by more than 25 % has not
settled, and is not chosen. The load is a sixth of the bound on u, and its frequency is given in
units of wc, the bandwidth of the tuned ADRC. The chosen sets then run on 128 other instances, with
other starts, phases and noise. Where a quarter of the errors are 3 % above another quarter, 1,024
others run: noise spreads the errors of a set by some 20 %. Where the interval of the median still
is not within 3 % of it, as some starts end in swings from bound to bound, the error is not settled,
and nothing is said of it. J is the median of twelve instances.

`fronts_sentences` judges the points, `fronts_figure` draws them, and `fronts_by_own_loop` gets them
without this package. With --draw, loads, prices, phases, starts and noise are drawn.

The fast engine runs everything. MuJoCo also runs each point on the first instance, unless it was
drawn. A plant of more than one equation is run by MuJoCo alone, with 40 sets a law, twelve
instances and fewer conditions.
"""

import argparse
import dataclasses
import json
import math
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import AbstractContextManager
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

import smc_mujoco as smc
from benchmarks import fronts_sentences
from benchmarks.fronts_sentences import FLOOR, LAWS, LEVELS, of_figure, read, summary, two_sides
from smc_mujoco.analysis.engine import scores
from smc_mujoco.analysis.engine.form import FAILURE, SCORES, SETTING, Form, layout
from smc_mujoco.analysis.engine.group import FormGroup, why_not
from smc_mujoco.analysis.engine.scores import log_in
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

TOLD = ("lqi", "mpc", "loop_shaping")  # told the plant's line at rest, whatever --model says
GOAL = OBJECTIVES["balanced"]
PERIODS = (1e-3, 5e-3)  # s, of control
SETS, SETS_BY_MUJOCO = 800, 40
SEARCHES = (11, 12)  # seeds
KINDS_BY_MUJOCO = ("middle", "middle, noise", "calm")
GENERATIONS = (0.5, 0.35, 0.25, 0.15, 0.1)  # spread of the bred sets, of log gains
WIDER = 0.5  # decades beyond the box of a search
STEEPER = ("phi", "w", "l")  # slopes and bandwidths of observers, which go a decade beyond
CAP = 15.0  # s^2: runs that stay where they start cost more
UNSEEN, MORE = 128, 1024  # instances; where the errors of those are not alike
PRICED = 12  # the first of them, which give J
CHOOSERS, CHOOSING = 3, 5000  # instances that choose; before the first of them
SETTLING, WINDOW = 4.0, 2.0  # s: before the two windows, and each of them at least
CHANGED = math.log(1.25)  # of the error from one window to the next
FORCE, NOISE = 1 / 6, 1e-3  # of u_max; of the start
VELOCITY_NOISE_RATIO = 5.0  # 1/s, as in margins
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
# factors that are drawn: of the force, of its frequency, of the noise
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
    draw: int | None = None  # seed
    search: int = SEARCHES[0]


class Sets(NamedTuple):
    """Gains of a law, and what they reach at worst on the instances that choose."""

    gains: np.ndarray  # (sets, gains)
    J: np.ndarray  # (sets,), NaN beyond CAP
    errors: np.ndarray  # (sets, conditions), of the start
    settled: np.ndarray  # (sets, conditions)
    rates: np.ndarray  # (sets,), of variation in calm, of u_max a second


def drawn(seed: int, plant: str) -> tuple[tuple[Condition, ...], dict[str, tuple[float, ...]]]:
    """Return conditions and levels of price that a seed draws for a plant; equal ratios are
    equally likely.
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
    """The runs of a job, on the instances that choose or on so many unseen ones: of each instance
    those of its conditions, and of the first ones those of J.
    """

    def __init__(self, job: Job, unseen: int = 0):
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
        first = smc.Scenario(plant=self.plant, law=self.task.law, duration=1.0)
        self.fast = not why_not(first)
        first_number, count = CHOOSING + CHOOSERS * job.search, CHOOSERS
        if unseen:
            first_number, count = 1, unseen if self.fast else PRICED
        if job.draw is not None:
            first_number += 10_000 * (1 + job.draw % 10**6)
        numbers = range(first_number, first_number + count)
        self.priced = [self._priced(number) for number in numbers[:PRICED]]
        self.loaded = [self._loaded(number) for number in numbers]
        if self.fast:
            self.group = FormGroup(self.cases, SUMS)
            rows = self.group.rows
            rows[:, SETTING.early] = rows[:, SETTING.samples] + 1 - self.windows
            rows[:, SETTING.late] = rows[:, SETTING.samples] - self.windows

    def _add(self, one: smc.Scenario, window: float) -> int:
        """Return the number of a run, with its window in s."""
        self.cases.append(one)
        self.windows.append(round(window / one.control_period))
        return len(self.cases) - 1

    def _priced(self, seed: int) -> list[int]:
        """Return the runs of J on an instance."""
        found = []
        for one in self.goal.holdout(self.plant, self.task.law, seed):
            found.append(self._add(dataclasses.replace(one, model=self.job.model), 1.0))
        return found

    def _loaded(self, seed: int) -> list[int]:
        """Return the runs of the conditions on an instance."""
        found = []
        rng = np.random.default_rng([2027, seed])
        for condition in self.job.conditions:
            omega = condition.ratio * self.job.wc
            period = math.tau / omega
            window = period * max(1, math.ceil(WINDOW / period))
            load = smc.Sine(condition.force * self.bound, omega, rng.uniform(0.0, math.tau))
            noise = condition.noise * self.start
            made = case(
                self.plant,
                self.task.law,
                duration=round(SETTLING + 2.0 * window, 2),
                seed=seed,
                changes={
                    "control_period": self.job.period,
                    "disturbance": load if condition.force else (),
                    "noise": smc.Noise(noise, VELOCITY_NOISE_RATIO * noise),
                    "model": self.job.model,
                },
            )
            found.append(self._add(made, window))
        return found

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

    def prices(self, sums: np.ndarray, runs: Sequence[int]) -> np.ndarray:
        """Return J of sums of the runs of an instance, (sets, runs, sums)."""
        total = np.zeros(len(sums))
        for i, run in enumerate(runs):
            one = self.cases[run]
            start = np.abs(np.subtract(one.resolved.x0, one.plant.origin)).sum()
            total += sums[:, i, ITAE] / start
            total += self.goal.weight * sums[:, i, TV] / (self.bound * self.goal.duration)
        return total

    def judged(self, gains: np.ndarray) -> Sets:
        """Return what gains reach on the worst instance, of each number by itself; only those
        within CAP run on the next instance and under loads.
        """
        J = np.zeros(len(gains))
        errors = np.full((len(gains), len(self.loaded[0])), np.nan)
        settled = np.zeros(errors.shape, bool)
        rates = np.full(len(gains), np.nan)
        for runs in self.priced:
            fine = np.flatnonzero(~np.isnan(J))
            if fine.size:
                J[fine] = np.maximum(J[fine], self.prices(self.sums(gains[fine], runs), runs))
                J[~(J <= CAP)] = np.nan
        fine = np.flatnonzero(~np.isnan(J))
        if fine.size:
            sums = np.array([self.sums(gains[fine], runs) for runs in self.loaded])
            errors[fine] = sums[..., RMS].max(axis=0) / self.start
            settled[fine] = np.all([self.settled(its) for its in sums], axis=0)
            rates[fine] = sums[:, :, CALM, RATE].max(axis=0) / self.bound
        return Sets(gains, J, errors, settled, rates)

    def settled(self, sums: np.ndarray) -> np.ndarray:
        """Return of sums, (sets, runs, sums), whether the error is as large in both windows."""
        both = np.maximum(sums[:, :, (RMS, BEFORE)], FLOOR * self.start)
        return np.abs(np.diff(np.log(both), axis=2)[:, :, 0]) < CHANGED

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
    """Draw and breed sets of gains of a law, and judge them on the instances that choose."""
    bench = Bench(job)
    count = job.sets
    rng = np.random.default_rng([job.search, zlib.crc32(job.law.encode()), job.draw or 0])
    low, high = np.log(list(drawn_from(bench.task).values())).T

    def held(draw: Callable[[], np.ndarray], wanted: int) -> np.ndarray:
        found: list[np.ndarray] = []
        while len(found) < wanted:
            for row in np.exp(draw()):
                if bench.task.holds(tuple(row)):
                    found.append(row)
        return np.array(found[:wanted])

    first = count // 2
    known = [bench.judged(held(lambda: rng.uniform(low, high, (first, len(low))), first))]
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

        known.append(bench.judged(held(bred, size)))
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


def points_of(
    job: Job, sets: Sets, levels: Mapping[str, Sequence[float]], least: float
) -> list[dict]:
    """Return the points of a law's fronts, as they were chosen."""
    bench = Bench(job)
    found = []
    for price, level, condition, i in chosen(sets, levels, least):
        gains = dict(zip(bench.names, sets.gains[i].tolist(), strict=True))
        found.append(
            {
                "search": job.search,
                "draw": job.draw,
                "plant": bench.plant.name,
                "period": job.period,
                "model": job.model,
                "law": job.law,
                "price": price,
                "level": level,
                "condition": job.conditions[condition].kind,
                "wc": job.wc,
                "least": least,
                "gains": gains,
                "chose": float(sets.J[i] if price == "least" else sets.errors[i, condition]),
                "within": bench.admitted(sets.gains[i])[condition],
                "edges": search_space.at_bound(gains, drawn_from(bench.task)),
            }
        )
    return found


def told(job: Job, points: Sequence[dict]) -> list[dict]:
    """Return points of a law with what their gains reach on the unseen instances, and how far J and
    error on the first of them are from those by MuJoCo, as shares, unless they were drawn.
    """
    bench = Bench(job, UNSEEN)
    kinds = [condition.kind for condition in job.conditions]
    gains = np.array([*dict.fromkeys(tuple(point["gains"].values()) for point in points)])
    J = np.array([bench.prices(bench.sums(gains, runs), runs) for runs in bench.priced])
    calm = [runs[CALM] for runs in bench.loaded[:PRICED]]
    rates = np.median(bench.sums(gains, calm)[:, :, RATE], axis=1) / bench.bound
    by_mujoco = job.draw is None
    theirs = prices_by_mujoco(bench, gains) if by_mujoco else J[0]
    found = []
    known: dict[tuple[int, int], dict] = {}
    more: dict[int, Bench] = {}  # of conditions that need them
    for point in points:
        i = int(np.flatnonzero((gains == [*point["gains"].values()]).all(axis=1))[0])
        at = kinds.index(point["condition"])
        if (i, at) not in known:
            errors, made = unseen_errors(bench, gains[[i]], at)
            if by_mujoco:
                one = bench.by_mujoco(gains[[i]], [bench.loaded[0][at]])
                error = float(one[0, 0, RMS]) / bench.start
                made["apart"] = [float(theirs[i] / J[0, i] - 1.0), float(error / errors[0] - 1.0)]
            if bench.fast and not are_alike(errors):
                if at not in more:
                    more[at] = Bench(job._replace(conditions=(job.conditions[at],)), MORE)
                made |= unseen_errors(more[at], gains[[i]], 0)[1]
            known[i, at] = made
        costs = fronts_sentences.with_interval(J[:, i])
        found.append(point | {"J": costs, "rate": float(rates[i])} | known[i, at])
    return found


def are_alike(errors: np.ndarray) -> bool:
    """Return whether no quarter of the errors is far above another one, or above the floor."""
    low, high = np.quantile(np.nan_to_num(errors, nan=math.inf), (0.25, 0.75), method="nearest")
    return high <= max(FLOOR, (1.0 + fronts_sentences.NARROW) * low)


def unseen_errors(bench: Bench, gains: np.ndarray, at: int) -> tuple[np.ndarray, dict]:
    """Return the errors of a set of gains in a condition on all instances, and what a point says of
    them.
    """
    sums = bench.sums(gains, [runs[at] for runs in bench.loaded])
    errors = sums[0, :, RMS] / bench.start
    made = {"error": fronts_sentences.with_interval(errors), "runs": len(errors)}
    return errors, made | {"settled": float(np.mean(bench.settled(sums)))}


def prices_by_mujoco(bench: Bench, gains: np.ndarray) -> np.ndarray:
    """Return J of gains on the first instance, (sets,), by MuJoCo."""
    return bench.prices(bench.by_mujoco(gains, bench.priced[0]), bench.priced[0])


KEPT = (
    *("search", "draw", "plant", "period", "model", "law", "price", "level", "condition"),
    *("within", "edges", "wc", "least", "chose", "rate", "settled", "runs", "gains"),
    *("J", "error", "apart"),
)


def rounded(value: Any) -> Any:
    """Return what is kept of a value of a point: of numbers four digits, of gains five."""
    if isinstance(value, dict):
        return {
            name: its if isinstance(its, str) else _digits(its, 5) for name, its in value.items()
        }
    if isinstance(value, list | tuple):
        return [_digits(one, 4) for one in value]
    return _digits(value, 4) if isinstance(value, float) else value


def _digits(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")


HEADS = "search, plant, period, model, law, condition, price, J, error / start, rate / u_max, "
HEADS += "settled, theorem, gains"


def line(point: dict) -> str:
    """Return a point as a row of a table."""
    gains = ", ".join(f"{name} {value:.3g}" for name, value in point["gains"].items())
    price = f"{point['price']} {point['level']:.3g}"
    model = point["model"] + ", its line" * (point["law"] in TOLD)
    period = f"{1e3 * point['period']:g} ms"
    error, low, high = point["error"]
    cells = [str(point["search"]), point["plant"], period, model, point["law"], point["condition"]]
    cells += [price, f"{point['J'][0]:.3g}", f"{error:.2g} ({low:.2g} to {high:.2g})"]
    cells += [f"{point['rate']:.3g}", f"{100 * point['settled']:.0f} %"]
    cells += [{None: "", True: "within", False: "beyond"}[point["within"]], gains]
    return f"| {' | '.join(cells)} |"


def fronts(job: Job, laws: Sequence[str], executor: Executor) -> list[dict]:
    """Return the points of the fronts of some laws in place of the job's that sentences or the
    figure rest on. Workers search and run laws side by side.
    """
    levels = LEVELS
    if job.draw is not None:
        conditions, levels = drawn(job.draw, job.plant)
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
    points = []
    for one, its in zip(jobs, searched, strict=True):
        points += points_of(one, its, levels, least)
    wanted = {id(side): side for _, *both in two_sides(points) for side in both if side}
    wanted |= {id(point): point for point in points if of_figure(point)}
    work = []
    for one in jobs:
        its = [point for point in wanted.values() if point["law"] == one.law]
        if its:
            work.append(executor.submit(told, one, its))
    print(
        f"{job.plant}, {1e3 * job.period:g} ms, search {job.search}: wc {job.wc:.3g} rad/s, least "
        f"J {least:.3g}, {job.sets} sets a law",
        flush=True,
    )
    return [point for one in work for point in one.result()]


def workers(processes: int, address: str | None) -> AbstractContextManager[Executor]:
    """Return the workers of a dask scheduler, or that many processes of this machine."""
    if address:
        return opened(address)
    return ProcessPoolExecutor(processes, mp_context=get_context("spawn"))


def write(points: Sequence[dict], path: Path) -> None:
    """Write what is kept of points: their names, then a row a point, which `read` reads."""
    rows = [KEPT, *([rounded(point.get(name)) for name in KEPT] for point in points)]
    path.write_text("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]\n")


def main() -> None:
    """Print a row a point and the verdicts, and write all points."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("plants", nargs="+", help="names, FILE.xml:joint or FILE.py:variable")
    parser.add_argument("--law", nargs="+", default=LAWS, help="names of laws")
    parser.add_argument("--model", default="none", choices=("none", "nominal"))
    parser.add_argument("--period", nargs="+", type=float, default=PERIODS, help="of control, s")
    parser.add_argument("--sets", type=int, default=SETS, help=f"of gains a law, {SETS}")
    parser.add_argument("--device", default="cpu", choices=("cpu", "cuda"))
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--executor", metavar="dask://HOST:PORT", help="in place of processes")
    parser.add_argument("--draw", type=int, metavar="SEED", help="draw loads, prices and seeds")
    parser.add_argument("--search", nargs="+", type=int, default=SEARCHES, metavar="SEED")
    parser.add_argument("--read", nargs="+", type=Path, default=[], help="points kept earlier")
    parser.add_argument("--keep", type=Path, help="file of the points that the page rests on")
    asked = parser.parse_args()
    points = [point for path in asked.read for point in read(path)]
    with workers(asked.processes, asked.executor) as executor:
        for search_seed in asked.search:
            for plant in asked.plants:
                for period in asked.period:
                    job = Job(plant, "", 0.0, period=period, model=asked.model, sets=asked.sets)
                    job = job._replace(device=asked.device, draw=asked.draw, search=search_seed)
                    points += fronts(job, asked.law, executor)
                    if asked.keep:
                        write(points, asked.keep)
    print(f"| {HEADS.replace(', ', ' | ')} |", *map(line, points), *summary(points), sep="\n")


if __name__ == "__main__":
    main()
