"""Identification: from logs to the numbers of a machine, with standard errors, correlations and the
fit on each log.

    arm = smc.plant_from("arm.xml", ["shoulder", "elbow"])
    found = smc.identify(arm, ["run1.csv", "run2.csv"], ["shoulder.damping", "elbow.frictionloss"])
    print(found)
    found.rig.fit("run3.csv")

The numbers are found by least squares of what the twin predicts: positions, and in a closed loop u,
each relative to its variation in the log. A log is first replayed in short pieces under the
recorded command, each from a state that is found along with the numbers, because the cost of pieces
is smooth. If the machine's controller is known, the log is then replayed as a whole with the loop
closed, from the values that the pieces gave. All runs of a step are one batch.
`mujoco.sysid` is not used: it replays recorded controls in an open loop, without controllers,
encoders and delays, and needs ten more packages.
"""

import dataclasses
import itertools
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from smc_mujoco.answers.answer import Answer
from smc_mujoco.answers.facts import Fact, Screen
from smc_mujoco.common import html
from smc_mujoco.common.aliases import AnyPath, Array, Data, Fields, Numbers
from smc_mujoco.common.constraints import Natural, Progress, Seed, Whole, constrained
from smc_mujoco.common.errors import ScenarioError, find, shown, whole
from smc_mujoco.common.files import write_json
from smc_mujoco.common.progress import bar
from smc_mujoco.common.tabular import Tabular
from smc_mujoco.common.text import joined
from smc_mujoco.identification import (
    gauss_newton,
    number_text,
    records,
)
from smc_mujoco.identification.kept_replays import KeptReplays
from smc_mujoco.identification.lack_of_fit import lack_of_fit
from smc_mujoco.identification.log_rig import SETTINGS
from smc_mujoco.identification.own_rig import own_rig
from smc_mujoco.identification.paths import DELAY, named_once
from smc_mujoco.identification.published_rig import rig as find_rig
from smc_mujoco.identification.published_rig import rigs
from smc_mujoco.identification.records import Record
from smc_mujoco.identification.replays import Point, Replays, Slopes
from smc_mujoco.identification.rig import Fall, Rig, Source
from smc_mujoco.identification.standard_errors import (
    BLOCKS,
    MAX_CORRELATION,
    between,
    check_told_apart,
    independent,
    statistics,
)
from smc_mujoco.mechanisms.custom import mjcf
from smc_mujoco.mechanisms.named import MODEL, as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import conditions
from smc_mujoco.simulation.conditions import DURATION, Condition, find_condition
from smc_mujoco.simulation.part_numbers import FIELDS
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Noise

SHORT_TIME = 0.1  # s: a shorter one is printed in ms; chosen
POOR_FIT = 80.0  # percent: a fit below may mean that the search ended in a wrong place; chosen
UNSEEN = 0.3  # of a value, beyond which its error says that the log does not show it; chosen
SLOW_SHARE = 0.1  # of the samples: of noise alone nearly all are independent; chosen
PERFECT_FIT = 99.99  # percent: residuals beyond it are the simulation's; chosen
FLOOR = 0.05  # of a value, by which drawn sets differ at least; chosen: friction warms up by more
USUAL_STEPS = 6  # of a search; chosen: only the progress that is shown depends on it
AHEAD = 1.1  # times what is done: the work that is shown, if a search takes longer
PIECE_STEPS = 12  # of the search for the starts of pieces of a log that was not used; chosen
HEADINGS = "number", "value", "±", "unit", "start", "scatter between logs"
Log = Source | AnyPath  # also a data frame
Count = Annotated[int, Whole(low=1, high=1000)]
SLOW = (
    "the residuals are slow, for example by a force that was not recorded, friction that drops "
    "with speed, a spring or play between motor and joint (find its play), or a log whose u is "
    "late: true errors may be many standard errors"
)
LEFT = (
    "a whole log is left in an open loop, as an arm under gravity leaves it however good its "
    "numbers are: judge by the pieces of 1 s"
)
POOR = (
    "the fit is poor: the model lacks something, a column is another one or in another unit "
    "(angles are in rad), or the search ended in a local minimum: start from other values, with "
    "more starts or another seed"
)


@dataclasses.dataclass(frozen=True)
class HeldOutFit:
    """How well a twin repeats a log that was not used."""

    fit: Numbers  # of the whole log, as `Rig.fit`
    by_pieces: Numbers  # of pieces of 1 s, whose starts are found


