"""What `run` takes and gives, and that no failing run is silent or harms another."""

# pyright: reportOperatorIssue=false, reportOptionalOperand=false
import dataclasses
import functools
import json
import math
import re
import signal
import sys
import threading
import time

import mujoco
import numpy as np
import pytest
from helpers.commands import python
from helpers.runs import made, plainly, same, scenario

import smc_mujoco as smc
from smc_mujoco.analysis.engine.group import FormGroup
from smc_mujoco.common import attended
from smc_mujoco.common.jit import integers
from smc_mujoco.simulation import callback
from smc_mujoco.simulation import run as runs

UNSTABLE = smc.plant("duffing", alpha=-1e6, beta=0.0)  # grows by e in a millisecond
LOGGED = ("x", "v", "u", "applied", "s", "d")
ARRAYS = (*LOGGED, "r")


NO_ROWS = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT.value


@pytest.mark.quick
@pytest.mark.parametrize(
    ("fields", "may"),
    [
        ({"plant": "duffing"}, False),
        ({"plant": "pendulum_network"}, False),
        ({"plant": "cart_pole"}, False),
        ({"plant": "duffing", "contact": "stops"}, True),
        ({"plant": "duffing", "actuator": smc.Backlash(gap=0.01)}, True),
        ({"plant": "duffing", "friction": smc.Coulomb(0.3)}, False),  # the callback has it
        (
            {
                "plant": "duffing",
                "friction": smc.Coulomb(0.3),
                "integrator": "implicitfast",
            },
            True,
        ),
        ({"plant": "servo_axis"}, True),  # it has its own dry friction
        ({"plant": "panda", "law": "none"}, True),
    ],
)
def test_models_that_can_have_no_constraint_look_for_none_and_no_bit_changes(
    fields, may, monkeypatch
):
    scenarios = []
    for seed in (0, 1):
        scenarios.append(
            smc.Scenario(**{"law": smc.law("classical"), "duration": 0.2} | fields, seed=seed)
        )
    flags = []
    may_have = runs.ScenarioBatch.may_have_constraints
    monkeypatch.setattr(
        runs.ScenarioBatch,
        "may_have_constraints",
        lambda batch: flags.append(may_have(batch)) or flags[-1],
    )
    quick = smc.run(scenarios)
    assert flags == [may]
    monkeypatch.setattr(runs.ScenarioBatch, "may_have_constraints", lambda batch: True)
    for quickly, slowly in zip(quick, smc.run(scenarios), strict=True):
        for name in (*ARRAYS, "force", "reaction"):
            np.testing.assert_array_equal(getattr(quickly, name), getattr(slowly, name))


def test_dry_friction_of_any_run_of_a_batch_keeps_the_constraints():
    common = {
        "plant": "duffing",
        "law": smc.law("classical"),
        "integrator": "implicitfast",
        "duration": 0.01,
    }
    none, with_friction = (
        runs.prepare(smc.Scenario(**common, friction=smc.Coulomb(force))) for force in (0.0, 0.3)
    )
    with callback.installed():
        for prepared, may in (
            ([none, none], False),
            ([none, with_friction], True),
            ([with_friction, none], True),
        ):
            batch = runs.ScenarioBatch(prepared, 1)
            assert bool(batch.model.opt.disableflags & NO_ROWS) is not may


def failed(trace, at: float, *words: str):
    """The trace failed at a time in s, said so in one sentence, and holds numbers before and NaN
    after.
    """
    assert trace.diverged_at == pytest.approx(at, abs=1e-9)
    assert trace.failure.endswith(f"at t = {at:g} s")
    assert "\n" not in trace.failure
    for word in words:
        assert word in trace.failure
    before = trace.t < at - 1e-9
    for name in LOGGED:
        array = getattr(trace, name)
        assert np.isfinite(array[before]).all(), name
        assert np.isnan(array[~before]).all(), name


# what goes in and comes out


def test_plants_sizes_and_durations_mix_in_one_call():
    many = [
        scenario(plant="duffing"),
        scenario(plant=smc.plant("pendulum_network", n=2)),
        scenario(plant=smc.plant("pendulum_network", n=3)),
        scenario(plant="duffing", duration=0.03),
        scenario(plant="duffing", control_period=2e-3),
        scenario(plant="duffing", physics_step=5e-4),
    ]
    traces = smc.run(many)
    assert [len(trace.t) for trace in traces] == [21, 21, 21, 31, 11, 21]
    for trace, scenario_of_trace in zip(traces, many, strict=True):
        assert same(trace, smc.run(scenario_of_trace))


# failures


