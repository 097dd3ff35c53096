"""Translate the Python of a law of many joints into C99: `translate`, with arrays of numbers.

An array has a kind such as "real[SMC_JOINTS]" or "real[3][SMC_JOINTS]". An expression of arrays becomes a loop over its
elements, with the operations of numba in the same order. A function that returns an array writes it to a pointer.

Python's names of arrays may share numbers, as `w = memory[:, 0]` does with the memory. The C copies. So an array that
the function changes must not share its numbers with another name; such code is refused.
"""

import ast
import functools
import inspect
import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from types import FunctionType
from typing import Any

import numpy as np

from smc_mujoco.control import joint_law
from smc_mujoco.control.component import Component
from smc_mujoco.exchange.c.translate import (
    ARGUMENTS,
    ATOM,
    HELPERS,
    LOOSE,
    PRODUCT,
    SUM,
    TYPES,
    UNARY,
    WHOLE_KINDS,
    Function,
    Program,
    Value,
    call_to,
    known,
    literal,
    names_in,
    parsed,
    plain,
    refuse,
    text_of,
    whole_expression,
    wider,
)

JOINTS, SLOTS = "SMC_JOINTS", "SMC_LAW_MEMORY"  # dimensions that are macros in the file
ROW, COLUMN = "\x00", "\x01"  # stand for the indices in the text of an array's element
TOKEN = re.compile("\x02(\\d+)\x03")  # stands for a call in an expression, which may move before its loop
NUMBERS = ("t", "dt", "model")
# Fields of the measurement -> their dimensions.
FIELDS = dict.fromkeys(joint_law.ARRAYS, f"[{JOINTS}]") | dict.fromkeys(NUMBERS, "")
FIELDS["M"] = f"[{JOINTS}][{JOINTS}]"
ON_REQUEST = {joint_law.coriolis: ("coriolis", (JOINTS,)), joint_law.jacobian: ("jacobian", ("3", JOINTS))}
HELPERS |= {  # numpy's, as numba compiles them: NaN stays NaN
    "lesser": "a <= b || a != a ? a : b",
    "greater": "a >= b || a != a ? a : b",
    "sign": "a > 0 ? 1 : a < 0 ? -1 : a",
}
# Functions of numpy with elements -> the same in C.
OF_MATH = ("sqrt", "exp", "expm1", "log", "log1p", "sin", "cos", "tan", "sinh", "cosh", "tanh", "fabs")
OF_MATH_RENAMED = {"arctan": "atan", "arctan2": "atan2", "arcsin": "asin", "arccos": "acos", "hypot": "hypot"}
ELEMENTWISE = {getattr(np, name): name for name in OF_MATH} | {getattr(np, n): c for n, c in OF_MATH_RENAMED.items()}
ELEMENTWISE |= {np.abs: "fabs", abs: "fabs"}
HELPED = {np.minimum: "lesser", np.maximum: "greater", np.sign: "sign"}
FILLED = {np.zeros: 0.0, np.empty: 0.0, np.ones: 1.0}
NEW = {*FILLED, np.full, np.array, np.where}  # functions that return a new array
SHARED = "which shares its numbers with another name: write .copy() behind it"


def translate(component: Component, single: bool, joints: int) -> tuple[int, str]:
    """Return the number of memory slots of each joint, and the C of a law of many joints and of all that it calls.

    Raises:
      Untranslatable: a piece of Python, which is quoted, has no translation.
    """
    return text_of(JointProgram(component, single, joints))


class JointProgram(Program):
    """The C file of a law for a number of joints."""

    def __init__(self, component: Component, single: bool, joints: int):
        super().__init__(component, single)
        self.joints, self.make = joints, ArrayFunction

    def size(self, dimension: str) -> int:
        """Return a dimension as a number; that of the memory is not known before the end."""
        return self.joints if dimension == JOINTS else int(dimension)


