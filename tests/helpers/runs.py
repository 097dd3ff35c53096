"""Short runs and how to compare them: what the tests of simulations and studies share."""

import math
import warnings

import numpy as np

import smc_mujoco as smc
from helpers import reference

# the plants that are no free body
JOINTED = [name for name in smc.plants() if not smc.plant(name).pose]
ARRAYS = ("t", "x", "v", "u", "applied", "s", "d", "r")


def at_defaults(law):
    """A law; a name means its default gains, where a scenario would take the shipped ones."""
    return smc.law(law) if law in smc.laws() else law


def scenario(law="classical", **fields):
    """A Duffing oscillator for 20 ms, unless fields say otherwise. A law's name is its defaults."""
    law = at_defaults(law)
    return smc.Scenario(**{"plant": "duffing", "law": law, "duration": 0.02} | fields)


def free_mass(mass=1.0):
    """A block, kg, that nothing but u and d moves."""
    return smc.plant("duffing", M=mass, delta=0.0, alpha=0.0, beta=0.0)


def made(function, gains=None, memory=8):
    """A law of a function."""
    return smc.law_function(gains=gains, memory=memory)(function)()


def plainly(*args, **kwargs):
    """`smc.run` of something that is called in Python, without the warning about it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", smc.errors.PlainLoopWarning)
        return smc.run(*args, **kwargs)


def same(a, b) -> bool:
    """Whether two traces are equal to the last bit."""
    return all(
        np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True) for name in ARRAYS
    )


def assert_same(a, b):
    """Fail unless two traces hold the same bits and ended the same way."""
    assert a.failure == b.failure
    assert a.diverged_at == b.diverged_at
    for name in ARRAYS:
        np.testing.assert_array_equal(
            getattr(a, name), getattr(b, name), err_msg=f"{name} of {a!r}"
        )


def assert_loops_agree(scenarios, rounding=0.0):
    """Fail unless runs of the callback are those of the oracle, to the bit or to a
    rounding, and go well.
    """
    for declared, trace in zip(scenarios, smc.run(scenarios), strict=True):
        assert trace.failure is None
        expected = reference.run(declared)
        for name in ARRAYS:
            a = getattr(trace, name)
            b = getattr(expected, name)
            np.testing.assert_allclose(
                a, b, rtol=rounding, atol=rounding, err_msg=f"{name} of {trace!r}"
            )


@smc.law_function(gains={"k": 1.0, "when": 0.02})
def fails_late(y, gains, memory):
    """Returns NaN after a time in s."""
    return (math.nan if y.t > gains.when else -gains.k * y.e), y.e
