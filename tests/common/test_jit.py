"""Helpers that laws call: this package's are compiled once for all laws, a user's anew with each law."""

from numba import njit

import smc_mujoco as smc
from smc_mujoco.common.jit import jit


def test_laws_share_the_package_s_helpers():
    one, other = (jit(smc.law(name).function).py_func.__globals__ for name in ("classical", "super_twisting"))
    assert one["sliding"] is other["sliding"]
    assert one["sliding"] is not smc.law("classical").function.__globals__["sliding"]


def test_a_user_s_helper_follows_a_change_of_its_globals():
    """The reference loop would follow it too: a copy from before would give other numbers."""
    space = {"njit": njit}
    exec("K = 2.0\n@njit\ndef helper(x):\n    return K * x", space)
    laws = []
    for _ in range(2):
        exec("def mine(y, gains, memory):\n    return helper(y.e), y.e", space)
        laws.append(jit(space["mine"]).py_func.__globals__["helper"])
    assert laws[0] is not laws[1]
