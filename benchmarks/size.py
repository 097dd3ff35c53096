"""How large the project is and how densely it is written, beside the last release.

    python benchmarks/size.py                   # what `make size` prints
    python benchmarks/size.py --release 0.1.0   # also keeps these numbers, as that release's

Size is counted in tokens of code, without comments and docstrings, as layout cannot change it.
Density is tokens for each thousand lines of code, and comprehensions are counted so, too. No test
asks for a total: see CONTRIBUTING.md.
"""

import argparse
import ast
import io
import json
import tokenize
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]
RELEASE = Path(__file__).with_name("size.json")
FOLDERS = ("tests", "benchmarks", "scenes", "docs")
LISTED = 10  # files, and functions
LONG = 60  # lines of a function, from its `def` to its end
LAYOUT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENCODING,
    tokenize.ENDMARKER,
}
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
DOCUMENTED = (ast.Module, ast.ClassDef, *FUNCTIONS)


def docstring_lines(tree: ast.Module) -> set[int]:
    """Return the numbers of the lines that docstrings take."""
    lines = set()
    for node in ast.walk(tree):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            first = node.body[0]
            lines |= set(range(first.lineno, (first.end_lineno or 0) + 1))
    return lines


def count(text: str) -> Counter:
    """Count the tokens of Python code, and the lines that have any."""
    docstrings = docstring_lines(ast.parse(text))
    tokens = 0
    lines = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in LAYOUT and token.start[0] not in docstrings:
            tokens += 1
            lines.add(token.start[0])
    return Counter(tokens=tokens, lines=len(lines))


COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)


def comprehensions(text: str) -> int:
    """Count comprehensions and generator expressions."""
    return sum(isinstance(node, COMPREHENSIONS) for node in ast.walk(ast.parse(text)))


def functions(text: str) -> dict[str, int]:
    """Return the length in lines of each function, from its `def` to its end; of several that share
    a name, that of the longest.
    """
    lengths = {}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, FUNCTIONS):
            length = (node.end_lineno or 0) - node.lineno + 1
            lengths[node.name] = max(length, lengths.get(node.name, 0))
    return lengths


def room(path: Path) -> str:
    """Return the folder by which a file is counted: within the package, one level deeper."""
    folders = path.parent.relative_to(ROOT).parts
    if folders[0] == "smc_mujoco":
        return "/".join(folders[:2])
    return folders[0]


def measure() -> dict[str, dict[str, int]]:
    """Count each room, file and function; a file's size is in tokens, a function's in lines."""
    rooms = {}
    files = {}
    lengths = {}
    for folder in ("smc_mujoco", *FOLDERS):
        for path in sorted((ROOT / folder).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            counted = count(text)
            counted["comprehensions"] = comprehensions(text)
            rooms.setdefault(room(path), Counter()).update(counted)
            name = path.relative_to(ROOT).as_posix()
            files[name] = counted["tokens"]
            for function, length in functions(text).items():
                lengths[f"{name}: {function}"] = length
    total = Counter()
    for name, counted in rooms.items():
        if name.startswith("smc_mujoco"):
            total.update(counted)
    rooms["the package"] = total
    measured = {"tokens": {}, "density": {}, "comprehensions": {}}
    for name, counted in sorted(rooms.items()):
        measured["tokens"][name] = counted["tokens"]
        measured["density"][name] = round(1000 * counted["tokens"] / counted["lines"])
        measured["comprehensions"][name] = round(
            1000 * counted["comprehensions"] / counted["lines"]
        )
    measured["long"] = {"of the package": long_functions(lengths)}
    return measured | {"files": largest(files), "functions": largest(lengths)}


def long_functions(lengths: dict[str, int]) -> int:
    """Count the package's functions of more than LONG lines."""
    return sum(name.startswith("smc_mujoco/") and n > LONG for name, n in lengths.items())


def largest(sizes: dict[str, int]) -> dict[str, int]:
    """Return the largest few, largest first."""
    ordered = sorted(sizes.items(), key=lambda item: -item[1])
    return dict(ordered[:LISTED])


def show(measured: dict[str, dict[str, int]], release: str, before: dict) -> None:
    """Print what was measured beside the release's numbers, and a dash where it has none."""
    titles = {
        "tokens": "tokens of code",
        "density": "tokens for each 1,000 lines of code",
        "comprehensions": "comprehensions for each 1,000 lines of code",
        "long": f"functions of more than {LONG} lines",
        "files": "largest files, tokens",
        "functions": "longest functions, lines",
    }
    for part, title in titles.items():
        print(f"\n{title:<70}{'now':>10}{release:>15}")
        for name, now in measured[part].items():
            then = before.get(part, {}).get(name)
            released = "-"
            if then is not None:
                released = f"{then:,}"
            print(f"  {name:<68}{now:>10,}{released:>15}")


def main() -> None:
    """Print the size, and keep it if asked to."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--release", metavar="NAME", help="keep these numbers in size.json")
    release = parser.parse_args().release
    before = json.loads(RELEASE.read_text(encoding="utf-8"))
    measured = measure()
    show(measured, before["release"], before)
    if release:
        stored = {"release": release, **measured}
        RELEASE.write_text(json.dumps(stored, indent=2) + "\n", encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
