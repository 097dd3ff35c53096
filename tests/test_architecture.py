"""How the house is built: imports point one way, light ones come first, and one file adds one
thing.
"""

import ast
import functools
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers import annexes
from helpers.commands import python

import smc_mujoco as smc
from smc_mujoco.mechanisms.hardware.part import Actuator, Friction, Part

pytestmark = pytest.mark.quick

PACKAGE = Path(smc.__file__).parent
ROOT = PACKAGE.parent
CATALOGUES = {
    "laws": "control/laws",
    "surfaces": "control/surfaces",
    "estimators": "control/estimators",
    "plants": "mechanisms/plants",
    "joint_laws": "control/joint_laws",
}
# The rooms of the package, each of which imports from itself and from those before it.
ROOMS = (
    "common",
    "answers",
    "mechanisms",
    "control",
    "simulation",
    "metrics",
    "analysis",
    "draw",
    "robustness",
    "studies",
    "identification",
    "envs",
    "testing",
    "cli",
    "chattering",
    "exchange",
    "evidence",
    "problems",
)
ANNEXES = ROOMS[-4:]
HEAVY = {
    "numpy",
    "mujoco",
    "numba",
    "scipy",
    "matplotlib",
    "mediapy",
    "dm_control",
    "PIL",
    "rich",
    "typer",
}

STUB = ast.parse((PACKAGE / "__init__.pyi").read_text())
# methods of parts and signals, which their base classes explain
PROTOCOLS = {*vars(Part), *vars(Friction), *vars(Actuator)}
PROTOCOLS |= {"value", "bounds", "parameters", "edit_on", "placed", "meets"}
# modules of public names, which anything may import
SHELVES = {"accuracy", "signals", "hardware", "errors", "design"}
PUBLIC = {*smc._LAZY.origins, *smc._LAZY.modules}

FILES = sorted(path for path in PACKAGE.rglob("*.py"))
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


@functools.cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


@functools.cache
def imported(path: Path) -> set[str]:
    """Dotted names of our modules that a file imports, anywhere in it, also through importlib."""
    names = set()
    for node in ast.walk(parsed(path)):
        match node:
            case ast.Import():
                names |= {alias.name for alias in node.names}
            case ast.ImportFrom():
                assert node.level == 0, f"{label(path)} imports relatively"
                names |= {f"{node.module}.{alias.name}" for alias in node.names}
            case ast.Call(
                func=ast.Name(id="import_module") | ast.Attribute(attr="import_module"),
                args=[ast.Constant(value=str(name)), *_],
            ):
                names.add(name)
    return {name.removeprefix("smc_mujoco.") for name in names if name.startswith("smc_mujoco.")}


def module(name: str) -> str:
    """The module of a dotted name, which may be that of something in it; a package stands for its
    __init__.
    """
    while (
        not (PACKAGE / f"{name.replace('.', '/')}.py").exists()
        and not (PACKAGE / name.replace(".", "/")).is_dir()
    ):
        name = name.rpartition(".")[0]
    return name


# which way imports point


def test_the_package_has_these_rooms_and_no_other():
    entries = set()
    for path in PACKAGE.iterdir():
        # git leaves the folder of a room that moved, with what Python compiled in it
        if path.is_file() or any(path.rglob("*.py")):
            entries.add(path.name)
    assert entries - {
        "__init__.py",
        "__init__.pyi",
        "__main__.py",
        "accuracy.pyi",
        "design.pyi",
        "py.typed",
    } == {
        *annexes.here(ROOMS),
        *(f"{name}.py" for name in SHELVES),
    }


def test_no_two_files_of_tests_share_a_name():
    """They would be one module, and pytest would run neither."""
    names = []
    for path in (ROOT / "tests").rglob("*.py"):
        names.append(path.name)
    assert sorted(set(names)) == sorted(names)


def test_a_file_imports_from_its_own_room_and_those_below():
    above = {}
    for path in (path for path in FILES if path.parent != PACKAGE):
        room = path.relative_to(PACKAGE).parts[0]
        below = ROOMS[: ROOMS.index(room) + 1]
        above[label(path)] = [
            name for name in sorted(imported(path)) if name.split(".")[0] not in below
        ]
    assert {name: names_above for name, names_above in above.items() if names_above} == {}


