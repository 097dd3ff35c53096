"""The conditions of the suite: each name with its fields, or with a function of plant and duration
that returns them.

The levels of the suite are those of a machine of the study's size. Dry friction is of any size: a
sixtieth of the machine's bound on the force of each driven joint, 0.1 N m or N in the study. The
viscous friction of "friction" is half as much at 1 rad/s or m/s. The dry friction of "stiction" is
six times as large in motion, and nine times at rest: a law with an integral may hunt under it, and
a search under this condition counts that. The backlash is that of a worn
gear, the lag that of a hydraulic valve, and the counts, per revolution or metre, are those of an
inexpensive encoder. On a free body and on a user's model, whose size may be any, a disturbance is
the same share of the largest force as it is of u_max in the study. The play, the counts and the
motor of a user's model are as large beside its joints as those of the study, and its stepper is
refused where a rig's steps and rates do not suit it. Under "elastic" a spring is between each joint
and its rotor, with a resonance of 68 Hz on the study's pendulum, and elsewhere as much faster than
what the bound on u can do; under "motor_side" the controller reads the rotors. Under "contact" a
joint has stops about its goal, and a blow drives it there whatever u does, see `blow`. Under
"jitter" samples are late by up to half of the suite's control period. Under "missed" one sample in
ten does not run. Under "stepper" u is the wanted acceleration, so gains for a force do not suit it:
tune under it. Its rates are those of the firmware of rig stepper_furuta; it is 30 times as strong
as other drives, near that machine's ratio of torque to inertia, as one of their strength loses
steps here. Under "fault" every actuator loses half of its force at 2 s.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Data
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.estimator import estimator
from smc_mujoco.mechanisms.custom.scales import BESIDE, at_goal, usual_start
from smc_mujoco.mechanisms.hardware.backlash import MIN_INERTIA, Backlash
from smc_mujoco.mechanisms.hardware.drives import DCMotor, Lag
from smc_mujoco.mechanisms.hardware.elastic_joint import ElasticJoint
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.friction import Coulomb, LuGre, Viscous
from smc_mujoco.mechanisms.hardware.part import Actuator, Friction
from smc_mujoco.mechanisms.hardware.stepper import of_rig
from smc_mujoco.mechanisms.hardware.stribeck import Stribeck
from smc_mujoco.mechanisms.layout import channel_names
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import plant_catalogue as plants
from smc_mujoco.simulation.blow import bump
from smc_mujoco.simulation.force_bounds import U_MAX, default_u_max
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import (
    Clock,
    Constant,
    Fault,
    Jump,
    Noise,
    OrnsteinUhlenbeck,
    Pulse,
    Signal,
    Sine,
    Step,
)

# fields, or a function of plant and duration that returns them
Recipe = Data | Callable[[Plant, float], Data]

BOUNDS_PER_FRICTION = 60.0  # of u, on each driven joint
BRISTLE_STIFFNESS = 1e4  # 1/rad (1/m), of bristles over the friction at which a joint breaks away
# of a user's joint, from the study's pendulum of 0.125 kg m^2: its largest acceleration, rad/s^2,
# and the share of a rotor; chosen: what a rig's stepper suits, rad/s^2 (m/s^2) and rad (m)
STUDY_ACCELERATION = 48.0
ROTOR_SHARE = 0.008
STEPPER_ACCELERATIONS = (5.0, 500.0)
SHORTEST_WAY_OF_STEPS = 0.15
SINE = Sine(amplitude=0.2, omega=5.0)
SENSOR_NOISE = Noise(position=0.01, velocity=0.05)
STICTION_SPEED = 0.05  # rad/s (m/s), at which friction has fallen, chosen: that of the bristles
# of an elastic joint, chosen: its rotor's share of the inertia, as of a geared arm; its resonance
# over the joint's own rate, sqrt(bound/(inertia way)), which is 68 Hz on the study's pendulum, ten
# times its loop; and the share of critical damping
ELASTIC_ROTOR = 0.5
RESONANCE = 43.6
STRUCTURAL_DAMPING = 0.01
DIFFERENCED = estimator("filtered_difference", tau=5e-3)


def _jump(size: str) -> Recipe:
    """Return a parameter jump at half time, with the sine disturbance; `size` is "mild" or
    "hard".
    """

    def fields(plant: Plant, duration: float) -> Data:
        if size not in plant.jumps:
            with_jump = []
            for name, machine in plants().items():
                if size in machine.jumps:
                    with_jump.append(name)
            cure = f"choose another condition, or one of {', '.join(with_jump)}"
            raise ScenarioError(
                f"condition 'jump_{size}' has no numbers for plant {plant.name!r}: {cure}"
            )
        return {
            "disturbance": _sized(SINE, plant),
            "jump": Jump(time=duration / 2, factors=plant.jumps[size]),
        }

    return fields


def _contact(plant: Plant, duration: float) -> Data:
    """Return a joint's stops about its goal, and a blow that reaches them whatever u does."""
    stops, blow = bump(plant, duration / 2, 1.0 / BOUNDS_PER_FRICTION)
    return {"contact": stops, "disturbance": blow}