class ArrayFunction(Function):
    """One function in C, with arrays.

    Attributes:
      frames: for each elementwise expression within another, the shapes of its operands and its calls.
      before: lines that belong before the present one, such as loops that fill arrays.
      temporaries: name -> kind of arrays for results within expressions.
      fixed: whether nothing may move before the present line.
    """

    program: JointProgram

    def __init__(self, *arguments: Any, **named: Any):
        self.frames: list[tuple[list[str], list[Value]]] = []
        self.fixed = False
        super().__init__(*arguments, **named)
        self.check_sharing()

    def arrays(self) -> Iterable[str]:
        """Return the declarations of the function's arrays."""
        kinds = {self.c_name(n): kind for n, kind in self.kinds.items() if n not in self.parameters}
        return [declared(kind, name) for name, kind in (kinds | self.temporaries).items() if shape(kind)]

    def text(self, name: str) -> str:
        """Return the whole function under a name. A length that only declares arrays is not read in C."""
        read = set(re.findall(r"\w+", " ".join(line.partition(" = ")[2] or line for line in self.lines)))
        self.read -= {n for n, kind in self.kinds.items() if kind in WHOLE_KINDS and self.c_name(n) not in read}
        return super().text(name)

    def head(self, name: str) -> str:
        """Return the declaration without a semicolon. Arrays are pointers."""
        pointers = ARGUMENTS | {"y": "const smc_joint_measurement *"}
        arguments = []
        for parameter in self.parameters:
            kind = self.kinds[parameter]
            of = pointers.get(kind) or (f"const {TYPES[base(kind)]} *" if shape(kind) else f"{TYPES[kind]} ")
            arguments.append(f"{of}{self.c_name(parameter)}")
        if self.entry:
            return f"int {name}({', '.join(arguments)}, smc_real *out)"
        if len(self.results) == 1 and not shape(self.results[0]):
            return f"static {TYPES[self.results[0]]} {name}({', '.join(arguments) or 'void'})"
        arguments += [f"{TYPES[base(kind)]} *out_{i}" for i, kind in enumerate(self.results)]
        return f"static void {name}({', '.join(arguments)})"

    # statements

    def block(self, body: Sequence[ast.stmt]) -> Iterator[str]:
        """Yield the lines of some statements, each after the lines that have moved before it."""
        if body is self.tree.body:
            self.before, self.temporaries, self.counts = list[str](), dict[str, str](), itertools.count(1)
        for line in super().block(body):
            before, self.before = self.before, []
            yield from before
            yield line

    def assign(self, target: ast.expr, value: ast.expr) -> Iterator[str]:
        """Assign a number or an array to one target, or to a tuple of them."""
        if isinstance(target, ast.Tuple | ast.List):
            yield from super().assign(target, value)
            return
        number = self.numeric(value)
        if shape(number.kind) or self.is_array(target):
            yield from self.store(target, number)
        else:
            yield f"{self.destination(target, number.kind)} = {number.text};"

    def augment(self, node: ast.AugAssign) -> Iterator[str]:
        """Translate target op= value, element by element if the target is an array."""
        if not self.is_array(node.target):
            yield from super().augment(node)
            return
        yield from self.store(node.target, self.numeric(whole_expression(node)))

    def at_once(self, targets: Sequence[ast.expr], values: Sequence[ast.expr]) -> Iterator[str]:
        """Compute all values before the first assignment. Arrays are refused."""
        if any(shape(self.numeric(value).kind) for value in values):
            raise refuse(values[0], "arrays that change places at once")
        yield from super().at_once(targets, values)

    def unpack(self, targets: Sequence[ast.expr], call: ast.Call) -> Iterator[str]:
        """Assign the results of a function that has several."""
        values = [self.argument(a) for a in call.args]
        kinds, beginning = self.program.function(self.callee(call), values, call.args)
        if len(kinds) != len(targets):
            raise refuse(call, f"{len(targets)} names for {len(kinds)} results")
        pointers, stores = [], []
        for target, kind in zip(targets, kinds, strict=True):
            if shape(kind):
                found = self.temporary(kind)
                pointers.append(found.pointer)
                stores.append((target, found))
            else:
                pointers.append(f"&{self.destination(target, kind)}")
        yield call_to(beginning, ", ".join(pointers))
        for target, found in stores:
            yield from self.store(target, found)

    def loop(self, node: ast.For, variable: str) -> Iterator[str]:
        """Translate for i in range(...) and for element in array."""
        if isinstance(node.iter, ast.Name) and len(shape(self.kinds.get(node.iter.id, ""))) == 1:
            array, i = self.value(node.iter), self.index()
            yield f"for (int32_t {i} = 0; {i} < {shape(array.kind)[0]}; {i}++) {{"
            yield f"{self.destination(node.target, base(array.kind))} = {array.text.replace(ROW, i)};"
            yield from self.block(node.body)
            yield "}"
        else:
            yield from super().loop(node, variable)

    def returned(self, value: ast.expr) -> Iterator[str]:
        """Translate return."""
        values = [self.numeric(v) for v in (value.elts if isinstance(value, ast.Tuple) else [value])]
        self.results = self.results or [v.kind for v in values]
        if len(values) != len(self.results):
            raise refuse(value, "another number of results")
        self.results = [wider(one, v.kind) for one, v in zip(self.results, values, strict=True)]
        if self.entry and (len(values) != 2 or any(not self.fits(kind, f"real[{JOINTS}]") for kind in self.results)):
            raise refuse(value, "a result other than two vectors, u and s, of one number for each joint,")
        if len(values) == 1 and not shape(self.results[0]):
            yield f"return {values[0].text};"
            return
        for i, v in enumerate(values):
            if self.entry:
                out = array_at("out", v.kind, f"{JOINTS} + " if i else "")
            else:
                out = array_at(f"out_{i}", v.kind) if shape(v.kind) else Value(f"*out_{i}", v.kind)
            yield from self.fill(out, v)
        yield "return 0;" if self.entry else "return;"

    def store(self, target: ast.expr, value: Value) -> Iterator[str]:
        """Assign an array, or a number to all elements of an array."""
        if isinstance(target, ast.Name):
            if target.id in self.parameters:
                raise refuse(target, "an assignment to an argument that is an array")
            before, kind = self.kinds.get(target.id, ""), value.kind
            if shape(before) and self.fits(before, kind):  # 3 or SMC_JOINTS, where there are three joints
                kind = base(kind) + before[len(base(before)) :]
            self.destination(target, kind)
            place = self.value(target)
        else:
            place = self.changeable(target)
            if wider(base(place.kind), base(value.kind)) != base(place.kind):
                raise refuse(target, "real numbers for elements of an array of whole numbers")
        if shape(value.kind) and not self.fits(value.kind, place.kind):
            raise refuse(target, f"an array of {', '.join(shape(value.kind))} numbers for one of another shape")
        own = [re.escape(place.text), rf"\w+\[{ROW} \* {SLOTS} \+ \w+\]"]  # elements of the same joint
        others = re.sub("|".join(own), "", value.text)
        if re.search(rf"\b{place.text.partition('[')[0]}\b", others):  # reads elements that the loop has changed
            kept = self.temporary(value.kind)
            yield from self.fill(kept, value)
            value = kept
        yield from self.fill(place, value)

    def fill(self, place: Value, value: Value) -> Iterator[str]:
        """Yield the loops that copy an array, or one number, to a place."""
        dimensions = shape(place.kind)
        if call := self.last_call(place, value):
            yield f"{call}, {place.pointer});"
            return
        indices = [self.index(i) for i in range(len(dimensions))]
        loops = [f"for (int32_t {i} = 0; {i} < {n}; {i}++)" for i, n in zip(indices, dimensions, strict=True)]
        line = f"{place.text} = {value.text};"
        for token, i in zip((ROW, COLUMN), indices, strict=False):
            line = line.replace(token, i)
        yield " ".join([*loops, line])

    def last_call(self, place: Value, value: Value) -> str:
        """Take back the call that has just computed a value, if it can write to a place itself; else an empty text."""
        end = f", {value.pointer});"
        if not (place.pointer and self.before and value.pointer in self.temporaries and self.before[-1].endswith(end)):
            return ""
        call = self.before[-1].removesuffix(end)
        if re.search(rf"\b{place.pointer.partition(' ')[0]}\b", call.partition("(")[2]):  # it reads from there
            return ""
        self.before.pop()
        del self.temporaries[value.pointer]
        return call

    def destination(self, target: ast.expr, kind: str) -> str:
        """Return a target in C, to which a value of a kind is assigned."""
        if isinstance(target, ast.Subscript):
            place = self.changeable(target)
            if wider(place.kind, kind) != place.kind:
                raise refuse(target, "a real number for an element of an array of whole numbers")
            return place.text
        return super().destination(target, kind)

    def changeable(self, target: ast.expr) -> Value:
        """Return elements that the function may change: of its memory, or of an array that it makes."""
        name = root(target)
        kind = self.kinds.get(name, "")
        if kind != "memory" and (not shape(kind) or name in self.parameters):
            raise refuse(target, "an assignment to this, which is no array of the function's own,")
        return self.value(target)

    def is_array(self, target: ast.expr) -> bool:
        """Return whether a target of an assignment is an array already."""
        kind, indices = self.kinds.get(root(target), ""), 0
        while isinstance(target, ast.Subscript):
            places = target.slice.elts if isinstance(target.slice, ast.Tuple) else [target.slice]
            indices += sum(not isinstance(place, ast.Slice) for place in places)
            target = target.value
        return indices < (2 if kind == "memory" else len(shape(kind)))

    def fits(self, kind: str, other: str) -> bool:
        """Return whether two kinds have the same shape."""
        sizes = [[self.program.size(n) for n in shape(one)] for one in (kind, other)]
        return sizes[0] == sizes[1]

    def index(self, place: int = 0) -> str:
        """Return the name of a loop's index, which no variable has."""
        taken = {n.id for n in ast.walk(self.tree) if isinstance(n, ast.Name)} | set(self.parameters)
        return [name for name in (*"ijklmn", "row", "column", "element_1", "element_2") if name not in taken][place]

    # expressions

    def numeric(self, node: ast.expr) -> Value:
        """Translate an expression that is a number or an array; within an elementwise one its element."""
        value = super().numeric(node)
        if not self.frames:
            return value
        shapes, calls = self.frames[-1]
        if dimensions := shape(value.kind):
            if shapes and not self.fits(shapes[0], value.kind):
                raise refuse(node, "arrays of different shapes in one expression")
            shapes.append("".join(f"[{n}]" for n in dimensions))
            return value._replace(kind=base(value.kind))
        if "(" in value.text and not isinstance(node, ast.Constant):
            calls.append(value)
            return Value(f"\x02{len(calls) - 1}\x03", value.kind)
        return value

    def elementwise(self, method: Callable[[Any], Value], node: Any) -> Value:
        """Translate an expression by its elements: an array if an operand is one. Calls then move before the loop."""
        self.frames.append(([], []))
        try:
            value = method(node)
        finally:
            shapes, calls = self.frames.pop()
        if not shapes:
            return value._replace(text=TOKEN.sub(lambda found: calls[int(found[1])].within(ATOM), value.text))
        names = {}

        def moved(found: re.Match[str]) -> str:
            if found[1] not in names:
                call = calls[int(found[1])]
                names[found[1]] = self.new_name("number")
                self.move(f"const {TYPES[call.kind]} {names[found[1]]} = {call.text};", node)
            return names[found[1]]

        return Value(TOKEN.sub(moved, value.text), value.kind + shapes[0], value.level)

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

    def stored(self, value: Value, node: ast.AST) -> Value:
        """Return an array whose numbers lie in a row: itself, or a copy."""
        if value.pointer:
            return value
        kept = self.temporary(value.kind)
        lines = list(self.fill(kept, value))
        for line in lines:
            self.move(line, node)
        return kept

    def argument(self, node: ast.expr) -> Value:
        """Translate an argument of a function: a number, an array as a pointer, or y or gains."""
        value = self.outside(self.value, node)
        if value.kind == "memory":
            raise refuse(node, "a function that gets the memory")
        if not shape(value.kind):
            return value
        kept = self.stored(value, node)
        return kept._replace(text=kept.pointer)

    def truth(self, node: ast.expr) -> str:
        """Translate an expression as a condition."""
        value = self.staying(self.outside, self.numeric, node)
        if shape(value.kind):
            raise refuse(node, "an array as a condition")
        return value.text if value.kind in WHOLE_KINDS else f"{value.within(UNARY)} != 0"

    def _name(self, node: ast.Name) -> Value:
        if node.id in self.names:
            value = self.names[node.id]
            return array_at(value.text, value.kind) if shape(value.kind) else value
        constant = self.globals.get(node.id)
        return self.constants_of(node, constant) if isinstance(constant, np.ndarray) else super()._name(node)

    def _attribute(self, node: ast.Attribute) -> Value:
        if (constant := self.resolve(node)) is not None:
            return self.constants_of(node, constant) if isinstance(constant, np.ndarray) else super()._attribute(node)
        owner, name = self.outside(self.value, node.value), node.attr
        if owner.kind == "y":
            known(name, "measurement", FIELDS)
            return (
                array_at(f"{owner.text}->{name}", f"real{FIELDS[name]}")
                if FIELDS[name]
                else Value(f"{owner.text}->{name}", "real")
            )
        if owner.kind == "gains":
            known(name, "gain", self.program.gains)
            place = f"GAIN_{plain(name)} * {JOINTS}"
            if name in self.program.component.shared:
                return Value(f"{owner.text}[{place}]", "real")
            return array_at(owner.text, f"real[{JOINTS}]", f"{place} + ")
        raise refuse(node, "an attribute")

    def constants_of(self, node: ast.expr, values: np.ndarray) -> Value:
        """Return an array of constants."""
        made = self.program.array(ast.unparse(node).replace(".", "_"), values)
        found = array_at(made.text, f"{made.kind}[{len(values)}]")
        return found if made.kind == "real" else found._replace(pointer="")  # of 16 bits, so that functions get a copy

    def _subscript(self, node: ast.Subscript) -> Value:
        array = self.resolve(node.value)
        if isinstance(array, tuple | list):
            return self.outside(super()._subscript, node)
        owner = self.outside(self.value, node.value)
        if owner.kind == "memory":
            owner = Value(f"{owner.text}[{ROW} * {SLOTS} + {COLUMN}]", f"real[{JOINTS}][{SLOTS}]")
        dimensions = shape(owner.kind)
        places = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if not dimensions or len(places) > len(dimensions):
            raise refuse(node, "an element")
        return self.elements(node, owner, [*places, *[ast.Slice()] * (len(dimensions) - len(places))])

    def elements(self, node: ast.Subscript, owner: Value, places: Sequence[ast.expr]) -> Value:
        """Return some elements of an array, by an index or a colon for each dimension."""
        text, left, pointer = owner.text, list[str](), owner.pointer
        for token, place, dimension in zip((ROW, COLUMN), places, shape(owner.kind), strict=False):
            if isinstance(place, ast.Slice):
                if place.lower or place.upper or place.step or dimension == SLOTS:
                    raise refuse(node, "a part of an array")
                text = text.replace(token, (ROW, COLUMN)[len(left)])
                left.append(dimension)
                continue
            index = self.outside(self.numeric, place)
            self.check_index(node, place, index, dimension)
            index = self.from_start(place, index, dimension)
            text = text.replace(token, index.within(PRODUCT))
            row = pointer and token == ROW and len(places) == 2
            pointer = f"{pointer} + {index.within(PRODUCT)} * {shape(owner.kind)[1]}" if row else ""
        return Value(text, base(owner.kind) + "".join(f"[{n}]" for n in left), owner.level, pointer)

    def check_index(self, node: ast.Subscript, place: ast.expr, index: Value, dimension: str) -> None:
        """Refuse an index that is no integer, or out of range as far as it is known."""
        constant = self.constant(place)
        if index.kind != "int":
            raise refuse(node, "an index that is not an integer")
        if dimension == SLOTS:
            if constant is None or constant < 0:
                raise refuse(node, f"memory at {'a negative' if constant else 'an'} index that is not constant")
            self.program.claim(node, int(constant))
        elif constant is not None and not 0 <= constant < self.program.size(dimension):
            raise refuse(node, f"an index outside 0 to {self.program.size(dimension) - 1}")

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        return self.elementwise(super()._unaryop, node)

    def _binop(self, node: ast.BinOp) -> Value:
        if isinstance(node.op, ast.MatMult):
            raise refuse(node, "the operator @")
        return self.elementwise(super()._binop, node)

    def _compare(self, node: ast.Compare) -> Value:
        return self.elementwise(super()._compare, node)

    def _boolop(self, node: ast.BoolOp) -> Value:
        return self.staying(self.outside, super()._boolop, node)

    def _ifexp(self, node: ast.IfExp) -> Value:
        return self.staying(self.elementwise, super()._ifexp, node)

    def _call(self, node: ast.Call) -> Value:
        if node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
            raise refuse(node, "a call with names or stars")
        if isinstance(node.func, ast.Attribute) and node.func.attr == "copy" and not node.args:
            return self.outside(self.value, node.func.value)._replace(pointer="")
        function = self.callee(node)
        if function in ELEMENTWISE or function in HELPED or function is np.where:
            return self.elementwise(lambda one: self.of_elements(function, one), node)
        if function is len or function is np.full or function in FILLED:
            method = self.sized
        elif function is np.array:
            method = self.listed
        else:
            method = self.requested if function in ON_REQUEST else self.called
        return self.outside(method, function, node)

    def called(self, function: Any, node: ast.Call) -> Value:
        """Translate a call of a function of Python, math, or one that is translated itself."""
        values = [self.argument(a) for a in node.args]
        if not any(shape(v.kind) for v in values):
            if (built_in := self.built_in(function, values, node)) is not None:
                return built_in
        elif function in (min, max) or inspect.isbuiltin(function) or isinstance(function, type | np.ufunc):
            raise refuse(node, f"{getattr(function, '__name__', function)} of an array")
        kinds, beginning = self.program.function(function, values, node.args)
        if len(kinds) != 1:
            raise refuse(node, "several results within an expression")
        if not shape(kinds[0]):
            return Value(f"{beginning})", kinds[0])
        found = self.temporary(kinds[0])
        self.move(call_to(beginning, found.pointer), node)
        return found

    def of_elements(self, function: Any, node: ast.Call) -> Value:
        """Translate a function of numpy, by its elements."""
        values = [self.numeric(a) for a in node.args]
        kind = "single" if all(v.kind == "single" for v in values) else "real"
        if function is np.where:
            if len(values) != 3:
                raise refuse(node, "where without two values")
            test, yes, no = values
            return Value(f"{test.within(SUM)} ? {yes.within(SUM)} : {no.within(SUM)}", wider(yes.kind, no.kind), LOOSE)
        if function in HELPED:
            return Value(f"{self.program.helper(HELPED[function], kind)}({', '.join(v.text for v in values)})", kind)
        return self.math(ELEMENTWISE[function], values)

    def requested(self, function: Any, node: ast.Call) -> Value:
        """Translate coriolis and jacobian, which the caller of the law provides."""
        name, dimensions = ON_REQUEST[function]
        y, *rest = [self.argument(a) for a in node.args]
        found = self.temporary("real" + "".join(f"[{n}]" for n in dimensions))
        arguments = [f"{y.text}->plant", *(one.text for one in rest)]
        self.move(f"{y.text}->{name}({', '.join(arguments)}, {found.pointer});", node)
        return found

    def listed(self, function: Any, node: ast.Call) -> Value:
        """Translate np.array of a list of numbers."""
        if len(node.args) != 1 or not isinstance(node.args[0], ast.List | ast.Tuple) or not node.args[0].elts:
            raise refuse(node, "an array of anything but a list of numbers")
        items = [self.numeric(item) for item in node.args[0].elts]
        if any(shape(item.kind) for item in items):
            raise refuse(node, "an array of arrays")
        kind = functools.reduce(wider, (item.kind for item in items))
        found = self.temporary(f"{kind}[{len(items)}]")
        for i, item in enumerate(items):
            self.move(f"{found.pointer}[{i}] = {item.text};", node)
        return found

    def sized(self, function: Any, node: ast.Call) -> Value:
        """Translate len, and arrays of one number."""
        if len(node.args) != (2 if function is np.full else 1):
            raise refuse(node, "a call with another number of arguments")
        if function is len:
            return Value(self.dimensions(node)[0], "int")
        dimensions = "".join(f"[{n}]" for n in self.dimensions(node.args[0]))
        if function is np.full:
            value = self.numeric(node.args[1])
            return value._replace(kind=value.kind + dimensions)
        return literal(FILLED[function], self.program.single, node)._replace(kind=f"real{dimensions}")

    def dimensions(self, node: ast.expr) -> list[str]:
        """Return the dimensions that an expression gives: a number, len(array), a variable of these, a tuple of them.

        Raises:
          Untranslatable: they are not known before the law runs.
        """
        match node:
            case ast.Tuple(elts=elements) if len(elements) <= 2:
                return [self.dimensions(one)[0] for one in elements]
            case ast.Constant(value=int(size)) if size > 0:
                return [str(size)]
            case ast.Call(func=ast.Name(id="len"), args=[array]):
                if dimensions := shape(self.value(array).kind):
                    return [dimensions[0]]
            case ast.Name(id=name):
                given = [one for one in ast.walk(self.tree) if name in assigned(one)]
                if len(given) == 1 and isinstance(given[0], ast.Assign) and isinstance(given[0].targets[0], ast.Name):
                    return self.dimensions(given[0].value)
                if isinstance(size := self.globals.get(name), int) and not given and name not in self.kinds:
                    return [str(size)]
        raise refuse(node, "a length that is not known before the law runs")

    # names that share numbers

    def check_sharing(self) -> None:
        """Refuse arrays that the function changes and that share their numbers with another name."""
        changed, pairs = {n for n, kind in self.kinds.items() if kind == "memory"}, []
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Assign):
                (target,) = node.targets
                paired = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
                pairs += zip(target.elts, node.value.elts, strict=True) if paired else [(target, node.value)]  # pyright: ignore[reportAttributeAccessIssue]
            if isinstance(node, ast.Assign | ast.AugAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                whole = [t for t in targets if isinstance(t, ast.Subscript) or isinstance(node, ast.AugAssign)]
                changed |= {name for t in whole if shape(self.kinds.get(name := root(t), ""))}
        for target, value in pairs:
            shares = self.shared(value)
            if isinstance(target, ast.Name | ast.Tuple) and (
                shares & changed or (shares and names_in([target]) & changed)
            ):
                raise refuse(value, f"an array, {SHARED},")

    def shared(self, node: ast.expr) -> set[str]:
        """Return the names of arrays with which the value of an expression may share its numbers."""
        found, parts = set[str](), list[ast.expr]()
        match node:
            case ast.Name() | ast.Subscript() if self.is_array(node):
                found = {root(node)}
            case ast.Attribute() | ast.Subscript(value=ast.Attribute()):  # of y or gains
                found = {ast.unparse(node)}
            case ast.IfExp():
                parts = [node.body, node.orelse]
            case ast.Call():
                parts = [node.args[i] for i in shared_arguments(self.resolve(node.func))]
                found = {a.id for a in parts if isinstance(a, ast.Name) and self.kinds.get(a.id) in ARGUMENTS}
        return found.union(*map(self.shared, parts))


def shared_arguments(function: Any) -> set[int]:
    """Return the places of the arguments that a function may return, in whole or in part."""
    if not isinstance(getattr(function, "py_func", function), FunctionType) or function in NEW:
        return set()
    written, tree = parsed(function)
    names = [a.arg for a in tree.args.args]
    origins = {name: {i} for i, name in enumerate(names)}  # variable -> arguments of which it may be a part

    def shared(value: ast.expr) -> set[int]:
        parts = list[ast.expr]()
        match value:
            case ast.Name(id=name):
                return origins.get(name, set())
            case ast.Subscript() | ast.Attribute():
                parts = [value.value]
            case ast.IfExp():
                parts = [value.body, value.orelse]
            case ast.Tuple():
                parts = value.elts
            case ast.Call(func=ast.Name(id=name), args=arguments):
                parts = [arguments[i] for i in shared_arguments(written.__globals__.get(name))]
            case ast.Call(func=ast.Attribute(value=ast.Name(id=module), attr=name), args=arguments):
                parts = [arguments[i] for i in shared_arguments(getattr(written.__globals__.get(module), name, None))]
        return set().union(*map(shared, parts))

    inside, before = list(ast.walk(tree)), {}
    while before != origins:
        before = dict(origins)
        for one in inside:
            if isinstance(one, ast.Assign):
                origins |= {name: origins.get(name, set()) | shared(one.value) for name in assigned(one)}
    return set().union(*(shared(n.value) for n in inside if isinstance(n, ast.Return) and n.value is not None))


def assigned(node: ast.AST) -> set[str]:
    """Return the names in the targets of an assignment or of a loop; none of other code."""
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    return names_in(t for t in targets if t is not None and not isinstance(t, ast.Subscript))


def root(node: ast.expr) -> str:
    """Return the name of the array whose elements an expression names, or an empty text."""
    while isinstance(node, ast.Subscript):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


def shape(kind: str) -> list[str]:
    """Return the dimensions of a kind."""
    return re.findall(r"\[(\w+)\]", kind)


def base(kind: str) -> str:
    """Return the kind of the elements."""
    return kind.partition("[")[0]


def declared(kind: str, name: str) -> str:
    """Return the declaration of an array, whose numbers lie in one row."""
    return f"{TYPES[base(kind)]} {name}[{' * '.join(shape(kind))}];"


def array_at(pointer: str, kind: str, offset: str = "") -> Value:
    """Return the array at a pointer, from an offset on."""
    place = ROW if len(shape(kind)) == 1 else f"{ROW} * {shape(kind)[-1]} + {COLUMN}"
    moved = f"{pointer} + {offset.removesuffix(' + ')}" if offset else pointer
    return Value(f"{pointer}[{offset}{place}]", kind, ATOM, moved)
