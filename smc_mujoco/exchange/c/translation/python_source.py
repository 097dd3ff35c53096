"""The Python that is translated: its syntax tree, its names, and what is refused in it."""

import ast
import collections
import inspect
import itertools
import textwrap
import threading
from collections.abc import Iterable, Sequence
from types import FunctionType
from typing import Any

from smc_mujoco.common.aliases import Fields
from smc_mujoco.common.errors import ScenarioError, shown, unknown

# before Python 3.11.8 two threads must not parse at once (gh-106905)
PARSING_LOCK = threading.Lock()
NEEDS_C = " has no translation into C: write it with arithmetic, if, for and math's functions"


class Untranslatable(ScenarioError):
    """A piece of Python has no translation into C."""


class PythonSource:
    """One function of Python: its tree, and what it does with its names."""

    def __init__(self, function: Any):
        self.written, self.tree = parsed(function)
        self.globals = around(self.written)
        self.arguments = [argument.arg for argument in self.tree.args.args]
        self.position = {argument: i for i, argument in enumerate(self.arguments)}
        nodes = inside(self.tree.body)
        self.gives = any(isinstance(node, ast.Return) for node in nodes)
        self.names = {*self.arguments}
        for node in nodes:
            if isinstance(node, ast.Name):
                self.names.add(node.id)
        self.assignments: dict[str, list[ast.AST]] = collections.defaultdict(list)
        self.read = set[str]()  # names that it reads: others need no variable
        for node in nodes:
            for name in assigned(node):
                self.assignments[name].append(node)
            if isinstance(node, ast.AugAssign):
                self.read |= assigned(node)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                self.read.add(node.id)
        loops = []
        for node in nodes:
            if isinstance(node, ast.For | ast.While):
                loops.append(node)
        self.in_loops = {*inside(loops)}

    def check(self, count: int, gives: bool) -> None:
        """Refuse another number of arguments, and a path without a return where it gives a
        value.
        """
        if len(self.arguments) != count:
            raise refuse(None, f"{self.tree.name} with its arguments")
        if (gives or self.gives) and not returns(self.tree.body):
            raise refuse(None, f"{self.tree.name}, which does not end in a return,")

    def exponents(self) -> set[str]:
        """Return the names that are exponents of powers."""
        names = set()
        for node in inside(self.tree.body):
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
                names.add(getattr(node.right, "id", ""))
        return names


def parsed(function: Any) -> tuple[FunctionType, ast.FunctionDef]:
    """Return a Python function, compiled or not, and its syntax tree."""
    written = in_python(function)
    name = getattr(function, "__name__", function)
    if written is None:
        raise refuse(None, f"{name}, which is not a Python function,")
    try:
        with PARSING_LOCK:
            text = textwrap.dedent(inspect.getsource(written))
            (tree,) = ast.parse(text).body
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
    names = set()
    for part in inside(targets):
        if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
            names.add(part.id)
    return names


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


def check_law_name(what: str, name: str, names: Iterable[str]) -> None:
    """Refuse a name that a law cannot read."""
    if name not in names:
        raise Untranslatable(f"it reads an {unknown(what, name, names)}")


def refuse(node: ast.AST | None, what: str) -> Untranslatable:
    """Return the error for a piece of Python without translation."""
    if node is not None:
        what += f" ({shown(ast.unparse(node))[1:-1]})"
    return Untranslatable(what + NEEDS_C)
