"""Step responses: runs from rest to a step of the reference, with every metric as an attribute, and
their reports.
"""

import dataclasses
import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from smc_mujoco.common.aliases import Numbers, Pair
from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.errors import ScenarioError, number, shown, unknown
from smc_mujoco.common.files import slug
from smc_mujoco.common.tabular import Tabular
from smc_mujoco.control.component import Component, Template
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.metrics.catalogue import score, scores
from smc_mujoco.metrics.conventions import CATALOGUE, groups
from smc_mujoco.simulation.conditions import DURATION, Condition, find_condition
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Constant, Step
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.testing.limits import bound, judge, quantity, without_frames

__tracebackhide__ = True  # pytest hides the frames of a module that has it
MAX_ID = 150  # characters of a test's id in a file's name: most file systems allow 255 bytes
IN_SHORT = ("settling_time", "overshoot", "tv_rate")  # metrics that are shown first


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class StepResponse:
    """The response of a law to a step.

    Every metric of `smc.score` is an attribute: r.settling_time, r.overshoot, ...

    If some joints have no actuator, `r.scores` has the metrics of each group of channels, as
    `smc.scores` does. For the pole on a cart: `r.scores["free"]["ultimate_bound"]`. In `check` that
    metric is named "free ultimate_bound".

    A failed run has no metrics: reading one raises a ScenarioError that says when and why the run
    failed.
    """

    trace: Trace
    step: float  # height, rad or m
    condition: str = (
        ""  # with the scenario fields that the test gave; "" for the nominal condition alone
    )

    @property
    def scenario(self) -> Scenario:
        """The scenario of the run."""
        return self.trace.scenario

    @property
    def failure(self) -> str | None:
        """Why the run ended early, in a sentence, or None."""
        return self.trace.failure

    @cached_property
    def metrics(self) -> Numbers:
        """Every metric by name. Raises ScenarioError if the run failed."""
        return score(self.trace)

    @cached_property
    def scores(self) -> Mapping[str, Numbers]:
        """Group of channels -> metric -> value. Raises as `metrics`."""
        return scores(self.trace)

    @cached_property
    def values(self) -> Numbers:
        """`metrics`, and those of each group of channels if there are several, with names such as
        "free peak".
        """
        labelled = dict(self.metrics)
        for group, values in self.scores.items():
            for name, value in values.items():
                labelled[self._label(group, name)] = value
        return labelled

    @without_frames
    def __getattr__(self, name: str) -> float:
        if name.startswith("_") or name == "trace":  # read by copy and inspect
            raise AttributeError(name)
        if name in CATALOGUE and name in self.metrics:
            return self.metrics[name]
        raise AttributeError(str(self._no_metric(name)))

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *CATALOGUE})

    def __str__(self) -> str:
        plant = self.scenario.plant
        step = f"{plant.name} under {self.scenario.law}, step {self.step:g} {plant.unit}"
        return ", ".join(filter(None, (step, self.condition)))

    def __repr__(self) -> str:
        if self.failure is not None:
            return f"StepResponse({self}: failed, {self.failure})"
        return f"StepResponse({self}: {self._in_short()})"

    def _in_short(self) -> str:
        """Return the first metrics to look at, on one line."""
        values = []
        for name in IN_SHORT:
            if name in self.metrics:
                values.append(f"{name} {quantity(*self.value(name))}")
        return ", ".join(values)

    def value(self, name: str) -> tuple[float, str]:
        """Return the value and the unit of one of `values`."""
        group, _, metric = name.rpartition(" ")
        return self.values[name], CATALOGUE[metric].unit_in(self.scenario, group)

    def _no_metric(self, name: str) -> ScenarioError:
        """Return the error for a metric that does not exist, or that the plant does not have."""
        if name in CATALOGUE:
            return ScenarioError(CATALOGUE[name].refusal(self.scenario))
        return unknown("metric", name, CATALOGUE)

    def _label(self, group: str, metric: str) -> str:
        """Return the name of a group's metric in tables: the metric's name if `metrics` has it,
        else "GROUP METRIC".
        """
        only_group = len(groups(self.scenario.plant)) == 1
        if only_group or (group == "driven" and not CATALOGUE[metric].shared):
            return metric
        return f"{group} {metric}"

    def applies(self, name: str) -> bool:
        """Return whether a metric has a meaning for this run: some have one for realistic
        mechanisms only.
        """
        return self.scenario.realistic or not CATALOGUE[name.rpartition(" ")[2]].realistic

    def check_names(self, names: Iterable[str]) -> None:
        """Raise AssertionError if the run failed, and ScenarioError for a name that is not among
        its `values`.
        """
        if self.failure is not None:
            raise AssertionError(f"{self}: {self.failure}")
        for name in names:
            if name not in self.values:
                raise self._no_metric(name)

    @without_frames
    def check(self, **limits: float | Pair) -> None:
        """Assert several limits on metrics:

        `r.check(settling_time=0.6, overshoot=5, rise_time=(0.05, 0.3))`.

        A limit is the highest value, or (lowest, highest), in the metric's unit. The AssertionError
        says which are missed, and which hold.
        """
        if not limits:
            raise ScenarioError(
                "check has no limits: give metrics with their largest values, as settling_time=0.6"
            )
        self.check_names(limits)
        bounds = []
        for name, limit in limits.items():
            bounds.append(bound(name, *self.value(name), limit))
        judge(bounds, "not", ("run", str(self)))

    def table(self, full: bool = True) -> str:
        """Return the metrics that have a meaning for this run as text: a table of all, or a line
        of the first.
        """
        if self.failure is not None:
            return f"failed: {self.failure}"
        if not full:
            return self._in_short()
        rows = []
        for name in self.values:
            if self.applies(name):
                rows.append((name, quantity(*self.value(name))))
        return str(Tabular(headings=("metric", "value"), rows=rows))


