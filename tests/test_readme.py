"""What README and docs show works as it stands: code, commands, links, and the catalogues they
name.
"""

import contextlib
import io
import json
import re
import runpy
import shlex
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest
import typer
from helpers import annexes
from helpers.commands import python
from helpers.episodes import dm_control_suite
from helpers.pages import PAGES, ROOT, beside, blocks, titled
from helpers.public import public_names, there

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.cli import main
from smc_mujoco.common import gl
from smc_mujoco.common.files import slug
from smc_mujoco.identification import ensemble
from smc_mujoco.studies import fair_gains, scene

pytestmark = pytest.mark.quick

README = PAGES[0].read_text()
TARGETS = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))


def commands(text: str) -> list[str]:
    """Every line of shell, and every command in running text; comments and folders of programs cut
    off.
    """
    lines = []
    for block in blocks(text, "sh"):
        for line in block.splitlines():
            lines.append(line)
    prose = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    lines += re.findall(r"`((?:smc-mujoco|make|python) [^`]+)`", prose)
    command_lines = [
        re.split(r"\s+#|\s+or:", line)[0].strip().removeprefix(".venv/bin/") for line in lines
    ]
    return list(dict.fromkeys(command_lines))


BY_NUMBERS = "mathematics.md"  # test_docs.py runs its code, and compares what it prints
CODE = [  # interpreters that a block starts take seconds, and test_workers.py has such
    pytest.param(page, i, block, marks=[pytest.mark.slow] if '"spawn"' in block else [])
    for page in PAGES
    for i, block in enumerate(blocks(page.read_text(), "python"))
    if page.name != BY_NUMBERS
]
LINES = [(page, line) for page in PAGES for line in commands(page.read_text())]
ON_HOST = "../../actions/"  # pages of the repository's host, beside its files: badges
LINKS = [
    (page, link) for page in PAGES for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text())
]
RELATIVE = [
    (page, link)
    for page, link in LINKS
    if "://" not in link
    and not link.startswith(ON_HOST)
    and annexes.here([link.partition("smc_mujoco/")[2]])
]


# What is asked for less of than a page does: as much code runs, in a tenth of the time.
SHORTLY = Objective(duration=0.5)
BRIEFLY = Objective(conditions=("nominal",), duration=0.25)
LITTLE = {
    "compare": {
        "seeds": 2,
        "duration": 0.3,
        "searches": 2,
        "budget": 4,
    },
    "tune": {"objective": SHORTLY, "searches": 2},
    "worst_case": {"budget": 8},
    "film": {"size": (640, 360)},
}


def with_little(function: Callable, little: dict) -> Callable:
    return lambda *given, **fields: function(*given, **fields | little)


def named(value: object) -> str:
    if isinstance(value, Path):
        return value.name
    return str(value)[:40]


@pytest.mark.parametrize(("page", "i", "block"), CODE, ids=named)
def test_code_runs_as_it_stands_and_writes_the_files_that_it_names(
    page, i, block, tmp_path, monkeypatch
):
    if annexes.lacking(block):
        pytest.skip("it uses an annex that is missing")
    if '.png", at=' in block and gl.missing_renderer():
        pytest.skip(gl.missing_renderer())
    if "dm_control_env" in block:
        dm_control_suite()
    for package in ("gymnasium", "optuna"):
        if f"import {package}" in block:
            pytest.importorskip(
                package, reason=f"{package} is not installed: pip install {package}"
            )
    if "law_from_fmu" in block:
        pytest.importorskip("fmpy", reason="FMPy is not installed: pip install 'smc-mujoco[fmu]'")
        warnings.simplefilter("ignore", smc.errors.PlainLoopWarning)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    monkeypatch.setattr(fair_gains, "Objective", lambda: BRIEFLY)
    monkeypatch.setattr(ensemble, "runs", with_little(ensemble.runs, {"seeds": 2, "duration": 0.3}))
    for name, little in LITTLE.items():
        monkeypatch.setattr(smc, name, with_little(getattr(smc, name), little))
    monkeypatch.setattr(sys, "argv", ["block.py", "--no-film"])  # read by a scene that plays itself
    Path("block.py").write_text(block)
    Path("examples").symlink_to(ROOT / "examples")
    if "smc.play(" in block:
        played = pytest.raises(SystemExit)
    else:
        played = contextlib.nullcontext()
    out = io.TextIOWrapper(io.BytesIO(), "utf-8")
    with beside(page, tmp_path), contextlib.redirect_stdout(out) as said, played as end:
        # whole, as interpreters that a block starts look for it from where pytest was started
        runpy.run_path(str(tmp_path / "block.py"), run_name="__main__")
    said.seek(0)
    assert end is None or not end.value.code
    assert ("print(" in block or end is not None) == (said.read().strip() != "")
    named_files = set(re.findall(r'"([\w-]+\.(?:npz|csv|json|mat|svg|png|tex|c|fmu))"', block))
    named_files |= set(re.findall(r'study\(.*"(\w+)"', block)) | (
        {"compared"} if "smc.compare(" in block else set()
    )
    written = {path.name for path in tmp_path.iterdir()} - {"block.py", "examples", *titled(page)}
    assert named_files <= written
    assert bool(written) == bool(named_files or end)


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_command_lines_name_commands_options_and_files_that_exist(page):
    program = typer.main.get_command(main.app)
    commands_by_name = program.commands  # pyright: ignore[reportAttributeAccessIssue]
    for line in (line for where, line in LINES if where == page and line.startswith("smc-mujoco ")):
        if not annexes.lacking(line):
            check_command(line, commands_by_name)


