"""Compiled components on disk: what was compiled once is loaded, what differs in anything that it
reaches is not.
"""

import ctypes
import importlib
import os
import pickle
import subprocess
import sys
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
import numpy as np
import pytest
from helpers import reference
from helpers.runs import assert_same
from numba import njit
from numba.extending import overload

import smc_mujoco as smc
from smc_mujoco.common import fingerprint
from smc_mujoco.common.jit import NUMBERS
from smc_mujoco.common.numba_internals import FunctionIdentity
from smc_mujoco.control.law import Measurement
from smc_mujoco.simulation import cfunctions


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch) -> Path:
    """An empty folder for what is compiled."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    return tmp_path


def compiled(function, kind="law", gains=("k",), memory=1):
    """Compile a component as a new process would."""
    return cfunctions._compile_pair.__wrapped__(function, kind, gains, memory)


def hits(function, **options) -> int:
    return compiled(function, **options)._cfunc.cache_hits


def force(function) -> float:
    """The u of a compiled law at 0, with a gain of 3."""
    inputs = np.zeros(len(Measurement._fields))
    gains = np.array([3.0])
    memory = np.zeros(1)
    out = np.zeros(2)
    done = compiled(function)
    assert done._cfunc.ctypes(*(a.ctypes.data for a in (inputs, gains, memory, out))) == 0
    return out[0]


def mine(body="y.x + gains.k", **space) -> FunctionType:
    """A user's law u = body, s = 0; its module holds these names."""
    space = {"__name__": "users", **space}
    exec(f"def mine(y, gains, memory):\n    return {body}, 0.0", space)
    return space["mine"]


FACTOR = 2.0


def ratio_to(x):
    return FACTOR / x[0]


def test_a_law_is_compiled_once_for_all_processes():
    assert [hits(smc.law("classical").function, gains=("k", "c")) for _ in range(2)] == [0, 1]


def test_a_function_of_arrays_is_compiled_once_for_all_processes(cache):
    """Numba's own cache would take a function with another number of its module for the same."""

    def ratio(factor, x):
        return cfunctions.cached(FunctionType(ratio_to.__code__, {"FACTOR": factor}))(np.array([x]))

    assert ratio(2.0, 1.0) == 2.0
    (file,) = cache.rglob("*.code")
    code = file.read_bytes()  # has numbers that no compilation gives again
    assert ratio(2.0, 0.0) == np.inf
    assert file.read_bytes() == code
    assert ratio(3.0, 1.0) == 3.0


@pytest.mark.slow
def test_another_kind_other_gains_or_another_memory_are_compiled_again():
    assert [hits(mine()), hits(mine())] == [0, 1]
    assert hits(mine(), gains=("k", "c")) == 0
    assert hits(mine(), memory=2) == 0
    assert hits(mine("y.x"), kind="estimator") == 0


@pytest.mark.slow
def test_a_law_that_has_changed_is_not_taken_for_the_one_before():
    """By its own text, by a number of its module, and by a helper's: the laws have one name."""
    scaled = "factor * gains.k"
    helper = "@njit\ndef helper(x):\n    return {} * x"

    def helped(number):
        space = {"njit": njit, "__name__": "users"}
        exec(helper.format(number), space)
        return mine("helper(gains.k)", helper=space["helper"])

    assert [force(mine("gains.k")), force(mine("2.0 * gains.k")), force(mine("gains.k"))] == [
        3.0,
        6.0,
        3.0,
    ]
    assert [force(mine(scaled, factor=f)) for f in (4.0, 5.0)] == [12.0, 15.0]
    assert [force(helped(number)) for number in (6.0, 7.0)] == [18.0, 21.0]


def test_a_global_that_changes_between_hash_and_compilation_is_not_kept_under_the_old_hash(cache):
    """A study hashes a law before it compiles it; another process with the old value must not load
    the new one.
    """
    late = mine("factor * gains.k", factor=2.0)
    fingerprint.of(late)
    late.__globals__["factor"] = 5.0
    assert force(late) == 15.0
    assert force(mine("factor * gains.k", factor=2.0)) == 6.0


def test_what_numba_compiles_in_place_of_a_function_tells_laws_apart():
    """A user's `overload` is registered with numba, and neither a global nor in the closure."""

    def overloaded(number):
        def thing(x): ...

        overload(thing)(lambda x: lambda x: number * x)
        return mine("thing(gains.k)", thing=thing)

    assert [force(overloaded(number)) for number in (6.0, 7.0)] == [18.0, 21.0]


def test_laws_of_one_name_are_all_kept():
    """Laws that are written from numbers have one name, such as linear controllers, and so have the
    laws of scripts.
    """
    laws = []
    for factor in (1.0, 2.0, 3.0):
        laws.append(mine(f"{factor} * gains.k"))
    assert [hits(law) for law in laws + laws] == [0, 0, 0, 1, 1, 1]


@pytest.mark.quick
def test_a_law_with_a_very_long_name_is_kept():
    law = mine()
    law.__qualname__ = "name" * 60  # with what is added, more than the 255 bytes of a file's name
    assert [hits(law) for _ in range(2)] == [0, 1]


def test_code_of_another_law_under_the_name_of_this_one_is_not_run(cache):
    force(mine("gains.k"))
    (ours,) = cache.rglob("*.code")
    assert force(mine("2.0 * gains.k")) == 6.0
    (theirs,) = {*cache.rglob("*.code")} - {ours}
    ours.write_bytes(theirs.read_bytes())  # its seal is of its name, too
    assert hits(mine("gains.k")) == 0
    assert force(mine("gains.k")) == 3.0