@pytest.mark.slow
def test_the_core_works_without_the_annexes(tmp_path):
    left_out = shutil.ignore_patterns(*ANNEXES, "__pycache__")
    shutil.copytree(PACKAGE, tmp_path / "smc_mujoco", ignore=left_out)
    for folder in ("models", "scenes"):
        shutil.copytree(ROOT / folder, tmp_path / "smc_mujoco" / folder)
    (tmp_path / "smc_mujoco" / "docs").mkdir()
    shutil.copy(ROOT / "docs" / "words.md", tmp_path / "smc_mujoco" / "docs")
    code = """
import smc_mujoco as smc
from smc_mujoco.cli.main import main
scenarios = smc.grid("duffing", ["classical", "pid"], seeds=2, duration=0.1)
trace = smc.run(scenarios)[0]
smc.figure(trace, "figure.png")
smc.leaderboard(smc.study(scenarios, "study"))
smc.plot
for name in "exchange law_from claims problem".split():
    try:
        getattr(smc, name)
    except smc.ScenarioError as error:
        assert f"smc.{name} needs smc_mujoco." in str(error), error
    else:
        raise AssertionError(name)
main("compare duffing --law pid --seeds 1 --duration 0.1 --out compared".split())
"""
    run_without = python("-c", code, folder=tmp_path, path=tmp_path).stdout
    assert "pid" in run_without


def used_by_a_test(tree: ast.Module) -> Iterator[str]:
    """The names of the package that a test takes, also in code that it hands on as text."""
    for node in ast.walk(tree):
        match node:
            case ast.Import():
                yield from (alias.name for alias in node.names)
            case ast.ImportFrom():
                yield f"{node.module}."
            case ast.Attribute():
                yield ast.unparse(node)
            case ast.Constant(value=str(text)) if "import smc_mujoco" in text:
                yield from re.findall(r"\bsmc\.[\w.]+|smc_mujoco\.[\w.]+", text)


def test_what_a_test_needs_of_an_annex_goes_with_the_annex():
    """Its folder of tests is deleted with it, and any other test must pass then."""
    needs = set()
    for path in (ROOT / "tests").rglob("*.py"):
        folder = path.relative_to(ROOT / "tests").parts[0]
        for name in used_by_a_test(parsed(path)):
            match = re.match(rf"smc_mujoco\.({'|'.join(ANNEXES)})\b", name)
            public = annexes.USED.match(name)
            annex = match[1] if match else annexes.PUBLIC[public[1]] if public else folder
            if annex != folder:
                needs.add(f"{label(path)}: {name}")
    assert needs == set()


def circle(paths: list[Path], package: Path) -> list[str]:
    """The modules that import each other in a circle."""
    graph = {}
    for path in paths:
        name = ".".join(path.relative_to(package).with_suffix("").parts).removesuffix(".__init__")
        graph[name] = {module(imported_name) for imported_name in imported(path)} - {name}
    while ends := [
        name
        for name, imported_names in graph.items()
        if not imported_names & set(graph)
        or not any(name in imported_names for imported_names in graph.values())
    ]:
        for name in ends:
            del graph[name]
    return sorted(graph)


def test_no_modules_import_each_other_in_a_circle():
    assert circle(FILES, PACKAGE) == []


def test_a_circle_through_importlib_is_seen(tmp_path):
    (tmp_path / "common").mkdir()
    text = "import importlib\n\nimportlib.import_module('smc_mujoco.common.errors')\n"
    (tmp_path / "common" / "text.py").write_text(text)
    (tmp_path / "common" / "errors.py").write_text("from smc_mujoco.common import text\n")
    paths = sorted(tmp_path.rglob("*.py"))
    assert circle(paths, tmp_path) == ["common.errors", "common.text"]


# what an import costs


