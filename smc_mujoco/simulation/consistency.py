"""What several fields of a scenario must satisfy together; each failure is one sentence."""

import dataclasses
import math
import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from smc_mujoco.common.errors import ScenarioError, ScenarioWarning, shown, users_frame
from smc_mujoco.common.frozen import frozen
from smc_mujoco.control.law import fits
from smc_mujoco.mechanisms.custom.channels import RECORDED, within
from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.drives import DCMotor
from smc_mujoco.mechanisms.plant import EFFORT
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.signals import Impulse, OrnsteinUhlenbeck

if TYPE_CHECKING:
    from smc_mujoco.simulation.scenario import Scenario

MOST_STEPS = 100_000_000  # per run: minutes of computing
MOST_TURNS = 3.0 * math.pi  # rad: chosen, as swing-ups overshoot within a turn and a half, and 10 may be degrees
LEAST_PERCENT = 10.0  # of a mismatch: chosen, whole fives from here on may be percent
LEAST_MILLISECONDS = 1.0  # s: chosen, as no plant here bears such a delay
MOST_RATE = 100.0  # rad/s: chosen, 16 turns a second
MOST_GAP = 0.5  # rad: chosen, 29 degrees of play
MOST_DEGREES = 720.0  # nobody means degrees beyond
MOST_VALUES = 20_000_000  # control samples times channels: a trace of about 1 GB


def check(scenario: "Scenario") -> None:
    """Raise ScenarioError for fields that do not go together."""
    check_clock(scenario)
    check_signals(scenario)
    check_law(scenario)
    within(scenario.plant.name, scenario.plant.ranges, scenario.x0)
    check_names(scenario)
    check_mechanism(scenario)
    if not RECORDED.get():
        warn_of_degrees(scenario)
        warn_of_units(scenario)
        warn_of_weak_motors(scenario)


def check_clock(s: "Scenario") -> None:
    """The run, its delays and its jump fit into whole steps, and those into memory."""
    delay = s.input_delay / s.physics_step
    if abs(delay - round(delay)) > 1e-6:
        raise ScenarioError(
            f"input_delay {s.input_delay:g} s is no whole number of physics steps of {s.physics_step:g} s: "
            "give a physics_step that divides it"
        )
    if s.samples < 1:
        raise ScenarioError(f"duration {s.duration:g} s is shorter than one control period of {s.control_period:g} s")
    if s.samples * s.steps > MOST_STEPS or (s.samples + 1) * s.plant.n > MOST_VALUES:
        raise ScenarioError(
            f"duration {s.duration:g} s is {s.samples:.3g} control samples of {s.plant.n} channels and "
            f"{s.samples * s.steps:.3g} physics steps: give a shorter duration or longer periods "
            f"(at most {MOST_VALUES:.0e} values and {MOST_STEPS:.0e} steps)"
        )
    if s.jump is not None and s.jump.time >= s.duration:
        raise ScenarioError(f"jump at {s.jump.time:g} s comes after the end of the run at {s.duration:g} s")
    if s.sensor is not None:
        s.sensor.check(s.physics_step)


def check_signals(s: "Scenario") -> None:
    """Signals are of the kind that their place asks for, and no shorter than a step."""
    for d in s.disturbance:
        most = max(MOST_STEPS, s.work)  # knots in all channels
        if isinstance(d, OrnsteinUhlenbeck) and s.plant.n * s.duration / d.dt > most:
            least = s.plant.n * s.duration / most
            raise ScenarioError(f"OrnsteinUhlenbeck's dt {d.dt:g} s makes too many knots: give {least:.3g} s or more")
        if isinstance(d, Impulse) and d.width < s.physics_step:
            raise ScenarioError(f"{shown(d)} is shorter than a physics step of {s.physics_step:g} s: widen it")
    if s.plant.direct and (forces := [d for d in s.disturbance if d.cartesian]):
        raise ScenarioError(
            f"disturbance {shown(forces[0])} pushes a body, and those of {s.plant.name}, a model of yours, act on its "
            "joints: give another signal"
        )
    if s.reference.cartesian:
        raise ScenarioError(f"reference is a {type(s.reference).__name__}, which is a force: give a signal")
    if s.reference.random:
        raise ScenarioError(f"reference is {type(s.reference).__name__}, which is noise: give a smooth signal")


def check_law(s: "Scenario") -> None:
    """The law is for this plant, and its surface for this law."""
    if not fits(s.law, s.plant):
        paired = dataclasses.replace(s.plant, underactuated=True)
        hint = ": give each channel a partner" if s.plant.direct and fits(s.law, paired) else ""
        raise ScenarioError(f"law {s.law.name!r} is for {', '.join(s.law.plants)} alone, not for {s.plant.name}{hint}")
    if s.model == "nominal" and s.plant.unmodelled:
        raise ScenarioError(f"{s.plant.name} has no nominal model: {s.plant.unmodelled}")
    if s.surface is not None and s.law.relative_degree > 1:
        raise ScenarioError(
            f"law {s.law.name!r} acts on the error and its rates, and takes no surface such as {s.surface.name!r}: "
            "leave it out, or give a law of degree 1"
        )
    if s.surface is not None and s.surface.relative_degree != s.law.relative_degree:
        raise ScenarioError(
            f"law {s.law.name!r} needs a sliding variable of relative degree {s.law.relative_degree}, "
            f"and surface {s.surface.name!r} has {s.surface.relative_degree}: give another, or leave it out"
        )


