"""Defaults of what one calls to audit a paper or to enter a board, recorded."""

import importlib
import inspect
from collections.abc import Iterator

MODULES = (
    "audit.audit", "audit.evidence", "audit.figure", "audit.mutants", "audit.paper", "audit.runs",
    "audit.verdict", "boards.entries", "boards.published", "boards.scoring", "boards.simulator", "boards.standings",
    "papers.gaber.lyapunov", "papers.gaber.scenarios", "papers.gaber.timing", "papers.measures",
)  # fmt: skip


def defaults(call: object) -> str:
    """Return the arguments of a call that have a default, with it."""
    try:
        arguments = inspect.signature(call).parameters.values()  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError):
        return ""
    kept = {one.name: one.default for one in arguments if one.default is not one.empty}
    return ", ".join(f"{name}={getattr(value, '__name__', value)!s}" for name, value in kept.items())


def calls(module: str) -> Iterator[tuple[str, object]]:
    """Yield name, call of a module's functions and classes, and of their methods."""
    for name, one in vars(importlib.import_module(f"smc_mujoco.evidence.{module}")).items():
        if getattr(one, "__module__", "").endswith(module):
            yield name, one
            methods = vars(one).items() if inspect.isclass(one) else ()
            yield from ((f"{name}.{key}", way) for key, way in methods if not key.startswith("_"))


def test_defaults_are_those_recorded(snapshot):
    told = [(module, name, defaults(one)) for module in MODULES for name, one in calls(module) if name != "Claims"]
    assert "\n".join(f"{module}: {name}({words})" for module, name, words in told if words) == snapshot
