"""The linear-quadratic regulator of a plant: of one channel by its f and g, or of the whole state
from finite differences of MuJoCo's step, with its contacts.
"""

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError, items_of, number, shown
from smc_mujoco.common.mjcb import installed
from smc_mujoco.control import nominal_gains
from smc_mujoco.control.law import Law
from smc_mujoco.control.written import state_feedback
from smc_mujoco.mechanisms.layout import dof_ids, drive_ids
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.scenario import Scenario

# in which a plant sinks into what it stands on: steps, and s of each; chosen
SINKING_STEPS = 3000
SINKING_STEP = 2e-3
MAX_REST_ACCELERATION = 0.05  # rad/s^2 or m/s^2: a larger one is no rest; chosen
# s, chosen: errors later than this count less. A base that nothing moves sideways, or turns, has
# states without end, and without this no finite cost
HORIZON = 20.0


def lqr(
    plant: Plant | str,
    q: Sequence[float] = (100.0, 16.0),
    r: float = 1.0,
    control_period: float = 1e-3,
) -> Law:
    """Return the linear-quadratic regulator of a plant at its goal.

        smc.run(smc.Scenario(plant="cart_pole", law=smc.design.lqr("cart_pole"), duration=1.0))

    Where every channel is driven, it is the law `lqr` of one channel, which minimises the integral
    of q[0] e^2 + q[1] de^2 + r u^2. Where joints or a base are only measured, it is u = -K (x - r,
    v - r') of all channels, with the sampled cost: the sum of q e^2 + q de^2 of all channels and r
    u^2. Its K is of finite differences of MuJoCo's step, with the contacts of the plant at rest.
    With a base, costs fade with a time constant of 20 s.

    Args:
      plant: a Plant or the name of one.
      q: weights of error and rate, the plant's units; or 2n, one for each channel's error, then one
        for each rate.
      r: weight of the control.
      control_period: s, of the runs; only used where channels are only measured.

    Returns:
      A Law with its gains.

    Raises:
      ScenarioError: a weight out of range, joints that are not measured, or a goal that is no rest
        without a command.
    """
    plant = as_plant(plant)
    q = items_of("q", q)
    if not plant.free:
        return nominal_gains.lqr(plant, (q[0], q[1]) if len(q) == 2 else q, r)  # pyright: ignore[reportArgumentType] refused there
    weights = [number("q", weight, low=0.0) for weight in q]
    if len(weights) not in (2, 2 * plant.n):
        raise ScenarioError(f"q is {shown(q)}: give two weights, or {2 * plant.n}")
    number("r", r, above=0.0)
    if len(weights) == 2:
        weights = [weights[0]] * plant.n + [weights[1]] * plant.n
    A, B = _sampled(plant, control_period)
    if plant.base >= 0:
        fading = math.exp(-0.5 * control_period / HORIZON)
        A *= fading
        B *= fading
    from scipy.linalg import solve_discrete_are

    R = r * np.eye(plant.driven)
    try:
        P = solve_discrete_are(A, B, np.diag(weights), R)
    except np.linalg.LinAlgError:
        raise ScenarioError(
            f"no command keeps {plant.name} at its goal: drive another joint, or give weights "
            "that are not 0"
        ) from None
    system = R + B.T @ P @ B
    gain = np.linalg.solve(system, B.T @ P @ A)
    return state_feedback(gain, "state_feedback")


def _sampled(plant: Plant, control_period: float) -> tuple[np.ndarray, np.ndarray]:
    """Return A and B of the errors and rates of all channels from sample to sample, at the goal."""
    rest = plant.rest or (0.0,) * plant.n
    goal = (*rest[: plant.driven], *(plant.goal or (0.0,) * plant.free))
    scenario = Scenario(
        plant=plant,
        law="none",
        x0=goal,
        integrator="implicitfast",
        control_period=control_period,
        duration=control_period,
    )
    with installed(None):
        model = models.with_values(models.compile_model(scenario), scenario)
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = models.initial_state(model, scenario)
        dofs = dof_ids(model)
        if model.nv > len(dofs) or model.na:
            raise ScenarioError(
                f"{plant.name} has joints or actuators whose state is not measured: name the "
                "joints in measured"
            )
        mujoco.mj_forward(model, data)
        if data.ncon:
            _sink(model, data)
        if np.abs(data.qacc).max() > MAX_REST_ACCELERATION:
            raise ScenarioError(
                f"{plant.name} does not rest at its goal without a command: give a law of your own"
            )
        step = np.zeros((2 * model.nv, 2 * model.nv))
        pushed = np.zeros((2 * model.nv, model.nu))
        mujoco.mjd_transitionFD(model, data, 1e-6, True, step, pushed, None, None)
    order = [*dofs, *(model.nv + dofs)]
    step = step[np.ix_(order, order)]
    columns = model.actuator_ctrladr[drive_ids(model)]
    pushed = pushed[np.ix_(order, columns)]
    A = np.eye(len(order))
    B = np.zeros_like(pushed)
    for _ in range(scenario.steps):
        A = step @ A
        B = step @ B + pushed
    return A, B


def _sink(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Let a plant sink, always from rest, until what it stands on carries it."""
    step = model.opt.timestep
    model.opt.timestep = SINKING_STEP
    for _ in range(SINKING_STEPS):
        data.qvel[:] = 0.0
        mujoco.mj_step(model, data)
    model.opt.timestep = step
    data.qvel[:] = 0.0
    mujoco.mj_forward(model, data)
