"""What every command says of itself, and that each of its options reaches the function that does
the work.
"""

import importlib
import inspect
import itertools
import json
import re
import sys
import typing
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
from helpers import annexes, machines
from helpers.arguments import reported
from helpers.words import words
from typer.models import OptionInfo

import smc_mujoco as smc
from smc_mujoco.analysis import engine
from smc_mujoco.cli import help_pages, main
from smc_mujoco.common import gl
from smc_mujoco.common.constraints import of_parameters
from smc_mujoco.identification import published_rig as rig

# command line -> the functions that it calls, of which the last does the work; not for audits
CALLS = {
    "list pid": ["cli.law_pages.print_pages"],
    "list --need continuous,two-gains --json l.json": ["cli.law_pages.print_suitable"],
    "list --plant duffing": ["cli.law_pages.print_suitable"],
    "list --full": ["cli.commands.listing._print_all"],
    "list law.c": ["exchange.c.law_from_c.check_law_source"],
    "explain star": ["cli.commands.glossary.meaning"],
    "run duffing": ["cli.run_scene.perform"],
    "run duffing --out there --no-film --seed 7 --threads 2 --export csv,mat --no-repeat "
    "--json r.json": ["cli.run_scene.perform"],
    "view duffing": ["draw.view.view"],
    "view duffing --law pid --port 8123 --no-browser --record run.html": ["draw.view.view"],
    "compare": ["studies.compare.compare"],
    "compare duffing,van_der_pol --law pid,classical --condition noise --seeds 3 --no-tune "
    "--worst --quick --metric itae "
    "--gains default --duration 2 --x0 0.4 --relevant 0.05 --allow-defaults --out there --searches 2 "
    "--figure f "
    "--latex t.tex --seed 5 --json c.json --threads 2 --device cuda --executor dask://h:1 --full": [
        "studies.compare.compare"
    ],
    "compare --law all": ["studies.compare.compare"],
    "compare --law all --gains default duffing": ["studies.compare.compare"],
    "compare --rig lifted_pendulum --seeds 1": [
        "identification.ensemble.study",
        "identification.ensemble.leaderboard",
    ],
    "compare --rig lifted_pendulum --law pid --seeds 1 --duration 2 --x0 0.4 --out there "
    "--threads 2 --allow-defaults --relevant 0.05": [
        "identification.ensemble.study",
        "identification.ensemble.leaderboard",
    ],
    "which duffing": ["studies.which.which"],
    "which duffing --need calm,fast --condition noise --law pid --quick --seeds 3 --duration 2 "
    "--x0 0.4 "
    "--relevant 0.05 --out there --allow-defaults --seed 5 --json w.json --threads 2 --device cuda "
    "--executor dask://h:1 --minutes 2 --no-film --falling --full": ["studies.which.which"],
    "tune duffing --law pid": ["analysis.tuning.search.tune"],
    "tune duffing --law pid --full --need calm --device cuda --objective tracking --searches 2 --budget 7 --seed 3 --out there.json "
    "--condition noise --x0 0.4 --json j.json --threads 2": ["analysis.tuning.search.tune"],
    "margins": ["robustness.margins.margins"],
    "margins --quick": ["robustness.margins.margins"],
    "margins duffing --law pid --full --kind delay,mass --gains default --quick --device cuda --condition noise --x0 "
    "0.4 "
    "--figure m --json m.json --threads 2": ["robustness.margins.margins"],
    "worst duffing": ["robustness.worst_case.worst_case"],
    "worst duffing --law pid --full --disturbance 2 "
    "--bound slope=3,position_noise=0.01,delay=0:0.01,mass=0.7:1.3,alpha=0.8:1.2 "
    "--metric peak --gains default --condition noise --duration 2 --budget 9 --seed 3 --figure w "
    "--json w.json --threads 2 --device cuda": ["robustness.worst_case.worst_case"],
    "worst lifted_pendulum": ["robustness.worst_case.worst_case"],
    "sensitivity duffing": ["robustness.sensitivity.sensitivity"],
    "sensitivity duffing --law pid --full --disturbance 2 --bound "
    "delay=0:0.01,encoder=256:4096,period=1:4 "
    "--metric peak --gains default --condition noise --duration 2 --points 8 --seed 3 --figure s "
    "--json s.json --threads 2 --device cuda": ["robustness.sensitivity.sensitivity"],
    "chatter duffing": ["simulation.grid.case"],
    "chatter duffing --law pid --actuator lag:0.01 --condition noise --gains default --duration 2": [
        "simulation.grid.case"
    ],
    "chatter duffing --law pid --channel 1 --figure c --json c.json --threads 2": [
        "chattering.prediction.chattering"
    ],
    "excitation arm.xml --for m,input_delay --u-max 5 --v-max 2 --amplitude 0.3 --duration 4 "
    "--rate 250 --noise 0.0001 --counts 8192 --figure f --out m.csv --json e.json": [
        "identification.excitation.excitation"
    ],
    "export pid.c": ["exchange.c.export_c.law_to_c"],
    "export pid there.c --gains kp=50 --type float --joints 2": ["exchange.c.export_c.law_to_c"],
    "export pid.fmu": ["exchange.fmu.export_fmu.law_to_fmu"],
    "export pid p.fmu --gains kp=50 --surface linear(c=4) --velocity levant --period 0.002 "
    "--u-max 6 --model nominal "
    "--joints 2 --no-binary": ["exchange.fmu.export_fmu.law_to_fmu"],
    "export pid folder --ros2 --gains kp=50 --surface linear(c=4) --velocity levant "
    "--period 0.002 --u-max 6 --joints 2": ["exchange.loop.package.law_to_package"],
    "export pid folder --plain": ["exchange.loop.package.law_to_package"],
}
CALLS = {line: paths for line, paths in CALLS.items() if annexes.here(paths) == paths}


