"""Residuals of records and their slopes: what a twin predicts at trial values, in pieces that have
states of their own.

A piece of a record is replayed from positions and velocities at its start, and from what no record
has, such as what servos have integrated by then, see hidden_starts.py. These are free numbers of
the search, one set for each piece (multiple shooting), because a few samples give them too poorly.
They enter almost linearly, so each step of the search moves them by linear least squares, and only
the quantities remain. Source: H. G. Bock, "Recent advances in parameter identification techniques
for ODE", 1983.

MuJoCo's steps are of first order where there is dry friction or a motor, and their error biases the
quantities by many standard errors. So replays of measured open loops are corrected by what short
steps change, which is extrapolated from two runs with steps h and h/2: 2 x(h/2) - x(h). The
correction hardly depends on the quantities. So a search keeps that of one point, and simulates its
other points with longer steps. Derivatives are of longer steps too where dry friction alone asks
for short ones: it makes them rough by as much with either.
"""

import contextlib
import copy
import dataclasses
import itertools
import math
import operator
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from smc_mujoco.common.aliases import Array, Data, Fields, Numbers
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioWarning
from smc_mujoco.identification import inverse_dynamics, records
from smc_mujoco.identification.kept_replays import Batch, KeptReplays
from smc_mujoco.identification.least_squares import least_squares
from smc_mujoco.identification.records import Record
from smc_mujoco.identification.rig import Quantity, RecordPart, Rig
from smc_mujoco.simulation import run_key
from smc_mujoco.simulation.run import run_unjudged
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

# of a quantity's scale, for central differences; chosen: dry friction makes shorter ones rough
DIFFERENCE_STEP = 2e-3
# scale of a state at the start, relative to the standard deviation of its column or rate; chosen
STATE_SCALE = 0.05
PARTS = 2.0, 4.0  # of a step, by which replays are extrapolated to steps of 0
MAX_STEP = 2.5e-4  # s, of RK4 in corrected replays; chosen
# of that step, for slopes: with dry friction they err by 5 % then, and by up to 45 % before; chosen
SLOPE_HALVINGS = 2
ROUGH = "Euler"  # integrator of rough replays; chosen
MIN_SIZE = 1e-300  # in place of the size 0 of slopes
# largest residual of a sample, relative to the norm of the record; that of a run that fails
WORST = 1.0
# ratio of singular values below which states at the start have no effect of their own
SINGULAR_RATIO = 1e-6


@frozen_data
class Piece:
    """A part of a record that is compared with its replay."""

    record: int  # its index
    part: RecordPart | None  # what its replay takes from the record; None if torques are predicted
    skipped: int  # samples at its start that are not compared
    measured: Record  # the columns compared, (N,) each
    spread: Numbers  # norm of each whole column about its mean: the unit of residuals
    scales: Array  # units of the free states, (s,)


@frozen_data
class Point:
    """A point of the search."""

    values: Array  # quantities in their scales, (p,)
    states: Array  # moves of each piece's free states, (pieces, s)


