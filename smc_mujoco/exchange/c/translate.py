"""Translate the Python of a law, surface or estimator into C99, operation by operation and with the
same rounding.

numba turns some powers with a constant exponent into products or roots. The C does the same, so
that its results in double precision equal those of the compiled function bit for bit.

A number in C is an expression. So is an element of an array, with ROW and COLUMN in place of its
indices: an assignment to an array is a loop over such elements, with the operations of numba in the
same order. What does not fit into an expression, such as a call that gives an array, becomes a line
before it. A function that returns arrays or several numbers writes them to pointers.

Python's names of arrays may share numbers. A name that is bound once to an array that lasts, or to
a part of it, as in `w = memory[:, 0]`, is a pointer into it. All others are copies. So an array
that the function changes must not share its numbers with a copy; such code is refused.
"""

import ast
import builtins
import collections
import functools
import inspect
import itertools
import math
import re
import textwrap
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common.aliases import Fields, Names
from smc_mujoco.common.errors import ScenarioError, shown, unknown
from smc_mujoco.common.frozen import frozen
from smc_mujoco.control import joint_law
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.law import Measurement

PARSING_LOCK = (
    threading.Lock()
)  # before Python 3.11.8 two threads must not parse at once (gh-106905)
# Kinds of numbers from narrow to wide. `single` is numpy.float32 in Python; `real` is smc_real in
# the file.
WIDTHS = ("bool", "int", "single", "real")
WHOLE = ("bool", "int")
TYPES = {"bool": "int32_t", "int": "int32_t", "single": "float", "real": "smc_real"}
TYPES |= {"memory": "smc_real", "gains": "smc_real", "y": "smc_measurement"}
CHANNEL_FIELDS = {"estimator": Reading._fields}  # of y, where they differ from a measurement's
JOINTS = "SMC_JOINTS"
SLOTS = "SMC_LAW_MEMORY"  # numbers of memory of a joint: known when all of a law is translated
# What the caller of a law of many joints provides: its name, and its rows if it is a matrix.
REQUESTS = {joint_law.coriolis: ("coriolis", ()), joint_law.jacobian: ("jacobian", (3,))}
ROW, COLUMN = "\x00", "\x01"  # stand for the indices in the text of an array's element
INDICES = (*"ijklmn", "row", "column", "element_1", "element_2")  # of loops over arrays

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
MATH_NAMES = """sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp expm1 log
log1p log10 log2 sqrt hypot fabs copysign fmod"""
SAME_IN_C = {getattr(math, name) for name in MATH_NAMES.split()}
ROUNDING = {math.floor: "floor", math.ceil: "ceil", math.trunc: "trunc"}  # to integers in Python
MATH = {"pow", *ROUNDING.values(), *MATH_NAMES.split()}
CASTS = {float: "real", np.float64: "real", np.float32: "single", int: "int"}
# Functions of numpy, element by element -> the same in C, or a helper.
NUMPY_NAMES = """sqrt exp expm1 log log1p sin cos tan sinh cosh tanh fabs hypot arctan arctan2
arcsin arccos"""
ELEMENTWISE = {getattr(np, name): name.replace("arc", "a") for name in NUMPY_NAMES.split()}
ELEMENTWISE |= {np.abs: "fabs", abs: "fabs"}
ELEMENTWISE |= {np.minimum: "lesser", np.maximum: "greater", np.sign: "sign"}
FILLED = {np.zeros: 0.0, np.empty: 0.0, np.ones: 1.0}

# Python's min, max, abs, % and indices of integers, numpy's functions as numba compiles them, where
# NaN stays NaN, and powers: functions that the file defines if it uses them.
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
    2: "a * a",
    3: f"a * {SQUARE}",
    4: FOURTH,
    5: f"a * {FOURTH}",
    6: f"{SQUARE} * {FOURTH}",
    7: f"a * {SQUARE} * {FOURTH}",
    8: f"({FOURTH} * {FOURTH})",
}

KEYWORDS = """auto break case char const continue default do double else enum extern float for goto
if inline int long register restrict return short signed sizeof static struct switch typedef union
unsigned void volatile while"""
# Other reserved names: functions and macros of C's headers, keywords of later standards and of
# compilers.
OTHER_RESERVED_NAMES = """_Bool _Complex _Imaginary alignas alignof asm bool constexpr false linux
nullptr static_assert thread_local true typeof unix main abort abs exit free index labs rindex NAN
INFINITY HUGE_VAL cbrt drem erf erfc exp2 exp10 fdim finite fma fmax fmin fpclassify frexp gamma
ilogb isfinite isgreater isgreaterequal isinf isless islessequal islessgreater isnan isnormal
isunordered j0 j1 jn ldexp lgamma llrint llround logb lrint lround modf nan nearbyint nextafter
nexttoward pow10 remainder remquo rint round scalb scalbln scalbn signbit signgam significand tgamma
y0 y1 yn"""
RESERVED = {*KEYWORDS.split(), *OTHER_RESERVED_NAMES.split(), *MATH, "out"}


class Untranslatable(ScenarioError):
    """A piece of Python has no translation into C."""


class Kind(NamedTuple):
    """What a value is: a number, an array, a tuple, or y or gains of a component."""

    of: str  # y, gains, memory, or one of WIDTHS
    shape: tuple[int, ...] = ()  # of an array or a tuple
    fields: Names | None = None  # of a tuple: their names, if it has some
    stride: str = "1"  # of a vector: from one number to the next

    @property
    def number(self) -> "Kind":
        """The kind of its numbers."""
        return REAL if self.of == "memory" else Kind(self.of)


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
        if kind.of == "memory":
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


def translate(
    component: Component,
    single: bool = False,
    joints: int = 0,
    others: Mapping[str, tuple[Any, Sequence[Kind]]] = frozen({}),
) -> tuple[int, str]:
    """Return the number of memory slots of a component, and the C of its function and of all
    functions it calls.

    The function's name is smc_law, smc_surface or smc_estimator. If `single`, smc_real is float.
    `joints` is 0 for a component of one channel. `others`: name in C -> another function for the
    file, and the kinds of its arguments.
    """
    program = Program(component, single, joints)
    program.used_names |= others.keys()
    slots = [joints, component.memory] if joints else [component.memory]
    kinds = Kind("y"), Kind("gains"), Kind("memory", tuple(slots))
    texts = [Function(program, component.function, kinds, entry=True).text(program.symbol)]
    for name, (function, kinds) in others.items():
        texts.append(Function(program, function, kinds).text(name).removeprefix("static "))
    for name, text in reversed(program.texts.items()):
        if re.search(rf"\b{name}\b", "".join(texts)):  # earlier, narrower drafts are called no more
            texts.insert(0, text)
    return program.slots, "\n\n".join(texts)