COMMANDS = {
    info.name: (info.rich_help_panel, info.callback) for info in main.app.registered_commands
}


def parameters(command: Callable) -> dict[str, tuple[inspect.Parameter, Any]]:
    """Return how each option and argument is written -> its parameter, and what typer is told of
    it.
    """
    option_by_name = {}
    signature = inspect.signature(command).parameters
    for parameter in [parameter for name, parameter in signature.items() if name != "ctx"]:
        info = parameter.annotation.__metadata__[0]
        declared = []
        for word in (info.default, *(info.param_decls or ())):
            if isinstance(word, str):
                declared.append(word)
        name = parameter.name.replace("_", "-")
        names = [f"--{name}", *[f"--no-{name}"] * isinstance(parameter.default, bool)]
        option_by_name[
            "/".join(declared or (names if isinstance(info, OptionInfo) else [parameter.name]))
        ] = (
            parameter,
            info,
        )
    return option_by_name


def value_of(one: inspect.Parameter, info: Any) -> str:
    """Return a value that an option takes and that is not its default; "" for a file or a flag.

    A text of a form of its own stands in the option's type, behind what typer is told:
    Annotated[str, typer.Option(...), "m=2"].
    """
    kind = one.annotation.__origin__
    kinds = {kind, *typing.get_args(kind)}
    if {int, float} & kinds:
        return str(max(info.min or 0, one.default or 0) + 1)
    if str in kinds:
        return next(iter(one.annotation.__metadata__[1:]), "word")
    return ""


def with_values(calls: dict[str, list[str]]) -> dict[str, list[str]]:
    """Return the calls; the longest of each command also has the numbers and texts that none of
    them has, so that such an option needs no word here.
    """
    call_by_line = dict(calls)
    for name, (_, command) in COMMANDS.items():
        lines = sorted((line for line in calls if line.split()[0] == name), key=len)
        tried = set()
        for word in " ".join(lines).split():
            tried.add(word.partition("=")[0])
        more = []
        for names, (parameter, info) in parameters(command).items():
            value = value_of(parameter, info)
            if value and names.startswith("-") and not tried & {*names.split("/")}:
                more += [names, value]
        if lines and more:
            call_by_line[" ".join([lines[-1], *more])] = call_by_line.pop(lines[-1])
    return call_by_line


CALLS = with_values(CALLS)

PRINTED = [  # command lines that are run to their ends
    "list --need continuous,one-gain --json l.json",
    "list classical --json l.json",
    "show one.npz --export csv,mat --json s.json",
    "margins duffing --law classical,pid --kind delay --quick --figure m.pdf --json m.json",
    (
        "worst duffing --law classical --budget 3 --duration 0.2 --gains default --figure w.pdf "
        "--json w.json"
    ),
    (
        "sensitivity duffing --law classical --bound mass=0.7:1.3 --points 8 --duration 0.2 "
        "--figure s.pdf --json s.json"
    ),
    (
        "chatter duffing --law super_twisting --actuator lag:0.01 --gains default --duration 0.2 "
        "--figure c.pdf --json c.json"
    ),
    "tune duffing --law classical --searches 2 --budget 32 --condition nominal --out t.json --json j.json",
    "compare duffing --law classical,pid --gains default --condition nominal --seeds 1 "
    "--duration 0.1 --out c "
    "--figure f.pdf --latex f.tex --json t.json",
    "compare --rig lifted_pendulum --law classical --seeds 1 --duration 0.1 --out r",
    "export classical.fmu --no-binary",
]
PRINTED = [line for line in PRINTED if annexes.here([line.split()[0]])]


