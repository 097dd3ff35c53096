"""Translate the Python of a law, surface or estimator into C99, operation by operation and with the
same rounding.

numba turns some powers with a constant exponent into products or roots. The C does the same, so
that its results in double precision equal those of the compiled function bit for bit.

An array has a kind such as "real[SMC_JOINTS]" or "real[3][SMC_JOINTS]". An expression of arrays
becomes a loop over its elements, with the operations of numba in the same order. A function that
returns an array writes it to a pointer. A tuple of numbers is an array whose kind ends in the names
of its fields, such as "real[4]()" or "real[2](e,de)".

Python's names of arrays may share numbers. A name that is bound once to a part of an array, as in
`w = memory[:, 0]`, is a pointer into it. All others are copies. So an array that the function
changes must not share its numbers with another name; such code is refused.
"""

import ast
import builtins
import functools
import inspect
import itertools
import math
import re
import textwrap
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import FunctionType, ModuleType
from typing import Any, Literal, NamedTuple

import numpy as np

from smc_mujoco.common.errors import ScenarioError, shown, unknown
from smc_mujoco.control import joint_law
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.law import Measurement

PARSING_LOCK = threading.Lock()
# Kinds of numbers from narrow to wide. `single` is numpy.float32 in Python; `real` is smc_real in
# the file.
KINDS = ("bool", "int", "single", "real")
WHOLE_KINDS = ("bool", "int")
TYPES = {"bool": "int32_t", "int": "int32_t", "single": "float", "real": "smc_real"}
# The arguments of a component. They are pointers, not numbers.
ARGUMENTS = {"y": "const smc_measurement *", "gains": "const smc_real *", "memory": "smc_real *"}
STRUCTS = {"estimator": "smc_reading"}  # structs of y, where they differ from a measurement
CHANNEL_FIELDS = {
    "law": Measurement._fields,
    "surface": Measurement._fields,
    "estimator": Reading._fields,
}  # of y

# Laws of many joints: dimensions that are macros in the file, fields of the measurement -> their
# dimensions, and what the caller of the law provides.
JOINTS = "SMC_JOINTS"
SLOTS = "SMC_LAW_MEMORY"
JOINT_FIELDS = dict.fromkeys(joint_law.ARRAYS, f"[{JOINTS}]") | dict.fromkeys(
    ("t", "dt", "model"), ""
)
JOINT_FIELDS["M"] = f"[{JOINTS}][{JOINTS}]"
REQUESTED_ARRAYS = {
    joint_law.coriolis: ("coriolis", (JOINTS,)),
    joint_law.jacobian: ("jacobian", ("3", JOINTS)),
}
ROW, COLUMN = "\x00", "\x01"  # stand for the indices in the text of an array's element
TOKEN = re.compile(
    "\x02(\\d+)\x03"
)  # stands for a call in an expression, which may move before its loop
LONE_TOKEN = re.compile("(?<!\\w)\\((\x02\\d+\x03)\\)")  # the same in parentheses

# Precedence of C's operators. An operand of lower precedence is put in parentheses.
ATOM = 5
UNARY = 4
PRODUCT = 3
SUM = 2
LOOSE = 1
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

# Functions of Python's math module that have the same name in C.
MATH_NAMES = """sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp expm1 log log1p log10 log2 sqrt
hypot fabs copysign fmod"""
SAME_IN_C = {getattr(math, name) for name in MATH_NAMES.split()}
ROUNDING = {
    math.floor: "floor",
    math.ceil: "ceil",
    math.trunc: "trunc",
}  # integers in Python, floating-point in C
MATH = {"pow", *ROUNDING.values(), *MATH_NAMES.split()}
CASTS = {float: "real", np.float64: "real", np.float32: "single", int: "int"}
# Functions of numpy with elements -> the same in C.
NUMPY_NAMES = (
    "sqrt",
    "exp",
    "expm1",
    "log",
    "log1p",
    "sin",
    "cos",
    "tan",
    "sinh",
    "cosh",
    "tanh",
    "fabs",
)
NUMPY_RENAMED = {
    "arctan": "atan",
    "arctan2": "atan2",
    "arcsin": "asin",
    "arccos": "acos",
    "hypot": "hypot",
}
ELEMENTWISE = {getattr(np, name): name for name in NUMPY_NAMES} | {
    getattr(np, n): c for n, c in NUMPY_RENAMED.items()
}
ELEMENTWISE |= {np.abs: "fabs", abs: "fabs"}
HELPER_NAMES = {np.minimum: "lesser", np.maximum: "greater", np.sign: "sign"}
FILL_VALUES = {np.zeros: 0.0, np.empty: 0.0, np.ones: 1.0}
SHARED_WORDS = "which shares its numbers with another name: write .copy() behind it"

# Python's min, max, abs, % and indices of integers, and numpy's functions as numba compiles them,
# where NaN stays NaN: functions that the C file defines if it uses them.
HELPERS = {
    "minimum": "b < a ? b : a",
    "maximum": "b > a ? b : a",
    "absolute": "a < 0 ? -a : a",
    "modulo": "(a % b + b) % b",
    "wrapped": "a < 0 ? a + b : a",  # an index from the end
    "lesser": "a <= b || a != a ? a : b",
    "greater": "a >= b || a != a ? a : b",
    "sign": "a > 0 ? 1 : a < 0 ? -1 : a",
}
SQUARE = "(a * a)"
FOURTH = "((a * a) * (a * a))"
POWERS = {  # multiplied in numba's order: by repeated squaring, from the lowest bit
    "power_2": "a * a",
    "power_3": f"a * {SQUARE}",
    "power_4": FOURTH,
    "power_5": f"a * {FOURTH}",
    "power_6": f"{SQUARE} * {FOURTH}",
    "power_7": f"a * {SQUARE} * {FOURTH}",
    "power_8": f"({FOURTH} * {FOURTH})",
}

KEYWORDS = """auto break case char const continue default do double else enum extern float for goto if inline int long
register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while"""
# Other reserved names: functions and macros of C's headers, keywords of later standards and of
# compilers.
OTHER_RESERVED_NAMES = """_Bool _Complex _Imaginary alignas alignof asm bool constexpr false linux nullptr static_assert
thread_local true typeof unix main abort abs exit free index labs rindex NAN INFINITY HUGE_VAL cbrt drem erf erfc exp2
exp10 fdim finite fma fmax fmin fpclassify frexp gamma ilogb isfinite isgreater isgreaterequal isinf isless islessequal
islessgreater isnan isnormal isunordered j0 j1 jn ldexp lgamma llrint llround logb lrint lround modf nan nearbyint
nextafter nexttoward pow10 remainder remquo rint round scalb scalbln scalbn signbit signgam significand tgamma y0 y1
yn"""
RESERVED = {*KEYWORDS.split(), *OTHER_RESERVED_NAMES.split(), *MATH, "out"}


class Untranslatable(ScenarioError):
    """A piece of Python has no translation into C."""


class Value(NamedTuple):
    """An expression in C: its text, its kind, and the precedence of its outermost operator."""

    text: str
    kind: str
    level: int = ATOM
    pointer: str = ""  # of an array: to its numbers in C
    stride: str = (
        ""  # of a vector with a pointer: from one number to the next, if they do not lie in a row
    )

    def within(self, level: int) -> str:
        """Return the text as an operand of an operator of precedence `level`."""
        if self.level >= level:
            return self.text
        return f"({self.text})"


def translate(
    component: Component,
    single: bool,
    joints: int = 0,
    others: Mapping[str, tuple[Any, Sequence[str]]] | None = None,
) -> tuple[int, str]:
    """Return the number of memory slots of a component, and the C of its function and of all
    functions it calls.

    The function's name is smc_law, smc_surface or smc_estimator. If `single`, smc_real is float.
    `joints` is 0 for a component of one channel. `others`: name in C -> another function for the
    file, and the kinds of its arguments.
    """
    program = Program(component, single, joints)
    functions = [
        Function(program, component.function, list(ARGUMENTS), {}, entry=True).text(program.symbol)
    ]
    for name, (function, kinds) in (others or {}).items():
        program.used_names.add(name)
        functions.append(Function(program, function, kinds, {}).text(name).removeprefix("static "))
    for name, text in reversed(program.functions.items()):
        if any(
            re.search(rf"\b{name}\(", other) for other in functions
        ):  # calls by earlier, narrower drafts are gone
            functions.insert(0, text)
    arrays = [
        text
        for name, text in program.arrays.items()
        if any(re.search(rf"\b{name}\b", other) for other in functions)
    ]
    return program.slots, "\n\n".join([*arrays, *functions])


