"""Identification: from records to a rig's quantities, with standard errors, correlations and the fit on each record.

The quantities are found by least squares of what the twin predicts: positions, and in a closed loop u, each relative to
its variation in the record. A record is first replayed in short pieces under the recorded command, each from a state
that is found along with the quantities, because the cost of pieces is smooth. If the machine's controller is known, the
record is then replayed as a whole with the loop closed, from the values that the pieces gave. All runs of a step are
one batch. `mujoco.sysid` is not used: it replays recorded controls in an open loop, without controllers, encoders and
delays, and needs ten more packages.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError, find, shown, whole
from smc_mujoco.common.progress import bar
from smc_mujoco.evidence.rigs import search
from smc_mujoco.evidence.rigs.identified import POOR_FIT, Identified
from smc_mujoco.evidence.rigs.records import Columns
from smc_mujoco.evidence.rigs.replays import Point, Replays, Slopes, cost
from smc_mujoco.evidence.rigs.rig import RADIANS_GAIN, Quantity, Rig, Source
from smc_mujoco.evidence.rigs.rig import rig as find_rig
from smc_mujoco.evidence.rigs.uncertainty import statistics
from smc_mujoco.mechanisms.hardware.part import column_ends
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

# Fields of a run's scenario that a rig made from its plant takes over.
SETTINGS = ("control_period", "friction", "contact", "actuator", "sensor", "u_max", "input_delay", "velocity", "model")
# Frictions and inertias of the library's plants, which are 0 or more.
FRICTIONS, INERTIAS = frozenset(("b", "bq", "b1", "b2", "cf", "cfq", "cf1", "cf2", "delta")), frozenset(("J", "Jc"))


def identify(
    of: Rig | Plant | str,
    records: Source | Sequence[Source],
    quantities: Sequence[str] | None = None,
    *,
    start: Mapping[str, float] | None = None,
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
      start: quantity -> value, SI units, from which the search starts; those not given start at the rig's own.
      starts: number of parameter sets from which the search may start: the present one, and the best of random ones,
        which differ from it by up to a factor of 100.
      seed: of these starts. The same seed gives the same result.
      most: largest number of steps of the search.
      progress: whether to show a progress bar.

    Raises:
      ScenarioError: an unknown quantity, not a record, columns in another unit or in the wrong order, or records that
        cannot tell the quantities apart.
    """
    many: list[Any] = list(records) if isinstance(records, (list, tuple)) else [records]
    if not many:
        raise ScenarioError("there are no records: give at least one")
    twin, data = _twin(of, many)
    twin = twin.with_values(start or {})
    names = _checked_names(twin, quantities)
    whole("starts", starts, 1, 1000)
    whole("seed", seed, 0, 2**53 - 1)
    fits_before = tuple(twin.fits(data))  # also refuses records that are too short
    for record, fit in zip(data, fits_before, strict=True):
        twin.refuse_degrees(record, fit)
    with bar(f"identify {twin.name}", 2 * most * (2 * len(names) + 1), shown=progress) as drawn:
        replays, slopes, by_steps = _solved(twin, names, data, starts, seed, most, drawn.advance)
        errors, correlations, independent = statistics(replays, slopes, by_steps)
    values = replays.values(slopes.point)
    fitted = twin.with_values(values, "identified from records")
    states, steps = _starting_states(fitted, data, replays, slopes.point), replays.short_steps
    return Identified(
        rig=fitted, before=twin, values=values, errors=errors, correlations=correlations,
        fits=tuple(fitted.fits(data, states=states, **steps)),
        fits_before=tuple(twin.fits(data, **steps)) if steps else fits_before,
        predictions=tuple(fitted.predictions(data, states=states, **steps)), evaluations=replays.evaluations,
        independent=independent,
    )  # fmt: skip


def _checked_names(twin: Rig, quantities: Sequence[str] | None) -> list[str]:
    """Return the names of the quantities to find."""
    names = list(twin.free if quantities is None else quantities)
    for name in names:
        find(f"quantity of {twin.name}", name, twin.quantities)
        if names.count(name) > 1:
            raise ScenarioError(f"quantities have {name} {names.count(name)} times: name it once")
    if not names:
        raise ScenarioError(f"{twin.name} has no quantities to find: name some, of {', '.join(twin.quantities)}")
    return names


