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
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from smc_mujoco.common.aliases import Array, Data, Fields, Numbers
from smc_mujoco.common.constraints import Seed, Whole, constrained
from smc_mujoco.common.errors import ScenarioError, find, shown, whole
from smc_mujoco.common.files import write_json
from smc_mujoco.common.progress import bar
from smc_mujoco.identification import gauss_newton
from smc_mujoco.identification.records import Columns, Record
from smc_mujoco.identification.replays import Point, Replays, Slopes
from smc_mujoco.identification.rig import Fall, Quantity, Rig, Source
from smc_mujoco.identification.rig import rig as find_rig
from smc_mujoco.identification.standard_errors import BLOCKS, MAX_CORRELATION, statistics
from smc_mujoco.mechanisms.layout import column_ends
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
POOR_FIT = 80.0  # percent: a fit below may mean that the search ended in a wrong place; chosen
PERFECT_FIT = 99.99  # percent: residuals beyond it are the simulation's; chosen
Count = Annotated[int, Whole(low=1, high=1000)]
SLOW = (
    "the residuals are slow, as where a force was not recorded: true errors may be several "
    "standard errors"
)
POOR = (
    "the fit is poor: the model lacks something, a column is another one or in another unit "
    "(angles are in rad), or the search ended in a local minimum: start from other values, with "
    "more starts or another seed"
)


@dataclasses.dataclass(frozen=True)
class Identified:
    """The quantities of a rig that were found from records, and how well they fit.

    Fits are those of `Rig.fit`, in an open loop with short steps; for `fits` the states at the
    starts are found too.
    """

    rig: Rig  # with the values found
    before: Rig  # with the values before
    values: Numbers  # quantity -> value found
    errors: Numbers  # quantity -> its standard error
    correlations: Array  # of the errors, (p, p), in the order of `values`
    fits: tuple[Numbers, ...]  # of each record
    fits_before: tuple[Numbers, ...]
    predictions: tuple[
        tuple[Record, Record, Array], ...
    ]  # predicted columns, measured ones, and their times
    evaluations: int  # how many parameter sets were simulated
    independent: float  # how many samples of the residuals are independent of each other

    @property
    def notes(self) -> list[str]:
        """What the records cannot determine, and what to doubt."""
        notes = []
        for (i, first), (j, second) in itertools.combinations(enumerate(self.values), 2):
            correlation = self.correlations[i, j]
            if abs(correlation) > MAX_CORRELATION:
                notes.append(
                    f"{first} and {second} cannot be told apart (correlation {correlation:.3f})"
                )
        for name, value in self.values.items():
            quantity = self.rig.quantities[name]
            if value in (quantity.least, quantity.most):
                notes.append(f"{name} is at the end of its range")
            elif self.errors[name] > abs(value):
                notes.append(f"{name} may as well be 0")
        worst = min(min(fit.values()) for fit in self.fits)
        if self.independent < BLOCKS[0] and worst < PERFECT_FIT and self.rig.controller is None:
            notes.append(SLOW)
        if worst < POOR_FIT:
            notes.append(POOR)
        return notes

    @constrained
    def drawn(self, count: Count = 8, seed: Seed = 0) -> Rig:
        """Return the rig with an ensemble of other parameter sets that the records allow, for
        rankings over them.

        They are drawn from the normal distribution of the errors, and cut to the ranges.
        """
        names = list(self.values)
        rng = np.random.default_rng(seed)
        spread = np.array([self.errors[name] for name in names])
        covariance = self.correlations * np.outer(spread, spread)
        draws = rng.multivariate_normal(
            list(self.values.values()), covariance, count, method="eigh"
        )
        for i, name in enumerate(names):
            quantity = self.rig.quantities[name]
            draws[:, i] = np.clip(draws[:, i], quantity.least, quantity.most)
        sets = tuple(dict(zip(names, row, strict=True)) for row in draws.tolist())
        return dataclasses.replace(self.rig, ensemble=sets)

    def __repr__(self) -> str:
        values = []
        for name, value in self.values.items():
            values.append(f"{name} = {value:.4g} ± {self.errors[name]:.1g}")
        return f"identified({self.rig.name!r}, {', '.join(values)})"

    def about(self) -> Fields:
        """Return values, errors, correlations and fits as JSON data."""
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
            about[key] = []
            for fit in fits:
                falls = isinstance(min(fit.values()), Fall)
                about[key].append(
                    {name: str(value) for name, value in fit.items()} if falls else fit
                )
        return about

    def save(self, path: str | Path) -> Path:
        """Write `about` to a JSON file. Return its path."""
        return write_json(Path(path), self.about())

    def figure(self, path: str | Path, record: int = 0) -> list[Path]:
        """Draw measured and predicted columns of a record, and their residuals, as PATH.svg and
        PATH.png.
        """
        from smc_mujoco.identification.residual_figure import residual_figure

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
    start: Numbers | None = None,
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
    many: Any
    if isinstance(records, (list, tuple)):
        many = records
    else:
        many = [records]
    if not many:
        raise ScenarioError("there are no records: give at least one")
    twin, data = _twin(rig, many)
    twin = twin.with_values({} if start is None else start)
    names = _checked_names(twin, quantities)
    fits_before = twin.fits(data)  # also refuses records that are too short
    with bar(f"identify {twin.name}", 2 * most * (2 * len(names) + 1), shown=progress) as drawn:
        replays, slopes, by_steps = _solved(twin, names, data, starts, seed, most, drawn.advance)
        errors, correlations, independent = statistics(replays, slopes, by_steps)
    values = replays.values(slopes.point)
    fitted = twin.with_values(values, "identified from records")
    states = _starting_states(fitted, data, replays, slopes.point)
    steps = replays.short_steps
    if steps:
        fits_before = twin.fits(data, **steps)
    return Identified(
        rig=fitted,
        before=twin,
        values=values,
        errors=errors,
        correlations=correlations,
        fits=tuple(fitted.fits(data, states=states, **steps)),
        fits_before=tuple(fits_before),
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
    data: Sequence[Data],
    starts: int,
    seed: int,
    most: int,
    report: Any,
) -> tuple[Replays, Slopes, Array]:
    """Return the replays of the last search, their slopes at the solution, and its error due to
    steps, (p,).
    """
    pieces = Replays(twin, names, data, False, report)
    reached = gauss_newton.search(pieces, starts, seed, most)
    if twin.controller is None:
        slopes, moved = gauss_newton.accurate(pieces, reached)
        return pieces, gauss_newton.not_worse(pieces, slopes), moved
    closed = Replays(twin, names, data, True, report)
    points = [closed.start, Point(reached.point.values, closed.start.states)]
    if len(closed.free):  # a record may begin at rest with a jump of the command
        points += [closed.at_rest(point) for point in points]
    slopes = gauss_newton.refine(closed, gauss_newton.better(closed, *points), most)
    closed.evaluations += pieces.evaluations
    return closed, slopes, np.zeros(len(names))