@pytest.mark.parametrize("integrator", ["RK4", "Euler", "implicitfast", "implicit"])
def test_an_unstable_plant_is_marked_with_the_time_at_which_it_left(integrator):
    trace = smc.run(scenario("none", plant=UNSTABLE, integrator=integrator))
    failed(trace, trace.diverged_at, "the plant diverged")
    assert 0.0 < trace.diverged_at < 0.02
    assert np.abs(trace.x[trace.t < trace.diverged_at - 1e-9]).max() < 1e6


def test_a_failure_between_two_samples_is_timed_to_the_physics_step():
    trace = smc.run(scenario("none", plant=UNSTABLE, control_period=0.01, physics_step=1e-3))
    finer = smc.run(scenario("none", plant=UNSTABLE))
    failed(trace, finer.diverged_at)
    assert trace.diverged_at % 0.01 > 1e-9


def test_a_failed_run_has_no_reference_from_then_on_either():
    trace = smc.run(scenario("none", plant=UNSTABLE, reference=smc.Constant(0.5)))
    np.testing.assert_array_equal(trace.r, np.where(np.isnan(trace.x), np.nan, 0.5))


def test_a_state_that_starts_outside_the_world_has_diverged_at_once():
    failed(smc.run(scenario(x0=1e6)), 0.0, "the plant diverged")


RETURNS = {
    "text": lambda y, gains, memory: ("a", "b"),
    "complex": lambda y, gains, memory: (1j, 0.0),
    "arrays": lambda y, gains, memory: (np.zeros(2), 0.0),
    "memory": lambda y, gains, memory: memory,
    "huge": lambda y, gains, memory: (json.loads("1") * 10**400, 0.0),
}


@pytest.mark.parametrize("name", RETURNS)
def test_a_law_that_returns_the_wrong_thing_is_named(name, capfd):
    failed(
        plainly(scenario(made(RETURNS[name]))),
        0.0,
        "law '<lambda>'",
        "instead of the two numbers u, s",
    )
    assert capfd.readouterr().err == ""


MISTAKES = {  # what is said of a law that no run can have
    "returns None: return u and s": lambda y, gains, memory: None,
    "returns 1 number: return u and s": lambda y, gains, memory: (y.x,),
    "reads gains.k2, which is not there: did you mean 'k'": lambda y, g, memory: (g.k2, 0.0),
    "reads y.ee, which is not there: did you mean 'e'": lambda y, gains, memory: (y.ee, 0.0),
}


@pytest.mark.parametrize("said", MISTAKES)
def test_a_mistake_of_a_law_is_said_before_the_run(said):
    with pytest.raises(smc.ScenarioError, match=re.escape(f"law '<lambda>' {said}")):
        smc.run(scenario(made(MISTAKES[said], {"k": 1.0})))


def test_a_law_that_raises_is_warned_of():
    """It stood only in the repr of the trace."""

    def late(y, gains, memory):
        return 1.0 / (y.t < 0.005), 0.0

    with pytest.warns(smc.errors.ScenarioWarning, match="late.* failed by itself: .* raised"):
        smc.run([scenario(made(late))] * 2)


def changes_its_gains(y, gains, memory):
    """Breaks its contract."""
    gains.k = 5.0
    return 0.0, 0.0


def changes_its_measurement(y, gains, memory):
    """Breaks its contract."""
    y.x = 5.0
    return 0.0, 0.0


@pytest.mark.parametrize("function", [changes_its_gains, changes_its_measurement])
def test_a_law_cannot_change_what_it_is_given(function):
    failed(
        plainly(scenario(made(function, {"k": 1.0}))),
        0.0,
        f"law '{function.__name__}'",
        "AttributeError",
    )


def test_endless_recursion_is_a_failure_like_any_other():
    def endless(y, gains, memory):
        return endless(y, gains, memory)

    failed(plainly(scenario(made(endless))), 0.0, "RecursionError")


@dataclasses.dataclass(frozen=True)
class Sour(smc.Signal):
    """A user's signal that raises after a while."""

    start: float = 0.0045

    @staticmethod
    def value(t, p):
        """Raises."""
        if t > p.start:
            raise ValueError("sour")
        return 0.0, 0.0, 0.0


@dataclasses.dataclass(frozen=True)
class Rotten(smc.Signal):
    """A user's signal that is NaN after a while."""

    start: float = 0.0045

    @staticmethod
    def value(t, p):
        """NaN."""
        return (math.nan if t > p.start else 0.0), 0.0, 0.0


@dataclasses.dataclass(frozen=True)
class Flat(smc.Signal):
    """A user's signal that forgets its derivatives."""

    level: float = 0.0

    @staticmethod
    def value(t, p):
        """One number."""
        return p.level