@frozen_data
class Slopes:
    """Residuals of each piece at a point, in the order of time, each sample with all columns, and
    their derivatives.
    """

    point: Point
    residuals: list[Array]  # (N,) of each piece
    by_values: list[Array]  # derivatives by the quantities, (N, p)
    by_states: list[Array]  # derivatives by the piece's states, (N, s)
    columns: int  # number of columns that are compared
    records: int  # number of records whose pieces these are

    def freed(self, rows: Sequence[Array]) -> list[Array]:
        """Return rows of each piece, (N,) or (N, p), without the part that states at its start can
        cause.
        """
        freed = []
        for basis, row in zip(self._bases, rows, strict=True):
            freed.append(row - basis @ (basis.T @ row))
        return freed

    @cached_property
    def _bases(self) -> list[Array]:
        """What states at the start can cause in each piece, as orthonormal columns, (N, at most
        s).
        """
        bases = []
        for S in self.by_states:
            vectors, sizes, _ = np.linalg.svd(S, full_matrices=False)
            bases.append(vectors[:, sizes > SINGULAR_RATIO * sizes.max(initial=0.0)])
        return bases

    @cached_property
    def freed_slopes(self) -> Array:
        """The derivatives by the quantities, `freed`, of all pieces, (all N, p)."""
        return np.concatenate(self.freed(self.by_values))

    @cached_property
    def basis(self) -> Array:
        """What quantities can cause beside states, as orthonormal columns, (all N, p)."""
        J = self.freed_slopes
        vectors, _ = np.linalg.qr(J / np.maximum(np.linalg.norm(J, axis=0), MIN_SIZE))
        return vectors

    @cached_property
    def freed_residuals(self) -> Array:
        """The residuals, `freed`, of all pieces, (all N,)."""
        return np.concatenate(self.freed(self.residuals))

    def moves(self, step: Array) -> Array:
        """Return the moves of each piece's states, (pieces, s), that suit a step of the quantities
        (p,) best.
        """
        moves = []
        for r, J, S in zip(self.residuals, self.by_values, self.by_states, strict=True):
            moves.append(-least_squares(S, r + J @ step, SINGULAR_RATIO))
        return np.array(moves)

    def stepped(self, step: Array) -> "Slopes":
        """Return the slopes after a small step of the quantities (p,), with residuals that follow
        from derivatives.

        States that the noise hides, such as a starting velocity in dry friction, do not move.
        """
        noise = math.sqrt(self.cost / sum(map(len, self.residuals)))
        rows = []
        moves = []
        for r, J, S in zip(self.residuals, self.by_values, self.by_states, strict=True):
            vectors, sizes, right = np.linalg.svd(S, full_matrices=False)
            visible = sizes > noise
            moved = r + J @ step
            within = vectors[:, visible].T @ moved
            moves.append(-right[visible].T @ (within / sizes[visible]))
            rows.append(moved + S @ moves[-1])
        point = Point(self.point.values + step, self.point.states + np.array(moves))
        return dataclasses.replace(self, point=point, residuals=rows)

    @cached_property
    def cost(self) -> float:
        """Sum of the squared residuals."""
        return cost(self.residuals)

    @property
    def fit(self) -> float:
        """Fit of all pieces together, percent: 100 (1 - rms of the columns' relative residuals)."""
        return 100.0 * (1.0 - math.sqrt(self.cost / (self.columns * self.records)))


def cost(rows: Sequence[Array]) -> float:
    """Return the sum of squares."""
    return float(sum(np.sum(residuals**2) for residuals in rows))


