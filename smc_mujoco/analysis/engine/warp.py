"""Worlds that MuJoCo Warp steps, in single precision, on a CUDA device.

Its control callback is that of `world_callback`, in double precision: it reads positions and
velocities where MuJoCo Warp has them, and writes commands there. It needs the packages mujoco-warp
and numba-cuda: `pip install 'smc-mujoco[gpu]'`. Tests run it on MuJoCo Warp's processor device.
"""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false
import copy
import functools
import warnings
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.analysis.engine import world_callback
from smc_mujoco.analysis.engine.form import FAILURE, UNDER_WAY
from smc_mujoco.analysis.engine.world_callback import WorldRuns
from smc_mujoco.common.aliases import Array
from smc_mujoco.common.errors import ScenarioError, ScenarioWarning, users_stacklevel
from smc_mujoco.common.extras import extra
from smc_mujoco.mechanisms.plant import field_array
from smc_mujoco.simulation.model import Mechanism, field_values, mechanism, put_initial_state
from smc_mujoco.simulation.run import DRY_FRICTION
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.state import address

with extra("gpu", "device 'cuda' for a plant that MuJoCo runs"):
    import mujoco_warp
    import warp

warp.config.log_level = warp.LOG_WARNING
PIECE = 2**18  # worlds at once; chosen
# Contacts for which a world has room at first, and at most. If some do not fit, all runs are
# repeated with twice the room; chosen.
CONTACTS = 16
MOST_CONTACTS = 1024
ROWS_OF_EQUALITY = 6  # of a weld, which has the most
# what mj_setConst computes of the fields that a scenario sets, of those that MuJoCo Warp has
DERIVED = (
    "body_subtreemass",
    "body_invweight0",
    "dof_invweight0",
    "tendon_length0",
    "tendon_invweight0",
    "actuator_acc0",
)
FULL = (
    mujoco_warp.OverflowType.NEFC
    | mujoco_warp.OverflowType.NJMAX_NNZ
    | mujoco_warp.OverflowType.BROADPHASE
    | mujoco_warp.OverflowType.NARROWPHASE
    | mujoco_warp.OverflowType.CCD
    | mujoco_warp.OverflowType.HFIELD
)


def why_not(scenario: Scenario) -> str:
    """Return why MuJoCo Warp cannot run the model of a scenario, in one sentence; "" if it can."""
    shared = mechanism(scenario)
    if reason := _refused(shared):
        return reason
    for name in field_values(shared.model, scenario, 0):
        if not (_of_sensors(name) or _batched(name)):
            return f"MuJoCo Warp has one {name} for all worlds"
    return ""


@functools.lru_cache(maxsize=32)
def _refused(shared: Mechanism) -> str:
    try:
        mujoco_warp.put_model(_for_warp(shared.model))
    except (NotImplementedError, ValueError) as error:
        return f"MuJoCo Warp cannot run its model: {str(error).rstrip('.')}"
    return ""


def _of_sensors(name: str) -> bool:
    """Return whether a field is of MuJoCo's sensors, which the callback does without."""
    return name.startswith("sensor_")


def _batched(name: str) -> bool:
    """Return whether MuJoCo Warp has a field for each world."""
    kind = mujoco_warp.Model
    if name.startswith("opt."):
        kind = mujoco_warp.Option
    spec = kind.__annotations__.get(name.rpartition(".")[2])
    return getattr(spec, "shape", ())[:1] == ("*",)


def _for_warp(base: mujoco.MjModel) -> mujoco.MjModel:
    """Return a copy of a model without what MuJoCo Warp lacks and what the callback does not
    need.
    """
    model = copy.copy(base)
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
    return model


def run_rows(runs: WorldRuns, rows: Array, device: str = "cuda") -> Array:
    """Return the scores of rows, (runs, SCORES + metrics); NaN after a failure. Row i has the
    model of scenario i, or of those in turn.

    Raises:
      ScenarioError: its contacts do not fit into MOST_CONTACTS a world.
    """
    rows = np.ascontiguousarray(rows)
    members = np.arange(len(rows)) % len(runs.scenarios)
    scores_by_piece = []
    with warp.ScopedDevice(device):
        for first in range(0, len(rows), PIECE):
            piece = slice(first, first + PIECE)
            scores_by_piece.append(_run(runs, rows[piece], members[piece]))
    return np.concatenate(scores_by_piece)