@dataclasses.dataclass(frozen=True)
class Identified(Answer):
    """The numbers of a machine that were found from logs, and how well they fit.

    Fits are those of `Rig.fit`, in an open loop with short steps; for `fits` the states at the
    starts are found too. An arm under gravity that is replayed in an open loop leaves its log after
    a while even with good numbers, as small errors grow. Then `by_pieces`, the fits of pieces of 1
    s, tell more.
    """

    rig: Rig  # with the values found
    before: Rig  # with the values before
    values: Numbers  # quantity -> value found
    errors: Numbers  # quantity -> its standard error
    correlations: Array  # by least squares, (p, p), in the order of `values`
    fits: tuple[Numbers, ...]  # of each log
    fits_before: tuple[Numbers, ...]
    predictions: tuple[
        tuple[Record, Record, Array], ...
    ]  # predicted columns, measured ones, and their times
    evaluations: int  # how many parameter sets were simulated
    # how many samples of the residuals, without what the model lacks, are independent of each other
    independent: float
    by_pieces: tuple[Numbers, ...] = ()  # fit of the pieces of each log; empty in a closed loop
    scatter: Numbers = dataclasses.field(default_factory=dict)  # of values between logs, if several
    held_out: HeldOutFit | None = None  # of the log that was kept aside
    doubted: tuple[str, ...] = ()  # sentences on what may be wrong with columns
    lacks: tuple[str, ...] = ()  # what the model lacks, and what to do
    data: tuple[Data, ...] = dataclasses.field(default=(), repr=False)  # the logs' columns

    @property
    def notes(self) -> list[str]:
        """What the logs cannot determine, and what to doubt."""
        notes = list(self.doubted)
        unseen = {}
        for name, value in self.values.items():
            if self.errors[name] > UNSEEN * abs(value) and (sentence := self.rig.unseen(name)):
                unseen[name] = sentence
        notes += unseen.values()
        for (i, first), (j, second) in itertools.combinations(enumerate(self.values), 2):
            correlation = self.correlations[i, j]
            if abs(correlation) > MAX_CORRELATION and not {first, second} & {*unseen}:
                notes.append(
                    f"{first} and {second} are hardly told apart (correlation {correlation:.3f})"
                )
        for name, value in self.values.items():
            quantity = self.rig.quantities[name]
            if value in (quantity.least, quantity.most):
                notes.append(f"{name} is at the end of its range")
            elif self.errors[name] > abs(value) and name not in unseen:
                notes.append(f"{name} may as well be 0")
        worst = _worst(self.by_pieces or self.fits)
        for lack in self.lacks if worst < PERFECT_FIT else ():
            notes.append(f"{lack}; the errors include what that may change")
        samples = sum(len(times) for *_, times in self.predictions)
        slow = self.independent < max(BLOCKS[0], SLOW_SHARE * samples)
        if slow and worst < PERFECT_FIT and self.rig.controller is None:
            notes.append(SLOW)
        if worst < POOR_FIT:
            notes.append(POOR)
        elif self.by_pieces and _worst(self.fits) < POOR_FIT:
            notes.append(LEFT)
        return notes + self.rig.cautions

    @constrained
    def drawn(self, count: Count = 8, seed: Seed = 0, floor: Natural = FLOOR) -> Rig:
        """Return the rig with an ensemble of other parameter sets that the logs allow, for rankings
        over them.

        They are drawn from a normal distribution and cut to the ranges. Its deviations are the
        standard errors, which have the scatter between logs, and at least `floor` times the value:
        a machine differs from day to day by more than the errors of one log. 0: no floor.
        """
        names = list(self.values)
        rng = np.random.default_rng(seed)
        values = np.array(list(self.values.values()))
        spread = np.array([self.errors[name] for name in names])
        covariance = self.correlations * np.outer(spread, spread)
        missing = np.maximum((floor * values) ** 2 - spread**2, 0.0)
        covariance = covariance + np.diag(missing)
        draws = rng.multivariate_normal(values, covariance, count, method="eigh")
        for i, name in enumerate(names):
            quantity = self.rig.quantities[name]
            draws[:, i] = np.clip(draws[:, i], quantity.least, quantity.most)
        sets = tuple(dict(zip(names, row, strict=True)) for row in draws.tolist())
        return dataclasses.replace(self.rig, ensemble=sets)

    @property
    def is_condition(self) -> bool:
        """Whether `condition` has one: not of a published machine."""
        return self.rig.is_own

    def condition(self, name: str = "identified") -> Condition:
        """Return a condition of the user's own machine, for `compare`, `which`, `tune`, `grid`: the
        true machine has the numbers found, and a law's model those of the file.

        Raises:
          ScenarioError: the rig is a published machine, whose scenarios are `rig.scenario(law)`.
        """
        fields = self.rig.condition_fields()
        if noise := self.noise:
            fields["noise"] = Noise(noise)
        return conditions.condition(name, **fields)

    @property
    def noise(self) -> float:
        """The standard deviation of the white noise of the logs' positions, rad or m: of the
        quietest column of each, in the median, to two digits.
        """
        deviations = [records.noise(dict(log), self.rig.columns) for log in self.data]
        return float(f"{np.median(deviations):.1e}") if deviations else 0.0

    def __repr__(self) -> str:
        values = []
        for name, value in self.values.items():
            values.append(f"{name} = {value:.4g} ± {self.errors[name]:.1g}")
        return f"identified({self.rig.name!r}, {', '.join(values)})"

    @property
    def screen(self) -> Screen:
        """The answer: numbers with errors and units, the fit, and what to doubt."""
        rows = []
        for name, value in self.values.items():
            number, error, unit = self._number(name, value)
            rows.append((name, number, f"± {error}", unit))
        fits = {"fit": _fit(self.by_pieces or self.fits), "pieces": bool(self.by_pieces)}
        if self.held_out:
            fits["held_out"] = _fit([self.held_out.by_pieces or self.held_out.fit])
        doubts = []
        for note in self.notes:
            if not note.startswith(self.lacks[1:]):  # further lacks of fit are in the tables
                doubts.append(Fact("sentence", label="doubt", text=note))
        return Screen(
            tables=[Tabular(headings=("",) * 4, rows=rows)],
            notes=[Fact("fits", **fits)],
            facts=doubts,
        )

    def _number(self, name: str, value: float) -> tuple[str, str, str]:
        """Return a number, its error and their unit as text; a short time is in ms."""
        unit = self.rig.quantities[name].unit
        scale = 1.0
        if unit == "s" and abs(self.values[name]) < SHORT_TIME:
            unit, scale = "ms", 1e3
        error = scale * self.errors[name]
        return number_text.to_error(scale * value, error), f"{error:.2g}", unit

    @property
    def title(self) -> str:
        """The machine."""
        return self.rig.label

    @property
    def pictures(self) -> list[html.Html]:
        """The figure of each log."""
        return [self._drawn(k) for k in range(len(self.data))]

    def _drawn(self, record: int) -> html.Html:
        """Return the figure of a log."""
        with tempfile.TemporaryDirectory() as folder:
            svg, *_ = self.figure(Path(folder) / "log.svg", record)
            return html.embedded(svg.read_bytes(), "image/svg+xml")

    @property
    def tables(self) -> list[Tabular]:
        """The numbers, the fits of all logs, and correlations."""
        numbers = []
        for name, value in self.values.items():
            before, *_ = self._number(name, self.before.values[name])
            scatter = f"{self.scatter[name]:.2g}" if self.scatter else ""
            numbers.append([name, *self._number(name, value), before, scatter])
        heads = [f"log {i}" for i in range(1, len(self.fits) + 1)]
        whole_fits, piece_fits = list(self.fits), list(self.by_pieces or [{}] * len(self.fits))
        if self.held_out:
            heads.append("held out")
            whole_fits.append(self.held_out.fit)
            piece_fits.append(self.held_out.by_pieces)
        fits = []
        for head, of_log, of_pieces in zip(heads, whole_fits, piece_fits, strict=True):
            for column, fit in of_log.items():
                in_pieces = f"{of_pieces[column]:.2f}" if column in of_pieces else ""
                fits.append([head, column, f"{fit:.2f}", in_pieces])
        rows = []
        for name, row in zip(self.values, self.correlations.tolist(), strict=True):
            rows.append([name, *(f"{value:.2f}" for value in row)])
        return [
            Tabular(headings=HEADINGS, rows=numbers, title=self.title, notes=self.notes),
            Tabular(
                headings=("log", "column", "fit, %", "in pieces of 1 s, %"),
                rows=fits,
                title="Fits",
                name_columns=2,
            ),
            Tabular(headings=("", *self.values), rows=rows, title="Correlations of the errors"),
        ]

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
        about["fits_by_pieces"] = list(map(dict, self.by_pieces))
        if self.held_out:
            about["held_out"] = dataclasses.asdict(self.held_out)
        return about

    def save(self, path: str | Path) -> Path:
        """Write a file, and return its path.

        FILE.txt is the condition, with values and errors as comments, for --condition of compare,
        which and tune. FILE.xml is your model as MJCF with the numbers found, and FILE.urdf as the
        URDF that it was. Any other is `about` as JSON.
        """
        file = Path(path)
        if file.suffix.lower() in (".xml", ".urdf"):
            return self.rig.save_model(file)
        if file.suffix != ".txt":
            return write_json(file, self.about())
        return number_text.save_condition(file, str(self), self.condition())

    def figure(self, path: str | Path, record: int = 0) -> list[Path]:
        """Draw measured and predicted columns of a log, their residuals over time and speed, and
        the friction of each joint, as PATH.svg and PATH.png.
        """
        whole("record", record, 0, len(self.fits) - 1)
        errors = np.array(list(self.errors.values()))
        covariance = self.correlations * np.outer(errors, errors)
        prediction, fit = self.predictions[record], self.fits[record]
        return self.rig.figure(covariance, self.data[record], prediction, fit, path)


