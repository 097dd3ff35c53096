"""Functions of Python as functions of C: assignments, if, for, while, and what they return."""

import ast
import inspect
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from types import FunctionType
from typing import Any

from smc_mujoco.control.c.calls import Unit
from smc_mujoco.control.c.expressions import OPERATORS, Expressions
from smc_mujoco.control.c.values import TYPES, Value, refuse, wider
from smc_mujoco.control.c.variables import Variables, named, stored

GIVEN = {"y": "const smc_measurement *", "gains": "const smc_real *", "memory": "smc_real *"}


def parsed(function: Any) -> tuple[FunctionType, ast.FunctionDef]:
    """A Python function, compiled or not, as it was written."""
    written = getattr(function, "py_func", function)
    if not isinstance(written, FunctionType):
        raise refuse(None, f"{getattr(function, '__name__', function)}, which is no function of Python's,")
    try:
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(written))).body
    except (OSError, SyntaxError, ValueError):
        raise refuse(None, f"{written.__name__}, whose source is not at hand,") from None
    if not isinstance(tree, ast.FunctionDef):
        raise refuse(tree, "what is no def")
    return written, tree


def known(function: FunctionType) -> dict[str, Any]:
    """What a function's global names, and those of functions around it, stand for."""
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    return dict(function.__globals__) | {name: cell.cell_contents for name, cell in cells}


