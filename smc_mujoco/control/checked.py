"""Checked laws: whether compiled code reads its arguments and constants alone, decided before any run.

    law.checked          # True, or False
    law.why_unchecked    # "", or why not, in one sentence

Such code cannot see the plant, the noise, the clock or a file, and keeps nothing between calls but its memory. Numba's
own results are examined twice. First its typed instructions: each must be one of a short list, each call must be of a
mathematical function or of a helper for which the same holds, and each global must be a number, a tuple of numbers or
a read-only array, of which compiled code has a copy. Arrays are read and written within their bounds. Then the code
that numba gives to LLVM: it may declare functions of these lists only, and have neither addresses as constants, nor
calls through an address, nor instructions of the processor, nor variables of its own. The code of operations on numba's
own types must be numba's own.

A law that runs in Python, in C from elsewhere or in an FMU is unchecked. The file that defines a law runs as a program
when it is imported; this check says nothing of that.
"""

import functools
import math
import operator
import re
from collections.abc import Callable
from types import CodeType, ModuleType
from typing import Any

import numpy as np
from numba import types

from smc_mujoco.common import numba_internals as internals
from smc_mujoco.common.errors import one_line
from smc_mujoco.common.jit import CHECKED_OPTIONS, AtAddress, NotCompilable, Uncompiled, compiled_for, named
from smc_mujoco.control import joint_law
from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import JointMeasurement
from smc_mujoco.control.law import Measurement

ir = internals.ir

BUILTINS = {
    abs, bool, complex, divmod, enumerate, float, int, len, max, min, pow, range, reversed, round, slice, sum, zip,
}  # fmt: skip
NUMPY_NAMES = """
all allclose any arange argmax argmin argsort around array asarray ascontiguousarray clip concatenate copy cross cumprod
cumsum diag diff dot eye flip full full_like identity interp isclose kron linspace max mean median min nan_to_num ones
ones_like outer prod ptp round searchsorted sign sinc sort std sum trace transpose trapezoid var vdot where zeros
zeros_like
"""
LINALG_NAMES = (
    "cholesky cond det eig eigh eigvals eigvalsh inv lstsq matrix_power matrix_rank norm pinv qr slogdet solve svd"
)
# Functions that only compute. np.empty is not one: it shows what is left in memory.
MATHEMATICAL = BUILTINS | {thing for thing in vars(math).values() if callable(thing)}
MATHEMATICAL |= {getattr(np, name) for name in NUMPY_NAMES.split() if hasattr(np, name)}
MATHEMATICAL |= {getattr(np.linalg, name) for name in LINALG_NAMES.split()}
MATHEMATICAL |= {thing for thing in vars(np).values() if isinstance(thing, np.ufunc)}
REQUESTED = {joint_law.coriolis, joint_law.jacobian}  # they call MuJoCo with the nominal model of the measurement

ARRAY_NAMES = """
T all any argmax argmin argsort astype conj copy cumsum diagonal dot dtype fill flatten imag item max mean min ndim prod
ravel real shape size sort std sum trace transpose var
"""
ARRAY_ATTRIBUTES = {*ARRAY_NAMES.split()}
LIST_ATTRIBUTES = {"append", "clear", "copy", "count", "extend", "index", "insert", "pop", "remove", "reverse"}
NUMBER_ATTRIBUTES = {"real", "imag", "conjugate"}
HIDDEN_FIELDS = {"dynamics"}  # of a measurement: an address, for REQUESTED alone

STATEMENTS = ir.Assign, ir.Branch, ir.Del, ir.Jump, ir.Return, ir.SetItem, ir.StaticRaise, ir.StaticSetItem
EXPRESSION_NAMES = """
arrayexpr binop build_list build_tuple call cast exhaust_iter getattr getitem getiter inplace_binop iternext null
pair_first pair_second phi static_getitem typed_getitem unary undef
"""
EXPRESSIONS = {*EXPRESSION_NAMES.split()}
OPERATIONS = {"getitem": operator.getitem, "static_getitem": operator.getitem, "typed_getitem": operator.getitem}
INDICES = types.Integer, types.SliceType, types.BaseTuple, types.EllipsisType, types.NoneType, types.Boolean
OPERATORS = {"operator", "_operator"}
NAMES_A_FUNCTION = (types.Callable, types.Module, types.DType)
CALLED = (types.NumberClass, types.BoundFunction, types.ExceptionClass)
CONSTANT_TYPES = (types.Number, types.Boolean, types.NoneType, types.UnicodeType, types.Literal, types.EllipsisType)