def _stepper(plant: Plant, duration: float) -> Data:
    """Return a stepper motor, and its largest acceleration as the bound on u."""
    if not plant.is_user_model:
        motor = of_rig(30.0 * default_u_max(plant))
        return {"actuator": motor, "u_max": motor.ramp}
    slowest, fastest = STEPPER_ACCELERATIONS
    for name, joint in zip(channel_names(plant), _joint_sizes(plant), strict=False):
        able = joint.limit / joint.inertia
        if not slowest <= able <= fastest or joint.travel < SHORTEST_WAY_OF_STEPS:
            raise ScenarioError(
                f"condition 'stepper' has the steps and rates of a rig, and joint {name!r} of "
                f"{plant.name} has {able:.2g} rad/s^2 (m/s^2) at its bound and moves by "
                f"{joint.travel:.2g} rad (m): give your own, as pulses: "
                "actuator=Stepper(torque=2, speed=60, ramp=80), u_max=80"
            )
    motors: Any = _each_joint("actuator", lambda limit, plant: of_rig(30.0 * limit))
    return motors(plant, duration) | {"u_max": of_rig(1.0).ramp}


def _fault(plant: Plant, duration: float) -> Data:
    """Return the loss of half the force, at 2 s, or at half of a run that is too short for it."""
    time = 2.0 if duration > 2.0 else duration / 2
    return {"fault": Fault(at=time, gain=0.5)}


def _sized(signal: Signal, plant: Plant) -> Signal:
    """Return a disturbance of the study's plants; for a free body and a user's model that share of
    the largest force.
    """
    if not (plant.pose or plant.is_user_model):
        return signal
    name = "sigma" if isinstance(signal, OrnsteinUhlenbeck) else "amplitude"
    size = getattr(signal, name) * default_u_max(plant) / U_MAX
    return dataclasses.replace(signal, **{name: size})


def _disturbed(make: Callable[[float], Signal]) -> Recipe:
    """Return the disturbance that a function makes for half of the duration."""
    return lambda plant, duration: {"disturbance": _sized(make(duration / 2), plant)}


def _by_joint(name: str, parts: Sequence[Any], plant: Plant) -> Data:
    """Return field `name` with a part for each driven joint; with one where all are equal, and on a
    free body.
    """
    if plant.pose or len(set(parts)) == 1:
        return {name: parts[0]}
    return {name: dict(zip(channel_names(plant), parts, strict=False))}


def _each_joint(name: str, make: Callable[[float, Plant], Any]) -> Recipe:
    """Return a recipe for field `name`: one part per driven joint, made from its bound."""

    def fields(plant: Plant, duration: float) -> Data:
        limits = Scenario.recorded(plant=plant, law="none").drive_train.forces
        return _by_joint(name, [make(limit, plant) for limit in limits], plant)

    return fields


def _rubbing(make: Callable[[float, Plant], Friction | tuple[Friction, ...]]) -> Recipe:
    """Return the friction that a function makes of a level, a sixtieth of the bound on each driven
    joint.
    """
    return _each_joint("friction", lambda limit, plant: make(limit / BOUNDS_PER_FRICTION, plant))


def _sticking(limit: float, plant: Plant) -> Friction:
    """Return dry friction that falls from 15 % of the bound at rest to 10 % in motion."""
    return Stribeck(0.1 * limit, 0.15 * limit, STICTION_SPEED)


def _bristles(level: float, plant: Plant) -> Friction:
    """Return bristles that bend by 0.1 mrad (mm) before a joint slides, as those of the study do.
    On the library's plants they have the study's stiffness. The default step does not resolve them
    on furuta: at a tenth of it `rotary_swing_up` settles 0.6 % earlier and has 3 % more ITAE.
    """
    stiffness = BRISTLE_STIFFNESS * level if plant.is_user_model else LuGre.stiffness
    return LuGre(0.5 * level, level, stribeck=0.05, stiffness=stiffness)


class JointSize(NamedTuple):
    """The size of a driven joint."""

    limit: float  # N m or N, its largest force
    inertia: float  # kg m^2 or kg, at the goal
    travel: float  # rad or m, from where runs start to the goal


def _joint_sizes(plant: Plant) -> list[JointSize]:
    """Return the sizes of the driven joints."""
    moments = at_goal(plant)
    inertias = np.diag(moments.M)[moments.dofs].tolist()
    apart = np.subtract(usual_start(plant), plant.origin)
    ways = np.abs(apart)[: plant.driven].tolist()
    limits = Scenario.recorded(plant=plant, law="none").drive_train.forces
    joints = zip(limits, inertias, ways, strict=True)
    own = []
    for limit, inertia, way in joints:
        own.append(JointSize(limit, inertia, way or BESIDE))
    return own


