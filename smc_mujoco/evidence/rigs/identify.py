"""Identification: from records to a rig's quantities, with standard errors, correlations and the fit on each record.

The quantities are found by least squares of what the twin predicts: positions, and in a closed loop u, each relative to
its variation in the record. A record is first replayed in short pieces, each from its measured state under the recorded
command, because the cost of pieces is smooth. Then it is replayed as a whole, with the loop closed if the controller is
known. All runs of a step are one batch. The search is scipy's trust region. `mujoco.sysid` is not used: it replays
recorded controls in an open loop, without controllers, encoders and delays, and needs ten more packages.

A cubic through the first samples of a record gives the velocity at its start, which is wrong if the command jumps
there. So that velocity is found along with the quantities, and in an open loop the position too, unless the residuals
begin when the start has no effect any more.

Standard errors allow for residuals that depend on their neighbours: they come from a jackknife, at first order, that
leaves out one block of time after the other. A closed loop feeds the noise of its measurement back. If one short
transient decides a quantity, the other blocks do not show the effect of that noise. So closed loops are also simulated
with their own noise and rounding, and a standard error is at least the deviation that these cause.
"""

import dataclasses
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError, ScenarioWarning, find, shown, whole
from smc_mujoco.common.files import write_json
from smc_mujoco.common.progress import bar
from smc_mujoco.evidence.rigs import records as files
from smc_mujoco.evidence.rigs.records import Columns, Record
from smc_mujoco.evidence.rigs.rig import Quantity, Rig, Source
from smc_mujoco.evidence.rigs.rig import rig as find_rig
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.perturbations import Noise
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

STEP = 2e-3  # of a quantity's scale, for central differences; chosen: dry friction makes shorter ones rough
SPREAD = 0.2  # standard deviation of the logarithm of a quantity in further starts of the search; chosen
MAX_CORRELATION = 0.98  # beyond this correlation records cannot tell two quantities apart; chosen
REPEATS = 24  # simulated repetitions of the records of a closed loop, for standard errors; chosen
POOR = 80.0  # percent: a fit below this may mean that the search ended in the wrong place; chosen
BLOCKS = 25  # blocks of time in a record that is replayed as a whole, for standard errors; chosen
STATE_SCALE = 0.05  # scale of a state at the start, relative to the standard deviation of its column or rate; chosen
SAME = 1e-6  # below this ratio of the Jacobian's singular values quantities cannot be told apart; chosen
WORST = 1.0  # largest residual of a sample, relative to the norm of the record; that of a run that fails
ENDING = 1e-6  # relative changes of cost and point at which the search ends; chosen
INSIDE = 1e-9  # distance of the search's start from the ends of its ranges, as scipy demands
# Fields of a run's scenario that a rig made from its plant takes over.
OF_RUN = ("control_period", "friction", "contact", "actuator", "sensor", "u_max", "input_delay", "velocity", "model")


