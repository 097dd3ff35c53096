"""What a hostile review broke, and what must stay mended: memory, processes, names, signs,
clocks.
"""

# pyright: reportOptionalMemberAccess=false, reportOperatorIssue=false
import copy
import ctypes
import dataclasses
import importlib
import itertools
import math
import os
import pickle
import re
import signal
import threading
import time
import types
import warnings
from pathlib import Path
from unittest import mock

import mujoco
import numba
import numpy as np
import pytest
from helpers import reference
from helpers.runs import made, plainly, same, scenario
from numba.core.compiler_lock import global_compiler_lock

import smc_mujoco as smc
from smc_mujoco.common import fingerprint, jit, numba_internals
from smc_mujoco.common.jit import Key, compiled_cfunc
from smc_mujoco.control.law import Measurement
from smc_mujoco.mechanisms.hardware import moments
from smc_mujoco.mechanisms.hardware.moments import lever
from smc_mujoco.simulation import callback, controller, parts, philox, run_key, state
from smc_mujoco.simulation.model import channels
from smc_mujoco.simulation.prepare import pack, prepare

# the module; the public name is the function
RUN = importlib.import_module("smc_mujoco.simulation.run")
ARRAYS = ("t", "x", "v", "u", "applied", "s", "d", "r")
THREE = smc.plant("pendulum_network", n=3)


# (a) the cache


USED = [
    (philox, "uniform", numba.njit(lambda seed, channel, stream, k: 0.5)),
    (controller, "MAX_STATE", 2e6),
    (moments, "lever", numba.njit(fastmath=True)(moments.lever.py_func)),
    (parts, "_exert", numba.njit(lambda address, sim, data, part: 0)),
]


def test_the_hash_of_compiled_code_is_of_all_that_it_uses_and_of_nothing_else(monkeypatch):
    """Else a process loads code that is outdated, or compiles the callback after each edit."""
    law = smc.law("classical").function
    of_law = fingerprint.now(law)
    seen = {fingerprint.now(controller.control)}
    for i, (module, name, replacement) in enumerate(USED):
        with monkeypatch.context() as patch:
            patch.setattr(module, name, replacement)
            seen.add(fingerprint.now(controller.control))
            assert fingerprint.now(law) == of_law
        assert len(seen) == i + 2, name
    monkeypatch.setattr(controller, "Unused", 3.0, raising=False)
    assert fingerprint.now(controller.control) in seen


# (b) memory


@numba.njit
def writes_beyond(memory):
    """Writes into the next channel."""
    memory[8] = 99.0


@numba.njit
def compiled_before(memory):
    """Likewise, compiled by its author ahead."""
    memory[8] = 99.0


compiled_before(np.zeros(16))


@numba.njit
def passes_on(memory):
    """Calls what writes beyond."""
    compiled_before(memory)


LIBRARY = types.ModuleType("library")
LIBRARY.writes_beyond = compiled_before


def by_global(y, gains, memory):
    """A helper among the globals."""
    if y.t > 0.0045:
        writes_beyond(memory)
    return 0.0, memory[0]


def by_another_helper(y, gains, memory):
    """A helper of a helper."""
    if y.t > 0.0045:
        passes_on(memory)
    return 0.0, memory[0]


def closed_over():
    """A law with a helper in a closure cell."""

    @numba.njit
    def inner(memory):
        memory[8] = 99.0

    inner(np.zeros(16))

    def by_cell(y, gains, memory):
        if y.t > 0.0045:
            inner(memory)
        return 0.0, memory[0]

    return by_cell


def by_module(y, gains, memory):
    """A helper of a module."""
    if y.t > 0.0045:
        LIBRARY.writes_beyond(memory)
    return 0.0, memory[0]


def by_inner_function(y, gains, memory):
    """A helper that only a function within the law names."""

    def inner(m):
        writes_beyond(m)
        return 0.0

    if y.t > 0.0045:
        inner(memory)
    return 0.0, memory[0]