class Program:
    """The C file of a component: constant arrays, functions, and the names they use."""

    def __init__(self, component: Component, single: bool, joints: int):
        self.component = component
        self.single = single
        self.joints = joints
        self.vector = (joints,) if joints else ()  # the shape of u
        self.symbol = f"smc_{component.kind}"
        self.texts: dict[str, str] = {}  # name of a function or a constant array -> text
        self.constants: dict[str, str] = {}  # content of a constant array -> name
        # what is translated -> the name in C, and the function; None while it is in progress
        self.known: dict[tuple, tuple[str, Function] | None] = {}
        self.used_names = {self.symbol, *RESERVED}
        self.slots = 0  # of memory

    def unique_name(self, name: str) -> str:
        """Reserve and return a name that is not used yet: `name`, or `name` with a number."""
        unique = plain(name)
        counts = itertools.count(2)
        while unique in self.used_names:
            unique = f"{plain(name)}_{next(counts)}"
        self.used_names.add(unique)
        return unique

    def claim(self, node: ast.AST, slots: int) -> None:
        """Note that some slots of the memory are used. Refuse more than the component has."""
        size = self.component.memory
        if slots > size:
            code = shown(ast.unparse(node))[1:-1]
            raise Untranslatable(
                f"it uses {code}, and its memory has {size} numbers: give memory={slots}"
            )
        self.slots = max(self.slots, slots)

    def helper(self, name: str, of: str, body: str = "") -> str:
        """Return the C name of a helper or a power such as power_3, for numbers of a kind."""
        function = f"{name}_{of}"
        body = body or HELPERS[name]
        number = TYPES[of]
        arguments = f"{number} a"
        if "b" in body:
            arguments += f", {number} b"
        self.used_names.add(function)
        self.texts[function] = (
            f"static {number} {function}({arguments})\n{{\n    return {body};\n}}"
        )
        return function

    def array(self, name: str, values: Any) -> Value:
        """Return a constant array of numbers, or a tuple of them."""
        data = np.asarray(values)
        if data.ndim != 1 or data.dtype.kind not in "if":
            raise refuse(
                None,
                f"the constant {plain(name)}, which is not a one-dimensional array of numbers,",
            )
        of = {"i": "int", "f": "real"}[data.dtype.kind]
        items = [
            literal(number, self.single, ast.Constant(number)).text for number in data.tolist()
        ]
        content = f"[{len(items)}] = {{\n{rows(items)}\n}};"
        if content not in self.constants:
            self.constants[content] = self.unique_name(name)
        name = self.constants[content]
        self.texts[name] = f"static const {TYPES[of]} {name}{content}"
        fields = () if isinstance(values, tuple) else None
        return array_at(name, Kind(of, data.shape, fields))

    def function(
        self, function: Any, values: Sequence[Value], literals: Sequence[float | None]
    ) -> tuple[str, "Function"]:
        """Return the name in C of a function for arguments of the kinds of some values, and it.

        A literal exponent is not an argument in C: each exponent gives its own function.
        """
        written, tree = parsed(function)
        exponents = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
                exponents.add(getattr(node.right, "id", ""))
        constants = {}
        for argument, number in zip(tree.args.args, literals, strict=False):
            if argument.arg in exponents and number is not None:
                constants[argument.arg] = number
        kinds = tuple(value.kind for value in values)
        key = written, kinds, tuple(constants.items())
        if key not in self.known:
            self.known[key] = None
            made = Function(self, function, kinds, constants)
            same = (name for name, text in self.texts.items() if made.text(name) == text)
            name = next(same, "") or self.unique_name(tree.name)
            self.texts[name] = made.text(name)
            self.known[key] = name, made
        if (known := self.known[key]) is None:
            raise refuse(None, f"{tree.name}, which calls itself,")
        return known


