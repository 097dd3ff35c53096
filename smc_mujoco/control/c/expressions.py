"""Expressions of Python as expressions of C that round alike: same operations, same order, nothing folded.

What numba's compiler computes otherwise than Python - a power with a constant exponent is a product, or a root - is
written as it computes it, so that the C of a law gives the bits of the compiled law.
"""

import ast
import builtins
import itertools
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np

from smc_mujoco.control.c.calls import Unit, built_in, called
from smc_mujoco.control.c.values import ATOM, LOOSE, POINTERS, PRODUCT, SUM, UNARY, Value, number, plain, refuse, wider

OPERATORS: dict[type, tuple[str, int]] = {
    ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT), ast.Div: ("/", PRODUCT),
}  # fmt: skip
BITS: dict[type, str] = {ast.LShift: "<<", ast.RShift: ">>", ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^"}
COMPARISONS: dict[type, str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip


class Expressions:
    """Translates the expressions of one function. `names` are its parameters and variables, `known` the rest."""

    def __init__(self, unit: Unit, names: dict[str, Value], constants: dict[str, float], known: dict[str, Any]):
        self.unit, self.names, self.constants, self.known = unit, names, constants, known
        self.slots = 0  # of memory, that constants index

    def value(self, node: ast.expr) -> Value:
        """An expression that gives a number, or something a law is given."""
        method: Callable[[Any], Value] | None = getattr(self, f"_{type(node).__name__.lower()}", None)
        if method is None:
            raise refuse(node, f"{type(node).__name__}")
        return method(node)

    def numeric(self, node: ast.expr) -> Value:
        """An expression that gives a number."""
        value = self.value(node)
        if value.kind in POINTERS:
            raise refuse(node, f"{value.text} as a number")
        return value

    def truth(self, node: ast.expr) -> str:
        """An expression as a condition."""
        value = self.numeric(node)
        return value.text if value.kind in ("bool", "int") else f"{value.within(UNARY)} != 0"

    def constant(self, node: ast.expr) -> float | None:
        """The literal number that an expression is, also through a parameter that was given one."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            value = self.constant(node.operand)
            return None if value is None else -value
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            return node.value
        return self.constants.get(node.id) if isinstance(node, ast.Name) else None

    def thing(self, node: ast.expr) -> Any:
        """What a global name, or a dotted one, stands for; None where it is a variable."""
        if isinstance(node, ast.Name):
            return None if node.id in self.names else self.known.get(node.id, getattr(builtins, node.id, None))
        if isinstance(node, ast.Attribute):
            home = self.thing(node.value)
            return getattr(home, node.attr, None) if isinstance(home, ModuleType) else None
        return None

    def _constant(self, node: ast.Constant) -> Value:
        return number(node.value, self.unit.single, node)

    def _name(self, node: ast.Name) -> Value:
        if node.id in self.constants:
            return number(self.constants[node.id], self.unit.single, node)
        if node.id in self.names:
            return self.names[node.id]
        if node.id not in self.known:
            raise refuse(node, "a name without a value")
        return number(self.known[node.id], self.unit.single, node)

    def _attribute(self, node: ast.Attribute) -> Value:
        constant = self.thing(node)
        if constant is not None:
            return number(constant, self.unit.single, node)
        home = self.value(node.value)
        if home.kind == "y":
            return Value(f"{home.text}->{node.attr}", "real")
        if home.kind == "gains":
            return Value(f"{home.text}[GAIN_{plain(node.attr)}]", "real")
        raise refuse(node, "an attribute")

    def _subscript(self, node: ast.Subscript) -> Value:
        array = self.thing(node.value)
        index = self.numeric(node.slice)
        if index.kind != "int":
            raise refuse(node, "an index that is no whole number")
        if isinstance(array, tuple | list | np.ndarray):
            name = ast.unparse(node.value).replace(".", "_")
            made = self.unit.array(name, array)
            return Value(f"{made.name}[{index.text}]", made.kind)
        home = self.value(node.value)
        if home.kind != "memory":
            raise refuse(node, "an element")
        at = self.constant(node.slice)
        if at is None or at < 0:
            raise refuse(node, f"memory {'at a place that is no constant' if at is None else 'counted from its end'}")
        self.slots = max(self.slots, int(at) + 1)
        return Value(f"{home.text}[{index.text}]", "real")

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(f"!({self.truth(node.operand)})", "bool", UNARY)
        value = self.numeric(node.operand)
        if isinstance(node.op, ast.UAdd):
            return value
        if not isinstance(node.op, ast.USub):
            raise refuse(node, "the operator")
        inner = value.within(ATOM)
        return Value(f"-{inner}", "int" if value.kind == "bool" else value.kind, UNARY)

    def _binop(self, node: ast.BinOp) -> Value:
        if isinstance(node.op, ast.Pow):
            return self._power(node)
        left, right = self.numeric(node.left), self.numeric(node.right)
        if type(node.op) in BITS:
            if not {left.kind, right.kind} <= {"int", "bool"}:
                raise refuse(node, "an operation on bits of what is no whole number")
            return Value(f"{left.within(ATOM)} {BITS[type(node.op)]} {right.within(ATOM)}", "int", LOOSE)
        if type(node.op) not in OPERATORS:
            raise refuse(node, f"the operator {type(node.op).__name__}")
        sign, level = OPERATORS[type(node.op)]
        kind = wider(left.kind, right.kind)
        first = left.within(level)
        if kind in ("int", "bool"):
            kind = "int"
            if sign == "/":
                first, kind = f"(smc_real){left.within(UNARY)}", "real"
        return Value(f"{first} {sign} {right.within(level + 1)}", kind, level)

    def _power(self, node: ast.BinOp) -> Value:
        base, exponent = self.numeric(node.left), self.constant(node.right)
        if base.kind not in ("real", "single"):
            raise refuse(node, "a power of a whole number")
        if exponent == 1:
            return base
        if exponent == 0.5:
            return called(self.unit, "sqrt", [base])
        if exponent == 2 or (isinstance(exponent, int) and 2 < exponent <= 8):
            name = self.unit.helper(f"raised_{exponent:.0f}", base.kind)
            return Value(f"{name}({base.text})", base.kind)
        power = self.numeric(node.right)
        if power.kind in ("int", "bool"):
            raise refuse(node, "a power with such an exponent")
        return called(self.unit, "pow", [base, power])

    def _compare(self, node: ast.Compare) -> Value:
        terms = [self.numeric(n).within(SUM) for n in (node.left, *node.comparators)]
        parts = []
        for (one, other), sign in zip(itertools.pairwise(terms), node.ops, strict=True):
            if type(sign) not in COMPARISONS:
                raise refuse(node, "the comparison")
            parts.append(f"{one} {COMPARISONS[type(sign)]} {other}")
        return Value(parts[0] if len(parts) == 1 else " && ".join(parts), "bool", LOOSE)

    def _boolop(self, node: ast.BoolOp) -> Value:
        sign = " && " if isinstance(node.op, ast.And) else " || "
        values = [self.numeric(v) for v in node.values]
        if any(v.kind != "bool" for v in values):
            raise refuse(node, "`and` or `or` of what is no comparison")
        # a plain comparison needs no parentheses, a chain of them or another operator does
        parts = [f"({v.text})" if "&&" in v.text or "||" in v.text else v.text for v in values]
        return Value(sign.join(parts), "bool", LOOSE)

    def _ifexp(self, node: ast.IfExp) -> Value:
        yes, no = self.numeric(node.body), self.numeric(node.orelse)
        kind = wider(yes.kind, no.kind)
        return Value(f"{_closed(self.truth(node.test))} ? {yes.within(SUM)} : {no.within(SUM)}", kind, LOOSE)

    def _call(self, node: ast.Call) -> Value:
        if node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
            raise refuse(node, "a call with names or stars")
        function, values = self.callee(node), [self.value(a) for a in node.args]
        if (built := built_in(self.unit, function, values, node)) is not None:
            return built
        name, kinds, passed = self.unit.function(function, values, node.args)
        if len(kinds) != 1:
            raise refuse(node, "several results within an expression")
        return Value(f"{name}({', '.join(v.text for v in passed)})", kinds[0])

    def callee(self, node: ast.Call) -> Any:
        """The function that a call is of."""
        function = self.thing(node.func)
        if function is None:
            raise refuse(node, "a call")
        return function


def _closed(condition: str) -> str:
    """A condition in parentheses where it has more than one part."""
    return f"({condition})" if " " in condition else condition
