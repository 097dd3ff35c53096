"""A user's function computes the same compiled as in Python, or Python calls it, or it is named."""

import dataclasses
import math
import random
import time
import warnings

import numpy as np
import pytest
from helpers.runs import made, scenario

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioWarning
from smc_mujoco.simulation import agreement, cfunctions, python_functions
from smc_mujoco.simulation.prepare import why_not_compiled
from smc_mujoco.simulation.run import PlainLoopWarning
from smc_mujoco.simulation.signals import Signal

DIFFERENT = [  # each alone against one way in which the forms differ
    lambda y, gains, memory: (2**70 * 1e-21, 0.0),
    lambda y, gains, memory: (float(np.mod(-7, 3) + np.fmod(-7, 3)), 0.0),
    lambda y, gains, memory: (10 ** int(y.x * 0.0 - 3.0), 0.0),
    lambda y, gains, memory: (math.tanh(0.0**-1.0), 0.0),  # Python raises
    lambda y, gains, memory: (0.0, 1.0 * int(y.t * 1e9) ** 3),  # at large times, in s
]


@pytest.mark.quick
@pytest.mark.parametrize("law", DIFFERENT)
def test_a_law_whose_compiled_form_differs_is_called_in_python_and_told(law):
    case = scenario(made(law), duration=0.01)
    with pytest.warns(PlainLoopWarning, match="compiled and .* in Python, for the same inputs"):
        trace = smc.run(case)
    expected = python_functions.PythonComponent(case.law, 1)
    y = python_functions.Measurement(**dict.fromkeys(python_functions.Measurement._fields, 0.0))
    try:
        assert trace.u[0, 0] == expected(0, y)[0]
    except python_functions.Failure:
        assert "raised ZeroDivisionError" in str(trace.failure)


def test_garbage_that_is_collected_meanwhile_hides_no_difference(monkeypatch):
    """A round of 3 ms beside one that is quick is no slow function."""
    results, rounds = agreement._results, []

    def interrupted(*arguments):
        rounds.append(arguments)
        begin = time.thread_time()
        while len(rounds) == 1 and time.thread_time() < begin + 3 * agreement.SLOW:
            pass
        return results(*arguments)

    monkeypatch.setattr(agreement, "_results", interrupted)
    own = made(lambda y, gains, memory: (2**71 * 1e-21, 0.0))
    with pytest.warns(PlainLoopWarning, match="compiled and .* in Python"):
        smc.run(scenario(own, duration=0.01))


@pytest.mark.parametrize(
    "law",
    [
        lambda y, gains, memory: (np.random.randn(), 0.0),  # noqa: NPY002
        lambda y, gains, memory: (random.random() if y.e > 1.0 else 0.0, 0.0),
    ],
)
def test_a_law_that_draws_random_numbers_is_named_once(law):
    case = scenario(made(law), duration=0.01)
    with pytest.warns(ScenarioWarning, match="its runs cannot be repeated"):
        smc.run(case)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        smc.run(case)


@dataclasses.dataclass(frozen=True)
class Wrapping(Signal):
    """A disturbance whose integer wraps."""

    @staticmethod
    def value(t, p):
        return 2**70 * 1e-21, 0.0, 0.0


@smc.hardware.friction_function(numbers={"level": 0.1})
def wrapping(y, p, memory):
    return p.level * abs(y.v) * (2**70 * 1e-21)


@pytest.mark.parametrize("fields", [{"disturbance": Wrapping()}, {"friction": wrapping()}])
def test_signals_and_frictions_are_compared_too(fields):
    assert "rapping gives " in why_not_compiled(scenario(duration=0.01, **fields))


def test_what_only_compiled_code_can_do_is_no_difference():
    """Its Python raises TypeError where it reads an address."""
    address = np.zeros(1).ctypes.data

    def law(y, gains, memory):
        return agreement_pointer(address)[0], 0.0

    agreement_pointer = cfunctions.pointer
    assert why_not_compiled(scenario(made(law))) == ""


@pytest.mark.slow
def test_every_law_surface_and_estimator_of_the_suite_agrees(monkeypatch):
    monkeypatch.setattr(agreement.fingerprint, "ours", lambda thing: False)
    makers = {"law": smc.law, "joint": smc.law, "surface": smc.surface, "estimator": smc.estimator}
    for kind, make in makers.items():
        for name in smc.laws(kind=kind):
            agreement.check_component(make(name), 6, 6)
            assert cfunctions.compile_component(make(name)).differs == ""