@constrained
def identify(
    machine: Rig | Plant | Scenario | str,
    logs: Log | Sequence[Log],
    names: Sequence[str] | None = None,
    *,
    held_out: Log | None = None,
    columns: Mapping[str, str] | None = None,
    condition: Condition | str | None = None,
    corrected: bool = False,
    starts: Count = 1,
    seed: Seed = 0,
    most: Count = 30,
    progress: Progress = False,
    folder: AnyPath | None = None,
) -> Identified:
    """Estimate a machine's parameters from logs: friction, armature, delay, masses and more.

        arm = smc.plant_from("arm.xml", ["elbow"])
        push = smc.Sine(1.5, 4.0)
        true = {"plant": arm, "mismatch": {"elbow.damping": 0.2}}
        run = smc.run(smc.Scenario(**true, law="none", feedforward=push, duration=2.0))
        print(smc.identify(arm, run, ["elbow.damping"]))

    Args:
      machine: your own machine as a plant, or as a scenario whose parts have numbers to find, such
        as a friction (with law="none"); or the name of either's plant, as "arm.xml:shoulder+elbow".
        Or a rig or its name, see `smc.rigs()`.
      logs: one log or several, of any controller, at 40 Hz or more: the path of a CSV or npz file,
        a data frame, columns by name, or traces. Of a trace x is what its encoder reads, with the
        noise; in a file of `Trace.export` it is the true position, but of `smc.measured(trace)`. A
        log has t in s, and x (rad or m) and u (in the unit of the machine's command) of the joint,
        or x_JOINT and u_JOINT of each. u is held from its row to the next: of a log of fewer rows
        give the mean between them.
        The time grows with rows and names: 4 s at 1 kHz of two joints take a minute or two.
      names: paths of the numbers: "shoulder.damping", .frictionloss, .armature, .stiffness, .gain,
        .offset, .zero, "input_delay", "hand.payload" of a body, "friction.elbow.kc", and "m" in kg,
        the mass of all that moves, where mismatches have "mass". None: the rig's `free`. No start
        is needed: it comes from least squares of forces.
      held_out: a log that is not used, to check the numbers on.
      columns: our name of a column -> that of the logs.
      condition: effects that the model lacks: a condition or its text, such as
        "mine: friction=LuGre(0.3, 0.4, 0.1)", whose numbers `names` may find; as in a Scenario.
      corrected: whether to correct open loops for the errors of the simulation's steps, in several
        times the time. Without it replays are extrapolated to steps of 0. A log of a simulation
        has the errors of its own steps: make it with the integrator RK4 or short steps. MuJoCo's
        default is Euler, which moved a number by 3.4 of its errors in one log with 1 ms.
      starts: number of sets from which the search may start, if the first fits badly: the present
        one, and the best of random ones, which differ from it by up to a factor of 100.
      seed: of these starts. The same seed gives the same result.
      most: largest number of steps of the search.
      progress: whether to show a progress bar: a search may take minutes.
      folder: a folder of its own for what is simulated. A call that was stopped goes on from it,
        with the same result; it is removed when the result is there. None: nothing is kept.

    Returns:
      An Identified, which prints as a table: `values` and `errors` by name in SI units, `notes` on
      what to doubt, fits, `rig` for runs of the machine, `condition()` for other commands, `drawn`
      for an ensemble, `figure` and `save`.

    Raises:
      ScenarioError: an unknown path, which lists what there is; a log without a column, too slow,
        without motion, in degrees, or too short; nothing in the logs depends on a number, or two
        have the same effect on them.
    """
    listed = None if names is None else named_once(names)
    twin, data = _read(machine, logs, listed, columns, condition)
    names = _checked_names(twin, listed)
    fits_before = twin.fits(data)  # also refuses records that are too short
    doubts = twin.doubts(data)
    batches = None if folder is None else KeptReplays(Path(folder))
    expected = _expected_sets(twin, names, most)
    with bar(f"identify {twin.name}", expected, shown=progress) as drawn:

        def report(count: int) -> None:
            done = drawn.done + count
            drawn.reached(done, max(expected, AHEAD * done))

        replays, slopes, by_steps = _solved(
            twin, names, data, doubts, starts, seed, most, corrected, report, batches
        )
        lacking = lack_of_fit(slopes, twin.lacks(replays, slopes))
        by_model = np.hypot(by_steps, lacking.moved)
        errors, correlations = statistics(replays, slopes, by_model)
    values = twin.in_order(replays.values(slopes.point))
    fitted = twin.with_values(values, "identified from records")
    steps = replays.short_steps
    states: list[Array | None] = [None] * len(data)
    if replays.closed and len(replays.free):
        states = [replays.state(slopes.point, k) for k in range(len(data))]
    elif len(replays.free):
        of_records = [piece.record for piece in replays.pieces]
        firsts = list(map(of_records.index, range(len(data))))
        repeats = Replays(fitted, [], data, False, whole=True, kept=batches)
        repeats.steps = steps
        of_pieces = Point(np.zeros(0), slopes.point.states[firsts])
        states = gauss_newton.starting_states(repeats, [repeats.start, of_pieces])
    if steps:
        fits_before = twin.fits(data, **steps)
    scatter = {}
    if len(data) > 1:
        deviation = between(slopes, [piece.record for piece in replays.pieces]) * replays.scales
        scatter = dict(zip(names, deviation.tolist(), strict=True))
    by_pieces = [] if replays.whole else fits_by_pieces(replays, slopes)
    predictions = fitted.predictions(data, states=states, **steps)
    checked = None if held_out is None else held_out_fit(fitted, held_out, columns, batches)
    if batches is not None:
        batches.remove()
    return Identified(
        rig=fitted,
        before=twin,
        values=values,
        errors=errors,
        correlations=correlations,
        fits=tuple(fitted.fits_of(predictions)),
        fits_before=tuple(fits_before),
        predictions=tuple(predictions),
        evaluations=replays.evaluations,
        independent=independent(lacking.slopes),
        by_pieces=tuple(by_pieces),
        scatter=scatter,
        held_out=checked,
        doubted=tuple(doubts),
        lacks=lacking.told(np.array(list(errors.values())) / replays.scales),
        data=tuple(data),
    )


