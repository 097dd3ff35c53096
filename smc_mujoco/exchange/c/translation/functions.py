"""Whole functions, and calls among them.

What does not fit into an expression, such as a call that gives an array, becomes a line before it.
A function that returns arrays or several numbers writes them to pointers.
"""

import ast
import re
from collections.abc import Mapping, Sequence
from typing import Any

from smc_mujoco.common.frozen import frozen
from smc_mujoco.control.component import Component
from smc_mujoco.exchange.c.translation.c_text import Program
from smc_mujoco.exchange.c.translation.python_source import PythonSource, refuse
from smc_mujoco.exchange.c.translation.statements import Statements
from smc_mujoco.exchange.c.translation.values import Kind, Value, gathered


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
    memory = Kind("memory", tuple(slots))
    kinds = Kind("y"), Kind("gains"), memory
    texts = [
        Function(program, PythonSource(component.function), kinds, entry=True).text(program.symbol)
    ]
    for name, (function, kinds) in others.items():
        texts.append(
            Function(program, PythonSource(function), kinds).text(name).removeprefix("static ")
        )
    for name, text in reversed(program.texts.items()):
        if re.search(rf"\b{name}\b", "".join(texts)):  # earlier, narrower drafts are called no more
            texts.insert(0, text)
    return program.slots, "\n\n".join(texts)


class Function(Statements):
    """One function in C, whose lines are written until no variable's kind widens."""

    def __init__(
        self,
        program: Program,
        source: PythonSource,
        kinds: Sequence[Kind],
        constants: Mapping[str, float] = frozen({}),
        entry: bool = False,
    ):
        source.check(len(kinds), entry)
        super().__init__(program, source, kinds, constants, entry)
        before: Any = None
        while before != (self.kinds, self.results):
            before = dict(self.kinds), list(self.results)
            self.begin()
            self.block(source.tree.body)
        for sources, node in self.copies:
            if sources & self.changed:
                what = "an array, which shares its numbers with another name: write .copy()"
                raise refuse(node, f"{what} behind it,")

    def results_of(self, call: ast.Call) -> Value:
        """Call a function of Python. Return its result, or a tuple of them."""
        function = self.callee(call)
        values = [*map(self.argument, call.args)]
        literals = [*map(self.constant, call.args)]
        name, callee = self.called(function, values, literals)
        self.check_changes(call, values, callee)
        arguments = []
        for parameter in callee.parameters:
            value = values[callee.source.position[parameter]]
            arguments.append(value.pointer or value.text)
        if callee.returns_scalar():
            value = Value(f"{name}({', '.join(arguments)})", callee.results[0])
            if callee.changed & callee.parameters.keys():
                return self.stored(value)
            return value
        sources = frozenset[str]()
        for i in callee.returned:
            sources |= values[i].sources
        items = self.results_in(callee, arguments, sources)
        self.lines.append(f"{name}({', '.join(arguments)});")
        return items[0] if len(items) == 1 else gathered(items, callee.fields)

    def results_in(
        self, made: "Function", arguments: list[str], sources: frozenset[str]
    ) -> list[Value]:
        """Return new variables for the results of a call, and add pointers to them to its
        arguments. Numbers of one kind are in one array.
        """
        kinds = made.results
        alike = len(kinds) > 1 and {*kinds} == {Kind(kinds[0].sort)}
        if alike:
            own_kind = Kind(kinds[0].sort, (len(kinds),), made.fields)
            array = self.temporary(own_kind)
            arguments.append(array.pointer)
            for i in range(1, len(kinds)):
                arguments.append(f"{array.pointer} + {i}")
            return [array._replace(sources=sources)]
        items = []
        for kind in kinds:
            place = self.temporary(kind)
            arguments.append(place.pointer or f"&{place.text}")
            if kind.shape:
                place = place._replace(sources=sources)
            items.append(place)
        return items

    def called(
        self, function: Any, values: Sequence[Value], literals: Sequence[float | None]
    ) -> tuple[str, "Function"]:
        """Return the name in C of a function for arguments of the kinds of some values, and it.

        A literal exponent is not an argument in C: each exponent gives its own function.
        """
        program = self.program
        source = PythonSource(function)
        exponents = source.exponents()
        constants = {}
        for name, number in zip(source.arguments, literals, strict=False):
            if name in exponents and number is not None:
                constants[name] = number
        kinds = tuple(value.kind for value in values)
        key = source.written, kinds, tuple(constants.items())
        if key not in program.functions:
            program.functions[key] = None
            callee = Function(program, source, kinds, constants)
            own_name = program.name_of(source.tree.name, callee)
            program.functions[key] = own_name, callee
        if (translated := program.functions[key]) is None:
            raise refuse(None, f"{source.tree.name}, which calls itself,")
        return translated

    def check_changes(self, call: ast.Call, values: list[Value], made: "Function") -> None:
        """Refuse a call that changes an array in a way that C would not."""
        for name in made.changed & made.parameters.keys():
            i = made.source.position[name]
            self.check_argument(call.args[i], values[i])
            siblings = values[:i] + values[i + 1 :]
            if any(values[i].sources & sibling.sources for sibling in siblings):
                raise refuse(call, "a call that gets an array twice and changes it")
            if self.reads_beside(call, values[i]):
                what = "a call that changes an array which the rest of the line reads"
                raise refuse(call, what)

    def check_argument(self, node: ast.expr, value: Value) -> None:
        """Refuse an argument that a function cannot change."""
        if isinstance(node, ast.Name | ast.Subscript | ast.Attribute):
            if not self.changeable(node).pointer:
                raise refuse(node, "a part of a matrix, which a function changes,")
        elif value.sources:
            raise refuse(node, "a result that shares its numbers, which a function changes,")

    def reads_beside(self, call: ast.Call, value: Value) -> bool:
        """Return whether the line of a call reads an array outside of it.

        C does not say which comes first.
        """
        within = set(ast.walk(call))
        targets = getattr(self.line, "targets", [])
        for part in ast.iter_child_nodes(self.line):
            if isinstance(part, ast.stmt) or part in targets:
                continue
            for read in ast.walk(part):
                array = self.names.get(getattr(read, "id", ""))
                if array and read not in within and array.sources & value.sources:
                    return True
        return False
