"""Fields of a condition as a text, and back.

Such a text is written as in Python, `friction=Coulomb(0.05), sensor=Encoder(counts=4096)`. It is
parsed, and only a file that it names is run, as in `friction=my_parts.py:stribeck(static=0.3)`.
"""

import ast
import functools
import inspect
import math
import re
from collections.abc import Callable, Mapping
from typing import Any

from smc_mujoco.common import errors
from smc_mujoco.common.aliases import Data
from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.common.registry import subclasses
from smc_mujoco.common.scripts import IN_FILE, WITHIN, object_named, script_place
from smc_mujoco.common.text import UNDERSCORED, stated
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.estimator import estimator_catalogue as estimators
from smc_mujoco.mechanisms.hardware import obstacles, servos  # noqa: F401
from smc_mujoco.mechanisms.hardware.contact import Obstacle
from smc_mujoco.mechanisms.hardware.part import Actuator, Friction, Part
from smc_mujoco.simulation import time_series  # noqa: F401
from smc_mujoco.simulation.signals import Clock, Fault, Jump, Noise, Signal

ABSTRACT = (Part, Friction, Actuator, Obstacle, Signal)  # classes that a text cannot name
PLAIN = (Noise, Jump, Fault, Clock)  # fields' values that are neither parts nor signals
WHAT = "part, signal or estimator"  # that a text may name
# a text in quotes, or FILE.py:NAME without them
FILES = re.compile(rf"'[^']*'|\"[^\"]*\"|(?P<bare>{WITHIN.pattern})")
CONSTANTS = {"inf": math.inf, "pi": math.pi}


def read_fields(text: str) -> dict[str, Any]:
    """Return the fields in a text such as "friction=Coulomb(0.05), x0=0.3".

    No text is run, but a file is whose part the text names, as "friction=my_parts.py:stribeck()".
    """
    quoted = FILES.sub(_in_quotes, text)
    if UNDERSCORED.search(FILES.sub("", text)):
        raise SyntaxError
    try:
        call = ast.parse(f"_({quoted})", mode="eval").body
    except (ValueError, RecursionError, MemoryError):
        call = None
    if not isinstance(call, ast.Call) or call.args:
        raise SyntaxError
    if any(word.arg is None for word in call.keywords):
        raise SyntaxError
    return _keywords(call)


def _in_quotes(found: re.Match[str]) -> str:
    """Return FILE.py:NAME in quotes, as Python reads it."""
    return repr(found["bare"]) if found["bare"] else found[0]


