"""Results cached for each trace, because tables, figures and films ask for the same."""

from __future__ import annotations

import functools
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from smc_mujoco.simulation.trace import Trace

V = TypeVar("V")


def once_per_trace(function: Callable[[Trace], V]) -> Callable[[Trace], V]:
    """Decorate a function of a trace: a result is computed once, and cached as long as its trace
    exists.
    """

    @functools.wraps(function)
    def cached(trace: Trace) -> V:
        results = vars(cached)["results"]
        if trace not in results:
            results[trace] = function(trace)
        return results[trace]

    # of the function, not of its closure, because a hash of its code has to leave the results out
    vars(cached)["results"] = weakref.WeakKeyDictionary()
    return cached
