"""Friction from pairs of speed and torque, as most published studies of friction have them.

    found = smc.identify_friction(speed, torque)
    print(found)
    smc.Scenario(plant="duffing", law="pid", friction=found.part)

The torque is what friction alone needs: measured, less gravity and inertia. Five models are fitted
by least squares, from a level alone to a level with a Stribeck drop. The one nonlinear number, a
speed, is found by a scan. Taken is the smallest model whose error on blocks of time that were left
out is within one standard error of the best (L. Breiman et al., Classification and Regression
Trees, 1984, section 3.4.3).
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.common.aliases import AnyPath, Array, Fields, Numbers
from smc_mujoco.common.data import attributes
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.files import as_path, write_json
from smc_mujoco.identification import number_text, records
from smc_mujoco.identification.least_squares import least_squares
from smc_mujoco.mechanisms.hardware.stribeck import Stribeck
from smc_mujoco.simulation.conditions import Condition, condition

# Model -> its terms, from the smallest on
MODELS = {
    "level": ("level",),
    "level, viscous": ("level", "viscous"),
    "level, viscous, offset": ("level", "viscous", "offset"),
    "smooth level, viscous, offset": ("smooth", "viscous", "offset"),
    "level, drop, viscous, offset": ("level", "drop", "viscous", "offset"),
}
NATURAL = "level", "smooth", "drop", "viscous"  # terms whose number is 0 or more
SPEED_OF = {"smooth": "width", "drop": "stribeck"}  # the speed of a term, rad/s (m/s)
UNITS = {"level": "N m", "drop": "N m", "offset": "N m", "viscous": "N m s/rad"}
UNITS |= {"width": "rad/s", "stribeck": "rad/s"}
MOVING = 0.01  # of the largest speed: slower pairs may be of a joint at rest
BLOCKS = 20  # of time, each of which counts once: neighbouring pairs depend on each other
SCAN = 40  # speeds that are tried, from twice the slowest pair to half of the fastest; chosen
MIN_PAIRS = 100  # that move, five in a block; chosen
MIN_R2 = 0.5  # of the variation of torque: below there is no friction in it
MOSTLY = 0.5  # of the held-out mean square: a mean that is more is told; chosen
WORSE = 1.5  # times the rms: held-out pairs that are better need no sentence; chosen
FITTED = 2 / 3  # of the pairs; what follows is held out, unless another log is given
Pairs = tuple[Array, Array]  # speeds and torques, (K,) each


@dataclasses.dataclass(frozen=True)
class FrictionFit:
    """A model of friction that was fitted to pairs of speed and torque."""

    model: str
    numbers: Numbers  # level, viscous, offset, drop, N m (N) or N m s/rad; width or stribeck, rad/s
    errors: Numbers  # their standard errors: those of blocks of time, or of white noise if larger
    rms: float  # N m (N), of the residuals
    held_out: float  # N m (N), the same on pairs that were not used
    held_out_offset: float  # N m (N), the mean of these residuals
    r2: float  # share of the variation of torque that it explains
    covariance: Array = dataclasses.field(repr=False)  # of the errors, (p, p), as `numbers`
    at_zero: tuple[str, ...] = ()  # numbers that would be negative

    @property
    def _values(self) -> tuple[tuple[str, ...], Array, float]:
        """The terms, their numbers, and the speed of one of them; 1 without one."""
        terms = MODELS[self.model]
        numbers = list(self.numbers.values())
        speed = numbers[len(terms)] if len(numbers) > len(terms) else 1.0
        return terms, np.array(numbers[: len(terms)]), speed

    def force(self, v: Array) -> Array:
        """Return the friction at speeds v, (K,), N m (N)."""
        terms, values, speed = self._values
        return _columns(terms, v, speed) @ values

    def force_error(self, v: Array) -> Array:
        """Return the standard error of the friction at speeds v, (K,), N m (N), at first order."""
        slopes = _slopes(v, *self._values)
        return np.sqrt(np.maximum(np.einsum("kp,pq,kq->k", slopes, self.covariance, slopes), 0.0))

    @property
    def part(self) -> Stribeck:
        """It as a part of a scenario."""
        number = self.numbers.get
        level = number("level", 0.0)
        drop = number("drop", 0.0)
        return Stribeck(
            level,
            level + drop if drop else None,
            self.numbers["stribeck"] if drop else None,
            viscous=number("viscous", 0.0),
            offset=number("offset", 0.0),
            width=number("width", 0.0),
        )


@dataclasses.dataclass(frozen=True)
class FrictionFound:
    """Friction in pairs of speed and torque: every model, and the one that is taken."""

    fits: dict[str, FrictionFit]  # by model, from the smallest on
    best: FrictionFit
    pairs: Pairs = dataclasses.field(repr=False)  # speeds and torques of the joint while it moves

    @property
    def part(self) -> Stribeck:
        """The friction that is taken, for `friction` of a scenario.

        Raises:
          ScenarioError: there is no friction in the pairs.
        """
        if self.best.r2 < MIN_R2:
            raise ScenarioError(
                f"{self.no_friction}: give the torque that friction alone needs (measured, less "
                "gravity and inertia), in N m, without spikes"
            )
        return self.best.part

    @property
    def offset_moved(self) -> str:
        """A sentence if the residuals of the pairs held out are mostly another offset; else ""."""
        rms, mean = self.best.held_out, self.best.held_out_offset
        if mean**2 < MOSTLY * rms**2 or rms < WORSE * self.best.rms:
            return ""
        spread = np.sqrt(rms**2 - mean**2)
        return (
            f"the offset of the pairs held out differs by {mean:+.3g} N m: apart from it their rms "
            f"is {spread:.3g}. A load or the zero of the torque has changed, so find the offset of "
            "each log"
        )

    @property
    def no_friction(self) -> str:
        """A sentence if no model explains half of the variation of torque; else ""."""
        if self.best.r2 >= MIN_R2:
            return ""
        share = f"{self.best.r2:.2f} of the variation"
        if self.best.r2 < 0.005:
            share = "nothing of the variation"
        return f"no friction in it: {self.best.model} explains {share}"

    def condition(self, name: str = "identified") -> Condition:
        """Return a condition with this friction, for `compare`, `which`, `tune`, `grid`."""
        return condition(name, friction=self.part)

    def about(self) -> Fields:
        """Return the fits as JSON data."""
        fields = ("numbers", "errors", "rms", "held_out", "r2")
        fits = {model: attributes(fit, fields) for model, fit in self.fits.items()}
        return {"best": self.best.model, "fits": fits}

    def save(self, path: AnyPath) -> Path:
        """Write a file, and return its path. FILE.txt is the condition, with the table as comments,
        for --condition of compare, which and tune. Any other is `about` as JSON.
        """
        file = as_path(path)
        if file.suffix != ".txt":
            return write_json(file, self.about())
        return number_text.save_condition(file, str(self), self.condition())

    def figure(self, path: AnyPath) -> list[Path]:
        """Draw the pairs, the friction that is taken with two standard errors, and the other
        models, as PATH.svg and PATH.png, or PATH.pdf. Return the paths.
        """
        from smc_mujoco.identification.pairs_figure import pairs_figure

        forces = {model: fit.force for model, fit in self.fits.items()}
        best = self.best
        title = f"rms {best.rms:.3g}, held out {best.held_out:.3g}, R² {best.r2:.3f}"
        return pairs_figure(self.pairs, forces, best.model, best.force_error, title, path)

    def __str__(self) -> str:
        heads = f"{'model':<30} {'rms':>8} {'held out':>8} {'R2':>6}"
        rows = [heads]
        for fit in self.fits.values():
            mark = "*" if fit is self.best else " "
            rows.append(f"{fit.model:<29}{mark} {fit.rms:8.4f} {fit.held_out:8.4f} {fit.r2:6.3f}")
        rows += ["", *number_text.table(self.best.numbers, self.best.errors, UNITS)]
        for name in self.best.at_zero:
            rows.append(f"{name} would be negative, and is 0")
        return "\n".join([*rows, *filter(None, [self.no_friction, self.offset_moved])])


def identify_friction(speed: Any, torque: Any, held_out: Any = None) -> FrictionFound:
    """Find friction in pairs of speed and torque.

        speed = np.sin(np.linspace(0.0, 9.0, 500))
        found = smc.identify_friction(speed, 0.3 * np.sign(speed) + 0.1 * speed)
        found.best.numbers["level"], found.part

    Args:
      speed: of the joint, rad/s (m/s), (K,), in the order of time.
      torque: that friction needs at this speed, N m (N), (K,): measured, less gravity and inertia.
      held_out: (speed, torque) of another log, on which `held_out` of the fits is. None: the last
        third of the pairs.

    Returns:
      A `FrictionFound`: `fits` by model with numbers, standard errors, rms and held-out rms, `best`
      of them, and its `part`.

    Raises:
      ScenarioError: pairs that are no numbers, too few that move, or of one direction alone.
    """
    pairs = _moving(speed, torque, "the pairs")
    held_out_pairs = None if held_out is None else _moving(held_out[0], held_out[1], "held_out")
    fits = {}
    errors = []
    for model, terms in MODELS.items():
        fits[model], errors_of_blocks = _fitted(model, terms, pairs, held_out_pairs)
        errors.append(errors_of_blocks)
    losses = np.array(errors)
    least = losses[int(losses.mean(axis=1).argmin())]
    for fit, loss in zip(fits.values(), losses, strict=True):
        worse = loss - least
        if worse.mean() <= worse.std(ddof=1) / np.sqrt(len(worse)):
            return FrictionFound(fits, fit, pairs)
    raise AssertionError("the best model is not worse than itself")


def read_pairs(path: AnyPath, columns: Mapping[str, str] | None = None) -> Pairs:
    """Return the columns speed and torque of a CSV or npz file, (K,) each.

    Args:
      path: of the file.
      columns: our name of a column -> the file's.

    Raises:
      ScenarioError: the file has no such column.
    """
    record: Any = records.as_columns(path, columns)
    for name in ("speed", "torque"):
        if not isinstance(record, Mapping) or name not in record:
            has = ", ".join(map(str, record)) if isinstance(record, Mapping) else "a trace"
            raise ScenarioError(
                f"{path} has no column {name} (it has {has}): add it, or say which it is, as "
                f"--columns {name}=NAME"
            )
    return record["speed"], record["torque"]


def _moving(speed: Any, torque: Any, what: str) -> Pairs:
    """Return the pairs of a joint that moves."""
    try:
        v, force = np.asarray(speed, float), np.asarray(torque, float)
    except (TypeError, ValueError, OverflowError):
        v = force = np.empty((0, 0))
    if v.ndim != 1 or v.shape != force.shape:
        raise ScenarioError(
            f"{what} are speeds {shown(speed)} and torques {shown(torque)}: give one number of "
            "each for each sample"
        )
    if wrong := int(np.sum(~(np.isfinite(v) & np.isfinite(force)))):
        raise ScenarioError(f"{wrong} of {what} are not finite: leave those samples out")
    moves = np.abs(v) > MOVING * np.abs(v).max(initial=0.0)
    if moves.sum() < MIN_PAIRS:
        raise ScenarioError(f"{moves.sum()} of {what} move: give {MIN_PAIRS} or more")
    v = v[moves]
    if not v.min() < 0.0 < v.max():
        raise ScenarioError(
            f"{what} have speeds of one sign, and a level cannot be told from an offset: give "
            "pairs of both directions"
        )
    return v, force[moves]


def _columns(terms: tuple[str, ...], v: Array, speed: float) -> Array:
    """Return what each term is at speeds v per unit of its number, (K, terms)."""
    sign = np.sign(v)
    shapes = {
        "level": lambda: sign,
        "smooth": lambda: np.tanh(v / speed),
        "drop": lambda: sign * np.exp(-((v / speed) ** 2)),
        "viscous": lambda: v,
        "offset": lambda: np.ones_like(v),
    }
    columns = [shapes[term]() for term in terms]
    return np.column_stack(columns)


def _solved(terms: tuple[str, ...], v: Array, force: Array, speed: float) -> Array:
    """Return the numbers of the terms by least squares; 0 for what would be negative, (terms,)."""
    columns = _columns(terms, v, speed)
    free = list(range(len(terms)))
    while True:
        numbers = np.zeros(len(terms))
        numbers[free] = least_squares(columns[:, free], force)
        negative = []
        for i in free:
            if terms[i] in NATURAL and numbers[i] < 0.0:
                negative.append(i)
        if not negative:
            return numbers
        free.remove(min(negative, key=lambda i: numbers[i]))


def _speed(terms: tuple[str, ...], v: Array, force: Array) -> float:
    """Return the speed of a smooth or dropping term with the least squares; 1 without one."""
    from scipy.optimize import minimize_scalar

    if not set(terms) & SPEED_OF.keys():
        return 1.0

    def loss(logarithm: float) -> float:
        speed = float(np.exp(logarithm))
        numbers = _solved(terms, v, force, speed)
        return float(np.sum((force - _columns(terms, v, speed) @ numbers) ** 2))

    sizes = np.abs(v)
    low = 2.0 * sizes.min()
    high = 0.5 * sizes.max()
    grid = np.linspace(np.log(low), np.log(max(high, 2.0 * low)), SCAN)
    best = int(np.argmin(list(map(loss, grid))))
    around = grid[max(best - 1, 0)], grid[min(best + 1, SCAN - 1)]
    minimum: Any = minimize_scalar(loss, bounds=around, method="bounded")
    return float(np.exp(minimum.x))


def _fitted(
    model: str, terms: tuple[str, ...], pairs: Pairs, other: Pairs | None
) -> tuple[FrictionFit, Array]:
    """Return the fit of a model, and the mean squares of its errors on blocks that were left out,
    (BLOCKS,).
    """
    v, force = pairs
    speed = _speed(terms, v, force)
    numbers = _solved(terms, v, force, speed)
    residual = force - _columns(terms, v, speed) @ numbers
    first, last = pairs, other
    if last is None:
        cut = round(FITTED * len(v))
        first = v[:cut], force[:cut]
        last = v[cut:], force[cut:]
    used = _speed(terms, *first)
    speeds_left, force_left = last
    predicted = _columns(terms, speeds_left, used) @ _solved(terms, *first, used)
    rest = force_left - predicted
    names = []
    speeds = []
    for term in terms:
        names.append("level" if term == "smooth" else term)
        if term in SPEED_OF:
            speeds.append(SPEED_OF[term])
    numbers_by_name = dict(zip(names, numbers.tolist(), strict=True))
    numbers_by_name |= dict.fromkeys(speeds, speed)
    covariance, losses = _covariance(terms, pairs, numbers, speed)
    errors = np.sqrt(np.diag(covariance))
    zeros = []
    for name in names:
        if name != "offset" and numbers_by_name[name] == 0.0:
            zeros.append(name)
    fit = FrictionFit(
        model,
        numbers_by_name,
        dict(zip(numbers_by_name, errors.tolist(), strict=True)),
        float(np.sqrt(np.mean(residual**2))),
        float(np.sqrt(np.mean(rest**2))),
        float(np.mean(rest)),
        float(1.0 - np.sum(residual**2) / np.sum((force - force.mean()) ** 2)),
        covariance,
        tuple(zeros),
    )
    return fit, losses


def _slopes(v: Array, terms: tuple[str, ...], numbers: Array, speed: float) -> Array:
    """Return how friction at speeds v depends on the numbers of the terms and on the speed of one,
    (K, p).
    """
    slopes = _columns(terms, v, speed)
    if not set(terms) & SPEED_OF.keys():
        return slopes
    step = 1e-4 * speed
    faster = _columns(terms, v, speed + step)
    slower = _columns(terms, v, speed - step)
    return np.column_stack([slopes, (faster - slower) @ numbers / (2.0 * step)])


def _covariance(
    terms: tuple[str, ...], pairs: Pairs, numbers: Array, speed: float
) -> tuple[Array, Array]:
    """Return the covariance of the errors of the numbers and of the speed, if there is one, and the
    mean squares of the errors on each block that was left out.

    The numbers without a block follow from the slopes at the fit. Numbers at 0 stay there.
    Variances are those of blocks, or of white noise if larger.
    """
    v, force = pairs
    slopes = _slopes(v, terms, numbers, speed)
    residual = force - _columns(terms, v, speed) @ numbers
    free = np.any(slopes != 0.0, axis=0)
    free[: len(terms)] &= (numbers != 0.0) | (np.array(terms) == "offset")
    free_numbers = np.flatnonzero(free)
    slopes = slopes[:, free_numbers]
    information = slopes.T @ slopes
    moved = np.zeros((BLOCKS, len(free_numbers)))
    losses = np.zeros(BLOCKS)
    for b, block in enumerate(np.array_split(np.arange(len(v)), BLOCKS)):
        own, block_residual = slopes[block], residual[block]
        moved[b] = -least_squares(information - own.T @ own, own.T @ block_residual)
        losses[b] = np.mean((block_residual - own @ moved[b]) ** 2)
    moved -= moved.mean(axis=0)
    by_blocks = (BLOCKS - 1) / BLOCKS * moved.T @ moved
    degrees = max(len(v) - len(free_numbers), 1)
    white = np.sum(residual**2) / degrees * np.diag(np.linalg.pinv(information))
    variance = np.diag(by_blocks)
    factors = np.sqrt(np.maximum(white / np.maximum(variance, 1e-300), 1.0))
    covariance = np.zeros((len(free), len(free)))
    covariance[np.ix_(free_numbers, free_numbers)] = by_blocks * np.outer(factors, factors)
    return covariance, losses
