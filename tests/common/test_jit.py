"""Helpers that laws call: this package's are compiled once for all laws, a user's again for each law."""

from collections.abc import Callable
from typing import Any

import pytest
from numba import njit

import smc_mujoco as smc
from smc_mujoco.common.jit import jit, reason

pytestmark = pytest.mark.quick


def names(function: Callable[..., Any] | None) -> dict[str, Any]:
    """Return what the names in a compiled function stand for."""
    compiled: Any = function
    return getattr(compiled, "py_func", compiled).__globals__


def test_reasons_have_no_terminal_codes_from_quoted_texts():
    error = ValueError("\x1b[1m\x1b[31mFailed in nopython mode\nit returns Literal[str](\x1b]0;owned\x07)\x1b[0m")
    assert reason(error) == r"it returns Literal[str](\x1b]0;owned\x07)"


def test_laws_share_the_package_s_helpers():
    plain = smc.law("classical").function
    one, other = (names(jit(smc.law(name).function)) for name in ("classical", "super_twisting"))
    assert one["sliding"] is other["sliding"]
    assert one["sliding"] is not names(plain)["sliding"]


def test_a_user_s_helper_follows_a_change_of_its_globals():
    """The reference loop would follow it too: a copy from before would give other numbers."""
    space = {"njit": njit}
    exec("K = 2.0\n@njit\ndef helper(x):\n    return K * x", space)
    laws = []
    for _ in range(2):
        exec("def mine(y, gains, memory):\n    return helper(y.e), y.e", space)
        laws.append(names(jit(space["mine"]))["helper"])
    assert laws[0] is not laws[1]