class Program:
    """The C file of a component: constant arrays, functions, and the names they use."""

    def __init__(self, component: Component, single: bool, joints: int):
        self.component = component
        self.gains = component.gains
        self.single = single
        self.symbol = f"smc_{component.kind}"
        self.joints = joints
        self.arrays: dict[str, str] = {}  # name -> text
        self.functions: dict[str, str] = {}  # name -> text
        self.translated: dict[
            tuple, tuple[str, list[str]] | None
        ] = {}  # -> name, result kinds; None in progress
        self.changing: dict[Any, set[int]] = {}  # Python function -> `changes`
        self.used_names = {self.symbol, *ARGUMENTS, *RESERVED}
        self.slots = 0  # of memory

    def size(self, dimension: str) -> int:
        """Return a dimension as a number; that of the memory is not known before the end."""
        if dimension == JOINTS:
            return self.joints
        return int(dimension)

    def unique_name(self, name: str) -> str:
        """Reserve and return a name that is not used yet: `name`, or `name` with a number."""
        candidates = itertools.chain([name], (f"{name}_{count}" for count in itertools.count(2)))
        unique = next(candidate for candidate in candidates if candidate not in self.used_names)
        self.used_names.add(unique)
        return unique

    def changes(self, function: Any) -> set[int]:
        """Return the positions of the arguments whose elements a function changes, itself or by
        another one.
        """
        written = in_python(function)
        if written is None or written in REQUESTED_ARRAYS:
            return set()
        if written in self.changing:
            return self.changing[written]
        self.changing[written] = set()
        tree = parsed(written)[1]
        known = around(written)
        names = [a.arg for a in tree.args.args]
        inside = in_body(tree)
        given = [
            (target.id, root(value))
            for target, value in pairs(inside)
            if isinstance(target, ast.Name)
        ]
        origins = {name: name for name in names}
        before = 0
        while before != (before := len(origins)):
            origins |= {
                name: origins[source]
                for name, source in given
                if source in origins and name not in names
            }
        changed = []
        for n in inside:
            if isinstance(n, ast.Subscript) and isinstance(n.ctx, ast.Store):
                changed.append(n)
        for call in (n for n in inside if isinstance(n, ast.Call)):
            changed += [
                call.args[i] for i in self.changes(resolved(call.func, known)) if i < len(call.args)
            ]
        self.changing[written] = {
            names.index(origins[root(n)]) for n in changed if root(n) in origins
        }
        return self.changing[written]

    def claim(self, node: ast.AST, slot: int) -> None:
        """Note that a slot of the memory is used. Refuse one that the component does not have."""
        size = self.component.memory
        if slot >= size:
            code = shown(ast.unparse(node))[1:-1]
            raise Untranslatable(
                f"it uses {code}, and its memory has {size} numbers: give memory={slot + 1}"
            )
        self.slots = max(self.slots, slot + 1)

    def helper(self, name: str, kind: str) -> str:
        """Return the C name of a helper or a power such as power_3, for numbers of a kind."""
        if name in POWERS and kind == "real":
            function = name
        else:
            function = f"{name}_{kind}"
        body = (HELPERS | POWERS)[name]
        of = TYPES[kind]
        second = f", {of} b" if "b" in body else ""
        self.used_names.add(function)
        self.functions.setdefault(
            function, f"static {of} {function}({of} a{second})\n{{\n    return {body};\n}}"
        )
        return function

    def array(self, name: str, values: Any) -> Value:
        """Return a constant array, of smc_real or of the smallest integer type that holds its
        values.
        """
        data, name = np.asarray(values), plain(name)
        if data.ndim != 1 or data.dtype.kind not in "if":
            raise refuse(
                None, f"the constant {name}, which is not a one-dimensional array of numbers,"
            )
        kind = "real"
        of = "smc_real"
        items = [literal(float(v), self.single, ast.Constant(0)).text for v in data]
        if data.dtype.kind == "i":
            kind = "int"
            largest = int(np.abs(data).max(initial=0))
            if largest >= 2**31:
                raise refuse(None, f"the constant {name}, beyond 32 bits,")
            of = "int16_t" if largest < 2**15 else "int32_t"
            items = [str(int(v)) for v in data]
        content = f"[{len(items)}] = {{\n{rows(items)}\n}};"
        for known, text in self.arrays.items():
            if text == f"static const {of} {known}{content}":
                return Value(known, kind)
        name = self.unique_name(name)
        self.arrays[name] = f"static const {of} {name}{content}"
        return Value(name, kind)

    def function(
        self, function: Any, values: Sequence[Value], nodes: Sequence[ast.expr]
    ) -> tuple[list[str], str]:
        """Return the kinds of a function's results, and a call of it without the closing
        parenthesis.

        A function is translated once per combination of argument kinds. A literal exponent is not
        an argument in C: each exponent gives its own function.
        """
        written, tree = parsed(function)
        names = [a.arg for a in tree.args.args]
        exponents = set()
        for n in ast.walk(tree):
            if (
                isinstance(n, ast.BinOp)
                and isinstance(n.op, ast.Pow)
                and isinstance(n.right, ast.Name)
            ):
                exponents.add(n.right.id)
        constants = {
            name: node.value
            for name, node in zip(names, nodes, strict=False)
            if name in exponents
            and isinstance(node, ast.Constant)
            and isinstance(node.value, int | float)
        }
        kinds = [v.kind for v in values]
        key = (written, tuple(kinds), tuple(constants.items()))
        if key not in self.translated:
            self.translated[key] = None
            translated = Function(self, function, kinds, constants)
            name = next((n for n, text in self.functions.items() if translated.text(n) == text), "")
            if not name:
                name = self.unique_name(plain(tree.name))
                self.functions[name] = translated.text(name)
            self.translated[key] = name, translated.results
        if (known := self.translated[key]) is None:
            raise refuse(None, f"{tree.name}, which calls itself,")
        name, results = known
        arguments = [v.text for n, v in zip(names, values, strict=True) if n not in constants]
        return results, f"{name}({', '.join(arguments)}"