FLAGS = {
    "--no-film",
    "--no-repeat",
    "--no-browser",
    "--no-tune",
    "--worst",
    "--quick",
    "--allow-defaults",
}
FLAGS |= {"--no-binary", "--full", "--falling", "--ros2", "--plain"}
# which function does the work; --need and --plant of `list`
SWITCHES = {"--rig", "--need", "--plant", "--no-film", "--full", "--ros2", "--plain"}
AFTER = {"--figure", "--latex", "--json", "--out"}  # of what is done after the function
FOLDERS = {"run", "compare", "which"}  # whose --out is a folder
ALIASES = {
    "--allow-defaults": "defaults",  # option -> arguments that it may change, besides the one of its name
    "--law": "laws scenario scenarios",
    "--condition": "conditions scenario",
    "--x0": "starts scenarios",
    "--seed": "scene scenario",
    "--seeds": "scenarios",
    "--duration": "scenario scenarios",
    "--gains": "law scenario",
    "--disturbance": "within over",
    "--bound": "within over",
    "--label": "scenario",
    "--no-film": "filming",
    "--no-browser": "open_browser",
    "--no-repeat": "repeated",
    "--out": "folder",
    "--actuator": "changes",
    "--type": "numbers",
    "--metric": "metrics",
    "--kind": "kinds",
    "--need": "needs",
    "--for": "names",
    "--period": "control_period",
}
# an option that its command needs -> another value of it
REQUIRED = {("tune", "--law"): ["--law", "classical"]}
# not told in whole
UNTOLD = {
    "study(scenarios)",
    "case(changes)",
    "worst_case(scenario)",
    "sensitivity(scenario)",
    "view(scenario)",
}


@pytest.fixture(autouse=True)
def machines_of_tests(monkeypatch):
    monkeypatch.setattr(rig, "rig_catalogue", machines.catalogue)


class Reached(BaseException):
    """The function that does the work was called; it passes the command's sentences for errors."""


def called(function: Callable, arguments: tuple, named: dict[str, Any]) -> dict[str, str]:
    """Return the arguments of a call that are not as the function's defaults, as text."""
    signature = inspect.signature(function)
    bound = signature.bind(*arguments, **named).arguments
    plain = {name: argument.default for name, argument in signature.parameters.items()}
    passed = {}
    for name, argument in bound.items():
        if type(argument) is not type(plain[name]) or argument != plain[name]:
            passed[name] = reported(argument)
    return {f"{function.__name__}({name})": argument for name, argument in passed.items()}


def reached(words: list[str], paths: list[str]) -> dict[str, str]:
    """Return with which arguments a command line calls the functions at `paths`, of which the last
    does the work.
    """
    calls: dict[str, str] = {}

    def stub(path: str, last: bool, patch: pytest.MonkeyPatch) -> None:
        module, _, name = f"smc_mujoco.{path}".rpartition(".")
        home = importlib.import_module(module)
        function = getattr(home, name)

        def noted(*arguments: Any, **named: Any) -> None:
            calls.update({name: ""} | called(function, arguments, named))
            if last:
                raise Reached

        patch.setattr(home, name, noted)

    with pytest.MonkeyPatch.context() as patch:
        for path, following in itertools.zip_longest(paths, paths[1:]):
            stub(path, following is None, patch)
        with pytest.raises(Reached):
            main.main(words)
    return calls


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    monkeypatch.setattr(
        gl, "missing_renderer", lambda: "not here"
    )  # else it is kept for later tests
    monkeypatch.setattr("warnings.showwarning", None)
    return tmp_path


def options(words: list[str]) -> list[tuple[int, int]]:
    """Return where each option and its value begin and end in a command line."""
    starts = [k for k, word in enumerate(words) if word.startswith("--")]
    alone = []
    for k in starts:
        alone.append(words[k] in FLAGS or "=" in words[k])
    return [(k, k + (1 if flag else 2)) for k, flag in zip(starts, alone, strict=True)]


