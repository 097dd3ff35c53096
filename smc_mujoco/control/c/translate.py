"""A law's Python as one file of C: its functions, the constants they use, and what both need."""

import ast
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.control.c.functions import Function, parsed
from smc_mujoco.control.c.values import POINTERS, TYPES, Array, Value, plain, refuse
from smc_mujoco.control.c.variables import TAKEN

BODIES = {"least": "b < a ? b : a", "most": "b > a ? b : a", "size": "a < 0 ? -a : a"}  # as Python's min, max and abs


class Translated(NamedTuple):
    """What the C of a law consists of."""

    constants: list[str]
    functions: list[str]
    slots: int  # numbers of memory that it uses


def translate(law: Any, single: bool) -> Translated:
    """The function (y, gains, memory) -> (u, s) of a law as smc_law; `single` where smc_real is float.

    Raises:
      Untranslatable: with what is not for C.
    """
    program = Program(single)
    main = Function(program, law, POINTERS, {}, law=True)
    functions = [main.text("smc_law")]
    for text in reversed(program.functions):  # but for those that a wider kind has taken the place of
        if any(re.search(rf"\b{_named(text)}\(", other) for other in functions):
            functions.insert(0, text)
    arrays = [a for name, a in program.arrays.items() if any(f"{name}[" in other for other in functions)]
    return Translated(arrays, functions, max(main.slots, program.slots))


def _named(text: str) -> str:
    """The name of the function that a text begins with."""
    found = re.match(r"[^(]*?(\w+)\(", text)
    return found[1] if found else ""


class Program:
    """The file that a law becomes part of."""

    def __init__(self, single: bool):
        self.single = single
        self.arrays: dict[str, str] = {}
        self.functions: list[str] = []
        self.made: dict[tuple, tuple[str, Function | None]] = {}
        self.taken: set[str] = {"smc_law", "y", "gains", "memory", *TAKEN}
        self.slots = 0

    def helper(self, name: str, kind: str) -> str:
        """The name of a small function of numbers of a kind: `least`, `most`, `size`, or a power `raised_3`."""
        key = (name, kind)
        if key not in self.made:
            self.made[key] = f"{name}_{kind}" if "raised" not in name or kind != "real" else name, None
            body = BODIES.get(name) or _product(int(name.rpartition("_")[2]))
            of, two = TYPES[kind], name in ("least", "most")
            head = f"static {of} {self.made[key][0]}({of} a{f', {of} b' if two else ''})"
            self.taken.add(self.made[key][0])
            self.functions.append(f"{head}\n{{\n    return {body};\n}}")
        return self.made[key][0]

    def array(self, name: str, values: Any) -> Array:
        """A constant array: of the smallest whole numbers that hold it, or of smc_real."""
        data, name = np.asarray(values), plain(name)
        if data.ndim != 1 or data.dtype.kind not in "if":
            raise refuse(None, f"the constant {name}, which is no row of numbers,")
        kind, of = "real", "smc_real"
        items = [f"{float(v)!r}{'f' * self.single}" for v in data]
        if data.dtype.kind == "i":
            kind, most = "int", int(np.abs(data).max(initial=0))
            if most >= 2**31:
                raise refuse(None, f"the constant {name}, beyond 32 bits,")
            of, items = "int16_t" if most < 2**15 else "int32_t", [str(int(v)) for v in data]
        content = f"[{len(items)}] = {{\n{rows(items)}\n}};"
        for taken, text in self.arrays.items():
            if text.endswith(content) and f" {of} " in text:
                return Array(taken, kind)
        name = self.free(name)
        self.arrays[name] = f"static const {of} {name}{content}"
        return Array(name, kind)

    def function(
        self, function: Any, arguments: Sequence[Value], nodes: Sequence[ast.expr]
    ) -> tuple[str, list[str], list[Value]]:
        """A function that another calls, once for each kind of its arguments, and for each literal exponent."""
        written, tree = parsed(function)
        constants = {
            name: node.value
            for name, node in zip([a.arg for a in tree.args.args], nodes, strict=False)
            if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and _exponent(tree, name)
        }
        kinds = [v.kind for v in arguments]
        key = (written, tuple(kinds), tuple(constants.items()))
        if key not in self.made:
            self.made[key] = "", None  # while it is under way
            made = Function(self, function, kinds, constants)
            name = self.free(plain(tree.name))
            self.made[key] = name, made
            self.slots = max(self.slots, made.slots)
            self.functions.append(made.text(name))
        name, made = self.made[key]
        if made is None:
            raise refuse(None, f"{tree.name}, which calls itself,")
        names = [a.arg for a in tree.args.args]
        return name, made.results, [v for n, v in zip(names, arguments, strict=True) if n not in constants]

    def free(self, name: str) -> str:
        """A name that no other function of the file has."""
        found, count = name, 1
        while found in self.taken:
            count += 1
            found = f"{name}_{count}"
        self.taken.add(found)
        return found


def _product(exponent: int) -> str:
    """a to a whole power as numba multiplies it out: squares, from the lowest bit."""
    result, square = "", "a"
    while exponent:
        if exponent & 1:
            result = f"{result} * {square}" if result else square
        exponent >>= 1
        square = f"({square} * {square})" if square != "a" else "(a * a)"
    return re.sub(r"^\((.*)\)$", r"\1", result) if result.count("(") == 1 and result.startswith("(") else result


def _exponent(tree: ast.FunctionDef, name: str) -> bool:
    """Whether a function raises anything to its argument's power."""
    powers = [n for n in ast.walk(tree) if isinstance(n, ast.BinOp) and isinstance(n.op, ast.Pow)]
    return any(isinstance(n.right, ast.Name) and n.right.id == name for n in powers)


def rows(items: Sequence[str]) -> str:
    """Items in lines of at most 100 letters."""
    lines, line = [], "   "
    for item in items:
        if len(line) + len(item) > 98:
            lines, line = [*lines, line], "   "
        line += f" {item},"
    return "\n".join([*lines, line])
