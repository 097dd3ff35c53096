"""The boards of 2025 (version 3): a minute in which the machine is carried off 15 times, and has to
come back.

    score = time with the tip above 0.9 (l1 + l2), over 60 s

The machine starts at rest, hanging. At 15 times, 3.75 k s +- 1 s, a PID with gravity compensation
drives both joints for 0.2 s towards angles in -pi .. pi, without setting the state; then the law
acts again. It is not told, and is not asked meanwhile. Nothing counts but the time above the line,
resets included. A swing-up is a rise above it, more than 1 s after the last one that counted.

The published simulator is repeated: RK4 and commands at 2 ms, no noise, no friction, t summed step
by step, by which resets begin; a derivative of the PID for a period of 1 ms, its sums kept from
reset to reset; its gravity compensation after its limit and before that of the motors. Times and
goals are drawn by numpy's legacy generator as today's code draws them; the published rows were made
by an earlier one, on resets that differ from row to row. So what is told of a law is its mean over
seeds. The machine is chaotic: differences below 0.08 mean nothing, see docs/boards.md. Source:
leaderboard/*/simulation_v3, controller/global_policy_testing_controller.py and controller/pid of
github.com/dfki-ric-underactuated-lab/double_pendulum (BSD-3-Clause), rewritten here.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from realaigym.published import GlobalRow
from realaigym.scoring import MIN_TIP_HEIGHT
from realaigym.simulator import (
    DT,
    LIMIT,
    MEASUREMENT_SIZE,
    ROOM,
    STEP,
    USES_MODEL,
    Machine,
    T,
    answered,
    stepped,
)
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.interrupts import delay_signals
from smc_mujoco.mechanisms.plants.double_pendulum import L2, MODEL_1_1, TORQUE_LIMIT
from smc_mujoco.simulation.scenario import Scenario

DURATION = 60.0
STEPS = 30_000
SEEDS = (0, 1, 2, 3)
RESETS, RESET_TIME, APART = 15, 0.2, 1.0  # of a minute; s; s, between two swing-ups that count
# N m/rad, N m/(rad s), N m s/rad; s, which is not the step
KP, KI, KD, PID_PERIOD = 10.0, 0.1, 1.0, 1e-3
# kg m, of the shoulder's gravity
LEVER = MODEL_1_1["m1"] * MODEL_1_1["r1"] + MODEL_1_1["m2"] * MODEL_1_1["l1"]


class Run(NamedTuple):
    """A minute: states (q1, q2, q1', q2'), (30001, 4), and the torques of shoulder and elbow, N m,
    (30000, 2).
    """

    states: np.ndarray
    torques: np.ndarray

    @property
    def up(self) -> np.ndarray:
        """Whether the tip is above the line, (30001,)."""
        l1, (q1, q2) = MODEL_1_1["l1"], self.states[:, :2].T
        return -l1 * np.cos(q1) - L2 * np.cos(q1 + q2) > MIN_TIP_HEIGHT * (l1 + L2)

    @property
    def uptime(self) -> float:
        """Time with the tip above the line, s."""
        return float(STEP * self.up.sum())

    @property
    def swing_ups(self) -> int:
        """How often the tip rose above the line."""
        count = 0
        last = -math.inf
        for rise in STEP * (np.flatnonzero(np.diff(self.up)) + 1)[::2]:
            if rise - last > APART:
                count, last = count + 1, rise
        return count


def resets(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the times at which resets begin, s, (15,), and the angles that they aim at, rad, (15,
    2).
    """
    rng = np.random.RandomState(seed)
    states = rng.uniform(0.0, 2.0 * math.pi, (10 * RESETS + 1, 4)) - math.pi
    times = DURATION / (RESETS + 1) * np.arange(1, RESETS + 1) + 2.0 * (rng.rand(RESETS) - 0.5)
    return times, states[:RESETS, :2].copy()


def minute(scenario: Scenario, seed: int) -> Run:
    """Return the minute of a law, and its estimator, with the resets of a seed.

    Raises:
      ScenarioError: as `robustness`.
    """
    machine, (times, goals) = Machine(scenario), resets(seed)
    run = Run(np.zeros((STEPS + 1, 4)), np.zeros((STEPS, 2)))
    with delay_signals():  # numba may compile it now
        raised = _minute(
            *machine.start(),
            machine.driven,
            machine.limit,
            machine.uses_model,
            times,
            goals,
            run.states,
            run.torques,
        )
    if raised:
        raise ScenarioError(
            "the law raised an exception on the board of 2025: run it in a scenario"
        )
    return run


def global_row(name: str, scenario: Scenario, seeds: Sequence[int] = SEEDS) -> GlobalRow:
    """Return a law's row of the board of 2025: means over the resets of some seeds."""
    runs = [minute(scenario, seed) for seed in seeds]
    swing_ups, uptime = (
        float(np.mean(values))
        for values in zip(*((r.swing_ups, r.uptime) for r in runs), strict=True)
    )
    return GlobalRow(name, swing_ups, uptime, uptime / DURATION)


@njit(error_model="numpy")
def _minute(
    functions,
    gains,
    tuning,
    memory,
    memories,
    known,
    driven,
    limit,
    uses_model,
    times,
    goals,
    states,
    torques,
):
    """Run a minute; states and torques are written.

    Return whether the law or its estimator raised an exception.
    """
    x = (0.0, 0.0, 0.0, 0.0)
    seen = np.zeros(4)
    y = np.zeros(MEASUREMENT_SIZE)
    room = np.zeros(ROOM)
    y[DT], y[LIMIT], y[USES_MODEL] = STEP, limit, uses_model
    total = np.zeros(2)
    before = np.zeros(2)
    count = 0
    resets_done = 0
    u = np.zeros(2)
    t = 0.0
    last = 0.0
    since = 0.0
    pushed = False
    for k in range(len(torques)):
        if not pushed and resets_done < len(times) and t >= times[resets_done]:
            pushed, since, resets_done = True, 0.0, resets_done + 1
        if pushed and since > RESET_TIME:
            pushed = False
        if pushed:
            count += 1
            outer = known[13] * known[1] * known[4] * math.sin(x[0] + x[1])
            gravity = (known[13] * LEVER * math.sin(x[0]) + outer, outer)
            for joint in range(2):
                error = goals[resets_done - 1, joint] - x[joint]
                total[joint] += error
                if count > 2:
                    rate = (error - before[joint]) / PID_PERIOD
                else:
                    rate = 0.0
                torque = KP * error + KI * PID_PERIOD * total[joint] + KD * rate
                before[joint] = error
                torque = min(max(torque, -TORQUE_LIMIT), TORQUE_LIMIT) + gravity[joint]
                u[joint] = min(max(torque, -TORQUE_LIMIT), TORQUE_LIMIT)
            since += t - last
        else:
            seen[0], seen[1], seen[2], seen[3] = x
            y[T] = t
            torque, raised = answered(
                functions, gains, tuning, memory, memories, known, driven, seen, y, room
            )
            if raised:
                return True
            u[driven], u[1 - driven] = min(max(torque, -limit), limit), 0.0
        last = t
        torques[k] = u
        x = stepped(x, u[0], u[1], known)
        states[k + 1, 0], states[k + 1, 1], states[k + 1, 2], states[k + 1, 3] = x
        if not abs(x[2]) + abs(x[3]) < 1e6:
            states[k + 1 :] = math.inf
            return False
        t += STEP
    return False