class Function:
    """One function in C.

    A component's own function, the `entry`, writes its results to out[0] and out[1]. Another
    function returns a single result, or writes several to pointers. `constants`: arguments replaced
    by literal numbers.
    """

    def __init__(
        self,
        program: Program,
        function: Any,
        kinds: Sequence[str],
        constants: Mapping[str, float],
        entry: bool = False,
    ):
        self.program = program
        self.constants = constants
        self.entry = entry
        self.counters = set[str]()  # variables of the present loops that are never negative
        self.frames = list[
            tuple[list[str], list[Value]]
        ]()  # shapes and calls of operands of nested expressions
        self.fixed = False  # whether nothing may move before the present line
        written, self.tree = parsed(function)
        self.globals = around(written) | dict(constants)
        arguments = [a.arg for a in self.tree.args.args]
        if (
            len(arguments) != len(kinds)
            or self.tree.args.vararg
            or self.tree.args.kwonlyargs
            or self.tree.args.kwarg
        ):
            raise refuse(None, f"{self.tree.name} with its arguments")
        inside = in_body(self.tree)
        if (entry or any(isinstance(n, ast.Return) for n in inside)) and not returns(
            self.tree.body
        ):
            raise refuse(None, f"{self.tree.name}, which does not end in a return,")
        given = {}
        for n, kind in zip(arguments, kinds, strict=True):
            if n not in constants:
                given[n] = kind.partition("@")
        self.parameters = {n: kind for n, (kind, _, _) in given.items()}
        self.changed = {
            arguments[i] for i in program.changes(function)
        }  # arguments whose elements it changes
        self.origins = dict[str, str]()  # names that are parts of arrays -> the arrays' names
        # places of arrays that are not where their names say: of these parts, and of arguments with
        # a stride
        self.places = {
            n: array_at(plain(n), kind, stride=stride)
            for n, (kind, _, stride) in given.items()
            if stride
        }
        self.read = {
            n.id for n in inside if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)
        }
        self.kinds, self.results = dict(self.parameters), list[str]()
        before = None
        while before != (self.kinds, self.results):  # repeat until no variable's kind widens
            before = dict(self.kinds), list(self.results)
            self.names = {name: self.named(name, kind) for name, kind in self.kinds.items()}
            self.assigned = set(self.parameters)
            self.lines = list(self.block(self.tree.body))
        self.check_sharing()

    def text(self, name: str) -> str:
        """Return the whole function under a name.

        A variable is declared by its first assignment, or at the top if that is inside a block or
        by a pointer. C does not read a length that only declares arrays.
        """
        words = set(
            re.findall(r"\w+", " ".join(line.partition(" = ")[2] or line for line in self.lines))
        )
        self.read -= {
            n
            for n, kind in self.kinds.items()
            if kind in WHOLE_KINDS and self.c_name(n) not in words
        }
        numbers = {}
        for n, kind in self.kinds.items():
            if kind in TYPES and n not in self.parameters:
                numbers[n] = TYPES[kind]
        types = {self.c_name(n): f"{of} " for n, of in numbers.items()}
        types |= {self.c_name(n): self.pointer_to(array) for n, array in self.origins.items()}
        unread = [self.c_name(n) for n in self.kinds if n not in self.read]
        top = [*self.arrays(), *(f"{types.pop(n)}{n} = 0;" for n in unread if n in types)]
        top += [f"(void){n};" for n in unread]  # compilers warn of unused variables
        lines = list[str]()
        depth = 1
        for line in self.lines:
            depth -= line.startswith("}")
            target = line.partition(" = ")[0]
            words = re.findall(r"\w+", line)
            indent = "    " * depth
            declaration = types.pop(target) if depth == 1 and target in types else ""
            top += [f"{types.pop(n)}{n} = 0;" for n in list(types) if n in words]
            lines += wrapped(indent, declaration + line)
            depth += line.endswith("{")
        return "\n".join(
            [*wrapped("", self.head(name)), "{", *(f"    {line}" for line in top), *lines, "}"]
        )

    def arrays(self) -> Iterable[str]:
        """Return the declarations of the function's arrays."""
        own = self.kinds.keys() - self.parameters.keys() - self.origins.keys()
        kinds = {self.c_name(n): kind for n, kind in self.kinds.items() if n in own}
        shaped = []
        for name, kind in (kinds | self.temporaries).items():
            if shape(kind):
                shaped.append((name, base(kind), shape(kind)))
        return [f"{TYPES[of]} {name}[{' * '.join(dimensions)}];" for name, of, dimensions in shaped]

    def head(self, name: str) -> str:
        """Return the declaration without a semicolon. Arrays are pointers."""
        pointers = ARGUMENTS | {
            "y": f"const {STRUCTS.get(self.program.component.kind, 'smc_measurement')} *"
        }
        arguments = []
        for parameter in self.parameters:
            kind = self.kinds[parameter]
            of = pointers.get(kind) or (
                self.pointer_to(parameter) if shape(kind) else f"{TYPES[kind]} "
            )
            arguments.append(f"{of}{self.c_name(parameter)}")
        if self.entry:
            return f"int {name}({', '.join(arguments)}, smc_real *out)"
        if len(self.results) == 1 and not shape(self.results[0]):
            return f"static {TYPES[self.results[0]]} {name}({', '.join(arguments) or 'void'})"
        arguments += [f"{TYPES[base(kind)]} *out_{i}" for i, kind in enumerate(self.results)]
        return f"static void {name}({', '.join(arguments)})"

    def pointer_to(self, name: str) -> str:
        """Return the type of a pointer to the numbers of an array."""
        kept = name in self.parameters and name not in self.changed and self.kinds[name] != "memory"
        return f"{'const ' * kept}{TYPES.get(base(self.kinds[name]), 'smc_real')} *"

    def named(self, name: str, kind: str) -> Value:
        """Return the value of a name."""
        if name in self.places:
            return self.places[name]
        if shape(kind):
            return array_at(self.c_name(name), kind)
        return Value(self.c_name(name), kind)

    def origin(self, node: ast.expr | str) -> str:
        """Return the name of the array whose numbers are those of an expression, or of a name; else
        an empty text.
        """
        name = node if isinstance(node, str) else root(node)
        return self.origins.get(name, name)

    def sharing(self, text: str) -> set[str]:
        """Return all names in C of the array that some C begins with."""
        first = re.findall(r"\w+", text)[0]
        names = {self.c_name(n): n for n in self.kinds}
        of = self.origin(names.get(first, ""))
        return {first} | {c for c, n in names.items() if of and self.origin(n) == of}

    def c_name(self, name: str) -> str:
        """Return a variable's name in C. A component's arguments have the names of smc_law.h."""
        if self.entry and self.kinds.get(name) in ARGUMENTS:
            return self.kinds[name]
        return plain(name) + "_" * (name in RESERVED or (self.entry and name in ARGUMENTS))

    # statements

    def block(self, body: Sequence[ast.stmt]) -> Iterator[str]:
        """Yield the lines of some statements, each after the lines that have moved before it."""
        if body is self.tree.body:
            self.before = list[
                str
            ]()  # lines before the present one, such as loops that fill arrays
            self.temporaries = dict[
                str, str
            ]()  # name -> kind of arrays for results within expressions
            self.counts = itertools.count(1)
        for line in itertools.chain.from_iterable(map(self.statement, body)):
            before, self.before = self.before, []
            yield from before
            yield line

    def statement(self, node: ast.stmt) -> Iterator[str]:
        """Yield the lines of a statement, without indentation."""
        match node:
            case ast.Expr(value=ast.Constant(value=str())) | ast.Pass():
                pass
            case ast.Expr(value=ast.Call() as call):
                if shape((value := self.value(call)).kind):
                    raise refuse(call, "an array or a tuple that has no name")
                yield f"{value.text};"
            case ast.Assign(targets=[target]):
                yield from self.assign(target, node.value)
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                yield from self.assign(target, value)
            case ast.AugAssign():
                yield from self.augment(node)
            case ast.If():
                yield from self.branch(node)
            case ast.For(target=ast.Name(id=name), orelse=[]):
                yield from self.loop(node, name)
            case ast.While(orelse=[]):
                yield f"while ({self.truth(node.test)}) {{"
                yield from self.block(node.body)
                yield "}"
            case ast.Break() | ast.Continue():
                yield f"{ast.unparse(node)};"
            case ast.Return(value=ast.expr() as value):
                yield from self.returned(value)
            case _:
                raise refuse(node, f"{type(node).__name__.lower()}")

    def assign(self, target: ast.expr, value: ast.expr) -> Iterator[str]:
        """Assign numbers or arrays to one target, or to a tuple of them."""
        several = isinstance(target, ast.Tuple | ast.List)
        if isinstance(value, ast.IfExp) and (several or self.needs_lines(value)):
            yield from self.either(value, lambda one: self.assign(target, one))
            return
        if not isinstance(target, ast.Tuple | ast.List):
            number = self.numeric(value)
            if isinstance(target, ast.Name) and number.pointer and self.is_part(target.id, value):
                yield self.bind(target.id, number, value)
            elif shape(number.kind) or self.is_array(target):
                yield from self.store(target, number)
            else:
                yield f"{self.destination(target, number.kind)} = {number.text};"
            return
        targets = target.elts
        values = self.parts(value, len(target.elts))
        if values and any(
            self.set_by(targets[:i]) & self.arrays_in([v]) for i, v in enumerate(values)
        ):
            yield "{"
            yield from self.at_once(targets, values)
            yield "}"
        elif values is not None:
            for part, of_part in zip(targets, values, strict=True):
                yield from self.assign(part, of_part)
        elif isinstance(value, ast.Call):
            yield from self.unpack(targets, value)
        else:
            raise refuse(value, "a tuple from anything but a call")

    def needs_lines(self, value: ast.IfExp) -> bool:
        """Return whether one of two values is a tuple, or the result of a Python function, which
        may be one.
        """
        values = value.body, value.orelse
        calls = [self.resolve(one.func) for one in values if isinstance(one, ast.Call)]
        return any(isinstance(one, ast.Tuple) for one in values) or any(map(in_python, calls))

    def either(
        self, value: ast.IfExp, translated: Callable[[ast.expr], Iterable[str]]
    ) -> Iterator[str]:
        """Yield the lines for one value or for the other one, by a condition."""
        yield f"if ({self.truth(value.test)}) {{"
        yield from translated(value.body)
        yield "} else {"
        yield from translated(value.orelse)
        yield "}"

    def arrays_in(self, nodes: Iterable[ast.AST]) -> set[str]:
        """Return the names in some code, and of parts of arrays those of the arrays."""
        return {one for name in names_in(nodes) for one in (name, self.origin(name))}

    def set_by(self, targets: Iterable[ast.expr]) -> set[str]:
        """Return the names that targets bind, and the arrays whose elements they set."""
        return bound(targets) | {
            self.origin(n) for t in targets for n in ast.walk(t) if isinstance(n, ast.Subscript)
        }

    def is_part(self, name: str, value: ast.expr) -> bool:
        """Return whether a name is always the part of an array that a value is, so that it can be a
        pointer into it.
        """
        nodes = [*ast.walk(self.tree)]
        array = self.origin(value)
        in_loops = {
            n for loop in nodes if isinstance(loop, ast.For | ast.While) for n in ast.walk(loop)
        }
        given, of_array = ([n for n in nodes if one in assigned(n)] for one in (name, array))
        lasts = array in self.parameters or (len(of_array) == 1 and of_array[0] not in in_loops)
        kind = self.kinds.get(array, "")
        is_place = isinstance(value, ast.Subscript) and (
            kind == "memory" or (shape(kind) and not is_tuple(kind))
        )
        return bool(is_place and lasts and len(given) == 1 and name not in self.parameters)

    def bind(self, name: str, part: Value, node: ast.expr) -> str:
        """Make a name a pointer to a part of an array, and return the line that sets it."""
        self.kinds[name], self.origins[name] = part.kind, self.origin(node)
        self.names[name] = self.places[name] = array_at(
            self.c_name(name), part.kind, stride=part.stride
        )
        return f"{self.c_name(name)} = {part.pointer};"

    def at_once(self, targets: Sequence[ast.expr], values: Sequence[ast.expr]) -> Iterator[str]:
        """Compute all values before the first assignment, because one reads an earlier target.

        Arrays are refused.
        """
        new = [self.numeric(value) for value in values]
        if any(shape(v.kind) for v in new):
            raise refuse(values[0], "arrays that change places at once")
        yield from (f"const {TYPES[v.kind]} new_{i} = {v.text};" for i, v in enumerate(new))
        for i, (target, value) in enumerate(zip(targets, new, strict=True)):
            yield f"{self.destination(target, value.kind)} = new_{i};"

    def parts(self, value: ast.expr, count: int) -> Sequence[ast.expr] | None:
        """Return the expressions of a tuple, or the elements of one or of memory; None for another
        expression.
        """
        if isinstance(value, ast.Tuple | ast.List) and len(value.elts) == count:
            return value.elts
        if isinstance(value, ast.Name) and (
            (kind := self.kinds.get(value.id, "")) == "memory" or is_tuple(kind)
        ):
            if is_tuple(kind) and int(shape(kind)[0]) != count:
                raise refuse(value, f"{count} names for {shape(kind)[0]} numbers")
            return [ast.Subscript(value, ast.Constant(i), ast.Load()) for i in range(count)]
        return None

    def unpack(self, targets: Sequence[ast.expr], call: ast.Call) -> Iterator[str]:
        """Assign the results of a function that has several."""
        function = self.callee(call)
        kinds, beginning = self.program.function(
            function, self.arguments(function, call), call.args
        )
        if len(kinds) != len(targets):
            raise refuse(call, f"{len(targets)} names for {len(kinds)} results")
        pointers = []
        stores = []
        read = self.arrays_in(call.args)
        for target, kind in zip(targets, kinds, strict=True):
            pointer = self.receiver(target, kind, read)
            if not pointer:
                array = self.temporary(kind if shape(kind) else f"{kind}[1]")
                pointer = array.pointer
                stores.append((target, array if shape(kind) else Value(f"{pointer}[0]", kind)))
            pointers.append(pointer)
        yield call_to(beginning, ", ".join(pointers))
        for target, value in stores:
            if shape(value.kind):
                yield from self.store(target, value)
            else:
                yield f"{self.destination(target, value.kind)} = {value.text};"

    def receiver(self, target: ast.expr, kind: str, read: set[str]) -> str:
        """Return a pointer by which a call that reads some arrays can set a target; "" if it
        cannot.
        """
        if isinstance(target, ast.Name):
            if self.kinds.get(target.id, kind) != kind or (
                shape(kind) and target.id in {*self.parameters, *read}
            ):
                return ""
            place = self.destination(target, kind)
            return place if shape(kind) else f"&{place}"
        place = self.changeable(target)
        fits = (
            base(place.kind) == base(kind)
            and self.same_shape(place.kind, kind)
            and not place.stride
        )
        if not fits or self.origin(target) in read:
            return ""
        if shape(kind):
            return place.pointer
        return f"&{place.text}"

    def destination(self, target: ast.expr, kind: str) -> str:
        """Return a target in C, to which a value of a kind is assigned."""
        if isinstance(target, ast.Subscript):
            place = self.changeable(target)
            if wider(place.kind, kind) != place.kind:
                raise refuse(target, "a real number for an element of an array of whole numbers")
            return place.text
        if isinstance(target, ast.Name):
            name = target.id
        else:
            name = ""
        if not name or self.kinds.get(name) in ARGUMENTS or name in self.constants:
            raise refuse(target, "an assignment to this")
        self.kinds[name] = kind = wider(self.kinds.get(name, kind), kind)
        self.names[name] = self.named(name, kind)
        self.assigned.add(name)
        return self.c_name(name)

    def augment(self, node: ast.AugAssign) -> Iterator[str]:
        """Translate target op= value, element by element if the target is an array."""
        whole = ast.BinOp(
            syntax(ast.unparse(node.target), "eval").body, node.op, node.value
        )  # target op value
        if self.is_array(node.target):
            yield from self.store(node.target, self.numeric(whole))
            return
        if type(node.op) not in OPERATORS:
            result = self.numeric(whole)
            yield f"{self.destination(node.target, result.kind)} = {result.text};"
            return
        value = self.numeric(node.value)
        result = self.combined(node.op, self.numeric(whole.left), value, node)
        target = self.destination(node.target, result.kind)
        if result.kind in WHOLE_KINDS:
            yield f"{target} = {result.text};"
        else:
            yield f"{target} {OPERATORS[type(node.op)][0]}= {value.text};"

    def branch(self, node: ast.If, word: str = "if") -> Iterator[str]:
        """Translate if, elif and else."""
        yield f"{word} ({self.truth(node.test)}) {{"
        yield from self.block(node.body)
        if len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If):
            yield from self.branch(node.orelse[0], "} else if")
            return
        if node.orelse:
            yield "} else {"
            yield from self.block(node.orelse)
        yield "}"

    def loop(self, node: ast.For, variable: str) -> Iterator[str]:
        """Translate for i in range(...) and for element in array."""
        if isinstance(node.iter, ast.Name) and len(shape(self.kinds.get(node.iter.id, ""))) == 1:
            array = self.value(node.iter)
            i = self.index()
            yield f"for (int32_t {i} = 0; {i} < {shape(array.kind)[0]}; {i}++) {{"
            yield f"{self.destination(node.target, base(array.kind))} = {array.text.replace(ROW, i)};"
            yield from self.block(node.body)
            yield "}"
        else:
            yield from self.counted(node, variable)

    def counted(self, node: ast.For, variable: str) -> Iterator[str]:
        """Translate for i in range(...) with a step of 1 or -1."""
        call = node.iter
        if not (
            isinstance(call, ast.Call)
            and ast.unparse(call.func) == "range"
            and 1 <= len(call.args) <= 3
        ):
            raise refuse(call, "a loop over anything but a range")
        if changed(node.body) & names_in([node.target, *call.args]):
            raise refuse(call, "a loop that changes its own variable or range")
        if len(call.args) == 3:
            step = self.constant(call.args[2])
        else:
            step = 1
        bounds = [self.numeric(a) for a in call.args[:2]]
        if any(b.kind != "int" for b in bounds) or step not in (1, -1):
            raise refuse(call, "a range of other than integers with a step of 1 or -1")
        if variable in self.assigned:
            raise refuse(node.target, "a loop over a variable that exists already")
        name = self.c_name(variable)
        self.names[variable] = Value(name, "int")
        if self.counts_naturals(call):
            self.counters |= {variable}
        else:
            self.counters |= set()
        if len(bounds) == 2:
            first, last = bounds
        else:
            first = Value("0", "int")
            last = bounds[0]
        if step == 1:
            sign = "<"
            change = "++"
        else:
            sign = ">"
            change = "--"
        yield f"for (int32_t {name} = {first.text}; {name} {sign} {last.within(SUM)}; {name}{change}) {{"
        yield from self.block(node.body)
        yield "}"
        self.counters.discard(variable)
        del self.names[variable]

    def returned(self, value: ast.expr) -> Iterator[str]:
        """Translate return."""
        if isinstance(value, ast.IfExp) and self.needs_lines(value):
            yield from self.either(value, self.returned)
            return
        values = [
            self.numeric(v) for v in (value.elts if isinstance(value, ast.Tuple) else [value])
        ]
        if len(values) == 1 and is_tuple((one := values[0]).kind):
            values = [
                Value(f"{one.pointer}[{i}]", base(one.kind)) for i in range(int(shape(one.kind)[0]))
            ]
        if self.entry and self.program.component.kind == "estimator" and len(values) == 1:
            values.append(Value("NAN", "real", UNARY))
        self.results = self.results or [v.kind for v in values]
        if len(values) != len(self.results):
            raise refuse(value, "another number of results")
        self.results = [wider(kind, v.kind) for kind, v in zip(self.results, values, strict=True)]
        if self.program.joints:
            wanted = f"real[{JOINTS}]"
        else:
            wanted = "real"
        if self.entry and (
            len(values) != 2 or any(not self.same_shape(kind, wanted) for kind in self.results)
        ):
            joints = "a result other than two vectors, u and s, of one number for each joint,"
            raise refuse(value, joints if self.program.joints else "another number of results")
        if len(values) == 1 and not shape(self.results[0]):
            yield f"return {values[0].text};"
            return
        for i, v in enumerate(values):
            if not self.entry:
                yield from self.fill(
                    array_at(f"out_{i}", v.kind) if shape(v.kind) else Value(f"*out_{i}", v.kind), v
                )
            elif self.program.joints:
                yield from self.fill(array_at("out", v.kind, f"{JOINTS} + " if i else ""), v)
            else:
                yield f"out[{i}] = {v.text};"
        yield "return 0;" if self.entry else "return;"

    def store(self, target: ast.expr, value: Value) -> Iterator[str]:
        """Assign an array, or a number to all elements of an array."""
        if isinstance(target, ast.Name):
            if target.id in self.parameters:
                raise refuse(target, "an assignment to an argument that is an array")
            before = self.kinds.get(target.id, "")
            kind = value.kind
            if shape(before) and self.same_shape(
                before, kind
            ):  # 3 or SMC_JOINTS, where there are three joints
                kind = base(kind) + before[len(base(before)) :]
            self.destination(target, kind)
            place = self.value(target)
        else:
            place = self.changeable(target)
            if wider(base(place.kind), base(value.kind)) != base(place.kind):
                raise refuse(target, "real numbers for elements of an array of whole numbers")
        if shape(value.kind) and not self.same_shape(value.kind, place.kind):
            raise refuse(
                target,
                f"an array of {', '.join(shape(value.kind))} numbers for one of another shape",
            )
        same = [
            re.escape(place.text),
            rf"\w+\[{ROW} \* {SLOTS} \+ \w+\]",
        ]  # elements of the same joint
        others = re.sub("|".join(same), "", value.text)
        if self.sharing(place.text) & set(
            re.findall(r"\w+", others)
        ):  # reads elements that the loop has changed
            kept = self.temporary(value.kind)
            yield from self.fill(kept, value)
            value = kept
        yield from self.fill(place, value)

    def fill(self, place: Value, value: Value) -> Iterator[str]:
        """Yield the loops that copy an array, or one number, to a place."""
        dimensions = shape(place.kind)
        if moved := self.retargeted(place, value):
            yield from moved
            return
        indices = [self.index(i) for i in range(len(dimensions))]
        loops = [
            f"for (int32_t {i} = 0; {i} < {n}; {i}++)"
            for i, n in zip(indices, dimensions, strict=True)
        ]
        line = f"{place.text} = {value.text};"
        for token, i in zip((ROW, COLUMN), indices, strict=False):
            line = line.replace(token, i)
        yield " ".join([*loops, line])

    def retargeted(self, place: Value, value: Value) -> list[str]:
        """Take back and return the lines that have just computed a value, if they can write to a
        place itself.
        """
        name = value.pointer
        given = place.pointer
        lines = [line for line in self.before if name and re.search(rf"\b{name}\b", line)]
        if (
            name not in self.temporaries
            or not lines
            or self.before[-len(lines) :] != lines
            or place.stride
        ):
            return []
        calls = (
            len(lines) == 1 and re.match(r"\w+\(", lines[0]) is not None
        )  # for and if have a space
        fits = given and base(place.kind) == base(value.kind) and (calls or given.isidentifier())
        if not fits or self.sharing(given) & set(
            re.findall(r"\w+", " ".join(lines))
        ):  # it reads from there
            return []
        del self.before[-len(lines) :], self.temporaries[name]
        return [re.sub(rf"\b{name}\b", given, line) for line in lines]

    def changeable(self, target: ast.expr) -> Value:
        """Return elements that the function may change: of its memory, of an array that it makes,
        or of an argument.
        """
        kind = self.kinds.get(self.origin(target), "")
        if kind != "memory" and (not shape(kind) or is_tuple(kind)):
            raise refuse(target, "an assignment to this, which is no array of the function's own,")
        return self.value(target)

    def is_array(self, target: ast.expr) -> bool:
        """Return whether a target of an assignment is an array already."""
        kind = self.kinds.get(root(target), "")
        indices = 0
        while isinstance(target, ast.Subscript):
            if isinstance(target.slice, ast.Tuple):
                places = target.slice.elts
            else:
                places = [target.slice]
            indices += sum(not isinstance(place, ast.Slice) for place in places)
            target = target.value
        return indices < (1 + bool(self.program.joints) if kind == "memory" else len(shape(kind)))

    def same_shape(self, kind: str, other: str) -> bool:
        """Return whether two kinds have the same shape."""
        return [*map(self.program.size, shape(kind))] == [*map(self.program.size, shape(other))]

    def index(self, place: int = 0) -> str:
        """Return the name of a loop's index, which no variable has."""
        taken = {n.id for n in ast.walk(self.tree) if isinstance(n, ast.Name)} | set(
            self.parameters
        )
        return [
            name
            for name in (*"ijklmn", "row", "column", "element_1", "element_2")
            if name not in taken
        ][place]

    # expressions

    def value(self, node: ast.expr) -> Value:
        """Translate an expression that is a number, an array, or one of the law's arguments."""
        method: Callable[[Any], Value] | None = getattr(
            self, f"_{type(node).__name__.lower()}", None
        )
        if method is None:
            raise refuse(node, f"{type(node).__name__}")
        match node:
            case ast.UnaryOp() | ast.BinOp() | ast.Compare():
                return self.elementwise(method, node)
            case ast.IfExp():
                return self.staying(self.elementwise, method, node)
            case ast.BoolOp():
                return self.staying(self.outside, method, node)
        return method(node)

    def numeric(self, node: ast.expr) -> Value:
        """Translate an expression that is a number or an array; an array in an elementwise one to
        its element.
        """
        value = self.value(node)
        if value.kind in ARGUMENTS or not value.kind or (self.frames and is_tuple(value.kind)):
            raise refuse(node, f"{'a tuple' if is_tuple(value.kind) else value.text} as a number")
        if not self.frames:
            return value
        shapes, calls = self.frames[-1]
        if dimensions := shape(value.kind):
            if shapes and not self.same_shape(shapes[0], value.kind):
                raise refuse(node, "arrays of different shapes in one expression")
            shapes.append("".join(f"[{n}]" for n in dimensions))
            return value._replace(kind=base(value.kind))
        if "(" in value.text and not isinstance(node, ast.Constant):
            calls.append(value)
            return Value(f"\x02{len(calls) - 1}\x03", value.kind, value.level)
        return value

    def elementwise(self, method: Callable[[Any], Value], node: Any) -> Value:
        """Translate an expression by its elements: an array if an operand is one.

        Calls then move before the loop.
        """
        self.frames.append(([], []))
        try:
            value = method(node)
        finally:
            shapes, calls = self.frames.pop()
        if not shapes:
            return value._replace(
                text=TOKEN.sub(lambda match: calls[int(match[1])].text, value.text)
            )
        names = {}

        def moved(match: re.Match[str]) -> str:
            if match[1] not in names:
                call = calls[int(match[1])]
                names[match[1]] = self.new_name("number")
                self.move(f"const {TYPES[call.kind]} {names[match[1]]} = {call.text};", node)
            return names[match[1]]

        text = LONE_TOKEN.sub("\\1", value.text)  # a name needs no parentheses
        return Value(TOKEN.sub(moved, text), value.kind + shapes[0], value.level)

    def outside(self, method: Callable[..., Any], *arguments: Any) -> Any:
        """Call a method whose operands are no elements of the present expression."""
        frames, self.frames = self.frames, []
        try:
            return method(*arguments)
        finally:
            self.frames = frames

    def staying(self, method: Callable[..., Any], *arguments: Any) -> Any:
        """Call a method that must not move anything before the present line."""
        fixed, self.fixed = self.fixed, True
        try:
            return method(*arguments)
        finally:
            self.fixed = fixed

    def move(self, line: str, node: ast.AST) -> None:
        """Put a line before the present one."""
        if self.fixed:
            raise refuse(node, "an array that is computed within a condition")
        self.before.append(line)

    def new_name(self, word: str) -> str:
        """Return a name that the function does not have."""
        taken = {*self.read, *self.kinds}
        return next(name for i in self.counts if (name := f"{word}_{i}") not in taken)

    def temporary(self, kind: str) -> Value:
        """Return a new array."""
        name = self.new_name("array")
        self.temporaries[name] = kind
        return array_at(name, kind)

    def argument(self, node: ast.expr) -> Value:
        """Translate an argument of a function: a number, an array as a pointer, or y or gains."""
        value = self.outside(self.value, node)
        if not shape(value.kind):
            return value
        if not value.pointer or value.stride:  # its numbers do not lie in a row: copy them
            value, of_elements = self.temporary(value.kind), value
            for line in list(self.fill(value, of_elements)):
                self.move(line, node)
        return value._replace(text=value.pointer)

    def arguments(self, function: Any, call: ast.Call) -> list[Value]:
        """Translate the arguments of a call.

        An array that the function changes is a pointer, with its stride.
        """
        changed = self.program.changes(function)
        values = list[Value]()
        shared = [self.shared(a) for a in call.args]
        for i, node in enumerate(call.args):
            if i not in changed or not isinstance(node, ast.Name | ast.Subscript | ast.Attribute):
                values.append(self.argument(node))
                continue
            value = self.outside(self.changeable, node)
            if any(shared[i] & others for j, others in enumerate(shared) if j != i):
                raise refuse(call, "a call that gets an array twice and changes it")
            if shape(value.kind):
                if not value.pointer:
                    raise refuse(node, "a part of a matrix, which a function changes,")
                value = value._replace(
                    text=value.pointer, kind=value.kind + f"@{value.stride}" * bool(value.stride)
                )
            values.append(value)
        return values

    def check_order(self, call: ast.Call) -> None:
        """Refuse a call that changes an array which the rest of its line reads:

        C does not say which comes first.
        """
        changed = set()
        for i in self.program.changes(self.callee(call)):
            if i < len(call.args):
                changed.add(self.origin(call.args[i]))
        for line in (n for n in in_body(self.tree) if isinstance(n, ast.stmt)):
            if isinstance(line, ast.Assign):
                targets = line.targets
            else:
                targets = []
            parts = []
            for n in ast.iter_child_nodes(line):
                if not isinstance(n, ast.stmt) and n not in targets:
                    parts.append(n)
            inside = [n for part in parts for n in ast.walk(part)]
            names = [n for n in inside if isinstance(n, ast.Name) and n not in ast.walk(call)]
            if call in inside and changed & self.arrays_in(names):
                raise refuse(call, "a call that changes an array which the rest of the line reads")

    def truth(self, node: ast.expr) -> str:
        """Translate an expression as a condition."""
        value = self.staying(self.outside, self.numeric, node)
        if shape(value.kind):
            raise refuse(node, "an array as a condition")
        if value.kind in WHOLE_KINDS:
            return value.text
        return f"{value.within(UNARY)} != 0"

    def constant(self, node: ast.expr) -> float | None:
        """Return the literal number that an expression is, or None."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            value = self.constant(node.operand)
            return None if value is None else -value
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            return node.value
        if isinstance(node, ast.Name):
            return self.constants.get(node.id)
        return None

    def resolve(self, node: ast.expr) -> Any:
        """Return the value of a global name, dotted or not; None for a variable."""
        if names_in([node]) & self.names.keys():
            return None
        return resolved(node, self.globals)

    def callee(self, node: ast.Call) -> Any:
        """Return the function that is called."""
        function = self.resolve(node.func)
        if function is None:
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

    def _attribute(self, node: ast.Attribute) -> Value:
        if (constant := self.resolve(node)) is not None:
            return self.outer(node, constant)
        owner = self.outside(self.value, node.value)
        name = node.attr
        joints = self.program.joints
        if owner.kind == "y":
            kind = self.program.component.kind
            if joints:
                fields = JOINT_FIELDS
            else:
                fields = CHANNEL_FIELDS[kind]
            known(name, "reading" if kind == "estimator" else "measurement", fields)
            if joints and JOINT_FIELDS[name]:
                return array_at(f"{owner.text}->{name}", f"real{JOINT_FIELDS[name]}")
            return Value(f"{owner.text}->{name}", "real")
        if owner.kind == "gains":
            known(name, "gain", self.program.gains)
            place = f"GAIN_{plain(name)}" + f" * {JOINTS}" * bool(joints)
            if joints and name not in self.program.component.shared:
                return array_at(owner.text, f"real[{JOINTS}]", f"{place} + ")
            return Value(f"{owner.text}[{place}]", "real")
        if fields := fields_of(owner.kind):
            known(name, "field", fields)
            return Value(f"{owner.pointer}[{fields.index(name)}]", base(owner.kind))
        raise refuse(node, "an attribute")

    def outer(self, node: ast.expr, value: Any) -> Value:
        """Return a constant from outside of the function: a number or an array."""
        if not isinstance(value, np.ndarray | tuple):
            return literal(value, self.program.single, node)
        made = self.program.array(ast.unparse(node).replace(".", "_"), value)
        array = array_at(made.text, f"{made.kind}[{len(value)}]" + "()" * isinstance(value, tuple))
        # of 16 bits, so that functions get a copy
        if made.kind == "real":
            return array
        return array._replace(pointer="")

    def _subscript(self, node: ast.Subscript) -> Value:
        constants = self.resolve(node.value)
        joints = self.program.joints
        if isinstance(constants, tuple | list | np.ndarray):
            owner = self.outer(node.value, np.asarray(constants))
        else:
            owner = self.outside(self.value, node.value)
        if owner.kind == "memory":
            owner = array_at(owner.text, f"real[{JOINTS}][{SLOTS}]" if joints else f"real[{SLOTS}]")
        dimensions = shape(owner.kind)
        if isinstance(node.slice, ast.Tuple):
            places = node.slice.elts
        else:
            places = [node.slice]
        if not dimensions or len(places) > len(dimensions):
            raise refuse(node, "an element")
        return self.elements(
            node, owner, [*places, *[ast.Slice()] * (len(dimensions) - len(places))]
        )

    def elements(self, node: ast.Subscript, owner: Value, places: Sequence[ast.expr]) -> Value:
        """Return some elements of an array, by an index or a colon for each dimension."""
        dimensions = shape(owner.kind)
        text = owner.text
        pointer = owner.pointer
        if len(dimensions) == 2:
            strides = [dimensions[1], ""]
        else:
            strides = [owner.stride]
        left = list[str]()
        steps = list[str]()
        for token, place, dimension, stride in zip(
            (ROW, COLUMN), places, dimensions, strides, strict=False
        ):
            if isinstance(place, ast.Slice):
                first, count = self.part(node, place, dimension)
                kept = (ROW, COLUMN)[len(left)]
                if first:
                    index = Value(f"{kept} + {first}", "int", SUM)
                else:
                    index = Value(kept, "int")
                left.append(count)
                steps.append(stride)
                moved = Value(str(first), "int")
            else:
                index = self.outside(self.numeric, place)
                self.check_index(node, place, index, dimension)
                if dimension != SLOTS and not self.natural(
                    place
                ):  # Python counts a negative index from the end
                    index = Value(
                        f"{self.program.helper('wrapped', 'int')}({index.text}, {dimension})", "int"
                    )
                moved = index
            text = re.sub(rf"\[{token}\]|{token}", functools.partial(put, index), text)
            if moved.text != "0":
                if stride:
                    pointer += f" + {moved.within(PRODUCT)} * {stride}"
                else:
                    pointer += f" + {moved.within(SUM)}"
        kind = (
            base(owner.kind)
            + "".join(f"[{n}]" for n in left)
            + "()" * (is_tuple(owner.kind) and bool(left))
        )
        in_rows = len(left) < 2 or left[1] == dimensions[1]
        located = bool(left and owner.pointer and in_rows)
        return Value(text, kind, owner.level, pointer * located, steps[-1] if located else "")

    def part(self, node: ast.Subscript, place: ast.Slice, dimension: str) -> tuple[int, str]:
        """Return where a slice of a dimension begins, and its length."""
        if place.step:
            raise refuse(node, "a part of an array with a step")
        if dimension == SLOTS:
            size = self.program.component.memory
        else:
            size = self.program.size(dimension)
        found = range(size)[slice(self.bound(place.lower), self.bound(place.upper))]
        if not found:
            raise refuse(node, "an empty part of an array")
        if dimension == SLOTS:
            self.program.claim(node, found[-1])
        return found[0], dimension if len(found) == size and dimension != SLOTS else str(len(found))

    def bound(self, node: ast.expr | None) -> int | None:
        """Return the bound of a slice, which is known before the law runs."""
        if node is None:
            return None
        constant = self.constant(node)
        if isinstance(constant, int):
            return constant
        return self.program.size(self.dimensions(node)[0])

    def check_index(
        self, node: ast.Subscript, place: ast.expr, index: Value, dimension: str
    ) -> None:
        """Refuse an index that is no integer, or out of range as far as it is known."""
        constant = self.constant(place)
        component = self.program.component
        if index.kind != "int":
            raise refuse(node, "an index that is not an integer")
        if dimension == SLOTS:
            if constant is None:  # a ring of readings or a matrix, as long as its memory
                constant = component.memory - 1
            if constant is None or constant < 0:
                if constant is None:
                    why = "at an index that is not constant"
                else:
                    why = "at a negative index"
                raise refuse(node, f"memory {why}")
            self.program.claim(node, int(constant))
        elif (
            constant is not None and not -(size := self.program.size(dimension)) <= constant < size
        ):
            raise refuse(node, f"an index outside {-size} to {size - 1}")

    def counts_naturals(self, node: ast.expr) -> bool:
        """Return whether no number of a range with a step of 1 or -1 is negative."""
        match node:
            case ast.Call(args=[_]):
                return True
            case ast.Call(args=[first, _]):
                return self.natural(first)
            case ast.Call(args=[first, last, step]):
                end = self.constant(last)
                if self.constant(step) == 1:
                    return self.natural(first)
                return end is not None and end >= -1
        return False

    def natural(self, node: ast.expr) -> bool:
        """Return whether an index is certainly not negative."""
        match node:
            case ast.Name(id=name) if name in self.counters:
                return True
            case ast.BinOp(left=left, op=ast.Add() | ast.Mult() | ast.Mod(), right=right):
                return self.natural(left) and self.natural(right)
        return (constant := self.constant(node)) is not None and constant >= 0

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(f"!({self.truth(node.operand)})", "bool", UNARY)
        value = self.numeric(node.operand)
        if isinstance(node.op, ast.UAdd):
            return value
        if not isinstance(node.op, ast.USub):
            raise refuse(node, "the operator")
        return Value(f"-{value.within(ATOM)}", "int" if value.kind == "bool" else value.kind, UNARY)

    def _binop(self, node: ast.BinOp) -> Value:
        if isinstance(node.op, ast.Pow):
            return self._power(node)
        if isinstance(node.op, ast.MatMult):
            raise refuse(node, "the operator @")
        return self.combined(node.op, self.numeric(node.left), self.numeric(node.right), node)

    def combined(self, operator: ast.operator, left: Value, right: Value, node: ast.AST) -> Value:
        """Return the result of an operator but that of powers."""
        whole = left.kind in WHOLE_KINDS and right.kind in WHOLE_KINDS
        if type(operator) in BIT_OPERATORS:
            if not whole:
                raise refuse(node, "a bit operation on real numbers")
            return Value(
                f"{left.within(ATOM)} {BIT_OPERATORS[type(operator)]} {right.within(ATOM)}",
                "int",
                LOOSE,
            )
        if isinstance(operator, ast.Mod) and whole:
            return Value(
                f"{self.program.helper('modulo', 'int')}({left.text}, {right.text})", "int"
            )
        if type(operator) not in OPERATORS:
            raise refuse(node, f"the operator {type(operator).__name__}")
        sign, level = OPERATORS[type(operator)]
        first = left.within(level)
        kind = wider(left.kind, right.kind)
        if whole:
            kind = "int"
            if sign == "/":
                first = f"(smc_real){left.within(UNARY)}"
                kind = "real"
        return Value(f"{first} {sign} {right.within(level + 1)}", kind, level)

    def _power(self, node: ast.BinOp) -> Value:
        base = self.numeric(node.left)
        exponent = self.constant(node.right)
        if base.kind in WHOLE_KINDS:
            raise refuse(node, "a power of a whole number")
        if exponent == 1:
            return base
        if exponent == 0.5:
            return self.math("sqrt", [base])
        if (power := f"power_{exponent}") in POWERS or exponent == 2:
            return Value(
                f"{self.program.helper(power.removesuffix('.0'), base.kind)}({base.text})",
                base.kind,
            )
        power = self.numeric(node.right)
        if power.kind in WHOLE_KINDS:
            raise refuse(node, "a power with such an exponent")
        return self.math("pow", [base, power])

    def _compare(self, node: ast.Compare) -> Value:
        terms = [self.numeric(n).within(SUM) for n in (node.left, *node.comparators)]
        if any(type(sign) not in COMPARISONS for sign in node.ops):
            raise refuse(node, "the comparison")
        pairs = zip(itertools.pairwise(terms), node.ops, strict=True)
        parts = [f"{left} {COMPARISONS[type(sign)]} {right}" for (left, right), sign in pairs]
        return Value(" && ".join(parts), "bool", LOOSE)

    def _boolop(self, node: ast.BoolOp) -> Value:
        values = [self.numeric(v) for v in node.values]
        if any(v.kind != "bool" for v in values):
            raise refuse(node, "`and` or `or` of numbers instead of comparisons")
        # && and || of other operands need parentheses around a nested && or ||
        parts = [f"({v.text})" if "&&" in v.text or "||" in v.text else v.text for v in values]
        return Value(
            (" && " if isinstance(node.op, ast.And) else " || ").join(parts), "bool", LOOSE
        )

    def _ifexp(self, node: ast.IfExp) -> Value:
        yes = self.numeric(node.body)
        no = self.numeric(node.orelse)
        test = self.truth(node.test)
        return self.chosen(Value(test, "bool", LOOSE if " " in test else ATOM), yes, no)

    def chosen(self, test: Value, yes: Value, no: Value) -> Value:
        """Return one of two values, by a condition."""
        return Value(
            f"{test.within(SUM)} ? {yes.within(SUM)} : {no.within(SUM)}",
            wider(yes.kind, no.kind),
            LOOSE,
        )

    def _tuple(self, node: ast.Tuple) -> Value:
        return self.gathered(node, node.elts, "()")

    def _call(self, node: ast.Call) -> Value:
        if node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
            raise refuse(node, "a call with names or stars")
        if isinstance(node.func, ast.Attribute) and node.func.attr == "copy" and not node.args:
            return self.outside(self.value, node.func.value)._replace(pointer="", stride="")
        function = self.callee(node)
        if function in ELEMENTWISE or function in HELPER_NAMES or function is np.where:
            return self.elementwise(lambda call: self.of_elements(function, call), node)
        if function is len or function in FILL_VALUES:
            method = self.sized
        elif function is np.array or hasattr(function, "_fields"):
            method = self.listed
        elif function in REQUESTED_ARRAYS:
            method = self.requested
        else:
            method = self.called
        return self.outside(method, function, node)

    def called(self, function: Any, node: ast.Call) -> Value:
        """Translate a call of a function of Python, math, or one that is translated itself."""
        values = self.arguments(function, node)
        if not any(shape(v.kind) for v in values):
            if (built_in := self.built_in(function, values, node)) is not None:
                return built_in
        elif (
            function in (min, max)
            or inspect.isbuiltin(function)
            or isinstance(function, type | np.ufunc)
        ):
            raise refuse(node, f"{getattr(function, '__name__', function)} of an array")
        kinds, beginning = self.program.function(function, values, node.args)
        self.check_order(node)
        if not kinds or (len(kinds) == 1 and not shape(kinds[0])):
            return Value(f"{beginning})", "".join(kinds))
        if len({*kinds}) > 1 or (len(kinds) > 1 and shape(kinds[0])):
            raise refuse(node, "several results, not all numbers of a kind, within an expression")
        array = self.temporary(kinds[0] if len(kinds) == 1 else f"{kinds[0]}[{len(kinds)}]()")
        pointers = [f"{array.pointer} + {i}" if i else array.pointer for i in range(len(kinds))]
        self.move(call_to(beginning, ", ".join(pointers)), node)
        return array

    def built_in(self, function: Any, values: list[Value], node: ast.Call) -> Value | None:
        """Translate a call of a function of Python, math or numpy; return None for another
        function.
        """
        if function in (min, max):
            return self.extreme("minimum" if function is min else "maximum", values, node)
        if function in CASTS and len(values) == 1:
            kind = CASTS[function]
            return Value(f"({TYPES[kind]}){values[0].within(UNARY)}", kind, UNARY)
        if function in ROUNDING:
            return Value(f"(int32_t){self.math(ROUNDING[function], values).text}", "int", UNARY)
        if function in SAME_IN_C:
            return self.math(function.__name__, values)
        return None

    def extreme(self, helper: str, values: list[Value], node: ast.Call) -> Value:
        """Translate min or max, from left to right."""
        if len(values) == 1:
            raise refuse(node, "min or max of one thing")
        result = values[0]
        for value in values[1:]:
            kind = wider(result.kind, value.kind)
            result = Value(
                f"{self.program.helper(helper, kind)}({result.text}, {value.text})", kind
            )
        return result

    def math(self, name: str, values: Sequence[Value]) -> Value:
        """Translate a call of a function of math.h, in the precision of its arguments."""
        single = all(v.kind == "single" for v in values)
        suffix = "f" if single or self.program.single else ""
        return Value(
            f"{name}{suffix}({', '.join(v.text for v in values)})", "single" if single else "real"
        )

    def of_elements(self, function: Any, node: ast.Call) -> Value:
        """Translate a function of numpy, by its elements."""
        values = [self.numeric(a) for a in node.args]
        if all(v.kind == "single" for v in values):
            kind = "single"
        else:
            kind = "real"
        if function is np.where:
            if len(values) != 3:
                raise refuse(node, "where without two values")
            return self.chosen(*values)
        if function in HELPER_NAMES:
            return Value(
                f"{self.program.helper(HELPER_NAMES[function], kind)}({', '.join(v.text for v in values)})",
                kind,
            )
        if function in (abs, np.abs) and values[0].kind in WHOLE_KINDS:
            return Value(f"{self.program.helper('absolute', 'int')}({values[0].text})", "int")
        return self.math(ELEMENTWISE[function], values)

    def requested(self, function: Any, node: ast.Call) -> Value:
        """Translate coriolis and jacobian, which the caller of the law provides."""
        name, dimensions = REQUESTED_ARRAYS[function]
        y, *rest = [self.argument(a) for a in node.args]
        array = self.temporary("real" + "".join(f"[{n}]" for n in dimensions))
        arguments = [f"{y.text}->plant", *(argument.text for argument in rest)]
        self.move(f"{y.text}->{name}({', '.join(arguments)}, {array.pointer});", node)
        return array

    def listed(self, function: Any, node: ast.Call) -> Value:
        """Translate np.array of a list of numbers, or a NamedTuple of numbers."""
        if function is not np.array:
            if len(node.args) != len(function._fields):
                raise refuse(node, "a NamedTuple without all its fields")
            return self.gathered(node, node.args, f"({','.join(function._fields)})")
        if len(node.args) != 1 or not isinstance(node.args[0], ast.List | ast.Tuple):
            raise refuse(node, "an array of anything but a list of numbers")
        return self.gathered(node, node.args[0].elts)

    def gathered(self, node: ast.expr, elements: Sequence[ast.expr], fields: str = "") -> Value:
        """Return an array of numbers, or a tuple with fields."""
        items = [self.outside(self.numeric, item) for item in elements]
        if not items or any(shape(item.kind) for item in items):
            raise refuse(node, "a tuple or an array of arrays, or of nothing,")
        kind = functools.reduce(wider, (item.kind for item in items))
        array = self.temporary(f"{kind}[{len(items)}]{fields}")
        for i, item in enumerate(items):
            self.move(f"{array.pointer}[{i}] = {item.text};", node)
        return array

    def sized(self, function: Any, node: ast.Call) -> Value:
        """Translate len, and arrays that are filled with one number."""
        if len(node.args) != 1:
            raise refuse(node, "a call with another number of arguments")
        if function is len:
            return Value(self.dimensions(node)[0], "int")
        dimensions = "".join(f"[{n}]" for n in self.dimensions(node.args[0]))
        return literal(FILL_VALUES[function], self.program.single, node)._replace(
            kind=f"real{dimensions}"
        )

    def dimensions(self, node: ast.expr) -> list[str]:
        """Return the dimensions that an expression gives: a number, len(array), a variable, or a
        tuple of these.
        """
        match node:
            case ast.Tuple(elts=elements) if len(elements) <= 2:
                return [self.dimensions(element)[0] for element in elements]
            case ast.Constant(value=int(size)) if size > 0:
                return [str(size)]
            case ast.Call(func=ast.Name(id="len"), args=[array]):
                if dimensions := shape(self.value(array).kind):
                    return [dimensions[0]]
            case ast.Name(id=name):
                given = [
                    statement for statement in ast.walk(self.tree) if name in assigned(statement)
                ]
                if (
                    len(given) == 1
                    and isinstance(given[0], ast.Assign)
                    and isinstance(given[0].targets[0], ast.Name)
                ):
                    return self.dimensions(given[0].value)
                if (
                    isinstance(size := self.globals.get(name), int)
                    and not given
                    and name not in self.kinds
                ):
                    return [str(size)]
        raise refuse(node, "a length that is not known before the law runs")

    # names that share numbers

    def check_sharing(self) -> None:
        """Refuse arrays that the function changes and that share their numbers with another name."""
        nodes = in_body(self.tree)
        changed = {n for n, kind in self.kinds.items() if kind == "memory"}
        for node in nodes:
            if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store):
                changed.add(self.origin(node))
            elif isinstance(node, ast.AugAssign):
                changed.add(self.origin(node.target))
            elif isinstance(node, ast.Call):
                numbers = self.program.changes(self.resolve(node.func))
                changed |= {self.origin(node.args[i]) for i in numbers if i < len(node.args)}
        for target, value in pairs(nodes):
            copies = bound([target]) - self.origins.keys()
            shares = self.shared(value)
            of_array = any(shape(self.kinds.get(name, "")) for name in copies)
            if of_array and (shares & changed or (shares and copies & changed)):
                raise refuse(value, f"an array, {SHARED_WORDS},")

    def shared(self, node: ast.expr) -> set[str]:
        """Return the names of arrays with which the value of an expression may share its numbers."""
        names = set[str]()
        parts = list[ast.expr]()
        match node:
            case ast.Name() | ast.Subscript() if self.is_array(node):
                if is_tuple(self.kinds.get(self.origin(node), "")):
                    names = set()
                else:
                    names = {self.origin(node)}
            case ast.Attribute() | ast.Subscript(value=ast.Attribute()):  # of y or gains
                names = {ast.unparse(node)}
            case ast.IfExp():
                parts = [node.body, node.orelse]
            case ast.Call() if may_return_argument(self.resolve(node.func)):
                parts = node.args
                names = set()
                for a in parts:
                    if isinstance(a, ast.Name) and self.kinds.get(a.id) in ARGUMENTS:
                        names.add(a.id)
        return names.union(*map(self.shared, parts))


# reading Python


def syntax(text: str, mode: Literal["exec", "eval"] = "exec") -> Any:
    """Return the syntax tree of a text.

    Before Python 3.11.8 two threads must not build one at once (gh-106905).
    """
    with PARSING_LOCK:
        return ast.parse(text, mode=mode)


def parsed(function: Any) -> tuple[FunctionType, ast.FunctionDef]:
    """Return a Python function, compiled or not, and its syntax tree."""
    written = getattr(function, "py_func", function)
    if of_numpy(written):
        raise refuse(None, f"numpy's {function.__name__}")
    if not isinstance(written, FunctionType):
        raise refuse(
            None, f"{getattr(function, '__name__', function)}, which is not a Python function,"
        )
    try:
        (tree,) = syntax(textwrap.dedent(inspect.getsource(written))).body
    except (OSError, SyntaxError, ValueError):
        raise refuse(None, f"{written.__name__}, whose source is not available,") from None
    if not isinstance(tree, ast.FunctionDef):
        raise refuse(tree, "a function without def")
    return written, tree


def in_body(tree: ast.FunctionDef) -> list[ast.AST]:
    """Return the nodes of a function's statements, without its decorators."""
    return [node for statement in tree.body for node in ast.walk(statement)]


