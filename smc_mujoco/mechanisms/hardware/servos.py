"""Servos whose friction grows with the load on their gearbox: models M1 to M6; Dynamixel MX-64 and MX-106 as presets.

    servo = smc.servo("mx106", "m4")
    scenario = smc.Scenario(plant="pendulum", law=..., actuator=servo.motor, friction=servo.friction)

The load of a gearbox is the two torques on its sides, that of its motor and that from outside, and not their sum: if a
motor holds a weight, the sum is 0 and the gearbox is loaded. The callback reads both torques before a physics step. The
motor's torque is that of the joint's drive in the step before. The torque from outside is -qfrc_bias (gravity and
gyration) + qfrc_spring + disturbances of the joint + qfrc_constraint (contacts and limits, of the step before). It has
no `Push` and no inertia of what the joint moves. The published code reads the same torques; it has no springs and
disturbances.
"""

import dataclasses
import math
from collections.abc import Mapping
from typing import NamedTuple

from smc_mujoco.common.errors import find
from smc_mujoco.mechanisms.hardware.drives import DCMotor
from smc_mujoco.mechanisms.hardware.sliding import PerJoint, Sliding

LOADED = ("km", "ke", "kms", "kes", "kmq", "keq")  # factors on the two torques of the gearbox


@dataclasses.dataclass(frozen=True)
class ServoFriction(Sliding):
    """Friction of a servo by model M6. Models M1 to M5 are M6 with some numbers 0, or equal to each other.

        F(v) = (kc + |km m - ke e| + w (kcs + |kms m - kes e| + q)) sgn(v) + kv v,    w = exp(-|v/vs|^alpha)
        q = keq e^2 if |m| > |e|,  kmq m^2 if |m| < |e|,  0 if m and e have the same sign or size

    m is the motor's torque, e that from outside: see the module's docstring. Friction differs between a servo that
    drives its load against e and one that e drives back. At rest, friction holds up to |F| for v to 0.

        M1  kc, kv                M3  M1 and km = ke                    M5  km, ke, kms and kes differ
        M2  M1 and kcs, vs, alpha M4  M2 and km = ke, kms = kes         M6  M5 and kmq, keq

    Source: M. Duclusaud, G. Passault, V. Padois and O. Ly, Extended friction models for the physics simulation of servo
    actuators, arXiv 2410.08650, 2024; signs and q as in their code, Rhoban/bam (Apache-2.0), bam/model.py, where q has
    m if the load drives. Their simulator holds a joint by the torque that stops it within a step.

    Attributes:
      kv: viscous friction, N m s/rad.
      kc, kcs: dry friction at every speed, and its addition near rest, N m.
      km, ke: dry friction for each N m of the motor's torque and of the torque from outside, at every speed.
      kms, kes: the same, its addition near rest.
      kmq, keq: additions near rest for the squares of these torques, 1/(N m).
      vs: speed at which the additions have fallen to 1/e, rad/s, greater than 0.
      alpha: how steeply they fall, greater than 0.
    """

    forces = ("kv", "kc", "kcs", *LOADED)

    kv: PerJoint = 0.0
    kc: PerJoint = 0.0
    km: PerJoint = 0.0
    ke: PerJoint = 0.0
    kcs: PerJoint = 0.0
    kms: PerJoint = 0.0
    kes: PerJoint = 0.0
    kmq: PerJoint = 0.0
    keq: PerJoint = 0.0
    vs: PerJoint = 1.0
    alpha: PerJoint = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_numbers("kv", "kc", "kcs", *LOADED, least=0.0)
        self.check_numbers("vs", "alpha", above=0.0)

    @staticmethod
    def value(v, motor, load, p):
        near = math.exp(-(abs(v / p.vs) ** p.alpha))
        dry = p.kc + abs(p.km * motor - p.ke * load)
        more = p.kcs + abs(p.kms * motor - p.kes * load)
        if not motor * load > 0.0:  # one torque drives, the other resists
            if abs(motor) > abs(load):
                more += p.keq * load * load
            elif abs(motor) < abs(load):
                more += p.kmq * motor * motor
        held = dry + more
        return math.copysign(dry + near * more, v) + p.kv * v, -held, held


class Servo(NamedTuple):
    """A servo as parts of a scenario."""

    motor: DCMotor
    friction: ServoFriction


def servo(name: str, model: str = "m4", command: str = "torque") -> Servo:
    """Return motor and friction of a servo, as identified by Duclusaud et al.

    Args:
      name: "mx64" or "mx106", for Dynamixel MX-64 and MX-106.
      model: "m1" to "m6", see `ServoFriction`. Each was fitted on its own, with its own numbers of the motor.
      command: what u is, as in `DCMotor`: "torque" or "voltage".

    Raises:
      ScenarioError: an unknown servo, model or command.
    """
    models = find("servo", name, SERVOS)
    fitted = find(f"model of {name}", model, models)
    k, resistance, armature = fitted["kt"], fitted["R"], fitted["armature"]
    motor = DCMotor(
        resistance, 0.0, k, gear=1.0, rotor_inertia=armature, voltage=VOLTAGE, current=math.inf, command=command
    )
    numbers = {ours: fitted[theirs] for theirs, several in THEIRS.items() if theirs in fitted for ours in several}
    return Servo(motor, ServoFriction(**numbers))