def check_command(line: str, known: dict) -> None:
    word, *rest = shlex.split(line)[1:]
    assert word in known, line
    options = {
        option
        for parameter in known[word].params
        for option in (*parameter.opts, *parameter.secondary_opts)
    }
    unknown = []
    for option in rest:
        if option.startswith("-") and option.partition("=")[0] not in {*options, "-"}:
            unknown.append(option)
    assert unknown == [], line
    arguments = []
    for argument in rest:
        if not argument.startswith("-"):
            arguments.append(argument)
        if argument.startswith("examples/"):
            assert (ROOT / argument.partition(":")[0]).exists(), line
    of_template = set()
    for path in (ROOT / "examples").glob("*/*/scenes/*.py"):
        of_template.add(path.stem)
    if word == "run" and arguments and arguments[0] not in {"NAME", *of_template}:
        assert isinstance(
            scene.read_scene(
                scene.find(str(ROOT / arguments[0]) if "/" in arguments[0] else arguments[0])
            ),
            smc.Scene,
        )
    if word == "show":
        assert arguments[0] in results(Path(arguments[0]).parent)


@pytest.mark.slow
def test_the_first_screen_is_what_its_command_prints(tmp_path):
    (tmp_path / "my_law.py").write_text(titled(PAGES[0])["my_law.py"])
    (line,) = [line for line in commands(README) if line.startswith("smc-mujoco compare ")]
    done = python("-m", "smc_mujoco", *shlex.split(line)[1:], folder=tmp_path, COLUMNS="80")
    (block,) = blocks(README, "text")
    lines = [line.rstrip() for line in done.stdout.splitlines()]
    assert block.splitlines() == lines[: len(block.splitlines())]
    assert (tmp_path / "compared" / "report.html").exists()


@pytest.mark.slow
def test_the_numbers_of_a_log_are_what_the_command_prints(tmp_path):
    page = (ROOT / "docs" / "identify.md").read_text()
    (line,) = [line for line in commands(README) if line.startswith("smc-mujoco identify ")]
    assert line in commands(page)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    done = python("-m", "smc_mujoco", *shlex.split(line)[1:], folder=tmp_path, COLUMNS="80")
    (block,) = blocks(page, "text")
    assert block.splitlines() == [line.rstrip() for line in done.stdout.splitlines()]


def test_readme_s_cost_of_a_law_is_that_of_the_benchmark():
    measured = json.loads((ROOT / "benchmarks" / "speed.json").read_text(encoding="utf-8"))
    cases = [
        f"{how}, {what}"
        for what in ("alone", "with noise and disturbance")
        for how in ("RK4", "Euler")
    ]
    added = [f"{100.0 * (measured[case] - 1.0):.0f}" for case in cases]
    sentence = r"compiled law adds (\d+) % .* RK4 and (\d+) % under Euler; .* (\d+) % and (\d+) %"
    assert [*re.findall(sentence, " ".join(README.split()))[0]] == added


def test_readme_s_times_are_those_of_the_benchmark_of_waits():
    waits = json.loads((ROOT / "benchmarks" / "waits.json").read_text(encoding="utf-8"))
    first = waits["comparison"]
    took = re.findall(r"took (\d+) s of processor time the first time, (\d+) s", README)
    assert took == [(f"{first['seconds']:.0f}", f"{first['parts']['compiling']:.0f}")]
    minutes = ["one minute", "two minutes", "three minutes", "four minutes"]
    demo = minutes[int(waits["demo"]["seconds"] / 60.0)]
    assert re.search(rf"^make demo .*: {demo}$", README, re.M)


def results(folder: Path) -> set[str]:
    """The traces that a run of a scene writes to its folder."""
    runs = scene.read_scene(scene.find(folder.name)).runs()
    return {
        (folder / f"{slug(condition)}-{slug(label)}.npz").as_posix() for condition, label, _ in runs
    }


def test_make_targets_exist():
    targets = set()
    for _, line in LINES:
        if line.startswith("make "):
            targets.add(re.match(r"make (\w+)", line))
    assert {"demo", "test"} <= {match[1] for match in targets if match} <= TARGETS


def test_files_that_command_lines_name_exist():
    named = set()
    for _, line in LINES:
        for word in re.findall(r"[\w./-]+\.(?:py|lock|sh)\b", line):
            if "NAME" not in word:
                named.add(word)
    assert named >= {"scenes/inverted_pendulum.py", "requirements.lock"}
    # to be written by the reader
    reported = set()
    for page in PAGES:
        for name in titled(page):
            reported.add(name)
    assert [name for name in named - reported if not (ROOT / name).is_file()] == []


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_relative_links_and_pictures_lead_somewhere(page):
    for path in (page.parent / link.partition("#")[0] for where, link in RELATIVE if where == page):
        assert path.exists(), path
        assert path.resolve().is_relative_to(ROOT), path
        assert path.stat().st_size > 0, path


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_names_that_a_page_takes_from_the_package_are_there(page):
    assert [name for name in public_names(page.read_text()) if not there(name)] == []


def test_folders_and_modules_that_contributing_lists_are_there():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    cells = []
    for line in text.splitlines():
        if line.startswith("| `"):
            cells.append(line.split("|")[1])
    names = [name for cell in cells for name in re.findall(r"`([\w/]+)`", cell)]
    names = annexes.here(names)
    assert len(names) >= 11
    places = []
    for name in names:
        places.append((ROOT / "smc_mujoco" / f"{name}.py", ROOT / "smc_mujoco" / name, ROOT / name))
    assert [
        name
        for name, paths in zip(names, places, strict=True)
        if not any(path.exists() for path in paths)
    ] == []
