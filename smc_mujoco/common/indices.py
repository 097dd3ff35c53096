"""Whether a function indexes arrays only where its memory surely is.

On a card, compiled code has no checks of bounds: a law that writes beyond its memory would write
into its neighbour's numbers.
"""

from types import FunctionType
from typing import Any

from smc_mujoco.common import numba_internals as internals
from smc_mujoco.common.rebuild import helpers


def constant_indices(function: Any, size: int) -> bool:
    """Return whether every index in a function, and in the compiled functions that it calls, is a
    constant of an array of this size.
    """
    if not isinstance(function, FunctionType):
        return False
    code = internals.run_frontend(function)
    for block in code.blocks.values():
        for statement in block.body:
            if not all(-size <= index < size for index in _indices(code, statement)):
                return False
    return all(constant_indices(helper, size) for helper in helpers(function))


def _indices(code: Any, statement: Any) -> list[float]:
    """Return the indices of a statement, NaN for what is no constant integer."""
    place = statement
    if isinstance(statement, internals.ir.Assign):
        place = statement.value
        if not isinstance(place, internals.ir.Expr) or "getitem" not in place.op:
            return []
        if getattr(internals.guard(code.get_definition, place.value), "op", "") == "exhaust_iter":
            return []  # u, s = helper(y)
    elif not isinstance(statement, internals.ir.SetItem | internals.ir.StaticSetItem):
        return []
    index = place.index
    if isinstance(index, internals.ir.Var):
        index = internals.guard(internals.find_const, code, index)
    return [index if isinstance(index, int) else float("nan")]
