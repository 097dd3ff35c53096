"""Runs that a person watches and changes: at every moment they are those of `smc.run`, so that they
can be saved.

A changed gain, condition or law starts the runs again. A push joins their disturbances, and they
are repeated up to the present. So the session is its scenarios, and a saved one repeats it.
"""

import dataclasses
import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from pprint import pformat
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array, Fields
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.component import Template
from smc_mujoco.control.gain_sets import law_with_gains
from smc_mujoco.control.law import Law, all_laws, laws, suits
from smc_mujoco.mechanisms.hardware.friction import Coulomb
from smc_mujoco.mechanisms.plant import Plant, compiled_for_runs
from smc_mujoco.simulation import callback, state
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.run import ScenarioBatch
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.scenario_json import describe, restore
from smc_mujoco.simulation.signals import Push

PUSH_WIDTH = 0.1  # s
SAVED = '''"""What was seen in `smc-mujoco view`, to the bit."""

from math import inf, nan  # noqa: F401

import smc_mujoco as smc
from smc_mujoco.simulation.scenario_json import restore

RUNS = {runs}
RESTORED = {{label: restore(run) for label, run in RUNS.items()}}
scene = smc.Scene(title={title!r}, conditions={{"view": RESTORED}})

if __name__ == "__main__":
    smc.play(__file__)
'''


class Slider(NamedTuple):
    """A number of a scenario: its present value, its range, and the fields that change with it."""

    value: float
    low: float
    high: float
    fields: Callable[[Scenario, float], Fields]  # what a scenario with another value has

    def changed(self, scenario: Scenario, value: float) -> Scenario:
        """Return the scenario with another number."""
        return dataclasses.replace(scenario, **self.fields(scenario, value))


class Session:
    """Runs of one plant under its laws, of which `sample` samples are over; a reset goes back to
    `first`.
    """

    def __init__(self, scenarios: Sequence[Scenario]):
        self.first = tuple(scenarios)
        self.due = 0.0
        self.message = ""
        self.paused = False
        self.begin(self.first)

    def begin(self, scenarios: Sequence[Scenario], sample: int = 0) -> None:
        """Start these scenarios, and repeat them up to a sample of the control."""
        kinds = len({(s.control_period, s.samples) for s in scenarios})
        if kinds > 1:
            raise ScenarioError(
                "no view: the runs differ in control_period or duration: give both the same"
            )
        prepared = list(map(prepare, scenarios))
        with callback.installed():
            self.batches = [ScenarioBatch([prepared_run], threads=1) for prepared_run in prepared]
        self.scenarios = tuple(scenarios)
        self.sliders = list(map(sliders, scenarios))
        self.advance_to(sample)

    @property
    def samples(self) -> int:
        """Samples of the whole runs."""
        return self.scenarios[0].samples

    @property
    def time(self) -> float:
        """Time of the runs, s."""
        return self.sample * self.scenarios[0].control_period

    def advance(self, seconds: float) -> None:
        """Simulate the time that is due, in whole control periods; start again after the end."""
        if self.sample == self.samples:
            self.begin(self.scenarios)
        self.due += seconds
        count = int(self.due / self.scenarios[0].control_period)
        self.due -= count * self.scenarios[0].control_period
        last = min(self.sample + count, self.samples)
        self.advance_to(last)

    def advance_to(self, sample: int) -> None:
        """Step all runs to a sample. A run that fails stays where it is, and says why."""
        self.sample = sample
        with callback.installed():
            for batch in self.batches:
                batch.advance_to(sample * batch.scenarios[0].steps)
        for batch in self.batches:
            if batch.records["failure"][0] != state.FINE:
                self.message = f"{batch.scenarios[0].law.name} failed: {batch.trace(0).failure}"

    def change(
        self, changed: Callable[[Scenario], Scenario], run: int | None = None, sample: int = 0
    ) -> None:
        """Start again with changed scenarios, all or one; a change that they refuse leaves them,
        and says why.
        """
        try:
            scenarios = list(self.scenarios)
            for i, scenario in enumerate(self.scenarios):
                if run in {None, i}:
                    scenarios[i] = changed(scenario)
            self.begin(scenarios, sample)
            self.message = ""
        except ScenarioError as error:
            self.message = str(error)

    def reset(self) -> None:
        """Start again as the session began."""
        self.begin(self.first)
        self.message = ""

    def push(self, body: str, force: Array) -> None:
        """Push a body from now on: a half sine of 0.1 s with this peak in the axes of the world,
        N.
        """
        x, y, z = force.tolist()
        push = Push(body=body, x=x, y=y, z=z, time=self.time, width=PUSH_WIDTH)
        self.change(
            lambda s: dataclasses.replace(s, disturbance=(*s.disturbance, push)), sample=self.sample
        )

    def take_law(self, law: Law | str, run: int) -> None:
        """Give one run another law, by its name with its gains for the plant."""
        self.change(
            lambda s: dataclasses.replace(s, law=law_for(s.plant, law), surface=None, model=None),
            run,
        )

    def state(self, run: int) -> tuple[Array, Array, Array]:
        """Return positions, velocities and activations of a run."""
        bind = self.batches[run].batch.bind
        if self.batches[run].model.na:
            act = bind("act")[0]
        else:
            act = np.zeros(0)
        return bind("qpos")[0], bind("qvel")[0], act

    def log(self, run: int) -> Array:
        """Return the samples of a run so far, (samples, channels)."""
        return self.batches[run].logs[0][: self.sample]

    def screen(self) -> mujoco.MjModel:
        """Return the mechanism with the true parameters at the start, for the screen."""
        scenario = self.scenarios[0].resolved
        seen = compiled_for_runs(models.spec(scenario), 0)
        models.put_values(seen, seen, scenario, 0)
        mujoco.mj_setConst(seen, mujoco.MjData(seen))
        return seen

    def pause(self) -> None:
        """Pause, or go on."""
        self.paused = not self.paused

    def add(self) -> None:
        """Show the run twice, so that the second can take another law."""
        self.begin([self.scenarios[0]] * 2)

    def move(self, run: int, slider: Slider, value: float) -> None:
        """Start again with the number of a slider; while paused, repeat the runs up to now."""
        self.change(lambda s: slider.changed(s, value), run, self.sample if self.paused else 0)

    def save(self, path: Path) -> Path:
        """Write a new scene file whose runs are these to the bit; refuse what it could not
        repeat.
        """
        runs = {}
        for i, s in enumerate(self.scenarios):
            runs[f"{s.law.name} {i + 1}"] = describe(s)
        runs = json.loads(json.dumps(runs))
        restored = map(restore, runs.values())
        if tuple(restored) != self.scenarios:
            raise ScenarioError(
                "the session cannot be saved: a scene file cannot name its law or plant"
            )
        title = f"A view of {self.scenarios[0].plant.name}"
        pretty = pformat(runs, width=110, sort_dicts=False)
        text = SAVED.format(title=title, runs=pretty)
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
        except FileExistsError:
            raise ScenarioError(f"{path} exists: move it, then save again") from None
        self.message = f"saved as {path}"
        return path


