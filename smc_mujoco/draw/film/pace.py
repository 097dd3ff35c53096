"""Playback speed of a film, from its traces: slow motion where things move fast, and faster where
they rest.

The measure is how far something moves in the time of a frame, as a share of its range over the
whole run. Every machine should take 1/MAX_TRAVEL frames or more to cross its range, so the speed is
1, 1/2, 1/4 or 1/8. Around impacts, and around pushes on an arm, it is 1/8. Where nothing has moved
for a while, it is REST_SPEED. If a film would be too long, slow motion is reduced step by step,
around pushes last. Where nothing moves that can be seen, the last three periods follow in a
close-up. The same traces give the same film.
"""

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np

from smc_mujoco.analysis.paired_runs import floor
from smc_mujoco.common.aliases import Array
from smc_mujoco.common.constraints import Number, constrained
from smc_mujoco.draw import shared_axes, states, timed_events
from smc_mujoco.draw.decimate import end, finite
from smc_mujoco.metrics.catalogue import chattering_amplitude, chattering_frequency
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

MAX_TRAVEL = 0.02  # of its range: how far a thing moves in a frame, if the speeds suffice; chosen
MAX_HALVINGS = 3  # of the speed
REST_TRAVEL = 5e-4  # of its range in a frame, a pixel in 3: what moves less is at rest; chosen
REST_SPEED = 4.0  # times real time
MOTION_MARGIN = 0.1  # s before and after fast motion that are shown as slowly as it
IMPACT_TIME = 0.04  # s around the start of a contact, and around the middle of a push
REST_MARGIN = 0.3  # s after motion, and before it, that are not shown faster
PERIODS = 3  # that a close-up shows at the end
CLOSE_TIME = 4.0  # s of the film for a close-up, at most; chosen, as what follows
MIN_FACTOR = 10.0  # of its deflections; smaller ones are seen without it
SEEN_TURN = 0.25  # rad: a turn of a hinge that is seen well
SEEN_SLIDE = 0.08  # extents of its machine: the same of a slide
STILL = 1 / 30  # s of the film, in a still
LITTLE = 0.2  # of these: a film of less motion shows nothing moving
MAX_LENGTH = (1.85, 8.0)  # of a film: in durations of the run, or in s if that is more; chosen
Rate = Annotated[float, Number(low=1.0, high=120.0)]  # frames per second
Speed = Annotated[float, Number(low=0.01, high=100.0)]  # times real time


class FilmClock(NamedTuple):
    """Times of a film's frames.

    After them a film may show a part again, `close`, in which deflections about the mean are drawn
    `factor` times as large.
    """

    times: Array  # of the run, (frames,) s, ascending
    speeds: Array  # of playback, (frames,), 1 for real time
    close: "FilmClock | None" = None
    factor: float = 1.0

    @property
    def edges(self) -> Array:
        """The start of the first frame and the ends of all, (frames + 1,) s of the run."""
        step = STILL * self.speeds[0] if len(self.times) < 2 else self.times[1] - self.times[0]
        return np.append(self.times[0] - step, self.times)

    def played(self, t: Array) -> Array:
        """Return when the film shows times t of the run, s: before its start and after its end at
        the speeds that it has there.
        """
        passed = np.diff(self.times) / self.speeds[1:]
        film_times = np.append(0.0, np.cumsum(passed))
        before = np.minimum(t - self.times[0], 0.0) / self.speeds[0]
        after = np.maximum(t - self.times[-1], 0.0) / self.speeds[-1]
        return np.interp(t, self.times, film_times) + before + after

    def still(self, time: float) -> "FilmClock":
        """Return the clock of the picture at a time of the run, s: what a film holds for a while,
        it shows as the film would.
        """
        now = min(int(np.searchsorted(self.times, time - 1e-9)), len(self.times) - 1)
        return FilmClock(np.array([time]), self.speeds[[now]])

    def part(self, start: float, stop: float) -> "FilmClock":
        """Return the frames from `start` to `stop` of the run, s."""
        inside = (self.times >= start - 1e-9) & (self.times <= stop + 1e-9)
        return FilmClock(self.times[inside], self.speeds[inside])


@constrained
def clock(traces: Trace | Sequence[Trace], fps: Rate, speed: Speed | None = None) -> FilmClock:
    """Return the times of a film's frames from t = 0 to the end of the longest trace; `speed` None:
    the rule above.
    """
    traces = shared_axes.traces_of_one_plant(traces)
    duration = end(traces)
    if speed is not None:
        count = int(duration * fps / speed + 1e-6) + 1
        times = np.arange(count) * (speed / fps)
        return FilmClock(times, np.full(len(times), speed))
    grid, speed_of_grid = speeds(traces, fps)
    times = [0.0]
    while times[-1] < duration - 1e-9:
        cell = np.searchsorted(grid, times[-1] + 1e-9, side="right") - 1
        now = speed_of_grid[cell]
        times.append(min(times[-1] + now / fps, duration))
    frames = np.array(times)
    speeds_there = speed_of_grid[np.searchsorted(grid, frames + 1e-9, side="right") - 1]
    return FilmClock(frames, speeds_there, close_up(traces, fps))


