"""Servos whose friction grows with the load on their gearbox: models M1 to M6, and the servos whose
numbers are published as presets.

    servo = smc.hardware.servo("mx106", "m4")
    parts = {"actuator": servo.motor, "friction": servo.friction}
    scenario = smc.Scenario(plant="pendulum", law=..., **parts)

The load of a gearbox is the two torques on its sides, that of its motor and that from outside, and
not their sum: if a motor holds a weight, the sum is 0 and the gearbox is loaded. The callback reads
both torques before a physics step. The motor's torque is that of the joint's drive in the step
before. The torque from outside is -qfrc_bias (gravity and gyration) + qfrc_spring + disturbances of
the joint + qfrc_constraint (contacts and limits, of the step before). It leaves out `Push`, the
inertia of what the joint moves, and the stops of a play, which pass on the motor's own torque. The
published code reads the same torques; it has no springs and disturbances.
"""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, NamedTuple

from smc_mujoco.common.errors import find
from smc_mujoco.common.files import read_json
from smc_mujoco.mechanisms.hardware.drives import DCMotor
from smc_mujoco.mechanisms.hardware.sliding import NaturalPerJoint, PositivePerJoint, Sliding

LOAD_FACTORS = ("km", "ke", "kms", "kes", "kmq", "keq")  # factors on the two torques of the gearbox


@dataclasses.dataclass(frozen=True)
class ServoFriction(Sliding):
    """Friction of a servo by model M6.

    Models M1 to M5 are M6 with some numbers 0, or equal to each other.

        F(v) = (kc + |km m - ke e| + w (kcs + |kms m - kes e| + q)) sgn(v) + kv v
        w = exp(-|v/vs|^alpha)
        q = keq e^2 if |m| > |e|,  kmq m^2 if |m| < |e|,  0 if m and e have the same sign or size

    m is the motor's torque, e that from outside: see the module's docstring. Friction differs
    between a servo that drives its load against e and one that e drives back. At rest, friction
    holds up to |F| for v to 0.

        M1  kc, kv                    M2  M1 and kcs, vs, alpha
        M3  M1 and km = ke            M4  M2 and km = ke, kms = kes
        M5  km, ke, kms, kes differ   M6  M5 and kmq, keq

    Source: M. Duclusaud, G. Passault, V. Padois and O. Ly, Extended friction models for the physics
    simulation of servo actuators, arXiv 2410.08650, 2024; signs and q as in their code, Rhoban/bam
    (Apache-2.0), bam/model.py, where q has m if the load drives. Their simulator holds a joint by
    the torque that stops it within a step.

    Attributes:
      kv: viscous friction, N m s/rad, 0 or more.
      kc, kcs: dry friction at every speed, and what is added to it near rest, N m, 0 or more.
      km, ke: dry friction for each N m of the motor's torque and of the torque from outside, at
        every speed, 0 or more.
      kms, kes: the same for what is added near rest, 0 or more.
      kmq, keq: friction added near rest for the squares of these torques, 1/(N m), 0 or more.
      vs: speed at which the additions have fallen to 1/e, rad/s, greater than 0.
      alpha: how steeply they fall, greater than 0.
    """

    forces = ("kv", "kc", "kcs", *LOAD_FACTORS)
    units: ClassVar[Mapping[str, str]] = {
        "kv": "{f} s/{x}",
        "kc": "{f}",
        "kcs": "{f}",
        "kmq": "1/({f})",
        "keq": "1/({f})",
        "vs": "{x}/s",
    }

    kv: NaturalPerJoint = 0.0
    kc: NaturalPerJoint = 0.0
    km: NaturalPerJoint = 0.0
    ke: NaturalPerJoint = 0.0
    kcs: NaturalPerJoint = 0.0
    kms: NaturalPerJoint = 0.0
    kes: NaturalPerJoint = 0.0
    kmq: NaturalPerJoint = 0.0
    keq: NaturalPerJoint = 0.0
    vs: PositivePerJoint = 1.0
    alpha: PositivePerJoint = 1.0

    @staticmethod
    def value(v, motor, load, p):
        near = math.exp(-(abs(v / p.vs) ** p.alpha))
        dry = p.kc + abs(p.km * motor - p.ke * load)
        additions = p.kcs + abs(p.kms * motor - p.kes * load)
        if not motor * load > 0.0:  # one torque drives, the other resists
            if abs(motor) > abs(load):
                additions += p.keq * load * load
            elif abs(motor) < abs(load):
                additions += p.kmq * motor * motor
        limit = dry + additions
        return math.copysign(dry + near * additions, v) + p.kv * v, -limit, limit