VANDALS = [
    by_global,
    by_another_helper,
    closed_over(),
    by_module,
    by_inner_function,
]


@pytest.mark.quick
@pytest.mark.parametrize("function", VANDALS, ids=lambda function: function.__name__)
def test_a_helper_that_writes_beyond_the_memory_fails_the_run_and_touches_nothing_else(function):
    good = [
        scenario(
            plant=THREE,
            seed=seed,
            noise=smc.Noise(0.1),
            law=smc.law("adaptive"),
        )
        for seed in range(3)
    ]
    bad = scenario(made(function), plant=THREE)
    first, trace, *further = plainly([good[0], bad, *good[1:]])
    assert trace.failure is not None
    assert f"law '{function.__name__}'" in trace.failure
    assert "IndexError" in trace.failure
    assert trace.diverged_at == pytest.approx(0.005)
    assert not trace.s[:5].any()
    assert np.isnan(trace.s[5:]).all()
    assert all(map(same, [first, *further], smc.run(good)))


@numba.njit
def factorial(n):
    """A helper that calls itself."""
    if n <= 0:
        return 1.0
    return n * factorial(n - 1)


def test_a_helper_that_calls_itself_is_called_in_python():
    with pytest.warns(smc.errors.PlainLoopWarning, match="factorial calls itself"):
        trace = smc.run(scenario(made(lambda y, gains, memory: (0.0, factorial(4)))))
    assert (trace.s == 24.0).all()
    endless = scenario(made(lambda y, gains, memory: (0.0, factorial(1e9))))
    assert "RecursionError" in str(plainly(endless).failure)


# (c) what a law returns


def late_number(y, gains, memory):
    """None at first."""
    u = None
    if y.t > 0.0045:
        u = 1.0
    return u, 0.0


def late_none(y, gains, memory):
    """None in the end."""
    u = None
    if y.t < 0.0045:
        u = 1.0
    return u, 0.0


@pytest.mark.parametrize(
    ("function", "at"),
    [
        (late_number, 0.0),
        (late_none, 0.005),
    ],
)
def test_a_law_that_may_return_none_is_not_compiled_and_is_named_when_it_does(function, at):
    with pytest.warns(
        smc.errors.PlainLoopWarning,
        match=f"'{function.__name__}' does not compile.*instead of numbers",
    ):
        trace = smc.run(scenario(made(function)))
    assert trace.diverged_at == pytest.approx(at)
    assert (
        f"law '{function.__name__}' returned (None, 0.0) instead of the two numbers u, s"
        in trace.failure
    )


# (d) signs


def seen(e: float, de: float, dt: float = 1e-3) -> Measurement:
    """A measurement of an error."""
    return Measurement(
        t=0.0,
        dt=dt,
        x=e,
        v=de,
        e=e,
        de=de,
        r=0.0,
        dr=0.0,
        ddr=0.0,
        f=0.0,
        g=1.0,
    )


# (e) references


@dataclasses.dataclass(frozen=True)
class Sour(smc.Signal):
    """A reference that raises after a while."""

    start: float = 0.0095

    @staticmethod
    def value(t, p):
        """Raises."""
        if t > p.start:
            raise ValueError("sour")
        return 0.1, 0.0, 0.0


# (f) other people's callbacks

# (g) batches


LARGE = [
    scenario(
        made(lambda y, gains, memory: (0.0, 0.0), memory=10_000),
        plant=smc.plant("pendulum_network", n=50),
    ),
    scenario(
        disturbance=[smc.signals.OrnsteinUhlenbeck(0.1, 0.1)] * 40,
        plant=smc.plant("pendulum_network", n=50),
    ),
    scenario(input_delay=0.9, duration=2.0, plant=smc.plant("pendulum_network", n=20)),
    scenario(velocity=smc.estimator_function(memory=5000)(lambda y, gains, memory: y.v)()),
    scenario(duration=10.0),
]