class Function:
    """One function in C.

    A component's own function, the `entry`, writes its results to out[]. Another one returns a
    number, or writes its results to pointers. `constants`: arguments replaced by literal numbers.
    """

    def __init__(
        self,
        program: Program,
        function: Any,
        kinds: Sequence[Kind],
        constants: Mapping[str, float] = frozen({}),
        entry: bool = False,
    ):
        self.program = program
        self.constants = constants
        self.entry = entry
        written, self.tree = parsed(function)
        self.globals = around(written) | dict(constants)
        arguments = [argument.arg for argument in self.tree.args.args]
        nodes = inside(self.tree.body)
        gives = entry or any(isinstance(node, ast.Return) for node in nodes)
        if len(arguments) != len(kinds):
            raise refuse(None, f"{self.tree.name} with its arguments")
        if gives and not returns(self.tree.body):
            raise refuse(None, f"{self.tree.name}, which does not end in a return,")
        self.position = {argument: i for i, argument in enumerate(arguments)}
        self.parameters = dict(zip(arguments, kinds, strict=True))
        for name in constants:
            del self.parameters[name]
        self.taken = {node.id for node in nodes if isinstance(node, ast.Name)} | {*arguments}
        self.indices = [name for name in INDICES if name not in self.taken]
        self.assignments: dict[str, list[ast.AST]] = collections.defaultdict(list)
        for node in nodes:
            for name in assigned(node):
                self.assignments[name].append(node)
        self.read = set[str]()  # names that it reads: others need no variable
        for node in nodes:
            if isinstance(node, ast.AugAssign):
                self.read |= assigned(node)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                self.read.add(node.id)
        loops = [node for node in nodes if isinstance(node, ast.For | ast.While)]
        self.in_loops = {*inside(loops)}
        self.kinds = dict(self.parameters)
        self.views = set[str]()  # names that are pointers to arrays or parts of them
        self.names = dict[str, Value]()
        for name in self.parameters:
            self.names[name] = self.named(name)
        self.results = list[Kind]()
        before: Any = None
        while before != (self.kinds, self.results):  # until no variable's kind widens
            before = dict(self.kinds), list(self.results)
            self.translate()
        for sources, node in self.copies:
            if sources & self.changed:
                what = "an array, which shares its numbers with another name: write .copy()"
                raise refuse(node, f"{what} behind it,")

    def translate(self) -> None:
        """Write the lines, with the kinds as far as they are known."""
        self.lines = list[str]()
        self.temporaries = dict[str, Kind]()
        self.counts = itertools.count(1)
        self.counters = set[str]()  # variables of the present loops that are never negative
        self.changed = set[str]()  # names of arrays whose elements it changes
        if self.entry:
            self.changed |= {name for name, kind in self.parameters.items() if kind.of == "memory"}
        self.copies = list[tuple[frozenset[str], ast.AST]]()  # which must not change
        self.returned = set[int]()  # positions of arguments whose numbers a result may have
        self.block(self.tree.body)

    def text(self, name: str) -> str:
        """Return the whole function under a name. Variables are declared at its top."""
        declared = {self.c_name(parameter): "" for parameter in self.parameters}
        for variable, kind in self.kinds.items():
            in_c = self.c_name(variable)
            if variable in self.views:
                declared[in_c] = f"{self.pointer_to(variable)}{in_c} = 0;"
            elif variable not in self.parameters:
                declared[in_c] = declaration(in_c, kind)
        for variable, kind in self.temporaries.items():
            declared[variable] = declaration(variable, kind)
        read = words(" ".join(line.partition(" = ")[2] or line for line in self.lines))
        top = [line for line in declared.values() if line]
        top += [f"(void){variable};" for variable in declared if variable not in read]
        lines = [*wrapped("", self.head(name)), "{"]
        depth = 1
        for line in [*top, *self.lines]:
            depth -= line.startswith("}")
            lines += wrapped("    " * depth, line)
            depth += line.endswith("{")
        return "\n".join([*lines, "}"])

    def head(self, name: str) -> str:
        """Return the declaration without a semicolon. Arrays are pointers."""
        arguments = [f"{self.pointer_to(n)}{self.c_name(n)}" for n in self.parameters]
        if self.entry:
            return f"int {name}({', '.join(arguments)}, smc_real *out)"
        if self.gives_number():
            return f"static {TYPES[self.results[0].of]} {name}({', '.join(arguments) or 'void'})"
        for i, kind in enumerate(self.results):
            arguments.append(f"{TYPES[kind.of]} *out_{i}")
        return f"static void {name}({', '.join(arguments)})"

    def pointer_to(self, name: str) -> str:
        """Return the type of an argument or of a pointer to an array."""
        kind = self.kinds[name]
        if not kind.shape and kind.of in WIDTHS:
            return f"{TYPES[kind.of]} "
        of = TYPES[kind.of]
        if kind.of == "y" and self.program.component.kind == "estimator":
            of = "smc_reading"
        if self.names[name].sources <= self.parameters.keys() - self.changed:
            of = f"const {of}"
        return f"{of} *"

    def gives_number(self) -> bool:
        """Return whether it returns one number."""
        return len(self.results) == 1 and not self.results[0].shape

    def named(self, name: str) -> Value:
        """Return the value of a variable that has a kind."""
        kind = self.kinds[name]
        if kind.shape:
            return array_at(self.c_name(name), kind, sources=[name])
        value = Value(self.c_name(name), kind)
        if kind.of in WIDTHS:
            return value
        return value._replace(sources=frozenset([name]))  # y and gains

    def c_name(self, name: str) -> str:
        """Return a variable's name in C."""
        if name in RESERVED:
            return f"{name}_"
        return plain(name)

    def origins(self, text: str) -> set[str]:
        """Return the names of the variables that some C mentions, and of the arrays they are."""
        found = set[str]()
        mentioned = words(re.sub(r"->\w+", "", text))
        for name, value in self.names.items():
            if self.c_name(name) in mentioned:
                found |= {name, *value.sources}
        return found

    # lines

    def temporary(self, kind: Kind) -> Value:
        """Return a new variable."""
        name = f"new_{next(self.counts)}"
        while name in self.taken:
            name = f"new_{next(self.counts)}"
        self.temporaries[name] = kind = kind._replace(stride="1")
        if kind.shape:
            return array_at(name, kind)
        return Value(name, kind)

    def kept(self, value: Value) -> Value:
        """Return a value after a line that stores it in a new variable."""
        place = self.temporary(value.kind)
        self.fill(place, value)
        return place._replace(sources=value.sources)

    def fill(self, place: Value, value: Value) -> None:
        """Write the loops that copy an array, or one number, to a place."""
        if value.items:
            for target, item in zip(place.elements(), value.items, strict=True):
                self.lines.append(f"{target.text} = {item.text};")
            return
        line = f"{place.text} = {value.text};"
        loops = ""
        for token, i, size in zip((ROW, COLUMN), self.indices, place.kind.shape, strict=False):
            loops += f"for (int32_t {i} = 0; {i} < {size}; {i}++) "
            line = line.replace(token, i)
        self.lines.append(loops + line)

    def captured(self, translate: Callable[[Any], Any], node: Any) -> tuple[Any, list[str]]:
        """Return what a method makes of some code, and the lines that it writes."""
        lines, self.lines = self.lines, []
        made = translate(node)
        own, self.lines = self.lines, lines
        return made, own

    def alone(self, translate: Callable[[Any], Any], node: ast.expr) -> Any:
        """Return what a method makes of some code that must need no line before it."""
        made, lines = self.captured(translate, node)
        if lines:
            raise refuse(node, "an array that is computed within a condition")
        return made

    def block(self, body: Sequence[ast.stmt]) -> None:
        """Translate some statements."""
        for node in body:
            self.line = node
            self.statement(node)

    def statement(self, node: ast.stmt) -> None:
        """Translate a statement."""
        match node:
            case ast.Expr(value=ast.Constant(value=str())) | ast.Pass():
                pass
            case ast.Expr(value=ast.Call() as call):
                self.results_of(call)
            case (
                ast.Assign(targets=[target], value=value)
                | ast.AnnAssign(target=target, value=ast.expr() as value)
            ):
                self.assign(target, value)
            case ast.AugAssign(target=target):
                whole = self.value(ast.BinOp(target, node.op, node.value))
                if whole.kind.shape and isinstance(target, ast.Name):  # changes the array itself
                    target = ast.Subscript(target, ast.Slice())
                self.store(target, whole)
            case ast.If():
                self.branch(node)
            case ast.For(target=ast.Name(id=name), orelse=[]):
                self.loop(node, name)
            case ast.While(orelse=[]):
                self.lines.append(f"while ({self.alone(self.truth, node.test)}) {{")
                self.block(node.body)
                self.lines.append("}")
            case ast.Break() | ast.Continue():
                self.lines.append(f"{ast.unparse(node)};")
            case ast.Return(value=ast.expr() as value):
                self.give(value)
            case _:
                raise refuse(node, f"{type(node).__name__.lower()}")

    def branch(self, node: ast.If) -> None:
        """Translate if, elif and else."""
        self.lines.append(f"if ({self.truth(node.test)}) {{")
        self.block(node.body)
        if node.orelse:
            _, lines = self.captured(self.block, node.orelse)
            # an elif may need lines of its own before its condition
            (first, *more) = node.orelse
            if isinstance(first, ast.If) and not more and lines[0].startswith("if ("):
                self.lines += [f"}} else {lines[0]}", *lines[1:]]
                return
            self.lines += ["} else {", *lines]
        self.lines.append("}")

    def loop(self, node: ast.For, variable: str) -> None:
        """Translate for i in range(...)."""
        if {*inside(node.body)} & {*self.assignments[variable]}:
            raise refuse(node.iter, "a loop that changes its own variable")
        match node.iter:
            case ast.Call(func=ast.Name(id="range"), args=[*bounds]) if 1 <= len(bounds) <= 3:
                self.count(variable, bounds)
                self.block(node.body)
                self.counters.discard(variable)
                del self.names[variable]
            case _:
                raise refuse(node.iter, "a loop over anything but a range")
        self.lines.append("}")

    def count(self, variable: str, bounds: list[ast.expr]) -> None:
        """Begin a loop over a range."""
        step = self.whole(bounds[2]) if len(bounds) == 3 else 1
        if len(bounds) == 1:
            bounds = [ast.Constant(0), *bounds]
        first, last = map(self.number, bounds[:2])
        if (first.kind, last.kind) != (INT, INT) or not step:
            raise refuse(self.line, "a range of other than integers with a constant step")
        end = self.whole(bounds[1])
        if end is None:  # Python computes it once
            last = self.kept(last)
        natural = self.natural(bounds[0])
        sign = "<"
        if step < 0:
            natural = end is not None and end >= -1
            sign = ">"
        if natural:
            self.counters.add(variable)
        i = self.c_name(variable)
        change = {1: "++", -1: "--"}.get(step, f" += {step}")
        self.names[variable] = Value(i, INT)
        loop = f"int32_t {i} = {first.text}; {i} {sign} {last.text}; {i}{change}"
        self.lines.append(f"for ({loop}) {{")

    def give(self, node: ast.expr) -> None:
        """Translate return."""
        value = self.value(node)
        values = value.items or (value,)
        if not value.items and value.kind.fields is not None:
            values = value.elements()
        if self.entry and self.program.component.kind == "estimator" and len(values) == 1:
            values = (*values, Value("NAN", REAL, UNARY))
        self.results = self.results or [item.kind._replace(stride="1") for item in values]
        if len(values) != len(self.results):
            raise refuse(node, "another number of results")
        places = self.results_at()
        for i, item in enumerate(values):
            self.results[i] = wider(self.results[i], item.kind)
            for source in item.sources:
                name = source.partition(".")[0]
                if name in self.parameters:
                    self.returned.add(self.position[name])
            if places:
                self.fill(places[i], item)
        shape = self.program.vector
        if self.entry and [kind.shape for kind in self.results] != [shape] * 2:
            raise refuse(node, "a result other than u and s, a number or one of each joint,")
        if places:
            self.lines.append("return 0;" if self.entry else "return;")
        else:
            self.lines.append(f"return {values[0].text};")

    def results_at(self) -> list[Value]:
        """Return the places of the results; none for a number."""
        if not self.entry and self.gives_number():
            return []
        places = []
        for i, kind in enumerate(self.results):
            if not self.entry and kind.shape:
                places.append(array_at(f"out_{i}", kind))
            elif not self.entry:
                places.append(Value(f"*out_{i}", kind))
            elif kind.shape:
                places.append(array_at("out", kind, ("", JOINTS)[i]))
            else:
                places.append(Value(f"out[{i}]", kind))
        return places

    # assignments

    def assign(self, target: ast.expr, node: ast.expr) -> None:
        """Assign a value to one target, or to a tuple of them."""
        if not isinstance(target, ast.Tuple | ast.List):
            self.store(target, self.number(node))
            return
        targets = target.elts
        value = self.value(node)
        values = value.elements()
        if value.kind.of == "memory":
            self.program.claim(node, len(targets))
            values = values[: len(targets)]
        if len(values) != len(targets):
            raise refuse(node, f"{len(targets)} names for {len(values)} numbers")
        held = []  # Python computes all values before the first assignment
        written = set[str]()
        for part, value in zip(targets, values, strict=True):
            if self.origins(value.text) & written:
                value = self.kept(value)  # noqa: PLW2901
            held.append(value)
            if isinstance(part, ast.Name):
                written.add(part.id)
            else:
                written |= self.origins(self.changeable(part).text)
        for part, value in zip(targets, held, strict=True):
            self.store(part, value)

    def store(self, target: ast.expr, value: Value) -> None:
        """Assign a value to a name, an element, or a part of an array."""
        if value.items and any(item.kind.shape for item in value.items):
            raise refuse(target, "a tuple of arrays under one name")
        if isinstance(target, ast.Name) and target.id not in self.read:
            return
        if isinstance(target, ast.Name):
            place = self.destination(target, value)
        else:
            place = self.changeable(target)
            if wider(Kind(place.kind.of), Kind(value.kind.of)).of != place.kind.of:
                raise refuse(target, "real numbers for elements of an array of whole numbers")
            if value.kind.shape not in ((), place.kind.shape):
                raise refuse(target, f"an array of shape {value.kind.shape} for one of another")
        if place is None or place.text == value.text:
            return
        if place.kind.shape:  # elements that it reads must not be those that the loop has changed
            others = joined(value.items or (value,))
            if self.origins(others.replace(place.text, "")) & self.origins(place.text):
                value = self.kept(value)
        self.fill(place, value)

    def destination(self, target: ast.Name, value: Value) -> Value | None:
        """Return the place of a name to which a value is assigned; None if it becomes a pointer."""
        name = target.id
        kind = value.kind._replace(stride="1")
        before = self.kinds.get(name)
        if name in self.constants or (before or kind).of not in WIDTHS or kind.of not in WIDTHS:
            raise refuse(target, "an assignment to this")
        if name in self.parameters and before and (before.shape or kind.shape):
            raise refuse(target, "an assignment to an argument that is an array")
        if self.is_view(name, value):
            self.views.add(name)
            self.kinds[name] = value.kind
            self.names[name] = array_at(self.c_name(name), value.kind, sources=value.sources)
            self.lines.append(f"{self.c_name(name)} = {value.pointer};")
            return None
        self.kinds[name] = wider(before or kind, kind)
        self.names[name] = self.named(name)
        if value.sources and kind.shape and kind.fields is None:
            self.copies.append((value.sources | {name}, target))
            self.names[name] = self.names[name]._replace(sources=value.sources | {name})
        return self.names[name]

    def is_view(self, name: str, value: Value) -> bool:
        """Return whether a name is always the same array, or part of one: then it is a pointer."""
        if not value.pointer or value.kind.fields is not None or len(value.sources) != 1:
            return False
        (array,) = value.sources
        first = re.findall(r"\w+", value.pointer)[0]
        same = [n for n, known in self.names.items() if known.sources == value.sources]
        if first not in map(self.c_name, same):
            return False
        given = self.assignments[array]
        lasts = array in self.parameters or (len(given) == 1 and given[0] not in self.in_loops)
        return lasts and len(self.assignments[name]) == 1 and name not in self.parameters

    def changeable(self, target: ast.expr) -> Value:
        """Return elements that the function changes: of its own arrays, or of an argument."""
        array = self.names.get(root(target))
        if array is None or not array.kind.shape or array.kind.fields is not None:
            raise refuse(target, "an assignment to this, which is no array of the function's own,")
        self.changed |= array.sources
        return self.value(target)

    # calls of Python functions

    def results_of(self, call: ast.Call) -> Value:
        """Call a function of Python. Return its result, or a tuple of them."""
        function = self.callee(call)
        values = [*map(self.argument, call.args)]
        literals = [*map(self.constant, call.args)]
        name, made = self.program.function(function, values, literals)
        self.check_changes(call, values, made)
        arguments = []
        for parameter in made.parameters:
            value = values[made.position[parameter]]
            arguments.append(value.pointer or value.text)
        if made.gives_number():
            value = Value(f"{name}({', '.join(arguments)})", made.results[0])
            if made.changed & made.parameters.keys():
                return self.kept(value)
            return value
        sources = frozenset[str]().union(*(values[i].sources for i in made.returned))
        kinds = made.results
        alike = len(kinds) > 1 and {*kinds} == {Kind(kinds[0].of)}
        if alike:  # in one array
            kinds = [Kind(kinds[0].of, (len(kinds),), ())]
        items = []
        for kind in kinds:
            place = self.temporary(kind)
            arguments.append(place.pointer or f"&{place.text}")
            if kind.shape:
                place = place._replace(sources=sources)
            items.append(place)
        if alike:
            arguments += [f"{items[0].pointer} + {i}" for i in range(1, items[0].kind.shape[0])]
        self.lines.append(f"{name}({', '.join(arguments)});")
        return items[0] if len(items) == 1 else gathered(items)

    def check_changes(self, call: ast.Call, values: list[Value], made: "Function") -> None:
        """Refuse a call that changes an array in a way that C would not."""
        for name in made.changed & made.parameters.keys():
            i = made.position[name]
            node = call.args[i]
            if isinstance(node, ast.Name | ast.Subscript | ast.Attribute):
                given = self.changeable(node)
                if not given.pointer:
                    raise refuse(node, "a part of a matrix, which a function changes,")
            elif values[i].sources:
                raise refuse(node, "a result that shares its numbers, which a function changes,")
            others = values[:i] + values[i + 1 :]
            if any(values[i].sources & other.sources for other in others):
                raise refuse(call, "a call that gets an array twice and changes it")
            within = set(ast.walk(call))
            targets = getattr(self.line, "targets", [])
            for part in ast.iter_child_nodes(self.line):
                if isinstance(part, ast.stmt) or part in targets:
                    continue
                for read in ast.walk(part):  # C does not say which comes first
                    array = self.names.get(getattr(read, "id", ""))
                    if array and read not in within and array.sources & values[i].sources:
                        what = "a call that changes an array which the rest of the line reads"
                        raise refuse(call, what)

    def argument(self, node: ast.expr) -> Value:
        """Translate an argument of a function: a number, an array as a pointer, or y or gains."""
        value = self.value(node)
        if value.kind.shape and not value.pointer:  # its numbers are not stored
            value = self.kept(value)
        return value

    # expressions

    def value(self, node: ast.expr) -> Value:
        """Translate an expression: a number, an array, a tuple, or one of the law's arguments."""
        method: Callable[[Any], Value] | None = getattr(
            self, f"_{type(node).__name__.lower()}", None
        )
        if method is None:
            raise refuse(node, f"{type(node).__name__}")
        return method(node)

    def number(self, node: ast.expr) -> Value:
        """Translate an expression that is a number, an array, or a tuple of these."""
        value = self.value(node)
        if value.kind.of not in WIDTHS and not value.kind.shape:
            raise refuse(node, f"{value.text or 'nothing'} as a number")
        return value

    def matched(self, node: ast.expr, parts: Sequence[ast.expr]) -> tuple[list[Value], Any]:
        """Translate the operands of an expression by elements. Return them, and their shape.

        Calls with numbers are done once, before the loop over the elements.
        """
        values = [*map(self.number, parts)]
        shapes = {value.kind.shape for value in values} - {()}
        if any(value.kind.fields is not None for value in values):
            raise refuse(node, "a tuple as a number")
        if len(shapes) > 1:
            raise refuse(node, "arrays of different shapes in one expression")
        if not shapes:
            return values, ()
        for i, value in enumerate(values):
            if value.kind.of == "memory":
                self.program.claim(node, self.program.component.memory)
                values[i] = value._replace(kind=value.kind._replace(of="real"))
            elif not value.kind.shape and "(" in value.text:
                values[i] = self.kept(value)
        return values, shapes.pop()

    def truth(self, node: ast.expr) -> str:
        """Translate an expression as a condition."""
        value = self.number(node)
        if value.kind.shape:
            raise refuse(node, "an array as a condition")
        if value.kind.of in WHOLE:
            return value.text
        return f"{value.within(UNARY)} != 0"

    def constant(self, node: ast.expr | None) -> Any:
        """Return the literal number that an expression is, or None."""
        match node:
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                if (value := self.constant(operand)) is not None:
                    return -value
            case ast.Constant(value=int() | float()):
                return node.value
            case ast.Name(id=name):
                return self.constants.get(name)
        return None

    def whole(self, node: ast.expr | None) -> int | None:
        """Return the integer that an expression is before the law runs, or None."""
        match node:
            case ast.Call(func=ast.Name(id="len"), args=[array]):
                return self.value(array).kind.shape[0]
            case ast.Name(id=name) if given := self.assignments.get(name):
                match given:
                    case [ast.Assign(targets=[ast.Name()], value=value)]:
                        return self.whole(value)
                return None
            case ast.Name() if isinstance(number := self.resolve(node), int):
                return number
        constant = self.constant(node)
        if isinstance(constant, int):
            return constant
        return None

    def natural(self, node: ast.expr) -> bool:
        """Return whether an index is certainly not negative."""
        match node:
            case ast.Name(id=name) if name in self.counters:
                return True
            case ast.BinOp(left=left, op=ast.Add() | ast.Mult() | ast.Mod(), right=right):
                return self.natural(left) and self.natural(right)
        return (number := self.whole(node)) is not None and number >= 0

    def resolve(self, node: ast.expr) -> Any:
        """Return the value of a global name, dotted or not; None for a variable."""
        if isinstance(node, ast.Name) and node.id not in self.names:
            return self.globals.get(node.id, getattr(builtins, node.id, None))
        if isinstance(node, ast.Attribute):
            module = self.resolve(node.value)
            if isinstance(module, ModuleType):
                return getattr(module, node.attr, None)
        return None

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
        name = node.attr
        component = self.program.component
        joints = self.program.joints
        sources = [f"{source}.{name}" for source in owner.sources]
        if owner.kind.of == "y":
            fields = CHANNEL_FIELDS.get(component.kind, Measurement._fields)
            if joints:
                fields = ("t", "dt", "model", *joint_law.ARRAYS)
            check("measurement", name, fields)
            place = f"{owner.text}->{name}"
            shape = self.program.vector
            if name == "M":
                shape *= 2
            if joints and name in joint_law.ARRAYS:
                return array_at(place, Kind("real", shape), sources=sources)
        elif owner.kind.of == "gains":
            check("gain", name, component.gains)
            offset = f"GAIN_{plain(name)}"
            if joints:
                offset += f" * {JOINTS}"
            place = f"{owner.text}[{offset}]"
            if joints and name not in component.shared:
                kind = Kind("real", self.program.vector)
                return array_at(owner.text, kind, offset, sources)
        elif owner.kind.fields:
            check("field", name, owner.kind.fields)
            return owner.elements()[owner.kind.fields.index(name)]
        else:
            raise refuse(node, "an attribute")
        return Value(place, REAL)

    def _subscript(self, node: ast.Subscript) -> Value:
        owner = self.value(node.value)
        shape = owner.kind.shape
        places = [node.slice]
        if isinstance(node.slice, ast.Tuple):
            places = list(node.slice.elts)
        if not shape or len(places) > len(shape):
            raise refuse(node, "an element")
        places += [ast.Slice()] * (len(shape) - len(places))
        if owner.items:
            return owner.items[int(self.index(node, places[0], len(owner.items), False).text)]
        memory = owner.kind.of == "memory"
        strides = [owner.kind.stride]
        if len(shape) == 2:
            strides = [str(shape[1]), "1"]
            if memory:
                strides[0] = SLOTS
        tokens = (ROW, COLUMN)[: len(shape)]
        made = owner
        left = list[int]()
        stride = "1"
        for token, place, size, step in zip(tokens, places, shape, strides, strict=True):
            slots = memory and token == tokens[-1]
            if isinstance(place, ast.Slice):
                part = self.part(node, place, size, slots)
                kept = Value(tokens[len(left)], INT)
                if part.start:
                    kept = Value(f"{kept.text} + {part.start}", INT, SUM)
                made = indexed(made, token, kept, Value(str(part.start), INT), step)
                left.append(len(part))
                stride = step
            else:
                index = self.index(node, place, size, slots)
                made = indexed(made, token, index, index, step)
        if not left:
            return Value(made.text, owner.kind.number, owner.level)
        if not owner.pointer or (len(left) == 2 and (memory or left[1] != shape[1])):
            made = made._replace(pointer="")  # its numbers do not lie in a row
            stride = "1"
        kind = Kind(owner.kind.number.of, tuple(left), owner.kind.fields and (), stride)
        return made._replace(kind=kind)

    def part(self, node: ast.Subscript, place: ast.Slice, size: int, slots: bool) -> range:
        """Return the indices of a slice of a dimension. `slots`: whether it is the memory's."""
        bounds = []
        for bound in (place.lower, place.upper):
            bounds.append(self.whole(bound))
            if bound is not None and bounds[-1] is None:
                raise refuse(node, "a length that is not known before the law runs")
        found = range(size)[slice(*bounds)]
        if place.step or not found:
            raise refuse(node, "a part of an array that is empty or has a step")
        if slots:
            self.program.claim(node, found.stop)
        return found

    def index(self, node: ast.Subscript, place: ast.expr, size: int, slots: bool) -> Value:
        """Return the index of an element. Python counts a negative one from the end."""
        constant = self.constant(place)
        if isinstance(constant, int):
            if slots:
                self.program.claim(node, max(constant, constant % size) + 1)
            if not -size <= constant < size:
                raise refuse(node, f"an index outside {-size} to {size - 1}")
            return Value(str(constant % size), INT)
        if slots:
            self.program.claim(node, size)
        value = self.number(place)
        if value.kind != INT:
            raise refuse(node, "an index that is not an integer")
        if slots or self.natural(place):
            return value
        return Value(f"{self.program.helper('wrapped', 'int')}({value.text}, {size})", INT)

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(f"!({self.truth(node.operand)})", BOOL, UNARY)
        (value,), _ = self.matched(node, [node.operand])
        if not isinstance(node.op, ast.USub):
            raise refuse(node, "the operator")
        kind = value.kind._replace(of=value.kind.of.replace("bool", "int"))
        return Value(f"-{value.within(ATOM)}", kind, UNARY)

    def _binop(self, node: ast.BinOp) -> Value:
        sort = type(node.op)
        if sort is ast.Pow:
            return self.power(node)
        if sort is ast.MatMult:
            raise refuse(node, "the operator @")
        (left, right), shape = self.matched(node, [node.left, node.right])
        whole = left.kind.of in WHOLE and right.kind.of in WHOLE
        if sort in BIT_OPERATORS and whole:
            text = f"{left.within(ATOM)} {BIT_OPERATORS[sort]} {right.within(ATOM)}"
            return Value(text, Kind("int", shape), LOOSE)
        if sort is ast.Mod and whole:
            text = f"{self.program.helper('modulo', 'int')}({left.text}, {right.text})"
            return Value(text, Kind("int", shape))
        if sort not in OPERATORS:
            raise refuse(node, f"the operator {sort.__name__}")
        sign, level = OPERATORS[sort]
        first = left.within(level)
        of = widest(left.kind.of, right.kind.of)
        if whole:
            of = "int"
        if whole and sign == "/":
            of = "real"
            first = f"(smc_real){left.within(UNARY)}"
        return Value(f"{first} {sign} {right.within(level + 1)}", Kind(of, shape), level)

    def power(self, node: ast.BinOp) -> Value:
        """Translate a power, as numba compiles it."""
        exponent = self.constant(node.right)
        (base, by), shape = self.matched(node, [node.left, node.right])
        if base.kind.of in WHOLE:
            raise refuse(node, "a power of a whole number")
        if exponent == 1:
            return base
        if exponent == 0.5:
            return self.math("sqrt", [base], shape)
        if exponent == 2 or (isinstance(exponent, int) and exponent in POWERS):
            helper = self.program.helper(
                f"power_{int(exponent)}", base.kind.of, POWERS[int(exponent)]
            )
            return Value(f"{helper}({base.text})", Kind(base.kind.of, shape))
        if by.kind.of in WHOLE:
            raise refuse(node, "a power with such an exponent")
        return self.math("pow", [base, by], shape)

    def _compare(self, node: ast.Compare) -> Value:
        if any(type(sign) not in COMPARISONS for sign in node.ops):
            raise refuse(node, "the comparison")
        values, shape = self.matched(node, [node.left, *node.comparators])
        parts = []
        for (left, right), sign in zip(itertools.pairwise(values), node.ops, strict=True):
            parts.append(f"{left.within(SUM)} {COMPARISONS[type(sign)]} {right.within(SUM)}")
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
        items = [chosen(test, *pair) for pair in zip(yes.elements(), no.elements(), strict=True)]
        return gathered(items)

    def _tuple(self, node: ast.Tuple) -> Value:
        return gathered([*map(self.number, node.elts)])

    def _call(self, node: ast.Call) -> Value:
        if isinstance(node.func, ast.Attribute) and node.func.attr == "copy" and not node.args:
            return self.value(node.func.value)._replace(pointer="", sources=frozenset())
        function = self.callee(node)
        if function is len:
            made = Value(str(self.whole(node)), INT)
        elif function in FILLED:
            made = self.filled(function, node)
        elif function in REQUESTS:
            made = self.requested(function, node)
        elif hasattr(function, "_fields"):
            made = gathered([*map(self.number, node.args)], function._fields)
        elif function is np.array and isinstance(node.args[0], ast.List | ast.Tuple):
            made = gathered([*map(self.number, node.args[0].elts)])
            made = self.kept(made._replace(kind=made.kind._replace(fields=None)))
        elif self.calls_python(node):
            made = self.results_of(node)
        else:
            made = self.built_in(function, node)
        return made

    def filled(self, function: Any, node: ast.Call) -> Value:
        """Return an array that is filled with one number."""
        (size,) = node.args
        parts = getattr(size, "elts", [size])
        shape = tuple(self.whole(part) or 0 for part in parts)
        if 0 in shape:
            raise refuse(node, "a length that is not known before the law runs")
        value = literal(FILLED[function], self.program.single, node)
        return value._replace(kind=Kind("real", shape))

    def requested(self, function: Any, node: ast.Call) -> Value:
        """Translate coriolis and jacobian, which the caller of the law provides."""
        name, rows = REQUESTS[function]
        y, *rest = map(self.argument, node.args)
        array = self.temporary(Kind("real", (*rows, self.program.joints)))
        pointers = [value.pointer for value in (*rest, array)]
        self.lines.append(f"{y.text}->{name}({', '.join([f'{y.text}->plant', *pointers])});")
        return array

    def built_in(self, function: Any, node: ast.Call) -> Value:
        """Translate a call of a function of Python, math or numpy."""
        values, shape = self.matched(node, node.args)
        of_numpy = function in ELEMENTWISE or function is np.where
        if shape and not of_numpy:
            raise refuse(node, f"{getattr(function, '__name__', function)} of an array")
        name = getattr(function, "__name__", str(function))
        numbers = [value.kind.of for value in values]
        if function is np.where and len(values) == 3:
            made = chosen(values[0], values[1], values[2], shape)
        elif function in (min, max) and len(values) > 1:
            made = values[0]
            for value in values[1:]:
                of = widest(made.kind.of, value.kind.of)
                helper = self.program.helper(f"{name}imum", of)
                made = Value(f"{helper}({made.text}, {value.text})", Kind(of))
        elif function in CASTS and len(values) == 1:
            kind = Kind(CASTS[function])
            made = Value(f"({TYPES[kind.of]}){values[0].within(UNARY)}", kind, UNARY)
        elif function in ROUNDING:
            text = self.math(ROUNDING[function], values).text
            made = Value(f"(int32_t){text}", INT, UNARY)
        elif function in SAME_IN_C:
            made = self.math(name, values)
        elif not of_numpy:
            raise refuse(node, name)
        elif ELEMENTWISE[function] in HELPERS or (numbers[0] in WHOLE and "abs" in name):
            of = functools.reduce(widest, numbers)
            helper = self.program.helper(ELEMENTWISE[function].replace("fabs", "absolute"), of)
            made = Value(f"{helper}({joined(values)})", Kind(of, shape))
        else:
            made = self.math(ELEMENTWISE[function], values, shape)
        return made

    def math(self, name: str, values: Sequence[Value], shape: tuple[int, ...] = ()) -> Value:
        """Translate a call of a function of math.h, in the precision of its arguments."""
        single = {value.kind.of for value in values} == {"single"}
        if single or self.program.single:
            name += "f"
        kind = Kind("single" if single else "real", shape)
        return Value(f"{name}({joined(values)})", kind)


