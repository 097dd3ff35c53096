"""Print C: a file of functions and constant arrays, and one function from its lines."""

import ast
import itertools
import math
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from smc_mujoco.common.aliases import Names
from smc_mujoco.common.errors import shown
from smc_mujoco.control.component import Component
from smc_mujoco.exchange.c.translation.python_source import PythonSource, Untranslatable, refuse
from smc_mujoco.exchange.c.translation.values import TYPES, WIDTHS, Kind, Value, array_at, literal

INDICES = (*"ijklmn", "row", "column", "element_1", "element_2")  # of loops over arrays

# Functions of Python's math module that have the same name in C.
MATH_NAMES = """sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp expm1 log
log1p log10 log2 sqrt hypot fabs copysign fmod"""

SAME_IN_C = {getattr(math, name) for name in MATH_NAMES.split()}

ROUNDING = {math.floor: "floor", math.ceil: "ceil", math.trunc: "trunc"}  # to integers in Python

MATH = {"pow", *ROUNDING.values(), *MATH_NAMES.split()}

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
    "unknown": "a != a",  # NaN
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
        self.functions: dict[tuple, tuple[str, Any] | None] = {}
        self.used_names = {self.symbol, *RESERVED}
        self.slots = 0  # of memory

    def unique_name(self, name: str) -> str:
        """Reserve and return a name that is not used yet: `name`, or `name` with a number."""
        unique = c_name(name)
        counts = itertools.count(2)
        while unique in self.used_names:
            unique = f"{c_name(name)}_{next(counts)}"
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

    def name_of(self, name: str, made: "Lines") -> str:
        """Return the name of a function: that of one which is the same, or a new one."""
        for same, text in self.texts.items():
            if made.text(same) == text:
                return same
        unique = self.unique_name(name)
        self.texts[unique] = made.text(unique)
        return unique

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
                f"the constant {c_name(name)}, which is not a one-dimensional array of numbers,",
            )
        sort = {"i": "int", "f": "real"}[data.dtype.kind]
        items = []
        for number in data.tolist():
            item = literal(number, self.single, ast.Constant(number))
            items.append(item.text)
        content = f"[{len(items)}] = {{\n{wrapped_lines(items)}\n}};"
        if content not in self.constants:
            self.constants[content] = self.unique_name(name)
        name = self.constants[content]
        self.texts[name] = f"static const {TYPES[sort]} {name}{content}"
        fields = getattr(values, "_fields", ()) if isinstance(values, tuple) else None
        return array_at(name, Kind(sort, data.shape, fields))


