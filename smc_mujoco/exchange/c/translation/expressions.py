"""Expressions: operators, comparisons, attributes, and calls of functions that C has."""

import ast
import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from smc_mujoco.control import joint_law
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.law import Measurement
from smc_mujoco.exchange.c.translation.arrays import FILLED, Arrays
from smc_mujoco.exchange.c.translation.c_text import (
    HELPERS,
    POWERS,
    ROUNDING,
    SAME_IN_C,
    c_name,
    joined,
)
from smc_mujoco.exchange.c.translation.python_source import check_law_name, in_python, refuse
from smc_mujoco.exchange.c.translation.values import (
    ATOM,
    BOOL,
    INT,
    JOINTS,
    LOOSE,
    PRODUCT,
    REAL,
    SUM,
    TYPES,
    UNARY,
    WHOLE,
    Kind,
    Value,
    array_at,
    chosen,
    gathered,
    literal,
    widest,
)

CHANNEL_FIELDS = {"estimator": Reading._fields}  # of y, where they differ from a measurement's

# What the caller of a law of many joints provides: its name, and its rows if it is a matrix.
REQUESTS = {joint_law.coriolis: ("coriolis", ()), joint_law.jacobian: ("jacobian", (3,))}

OPERATORS: dict[type, tuple[str, int]] = {
    ast.Add: ("+", SUM),
    ast.Sub: ("-", SUM),
    ast.Mult: ("*", PRODUCT),
    ast.Div: ("/", PRODUCT),
}

BIT_OPERATORS: dict[type, str] = {
    ast.LShift: "<<",
    ast.RShift: ">>",
    ast.BitAnd: "&",
    ast.BitOr: "|",
    ast.BitXor: "^",
}

COMPARISONS: dict[type, str] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}

CASTS = {float: "real", np.float64: "real", np.float32: "single", int: "int"}

# Functions of numpy, element by element -> the same in C, or a helper.
NUMPY_NAMES = """sqrt exp expm1 log log1p sin cos tan sinh cosh tanh fabs hypot arctan arctan2
arcsin arccos"""

ELEMENTWISE = {getattr(np, name): name.replace("arc", "a") for name in NUMPY_NAMES.split()}
ELEMENTWISE |= {np.abs: "fabs", abs: "fabs"}
ELEMENTWISE |= {np.minimum: "lesser", np.maximum: "greater", np.sign: "sign"}
ELEMENTWISE |= {math.isnan: "unknown"}