# LLVM's own functions, which differ by processor, without those that read the machine, other code or a clock.
INTRINSICS = re.compile(
    r"llvm\.(?!\w*(address|register|counter|rdtsc|rdpmc|rdrand|rdseed|rdpid|fsbase|gsbase|trampoline|threadpointer)"
    r"|thread\.|x86\.(?!atomic|sse|avx|fma)|eh\.|coro|gc|va_|[gs]et|init|adjust|objectsize|syscall|trap|debug|ubsan)[\w.]+"
)
# Numba's own functions: memory that it counts, arithmetic that no processor has, and linear algebra.
RUNTIME = re.compile(
    r"NRT_(MemInfo_(alloc\w*|call_dtor|data\w*|varsize\w*|new_varsize\w*)|Allocate\w*|Reallocate|Free|incref|decref)"
    r"|numba_(x|ez_|raw_)\w+|numba_fatal_error|__powidf2|__muloti4|__divti3|__modti3|numba_gil_(ensure|release)"
    r"|Py_FatalError|(_?_?numba_)?_?py_?\w*mod"
    r"|numba_(cpow|gamma|lgamma|erf|erfc|frexp|ldexp|modf|ndtr|nextafter|attempt_nocopy_reshape)\w*"
)
LIBM = re.compile(
    r"(a?(sin|cos|tan)h?|atan2|exp|exp2|expm1|log|log10|log1p|log2|sqrt|cbrt|hypot|pow|fmod|remainder|fabs|floor|ceil"
    r"|trunc|rint|round|nearbyint|copysign|erf|erfc|tgamma|lgamma|ldexp|frexp|modf|nextafter|mem(cpy|set|move|cmp))f?"
)
ALLOWED = re.compile("|".join((INTRINSICS.pattern, RUNTIME.pattern, LIBM.pattern)))
# The text of an error, for Python, which compiled code does not read: numba writes it for shapes that do not match.
MESSAGES = re.compile(r"^define [^\n]*@__excinfo_unwrap_args\w+\(.*?^}$", re.MULTILINE | re.DOTALL)
MAX_HEAD = 80  # characters between the name of a variable and its value
ADDRESS = re.compile(r"\binttoptr \(?i\d+ -?\d+ to\b")
INSTRUCTIONS = re.compile(r"\b(?:call|invoke)\b[^\n\"]*\basm\b")
INDIRECT = re.compile(r"\b(?:call|invoke)\b[^@\n\"]*?%[\w.$-]+\(")


class Found(Exception):
    """What a law's code does that a checked one does not, worded to follow "it"."""


def why_unchecked(c: Component) -> str:
    """Return why a law, a surface or an estimator is not checked, as a sentence; "" if it is."""
    for part in c.parts:
        if part.function is None:
            return f"{part.kind} {part.name} is unchecked: its code is not available here"
        if isinstance(part.function, Uncompiled):
            return f"{part.kind} {part.name} is unchecked: it {part.function.why}"
        if isinstance(part.function, AtAddress):
            return f"{part.kind} {part.name} is unchecked: it is machine code that numba did not compile"
        try:
            why = _found(part.function, part.kind, tuple(part.gains), part.shared, part.joint)
        except TypeError:
            why = "does not compile: it is not hashable"
        if why:
            return f"{part.kind} {part.name} is unchecked: it {why}"
    return ""


@functools.cache
def _found(function: Callable, kind: str, gains: tuple[str, ...], shared: tuple[str, ...], joint: bool) -> str:
    """Return what compiled code does that a checked one does not, or why it does not compile; "" for nothing."""
    if whose := _elsewhere():
        return f"may run {whose}, which changes what numba compiles for its own types"
    try:
        compiled = compiled_for(function, _argument_types(kind, gains, shared, joint))
        requests = Examination().examine(compiled)
        _examine_llvm(compiled.library, requests)
    except NotCompilable as error:
        return f"does not compile and runs in Python: {one_line(str(error))}"
    except Found as found:
        return str(found)
    return ""