@pytest.mark.skipif(os.name != "posix", reason="rights of POSIX")
def test_code_that_another_user_may_have_written_is_not_loaded(cache, monkeypatch):
    """It is a pickle, which runs what it holds."""
    force(mine("gains.k"))
    (file,) = cache.rglob("*.code")
    assert hits(mine("gains.k")) == 1
    for path in (file, cache):
        mode = path.stat().st_mode
        for right in (0o020, 0o002):
            path.chmod(mode | right)
            assert hits(mine("gains.k")) == 0
            file.chmod(0o600)
            cache.chmod(0o700)
    assert hits(mine("gains.k")) == 1
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    if file.stat().st_uid != 0:
        assert hits(mine("gains.k")) == 0


@pytest.mark.parametrize("error", [AttributeError, ImportError, SystemError])
def test_code_that_cannot_be_loaded_is_compiled_anew(error, monkeypatch):
    def damaged(*_):
        raise error

    force(mine("gains.k"))
    monkeypatch.setattr(pickle, "loads", damaged)
    assert force(mine("gains.k")) == 3.0


PAIR = """
import sys

import numba
import smc_mujoco as smc
from smc_mujoco.simulation import cfunctions

gains = {"k": 3.0}


@smc.law_function(joint=True, gains=gains)
def weak(y, gains, memory):
    return -gains.k * y.x, y.e


@smc.law_function(joint=True, gains=gains)
def strong(y, gains, memory):
    return -2.0 * gains.k * y.x, y.e


def scenario(law):
    return smc.Scenario(plant="double_pendulum", law=law, duration=0.002)


if __name__ == "__main__":
    import pair

    numba.config.CACHE_DIR = sys.argv[1]
    cfunctions.compile_component(getattr(pair, sys.argv[2])())
"""


@pytest.mark.slow
def test_code_of_two_processes_is_not_mixed_up(cache, tmp_path, monkeypatch):
    """Numba numbers functions of one name, such as those around a law, and each of the processes
    counts from the start.

    A process that loads both would run the code that it loads first in both laws.
    """
    (tmp_path / "pair.py").write_text(PAIR)
    monkeypatch.syspath_prepend(tmp_path)
    import pair  # pyright: ignore[reportMissingImports]

    laws = pair.weak, pair.strong
    for law in laws:
        subprocess.run([sys.executable, "pair.py", cache, law.name], check=True, cwd=tmp_path)
    loaded = [cfunctions.compile_component(law()) for law in laws]
    assert [code._cfunc.cache_hits for code in loaded] == [1, 1]
    for trace in smc.run([pair.scenario(law) for law in laws]):
        assert_same(trace, reference.run(trace.scenario))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_forked_processes_number_functions_apart():
    ours, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        os.write(theirs, b"%d" % next(NUMBERS.count))
        os._exit(0)
    os.waitpid(child, 0)
    assert abs(int(os.read(ours, 100)) - next(NUMBERS.count)) > 1_000_000
    os.close(ours)
    os.close(theirs)


def test_numba_numbers_the_functions_of_others_as_ever(cache):
    before = next(FunctionIdentity._unique_ids)
    assert force(mine()) == 3.0
    assert list(cache.rglob("*.code"))
    assert next(FunctionIdentity._unique_ids) == before + 1


@njit
def doubled_by_sorting(x):
    pair = np.array([2.0 * x, x])
    pair.sort()
    return pair[1]


@pytest.mark.parametrize(
    ("body", "thing"),
    [
        ("thing(gains.k)", ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(lambda x: 2.0 * x)),
        ("thing[0] * gains.k", np.full(1_000_000, 2.0)),  # too large to be copied into code
        ("thing(gains.k)", doubled_by_sorting),
    ],
    ids=["function", "array", "function that was compiled before"],
)
def test_code_that_holds_an_address_or_a_number_of_this_process_is_not_kept(cache, body, thing):
    """It would be another one in the next process.

    Numba numbers its own function that sorts, and may give the number to another elsewhere.
    """
    if thing is doubled_by_sorting:
        doubled_by_sorting(1.0)
    assert force(mine(body, thing=thing)) == 6.0
    assert list(cache.rglob("*.code")) == []


def test_own_functions_divide_as_numpy_does_and_those_of_laws_as_python_does():
    """An exception cannot leave the callback, so a division by zero gives inf there.

    In a law it ends the run.
    """
    from smc_mujoco.control import law

    of_callbacks = "controller", "exogenous", "joint_controller", "parts", "philox", "signals"
    modules = []
    for name in (*of_callbacks, "time_series"):
        modules.append(importlib.import_module(f"smc_mujoco.simulation.{name}"))

    def models(*modules):
        dividing = []
        for module in modules:
            for member in vars(module).values():
                if (
                    hasattr(member, "targetoptions")
                    and member.py_func.__module__ == module.__name__
                ):
                    dividing.append(member.targetoptions.get("error_model", "python"))
        return dividing

    callbacks = models(*modules)
    assert len(callbacks) > 20
    assert set(callbacks) == {"numpy"}
    assert set(models(law)) == {"python"}


def test_the_callback_is_compiled_without_what_few_runs_have():
    """A first run waits for all that it reaches: with laws of many joints and disturbances it took
    twice the time.
    """
    from smc_mujoco.common.rebuild import helpers
    from smc_mujoco.simulation import controller, exogenous, joint_controller

    compiled_with_it = set()
    ask_joints: Any = controller._ask_joints
    callback: Any = controller.control
    unread = [callback.py_func]
    while unread:
        function = unread.pop()
        if function not in compiled_with_it:
            compiled_with_it.add(function)
            unread += helpers(function)
    assert ask_joints.py_func in compiled_with_it
    seldom: list[Any] = [joint_controller.ask, joint_controller.mix, exogenous.disturb]
    for apart in seldom:
        assert apart.py_func not in compiled_with_it