def respond(
    plant: Plant | str,
    law: Component | Template | str,
    step: float,
    condition: str | Condition,
    fields: Mapping[str, object],
) -> StepResponse:
    """Run a law from rest to a step of the reference at t = 0.

    Rest is at 0, or at `plant.rest` if the plant has it.
    """
    for name in fields:
        if name not in Scenario.fields():
            raise unknown("field of a Scenario", name, Scenario.fields())
    if "reference" in fields:
        raise ScenarioError(
            f"reference is {shown(fields['reference'])}: leave it out, as it is the step of {step}"
        )
    if isinstance(law, Callable) and not isinstance(law, Component | Template):
        raise ScenarioError(
            f"law is {shown(law)}: put @smc.law_function(gains={{...}}) above the function"
        )
    height = number("step", step)
    if height == 0.0:
        raise ScenarioError("step is 0: give the height of the step in rad or m, such as 0.2")
    chosen = find_condition(condition)
    plant = as_plant(plant)
    start = {"x0": 0.0, "reference": Step(height)}
    if plant.rest:
        goal = [Constant(x + height) for x in plant.rest[: plant.driven]]
        start = {"x0": plant.rest, "reference": goal}
    under = chosen.on(plant, number("duration", fields.get("duration", DURATION)))
    scenario = Scenario(plant=plant, law=law, **(start | under | dict(fields)))  # pyright: ignore[reportArgumentType]
    words = [f"{name}={shown(value)}" for name, value in fields.items()]
    if chosen.name != "nominal":
        words.insert(0, chosen.name)
    return StepResponse(trace=run(scenario), step=height, condition=", ".join(words))


def report_of(
    test: str, responses: Sequence[StepResponse], folder: Path, *, video: bool, full: bool
) -> str:
    """Return the metrics of all responses, all of them if `full`, and the paths of the files that
    show them: a figure and a film for each plant.
    """
    from smc_mujoco.draw.figure import figure
    from smc_mujoco.draw.film.film import film

    tables = []
    for response in responses:
        tables.append(f"{response}\n{response.table(full)}")
    plants: dict[str, list[Trace]] = {}
    for response in responses:
        plants.setdefault(response.scenario.plant.name, []).append(response.trace)
    titled = functools.partial(figure, title=test.rpartition("::")[2])
    lines = []
    for plant, traces in plants.items():
        name = slug(test[-MAX_ID:], MAX_ID)
        if len(plants) > 1:
            name += f"-{slug(plant)}"
        lines.append(_line("figure", titled, traces, folder / f"{name}.png"))
        if video:
            lines.append(_line("film", film, traces, folder / f"{name}.mp4"))
    if not full:
        lines.append("all metrics: pytest -v")
    return "\n\n".join([*tables, "\n".join(dict.fromkeys(lines))])


def _line(
    what: str, draw: Callable[[Sequence[Trace], Path], object], traces: Sequence[Trace], path: Path
) -> str:
    """Draw traces. Return a line with the file, or with the reason why there is none."""
    try:
        draw(traces, path)
    except Exception as error:  # a picture must not hide why the test failed
        return f"no {what}: {str(error).removeprefix(f'no {what}: ')}"
    return f"{what}: {path}"