def _run(runs: WorldRuns, rows: Array, members: Array) -> Array:
    """Return the scores of as many rows as are run at once, with room for all contacts."""
    values = values_of(runs)
    contacts = CONTACTS
    while True:
        model, data = worlds_of(runs, rows, members, values, contacts)
        scores = _stepped(runs, rows, model, data)
        if not np.any(data.overflow.numpy() & FULL):
            return scores
        contacts *= 2
        if contacts > MOST_CONTACTS:
            raise ScenarioError(
                f"{runs.scenarios[0].plant.name} has more contacts than MuJoCo Warp has room "
                f"for, {MOST_CONTACTS} a world: give device 'cpu'"
            )


def values_of(runs: WorldRuns) -> dict[str, Array]:
    """Return the fields of the model that a scenario sets, with what MuJoCo derives from them,
    (scenarios, ...) each.
    """
    base = runs.model
    model = copy.copy(base)
    data = mujoco.MjData(model)
    values_by_scenario = [field_values(base, s, 0) for s in runs.scenarios]
    names = set()
    for values in values_by_scenario:
        for name in values:
            if not _of_sensors(name):
                names.add(name)
    if not names:
        return {}
    arrays: dict[str, list[Array]] = {name: [] for name in sorted(names.union(DERIVED))}
    for values in values_by_scenario:
        for name in names:
            values_of_field = values.get(name, field_array(base, name))
            field_array(model, name)[:] = values_of_field
        mujoco.mj_setConst(model, data)
        for name, of_each in arrays.items():
            of_each.append(field_array(model, name).copy())
    return {name: np.array(of_each) for name, of_each in arrays.items()}


def worlds_of(
    runs: WorldRuns, rows: Array, members: Array, values: dict[str, Array], contacts: int
) -> tuple[Any, Any]:
    """Return MuJoCo Warp's model and data of the worlds of rows, at their start."""
    host = _for_warp(runs.model)
    for name, of_each in values.items():
        # MuJoCo Warp checks whether there is any dry friction
        field_array(host, name)[:] = of_each.max(axis=0) if name in DRY_FRICTION else of_each[0]
    varying = {}
    for name, of_each in values.items():
        if np.any(of_each != of_each[0]) or name in DRY_FRICTION:
            varying[name] = of_each
    sizes = {}
    for name in varying:
        if not name.startswith("opt."):
            sizes[name] = len(rows)
    model = mujoco_warp.put_model(host, batch_sizes=sizes)
    for name, of_each in varying.items():
        _put(model, name, of_each[members])
    start = mujoco.MjData(host)
    put_initial_state(host, start, runs.scenarios[0])
    room = _room(host, contacts)
    data = mujoco_warp.put_data(host, start, nworld=len(rows), **room)
    for array, states in zip(
        (data.qpos, data.qvel), runs.states(rows, start.qpos, start.qvel), strict=True
    ):
        array.assign(states.astype(np.float32))
    return model, data


def _put(model: Any, name: str, values: Array) -> None:
    """Write a field of every world, (worlds, ...)."""
    owner = model
    if name.startswith("opt."):
        owner = model.opt
    field = name.rpartition(".")[2]
    array = getattr(owner, field)
    rest = array.numpy().shape[1:]
    shape = (len(values), *rest)
    shaped = values.reshape(shape)
    setattr(owner, field, warp.array(shaped, dtype=array.dtype))


def _room(model: mujoco.MjModel, contacts: int) -> dict[str, int]:
    """Return how many contacts and rows of constraints a world gets room for.

    With none, MuJoCo Warp leaves its solver out.
    """
    flags = mujoco.mjtDisableBit
    off = model.opt.disableflags
    collides = np.any(model.geom_contype) and np.any(model.geom_conaffinity)
    touching = model.npair or collides
    if not touching or off & flags.mjDSBL_CONTACT:
        contacts = 0
    rows = ROWS_OF_EQUALITY * model.neq
    rows += np.count_nonzero(model.jnt_limited) + 2 * np.count_nonzero(model.tendon_limited)
    if not off & flags.mjDSBL_FRICTIONLOSS:
        for name in DRY_FRICTION:
            rows += np.count_nonzero(getattr(model, name))
    of_contact = 2 * max(1, *model.geom_condim, *model.pair_dim) if contacts else 0
    return {"nconmax": contacts, "njmax": int(rows + of_contact * contacts)}