def _expected_sets(twin: Rig, names: Sequence[str], most: int) -> int:
    """Return about how many parameter sets a search will simulate."""
    slopes = 2 * (len(names) + 2 * len(twin.columns.x)) + 1
    searches = 1 if twin.controller is None else 2
    return searches * min(most, USUAL_STEPS) * slopes


def held_out_fit(
    rig: Rig,
    log: Log,
    columns: Mapping[str, str] | None = None,
    batches: KeptReplays | None = None,
) -> HeldOutFit:
    """Return how well a rig repeats a log that its numbers were not found from."""
    twin, data = rig.reading([records.as_columns(log, columns)])
    fit = twin.fit(data[0])
    if twin.controller is not None or twin.dynamics is not None:
        return HeldOutFit(fit, {})
    replays = Replays(twin, [], data, False, kept=batches)
    slopes = gauss_newton.fit_starts(replays, PIECE_STEPS)
    return HeldOutFit(fit, fits_by_pieces(replays, slopes)[0])


def _worst(fits: Sequence[Numbers]) -> float:
    """Return the worst fit of any column of any log."""
    return min(min(fit.values()) for fit in fits)


def _fit(fits: Sequence[Numbers]) -> str:
    """Return the worst fit as text: "99.4 %", or when a twin falls."""
    fit = _worst(fits)
    return str(fit) if isinstance(fit, Fall) else f"{fit:.1f} %"


