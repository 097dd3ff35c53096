"""The control callback of a world that another engine steps: a run's samples, without its physics.

A run has two halves: what happens at a sample, and a physics step. Where a plant has no equation,
MuJoCo takes the steps, in thousands of worlds at once (see `warp`), and calls at each of their
stages what MuJoCo calls its control callback. That is composed here, of the same moments and in the
same order as the fast engine's loop. It reads a world's positions and velocities, and writes its
commands, and the disturbances on its joints.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import functools
from collections import namedtuple
from typing import Any, NamedTuple

import mujoco
import numpy as np

from smc_mujoco.analysis.engine import noise
from smc_mujoco.analysis.engine.advance import driving
from smc_mujoco.analysis.engine.calls import Compiler, View, compiled_once
from smc_mujoco.analysis.engine.form import (
    FAILED_STEP,
    FAILURE,
    SCORES,
    SETTING,
    UNDER_WAY,
    Form,
    Places,
    layout,
)
from smc_mujoco.analysis.engine.loop import moments, recording, remembering
from smc_mujoco.common.aliases import Array, ArrayPair
from smc_mujoco.common.jit import inlined, jit, pointer
from smc_mujoco.simulation.scenario import Resolved
from smc_mujoco.simulation.state import FINE, RAISED
from smc_mujoco.simulation.step import order

# What the callback reaches of a world, as pointers to numbers of any precision.
World = namedtuple("World", ("qpos", "qvel", "ctrl", "qfrc_applied"))


class WorldPlaces(NamedTuple):
    """Where a run's row has the numbers of its world, behind all that `layout` names. There are n
    of each, unless another count is given.
    """

    calls: int  # of the callback in a physics step; 1 number
    qpos: int  # index in the array of this name, as are the next two
    qvel: int
    ctrl: int  # only of channels that have an actuator
    scale: int  # control of the actuator per unit of u


class WorldRuns(NamedTuple):
    """Runs of one form, in worlds of one model. Row i is of scenario i, or of those in turn."""

    form: Form
    scenarios: list[Resolved]
    model: mujoco.MjModel  # without the values of a scenario
    tables: Array

    @property
    def calls(self) -> int:
        """How many times in a physics step the callback has to be called."""
        return calls_in_step(self.form, self.scenarios[0])

    def start(self, count: int) -> ArrayPair:
        """Return the state of runs and their scores so far, (runs, work_size) and (runs, SCORES +
        metrics).
        """
        width = SCORES + len(self.form.metrics)
        scores = np.full((count, width), np.nan)
        scores[:, FAILURE] = UNDER_WAY
        return np.zeros((count, work_size(self.form))), scores

    def states(self, rows: Array, qpos: Array, qvel: Array) -> ArrayPair:
        """Return the states at which the worlds of rows start, (worlds, nq) and (worlds, nv), given
        the model's.
        """
        places = world_places(self.form)[0]
        of_row = layout(self.form).row
        n = self.form.n
        pair = []
        for state, place, start in ((qpos, places.qpos, of_row.x0), (qvel, places.qvel, of_row.v0)):
            states = np.tile(state, (len(rows), 1))
            states[:, rows[0, place : place + n].astype(int)] = rows[:, start : start + n]
            pair.append(states)
        return pair[0], pair[1]


@functools.cache
def world_places(form: Form) -> tuple[WorldPlaces, int]:
    """Return the places of a world's numbers, and the size of a row."""
    row = Places(layout(form).row_size)
    places = WorldPlaces(row.take(), *(row.take(form.n) for _ in range(4)))
    return places, row.size


def work_size(form: Form) -> int:
    """Return how many numbers the state of a run has: those of its layout, and the count of calls
    so far.
    """
    return layout(form).work_size + 1


def calls_in_step(form: Form, s: Resolved) -> int:
    """Return how many times in a physics step the callback has to be called."""
    return s.stages if form.disturbances or form.drive else 1