def sliders(s: Scenario) -> dict[str, Slider]:
    """Return name -> slider of a run's gains and conditions."""
    slider_by_name = {} if len(s.law.parts) > 1 else gain_sliders(s.law)
    for name, slider in condition_sliders(s).items():
        if takes(s, slider):
            slider_by_name[name] = slider
    return slider_by_name


def laws_of(plant: Plant) -> list[str]:
    """List the laws for a plant, without `none`; for an arm those of many joints come first."""
    names = laws(plant)
    if plant.n > 1 and not (plant.pose or plant.free or plant.unmodelled):
        of_many = laws(kind="joint")
        names = [*(name for name in of_many if suits(all_laws()[name], plant)), *names]
    return [name for name in names if name != "none"]


def law_for(plant: Plant, law: Law | Template | str) -> Law | Template | str:
    """Return a law; for a name, with the package's gains for the plant where there are any, else
    its defaults.
    """
    try:
        if isinstance(law, str):
            return law_with_gains(plant, law)
        return law
    except ScenarioError:
        return law


def gain_sliders(law: Law) -> dict[str, Slider]:
    """Return a slider for each finite gain that all channels share: a tenth to ten times it, 0 to 1
    for 0.
    """

    def fields(name: str) -> Callable[[Scenario, float], Fields]:
        return lambda s, gain: {
            "law": dataclasses.replace(s.law, gains={**s.law.gains, name: gain})
        }

    slider_by_gain = {}
    for name, gain in law.gains.items():
        if not isinstance(gain, tuple) and math.isfinite(gain):
            low, high = sorted((gain / 10.0, gain * 10.0))
            slider_by_gain[name] = Slider(gain, low, high if gain else 1.0, fields(name))
    return slider_by_gain


def condition_sliders(s: Scenario) -> Mapping[str, Slider]:
    """Return the sliders of what acts on a run, but of friction where the scenario has a kind of
    its own.
    """
    step = s.resolved.physics_step
    bound = min(s.drive_train.forces)
    sliders: dict[str, Slider] = {
        "mass, factor": Slider(
            s.mismatch.get("mass", 1.0),
            0.5,
            2.0,
            lambda s, v: {"mismatch": {**s.mismatch, "mass": v}},
        ),
        "delay, s": Slider(
            s.input_delay, 0.0, 0.05, lambda s, v: {"input_delay": round(v / step) * step}
        ),
        "noise, rad or m": Slider(
            s.noise.position,
            0.0,
            0.02,
            lambda s, v: {"noise": dataclasses.replace(s.noise, position=v)},
        ),
    }
    rubs, *more_friction = s.friction or (Coulomb(0.0),)
    if isinstance(rubs, Coulomb) and not more_friction:
        most = 0.5 * bound if math.isfinite(bound) else 1.0
        sliders["friction, N or N m"] = Slider(
            rubs.level,
            0.0,
            most,
            lambda s, v: {"friction": dataclasses.replace(rubs, level=v) if v else None},
        )
    return sliders


def takes(scenario: Scenario, slider: Slider) -> bool:
    """Return whether a scenario takes what a slider changes."""
    try:
        slider.changed(scenario, slider.high)
    except ScenarioError:
        return False
    return True
