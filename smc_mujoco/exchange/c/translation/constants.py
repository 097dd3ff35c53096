"""What an expression is before the law runs: a literal number, a length, a global name."""

import ast
import builtins
from types import ModuleType
from typing import Any

from smc_mujoco.exchange.c.translation.c_text import Lines
from smc_mujoco.exchange.c.translation.values import Value


class Constants(Lines):
    """The lines of a function that read what is known before it runs."""

    def value(self, node: ast.expr) -> Value:
        """Translate an expression: a number, an array, a tuple, or one of the law's arguments."""
        raise NotImplementedError

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
            case ast.Name(id=name) if assigned := self.source.assignments.get(name):
                match assigned:
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
            builtin = getattr(builtins, node.id, None)
            return self.globals.get(node.id, builtin)
        if isinstance(node, ast.Attribute):
            module = self.resolve(node.value)
            if isinstance(module, ModuleType):
                return getattr(module, node.attr, None)
        return None
