"""The hash of the machine's arithmetic: of the functions whose last bits differ between C libraries
and processors.
"""

import hashlib
import math
import struct
from types import SimpleNamespace

import pytest

from smc_mujoco.common import fingerprint

FUNCTIONS = ("sin", "cos", "tan", "atan", "tanh", "exp", "log")
INPUTS = [1e-3 * 1.01**k for k in range(1000)]


def reported(functions) -> str:
    values = []
    for f in functions:
        for x in INPUTS:
            values.append(f(x))
    return hashlib.sha256(struct.pack(f"<{len(values)}d", *values)).hexdigest()[:8]


def test_it_is_of_seven_functions_and_of_a_power_with_a_broken_exponent():
    assert fingerprint.arithmetic() == reported(
        [*(getattr(math, name) for name in FUNCTIONS), lambda x: math.pow(x, 0.7)]
    )


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_last_bit_of_one_value_of_a_function_changes_it(name, monkeypatch):
    before = fingerprint.arithmetic()
    exact = getattr(math, name)
    other = {name: lambda x: math.nextafter(exact(x), 9.0) if x == INPUTS[500] else exact(x)}
    functions = {each: getattr(math, each) for each in FUNCTIONS} | other
    monkeypatch.setattr(fingerprint, "math", SimpleNamespace(**functions))
    assert fingerprint.arithmetic.__wrapped__() != before
