"""Friction models, drives and kinds of contact beyond those at the root, and your own."""

from smc_mujoco.mechanisms.hardware.command_delay import CommandDelay
from smc_mujoco.mechanisms.hardware.command_filter import CommandFilter
from smc_mujoco.mechanisms.hardware.contact import Contact
from smc_mujoco.mechanisms.hardware.current_motor import CurrentMotor
from smc_mujoco.mechanisms.hardware.drag import Drag
from smc_mujoco.mechanisms.hardware.drives import RateLimit
from smc_mujoco.mechanisms.hardware.elastic_joint import ElasticJoint
from smc_mujoco.mechanisms.hardware.friction import LuGre
from smc_mujoco.mechanisms.hardware.part_functions import actuator_function, friction_function
from smc_mujoco.mechanisms.hardware.position_servo import PositionServo
from smc_mujoco.mechanisms.hardware.servos import ServoFriction, servo
from smc_mujoco.mechanisms.hardware.sliding import Sigmoid
from smc_mujoco.mechanisms.hardware.stepper import Stepper
from smc_mujoco.mechanisms.hardware.stribeck import Stribeck

__all__ = [
    "CommandDelay",
    "CommandFilter",
    "Contact",
    "Drag",
    "ElasticJoint",
    "LuGre",
    "PositionServo",
]
__all__ += ["CurrentMotor", "RateLimit", "ServoFriction", "Sigmoid", "Stepper", "Stribeck"]
__all__ += ["actuator_function", "friction_function", "servo"]
