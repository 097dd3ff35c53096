"""Which law wins under friction, and what friction compensation is worth: runs for
docs/what_wins_under_friction.md.

    python -m benchmarks.friction rail geared ak80 --keep FOLDER --out friction.json
    python -m benchmarks.friction drawn_rail drawn_geared --draw 1234567 --seeds 1 --out drawn.json

`benchmarks.friction_sentences` reads the file.

The joints are those of friction_plants.py. All laws read the same encoder of 4096 counts with 0.3
counts of noise, at 1 kHz, and act after 2 ms; the rate is a filtered difference, whose time
constant is a gain of each law. No law has a model. Errors are in counts; **below one count nothing
is ranked**.

Tasks: `rest`, from the start to 0, the rms of 5 to 10 s; `sine`, through reversals, the rms of one
period. Two prices: J, the ITAE over the start plus weighted variation of u, of five runs of 5 s
without friction; and R, the rate of variation of u at rest without friction, of the bound a second.
A set of gains is admitted if its J is at most ADMITTED times the least of all laws.

Each law gets the same number of sets: two thirds drawn over the box of a search and a decade
beyond it, the others bred from their fronts. One instance chooses, 48 others judge, with other
starts, phases, zeros of the encoder and noise. Both seeds are whole searches. A feedforward knows
the friction, or has 30 % less or more of it, on the reference or at the measured speed, and a set
is chosen for each of these. At the measured speed it moves u at rest, so R is then that of a run
with the friction and its compensation.

Sets that are chosen without them run again with what friction_dither.py has: a PD beside a square
wave, and super-twisting with a slope in place of its sign.

The fast engine searches, and runs what no search has seen, friction that grows with the load and
LuGre. MuJoCo runs each point that the page prints, and by itself a play with friction on either
side, and a contact.
"""

import argparse
import json
import math
import zlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import smc_mujoco as smc
from benchmarks.friction_dither import AMPLITUDES, DITHER, SLOPES, Square, sloped
from benchmarks.friction_plants import Joint, joints
from smc_mujoco.analysis.engine.form import FAILURE, SCORES, SETTING
from smc_mujoco.analysis.engine.group import FormGroup
from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.analysis.tuning.evaluator import with_gains
from smc_mujoco.control.component import Component
from smc_mujoco.simulation import state
from smc_mujoco.simulation.conditions import NAMED
from smc_mujoco.simulation.run import stream

OBSERVERS = ("adrc", "pd_observer")
LAWS = (
    "pd",
    "pid",
    *OBSERVERS,
    "hodob",
    "super_twisting",
    "implicit_super_twisting",
    "observer_free_integral",
    "boundary_layer",
    "classical",
)
SETS = 240
SEEDS = (1, 2)
GENERATIONS = (0.5, 0.35, 0.25, 0.15)  # spread of the bred sets, of log gains
WIDER = 1.0  # decades beyond the box of a search
TAUS = (1e-3, 3e-2)  # s, of the filtered difference
CAP = 1.5  # s^2: a set that costs more does not run under friction
DRAWN = 2 / 3  # of the sets; the others are bred
ADMITTED, MARGIN = 4.0, 0.97  # of the least J; of a level of R
RATES = (10.0, 30.0, 100.0)  # levels of R, 1/s
UNSEEN, BY_MUJOCO = 48, 2  # instances
PERIOD, DELAY, NOISE = 1e-3, 2e-3, 0.3  # s; s; counts
REST, WINDOW, CALM, LONG, LATE = 10.0, 5.0, 4.0, 40.0, 10.0  # s
AFTER_BLOW = 2.0  # s, the last of a run with a blow at 5 s
SPEED, SETTLING = 0.1, 3.0  # of a sine: its peak over the start and the time scale; s
STILL = 4.0  # counts: a joint that moves by more in the last 10 of 40 s still moves
PARTED = (0.0, RATES[0])  # levels whose sets run beside a square wave or with a slope; 0: least J
HUNTERS, HUNTING_RATE = 16, 30.0  # sets of a law that run for 40 s; their largest R
SUMS = ("itae", "tv", "rms_error", "tv_rate", "ripple", "stick_time", "reversal_error")
ITAE, TV, RMS, RATE, RIPPLE, STICK, TURNED = range(len(SUMS))
SHARES = (0.0, 1.0, 0.7, 1.3)  # of the true friction that is fed forward
ON = ("reference", "speed")  # what is fed forward on


