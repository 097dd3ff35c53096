"""Models are compiled whatever control callback is installed, by whichever thread, and no thread
waits forever.
"""

import ctypes
import dataclasses
import itertools
import os
import signal
import threading
import warnings

import mujoco
import numba
import numpy as np
import pytest
from helpers.commands import python
from helpers.pages import ROOT
from helpers.python_laws import acting
from numba import types

import smc_mujoco as smc
from smc_mujoco.common import libmujoco, mjcb
from smc_mujoco.common.jit import integers
from smc_mujoco.envs.gymnasium_env import PlantEnv
from smc_mujoco.envs.tasks import tasks, toppling
from smc_mujoco.envs.vector_env import BatchEnv
from smc_mujoco.mechanisms.custom.nominal_model import prepared
from smc_mujoco.simulation import callback, scenario_checks
from smc_mujoco.simulation import run as runs

pytestmark = pytest.mark.filterwarnings("ignore::smc_mujoco.simulation.run.PlainLoopWarning")

MODEL = """
<mujoco>
  <worldbody>
    <body><joint name="j" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 -.5" size=".03"/></body>
  </worldbody>
  <actuator><motor joint="j"/></actuator>
</mujoco>
"""
SPRINGS = {
    "plant": "pendulum_network",
    "law": "none",
    "mechanism": "springs",
    "mismatch": {"mass": 1.1},
    "duration": 0.003,
}

PLAY = {"actuator": smc.Backlash(gap=0.01)}


@pytest.fixture
def own(tmp_path):
    """A plant of a user's file."""
    (tmp_path / "own.xml").write_text(MODEL)
    return smc.plant_from(tmp_path / "own.xml", ["j"])


def run_of(law, plant="duffing", **fields):
    return smc.run(
        smc.Scenario(
            plant=plant,
            law=law,
            duration=0.003,
            **fields,
        )
    )


def still_of(trace, folder):
    return smc.film([trace], folder / "still.png", at=0.0)


# (own plant, a trace of it, folder) -> whether what is to come out did
COMPILES = {
    "a run of an own model": lambda own, trace, folder: (
        run_of("super_twisting", own).failure is None
    ),
    "an environment of an own model": lambda own, trace, folder: (
        len(PlantEnv(own).reset(seed=0)[0]) == 2
    ),
    "a batch of an own model": lambda own, trace, folder: (
        BatchEnv(own, num_envs=2).reset(seed=0)[0].shape == (2, 2)
    ),
    "a mechanism with mismatch": lambda own, trace, folder: (
        smc.Scenario(**SPRINGS).mechanism == "springs"
    ),
    "a picture": lambda own, trace, folder: still_of(trace, folder),
    "an own model again": lambda own, trace, folder: (
        smc.plant_from(own.build.source.path, ["j"], name="again").n == 1
    ),
    "a trace of an own model": lambda own, trace, folder: (
        smc.load(folder / "own.npz").scenario == trace.scenario
    ),
    "a plant's model": lambda own, trace, folder: own.load().nv == 1,
    "backlash": lambda own, trace, folder: (
        len(PlantEnv("duffing", changes=PLAY).reset(seed=0)[0]) == 2
    ),
    "a start among obstacles": lambda own, trace, folder: (
        run_of("none", contact="stops").failure is None
    ),
    "tasks of an own model": lambda own, trace, folder: "regulate" in tasks(own),
}


@pytest.mark.quick
@pytest.mark.parametrize("what", COMPILES)
def test_within_a_policy_every_model_compiles_and_the_run_goes_on(what, own, tmp_path):
    trace = run_of("none", own)
    trace.save(tmp_path / "own.npz")
    for callback_set in (
        scenario_checks.mechanism_model,
        prepared,
        toppling,
    ):  # as the first time in a process
        callback_set.cache_clear()
    calls = []
    masses = []

    def act(observation):
        calls.append(observation)
        if len(calls) == 2:
            masses.append(COMPILES[what](own, trace, tmp_path))
        return [-0.5 * observation[0]]

    def alone(observation):
        return [-0.5 * observation[0]]

    beside = run_of(acting(act))
    assert beside.failure is None
    assert all(masses)
    assert len(masses) == 1
    np.testing.assert_array_equal(beside.x, run_of(acting(alone)).x)


def in_thread(work):
    """Begin work in a thread; the event of its end."""
    done = threading.Event()

    def worked():
        work()
        done.set()

    threading.Thread(target=worked, daemon=True).start()
    return done