@pytest.mark.parametrize("signal", [Sour, Rotten])
@pytest.mark.parametrize("field", ["reference", "disturbance"])
def test_a_signal_that_fails_fails_the_run_and_is_timed(signal, field):
    trace = smc.run(scenario(**{field: signal()}))
    failed(trace, trace.diverged_at)
    # some stage of a step, or the next
    assert trace.diverged_at in (pytest.approx(0.004), pytest.approx(0.005))


@pytest.mark.parametrize("field", ["reference", "disturbance"])
def test_a_signal_of_the_wrong_shape_fails_the_run(field):
    failed(plainly(scenario("none", **{field: Flat()})), 0.0, "Flat")


# laws that do not compile


def with_json(y, gains, memory):
    """The same, of what numba does not know."""
    memory[0] += y.dt * y.e
    k = json.loads(json.dumps(gains.k))
    return -k * y.de - k * y.e - memory[0], y.e + y.de


def test_the_warning_names_what_does_not_compile_and_why_and_points_at_the_caller():
    with pytest.warns(smc.errors.PlainLoopWarning, match="with_json.*json") as caught:
        smc.run(scenario(made(with_json, {"k": 2.0})))
    assert caught[0].filename == __file__

    @smc.estimator_function()
    def loaded(y, gains, memory):
        return float(json.loads(json.dumps(y.v)))

    with pytest.warns(smc.errors.PlainLoopWarning, match="loaded.*json"):
        smc.run(scenario(velocity=loaded()))


def test_an_estimator_from_a_file_without_its_code_is_refused(tmp_path, refused):
    mine = smc.estimator_function()(lambda y, gains, memory: y.v)()
    smc.run(scenario(velocity=mine)).save(tmp_path / "a.npz")
    refused(lambda: smc.run(smc.load(tmp_path / "a.npz").scenario), "estimator", "code")


# the process around it


WILD = """
import json, math, warnings
import smc_mujoco as smc
warnings.simplefilter("ignore", smc.errors.PlainLoopWarning)
warnings.simplefilter("ignore", smc.errors.ScenarioWarning)
def law(function):
    return smc.law_function()(function)()
def run(law, **fields):
    return smc.run(smc.Scenario(**{"plant": "duffing", "law": law, "duration": 0.02} | fields))
for factor in (1e-300, 1e-30, 1e-16, 1e15):  # beyond 1e15 a parameter is refused
    run("none", mismatch={"mass": factor})
    run("none", jump=smc.Jump(0.01, {"mass": factor}))
    run(law(lambda y, gains, memory: (float(json.dumps(y.t)), 0.0)), mismatch={"mass": factor})
for name in ("alpha", "beta", "delta"):
    for value in (-1e9, 1e9):
        assert run("none", plant=smc.plant("duffing", **{name: value})).diverged_at is not None
        in_python = law(lambda y, gains, memory: (float(json.dumps(y.t)), 0.0))
        run(in_python, plant=smc.plant("duffing", **{name: value}))
lost = law(lambda y, gains, memory: (math.nan, 0.0))
assert run(lost, noise=smc.Noise(1e90, 1e90)).diverged_at == 0.0
assert run(law(lambda y, gains, memory: memory)).diverged_at == 0.0
print("done")
"""


MANY = """
import resource, smc_mujoco as smc, smc_mujoco.simulation.run
import sys
sys.modules["smc_mujoco.simulation.run"].BATCH_BYTES = 2**20
def peak():
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
def play(count):
    one = dict(plant="duffing", law="none", duration=0.5, integrator="Euler")
    for _ in smc.stream([smc.Scenario(**one, seed=i) for i in range(count)]):
        pass
play(40)
before = peak()
play(500)
print(peak() - before)
"""