def _rests_at_the_end(run: Trace) -> bool:
    """Say whether all joints rest at the end of a run of a machine with dry friction."""
    return bool(states.has_dry_friction(run.scenario).any() and states.at_rest(run)[-1].all())


def close_up(traces: Sequence[Trace], fps: float) -> FilmClock | None:
    """Return the last periods of runs in which a film shows nothing moving: those that chatter
    about one place, rattle in a backlash or stick. None of others, and none of deflections below
    the floor of errors in tables.
    """
    runs = [trace for trace in traces if trace.diverged_at is None]
    scenario = traces[0].scenario
    if not runs or scenario.plant.has_path:
        return None
    sizes = visible_sizes(scenario)
    ways = []
    for run in runs:
        spans = np.ptp(run.x, axis=0) / sizes
        ways.append(float(spans.max()))
    way = max(ways)
    rattles = any(states.backlash_gap(run.scenario) for run in runs)
    sticks = all(map(_rests_at_the_end, runs))
    if way > LITTLE and not rattles and not sticks:
        return None
    largest = max(runs, key=lambda run: np.nan_to_num(chattering_amplitude(run)))
    frequency = chattering_frequency(largest)
    if not frequency > 0.0:
        return None
    stop = float(largest.t[-1])
    start = stop - PERIODS / frequency
    deflections = []
    matters = False
    for run in runs:
        x = run.x[run.t >= start]
        away = np.abs(x - x.mean(axis=0))
        matters |= bool(away.max() > floor(run.scenario, "ultimate_bound"))
        deflections.append(float((away / sizes).max()))
    if not matters:
        return None
    factor = rounded(1.0 / max(*deflections, 1e-12))
    if factor < MIN_FACTOR:
        return None
    speed = 1.0 / rounded(max(1.0, CLOSE_TIME * frequency / PERIODS))
    times = np.arange(start, stop, speed / fps)
    return FilmClock(times, np.full(len(times), speed), factor=factor)


def visible_sizes(scenario: Scenario) -> Array:
    """Return deflections of channels that are seen well, (n,) rad or m."""
    turns = np.array(scenario.plant.units) == "rad"
    extent = math.nan if turns.all() else models.compile_model(scenario).stat.extent
    return np.where(turns, SEEN_TURN, SEEN_SLIDE * extent)


def rounded(value: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... that is not larger than a value of 1 or more."""
    power = 10.0 ** math.floor(math.log10(value) + 1e-9)
    return power * max(digit for digit in (1, 2, 5) if digit * power <= value * (1 + 1e-9))


def speeds(traces: Sequence[Trace], fps: float) -> tuple[Array, Array]:
    """Return the playback speed from each time on: times in s, (m,), the first is 0, and speeds,
    (m,).
    """
    from scipy.ndimage import maximum_filter1d

    duration = end(traces)
    grid = np.arange(max(1, round(duration * fps))) / fps
    runs = list(map(finite, traces))
    travel = travel_of(runs, np.append(grid, duration))
    beyond = np.maximum(travel / MAX_TRAVEL, 1.0)
    powers = np.ceil(np.log2(beyond) - 1e-9)
    powers = np.asarray(
        maximum_filter1d(powers, 2 * round(MOTION_MARGIN * fps) + 1, mode="nearest")
    )
    for start in impacts(runs):
        powers[np.abs(grid + 0.5 / fps - start) <= IMPACT_TIME] = MAX_HALVINGS
    pushed = np.zeros(len(grid), bool)
    for push in timed_events.pushes(runs):
        away = grid + 0.5 / fps - push.time - 0.5 * push.width
        pushed |= np.abs(away) <= IMPACT_TIME
    moved = (travel > REST_TRAVEL) | pushed
    moving = np.asarray(
        maximum_filter1d(moved, 2 * round(REST_MARGIN * fps) + 1, mode="nearest"), bool
    )
    longest = max(MAX_LENGTH[0] * duration, MAX_LENGTH[1])
    playback = np.ones(len(grid))
    for saved in range(2 * MAX_HALVINGS + 1):  # first around other motion, then around pushes
        slowest = max(0, MAX_HALVINGS - saved)
        around_pushes = min(MAX_HALVINGS, 2 * MAX_HALVINGS - saved)
        slowed = 0.5 ** np.minimum(powers, slowest)
        playback = np.where(moving | (powers > 0.0), slowed, REST_SPEED)
        playback[pushed] = 0.5**around_pushes
        if (1.0 / playback).sum() / fps <= longest:
            break
    return grid, playback


def travel_of(runs: Sequence[Trace], edges: Array) -> Array:
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
        change = np.abs(np.diff(seen, axis=0)) / size
        travel = np.maximum(travel, change.max(axis=1))
    return travel


def impacts(runs: Sequence[Trace]) -> list[float]:
    """Return when contacts begin after a while without contact, s."""
    starts = []
    for trace in runs:
        touch = states.extended(
            np.asarray(states.in_contact(trace).any(axis=1)), trace.t, states.MIN_STATE_TIME
        )
        begins = np.diff(touch.astype(int), prepend=1) > 0
        starts += trace.t[np.flatnonzero(begins)].tolist()
    return starts