class Case(NamedTuple):
    """A friction, a task, the share of the friction that is fed forward, and at which speed."""

    friction: str
    task: str = "rest"
    share: float = 0.0
    on: str = ON[0]


PRICED = (  # runs without friction: J's, then that of the rate in calm
    {},
    {"load": 0.0},
    {"load": 5.0},
    {"mass": 0.7},
    {"mass": 1.3},
    {"calm": True},
)


def cases_of(one: Joint) -> list[Case]:
    """Return what sets of gains are chosen under; compensation matters where the reference moves,
    and its errors are told of dry friction of one level.
    """
    found = []
    for name, (moving, resting) in one.levels.items():
        found += [Case(name), Case(name, "sine")]
        for on in ON if moving == resting else ():
            found += [Case(name, "sine", share, on) for share in SHARES[1:]]
    return found


def law_of(name: str, one: Joint) -> Component:
    """Return a law of the page: `pd` is `pid` without an integral, whose rate has one filter."""
    if name in ("pd", "pid"):
        return smc.law("pid", tau=0.0, ki=0.0) if name == "pd" else smc.law("pid", tau=0.0)
    if name == "super_twisting":
        return smc.law(name, w_max=one.bound)
    return smc.law(name)


def scenario(one: Joint, law: Component, case: Case, instance: int, **changes: Any) -> smc.Scenario:
    """Return a run; `changes` are fields of it, or the `length` of a rest, s."""
    rng = np.random.default_rng([31, instance])
    start = one.start * rng.uniform(0.8, 1.2) * rng.choice([-1, 1])
    phase = rng.uniform(0.0, math.tau)
    zero = rng.uniform(-0.5, 0.5) * one.count
    omega = SPEED / one.scale
    size = one.start if case.task == "sine" else 0.0
    length = changes.pop("length", REST)
    if case.task == "sine":
        start = one.start * math.sin(phase)
        length = SETTLING + period_of(one)
    friction = one.friction(case.friction)
    fields = {
        "plant": one.plant,
        "law": law,
        "model": "none",
        "u_max": one.bound,
        "x0": start,
        "friction": friction,
        "feedforward": smc.Feedforward(
            friction, on=case.on, eps=one.slow / 4, error=case.share - 1.0
        ),
        "reference": smc.Sine(size, omega, phase),
        "duration": length,
        "control_period": PERIOD,
        "physics_step": PERIOD,
        "sensor": smc.Encoder(counts=one.counts, bias=zero),
        "noise": smc.Noise(position=NOISE * one.count),
        "velocity": smc.estimator("filtered_difference"),
        "input_delay": DELAY,
        "seed": instance,
    }
    return smc.Scenario(**fields | changes)


def period_of(one: Joint) -> float:
    """Return the period of the sine, s, in whole control periods."""
    return round(math.tau * one.scale / SPEED / PERIOD) * PERIOD


def window_of(one: Joint, case: Case) -> int:
    """Return the samples that a case's error is taken over."""
    return round((period_of(one) if case.task == "sine" else WINDOW) / PERIOD)


def priced(one: Joint, law: Component, number: int, instance: int) -> smc.Scenario:
    """Return a run of the prices."""
    what = PRICED[number]
    changes: dict[str, Any] = {"length": CALM if "calm" in what else 5.0}
    if "calm" in what:
        changes["x0"] = 0.0
    if "mass" in what:
        changes["mismatch"] = {"mass": what["mass"]}
    if "load" in what:
        force = one.bound / 30
        changes["disturbance"] = (
            smc.Sine(force, what["load"]) if what["load"] else smc.Constant(force)
        )
    return scenario(one, law, Case("none"), instance, **changes)