def _argument_types(kind: str, gains: tuple[str, ...], shared: tuple[str, ...], joint: bool) -> tuple[types.Type, ...]:
    """Return numba's types of (y, gains, memory), those with which the callback compiles the function."""
    number, vector = types.float64, types.Array(types.float64, 1, "C")
    matrix, record = types.Array(types.float64, 2, "C"), named(gains)
    if not joint:
        fields = Reading if kind == "estimator" else Measurement
        y = types.NamedUniTuple(number, len(fields._fields), fields)
        return y, types.NamedUniTuple(number, len(record._fields), record), vector
    heads = {"t": number, "dt": number, "model": number, "dynamics": types.int64, "M": matrix}
    y = types.NamedTuple([heads.get(name, vector) for name in JointMeasurement._fields], JointMeasurement)
    values = [number if name in shared else vector for name in record._fields]
    same = len(set(values)) == 1
    return y, types.NamedUniTuple(values[0], len(values), record) if same else types.NamedTuple(values, record), matrix


class Examination:
    """An examination of the typed instructions of a function, and of its helpers."""

    def __init__(self) -> None:
        self.known: set[int] = set()
        self.requests = False
        self.written: set[Any] = set()  # names and texts in the function that is examined

    def examine(self, compiled: Any) -> bool:
        """Examine a compiled function. Return whether it asks the nominal model for numbers. Raise Found."""
        self.known.add(id(compiled))
        about, outer = compiled.type_annotation, self.written
        types_of, self.written = about.typemap, _words(about.func_id.code)
        for kind in compiled.signature.args:
            if isinstance(kind, types.Omitted):
                self.constant("a default value", kind.value, internals.typeof(kind.value))
        for statement in [s for block in about.blocks.values() for s in block.body]:
            if not isinstance(statement, STATEMENTS):
                raise Found(f"has a statement that is not on the list ({type(statement).__name__.lower()})")
            if isinstance(statement, ir.SetItem):
                self.index(types_of[statement.index.name])
            if isinstance(statement, ir.SetItem | ir.StaticSetItem):
                self.operation(operator.setitem, about.calltypes[statement])
            if isinstance(statement, ir.Assign):
                self.value(statement.value, types_of, types_of[statement.target.name], about.calltypes)
        self.written = outer
        return self.requests

    def value(self, value: Any, types_of: Any, kind: types.Type, calltypes: Any) -> None:
        """Examine the right side of an assignment, whose type is `kind`."""
        if isinstance(value, ir.Global | ir.FreeVar):
            self.constant(value.name, value.value, kind)
        elif isinstance(value, ir.Const):
            self.constant("a constant", value.value, kind)
        elif isinstance(value, ir.Expr):
            if value.op not in EXPRESSIONS:
                raise Found(f"has an expression that is not on the list ({value.op})")
            for function in {OPERATIONS.get(value.op), *map(value._kws.get, ("fn", "immutable_fn"))}:
                self.operation(function, calltypes.get(value))
            if value.op == "call":
                self.call(types_of[value.func.name], calltypes[value])
            elif value.op == "getattr":
                self.attribute(types_of[value.value.name], value.attr, kind)
            elif value.op in ("static_getitem", "typed_getitem", "getitem"):
                self.item(value, types_of)
            elif value.op == "arrayexpr":
                self.elementwise(value.expr)
        elif not isinstance(value, ir.Arg | ir.Var):
            raise Found(f"has a value that is not on the list ({type(value).__name__.lower()})")

    def constant(self, name: str, value: Any, kind: types.Type) -> None:
        """Examine a value from outside the function, of which compiled code has a copy."""
        if value is np.empty and (name != "empty" or name in self.written):  # numba writes it for np.array([...])
            raise Found("calls numpy.empty, which shows what is left in memory: call numpy.zeros")
        if isinstance(kind, types.RecursiveCall):
            raise Found("calls itself, for which numba uses an address: write a loop")
        if isinstance(kind, NAMES_A_FUNCTION) or isinstance(value, type | ModuleType):
            return
        if isinstance(value, np.ndarray):
            if value.flags.writeable or value.base is not None:
                raise Found(f"reads the array {name}, which others can change: give a tuple, or a read-only array")
        elif isinstance(kind, types.BaseTuple):
            for one in value:
                self.constant(name, one, internals.typeof(one))
        elif not isinstance(kind, CONSTANT_TYPES):
            raise Found(f"reads {name}, which is no number, no tuple of numbers and no read-only array")

    def attribute(self, kind: types.Type, name: str, result: types.Type) -> None:
        """Examine the reading of an attribute of something of this type."""
        if isinstance(kind, types.Module):
            self.written.add(name)
            self.constant(name, getattr(kind.pymod, name), result)
        elif isinstance(kind, types.BaseNamedTuple):
            if name in HIDDEN_FIELDS:
                raise Found(f"reads {name} of its measurement: call coriolis or jacobian")
        else:
            allowed = {types.Array: ARRAY_ATTRIBUTES, types.List: LIST_ATTRIBUTES}.get(type(kind), NUMBER_ATTRIBUTES)
            if name not in allowed:
                raise Found(f"reads .{name} of a value, which is not on the list")

    def item(self, value: Any, types_of: Any) -> None:
        """Examine the reading of an element."""
        if isinstance(types_of[value.value.name], types.BaseNamedTuple):
            if getattr(types_of[value.value.name], "instance_class", None) is JointMeasurement:
                raise Found("reads its measurement by number: read it by name")
        elif value.op != "static_getitem":
            self.index(types_of[value.index.name])

    def index(self, kind: types.Type) -> None:
        """Examine an index: numba checks numbers, and cuts slices."""
        if not isinstance(kind, INDICES):
            raise Found("has an index that is neither a number nor a slice")
        for one in kind.types if isinstance(kind, types.BaseTuple) else ():  # pyright: ignore[reportAttributeAccessIssue] numba's own
            self.index(one)

    def elementwise(self, expression: Any) -> None:
        """Examine an expression of whole arrays, a tuple of a function and operands."""
        if isinstance(expression, tuple):
            function, operands = expression
            if getattr(function, "__module__", "") != "_operator" and function not in MATHEMATICAL:
                raise Found(f"calls {_name(function)}, which is not on the list of mathematical functions")
            for operand in operands:
                self.elementwise(operand)

    def operation(self, function: Any, signature: Any) -> None:
        """Examine what compiled code does for an operator, called with these types."""
        if function is not None and signature is not None:
            for template in internals.cpu_target.typing_context.resolve_value_type(function).templates:
                if not _home(template) and _takes(template, signature.args):
                    raise Found(f"calls {_name(function)}, for which numba's code is not used")

    def call(self, kind: types.Type, signature: Any) -> None:
        """Examine a call of something of this type with arguments of the types in its signature."""
        if isinstance(kind, types.Dispatcher):
            self.helper(kind.dispatcher)
        elif isinstance(kind, types.NamedTupleClass):
            if kind.instance_class is JointMeasurement:
                raise Found("makes a measurement of its own")
        elif isinstance(kind, types.Function):
            self.function(kind, kind.typing_key, signature)
        elif not isinstance(kind, CALLED):
            raise Found(f"calls a function from elsewhere ({one_line(str(kind))})")

    def function(self, kind: types.Function, function: Any, signature: Any) -> None:
        """Examine a call of a function that numba, or this package for REQUESTED, knows."""
        home = joint_law.__name__ if function in REQUESTED else "numba"
        own = all(_home(template, home) for template in kind.templates)
        if function not in MATHEMATICAL | REQUESTED | {np.empty} or not own:
            raise Found(f"calls {_name(function)}, which is not on the list of mathematical functions")
        if (
            function is np.outer and isinstance(signature.args[-1], types.Array) and len(signature.args) > 2
        ):  # numba may have compiled it elsewhere, without checks
            raise Found("writes numpy.outer into an array of its own: call it with two arguments")
        if function in REQUESTED and getattr(signature.args[0], "instance_class", None) is not JointMeasurement:
            raise Found(f"calls {function.__name__} with another thing than its measurement")
        self.requests |= function in REQUESTED

    def helper(self, dispatcher: Any) -> None:
        """Examine a function that the law calls: it must be compiled as the law is, with checks of bounds."""
        if type(dispatcher) is not internals.CPUDispatcher or dispatcher.targetoptions != CHECKED_OPTIONS:
            raise Found(f"calls {_name(dispatcher)}, which is not compiled as laws are")
        for compiled in dispatcher.overloads.values():
            if id(compiled) not in self.known:
                self.examine(compiled)


