"""When a number of a run and of the same run again count as different: the rule by which all
numbers are marked.

They do where they are more than 5 % apart, or where only some of the runs have the number, such as
a limit cycle. Values below what matters in the problem count as equal. Under an integrator of first
order half the step removes half of the error. So the value without it, 2 y' - y with y' that at
half the step, counts as one more.
"""

import math
from collections.abc import Sequence

MAX_CHANGE = 0.05  # relative change of a number above which it is marked: chosen


def relative_range(values: Sequence[float], least: float = 0.0, first_order: bool = False) -> float:
    """Return the range of a number in several runs over its smallest magnitude; inf if only some of
    them have it.

    Magnitudes up to `least` do not matter, see `paired_runs.floor`. NaN is a run without the
    number. With `first_order` the first two values are of a run under an integrator of first order,
    and of the same run at half the step.
    """
    if first_order and len(values) > 1 and all(map(math.isfinite, values[:2])):
        values = [*values, 2.0 * values[1] - values[0]]
    missing = list(map(math.isnan, values))
    if any(missing):
        return 0.0 if all(missing) else math.inf
    beyond = []
    for value in values:
        excess = max(abs(value) - least, 0.0)
        beyond.append(math.copysign(excess, value))
    smallest = max(min(map(abs, values)), least)
    width = max(beyond) - min(beyond)
    # inf - inf is no change
    if not width > 0.0:
        return 0.0
    return width / smallest if smallest else math.inf


def differ(values: Sequence[float], least: float = 0.0, first_order: bool = False) -> bool:
    """Return whether a number of a run and of the same run again are more than 5 % apart, see
    `relative_range`.
    """
    return relative_range(values, least, first_order) > MAX_CHANGE
