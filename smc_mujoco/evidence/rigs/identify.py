"""Identification: from records to a rig's quantities, with standard errors, correlations and the
fit on each record.

The quantities are found by least squares of what the twin predicts: positions, and in a closed loop
u, each relative to its variation in the record. A record is first replayed in short pieces under
the recorded command, each from a state that is found along with the quantities, because the cost of
pieces is smooth. If the machine's controller is known, the record is then replayed as a whole with
the loop closed, from the values that the pieces gave. All runs of a step are one batch.
`mujoco.sysid` is not used: it replays recorded controls in an open loop, without controllers,
encoders and delays, and needs ten more packages.
"""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from smc_mujoco.common.constraints import Seed, Whole, constrained
from smc_mujoco.common.errors import ScenarioError, find, shown, whole
from smc_mujoco.common.files import write_json
from smc_mujoco.common.progress import bar
from smc_mujoco.common.text import joined
from smc_mujoco.evidence.rigs import search
from smc_mujoco.evidence.rigs.records import Columns, Record, percent
from smc_mujoco.evidence.rigs.replays import Point, Replays, Slopes, cost
from smc_mujoco.evidence.rigs.rig import RADIANS_GAIN, Fall, Quantity, Rig, Source
from smc_mujoco.evidence.rigs.rig import rig as find_rig
from smc_mujoco.evidence.rigs.uncertainty import BLOCKS, MAX_CORRELATION, statistics
from smc_mujoco.mechanisms.hardware.part import column_ends
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

# Fields of a run's scenario that a rig made from its plant takes over.
SETTINGS = (
    "control_period",
    "friction",
    "contact",
    "actuator",
    "sensor",
    "u_max",
    "input_delay",
    "velocity",
    "model",
)
# Frictions and inertias of the library's plants, which are 0 or more.
FRICTIONS = frozenset(("b", "bq", "b1", "b2", "cf", "cfq", "cf1", "cf2", "delta"))
INERTIAS = frozenset(("J", "Jc"))
POOR_FIT = (
    80.0  # percent: a fit below this may mean that the search ended in the wrong place; chosen
)
PERFECT_FIT = 99.99  # percent: residuals beyond it are the simulation's; chosen
# factor between a quantity before and after, beyond which a column may be in another unit; chosen
UNIT_FACTOR = 5.0
FACTOR_TOLERANCE = 0.1  # relative difference up to which such factors count as the same; chosen
Count = Annotated[int, Whole(low=1, high=1000)]
MAX_FIT_LOSS = 0.1  # percent, by which the fit of a whole record may fall without a note; chosen