def steps(rows: Array) -> int:
    """Return how many physics steps the longest run has."""
    steps = rows[:, SETTING.samples] * rows[:, SETTING.steps]
    return int(steps.max())


def controlling(form: Form, compile_user: Compiler) -> Any:
    """Return a compiled function (view, scores, world): the control callback of a world.

    The run has ended once its failure among the scores is not UNDER_WAY; then nothing acts.
    """
    begin, between = order(moments(form, compile_user, noise.drawn))
    remember = remembering(form)
    record = recording(form)
    act = _acting(form)
    release = _releasing(form)
    n = form.n
    places = world_places(form)[0]
    work_at = layout(form).work
    called = layout(form).work_size

    @inlined
    def control(view, scores, world):
        row, _, work = view
        if scores[FAILURE] != UNDER_WAY:
            release(view, world)
            return
        count = int(work[called])
        work[called] = count + 1.0
        calls = int(row[places.calls])
        step = count // calls
        stage = count - step * calls
        steps = int(row[SETTING.steps])
        k = step // steps
        within = step - k * steps
        for i in range(n):
            work[work_at.x + i] = world.qpos[int(row[places.qpos + i])]
            work[work_at.v + i] = world.qvel[int(row[places.qvel + i])]
        if stage == 0:
            if within == 0 and k > 0:  # at the end of its period: a sample may come late
                record(view, scores, scores, k - 1)
            scores[FAILED_STEP] = step
            remember(view, step)
            failure = begin(view, k, within, step)
        else:
            failure = between(view, k, within, stage)
        if failure != FINE:
            scores[FAILURE] = failure
        elif k == int(row[SETTING.samples]):
            record(view, scores, scores, k)
            scores[FAILURE] = FINE
        act(view, world, stage)

    return control


def _acting(form: Form) -> Any:
    """Return a function (view, world, stage): write the commands, and the disturbances."""
    driven = form.driven
    disturbed = bool(form.disturbances)
    drive = driving(form)
    places = world_places(form)[0]
    work_at = layout(form).work

    @inlined
    def act(view, world, stage):
        row, _, work = view
        for i in range(driven):
            u = drive(view, i, stage)
            world.ctrl[int(row[places.ctrl + i])] = row[places.scale + i] * u
            if disturbed:
                world.qfrc_applied[int(row[places.qvel + i])] = work[work_at.d + i]

    return act


def _releasing(form: Form) -> Any:
    """Return a function (view, world): let nothing act any more."""
    driven = form.driven
    places = world_places(form)[0]

    @inlined
    def release(view, world):
        for i in range(driven):
            world.ctrl[int(view.row[places.ctrl + i])] = 0.0
            world.qfrc_applied[int(view.row[places.qvel + i])] = 0.0

    return release


@functools.lru_cache(maxsize=64)
def compiled_callback(form: Form) -> Any:
    """Return the compiled callback of worlds on the processor, (count, addresses of rows, tables,
    work, scores, qpos, qvel, ctrl and qfrc_applied, numbers of qpos, qvel and ctrl in a world).
    """
    control = controlling(form, jit)
    row_bytes = 8 * world_places(form)[1]
    work_bytes = 8 * work_size(form)
    score_bytes = 8 * (SCORES + len(form.metrics))

    def worlds(count, rows, tables, work, scores, qpos, qvel, ctrl, qfrc_applied, nq, nv, nu):
        for i in range(count):
            view = View(
                pointer(rows + row_bytes * i), pointer(tables), pointer(work + work_bytes * i)
            )
            world = World(
                pointer(qpos + 8 * nq * i),
                pointer(qvel + 8 * nv * i),
                pointer(ctrl + 8 * nu * i),
                pointer(qfrc_applied + 8 * nv * i),
            )
            scores_of_world = pointer(scores + score_bytes * i)
            try:
                control(view, scores_of_world, world)
            except Exception:
                scores_of_world[FAILURE] = RAISED

    return compiled_once(worlds)