VOLTAGE = 15.0 * 0.9625  # V: the supply times the largest duty cycle; bam/dynamixel/actuator.py
THEIRS = {  # name of a number in Rhoban/bam -> fields of ServoFriction
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
# Servo -> model -> numbers of Rhoban/bam (Apache-2.0), params/mx64 and params/mx106: kt in N m/A, R in ohm, armature in
# kg m^2, and the keys of THEIRS in the units of ServoFriction.
SERVOS: Mapping[str, Mapping[str, Mapping[str, float]]] = {
    "mx64": {
        "m1": {
            "kt": 1.6224667906987444, "R": 3.949433673232461, "armature": 0.011951238325312509,
            "friction_base": 0.09038677246291783, "friction_viscous": 0.011691602145974832,
        },
        "m2": {
            "kt": 1.6204381558934768, "R": 3.8944216519292354, "armature": 0.011923664899375061,
            "friction_base": 0.05611931763075957, "friction_stribeck": 0.08186411549069562,
            "dtheta_stribeck": 1.1202509555217797, "alpha": 2.9999999999758256,
            "friction_viscous": 0.019180846406029385,
        },
        "m3": {
            "kt": 1.631491787799071, "R": 3.5708899455080743, "armature": 0.011237906702031345,
            "friction_base": 0.10216727649779266, "load_friction_base": 0.07580074806755707,
            "friction_viscous": 0.0006300275797440622,
        },
        "m4": {
            "kt": 1.6631556605652682, "R": 3.1560000816605682, "armature": 0.010961212217454795,
            "friction_base": 0.061549466501679174, "friction_stribeck": 0.02389528618121147,
            "load_friction_base": 1.9611119490261663e-10, "load_friction_stribeck": 0.23428996680337053,
            "dtheta_stribeck": 1.5205782308422509, "alpha": 1.3344007931759223,
            "friction_viscous": 0.014754905791636505,
        },
        "m5": {
            "kt": 1.587432589063179, "R": 2.4143487051532198, "armature": 0.011728935143844849,
            "friction_base": 0.07501958219691603, "friction_stribeck": 0.022233160228709636,
            "load_friction_motor": 0.3847995899952685, "load_friction_external": 1.6148277731274518e-11,
            "load_friction_motor_stribeck": 0.030123950049619153, "load_friction_external_stribeck": 0.1658962964406309,
            "dtheta_stribeck": 0.7461716797150073, "alpha": 1.2930393293009845,
            "friction_viscous": 0.014908872960620413,
        },
        "m6": {
            "kt": 1.6016832750318712, "R": 2.3164043271967447, "armature": 0.012265893049213158,
            "friction_base": 6.217919698787649e-07, "friction_stribeck": 0.12269525980968875,
            "load_friction_motor": 0.3114720375111298, "load_friction_external": 2.0462014258729542e-08,
            "load_friction_motor_stribeck": 0.18774381222411038,
            "load_friction_external_stribeck": 0.014065853481003015,
            "load_friction_motor_quad": 0.006908512882777861, "load_friction_external_quad": 0.009999980627672081,
            "dtheta_stribeck": 2.575277366960116, "alpha": 0.8409018066017007,
            "friction_viscous": 0.02533701181690149,
        },
    },
    "mx106": {
        "m1": {
            "kt": 2.1913757006745245, "R": 2.9649903987776804, "armature": 0.026609234235148084,
            "friction_base": 0.10352026623606064, "friction_viscous": 0.03520238029013507,
        },
        "m2": {
            "kt": 2.190958566263214, "R": 2.9609045764726725, "armature": 0.026838831911873175,
            "friction_base": 2.768555173702711e-06, "friction_stribeck": 0.11742121471961874,
            "dtheta_stribeck": 1.8487805494299074, "alpha": 1.7413892741330947,
            "friction_viscous": 0.059589394457307716,
        },
        "m3": {
            "kt": 2.204165397088512, "R": 2.653346939680077, "armature": 0.02484689556730746,
            "friction_base": 0.1133532996239035, "load_friction_base": 0.10824037267470683,
            "friction_viscous": 0.01194450384263248,
        },
        "m4": {
            "kt": 2.23138890457851, "R": 2.3717487904639545, "armature": 0.02457397334336701,
            "friction_base": 6.653380436533205e-13, "friction_stribeck": 0.10491060771568866,
            "load_friction_base": 0.009150334028953775, "load_friction_stribeck": 0.22235912179095094,
            "dtheta_stribeck": 1.6232949773728853, "alpha": 1.323485668999259,
            "friction_viscous": 0.05096082506010955,
        },
        "m5": {
            "kt": 2.2087822411811935, "R": 2.0142427292798475, "armature": 0.026018155628771758,
            "friction_base": 1.8812712661235184e-10, "friction_stribeck": 0.12242747179820507,
            "load_friction_motor": 0.20763710226562626, "load_friction_external": 0.022684350817709906,
            "load_friction_motor_stribeck": 0.19519320110890795,
            "load_friction_external_stribeck": 0.08490162305974122,
            "dtheta_stribeck": 1.7457130513692263, "alpha": 1.138313248724122,
            "friction_viscous": 0.05066487276724427,
        },
        "m6": {
            "kt": 2.209828156174588, "R": 2.033661749312417, "armature": 0.026016184370993383,
            "friction_base": 1.0232526438525893e-05, "friction_stribeck": 0.12195409579603411,
            "load_friction_motor": 0.19800553725822115, "load_friction_external": 0.022215529897348624,
            "load_friction_motor_stribeck": 0.19859970173941574,
            "load_friction_external_stribeck": 0.08710328264676681,
            "load_friction_motor_quad": 0.009999930103371748, "load_friction_external_quad": 7.326919843140997e-05,
            "dtheta_stribeck": 1.7463251741328727, "alpha": 1.142827788004191,
            "friction_viscous": 0.05071566473605552,
        },
    },
}  # fmt: skip