@dataclasses.dataclass(frozen=True)
class Identified:
    """The quantities of a rig that were found from records, and how well they fit.

    Fits are those of `Rig.fit`, in an open loop with short steps; for `fits` the states at the
    starts are found too.
    """

    rig: Rig  # with the values found
    before: Rig  # with the values before
    values: Mapping[str, float]  # quantity -> value found
    errors: Mapping[str, float]  # quantity -> its standard error
    correlations: np.ndarray  # of the errors, (p, p), in the order of `values`
    fits: tuple[Mapping[str, float], ...]  # of each record
    fits_before: tuple[Mapping[str, float], ...]
    predictions: tuple[
        tuple[Record, Record, np.ndarray], ...
    ]  # predicted columns, measured ones, and their times
    evaluations: int  # how many parameter sets were simulated
    independent: float  # how many samples of the residuals are independent of each other

    @property
    def notes(self) -> list[str]:
        """Sentences on what the records cannot determine, and on a poor fit."""
        sentences = []
        for (i, second), (j, first) in itertools.product(enumerate(self.values), repeat=2):
            if j < i and abs(correlation := self.correlations[i, j]) > MAX_CORRELATION:
                sentences.append(
                    f"{first} and {second} cannot be told apart (correlation {correlation:.3f})"
                )
        for name, value in self.values.items():
            quantity = self.rig.quantities[name]
            if value in (quantity.least, quantity.most):
                sentences.append(
                    f"{name} is at the end of its range, {value:g} {quantity.unit}".rstrip()
                )
            elif self.errors[name] > abs(value):
                sentences.append(f"{name} may as well be 0 ({value:.3g} ± {self.errors[name]:.2g})")
        return sentences + self._scale_notes() + self._loss_notes() + self._doubts()

    def _scale_notes(self) -> list[str]:
        """Sentences on quantities that cannot be negative and are far from their values before."""
        before = {name: self.before.quantities[name] for name in self.values}
        positive = {name: q.value for name, q in before.items() if q.least >= 0.0 and q.value > 0.0}
        factors = {name: self.values[name] / value for name, value in positive.items()}
        far = {}
        for name, factor in factors.items():
            if not 1.0 / UNIT_FACTOR < factor < UNIT_FACTOR:
                far[name] = factor
        if not far:
            return []
        middle = float(np.median(list(far.values())))
        if len(far) > 1 and all(
            abs(factor / middle - 1.0) < FACTOR_TOLERANCE for factor in far.values()
        ):
            return [
                f"{joined(list(far))} are {middle:.3g} times what they were before: look at the unit of the command"
            ]
        changes = [f"{name} is {factor:.3g} times its value before" for name, factor in far.items()]
        return [
            f"{joined(changes)}: look at the units of the columns, unless the values before were only a guess"
        ]

    def _doubts(self) -> list[str]:
        """Sentences on residuals that the standard errors do not allow for, and on a poor fit."""
        sentences = []
        worst = min(min(fit.values()) for fit in self.fits)
        if self.independent < BLOCKS[0] and worst < PERFECT_FIT and self.rig.controller is None:
            sentences.append(
                f"the residuals are slow, with {self.independent:.0f} independent samples, as where a force was not "
                "recorded: true errors may be several standard errors"
            )
        if worst < POOR_FIT:
            if isinstance(worst, Fall):
                poor = f"the twin {worst}"
            else:
                poor = f"the worst fit is {worst:.0f} %"
            sentences.append(
                f"{poor}: the model lacks something, a column is wrong or in another unit, or "
                "the search ended in a local minimum; start from other values, with more starts or another seed"
            )
        return sentences

    def _loss_notes(self) -> list[str]:
        """Sentences on whole records that the values before repeat better."""
        sentences = []
        for i, (fit, before) in enumerate(zip(self.fits, self.fits_before, strict=True)):
            if min(fit.values()) < min(before.values()) - MAX_FIT_LOSS:
                sentences.append(
                    f"record {i + 1}, repeated as a whole, fits by {percent(fit)} and by {percent(before)} with the "
                    "values before, though its pieces fit better: errors add up over the record, or the model lacks "
                    "something"
                )
        return sentences

    @constrained
    def drawn(self, count: Count = 8, seed: Seed = 0) -> Rig:
        """Return the rig with an ensemble of other parameter sets that the records allow, for
        rankings over them.

        They are drawn from the normal distribution of the errors, and cut to the ranges.
        """
        names = list(self.values)
        rng = np.random.default_rng(seed)
        spread, middle = (
            np.array([of[name] for name in names]) for of in (self.errors, self.values)
        )
        draws = rng.multivariate_normal(
            middle, self.correlations * np.outer(spread, spread), count, method="eigh"
        )
        known = [self.rig.quantities[name] for name in names]
        kept = np.clip(
            draws, [quantity.least for quantity in known], [quantity.most for quantity in known]
        )
        return dataclasses.replace(
            self.rig, ensemble=tuple(dict(zip(names, row, strict=True)) for row in kept.tolist())
        )

    def __repr__(self) -> str:
        values = ", ".join(
            f"{name} = {value:.4g} ± {self.errors[name]:.1g}" for name, value in self.values.items()
        )
        return f"identified({self.rig.name!r}, {values})"

    def save(self, path: str | Path) -> Path:
        """Write values, errors, correlations and fits to a JSON file. Return its path."""
        quantities = {}
        for name, value in self.values.items():
            quantities[name] = {
                "value": value,
                "error": self.errors[name],
                "unit": self.rig.quantities[name].unit,
            }
        about = {
            "rig": self.rig.name,
            "quantities": quantities,
            "correlations": self.correlations.tolist(),
        }
        for key, fits in (("fits", self.fits), ("fits_before", self.fits_before)):
            about[key] = [
                {
                    column: str(value) if isinstance(value, Fall) else value
                    for column, value in fit.items()
                }
                for fit in fits
            ]
        return write_json(Path(path), about)

    def figure(self, path: str | Path, record: int = 0) -> list[Path]:
        """Draw measured and predicted columns of a record, and their residuals, as PATH.svg and
        PATH.png.
        """
        from smc_mujoco.evidence.rigs.figure import residual_figure

        whole("record", record, 0, len(self.fits) - 1)
        predicted, measured, t = self.predictions[record]
        fits = {"twin": self.fits[record]}
        return residual_figure(
            self.rig.label, t, measured, {"twin": predicted}, fits, self.rig.units, path
        )