def check_names(s: "Scenario") -> None:
    """A run that is to be names no parameter twice."""
    for name, factors in (("mismatch", s.mismatch), ("Jump", s.jump.factors if s.jump else {})):
        twice = "mass" in factors and s.plant.mass in factors and s.plant.mass != "mass"
        if twice and not RECORDED.get():
            both = f"{s.plant.mass} {factors[s.plant.mass]:g} and mass {factors['mass']:g}"
            raise ScenarioError(f"{name} has {both}, which are the same parameter of {s.plant.name}: give one of them")


def check_mechanism(s: "Scenario") -> None:
    """The integrator takes the parts' states, and mechanism and contact all parameters of the run."""
    if s.integrator == "RK4" and (states := [p for p in (*s.friction, *s.actuator) if p.stateful]):
        raise ScenarioError(
            f"integrator RK4 with {shown(states[0])}, whose state it does not integrate: leave the integrator out"
        )
    for step in (0, s.samples * s.steps):
        coerce.check_numbers(s.plant, s.mechanism, frozen(s.factors(step)))
        coerce.contact_fits(s.contact, s.plant, s.factors(step))


def warn_of_degrees(s: "Scenario") -> None:
    """Warn of a start, or of a reference's amplitude, of several turns: a ramp or a series may go on for as many."""
    amplitude = s.reference.parameters().get("amplitude", 0.0)
    for what, values in (("x0", s.x0), ("the reference's amplitude", (amplitude,) * s.plant.driven)):
        for unit, value in zip(s.plant.units, values, strict=False):
            if unit == "rad" and MOST_TURNS < abs(value) <= MOST_DEGREES:
                warnings.warn(
                    f"{what} is {value:g} rad, {abs(value) / math.tau:.1f} turns: if it is {value:g} degrees, give "
                    f"math.radians({value:g})",
                    ScenarioWarning,
                    users_frame(),
                )
                return


def warn_of_units(s: "Scenario") -> None:
    """Warn of numbers that are surely meant in another unit: percent, ms or degrees."""
    for told, cure in _other_units(s):
        warnings.warn(f"{told}: {cure}", ScenarioWarning, users_frame())
        return


def _other_units(s: "Scenario") -> Iterator[tuple[str, str]]:
    """Yield what is hardly meant as it stands, with what to give instead."""
    for name, factor in s.mismatch.items():
        if LEAST_PERCENT <= factor <= 100.0 and factor % 5.0 == 0.0:
            yield (
                f"mismatch makes {name} {factor:g} times the nominal one",
                f"if it is {factor:g} % more, give {1 + factor / 100:g}",
            )
    if s.input_delay >= LEAST_MILLISECONDS:
        yield f"input_delay is {s.input_delay:g} s", f"if it is {s.input_delay:g} ms, give {s.input_delay / 1e3:g}"
    for signal in (s.reference, *s.disturbance):
        phase = signal.parameters().get("phase", 0.0)
        if MOST_TURNS < abs(phase) <= MOST_DEGREES:
            yield f"a phase is {phase:g} rad", f"if it is {phase:g} degrees, give math.radians({phase:g})"
    turning = [v for unit, v in zip(s.plant.units, s.v0, strict=True) if unit == "rad"]
    for v in turning:
        if MOST_RATE < abs(v) <= 10 * MOST_DEGREES:
            yield f"v0 is {v:g} rad/s", f"if it is {v:g} degrees per second, give math.radians({v:g})"
    for part in s.actuator:
        if isinstance(part, Backlash) and part.gap > MOST_GAP and "rad" in s.plant.units[: s.plant.driven]:
            told = f"Backlash has a gap of {part.gap:g} rad"
            yield told, f"if it is {part.gap:g} degrees, give math.radians({part.gap:g})"


def warn_of_weak_motors(s: "Scenario") -> None:
    """Warn of a DC motor that cannot hold a joint where it starts, though a force within the law's bound could."""
    p, still = s.plant.values({}), np.zeros(s.plant.n)
    for motor in [part for part in s.actuator if isinstance(part, DCMotor)]:
        for i, limit in enumerate(s.limits):
            with np.errstate(all="ignore"):
                f, g = s.plant.nominal(np.array(s.x0), still, i, p)
            need = abs(f) / abs(g) if g else 0.0
            if motor.stall < need <= limit:
                warnings.warn(
                    f"DCMotor gives at most {motor.stall:.3g} {EFFORT[s.plant.units[i]]} at rest, and channel {i} of "
                    f"{s.plant.name} needs {need:.3g} to stand where it starts: give it more gear, voltage or current",
                    ScenarioWarning,
                    users_frame(),
                )
                return
