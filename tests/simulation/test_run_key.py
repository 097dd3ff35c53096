"""What tells runs apart: equal ones have one key, and what decides what a run does changes it."""

import dataclasses
import functools
import importlib
import math
import shutil
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from helpers import runs
from helpers.commands import python
from llvmlite import ir
from numba import from_dtype, types

import smc_mujoco as smc
from smc_mujoco.common import fingerprint
from smc_mujoco.control import joint_law
from smc_mujoco.mechanisms.plant import Variant
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.simulation import gaber_study, scenario_json
from smc_mujoco.simulation.grid import grid
from smc_mujoco.simulation.run_key import condition, run_key

pytestmark = pytest.mark.quick

scenario = functools.partial(runs.scenario, duration=0.05)


@pytest.mark.parametrize("plant", gaber_study.PLANTS)
def test_every_condition_is_known_by_its_name(plant):
    scenarios = grid([plant], ["observer_free"], list(gaber_study.CONDITIONS), 2, "study")
    assert (
        [condition(s) for s in scenarios[::2]]
        == [condition(s) for s in scenarios[1::2]]
        == list(gaber_study.CONDITIONS)
    )


def test_a_condition_that_the_paper_has_not_is_told_by_what_differs():
    assert condition(scenario(smc.law("classical"), u_max=4.0, seed=3)) == "u_max=4.0"
    assert (
        condition(scenario(smc.law("classical"), friction=smc.Coulomb(0.2)))
        == "friction=(Coulomb(level=0.2),)"
    )
    many = {
        "noise": smc.Noise(0.1, 0.2),
        "disturbance": (smc.Sine(0.1, 2.0), smc.signals.Pulse(2.0, time=0.01, width=0.1)),
    }
    names = []
    for delay in (0.001, 0.002):
        names.append(condition(scenario(smc.law("classical"), input_delay=delay, **many)))
    assert len(set(names)) == 2
    assert max(map(len, names)) < 80


def test_equal_scenarios_have_one_key_and_others_another():
    s = scenario(smc.law("classical"))
    same = scenario(smc.law("classical"), physics_step=1e-3, integrator="RK4", x0=s.resolved.x0)
    assert same == s
    assert run_key(same) == run_key(s)
    different = [
        scenario(smc.law("classical", k=3.0)),
        scenario(smc.law("adaptive")),
        scenario(smc.law("classical"), seed=1),
        scenario(smc.law("classical"), duration=0.06),
        scenario(smc.law("classical"), plant=smc.plant("duffing", alpha=0.5)),
    ]
    assert len({run_key(s), *map(run_key, different)}) == 1 + len(different)


def test_other_versions_are_other_runs(monkeypatch):
    before = run_key(scenario(smc.law("classical")))
    described = scenario_json.describe
    monkeypatch.setattr(
        scenario_json, "describe", lambda s: described(s) | {"versions": {"mujoco": "99"}}
    )
    assert run_key(scenario(smc.law("classical"))) != before


LAW = """
import math
import smc_mujoco as smc
from numba import njit
GAIN = {constant}

@njit
def helper(x):
    "{words}"
    return {helper}

@smc.law_function(gains={{"k": 1.0}})
def mine(y, gains, memory):
    "{words}"
    return {law}, y.e

class Push(smc.Signal):
    amplitude: float = 1.0

    @staticmethod
    def value(t, p):
        return {signal}, 0.0, 0.0
"""


def written(
    law="-gains.k * helper(y.e)",
    helper="GAIN * x",
    constant="2.0",
    signal="p.amplitude",
    before="",
    words="One.",
    module="written",
) -> str:
    """The key of a run under a law of the user's."""
    space: dict = {"__name__": module}
    text = before + LAW.format(
        law=law,
        helper=helper,
        constant=constant,
        signal=signal,
        words=words,
    )
    exec(compile(text, "written", "exec"), space)
    return run_key(scenario(space["mine"](), disturbance=space["Push"]()))