LARGE = """
import numpy as np, smc_mujoco as smc
def resident():
    return int(open("/proc/self/statm").read().split()[1]) * 4096
smc.run(smc.Scenario(plant="duffing", law="none", duration=0.01))
np.ones(2**21)
small = []
before = resident()
for _ in range(2):
    large = []
    for _ in range(20):
        large.append(np.ones(2**21))
        small.append(bytearray(20_000))
    del large
print(resident() - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="glibc")
def test_large_blocks_go_back_to_the_system_though_small_ones_lie_between_them(tmp_path):
    done = python("-c", LARGE, folder=tmp_path)
    assert int(done.stdout) < 20 * 2**24 / 4  # some fit into what the heap has free


@pytest.mark.skipif(sys.platform == "win32", reason="resource")
def test_a_stream_holds_one_batch_and_diverging_runs_print_nothing_and_leave_no_file(tmp_path):
    done = python("-c", MANY + WILD, folder=tmp_path)
    assert done.stderr == ""
    held, said = done.stdout.splitlines()
    logs = 500 * 6 * 501 * 8
    assert int(held) < 0.3 * logs
    assert said == "done"
    assert not list(tmp_path.iterdir())


def test_a_stream_prepares_no_more_than_a_batch_ahead(monkeypatch):
    """A generator of a hundred thousand scenarios would be in memory as a whole."""
    monkeypatch.setattr(runs, "BATCH_BYTES", 1)
    prepared_ones = []

    def many():
        for seed in range(20):
            prepared_ones.append(seed)
            yield scenario(seed=seed)

    next(iter(smc.stream(many(), threads=2)))
    assert len(prepared_ones) == 3


def test_a_callback_that_was_installed_is_put_back():
    calls = []

    def mine(model, data):
        calls.append(data)

    smc.run(scenario())  # has imported all there is to import: mujoco.batch compiles a model
    mujoco.set_mjcb_control(mine)
    try:
        trace = smc.run(scenario())
        plain = plainly(scenario(made(with_json, {"k": 2.0})))
        assert mujoco.get_mjcb_control() is mine
    finally:
        mujoco.set_mjcb_control(None)
    assert calls == []
    assert same(trace, smc.run(scenario()))
    assert same(plain, plainly(scenario(made(with_json, {"k": 2.0}))))


def test_one_thread_steps_all_slices_of_a_run(monkeypatch):
    """A thread for each slice cost a quarter of the time of a user's arm."""
    monkeypatch.setattr(runs, "SLICE_STEPS", 2)
    steppers = []
    ((_, trace),) = smc.stream(
        [scenario()], report=lambda steps: steppers.append(threading.current_thread())
    )
    assert trace.failure is None
    assert len(steppers) > 5
    assert {*steppers} == {steppers[0]}
    assert steppers[0] is not threading.current_thread()


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers")
@pytest.mark.parametrize("engine", ["MuJoCo", pytest.param("the equation", marks=pytest.mark.slow)])
def test_ctrl_c_calls_a_slow_law_no_more_and_leaves_no_thread(engine):
    calls = np.zeros(2, np.int64)
    address = calls.ctypes.data

    def slow(y, gains, memory):
        integers(address)[0] += 1
        for _ in range(1_000_000):  # a ms or more
            memory[0] += 1.0
        return 0.0, 0.0

    def interrupt(signum, frame):
        if calls[0]:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            raise KeyboardInterrupt

    case = scenario(made(slow, memory=1), duration=20.0)
    if engine == "MuJoCo":
        started = functools.partial(smc.run, [case] * 2)
    else:
        started = functools.partial(FormGroup([case] * 2, ("itae",)).scored, "cpu", 2)
    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.1, 0.1)
    try:
        with pytest.raises(KeyboardInterrupt):
            started()
        made_until_then = calls[0]
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    time.sleep(0.1)
    assert 0 < made_until_then == calls[0]
    assert not attended._running
    assert smc.run(scenario()).failure is None


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers")
def test_ctrl_c_is_heard_while_a_compiled_law_computes_for_ever(monkeypatch):
    shared = np.zeros(2, np.int64)  # whether the law is to stop, and whether it has begun
    address = shared.ctypes.data

    def endless(y, gains, memory):
        integers(address)[1] = 1
        while integers(address)[0] == 0:
            memory[0] += 1.0
        return 0.0, 0.0

    def interrupt(signum, frame):
        if shared[1]:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            raise KeyboardInterrupt

    monkeypatch.setattr(attended, "PATIENCE", 0.1)
    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.1, 0.1)
    try:
        with pytest.raises(KeyboardInterrupt):
            smc.run(scenario(made(endless, memory=1)))
        (thread,) = attended._running
        assert smc.run(scenario()).failure is None
    finally:
        shared[0] = 1
        signal.signal(signal.SIGALRM, before)
    thread.join()
    assert not attended._running


@pytest.mark.parametrize(
    "law", ["classical", made(with_json, {"k": 2.0})], ids=["compiled", "in Python"]
)
@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers")
def test_ctrl_c_in_mid_run_is_heard_and_leaves_the_callback_restored(law):
    def interrupt(_, frame):
        # Python ignores exceptions there: the next alarm interrupts
        if frame.f_globals["__name__"] != "weakref":
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            raise KeyboardInterrupt

    plainly(scenario(law))
    handler = mujoco.get_mju_user_warning()
    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.2, 0.2)
    begin = time.process_time()
    try:
        with pytest.raises(KeyboardInterrupt):
            plainly(
                scenario(
                    law,
                    duration=10_000.0,
                    control_period=0.1,
                    physics_step=1e-3,
                    integrator="Euler",
                )
            )
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    # s of processor time; the run itself would take a minute
    assert time.process_time() - begin < 10.0
    assert mujoco.get_mjcb_control() is None
    assert mujoco.get_mju_user_warning() is handler
    assert smc.run(scenario()).diverged_at is None