@pytest.mark.parametrize("large", LARGE, ids=["law", "noise", "delay", "estimator", "log"])
def test_the_estimated_memory_of_a_simulation_is_what_it_takes(large):
    model = large.plant.load(nuserdata=2)
    prepared = prepare(large)
    log = np.empty((large.samples + 1, large.plant.n), state.LOG)
    _, packed = pack(prepared, log)
    struct = callback.offsets().userdata  # its arrays of statistics come first, and are most of it
    takes = (
        log.nbytes
        + packed.numbers.nbytes
        + state.SIMULATION.itemsize
        + struct
        + mujoco.MjData(model).nbuffer
    )
    assert takes <= prepared.bytes <= 1.5 * takes


def test_batches_of_laws_with_large_memory_stay_bounded(monkeypatch):
    monkeypatch.setattr(RUN, "BATCH_BYTES", RUN.BATCH_BYTES // 10)
    law = made(lambda y, gains, memory: (0.0, 0.0), memory=10_000)
    many = []
    for seed in range(20):
        many.append(scenario(law, plant=smc.plant("pendulum_network", n=100), seed=seed))
    batches = list(RUN._batches(list(enumerate(map(prepare, many))), 1))
    assert [index for batch in batches for index, _ in batch] == list(range(20))
    memory_of_law = 8 * 10_000 * 100
    assert 1 < max(map(len, batches)) < 20
    assert max(map(len, batches)) * memory_of_law <= RUN.BATCH_BYTES


# (h) telling failures again


def sour_law(y, gains, memory):
    """Raises."""
    if y.t > 0.0045:
        raise ValueError("sour")
    return 0.0, y.f


def none_law(y, gains, memory):
    """Returns NaN, from 0/0 that compiled code does not raise."""
    return math.nan if y.t > 0.0045 else 0.0, y.f


def square_root(y, gains, memory):
    """Leaves a function's domain, which only Python minds."""
    return math.sqrt(0.0045 - y.t), y.f


def exits(y, gains, memory):
    """Ends the process, if it could."""
    if y.t > 0.0045:
        raise SystemExit(3)
    return 0.0, 0.0


class Speechless(Exception):
    """Has no text."""

    def __str__(self):
        raise RuntimeError("none")


def speechless(y, gains, memory):
    """Raises what cannot be shown."""
    if y.t > 0.0045:
        raise Speechless
    return 0.0, 0.0


def unprintable(y, gains, memory):
    """Raises what spoils a terminal and a table."""
    if y.t > 0.0045:
        raise ValueError("\x1b[31m\x00\ud800" + "long " * 2_000)
    return 0.0, 0.0


def third_call(y, gains, memory):
    """Changes its memory before it raises."""
    memory[0] += 1.0
    if memory[0] == 6.0:
        raise ValueError("sixth")
    return 0.0, 0.0


SAYS = {
    sour_law: "raised ValueError (sour)",
    none_law: "returned u = nan, s = {s}",
    square_root: "raised ValueError (math domain error)",
    exits: "raised SystemExit (3)",
    speechless: "raised Speechless (its text cannot be shown)",
    unprintable: f"raised ValueError (?[31m??{('long ' * 99)[:190]}...)",
    third_call: "raised ValueError (sixth)",
}


@pytest.mark.parametrize("function", SAYS, ids=lambda function: function.__name__)
def test_a_failing_run_says_the_same_alone_in_company_and_in_python(function):
    law = made(function)
    many = [scenario(law, seed=seed, noise=smc.Noise(0.1)) for seed in range(2)]
    beside = plainly([scenario(), *many, scenario()])
    said = [trace.failure for trace in beside[1:-1]]
    assert said[0] == plainly(many[0]).failure
    assert said == [reference.run(alone).failure for alone in many]
    for words in said:
        s = words.partition("s = ")[2].partition(" in ")[0]
        reported = f"{SAYS[function].format(s=s)} in channel 0, at t = 0.005 s"
        of_3_14 = re.sub(r"expected a nonnegative input, got [-.\d]+", "math domain error", words)
        assert of_3_14 == f"law '{function.__name__}' {reported}"
    assert [trace.failure for trace in (beside[0], beside[-1])] == [None, None]


def sour_estimator(y, gains, memory):
    """Raises in one channel."""
    if y.x > 2.5:
        raise ValueError("sour")
    return y.v


def sour_surface(y, gains, memory):
    """Raises in one channel."""
    if y.e > 2.5:
        raise ValueError("sour")
    return y.de, 0.0


@dataclasses.dataclass(frozen=True)
class SourNoise(smc.Signal):
    """A disturbance of each channel that raises in one."""

    start: float = 0.0095
    memory = 1
    random = True

    @staticmethod
    def value(t, p, memory, seed, channel, stream):
        """Raises, having counted nothing."""
        if t > p.start and channel == 1:
            raise ValueError("sour")
        memory[0] = t
        return 0.0, 0.0, 0.0


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        (
            {"velocity": smc.estimator_function(sour_estimator)()},
            "estimator 'sour_estimator' raised ValueError (sour)",
        ),
        (
            {"surface": smc.design.surface_function(sour_surface)()},
            "surface 'sour_surface' raised ValueError (sour)",
        ),
        ({"reference": Sour()}, "Sour raised ValueError (sour)"),
        ({"feedforward": Sour()}, "Sour raised ValueError (sour)"),
        (
            {"disturbance": [smc.signals.OrnsteinUhlenbeck(0.1, 0.1), SourNoise()]},
            "SourNoise raised ValueError (sour)",
        ),
    ],
    ids=["estimator", "surface", "reference", "feedforward", "disturbance"],
)
def test_every_part_that_raises_is_named(fields, words):
    failing = scenario(plant=THREE, x0=(1.0, 3.0, 2.0), **fields)
    again = reference.run(failing).failure
    trace = smc.run([scenario(plant=THREE), failing])[1]
    assert trace.failure.startswith(words)
    assert trace.failure == again


