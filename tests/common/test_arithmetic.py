"""A run is refused where other code has changed how its thread computes."""

import os

import pytest
from helpers.commands import python

ROUNDS_UP = """
import ctypes
import smc_mujoco as smc
from smc_mujoco.common import arithmetic

scenario = smc.Scenario(plant="duffing", law="classical", duration=0.01)
smc.run(scenario)
library = ctypes.PyDLL(None)
environment = ctypes.create_string_buffer(256)
library.fegetenv(environment)
flushed = ctypes.create_string_buffer(bytes(environment), 256)
ctypes.c_uint32.from_buffer(flushed, 28).value |= 0x8040  # small results and operands are 0
for change in (
    *(lambda mode=mode: library.fesetround(mode) for mode in (0x400, 0x800, 0xC00)),
    lambda: library.fesetenv(flushed),
):
    change()
    usual = arithmetic.computes_as_usual()
    try:
        smc.run(scenario)
    except smc.ScenarioError as error:
        words = str(error)
    library.fesetenv(environment)
    print(usual, "arithmetic of this thread" in words)
print(smc.run(scenario).failure)
"""


@pytest.mark.skipif(
    os.name != "posix" or os.uname().machine != "x86_64",
    reason="the numbers of the modes are those of x86 and of the GNU C library",
)
def test_a_run_is_refused_where_other_code_has_set_the_rounding(tmp_path):
    """It would change every run of the process in silence. In a process of its own: a change would
    spoil later tests.
    """
    printed = python("-c", ROUNDS_UP, folder=tmp_path).stdout.splitlines()
    assert printed == ["False True"] * 4 + ["None"]