@constrained
def identify(
    rig: Rig | Plant | str,
    records: Source | Sequence[Source],
    quantities: Sequence[str] | None = None,
    *,
    start: Mapping[str, float] | None = None,
    starts: Count = 4,
    seed: Seed = 0,
    most: int = 30,
    progress: bool = False,
) -> Identified:
    """Find a rig's quantities from records.

    Args:
      rig: a Rig or its name; or a Plant, whose records are traces, or columns named as those of
        traces.
      records: one record or several: columns by name (see `Rig.columns`), or traces of simulated
        runs.
      quantities: names of those to find; None: the rig's `free`, or all parameters of a plant that
        are not 0.
      start: quantity -> value, SI units, from which the search starts; those not given start at the
        rig's own.
      starts: number of parameter sets from which the search may start: the present one, and the
        best of random ones, which differ from it by up to a factor of 100.
      seed: of these starts. The same seed gives the same result.
      most: largest number of steps of the search.
      progress: whether to show a progress bar.

    Raises:
      ScenarioError: an unknown quantity, not a record, columns in another unit or in the wrong
        order, or records that cannot tell the quantities apart.
    """
    many: list[Any]
    if isinstance(records, (list, tuple)):
        many = list(records)
    else:
        many = [records]
    if not many:
        raise ScenarioError("there are no records: give at least one")
    twin, data = _twin(rig, many)
    twin = twin.with_values(start or {})
    names = _checked_names(twin, quantities)
    fits_before = tuple(twin.fits(data))  # also refuses records that are too short
    for record, fit in zip(data, fits_before, strict=True):
        twin.refuse_degrees(record, fit)
    with bar(f"identify {twin.name}", 2 * most * (2 * len(names) + 1), shown=progress) as drawn:
        replays, slopes, by_steps = _solved(twin, names, data, starts, seed, most, drawn.advance)
        errors, correlations, independent = statistics(replays, slopes, by_steps)
    values = replays.values(slopes.point)
    fitted = twin.with_values(values, "identified from records")
    states = _starting_states(fitted, data, replays, slopes.point)
    steps = replays.short_steps
    return Identified(
        rig=fitted,
        before=twin,
        values=values,
        errors=errors,
        correlations=correlations,
        fits=tuple(fitted.fits(data, states=states, **steps)),
        fits_before=tuple(twin.fits(data, **steps)) if steps else fits_before,
        predictions=tuple(fitted.predictions(data, states=states, **steps)),
        evaluations=replays.evaluations,
        independent=independent,
    )


def _checked_names(twin: Rig, quantities: Sequence[str] | None) -> list[str]:
    """Return the names of the quantities to find."""
    names = list(twin.free if quantities is None else quantities)
    for name in names:
        find(f"quantity of {twin.name}", name, twin.quantities)
        if names.count(name) > 1:
            raise ScenarioError(f"quantities have {name} {names.count(name)} times: name it once")
    if not names:
        raise ScenarioError(
            f"{twin.name} has no quantities to find: name some, of {', '.join(twin.quantities)}"
        )
    return names


def _solved(
    twin: Rig,
    names: list[str],
    data: Sequence[Mapping[str, Any]],
    starts: int,
    seed: int,
    most: int,
    report: Any,
) -> tuple[Replays, Slopes, np.ndarray]:
    """Return the replays of the last search, their slopes at the solution, and its error due to
    steps, (p,).
    """
    pieces = Replays(twin, names, data, False, report)
    reached = search.search(pieces, starts, seed, most)
    if twin.controller is None:
        _refuse_swapped(twin, names, data, reached)
        slopes, moved = search.accurate(pieces, reached)
        return pieces, search.not_worse(pieces, slopes), moved
    closed = Replays(twin, names, data, True, report)
    points = [closed.start, Point(reached.point.values, closed.start.states)]
    if len(closed.free):  # a record may begin at rest with a jump of the command
        points += [closed.at_rest(point) for point in points]
    slopes = search.refine(closed, search.better(closed, *points), most)
    closed.evaluations += pieces.evaluations
    return closed, slopes, np.zeros(len(names))


