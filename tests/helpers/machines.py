"""Two machines that tests identify, so that they need none of the published ones.

monkeypatch.setattr(rig, "rig_catalogue", machines.catalogue)  # smc.rig("axis") is AXIS
"""

import math

import numpy as np

from smc_mujoco.common.registry import Catalogue
from smc_mujoco.control.estimator import estimator
from smc_mujoco.control.law import law_function, library_law
from smc_mujoco.control.source import SHIPPED
from smc_mujoco.control.units import Gain
from smc_mujoco.identification.published_rig import PublishedRig
from smc_mujoco.identification.records import Columns
from smc_mujoco.identification.rig import Quantity
from smc_mujoco.mechanisms.hardware.drives import DCMotor
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.friction import Coulomb
from smc_mujoco.mechanisms.plant import plant

CHOSEN = "chosen, about those of a small machine tool"
BACK_EMF = 1e-6  # V s/m: too small to have an effect
LIFTED = "chosen, about those of a kilogram on an arm"


@law_function(gains={"kp": Gain(160.18, positive=True), "kv": Gain(243.45, positive=True)})
def cascade(y, gains, memory):
    """A position loop about a velocity loop."""
    return gains.kv * (-gains.kp * y.e - y.v), 0.0


def _axis(q):
    """A carriage that a voltage drives, without back-EMF, under its own cascade."""
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
        "control_period": 1e-3,
        "physics_step": 5e-4,
        "integrator": "RK4",
        "x0": 0.0,
    }


def _first_command(record, first):
    """What the cascade adds at the start, where a replay does not know the sample before."""
    gains = cascade.defaults
    u = np.zeros(len(record["t"]) - first)
    error = record["r"][first] - record["x"][first]
    u[0] = record["u"][first] - gains["kv"] * gains["kp"] * error
    return u


AXIS = PublishedRig(
    name="axis",
    label="A carriage on a ball screw",
    quantities={
        "mass": Quantity(95.1089, "kg", CHOSEN, 1.0, 1e4),
        "viscous": Quantity(203.5034, "N s/m", CHOSEN, 0.0, 1e5),
        "coulomb": Quantity(20.3935, "N", CHOSEN, 0.0, 1e4),
        "offset": Quantity(-3.1648, "N", CHOSEN, -1e3, 1e3),
        "force_per_volt": Quantity(35.1507, "N/V", CHOSEN, 0.1, 1e4),
        "count": Quantity(5e-8, "m", CHOSEN, 1e-9, 1e-2),
    },
    machine=_axis,
    controller=cascade(),
    commands=_first_command,
    columns=Columns(x=("x",), u="u", reference="r"),
    free=("mass", "viscous", "coulomb", "offset"),
)


def _pendulum(q):
    """A point mass of the inertia and of the moment of the weight."""
    l = q.inertia / q.mass_moment
    return {
        "plant": plant("inverted_pendulum", m=q.mass_moment / l, l=l, b=q.viscous),
        "friction": Coulomb(q.coulomb),
        "sensor": Encoder(counts=4096),
        "u_max": q.torque_limit,
        "control_period": 2e-3,
        "x0": -math.pi,
    }


PENDULUM = PublishedRig(
    name="lifted_pendulum",
    label="A pendulum on a motor that takes torques",
    quantities={
        "inertia": Quantity(0.1635, "kg m^2", LIFTED, 1e-3, 10.0),
        "mass_moment": Quantity(0.33, "kg m", LIFTED, 1e-3, 10.0),
        "viscous": Quantity(0.0, "N m s/rad", LIFTED, 0.0, 10.0),
        "coulomb": Quantity(0.21, "N m", LIFTED, 0.0, 10.0),
        "torque_limit": Quantity(12.0, "N m", LIFTED, 0.1, 100.0),
    },
    machine=_pendulum,
    columns=Columns(time="time", x=("position",), u="torque", offset=(math.pi,)),
    free=("inertia", "mass_moment", "viscous", "coulomb"),
    window=1.0,
    ensemble=(
        {"inertia": 0.161, "mass_moment": 0.318, "coulomb": 0.18},
        {"inertia": 0.166, "mass_moment": 0.342, "coulomb": 0.24},
        {"inertia": 0.161, "mass_moment": 0.342, "coulomb": 0.18},
        {"inertia": 0.166, "mass_moment": 0.318, "coulomb": 0.24},
    ),
    laws=(
        library_law("classical", k=1.578, c=16.55).sourced(SHIPPED),
        library_law("pid", kp=341.0, ki=1107.0, kd=4.143, tt=0.1287).sourced(SHIPPED),
    ),
    x0=(0.3,),
)


def catalogue() -> Catalogue[PublishedRig]:
    """Return both, by name."""
    return Catalogue({machine.name: machine for machine in (AXIS, PENDULUM)})
