"""Results kept for each trace, because tables, figures and films ask for the same."""

from __future__ import annotations

import functools
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from smc_mujoco.simulation.trace import Trace

V = TypeVar("V")


class once_per_trace(Generic[V]):
    """Decorator for a function of a trace: a result is computed once, and kept as long as its trace
    exists.
    """

    def __init__(self, function: Callable[[Trace], V]):
        functools.update_wrapper(
            self, function
        )  # hashes of code follow __wrapped__ and do not see the results
        self._function = function
        self._results: weakref.WeakKeyDictionary[Trace, V] = weakref.WeakKeyDictionary()

    def __call__(self, trace: Trace) -> V:
        if trace not in self._results:
            self._results[trace] = self._function(trace)
        return self._results[trace]