def around(written: FunctionType) -> dict[str, Any]:
    """Return the names outside of a function that it can read, with their values."""
    cells = zip(written.__code__.co_freevars, written.__closure__ or (), strict=True)
    return written.__globals__ | {name: cell.cell_contents for name, cell in cells}


def in_python(function: Any) -> FunctionType | None:
    """Return the Python of a function, compiled or not; None for numpy's, for C's and for what is
    no function.
    """
    written = getattr(function, "py_func", function)
    if isinstance(written, FunctionType) and not of_numpy(written):
        return written
    return None


def of_numpy(function: Any) -> bool:
    """Return whether a function is one of numpy's own."""
    return str(getattr(function, "__module__", "")).partition(".")[0] == "numpy"


def names_in(nodes: Iterable[ast.AST]) -> set[str]:
    """Return the names in some code."""
    return {n.id for node in nodes for n in ast.walk(node) if isinstance(n, ast.Name)}


def pairs(nodes: Iterable[ast.AST]) -> list[tuple[ast.expr, ast.expr]]:
    """Return the targets and values of the assignments among some nodes; of tuples, those of their
    elements.
    """
    found = list[tuple[ast.expr, ast.expr]]()
    for node in nodes:
        if isinstance(node, ast.Assign):
            for target in node.targets:
                paired = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
                # pyright: ignore[reportAttributeAccessIssue]
                if paired:
                    found += zip(target.elts, node.value.elts, strict=False)
                else:
                    found += [(target, node.value)]
    return found