def _fitted(usual: Actuator, fit: Callable[[JointSize], Actuator]) -> Recipe:
    """Return a recipe for an actuator: the usual one, or one that fits each driven joint of a
    user's model.
    """

    def fields(plant: Plant, duration: float) -> Data:
        if not plant.has_user_joints:
            return {"actuator": usual}
        parts = list(map(fit, _joint_sizes(plant)))
        return _by_joint("actuator", parts, plant)

    return fields


def _backlash(joint: JointSize) -> Backlash:
    """Return the study's play and rotor as shares of the way and of the inertia."""
    rotor = max(ROTOR_SHARE * joint.inertia, MIN_INERTIA)
    return Backlash(0.01 * min(1.0, joint.travel / BESIDE), rotor_inertia=rotor)


def _elastic(plant: Plant, duration: float) -> Data:
    """Return springs between joints and rotors: with the resonance of the study's, as a multiple of
    the rate at which the bound moves the joint by the longest way of all.
    """
    if plant.pose:
        return {"actuator": ElasticJoint(1.0)}  # which the caller refuses
    parts = []
    joints = _joint_sizes(plant)
    way = max(joint.travel for joint in joints)
    for joint in joints:
        rotor = max(ELASTIC_ROTOR * joint.inertia, MIN_INERTIA)
        moving = rotor * joint.inertia / (rotor + joint.inertia)
        ratio = joint.limit / (joint.inertia * way)
        omega = RESONANCE * math.sqrt(ratio)
        damping = 2.0 * STRUCTURAL_DAMPING * omega * moving
        numbers = (moving * omega**2, damping, rotor)
        parts.append(ElasticJoint(*(float(f"{number:.3g}") for number in numbers)))
    return _by_joint("actuator", parts, plant)


def _motor_side(plant: Plant, duration: float) -> Data:
    """Return the same, where the controller reads the rotors, without error."""
    encoder = Encoder(counts=math.inf, side="motor")
    seen = {"sensor": encoder, "velocity": estimator("measured")}
    return {**_elastic(plant, duration), **seen}


def _encoder(plant: Plant, duration: float) -> Data:
    """Return the study's encoder; on a user's model with as many counts on the shortest way as it
    has on 0.3 rad, or more.
    """
    way = BESIDE
    if plant.has_user_joints:
        way = min(BESIDE, *(joint.travel for joint in _joint_sizes(plant)))
    return {"sensor": Encoder(counts=math.ceil(4096 * BESIDE / way))}


def _motor(joint: JointSize) -> DCMotor:
    """Return as many default motors in parallel as the bound is times the study's; with less gear
    where the joint accelerates faster than the study's, so that the rotors are no heavier beside
    it.
    """
    gear = min(1.0, STUDY_ACCELERATION * joint.inertia / joint.limit)
    motor = dataclasses.replace(DCMotor(), gear=gear * DCMotor.gear)
    return motor.side_by_side(joint.limit / U_MAX / gear)


# cli/names.py reads the names from the text
IDEAL: dict[str, Recipe] = {
    "nominal": {},
    "noise": {"noise": SENSOR_NOISE},
    "sine": _disturbed(lambda half: SINE),
    "constant": _disturbed(lambda half: Constant(0.2)),
    "step": _disturbed(lambda half: Step(0.2, time=half)),
    "pulse": _disturbed(lambda half: Pulse(2.0, time=half, width=0.1)),
    "process_noise": _disturbed(lambda half: OrnsteinUhlenbeck(sigma=0.2, tau=0.1)),
    "delay_1ms": {"input_delay": 0.001},
    "delay_5ms": {"input_delay": 0.005},
    "delay_10ms": {"input_delay": 0.01},
    "delay_20ms": {"input_delay": 0.02},
    "delay_50ms": {"input_delay": 0.05},
    "light": {"mismatch": {"mass": 0.7}},
    "heavy": {"mismatch": {"mass": 1.3}},
    "jump_mild": _jump("mild"),
    "jump_hard": _jump("hard"),
    "period_10ms": {"control_period": 0.01},
    "period_20ms": {"control_period": 0.02},
    "period_50ms": {"control_period": 0.05},
    "differenced_5ms": {"velocity": DIFFERENCED},
    "differenced_5ms_noise": {"velocity": DIFFERENCED, "noise": Noise(position=0.01)},
}
REAL: dict[str, Recipe] = {
    "friction": _rubbing(lambda level, plant: (Coulomb(level), Viscous(0.5 * level))),
    "coulomb": _rubbing(lambda level, plant: Coulomb(level)),
    "lugre": _rubbing(_bristles),
    "stiction": _each_joint("friction", _sticking),
    "lag_20ms": {"actuator": Lag(0.02)},
    "dc_motor": _fitted(DCMotor(), _motor),
    "stepper": _stepper,
    "backlash": _fitted(Backlash(0.01), _backlash),
    "elastic": _elastic,
    "motor_side": _motor_side,
    "encoder": _encoder,
    "jitter": {"clock": Clock(jitter=0.5e-3)},
    "missed": {"clock": Clock(missed=0.1)},
    "contact": _contact,
    "fault": _fault,
}
