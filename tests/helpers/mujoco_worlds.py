"""Worlds that MuJoCo steps on the processor, in double precision: what `world_callback` writes around
a physics step, without MuJoCo Warp.
"""

import mujoco
import numpy as np

from smc_mujoco.analysis.engine import world_callback
from smc_mujoco.analysis.engine.form import SETTING
from smc_mujoco.common import mjcb
from smc_mujoco.simulation.model import put_initial_state, with_values
from smc_mujoco.simulation.state import address


def run_rows(group, rows):
    """The scores of rows, (runs, SCORES + metrics), of the group's scenarios in turn."""
    runs = group.runs
    work, scores = runs.start(len(rows))
    control = world_callback.compiled_callback(runs.form)
    for i in range(len(rows)):
        scenario = runs.scenarios[i % len(runs.scenarios)]
        model = with_values(runs.model, scenario)
        data = mujoco.MjData(model)
        put_initial_state(model, data, scenario)
        (data.qpos[:],), (data.qvel[:],) = runs.states(rows[i : i + 1], data.qpos, data.qvel)
        of_run = [rows[i], runs.tables, work[i], scores[i]]
        places = list(map(address, (*of_run, data.qpos, data.qvel, data.ctrl, data.qfrc_applied)))
        stages = scenario.stages
        calls = [0]

        def callback(model, data, places=places, stages=stages, calls=calls):
            if calls[0] % stages < runs.calls:
                control(1, *places, 0, 0, 0)
            calls[0] += 1

        steps = int(rows[i, SETTING.samples] * rows[i, SETTING.steps])
        with mjcb.installed(callback):
            for _ in range(steps):
                mujoco.mj_step(model, data)
            mujoco.mj_forward(model, data)
    return np.array(scores)
