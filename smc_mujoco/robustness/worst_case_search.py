"""The search for the worst member of a class around a scenario.

A search tries the same members in the same order, whatever its budget:

1. constant forces, and relays that switch with the sign of s, of e and of e': an adversary who sees
  the loop;
2. the corners of the constants of the class, at most 16, each with both constant forces and a relay
  of e';
3. relays of weighted sums of these, forces that switch once, and waves about the frequency at which
   the loop swings; then errors of measurement, constant or switching as the loop swings;
4. the worst member so far, with a force along the motion from some time on: such a force drives a
  fallen pendulum;
5. in turns, two ways to change the worst members. The first reverses a piece of a force, shifts a
   switch or moves constants, in members of different origin. The second is an evolution of the
   worst member by separable CMA-ES (R. Ros & N. Hansen, PPSN X, 2008; package cmaes), which adds
   straight lines between knots to its force and cuts the sum off at the bound.

A larger budget only continues a search, so its worst is never milder. A search also ends when a run
fails, because nothing is worse. The force of a relay is recorded and replayed, so every member is
an ordinary scenario. A force is a number for each control sample, as a share of its bound. The
error of a linear loop is a convex function of the force, so the worst force jumps between its
bounds, as most of these do.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.analysis.engine.scored_runs import ScoredRuns
from smc_mujoco.common.aliases import Array, Pair
from smc_mujoco.metrics.catalogue import CATALOGUE, arrived
from smc_mujoco.metrics.conventions import Metric, by_group
from smc_mujoco.robustness.uncertainty import Member, Members
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Relay
from smc_mujoco.simulation.trace import Trace

BATCH_MEMBERS = 16  # run at once; chosen
DRAWN_MEMBERS = 1024  # random members that are run at once, after the first BATCH_MEMBERS; chosen
# in a batch: of the worst member, then of the worst of each other origin; chosen
CHANGES_PER_PARENT = 7, 4, 3, 2
MAX_CORNERS = 16
FORCE_KNOTS = 32  # in an evolution; chosen
KNOT_DEVIATION = 0.5  # first standard deviation of a knot, over the bound; chosen
GENERATIONS = 4  # of an evolution, before the next one begins with the worst member so far; chosen
FAILED_KEY = math.inf, math.inf
SIGNS = 1.0, -1.0
CONFIRMED = 8  # of the worst members, which MuJoCo runs after the fast engine; chosen
# strategy -> signal that a relay sees
RELAY_SIGNALS = {"sign of s": "s", "sign of e": "error", "sign of e'": "rate"}
PHASE_LEADS = (-1.2, -0.6, 0.6, 1.2)  # rad, of weighted sums of e' and e before e'; chosen
SWITCH_TIMES = (0.25, 0.5, 0.75)  # of a force that switches once, as shares of a run; chosen
# the same while the loop still moves from its start; chosen
EARLY_SWITCH_TIMES = 1 / 32, 1 / 16, 1 / 8
FREQUENCY_RATIOS = (0.5, 0.8, 1.0, 1.25, 2.0)  # frequencies of waves over that of the loop; chosen
# of the control frequency: a faster oscillation of the loop is chattering; chosen
MAX_FREQUENCY_SHARE = 0.1


class Case(NamedTuple):
    """A member to run."""

    member: Member
    relay: Relay | None = None  # makes its force; None if the member has its force
    origin: int = -1  # number of the member from which changes led to this one; -1 for a new one


class TriedMember(NamedTuple):
    """A member that was run."""

    member: Member
    key: Pair  # its metric, then its rms error, which decides between equal metrics
    origin: int  # as in `Case`; a new member is its own origin
    by_mujoco: bool = True


class WorstCaseSearch:
    """A search among the members of a class."""

    def __init__(
        self,
        members: Members,
        metric: Metric,
        budget: int,
        fast: ScoredRuns,
        report: Callable[[int], None],
    ):
        self.members = members
        self.fast = fast
        self.metric = metric
        self.budget = budget
        self.threads = fast.threads
        self.report = report
        self.tried: list[TriedMember] = []  # every member that was run, in order
        self.runs = 0
        self.broken = ""  # how the law or a signal failed first, in a sentence
        # the first run under a relay of e', or without a force, for its frequency
        self.swing: Trace | None = None

    @property
    def worst(self) -> TriedMember:
        """The worst member so far, the first of several."""
        return max(self.tried, key=lambda one: one.key)

    def draw(self, rng: np.random.Generator) -> None:
        """Run random members only, a whole budget of them."""
        at_once = BATCH_MEMBERS  # which may tell the frequency at which the loop swings
        while self.runs < self.budget:
            cases = []
            for _ in range(min(self.budget - self.runs, at_once)):
                cases.append(Case(self.members.random(rng)))
            self.run(cases)
            at_once = DRAWN_MEMBERS

    def search(self, rng: np.random.Generator, known: Sequence[TriedMember]) -> None:
        """Try the strategies, beginning with members that were run before."""
        for i, member in enumerate(known):
            self.tried.append(member._replace(origin=-1 - i))
        batches = (
            self._simple(),
            self._corners(),
            self._at_loop_frequency(),
            self._driven(),
            self._changed(rng),
        )
        for batch in itertools.chain(*batches):
            self.run(batch)
            if self.runs >= self.budget or self.worst.key == FAILED_KEY:
                return

    def run(self, cases: Sequence[Case]) -> list[TriedMember]:
        """Run cases, as many as the budget allows, and return them as tried."""
        cases = list(cases[: self.budget - self.runs])
        first = self.runs
        replays = []
        self.runs += len(cases)
        tried: list[TriedMember | None] = [None] * len(cases)
        scenarios = []
        for case in cases:
            scenarios.append(self.members.scenario_of(case.member, case.relay))
        scored = self._scored(cases, scenarios)
        traced = []
        for i in range(len(cases)):
            if i not in scored:
                traced.append(i)
        for i, key in scored.items():
            member, _, origin = cases[i]
            tried[i] = TriedMember(member, key, origin if origin >= 0 else first + i, False)
        for k, trace in stream([scenarios[i] for i in traced], self.threads, self.report):
            i = traced[k]
            member, relay, origin = cases[i]
            if relay:
                swings = relay.rate > 0.0
            else:
                swings = not self.members.forced
            if swings and self.swing is None:
                self.swing = trace
            if relay:
                member = dataclasses.replace(
                    member, force=recorded_force(trace, relay, member.force)
                )
                if relay.slope or relay.start or trace.scenario.clock.jitter:
                    # the recorded force differs a little from that of the relay
                    replays.append(Case(member))
                    continue
            if origin < 0:
                origin = first + i
            tried[i] = TriedMember(member, self._key(trace), origin)
        done = [entry for entry in tried if entry]
        self.tried += done
        if replays:
            return done + self.run(replays)
        return done

    def _scored(self, cases: Sequence[Case], scenarios: Sequence[Scenario]) -> dict[int, Pair]:
        """Return index -> key of the cases that the fast engine runs: those whose trace is not
        needed.
        """
        keys = {}
        for i, case in enumerate(cases):
            needed = case.relay or self.metric.command or not (self.members.forced or self.swing)
            if not needed and self.fast.covers(scenarios[i]):
                keys[i] = FAILED_KEY
        scores = self.fast.scored([scenarios[i] for i in keys], self.report)
        for i, (values, failed) in zip(keys, scores, strict=True):
            if failed is None:
                keys[i] = self._value(values[0]), values[-1]
        return keys

    def _key(self, trace: Trace) -> Pair:
        if trace.failure is not None:
            self.broken = self.broken or trace.broken
            return FAILED_KEY
        groups = by_group(trace)
        value = self._value(self.metric.worst(groups))
        error = CATALOGUE["rms_error"].worst(groups)
        if self.metric.command and not arrived(trace):
            value = math.inf
        return value, error

    def _value(self, value: float) -> float:
        return self.metric.absent if math.isnan(value) else value

    def confirm(self) -> None:
        """Have MuJoCo run those of the worst members that it has not run yet."""
        tried = self.tried
        order = sorted(range(len(tried)), key=lambda i: tried[i].key, reverse=True)
        worst = order[:CONFIRMED]
        again = []
        for i in worst:
            if not tried[i].by_mujoco:
                again.append(i)
        scenarios = [self.members.scenario_of(tried[i].member) for i in again]
        for k, trace in stream(scenarios, self.threads):
            i = again[k]
            tried[i] = tried[i]._replace(key=self._key(trace), by_mujoco=True)

    def _simple(self) -> Iterator[list[Case]]:
        """Yield constant forces and relays, with the constants of the class in the middle of their
        ranges.
        """
        if self.members.forced:
            signals = itertools.product(RELAY_SIGNALS.items(), SIGNS)
            relays = []
            for (kind, signal), sign in signals:
                relays.append(self._relayed(kind, sign, **{signal: 1.0}))
            yield [*(self._forced("constant", force) for force in self._constants()), *relays]

    def _at_loop_frequency(self) -> Iterator[list[Case]]:
        """Yield members for the frequency at which the loop swings, also with constants in the
        middle.
        """
        members = self.members
        if members.forced and self.swing:
            yield [
                *self._weighted_sums(self.swing),
                *self._single_switches(),
                *self._waves(self.swing),
            ]
        if members.times:
            if members.forced:
                base = self.worst.member
            else:
                base = members.bare
            if self.swing is None:
                yield [Case(members.bare.of_kind("no error"))]
            if self.swing:
                errors = measurement_errors(self.swing, members.times, members.hold)
            else:
                errors = ()
            cases = []
            for kind, noise in errors:
                cases.append(Case(dataclasses.replace(base, noise=noise, kind=kind)))
            yield cases

    def _driven(self) -> Iterator[list[Case]]:
        """Yield the worst member so far, with a force along the motion from some time on."""
        if self.members.forced and not self.members.slope:
            worst = self.worst
            end = self.members.samples * self.members.h
            kind = worst.member.kind
            then = "sign of e'"
            if kind != then:
                kind = f"{kind}, then {then}"
            member = worst.member.of_kind(kind)
            relays = []
            for share in SWITCH_TIMES:
                relays.append(Relay(self.members.within.disturbance, rate=1.0, start=share * end))
            cases = [Case(member, relay, worst.origin) for relay in relays]
            yield cases

    def _relayed(self, kind: str, sign: float = 1.0, **weights: float) -> Case:
        relay = Relay(sign * self.members.within.disturbance, **weights, slope=self.members.slope)
        return Case(self.members.bare.of_kind(kind), relay)

    def _forced(self, kind: str, force: Array) -> Case:
        """Return a member with a force, limited to the class."""
        return Case(
            dataclasses.replace(self.members.bare, kind=kind, force=self.members.limited(force))
        )

    def _constants(self) -> list[Array]:
        return [np.full(self.members.samples + 1, sign) for sign in SIGNS]

    def _single_switches(self) -> Iterator[Case]:
        """Yield forces that change their sign once: in the first swing, or when an integral has
        settled.
        """
        samples = self.members.samples
        for share, sign in itertools.product((*SWITCH_TIMES, *EARLY_SWITCH_TIMES), SIGNS):
            yield self._forced(
                "one switch", np.where(np.arange(samples + 1) < share * samples, sign, -sign)
            )

    def _weighted_sums(self, trace: Trace) -> Iterator[Case]:
        """Yield relays of weighted sums of e' and e, or of e' and s, each divided by its size in a
        run.
        """
        sizes = {}
        for name, part in relay_signals(trace).items():
            sizes[name] = float(np.nan_to_num(part).std()) or 1.0
        for lead in PHASE_LEADS:
            weights = {
                "rate": math.cos(lead) / sizes["rate"],
                "error": math.sin(lead) / sizes["error"],
            }
            yield self._relayed("sign of e' and e", **weights)
        yield self._relayed("sign of e' and s", rate=1.0 / sizes["rate"], s=1.0 / sizes["s"])

    def _waves(self, trace: Trace) -> Iterator[Case]:
        """Yield square waves and sines about the frequency at which a loop swings under a relay of
        e'.
        """
        phase = 2.0 * math.pi * loop_frequency(trace) * trace.t
        for pitch in FREQUENCY_RATIOS:
            positive = np.sin(pitch * phase) >= 0.0
            yield self._forced("square wave", np.where(positive, 1.0, -1.0))
        for shift in (0.0, 0.5 * math.pi):
            yield self._forced("sine", np.sin(phase + shift))

    def _corners(self) -> Iterator[list[Case]]:
        """Yield the corners of the constants, spread evenly over all of them if there are more than
        MAX_CORNERS.
        """
        ends = self.members.ends
        if not ends:
            return
        corners = math.prod(map(len, ends))
        count = min(corners, MAX_CORNERS)
        for i in range(count):
            corner = round(i * (corners - 1) / (count - 1))
            places = np.unravel_index(corner, list(map(len, ends)), order="F")
            shares = []
            for choices, place in zip(ends, places, strict=True):
                shares.append(choices[place])
            corner = dataclasses.replace(self.members.bare, shares=np.array(shares), kind="corner")
            if not self.members.forced:
                yield [Case(corner)]
                continue
            steady = []
            for force in self._constants():
                steady.append(dataclasses.replace(corner, force=force))
            relay = Relay(self.members.within.disturbance, rate=1.0, slope=self.members.slope)
            yield [*map(Case, steady), Case(corner, relay)]

    def _changed(self, rng: np.random.Generator) -> Iterator[list[Case]]:
        """Yield changes of the worst members, and evolutions of the worst, in turns."""
        while True:
            for _ in range(GENERATIONS):
                yield self._changes(rng)
            yield from self._evolution(rng)

    def _changes(self, rng: np.random.Generator) -> list[Case]:
        best: dict[int, TriedMember] = {}
        for tried in sorted(self.tried, key=lambda tried: tried.key, reverse=True):
            best.setdefault(tried.origin, tried)
        parents = list(best.values())[: len(CHANGES_PER_PARENT)]
        counts = CHANGES_PER_PARENT[1 : len(parents)]
        cases = []
        for parent, count in zip(parents, (BATCH_MEMBERS - sum(counts), *counts), strict=True):
            for _ in range(count):
                changed = self.members.changed(parent.member, rng)
                cases.append(Case(changed, origin=parent.origin))
        return cases

    def _evolution(self, rng: np.random.Generator) -> Iterator[list[Case]]:
        """Yield the generations of an evolution that begins with the worst member so far."""
        from cmaes import SepCMA

        start = self.worst
        evolution = SepCMA(
            mean=np.zeros(max(2, self.members.size(FORCE_KNOTS))),
            sigma=KNOT_DEVIATION,
            seed=int(rng.integers(2**31)),
            population_size=BATCH_MEMBERS,
        )
        for _ in range(GENERATIONS):
            points = [evolution.ask() for _ in range(BATCH_MEMBERS)]
            before = len(self.tried)
            cases = []
            for z in points:
                cases.append(
                    Case(self.members.moved(start.member, z, FORCE_KNOTS), origin=start.origin)
                )
            yield cases
            keys = []
            for tried in self.tried[before:]:
                keys.append(tried.key)
            order = sorted(range(len(keys)), key=keys.__getitem__, reverse=True)
            ranks = {}
            for rank, i in enumerate(order):
                ranks[i] = float(rank)
            if len(keys) == BATCH_MEMBERS:
                evolution.tell([(point, ranks[i]) for i, point in enumerate(points)])


def relay_signals(trace: Trace) -> dict[str, Array]:
    """Return what a relay sees of channel 0 at the control samples: "s", "rate" and "error",
    (samples + 1,) each.
    """
    r = trace.r[:, 0]
    dr = np.diff(r, prepend=r[:1]) / trace.scenario.control_period
    rate = trace.v[:, 0] - dr
    error = trace.x[:, 0] - r
    return {"s": trace.s[:, 0], "rate": rate, "error": error}


def recorded_force(trace: Trace, relay: Relay, before: Array) -> Array:
    """Return the force of a relay over its bound, (samples + 1,), and `before` until the relay
    starts.
    """
    parts = relay_signals(trace)
    aim = relay.s * parts["s"] + relay.rate * parts["rate"] + relay.error * parts["error"]
    goals = np.where(np.nan_to_num(aim) > 0.0, relay.amplitude, -relay.amplitude)
    if relay.slope:
        force = 0.0
        for i, goal in enumerate(goals.tolist()):
            force += min(max(goal - force, -relay.slope), relay.slope)
            goals[i] = force
    goals /= abs(relay.amplitude)
    if relay.start:
        return np.where(trace.t < relay.start, before, goals)
    return goals


def loop_frequency(trace: Trace) -> float:
    """Return the frequency at which a loop swings under a relay of e', Hz."""
    error = np.nan_to_num(trace.x[:, 0] - trace.r[:, 0])
    late = error[len(trace.t) // 4 :]
    swings = max(1.0, np.count_nonzero(np.diff(late > late.mean())) / 2.0)
    return min(
        swings / (0.75 * float(trace.t[-1])), MAX_FREQUENCY_SHARE / trace.scenario.control_period
    )


def measurement_errors(trace: Trace, times: int, hold: int) -> Iterator[tuple[str, Array]]:
    """Yield errors of position and velocity, (2, times), each for `hold` samples: constant, and as
    a loop swings.
    """
    for signs in itertools.product(SIGNS, repeat=2):
        yield "constant error", np.repeat(np.reshape(signs, (2, 1)), times, axis=1)
    for part in relay_signals(trace).values():
        seen = np.nan_to_num(part[: times * hold : hold])
        signs = np.where(seen > 0.0, 1.0, -1.0)
        for sign in SIGNS:
            yield "error that switches", sign * np.array([signs, signs])
