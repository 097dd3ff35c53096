"""What a translated expression is: its text in C, how tightly it binds, its kind; and what cannot be translated."""

import ast
import math
from typing import NamedTuple

from smc_mujoco.common.errors import ScenarioError, shown

# Kinds of numbers, narrow to wide; `single` is Python's numpy.float32, `real` what the file calls smc_real.
NUMBERS = ("bool", "int", "single", "real")
POINTERS = ("y", "gains", "memory")  # what a law is given
TYPES = {"bool": "int32_t", "int": "int32_t", "single": "float", "real": "smc_real"}

# How tightly C's operators bind; an operand that binds less is put in parentheses.
ATOM, UNARY, PRODUCT, SUM, LOOSE = 5, 4, 3, 2, 1


class Untranslatable(ScenarioError):
    """What has no translation into C."""


class Array(NamedTuple):
    """A constant array of the file."""

    name: str
    kind: str


class Value(NamedTuple):
    """An expression in C."""

    text: str
    kind: str
    level: int = ATOM

    def within(self, level: int) -> str:
        """The text as an operand of something that binds as tightly as `level`."""
        return self.text if self.level >= level else f"({self.text})"


def refuse(node: ast.AST | None, what: str) -> Untranslatable:
    """The error for a piece of Python."""
    code = f" ({shown(ast.unparse(node))[1:-1]})" if node is not None else ""
    return Untranslatable(
        f"{what}{code} has no translation into C: write it with arithmetic, if, for and math's functions"
    )


def wider(one: str, other: str) -> str:
    """The kind that an operation of two kinds gives, as C and numba agree; int and single meet in real."""
    if {one, other} in ({"int", "single"}, {"bool", "single"}):
        return "real"
    return max(one, other, key=NUMBERS.index)


def number(value: object, single: bool, node: ast.AST | None = None) -> Value:
    """A constant of Python as one of C; `single` where smc_real is float."""
    kind = "single" if type(value).__name__ == "float32" else "real"
    if isinstance(value, bool):
        return Value(str(int(value)), "bool")
    if type(value).__name__.startswith("int"):
        n = int(value)  # pyright: ignore[reportArgumentType]
        if not -(2**31) < n < 2**31:
            raise refuse(node, f"the whole number {n}, beyond 32 bits,")
        return Value(str(n), "int", ATOM if n >= 0 else UNARY)
    try:
        x = float(value)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError):
        raise refuse(node, f"the value {shown(value)}") from None
    if math.isnan(x) or math.isinf(x):
        return Value("NAN" if math.isnan(x) else "INFINITY" if x > 0.0 else "-INFINITY", kind, UNARY)
    text = repr(x)
    return Value(text + "f" * (single or kind == "single"), kind, UNARY if text.startswith("-") else ATOM)


def plain(name: str) -> str:
    """A name as C99 takes it everywhere, of ASCII letters."""
    return "".join(c if c.isascii() else f"u{ord(c):04x}" for c in name)
