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
    """Return the motor and gearbox of a rig.

    The efficiency of the gearbox divides resistance and inductance, which reduces the torque per volt as losses do.
    """
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


def electric(source, resistance, inductance, torque_constant, rotor, gear=1.0, efficiency=1.0, voltage=10.0):
    """Return name -> Quantity of a motor and gearbox, from numbers of one source in the units below."""
    return {
        "resistance": Quantity(resistance, "ohm", source, 1e-3),
        "inductance": Quantity(inductance, "H", source, 0.0),
        "torque_constant": Quantity(torque_constant, "N m/A", source, 1e-6),
        "rotor_inertia": Quantity(rotor, "kg m^2", source, 0.0),
        "gear": Quantity(gear, "", source, 1e-3),
        "efficiency": Quantity(efficiency, "", source, 0.01, 1.0),
        "voltage": Quantity(voltage, "V", source, 0.1),
    }


def pendulum(source, arm_inertia, arm_length, arm_damping, mass, centre, inertia, damping, counts):
    """Return name -> Quantity of an arm and a pendulum, from numbers of one source in the units below."""
    return {
        "arm_inertia": Quantity(arm_inertia, "kg m^2", source, 1e-7),
        "arm_length": Quantity(arm_length, "m", source, 1e-3),
        "arm_damping": Quantity(arm_damping, "N m s/rad", source, 0.0),
        "pendulum_mass": Quantity(mass, "kg", source, 1e-4),
        "pendulum_centre": Quantity(centre, "m", source, 1e-3),
        "pendulum_inertia": Quantity(inertia, "kg m^2", source, 1e-8),
        "pendulum_damping": Quantity(damping, "N m s/rad", source, 0.0),
        "counts": Quantity(counts, "1/turn", source, 2.0),
    }


def qube(version, source, motor, divisor, arm_damping, pendulum_damping, about):
    """Return a QUBE-Servo with its rotary pendulum; the arm has the inertia m r^2 / divisor."""
    arm, pole = (0.095, 0.085), (0.024, 0.129)  # kg, m
    return Rig(
        name=f"qube_servo_{version}",
        label=f"QUBE-Servo {version} with rotary pendulum, by its published parameters",
        quantities=electric(source, *motor)
        | pendulum(
            source, arm[0] * arm[1] ** 2 / divisor, arm[1], arm_damping, pole[0], pole[1] / 2,
            pole[0] * pole[1] ** 2 / 12, pendulum_damping, 2048.0,
        ),
        machine=rotary,
        about=about,
    )  # fmt: skip


QUBE_SERVO_2 = qube(
    2, DRIVER, (8.4, 1.16e-3, 0.042, 4e-6), 12.0, 5e-5, 2.5e-6,
    "The arm's inertia is m r^2/12. With m r^2/3 a controller that balances the machine lets the twin fall.",
)  # fmt: skip
QUBE_SERVO_3 = qube(
    3, QUBE_3, (7.5, 1.15e-3, 0.0422, 1.4e-6), 3.0, 1e-3, 5e-5,
    "As published, with m r^2/3 for the arm. Records of the first QUBE-Servo contradict that inertia.",
)  # fmt: skip
SRV02_PENDULUM = Rig(
    name="srv02",
    label="SRV02 with rotary pendulum, by its published parameters",
    quantities=electric(SRV02, 2.6, 0.18e-3, 7.68e-3, 3.9e-7, gear=70.0, efficiency=0.9 * 0.69)
    | pendulum(SRV02, 2e-3, 0.216, 2.4e-3, 0.127, 0.156, 1.2e-3, 2.4e-3, 4096.0),
    machine=rotary,
)
IP02_CART = Rig(
    name="ip02",
    label="IP02 cart with a pendulum, by its published parameters",
    quantities=electric(IP02, 2.6, 0.18e-3, 7.67e-3, 3.9e-7, gear=3.71 / 6.35e-3)
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
)