class Lines:
    """The lines of one function in C, and its variables.

    A component's own function, the `entry`, writes its results to out[]. Another one returns a
    number, or writes its results to pointers. `constants`: arguments replaced by literal numbers.
    """

    def __init__(
        self,
        program: Program,
        source: PythonSource,
        kinds: Sequence[Kind],
        constants: Mapping[str, float],
        entry: bool,
    ):
        self.program = program
        self.source = source
        self.constants = constants
        self.entry = entry
        self.globals = source.globals | dict(constants)
        self.parameters = dict(zip(source.arguments, kinds, strict=True))
        for name in constants:
            del self.parameters[name]
        self.indices = [name for name in INDICES if name not in source.names]
        self.kinds = dict(self.parameters)
        self.views = set[str]()  # names that are pointers to arrays or parts of them
        self.names = dict[str, Value]()
        for name in self.parameters:
            self.names[name] = self.variable(name)
        self.results = list[Kind]()
        self.fields: Names = ()  # names of its results, if it returns a named tuple
        self.begin()

    def begin(self) -> None:
        """Forget all lines, but not the kinds of variables and results."""
        self.lines: list[str] = []
        self.temporaries = dict[str, Kind]()
        self.counts = itertools.count(1)
        self.counters = set[str]()  # variables of the present loops that are never negative
        self.changed = set[str]()  # names of arrays whose elements it changes
        if self.entry:
            for name, kind in self.parameters.items():
                if kind.sort == "memory":
                    self.changed.add(name)
        self.copies = list[tuple[frozenset[str], ast.AST]]()  # which must not change
        self.returned = set[int]()  # positions of arguments whose numbers a result may have

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
        text = " ".join(line.partition(" = ")[2] or line for line in self.lines)
        read = words(text)
        top = list(filter(None, declared.values()))
        for variable in declared:
            if variable not in read:
                top.append(f"(void){variable};")
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
        if self.returns_scalar():
            return f"static {TYPES[self.results[0].sort]} {name}({', '.join(arguments) or 'void'})"
        for i, kind in enumerate(self.results):
            arguments.append(f"{TYPES[kind.sort]} *out_{i}")
        return f"static void {name}({', '.join(arguments)})"

    def pointer_to(self, name: str) -> str:
        """Return the type of an argument or of a pointer to an array."""
        kind = self.kinds[name]
        if not kind.shape and kind.sort in WIDTHS:
            return f"{TYPES[kind.sort]} "
        type_name = TYPES[kind.sort]
        if kind.sort == "y" and self.program.component.kind == "estimator":
            type_name = "smc_reading"
        if self.names[name].sources <= self.parameters.keys() - self.changed:
            type_name = f"const {type_name}"
        return f"{type_name} *"

    def returns_scalar(self) -> bool:
        """Return whether it returns one number."""
        return len(self.results) == 1 and not self.results[0].shape

    def variable(self, name: str) -> Value:
        """Return the value of a variable that has a kind."""
        kind = self.kinds[name]
        if kind.shape:
            return array_at(self.c_name(name), kind, sources=[name])
        value = Value(self.c_name(name), kind)
        if kind.sort in WIDTHS:
            return value
        return value._replace(sources=frozenset([name]))  # y and gains

    def c_name(self, name: str) -> str:
        """Return a variable's name in C."""
        if name in RESERVED:
            return f"{name}_"
        return c_name(name)

    def origins(self, text: str) -> set[str]:
        """Return the names of the variables that some C mentions, and of the arrays they are."""
        variables = set[str]()
        mentioned = words(re.sub(r"->\w+", "", text))
        for name, value in self.names.items():
            if self.c_name(name) in mentioned:
                variables |= {name, *value.sources}
        return variables

    def temporary(self, kind: Kind) -> Value:
        """Return a new variable."""
        name = f"new_{next(self.counts)}"
        while name in self.source.names:
            name = f"new_{next(self.counts)}"
        self.temporaries[name] = kind = kind._replace(stride="1")
        if kind.shape:
            return array_at(name, kind)
        return Value(name, kind)

    def captured(self, translate: Callable[[Any], Any], node: Any) -> tuple[Any, list[str]]:
        """Return what a method makes of some code, and the lines that it writes."""
        before = self.lines
        self.lines = []
        translated = translate(node)
        own = self.lines
        self.lines = before
        return translated, own

    def alone(self, translate: Callable[[Any], Any], node: ast.expr) -> Any:
        """Return what a method makes of some code that must need no line before it."""
        translated, lines = self.captured(translate, node)
        if lines:
            raise refuse(node, "an array that is computed within a condition")
        return translated


def declaration(name: str, kind: Kind) -> str:
    """Return the line that declares a variable."""
    if kind.shape:
        return f"{TYPES[kind.sort]} {name}[{math.prod(kind.shape)}];"
    return f"{TYPES[kind.sort]} {name} = 0;"


def c_name(name: str) -> str:
    """Return a name in ASCII letters, which every C99 compiler accepts."""
    return "".join(c if c.isascii() else f"u{ord(c):04x}" for c in name)


def joined(values: Iterable[Value]) -> str:
    """Return the texts of values, with commas."""
    return ", ".join(value.text for value in values)


def words(text: str) -> set[str]:
    """Return the names and numbers in some C."""
    return set(re.findall(r"\w+", text))


def wrapped_lines(items: Sequence[str]) -> str:
    """Return items in lines of at most 100 characters."""
    text = ", ".join(items) + ","
    return textwrap.fill(text, 100, initial_indent="    ", subsequent_indent="    ")


def wrapped(indent: str, line: str) -> list[str]:
    """Return a line of code in lines of at most 110 characters."""
    further = f"{indent}        "
    wrap = textwrap.TextWrapper(110, indent, further, break_long_words=False)
    wrap.break_on_hyphens = False
    return wrap.wrap(line)