@pytest.mark.parametrize("run", [smc.run, reference.run])
def test_a_trace_is_finite_up_to_its_end_in_all_its_signals(run):
    @dataclasses.dataclass(frozen=True)
    class Unbounded(smc.Signal):
        @staticmethod
        def value(t, p):
            return math.inf if t > 0.0095 else 0.0, 0.0, 0.0

    trace = run(scenario("none", reference=Unbounded()))
    assert trace.failure == "r became NaN or inf, at t = 0.01 s"
    assert trace.diverged_at == pytest.approx(0.01)
    for name in (*ARRAYS[1:], "force", "reaction"):
        assert np.isfinite(getattr(trace, name)[:10]).all()
        assert np.isnan(getattr(trace, name)[10:]).all()


# (i) forks


def child_runs() -> int:
    """0 if a forked child finishes its own run, its exit status if not."""
    with warnings.catch_warnings():
        # forking with threads about is what is tested
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        signal.alarm(20)  # a child that hangs dies of it
        try:
            os._exit(0 if smc.run(scenario()).failure is None else 3)
        except BaseException:
            os._exit(4)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_child_forked_during_a_run_of_another_thread_can_run():
    expected = smc.run(scenario())
    long = scenario(duration=400.0, control_period=0.1, physics_step=1e-3)
    thread = threading.Thread(target=smc.run, args=(long,))
    thread.start()
    while mujoco.get_mjcb_control() is None and thread.is_alive():
        time.sleep(1e-3)
    held = thread.is_alive()
    status = child_runs()
    thread.join()
    assert held
    assert status == 0
    assert same(smc.run(scenario()), expected)  # the parent is as it was


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_child_forked_by_a_law_in_python_can_run():
    status = []

    def forks(y, gains, memory):
        if not status:
            status.append(child_runs())
        return 0.0, 0.0

    smc.run(scenario())
    assert plainly(scenario(made(forks))).failure is None
    assert status == [0]


# (j) clocks of signals