# reading Python


def parsed(function: Any) -> tuple[FunctionType, ast.FunctionDef]:
    """Return a Python function, compiled or not, and its syntax tree."""
    written = in_python(function)
    name = getattr(function, "__name__", function)
    if written is None:
        raise refuse(None, f"{name}, which is not a Python function,")
    try:
        with PARSING_LOCK:
            (tree,) = ast.parse(textwrap.dedent(inspect.getsource(written))).body
    except (OSError, SyntaxError, ValueError):
        raise refuse(None, f"{name}, whose source is not available,") from None
    if not isinstance(tree, ast.FunctionDef):
        raise refuse(tree, "a function without def")
    return written, tree


def around(written: FunctionType) -> Fields:
    """Return the names outside of a function that it can read, with their values."""
    cells = zip(written.__code__.co_freevars, written.__closure__ or (), strict=True)
    return written.__globals__ | {name: cell.cell_contents for name, cell in cells}


def in_python(function: Any) -> FunctionType | None:
    """Return the Python of a function, compiled or not; None for numpy's and for C's."""
    written = getattr(function, "py_func", function)
    if not isinstance(written, FunctionType) or str(written.__module__).startswith("numpy"):
        return None
    return written


def inside(nodes: Iterable[ast.AST]) -> list[ast.AST]:
    """Return some nodes with all that they contain."""
    return [*itertools.chain.from_iterable(map(ast.walk, nodes))]


