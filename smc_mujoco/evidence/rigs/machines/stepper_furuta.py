"""Rotary pendulum on a stepper motor, a hobbyist's machine whose public records ran sliding modes."""

import math

from smc_mujoco.evidence.rigs.firmware import FOUR_STATES, LINEAR, TICK, TWO_STATES, firmware
from smc_mujoco.evidence.rigs.records import Columns
from smc_mujoco.evidence.rigs.rig import Quantity, Rig
from smc_mujoco.hardware import Stepper
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.plant import plant
from smc_mujoco.simulation.signals import Clock, Noise, OrnsteinUhlenbeck

MACHINE = "Piyushiitk24/Rotary-Inverted-Pendulum at 05a9ffa (no licence stated)"
STEP = 2.5e-4  # s
STEPS = 1600  # a turn: 1.8 degrees at 8 microsteps
TOOTH = 50


def machine(q):
    """Return the fields of a scenario."""
    pendulum = plant(
        "furuta", J=q.arm_inertia - q.pendulum_mass * q.arm_length**2, L=q.arm_length, m=q.pendulum_mass,
        l=q.pendulum_centre, Jc=q.pendulum_inertia - q.pendulum_mass * q.pendulum_centre**2, bq=q.pivot_damping,
        cf=q.arm_friction, cfq=q.pivot_friction,
    )  # fmt: skip
    step = math.tau / STEPS
    motor = Stepper(
        steps=STEPS, teeth=TOOTH, torque=q.holding_torque, damping=q.arm_damping, rotor_inertia=0.0, speed=15e3 * step,
        ramp=20e3 * step, stop_band=50.0 * step,
    )  # fmt: skip
    return {
        "plant": pendulum,
        "actuator": motor,
        "sensor": Encoder(counts=4096, bias=q.upright_error, delay=q.sensor_delay, skew=5e-4),
        "noise": Noise(position=q.sensor_noise),
        "clock": Clock(pause=7.3e-3, pause_every=1.0),
        "disturbance": OrnsteinUhlenbeck(q.vibration, 0.05, 5e-3) if q.vibration else None,
        "control_period": TICK,
        "physics_step": STEP,
        "u_max": math.inf,
        "x0": (0.0, 0.0),
    }


LAWS = (
    firmware(kind=LINEAR).named("linear"),
    firmware(kind=TWO_STATES).named("sliding_two_states"),
    firmware(kind=FOUR_STATES, top=12e3, speed=2e3).named("sliding_four_states"),
)
FORMULA = f"{MACHINE}: from formulas, not identified"
STEPPER_FURUTA = Rig(
    name="stepper_furuta",
    label="Rotary pendulum on a stepper motor",
    quantities={
        "arm_inertia": Quantity(1.104e-3, "kg m^2", f"{FORMULA}; with the pendulum's mass on its end", 5e-4, 1e-2),
        "arm_length": Quantity(0.19, "m", MACHINE, 0.01, 1.0),
        "pendulum_mass": Quantity(11.962e-3, "kg", MACHINE, 1e-3, 0.1),
        "pendulum_centre": Quantity(0.08768, "m", FORMULA, 0.01, 1.0),
        "pendulum_inertia": Quantity(1.0215e-4, "kg m^2", f"{FORMULA}; about the pivot", 1e-5, 1e-2),
        "holding_torque": Quantity(0.15, "N m", "guess", 1e-3, 10.0),
        "arm_damping": Quantity(0.02, "N m s/rad", "guess", 0.0, 1.0),
        "arm_friction": Quantity(0.0, "N m", "guess", 0.0, 0.1),
        "pivot_friction": Quantity(9e-5, "N m", "guess", 0.0, 1e-2),
        "pivot_damping": Quantity(1e-5, "N m s/rad", "guess", 0.0, 1e-2),
        "upright_error": Quantity(0.0, "rad", "guess", -0.1, 0.1),
        "sensor_noise": Quantity(3e-4, "rad", "guess", 0.0, 0.01),
        "vibration": Quantity(1e-4, "N m", "guess", 0.0, 1.0),
        "sensor_delay": Quantity(2e-3, "s", "AS5600's default filter, from memory", 0.0, 0.01),
    },
    machine=machine,
    controller=LAWS[0],
    columns=Columns(x=("theta", "alpha"), u="u", reference="target"),
    laws=LAWS,
)
