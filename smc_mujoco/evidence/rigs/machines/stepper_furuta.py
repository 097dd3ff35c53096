"""Rotary pendulum on a stepper motor: a hobbyist's machine whose public recordings ran two sliding
modes.

Nothing of the recordings is here but figures of those under the linear law, from which the ensemble
was found. The sets are draws whose simulated recordings have these figures, see
benchmarks/stepper_furuta.py.
"""

import dataclasses
import math

from smc_mujoco.evidence.rigs.controllers import rotary
from smc_mujoco.evidence.rigs.firmware import (
    DEGREES,
    FOUR_STATES,
    LINEAR,
    TICK,
    TWO_STATES,
    firmware,
)
from smc_mujoco.identification.published_rig import PublishedRig
from smc_mujoco.identification.records import Columns
from smc_mujoco.identification.rig import Quantity
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.stepper import of_rig
from smc_mujoco.mechanisms.plant import plant
from smc_mujoco.simulation.signals import Clock, Noise, OrnsteinUhlenbeck

MACHINE = "Piyushiitk24/Rotary-Inverted-Pendulum at 05a9ffa (no licence stated)"
FORMULA = f"{MACHINE}: from formulas, not identified"
LIBRARY = "FastAccelStepper 0.33.9 (MIT) on an ATmega2560"
MEMORY = "from memory of a data sheet, not verified"
FOUND = (
    "identified here: a draw whose runs under the linear law have the recorded figures, "
    "benchmarks/stepper_furuta.py"
)
ABLATED = "its number here is the machine's; 0 leaves it out"
STEP = 2.5e-4  # s
ARM_INERTIA = 1.104e-3  # kg m^2, with the pendulum's mass on the arm's end; N m per rad/s^2 of u
# 1/s^2 and 1/s: the surface of least quadratic cost of the machine's own model, with the weights of
# `rotary_swing_up`
SURFACE = {"c1": -20.2542, "c2": -227.487, "c3": -12.589, "c4": -22.2163}
LAWS = (
    firmware(kind=LINEAR).named("linear"),
    firmware(kind=TWO_STATES).named("two_states"),
    firmware(kind=FOUR_STATES, top=12e3, speed=2e3).named("four_states"),
)


def machine(q):
    """Return the fields of a scenario."""
    pendulum = plant(
        "furuta",
        J=q.arm_inertia - q.pendulum_mass * q.arm_length**2,
        L=q.arm_length,
        m=q.pendulum_mass,
        l=q.pendulum_centre,
        Jc=q.pendulum_inertia - q.pendulum_mass * q.pendulum_centre**2,
        bq=q.pivot_damping,
        cf=q.arm_friction,
        cfq=q.pivot_friction,
    )
    step = math.tau / 1600.0  # of the firmware, rad
    motor = dataclasses.replace(
        of_rig(q.holding_torque),
        steps=round(q.steps) or math.inf,
        damping=q.arm_damping,
        rotor_inertia=0.0,
        stop_band=q.stop_band * step,
        queue=q.queue,
        refill=q.refill,
    )
    return {
        "plant": pendulum,
        "actuator": motor,
        "sensor": Encoder(
            round(q.counts) or math.inf, q.upright_error, delay=q.sensor_delay, skew=q.sensor_skew
        ),
        "noise": Noise(position=q.sensor_noise),
        "clock": Clock(pause=q.pause),
        "disturbance": OrnsteinUhlenbeck(q.vibration, 0.05, 5e-3) if q.vibration else None,
        "control_period": TICK,
        "physics_step": STEP,
        "u_max": math.inf,
        "x0": (0.0, 0.0),
    }


