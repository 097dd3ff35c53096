"""Statements: assignments, conditions, loops and returns."""

import ast
from collections.abc import Sequence

from smc_mujoco.exchange.c.translation.c_text import joined
from smc_mujoco.exchange.c.translation.expressions import Expressions
from smc_mujoco.exchange.c.translation.python_source import inside, refuse
from smc_mujoco.exchange.c.translation.values import (
    INT,
    JOINTS,
    REAL,
    UNARY,
    WIDTHS,
    Kind,
    Value,
    array_at,
    wider,
)


class Statements(Expressions):
    """The lines of a function, a statement after the other."""

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
                expression = ast.BinOp(target, node.op, node.value)
                assigned = self.value(expression)
                if assigned.kind.shape and isinstance(target, ast.Name):  # changes the array itself
                    target = ast.Subscript(target, ast.Slice())
                self.store(target, assigned)
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
        assigned = self.source.assignments[variable]
        if {*inside(node.body)} & {*assigned}:
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
            last = self.stored(last)
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
        self.fields = value.kind.fields or ()
        self.results = self.results or [item.kind._replace(stride="1") for item in values]
        if len(values) != len(self.results):
            raise refuse(node, "another number of results")
        places = self.results_at()
        for i, item in enumerate(values):
            self.results[i] = wider(self.results[i], item.kind)
            for source in item.sources:
                name = source.partition(".")[0]
                if name in self.parameters:
                    self.returned.add(self.source.position[name])
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
        if not self.entry and self.returns_scalar():
            return []
        places = []
        for i, kind in enumerate(self.results):
            if not self.entry and kind.shape:
                places.append(array_at(f"out_{i}", kind))
            elif not self.entry:
                places.append(Value(f"*out_{i}", kind))
            elif kind.shape:
                joints = ("", JOINTS)[i]
                places.append(array_at("out", kind, joints))
            else:
                places.append(Value(f"out[{i}]", kind))
        return places

    def assign(self, target: ast.expr, node: ast.expr) -> None:
        """Assign a value to one target, or to a tuple of them."""
        if not isinstance(target, ast.Tuple | ast.List):
            self.store(target, self.number(node))
            return
        targets = target.elts
        value = self.value(node)
        values = value.elements()
        if value.kind.sort == "memory":
            self.program.claim(node, len(targets))
            values = values[: len(targets)]
        if len(values) != len(targets):
            raise refuse(node, f"{len(targets)} names for {len(values)} numbers")
        held = []  # Python computes all values before the first assignment
        written = set[str]()
        for part, value in zip(targets, values, strict=True):
            if self.origins(value.text) & written:
                value = self.stored(value)  # noqa: PLW2901
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
        if isinstance(target, ast.Name) and target.id not in self.source.read:
            return
        if isinstance(target, ast.Name):
            place = self.destination(target, value)
        else:
            place = self.changeable(target)
            of_place = Kind(place.kind.sort)
            if wider(of_place, Kind(value.kind.sort)).sort != place.kind.sort:
                raise refuse(target, "real numbers for elements of an array of whole numbers")
            if value.kind.shape not in ((), place.kind.shape):
                raise refuse(target, f"an array of shape {value.kind.shape} for one of another")
        if place is None or place.text == value.text:
            return
        if place.kind.shape:  # elements that it reads must not be those that the loop has changed
            read = joined(value.items or (value,))
            rest = read.replace(place.text, "")
            if self.origins(rest) & self.origins(place.text):
                value = self.stored(value)
        self.fill(place, value)

    def destination(self, target: ast.Name, value: Value) -> Value | None:
        """Return the place of a name to which a value is assigned; None if it becomes a pointer."""
        name = target.id
        kind = value.kind._replace(stride="1")
        before = self.kinds.get(name)
        if name in self.constants or (before or kind).sort not in WIDTHS or kind.sort not in WIDTHS:
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
        self.names[name] = self.variable(name)
        if value.sources and kind.shape and kind.fields is None:
            self.copies.append((value.sources | {name}, target))
            self.names[name] = self.names[name]._replace(sources=value.sources | {name})
        return self.names[name]
