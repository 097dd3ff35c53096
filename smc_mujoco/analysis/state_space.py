"""The linear model of a mechanism: A and B of its rates, from MuJoCo."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array, Names
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.extras import package
from smc_mujoco.common.mjcb import installed
from smc_mujoco.control.nominal_gains import DIFFERENCE_STEP
from smc_mujoco.mechanisms.layout import channel_names, dof_ids, drive_ids
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.scenario import Scenario

if TYPE_CHECKING:
    from control import StateSpace

INSTANT_STEP = 1e-9  # s, physics step while rates are linearised
FLAGS = mujoco.mjtDisableBit
NONLINEAR_FLAGS = FLAGS.mjDSBL_CONTACT.value | FLAGS.mjDSBL_LIMIT.value
NONLINEAR_FLAGS |= FLAGS.mjDSBL_FRICTIONLOSS.value | FLAGS.mjDSBL_CLAMPCTRL.value
# rad/s^2 or m/s^2: a larger acceleration that no command cancels is no rest
MAX_REST_ACCELERATION = 1e-6


def state_space(plant: Plant | str, x: float | None = None) -> "StateSpace":
    """Linearise a plant at rest as a `control.StateSpace`: x' = A x + B u, y = C x.

        smc.design.state_space("inverted_pendulum").poles()

    The states are the positions of its joints, then their velocities, the channels first in their
    order; u are the commands of the driven channels, and y the positions of all channels. Those of
    a free body are errors of its pose, and its u are the forces of its actuators. SI units. Drives
    are ideal, without delay; contacts, limits and dry friction are left out. A and B are central
    differences of the accelerations that MuJoCo computes.

    Args:
      plant: a Plant or its name.
      x: position of all channels, rad or m; the commands that hold the plant there are part of the
        operating point. Default: where the plant rests.

    Returns:
      A `control.StateSpace`.

    Raises:
      ScenarioError: no command holds the plant at rest there.
      MissingPackageError: python-control is not installed.
    """
    with package("control", "smc.design.state_space"):
        from control import StateSpace

    plant = as_plant(plant)
    scenario = Scenario(plant=plant, law="none", x0=(plant.rest or 0.0) if x is None else x, v0=0.0)
    with installed(None):
        model = models.with_values(models.compile_model(scenario), scenario)
        model.opt.disableflags |= NONLINEAR_FLAGS
        model.actuator_delay[:] = 0.0
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = models.initial_state(model, scenario)
        driven = model.actuator_ctrladr[drive_ids(model)]  # their places in ctrl
        dofs = dof_ids(model)
        _hold(model, data, driven, plant.name)
        block = rates(model, data)
    order = _order(model, dofs)
    n = len(order)
    a = block[:n, :n][np.ix_(order, order)]
    b = block[:n, n:][np.ix_(order, driven)]
    labels, drives = _labels(plant, model, order)
    return StateSpace(
        a,
        b,
        np.eye(plant.n, n),
        0.0,
        states=[*_of("x", labels), *_of("v", labels)],
        inputs=_of("u", drives),
        outputs=_of("x", channel_names(plant)),
        name=plant.name,
    )


def _order(model: mujoco.MjModel, dofs: Array) -> Array:
    """Return the indices of positions and then of velocities, those of channels first."""
    order = list(dofs)
    for i in range(model.nv):
        if i not in dofs:
            order.append(i)
    return np.concatenate([order, np.add(order, model.nv)])


def _labels(plant: Plant, model: mujoco.MjModel, order: Array) -> tuple[Names, Names]:
    """Return the names of what moves, in the order of the states, and of what drives it."""
    names = channel_names(plant)
    if plant.pose:
        return names, tuple(model.actuator(i).name for i in drive_ids(model))
    joints = []
    for i in order[: model.nv]:
        joints.append(model.joint(int(model.dof_jntid[i])).name)
    return tuple(joints), names[: plant.driven]


def _of(kind: str, names: Sequence[str]) -> list[str]:
    """Return the names of signals of one kind, such as x[hinge]."""
    return [f"{kind}[{name}]" for name in names]


def _hold(model: mujoco.MjModel, data: mujoco.MjData, commands: Array, name: str) -> None:
    """Set the numbers of ctrl that hold a mechanism at rest; raise ScenarioError if there are
    none.
    """
    last = 2 * model.nv + model.na
    b = rates(model, data)[model.nv : 2 * model.nv, last:][:, commands]
    mujoco.mj_forward(model, data)
    solution = np.linalg.lstsq(b, data.qacc)
    data.ctrl[commands] -= solution[0]
    mujoco.mj_forward(model, data)
    if np.abs(data.qacc).max() > MAX_REST_ACCELERATION:
        x = ", ".join(f"{position:g}" for position in data.qpos)
        raise ScenarioError(f"no command holds {name} at rest at x = {x}: give another x")


def rates(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Return d(rates) / d(positions, velocities, activations, commands) at `data`, square; rows of
    commands are 0.
    """
    nv = model.nv
    n = 2 * model.nv + model.na
    step = float(model.opt.timestep)
    point = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.ctrl.copy()
    model.opt.timestep = INSTANT_STEP  # the force of a drive is that at the end of a step

    def rates_at(offset: Array) -> Array:
        data.qpos[:], data.qvel[:], data.act[:], data.ctrl[:] = point
        mujoco.mj_integratePos(model, data.qpos, offset[:nv], 1.0)
        data.qvel[:] += offset[nv : 2 * nv]
        data.act[:] += offset[2 * nv : n]
        data.ctrl[:] += offset[n:]
        mujoco.mj_forward(model, data)
        return np.concatenate((data.qvel, data.qacc, data.act_dot))

    block = np.zeros((n + model.nu, n + model.nu))
    for i, offset in enumerate(DIFFERENCE_STEP * np.eye(n + model.nu)):
        difference = rates_at(offset) - rates_at(-offset)
        block[:n, i] = difference / (2.0 * DIFFERENCE_STEP)
    model.opt.timestep = step
    data.qpos[:], data.qvel[:], data.act[:], data.ctrl[:] = point
    return block