def test_whoever_runs_and_compares_loads_no_annex(tmp_path):
    code = """
import sys
import smc_mujoco as smc
trace = smc.run(smc.Scenario(plant="duffing", law="pid", duration=0.01))
smc.score(trace), smc.figure(trace), smc.film
smc.compare("pid", "duffing", "nominal", seeds=1, duration=0.1, out="compared", progress=False)
print(*sys.modules)
"""
    loaded = python("-c", code, folder=tmp_path).stdout.splitlines()[-1].split()
    rooms = {name.split(".")[1] for name in loaded if name.startswith("smc_mujoco.")}
    assert "simulation" in rooms
    assert rooms.isdisjoint(ANNEXES)


@pytest.mark.parametrize(
    ("name", "needed"),
    [
        ("smc_mujoco", set()),
        ("smc_mujoco.common.gl", set()),
        ("smc_mujoco.cli.main", {"rich", "typer"}),
    ],
)
def test_an_import_brings_nothing_heavy_that_it_does_not_need(name, needed):
    loaded = set(python("-c", f"import {name}, sys; print(*sys.modules)").stdout.split())
    assert loaded & HEAVY <= needed


# names


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="scenaro"):
        smc.scenaro  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]


def test_no_room_hides_a_public_name():
    assert {*smc.__all__}.isdisjoint(ROOMS)


def test_types_and_run_time_agree_on_the_public_names():
    reported = {n.targets[0].id for n in STUB.body if isinstance(n, ast.Assign)} | {
        alias.asname
        for n in STUB.body
        if isinstance(n, ast.ImportFrom)
        for alias in n.names
        if alias.asname
    }
    assert {*annexes.here(reported)} == PUBLIC


# one file adds one thing

ENTRY = {
    "laws": """
from smc_mujoco.control.law import law_function
@law_function(gains={"k": 2.0})
def brand_new(y, gains, memory):
    return -gains.k * y.e, y.e
""",
    "joint_laws": """
from smc_mujoco.control.law import law_function
@law_function(joint=True, gains={"k": 2.0})
def brand_new_joint(y, gains, memory):
    return -gains.k * y.e, y.e
""",
    "estimators": """
from smc_mujoco.control.estimator import estimator_function
@estimator_function(gains={"k": 2.0})
def brand_new(y, gains, memory):
    return gains.k * y.v
""",
    "surfaces": """
from smc_mujoco.control.surface import surface_function
@surface_function(gains={"k": 2.0})
def brand_new(y, gains, memory):
    return y.de + gains.k * y.e, -gains.k * y.de
""",
    "plants": """
import dataclasses
from smc_mujoco.mechanisms.plants.duffing import DUFFING
BRAND_NEW = dataclasses.replace(DUFFING, name="brand_new")
""",
}
RUN = {
    "surfaces": "smc.Scenario(plant='duffing', law='classical', surface='brand_new', duration=.01)",
    "laws": "smc.Scenario(plant='duffing', law='brand_new', duration=0.01)",
    "joint_laws": "smc.Scenario(plant='double_pendulum', law='brand_new_joint', duration=0.01)",
    "estimators": "smc.Scenario(plant='duffing', law='classical', velocity='brand_new')",
    "plants": "smc.Scenario(plant='brand_new', law='classical', duration=0.01)",
}

LISTS = {
    name: f"smc.laws(kind={name.removesuffix('s').removesuffix('_law')!r})" for name in CATALOGUES
}
LISTS["plants"] = "smc.plants()"


def test_a_new_file_is_found_and_runs(tmp_path):
    code = "import importlib\n"
    for catalogue, room in CATALOGUES.items():
        (tmp_path / catalogue).mkdir()
        if catalogue == "joint_laws":
            name = "brand_new_joint"
        else:
            name = "brand_new"
        (tmp_path / catalogue / f"{name}.py").write_text(ENTRY[catalogue])
        name = f"smc_mujoco.{room.replace('/', '.')}"
        code += (
            f"importlib.import_module({name!r}).__path__.append({str(tmp_path / catalogue)!r})\n"
        )
    code += "import smc_mujoco as smc\n"
    for catalogue, run in RUN.items():
        code += f"""
assert "brand_new{"_joint" * (catalogue == "joint_laws")}" in {LISTS[catalogue]}
trace = smc.run({run})
assert trace.diverged_at is None
again = smc.load(trace.save("{catalogue}.npz"))
assert again.scenario == trace.scenario
"""
    assert python("-c", code + "print('done')", folder=tmp_path).stdout == "done\n"


