"""What laws need and promise, to choose laws by.

    suitable(["continuous", "two-gains"])     # templates of laws
    reads(smc.law("pid").template)            # {"e", "de", ...}: what the law measures

Most properties are derived from the law's code. Continuity and finite time follow from theory
alone, so the law's decorator states them. Tests compare both kinds with what the law does.
"""

import ast
import functools
import inspect
import textwrap
from collections.abc import Callable, Iterable, Mapping
from types import FunctionType
from typing import NamedTuple

from smc_mujoco.common.errors import find
from smc_mujoco.control.component import Template
from smc_mujoco.control.law import Measurement, all_laws, laws
from smc_mujoco.mechanisms.plant import Plant

# fields of the measurement that a velocity sensor or an estimator gives
VELOCITY = {"v", "de", "dq"}


class Property(NamedTuple):
    """A property of a law in words, as in "laws that need no model", and the function that tests
    it.
    """

    words: str
    holds: Callable[[Template], bool]


def reads(law: Template) -> frozenset[str]:
    """Return the fields of the measurement that a law's code reads; all of them if its code cannot
    be read.
    """
    return read_by(law.function)


@functools.cache
def read_by(function: Callable) -> frozenset[str]:
    """Return the fields of the measurement that a law's function reads; see `reads`."""
    return frozenset(_reads(function, 0, set()))


def searched_gains(law: Template) -> list[str]:
    """Return the names of the gains that tuning searches: those that must be chosen for a plant."""
    return [name for name, gain in law.gains.items() if not gain.held]


PROPERTIES: Mapping[str, Property] = {
    "no-velocity": Property("need no velocity", lambda law: not reads(law) & VELOCITY),
    "no-model": Property("need no model of the plant", lambda law: not law.requires_model),
    "continuous": Property("have a continuous u", lambda law: law.continuous),
    "finite-time": Property(
        "bring the error to 0 in finite time", lambda law: law.finite_time == "e"
    ),
    "one-gain": Property("have one gain to choose", lambda law: len(searched_gains(law)) == 1),
    "two-gains": Property(
        "have at most two gains to choose", lambda law: len(searched_gains(law)) in (1, 2)
    ),
}


def suitable(needs: Iterable[str] = (), plant: Plant | str | None = None) -> list[Template]:
    """Return the laws of the library, or those for a plant, that have all these PROPERTIES."""
    properties = []
    for need in needs:
        properties.append(find("property of a law", need, PROPERTIES))
    templates = []
    for name in laws(plant):
        templates.append(all_laws()[name])
    for needed in properties:
        templates = list(filter(needed.holds, templates))
    return templates


def _reads(function: object, position: int, seen: set[object]) -> set[str]:
    """Return the attributes that a function reads of its argument at a position; every field if
    that is not known.
    """
    function = getattr(function, "py_func", function)
    if function in seen:
        return set()
    seen.add(function)
    try:
        assert isinstance(function, FunctionType)
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
        assert isinstance(tree, ast.FunctionDef)
    except (AssertionError, OSError, SyntaxError, ValueError):
        return set(Measurement._fields)
    name = tree.args.args[position].arg
    fields = set()
    understood = 0
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and node.value.id == name
        ):
            fields.add(node.attr)
            understood += 1
        elif isinstance(node, ast.Call):
            for i, argument in enumerate(node.args):
                if isinstance(argument, ast.Name) and argument.id == name:
                    fields |= _reads(function.__globals__.get(ast.unparse(node.func)), i, seen)
                    understood += 1
    uses = sum(isinstance(node, ast.Name) and node.id == name for node in ast.walk(tree))
    if uses == understood:
        return fields
    return set(Measurement._fields)