def changed(nodes: Iterable[ast.AST]) -> set[str]:
    """Return the names of variables and arrays that some code changes."""
    inside = []
    for node in nodes:
        for n in ast.walk(node):
            if isinstance(n, ast.Name | ast.Subscript):
                inside.append(n)
    return names_in(
        n.value if isinstance(n, ast.Subscript) else n
        for n in inside
        if isinstance(n.ctx, ast.Store)
    )


def returns(body: Sequence[ast.stmt]) -> bool:
    """Return whether every path through some code ends in a return."""
    match body[-1]:
        case ast.If(body=yes, orelse=no):
            return bool(no) and returns(yes) and returns(no)
        case last:
            return isinstance(last, ast.Return)


def known(name: str, kind: str, names: Iterable[str]) -> None:
    """Refuse a name that a law cannot read."""
    if name not in names:
        raise Untranslatable(f"it reads an {unknown(kind, name, names)}")


def refuse(node: ast.AST | None, what: str) -> Untranslatable:
    """Return the error for a piece of Python without translation."""
    if node is not None:
        code = f" ({shown(ast.unparse(node))[1:-1]})"
    else:
        code = ""
    return Untranslatable(
        f"{what}{code} has no translation into C: write it with arithmetic, if, for and math's functions"
    )


def resolved(node: ast.expr, known: Mapping[str, Any]) -> Any:
    """Return the value of a name, dotted or not, among known names and Python's own; None for
    another expression.
    """
    if isinstance(node, ast.Name):
        return known.get(node.id, getattr(builtins, node.id, None))
    if isinstance(node, ast.Attribute) and isinstance(
        module := resolved(node.value, known), ModuleType
    ):
        return getattr(module, node.attr, None)
    return None