def _parsed(node: ast.expr) -> Any:  # noqa: PLR0911  # a table
    """Return the value of a literal, or of a call that makes a part, a signal or an estimator."""
    match node:
        case ast.Constant(value=str() as text) if IN_FILE.fullmatch(text):
            return _call(ast.Call(func=node, args=[], keywords=[]))
        case ast.Constant(value=value):
            return value
        case ast.Name(id=name) if name in CONSTANTS:
            return CONSTANTS[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -errors.number("a value", _parsed(operand), infinite=True)
        case ast.Tuple(elts=items) | ast.List(elts=items):
            return tuple(map(_parsed, items))
        case ast.Dict(keys=keys, values=values) if None not in keys:
            parsed = {}
            for key, value in zip(keys, values, strict=True):
                if key is not None and parsed.setdefault(_parsed(key), value) is not value:
                    raise _twice(ast.unparse(key), node)
            return {key: _parsed(value) for key, value in parsed.items()}
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            first = _parsed(left)
            second = _parsed(right)
            if isinstance(first, Signal) and isinstance(second, Signal):
                return first + second
        case ast.Call():
            return _call(node)
    raise ScenarioError(
        f"condition has {shown(ast.unparse(node))}: give numbers, texts and parts such as "
        "Coulomb(0.05)"
    )


def _call(node: ast.Call) -> Any:
    """Return the part, signal or estimator that a call makes."""
    kind: Any
    if isinstance(node.func, ast.Constant):
        kind = object_named(str(node.func.value), WHAT, _usable)
    else:
        name = ast.unparse(node.func).removeprefix("smc.")
        kind = find(WHAT, name, estimators() | _kinds())
    if not callable(kind):
        if node.args or node.keywords:
            raise ScenarioError(
                f"condition has {shown(ast.unparse(node))}, which is {kind}: leave its brackets out"
            )
        return kind
    values = map(_parsed, node.args)
    keywords = _keywords(node)
    try:
        return kind(*values, **keywords)
    except TypeError:
        parameters = getattr(kind, "defaults", ())
        if isinstance(kind, type):
            parameters = inspect.signature(kind).parameters
        cure = f"it takes {', '.join(parameters) or 'nothing'}"
        raise ScenarioError(f"condition has {shown(ast.unparse(node))}: {cure}") from None


def _usable(thing: Any) -> bool:
    """Return whether a thing of a user's file is a part, signal or estimator, or a kind of it."""
    if isinstance(thing, Template):
        return thing.kind == "estimator"
    if isinstance(thing, type):
        return issubclass(thing, (Part, Signal, *PLAIN)) and thing not in ABSTRACT
    return isinstance(thing, Part | Signal | Noise | Jump | Fault | Clock)


def _keywords(node: ast.Call) -> dict[str, Any]:
    """Return keyword -> value of a call, in which no keyword may stand twice."""
    keywords: dict[str, Any] = {}
    for word in node.keywords:
        if str(word.arg) in keywords:
            raise _twice(str(word.arg), node)
        keywords[str(word.arg)] = _parsed(word.value)
    return keywords


def _twice(name: str, node: ast.expr) -> ScenarioError:
    text = shown(ast.unparse(node).removeprefix("_"))
    return ScenarioError(f"condition has {name} twice, in {text}: give it once")


def _kinds() -> dict[str, Any]:
    """Return name -> class of all parts and signals, also users'.

    If two have one name, the suite's is returned.
    """
    kinds: list[type] = [*PLAIN]
    for kind in (*subclasses(Part), *subclasses(Signal)):
        if kind not in ABSTRACT:
            kinds.append(kind)
    kinds.sort(key=lambda kind: kind.__module__.startswith("smc_mujoco."))
    return {kind.__name__: kind for kind in kinds}


def assignments(fields: Data, as_text: Callable[[Any], str]) -> str:
    """Write fields as assignments, with commas between them."""
    return ", ".join(f"{name}={as_text(value)}" for name, value in fields.items())


def value_text(value: Any, files: bool = True, brief: bool = False) -> str:
    """Return a value as `parse` reads it, with or without the files of a user's parts; or `brief`,
    for people, with six digits and without the fields of parts that are none or 0 by default.
    """
    as_text = functools.partial(value_text, files=files, brief=brief)
    if isinstance(value, Component):
        own = files and value.name not in estimators()
        word = _word(value.template, own) or value.name
        return f"{word}({assignments(value.gains, repr)})"
    if isinstance(value, Part | Signal | Noise | Jump | Fault | Clock):
        fields = stated(value)
        if brief:
            changed = stated(value, defaults=False)
            fields = {name: number for name, number in fields.items() if name in changed or number}
        if getattr(value, "about", ""):
            fields["about"] = "goal"
        kind = type(value)
        own = files and not kind.__module__.startswith("smc_mujoco.")
        word = _word(kind, own) or kind.__name__
        return f"{word}({assignments(fields, as_text)})"
    if isinstance(value, tuple):
        end = "" if brief else ","
        return f"({', '.join(map(as_text, value))}{end})"
    if isinstance(value, Mapping):
        items = []
        for key, item in value.items():
            items.append(f"{key!r}: {as_text(item)}")
        return f"{{{', '.join(items)}}}"
    return f"{value:.6g}" if brief and isinstance(value, float) else repr(value)


def _word(kind: Any, own: bool) -> str:
    """Return FILE.py:NAME of a kind of part that is the user's own; "" if no file has it."""
    where = script_place(kind) if own else ""
    return where if WITHIN.fullmatch(where) else where and repr(where)