def _refuse_swapped(
    twin: Rig, names: list[str], data: Sequence[Mapping[str, Any]], reached: Slopes
) -> None:
    """Raise ScenarioError if records of one joint fit badly as they are, and well with position and
    command swapped.
    """
    (x, *others), u = twin.columns.x, twin.columns.u
    if others or twin.columns.state or twin.dynamics is not None or reached.fit >= POOR_FIT:
        return
    swapped = Replays(
        twin, names, [dict(record) | {x: record[u], u: record[x]} for record in data], False
    )
    fit = search.search(swapped, 4, 0, search.ROUGH_STEPS).fit
    if fit > max(RADIANS_GAIN, reached.fit + RADIANS_GAIN):
        raise ScenarioError(
            f"the columns {x} and {u} of the record of {twin.name} look swapped, as its pieces fit by {fit:.0f} % with "
            f"them exchanged and by {reached.fit:.0f} % as they are: name the position {x} and the command {u}"
        )


def _starting_states(
    fitted: Rig, data: Sequence[Mapping[str, Any]], replays: Replays, point: Point
) -> list[np.ndarray | None]:
    """Return the state from which each record is repeated as a whole, (2n,); None for the measured
    one.

    In an open loop these are the measured state, that of the first piece, or one that fits the
    whole record better.
    """
    if not len(replays.free):
        return [None] * len(data)
    if replays.closed:
        return [replays.state(point, k) for k in range(len(data))]
    whole_records = Replays(fitted, [], data, False, whole=True)
    whole_records.steps = replays.short_steps
    firsts = []
    for i in range(len(data)):
        firsts.append(next(k for k, piece in enumerate(replays.pieces) if piece.record == i))
    candidates = [whole_records.start, Point(np.zeros(0), point.states[firsts])]
    for candidate in tuple(candidates):
        slopes = whole_records.slopes(candidate)
        candidates.append(Point(candidate.values, candidate.states + slopes.moves(np.zeros(0))))
    costs = np.array(
        [[cost([rows]) for rows in pieces] for pieces in whole_records.residuals(candidates)]
    )
    best = costs.argmin(axis=0)
    return [whole_records.state(candidates[best[i]], i) for i in range(len(data))]


def _twin(given: Rig | Plant | str, many: Sequence[Source]) -> tuple[Rig, list[Mapping[str, Any]]]:
    """Return the rig to identify, and its records as columns."""
    if isinstance(given, str):
        given = find_rig(given)
    traces = [record for record in many if isinstance(record, Trace)]
    if isinstance(given, Plant):
        given = _of_plant(given, traces[0].scenario if traces else None)
    if not isinstance(given, Rig):
        raise ScenarioError(
            f"cannot identify {shown(given)}: give a rig, the name of one, or a smc.Plant"
        )
    return given.reading(many)


def _of_plant(plant: Plant, base: Scenario | None) -> Rig:
    """Return a rig whose quantities are a plant's parameters, with the parts of a run's scenario
    `base`.
    """
    settings = {}
    if base is not None:
        settings = {}
        for name in SETTINGS:
            if getattr(base, name) is not None:
                settings[name] = getattr(base, name)
    lower = dict.fromkeys(plant.parameters, -np.inf)
    lower |= dict.fromkeys(
        (FRICTIONS | INERTIAS | {*plant.dry, *plant.added}) & set(plant.parameters), 0.0
    )
    lower |= dict.fromkeys(plant.positive, 1e-6)
    ends = column_ends(plant)
    return Rig(
        name=plant.name,
        label=plant.label or plant.name,
        quantities={
            name: Quantity(value, "", "nominal value of the plant", lower[name])
            for name, value in plant.parameters.items()
        },
        machine=lambda q: settings | {"plant": dataclasses.replace(plant, parameters=vars(q))},
        columns=Columns(
            x=tuple(f"x{end}" for end in ends), u=f"u{ends[0]}", reference=f"r{ends[0]}"
        ),
        free=tuple(name for name, value in plant.parameters.items() if value and name != "grav"),
    )