def calm(one: Joint, law: Component, case: Case, instance: int, **changes: Any) -> smc.Scenario:
    """Return a run at rest under the friction of a case, with its compensation."""
    its = {"x0": 0.0, "length": CALM} | changes
    return scenario(one, law, case._replace(task="rest"), instance, **its)


class Sets(NamedTuple):
    """Gains of a law, the last of which is tau, and what they reach where they are chosen."""

    gains: np.ndarray  # (sets, gains)
    J: np.ndarray  # (sets,), NaN beyond CAP
    rates: np.ndarray  # (sets, cases), R
    errors: np.ndarray  # (sets, cases), counts


CALM_WINDOW = round((CALM - 1.0) / PERIOD)  # samples


def grouped(runs: Sequence[smc.Scenario], windows: np.ndarray) -> FormGroup:
    """Return runs of one form, whose errors are taken over their last samples."""
    group = FormGroup(runs, SUMS)
    group.rows[:, SETTING.early] = group.rows[:, SETTING.samples] + 1 - windows
    group.rows[:, SETTING.late] = group.rows[:, SETTING.samples] - windows
    return group


def sums_of(group: FormGroup, rows: np.ndarray) -> np.ndarray:
    """Return the sums of rows, (rows, sums); NaN after a failure."""
    scores = group.run(rows, threads=1)
    return np.where(scores[:, [FAILURE]] == state.FINE, scores[:, SCORES:], np.nan)


