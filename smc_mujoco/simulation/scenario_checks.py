"""Whether the fields of a scenario fit together: its times, signals, obstacles and parts.

Here `s` is a scenario with its defaults, whose module imports this one.
"""

import functools
import itertools
from typing import Any

import mujoco

from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.common.mjcb import compiled_spec
from smc_mujoco.mechanisms.hardware.contact import kinds
from smc_mujoco.mechanisms.hardware.feedforward import Feedforward
from smc_mujoco.mechanisms.hardware.part import Friction
from smc_mujoco.mechanisms.hardware.rotors import flies
from smc_mujoco.mechanisms.hardware.tendons import of_plant
from smc_mujoco.mechanisms.layout import driven_names, loaded
from smc_mujoco.mechanisms.plant import MAX_EXCESS, Plant, check_ranges, degrees_hint
from smc_mujoco.simulation.law_checks import check_inertia, check_law
from smc_mujoco.simulation.signals import (
    Dryden,
    Impulse,
    OrnsteinUhlenbeck,
    PerChannel,
    Push,
    Signal,
    extremes,
)

MAX_STEPS = 100_000_000  # per run: minutes of computing
MAX_VALUES = 20_000_000  # control samples times channels: a trace of about 1 GB


def check_fields(s: Any) -> None:
    """Raise ScenarioError for fields that do not fit together."""
    check_clock(s)
    check_signals(s)
    check_law(s)
    check_mechanism(s)


def check_start(s: Any) -> None:
    """Raise ScenarioError for what the plant cannot have at the start, or on its way.

    Runs that were recorded before these checks are read without them.
    """
    check_ranges(s.plant.name, s.plant.ranges, s.x0, s.plant.units)
    check_reference_ranges(s)
    check_inertia(s)
    check_obstacles(s)
    check_names(s)


def check_clock(s: Any) -> None:
    """Check that the delay is a whole number of steps, the jump is within the run, and the trace
    fits into memory.
    """
    delay = s.input_delay / s.physics_step
    if abs(delay - round(delay)) > 1e-6 or (delay > 0.0 and round(delay) == 0):
        raise ScenarioError(
            f"input_delay {s.input_delay:g} s is not a whole number of physics steps of "
            f"{s.physics_step:g} s: give a physics_step that divides it"
        )
    if s.samples < 1:
        raise ScenarioError(
            f"duration {s.duration:g} s is shorter than one control period of {s.control_period:g} "
            "s: give a longer one"
        )
    if s.samples * s.steps > MAX_STEPS or (s.samples + 1) * s.plant.n > MAX_VALUES:
        raise ScenarioError(
            f"duration {s.duration:g} s is {s.samples:.3g} control samples of {s.plant.n} channels "
            f"and {s.samples * s.steps:.3g} physics steps: give a shorter duration or longer "
            f"periods (at most {MAX_VALUES:.0e} values and {MAX_STEPS:.0e} steps)"
        )
    for name, time in event_times(s.jump, s.fault).items():
        if time >= s.duration:
            raise ScenarioError(
                f"{name} at {time:g} s comes after the end of the run at {s.duration:g} s: give an "
                "earlier time"
            )
    s.failing()  # refuses an unknown one
    for sensor in s.sensors:
        sensor.check(s.physics_step)
    s.clock.check(s.control_period, s.physics_step)


def event_times(jump: Any, fault: Any) -> dict[str, float]:
    """Return when a run changes for good, s, by the name of the field."""
    times = {}
    if jump:
        times["jump"] = jump.time
    if fault:
        times["fault"] = fault.at
    return times


