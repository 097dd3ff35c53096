"""Old names of modules, such as smc_mujoco.law, for one release: each hands on its module's new place, and warns.

This folder is on the package's path, so that `from smc_mujoco.law import law_function` finds law.py here.
"""

import importlib
import sys
import types
import warnings

PLACES = {
    "actuators": "mechanisms.hardware.drives",
    "agents": "envs.agent",
    "backlash": "mechanisms.hardware.backlash",
    "basin": "analysis.region_of_attraction",
    "bounds": "analysis.tuning.search_space",
    "claims": "studies.paper.claims.audit",
    "component": "control.component",
    "conditions": "simulation.perturbations",
    "contact": "mechanisms.hardware.contact",
    "design": "control.design",
    "differences": "analysis.differences",
    "errors": "common.errors",
    "estimators": "control.estimator",
    "friction": "mechanisms.hardware.friction",
    "grids": "simulation.grid",
    "gym": "envs.gymnasium_env",
    "initial_states": "simulation.initial_states",
    "law": "control.law",
    "leaderboard": "studies.leaderboard",
    "margins": "analysis.margins",
    "mechanism": "mechanisms.fidelity",
    "named_conditions": "simulation.conditions",
    "own_model": "mechanisms.custom.plant_from",
    "plant": "mechanisms.plant",
    "policies": "control.policy",
    "pytest_plugin": "testing.plugin",
    "references": "simulation.references",
    "report": "studies.report",
    "run": "simulation.run",
    "scenario": "simulation.scenario",
    "scene": "studies.scene",
    "sensors": "mechanisms.hardware.encoder",
    "series": "simulation.time_series",
    "signals": "simulation.signals",
    "study": "studies.study",
    "suite": "envs.dm_control_env",
    "surfaces": "control.surface",
    "table": "studies.table",
    "theory": "analysis.linear_theory",
    "trace": "simulation.trace",
    "tuned": "analysis.tuning.result",
    "tuning": "analysis.tuning.search",
    "vector": "envs.vector_env",
}


class Moved(types.ModuleType):
    """A module under its old name. Called, it is the public function of that name, which it hides."""

    def __init__(self, name: str, module: types.ModuleType):
        super().__init__(name, module.__doc__)
        self._module = module

    def __getattr__(self, name: str) -> object:
        return getattr(self._module, name)

    def __call__(self, *args: object, **kwargs: object) -> object:
        """What the public function of the module's old name gives."""
        return importlib.import_module("smc_mujoco").__getattr__(self.__name__.rpartition(".")[2])(*args, **kwargs)


def forward(old: str) -> None:
    """Put the module at its new place where the old name is being imported, with a DeprecationWarning."""
    place = "smc_mujoco." + PLACES[old.removeprefix("smc_mujoco.")]
    warnings.warn(f"{old} is now {place}: import it from there", DeprecationWarning, stacklevel=3)
    sys.modules[old] = Moved(old, importlib.import_module(place))
