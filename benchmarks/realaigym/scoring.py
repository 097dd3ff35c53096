"""Criteria and scores of RealAIGym's simulation boards, of a run of pendubot or acrobot.

A run starts at rest, hanging, and lasts 10 s, with RK4 and a command every 2 ms. Sums leave out the
last sample, which
is only the end of the last step:

    swing-up time       first t from which the tip stays above 0.9 (l1 + l2), else failed
    energy              sum |dq tau|, with dq the step of the driven joint
    max torque          max |tau|
    integrated torque   sum |tau| dt
    torque cost         sum tau^2 dt
    torque smoothness   standard deviation of the steps of tau
    velocity cost       sum (q1'^2 + q2'^2) dt

    v1:  score = 1 - sum w c / n,                 w/n of the seven criteria as in V1
    v2:  score = 1 - (1/5) sum tanh(pi c / n),    of five criteria, n as in V2

A failed run scores 0. Source: src/python/double_pendulum/analysis/leaderboard.py and
leaderboard/*/simulation_v* of github.com/dfki-ric-underactuated-lab/double_pendulum (BSD-3-Clause),
rewritten here.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from realaigym.published import Row
from smc_mujoco.common.errors import find, number
from smc_mujoco.mechanisms.plants.double_pendulum import L2
from smc_mujoco.simulation.trace import Trace

MIN_TIP_HEIGHT = 0.9  # of the length of both links, which the tip must exceed
# Criterion -> weight and norm in version 1, norm in version 2.
V1 = {
    "swing_up_time": (0.2, 10.0),
    "max_torque": (0.1, 6.0),
    "energy": (0.1, 100.0),
    "integrated_torque": (0.1, 60.0),
    "torque_cost": (0.1, 360.0),
    "torque_smoothness": (0.2, 12.0),
    "velocity_cost": (0.2, 1000.0),
}
V2 = {
    "swing_up_time": 20.0,
    "energy": 60.0,
    "torque_cost": 20.0,
    "torque_smoothness": 0.1,
    "velocity_cost": 400.0,
}
VERSIONS = {"v1": V1, "v2": V2}
ROBOTS = ("acrobot", "pendubot")


class Criteria(NamedTuple):
    """Criteria of a run, SI units. The swing-up time of a run that failed is inf."""

    swing_up_time: float
    energy: float
    max_torque: float
    integrated_torque: float
    torque_cost: float
    torque_smoothness: float
    velocity_cost: float

    @property
    def success(self) -> bool:
        """Whether the tip was up, and stayed up to the end."""
        return math.isfinite(self.swing_up_time)


def shoulder_first(robot: str) -> list[int]:
    """Return the channels of shoulder and elbow.

    Raise ScenarioError for another plant than pendubot and acrobot.
    """
    return find("robot of the boards", robot, {"acrobot": [1, 0], "pendubot": [0, 1]})


def criteria(trace: Trace) -> Criteria:
    """Return the criteria of a run of pendubot or acrobot; all are inf for a run that diverged.

    Raises:
      ScenarioError: another plant.
    """
    plant = trace.scenario.plant
    joints = shoulder_first(plant.name)
    if trace.failure is not None:
        return Criteria(*[math.inf] * len(Criteria._fields))
    q = trace.x[:, joints]
    v = trace.v[:, joints]
    u = trace.u[:, 0]
    t = trace.t
    l1 = plant.parameters["l1"]
    tip = -l1 * np.cos(q[:, 0]) - L2 * np.cos(q[:, 0] + q[:, 1])
    # as published: first and last left out
    low = np.flatnonzero(tip[1:-1] <= MIN_TIP_HEIGHT * (l1 + L2)) + 1
    first = low[-1] + 1 if len(low) else 1
    step = np.diff(t)
    torque = np.abs(u[:-1])
    return Criteria(
        swing_up_time=float(t[first]) if first < len(t) - 1 else math.inf,
        energy=float(np.sum(np.abs(np.diff(trace.x[:, 0])) * torque)),
        max_torque=float(np.abs(u).max()),
        integrated_torque=float(np.sum(torque * step)),
        torque_cost=float(np.sum(torque**2 * step)),
        torque_smoothness=float(np.std(np.diff(u))),
        velocity_cost=float(np.sum(v[:-1] ** 2 * step[:, None])),
    )


def score(run: Trace | Mapping[str, Any] | Criteria | Row, version: str = "v2") -> float:
    """Return the score of a run, in 0 .. 1, or of criteria by name, such as those of a published
    row.

    Raises:
      ScenarioError: an unknown version, a criterion that is missing, or another plant.
    """
    if isinstance(run, Trace):
        run = criteria(run)
    values = run if isinstance(run, Mapping) else run._asdict()
    for name in find("version of the board", version, VERSIONS):
        number(f"criterion {name}", values.get(name), low=0.0, infinite=True)
    if not math.isfinite(values["swing_up_time"]):
        return 0.0
    if version == "v1":
        return 1.0 - sum(weight * values[name] / norm for name, (weight, norm) in V1.items())
    penalties = [math.tanh(math.pi * values[name] / norm) for name, norm in V2.items()]
    return 1.0 - sum(penalties) / len(V2)
