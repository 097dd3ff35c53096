"""Draw small faults of a room's code at random, and say which of them the room's tests find.

    make mutants ROOM=metrics                      # ten mutants, from seed 0
    make mutants ROOM=identification SEED=7 COUNT=4

A mutant that lives is equivalent, or shows what no test holds.
"""

import ast
import copy
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[1]
COPIED = ("smc_mujoco", "tests", "models", "scenes", "docs", "benchmarks", "examples", ".github")
TIMEOUT = 1200.0  # s for the tests of a room; a mutant that never ends is found
OPERATORS = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
FIRST_ARGUMENT = {"abs", "max", "min", "sorted", "all", "any", "fabs", "sqrt", "sum"}


def mutate(node: ast.AST) -> ast.AST | None:
    """Return a mutant of a node, or None where there is none."""
    mutant = copy.deepcopy(node)
    match mutant:
        case ast.Compare(ops=[operator]) if type(operator) in OPERATORS:
            mutant.ops = [OPERATORS[type(operator)]()]
        case ast.BinOp(op=operator) | ast.BoolOp(op=operator) if type(operator) in OPERATORS:
            mutant.op = OPERATORS[type(operator)]()
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            return operand
        case ast.Constant(value=bool(value)):
            mutant.value = not value
        case ast.Constant(value=int(value) | float(value)):
            if isinstance(value, int):
                mutant.value = value + 1
            else:
                mutant.value = 1.1 * value + 0.1
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name), args=[first, *_]):
            return first if name in FIRST_ARGUMENT else None
        case ast.IfExp() | ast.If():
            mutant.test = ast.UnaryOp(ast.Not(), mutant.test)
        case _:
            return None
    return mutant


def mutants(path: Path) -> list[tuple[int, str, Callable[[], str]]]:
    """Return (line, words, a function that makes the mutated file) for each mutant of a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    mutations = []
    for parent in ast.walk(tree):
        for field, value in ast.iter_fields(parent):
            if isinstance(value, list):
                children = value
            else:
                children = [value]
            for i, child in enumerate(children):
                if not isinstance(child, ast.expr | ast.stmt) or field in ("annotation", "returns"):
                    continue
                if (mutant := mutate(child)) is None:
                    continue

                def make(parent=parent, field=field, value=value, i=i, mutant=mutant) -> str:
                    if isinstance(value, list):
                        changed = [*value[:i], mutant, *value[i + 1 :]]
                    else:
                        changed = mutant
                    setattr(parent, field, changed)
                    text = ast.unparse(ast.fix_missing_locations(tree))
                    setattr(parent, field, value)
                    return text

                before, after = (ast.unparse(n).splitlines()[0] for n in (child, mutant))
                mutations.append((child.lineno, f"{before}  ->  {after}", make))
    return mutations


def main() -> None:
    """Run the tests of a room on each mutant that is drawn."""
    room = os.environ.get("ROOM") or sys.exit(
        "name a room of the package: make mutants ROOM=metrics"
    )
    seed, count = (
        int(os.environ.get(name) or default) for name, default in (("SEED", 0), ("COUNT", 10))
    )
    if not (ROOT / "smc_mujoco" / room).is_dir() or not (ROOT / "tests" / room).is_dir():
        sys.exit(
            f"ROOM is {room!r}: name a folder of smc_mujoco that tests/ has too, such as metrics"
        )
    files = sorted((ROOT / "smc_mujoco" / room).rglob("*.py"))
    all_mutants = [(file.relative_to(ROOT), *mutant) for file in files for mutant in mutants(file)]
    drawn = random.Random(seed).sample(all_mutants, min(count, len(all_mutants)))
    with tempfile.TemporaryDirectory() as folder:
        for name in COPIED:
            shutil.copytree(
                ROOT / name, Path(folder, name), ignore=shutil.ignore_patterns("__pycache__")
            )
        for file in filter(Path.is_file, ROOT.iterdir()):
            shutil.copy(file, folder)
        if failed := run_tests(Path(folder), room):
            sys.exit(f"the tests fail without a mutant: {failed}")
        lived = 0
        for path, line, words, make in drawn:
            Path(folder, path).write_text(make(), encoding="utf-8")
            failed = run_tests(Path(folder), room)
            shutil.copy(ROOT / path, Path(folder, path))
            lived += not failed
            print(f"{'died ' if failed else 'LIVED'} {path}:{line}  {words}  {failed}", flush=True)
    print(f"{len(drawn) - lived} of {len(drawn)} mutants of {len(all_mutants)} died")


def run_tests(folder: Path, room: str) -> str:
    """Return the test that fails first, "" if none does."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        f"tests/{room}",
        "-x",
        "-q",
        "--no-header",
        "--tb=no",
    ]
    environment = os.environ | {"PYTHONPATH": str(folder)}
    try:
        run = subprocess.run(
            command,
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "(it never ends)"
    failed = []
    for line in run.stdout.splitlines():
        if line.startswith(("FAILED", "ERROR")):
            failed.append(line)
    if run.returncode:
        return (failed or ["(it does not start)"])[0]
    return ""


if __name__ == "__main__":
    main()