def test_another_thread_compiles_during_the_run_of_a_policy():
    policy_called = threading.Event()
    let = threading.Event()
    failures = []

    def act(observation):
        policy_called.set()
        assert let.wait(60)
        return [0.0]

    over = in_thread(lambda: failures.append(run_of(acting(act)).failure))
    assert policy_called.wait(60)
    assert in_thread(lambda: smc.plant("duffing").load()).wait(60)
    let.set()
    assert over.wait(60)
    assert failures == [None]


class Slow:
    """A spec that compiles until it is told to stop."""

    def __init__(self):
        self.begun = threading.Event()
        self.let = threading.Event()

    def compile(self):
        self.begun.set()
        assert self.let.wait(60)
        return mujoco.MjSpec().compile()


def test_a_model_that_does_not_compile_leaves_the_callback():
    def control(model, data):
        return None

    broken = mujoco.MjSpec()
    broken.worldbody.add_geom(size=(-1.0, 0.0, 0.0))
    with mjcb.installed(control):
        with pytest.raises(ValueError, match="size"):
            mjcb.compiled_spec(broken)
        assert mujoco.get_mjcb_control() is control
    assert in_thread(lambda: mjcb.compiled_spec(mujoco.MjSpec())).wait(60)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_a_forked_child_waits_for_no_thread_of_its_parent():
    slow = Slow()
    entered = threading.Event()
    leave = threading.Event()

    def hold():
        with callback.installed():
            entered.set()
            assert leave.wait(60)

    ends = in_thread(hold), in_thread(lambda: mjcb.compiled_spec(slow))  # pyright: ignore[reportArgumentType]
    assert entered.wait(60)
    assert slow.begun.wait(60)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of a fork beside threads
        child = os.fork()
    if child == 0:
        signal.alarm(30)  # ends it where it hangs
        own = mujoco.get_mjcb_control(), mujoco.get_mjcb_time()
        mjcb.compiled_spec(mujoco.MjSpec())
        with mjcb.installed(lambda model, data: None):
            mjcb.compiled_spec(mujoco.MjSpec())
        os._exit(
            7 if own == (mujoco.get_mjcb_control(), mujoco.get_mjcb_time()) == (None, None) else 8
        )
    leave.set()
    slow.let.set()
    for end in ends:
        assert end.wait(60)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_a_user_s_clock_is_kept_in_a_forked_child():
    mujoco.set_mjcb_time(foreign)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of a fork beside threads
            child = os.fork()
        if child == 0:
            os._exit(7 if mujoco.get_mjcb_time() is foreign else 8)
    finally:
        mujoco.set_mjcb_time(None)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7


IMPORTS = """
import threading, time, warnings
import smc_mujoco as smc
from helpers.python_laws import acting
warnings.simplefilter("ignore")
asked = threading.Event()
def other():
    asked.wait()
    import smc_mujoco.envs.vector_env
thread = threading.Thread(target=other)
thread.start()
def act(observation):
    if not asked.is_set():
        asked.set()
        time.sleep(0.5)
        import smc_mujoco.envs.vector_env
    return [0.0]
print(smc.run(smc.Scenario(plant="duffing", law=acting(act), duration=0.003)).failure)
thread.join()
"""


def test_a_policy_and_another_thread_may_import_the_batches_at_once():
    done = python("-c", IMPORTS, path=os.pathsep.join(map(str, (ROOT, ROOT / "tests"))))
    assert done.stdout == "None\n"
    assert done.stderr == ""


def foreign(*arguments):
    """A user's callback."""
    return 0.0


@pytest.mark.parametrize("name", [name for name in mjcb.CALLBACKS if name != "control"])
def test_a_user_s_other_callback_is_removed_in_a_run_and_restored(name):
    alone = run_of("classical")
    getattr(mujoco, f"set_mjcb_{name}")(foreign)
    try:
        beside = run_of("classical")
        assert getattr(mujoco, f"get_mjcb_{name}")() is foreign
    finally:
        getattr(mujoco, f"set_mjcb_{name}")(None)
    np.testing.assert_array_equal(beside.x, alone.x)


def test_timers_are_off_while_a_callback_is_installed_and_on_afterwards():
    model = smc.plant("duffing").load()
    inside = mujoco.MjData(model)
    after = mujoco.MjData(model)
    with mjcb.installed(None), mjcb.installed(None):
        mujoco.mj_step(model, inside)
    mujoco.mj_step(model, after)
    assert inside.timer.number.sum() == after.timer.number.sum() > 0
    assert inside.timer.duration.sum() == 0.0 < after.timer.duration.sum()