@dataclasses.dataclass(frozen=True)
class Identified:
    """The quantities of a rig that were found from records, and how well they fit.

    Attributes:
      rig: the rig with the values found.
      before: the rig with the values before.
      values, errors: quantity -> value found, and its standard error.
      correlations: of the errors, (p, p), in the order of `values`.
      fits, fits_before: `Rig.fit` of each record after and before; for `fits` the states at the starts are those found.
      predictions: of each record, the predicted columns, the measured columns and their times.
      evaluations: how many sets of values were simulated.
    """

    rig: Rig
    before: Rig
    values: Mapping[str, float]
    errors: Mapping[str, float]
    correlations: np.ndarray
    fits: tuple[Mapping[str, float], ...]
    fits_before: tuple[Mapping[str, float], ...]
    predictions: tuple[tuple[Record, Record, np.ndarray], ...]
    evaluations: int

    @property
    def notes(self) -> list[str]:
        """Sentences on what the records cannot determine, and on a poor fit."""
        names, found = list(self.values), []
        for i, one in enumerate(names):
            for j, other in enumerate(names[:i]):
                if abs(self.correlations[i, j]) > MAX_CORRELATION:
                    found.append(f"{other} and {one} cannot be told apart (correlation {self.correlations[i, j]:.3f})")
        for name, value in self.values.items():
            quantity = self.rig.quantities[name]
            if value in (quantity.least, quantity.most):
                found.append(f"{name} is at the end of its range, {value:g} {quantity.unit}".rstrip())
            elif self.errors[name] > abs(value):
                found.append(f"{name} may as well be 0 ({value:.3g} ± {self.errors[name]:.2g})")
        if (worst := min(min(fit.values()) for fit in self.fits)) < POOR:
            found.append(
                f"the worst fit is {worst:.0f} %: the model lacks something, a column is wrong or in another unit, or "
                "the search ended in a local minimum; start from other values, with more starts or another seed"
            )
        return found

    def drawn(self, count: int = 8, seed: int = 0) -> Rig:
        """Return the rig with an ensemble of other sets of values that the records allow, for rankings over them.

        Args:
          count: number of sets. They are drawn from the normal distribution of the errors, and cut to the ranges.
          seed: of the draws.

        Raises:
          ScenarioError: count or seed is out of range.
        """
        whole("count", count, 1, 1000)
        names, rng = list(self.values), np.random.default_rng(whole("seed", seed, 0, 2**53 - 1))
        spread, middle = (np.array([each[name] for name in names]) for each in (self.errors, self.values))
        draws = rng.multivariate_normal(middle, self.correlations * np.outer(spread, spread), count, method="eigh")
        known = [self.rig.quantities[name] for name in names]
        kept = np.clip(draws, [each.least for each in known], [each.most for each in known])
        return dataclasses.replace(
            self.rig, ensemble=tuple(dict(zip(names, row, strict=True)) for row in kept.tolist())
        )

    def __repr__(self) -> str:
        found = ", ".join(f"{name} = {value:.4g} ± {self.errors[name]:.1g}" for name, value in self.values.items())
        return f"identified({self.rig.name!r}, {found})"

    def save(self, path: str | Path) -> Path:
        """Write values, errors, correlations and fits to a JSON file. Return its path."""
        quantities = {
            name: {"value": value, "error": self.errors[name], "unit": self.rig.quantities[name].unit}
            for name, value in self.values.items()
        }
        return write_json(
            Path(path),
            {
                "rig": self.rig.name, "quantities": quantities, "correlations": self.correlations.tolist(),
                "fits": [dict(fit) for fit in self.fits], "fits_before": [dict(fit) for fit in self.fits_before],
            },
        )  # fmt: skip

    def figure(self, path: str | Path, record: int = 0) -> list[Path]:
        """Draw measured and predicted columns of a record, and their residuals, as PATH.svg and PATH.png.

        Args:
          path: of the figure.
          record: index of the record.

        Returns:
          The paths of both files.
        """
        from smc_mujoco.evidence.rigs.figure import residual_figure

        whole("record", record, 0, len(self.fits) - 1)
        predicted, measured, t = self.predictions[record]
        fits = {"twin": self.fits[record]}
        return residual_figure(self.rig.label, t, measured, {"twin": predicted}, fits, self.rig.units, path)


def identify(
    of: Rig | Plant | str,
    records: Source | Sequence[Source],
    quantities: Sequence[str] | None = None,
    *,
    starts: int = 4,
    seed: int = 0,
    most: int = 30,
    progress: bool = False,
) -> Identified:
    """Find a rig's quantities from records.

    Args:
      of: a Rig or its name; or a Plant, whose records are traces, or columns named as those of traces.
      records: one record or several: columns by name (see `Rig.columns`), or traces of simulated runs.
      quantities: names of those to find; None: the rig's `free`, or all parameters of a plant that are not 0.
      starts: number of sets of values from which the search may start: the present one, and random ones about it.
      seed: of these starts. The same seed gives the same result.
      most: largest number of steps of the search.
      progress: whether to show a progress bar.

    Raises:
      ScenarioError: an unknown quantity, not a record, or records that cannot tell the quantities apart.
    """
    many: list[Any] = list(records) if isinstance(records, (list, tuple)) else [records]
    if not many:
        raise ScenarioError("there are no records: give at least one")
    twin, data = _twin(of, many)
    names = list(twin.free if quantities is None else quantities)
    for name in names:
        find(f"quantity of {twin.name}", name, twin.quantities)
        if names.count(name) > 1:
            raise ScenarioError(f"quantities have {name} {names.count(name)} times: name it once")
    if not names:
        raise ScenarioError(f"{twin.name} has no quantities to find: name some, of {', '.join(twin.quantities)}")
    whole("starts", starts, 1, 1000)
    whole("seed", seed, 0, 2**53 - 1)
    checked = [twin.checked(record) for record in data]
    fits_before = tuple(twin.fits(data))  # also refuses records that are too short
    for record, fit in zip(data, fits_before, strict=True):
        twin.refuse_degrees(record, fit)
    with bar(f"identify {twin.name}", most * (2 * len(names) + 1), shown=progress) as drawn:
        search = Search(twin, names, data, checked, drawn.advance)
        stages = ("pieces", "whole") if twin.dynamics is None and twin.window else ("whole",)
        z = search.best_start(stages[0], starts, seed)
        if stages[0] == "pieces":
            z = search.better("whole", z, search.refine("pieces", z, most))
        z = search.refine_from_rest(z, most)
        values, errors, correlations = search.statistics(z)
    found, states = twin.with_values(values, "identified from records"), search.states(z)
    return Identified(
        rig=found, before=twin, values=values, errors=errors, correlations=correlations,
        fits=tuple(found.fits(data, states=states)), fits_before=fits_before,
        predictions=tuple(found.predictions(data, states=states)), evaluations=search.evaluations,
    )  # fmt: skip