# how files look


def public(tree: ast.Module) -> Iterator[ast.FunctionDef | ast.ClassDef]:
    """Functions and classes at the top of a module, and the methods of the classes, that are not
    private.
    """
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node
            if isinstance(node, ast.ClassDef):
                yield from (
                    n
                    for n in node.body
                    if isinstance(n, ast.FunctionDef) and not n.name.startswith("_")
                )


def explained_elsewhere(path: Path, node: ast.FunctionDef | ast.ClassDef) -> bool:
    """A catalogue's file explains itself at its top; a class its protocol's methods, overloads, a
    signal's formula.
    """
    if path.parent.name in CATALOGUES or ast.unparse(node.body[0]) == "...":
        return True
    return node.name in PROTOCOLS


def test_everything_public_is_explained():
    silent = []
    for path in FILES:
        tree = parsed(path)
        bare = path.parent.name == "plants"
        if (path.name != "__init__.py" or path.stat().st_size) and not (
            ast.get_docstring(tree) or bare
        ):
            silent.append(label(path))
        for node in public(tree):
            if not ast.get_docstring(node) and not explained_elsewhere(path, node):
                silent.append(f"{node.name} of {label(path)}")
    assert silent == []


def test_a_part_by_the_protocol_needs_no_docstring_for_its_functions():
    methods = ["force", "stage_force", "brake", "act", "push", "read", "numbers", "start"]
    lines = [f"    def {name}(y, p, memory): pass" for name in methods]
    tree = ast.parse("\n".join(["class Rubber(Friction):", *lines]))
    _, *functions = public(tree)
    assert [node.name for node in functions] == methods
    path = PACKAGE / "mechanisms" / "hardware" / "rubber.py"
    assert all(explained_elsewhere(path, node) for node in functions)


def test_no_file_names_a_folder_of_one_machine():
    folder = re.compile(
        r"""(?<![\w.}/])/(?:home|root|Users|tmp|work|mnt|opt|var)/[\w.]+|[A-Z]:\\\\Users"""
    )
    folders_by_file = {}
    for path in TEXTS:
        folders_by_file[label(path)] = folder.findall(path.read_text())
    assert {name: folders for name, folders in folders_by_file.items() if folders} == {}


# catalogues whose files may share a name: one of a law is also one of a surface
SURFACES_OF_LAWS = {
    "terminal",
    "nonsingular_terminal",
    "nonsingular_fast_terminal",
    "integral",
    "pid",
}
# the public list of a room's names beside the room, and the commands of each annex
TOLD_APART = {"errors", "signals", "commands"}


def test_no_two_files_and_no_two_classes_share_a_name():
    files: dict[str, list[str]] = {}
    classes: dict[str, set[str]] = {}
    for path in FILES:
        files.setdefault(path.stem, []).append(label(path))
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.ClassDef):
                classes.setdefault(node.name, set()).add(label(path))
    allowed = SURFACES_OF_LAWS | TOLD_APART | {"__init__"}
    twice = {name for name, paths in files.items() if len(paths) > 1}
    assert twice <= allowed
    assert {name: paths for name, paths in classes.items() if len(paths) > 1} == {}


def test_every_public_name_in_a_docstring_or_message_exists():
    """A cure that is printed must work: smc.MODULE.NAME is there."""
    missing = set()
    for path in FILES:
        for name, inner in re.findall(r"\bsmc\.(\w+)(?:\.(\w+))?", path.read_text()):
            if len(annexes.here([name, f"{name}.{inner}"])) < 2:
                continue
            public_object = getattr(smc, name, None)
            if public_object is None or (inner and not hasattr(public_object, inner)):
                missing.add(f"smc.{name}.{inner} in {label(path)}")
    assert missing == set()