def check_signals(s: Any) -> None:
    """Check that the signals can be disturbances and a reference, and that none is shorter than a
    step.
    """
    for d in s.disturbance:
        budget = s.plant.n * s.duration
        shortest = budget / max(MAX_STEPS, s.work)  # between knots, s
        if isinstance(d, OrnsteinUhlenbeck | Dryden) and d.dt < shortest:
            raise ScenarioError(
                f"{type(d).__name__}'s dt {d.dt:g} s makes too many knots: give {shortest:.3g} s "
                "or more"
            )
        if isinstance(d, Impulse) and d.width < s.physics_step:
            raise ScenarioError(
                f"{shown(d)} is shorter than a physics step of {s.physics_step:g} s: widen it"
            )
    for signal in (*s.disturbance, s.feedforward_signal):
        if getattr(signal, "about", ""):
            raise ScenarioError(f"{shown(signal)} is about the goal: only a reference may be")
    if any(isinstance(signal, PerChannel) for signal in (*s.disturbance, s.feedforward_signal)):
        raise ScenarioError(
            "only a reference may have a signal for each channel: give one signal for all"
        )
    _check_forces(s)
    for signal in dict.fromkeys(s.references):
        check_function_of_time("reference", signal, "a smooth signal")
    if s.feedforward_signal:
        check_function_of_time("feedforward", s.feedforward_signal, "a known signal of u")


def _check_forces(s: Any) -> None:
    """Check that winds, pushes and forces have a body to act on."""
    for d in s.disturbance:
        if d.air and not flies(s.plant):
            raise ScenarioError(
                f"disturbance {shown(d)} is a wind, and {s.plant.name} has no drag: give a force, "
                "or plant 'quadrotor'"
            )
    for d in s.disturbance:
        if isinstance(d, Push):
            names = dict.fromkeys(bodies(s.plant))
            find(f"body of {s.plant.name} in a Push", d.body, names)
    forces = []
    for d in s.disturbance:
        if d.cartesian and not isinstance(d, Push):
            forces.append(d)
    if forces and s.plant.direct and not s.plant.pose:
        raise ScenarioError(
            f"disturbance {shown(forces[0])} is a force on a body, and disturbances of "
            f"{s.plant.name} act on its joints: give another signal"
        )


def check_reference_ranges(s: Any) -> None:
    """Check that each reference stays within its joint's range."""
    if not s.plant.ranges:
        return
    for (joint, low, high), signal, unit in zip(
        s.plant.ranges, s.references, s.plant.units, strict=False
    ):
        least, most = extremes(signal, s.duration)
        if not low - MAX_EXCESS <= least <= most <= high + MAX_EXCESS:
            raise ScenarioError(
                f"the reference of joint {joint!r} of {s.plant.name} goes from {least:.4g} to "
                f"{most:.4g}, beyond its range from {low:g} to {high:g}: give another reference"
                f"{degrees_hint((low, high), max(least, most, key=abs), unit)}"
            )


def check_function_of_time(name: str, signal: Signal, cure: str) -> None:
    """Check that a signal is a number that only time decides."""
    kinds = {
        "a force": signal.cartesian,
        "a wind": signal.air,
        "noise": signal.random,
        "one that sees the loop": signal.sees,
    }
    for kind, applies in kinds.items():
        if applies:
            raise ScenarioError(f"{name} is {type(signal).__name__}, which is {kind}: give {cure}")


@functools.lru_cache(maxsize=32)
def bodies(plant: Plant) -> tuple[str, ...]:
    """Return the names of a plant's bodies."""
    model = loaded(plant)
    names = []
    for i in range(1, model.nbody):
        name = model.body(i).name
        if name:
            names.append(name)
    return tuple(names)


def check_obstacles(s: Any) -> None:
    """Check that a run does not start beyond a stop or in a wall, nor a user's model inside what
    it does not start in by itself.
    """
    if s.plant.is_user_model and s.x0 != s.plant.x0:
        from smc_mujoco.mechanisms.custom.clearance import DEPTH, overlap

        inside = overlap(s.plant, s.x0)
        at_start = overlap(s.plant, s.plant.x0)
        if inside.depth > max(DEPTH, at_start.depth):
            raise ScenarioError(
                f"x0 {shown(s.x0)} of {s.plant.name} has {inside}: give another x0, or starts "
                "with less spread"
            )
    for part in s.contact:
        if met := part.meets(s.plant, s.x0):
            raise ScenarioError(
                f"x0 of {s.plant.name} has {met}: give another x0, or a contact with more room, of "
                "your own if a condition names it"
            )


