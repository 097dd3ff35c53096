"""Tables of made-up runs, in place of a study's."""

import copy
import json
import math

import numpy as np

from smc_mujoco.common.errors import ScenarioError, find
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.simulation import scenario_json

TEXTS = {
    "plant": "duffing",
    "condition": "nominal",
    "failure": None,
    "half_step": None,
    "trends": None,
    "arrived": True,
    "touched": None,
    "source": "given",
    "search": None,
    "scenario": '{"plant": {}}',
}


class MadeTable:
    """A table of runs with the given columns; others have a default."""

    def __init__(self, **columns):
        rows = len(columns["law"])
        self.columns = {"seed": np.arange(rows), "duration": np.full(rows, 10.0)}
        for name in (*CATALOGUE, "diverged_at"):
            self.columns[name] = np.full(rows, math.nan)
        for name, text in TEXTS.items():
            self.columns[name] = np.array([text] * rows, object)
        self.columns |= {name: np.asarray(values) for name, values in columns.items()}

    def column(self, name: str) -> np.ndarray:
        return find("column", name, self.columns)

    def scenario(self, i: int):
        text = self.column("scenario")[i]
        if text == TEXTS["scenario"]:
            raise ScenarioError("no run")
        return scenario_json.restore(json.loads(text))

    def taken(self, rows) -> "MadeTable":
        return MadeTable(**{name: values[rows] for name, values in self.columns.items()})


def table_of(scores: dict[str, np.ndarray], metric: str = "itae", **columns) -> MadeTable:
    """A table of one plant from law -> (conditions, seeds)."""
    conditions, seeds = next(iter(scores.values())).shape
    names = [f"c{i}" for i in range(conditions)]
    columns[metric] = np.concatenate([values.ravel() for values in scores.values()])
    return MadeTable(
        law=np.repeat(list(scores), conditions * seeds),
        condition=np.tile(np.repeat(names, seeds), len(scores)),
        seed=np.tile(np.arange(seeds), len(scores) * conditions),
        **columns,
    )


def changed(block, **facts):
    """Return a block of a board with other facts than its comparison's."""
    twin = copy.copy(block)
    twin.__dict__.update(facts)
    return twin