def may_return_argument(function: Any) -> bool:
    """Return whether a function may return one of its arguments, or a part of it, and not only what
    it computes.
    """
    written = in_python(function)
    if written is None:
        return False
    tree = parsed(written)[1]
    nodes = [*ast.walk(tree)]
    arguments = {a.arg for a in tree.args.args}
    known = around(written)
    given = [(name, value) for target, value in pairs(nodes) for name in bound([target])]

    def may_share(value: ast.expr, seen: frozenset[str] = frozenset()) -> bool:
        match value:
            case ast.Tuple(elts=parts):
                return any(may_share(part, seen) for part in parts)
            case ast.IfExp(body=yes, orelse=no):
                return may_share(yes, seen) or may_share(no, seen)
            case ast.Call(func=called):
                return may_return_argument(resolved(called, known))
            case ast.Subscript(value=array):
                return may_share(array, seen)
            case ast.Name(id=name):
                if name in seen:
                    values = []
                else:
                    values = [v for n, v in given if n == name]
                return name in arguments or any(may_share(v, seen | {name}) for v in values)
        return isinstance(value, ast.Attribute)

    return any(
        may_share(node.value) for node in nodes if isinstance(node, ast.Return) and node.value
    )


def assigned(node: ast.AST) -> set[str]:
    """Return the names in the targets of an assignment or of a loop; none of other code."""
    if isinstance(node, ast.Assign):
        targets = node.targets
    else:
        targets = [getattr(node, "target", None)]
    return bound(target for target in targets if target is not None)