def _starting_states(
    fitted: Rig, data: Sequence[Data], replays: Replays, point: Point
) -> list[Array | None]:
    """Return the state from which each record is repeated as a whole, (2n,); None for the measured
    one.

    In an open loop these are the measured state, that of the first piece, or one that fits the
    whole record better.
    """
    if not len(replays.free):
        return [None] * len(data)
    if replays.closed:
        return [replays.state(point, k) for k in range(len(data))]
    repeats = Replays(fitted, [], data, False, whole=True)
    repeats.steps = replays.short_steps
    of_records = [piece.record for piece in replays.pieces]
    firsts = [of_records.index(i) for i in range(len(data))]
    none = np.zeros(0)
    candidates = [repeats.start, Point(none, point.states[firsts])]
    for candidate in tuple(candidates):
        moves = repeats.slopes(candidate).moves(none)
        candidates.append(Point(none, candidate.states + moves))
    costs = repeats.costs(candidates)
    best = costs.argmin(axis=0)
    return [repeats.state(candidates[best[i]], i) for i in range(len(data))]


def _twin(given: Rig | Plant | str, many: Sequence[Source]) -> tuple[Rig, list[Data]]:
    """Return the rig to identify, and its records as columns."""
    if isinstance(given, str):
        given = find_rig(given)
    traces = [record for record in many if isinstance(record, Trace)]
    if isinstance(given, Plant):
        given = _of_plant(given, traces[0].scenario if traces else None)
    if not isinstance(given, Rig):
        raise ScenarioError(
            f"cannot identify {shown(given)}: give a rig, the name of one, or a plant"
        )
    return given.reading(many)


def _of_plant(plant: Plant, base: Scenario | None) -> Rig:
    """Return a rig whose quantities are a plant's parameters, with the parts of a run's scenario
    `base`.
    """
    settings = {}
    for name in SETTINGS:
        value = getattr(base, name, None)
        if value is not None:
            settings[name] = value
    from_zero = FRICTIONS | INERTIAS | {*plant.dry, *plant.added}
    quantities = {}
    for name, value in plant.parameters.items():
        least = 0.0 if name in from_zero else -np.inf
        if name in plant.positive:
            least = 1e-6
        quantities[name] = Quantity(value, "", "nominal value of the plant", least)
    ends = column_ends(plant)
    return Rig(
        name=plant.name,
        label=plant.label or plant.name,
        quantities=quantities,
        machine=lambda q: settings | {"plant": dataclasses.replace(plant, parameters=vars(q))},
        columns=Columns(
            x=tuple(f"x{end}" for end in ends), u=f"u{ends[0]}", reference=f"r{ends[0]}"
        ),
        free=tuple(name for name, value in plant.parameters.items() if value and name != "grav"),
    )