@pytest.mark.parametrize("dt", [1e-3, 5e-3])
def test_a_pulse_lasts_width_over_dt_samples_wherever_decimal_times_put_it(dt):
    wrong = []
    for start, width in itertools.product((*range(0, 60), 500, 4999), (1, 2, 3, 7, 10, 33, 100)):
        pulse = smc.signals.Pulse(
            1.0, time=float(f"{start * dt:.6g}"), width=float(f"{width * dt:.6g}")
        )
        on = []
        for k in range(start - 2, start + width + 3):
            if pulse.value(k * dt, pulse)[0]:
                on.append(k)
        if on != list(range(start, start + width)):
            wrong.append((pulse, on))
    assert wrong == []


NOISE = smc.signals.OrnsteinUhlenbeck(0.2, 0.1)


@pytest.mark.parametrize(
    "before",
    [
        [smc.Constant(0.0)],
        [smc.Step(0.0), smc.signals.Pulse(0.0, 0.1, 0.1)],
    ],
)
def test_the_path_of_process_noise_does_not_change_with_what_is_put_before_it(before):
    alone = smc.run(scenario("none", plant=THREE, disturbance=NOISE, seed=3))
    assert np.ptp(alone.d) > 0.0
    np.testing.assert_array_equal(
        smc.run(scenario("none", plant=THREE, disturbance=[*before, NOISE], seed=3)).d, alone.d
    )
    np.testing.assert_array_equal(
        smc.run(scenario("none", plant=THREE, disturbance=[NOISE, *before], seed=3)).d, alone.d
    )


# (k) file names


# (l) users' signals


@dataclasses.dataclass(frozen=True)
class Sine(smc.Signal):
    """A user's signal that is named as one of the library, with other parameters and another
    shape.
    """

    amplitude: float
    omega: float
    phase: float = 0.0

    @staticmethod
    def value(t, p):
        """No sine."""
        return p.amplitude, 0.0, 0.0


def test_a_trace_of_a_signal_that_is_gone_is_refused_with_the_name_of_its_module(
    tmp_path, monkeypatch, refused
):
    path = smc.run(scenario(disturbance=Sine(0.2, 5.0))).save(tmp_path / "a.npz")
    monkeypatch.setattr(Sine, "__module__", "a_module_that_is_gone")
    refused(lambda: smc.load(path), "'Sine' is unknown here: first import test_safety")


def test_signals_of_one_name_are_different_signals():
    assert Sine(0.2, 5.0) != smc.Sine(0.2, 5.0)
    mine, theirs = smc.run(
        [scenario(disturbance=Sine(0.2, 5.0)), scenario(disturbance=smc.Sine(0.2, 5.0))]
    )
    assert (mine.d == 0.2).all()
    np.testing.assert_allclose(theirs.d[:, 0], 0.2 * np.sin(5.0 * theirs.t), atol=1e-15)


# (m) checked mappings

WHOLE = scenario(
    smc.law("classical", k=2.0),
    mismatch={"M": 1.1, "alpha": 0.9},
    jump=smc.Jump(0.01, {"M": 2.0, "alpha": 3.0}),
)
MAPPINGS = {
    "gains": lambda s: s.law.gains,
    "mismatch": lambda s: s.mismatch,
    "factors": lambda s: s.jump.factors,
    "parameters": lambda s: s.plant.parameters,
}


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))]
)
def test_a_scenario_hashes_and_comes_back_equal_and_unchangeable(copied):
    again = copied(WHOLE)
    assert again == WHOLE
    assert hash(again) == hash(WHOLE)
    assert len({again, WHOLE, dataclasses.replace(WHOLE, seed=1)}) == 2
    for held in MAPPINGS.values():
        with pytest.raises(TypeError):
            held(again)["k"] = 1.0


# (n) channels

MECHANISM = """
<mujoco>
  <worldbody><body><joint name="j" type="{joint}" axis="{axis}"/>
    <geom size="0.1" pos="0.3 0.4 0.5"/></body></worldbody>
  <tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>
  <actuator><motor name="u" {drive}/></actuator>
  <sensor><jointpos joint="j"/><jointvel joint="j"/></sensor>
</mujoco>
"""


