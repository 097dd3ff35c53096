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
compare them with whole runs. What the fast engine cannot run, `basin` integrates with implicitfast,
four times as fast as RK4, with a difference of 1e-3 rad or m, less than a fiftieth of a cell.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from smc_mujoco.analysis.engine import CHECKED, CONVERGES, DOES_NOT, UNDECIDED, Device
from smc_mujoco.analysis.engine.choice import chosen
from smc_mujoco.analysis.engine.form import SCORES, SETTING
from smc_mujoco.analysis.engine.group import FormGroup, why_not
from smc_mujoco.analysis.engine.outcome import NAME, over_trace
from smc_mujoco.analysis.engine.scored_runs import worth_compiling
from smc_mujoco.common.aliases import AnyPath, Array, ArrayPair, Fields, Floats
from smc_mujoco.common.constraints import Called, constrained
from smc_mujoco.common.errors import ScenarioError, items_of, number, shown, whole
from smc_mujoco.common.files import read_json, reading, with_ending, write_json
from smc_mujoco.common.progress import Report
from smc_mujoco.control.component import Template
from smc_mujoco.control.law import Law
from smc_mujoco.control.source import NONE
from smc_mujoco.mechanisms.named import jointed
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.conventions import last_part
from smc_mujoco.simulation.conditions import DURATION, Condition, find_condition
from smc_mujoco.simulation.grid import case
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import stream
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Constant
from smc_mujoco.simulation.trace import Trace, warn_of_broken

HORIZONS = (0.15, 0.4, 1.0)  # of the duration: chosen
EARLY_PARTS = 3  # an early verdict considers the last of so many equal parts of a run
BATCH_BYTES = 48 * 2**20  # of traces in memory at once, about
BATCH_STATES = 2**17  # of the fast engine's runs at once
# X, chosen
POSITION_REACH = {"rad": lambda plant: math.pi, "m": lambda plant: 2.0 * max(map(abs, plant.x0))}
VELOCITY_RATIO = 3.0  # 1/s, V over X: chosen, about the frequency of the study's plants
MIN_SAMPLES = 10  # of the shortest runs: then each half of their last third has one


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Basin:
    """The outcome of every initial state of a grid."""

    plant: str  # its name
    law: str  # its name
    x: Array  # (nx,), positions of the grid, in the plant's unit
    v: Array  # (nv,), velocities of the grid, per second
    outcome: Array  # (nv, nx) int8: 1 converges, 0 undecided, -1 does not
    # (nv, nx), duration of the run that decided, s; the whole duration if undecided
    decided_at: Array
    unit: str  # of x, "rad" or "m"
    duration: float  # s, of the longest runs
    source: str = NONE  # where the law's gains come from, a kind of `control.source`
    checked: str = ""  # how many states MuJoCo decided, and how many of them otherwise

    def __repr__(self) -> str:
        share = f"{100 * self.share:.3g} % of {self.outcome.size} states"
        text = f"{self.law} on {self.plant}: {share} come to rest within {self.duration:g} s"
        return f"Basin({'; '.join(filter(None, (text, self.checked)))})"

    @property
    def share(self) -> float:
        """The share of the states that converge within the duration."""
        return float((self.outcome == CONVERGES).mean())

    def save(self, path: AnyPath) -> Path:
        """Write a .json file that `load_basin` reads back."""
        data = {}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            data[field.name] = value.tolist() if isinstance(value, np.ndarray) else value
        return write_json(with_ending(path, ".json"), data, indent=None)