@pytest.mark.parametrize("control", [None, foreign], ids=["none", "a Python function"])
@pytest.mark.parametrize("at", [10, 15, 20])
def test_runs_whose_callback_is_taken_away_fail_from_there_on(control, at, monkeypatch):
    monkeypatch.setattr(runs, "SLICE_STEPS", 10)  # 5 of each of two runs
    two = [
        smc.Scenario(
            plant="duffing",
            law=smc.law("classical"),
            duration=0.02,
            seed=seed,
        )
        for seed in range(2)
    ]
    undisturbed = smc.run(two)
    done = []

    def report(steps):
        done.append(steps)
        if sum(done) == 2 * at:
            mujoco.set_mjcb_control(control)

    for i, trace in smc.stream(two, report=report):
        assert "took its control callback away" in (trace.failure or "")
        assert trace.diverged_at == pytest.approx(at * 1e-3)
        np.testing.assert_array_equal(trace.u[:at], undisturbed[i].u[:at])
        for array in (trace.x, trace.u, trace.d, trace.reaction):
            assert np.isnan(array[at:]).all()
    assert mujoco.get_mjcb_control() is None


@numba.cfunc(types.void(types.intp, types.intp))
def native(model, data):
    return


@numba.cfunc(types.int32(types.intp, types.intp, types.int32, types.int32))
def lets_touch(model, data, one, other):
    return 0


@pytest.mark.parametrize("law", ["compiled", "python"])
@pytest.mark.parametrize("name", ["passive", "sensor", "act_dyn", "contactfilter"])
def test_a_run_during_which_other_code_sets_any_callback_fails(name, law, monkeypatch):
    """Such a callback would change the forces of a run in silence."""
    scenario = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.2)
    foreign = (lets_touch if name == "contactfilter" else native).ctypes
    count = itertools.count()
    monkeypatch.setattr(runs, "SLICE_STEPS", 20)

    def set_it(*_):
        if next(count) == 3:
            getattr(mujoco, f"set_mjcb_{name}")(foreign)
        return [0.0]

    if law == "python":
        trace = smc.run(dataclasses.replace(scenario, law=acting(set_it)))
    else:
        ((_, trace),) = smc.stream([scenario], report=set_it)
    assert getattr(mujoco, f"get_mjcb_{name}")() is None
    assert (trace.failure or "").startswith("other code set a callback of MuJoCo's during the run")
    assert smc.run(scenario).failure is None


@pytest.mark.parametrize("integrator", ["RK4", "implicitfast"])
@pytest.mark.parametrize("name", ["passive", "act_gain", "contactfilter"])
def test_a_callback_that_is_set_and_cleared_within_a_slice_fails_the_run(name, integrator):
    """As a thread that does not wait for the run may do: at both ends of the slice there is none."""
    slots = {}
    for slot_name in ("passive", name):
        slots[slot_name] = ctypes.c_void_p.in_dll(libmujoco.library(), f"mjcb_{slot_name}")
    addresses = {slot_name: ctypes.addressof(slot) for slot_name, slot in slots.items()}
    calls = np.zeros(1, np.int64)
    calls_address, passive, slot_address = calls.ctypes.data, addresses["passive"], addresses[name]

    @numba.cfunc(types.void(types.intp, types.intp))
    def gone_after_ten_calls(model, data):
        integers(calls_address)[0] += 1
        if integers(calls_address)[0] == 10:
            integers(passive)[0] = integers(slot_address)[0] = 0

    count = itertools.count()

    def act(observation):
        if next(count) == 3:
            slots[name].value = lets_touch.address
            slots["passive"].value = gone_after_ten_calls.address
        return [0.0]

    law = acting(act)
    run = smc.Scenario(plant="duffing", law=law, duration=0.05, integrator=integrator)
    trace = smc.run(run)
    assert calls[0] == 10
    assert [slot.value for slot in slots.values()] == [None] * len(slots)
    assert (trace.failure or "").startswith("other code set a callback of MuJoCo's during the run")
    assert trace.diverged_at == pytest.approx(0.004)


@pytest.mark.parametrize("integrator", ["RK4", "Euler"])
def test_a_law_that_clears_the_callback_fails_its_run(integrator):
    count = itertools.count()

    def act(observation):
        if next(count) == 3:
            mujoco.set_mjcb_control(foreign)
            mujoco.set_mjcb_control(None)
        return [-0.5 * observation[0]]

    trace = smc.run(
        smc.Scenario(
            plant="duffing",
            law=acting(act),
            duration=0.02,
            integrator=integrator,
        )
    )
    assert "took its control callback away" in (trace.failure or "")
    assert trace.diverged_at == 0.0  # of its slice
    assert np.isnan(trace.x).all()


def test_a_run_reads_no_clock():
    assert mjcb.no_clock()() == 0.0
    with mjcb.installed(None):
        assert mujoco.get_mjcb_time() is mjcb.no_clock()
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    with mjcb.installed(None):
        mujoco.mj_step(model, data, 10)
    assert data.timer.duration.max() == 0.0
