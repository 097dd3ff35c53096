"""Helpers that laws call: this package's are compiled once for all laws, a user's again for each
law.
"""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numba import njit
from numba.core import utils
from numba.core.codegen import CPUCodeLibrary, RuntimeLinker

import smc_mujoco as smc
from smc_mujoco.common import numba_internals as internals
from smc_mujoco.common.jit import NotCompilable, Numbers, _complete, jit, reason
from smc_mujoco.control.law import sgn
from smc_mujoco.simulation.cfunctions import compile_component

pytestmark = pytest.mark.quick


def names(function: Callable[..., Any] | None) -> dict[str, Any]:
    """Return what the names in a compiled function stand for."""
    compiled: Any = function
    return getattr(compiled, "py_func", compiled).__globals__


def test_reasons_have_no_terminal_codes_from_quoted_texts():
    error = ValueError(
        "\x1b[1m\x1b[31mFailed in nopython mode\nit returns Literal[str](\x1b]0;owned\x07)\x1b[0m"
    )
    assert reason(error) == r"it returns Literal[str](\x1b]0;owned\x07)"


def test_laws_share_the_package_s_helpers():
    plain = smc.law("classical").function
    of_classical, of_super_twisting = (
        names(jit(smc.law(name).function)) for name in ("classical", "super_twisting")
    )
    assert of_classical["sliding"] is of_super_twisting["sliding"]
    assert of_classical["sliding"] is not names(plain)["sliding"]


def test_a_user_s_helper_follows_a_change_of_its_globals():
    """As it does where the law is called in Python."""
    space = {"njit": njit}
    exec("K = 2.0\n@njit\ndef helper(x):\n    return K * x", space)
    laws = []
    for _ in range(2):
        exec("def mine(y, gains, memory):\n    return helper(y.e), y.e", space)
        laws.append(names(jit(space["mine"]))["helper"])
    assert laws[0] is not laws[1]


def test_code_is_kept_if_no_other_process_numbers_a_function_alike_and_no_address_is_added():
    own = f"f_B1v{Numbers.FIRST}"
    numbas = "f_B1v7"
    for names_of, declared, filled, on_disk in (
        ([own, own], [], "x", True),
        ([own, numbas], [], "x", False),
        ([numbas, own], [], "x", False),
        ([own], [numbas], "x", True),
        ([own], [], internals.UNRESOLVED, False),
    ):
        functions = []
        for name in names_of:
            functions.append(SimpleNamespace(name=name, is_declaration=False))
        functions += [SimpleNamespace(name=name, is_declaration=True) for name in declared]
        module = SimpleNamespace(
            global_variables=[SimpleNamespace(name=filled)], functions=functions
        )
        library: Any = SimpleNamespace(_final_module=module)
        assert _complete(library) == on_disk


@pytest.mark.parametrize(
    ("thing", "attributes"),
    [
        (internals.cgutils, "create_struct_proxy pack_array get_null_value"),
        (internals.FunctionIdentity, "_unique_ids"),
        (internals.CFunc, "compile address cache_hits"),
        (internals.CompileResult, "_reduce _rebuild"),
        (CPUCodeLibrary, "has_dynamic_globals add_linking_library"),
        (internals.builtin_registry, "globals"),
        (internals.global_compiler_lock, "__enter__"),
    ],
)
def test_a_private_name_of_numba_exists(thing, attributes):
    """The next numba is to fail here, and not in a user's run."""
    assert [name for name in attributes.split() if not hasattr(thing, name)] == []


def test_what_is_written_for_numba_s_private_names_are_its_own():
    assert RuntimeLinker.PREFIX == internals.UNRESOLVED
    assert utils._dynamic_modname == internals.DYNAMIC_MODULE


def test_private_names_of_numba_stand_in_one_module():
    package = Path(internals.__file__).parents[1]
    reaching = []
    for file in package.rglob("*.py"):
        if "from numba.core" in file.read_text(encoding="utf-8"):
            reaching.append(file.name)
    assert reaching == ["numba_internals.py"]


def plain_helper(x):
    return 2.0 * x


@njit
def recursive(x):
    return x if x < 1.0 else recursive(x - 1.0)


@njit
def to_odd(x):
    return x if x < 1.0 else to_even(x - 1.0)


@njit
def to_even(x):
    return x if x < 1.0 else to_odd(x - 1.0)


@njit
def reads_flat(memory):
    return memory.flat[99]


counts = np.bincount  # under another name


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (lambda y, gains, memory: (recursive(y.x), 0.0), "recursive calls itself"),
        (lambda y, gains, memory: (to_even(y.x), 0.0), "to_even calls itself"),
        (lambda y, gains, memory: (reads_flat(memory), 0.0), "it uses flat"),
        (lambda y, gains, memory: (1.0 * counts(memory)[0], 0.0), "it uses bincount"),
    ],
)
def test_what_compiled_code_does_not_check_is_called_in_python(law, words):
    with pytest.raises(NotCompilable, match=words):
        jit(law)


def test_the_plain_helpers_of_a_law_are_named_with_their_cure():
    def inner(x):
        return x

    def outer(x):
        return inner(x)

    @njit
    def middle(x):
        return outer(x)

    for law, name in (
        (lambda y, gains, memory: (plain_helper(y.x), 0.0), "plain_helper$"),
        (lambda y, gains, memory: (inner(y.x), 0.0), "inner$"),
        (lambda y, gains, memory: (plain_helper(inner(y.x)), 0.0), "plain_helper and inner$"),
        (lambda y, gains, memory: (middle(sgn(y.x)), 0.0), "outer and inner$"),
    ):
        with pytest.raises(NotCompilable, match=f"put @numba.njit on {name}"):
            compile_component(smc.law_function(law)())