def assigned(node: ast.AST) -> set[str]:
    """Return the names that an assignment or a loop binds; none of other code."""
    targets = getattr(node, "targets", None) or [getattr(node, "target", ast.Pass())]
    names = [part for part in inside(targets) if isinstance(part, ast.Name)]
    return {name.id for name in names if isinstance(name.ctx, ast.Store)}


def returns(body: Sequence[ast.stmt]) -> bool:
    """Return whether every path through some code ends in a return."""
    match body[-1]:
        case ast.If(body=yes, orelse=no):
            return bool(no) and returns(yes) and returns(no)
        case last:
            return isinstance(last, ast.Return)


def root(node: ast.AST) -> str:
    """Return the name of the array whose elements an expression names, or an empty text."""
    while isinstance(node, ast.Subscript):
        node = node.value
    return getattr(node, "id", "")


def check(what: str, name: str, names: Iterable[str]) -> None:
    """Refuse a name that a law cannot read."""
    if name not in names:
        raise Untranslatable(f"it reads an {unknown(what, name, names)}")


NEEDS_C = " has no translation into C: write it with arithmetic, if, for and math's functions"


def refuse(node: ast.AST | None, what: str) -> Untranslatable:
    """Return the error for a piece of Python without translation."""
    if node is not None:
        what += f" ({shown(ast.unparse(node))[1:-1]})"
    return Untranslatable(what + NEEDS_C)


