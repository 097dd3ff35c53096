"""States of a machine over time: whether it sticks, hits or touches something, and where it lies in
its backlash.

A state is shown for MIN_STATE_TIME of the film at least, whatever its speed: rest is shown only if
it lasts so long. A hit of 5 ms stays for HOLD_TIME, as a blow does, and then fades.
`metrics.conventions.at_rest` defines rest, and `metrics.touching` contact. The flank of a backlash
is the sign of the joint's reaction. Friction and contacts are in the reaction too: with them the
flank is the sign of the actuator's force, which does not tell when a rotor is in play.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.text import joined
from smc_mujoco.draw import shared_axes, style, wording
from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.contact import RUB
from smc_mujoco.mechanisms.layout import channel_names, dof_ids
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics import conventions
from smc_mujoco.metrics.touching import in_contact, shapes
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Impulse
from smc_mujoco.simulation.trace import Trace

MIN_STATE_TIME = 0.15  # s of a film, chosen: nine frames at 60 fps, long enough to read a word
HOLD_TIME = 0.6  # s of a film, from the start of a hit or blow: its words and arrow; chosen
HIT_TIME = 0.1  # s of the run: what lasts longer is no hit or blow; chosen
SIDES = {-1: "left flank", 0: "in play", 1: "right flank", 2: "rattles"}


class State(NamedTuple):
    """The state of a machine in words, with their colour and their opacity, 0 .. 1, and the time of
    the force that they have, s.
    """

    words: str
    colour: str
    opacity: float = 1.0
    peak: float | None = None


def timeline(
    trace: Trace, times: Array, played: Callable[[Array], Array] | None = None
) -> list[State | None]:
    """Return the state at each time, s; None where there is nothing to say.

    `played` gives the time of the film, s, at times of the run, s; by default they are the same.
    """
    if trace.scenario.plant.tip:  # its forces have their numbers
        return [ended(trace, time) for time in times.tolist()]
    film_times = played(trace.t) if played else trace.t
    ticks = MIN_STATE_TIME * np.floor(film_times / MIN_STATE_TIME + 1e-9)
    read = np.searchsorted(film_times, ticks - 1e-9)  # numbers that change are held as long, too
    gap = backlash_gap(trace.scenario)
    hits = contacts(trace, film_times)
    blown = blows(trace, film_times)
    rest = resting(trace, film_times)
    sides_of_flanks = []
    for flank in flanks(trace).T:
        sides_of_flanks.append(backlash_side(flank, film_times, MIN_STATE_TIME))
    sides = np.array(sides_of_flanks)
    plant = trace.scenario.plant
    names = () if plant.network and not plant.direct else channel_names(plant)
    states: list[State | None] = []
    for time in times.tolist():
        place = np.searchsorted(trace.t, time + 1e-9)
        k = int(place) - 1
        sticks = rest[:, k]
        words = []
        if sticks.any():
            words.append(stick_words(sticks, names))
        if gap:
            words.append(backlash_words(sides[:, k]))
        if end := ended(trace, time):
            states.append(end)
        elif hits[k]:
            states.append(hits[k])
        elif blown[k]:
            states.append(blown[k])
        elif said := off_place(trace, int(read[k])):
            states.append(said)
        elif words:
            colour = style.INK if sticks.any() else style.MUTED
            states.append(State(", ".join(words), colour))
        else:
            states.append(None)
    return states


def off_place(trace: Trace, k: int) -> State | None:
    """Return how far a free body, or a robot with a measured base, is off its place at a sample:
    what a camera that follows it hides. None of other machines.
    """
    place = place_channels(trace.scenario.plant)
    away = 1e3 * float(np.linalg.norm(trace.x[k, place] - trace.r[k, place]))
    if not away >= 1.0:
        return None
    if away >= 1e3:  # fewer letters, in a narrow tile
        return State(f"{wording.short(1e-3 * away)} m off", style.INK)
    return State(f"{wording.short(away)} mm off", style.INK)


def place_channels(plant: Plant) -> slice:
    """Return the channels of the place of a free body, or of a robot with a measured base; none of
    other machines.
    """
    first = 0 if plant.pose else plant.base
    return slice(first, first + 3) if first >= 0 else slice(0)


def ended(trace: Trace, time: float) -> State | None:
    """Return how a run has failed by a time, s; None if it has not."""
    if trace.diverged_at is None or time < trace.diverged_at:
        return None
    return State(wording.ending(trace), style.MUTED)


def contacts(trace: Trace, shown: Array) -> list[State | None]:
    """Return what is said of contact at each sample, whose times in the film are `shown`, s: "hit,
    280 N·m", with the largest force of the hit on a joint; then "contact" of one that lasts, and of
    one from the start of the run on.
    """
    touch = in_contact(trace)
    touched: Array = np.asarray(touch.any(axis=1))
    acts = touch | (touched[:, None] & (np.nan_to_num(trace.reaction) != 0.0))
    words = "hit", "contact"
    return told(trace, shown, acts, trace.reaction, words, style.REACTION)


def blows(trace: Trace, shown: Array) -> list[State | None]:
    """Return what is said of impulses at each sample, as `contacts` does: "blow, 200 N·m"."""
    return told(trace, shown, struck(trace), trace.d, ("blow", ""), style.DISTURBANCE)


def struck(trace: Trace) -> Array:
    """Return where an impulse acts on each channel, (K + 1, n)."""
    is_struck = np.zeros(trace.d.shape, bool)
    for signal in trace.scenario.disturbance:
        if isinstance(signal, Impulse):
            during = (trace.t >= signal.time - 1e-9) & (trace.t < signal.time + signal.width)
            is_struck |= during[:, None] & (np.nan_to_num(trace.d) != 0.0)
    return is_struck


def told(
    trace: Trace, shown: Array, acts: Array, forces: Array, words: tuple[str, str], colour: str
) -> list[State | None]:
    """Return what is said at each sample, whose times in the film are `shown`, s, of forces,
    (K + 1, n), while they act on channels, (K + 1, n): the first of two words with the largest
    force, and the second, or nothing if that is "", where they last for more than HIT_TIME. Words
    fade at the end, and those of the largest force are told before others.
    """
    on: Array = np.asarray(acts.any(axis=1))
    said: list[State | None] = [None] * len(on)
    held = extended(on, shown, MIN_STATE_TIME)
    changes = np.diff(held.astype(int), prepend=0, append=0)
    edges = np.flatnonzero(changes)
    spells = []
    for first, stop in edges.reshape(-1, 2).tolist():
        last = first + int(np.flatnonzero(on[first:stop])[-1])
        lasts = bool(trace.t[last] - trace.t[first] > HIT_TIME)
        if lasts and not words[1]:
            continue
        ends = max(
            int(np.searchsorted(trace.t, trace.t[first] + HIT_TIME, side="right")),
            int(np.searchsorted(shown, shown[first] + MIN_STATE_TIME)),
        )
        begun = max(ends, int(np.searchsorted(shown, shown[first] + HOLD_TIME)))
        if lasts and first == 0:
            begun = 0
        elif begun > last:
            begun = len(on)
        hit = slice(first, min(ends, stop))
        peak = largest(trace, acts[hit], forces[hit]) if begun else Peak(0.0, 0, "")
        peak = peak._replace(sample=first + peak.sample)
        until = float(max(shown[last], shown[first] + HOLD_TIME * (begun > 0)))
        spells.append((peak, first, begun, until))
    for peak, first, begun, until in sorted(spells):
        for k in range(first, int(np.searchsorted(shown, until + MIN_STATE_TIME))):
            fade = 1.0 - (shown[k] - until) / MIN_STATE_TIME
            opacity = min(1.0, max(0.0, float(fade)))
            if k < begun:
                now = f"{words[0]}, {peak.words}"
                said[k] = State(now, colour, opacity, float(trace.t[peak.sample]))
            else:
                said[k] = State(words[1], colour, opacity)
    return said


class Peak(NamedTuple):
    """The largest of forces, N or N m: its size, its sample, and its words with the unit."""

    size: float
    sample: int
    words: str


def largest(trace: Trace, acts: Array, forces: Array) -> Peak:
    """Return the largest of forces at some samples, (m, n), of the channels on which they act."""
    sizes = np.where(acts, np.abs(np.nan_to_num(forces)), 0.0)
    sample, channel = np.unravel_index(sizes.argmax(), sizes.shape)
    size = float(sizes.max())
    for group in conventions.groups(trace.scenario):
        if channel in group.channels:
            unit = shared_axes.units(group)["force"]
            return Peak(size, int(sample), f"{wording.short(size)} {unit}")
    raise AssertionError


def resting(trace: Trace, shown: Array) -> Array:
    """Return where dry friction holds each channel, (n, K + 1), where the same ones are held long
    enough to be read; the times of samples in the film are `shown`, s.
    """
    moving = ~at_rest(trace)
    moving[0] = True  # else a brief rest at the start would be shown
    held = []
    for moves, rubs in zip(moving.T, has_dry_friction(trace.scenario), strict=True):
        held.append(rubs & ~extended(moves, shown, MIN_STATE_TIME))
    rest = np.array(held)
    changes = np.diff(rest, axis=1).any(axis=0)
    edges = [0, *(np.flatnonzero(changes) + 1).tolist(), len(shown)]
    for first, stop in itertools.pairwise(edges):
        if shown[stop - 1] - shown[first] < MIN_STATE_TIME - 1e-9:
            rest[:, first:stop] = False
    return rest


def at_rest(trace: Trace) -> Array:
    """Return where each channel is at rest, in proportion to the speeds of its group, (K + 1,
    n).
    """
    rest = np.empty(trace.x.shape, bool)
    for group, part in conventions.by_group(trace).items():
        rest[:, group.channels] = conventions.at_rest(part)
    return rest


def has_dry_friction(scenario: Scenario) -> Array:
    """Return which channels dry friction can hold, in the joint or under the body, (n,)."""
    plant = scenario.plant
    model = shapes(scenario, scenery=False)[0].model
    rubs = model.dof_frictionloss[dof_ids(model)] > 0.0
    for part in scenario.friction:
        if part.side == "link" and part.keeps_state:
            rubs[list(part.channels(plant))] = True
    for i in range(model.npair):  # of machines of one channel
        rubs |= model.pair(i).name.startswith(RUB) and model.pair_friction[i, 0] > 0.0
    return rubs


def backlash_gap(scenario: Scenario) -> float:
    """Return the gap of the scenario's backlash in rad or m, 0 without one."""
    for part in scenario.actuator:
        if isinstance(part, Backlash):
            return part.gap
    return 0.0