def mechanism(drive: str, joint: str = "slide", axis: str = "1 0 0") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(MECHANISM.format(drive=drive, joint=joint, axis=axis))


@pytest.mark.parametrize(
    ("joint", "axis"),
    [
        ("hinge", "1 0 0"),
        ("hinge", "0 1 0"),
        ("hinge", "0 0 1"),
        ("hinge", "0 0 -1"),
        ("slide", "-1 0 0"),
    ],
)
def test_the_generalised_force_of_a_horizontal_force_is_that_of_the_jacobian(joint, axis):
    """J' F by MuJoCo's Jacobian of the body's centre of mass, in place of the lever arm that both
    loops read.
    """
    model = mechanism('joint="j"', joint, axis)
    data, jacobian, (channel,) = mujoco.MjData(model), np.zeros((3, 1)), channels(model)
    data.qpos[:] = 0.7
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_jacBodyCom(model, data, jacobian, None, 1)
    force = channel["sign"]
    if joint == "hinge":
        force = lever.py_func(
            np.rec.array(channel), data.xipos.ravel(), data.xanchor.ravel(), data.xaxis.ravel()
        )
    direction = channel["horizontal"] - 6
    assert 0 <= direction < 2
    assert force == pytest.approx(jacobian[direction, 0], rel=1e-9)


# (o) infinite disturbances


@pytest.mark.parametrize(("start", "integrator"), [(0.0, "RK4"), (0.007, "Euler")])
def test_an_infinite_disturbance_is_marked_at_its_own_sample(start, integrator):
    infinite = [smc.Step(1e308, start), smc.Step(1e308, start)]  # their sum is
    trace = smc.run(scenario("none", disturbance=infinite, integrator=integrator))
    assert trace.diverged_at == pytest.approx(start, abs=1e-9)
    assert "disturbance became NaN or inf" in trace.failure
    k = round(start / 1e-3)
    assert np.isfinite(trace.x[:k]).all()
    assert np.isfinite(trace.d[:k]).all()
    assert np.isnan(trace.x[k:]).all()


# (p) the cache on disk, memory, forks and Ctrl-C


def twice(x):
    """What is compiled."""
    return x + x


def hits() -> int:
    """How often a compiled function is taken from the cache, as a new process would: 0 or 1."""
    function = compiled_cfunc(
        numba.types.float64(numba.types.float64), twice, Key("twice", "its hash")
    )
    assert function.ctypes(1.5) == 3.0
    return function.cache_hits


def flipped(data: bytes) -> bytes:
    """With one bit changed, in the middle."""
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 16]) + data[middle + 1 :]


