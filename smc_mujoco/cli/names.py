"""The names of all that the package has, read from its source and folders: importing what they name
compiles laws, and takes a second.
"""

import ast
import importlib.util
from collections.abc import Iterator
from pathlib import Path

from smc_mujoco.common.files import shipped
from smc_mujoco.common.registry import KINDS, file_names, points

FOLDERS = {  # heading -> the folder that has one file a name
    "Plants": "mechanisms.plants",
    "Laws": "control.laws",
    "Laws of many joints": "control.joint_laws",
    "Surfaces": "control.surfaces",
    "Velocity estimators": "control.estimators",
}
SUITE = ("IDEAL", "REAL")  # tables of conditions by name
ENTERING = ("metric", "folded")  # decorators that enter a metric


def of_others() -> bool:
    """Return whether another installed package adds something, which only an import can judge."""
    return any(map(points, KINDS))


def names() -> list[tuple[str, list[str]]]:
    """Return heading -> names, as listings have them."""
    rows = []
    for heading, folder in FOLDERS.items():
        rows.append((heading, file_names(f"smc_mujoco.{folder}")))
    scenes = sorted(path.stem for path in shipped("scenes").glob("*.py"))
    rows.append(("Scenes", scenes))
    rows.append(("Conditions", list(_conditions())))
    rows.append(("Metrics", list(_metrics())))
    return rows


def _conditions() -> Iterator[str]:
    """Yield the keys of the suite's tables."""
    for part in _source("simulation.suite_conditions"):
        if isinstance(part, ast.AnnAssign) and ast.unparse(part.target) in SUITE:
            assert isinstance(part.value, ast.Dict)
            for key in part.value.keys:
                yield ast.literal_eval(key or ast.Constant(None))


def _metrics() -> Iterator[str]:
    """Yield the names of decorated functions."""
    for part in _source("metrics.catalogue"):
        if isinstance(part, ast.FunctionDef):
            for decorator in part.decorator_list:
                if isinstance(decorator, ast.Call) and ast.unparse(decorator.func) in ENTERING:
                    yield part.name


def _source(module: str) -> list[ast.stmt]:
    """Return the statements of a module of the package."""
    spec = importlib.util.find_spec(f"smc_mujoco.{module}")
    assert spec is not None
    return ast.parse(Path(str(spec.origin)).read_text(encoding="utf-8")).body