@constrained
def basin(
    plant: str | Plant,
    law: str | Law | Template,
    points: tuple[int, int] = (50, 50),
    x: Sequence[float] | Array | None = None,
    v: Sequence[float] | Array | None = None,
    gains: str = "tuned",
    duration: float = DURATION,
    threads: int | None = None,
    report: Annotated[Report, Called()] = lambda done, needed: None,
    condition: str | Condition = "nominal",
    device: Device = "cpu",
) -> Basin:
    """Map the region of attraction of a law on a plant.

        print(smc.design.basin("inverted_pendulum", "pid", points=(5, 5)))

    The fast engine makes the runs where it can, and MuJoCo repeats 20 of them: `checked` says how
    many it decides otherwise.

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
      device: of the fast engine, "cpu" or "cuda".

    Returns:
      A `Basin`: `outcome` of every initial state, `share` of those that converge, and
        `save("basin.json")`.

    Raises:
      ScenarioError: an unknown plant, law, set or condition, a condition whose reference moves, an
        empty grid, or no such device.
    """
    plant = jointed(plant, "a region of attraction")
    base = case(plant, law, condition, duration, gains)
    if why_not(base, (), device):
        base = dataclasses.replace(base, integrator="implicitfast", physics_step=None)
    if start := sorted({"x0", "v0"} & find_condition(condition).on(base.plant, duration).keys()):
        raise ScenarioError(
            f"condition {base.condition!r} sets {start[0]}, and a map starts everywhere: leave "
            "it out"
        )
    xs, vs = _default_axes(base.plant, points, needed=x is None or v is None)
    return basin_of(base, xs if x is None else x, vs if v is None else v, threads, report, device)


def _default_axes(plant: Plant, points: Sequence[int], needed: bool) -> ArrayPair:
    """Return the positions and the velocities of the default grid; if they are `needed`, raise
    ScenarioError for a plant that gives them no size.
    """
    reach = POSITION_REACH[plant.unit](plant)
    if not reach and needed:
        raise ScenarioError(
            f"{plant.name} starts at 0, which gives the map no size: give positions x and "
            "velocities v"
        )
    counts = items_of("points", points)
    if len(counts) != 2:
        raise ScenarioError(f"points is {shown(points)}: give two numbers of points, in x and v")
    nx = whole("points in x", counts[0], 2, 1000)
    nv = whole("points in v", counts[1], 2, 1000)
    fastest = VELOCITY_RATIO * reach
    return np.linspace(-reach, reach, nx), np.linspace(-fastest, fastest, nv)


def basin_of(
    base: Scenario,
    x: Sequence[float] | Array,
    v: Sequence[float] | Array,
    threads: int | None = None,
    report: Report = lambda done, needed: None,
    device: str = "cpu",
) -> Basin:
    """Map the region of attraction of any scenario as `basin` does."""
    if base.plant.mixed:
        raise ScenarioError(
            f"{base.plant.name} has channels in m and rad, which cannot start from the same state: "
            "map another plant"
        )
    if moving := [
        reference for reference in base.references if not isinstance(reference, Constant)
    ]:
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
    grid = _Grid(base, x, v, threads)
    every_x = np.tile(x, v.size)
    every_v = np.repeat(v, x.size)
    states = np.stack([every_x, every_v], axis=1)
    checked = ""
    kind, _ = chosen(base, (NAME,), device)
    work = round(len(states) * base.work * sum(HORIZONS))
    compiles = device != "cpu" or worth_compiling(work)
    if kind is None or not compiles or len(states) < kind.least or prepare(base).why_not:
        outcome, decided_at = grid.decide(grid.by_mujoco, grid.traced, states, report)
    else:
        outcome, decided_at = grid.decide(
            grid.by_engine(kind, device), BATCH_STATES, states, report
        )
        drawn = np.random.default_rng(0).permutation(len(states))[:CHECKED]
        again, _ = grid.decide(grid.by_mujoco, CHECKED, states[drawn], lambda done, needed: None)
        differ = np.count_nonzero(again != outcome[drawn])
        checked = f"MuJoCo repeated {drawn.size} states, {differ} with another outcome"
    warn_of_broken(grid.broken)
    shape = v.size, x.size
    return Basin(
        plant=base.plant.name,
        law=base.law.name,
        x=x,
        v=v,
        outcome=outcome.reshape(shape),
        decided_at=decided_at.reshape(shape),
        unit=base.plant.unit,
        duration=base.duration,
        source=base.law.source.words,
        checked=checked,
    )