def _solved(
    twin: Rig, names: list[str], data: Sequence[Mapping[str, Any]], starts: int, seed: int, most: int, report: Any
) -> tuple[Replays, Slopes, np.ndarray]:
    """Return the replays that are compared in the end, their slopes at the solution, and its error by steps, (p,)."""
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


def _refuse_swapped(twin: Rig, names: list[str], data: Sequence[Mapping[str, Any]], reached: Slopes) -> None:
    """Raise ScenarioError if records of one joint fit badly as they are, and well with position and command swapped."""
    (x, *others), u = twin.columns.x, twin.columns.u
    if others or twin.columns.state or twin.dynamics is not None or reached.fit >= POOR_FIT:
        return
    swapped = Replays(twin, names, [dict(record) | {x: record[u], u: record[x]} for record in data], False)
    fit = search.search(swapped, 4, 0, search.ROUGH_STEPS).fit
    if fit > max(RADIANS_GAIN, reached.fit + RADIANS_GAIN):
        raise ScenarioError(
            f"the columns {x} and {u} of the record of {twin.name} look swapped, as its pieces fit by {fit:.0f} % with "
            f"them exchanged and by {reached.fit:.0f} % as they are: name the position {x} and the command {u}"
        )


def _starting_states(
    fitted: Rig, data: Sequence[Mapping[str, Any]], replays: Replays, point: Point
) -> list[np.ndarray | None]:
    """Return the state from which each record is repeated as a whole, (2n,); None for the measured one.

    In an open loop these are the measured state, that of the first piece, or one that fits the whole record better.
    """
    if not len(replays.free):
        return [None] * len(data)
    if replays.closed:
        return [replays.state(point, k) for k in range(len(data))]
    whole_records = Replays(fitted, [], data, False, whole=True)
    whole_records.steps = replays.short_steps
    firsts = [next(k for k, piece in enumerate(replays.pieces) if piece.record == i) for i in range(len(data))]
    candidates = [whole_records.start, Point(np.zeros(0), point.states[firsts])]
    for candidate in tuple(candidates):
        slopes = whole_records.slopes(candidate)
        candidates.append(Point(candidate.values, candidate.states + slopes.moves(np.zeros(0))))
    costs = np.array([[cost([rows]) for rows in pieces] for pieces in whole_records.residuals(candidates)])
    best = costs.argmin(axis=0)
    return [whole_records.state(candidates[best[i]], i) for i in range(len(data))]


def _twin(of: Rig | Plant | str, many: Sequence[Source]) -> tuple[Rig, list[Mapping[str, Any]]]:
    """Return the rig to identify, and its records as columns."""
    if isinstance(of, str):
        of = find_rig(of)
    traces = [record for record in many if isinstance(record, Trace)]
    if isinstance(of, Plant):
        of = _of_plant(of, traces[0].scenario if traces else None)
    if not isinstance(of, Rig):
        raise ScenarioError(f"cannot identify {shown(of)}: give a rig, the name of one, or a smc.Plant")
    return of.reading(many)


def _of_plant(plant: Plant, base: Scenario | None) -> Rig:
    """Return a rig whose quantities are a plant's parameters, with the parts of a run's scenario `base`."""
    settings = {}
    if base is not None:
        settings = {name: getattr(base, name) for name in SETTINGS if getattr(base, name) is not None}
    lower = dict.fromkeys(plant.parameters, -np.inf)
    lower |= dict.fromkeys((FRICTIONS | INERTIAS | {*plant.dry, *plant.added}) & set(plant.parameters), 0.0)
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
        columns=Columns(x=tuple(f"x{end}" for end in ends), u=f"u{ends[0]}", reference=f"r{ends[0]}"),
        free=tuple(name for name, value in plant.parameters.items() if value and name != "grav"),
    )
