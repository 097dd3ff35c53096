"""What an identification gives: quantities with errors and correlations, fits, and notes on what to doubt."""

import dataclasses
import itertools
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from smc_mujoco.common.errors import whole
from smc_mujoco.common.files import write_json
from smc_mujoco.common.text import joined
from smc_mujoco.evidence.rigs.records import Record, percent
from smc_mujoco.evidence.rigs.rig import Fall, Rig
from smc_mujoco.evidence.rigs.uncertainty import BLOCKS, MAX_CORRELATION

POOR_FIT = 80.0  # percent: a fit below this may mean that the search ended in the wrong place; chosen
PERFECT_FIT = 99.99  # percent: residuals beyond it are the simulation's; chosen
UNIT_FACTOR = 5.0  # factor between a quantity before and after, beyond which a column may be in another unit; chosen
FACTOR_TOLERANCE = 0.1  # relative difference up to which such factors count as the same; chosen
MAX_FIT_LOSS = 0.1  # percent, by which the fit of a whole record may fall without a note; chosen


@dataclasses.dataclass(frozen=True)
class Identified:
    """The quantities of a rig that were found from records, and how well they fit.

    Fits are those of `Rig.fit`, in an open loop with short steps; for `fits` the states at the starts are found too.
    """

    rig: Rig  # with the values found
    before: Rig  # with the values before
    values: Mapping[str, float]  # quantity -> value found
    errors: Mapping[str, float]  # quantity -> its standard error
    correlations: np.ndarray  # of the errors, (p, p), in the order of `values`
    fits: tuple[Mapping[str, float], ...]  # of each record
    fits_before: tuple[Mapping[str, float], ...]
    predictions: tuple[tuple[Record, Record, np.ndarray], ...]  # predicted columns, measured ones, and their times
    evaluations: int  # how many parameter sets were simulated
    independent: float  # how many samples of the residuals are independent of each other

    @property
    def notes(self) -> list[str]:
        """Sentences on what the records cannot determine, and on a poor fit."""
        sentences = []
        for (i, second), (j, first) in itertools.product(enumerate(self.values), repeat=2):
            if j < i and abs(correlation := self.correlations[i, j]) > MAX_CORRELATION:
                sentences.append(f"{first} and {second} cannot be told apart (correlation {correlation:.3f})")
        for name, value in self.values.items():
            quantity = self.rig.quantities[name]
            if value in (quantity.least, quantity.most):
                sentences.append(f"{name} is at the end of its range, {value:g} {quantity.unit}".rstrip())
            elif self.errors[name] > abs(value):
                sentences.append(f"{name} may as well be 0 ({value:.3g} ± {self.errors[name]:.2g})")
        return sentences + self._scale_notes() + self._loss_notes() + self._doubts()

    def _scale_notes(self) -> list[str]:
        """Sentences on quantities that cannot be negative and are far from their values before."""
        before = {name: self.before.quantities[name] for name in self.values}
        positive = {name: q.value for name, q in before.items() if q.least >= 0.0 and q.value > 0.0}
        factors = {name: self.values[name] / value for name, value in positive.items()}
        far = {name: factor for name, factor in factors.items() if not 1.0 / UNIT_FACTOR < factor < UNIT_FACTOR}
        if not far:
            return []
        middle = float(np.median(list(far.values())))
        if len(far) > 1 and all(abs(factor / middle - 1.0) < FACTOR_TOLERANCE for factor in far.values()):
            return [
                f"{joined(list(far))} are {middle:.3g} times what they were before: look at the unit of the command"
            ]
        changes = [f"{name} is {factor:.3g} times its value before" for name, factor in far.items()]
        return [f"{joined(changes)}: look at the units of the columns, unless the values before were only a guess"]

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
            poor = f"the twin {worst}" if isinstance(worst, Fall) else f"the worst fit is {worst:.0f} %"
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

    def drawn(self, count: int = 8, seed: int = 0) -> Rig:
        """Return the rig with an ensemble of other parameter sets that the records allow, for rankings over them.

        They are drawn from the normal distribution of the errors, and cut to the ranges.
        """
        whole("count", count, 1, 1000)
        names, rng = list(self.values), np.random.default_rng(whole("seed", seed, 0, 2**53 - 1))
        spread, middle = (np.array([of[name] for name in names]) for of in (self.errors, self.values))
        draws = rng.multivariate_normal(middle, self.correlations * np.outer(spread, spread), count, method="eigh")
        known = [self.rig.quantities[name] for name in names]
        kept = np.clip(draws, [quantity.least for quantity in known], [quantity.most for quantity in known])
        return dataclasses.replace(
            self.rig, ensemble=tuple(dict(zip(names, row, strict=True)) for row in kept.tolist())
        )

    def __repr__(self) -> str:
        values = ", ".join(f"{name} = {value:.4g} ± {self.errors[name]:.1g}" for name, value in self.values.items())
        return f"identified({self.rig.name!r}, {values})"

    def save(self, path: str | Path) -> Path:
        """Write values, errors, correlations and fits to a JSON file. Return its path."""
        quantities = {
            name: {"value": value, "error": self.errors[name], "unit": self.rig.quantities[name].unit}
            for name, value in self.values.items()
        }
        about = {"rig": self.rig.name, "quantities": quantities, "correlations": self.correlations.tolist()}
        for key, fits in (("fits", self.fits), ("fits_before", self.fits_before)):
            about[key] = [
                {column: str(value) if isinstance(value, Fall) else value for column, value in fit.items()}
                for fit in fits
            ]
        return write_json(Path(path), about)

    def figure(self, path: str | Path, record: int = 0) -> list[Path]:
        """Draw measured and predicted columns of a record, and their residuals, as PATH.svg and PATH.png."""
        from smc_mujoco.evidence.rigs.figure import residual_figure

        whole("record", record, 0, len(self.fits) - 1)
        predicted, measured, t = self.predictions[record]
        fits = {"twin": self.fits[record]}
        return residual_figure(self.rig.label, t, measured, {"twin": predicted}, fits, self.rig.units, path)