@pytest.mark.quick
@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("line", CALLS)
def test_every_option_changes_the_argument_of_its_name_and_no_other_to_its_value(line, monkeypatch):
    """What is done only after the work, such as writing a file, is seen in what commands write,
    below.
    """
    # the minutes of `which` are those that are left
    monkeypatch.setattr("smc_mujoco.cli.commands.studies.time.monotonic", lambda: 0.0)
    words = line.split()
    paths = CALLS[line]
    calls = reached(words, paths)
    assert [name for name, value in calls.items() if not value and "(" not in name] == [
        path.rpartition(".")[2] for path in paths
    ]
    for start, stop in options(words):
        option = words[start].partition("=")[0]
        if option in SWITCHES:
            continue
        instead = REQUIRED.get((words[0], option), [])
        without = reached(words[:start] + instead + words[stop:], paths)
        changed = set()
        for name in {*calls, *without}:
            if calls.get(name) != without.get(name):
                changed.add(name)
        # of its runs
        if not changed and (option in AFTER or (words[0], option) == ("chatter", "--threads")):
            continue
        names = {
            option.removeprefix("--no-").strip("-").replace("-", "_"),
            *ALIASES.get(option, "").split(),
        }
        mine = [name for name in changed if re.split(r"[()]", name)[1] in names]
        assert len(mine) == 1, (option, changed)
        assert option == "--quick" or len(changed) == 1, (option, changed)
        value = calls.get(mine[0], "").replace("_", "-")
        for piece in re.split(r"[,=:()]", " ".join(words[start + 1 : stop])):
            plain = piece.removesuffix(".json").replace("_", "-")
            assert plain in value or mine[0] in UNTOLD or plain == "all", (option, piece, value)


FILES = {
    line: [
        word
        for word in line.split()
        if word in AFTER - FLAGS and not (word == "--out" and line.split()[0] in FOLDERS)
    ]
    for line in CALLS
}


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("line", "option"), [(line, option) for line, options in FILES.items() for option in options]
)
def test_a_file_of_another_kind_is_refused_before_the_work(line, option, capsys):
    words = line.split()
    words[words.index(option) + 1] = "a.gif"
    with pytest.raises(SystemExit) as end:
        reached(words, CALLS[line])
    assert end.value.code == 2
    assert "'a.gif': end the name in" in capsys.readouterr().err


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("line", [line for line in CALLS if "--device cuda" in line])
def test_a_device_without_its_package_is_refused_before_the_work(line, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "numba_cuda", None)
    monkeypatch.delitem(sys.modules, "smc_mujoco.analysis.engine.gpu", raising=False)
    monkeypatch.delattr(engine, "gpu", raising=False)
    with pytest.raises(SystemExit) as end:
        main.main(line.split())
    assert end.value.code == 2
    assert "numba_cuda" in (message := capsys.readouterr().err)
    assert message.endswith("pip install 'smc-mujoco[gpu]'\n")


def test_an_option_of_a_number_or_a_text_needs_no_value_here():
    def command(
        count: Annotated[int, typer.Option(min=3)] = 0,
        label: Annotated[str, typer.Option()] = "",
        masses: Annotated[str | None, typer.Option("--mass"), "m=2"] = None,
        out: Annotated[Path | None, typer.Option()] = None,
    ):
        pass

    value_by_option = {}
    for names, (parameter, info) in parameters(command).items():
        value_by_option[names] = value_of(parameter, info)
    assert value_by_option == {"--count": "4", "--label": "word", "--mass": "m=2", "--out": ""}


def test_the_calls_above_have_every_option_of_their_commands():
    for name, (_, command) in COMMANDS.items():
        words = set()
        for line in CALLS:
            if line.split()[0] == name:
                for word in line.split():
                    words.add(word.partition("=")[0])
        if words:
            options = []
            for names in parameters(command):
                if names.startswith("-"):
                    options.append({*names.split("/")})
        else:
            options = []
        assert [option for option in options if not option & words] == [], name


@pytest.mark.parametrize("typed", [["--duration", "1_0"], ["--seeds=1_0"]])
def test_a_number_is_written_in_the_digits_0_to_9_alone(typed, capsys):
    with pytest.raises(SystemExit) as ended:
        main.main(["compare", "duffing", *typed])
    assert ended.value.code == 2
    assert typed[-1].removeprefix("--seeds=") in capsys.readouterr().err


def test_the_least_number_that_an_option_takes_is_the_least_that_its_function_takes():
    compared = 0
    for line, path in {(line.split()[0], paths[-1]) for line, paths in CALLS.items()}:
        module, _, name = f"smc_mujoco.{path}".rpartition(".")
        declared = of_parameters(getattr(importlib.import_module(module), name))
        for parameter, info in parameters(COMMANDS[line][1]).values():
            bound = declared.get(parameter.name)
            low = getattr(getattr(bound, "item", bound), "low", None)
            if isinstance(info, OptionInfo) and info.min is not None and low is not None:
                assert info.min == low, (line, parameter.name)
                compared += 1
    assert compared > 8


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_the_examples_of_a_command_have_options_that_it_takes(name):
    command = COMMANDS[name][1]
    taken = set()
    for names in parameters(command):
        for option in names.split("/"):
            taken.add(option)
    examples = re.findall(
        r"Example: smc-mujoco (\S+)(.*?)(?: && .*| > .*)?\n", f"{command.__doc__}\n"
    )
    assert examples
    assert {called for called, _ in examples} == {name}
    assert {
        word for _, words in examples for word in words.split() if word.startswith("--")
    } <= taken