class Replays:
    """Replays of records at trial values of some quantities."""

    def __init__(
        self,
        twin: Rig,
        names: list[str],
        data: Sequence[Data],
        closed: bool,
        report: Callable[[int], None] = lambda count: None,
        whole: bool = False,
        kept: KeptReplays | None = None,
    ):
        """Cut the records of a rig into pieces, to find the quantities `names`, (p,).

        If `closed`, each record is replayed as a whole, by the rig's own controller; else its
        pieces of the rig's `window` under the recorded command, or the `whole` record. `report` is
        called with the number of replays of all records after a batch. `kept` has the batches of a
        search that was stopped.
        """
        self.twin = twin
        self.names = names
        self.data = data
        self.closed = closed
        self.report = report
        self.kept = kept
        self.whole = whole or closed or not twin.window
        self.quantities = []
        low = []
        high = []
        for name in names:
            quantity = twin.quantities[name]
            self.quantities.append(quantity)
            low.append(quantity.least)
            high.append(quantity.most)
        self.scales = np.array(list(map(_scale, self.quantities)))
        self.low = np.array(low) / self.scales
        self.high = np.array(high) / self.scales
        n = len(twin.columns.x)
        self.free = np.arange(len(twin.hidden) + 2 * n)
        if closed:  # the controller has read the first positions as they were measured
            self.free = self.free[-n:]
        forgotten = closed and twin.score_from > twin.start
        if twin.columns.state or twin.dynamics is not None or forgotten:
            self.free = np.zeros(0, int)
        self.evaluations = 0
        # integrator and step of replays; none for the scenario's own
        self.steps: Fields = {}
        self.corrections: list[Record] | None = None  # of each piece; None for none
        # what steps of 0 would change in the residuals of each piece; None for nothing
        self.step_errors: list[Array] | None = None
        self.pieces: list[Piece] = []
        for i in range(len(data)):
            self.pieces += self._pieces(i)
        # those of derivatives, which may be longer; none: those of residuals
        self.slope_steps: Fields = {} if closed else twin.long_steps(self._part(0))
        # those of which only what changes counts, as their errors cancel; none: those of residuals
        self.rough_steps: Fields = self.slope_steps and self.slope_steps | {"integrator": ROUGH}

    @property
    def start(self) -> Point:
        """The point of the rig's own values, and of the measured states."""
        values = np.array([self.twin.values[name] for name in self.names]) / self.scales
        return Point(values, np.zeros((len(self.pieces), len(self.free))))

    def values(self, point: Point) -> dict[str, float]:
        """Return the quantities at a point, cut to their ranges."""
        values = {}
        scaled = (point.values * self.scales).tolist()
        for name, value, quantity in zip(self.names, scaled, self.quantities, strict=True):
            values[name] = min(max(value, quantity.least), quantity.most)
        return values

    def in_order(self, point: Point) -> Point:
        """Return the point whose quantities are in the order in which they are reported; it has the
        same residuals.
        """
        ordered = self.twin.in_order(self.values(point))
        scaled = np.array([ordered[name] for name in self.names]) / self.scales
        return Point(scaled, point.states)

    def only(self, indices: Sequence[int]) -> "Replays":
        """Return the replays of some of the pieces alone."""
        subset = copy.copy(self)
        subset.pieces = [self.pieces[k] for k in indices]
        if self.corrections is not None:
            subset.corrections = [self.corrections[k] for k in indices]
        if self.step_errors is not None:
            subset.step_errors = [self.step_errors[k] for k in indices]
        return subset

    def rig(self, point: Point) -> Rig:
        """Return the rig at a point."""
        return self.twin.with_values(self.values(point))

    def _part(self, k: int) -> Any:
        """Return what the replay of piece k takes from its record."""
        return self.pieces[k].part

    def state(self, point: Point, k: int) -> Array | None:
        """Return hidden numbers, positions and velocities at the start of piece k, (q + 2n,); None
        if they are not free.
        """
        if not len(self.free):
            return None
        state = self._part(k).state.copy()
        state[self.free] += point.states[k] * self.pieces[k].scales
        return state

    def _finer(self, times: int) -> list[Piece]:
        """Return the pieces with that many times as many commands, where a delay needs them."""
        finer = []
        for k, piece in enumerate(self.pieces):
            part = self.twin.finer(self._part(k), times)
            finer.append(dataclasses.replace(piece, part=part))
        return finer

    def at_rest(self, point: Point) -> Point:
        """Return the point with velocity 0 at the start of each piece. Velocities must be free."""
        n = len(self.twin.columns.x)
        states = point.states.copy()
        for k, piece in enumerate(self.pieces):
            states[k, -n:] = -self._part(k).state[-n:] / piece.scales[-n:]
        return Point(point.values, states)

    @property
    def plays(self) -> Array:
        """Half of the play of each free state that is where a rotor stands in one, (s,); 0 for
        others.
        """
        halves = np.zeros(len(self.free))
        if len(self.free) == len(self.twin.hidden) + 2 * len(self.twin.columns.x):
            halves[: len(self.twin.hidden)] = self.twin.half_plays
        return halves

    def at_flanks(self, point: Point, side: float) -> Point:
        """Return the point with the rotor of each play on a flank of it at the start of each
        piece: that of side -1 or 1.
        """
        states = point.states.copy()
        for j in np.flatnonzero(self.plays):
            for k, piece in enumerate(self.pieces):
                flank = side * self.plays[j]
                states[k, j] = (flank - self._part(k).state[j]) / piece.scales[j]
        return Point(point.values, states)

    def residuals(self, points: Sequence[Point]) -> list[list[Array]]:
        """Return the residuals of each piece, (N,), at each point. All replays are one batch."""
        residuals = self._residuals(points)
        if self.step_errors is None:
            return residuals
        return [list(map(operator.add, rows, self.step_errors)) for rows in residuals]

    def delayed(self, slopes: Slopes, points: Sequence[Point]) -> list[list[Array]]:
        """Return `residuals` at points that differ from that of slopes in the delay, by what that
        changes in rough replays.
        """
        if not self.rough_steps:
            return self.residuals(points)
        with self._stepping(self.rough_steps):
            before, *after = self._residuals([slopes.point, *points])
        delayed = []
        for rows in after:
            changes = map(operator.sub, rows, before)
            delayed.append(list(map(operator.add, slopes.residuals, changes)))
        return delayed

    def by_steps(self, points: Sequence[Point], parts: Sequence[float]) -> list[list[list[Array]]]:
        """Return `residuals` with each of some parts of the physics step, and commands as fine."""
        plain = self.rig(points[0]).repeated(self._part(0))
        pieces = self.pieces
        residuals = []
        for part in parts:
            with self._stepping({"physics_step": plain.resolved.physics_step / part}):
                self.pieces = self._finer(round(part))
                residuals.append(self._residuals(points))
                self.pieces = pieces
        return residuals

    def _residuals(self, points: Sequence[Point]) -> list[list[Array]]:
        relative = []
        for by_piece in self.predicted(points):
            relative.append(list(map(self.relative, self.pieces, by_piece)))
        return relative

    def costs(self, points: Sequence[Point]) -> Array:
        """Return the sum of squares of each piece at each point, (points, pieces)."""
        costs = []
        for by_piece in self.residuals(points):
            costs.append([cost([rows]) for rows in by_piece])
        return np.array(costs)

    def predicted(self, points: Sequence[Point]) -> list[list[Record]]:
        """Return the predicted columns of each piece at each point."""
        self.evaluations += len(points)
        rigs = list(map(self.rig, points))
        if self.twin.dynamics is not None:
            predictions = []
            for rig in rigs:
                predictions.append([columns for columns, _, _ in rig.predictions(self.data)])
        else:
            predictions = self._replayed(rigs, points, self.steps)
        self.report(len(points))
        for by_piece in predictions:
            for columns, added in zip(by_piece, self.corrections or (), strict=False):
                for name in columns:
                    columns[name] = columns[name] + added[name]
        return predictions

    def correct(self, point: Point, halvings: int) -> bool:
        """Correct later replays by what `halvings` of MAX_STEP change at a point; return whether
        that is needed.
        """
        if self.closed or self.twin.columns.state or self.twin.dynamics is not None:
            return False  # records of simulated runs have the same errors by steps
        rig = self.rig(point)
        if not (plain := rig.repeated(self._part(0))).realistic:
            return False
        self.steps = _steps(plain, 0)
        predictions = []
        for k in (0, halvings - 1, halvings):
            predictions += self._replayed([rig], [point], _steps(plain, k))
        self.corrections = []
        for plain_steps, coarse, fine in zip(*predictions, strict=True):
            correction = {}
            for name in fine:
                correction[name] = 2.0 * fine[name] - coarse[name] - plain_steps[name]
            self.corrections.append(correction)
        return True

    @property
    def short_steps(self) -> Fields:
        """Integrator and step of exact replays without corrections; none for the scenario's own."""
        if not self.corrections:
            return {}
        return self.steps | {"physics_step": self.steps["physics_step"] / 2**SLOPE_HALVINGS}

    def sharpened(self, slopes: Slopes) -> Slopes:
        """Return slopes with derivatives from shorter steps."""
        with self._stepping(self.short_steps):
            sharp = self.slopes(slopes.point)
        return dataclasses.replace(sharp, residuals=slopes.residuals)

    @contextlib.contextmanager
    def _stepping(self, steps: Fields) -> Iterator[Fields]:
        """Replay with other steps meanwhile, and yield them."""
        before, self.steps = self.steps, steps
        yield steps
        self.steps = before

    def _replayed(
        self, rigs: Sequence[Rig], points: Sequence[Point], fields: Fields
    ) -> list[list[Record]]:
        """Return what `predicted` returns, without corrections; `fields` replace those of the
        replays' scenarios.
        """

        def simulated() -> Batch:
            return self._simulated(rigs, points, fields)

        if self.kept is None:
            return simulated()
        return self.kept.batch(self._depends(rigs, points, fields), simulated)

    def _depends(
        self, rigs: Sequence[Rig], points: Sequence[Point], fields: Fields
    ) -> Iterator[bytes]:
        """Yield all that a batch of replays depends on."""
        first = self.twin.repeated(self._part(0), state=self.state(points[0], 0), **fields)
        yield run_key.run_key(first).encode()
        for k, piece in enumerate(self.pieces):
            yield repr((piece.record, piece.skipped, [*piece.measured])).encode()
            for values in piece.measured.values():
                yield values.tobytes()
            for point in points:
                state = self.state(point, k)
                yield b"" if state is None else state.tobytes()
        for rig in rigs:
            yield repr([*rig.values.items()]).encode()

    def _simulated(self, rigs: Sequence[Rig], points: Sequence[Point], fields: Fields) -> Batch:
        """Return what `_replayed` returns, by a run of each piece of each rig."""
        scenarios = []
        with warnings.catch_warnings():  # about values that are only tried
            warnings.simplefilter("ignore", ScenarioWarning)
            for rig, point in zip(rigs, points, strict=True):
                for k in range(len(self.pieces)):
                    state = self.state(point, k)
                    scenarios.append(rig.repeated(self._part(k), state=state, **fields))
            traces = iter(run_unjudged(scenarios))
        return [self.by_piece(rig, traces) for rig in rigs]

    def by_piece(self, rig: Rig, traces: Iterator[Trace]) -> list[Record]:
        """Return the columns of each piece that are compared, from the next replays of a rig."""
        predictions = []
        for piece, trace in zip(self.pieces, traces, strict=False):
            columns = rig.predicted(trace)
            for name, values in columns.items():
                samples = piece.skipped + len(piece.measured[name])
                columns[name] = values[:: len(values) // samples][piece.skipped :]
            predictions.append(columns)
        return predictions

    def relative(self, piece: Piece, predicted: Record) -> Array:
        """Return the residuals of a piece, sample by sample with all columns, (N,), divided by the
        columns' spread.
        """
        columns = []
        for name, values in predicted.items():
            columns.append((piece.measured[name] - values) / piece.spread[name])
        rows = np.nan_to_num(np.column_stack(columns), nan=WORST, posinf=WORST, neginf=-WORST)
        return np.clip(rows, -WORST, WORST).ravel()

    def slopes(
        self, point: Point, central: bool = True, residuals: list[Array] | None = None
    ) -> Slopes:
        """Return residuals and their derivatives at a point, by differences that stay within the
        ranges: central ones, or in half the time those to one side. `residuals`: those at the
        point, if they are there already.
        """
        p = len(self.names)
        steps = np.full(p, DIFFERENCE_STEP)
        behind = []
        if central:
            behind = self._moved(point, -steps, -DIFFERENCE_STEP)
        else:
            steps[point.values + steps > self.high] *= -1.0
        ahead = self._moved(point, steps, DIFFERENCE_STEP)
        points = [point, *ahead, *behind]
        with self._stepping(self.slope_steps or self.steps) as steps:
            before, *rows = self.residuals(points)
        if steps == self.steps:
            residuals = before
        elif residuals is None:
            (residuals,) = self.residuals([point])
        count = len(ahead)
        rows_behind = rows[count:]
        if not central:
            behind = [point] * count
            rows_behind = [before] * count
        gaps = np.full(count, DIFFERENCE_STEP)
        if central:
            gaps = 2.0 * gaps
        for j in range(p):
            gaps[j] = ahead[j].values[j] - behind[j].values[j]
        by_values = []
        by_states = []
        for k in range(len(self.pieces)):
            columns = []
            for ahead, back, gap in zip(rows[:count], rows_behind, gaps, strict=True):
                columns.append((ahead[k] - back[k]) / gap)
            derivatives = np.column_stack(columns)
            by_values.append(derivatives[:, :p])
            by_states.append(derivatives[:, p:])
        columns = len(self.pieces[0].measured)
        return Slopes(point, residuals, by_values, by_states, columns, len(self.data))

    def _moved(self, point: Point, steps: Array, step: float) -> list[Point]:
        """Return the point with each value moved by its own of the steps, then each free state by
        the step.
        """
        moved = []
        for row in np.diag(steps):
            values = np.clip(point.values + row, self.low, self.high)
            moved.append(Point(values, point.states))
        for e in np.eye(len(self.free)):
            moved.append(Point(point.values, point.states + step * e))
        return moved

    def _pieces(self, i: int) -> list[Piece]:
        """Return the pieces of record i."""
        twin = self.twin
        data = self.twin.checked(self.data[i])
        if twin.dynamics is not None:
            measured = inverse_dynamics.measured_torque(data, twin.columns)
            spread = {}
            for name, values in measured.items():
                spread[name] = _norm(values)
            return [Piece(i, None, 0, measured, spread, np.zeros(0))]
        period = twin.step(data)
        first = round(twin.start / period)
        last = len(data[twin.columns.time]) - 1
        count = 1
        if not self.whole:
            shortest = max(twin.window, (records.MIN_SAMPLES + 1) * period)
            count = max(1, int((last - first) * period / shortest + 0.01))
        ends = np.linspace(first, last, count + 1).round().astype(int)
        x = [data[name] for name in twin.columns.x]
        rates = [records.rate(column, period) for column in x]
        varied = twin.hidden_spreads(data, period)
        for column in (*x, *rates):
            varied.append(column.std() or 1.0)
        names = [*twin.columns.x]
        skipped = 0
        if self.closed:
            names.append(twin.columns.u)
            skipped = round((twin.score_from - twin.start) / period)
        spread = {name: _norm(data[name]) for name in names}
        pieces = []
        for first, last in itertools.pairwise(ends):
            duration = None
            if count > 1:
                duration = float(period * (last - first))
            part = twin.part(self.data[i], float(period * first), duration, self.closed)
            measured = {}
            for name in names:
                measured[name] = data[name][first + skipped : last + 1]
            scales = STATE_SCALE * np.array(varied)[self.free]
            pieces.append(Piece(i, part, skipped, measured, spread, scales))
        return pieces


def _norm(values: Array) -> float:
    """Return the norm of a column about its mean; 1 for a constant one."""
    return float(np.linalg.norm(values - values.mean())) or 1.0


def _steps(scenario: Scenario, halvings: int) -> Fields:
    """Return integrator and step of a corrected replay.

    RK4 has errors of first order only where dry friction changes its direction. It cannot integrate
    friction that has a state.
    """
    integrator = "RK4"
    step = scenario.control_period / math.ceil(scenario.control_period / MAX_STEP - 1e-9)
    if scenario.input_delay or any(part.keeps_state for part in scenario.friction):
        integrator = scenario.resolved.integrator
        step = scenario.resolved.physics_step
    return {"integrator": integrator, "physics_step": step / 2**halvings}


def _scale(quantity: Quantity) -> float:
    """Return the scale of a quantity: its magnitude, at least a hundredth of its range; 1e-3 for 0
    without a range.
    """
    span = quantity.most - quantity.least
    if np.isfinite(span):
        return max(abs(quantity.value), 0.01 * span)
    return abs(quantity.value) or 1e-3
