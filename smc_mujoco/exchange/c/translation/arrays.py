"""Arrays in C: their elements, their parts, and loops over them.

An assignment to an array is a loop over its elements, with the operations of numba in the same
order.

Python's names of arrays may share numbers. A name that is bound once to an array that lasts, or to
a part of it, as in `w = memory[:, 0]`, is a pointer into it. All others are copies. So an array
that the function changes must not share its numbers with a copy; such code is refused.
"""

import ast
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from smc_mujoco.exchange.c.translation.constants import Constants
from smc_mujoco.exchange.c.translation.python_source import refuse, root
from smc_mujoco.exchange.c.translation.values import (
    COLUMN,
    INT,
    PRODUCT,
    ROW,
    SLOTS,
    SUM,
    WIDTHS,
    Kind,
    Value,
    literal,
)

FILLED = {np.zeros: 0.0, np.empty: 0.0, np.ones: 1.0}


class Arrays(Constants):
    """The lines of a function that compute arrays."""

    def number(self, node: ast.expr) -> Value:
        """Translate an expression that is a number, an array, or a tuple of these."""
        value = self.value(node)
        if value.kind.sort not in WIDTHS and not value.kind.shape:
            raise refuse(node, f"{value.text or 'nothing'} as a number")
        return value

    def stored(self, value: Value) -> Value:
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
            if value.kind.sort == "memory":
                self.program.claim(node, self.program.component.memory)
                real = value.kind._replace(sort="real")
                values[i] = value._replace(kind=real)
            elif not value.kind.shape and "(" in value.text:
                values[i] = self.stored(value)
        return values, shapes.pop()

    def argument(self, node: ast.expr) -> Value:
        """Translate an argument of a function: a number, an array as a pointer, or y or gains."""
        value = self.value(node)
        if value.kind.shape and not value.pointer:  # its numbers are not stored
            value = self.stored(value)
        return value

    def filled(self, function: Any, node: ast.Call) -> Value:
        """Return an array that is filled with one number."""
        (size,) = node.args
        parts = getattr(size, "elts", [size])
        shape = tuple(self.whole(part) or 0 for part in parts)
        if 0 in shape:
            raise refuse(node, "a length that is not known before the law runs")
        value = literal(FILLED[function], self.program.single, node)
        return value._replace(kind=Kind("real", shape))

    def _subscript(self, node: ast.Subscript) -> Value:
        owner = self.value(node.value)
        shape = owner.kind.shape
        places = [node.slice]
        if isinstance(node.slice, ast.Tuple):
            places = list(node.slice.elts)
        if not shape or len(places) > len(shape):
            raise refuse(node, "an element")
        missing = len(shape) - len(places)
        places += [ast.Slice()] * missing
        if owner.items:
            number = self.index(node, places[0], len(owner.items), False)
            return owner.items[int(number.text)]
        memory = owner.kind.sort == "memory"
        strides = [owner.kind.stride]
        if len(shape) == 2:
            strides = [str(shape[1]), "1"]
            if memory:
                strides[0] = SLOTS
        tokens = (ROW, COLUMN)[: len(shape)]
        element = owner
        dimensions = list[int]()
        stride = "1"
        for token, place, size, step in zip(tokens, places, shape, strides, strict=True):
            slots = memory and token == tokens[-1]
            if isinstance(place, ast.Slice):
                part = self.part(node, place, size, slots)
                token_kept = Value(tokens[len(dimensions)], INT)
                if part.start:
                    token_kept = Value(f"{token_kept.text} + {part.start}", INT, SUM)
                first = Value(str(part.start), INT)
                element = indexed(element, token, token_kept, first, step)
                dimensions.append(len(part))
                stride = step
            else:
                index = self.index(node, place, size, slots)
                element = indexed(element, token, index, index, step)
        if not dimensions:
            return Value(element.text, owner.kind.number, owner.level)
        if not owner.pointer or (len(dimensions) == 2 and (memory or dimensions[1] != shape[1])):
            element = element._replace(pointer="")  # its numbers do not lie in a row
            stride = "1"
        kind = Kind(owner.kind.number.sort, tuple(dimensions), owner.kind.fields and (), stride)
        return element._replace(kind=kind)

    def part(self, node: ast.Subscript, place: ast.Slice, size: int, slots: bool) -> range:
        """Return the indices of a slice of a dimension. `slots`: whether it is the memory's."""
        bounds = []
        for bound in (place.lower, place.upper):
            bounds.append(self.whole(bound))
            if bound is not None and bounds[-1] is None:
                raise refuse(node, "a length that is not known before the law runs")
        indices = range(size)[slice(*bounds)]
        if place.step or not indices:
            raise refuse(node, "a part of an array that is empty or has a step")
        if slots:
            self.program.claim(node, indices.stop)
        return indices

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

    def is_view(self, name: str, value: Value) -> bool:
        """Return whether a name is always the same array, or part of one: then it is a pointer."""
        if not value.pointer or value.kind.fields is not None or len(value.sources) != 1:
            return False
        (array,) = value.sources
        first = re.findall(r"\w+", value.pointer)[0]
        same = [n for n, variable in self.names.items() if variable.sources == value.sources]
        if first not in map(self.c_name, same):
            return False
        assigned = self.source.assignments[array]
        lasts = array in self.parameters or (
            len(assigned) == 1 and assigned[0] not in self.source.in_loops
        )
        return lasts and len(self.source.assignments[name]) == 1 and name not in self.parameters

    def changeable(self, target: ast.expr) -> Value:
        """Return elements that the function changes: of its own arrays, or of an argument."""
        array = self.names.get(root(target))
        if array is None or not array.kind.shape or array.kind.fields is not None:
            raise refuse(target, "an assignment to this, which is no array of the function's own,")
        self.changed |= array.sources
        return self.value(target)


def indexed(array: Value, token: str, index: Value, start: Value, stride: str) -> Value:
    """Return an array with an index in place of a token, and the pointer to where it starts."""
    text, *after = re.split(rf"(\[{token}\]|{token})", array.text)
    values = after[1::2]
    for token_text, rest in zip(after[::2], values, strict=True):
        text += f"[{index.text}]" if token_text[0] == "[" else index.within(PRODUCT)
        text += rest
    offset = f" + {start.within(PRODUCT)} * {stride}"
    if stride == "1":
        offset = f" + {start.within(SUM)}"
    if start.text == "0":
        offset = ""
    return array._replace(text=text, pointer=array.pointer + offset)
