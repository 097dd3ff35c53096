"""Time that a law takes for a sample: its compiled code alone, on this machine, on what it measures
in a run.

Every sample of the run is given to several copies of the law at once, each with its own memory, so
that a clock can tell tens of ns. The least time of each sample in a few rounds counts, as what else
the machine does only adds to it. The 99 % quantile is thus over samples: for a law that iterates,
the time of its hard ones. The code is warm: it and its memory are in the processor's caches. The
law `pid` is timed in turn with it, on the same measurements.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import time
from typing import NamedTuple

import numpy as np
from numba import njit

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.attended import attended
from smc_mujoco.common.jit import NotCompilable, call
from smc_mujoco.control.law import Law, library_law
from smc_mujoco.simulation import callback, cfunctions, state
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import ScenarioBatch
from smc_mujoco.simulation.scenario import Scenario

LONGEST = 2.0  # s of a run, with the approach and some rest of most; chosen
# of a law at once; numbers of their memories, which fit a processor's second cache
COPIES = 256
MOST_NUMBERS = 32768
ROUNDS = 5


class LawTime(NamedTuple):
    """The time that a law takes for a sample."""

    median: float  # s
    high: float  # s, the 99 % quantile over samples
    ratio: float  # of the median to that of `pid` on the same measurements


def law_time(scenario: Scenario) -> LawTime | None:
    """Return the time of a scenario's law in its last channel; None if it is of many joints, does
    not compile, or fails.
    """
    of_channel = scenario.resolved.law
    if of_channel.joint:
        return None
    timed = of_channel.of_channel(scenario.plant.driven - 1)
    reference = library_law("pid")
    try:
        cfunctions.compile_component(timed)
    except NotCompilable:
        return None
    seen = _measured(scenario)
    if not len(seen):
        return None
    # in turn, as loads come and go
    rounds = []
    for _ in range(ROUNDS):
        own_round = _round(timed, seen)
        other_round = _round(reference, seen)
        rounds.append((own_round, other_round))
    of_timed, of_reference = zip(*rounds, strict=True)
    own = np.min(of_timed, axis=0)
    reference_time = np.min(of_reference, axis=0)
    quantiles = np.quantile(own, (0.5, 0.99))
    median, high = quantiles.tolist()
    return LawTime(median, high, median / float(np.median(reference_time)))


def _measured(scenario: Scenario) -> Array:
    """Return what the law measures in the last channel at each sample of a run, (samples, fields
    of a Measurement).
    """
    samples = min(scenario.samples, round(LONGEST / scenario.control_period))
    seen = []
    with callback.installed():
        batch = ScenarioBatch([prepare(scenario)], threads=1)

        def measure() -> None:
            for k in range(samples):
                batch.advance_to((k + 1) * scenario.steps)
                if batch.records["failure"][0] != state.FINE:
                    break
                seen.append(batch.records["y"][0].item())

        attended([measure], batch.stop)  # one thread, not one for each sample
    return np.array(seen)


def _round(timed: Law, seen: Array) -> Array:
    """Return the time of a law at each sample, s, (samples,)."""
    function = cfunctions.compile_component(timed)
    fitting = MOST_NUMBERS // max(timed.memory, 1)
    copies = max(1, min(COPIES, fitting))
    gains = np.array([*timed.gains.values(), 0.0])
    memory = np.zeros((copies, timed.memory + 1))
    out = np.zeros(2)
    own = [a.ctypes.data for a in (gains, memory, out)]
    stride = memory.strides[0]
    rows = [row.ctypes.data for row in seen]
    clock = time.perf_counter_ns
    spent = np.empty(len(rows))
    empty = np.empty(len(rows))
    for k, row in enumerate(rows):
        start = clock()
        _calls(function.address, row, *own, stride, 0)
        middle = clock()
        _calls(function.address, row, *own, stride, copies)
        spent[k] = clock() - middle
        empty[k] = middle - start
    alone = np.maximum(spent - np.median(empty), 0.0)
    return 1e-9 * alone / copies


@njit
def _calls(function, y, gains, memory, out, stride, copies):
    """Call some copies of a law with one measurement. Return how many of them raised."""
    raised = 0
    for i in range(copies):
        raised += call(function, y, gains, memory + i * stride, out)
    return raised
