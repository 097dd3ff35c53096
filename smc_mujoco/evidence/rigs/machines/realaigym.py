"""RealAIGym's double pendulum, design C.1: as a pendubot, driven at the shoulder, and as an
acrobot, at the elbow.

Records have the torques of both motors. Identification compares them with the torques that the
measured motion takes. The rig's numbers are identified from two records. The published fits of the
machine, models 1.0 to 3.0, disagree.
"""

import math

from smc_mujoco.common.data import attributes
from smc_mujoco.identification.published_rig import PublishedRig
from smc_mujoco.identification.records import Columns
from smc_mujoco.identification.rig import Quantity
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.plant import plant
from smc_mujoco.mechanisms.plants.double_pendulum import MODEL_1_0, MODEL_1_1

SOURCE = "dfki-ric-underactuated-lab/double_pendulum (BSD-3), design C.1"
ORIGIN = "identified here from the public sys-id records 03 and 13"
UNITS = {
    "m1": "kg",
    "m2": "kg",
    "l1": "m",
    "r1": "m",
    "r2": "m",
    "I1": "kg m^2",
    "I2": "kg m^2",
    "Ir": "kg m^2",
    "gear": "",
    "b1": "N m s/rad",
    "b2": "N m s/rad",
    "cf1": "N m",
    "cf2": "N m",
    "grav": "m/s^2",
}
IDENTIFIED = {
    "r1": 0.149695,
    "r2": 0.250753,
    "I1": 0.0241934,
    "I2": 0.0474307,
    "Ir": 5.68305e-5,
    "b1": 0.00213092,
    "b2": 0.00398775,
    "cf1": 0.249115,
    "cf2": 0.162908,
}
DRY = math.pi / 2  # factor on cf in the published friction cf arctan(100 q'), at speed
SETS = {
    "model_1_0": MODEL_1_0 | {"source": f"{SOURCE}, model 1.0"},
    "model_1_1": MODEL_1_1 | {"source": f"{SOURCE}, model 1.1"},
    "model_2_0": MODEL_1_0
    | {
        "cf1": 0.1747 * DRY,
        "cf2": 0.11 * DRY,
        "b1": 0.0037,
        "b2": 0.00065,
        "m1": 0.7586,
        "m2": 0.3369,
        "I1": 0.0421,
    }
    | {"I2": 0.0510, "r2": 0.4684, "source": f"{SOURCE}, model 2.0"},
    "model_3_0": MODEL_1_0
    | {
        "cf1": 0.033 * DRY,
        "cf2": 0.035 * DRY,
        "b1": 0.049,
        "b2": 0.020,
        "source": f"{SOURCE}, friction of model 3.0",
    },
}

ENSEMBLE = []
for model in ("model_1_0", "model_2_0", "model_3_0"):  # not model 1.1, which has no friction
    numbers = dict(SETS[model])
    del numbers["source"]
    ENSEMBLE.append(numbers)


def quantities():
    """Return name -> Quantity: identified numbers, else those of model 1.0, and the boards' limit
    of torque.
    """
    measured = {}
    for name, value in MODEL_1_0.items():
        measured[name] = Quantity(
            IDENTIFIED.get(name, value), UNITS[name], ORIGIN if name in IDENTIFIED else SOURCE, 0.0
        )
    return measured | {
        "torque_limit": Quantity(6.0, "N m", f"{SOURCE}: the boards' limit", 0.0, 12.0)
    }


def plant_of(name, q):
    """Return a plant with the rig's numbers."""
    return plant(name, **attributes(q, MODEL_1_0))


def fields(name, q):
    """Return the fields of a scenario of the plant `name`, which starts hanging at rest."""
    return {
        "plant": plant_of(name, q),
        "sensor": Encoder(counts=4096),
        "u_max": q.torque_limit,
        "control_period": 2e-3,
        "x0": (0.0, 0.0),
    }


COMMON = {
    "columns": Columns(
        time="time", x=("pos_meas1", "pos_meas2"), torque=("tau_meas1", "tau_meas2")
    ),
    "dynamics": lambda q: plant_of("double_pendulum", q),
    "identified_from": ("sys-id 03", "sys-id 13"),
    "free": ("r1", "r2", "I1", "I2", "Ir", "b1", "b2", "cf1", "cf2"),
    "published": SETS,
    "ensemble": tuple(ENSEMBLE),
    "about": (
        "Records: sys-id motions and board runs of design C.1. Masses are kept, because torques "
        "determine only moments."
    ),
}
PENDUBOT = PublishedRig(
    name="realaigym_pendubot",
    label="RealAIGym's double pendulum, driven at the shoulder",
    quantities=quantities(),
    machine=lambda q: fields("pendubot", q),
    **COMMON,
)
ACROBOT = PublishedRig(
    name="realaigym_acrobot",
    label="RealAIGym's double pendulum, driven at the elbow",
    quantities=quantities(),
    machine=lambda q: fields("acrobot", q),
    **COMMON,
)
