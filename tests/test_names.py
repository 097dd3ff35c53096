"""A stored name says what it holds: none of these words is one."""

import ast

import pytest
from helpers.pages import ROOT

pytestmark = pytest.mark.quick

WORDS = """one its some each of found made told other others these shown kept known given wanted thing
left at every both several asked there whole"""
FOLDERS = ["smc_mujoco", "tests", "benchmarks", "scenes", "docs/site", "videos", "examples"]
# fields and parameters that users name by keyword, and the left side of a box
PUBLIC = {
    ("smc_mujoco/draw/film/film.py", "at"),
    ("smc_mujoco/simulation/signals.py", "at"),
    ("smc_mujoco/mechanisms/custom/user_model.py", "others"),
    ("smc_mujoco/mechanisms/hardware/moments.py", "others"),
    ("tests/helpers/boxes.py", "left"),
    ("tests/helpers/films.py", "left"),
}


def stored(path):
    """The names that a file stores, with their lines: variables, fields, loop variables."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_stored_name_says_what_it_holds(folder):
    vague = []
    for path in sorted((ROOT / folder).rglob("*.py")):
        place = path.relative_to(ROOT).as_posix()
        for name, line in stored(path):
            if name in WORDS.split() and (place, name) not in PUBLIC:
                vague.append(f"{place}:{line} {name}")
    assert vague == []