class Function:
    """One function in C: `parameters` are its arguments' kinds, `constants` literal numbers that it was called with.

    A law's results go to out[0] and out[1], one result is returned, several go to pointers.
    """

    def __init__(
        self, unit: Unit, function: Any, parameters: Sequence[str], constants: Mapping[str, float], law: bool = False
    ):
        self.unit, self.law = unit, law
        self.function, self.tree = parsed(function)
        self.variables = Variables(self.tree, parameters, constants, law)
        self.results: list[str] = []
        self.translate()

    def translate(self) -> None:
        """Translate until the kinds of variables and results no longer widen."""
        before = None
        while before != (self.variables.kinds, self.results):
            before = dict(self.variables.kinds), list(self.results)
            self.variables.restart()
            names, constants = self.variables.names, self.variables.constants
            self.expressions = Expressions(self.unit, names, constants, known(self.function))
            self.lines = list(self.block(self.tree.body, "    ", top=True))

    @property
    def slots(self) -> int:
        """Numbers of memory that it uses."""
        return self.expressions.slots

    def text(self, name: str) -> str:
        """The whole function under a name of the file's."""
        lines = self.variables.opening()
        lines += [piece for line in self.lines for piece in folded(line)]
        return "\n".join([self.head(name), "{", *lines, "}"])

    def head(self, name: str) -> str:
        """The declaration, without a semicolon."""
        if self.law:
            return f"int {name}(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out)"
        given = [
            f"{GIVEN.get(kind) or TYPES[kind] + ' '}{self.variables.name(n)}"
            for n, kind in self.variables.kinds.items()
            if n in self.variables.parameters
        ]
        if len(self.results) == 1:
            return f"static {TYPES[self.results[0]]} {name}({', '.join(given) or 'void'})"
        given += [f"{TYPES[kind]} *out_{i}" for i, kind in enumerate(self.results)]
        return f"static void {name}({', '.join(given)})"

    def block(self, body: Sequence[ast.stmt], indent: str, top: bool = False) -> Iterator[str]:
        """The statements of a block."""
        for node in body:
            match node:
                case ast.Expr(value=ast.Constant(value=str())) | ast.Pass():
                    pass
                case ast.Assign(targets=[target]):
                    yield from self.assign(target, node.value, indent, top)
                case ast.AnnAssign(target=target, value=ast.expr() as value):
                    yield from self.assign(target, value, indent, top)
                case ast.AugAssign():
                    yield from self.augment(node, indent)
                case ast.If():
                    yield from self.branch(node, indent)
                case ast.For(target=ast.Name(), orelse=[]):
                    yield from self.loop(node, indent)
                case ast.While(orelse=[]):
                    yield f"{indent}while ({self.expressions.truth(node.test)}) {{"
                    yield from self.block(node.body, indent + "    ")
                    yield f"{indent}}}"
                case ast.Break() | ast.Continue():
                    yield f"{indent}{ast.unparse(node)};"
                case ast.Return(value=ast.expr() as value):
                    yield from self.give(value, indent)
                case _:
                    raise refuse(node, f"{type(node).__name__.lower()}")

    def assign(self, target: ast.expr, value: ast.expr, indent: str, top: bool) -> Iterator[str]:
        """One target, or a tuple of them."""
        targets = target.elts if isinstance(target, ast.Tuple | ast.List) else None
        if targets is None:
            found = self.expressions.numeric(value)
            yield f"{indent}{self.home(target, found.kind, top)} = {found.text};"
            yield from self.variables.silent([target], indent, top)
            return
        values = self.parts(value, len(targets))
        if values is not None and clash(targets, values):
            found = [self.expressions.numeric(v) for v in values]
            yield f"{indent}{{"
            yield from (f"{indent}    const {TYPES[v.kind]} new_{i} = {v.text};" for i, v in enumerate(found))
            names = [self.home(t, v.kind, top=False) for t, v in zip(targets, found, strict=True)]
            yield from (f"{indent}    {name} = new_{i};" for i, name in enumerate(names))
            yield f"{indent}}}"
        elif values is not None:
            for one, part in zip(targets, values, strict=True):
                yield from self.assign(one, part, indent, top)
        elif isinstance(value, ast.IfExp):
            yield f"{indent}if ({self.expressions.truth(value.test)}) {{"
            yield from self.assign(target, value.body, indent + "    ", top=False)
            yield f"{indent}}} else {{"
            yield from self.assign(target, value.orelse, indent + "    ", top=False)
            yield f"{indent}}}"
        else:
            yield from self.unpack(targets, value, indent, top)

    def parts(self, value: ast.expr, count: int) -> Sequence[ast.expr] | None:
        """The expressions of a tuple, or memory element by element; None for what gives a tuple otherwise."""
        if isinstance(value, ast.Tuple | ast.List) and len(value.elts) == count:
            return value.elts
        if isinstance(value, ast.Name) and self.variables.kinds.get(value.id) == "memory":
            return [ast.Subscript(value, ast.Constant(i), ast.Load()) for i in range(count)]
        return None

    def unpack(self, targets: Sequence[ast.expr], value: ast.expr, indent: str, top: bool) -> Iterator[str]:
        """Targets of a call with several results."""
        if not isinstance(value, ast.Call):
            raise refuse(value, "a tuple that is no call")
        given = [self.expressions.value(a) for a in value.args]
        name, kinds, passed = self.unit.function(self.expressions.callee(value), given, value.args)
        if len(kinds) != len(targets):
            raise refuse(value, f"{len(targets)} names for {len(kinds)} results")
        homes = []
        for target, kind in zip(targets, kinds, strict=True):
            *declared, home = self.home(target, kind, top).rsplit(" ", 1)
            if declared:
                yield f"{indent}{declared[0]} {home};"
            homes.append(f"&{home}")
        yield f"{indent}{name}({', '.join([*(v.text for v in passed), *homes])});"
        yield from self.variables.silent(targets, indent, top)

    def home(self, target: ast.expr, kind: str, top: bool) -> str:
        """What a target is in C, after its type where this declares it."""
        if isinstance(target, ast.Name):
            return self.variables.target(target.id, kind, top)
        if not isinstance(target, ast.Subscript) or (value := self.expressions.value(target)).kind != "real":
            raise refuse(target, "an assignment to this")
        return value.text

    def augment(self, node: ast.AugAssign, indent: str) -> Iterator[str]:
        """target op= value."""
        whole = ast.BinOp(ast.parse(ast.unparse(node.target), mode="eval").body, node.op, node.value)
        found = self.expressions.numeric(whole)
        target = self.home(node.target, found.kind, top=False)
        if type(node.op) in OPERATORS and found.kind in ("real", "single"):
            sign, value = OPERATORS[type(node.op)][0], self.expressions.numeric(node.value)
            yield f"{indent}{target} {sign}= {value.text};"
        else:
            yield f"{indent}{target} = {found.text};"

    def branch(self, node: ast.If, indent: str, word: str = "if") -> Iterator[str]:
        """if, elif, else."""
        yield f"{indent}{word} ({self.expressions.truth(node.test)}) {{"
        yield from self.block(node.body, indent + "    ")
        if len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If):
            yield from self.branch(node.orelse[0], indent, "} else if")
            return
        if node.orelse:
            yield f"{indent}}} else {{"
            yield from self.block(node.orelse, indent + "    ")
        yield f"{indent}}}"

    def loop(self, node: ast.For, indent: str) -> Iterator[str]:
        """for i in range(...), with a constant step."""
        call = node.iter
        assert isinstance(node.target, ast.Name)
        if not (isinstance(call, ast.Call) and ast.unparse(call.func) == "range" and 1 <= len(call.args) <= 3):
            raise refuse(node.iter, "a loop over anything but a range")
        if stored(node.body) & named([node.target, *call.args]):
            raise refuse(node.iter, "a loop that changes its own variable or range")
        steps = self.expressions.constant(call.args[2]) if len(call.args) == 3 else 1
        bounds = [self.expressions.numeric(a) for a in call.args[:2]]
        if any(b.kind != "int" for b in bounds) or steps not in (1, -1):
            raise refuse(node.iter, "a range of other than whole numbers one apart")
        name = self.variables.counter(node.target.id)
        first, last = bounds if len(bounds) == 2 else (Value("0", "int"), bounds[0])
        sign, change = ("<", "++") if steps == 1 else (">", "--")
        yield f"{indent}for (int32_t {name} = {first.text}; {name} {sign} {last.within(2)}; {name}{change}) {{"
        yield from self.block(node.body, indent + "    ")
        yield f"{indent}}}"
        del self.variables.names[node.target.id]

    def give(self, value: ast.expr, indent: str) -> Iterator[str]:
        """return."""
        found = [self.expressions.numeric(v) for v in (value.elts if isinstance(value, ast.Tuple) else [value])]
        self.results = self.results or [v.kind for v in found]
        if len(found) != len(self.results) or (self.law and len(found) != 2):
            raise refuse(value, "another number of results")
        self.results = [wider(one, v.kind) for one, v in zip(self.results, found, strict=True)]
        if self.law:
            yield from (f"{indent}out[{i}] = {v.text};" for i, v in enumerate(found))
            yield f"{indent}return 0;"
        elif len(found) == 1:
            yield f"{indent}return {found[0].text};"
        else:
            yield from (f"{indent}*out_{i} = {v.text};" for i, v in enumerate(found))
            yield f"{indent}return;"


def clash(targets: Sequence[ast.expr], values: Sequence[ast.expr]) -> bool:
    """Whether a value reads a target that stands before it, so that one after the other is not at once."""
    changed: set[str] = set()
    for target, value in zip(targets, values, strict=True):
        if changed & named([value]):
            return True
        changed |= named([target])
    return False


def folded(line: str) -> list[str]:
    """A line in several where it is long."""
    indent = line[: len(line) - len(line.lstrip())] + " " * 8
    return textwrap.wrap(line, 110, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