class Search:
    """Least squares over some quantities of a rig, and over the states at the starts of its records.

    A point z of the search, (p + records * s,), has first the p quantities. Then follow, for each record, the s free
    numbers of the state at its start, as differences from the measured ones. All are in units of their scales.
    """

    def __init__(
        self,
        twin: Rig,
        names: list[str],
        data: list[Mapping[str, Any]],
        checked: list[Record],
        report: Callable[[int], None],
    ):
        self.twin, self.names, self.data, self.checked, self.report = twin, names, data, checked, report
        known = [twin.quantities[name] for name in names]
        self.scales = np.array([_scale(quantity) for quantity in known])
        n, own = len(twin.columns.x), bool(twin.columns.state) or twin.dynamics is not None
        forgotten = own or twin.score_from > twin.start
        self.free_states = np.zeros(0, int) if forgotten else np.arange(2 * n)[n if twin.controller else 0 :]
        self.measured = [] if own else [self._measured_state(i) for i in range(len(data))]
        self.state_scales = (
            [self._state_scales(i)[self.free_states] for i in range(len(data))] if len(self.free_states) else []
        )
        unbounded = np.full(len(self.free_states) * len(data), np.inf)
        self.low = np.append([quantity.least for quantity in known] / self.scales, -unbounded)
        self.high = np.append([quantity.most for quantity in known] / self.scales, unbounded)
        self.evaluations = 0

    def rig(self, z: np.ndarray) -> Rig:
        """Return the rig at a point of the search."""
        return self.twin.with_values(self.values(z))

    def states(self, z: np.ndarray) -> list[np.ndarray | None]:
        """Return positions and velocities at the start of each record at a point, (2n,); None if they are not free."""
        if not len(self.free_states):
            return [None] * len(self.data)
        found = []
        for i, moved in enumerate(z[len(self.names) :].reshape(len(self.data), -1)):
            state = self.measured[i].copy()
            state[self.free_states] += moved * self.state_scales[i]
            found.append(state)
        return found

    def at_rest(self, z: np.ndarray) -> np.ndarray:
        """Return the point with velocity 0 at the start of each record. States at the start must be free."""
        rest, n = z.copy(), len(self.twin.columns.x)
        moved = rest[len(self.names) :].reshape(len(self.data), -1)
        moved[:, -n:] = [-self.measured[i][n:] / self.state_scales[i][-n:] for i in range(len(self.data))]
        return rest

    def _measured_state(self, i: int) -> np.ndarray:
        """Return the measured positions and velocities at the start of a record, (2n,)."""
        period = self.twin.step(self.checked[i])
        return np.concatenate(files.state(self.checked[i], self.twin.columns, period, round(self.twin.start / period)))

    def _state_scales(self, i: int) -> np.ndarray:
        """Return the scales of positions and velocities at the start of a record, (2n,)."""
        columns, period = [self.checked[i][name] for name in self.twin.columns.x], self.twin.step(self.checked[i])
        varied = [each.std() for each in (*columns, *(files.rate(each, period) for each in columns))]
        return STATE_SCALE * np.array([each or 1.0 for each in varied])

    def values(self, z: np.ndarray) -> dict[str, float]:
        """Return the quantities at a point of the search, cut to their ranges."""
        known = [self.twin.quantities[name] for name in self.names]
        found = np.clip(
            z[: len(self.names)] * self.scales, [each.least for each in known], [each.most for each in known]
        )
        return dict(zip(self.names, found.tolist(), strict=True))

    def residuals(self, points: Sequence[np.ndarray], stage: str) -> list[np.ndarray]:
        """Return the residuals at each point, (N,) each.

        Args:
          stage: "pieces" or "whole": how records are replayed.
        """
        compared = self.compared(points, stage)
        return [np.concatenate([self._relative(*each) for each in one]) for one in compared]

    def compared(self, points: Sequence[np.ndarray], stage: str) -> list[list[tuple[Record, Record, Any]]]:
        """Return, for each point and piece, the predicted columns, the measured columns, and the record's index.

        All runs are one batch.
        """
        self.evaluations += len(points)
        rigs = [self.rig(z) for z in points]
        if self.twin.dynamics is not None:
            found = [rig.predictions(self.data) for rig in rigs]
        else:
            plan = [(i, at) for i in range(len(self.data)) for at in self._pieces(i, stage)]
            with warnings.catch_warnings():  # about values that are only tried
                warnings.simplefilter("ignore", ScenarioWarning)
                scenarios = [
                    rig.replay(
                        self.data[i], *at, rounded=False, closed=stage == "whole",
                        state=states[i] if at[0] == rig.start else None,
                    )
                    for rig, states in zip(rigs, map(self.states, points), strict=True)
                    for i, at in plan
                ]  # fmt: skip
                traces = run(scenarios)
            size = len(plan)
            found = [
                [
                    self._compared(rig, i, at, trace)
                    for (i, at), trace in zip(plan, traces[k * size :][:size], strict=True)
                ]
                for k, rig in enumerate(rigs)
            ]
        self.report(len(points))
        return found

    def _pieces(self, i: int, stage: str) -> list[tuple[float, float | None]]:
        """Return start and duration of the pieces of record i, s; None as duration: to its end."""
        t = self.checked[i][self.twin.columns.time]
        whole, start = float(t[-1] - t[0]), self.twin.start
        count = int((whole - start) / self.twin.window) if stage == "pieces" or self.twin.controller is None else 0
        if count < 2:
            return [(start, None)]
        return [(start + k * self.twin.window, self.twin.window) for k in range(count)]

    def _compared(self, rig: Rig, i: int, at: tuple[float, float | None], trace: Trace) -> tuple[Record, Record, int]:
        """Return an item of `compared`, for the piece `at` of record i, from the trace of its replay."""
        first = round(at[0] / trace.scenario.control_period)
        skipped = 0 if at[1] else round((rig.score_from - rig.start) / trace.scenario.control_period)
        predicted = {name: values[skipped:] for name, values in rig.predicted(trace).items()}
        measured = {
            name: self.checked[i][name][first + skipped : first + skipped + len(values)]
            for name, values in predicted.items()
        }
        return predicted, measured, i

    def _relative(self, predicted: Record, measured: Record, which: Any) -> np.ndarray:
        """Return the residuals of all columns, one after the other, relative to each column's variation.

        Args:
          which: index of the record whose variation counts; otherwise that of `measured` does.
        """
        found = []
        for name, values in predicted.items():
            column = self.checked[which][name] if isinstance(which, int) else measured[name]
            spread = np.linalg.norm(column - column.mean()) or 1.0
            residual = (measured[name] - values) / spread
            found.append(np.clip(np.nan_to_num(residual, nan=WORST, posinf=WORST, neginf=-WORST), -WORST, WORST))
        return np.concatenate(found)

    def best_start(self, stage: str, starts: int, seed: int) -> np.ndarray:
        """Return the point of least cost among the present values and `starts` - 1 random ones about them."""
        rng, p = np.random.default_rng(seed), len(self.names)
        here = np.zeros(len(self.low))
        here[:p] = np.array([self.twin.values[name] for name in self.names]) / self.scales
        points = [here]
        for _ in range(starts - 1):
            other = here.copy()
            other[:p] *= np.exp(SPREAD * rng.standard_normal(p))
            points.append(np.clip(other, self.low, self.high))
        return self.better(stage, *points)

    def better(self, stage: str, *points: np.ndarray) -> np.ndarray:
        """Return the point of least cost, the first one if several are equal."""
        return points[int(np.argmin([float(np.sum(residual**2)) for residual in self.residuals(points, stage)]))]

    def refine(self, stage: str, z: np.ndarray, most: int) -> np.ndarray:
        """Return the point of least squares near z, after at most `most` steps."""
        from scipy.optimize import least_squares

        inside = np.clip(z, self.low + INSIDE, self.high - INSIDE)
        slopes: Any = lambda z: self.jacobian(z, stage)  # noqa: E731  # typed Any, as scipy's stub allows no function
        found = least_squares(
            lambda z: self.residuals([z], stage)[0], inside, slopes, bounds=(self.low, self.high), max_nfev=most,
            ftol=ENDING, xtol=ENDING,
        )  # fmt: skip
        return found.x

    def refine_from_rest(self, z: np.ndarray, most: int) -> np.ndarray:
        """Return the better point of least squares: near z, or near z with velocities 0 at the starts of the records.

        Dry friction makes a kink in the cost at velocity 0, before which a search from another velocity ends.
        """
        if not len(self.free_states):
            return self.refine("whole", z, most)
        z = self.refine("whole", self.better("whole", z, self.at_rest(z)), most)
        rest = self.better("whole", z, self.at_rest(z))
        return z if rest is z else self.refine("whole", rest, most)

    def jacobian(self, z: np.ndarray, stage: str) -> np.ndarray:
        """Return the slopes of the residuals, (N, len(z)), by differences that stay within the ranges."""
        ahead = [np.clip(z + STEP * e, self.low, self.high) for e in np.eye(len(z))]
        back = [np.clip(z - STEP * e, self.low, self.high) for e in np.eye(len(z))]
        both = self.residuals(ahead + back, stage)
        return np.column_stack([(both[i] - both[i + len(z)]) / (ahead[i][i] - back[i][i]) for i in range(len(z))])

    def statistics(self, z: np.ndarray) -> tuple[dict[str, float], dict[str, float], np.ndarray]:
        """Return values, standard errors and correlations at the solution.

        Raises:
          ScenarioError: records that cannot tell the quantities apart.
        """
        slopes, r = self.jacobian(z, "whole"), self.residuals([z], "whole")[0]
        J, by_states = np.split(slopes, [len(self.names)], axis=1)
        sizes = np.linalg.norm(J, axis=0)
        for name, size in zip(self.names, sizes, strict=True):
            if size == 0.0:
                raise ScenarioError(f"nothing in the records depends on {name}: leave it out, or give other records")
        J = J - by_states @ np.linalg.lstsq(by_states, J, rcond=None)[0]  # the part that no state at a start can cause
        _, singular, rows = np.linalg.svd(J / sizes, full_matrices=False)
        if singular[-1] < SAME * singular[0]:
            raise self._alike(self.names[i] for i in np.argsort(-np.abs(rows[-1]))[:2])
        covariance = self._jackknife(J, r, z)
        deviation = np.sqrt(np.diag(covariance))
        with np.errstate(all="ignore"):
            correlations = np.nan_to_num(covariance / np.outer(deviation, deviation))
        deviation = np.maximum(deviation, self._fed_back(J, z))
        values = self.values(z)
        errors = dict(zip(self.names, (deviation * self.scales).tolist(), strict=True))
        self._refuse_alike(values, errors, correlations)
        return values, errors, correlations

    def _refuse_alike(self, values: dict[str, float], errors: dict[str, float], correlations: np.ndarray) -> None:
        """Raise ScenarioError for two quantities of which only a sum is known: neither is above its standard error."""
        unknown = np.array([errors[name] > abs(value) for name, value in values.items()])
        pairs = np.triu(np.abs(correlations), 1) * np.outer(unknown, unknown)
        i, j = np.unravel_index(int(pairs.argmax()), pairs.shape)
        if pairs[i, j] > MAX_CORRELATION:
            two = self.names[i], self.names[j]
            raise self._alike(f"{name} ({values[name]:.3g} ± {errors[name]:.2g})" for name in two)

    def _alike(self, quantities: Iterable[str]) -> ScenarioError:
        """Return the error that the records cannot tell some quantities apart."""
        return ScenarioError(
            f"the records of {self.twin.name} cannot tell {' and '.join(quantities)} apart: leave one out, or give a "
            "longer record or one of a richer motion, or look at its units and columns"
        )

    def _jackknife(self, J: np.ndarray, r: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the covariance of the solution, (p, p), from leaving out one block of time after the other."""
        blocks, count = [], 0
        pieces = self.compared([z], "whole")[0]
        parts = max(1, -(-BLOCKS * len(self.data) // len(pieces)))
        for predicted, _, _ in pieces:
            blocks += [count + np.arange(len(values)) * parts // len(values) for values in predicted.values()]
            count += parts
        which, A = np.concatenate(blocks), J.T @ J
        moves = np.zeros((count, J.shape[1]))
        for b in range(count):
            mine, errors = J[which == b], r[which == b]
            moves[b] = np.linalg.lstsq(A - mine.T @ mine, mine.T @ errors, rcond=None)[0]
        return (count - 1) / count * moves.T @ moves

    def _fed_back(self, J: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the deviation of the solution, (p,), that the measurement's noise causes through the controller.

        It is the root mean square over REPEATS simulations of the records with their noise and rounding, at first
        order; 0 in an open loop.
        """
        if self.twin.controller is None:
            return np.zeros(J.shape[1])
        rig, several = self.rig(z), range(len(self.data))
        known = list(zip(self.data, self.states(z), strict=True))
        calm = [rig.replay(record, rounded=False, state=state) for record, state in known]
        noisy = [
            dataclasses.replace(
                rig.replay(record, state=state), noise=Noise(files.noise(self.checked[i], rig.columns)), seed=repeat
            )
            for repeat in range(REPEATS)
            for i, (record, state) in enumerate(known)
        ]
        traces = run(calm + noisy)
        at = rig.start, None
        expected = [self._compared(rig, i, at, traces[i])[0] for i in several]
        moved = np.zeros((REPEATS, J.shape[1]))
        for repeat in range(REPEATS):
            ran = traces[len(calm) * (1 + repeat) :]
            change = [self._relative(self._compared(rig, i, at, ran[i])[0], expected[i], i) for i in several]
            moved[repeat] = np.linalg.lstsq(J, np.concatenate(change), rcond=None)[0]
        self.report(1)
        return np.sqrt(np.mean(moved**2, axis=0))


def _scale(quantity: Quantity) -> float:
    """Return the scale of a quantity: its magnitude, at least a hundredth of its range; 1e-3 for 0 without a range."""
    span = quantity.most - quantity.least
    return max(abs(quantity.value), 0.01 * span if np.isfinite(span) else 1e-3 * (quantity.value == 0.0))


def _twin(of: Rig | Plant | str, many: Sequence[Source]) -> tuple[Rig, list[Mapping[str, Any]]]:
    """Return the rig to identify, and its records as columns.

    Args:
      of: as in `identify`.
      many: the records.
    """
    if isinstance(of, str):
        of = find_rig(of)
    traces = [one for one in many if isinstance(one, Trace)]
    if isinstance(of, Plant):
        of = _of_plant(of, traces[0].scenario if traces else None)
    if not isinstance(of, Rig):
        raise ScenarioError(f"cannot identify {shown(of)}: give a rig, the name of one, or a smc.Plant")
    return of.reading(many)


def _of_plant(plant: Plant, base: Scenario | None) -> Rig:
    """Return a rig whose quantities are a plant's parameters.

    Args:
      base: scenario of a run, whose parts the rig has; None for none.
    """
    own = {}
    if base is not None:
        own = {name: getattr(base, name) for name in OF_RUN if getattr(base, name) is not None}
    least = {name: 1e-6 if name in plant.positive else -np.inf for name in plant.parameters}
    ends = [""] if plant.n == 1 else [str(i) for i in range(plant.n)]
    return Rig(
        name=plant.name,
        label=plant.label or plant.name,
        quantities={
            name: Quantity(value, "", "nominal value of the plant", least[name])
            for name, value in plant.parameters.items()
        },
        machine=lambda q: own | {"plant": dataclasses.replace(plant, parameters=vars(q))},
        columns=Columns(x=tuple(f"x{end}" for end in ends), u=f"u{ends[0]}", reference=f"r{ends[0]}"),
        free=tuple(name for name, value in plant.parameters.items() if value and name != "grav"),
    )
