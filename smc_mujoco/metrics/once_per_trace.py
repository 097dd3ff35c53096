"""Results kept for each trace, because tables, figures and films ask for the same."""

from __future__ import annotations

import functools
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from smc_mujoco.simulation.trace import Trace

V = TypeVar("V")


def once_per_trace(function: Callable[[Trace], V]) -> Callable[[Trace], V]:
    """Decorate a function of a trace: a result is computed once, and kept as long as its trace
    exists.
    """
    results: weakref.WeakKeyDictionary[Trace, V] = weakref.WeakKeyDictionary()

    @functools.wraps(function)  # hashes of code follow __wrapped__ and do not see the results
    def kept(trace: Trace) -> V:
        if trace not in results:
            results[trace] = function(trace)
        return results[trace]

    return kept