class Expressions(Arrays):
    """The lines of a function that compute values."""

    def results_of(self, call: ast.Call) -> Value:
        """Call a function of Python. Return its result, or a tuple of them."""
        raise NotImplementedError

    def value(self, node: ast.expr) -> Value:
        """Translate an expression: a number, an array, a tuple, or one of the law's arguments."""
        method: Callable[[Any], Value] | None = getattr(
            self, f"_{type(node).__name__.lower()}", None
        )
        if method is None:
            raise refuse(node, f"{type(node).__name__}")
        return method(node)

    def truth(self, node: ast.expr) -> str:
        """Translate an expression as a condition."""
        value = self.number(node)
        if value.kind.shape:
            raise refuse(node, "an array as a condition")
        if value.kind.sort in WHOLE:
            return value.text
        return f"{value.within(UNARY)} != 0"

    def calls_python(self, node: ast.Call) -> bool:
        """Return whether a call is of a function that is translated itself."""
        function = self.resolve(node.func)
        return in_python(function) is not None and function not in REQUESTS

    def callee(self, node: ast.Call) -> Any:
        """Return the function that is called."""
        function = self.resolve(node.func)
        if function is None or node.keywords:
            raise refuse(node, "a call")
        return function

    def _constant(self, node: ast.Constant) -> Value:
        return literal(node.value, self.program.single, node)

    def _name(self, node: ast.Name) -> Value:
        if node.id in self.names:
            return self.names[node.id]
        if node.id not in self.globals:
            raise refuse(node, "a name without a value")
        return self.outer(node, self.globals[node.id])

    def outer(self, node: ast.expr, value: Any) -> Value:
        """Return a constant from outside of the function: a number or an array."""
        if isinstance(value, np.ndarray | tuple):
            return self.program.array(ast.unparse(node).replace(".", "_"), value)
        return literal(value, self.program.single, node)

    def _attribute(self, node: ast.Attribute) -> Value:
        if (constant := self.resolve(node)) is not None:
            return self.outer(node, constant)
        owner = self.value(node.value)
        if owner.kind.sort == "y":
            return self.measured(owner, node.attr)
        if owner.kind.sort == "gains":
            return self.gain(owner, node.attr)
        if not owner.kind.fields:
            raise refuse(node, "an attribute")
        check_law_name("field", node.attr, owner.kind.fields)
        return owner.elements()[owner.kind.fields.index(node.attr)]

    def measured(self, y: Value, name: str) -> Value:
        """Return what a law measures: a number, or an array with a number of each joint."""
        program = self.program
        if program.joints:
            fields = ("t", "dt", "model", *joint_law.ARRAYS)
        else:
            fields = CHANNEL_FIELDS.get(program.component.kind, Measurement._fields)
        check_law_name("measurement", name, fields)
        place = f"{y.text}->{name}"
        if not program.joints or name not in joint_law.ARRAYS:
            return Value(place, REAL)
        shape = program.vector
        if name == "M":
            shape *= 2
        return array_at(place, Kind("real", shape), sources=attribute_names(y, name))

    def gain(self, gains: Value, name: str) -> Value:
        """Return a gain: a number, or an array with a number of each joint."""
        program = self.program
        check_law_name("gain", name, program.component.gains)
        offset = f"GAIN_{c_name(name)}"
        if program.joints:
            offset += f" * {JOINTS}"
        if program.joints and name not in program.component.shared:
            kind = Kind("real", program.vector)
            return array_at(gains.text, kind, offset, attribute_names(gains, name))
        return Value(f"{gains.text}[{offset}]", REAL)

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(f"!({self.truth(node.operand)})", BOOL, UNARY)
        (value,), _ = self.matched(node, [node.operand])
        if not isinstance(node.op, ast.USub):
            raise refuse(node, "the operator")
        sort = value.kind.sort.replace("bool", "int")
        kind = value.kind._replace(sort=sort)
        return Value(f"-{value.within(ATOM)}", kind, UNARY)

    def _binop(self, node: ast.BinOp) -> Value:
        sort = type(node.op)
        if sort is ast.Pow:
            return self.power(node)
        if sort is ast.MatMult:
            raise refuse(node, "the operator @")
        (before_sign, after_sign), shape = self.matched(node, [node.left, node.right])
        integers = before_sign.kind.sort in WHOLE and after_sign.kind.sort in WHOLE
        if sort in BIT_OPERATORS and integers:
            text = f"{before_sign.within(ATOM)} {BIT_OPERATORS[sort]} {after_sign.within(ATOM)}"
            return Value(text, Kind("int", shape), LOOSE)
        if sort is ast.Mod and integers:
            text = f"{self.program.helper('modulo', 'int')}({before_sign.text}, {after_sign.text})"
            return Value(text, Kind("int", shape))
        if sort not in OPERATORS:
            raise refuse(node, f"the operator {sort.__name__}")
        sign, level = OPERATORS[sort]
        first = before_sign.within(level)
        number = widest(before_sign.kind.sort, after_sign.kind.sort)
        if integers:
            number = "int"
        if integers and sign == "/":
            number = "real"
            first = f"(smc_real){before_sign.within(UNARY)}"
        return Value(f"{first} {sign} {after_sign.within(level + 1)}", Kind(number, shape), level)

    def power(self, node: ast.BinOp) -> Value:
        """Translate a power, as numba compiles it."""
        exponent = self.constant(node.right)
        (base, by), shape = self.matched(node, [node.left, node.right])
        if base.kind.sort in WHOLE:
            raise refuse(node, "a power of a whole number")
        if exponent == 1:
            return base
        if exponent == 0.5:
            return self.math("sqrt", [base], shape)
        if exponent == 2 or (isinstance(exponent, int) and exponent in POWERS):
            helper = self.program.helper(
                f"power_{int(exponent)}", base.kind.sort, POWERS[int(exponent)]
            )
            return Value(f"{helper}({base.text})", Kind(base.kind.sort, shape))
        if by.kind.sort in WHOLE:
            raise refuse(node, "a power with such an exponent")
        return self.math("pow", [base, by], shape)

    def _compare(self, node: ast.Compare) -> Value:
        if any(type(sign) not in COMPARISONS for sign in node.ops):
            raise refuse(node, "the comparison")
        values, shape = self.matched(node, [node.left, *node.comparators])
        parts = []
        for (lower, upper), sign in zip(itertools.pairwise(values), node.ops, strict=True):
            parts.append(f"{lower.within(SUM)} {COMPARISONS[type(sign)]} {upper.within(SUM)}")
        return Value(" && ".join(parts), Kind("bool", shape), LOOSE)

    def _boolop(self, node: ast.BoolOp) -> Value:
        parts = []
        for operand in node.values:
            value = self.alone(self.number, operand) if parts else self.number(operand)
            if value.kind != BOOL:
                raise refuse(node, "`and` or `or` of anything but two comparisons")
            text = value.text
            if "&&" in text or "||" in text:
                text = f"({text})"
            parts.append(text)
        sign = {ast.And: " && ", ast.Or: " || "}[type(node.op)]
        return Value(sign.join(parts), BOOL, LOOSE)

    def _ifexp(self, node: ast.IfExp) -> Value:
        test = Value(self.truth(node.test), BOOL, LOOSE)
        yes = self.alone(self.number, node.body)
        no = self.alone(self.number, node.orelse)
        if yes.kind.fields is None:
            return chosen(test, yes, no)._replace(sources=yes.sources | no.sources)
        items = []
        for pair in zip(yes.elements(), no.elements(), strict=True):
            items.append(chosen(test, *pair))
        return gathered(items)

    def _tuple(self, node: ast.Tuple) -> Value:
        return gathered([*map(self.number, node.elts)])

    def _call(self, node: ast.Call) -> Value:
        if isinstance(node.func, ast.Attribute) and node.func.attr == "copy" and not node.args:
            value = self.value(node.func.value)
            return value._replace(pointer="", sources=frozenset())
        function = self.callee(node)
        if function is len:
            called = Value(str(self.whole(node)), INT)
        elif function in FILLED:
            called = self.filled(function, node)
        elif function in REQUESTS:
            called = self.requested(function, node)
        elif hasattr(function, "_fields"):
            items = map(self.number, node.args)
            called = gathered([*items], function._fields)
        elif function is np.array and isinstance(node.args[0], ast.List | ast.Tuple):
            called = gathered([*map(self.number, node.args[0].elts)])
            kind = called.kind._replace(fields=None)
            called = self.stored(called._replace(kind=kind))
        elif self.calls_python(node):
            called = self.results_of(node)
        else:
            called = self.built_in(function, node)
        return called

    def requested(self, function: Any, node: ast.Call) -> Value:
        """Translate coriolis and jacobian, which the caller of the law provides."""
        name, rows = REQUESTS[function]
        y, *rest = map(self.argument, node.args)
        kind = Kind("real", (*rows, self.program.joints))
        array = self.temporary(kind)
        pointers = [value.pointer for value in (*rest, array)]
        self.lines.append(f"{y.text}->{name}({', '.join([f'{y.text}->plant', *pointers])});")
        return array

    def built_in(self, function: Any, node: ast.Call) -> Value:
        """Translate a call of a function of Python, math or numpy."""
        values, shape = self.matched(node, node.args)
        name = getattr(function, "__name__", str(function))
        if function is np.where and len(values) == 3:
            return chosen(values[0], values[1], values[2], shape)
        if function in ELEMENTWISE:
            return self.elementwise(function, values, shape)
        if shape:
            raise refuse(node, f"{name} of an array")
        if function in (min, max) and len(values) > 1:
            return functools.reduce(functools.partial(self.lesser_or_greater, name), values)
        if function in CASTS and len(values) == 1:
            kind = Kind(CASTS[function])
            return Value(f"({TYPES[kind.sort]}){values[0].within(UNARY)}", kind, UNARY)
        if function in ROUNDING:
            text = self.math(ROUNDING[function], values).text
            return Value(f"(int32_t){text}", INT, UNARY)
        if function in SAME_IN_C:
            return self.math(name, values)
        raise refuse(node, name)

    def lesser_or_greater(self, name: str, first: Value, second: Value) -> Value:
        """Translate Python's min or max of two numbers."""
        sort = widest(first.kind.sort, second.kind.sort)
        helper = self.program.helper(f"{name}imum", sort)
        return Value(f"{helper}({first.text}, {second.text})", Kind(sort))

    def elementwise(self, function: Any, values: Sequence[Value], shape: tuple[int, ...]) -> Value:
        """Translate a call of a function of numpy, or of abs."""
        name = ELEMENTWISE[function]
        if name == "fabs" and values[0].kind.sort in WHOLE:
            name = "absolute"
        if name not in HELPERS:
            return self.math(name, values, shape)
        sort = functools.reduce(widest, [value.kind.sort for value in values])
        return Value(f"{self.program.helper(name, sort)}({joined(values)})", Kind(sort, shape))

    def math(self, name: str, values: Sequence[Value], shape: tuple[int, ...] = ()) -> Value:
        """Translate a call of a function of math.h, in the precision of its arguments."""
        single = {value.kind.sort for value in values} == {"single"}
        if single or self.program.single:
            name += "f"
        kind = Kind("single" if single else "real", shape)
        return Value(f"{name}({joined(values)})", kind)


def attribute_names(owner: Value, name: str) -> list[str]:
    """Return the names of an attribute, whose numbers are its owner's."""
    return [f"{source}.{name}" for source in owner.sources]