def fits_by_pieces(replays: Replays, slopes: Slopes) -> list[dict[str, float]]:
    """Return the fit of each column of each record, percent, in pieces whose starts were found."""
    fits = []
    for k in range(len(replays.data)):
        rows = []
        columns = {}
        for piece, residuals in zip(replays.pieces, slopes.residuals, strict=True):
            if piece.record == k:
                rows.append(residuals.reshape(-1, slopes.columns))
                columns = piece.measured
        shares = np.linalg.norm(np.concatenate(rows), axis=0)
        percent = (100.0 * (1.0 - shares)).tolist()
        fits.append(dict(zip(columns, percent, strict=True)))
    return fits


def _read(
    machine: Rig | Plant | Scenario | str,
    logs: Log | Sequence[Log],
    names: Sequence[str] | None,
    columns: Mapping[str, str] | None,
    condition: Condition | str | None,
) -> tuple[Rig, list[Data]]:
    """Return the rig of a machine, and its logs as columns. An error about a file names it."""
    many: Any = logs if isinstance(logs, (list, tuple)) else [logs]
    if not many:
        raise ScenarioError("there are no logs: give at least one")
    read = [records.as_columns(log, columns) for log in many]
    line = _shell_line(machine, many, columns, condition)
    if isinstance(machine, str):
        machine = (
            find_rig(machine) if machine in rigs() else _named_plant(machine, read, names or ())
        )
    if condition is not None:
        machine = _under(machine, find_condition(condition))
    if isinstance(machine, Plant | Scenario):
        machine = own_rig(machine, names or [])
    if not isinstance(machine, Rig):
        raise ScenarioError(
            f"cannot identify {shown(machine)}: give a plant, a scenario, or a rig or its name"
        )
    if machine.quantities:  # of a machine whose numbers are not named its log is checked first
        _checked_names(machine, None if names is None else list(names))
    twin, data = machine.reading(read)
    for source, record in zip(many, data, strict=True):
        _check_log(twin, source, record)
    twin.check_named(line)
    return twin.guessed(data), data