class Bench:
    """The runs that choose among sets of gains of a law on a joint, as rows of the fast engine."""

    def __init__(self, one: Joint, name: str):
        self.one = one
        self.law = law_of(name, one)
        scales = search_space.scales(one.plant, one.bound, one.start, 1.0)
        self.box = search_space.box(self.law, scales)
        self.cases = cases_of(one)
        runs = [priced(one, self.law, number, 0) for number in range(len(PRICED))]
        self.priced = grouped(runs, np.full(len(runs), CALM_WINDOW))
        self.starts = [abs(run.resolved.x0[0]) for run in runs[:-1]]
        self.at = {on: [k for k, case in enumerate(self.cases) if case.on == on] for on in ON}
        self.loaded = {}
        for on, places in self.at.items():
            cases = [self.cases[k] for k in places]
            runs = [scenario(one, self.law, case, 0) for case in cases]
            self.loaded[on] = grouped(runs, np.array([window_of(one, case) for case in cases]))
        cases = [self.cases[k] for k in self.at["speed"]]
        runs = [calm(one, self.law, case, 0) for case in cases]
        self.calm = grouped(runs, np.full(len(runs), CALM_WINDOW))

    def sums(self, group: FormGroup, gains: np.ndarray) -> np.ndarray:
        """Return the sums of gains in the runs of a group, (sets, runs, sums)."""
        runs = len(group.rows)
        rows = np.tile(group.rows, (len(gains), 1))
        for name, values in zip(self.box, gains.T, strict=False):
            rows[:, group.gain_columns(name)] = np.repeat(values, runs)[:, None]
        rows[:, group.layout.estimator.numbers] = np.repeat(gains[:, -1], runs)
        return sums_of(group, rows).reshape(len(gains), runs, len(SUMS))

    def prices(self, gains: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return J and R of gains."""
        sums = self.sums(self.priced, gains)
        J = np.zeros(len(gains))
        for i, start in enumerate(self.starts):
            J += sums[:, i, ITAE] / start + PERIOD * sums[:, i, TV] / (self.one.bound * 5.0)
        return J, sums[:, -1, RATE] / self.one.bound

    def judged(self, gains: np.ndarray) -> Sets:
        """Return what gains reach; only what is within CAP and the largest level of R runs under
        friction.
        """
        J, plain = self.prices(gains)
        J[~(J < CAP)] = np.nan
        errors = np.full((len(gains), len(self.cases)), np.nan)
        rates = np.tile(plain[:, None], (1, len(self.cases)))
        fine = np.flatnonzero(np.isfinite(J) & (plain <= RATES[-1]))
        if fine.size:
            for on, places in self.at.items():
                sums = self.sums(self.loaded[on], gains[fine])
                errors[fine[:, None], places] = sums[:, :, RMS] / self.one.count
            sums = self.sums(self.calm, gains[fine])
            rates[fine[:, None], self.at["speed"]] = sums[:, :, RATE] / self.one.bound
        return Sets(gains, J, rates, errors)


def joined(parts: Sequence[Sets]) -> Sets:
    """Return sets as one."""
    return Sets(*(np.concatenate(its) for its in zip(*parts, strict=True)))


def on_front(sets: Sets) -> np.ndarray:
    """Return the sets that have less error in some case than every set of a lower R, and the one of
    the least J.
    """
    found = {int(np.nanargmin(sets.J))} if np.isfinite(sets.J).any() else set()
    for error, rates in zip(sets.errors.T, sets.rates.T, strict=True):
        least = math.inf
        for i in np.argsort(rates):
            if error[i] < 0.95 * least:
                found.add(int(i))
                least = error[i]
    return np.array(sorted(found), int)


def searched(one: Joint, name: str, count: int, seed: int, folder: Path | None) -> Sets:
    """Return the sets of a search, which a folder may keep."""
    file = folder and folder / f"{one.plant.name}-{name}-{seed}-{count}.npz"
    if file and file.exists():
        with np.load(file) as kept:
            return Sets(**kept)
    found = search(one, name, count, seed)
    if file:
        np.savez_compressed(file, **found._asdict())
    return found


def search(one: Joint, name: str, count: int, seed: int) -> Sets:
    """Draw and breed sets of gains of a law, and judge them on the instance that chooses."""
    bench = Bench(one, name)
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    low, high = np.log([*bench.box.values(), TAUS]).T
    low[:-1] -= WIDER * math.log(10.0)
    high[:-1] += WIDER * math.log(10.0)
    drawn = round(DRAWN * count)
    known = [bench.judged(np.exp(rng.uniform(low, high, (drawn, len(low)))))]
    size = (count - drawn) // len(GENERATIONS)
    for spread in GENERATIONS:
        so_far = joined(known)
        parents = np.log(so_far.gains[on_front(so_far)])
        if not len(parents):
            break
        steps = rng.normal(0.0, spread, (size, len(low)))
        steps *= rng.random(steps.shape) < 0.6
        bred = parents[rng.integers(len(parents), size=len(steps))] + steps
        known.append(bench.judged(np.exp(np.clip(bred, low, high))))
    return joined(known)


class Choice(NamedTuple):
    """A point of the page, before its runs: what buys it, and where."""

    price: str  # "J": the set of the least J; "R": that of the least error which a level affords
    level: float
    case: int


def choices(cases: Sequence[Case]) -> Iterator[Choice]:
    """Yield what the page prints: rest by the set of the least J, reversals by level of R."""
    for k, case in enumerate(cases):
        if case.task == "rest":
            yield Choice("J", 0.0, k)
            continue
        levels = RATES[:2] if case.on == "speed" else RATES[:1]
        for level in levels if case.share else RATES:
            yield Choice("R", level, k)


def chosen(sets: Sets, choice: Choice, least: float) -> int:
    """Return the set of a choice; -1 where there is none."""
    if choice.price == "J":
        costs = sets.J
    else:
        rates = sets.rates[:, choice.case]
        admitted = (sets.J / least <= ADMITTED) & (rates <= MARGIN * choice.level)
        costs = np.where(admitted, sets.errors[:, choice.case], np.nan)
    return -1 if np.isnan(costs).all() else int(np.nanargmin(costs))


class Told(NamedTuple):
    """What the engine and MuJoCo say of sets of gains of a law on a joint."""

    one: Joint
    name: str
    law: Component
    names: tuple[str, ...]  # of the gains, without tau

    def scenario(
        self, gains: Sequence[float] | np.ndarray, case: Case, instance: int, **changes: Any
    ):
        """Return a run with these gains."""
        law = with_gains(self.law, self.names, [float(value) for value in gains[:-1]])
        rate = smc.estimator("filtered_difference", tau=float(gains[-1]))
        return scenario(self.one, law, case, instance, **{"velocity": rate} | changes)

    def named(self, gains: np.ndarray) -> dict[str, float]:
        """Return the gains by name."""
        return dict(zip((*self.names, "tau"), gains.tolist(), strict=True))

    def runs(self, gains: np.ndarray, case: Case, **changes: Any) -> dict[str, Any]:
        """Return what unseen instances of a case give, by the engine and by MuJoCo."""
        window = window_of(self.one, case)
        numbers = range(1, 1 + UNSEEN)
        runs = [self.scenario(gains, case, number, **changes) for number in numbers]
        sums = self.by_engine(runs, window)
        found: dict[str, Any] = {"errors": (sums[:, RMS] / self.one.count).tolist()}
        for key, column in (("ripple", RIPPLE), ("turned", TURNED)):
            found[key] = float(np.median(sums[:, column]) / self.one.count)
        found["stuck"] = float(np.median(sums[:, STICK]) / runs[0].duration)
        if self.one.printed:
            found["mujoco"] = self.by_mujoco(runs[:BY_MUJOCO], window)
        return found

    def by_engine(self, runs: Sequence[smc.Scenario], window: int) -> np.ndarray:
        """Return the sums of runs of one form over their last samples, (runs, sums)."""
        group = grouped(runs, np.full(len(runs), window))
        return sums_of(group, group.rows)

    def by_mujoco(self, runs: Sequence[smc.Scenario], window: int) -> list[float]:
        """Return the rms of the error over the last samples of MuJoCo's runs, counts."""
        found = [math.nan] * len(runs)
        for i, trace in stream(runs, threads=1):
            if trace.failure is None and trace.diverged_at is None:
                found[i] = float(np.sqrt(np.mean(trace.e[-window:, 0] ** 2)) / self.one.count)
        return found


def told(one: Joint, name: str, found: Sequence[Sets], least: float) -> list[dict]:
    """Return the points of a law, by the sets of all searches together, on instances that chose
    nothing; `chose` has what each search by itself chose, on the instance that chooses.
    """
    law = law_of(name, one)
    box = search_space.box(law, search_space.scales(one.plant, one.bound, one.start, 1.0))
    it = Told(one, name, law, tuple(box))
    cases = cases_of(one)
    sets = joined(found)
    points = []
    for choice in choices(cases):
        case = cases[choice.case]
        point: dict[str, Any] = {"joint": one.plant.name, "law": name, "price": choice.price}
        point |= {"level": choice.level} | case._asdict() | {"errors": None}
        i = chosen(sets, choice, least)
        if i >= 0:
            alone = [(its, chosen(its, choice, least)) for its in found]
            point["chose"] = [
                its.errors[j, choice.case] if j >= 0 else math.inf for its, j in alone
            ]
            point |= {"J": sets.J[i] / least, "gains": it.named(sets.gains[i])}
            point["R"] = sets.rates[i, choice.case]
            point |= it.runs(sets.gains[i], case) | {"edge": edges(sets.gains[i], box)}
        points.append(point)
    points += hunting(it, sets, least)
    if np.isfinite(sets.J).any():
        points += beyond(it, sets, least)
    for choice in choices(cases):
        i = chosen(sets, choice, least)
        case = cases[choice.case]
        if i >= 0 and case.share == 0.0 and choice.level in PARTED:
            points += parted(it, case, choice.level, sets.gains[i])
    return points


def parted(it: Told, case: Case, level: float, gains: np.ndarray) -> Iterator[dict]:
    """Yield what a set of gains, which a level of R bought, does beside a square wave if it is a
    PD's, and with a slope in place of the sign if it is super-twisting's; with R of its own.
    """
    one = it.one
    variants: list[tuple[str, float, Told, dict[str, Any]]] = []
    moving, resting = one.levels[case.friction]
    if it.name == "pd" and moving == resting:
        for share in AMPLITUDES:
            wave = Square(share * moving * one.bound, DITHER)
            variants.append(("dither", share, it, {"feedforward": wave}))
    if it.name == "super_twisting":
        for width in SLOPES:
            law = sloped(it.law, width * one.start / one.scale)
            variants.append(("slope", width, it._replace(law=law), {}))
    for price, size, its, changes in variants:
        point: dict[str, Any] = {"joint": one.plant.name, "law": it.name, "price": price}
        point |= {"level": level, "size": size} | case._asdict()
        still = {"x0": 0.0, "length": CALM} | changes
        numbers = range(1, 1 + UNSEEN)
        runs = [its.scenario(gains, Case("none"), number, **still) for number in numbers]
        rates = its.by_engine(runs, CALM_WINDOW)[:, RATE] / one.bound
        point |= {"R": float(np.median(rates)), "gains": it.named(gains)}
        yield point | its.runs(gains, case, **changes)


def beyond(it: Told, sets: Sets, least: float) -> Iterator[dict]:
    """Yield what the set of the least J does at rest under what no search has seen."""
    one = it.one
    i = int(np.nanargmin(sets.J))
    for name in one.others:
        point = {"joint": one.plant.name, "law": it.name, "price": "J", "level": 0.0}
        point |= {"friction": name, "task": "rest", "share": 0.0, "J": sets.J[i] / least}
        point |= {"R": sets.rates[i, 0]}
        changes: dict[str, Any] = {}
        if name in ("load", "lugre"):
            if name == "lugre":
                changes["physics_step"] = PERIOD / 4
            point |= {"gains": it.named(sets.gains[i])}
            yield point | it.runs(sets.gains[i], Case(name), **changes)
            continue
        case = Case("coulomb10")
        if name.startswith("play"):
            changes = play(one, name.removeprefix("play, "))
        if name == "contact":
            changes = dict(NAMED["contact"].on(one.plant, REST)) | {"x0": one.start}
            changes["physics_step"] = PERIOD / 4
        runs = []
        for instance in range(BY_MUJOCO):
            runs.append(it.scenario(sets.gains[i], case, 1 + instance, **changes))
        window = round((AFTER_BLOW if name == "contact" else WINDOW) / PERIOD)
        yield point | {"errors": it.by_mujoco(runs, window)}


def play(one: Joint, side: str) -> dict[str, Any]:
    """Return a play of a hundredth of the start, with 40 % of the inertia on the motor's side, and
    friction of 10 % of the bound on a side of it.
    """
    M = one.plant.parameters["M"]
    gap = smc.Backlash(one.start / 100, rotor_inertia=0.4 * M)
    friction = smc.Coulomb(0.1 * one.bound, side=side)
    fields = {"actuator": gap, "friction": friction, "feedforward": None, "mismatch": {"mass": 0.6}}
    return fields | {"physics_step": PERIOD / 8}


def edges(gains: np.ndarray, box: Mapping[str, tuple[float, float]]) -> list[str]:
    """Return the gains that are outside of the box of a search, or at its edge."""
    found = []
    for (name, (low, high)), value in zip(box.items(), gains, strict=False):
        place = math.log(value / low) / math.log(high / low)
        if not search_space.BOUND_MARGIN < place < 1.0 - search_space.BOUND_MARGIN:
            found.append(name)
    return found


def hunting(it: Told, sets: Sets, least: float) -> Iterator[dict]:
    """Yield for each friction which share of a law's admitted sets still moves after 40 s."""
    admitted = np.flatnonzero((sets.J / least <= ADMITTED) & (sets.rates[:, 0] <= HUNTING_RATE))
    picked = np.random.default_rng(5).permutation(admitted)[:HUNTERS]
    for friction in it.one.levels:
        point: dict[str, Any] = {"joint": it.one.plant.name, "law": it.name, "price": "hunting"}
        point |= {"friction": friction, "sets": len(picked)}
        if len(picked):
            runs = []
            for i in picked:
                for instance in (1, 2):
                    runs.append(it.scenario(sets.gains[i], Case(friction), instance, length=LONG))
            ripples = it.by_engine(runs, round(LATE / PERIOD))[:, RIPPLE] / it.one.count
            ranges = np.nan_to_num(ripples, nan=math.inf).reshape(-1, 2)
            moving = (ranges > STILL).all(axis=1)
            point["moving"] = float(moving.mean())
            point["range"] = float(np.median(ranges[moving])) if moving.any() else 0.0
        yield point


def points_of(
    one: Joint, laws: Sequence[str], count: int, seeds: Sequence[int], folder: Path | None
) -> list[dict]:
    """Return the points of some laws on a joint."""
    found = {}
    for seed in seeds:
        for name in laws:
            found.setdefault(name, []).append(searched(one, name, count, seed, folder))
    J = [sets.J for its in found.values() for sets in its]
    least = float(np.nanmin(np.concatenate(J)))
    points = []
    for name, its in found.items():
        file = folder and folder / f"{one.plant.name}-{name}-{count}.json"
        if file and file.exists():
            points += json.loads(file.read_text())
            continue
        made = told(one, name, its, least)
        if file:
            file.write_text(json.dumps(made))
        points += made
    return [point | {"least": least, "searched": count * len(seeds)} for point in points]


def rounded(value: Any) -> Any:
    """Return a point with numbers of four digits."""
    if isinstance(value, dict):
        return {key: rounded(one) for key, one in value.items()}
    if isinstance(value, list):
        return [rounded(one) for one in value]
    if isinstance(value, float):
        return float(f"{value:.4g}") if math.isfinite(value) else None
    return value


def row(point: dict) -> str:
    """Return a point as a line."""
    about = [point[name] for name in ("joint", "law", "price", "friction")]
    if point["price"] == "hunting":
        return f"{about} {point['sets']} sets, {point.get('moving')} move"
    about += [point["level"], point["task"], point["share"], point.get("edge")]
    errors = [np.median(point[by]) if point.get(by) else math.nan for by in ("errors", "mujoco")]
    return f"{about} J {point.get('J')} R {point.get('R')}: {errors[0]:.3g} ({errors[1]:.3g})"


def main() -> None:
    """Print a line a point, and write all points."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("joints", nargs="+", help="rail, geared, ak80; or drawn_rail, drawn_geared")
    parser.add_argument("--law", nargs="+", default=LAWS, help="names of laws")
    parser.add_argument("--sets", type=int, default=SETS)
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    parser.add_argument("--draw", type=int, metavar="SEED", help="draw the joints by chance")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="folder of searches that are done")
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    points = []
    known = joints(asked.draw)
    with ProcessPoolExecutor(asked.processes, mp_context=get_context("spawn")) as executor:
        work = []
        for name in asked.joints:
            its = known[name], asked.law, asked.sets, asked.seeds, asked.keep
            work.append(executor.submit(points_of, *its))
        for one in work:
            points += map(rounded, one.result())
            lines = ",\n".join(map(json.dumps, points))
            asked.out.write_text(f"[\n{lines}\n]\n")
    print(*map(row, points), sep="\n")


if __name__ == "__main__":
    main()
