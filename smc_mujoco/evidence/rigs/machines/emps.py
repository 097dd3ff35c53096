"""EMPS: an electro-mechanical positioning system, a carriage on a ball screw that a voltage drives.

Its records are of closed loops with the published cascade at 1 kHz. The amplifier controls the
current, so there is no back-EMF; that of the motor here is too small to have an effect.
"""

import math

import numpy as np

from smc_mujoco.control.estimator import estimator
from smc_mujoco.evidence.rigs.controllers import cascade
from smc_mujoco.identification.published_rig import PublishedRig
from smc_mujoco.identification.records import Columns, Record
from smc_mujoco.identification.rig import Quantity
from smc_mujoco.mechanisms.hardware.drives import DCMotor
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.plant import plant

# s, under RK4. With steps h of first order, positions lead by h/2 v, which biases friction.
PERIOD, STEP = 1e-3, 5e-4
BACK_EMF = 1e-6  # V s/m: too small to have an effect
PUBLISHED = (
    "A. Janot, M. Gautier and M. Brunot, Data set and reference models of EMPS, 2019 (no licence "
    "stated)"
)


def machine(q):
    """Return the fields of a scenario."""
    motor = DCMotor(
        resistance=BACK_EMF / q.force_per_volt,
        inductance=0.0,
        torque_constant=BACK_EMF,
        gear=1.0,
        rotor_inertia=0.0,
        voltage=10.0,
        current=math.inf,
        command="voltage",
    )
    return {
        "plant": plant("servo_axis", M=q.mass, b=q.viscous, cf=q.coulomb, offset=q.offset),
        "actuator": motor,
        "sensor": Encoder(counts=round(1.0 / q.count)),
        "velocity": estimator("filtered_difference", tau=0.0),
        "control_period": PERIOD,
        "physics_step": STEP,
        "integrator": "RK4",
        "x0": 0.0,
    }


def commands(record: Record, first: int) -> np.ndarray:
    """Return what the machine's controller adds to the replay's: the velocity term at the start, V,
    (K,).

    The replay does not know the samples before its start, so that term follows from the first
    recorded command.
    """
    gains = cascade.defaults
    u = np.zeros(len(record["t"]) - first)
    u[0] = record["u"][first] - gains["kv"] * gains["kp"] * (
        record["r"][first] - record["x"][first]
    )
    return u


EMPS = PublishedRig(
    name="emps",
    label="EMPS, an electro-mechanical positioning system",
    quantities={
        "mass": Quantity(95.1089, "kg", PUBLISHED, 1.0, 1e4),
        "viscous": Quantity(203.5034, "N s/m", PUBLISHED, 0.0, 1e5),
        "coulomb": Quantity(20.3935, "N", PUBLISHED, 0.0, 1e4),
        "offset": Quantity(-3.1648, "N", PUBLISHED, -1e3, 1e3),
        "force_per_volt": Quantity(35.1507, "N/V", PUBLISHED, 0.1, 1e4),
        "count": Quantity(5e-8, "m", PUBLISHED, 1e-9, 1e-2),
    },
    machine=machine,
    controller=cascade(),
    commands=commands,
    columns=Columns(x=("x",), u="u", reference="r"),
    free=("mass", "viscous", "coulomb", "offset"),
    about=(
        "The numbers are the published ones. The program's tracking error is 0.578 mm rms, "
        "recorded 0.581; with the reference a tick late 0.666. There is no ensemble, because no "
        "standard errors are published. The direction of dry friction changes up to 0.5 ms late."
    ),
)