@pytest.mark.parametrize(
    "edit",
    [
        {"law": "-2.0 * gains.k * helper(y.e)"},
        {"law": "gains.k * helper(y.e)"},
        {"helper": "GAIN * math.tanh(x)"},
        {"constant": "3.0"},
        {"signal": "2.0 * p.amplitude"},
    ],
    ids=["constant of the law", "sign", "helper", "global constant", "signal"],
)
def test_an_edited_law_is_another_run(edit):
    assert written() != written(**edit)


def test_a_script_that_is_imported_has_the_same_runs():
    assert written(module="__main__") == written() != written(module="__main__", helper="x")


def test_a_gain_and_a_module_of_this_package_count_by_whatever_name():
    @smc.law_function(gains={"module": 1.0})
    def mine(y, gains, memory):
        return -gains.module * y.e, y.e

    assert run_key(scenario(mine(module=1.0))) != run_key(scenario(mine(module=2.0)))
    ours = scenario_json.describe(scenario(smc.law("classical")))
    of_another_module = ours | {"law": ours["law"] | {"module": "smc_mujoco.control.laws.adaptive"}}
    assert run_key(scenario(smc.law("classical")), ours) != run_key(
        scenario(smc.law("classical")), of_another_module
    )


def test_every_law_of_a_mixture_decides_the_key():
    def mixed(factors) -> str:
        laws = []
        for factor in factors:
            space: dict = {"__name__": "written"}
            exec(f"def mine(y, gains, memory): return -{factor} * y.e, y.e", space)
            laws.append(smc.law_function(space["mine"])())
        return run_key(smc.Scenario(plant="double_pendulum", law=laws, duration=0.05))

    assert mixed((1.0, 2.0)) == mixed((1.0, 2.0))
    assert len({mixed(pair) for pair in ((1.0, 2.0), (1.0, 3.0), (4.0, 2.0), (2.0, 1.0))}) == 4


def test_a_comment_a_line_more_or_other_docstrings_are_no_edit():
    assert written() == written() == written(before="# a comment\n\n") == written(words="Two.")


def test_another_order_of_a_class_s_definitions_is_no_edit():
    ordered = {"a": 1.0, "b": 2.0}
    reversed_order = {"b": 2.0, "a": 1.0}
    assert fingerprint.of(type("Mine", (), ordered)) == fingerprint.of(
        type("Mine", (), reversed_order)
    )
    assert fingerprint.of(type("Mine", (), ordered)) != fingerprint.of(
        type("Mine", (), {"a": 2.0, "b": 1.0})
    )


def test_a_key_does_not_depend_on_the_process():
    expression = "grid(['duffing'], ['adaptive'], ['noise'], [3], 'study')[0]"
    code = (
        "from smc_mujoco import grid; from smc_mujoco.simulation.run_key import run_key; "
        f"print(run_key({expression}))"
    )
    done = python("-c", code, PYTHONHASHSEED="1")
    assert done.stdout.strip() == run_key(
        grid(["duffing"], ["adaptive"], ["noise"], [3], "study")[0]
    )


def test_types_that_a_compiler_has_made_by_then_change_no_key(monkeypatch):
    """A law of many joints reaches llvmlite, which keeps each type that it has made, and numba,
    which numbers them.
    """
    joint = smc.Scenario(plant="inverted_pendulum_network", law="passivity_based")
    before = run_key(joint), fingerprint.now(joint.law.function)
    ir.IntType(57)
    monkeypatch.setattr(from_dtype(joint_law.HANDLE), "_code", 1_000_000)
    assert (run_key(joint), fingerprint.now(joint.law.function)) == before
    assert fingerprint.now(types.float32) != fingerprint.now(types.float64)