def test_the_program_says_under_the_heading_of_each_command_what_it_does(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        main.main(["--help"])
    said = " ".join(capsys.readouterr().out.split())
    for name, (panel, command) in COMMANDS.items():
        first, *_ = inspect.cleandoc(command.__doc__ or "").split("\n\n")
        assert f"{name} {' '.join(first.split())}" in said.partition(f"{panel}:")[2]


def test_rare_options_are_shown_by_help_all_alone_and_every_group_has_options_that_there_are(
    capsys,
):
    pages = []
    for option in ("--help", "--help-all"):
        with pytest.raises(SystemExit):
            main.main(["compare", option])
        pages.append(capsys.readouterr().out)
    brief, all_options = (text.partition("has further options")[0] for text in pages)
    assert ("--law" in brief, "--executor" in brief, "--executor" in all_options) == (
        True,
        False,
        True,
    )
    taken = set()
    for _, command in COMMANDS.values():
        for names in parameters(command):
            taken |= {*names.split("/")}
    assert help_pages.GROUPS.keys() - taken == {"--help"}


def test_every_command_that_prints_tables_takes_json():
    without = {
        name for name, (_, command) in COMMANDS.items() if "--json" not in parameters(command)
    }
    assert without == {*annexes.here(["enter", "explain", "export", "view"])}


# what is printed and written

HASHES = re.compile(r"-[0-9a-f]{12}-[0-9a-f]{12}")  # in names of kept results


@pytest.fixture
def trace(folder):
    smc.run(smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.05)).save(
        folder / "one.npz"
    )


@pytest.mark.usefixtures("trace", "coarse_grid")
@pytest.mark.parametrize("line", PRINTED, ids=lambda line: line.partition(" --")[0])
def test_what_a_command_prints_fits_and_what_it_writes_is_parsed_as_ever(
    line, folder, monkeypatch, capsys, snapshot
):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit) as end:
        main.main(line.split())
    assert not end.value.code
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 80
    assert not re.search(r"\b(nan|None|inf|True|False)\b|[<>]smc|…", out)
    # no more digits than anybody reads
    assert not re.search(r"\b[1-9]\d*\.\d{5}|0\.0*[1-9]\d{4}", out)
    for law in "".join(re.findall(r"--law (\S+)", line)).split(","):
        assert law in out
    files = set()
    for path in folder.rglob("*"):
        if path.is_file() and path.parent.name != "parts":
            files.add(path.relative_to(folder))
    reported = [Path(name) for name in re.findall(r"^wrote (\S+)", out, re.MULTILINE)]
    beside = {"one.npz", "classical.fmu", "report.html", "results.parquet"}
    untold = {
        file
        for file in files - set(reported)
        if file.name not in beside and "searches" not in str(file) and "unseen" not in str(file)
    }
    assert {Path(file).name for file in map(str, untold)} <= {name.name for name in reported}
    for name in reported:
        assert (folder / name).stat().st_size > 100
    assert not reported or all(
        name.suffix in (".json", ".pdf", ".tex", ".csv", ".mat", ".parquet") for name in reported
    )
    parsed = []
    for file in sorted(files):
        if content(file):
            parsed.append(f"{HASHES.sub('', file.as_posix())}: {content(file)}")
    if parsed:
        assert "\n".join(parsed) == snapshot


def content(file: Path) -> str:
    """Return what programs read of a file: the head of CSV, LaTeX without its comments, or the
    names in JSON.
    """
    if file.suffix not in (".json", ".csv", ".tex"):
        return ""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".json":
        return names_in(json.loads(text))
    return words(
        "\n".join(
            line
            for line in text.splitlines()[: None if file.suffix == ".tex" else 1]
            if line[:1] != "%"
        )
    )


def names_in(data: Any, depth: int = 2) -> str:
    """Return the names in some JSON and, to some depth, those below them; of a list, those of its
    first item.
    """
    if isinstance(data, list) and data:
        data = data[0]
    if not depth or not isinstance(data, dict):
        return ""
    return ", ".join(
        f"{name} ({below})" if (below := names_in(entry, depth - 1)) else name
        for name, entry in data.items()
    )
