"""Quanser's rigs with their published parameters: QUBE-Servo 2 and 3, IP02 cart, SRV02 rotary pendulum.

No records of them are at hand, so nothing is identified. The dead bands of their amplifiers are left out.
"""

import math

from smc_mujoco.evidence.rigs.rig import Quantity, Rig
from smc_mujoco.mechanisms.hardware.drives import DCMotor
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.plant import plant

DRIVER = "BlueRiverTech/quanser-openai-driver (MIT)"
QUBE_3 = "Quanser's qube3_rotpen_param.m and user manual (no licence stated)"
IP02 = "Quanser, IP02 linear servo, user manual (no licence stated)"
LONG_SOURCE = "Quanser's setup_sp_configuration.m, pendulum LONG_24IN (no licence stated)"
SRV02 = "Quanser, SRV02 rotary servo and pendulum, user manuals (no licence stated)"


def motor(q):
    """Return motor and gearbox, whose efficiency divides resistance and inductance: less torque per volt."""
    return DCMotor(
        resistance=q.resistance / q.efficiency, inductance=q.inductance / q.efficiency,
        torque_constant=q.torque_constant, gear=q.gear, rotor_inertia=q.rotor_inertia, voltage=q.voltage,
        current=math.inf, command="voltage",
    )  # fmt: skip


def rotary(q):
    """Return the fields of a scenario of a rotary pendulum."""
    furuta = plant(
        "furuta", J=q.arm_inertia, L=q.arm_length, m=q.pendulum_mass, l=q.pendulum_centre, Jc=q.pendulum_inertia,
        b=q.arm_damping, bq=q.pendulum_damping,
    )  # fmt: skip
    return {
        "plant": furuta, "actuator": motor(q), "sensor": Encoder(counts=round(q.counts)), "control_period": 2e-3,
        "x0": (0.0, 0.1),
    }  # fmt: skip


def linear(q):
    """Return the fields of a scenario of a cart with a pole."""
    cart = plant("cart_pole", M=q.cart_mass, m=q.pole_mass, l=q.pole_half_length, b=q.cart_damping, bq=q.pole_damping)
    return {
        "plant": cart, "actuator": motor(q), "sensor": Encoder(counts=round(q.counts)), "control_period": 1e-3,
        "x0": (0.0, 0.1),
    }  # fmt: skip


UNITS = {  # quantity -> unit, and range
    "resistance": ("ohm", 1e-3), "inductance": ("H", 0.0), "torque_constant": ("N m/A", 1e-6),
    "rotor_inertia": ("kg m^2", 0.0), "gear": ("", 1e-3), "efficiency": ("", 0.01, 1.0), "voltage": ("V", 0.1),
    "arm_inertia": ("kg m^2", 1e-7), "arm_length": ("m", 1e-3), "arm_damping": ("N m s/rad", 0.0),
    "pendulum_mass": ("kg", 1e-4), "pendulum_centre": ("m", 1e-3), "pendulum_inertia": ("kg m^2", 1e-8),
    "pendulum_damping": ("N m s/rad", 0.0), "counts": ("1/turn", 2.0),
}  # fmt: skip


def quantities(source, **values):
    """Return name -> Quantity, from numbers of one source in UNITS."""
    values = {name: values[name] for name in UNITS if name in values}
    return {name: Quantity(value, UNITS[name][0], source, *UNITS[name][1:]) for name, value in values.items()}


def qube(version, source, arm_inertia, about, **values):
    """Return a QUBE-Servo with its rotary pendulum, a uniform rod of 0.024 kg and 0.129 m."""
    numbers = quantities(
        source, arm_inertia=arm_inertia, arm_length=0.085, pendulum_mass=0.024, pendulum_centre=0.129 / 2,
        pendulum_inertia=0.024 * 0.129**2 / 12, counts=2048.0, gear=1.0, efficiency=1.0, voltage=10.0, **values,
    )  # fmt: skip
    label = f"QUBE-Servo {version} with rotary pendulum, by its published parameters"
    return Rig(name=f"qube_servo_{version}", label=label, quantities=numbers, machine=rotary, about=about)


QUBE_SERVO_2 = qube(
    2, DRIVER, 0.095 * 0.085**2 / 12.0,
    "The arm's inertia is m r^2/12. With m r^2/3 a controller that balances the machine lets the twin fall.",
    resistance=8.4, inductance=1.16e-3, torque_constant=0.042, rotor_inertia=4e-6, arm_damping=5e-5,
    pendulum_damping=2.5e-6,
)  # fmt: skip
QUBE_SERVO_3 = qube(
    3, QUBE_3, 0.095 * 0.085**2 / 3.0,
    "As published, with m r^2/3 for the arm. Records of the first QUBE-Servo contradict that inertia.",
    resistance=7.5, inductance=1.15e-3, torque_constant=0.0422, rotor_inertia=1.4e-6, arm_damping=1e-3,
    pendulum_damping=5e-5,
)  # fmt: skip
SRV02_PENDULUM = Rig(
    name="srv02",
    label="SRV02 with rotary pendulum, by its published parameters",
    quantities=quantities(
        SRV02, resistance=2.6, inductance=0.18e-3, torque_constant=7.68e-3, rotor_inertia=3.9e-7, gear=70.0,
        efficiency=0.9 * 0.69, voltage=10.0, arm_inertia=2e-3, arm_length=0.216, arm_damping=2.4e-3,
        pendulum_mass=0.127, pendulum_centre=0.156, pendulum_inertia=1.2e-3, pendulum_damping=2.4e-3, counts=4096.0,
    ),
    machine=rotary,
)  # fmt: skip
IP02_CART = Rig(
    name="ip02",
    label="IP02 cart with a pendulum, by its published parameters",
    quantities=quantities(
        IP02, resistance=2.6, inductance=0.18e-3, torque_constant=7.67e-3, rotor_inertia=3.9e-7, gear=3.71 / 6.35e-3,
        efficiency=1.0, voltage=10.0,
    )
    | {
        "cart_mass": Quantity(0.57, "kg", f"{IP02}; 0.94 with its weight", 0.01),
        "cart_damping": Quantity(5.4, "N s/m", f"{IP02}; 4.3 without its weight", 0.0),
        "pole_mass": Quantity(0.23, "kg", LONG_SOURCE, 1e-3),
        "pole_half_length": Quantity(0.3302, "m", f"{LONG_SOURCE}, pivot to centre of gravity", 1e-3),
        "pole_damping": Quantity(2.4e-3, "N m s/rad", LONG_SOURCE, 0.0),
        "counts": Quantity(4096.0, "1/turn", f"{IP02}, of the pendulum", 2.0),
    },
    machine=linear,
    about="The pole is uniform, with 6 % more inertia about its centre than Quanser's, whose tip is 0.6413 m from the "
    "hinge. The cart's position has the pendulum's 4096 counts, for a metre in place of a turn. The counts of the "
    "machine are 22.75 um.",
)  # fmt: skip