def _shell_line(machine: Any, logs: Sequence[Any], columns: Any, condition: Any) -> list[str]:
    """Return the words of a command that reads logs of a machine; none for what has no name or
    file.
    """
    words = [machine, *logs]
    named = words if condition is None else [*words, condition]
    if not all(isinstance(word, str | os.PathLike) for word in named):
        return []
    if columns:
        renamed = ",".join(f"{ours}={theirs}" for ours, theirs in columns.items())
        words += ["--columns", renamed]
    if condition is not None:
        words += ["--condition", condition]
    return ["smc-mujoco", "identify", *map(str, words)]


def _under(machine: Any, condition: Condition) -> Scenario:
    """Return the scenario of a plant under a condition, whose every field a replay has."""
    if not isinstance(machine, Plant):
        raise ScenarioError(
            f"condition {condition.name!r} is for a plant: leave it out, and give a scenario its "
            "parts itself"
        )
    fields = condition.on(machine, DURATION)
    for name in fields:
        if name not in (*FIELDS, *SETTINGS, DELAY):
            raise ScenarioError(
                f"condition {condition.name!r} has {name}, which no replay of a log has: leave it "
                f"out; it may have {joined(FIELDS)}"
            )
    return Scenario.recorded(plant=machine, law="none", **fields)