def flanks(trace: Trace) -> Array:
    """Return the side from which each rotor pushes its joint, -1, 0 or 1, (K + 1, n): 1 pushes
    towards larger x.
    """
    alone = not (trace.scenario.friction or trace.scenario.contact)
    force = trace.holding if alone else trace.force
    return np.sign(np.nan_to_num(force))


def extended(on: Array, t: Array, hold: float) -> Array:
    """Return the signal (K + 1,), extended by `hold` s each time it is on, without gaps shorter
    than that.
    """
    times = np.where(on, t, -np.inf)
    last = np.maximum.accumulate(times)
    on = t - last < hold - 1e-9
    changes = np.diff(on.astype(int), prepend=0)
    edges = np.flatnonzero(changes)  # on, off, on, ...
    for off, again in zip(edges[1::2], edges[2::2], strict=False):
        on[off:again] |= t[again] - t[off] < hold
    return on


def backlash_side(flank: Array, t: Array, hold: float) -> Array:
    """Return the key of SIDES at each sample, (K + 1,): flank -1 or 1, 0 in play, 2 if it crosses
    too often to show.
    """
    touched = np.flatnonzero(flank)
    changes = np.diff(flank[touched])
    crossed = touched[1:][changes != 0]
    rattles = np.zeros(len(t), bool)
    soon = np.diff(t[crossed]) < hold
    rattles[crossed[1:][soon]] = True
    samples = np.arange(len(t))
    places = np.where(flank != 0, samples, 0)
    latest = np.maximum.accumulate(places)
    touching = extended(flank != 0, t, hold)
    sides = np.where(touching, flank[latest], 0.0)
    shaken = extended(rattles, t, hold)
    return np.where(shaken, 2, sides).astype(int)


def stick_words(sticks: Array, names: Sequence[str] = ()) -> str:
    """Return words for channels (n,) of which some stick; joints of a robot have names."""
    if sticks.all():
        return "sticks"
    if names:
        who = []
        for name, stuck in zip(names, sticks, strict=True):
            if stuck:
                who.append(name)
        return f"{joined(who)} {'sticks' if len(who) == 1 else 'stick'}"
    return f"{sticks.sum()} of {len(sticks)} stick"


def backlash_words(sides: Sequence[int] | Array) -> str:
    """Return words for channels in their backlash."""
    if len(set(sides)) == 1:
        return SIDES[int(sides[0])]
    return f"{list(sides).count(0)} of {len(sides)} in play"