def bound(targets: Iterable[ast.AST]) -> set[str]:
    """Return the names that some targets bind, and not only change the elements of."""
    inside = []
    for target in targets:
        for n in ast.walk(target):
            inside.append(n)
    return {n.id for n in inside if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}


def root(node: ast.expr) -> str:
    """Return the name of the array whose elements an expression names, or an empty text."""
    while isinstance(node, ast.Subscript):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


# writing C


def wider(first: str, second: str) -> str:
    """Return the kind of an operation on two kinds, in C and in numba.

    An integer and a single give a real.
    """
    bases, shapes = zip(
        *((base(kind), kind.removeprefix(base(kind))) for kind in (first, second)), strict=True
    )
    if shapes[0] != shapes[1]:
        raise refuse(None, "a name for a number and an array, or for arrays of two shapes,")
    mixed = "single" in bases and any(kind in WHOLE_KINDS for kind in bases)
    return ("real" if mixed else max(bases, key=KINDS.index)) + shapes[0]


def call_to(beginning: str, pointers: str) -> str:
    """Return the call of a function that writes its results to pointers."""
    return f"{beginning}{', ' * (not beginning.endswith('('))}{pointers});"


def literal(value: Any, single: bool, node: ast.AST) -> Value:
    """Return a Python number in C. `single`: whether smc_real is float."""
    if type(value) is np.float32:
        kind = "single"
    else:
        kind = "real"
    if isinstance(value, bool):
        return Value(str(int(value)), "bool")
    if type(value).__name__.startswith("int"):
        n = int(value)
        if not -(2**31) < n < 2**31:
            raise refuse(node, f"the whole number {n}, beyond 32 bits,")
        return Value(str(n), "int", ATOM if n >= 0 else UNARY)
    try:
        x = float(value)
    except (TypeError, ValueError):
        raise refuse(node, f"the value {shown(value)}") from None
    if math.isnan(x) or math.isinf(x):
        return Value(
            "NAN" if math.isnan(x) else "INFINITY" if x > 0.0 else "-INFINITY", kind, UNARY
        )
    text = repr(x)
    return Value(
        text + "f" * (single or kind == "single"), kind, UNARY if text.startswith("-") else ATOM
    )