def check_names(s: Any) -> None:
    """Check that no parameter is named twice, once by its own name and once as the mass."""
    for name, factors in (("mismatch", s.mismatch), ("Jump", s.jump.factors if s.jump else {})):
        if s.plant.mass != "mass" and {"mass", s.plant.mass} <= factors.keys():
            masses = f"{s.plant.mass} {factors[s.plant.mass]:g} and mass {factors['mass']:g}"
            raise ScenarioError(
                f"{name} has {masses}, which are the same parameter of {s.plant.name}: give one of "
                "them"
            )


def check_mechanism(s: Any) -> None:
    """Check that the integrator suits the parts, and that mechanism and contact suit the parameters
    at any time.
    """
    for machine in s.machines:
        _check_parts(machine)
    states = [part for part in s.friction if part.keeps_state or part.force is not None]
    if s.integrator == "RK4" and states and not s.exact_friction:
        raise ScenarioError(
            f"integrator RK4 has four stages in a step, and the state of {shown(states[0])} moves "
            "once a step: leave the integrator out"
        )
    if isinstance(s.feedforward, Feedforward):
        if s.accelerates:
            raise ScenarioError(
                "Feedforward gives a force, and u is an acceleration: leave feedforward out"
            )
        s.feedforward.check(s)
    for step in (0, s.samples * s.steps):
        values = s.plant.values(s.factors(step))  # raises for those that the plant cannot have
        if s.mechanism != "equation":
            model = mechanism_model(s.plant, s.mechanism)
            mechanism = s.plant.mechanisms[s.mechanism]
            list(mechanism.fields(model, values))  # raises, too
        placed = s.plant.placed.items()
        for (name, value), kind in itertools.product(placed, kinds(s.contact)):
            if (present := getattr(values, name)) != value:
                raise ScenarioError(
                    f"the obstacles of contact {kind!r} of {s.plant.name} are placed for "
                    f"{name} = {value:g}, and {name} is {present:g}: leave {name} as it is"
                )


def _check_parts(s: Any) -> None:
    """Check that drives and frictions suit the scenario."""
    for chain in dict.fromkeys(s.drive_train.chains):
        for part in chain:
            part.suits(s, chain)
    tendons = of_plant(s.plant)
    for i, chain in enumerate(s.drive_train.chains):
        if tendons and i in tendons.driven and chain:
            raise ScenarioError(
                f"tendons drive joint {driven_names(s.plant)[i]!r} of {s.plant.name}, and "
                f"{type(chain[0]).__name__} is another drive of it: leave actuator out"
            )
    for part in s.friction:
        part.check(s.plant)
        if part.side == "motor":
            check_rotors(s, part)


def check_rotors(s: Any, part: Friction) -> None:
    """Check that the joints of a friction on the motor side have rotors beside them."""
    pairs = zip(driven_names(s.plant), s.drive_train.chains, strict=True)
    chains = dict(pairs)
    for joint in part.joint_names(s.plant):
        if all(actuator.drives for actuator in chains.get(joint, ())):
            raise ScenarioError(
                f"{type(part).__name__} is on side 'motor' of joint {joint!r} of {s.plant.name}, "
                "which has no rotor beside it: give actuator=smc.hardware.ElasticJoint(...) or "
                "smc.Backlash(...)"
            )


@functools.lru_cache(maxsize=16)
def mechanism_model(plant: Plant, name: str) -> mujoco.MjModel:
    """Return the model of a mechanism that a plant offers."""
    spec = plant.spec()
    plant.mechanisms[name].edit(spec)
    return compiled_spec(spec)
