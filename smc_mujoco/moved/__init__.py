"""Old names of modules, such as smc_mujoco.law, for one release. They work, with a DeprecationWarning.

This folder is on the package's path, so `from smc_mujoco.law import law_function` finds law.py here.
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
    "c": "control.c",
    "c.export": "control.c.export",
    "c.load": "control.c.load",
    "claims": "studies.paper.claims.audit",
    "claims.lyapunov": "studies.paper.claims.lyapunov",
    "component": "control.component",
    "conditions": "simulation.perturbations",
    "contact": "mechanisms.hardware.contact",
    "design": "control.design",
    "differences": "analysis.differences",
    "draw.video": "draw.film.film",
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
    "paper": "studies.paper.scenarios",
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
    """A module under its old name. If a public function has that name too, the module can be called in its place."""

    def __init__(self, name: str, module: types.ModuleType):
        super().__init__(name, module.__doc__)
        vars(self).update({name: value for name, value in vars(module).items() if not name.startswith("__")})
        found = vars(sys.modules[name])  # the file in this folder
        vars(self).update({name: found[name] for name in ("__path__", "__spec__") if name in found})
        self._module = module

    def __getattr__(self, name: str) -> object:
        return getattr(self._module, name)

    def __call__(self, *args: object, **kwargs: object) -> object:
        """Call the public function of this name."""
        return importlib.import_module("smc_mujoco").__getattr__(self.__name__.rpartition(".")[2])(*args, **kwargs)


def forward(old: str) -> None:
    """Let the old name of a module stand for the module in its new place, with a DeprecationWarning."""
    place = "smc_mujoco." + PLACES[old.removeprefix("smc_mujoco.")]
    warnings.warn(f"{old} is now {place}: import it from there", DeprecationWarning, stacklevel=3)
    sys.modules[old] = Moved(old, importlib.import_module(place))