def test_a_global_changes_a_run_until_its_law_is_compiled():
    """Compiled code keeps its globals. A study whose runs are all stored compiles nothing."""
    space = {"__name__": "users", "G": 3.0}
    exec("def late(y, gains, memory):\n    return -G * y.e, y.e", space)
    law = smc.law_function(space["late"])()
    first, second = (
        smc.Scenario(
            plant="duffing",
            law=law,
            duration=0.01,
            x0=x,
        )
        for x in (0.5, 0.6)
    )
    before = run_key(first)
    space["G"] = 5.0
    assert run_key(first) != before
    key_when_compiled = run_key(second)
    assert smc.run(second).u[0, 0] == -5.0 * 0.6
    space["G"] = 7.0
    assert run_key(second) == key_when_compiled
    assert smc.run(second).u[0, 0] == -5.0 * 0.6


def test_a_function_that_reaches_itself_has_a_fingerprint():
    def loop(n):
        return loop(n - 1) if n else 0

    assert fingerprint.of(loop) == fingerprint.of(loop)


def test_an_object_that_is_called_is_told_by_what_it_holds():
    class Policy:
        def __init__(self, weights):
            self.weights = weights

        def __call__(self, y, gains, memory):
            return float(self.weights @ [y.e, y.de]), y.e

    policy, same, changed = (Policy(np.array(w)) for w in ([1.0, 2.0], [1.0, 2.0], [1.0, 3.0]))
    assert fingerprint.of(policy) == fingerprint.of(same) != fingerprint.of(changed)


class Weighted:
    """Has methods that may be laws."""

    def __init__(self, weight: float):
        self.weight = weight

    def law(self, y, gains, memory):
        return self.weight * y.e, y.e


def reaching(value: object, text: str = "THING(y.e)", before: str = "") -> Callable:
    """A law that calls something global."""
    space: dict = {"__name__": "written", "THING": value, "functools": functools}
    exec(f"{before}\ndef law(y, gains, memory): return {text}, y.e", space)
    return space["law"]


def package(factor: float) -> ModuleType:
    """A package with a module in it."""
    inner = ModuleType("mine.inner")
    outer = ModuleType("mine")
    exec(f"def helper(x): return {factor} * x", vars(inner))
    vars(outer)["inner"] = inner
    return outer


@pytest.mark.parametrize(
    "made",
    [
        lambda k: Weighted(k).law,
        lambda k: functools.partial(Weighted.law, weight=k),
        lambda k: reaching(functools.partial(max, k)),
        lambda k: reaching(np.vectorize(lambda x: k * x)),
        lambda k: reaching(np.poly1d([k, 1.0])),
        lambda k: reaching(package(k), "THING.inner.helper(y.e)"),
        lambda k: reaching(type("Table", (), {"values": (k, 1.0)}), "THING.values[0]"),
        lambda k: reaching(None, "helper(y.e)", f"@functools.cache\ndef helper(x): return {k} * x"),
    ],
    ids=[
        "method",
        "partial",
        "global partial",
        "vectorized",
        "object",
        "package",
        "class",
        "kept results",
    ],
)
def test_everything_that_a_law_reaches_is_in_its_fingerprint(made):
    assert fingerprint.of(made(1.0)) == fingerprint.of(made(1.0)) != fingerprint.of(made(2.0))


IMPORTING = {
    "a module": "import a_helper\n    return a_helper.factor(y.e), y.e",
    "a name": "from a_helper import factor\n    return factor(y.e), y.e",
    "in a function within": "def g(x):\n        from a_helper import factor as f\n"
    "        return f(x)\n    return g(y.e), y.e",
}


