"""How the house is built: imports point one way, light ones come first, and one file adds one thing."""

import ast
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import smc_mujoco as smc

PACKAGE = Path(smc.__file__).parent
ROOT = PACKAGE.parent
CATALOGUES = ("laws", "surfaces", "plants", "estimators")

# Each may import what stands above it. What is not here shows results: it may import all of this, and none of this it.
CORE = (
    {"errors", "gl", "noise", "progress", "row", "coil", "frozen", "remade", "hook", "interrupts", "mjcf_trial"},
    {"libmujoco"},
    {"files", "layout", "mjcf", "compiled", "component", "conditions", "optional"},
    {"estimators", "fingerprint", "signals", "plant"},
    {"law", "series", "references", "part", "mechanism"},
    {
        "surfaces",
        "native",
        "channels",
        "believed",
        "motors",
        "own_channels",
        "model_check",
        "friction",
        "actuators",
        "tandem",
        "backlash",
        "contact",
        "sensors",
    },
    {"given", "forces", "pendulum_chain", "cart", "own_model"},
    {"consistency", "pendulum_row"},
    {"scenario"},
    {"harness", "record", "bounds", "assembly", "guarded", "named_conditions", "initial_states"},
    {"gains"},
    {"callback", "trace", "paper"},
    {"plain", "groups"},
    {"measure"},
    {"chunk", "metrics"},
    {"run", "scene"},
)
HEIGHT = {name: height for height, names in enumerate(CORE) for name in names}
TOP = len(CORE)  # the height of what shows results
ENTRIES = {  # what the files of a catalogue may import of ours
    "laws": {"law"},
    "surfaces": {"surfaces", "law"},
    "plants": {"plant", "pendulum_chain", "pendulum_row", "cart", "contact", "part", "coil", "errors"},
    "estimators": {"estimators"},
}
HEAVY = {"numpy", "mujoco", "numba", "scipy", "matplotlib", "mediapy", "dm_control", "PIL", "rich", "typer"}

PUBLIC = {  # what type checkers see
    alias.asname
    for node in ast.walk(ast.parse((PACKAGE / "__init__.py").read_text()))
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
    if alias.asname
}

FILES = sorted(path for path in PACKAGE.rglob("*.py"))
MODULES = {path.stem: path for path in PACKAGE.glob("*.py") if not path.stem.startswith("__")}
MODULES |= {name: PACKAGE / name / "__init__.py" for name in CATALOGUES}
SCENES = sorted((ROOT / "scenes").glob("*.py"))
TEXTS = [
    path
    for folder in ("smc_mujoco", "scenes", "models", "tests", "benchmarks", "docs", "videos")
    for path in sorted((ROOT / folder).rglob("*"))
    if path.suffix in (".py", ".xml", ".md", ".toml", ".txt")
] + [
    path
    for path in sorted(ROOT.glob("*"))
    if path.suffix in (".md", ".toml", ".sh", ".lock") or path.name == "Makefile"
]