def test_a_damaged_cache_is_written_again(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    assert [hits(), hits()] == [0, 1]
    (path,) = tmp_path.iterdir()
    data = path.read_bytes()
    for damaged in (b"", data[: len(data) // 2], flipped(data), b"garbage" * 99):
        path.write_bytes(damaged)
        assert [hits(), hits()] == [0, 1]


def test_without_a_folder_code_is_kept_in_the_users_cache(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert [hits(), hits()] == [0, 1]
    assert list(tmp_path.rglob("*.code")) == list((tmp_path / "smc_mujoco" / "numba").iterdir())


def test_compiled_code_that_no_process_reads_for_thirty_days_is_deleted(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    assert hits() == 0
    (file,) = tmp_path.iterdir()
    forgotten, notes = tmp_path / "forgotten.code", tmp_path / "notes.txt"
    day = 86400.0
    for path, age in ((file, 29), (forgotten, 31), (notes, 31)):
        path.touch()
        os.utime(path, (time.time() - age * day,) * 2)
    assert hits() == 1  # which reads it
    assert time.time() - file.stat().st_mtime < day
    jit.delete_unread.cache_clear()
    jit.delete_unread(tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted([file, notes])


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "file"))
    assert [hits(), hits()] == [0, 0]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_child_forked_while_another_thread_compiles_can_compile():
    compiling = threading.Event()

    def compiles():
        with global_compiler_lock:
            compiling.set()
            time.sleep(0.3)

    thread = threading.Thread(target=compiles)
    thread.start()
    assert compiling.wait(60)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        signal.alarm(20)  # a child that hangs dies of it
        os._exit(
            0
            if global_compiler_lock.is_locked() is False and global_compiler_lock._lock.acquire()
            else 3
        )
    thread.join()
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert not global_compiler_lock.is_locked()


def test_ctrl_c_that_comes_while_numba_compiles_is_heard_when_it_is_done(monkeypatch):
    done = []

    class Pressed:
        """What numba's compiler loses an interrupt in, such as a finaliser."""

        def compile(self):
            try:
                signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt:
                return
            done.append(True)

    # a shell's background job ignores it
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    monkeypatch.setattr(numba_internals, "CFunc", lambda *arguments: Pressed())
    with pytest.raises(KeyboardInterrupt):
        compiled_cfunc(numba.types.float64(numba.types.float64), math.sin)
    assert done == [True]
    assert signal.signal(signal.SIGINT, before) is signal.default_int_handler


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="no alarm")
def test_what_a_handler_raises_while_a_law_compiles_is_no_fault_of_the_law(monkeypatch):
    """A time limit by SIGALRM raises an Exception, which is not one of numba's."""

    def handler(number, frame):
        raise TimeoutError("up")

    def law(y, gains, memory):
        return -y.e, y.e

    compile_function = numba_internals.CFunc.compile

    def interrupted(self):
        signal.pthread_kill(threading.main_thread().ident, signal.SIGALRM)
        compile_function(self)

    case = smc.Scenario(plant="duffing", law=smc.law_function(law), duration=0.1)
    before = signal.signal(signal.SIGALRM, handler)
    try:
        with monkeypatch.context() as patched:
            patched.setattr(numba_internals.CFunc, "compile", interrupted)
            with pytest.raises(TimeoutError, match="up"):
                smc.run(case)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert smc.run(case).failure is None  # compiled now: a PlainLoopWarning is an error here


def test_memory_that_runs_out_is_said_in_one_sentence(monkeypatch, refused):
    for error in (
        MemoryError("std::bad_alloc"),
        mujoco.FatalError("Could not allocate memory"),
        ValueError("Could not allocate memory"),
    ):
        runs_out = mock.Mock(side_effect=error)
        with monkeypatch.context() as patch:
            patch.setattr(RUN, "ScenarioBatch", runs_out)
            refused(lambda: smc.run([scenario(), scenario(seed=1)]), "no memory for 2 runs")


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="not glibc")
def test_many_runs_leave_no_memory_behind():
    """They leave 8 to 12 kB each, once, as more of them are in one batch; without giving it back 45
    to 100 kB.
    """

    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")

    many = []
    for seed in range(600):
        many.append(scenario(seed=seed, duration=0.002))
    for _ in smc.stream(many[:64]):
        pass
    before = resident()
    for _ in smc.stream(many):
        pass
    assert resident() - before < 20_000 * len(many)


def test_how_this_machine_rounds_is_part_of_what_a_run_is(monkeypatch):
    here = run_key.run_key(scenario())
    assert run_key.description(scenario())["versions"]["arithmetic"] == fingerprint.arithmetic()
    monkeypatch.setattr(
        fingerprint.math, "tanh", lambda x: math.nextafter(math.sinh(x) / math.cosh(x), 2.0)
    )
    monkeypatch.setattr(
        importlib.import_module("smc_mujoco.simulation.scenario_json"),
        "arithmetic",
        fingerprint.arithmetic.__wrapped__,
    )
    versions = importlib.import_module("smc_mujoco.simulation.scenario_json")._versions
    versions.cache_clear()
    try:
        assert run_key.run_key(scenario()) != here
    finally:
        versions.cache_clear()
