"""Regions of attraction: from which initial states (x, v) a law brings a plant to rest at its
reference.

All channels of a network start from the same state. x is not wrapped: a pendulum at rest a turn
away has not converged.

The rule. X and V are the largest |x| and |v| of the grid, and e = x - r is the error. A run is in
the band while
|e| <= 2 % of X and |v| <= 2 % of V on every channel. It is near while its squared distance (e/X)^2
  + (v/V)^2 is below
(0.2 %)^2, a tenth of the band. Every state is run for 15 % of the duration. Undecided states are
run again, from the beginning, for 40 %, and those still undecided for the whole duration.
- Early, a run converges if it is in the band throughout the last third of the run, and in the
  second half of this third it is near, or its largest squared distance is a tenth smaller than in
  the first. Near the reference the distance need not decrease, because a law that switches leaves a
  ripple. If a run starts near, it must decrease, because a run that leaves slowly is near for long.
- A run that failed does not converge. Early, nor does one that rests outside the band in that
  third: x, v and u change by less than 1e-6 of X, V and u_max (of the largest |u|, if u has no
  bound).
- At the end, a run converges if it is in the band throughout the last 20 % of the run, and in the
  second half of this part it is near, or its largest squared distance is at most 5 % larger than in
  the first. It does not converge if it is never in the band in that part, unless it still
  approaches: its largest squared distance falls by a tenth from each of the last four fifths of the
  run to the next. Otherwise it is undecided. A run that leaves slowly, at 2.5 % a second or less in
  runs of 10 s, counts as one that stays.

Early verdicts are no proofs, because a run that approaches in the band might leave later. Tests
compare them with whole runs. `basin` integrates with implicitfast, four times as fast as RK4, with
a difference of 1e-3 rad or m, less than a fiftieth of a cell.
"""

import dataclasses
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError, items_of, number, shown, whole
from smc_mujoco.common.files import read_json, reading, with_ending, write_json
from smc_mujoco.common.progress import Report, summed
from smc_mujoco.control.component import Template
from smc_mujoco.control.law import Law
from smc_mujoco.control.source import NONE
from smc_mujoco.mechanisms.named import jointed
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.conventions import SETTLING_BAND, error, last_part
from smc_mujoco.simulation.conditions import DURATION, Condition, find_condition
from smc_mujoco.simulation.grid import case
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Constant
from smc_mujoco.simulation.trace import Trace, warn_of_broken