class Servo(NamedTuple):
    """A servo as parts of a scenario."""

    motor: DCMotor
    friction: ServoFriction


def servo(name: str, model: str = "m4", command: str = "torque") -> Servo:
    """Return motor and friction of a servo, as identified by Duclusaud et al.

        servo = smc.hardware.servo("mx64")
        smc.Scenario(plant="inverted_pendulum", law="pid", actuator=servo.motor)

    Args:
      name: "mx64", "mx106", "xl320" or "xl330" (Dynamixel), "sts3215" (Feetech, 7.4 V) or
        "erob80_50" (eRob 80, gearbox 50 to 1).
      model: "m1" to "m6", see `ServoFriction`; "sts3215" has "m1" only. Each was fitted on its own,
        with its own numbers of the motor.
      command: what u is, as in `DCMotor`: "torque" or "voltage".

    Returns:
      A `Servo`: `motor`, for `actuator` of a Scenario, and `friction`.

    Raises:
      ScenarioError: an unknown servo, model or command.
    """
    models = find("servo", name, SERVOS)
    fitted = find(f"model of {name}", model, models)
    motor = DCMotor(
        fitted["R"],
        0.0,
        fitted["kt"],
        gear=1.0,
        rotor_inertia=fitted["armature"],
        command=command,
        **SUPPLIES[name]._asdict(),
    )
    numbers = {}
    for theirs, fields in BAM_FIELDS.items():
        if theirs in fitted:
            for ours in fields:
                numbers[ours] = fitted[theirs]
    return Servo(motor, ServoFriction(**numbers))


class Supply(NamedTuple):
    """What bounds a servo's motor."""

    voltage: float  # V: the supply times the largest duty cycle
    current: float = math.inf  # A


# Of Rhoban/bam, bam/dynamixel/actuator.py, bam/feetech/actuator.py and bam/erob/actuator.py
SUPPLIES = {
    "mx64": Supply(15.0 * 0.9625),
    "mx106": Supply(15.0 * 0.9625),
    "xl320": Supply(7.5),
    "xl330": Supply(7.5),
    "sts3215": Supply(7.4 * 0.97),
    "erob80_50": Supply(48.0, 12.0),
}
BAM_FIELDS = {  # name of a number in Rhoban/bam -> fields of ServoFriction
    "friction_viscous": ("kv",),
    "friction_base": ("kc",),
    "friction_stribeck": ("kcs",),
    "load_friction_base": ("km", "ke"),
    "load_friction_stribeck": ("kms", "kes"),
    "load_friction_motor": ("km",),
    "load_friction_external": ("ke",),
    "load_friction_motor_stribeck": ("kms",),
    "load_friction_external_stribeck": ("kes",),
    "load_friction_motor_quad": ("kmq",),
    "load_friction_external_quad": ("keq",),
    "dtheta_stribeck": ("vs",),
    "alpha": ("alpha",),
}
# Servo -> model -> numbers of Rhoban/bam (Apache-2.0, commit 1b5a1ce), bam/params/NAME, for sts3215
# feetech_sts3215_7_4V: kt in N m/A, R in ohm, armature in kg m^2, and the keys of BAM_FIELDS in the
# units of ServoFriction.
SERVOS: Mapping[str, Mapping[str, Mapping[str, float]]] = read_json(
    Path(__file__).with_name("servos.json")
)
