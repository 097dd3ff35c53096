"""Which two quantities the charts below a film show."""

import operator
from collections.abc import Sequence

import numpy as np

from smc_mujoco.draw import shared_axes, states
from smc_mujoco.draw.panels import (
    HEIGHT,
    SINGLE,
    Panel,
    agreed,
    by_channel,
    over_groups,
    worst_first,
)
from smc_mujoco.draw.quantities import PEAKS, lasting
from smc_mujoco.metrics.conventions import scale, settling_band
from smc_mujoco.metrics.touching import in_contact
from smc_mujoco.simulation.trace import Trace

LINEAR = {"settling": "distance", "tip": "tip distance"}  # of PEAKS -> the same on a linear axis
# of the largest to the smallest end of curves, or of a single one's peak to its end: a logarithmic
# axis is for larger ones; chosen
MIN_SPREAD = 3.0


def strip(traces: Sequence[Trace]) -> list[Panel]:
    """Return the two panels below a film: the first two of its `candidates`, those in which
    all runs agree only if there are no others.
    """
    ranked = []
    for place, candidate in enumerate(candidates(traces)):
        linear = candidate.quantity in PEAKS and not needs_decades(candidate)
        panel = candidate._replace(quantity=LINEAR[candidate.quantity]) if linear else candidate
        ranked.append((all_agree(panel), place, panel))
    best = sorted(ranked, key=operator.itemgetter(0, 1))[:2]
    return [panel for *_, panel in sorted(best, key=operator.itemgetter(1))]


def candidates(traces: Sequence[Trace]) -> list[Panel]:
    """Return the panels that a film may have: the motion of the groups of channels, then their u,
    then |x - r|; of arms first the tip's, with the force of its contact or the largest u.

    The motion is x; of several channels it is the largest error, and x of the joint that is off
    farthest of those that are hit.
    """
    plant = traces[0].scenario.plant
    first = over_groups(traces, "tip")
    if first:
        load = first[0]._replace(quantity="load")
        first += [*over_groups(traces, "contact"), load]
    motions = []
    controls = []
    errors = []
    for group_traces in shared_axes.split(traces).items():
        place = Panel("x", *group_traces)
        error = place._replace(quantity="settling")
        many = len(place.group.channels) > 1
        if place.group.driven:
            control = place._replace(quantity="largest" if many and plant.direct else "u")
            controls += (
                [control] if place.group.effort else by_channel(place._replace(quantity="u"))
            )
        if many and plant.direct and plant.n == plant.driven == 2:
            motions += by_channel(place)
        elif many or first:
            motions += [error] if place.group.driven else []
        else:
            motions.append(place)
            errors += [error] if place.group.driven else []
    if plant.pose:
        motions = flown(motions)
    elif plant.direct and not first and motions[0].quantity == "settling":
        hit = hit_channels(traces)
        joints = worst_first(traces)
        motions[1:1] = [joint._replace(quantity="x") for joint in joints if joint.channel in hit][
            :1
        ]
    return [*first, *motions, *controls, *errors]


def flown(motions: Sequence[Panel]) -> list[Panel]:
    """Return the panels of a free body's motion, given those of the errors of its place and its
    attitude.

    One whose reference goes somewhere, or whose attitude stays in its settling band, has a map of
    the paths in place of the error of its attitude. One whose reference stays has its height in
    place of the error of its place, if that is off farthest upwards or downwards.
    """
    place, turn = motions
    moving = any(np.ptp(run.r, axis=0).any() for run in place.traces)
    if moving or all(map(stays_settled, turn.traces)):
        turn = place._replace(quantity="path")
    off = [np.abs(run.x - run.r).max(axis=0) for run in place.traces]
    if not moving and int(np.max(off, axis=0).argmax()) == HEIGHT:
        place = by_channel(place._replace(quantity="x"))[HEIGHT]
    return [place, turn]


def stays_settled(trace: Trace) -> bool:
    """Return whether no channel of a trace ever leaves its settling band."""
    band = settling_band(trace.scenario, scale(trace))
    return bool((np.abs(trace.x - trace.r) <= band).all())


def hit_channels(traces: Sequence[Trace]) -> set[int]:
    """Return the channels that impulses hit, or whose reactions are largest during contact."""
    channels: set[int] = set()
    for trace in traces:
        touch = in_contact(trace).any(axis=1)
        sizes = np.abs(np.nan_to_num(trace.reaction))
        during = sizes[touch].max(axis=0, initial=0.0)
        apart = sizes[~touch].max(axis=0, initial=0.0)
        acts = (during > apart) | states.struck(trace).any(axis=0)
        channels.update(np.flatnonzero(acts).tolist())
    return channels


def all_agree(panel: Panel) -> bool:
    """Return whether all runs of a panel agree at all times."""
    if panel.quantity == "path" or (panel.quantity not in SINGLE and len(panel.group.channels) > 1):
        return False
    everyone = len(panel.traces)
    return any(len(who) == everyone and stop == np.inf for who, stop in agreed(panel))


def needs_decades(panel: Panel) -> bool:
    """Return whether the runs of a panel of PEAKS end far apart; a single one, far below its
    peak.
    """
    curves = lasting(panel.traces, panel.quantity)
    ends = [float(y[-1, 0]) for y in curves]
    if len(ends) == 1:
        ends.append(float(curves[0].max()))
    return bool(ends) and max(ends) > MIN_SPREAD * min(ends)
