"""Time of a law per control sample: its compiled C function alone, on states that vary between samples.

Rounds of the laws are interleaved, and each law's least time counts, since other processes can only add to it. Only
ratios within one call mean anything. benchmarks/laws.py measures the whole sample, in which reading and logging cost
more.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import functools
import time
from collections.abc import Callable, Mapping

import numpy as np

from smc_mujoco.common.jit import call
from smc_mujoco.control.component import Component
from smc_mujoco.control.law import Measurement
from smc_mujoco.simulation import cfunctions

CALLS, ROUNDS, QUICK_ROUNDS = 20_000, 60, 20
FIELD_INDEX = {name: i for i, name in enumerate(Measurement._fields)}
FIXED_FIELDS = {"dt": 1e-3, "g": 8.0, "limit": 6.0}  # what a pendulum's sample holds besides the state; no model


def nanoseconds(laws: Mapping[str, Component], quick: bool = False) -> dict[str, float]:
    """Return the least time per call of each law, ns."""
    t = np.arange(CALLS) * 1e-3
    states = np.column_stack([0.3 * np.sin(7 * t), 2.1 * np.cos(7 * t)])
    # kept alive while their addresses are used
    functions = {name: cfunctions.compile_component(law) for name, law in laws.items()}
    shortest, loop = dict.fromkeys(laws, np.inf), _loop()
    for _ in range(QUICK_ROUNDS if quick else ROUNDS):
        for name, law in laws.items():
            seen, gains = np.zeros(len(FIELD_INDEX)), np.array([*law.gains.values(), 0.0])
            for field, value in FIXED_FIELDS.items():
                seen[FIELD_INDEX[field]] = value
            arrays = seen, gains, np.zeros(law.memory), np.zeros(2)
            addresses = np.array([a.ctypes.data for a in arrays])
            start = time.perf_counter()
            loop(functions[name].address, seen, states, addresses)
            shortest[name] = min(shortest[name], time.perf_counter() - start)
    return {name: 1e9 * seconds / CALLS for name, seconds in shortest.items()}


@functools.cache
def _loop() -> Callable:
    """Return a compiled loop that calls a law once per state."""
    from numba import njit

    e, de = FIELD_INDEX["e"], FIELD_INDEX["de"]

    @njit
    def loop(function, seen, states, addresses):
        for k in range(len(states)):
            seen[e], seen[de] = states[k, 0], states[k, 1]
            call(function, addresses[0], addresses[1], addresses[2], addresses[3])

    loop(0, np.zeros(len(FIELD_INDEX)), np.zeros((0, 2)), np.zeros(4, np.int64))  # compiles, and calls nothing
    return loop
