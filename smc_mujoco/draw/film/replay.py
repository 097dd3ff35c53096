"""The whole pose of a mechanism over a run, of which a trace has the channels only: the run is simulated again."""

import numpy as np

from smc_mujoco.simulation import callback, state
from smc_mujoco.simulation.batch import ScenarioBatch
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.simulation.trace import Trace


def poses(trace: Trace, times: np.ndarray) -> np.ndarray | None:
    """Return qpos at times in s, (times, nq), each at the physics step before; after a failure the last one.

    None: the law or a signal does not compile, and the run would take long.
    """
    prepared = prepare(trace.scenario)
    if prepared.why_not:
        return None
    scenario = trace.scenario.resolved
    total, jump = scenario.samples * scenario.steps, scenario.jump_step
    wanted: list[int] = np.clip(np.floor(times / scenario.physics_step + 1e-6).astype(int), 0, total).tolist()
    found: dict[int, np.ndarray] = {}
    ends: list[int] = sorted({*wanted, *([jump] if 0 < jump < total else [])})
    step = 0
    with callback.installed():
        batch = ScenarioBatch([prepared], threads=1)
        qpos = batch.batch.bind("qpos")
        last = qpos[0].copy()
        for end in ends:
            batch.advance(end - step, lambda steps: None)
            step = end
            if step == jump:
                batch.set_parameters(step, [0])
            if batch.records["failure"][0] == state.FINE:
                last = qpos[0].copy()
            found[end] = last
    return np.array([found[end] for end in wanted])
