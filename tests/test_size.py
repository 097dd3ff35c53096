"""How large the project is, and how densely it is written: what two people can own.

Size is counted in tokens of code, without comments and docstrings, as layout cannot change it.
"""

import ast
import collections
import io
import tokenize
from pathlib import Path

import pytest
from helpers.commands import python

import smc_mujoco as smc
from smc_mujoco.cli.main import GROUPS

pytestmark = pytest.mark.quick

ROOT = Path(__file__).parents[1]
MAX_TOKENS = {"smc_mujoco": 450_000, "tests": 450_000}
MAX_LOADED = 176_900  # tokens of what run, score, draw, film and compare load
MAX_DENSITY = {  # of a thousand lines of code
    "tokens": 9_500,
    "ternaries": 15,
    "comprehensions": 35,
    "long lines": 10,
}
LAYOUT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENCODING,
    tokenize.ENDMARKER,
}
COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def docstring_lines(tree: ast.Module) -> set[int]:
    lines = set()
    for node in ast.walk(tree):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            first = node.body[0]
            lines |= set(range(first.lineno, (first.end_lineno or 0) + 1))
    return lines


def count(text: str) -> collections.Counter:
    """Count the tokens, lines, ternaries, comprehensions and long lines of Python code."""
    tree = ast.parse(text)
    docstrings = docstring_lines(tree)
    counted = collections.Counter()
    lines = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in LAYOUT and token.start[0] not in docstrings:
            counted["tokens"] += 1
            lines.add(token.start[0])
    counted["lines"] = len(lines)
    for node in ast.walk(tree):
        counted["ternaries"] += isinstance(node, ast.IfExp)
        counted["comprehensions"] += isinstance(node, COMPREHENSIONS)
    counted["long lines"] = sum(len(line) > 100 for line in text.splitlines())
    return counted


def count_folder(folder: str) -> collections.Counter:
    total = collections.Counter()
    for path in (ROOT / folder).rglob("*.py"):
        total += count(path.read_text(encoding="utf-8"))
    return total


def test_the_counter_by_hand():
    text = '''"""A docstring."""
# a comment
x = 1 if True else [y for y in (2,)]
'''
    counted = count(text)
    assert counted["tokens"] == 16
    assert counted["lines"] == counted["ternaries"] == counted["comprehensions"] == 1


@pytest.mark.parametrize("folder", MAX_TOKENS)
def test_the_code_is_small_and_a_line_says_one_thing(folder):
    total = count_folder(folder)
    density = {}
    for name in MAX_DENSITY:
        density[name] = 1000 * total[name] / total["lines"]
    assert total["tokens"] <= MAX_TOKENS[folder]
    assert {name: found for name, found in density.items() if found > MAX_DENSITY[name]} == {}


def test_there_are_few_names_and_commands():
    assert len(smc.__all__) <= 60
    assert sum(len(commands) for commands in GROUPS.values()) <= 17


def test_whoever_runs_and_compares_loads_no_annex_and_little_code(tmp_path):
    code = """
import sys
import smc_mujoco as smc
trace = smc.run(smc.Scenario(plant="duffing", law="pid", duration=0.01))
smc.score(trace), smc.figure(trace), smc.film
smc.compare("pid", "duffing", "nominal", seeds=1, duration=0.1, out="compared", progress=False)
print(*{module.__file__ for name, module in sys.modules.items() if name.startswith("smc_mujoco")})
"""
    loaded = python("-c", code, folder=tmp_path).stdout.splitlines()[-1].split()
    rooms = set()
    for file in loaded:
        rooms.add(Path(file).relative_to(ROOT / "smc_mujoco").parts[0])
    assert rooms.isdisjoint({"exchange", "evidence", "problems"})
    total = sum(count(Path(file).read_text(encoding="utf-8"))["tokens"] for file in loaded)
    assert total <= MAX_LOADED
