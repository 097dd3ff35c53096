"""Playback speed of a film, from its traces: slow motion where things move fast, and faster where
they rest.

The measure is how far something moves in the time of a frame, as a share of its range over the
whole run. Every machine should take 1/MAX_TRAVEL frames or more to cross its range, so the speed is
1, 1/2, 1/4 or 1/8. Around impacts, and around pushes on an arm, it is 1/8. Where nothing has moved
for a while, it is REST_SPEED. If a film would be too long, slow motion is reduced step by step,
around pushes last. The same traces give the same film.
"""

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np

from smc_mujoco.common.constraints import Number, constrained
from smc_mujoco.draw import states, style
from smc_mujoco.draw.decimate import end, finite
from smc_mujoco.simulation.trace import Trace

MAX_TRAVEL = 0.02  # of its range: how far a thing moves in a frame, if the speeds suffice; chosen
MAX_HALVINGS = 3  # of the speed
REST_TRAVEL = (
    5e-4  # of its range: a thing that moves less in a frame is at rest; chosen: a pixel in 3 frames
)
REST_SPEED = 4.0  # times real time
MOTION_MARGIN = 0.1  # s before and after fast motion that are shown as slowly as it
IMPACT_TIME = 0.04  # s around the start of a contact, and around the middle of a push
REST_MARGIN = 0.3  # s after motion, and before it, that are not shown faster
MAX_LENGTH = (
    1.85,
    8.0,
)  # duration of a film: in durations of the run, or in s if that is more; chosen
Rate = Annotated[float, Number(low=1.0, high=120.0)]  # frames per second
Speed = Annotated[float, Number(low=0.01, high=100.0)]  # times real time


class Clock(NamedTuple):
    """Times of a film's frames."""

    times: np.ndarray  # of the run, (frames,) s, ascending
    speeds: np.ndarray  # of playback, (frames,), 1 for real time
    begin: float = (
        0.0  # when the first is shown, s of the film: a part of a film is drawn as in the whole
    )

    @property
    def shown(self) -> np.ndarray:
        """When each frame is shown, (frames,) s of the film."""
        return self.begin + np.append(0.0, np.cumsum(np.diff(self.times) / self.speeds[:-1]))

    def part(self, start: float, stop: float) -> "Clock":
        """Return the frames from `start` to `stop` of the run, s."""
        inside = (self.times >= start - 1e-9) & (self.times <= stop + 1e-9)
        return Clock(self.times[inside], self.speeds[inside])


@constrained
def clock(traces: Trace | Sequence[Trace], fps: Rate, speed: Speed | None = None) -> Clock:
    """Return the times of a film's frames from t = 0 to the end of the longest trace; `speed` None:
    the rule above.
    """
    traces = style.same_plant(traces)
    whole = end(traces)
    if speed is not None:
        times = np.arange(int(whole * fps / speed + 1e-6) + 1) * (speed / fps)
        return Clock(times, np.full(len(times), speed))
    grid, wanted = speeds(traces, fps)
    times = [0.0]
    while times[-1] < whole - 1e-9:
        now = wanted[np.searchsorted(grid, times[-1] + 1e-9, side="right") - 1]
        times.append(min(times[-1] + now / fps, whole))
    frames = np.array(times)
    return Clock(frames, wanted[np.searchsorted(grid, frames + 1e-9, side="right") - 1])


def speeds(traces: Sequence[Trace], fps: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the playback speed from each time on: times in s, (m,), the first is 0, and speeds,
    (m,).
    """
    from scipy.ndimage import maximum_filter1d

    whole = end(traces)
    grid = np.arange(max(1, round(whole * fps))) / fps
    runs = list(map(finite, traces))
    travel = travel_of(runs, np.append(grid, whole))
    powers = np.ceil(np.log2(np.maximum(travel / MAX_TRAVEL, 1.0)) - 1e-9)
    powers = np.asarray(
        maximum_filter1d(powers, 2 * round(MOTION_MARGIN * fps) + 1, mode="nearest")
    )
    for start in impacts(runs):
        powers[np.abs(grid + 0.5 / fps - start) <= IMPACT_TIME] = MAX_HALVINGS
    pushed = np.zeros(len(grid), bool)
    for push in style.pushes(runs):
        pushed |= np.abs(grid + 0.5 / fps - push.time - 0.5 * push.width) <= IMPACT_TIME
    moved = (travel > REST_TRAVEL) | pushed
    moving = np.asarray(
        maximum_filter1d(moved, 2 * round(REST_MARGIN * fps) + 1, mode="nearest"), bool
    )
    longest = max(MAX_LENGTH[0] * whole, MAX_LENGTH[1])
    playback = np.ones(len(grid))
    for saved in range(2 * MAX_HALVINGS + 1):  # first around other motion, then around pushes
        slowest = max(0, MAX_HALVINGS - saved)
        around_pushes = min(MAX_HALVINGS, 2 * MAX_HALVINGS - saved)
        playback = np.where(moving | (powers > 0.0), 0.5 ** np.minimum(powers, slowest), REST_SPEED)
        playback[pushed] = 0.5**around_pushes
        if (1.0 / playback).sum() / fps <= longest:
            break
    return grid, playback


def travel_of(runs: Sequence[Trace], edges: np.ndarray) -> np.ndarray:
    """Return how far the machines move between times, (edges - 1,): the largest share of a
    channel's range.
    """
    lasting = [trace for trace in runs if trace.diverged_at is None] or runs
    places = np.concatenate([trace.x for trace in lasting])
    low = places.min(axis=0)
    high = places.max(axis=0)
    size = np.where(high > low, high - low, np.inf)
    travel = np.zeros(len(edges) - 1)
    for trace in runs:
        x = np.clip(trace.x, low, high)  # what has left the world does not count
        seen = np.stack([np.interp(edges, trace.t, channel) for channel in x.T], axis=1)
        travel = np.maximum(travel, (np.abs(np.diff(seen, axis=0)) / size).max(axis=1))
    return travel


def impacts(runs: Sequence[Trace]) -> list[float]:
    """Return when contacts begin after a while without contact, s."""
    starts = []
    for trace in runs:
        touch = states.extended(
            np.asarray(states.in_contact(trace).any(axis=1)), trace.t, states.MIN_STATE_TIME
        )
        starts += trace.t[np.flatnonzero(np.diff(touch.astype(int), prepend=1) > 0)].tolist()
    return starts