@pytest.mark.parametrize("way", IMPORTING)
def test_what_a_law_imports_in_its_body_is_in_its_fingerprint(way, tmp_path, monkeypatch):
    """A kept run of an old helper was taken for that of the new one."""
    monkeypatch.syspath_prepend(tmp_path)
    hashes = []
    for gain in (1.0, 1.0, 22.0):
        (tmp_path / "a_helper.py").write_text(f"K = {gain}\ndef factor(x):\n    return K * x\n")
        monkeypatch.delitem(sys.modules, "a_helper", raising=False)
        importlib.invalidate_caches()
        monkeypatch.setattr(sys, "dont_write_bytecode", True)
        space: dict = {"__name__": "written"}
        exec(f"def law(y, gains, memory):\n    {IMPORTING[way]}", space)
        hashes.append(fingerprint.now(space["law"]))
    monkeypatch.delitem(sys.modules, "a_helper")
    assert hashes[0] == hashes[1] != hashes[2]


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("open('k.txt').read()", ["open"]),
        ("globals()['K']", ["globals"]),
        ("getattr(math, 'sin')(y.e)", ["getattr"]),
        ("np.load('k.npy')[0]", ["np.load"]),
        ("Path('k.txt').read_text()", ["read_text"]),
        ("np.sin(y.load)", []),
    ],
)
def test_what_a_law_reads_by_a_text_is_said_not_to_count(text, names):
    space: dict = {"__name__": "written", "np": np, "math": math, "Path": Path}
    exec(f"def mine(y, gains, memory): return {text}, y.e", space)
    digest = fingerprint.now(space["mine"])
    assert fingerprint.unseen(digest) == ({"mine": names} if names else {})
    law = smc.law_function(gains={"k": 1.0})(space["mine"])()
    with warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        run_key(scenario(law))
    assert [str(w.message).partition(",")[0] for w in raised] == [
        f"mine reads by {name}" for name in names
    ]


def test_an_object_that_changed_is_another():
    policy = Weighted(1.0)
    before = fingerprint.of(policy)
    policy.weight = 2.0
    assert fingerprint.of(policy) != before


def test_a_key_changes_with_the_code_of_the_package_but_not_with_that_of_its_commands(
    monkeypatch, tmp_path
):
    scenario = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=1.0)
    package = tmp_path / "smc_mujoco"
    shutil.copytree(
        fingerprint.PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__", "tuned_gains")
    )
    monkeypatch.setattr(fingerprint, "PACKAGE", package)

    def now() -> str:
        fingerprint.package.cache_clear()
        return run_key(scenario)

    same = now()
    (package / "cli" / "words.py").write_text("# other words")
    assert now() == same
    (package / "simulation" / "callback.py").write_text("# another loop")
    assert now() != same
    fingerprint.package.cache_clear()


def test_replaced_functions_of_a_plant_change_the_key():
    def nominal(x, v, i, q):
        return 0.0, 1.0

    def nothing(*given):
        yield from ()

    # without a module, as SymPy's lambdify
    exec("def generated(x, v, i, q): return 0.0, 2.0", space := {})
    own = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.1)
    contacts = own.plant.contacts
    mechanisms = own.plant.mechanisms
    changes = (
        {"nominal": nominal},
        {"nominal": space["generated"]},
        {"fields": nothing},
        {"contacts": {**contacts, "other": nothing}},
        {"mechanisms": {**mechanisms, "other": Variant(nothing, nothing)}},
        {"contacts": {**contacts}, "mechanisms": {**mechanisms}},
    )
    plants = []
    for change in changes:
        plants.append(dataclasses.replace(own.plant, **change))
    *different, same = [run_key(dataclasses.replace(own, plant=plant)) for plant in plants]
    assert len({run_key(own), *different}) == 6
    assert same == run_key(own)


def test_metrics_are_the_same_after_a_score():
    """A cache of results that they reach would change the hash of their code, and so discard stored
    studies.
    """
    formulas = tuple(metric.formula for metric in metrics())
    before = fingerprint.now(formulas)
    smc.score(smc.run(scenario(smc.law("classical"))))
    assert fingerprint.now(formulas) == before


def test_a_global_with_the_name_of_an_attribute_does_not_count():
    space = {"__name__": "users", "t": 3.0, "G": 2.0}
    exec("def timed(y, gains, memory):\n    return -G * y.e + 0.0 * y.t, y.e", space)
    before = fingerprint.now(space["timed"])
    space["t"] = open  # neither read by the law nor comparable
    assert fingerprint.now(space["timed"]) == before
    space["G"] = 5.0
    assert fingerprint.now(space["timed"]) != before
