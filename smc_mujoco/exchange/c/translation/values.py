"""What a value is in C: its type, its text, and where its numbers are stored.

A number in C is an expression. So is an element of an array, with ROW and COLUMN in place of its
indices.
"""

import ast
import functools
import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Names
from smc_mujoco.common.errors import shown
from smc_mujoco.exchange.c.translation.python_source import refuse

# Kinds of numbers from narrow to wide. `single` is numpy.float32 in Python; `real` is smc_real in
# the file.
WIDTHS = ("bool", "int", "single", "real")

WHOLE = ("bool", "int")

TYPES = {"bool": "int32_t", "int": "int32_t", "single": "float", "real": "smc_real"}
TYPES |= {"memory": "smc_real", "gains": "smc_real", "y": "smc_measurement"}

JOINTS = "SMC_JOINTS"

SLOTS = "SMC_LAW_MEMORY"  # numbers of memory of a joint: known when all of a law is translated

ROW, COLUMN = "\x00", "\x01"  # stand for the indices in the text of an array's element

# Precedence of C's operators. An operand of lower precedence is put in parentheses.
ATOM = 5

UNARY = 4

PRODUCT = 3

SUM = 2

LOOSE = 1


class Kind(NamedTuple):
    """What a value is: a number, an array, a tuple, or y or gains of a component."""

    sort: str  # y, gains, memory, or one of WIDTHS
    shape: tuple[int, ...] = ()  # of an array or a tuple
    fields: Names | None = None  # of a tuple: their names, if it has some
    stride: str = "1"  # of a vector: from one number to the next

    @property
    def number(self) -> "Kind":
        """The kind of its numbers."""
        return REAL if self.sort == "memory" else Kind(self.sort)


INT = Kind("int")

BOOL = Kind("bool")

REAL = Kind("real")


class Value(NamedTuple):
    """An expression in C, or one for each item of a tuple."""

    text: str  # of an array: of its element
    kind: Kind
    level: int = ATOM  # precedence of the outermost operator
    pointer: str = ""  # to the numbers of an array, if they are stored
    sources: frozenset[str] = frozenset()  # names of arrays with which it may share its numbers
    items: tuple["Value", ...] = ()  # of a tuple that is not stored

    def within(self, level: int) -> str:
        """Return the text as an operand of an operator of precedence `level`."""
        if self.level >= level:
            return self.text
        return f"({self.text})"

    def elements(self) -> tuple["Value", ...]:
        """Return the items of a tuple, or the numbers of a vector."""
        if self.items or not self.kind.shape:
            return self.items
        kind = self.kind.number
        indices = map(str, range(self.kind.shape[0]))
        return tuple(Value(self.text.replace(ROW, i), kind, self.level) for i in indices)


def array_at(base: str, kind: Kind, offset: str = "", sources: Iterable[str] = ()) -> Value:
    """Return the array that begins in another one, or at a pointer, from an offset on."""
    if len(kind.shape) == 2:
        width = str(kind.shape[1])
        if kind.sort == "memory":
            width = SLOTS
        place = f"{ROW} * {width} + {COLUMN}"
    elif kind.stride == "1":
        place = ROW
    else:
        place = f"{ROW} * {kind.stride}"
    if offset:
        return Value(
            f"{base}[{offset} + {place}]", kind, ATOM, f"{base} + {offset}", frozenset(sources)
        )
    return Value(f"{base}[{place}]", kind, ATOM, base, frozenset(sources))


def gathered(items: Sequence[Value], fields: Names = ()) -> Value:
    """Return a tuple of values."""
    sort = functools.reduce(widest, [item.kind.sort for item in items], "bool")
    kind = Kind(sort, (len(items),), fields)
    return Value("", kind, items=tuple(items))


def chosen(test: Value, yes: Value, no: Value, shape: tuple[int, ...] | None = None) -> Value:
    """Return one of two values, by a condition. `shape`: of the result, if they differ."""
    if shape is None:
        kind = wider(yes.kind, no.kind)
    else:
        sort = widest(yes.kind.sort, no.kind.sort)
        kind = Kind(sort, shape)
    text = f"{test.within(SUM)} ? {yes.within(SUM)} : {no.within(SUM)}"
    return Value(text, kind, LOOSE)


def widest(first: str, second: str) -> str:
    """Return the kind of number that an operation on two kinds gives, in C and in numba.

    An integer and a single give a real.
    """
    pair = [WIDTHS.index(Kind(sort).number.sort) for sort in (first, second)]
    if max(pair) == WIDTHS.index("single") != min(pair):
        return "real"
    return WIDTHS[max(pair)]


def wider(first: Kind, second: Kind) -> Kind:
    """Return the kind of a name, or of a result, that has one kind and then another."""
    if first.shape != second.shape:
        raise refuse(None, "a name for a number and an array, or for arrays of two shapes,")
    fields = first.fields
    if fields != second.fields:
        fields = ()
    return Kind(widest(first.sort, second.sort), first.shape, fields)


def literal(value: Any, single: bool, node: ast.AST) -> Value:
    """Return a Python number in C. `single`: whether smc_real is float."""
    if isinstance(value, bool):
        return Value(str(int(value)), BOOL)
    if isinstance(value, int | np.integer):
        if abs(value) >= 2**31:
            raise refuse(node, f"the whole number {value}, beyond 32 bits,")
        return signed(str(int(value)), INT)
    if not isinstance(value, float | np.floating):
        raise refuse(node, f"the value {shown(value)}")
    kind = REAL
    if type(value) is np.float32:
        kind = Kind("single")
    text = repr(float(value))
    if math.isnan(value):
        text = "NAN"
    elif math.isinf(value):
        text = "INFINITY" if value > 0.0 else "-INFINITY"
    elif single or kind.sort == "single":
        text += "f"
    return signed(text, kind)


def signed(text: str, kind: Kind) -> Value:
    """Return a number that may have a sign."""
    if text.startswith("-"):
        return Value(text, kind, UNARY)
    return Value(text, kind)