NAMES = (
    "holding_torque",
    "arm_damping",
    "arm_friction",
    "pivot_friction",
    "pivot_damping",
    "upright_error",
    "sensor_noise",
    "vibration",
    "pendulum_inertia",
)
SETS = (  # of the quantities above, as benchmarks/stepper_furuta.py prints them, the nearest first
    (0.1404, 0.006761, 0.00792, 0.0001499, 8.631e-05, 0.005923, 9.895e-05, 0.007587, 0.0001036),
    (0.1494, 0.006834, 0.007885, 0.0001388, 6.145e-05, 0.003578, 0.0004589, 0.00637, 0.0001034),
    (0.1232, 0.007031, 0.006645, 0.0001371, 0.0001492, 0.00541, 5.597e-05, 0.005791, 0.0001049),
    (0.1418, 0.01024, 0.00276, 0.0001466, 5.802e-06, -0.002811, 0.0005402, 0.007531, 0.0001118),
    (0.1285, 0.006165, 0.006705, 0.0001447, 0.0001019, 0.004563, 5.867e-05, 0.006334, 0.0001047),
    (0.1602, 0.004914, 0.005771, 0.0001482, 8.537e-05, 0.003283, 6.596e-05, 0.004848, 0.0001021),
    (0.1501, 0.005695, 0.006846, 0.0001268, 0.0001249, 0.004533, 0.0001002, 0.005337, 9.907e-05),
    (0.1334, 0.01225, 0.003725, 0.0001439, 2.463e-05, -0.001552, 0.0005427, 0.003792, 0.0001071),
)
BEST = dict(zip(NAMES, SETS[0], strict=True))
SECOND = (0.1991, 0.01633, 0.003776, 0.0001473, 0.0002129, -0.01205, 0.0001302, 0.004392, 9.59e-05)
QUANTITIES = {
    "arm_inertia": Quantity(
        ARM_INERTIA, "kg m^2", f"{FORMULA}; with the pendulum's mass on its end", 5e-4, 1e-2
    ),
    "arm_length": Quantity(0.19, "m", MACHINE, 0.01, 1.0),
    "pendulum_mass": Quantity(11.962e-3, "kg", MACHINE, 1e-3, 0.1),
    "pendulum_centre": Quantity(0.08768, "m", FORMULA, 0.01, 1.0),
    "pendulum_inertia": Quantity(
        BEST["pendulum_inertia"],
        "kg m^2",
        f"{FOUND}; about the pivot, 1.0215e-4 by formula",
        1e-5,
        1e-2,
    ),
    "holding_torque": Quantity(BEST["holding_torque"], "N m", FOUND, 1e-3, 100.0),
    "arm_damping": Quantity(BEST["arm_damping"], "N m s/rad", FOUND, 0.0, 1.0),
    "arm_friction": Quantity(BEST["arm_friction"], "N m", FOUND, 0.0, 0.1),
    "pivot_friction": Quantity(BEST["pivot_friction"], "N m", FOUND, 0.0, 1e-2),
    "pivot_damping": Quantity(BEST["pivot_damping"], "N m s/rad", FOUND, 0.0, 1e-2),
    "upright_error": Quantity(BEST["upright_error"], "rad", FOUND, -0.1, 0.1),
    "sensor_noise": Quantity(BEST["sensor_noise"], "rad", FOUND, 0.0, 0.01),
    "vibration": Quantity(
        BEST["vibration"], "N m", f"{FOUND}; rms on the arm, correlated over 0.05 s", 0.0, 1.0
    ),
    "counts": Quantity(4096.0, "", f"{MACHINE}; {ABLATED}", 0.0, 1e6),
    "sensor_delay": Quantity(2e-3, "s", f"chosen: AS5600's default filter, {MEMORY}", 0.0, 0.01),
    "sensor_skew": Quantity(
        5e-4, "s", f"{MACHINE}: one bus, the pendulum's sensor is read first", 0.0, 0.01
    ),
    "pause": Quantity(
        7.3e-3, "s", f"{MACHINE}: its longest ticks; a line of text a second", 0.0, 0.1
    ),
    "steps": Quantity(1600.0, "", f"{MACHINE}; {ABLATED}", 0.0, 1e6),
    "stop_band": Quantity(50.0, "steps/s", f"{MACHINE}; {ABLATED}", 0.0, 1e4),
    "queue": Quantity(0.02, "s", LIBRARY, 0.0, 1.0),
    "refill": Quantity(4.096e-3, "s", LIBRARY, 0.0, 1.0),
}
STEPPER_FURUTA = PublishedRig(
    name="stepper_furuta",
    label="Rotary pendulum on a stepper motor",
    quantities=QUANTITIES,
    machine=machine,
    controller=LAWS[0],
    columns=Columns(x=("theta", "alpha"), u="u", reference="target"),
    identified_from=("hold, linear", "nudges, linear"),
    free=NAMES,
    published={
        "second_search": dict(zip(NAMES, SECOND, strict=True))
        | {
            "source": (
                f"{FOUND} second: the one set of 16 whose runs allow the recorded rms of the hold"
            )
        },
    },
    ensemble=tuple(dict(zip(NAMES, values, strict=True)) for values in SETS[1:]),
    laws=(*LAWS, *rotary(ARM_INERTIA, SURFACE)),
    x0=(0.0, 0.75 / DEGREES),
    about=(
        f"{MACHINE}. The firmware's laws, its pulse generator's logic and the masses are the "
        "machine's facts; the rest was found from figures of its recordings under the linear law."
    ),
)