# writing C


def gathered(items: Sequence[Value], fields: Names = ()) -> Value:
    """Return a tuple of values."""
    of = functools.reduce(widest, [item.kind.of for item in items], "bool")
    return Value("", Kind(of, (len(items),), fields), items=tuple(items))


def chosen(test: Value, yes: Value, no: Value, shape: tuple[int, ...] | None = None) -> Value:
    """Return one of two values, by a condition. `shape`: of the result, if they differ."""
    if shape is None:
        kind = wider(yes.kind, no.kind)
    else:
        kind = Kind(widest(yes.kind.of, no.kind.of), shape)
    text = f"{test.within(SUM)} ? {yes.within(SUM)} : {no.within(SUM)}"
    return Value(text, kind, LOOSE)


def widest(first: str, second: str) -> str:
    """Return the kind of number that an operation on two kinds gives, in C and in numba.

    An integer and a single give a real.
    """
    pair = [WIDTHS.index(Kind(of).number.of) for of in (first, second)]
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
    return Kind(widest(first.of, second.of), first.shape, fields)


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
    elif single or kind.of == "single":
        text += "f"
    return signed(text, kind)


def signed(text: str, kind: Kind) -> Value:
    """Return a number that may have a sign."""
    if text.startswith("-"):
        return Value(text, kind, UNARY)
    return Value(text, kind)


