"""What firmware needs around a law of a free body in C: its pose, its errors, and what its
actuators get.

These functions are translated, from the Python that runs in MuJoCo's callback, so that they give
the same bits.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from smc_mujoco.exchange.c.translation.values import Kind
from smc_mujoco.mechanisms.layout import PLACES
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.rotation import mix, put_attitude_error, rotation_vector
from smc_mujoco.simulation.model import keeps_torques, mixer

VECTOR = Kind("real", (len(PLACES),))  # of a pose, a velocity or a command


def pose(q, x):
    """Write the pose x, (6,), of a position and a unit quaternion q, (7,)."""
    x[:3] = q[:3]
    x[3], x[4], x[5] = rotation_vector(q[3], q[4], q[5], q[6])


def errors(x, v, r, dr, e, de):
    """Write the errors e and de of a pose x, v from a reference r, dr, (6,) each."""
    e[:], de[:] = x - r, v - dr
    put_attitude_error(x, v, r, dr, e, de)


def functions(plant: Plant | None) -> dict[str, tuple[Callable[..., Any], list[Kind]]]:
    """Return name in smc_law.h -> function, and the kinds of its arguments.

    Without a plant there are no actuators.
    """
    table_of_c = {
        "smc_pose": (pose, [Kind("real", (7,)), VECTOR]),
        "smc_errors": (errors, [VECTOR] * 6),
    }
    if plant is None:
        return table_of_c
    table = mixer(plant)
    rows = table.ravel()
    count = len(table)
    keeping = int(keeps_torques(table))

    def actuators(y, u, controls):
        command = np.zeros(len(u))
        for i in range(len(u)):
            command[i] = min(max(u[i], -y.limit[i]), y.limit[i])
        mix(y.x, command, rows, count, keeping, controls)

    return {**table_of_c, "smc_actuators": (actuators, [Kind("y"), VECTOR, Kind("real", (count,))])}