def _words(code: CodeType) -> set[Any]:
    """Return the names and the texts in a function's code, and in that of functions in it."""
    words = {*code.co_names, *code.co_freevars, *code.co_varnames, *(c for c in code.co_consts if isinstance(c, str))}
    return words.union(*(_words(inner) for inner in code.co_consts if isinstance(inner, CodeType)))


def _home(source: Any, home: str = "numba") -> bool:
    """Return whether an implementation, or numba's template of one, is written in the package `home`."""
    written = getattr(source, "_overload_func", None) or getattr(source, "_definition_func", source)
    return f"{_module(written)}.".startswith(f"{home}.")


def _takes(template: Any, arguments: tuple[types.Type, ...]) -> bool:
    """Return whether a template of numba has an implementation for arguments of these types."""
    try:
        return template(internals.cpu_target.typing_context).apply(arguments, {}) is not None
    except Exception:  # numba raises many types; each means that it has none
        return False


def _elsewhere() -> str:
    """Return the function of another package that writes code for numba's own operations and types; "" for none."""
    target, typing = internals.cpu_target.target_context, internals.cpu_target.typing_context
    target.refresh()
    selectors = [*target._defns.items(), *target._getattrs.items(), ("", target._casts), ("", target._get_constants)]
    found = [(key, kinds, _written(how)) for key, selector in selectors for kinds, how in selector.versions]
    named = ARRAY_ATTRIBUTES | LIST_ATTRIBUTES | NUMBER_ATTRIBUTES
    for kind, templates in typing._attributes.items():
        found += [("", (kind,), how) for how in templates if getattr(how, "_attr", "real") in named]
    for key, kinds, how in found:
        own = key in MATHEMATICAL or not callable(key) or _module(key) in OPERATORS
        if own and not _home(how) and all(_home(kind if isinstance(kind, type) else type(kind)) for kind in kinds):
            return _name(getattr(how, "_overload_func", how))
    return ""