def label(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def imported(path: Path) -> set[str]:
    """Our modules that a file imports, wherever in it, but for type checkers alone."""
    found, tree = set(), ast.parse(path.read_text())
    tree.body = [n for n in tree.body if not (isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING")]
    for node in ast.walk(tree):
        match node:
            case ast.Import():
                names = [alias.name for alias in node.names]
            case ast.ImportFrom(module="smc_mujoco"):
                names = [f"smc_mujoco.{alias.name}" for alias in node.names]
            case ast.ImportFrom():
                assert node.level == 0, f"{label(path)} imports relatively"
                names = [node.module or ""]
            case _:
                continue
        found |= {name.split(".")[1] for name in names if name.startswith("smc_mujoco.")}
    return found


def python(code: str, *, folder: Path = ROOT) -> str:
    """What a fresh interpreter prints."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-B", "-c", code],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


# which way imports point


def test_the_core_is_all_there():
    assert set(HEIGHT) <= set(MODULES)


@pytest.mark.parametrize("name", sorted(set(MODULES) - {"laws", "plants"}))
def test_a_module_imports_only_what_stands_above_it(name):
    height = HEIGHT.get(name, TOP)
    wrong = {other for other in imported(MODULES[name]) if other in MODULES and HEIGHT.get(other, TOP) >= height}
    if height == TOP:
        wrong = {other for other in wrong if other in HEIGHT}
    assert not wrong, f"{name} imports {sorted(wrong)}"


def test_no_modules_import_each_other_in_a_circle():
    graph = {name: imported(path) & set(MODULES) for name, path in MODULES.items()}
    while leaves := [name for name, others in graph.items() if not others & set(graph)]:
        for name in leaves:
            del graph[name]
    assert not graph, f"there is a circle among {sorted(graph)}"


def test_nothing_imports_the_command_line():
    assert [name for name, path in MODULES.items() if "cli" in imported(path)] == []


@pytest.mark.parametrize("catalogue", CATALOGUES)
def test_what_a_catalogue_holds_imports_little(catalogue):
    for path in (PACKAGE / catalogue).glob("*.py"):
        if path.stem != "__init__":
            assert imported(path) <= ENTRIES[catalogue], label(path)


@pytest.mark.parametrize("path", SCENES, ids=label)
def test_a_scene_uses_public_names_only(path):
    tree = ast.parse(path.read_text())
    assert imported(path) <= PUBLIC
    used = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "smc"
    }
    assert used <= PUBLIC


# what an import costs


@pytest.mark.parametrize("module", ["smc_mujoco", "smc_mujoco.gl"])
def test_importing_the_package_imports_nothing_heavy(module):
    loaded = set(python(f"import {module}, sys; print(*sys.modules)").split())
    assert loaded & HEAVY == set()


def test_importing_the_command_line_starts_no_simulator():
    loaded = set(python("import smc_mujoco.cli, sys; print(*sys.modules)").split())
    assert loaded & (HEAVY - {"rich", "typer", "numpy"}) == set()


# names


def test_every_public_name_is_there_and_listed():
    assert [name for name in sorted(PUBLIC) if getattr(smc, name) is None or name not in dir(smc)] == []


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="scenaro"):
        smc.scenaro  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]


NAMES = """
import importlib, sys, types
modules = {modules!r}
for name in modules:
    importlib.import_module("smc_mujoco." + name)
import smc_mujoco as smc
print(*[name for name in {public!r} if isinstance(getattr(smc, name), types.ModuleType)])
print(smc.law("classical").name, smc.plants()[1], len(smc.laws()) > 1, callable(smc.run), callable(smc.estimators))
"""


@pytest.mark.parametrize("first", ["law laws run plant plants estimators", "trace run", "run law"])
def test_a_submodule_never_hides_a_public_name(first):
    names, works = python(NAMES.format(modules=first.split(), public=sorted(PUBLIC))).splitlines()
    assert names.split() in ([], ["paper"])
    assert works == "classical duffing True True True"


def test_types_and_run_time_agree_on_the_public_names():
    assert set(smc._HOME) == PUBLIC


# one file adds one thing

ENTRY = {
    "laws": """
from smc_mujoco.law import law_function
@law_function(gains={"k": 2.0})
def brand_new(y, gains, memory):
    return -gains.k * y.e, y.e
""",
    "estimators": """
from smc_mujoco.estimators import estimator_function
@estimator_function(gains={"k": 2.0})
def brand_new(y, gains, memory):
    return gains.k * y.v
""",
    "surfaces": """
from smc_mujoco.surfaces import surface_function
@surface_function(gains={"k": 2.0})
def brand_new(y, gains, memory):
    return y.de + gains.k * y.e, -gains.k * y.de
""",
    "plants": """
import dataclasses
from smc_mujoco.plants.duffing import DUFFING
BRAND_NEW = dataclasses.replace(DUFFING, name="brand_new")
""",
}
RUN = {
    "surfaces": "smc.Scenario(plant='duffing', law='classical', surface='brand_new', duration=0.01)",
    "laws": "smc.Scenario(plant='duffing', law='brand_new', duration=0.01)",
    "estimators": "smc.Scenario(plant='duffing', law='classical', velocity='brand_new', duration=0.01)",
    "plants": "smc.Scenario(plant='brand_new', law='classical', duration=0.01)",
}


@pytest.mark.parametrize("catalogue", CATALOGUES)
def test_a_new_file_is_found_and_runs(catalogue, tmp_path):
    (tmp_path / "brand_new.py").write_text(ENTRY[catalogue])
    code = f"""
import importlib
importlib.import_module("smc_mujoco.{catalogue}").__path__.append({str(tmp_path)!r})
import smc_mujoco as smc
assert "brand_new" in smc.{catalogue}()
trace = smc.run({RUN[catalogue]})
assert trace.diverged_at is None
again = smc.load(trace.save({str(tmp_path / "a.npz")!r}))
assert again.scenario == trace.scenario
print("done")
"""
    assert python(code, folder=tmp_path) == "done\n"


# how files look


def public(tree: ast.Module) -> Iterator[ast.FunctionDef | ast.ClassDef]:
    """Functions and classes at the top of a module, and the methods of the classes, that are not private."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node
            if isinstance(node, ast.ClassDef):
                yield from (n for n in node.body if isinstance(n, ast.FunctionDef) and not n.name.startswith("_"))


def explained_elsewhere(path: Path, node: ast.FunctionDef | ast.ClassDef) -> bool:
    """A catalogue's file explains itself at its top; overloads and a signal's formula are explained by their class."""
    decorators = {ast.unparse(decorator) for decorator in node.decorator_list}
    if path.parent.name in CATALOGUES or "overload" in decorators:
        return True
    return node.name in ("value", "edit", "fields", "structure")  # of a signal, of a part


@pytest.mark.parametrize("path", FILES, ids=label)
def test_everything_public_is_explained(path):
    tree = ast.parse(path.read_text())
    if path.name != "__init__.py" or path.stat().st_size:
        assert ast.get_docstring(tree) or path.parent.name == "plants", "the module has no docstring"
    bare = [node.name for node in public(tree) if not ast.get_docstring(node) and not explained_elsewhere(path, node)]
    assert bare == []


@pytest.mark.parametrize("path", SCENES, ids=label)
def test_a_scene_is_short_and_asks_its_question(path):
    assert len(path.read_text().splitlines()) <= 60
    assert "?" in (ast.get_docstring(ast.parse(path.read_text())) or "")


@pytest.mark.parametrize("path", TEXTS, ids=label)
def test_no_file_names_a_folder_of_one_machine(path):
    found = re.findall(
        r"""(?<![\w.}/])/(?:home|root|Users|tmp|work|mnt|opt|var)/[\w.]+|[A-Z]:\\\\Users""", path.read_text()
    )
    assert found == []
