"""Tracking problems: a joint under a load or a friction, a sensor as machines have, and a limit on
what the command may cost.

A suite of them is a file `suites/NAME.toml` with a table for each problem. An instance draws the
start, the phases of the load and of the reference, the zero of the encoder and the noise. An error
is the rms of x - r over the last whole periods, in counts of the encoder; the same gains also run
without the load or friction, as an error is of these only beyond the one without. The rate is the
variation of u over the same time, per second, over the bound on u: it is counted along the motion,
so that what a compensation adds to u counts, too.
"""

import dataclasses
import functools
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import find
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import Estimator, estimator
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.feedforward import Feedforward
from smc_mujoco.mechanisms.hardware.part import Friction
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.problems.joints import plant_of_problem
from smc_mujoco.simulation.conditions import find_condition
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Noise, Signal, Sine

SUITES = Path(__file__).parent / "suites"
START = (0.8, 1.2)  # of the problem's start, to either side
OFF_REFERENCE = 0.2  # of the start, at most, where the reference moves


@keyword_dataclass
class TrackingProblem:
    """A problem of a suite; the fields are those of its table."""

    name: str
    why: str  # one line
    plant: str
    bound: float  # on |u|, N or N m
    start: float  # m or rad
    load: str  # a condition, whose fields the run without the load lacks
    limit: float  # of the rate, bounds a second
    period: float = 1e-3  # of control, s
    delay: float = 2e-3  # from a sample until its command acts, s
    counts: float = 4096  # of the encoder, per revolution or metre
    noise: float = 0.3  # counts
    swing: float = 0.0  # amplitude of a sinusoidal reference, m or rad; 0: hold
    omega: float = 0.0  # of it, rad/s
    slow: float = 0.005  # m/s or rad/s, above which a compensation gives the whole friction
    settling: float = 4.0  # s, before the window
    window: float  # s: whole periods of the load or the reference

    @functools.cached_property
    def machine(self) -> Plant:
        """The joint."""
        return plant_of_problem(self.plant)

    @property
    def count(self) -> float:
        """A count of the encoder, m or rad."""
        return (math.tau if self.machine.unit == "rad" else 1.0) / self.counts

    @property
    def late(self) -> int:
        """The samples of the window."""
        return round(self.window / self.period)

    @functools.cached_property
    def fields(self) -> Mapping[str, Any]:
        """The fields of a scenario that the load sets."""
        return find_condition(f"load: {self.load}").on(self.machine, self.duration)

    @property
    def duration(self) -> float:
        """Of a run, s."""
        return self.settling + self.window

    @property
    def friction(self) -> tuple[Friction, ...]:
        """The friction that a compensation knows; () for a load without friction."""
        parts = self.fields.get("friction", ())
        return tuple(parts) if isinstance(parts, tuple | list) else (parts,)

    def scenario(
        self,
        law: Component,
        velocity: Estimator,
        compensation: Feedforward | Signal | None,
        instance: int,
        loaded: bool = True,
    ) -> Scenario:
        """Return a run of an instance, with or without the load."""
        rng = np.random.default_rng([2026, instance])
        side = rng.choice([-1.0, 1.0])
        start = side * self.start * rng.uniform(*START)
        phases = rng.uniform(0.0, math.tau, 3)
        zero = rng.uniform(-0.5, 0.5) * self.count
        reference = Sine(self.swing, self.omega, phases[0])
        if self.swing:
            start = self.swing * math.sin(phases[0]) + OFF_REFERENCE * start
        return Scenario(
            plant=self.machine,
            law=law,
            model="none",
            u_max=self.bound,
            x0=start,
            reference=reference,
            feedforward=compensation,
            duration=self.duration,
            control_period=self.period,
            sensor=Encoder(counts=self.counts, bias=zero),
            noise=Noise(position=self.noise * self.count),
            velocity=velocity,
            input_delay=self.delay,
            seed=instance,
            **self._load(phases[1:], loaded),
        )

    def _load(self, phases: np.ndarray, loaded: bool) -> dict[str, Any]:
        """Return the fields of the load with the phases of an instance. Without the load its forces
        are 0, so that the same loop runs.
        """
        fields = dict(self.fields)
        if "disturbance" in fields:
            signals = fields["disturbance"]
            signals = signals if isinstance(signals, tuple | list) else (signals,)
            moved = []
            for signal, phase in zip(signals, phases, strict=False):
                moved.append(_shifted(signal, phase))
            fields["disturbance"] = moved if loaded else list(map(_without_force, moved))
        if self.friction and not loaded:
            fields["friction"] = list(map(_without_force, self.friction))
        return fields


def _shifted(signal: Signal, phase: float) -> Signal:
    """Return a disturbance with the phase of an instance, if it is a sine."""
    return dataclasses.replace(signal, phase=float(phase)) if isinstance(signal, Sine) else signal


# fields of frictions and disturbances that are forces, or shares of one
FORCES = ("level", "coulomb", "static", "b", "kv", "kc", "kcs", "km", "ke", "kms", "kes")
FORCES += ("amplitude", "sigma")


def _without_force(part: Any) -> Any:
    """Return a friction or a disturbance whose forces are all 0."""
    forces = {}
    for field in dataclasses.fields(part):
        if field.name in FORCES:
            forces[field.name] = 0.0
    return dataclasses.replace(part, **forces)


@keyword_dataclass
class TrackingSuite:
    """A suite of tracking problems."""

    name: str
    about: str  # what it asks, one sentence
    without: str  # what a run lacks beside which errors stand: "load" or "friction"
    problems: tuple[TrackingProblem, ...]


def tracking_suites() -> tuple[str, ...]:
    """List the names of the suites of tracking problems."""
    return tuple(sorted(path.stem for path in SUITES.glob("*.toml")))


@functools.cache
def tracking_suite(name: str) -> TrackingSuite:
    """Return a suite of tracking problems. Raise ScenarioError for an unknown name."""
    find("suite", name, dict.fromkeys(tracking_suites()))
    about = tomllib.loads((SUITES / f"{name}.toml").read_text(encoding="utf-8"))
    problems = [TrackingProblem(**fields) for fields in about.pop("problem")]
    return TrackingSuite(name=name, problems=tuple(problems), **about)


def filtered_difference(tau: float) -> Estimator:
    """Return the estimator of all entries that name no other, with its time constant, s."""
    return estimator("filtered_difference", tau=tau)
