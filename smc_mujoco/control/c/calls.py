"""Calls of what Python, math and numpy have built in, as calls of math.h and of small functions of the file's."""

import ast
import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from smc_mujoco.control.c.values import UNARY, Array, Value, refuse, wider

# Functions of math with the same name in C.
NAMES = """sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp expm1 log log1p log10 log2 sqrt hypot
fabs copysign fmod"""
SAME = {getattr(math, name) for name in NAMES.split()}
WHOLE = {math.floor: "floor", math.ceil: "ceil", math.trunc: "trunc"}  # of a number, a whole number in Python
MATH = {"pow", *WHOLE.values(), *(f.__name__ for f in SAME)}
CASTS = {float: "real", np.float64: "real", np.float32: "single", int: "int"}
TYPES = {"real": "smc_real", "single": "float", "int": "int32_t"}


class Unit(Protocol):
    """The file that an expression is part of."""

    single: bool

    def helper(self, name: str, kind: str) -> str:
        """The name of a small function of the file's, `least`, `most`, `size` or a power, of numbers of a kind."""
        ...

    def array(self, name: str, values: Any) -> Array:
        """A constant array of the file's."""
        ...

    def function(
        self, function: Any, arguments: Sequence[Value], nodes: Sequence[ast.expr]
    ) -> tuple[str, list[str], list[Value]]:
        """A function of the file's: its name, the kinds it returns, and the arguments that it takes."""
        ...


def built_in(unit: Unit, function: Any, values: list[Value], node: ast.Call) -> Value | None:
    """A call of what Python or numpy have built in; None for another."""
    if function in (min, max):
        return extreme(unit, "least" if function is min else "most", values, node)
    if function in CASTS and len(values) == 1:
        kind = CASTS[function]
        return Value(f"({TYPES[kind]}){values[0].within(UNARY)}", kind, UNARY)
    if function in (abs, math.fabs):
        if values[0].kind in ("int", "bool"):
            return Value(f"{unit.helper('size', 'int')}({values[0].text})", "int")
        return called(unit, "fabs", values)
    if function in WHOLE:
        return Value(f"(int32_t){called(unit, WHOLE[function], values).text}", "int", UNARY)
    return called(unit, function.__name__, values) if function in SAME else None


def extreme(unit: Unit, name: str, values: list[Value], node: ast.Call) -> Value:
    """min or max, from left to right."""
    if len(values) == 1:
        raise refuse(node, "min or max of one thing")
    found = values[0]
    for value in values[1:]:
        kind = wider(found.kind, value.kind)
        found = Value(f"{unit.helper(name, kind)}({found.text}, {value.text})", kind)
    return found


def called(unit: Unit, name: str, values: Sequence[Value]) -> Value:
    """A function of math.h, of the precision of what it is given."""
    single = all(v.kind == "single" for v in values)
    suffix = "f" if single or unit.single else ""
    return Value(f"{name}{suffix}({', '.join(v.text for v in values)})", "single" if single else "real")