def plain(name: str) -> str:
    """Return a name in ASCII letters, which every C99 compiler accepts."""
    return "".join(c if c.isascii() else f"u{ord(c):04x}" for c in name)


def rows(items: Sequence[str]) -> str:
    """Return items in lines of at most 100 characters."""
    text = ", ".join(items) + ","
    return textwrap.fill(text, 100, initial_indent="    ", subsequent_indent="    ")


def wrapped(indent: str, line: str) -> list[str]:
    """Return a line of code in lines of at most 110 characters."""
    return textwrap.wrap(
        indent + line,
        110,
        subsequent_indent=f"{indent}        ",
        break_long_words=False,
        break_on_hyphens=False,
    )


def shape(kind: str) -> list[str]:
    """Return the dimensions of a kind."""
    return re.findall(r"\[(\w+)\]", kind)


def base(kind: str) -> str:
    """Return the kind of the elements."""
    return kind.partition("[")[0]


def is_tuple(kind: str) -> bool:
    """Return whether a kind is that of a tuple."""
    return kind.endswith(")")


def fields_of(kind: str) -> list[str]:
    """Return the names of a tuple's fields, if it has some."""
    if is_tuple(kind) and not kind.endswith("()"):
        return kind.partition("(")[2].removesuffix(")").split(",")
    return []


def put(index: Value, token: re.Match[str]) -> str:
    """Return an index in the place of a token, which may be in brackets."""
    if token[0].startswith("["):
        return f"[{index.text}]"
    return index.within(PRODUCT)


def array_at(pointer: str, kind: str, offset: str = "", stride: str = "") -> Value:
    """Return the array at a pointer, from an offset on.

    `stride`: from one number to the next, if it is not 1.
    """
    if len(shape(kind)) == 1:
        place = ROW
    else:
        place = f"{ROW} * {shape(kind)[-1]} + {COLUMN}"
    place += f" * {stride}" * bool(stride)
    if offset:
        moved = f"{pointer} + {offset.removesuffix(' + ')}"
    else:
        moved = pointer
    return Value(f"{pointer}[{offset}{place}]", kind, ATOM, moved, stride)
