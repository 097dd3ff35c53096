"""Friction by a formula in environments: the callback of `smc.run` computes it, and the agent gives the commands."""

import contextlib
import dataclasses
from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.simulation import callback, state
from smc_mujoco.simulation.model import Mechanism, channels
from smc_mujoco.simulation.prepare import pack, prepare
from smc_mujoco.simulation.scenario import Resolved


class FormulaFriction:
    """The friction by a formula of `count` copies of a mechanism."""

    def __init__(self, scenario: Resolved, model: mujoco.MjModel, count: int):
        prepared = prepare(scenario)
        if prepared.why_not:
            name = type(scenario.formula_friction).__name__
            raise ScenarioError(f"friction {name} needs functions that compile, but {prepared.why_not}")
        self.scenario, self.model, self.count = scenario, model, count
        mechanism = Mechanism(prepared.mechanism.model, channels(model))
        self.prepared = dataclasses.replace(prepared, mechanism=mechanism)
        self.log = np.zeros((1, scenario.plant.n), state.LOG)
        self.records, self.packed = np.zeros(count, state.SIMULATION), []  # the arrays whose addresses are in records
        for i in range(count):
            self.records[i], packed = pack(self.prepared, self.log)
            self.packed.append(packed)
        self.records["agent"] = 1

    @property
    def userdata(self) -> np.ndarray:
        """The content of mjData.userdata of each copy, (count, 2)."""
        addresses = state.address(self.records) + np.arange(self.count) * self.records.itemsize
        return np.column_stack([np.full(self.count, callback.magic()), addresses])

    @property
    def failed(self) -> np.ndarray:
        """The copies in which the formula raised an exception, (count,) of bool."""
        return self.records["failure"] != state.FINE

    def states(self, i: int) -> np.ndarray:
        """Return the channel states of copy i as writeable numbers: where its joints stick, and their last speeds."""
        size = state.CHANNEL_STATE.itemsize // 8 * self.scenario.plant.n
        return state.view(self.packed[i].numbers, int(self.records["states"][i]), (size,))

    def begin(self, copies: Iterable[int]) -> None:
        """Begin episodes in which no joint sticks."""
        for i in copies:
            self.states(i)[:] = 0.0
            self.records["failure"][i] = state.FINE

    def with_friction(self, data: mujoco.MjData) -> contextlib.AbstractContextManager[None]:
        """Return the context in which friction acts on the only copy."""
        data.userdata[:] = self.userdata[0]
        return callback.installed()

    def __getstate__(self) -> dict[str, Any]:
        """Return all but addresses, for copies and other processes."""
        states = [self.states(i).copy() for i in range(self.count)]
        return {"arguments": (self.scenario, self.model, self.count), "states": states, "failed": self.failed}

    def __setstate__(self, pickled: dict[str, Any]) -> None:
        self.__init__(*pickled["arguments"])
        for i, numbers in enumerate(pickled["states"]):
            self.states(i)[:] = numbers
        self.records["failure"] = np.where(pickled["failed"], state.RAISED, state.FINE)