def _written(how: Any) -> Any:
    """Return the code of an attribute, out of numba's wrapper."""
    names = getattr(getattr(how, "__code__", None), "co_freevars", ())
    return how.__closure__[names.index("real_impl")].cell_contents if "real_impl" in names else how


def _module(source: Any) -> str:
    """Return the module in which a function or a class of numba is written."""
    return str(getattr(source, "__globals__", {}).get("__name__") or getattr(source, "__module__", ""))


def _name(function: Any) -> str:
    module, name = getattr(function, "__module__", ""), getattr(function, "__name__", type(function).__name__)
    return one_line(f"{module}.{name}" if module and module != "builtins" else name)


def _examine_llvm(library: Any, requests: bool) -> None:
    """Examine a library's code. Raise Found. `requests`: whether it may call through the address in a measurement."""
    module = library._final_module
    text = MESSAGES.sub("", str(module))
    for thing in (*module.functions, *module.global_variables):
        name = thing.name
        used = thing.is_declaration and len(re.findall(rf"{re.escape(name)}(?![\w.])", text)) > 1
        if used and not ALLOWED.fullmatch(name):
            raise Found(f"calls or reads {one_line(name)}, which is not on the list of mathematical functions")
    for variable in module.global_variables:
        start = str(variable)[len(variable.name) : len(variable.name) + MAX_HEAD]
        if not (variable.is_declaration or variable.name.startswith("_ZN08NumbaEnv") or " constant " in start):
            raise Found("has a variable of its own, as a global array of a megabyte is: keep what changes in memory")
    if INSTRUCTIONS.search(text):
        raise Found("has instructions of the processor")
    if ADDRESS.search(text):
        raise Found("has an address as a constant")
    if INDIRECT.search(text) and not requests:
        raise Found("calls a function by its address")