class _Grid:
    """The runs of a map, whose states are (S, 2), x and v of every channel."""

    def __init__(self, base: Scenario, x: Array, v: Array, threads: int | None):
        self.base = base
        self.x = x
        self.v = v
        self.threads = threads
        self.broken: dict[str, str] = {}
        trace_bytes = 72 * (base.samples + 1) * base.plant.n
        self.traced = max(32, int(BATCH_BYTES / trace_bytes))  # runs whose traces fit in memory

    def decide(self, run: Callable, size: int, states: Array, report: Report) -> ArrayPair:
        """Return the outcome of every state, and the duration of the run that decided, s.

        `run` gets a scenario, `size` states at most, and whether its verdict is final; it returns
        their outcomes.
        """
        base = self.base
        outcome = np.full(len(states), UNDECIDED, np.int8)
        decided_at = np.full(len(states), base.duration)
        undecided = np.arange(len(states))
        done = 0.0
        for i, horizon in enumerate(HORIZONS):
            final = horizon == HORIZONS[-1]
            shortened = dataclasses.replace(base, duration=horizon * base.duration)
            needed = done + undecided.size * base.work * sum(HORIZONS[i:])
            for begin in range(0, undecided.size, size):
                batch = undecided[begin : begin + size]
                outcome[batch] = run(shortened, states[batch], final)
                done += batch.size * shortened.work
                report(done, needed)
            waits = outcome[undecided] == UNDECIDED
            decided_at[undecided[~waits]] = shortened.duration
            undecided = undecided[waits]
        return outcome, decided_at

    def by_mujoco(self, shortened: Scenario, states: Array, final: bool) -> list[int]:
        """Return the outcomes of runs by MuJoCo."""
        cases = []
        for x, v in states.tolist():
            cases.append(dataclasses.replace(shortened, x0=x, v0=v))
        verdicts = [UNDECIDED] * len(cases)
        for i, trace in stream(cases, self.threads):
            if trace.broken:
                self.broken.setdefault(self.base.law.name, trace.broken)
            verdicts[i] = verdict_of(trace, self.x, self.v, final) or UNDECIDED
        return verdicts

    def by_engine(self, kind: type[FormGroup], device: str) -> Callable:
        """Return the same by a kind of group, on a device."""

        def run(shortened: Scenario, states: Array, final: bool) -> Array:
            group = kind([shortened], (NAME,))
            rows = np.repeat(group.rows, len(states), axis=0)
            places = group.layout.row
            n = self.base.plant.n
            rows[:, places.x0 : places.x0 + n] = states[:, :1]
            rows[:, places.v0 : places.v0 + n] = states[:, 1:]
            u_max = shortened.resolved.u_max
            rows[:, places.reach : places.reach + 4] = _reach(self.x, self.v, u_max, final)
            if not final:
                rows[:, SETTING.late] = _early(shortened.samples)
            outcome = group.run(rows, self.threads, device)[:, SCORES]
            return np.where(np.isnan(outcome), DOES_NOT, outcome)

        return run


def verdict_of(trace: Trace, x: Array, v: Array, final: bool) -> int | None:
    """Return what the module's rule says of a run, for a grid x, v: 1, 0 or -1, or None if it needs
    a longer run.
    """
    if trace.failure is not None or trace.diverged_at is not None:
        return DOES_NOT
    late = last_part(trace).start if final else _early(len(trace.t) - 1)
    reach = _reach(x, v, trace.scenario.resolved.u_max, final)
    outcome = over_trace(trace, late, reach)
    return outcome if outcome or final else None  # pyright: ignore[reportReturnType]


def _early(samples: int) -> int:
    """Return the first sample that counts in an early verdict."""
    count = samples + 1
    return count - count // EARLY_PARTS


def _reach(x: Array, v: Array, u_max: Any, final: bool) -> Floats:
    """Return X, V, the bound on u, and whether the verdict is final."""
    X = np.abs(x).max() or 1.0
    V = np.abs(v).max() or 1.0
    return X, V, float(np.max(u_max)), float(final)


def load_basin(path: AnyPath) -> Basin:
    """Read the map that `Basin.save` wrote."""
    kinds = {"x": float, "v": float, "decided_at": float, "outcome": np.int8}
    with reading(path, "map", "give a .json file that Basin.save wrote") as file:
        fields: Fields = read_json(file)
        for name, kind in kinds.items():
            fields[name] = np.array(fields[name], kind)
        return Basin(**fields)


def _axis(name: str, values: Sequence[float] | Array) -> Array:
    axis = []
    for value in items_of(name, values):
        axis.append(number(f"a value of {name}", value))
    if not axis:
        raise ScenarioError(f"{name} is {shown(values)}: give one or more finite numbers")
    return np.array(axis)