HORIZONS = (0.15, 0.4, 1.0)  # of the duration: chosen
EARLY_PARTS = 3  # an early verdict considers the last of so many equal parts of a run
BATCH_BYTES = 48 * 2**20  # of traces in memory at once, about
REST_TOLERANCE = 1e-6  # of X, V and u_max: a run that changes less is at rest
# of the squared distance (e/X)^2 + (v/V)^2, second half over first
MAX_FINAL_RATIO, MAX_EARLY_RATIO = 1.05, 0.9
NEAR_SQUARE = (0.1 * SETTLING_BAND) ** 2  # squared distance
# X, chosen
POSITION_REACH = {"rad": lambda plant: math.pi, "m": lambda plant: 2.0 * max(map(abs, plant.x0))}
VELOCITY_RATIO = 3.0  # 1/s, V over X: chosen, about the frequency of the study's plants
MIN_SAMPLES = 10  # of the shortest runs: then each half of their last third has one
CONVERGES = 1
UNDECIDED = 0
DOES_NOT = -1


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Basin:
    """The outcome of every initial state of a grid."""

    plant: str  # its name
    law: str  # its name
    x: np.ndarray  # (nx,), positions of the grid, in the plant's unit
    v: np.ndarray  # (nv,), velocities of the grid, per second
    outcome: np.ndarray  # (nv, nx) int8: 1 converges, 0 undecided, -1 does not
    # (nv, nx), duration of the run that decided, s; the whole duration if undecided
    decided_at: np.ndarray
    unit: str  # of x, "rad" or "m"
    duration: float  # s, of the longest runs
    source: str = NONE  # where the law's gains come from, a kind of `control.source`

    @property
    def share(self) -> float:
        """The share of the states that converge within the duration."""
        return float((self.outcome == CONVERGES).mean())

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write a .json file that `load` reads back."""
        data = {}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            data[field.name] = value.tolist() if isinstance(value, np.ndarray) else value
        return write_json(with_ending(path, ".json"), data, indent=None)


def basin(
    plant: str | Plant,
    law: str | Law | Template,
    points: tuple[int, int] = (50, 50),
    x: Sequence[float] | np.ndarray | None = None,
    v: Sequence[float] | np.ndarray | None = None,
    gains: str = "tuned",
    duration: float = DURATION,
    threads: int | None = None,
    report: Report = lambda done, needed: None,
    condition: str | Condition = "nominal",
) -> Basin:
    """Map the region of attraction of a law on a plant.

    Args:
      plant, law: names, or your own plant and law.
      points: numbers of positions and velocities of the default grid, -X .. X and -V .. V. X is
        half a turn, or twice the plant's x0 on a rail; V is 3 X per second.
      x, v: positions and velocities of the grid, in place of the default ones.
      gains: set of gains, one of `gain_sets.SETS`, or "default".
      duration: of the longest runs, s.
      threads: as in `run`.
      report: called with the work done and the work that may be needed, in simulated steps; the
        latter shrinks as states are decided.
      condition: condition of the runs, such as "coulomb".

    Raises:
      ScenarioError: an unknown plant, law, set or condition, a condition whose reference moves, or
        an empty grid.
    """
    plant = jointed(plant, "a region of attraction")
    base = case(plant, law, condition, duration, gains, changes={"integrator": "implicitfast"})
    if start := sorted({"x0", "v0"} & find_condition(condition).on(base.plant, duration).keys()):
        raise ScenarioError(
            f"condition {base.condition!r} sets {start[0]}, and a map starts everywhere: leave "
            "it out"
        )
    reach = POSITION_REACH[base.plant.unit](base.plant)
    if not reach and (x is None or v is None):
        raise ScenarioError(
            f"{base.plant.name} starts at 0, which tells no reach: give positions x and "
            "velocities v"
        )
    if len(counts := items_of("points", points)) != 2:
        raise ScenarioError(f"points is {shown(points)}: give two numbers of points, in x and v")
    nx, nv = (whole(f"points in {axis}", n, 2, 1000) for axis, n in zip("xv", counts, strict=True))
    positions = np.linspace(-reach, reach, nx) if x is None else x
    fastest = VELOCITY_RATIO * reach
    velocities = np.linspace(-fastest, fastest, nv) if v is None else v
    return basin_of(base, positions, velocities, threads, report)


def basin_of(
    base: Scenario,
    x: Sequence[float] | np.ndarray,
    v: Sequence[float] | np.ndarray,
    threads: int | None = None,
    report: Report = lambda done, needed: None,
) -> Basin:
    """Map the region of attraction of any scenario as `basin` does."""
    if base.plant.mixed:
        raise ScenarioError(
            f"{base.plant.name} has channels in m and rad, which cannot start from the same state: "
            "map another plant"
        )
    if moving := [one for one in base.references if not isinstance(one, Constant)]:
        raise ScenarioError(
            f"a map shows what comes to rest, and {shown(moving[0])} moves: give a constant "
            "reference"
        )
    shortest = math.ceil(MIN_SAMPLES / HORIZONS[0])
    if base.samples < shortest:
        raise ScenarioError(
            f"duration {base.duration:g} s is too short to tell what comes to rest: give at least "
            f"{shortest * base.control_period:g} s"
        )
    x, v = _axis("x", x), _axis("v", v)
    outcome = np.full((v.size, x.size), UNDECIDED, np.int8)
    decided_at = np.full(outcome.shape, base.duration)
    undecided = list(np.ndindex(*outcome.shape))
    done = 0.0
    broken = {}
    for i, horizon in enumerate(HORIZONS):
        shortened = dataclasses.replace(base, duration=horizon * base.duration)
        needed = done + len(undecided) * base.work * sum(HORIZONS[i:])
        size = max(32, int(BATCH_BYTES / (72 * (shortened.samples + 1) * shortened.plant.n)))
        left = []
        for begin in range(0, len(undecided), size):
            batch = undecided[begin : begin + size]
            cases = []
            for j, k in batch:
                cases.append(dataclasses.replace(shortened, x0=x[k], v0=v[j]))
            for index, trace in stream(cases, threads, summed(report, done, needed)):
                if trace.broken:
                    broken.setdefault(base.law.name, trace.broken)
                verdict = verdict_of(trace, x, v, final=horizon == HORIZONS[-1])
                if verdict is None:
                    left.append(batch[index])
                else:
                    outcome[batch[index]], decided_at[batch[index]] = verdict, shortened.duration
            done += len(cases) * shortened.work
        undecided = left
    warn_of_broken(broken)
    return Basin(
        plant=base.plant.name,
        law=base.law.name,
        x=x,
        v=v,
        outcome=outcome,
        decided_at=decided_at,
        unit=base.plant.unit,
        duration=base.duration,
        source=base.law.source.words,
    )


def verdict_of(trace: Trace, x: np.ndarray, v: np.ndarray, final: bool) -> int | None:
    """Return what the module's rule says of a run, for a grid x, v: 1, 0 or -1, or None if it needs
    a longer run.
    """
    if trace.failure is not None or trace.diverged_at is not None:
        return DOES_NOT
    x_reach = np.abs(x).max() or 1.0
    v_reach = np.abs(v).max() or 1.0
    e = error(trace)
    distance = np.maximum(np.abs(e / x_reach), np.abs(trace.v / v_reach)).max(axis=1)
    if final:
        late = last_part(trace)
    else:
        late = slice(-(distance.size // EARLY_PARTS), None)
    inside = distance[late] <= SETTLING_BAND
    squares = ((e / x_reach) ** 2 + (trace.v / v_reach) ** 2).sum(axis=1)
    start = squares[0]
    square = squares[late]
    middle = square.size // 2
    first_half = square[:middle].max()
    second_half = square[middle:].max()
    near = NEAR_SQUARE if final or start > NEAR_SQUARE else 0.0
    ratio = MAX_FINAL_RATIO if final else MAX_EARLY_RATIO
    stays = inside.all() and second_half <= max(ratio * first_half, near)
    if final or stays:
        if stays:
            return CONVERGES
        if inside.any() or _approaches(squares):
            return UNDECIDED
        return DOES_NOT
    changes = np.stack(
        [np.ptp(signal[late], axis=0).max() for signal in (trace.x, trace.v, trace.u)]
    )
    u_reach = float(np.max(trace.scenario.resolved.u_max))
    if not math.isfinite(u_reach):
        u_reach = np.abs(trace.u).max()
    rests = (changes <= REST_TOLERANCE * np.array([x_reach, v_reach, u_reach])).all()
    if rests and not inside.any():
        return DOES_NOT
    return None


def _approaches(squares: np.ndarray) -> bool:
    """Return whether the largest squared distance, (K,), falls over the last four fifths of a
    run.
    """
    largest = np.array([part.max() for part in np.array_split(squares, 5)[1:]])
    return bool((largest[1:] <= MAX_EARLY_RATIO * largest[:-1]).all())


def load(path: str | os.PathLike[str]) -> Basin:
    """Read the map that `Basin.save` wrote."""
    kinds = {"x": float, "v": float, "decided_at": float, "outcome": np.int8}
    with reading(path, "map", "give a .json file that Basin.save wrote") as file:
        fields: dict[str, Any] = read_json(file)
        fields |= {name: np.array(fields[name], kind) for name, kind in kinds.items()}
        return Basin(**fields)


def _axis(name: str, values: Sequence[float] | np.ndarray) -> np.ndarray:
    axis = []
    for value in items_of(name, values):
        axis.append(number(f"a value of {name}", value))
    if not axis:
        raise ScenarioError(f"{name} is {shown(values)}: give one or more finite numbers")
    return np.array(axis)
