"""Runs in worlds of one model, which MuJoCo Warp steps on a CUDA device."""

from collections.abc import Hashable, Sequence

import numpy as np

from smc_mujoco.analysis.engine.form import ChannelFunction, Form
from smc_mujoco.analysis.engine.group import (
    FormGroup,
    first_of,
    form_of,
    group_key,
    lags,
    why_not_sampled,
)
from smc_mujoco.analysis.engine.scores import holds
from smc_mujoco.analysis.engine.world_callback import WorldRuns, calls_in_step, world_places
from smc_mujoco.common.aliases import Array
from smc_mujoco.mechanisms.hardware.tendons import of_plant
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.simulation.model import check_start, mechanism, structure
from smc_mujoco.simulation.scenario import Resolved, Scenario


def no_model(x, v, i, p):
    """Return the f and g of a model that no law reads."""
    return 0.0, 1.0


def why_not(scenario: Scenario, metrics: Sequence[str] = (), device: str = "cuda") -> str:
    """Return why the callback of a world cannot run a scenario, in one sentence; "" if it can."""
    s = scenario.resolved
    plant = s.plant
    beyond = {
        "it has a base that moves freely": bool(plant.pose or plant.base >= 0),
        "its law reads the nominal model, which MuJoCo computes run by run": s.model != "none"
        and bool(plant.by_mujoco or plant.unmodelled),
        "tendons share the forces on its joints": of_plant(plant) is not None,
        "it measures joints that nothing drives": plant.measured > 0,
        "a part of it acts in MuJoCo's callback": any(kind != "act" for _, kind in s.acting),
        "it has an actuator other than lags and rate limits": not all(map(lags, s.actuator)),
        "its parameters jump": bool(s.jump),
        "a disturbance acts on a body": bool(s.disturbance) and not plant.direct,
    }
    for name in metrics:
        beyond[f"{name} needs to know when friction holds a joint, as a trace does"] = holds(name)
        if refusal := name in CATALOGUE and CATALOGUE[name].refusal(s):
            beyond[refusal] = True
    return first_of(beyond) or why_not_sampled(s, metrics, device)


class WorldGroup(FormGroup):
    """Runs in worlds of one model, see `FormGroup`."""

    # chosen: by an estimate an H100 draws level with two cores at 55 Pandas, with 16 threads at 440
    least = 256

    @staticmethod
    def key_of(scenario: Scenario) -> Hashable:
        """Return what is equal for scenarios that are worlds of one model."""
        return group_key(scenario), structure(scenario)

    def __init__(
        self, scenarios: Sequence[Scenario], metrics: Sequence[str] = (), known: Sequence[Form] = ()
    ):
        super().__init__(scenarios, metrics, known)
        self.mechanism = mechanism(scenarios[0])
        for scenario in scenarios:
            check_start(self.mechanism, scenario)
        places, size = world_places(self.form)
        rows = np.zeros((len(scenarios), size))
        rows[:, : self.layout.row_size] = self.rows
        for row, s in zip(rows, self.scenarios, strict=True):
            row[places.calls] = calls_in_step(self.form, s)
            for name in ("qpos", "qvel", "ctrl"):
                first = getattr(places, name)
                row[first : first + s.plant.n] = self.mechanism.channels[name]
            row[places.scale : places.scale + s.plant.driven] = s.drive_train.scales
        self.rows = rows

    @property
    def runs(self) -> WorldRuns:
        """What is run: the form, the scenarios and the model, without rows."""
        return WorldRuns(self.form, self.scenarios, self.mechanism.model, self.tables)

    def run(self, rows: Array, threads: int | None = None, device: str = "cuda") -> Array:
        """Return the scores of rows, (runs, SCORES + metrics); NaN after a failure."""
        from smc_mujoco.analysis.engine import warp

        return warp.run_rows(self.runs, rows, device)

    def form_of(self, s: Resolved, metrics: Sequence[str]) -> Form:
        """Return the form of one run, whose plant and frictions are the world's."""
        form = form_of(s, metrics)
        if s.plant.by_mujoco or s.plant.unmodelled:
            form = form._replace(nominal=ChannelFunction(no_model, form.nominal.names))
        return form._replace(frictions=(), rotor_frictions=(), implicit=False)
