"""The search for the worst member of a class around a scenario.

A search tries the same in the same order, whatever its budget:

1. constant forces, and relays that switch with the sign of s, of e and of e': an adversary who sees the loop;
2. the corners of the constants of the class, at most 16, each with both constant forces and a relay of e';
3. relays of weighted sums of these, forces that switch once, and waves about the frequency at which the loop swings;
4. the worst member so far, with a force along the motion from some time on: such a force drives a fallen pendulum;
5. in turns, two ways to change the worst members. The first reverses a piece of a force, shifts a switch or moves
   constants, in members of different origin. The second is an evolution of the worst member by separable CMA-ES (R. Ros
   & N. Hansen, PPSN X, 2008; package cmaes), which adds straight lines between knots to its force and cuts the sum off
   at the bound.

A larger budget only continues a search, so it is never less bad. A search also ends when a run fails, because nothing
is worse. The force of a relay is recorded and replayed, so every member is an ordinary scenario.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.analysis.worst_case import strategies
from smc_mujoco.analysis.worst_case.uncertainty import Member, Members
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.metrics.conventions import Metric, by_group
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.signals import Relay
from smc_mujoco.simulation.trace import Trace

BATCH_MEMBERS = 16  # run at once; chosen
CHANGES_PER_PARENT = (7, 4, 3, 2)  # in a batch: of the worst member, then of the worst of each other origin; chosen
MAX_CORNERS = 16
FORCE_KNOTS = 32  # in an evolution; chosen
KNOT_DEVIATION = 0.5  # first standard deviation of a knot, over the bound; chosen
GENERATIONS = 4  # of an evolution, before the next one begins with the worst member so far; chosen
FAILED_KEY = math.inf, math.inf


class Case(NamedTuple):
    """A member to run.

    Attributes:
      relay: makes its force; None if the member has its force.
      origin: number of the member from which changes led to this one; -1 for a new one.
    """

    member: Member
    relay: Relay | None = None
    origin: int = -1


class Tried(NamedTuple):
    """A member that was run.

    Attributes:
      key: its metric, then its rms error, which decides between equal metrics.
      origin: as in `Case`; a new member is its own origin.
    """

    member: Member
    key: tuple[float, float]
    origin: int


class Search:
    """A search among the members of a class.

    Attributes:
      tried: every member that was run, in order.
      runs: number of runs so far.
      swing: the first run under a relay of e', or without a force, from which the loop's frequency is read.
    """

    def __init__(
        self, members: Members, metric: Metric, budget: int, threads: int | None, report: Callable[[int], None]
    ):
        self.members, self.metric, self.budget, self.threads, self.report = members, metric, budget, threads, report
        self.tried: list[Tried] = []
        self.runs = 0
        self.swing: Trace | None = None

    @property
    def worst(self) -> Tried:
        """The worst member so far, the first of several."""
        return max(self.tried, key=lambda one: one.key)

    def draw(self, rng: np.random.Generator) -> None:
        """Run random members only, a whole budget of them."""
        for left in range(self.budget, 0, -BATCH_MEMBERS):
            self.run([Case(self.members.random(rng)) for _ in range(min(left, BATCH_MEMBERS))])

    def search(self, rng: np.random.Generator, known: Sequence[Tried]) -> None:
        """Try the strategies of the module, beginning with members that were run before."""
        self.tried += [one._replace(origin=-1 - i) for i, one in enumerate(known)]
        batches = self._simple(), self._corners(), self._at_loop_frequency(), self._driven(), self._changed(rng)
        for batch in itertools.chain(*batches):
            self.run(batch)
            if self.runs >= self.budget or self.worst.key == FAILED_KEY:
                return

    def run(self, cases: Sequence[Case]) -> list[Tried]:
        """Run cases, as many as the budget allows, and return them as tried."""
        cases = list(cases[: self.budget - self.runs])
        first, replays = self.runs, []
        self.runs += len(cases)
        tried: list[Tried | None] = [None] * len(cases)
        scenarios = [self.members.scenario_of(case.member, case.relay) for case in cases]
        for i, trace in stream(scenarios, self.threads, self.report):
            member, relay, origin = cases[i]
            if self.swing is None and (relay.rate > 0.0 if relay else not self.members.forced):
                self.swing = trace
            if relay:
                member = dataclasses.replace(member, force=strategies.recorded_force(trace, relay, member.force))
            tried[i] = Tried(member, self._key(trace), first + i if origin < 0 else origin)
            exact = relay is None or not (relay.slope or relay.start or trace.scenario.clock.jitter)
            if not exact:  # the recorded force differs a little from that of the relay
                replays.append(Case(member))
                tried[i] = None
        done = [one for one in tried if one]
        self.tried += done
        return done + (self.run(replays) if replays else [])

    def _key(self, trace: Trace) -> tuple[float, float]:
        if trace.failure is not None:
            return FAILED_KEY
        groups = by_group(trace)
        value, error = self.metric.worst(groups), CATALOGUE["rms_error"].worst(groups)
        return (self.metric.absent if math.isnan(value) else value), error

    def _simple(self) -> Iterator[list[Case]]:
        """Yield constant forces and relays, with the constants of the class in the middle of their ranges."""
        if self.members.forced:
            steady = [self._forced(*one) for one in strategies.constants(self.members.samples)]
            relays = strategies.relays(self.members.within.disturbance, self.members.slope)
            yield [*steady, *(Case(self.members.bare.named(kind), relay) for kind, relay in relays)]

    def _at_loop_frequency(self) -> Iterator[list[Case]]:
        """Yield what suits the frequency at which the loop swings, with the constants in the middle as well."""
        within, slope, bare = self.members.within, self.members.slope, self.members.bare
        if self.members.forced and self.swing:
            relays = [*strategies.weighted_sums(self.swing, within.disturbance, slope)]
            forces = [*strategies.single_switches(self.members.samples), *strategies.waves(self.swing)]
            yield [*(Case(bare.named(kind), relay) for kind, relay in relays), *(self._forced(*one) for one in forces)]
        if self.members.times:
            base = bare if not self.members.forced else self.worst.member
            if self.swing is None:
                yield [Case(bare.named("no error"))]
            times, hold = self.members.times, self.members.hold
            errors = strategies.measurement_errors(self.swing, times, hold) if self.swing else ()
            yield [Case(dataclasses.replace(base, noise=noise, kind=kind)) for kind, noise in errors]

    def _driven(self) -> Iterator[list[Case]]:
        """Yield the worst member so far, with a force along the motion from some time on."""
        if self.members.forced and not self.members.slope:
            worst, end = self.worst, self.members.samples * self.members.h
            kind, then = worst.member.kind, "sign of e'"
            member = worst.member.named(kind if kind == then else f"{kind}, then {then}")
            starts = [share * end for share in strategies.SWITCH_TIMES]
            relays = [Relay(self.members.within.disturbance, rate=1.0, start=start) for start in starts]
            yield [Case(member, relay, worst.origin) for relay in relays]

    def _forced(self, kind: str, force: np.ndarray) -> Case:
        """Return a member with a force, limited to the class."""
        bare = self.members.bare.named(kind)
        return Case(dataclasses.replace(bare, force=self.members.limited(force)))

    def _corners(self) -> Iterator[list[Case]]:
        """Yield the corners of the constants, spread evenly over all of them if there are more than MAX_CORNERS."""
        ends = self.members.ends
        if not ends:
            return
        corners = math.prod(map(len, ends))
        count = min(corners, MAX_CORNERS)
        for i in range(count):
            places = np.unravel_index(round(i * (corners - 1) / (count - 1)), [*map(len, ends)], order="F")
            shares = np.array([choices[place] for choices, place in zip(ends, places, strict=True)])
            corner = dataclasses.replace(self.members.bare, shares=shares, kind="corner")
            if not self.members.forced:
                yield [Case(corner)]
                continue
            steady = [dataclasses.replace(corner, force=f) for _, f in strategies.constants(self.members.samples)]
            relay = Relay(self.members.within.disturbance, rate=1.0, slope=self.members.slope)
            yield [*map(Case, steady), Case(corner, relay)]

    def _changed(self, rng: np.random.Generator) -> Iterator[list[Case]]:
        """Yield changes of the worst members, and evolutions of the worst, in turns."""
        while True:
            for _ in range(GENERATIONS):
                yield self._changes(rng)
            yield from self._evolution(rng)

    def _changes(self, rng: np.random.Generator) -> list[Case]:
        """Return changes of the worst members, one for each origin."""
        best: dict[int, Tried] = {}
        for one in sorted(self.tried, key=lambda one: one.key, reverse=True):
            best.setdefault(one.origin, one)
        parents = list(best.values())[: len(CHANGES_PER_PARENT)]
        counts = [*CHANGES_PER_PARENT[1 : len(parents)]]
        counts = [BATCH_MEMBERS - sum(counts), *counts]
        return [
            Case(self.members.changed(parent.member, rng), origin=parent.origin)
            for parent, count in zip(parents, counts, strict=True)
            for _ in range(count)
        ]

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
            yield [Case(self.members.moved(start.member, z, FORCE_KNOTS), origin=start.origin) for z in points]
            keys = [one.key for one in self.tried[before:]]
            order = sorted(range(len(keys)), key=keys.__getitem__, reverse=True)
            ranks = {i: float(rank) for rank, i in enumerate(order)}
            if len(keys) == BATCH_MEMBERS:
                evolution.tell([(points[i], ranks[i]) for i in range(BATCH_MEMBERS)])
