"""What happens in runs at a time: changes of a plant, blows on bodies and gusts, in words."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from smc_mujoco.draw.wording import short
from smc_mujoco.simulation.signals import Push, Wind
from smc_mujoco.simulation.trace import Trace


class Event(NamedTuple):
    """A change of a plant, for good, a blow or a gust, from `time` to `stop`, s, in words."""

    time: float
    stop: float
    words: str
    kind: str = "change"


def events(traces: Sequence[Trace], names: Sequence[str]) -> list[Event]:
    """Return the changes of plants, the blows on bodies and the gusts, such as "mass × 2", "blow of
    400 N" and "gust of 5 m/s", in the order of their times.

    The labels of the runs precede what only some of them have, where these do not say so.
    """
    who_at: dict[Event, list[str]] = {}
    for trace, name in zip(traces, names, strict=True):
        happened = set()
        if jump := trace.scenario.jump:
            words = trace.scenario.plant.change(jump.factors)
            happened.add(Event(jump.time, math.inf, words))
        if fault := trace.scenario.fault:
            happened.add(Event(fault.at, math.inf, fault.words))
        for push in pushes([trace]):
            force = math.hypot(push.x, push.y, push.z)
            size = short(force)
            end = push.time + push.width
            happened.add(Event(push.time, end, f"blow of {size} N", "blow"))
        for wind in trace.scenario.disturbance:
            if isinstance(wind, Wind) and wind.width:
                speed = short(math.hypot(wind.x, wind.y, wind.z))
                end = wind.time + wind.width
                happened.add(Event(wind.time, end, f"gust of {speed} m/s", "gust"))
        for event in happened:
            who_at.setdefault(event, []).append(name)
    told_events = []
    for event, who in sorted(who_at.items()):
        if len(who) < len(traces) and not all(event.words in name for name in who):
            told_events.append(event._replace(words=f"{', '.join(who)}: {event.words}"))
        else:
            told_events.append(event)
    return told_events


def marks(happened: Sequence[Event]) -> dict[float, str]:
    """Return what happened by its time, s, in words: "mass × 2", "blow of 400 N for 20 ms"."""
    words: dict[float, str] = {}
    for event in happened:
        said = event.words
        if math.isfinite(event.stop):
            said += f" for {1e3 * (event.stop - event.time):.4g} ms"
        words[event.time] = f"{words[event.time]}; {said}" if event.time in words else said
    return words


def pushes(traces: Sequence[Trace]) -> list[Push]:
    """Return the blows on bodies of arms and of users' models, which no d of a trace has."""
    body_pushes = []
    for trace in traces:
        plant = trace.scenario.plant
        if plant.tip or plant.has_user_joints:
            for push in trace.scenario.disturbance:
                if isinstance(push, Push):
                    body_pushes.append(push)
    return body_pushes
