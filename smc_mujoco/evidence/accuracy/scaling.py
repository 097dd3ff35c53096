"""Orders of accuracy: the exponent with which an error falls with the control period, its interval,
and remarks.

The order is the slope of a line through the logarithms of error and period. Its variance is the sum
of two: that of the slope through the means of the starts, from their distance to the line, and that
of the starts' own slopes.

A period counts only if its errors are ultimate bounds of the law. So no run fails there, all errors
are above rounding, and no run's error still falls or grows: by more than a factor of 1.5 from each
of the last three parts to the next.
"""

import math
from collections.abc import Sequence

import numpy as np

from smc_mujoco.common.aliases import Array, Floats
from smc_mujoco.common.data import keyword_dataclass

# ratio of the errors in one part of a run and the next above which they fall or grow; chosen
TREND = 1.5
ORDER_BAND = 0.2  # difference of two orders up to which they agree
CONFIDENCE = 0.95  # of intervals
QUANTITIES = ("e", "s")
UNTOLD = "the order cannot be told"


@keyword_dataclass
class Scaling:
    """The order with which the error of one quantity falls with the control period, and its 95 %
    interval.
    """

    errors: tuple[Floats, ...]  # of each run: for each start, for each period; inf if it failed
    used: Floats  # the periods in the fit, s
    order: float  # exponent of the period; NaN with fewer than two periods
    low: float  # with `high` its interval; NaN with fewer than three periods
    high: float
    theory: (
        float | None
    )  # the order that the law's theorem promises, at least; None if it promises none here
    # why periods were left out, and why the order is not theory's where the runs show a reason
    why: str

    @property
    def largest(self) -> Floats:
        """The largest error over the starts, for each period."""
        return tuple(np.max(self.errors, axis=0).tolist())

    def __str__(self) -> str:
        if math.isnan(self.order):
            return "none"
        return f"{self.order:z.2f}" + (
            "" if math.isnan(self.low) else f" ±{self.high - self.order:.2f}"
        )


@keyword_dataclass
class Accuracy:
    """The accuracy of one law on one plant in one condition."""

    plant: str
    condition: str
    law: str
    gains: str  # the kinds of sources of the law's gains, see `control.source`, such as "shipped"
    unit: str  # of e; that of s depends on the law, for s = de + c e it is this unit per second
    periods: Floats  # control periods, s, longest first
    e: Scaling  # of the tracking error
    s: Scaling  # of the law's sliding variable
    runs: int
    failed: int  # runs
    floor: float  # errors up to this size are rounding

    @property
    def place(self) -> Floats:
        """What sorts laws: the number of failed runs, then the largest |e| at each period, from the
        shortest on.
        """
        shortest_first = np.maximum(self.e.largest[::-1], self.floor)
        return self.failed, *shortest_first.tolist()

    @property
    def why(self) -> str:
        """The remarks on e and on s in one text, which tells them apart where they differ; "" for
        none.
        """
        if self.e.why == self.s.why:
            return self.e.why
        remarks = []
        for name in QUANTITIES:
            remark = getattr(self, name).why
            if remark:
                remarks.append(f"for {name}, {remark}")
        return "; ".join(remarks)

    @property
    def theory(self) -> str:
        """The orders of e and s that theory promises, as text: one number if they are the same, ""
        for none.
        """
        promised = []
        for order in (self.e, self.s):
            if order.theory is None:
                promised.append("")
            else:
                promised.append(f"{order.theory:.2g}")
        return ", ".join(dict.fromkeys(promised))

    def error(self, k: int) -> str:
        """Return the largest |e| at period k as text."""
        value = self.e.largest[k]
        if not math.isfinite(value):
            return "failed"
        if value <= self.floor:
            return f"<{self.floor:.0e}"
        return f"{value:.1e}"


def scaling(
    parts: Array,
    periods: Sequence[float],
    theory: float | None,
    floor: float,
    remarks: Sequence[str] = (),
) -> Scaling:
    """Return how errors depend on the control period; periods (s, longest first), theory and floor
    as of the classes.

    Args:
      parts: largest magnitudes in the last three parts of each run, (starts, periods, 3), in order
        of time; inf for a failed run. The last one is the error.
      remarks: what is known without the errors, such as how many runs failed.
    """
    errors = parts[..., -1]
    failed = ~np.isfinite(errors).all(axis=0)
    rounded = np.asarray(~failed & (errors <= floor).any(axis=0))
    with np.errstate(invalid="ignore", divide="ignore"):
        ratios = parts[..., 1:] / parts[..., :-1]
    resolved = ~failed & ~rounded
    falls = np.all(ratios < 1.0 / TREND, axis=2)
    grows = np.all(ratios > TREND, axis=2)
    falling = np.asarray(resolved & np.any(falls, axis=0))
    growing = np.asarray(resolved & np.any(grows, axis=0))
    used = ~(failed | rounded | falling | growing)
    h = np.array(periods)[used]
    order, low, high = fit(h, errors[:, used])
    said = list(remarks)
    for mask, words in (
        (rounded, f"up to {floor:.0e}, which is rounding"),
        (falling, "still falling at the end of the run"),
        (growing, "still growing at the end of the run"),
    ):
        if mask.any():
            said.append(f"{_periods(periods, mask)} {words}")
    said.append(_difference(order, low, high, theory))
    return Scaling(
        errors=tuple(map(tuple, errors.tolist())),
        used=tuple(h.tolist()),
        order=order,
        low=low,
        high=high,
        theory=theory,
        why="; ".join(filter(None, said)),
    )


def fit(periods: Array, errors: Array) -> tuple[float, float, float]:
    """Return the exponent of periods (P,), s, in positive errors (starts, P), and its interval; NaN
    for too few.
    """
    if len(periods) < 2:
        return math.nan, math.nan, math.nan
    x = np.log(periods)
    y = np.log(errors)
    x = x - x.mean()
    spread = float(x @ x)
    slopes = y @ x / spread  # of each start
    mean = y.mean(axis=0)
    order = float(slopes.mean())
    if len(periods) < 3:
        return order, math.nan, math.nan
    from scipy.special import stdtrit

    freedom = len(periods) - 2
    residual = mean - mean.mean() - order * x
    variance = float(residual @ residual) / freedom / spread
    if len(slopes) > 1:
        variance += float(slopes.var(ddof=1)) / len(slopes)
    half = float(stdtrit(freedom, 0.5 + CONFIDENCE / 2.0)) * math.sqrt(variance)
    return order, order - half, order + half


def _difference(order: float, low: float, high: float, theory: float | None) -> str:
    """Return how an order differs from theory's, in words; "" if it does not."""
    if theory is None or math.isnan(order):
        return ""
    if low <= 0.0 < theory <= high:
        return f"its interval contains 0 and {theory:.2g}: {UNTOLD}"
    if order > theory + ORDER_BAND:
        return "falls faster than promised"
    if order >= theory - ORDER_BAND:
        return ""
    if low <= theory <= high:
        return "its interval contains the promised order"
    return "falls slower than promised: these gains, not sampling, limit it"


def _periods(periods: Sequence[float], mask: Array) -> str:
    """Return the marked periods in words."""
    if mask.all():
        return "all periods:"
    marked = ", ".join(f"{1e3 * h:g}" for h in np.array(periods)[mask])
    return f"at {marked} ms"