def indexed(array: Value, token: str, index: Value, start: Value, stride: str) -> Value:
    """Return an array with an index in place of a token, and the pointer to where it starts."""
    text, *after = re.split(rf"(\[{token}\]|{token})", array.text)
    for found, rest in zip(after[::2], after[1::2], strict=True):
        text += f"[{index.text}]" if found[0] == "[" else index.within(PRODUCT)
        text += rest
    offset = f" + {start.within(PRODUCT)} * {stride}"
    if stride == "1":
        offset = f" + {start.within(SUM)}"
    if start.text == "0":
        offset = ""
    return array._replace(text=text, pointer=array.pointer + offset)


def declaration(name: str, kind: Kind) -> str:
    """Return the line that declares a variable."""
    if kind.shape:
        return f"{TYPES[kind.of]} {name}[{math.prod(kind.shape)}];"
    return f"{TYPES[kind.of]} {name} = 0;"


def plain(name: str) -> str:
    """Return a name in ASCII letters, which every C99 compiler accepts."""
    return "".join(c if c.isascii() else f"u{ord(c):04x}" for c in name)


def joined(values: Iterable[Value]) -> str:
    """Return the texts of values, with commas."""
    return ", ".join(value.text for value in values)


def words(text: str) -> set[str]:
    """Return the names and numbers in some C."""
    return set(re.findall(r"\w+", text))


def rows(items: Sequence[str]) -> str:
    """Return items in lines of at most 100 characters."""
    text = ", ".join(items) + ","
    return textwrap.fill(text, 100, initial_indent="    ", subsequent_indent="    ")


def wrapped(indent: str, line: str) -> list[str]:
    """Return a line of code in lines of at most 110 characters."""
    further = f"{indent}        "
    wrap = textwrap.TextWrapper(110, indent, further, break_long_words=False)
    wrap.break_on_hyphens = False
    return wrap.wrap(line)