def _named_plant(text: str, logs: Sequence[Any], names: Sequence[str]) -> Plant:
    """Return a plant by its name. FILE.xml alone has the joints of the first log's columns: those
    with a command u_JOINT are driven, and those with a position x_JOINT alone are measured. Raise
    ScenarioError for positions without any command, and for a number to find of a joint of the file
    that has no column.
    """
    model = MODEL.fullmatch(text)
    if model is None or model["joints"] is not None or not isinstance(logs[0], Mapping):
        return as_plant(text)
    driven = []
    seen = []
    for name in logs[0]:
        if name.startswith("u_"):
            driven.append(name[2:])
        elif name.startswith("x_"):
            seen.append(name[2:])
    if seen and not driven:
        positions = joined(f"x_{joint}" for joint in seen)
        commands = joined(f"u_{joint}" for joint in seen)
        raise ScenarioError(
            f"the log has {positions} and no command: give {commands}, the motors' commands, too"
        )
    joints = list(driven)
    for joint in seen:
        if joint not in driven:
            joints.append(f"{joint}(measured)")
    of_file = [joint.name for joint in mjcf.model_source(text).spec().joints if joint.name]
    for name in names if driven else ():
        joint = name.rpartition(".")[0]
        if joint in of_file and joint not in (*driven, *seen):
            raise ScenarioError(
                f"{name} is to be found, and the log has no x_{joint} and u_{joint}: its columns "
                f"are {joined(logs[0])}; say by columns (--columns) which they are"
            )
    if not driven:
        joints = of_file
        if len(joints) > 1 and "x" in logs[0]:
            raise ScenarioError(
                f"the log has x of one joint, and {text} has {len(joints)}: say which it is, as "
                f"{text}:{joints[-1]}, of {joined(joints)}"
            )
        if len(joints) != 1:
            return as_plant(text)  # its error names the joints
    return as_plant(f"{text}:{'+'.join(joints)}")


def _check_log(twin: Rig, given: Any, record: Data) -> None:
    """Raise ScenarioError for a log that cannot be used. It names the log's file, if it has one."""
    try:
        twin.checked(record)
    except ScenarioError as error:
        if isinstance(given, str | Path):
            raise ScenarioError(f"{given}: {error}") from None
        raise


def _checked_names(twin: Rig, names: list[str] | None) -> list[str]:
    """Return the names of the quantities to find."""
    listed = list(twin.free) if names is None else names
    for name in listed:
        find(f"quantity of {twin.name}", name, twin.quantities)
    if not listed:
        raise ScenarioError(
            f"{twin.name} has no quantities to find: name some, of {', '.join(twin.quantities)}"
        )
    return listed


def _solved(
    twin: Rig,
    names: list[str],
    data: Sequence[Data],
    doubts: Sequence[str],
    starts: int,
    seed: int,
    most: int,
    corrected: bool,
    report: Any,
    batches: KeptReplays | None,
) -> tuple[Replays, Slopes, Array]:
    """Return the replays of the last search, their slopes at the solution, and its error due to
    steps, (p,).
    """
    pieces = Replays(twin, names, data, False, report, kept=batches)
    pieces.steps = pieces.slope_steps
    first = pieces.slopes(pieces.start)
    if doubts and first.fit < 0.0:
        raise ScenarioError(doubts[0])
    check_told_apart(pieces, first)
    extrapolates = twin.controller is None and not corrected
    tolerance = gauss_newton.SMALL_CHANGE if extrapolates else gauss_newton.COST_TOLERANCE
    reached = gauss_newton.search(pieces, first, starts, seed, most, tolerance)
    point = pieces.in_order(reached.point)
    pieces.steps = {}
    if twin.controller is None:
        if not corrected:
            if pieces.slope_steps:
                (residuals,) = pieces.residuals([reached.point])
                reached = dataclasses.replace(reached, residuals=residuals)
                reached = gauss_newton.refine(pieces, reached, most, tolerance, rough=True)
            else:
                tolerance = gauss_newton.COST_TOLERANCE
            reached = pieces.slopes(pieces.in_order(reached.point), residuals=reached.residuals)
            reached = gauss_newton.refine(pieces, reached, most, tolerance)
            return pieces, *gauss_newton.extrapolated(pieces, reached, most)
        pieces.slope_steps = {}
        slopes, moved = gauss_newton.accurate(pieces, pieces.slopes(point))
        return pieces, gauss_newton.not_worse(pieces, slopes), moved
    closed = Replays(twin, names, data, True, report, kept=batches)
    points = [closed.start, Point(point.values, closed.start.states)]
    if len(closed.free):  # a record may begin at rest with a jump of the command
        points += list(map(closed.at_rest, points))
    begin = closed.slopes(gauss_newton.better(closed, *points))
    slopes = gauss_newton.refine(closed, begin, most)
    closed.evaluations += pieces.evaluations
    return closed, slopes, np.zeros(len(names))