def _stepped(runs: WorldRuns, rows: Array, model: Any, data: Any) -> Array:
    """Return the scores of worlds, stepped to the end of the longest run."""
    callback = _OnCard if warp.get_device().is_cuda else _OnProcessor
    called = callback(runs, rows, data)
    stages = runs.scenarios[0].stages
    calls = 0

    def control(model, data):
        nonlocal calls
        if calls % stages < runs.calls:
            called()
        calls += 1

    model.callback.control = control
    step = functools.partial(mujoco_warp.step, model, data)
    steps = world_callback.steps(rows)
    if steps:
        step()  # MuJoCo Warp compiles its kernels
        step = called.captured(step)
        calls -= calls % stages  # of a step that CUDA captured in part
    for _ in range(steps - 1):
        step()
    called()  # the last sample, at the end of the run
    scores = called.scores()
    if np.any(scores[:, FAILURE] == UNDER_WAY):
        raise ScenarioError(
            "MuJoCo Warp did not call the control callback at every step: give device 'cpu'"
        )
    return scores


class _OnProcessor:
    """The callback on MuJoCo Warp's processor device, for tests."""

    def __init__(self, runs: WorldRuns, rows: Array, data: Any):
        self.control = world_callback.compiled_callback(runs.form)
        self.theirs = [data.qpos, data.qvel, data.ctrl, data.qfrc_applied]
        self.mine = [array.numpy().astype(float) for array in self.theirs]
        self.sizes = [array.shape[1] for array in self.mine[:3]]
        self.rows = rows
        self.tables = runs.tables
        self.work, self.kept = runs.start(len(rows))

    def __call__(self) -> None:
        for mine, theirs in zip(self.mine, self.theirs, strict=True):
            mine[:] = theirs.numpy()
        arrays = self.rows, self.tables, self.work, self.kept, *self.mine
        self.control(len(self.rows), *map(address, arrays), *self.sizes)
        for mine, theirs in zip(self.mine[2:], self.theirs[2:], strict=True):
            theirs.assign(mine.astype(np.float32))

    def captured(self, step: Callable[[], None]) -> Callable[[], None]:
        return step

    def scores(self) -> Array:
        return self.kept


class _OnCard:
    """The callback on a CUDA device, one thread per world, on MuJoCo Warp's stream."""

    def __init__(self, runs: WorldRuns, rows: Array, data: Any):
        from smc_mujoco.analysis.engine import gpu

        work, scores = runs.start(len(rows))
        stream = gpu.cuda.external_stream(warp.get_stream().cuda_stream)
        kernel = gpu.compiled_control(runs.form)
        self.launch = kernel[-(-len(rows) // gpu.THREADS), gpu.THREADS, stream]
        self.numbers = [gpu.cuda.to_device(array) for array in (rows, runs.tables, work)]
        self.kept = gpu.cuda.to_device(scores)
        self.theirs = []
        for array in (data.qpos, data.qvel, data.ctrl, data.qfrc_applied):
            self.theirs.append(gpu.cuda.as_cuda_array(array, sync=False))

    def __call__(self) -> None:
        self.launch(*self.numbers, self.kept, *self.theirs)

    def captured(self, step: Callable[[], None]) -> Callable[[], None]:
        """Return a step as one launch of a CUDA graph; as it is if CUDA cannot capture one."""
        try:
            with warp.ScopedCapture(capture_mode=warp.CaptureMode.RELAXED) as capture:
                step()
        except Exception as error:  # the device's driver decides
            warnings.warn(
                f"CUDA could not capture a graph of a step, so runs are slower: {error}",
                ScenarioWarning,
                users_stacklevel(),
            )
            return step
        return functools.partial(warp.capture_launch, capture.graph)

    def scores(self) -> Array:
        warp.synchronize()
        return self.kept.copy_to_host()
