"""What the command line promises: tables that fit, files where they were asked for, one sentence
for every mistake.
"""

import functools
import itertools
import json
import math
import os
import re
import signal
import sys
import threading
import time
import types
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from helpers import commands
from PIL import Image

import smc_mujoco as smc
from smc_mujoco.cli import console, law_pages, main, names, tables
from smc_mujoco.cli import run_scene as show
from smc_mujoco.cli.commands import options, studies
from smc_mujoco.common import gl
from smc_mujoco.common.errors import ScenarioError, ScenarioWarning
from smc_mujoco.draw.film import film, pace
from smc_mujoco.mechanisms.plant import plant_catalogue as plants
from smc_mujoco.metrics.catalogue import CATALOGUE, metrics, score
from smc_mujoco.simulation import run as runs
from smc_mujoco.simulation.conditions import NAMED
from smc_mujoco.simulation.grid import case
from smc_mujoco.studies.scene import scenes

LABEL = "a label that is forty characters in all."
SCENE = f'''"""Does a user's scene run?"""

import smc_mujoco as smc


@smc.law_function(gains={{"k": 3.0}})
def mine(y, gains, memory):
    s = y.de + gains.k * y.e
    return -gains.k * s, s


scene = smc.Scene(
    title="Mine",
    conditions={{
        "calm": {{"{LABEL}": smc.Scenario(plant="duffing", law=mine(), duration=0.2)}},
        "noisy": {{"rough": smc.Scenario(
            plant="duffing", law=mine(), duration=0.2, noise=smc.Noise(0.01, 0.05))}},
    }},
)
'''
FILES = {
    f"calm-{LABEL.rstrip('.').replace(' ', '_')}..npz",
    "noisy-rough.npz",
    "calm.svg",
    "calm.png",
    "noisy.svg",
    "noisy.png",
}


TRACES = {name for name in FILES if name.endswith(".npz")}


python = functools.partial(commands.python, fine=False, COLUMNS="80")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty working folder, a terminal of 80 columns, and nothing of the process changed for
    good.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    monkeypatch.setattr(sys, "path", sys.path[:])
    return tmp_path


@pytest.fixture
def call(folder, capsys):
    """Run the command line in this process: (exit code, stdout, stderr)."""

    def called(*words: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as end:
            main.main([str(word) for word in words])
        printed = capsys.readouterr()
        return int(end.value.code or 0), printed.out, printed.err

    return called


@pytest.fixture
def scene(folder) -> Path:
    (folder / "mine.py").write_text(SCENE)
    return folder / "mine.py"


@pytest.fixture
def undrawn(monkeypatch):
    """Figures take most of the time, and most claims are not about them."""
    monkeypatch.setattr(show, "figures", lambda *_: [])


@pytest.fixture
def trace(folder) -> Path:
    fault = smc.Fault(at=0.1, gain=0.5)
    scenario = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.2, fault=fault)
    return smc.run(scenario).save(folder / "one.npz")


def refused(answer: tuple[int, str, str], *words: object) -> None:
    """Exit code 2, one sentence on stderr with these words in it, no traceback."""
    code, out, err = answer
    assert code == 2
    assert [
        line for line in err.splitlines() if line.startswith("smc-mujoco: ")
    ] == err.splitlines()[-1:]
    assert "Traceback" not in out + err
    for word in words:
        assert str(word) in err


# list


@pytest.mark.quick
def test_names_that_are_read_from_the_source_are_those_of_the_catalogues():
    catalogues = {
        "Plants": plants(),
        **{heading: templates() for heading, templates in law_pages.CATALOGUES.items()},
        "Scenes": scenes(),
        "Conditions": NAMED,
        "Metrics": CATALOGUE,
    }
    assert names.names() == [(heading, [*entries]) for heading, entries in catalogues.items()]
    assert not names.of_others()


def test_list_names_everything_there_is_or_all_of_a_kind(call):
    code, out, err = call("list")
    assert code == 0
    assert err == ""
    scenes = []
    for path in (Path(smc.__file__).parents[1] / "scenes").glob("*.py"):
        scenes.append(path.stem)
    assert len(scenes) >= 10
    names = [*smc.plants(), *smc.laws(), *scenes, *smc.paper.CONDITIONS]
    names += [*smc.laws(kind="surface"), *smc.laws(kind="estimator")]
    assert [name for name in names if not re.search(rf"(?<![\w]){name}(?![\w])", out)] == []
    name_by_kind = {"scenes": "hard_stops", "friction": "Viscous(b=0.05)", "peak": "x, not e"}
    assert [word for word in name_by_kind if name_by_kind[word] not in call("list", word)[1]] == []
    assert "…" not in out
    assert max(map(len, out.splitlines())) <= 80


# run


@pytest.mark.slow
def test_run_prints_scores_of_a_scene_file_and_writes_its_files(call, scene, folder):
    code, out, err = call("run", scene, "--no-film", "--out", "results")
    assert code == 0
    assert err == ""
    assert {path.name for path in (folder / "results" / "mine").iterdir()} == FILES
    said = out.partition("wrote\n")[2].split()
    assert {Path(name) for name in said} == {Path("results/mine") / name for name in FILES}
    for heading in ("Mine, calm", "Mine, noisy"):
        assert heading in out


def test_run_prints_the_question_first_then_the_answer_then_the_scores(call, undrawn, folder):
    (folder / "asks.py").write_text('''"""Does it settle?

Look for: nothing.
"""
import smc_mujoco as smc
run = smc.Scenario(plant="duffing", law="none", duration=0.01)
conditions = {"calm": {"only": run}}
answer = lambda runs: runs.count("rest")
scene = smc.Scene(title="Asked [/s]", conditions=conditions, answer=answer)
''')
    code, out, _ = call("run", "asks.py", "--no-film", "--out", "out")
    assert code == 0
    assert [line.strip() for line in out.splitlines() if line][:3] == [
        "Does it settle?",
        "0 of 1 rest (not only)",
        "Asked [/s]",
    ]


def test_what_a_scene_s_answer_raises_is_shown_as_it_is_and_its_runs_are_kept(
    call, undrawn, folder
):
    (folder / "fails.py").write_text("""import smc_mujoco as smc
run = smc.Scenario(plant="duffing", law="none", duration=0.01)
conditions = {"calm": {"only": run}}
scene = smc.Scene(title="Fails", conditions=conditions, answer=lambda runs: runs.nothing)
""")
    with pytest.raises(AttributeError, match="nothing"):
        call("run", "fails.py", "--no-film", "--out", "out")
    assert [path.name for path in (folder / "out" / "fails").iterdir()] == ["calm-only.npz"]


def test_another_seed_changes_random_numbers_and_the_same_seed_nothing(call, undrawn, scene):
    for out, seed in (
        ("a", 1),
        ("b", 1),
        ("c", 2),
    ):
        assert call("run", scene, "--no-film", "--out", out, "--seed", seed)[0] == 0
    a, b, c = (smc.load(f"{out}/mine/noisy-rough.npz") for out in "abc")
    assert a.scenario.seed == 1
    assert c.scenario.seed == 2
    np.testing.assert_array_equal(a.x, b.x)
    np.testing.assert_array_equal(a.s, b.s)
    assert (a.s != c.s).any()


def test_threads_are_as_many_as_asked_for_and_change_no_bit(call, undrawn, scene, monkeypatch):
    thread_counts = []

    def noted(scenarios, threads, **options):
        thread_counts.append((threads, options))
        return smc.run(scenarios, threads, **options)

    monkeypatch.setattr(show, "run", noted)
    for threads in (1, 2):
        assert call("run", scene, "--no-film", "--out", str(threads), "--threads", threads)[0] == 0
    # the runs, then the same at half the step
    assert thread_counts == [(k, {"progress": True}) for k in (1, 1, 2, 2)]
    np.testing.assert_array_equal(
        smc.load("1/mine/noisy-rough.npz").x, smc.load("2/mine/noisy-rough.npz").x
    )


def test_without_a_renderer_only_the_film_is_missing_and_one_line_says_the_cure(
    call, undrawn, scene, folder, monkeypatch
):
    monkeypatch.setattr(gl, "choice", lambda: ("", "disabled"))
    monkeypatch.delenv("PYOPENGL_PLATFORM", raising=False)
    gl.missing_renderer.cache_clear()
    code, out, err = call("run", scene, "--out", "out")
    gl.missing_renderer.cache_clear()
    assert code == 0
    assert err == ""
    assert {path.name for path in (folder / "out" / "mine").iterdir()} == TRACES
    (line,) = [line for line in out.splitlines() if line.startswith("no film: ")]
    assert "install" in line


def test_a_word_in_mujoco_gl_that_is_no_backend_stops_no_command(folder):
    done = python("-m", "smc_mujoco", "show", "none.npz", folder=folder, MUJOCO_GL="nonsense")
    assert done.returncode == 2
    assert "none.npz" in done.stderr.splitlines()[-1]


# show


def test_show_prints_every_metric_with_its_value(call, trace):
    code, out, err = call("show", trace)
    assert code == 0
    assert err == ""
    rows = {}
    for line in out.splitlines():
        if line and not line.startswith(" "):
            rows[line.split()[0]] = line.split()[1]
    everything = score(smc.load(trace))
    realistic = {m.name for m in metrics() if m.realistic}
    assert set(everything) == {m.name for m in metrics() if not m.network}
    assert set(rows) & realistic == set()
    for name in everything.keys() - realistic:
        assert rows[name] == tables.number(everything[name])
    assert ", fault=Fault(at=0.1, gain=0.5)" in " ".join(out.split())
    assert all(m.summary.endswith(".") for m in metrics())


def test_show_exports_the_columns_and_draws_the_figure_that_it_names(call, trace, folder):
    code, out, err = call("show", trace, "--export", "csv, mat", "--figure", "drawn/one")
    assert code == 0
    assert err == ""
    written = [str(folder / "one.csv"), str(folder / "one.mat"), "drawn/one.svg", "drawn/one.png"]
    assert re.findall(r"wrote (\S+)", out) == written
    assert (folder / "one.mat").exists()
    assert (folder / "drawn" / "one.svg").read_text().rstrip().endswith("</svg>")
    assert (folder / "drawn" / "one.png").read_bytes().startswith(b"\x89PNG")


# mistakes


REFUSED = {  # command line -> what the sentence names
    "run duffin": ("'duffin'", "did you mean 'duffing'?"),
    "run not/there.py": ("not/there.py",),
    "run empty.py": ("empty.py", "declares no scene"),
    "run torn.py": ("torn.py", "line 2"),
    "show torn.npz": ("torn.npz",),
    "show one.npz --export csv,mta": ("did you mean 'mat'?",),
    "chatter duffing --law ,": ("',' holds no name",),
    "chatter duffing --actuator lag": ("lag:0.01",),
    "worst duffing --law pid --disturbance 2 --bound mass=heavy": ("mass=heavy", "mass=0.7:1.3"),
    "worst duffing --law pid --bound mass=0.7:1.3,mass=0.5:2": ("mass twice",),
    "worst duffing --law pid --bound delai=0:1": ("'delai'", "delay"),
    "worst duffing --law pid --bound mass=0.3": ("mass",),
    "film one.npz": ("smc.film",),
    "which arm.xm:shoulder --quick": ("'arm.xm'", ".xml"),
}
for option in ("--no-tune", "--quick", "--device cuda"):
    REFUSED[f"compare --rig axis {option}"] = ("--rig",)


@pytest.mark.usefixtures("coarse_grid", "scene", "trace")
@pytest.mark.parametrize("line", REFUSED)
def test_a_mistake_is_one_sentence_that_names_it_with_code_2_and_nothing_is_written(
    line, call, folder
):
    (folder / "empty.py").write_text("x = 1\n")
    (folder / "torn.py").write_text('"""Torn?"""\nx = (\n')
    (folder / "torn.npz").write_bytes(b"PK\x03\x04")
    before = {}
    for path in folder.iterdir():
        before[path] = path.stat().st_size
    refused(call(*line.split()), *REFUSED[line])
    assert {
        path: path.stat().st_size for path in folder.iterdir() if path.name != "__pycache__"
    } == before


TRACEBACK = "Traceback (most recent call last):"
SCENES = {  # a mistake in a scene -> the expression, and what the sentence names
    "a name that is not there": (
        "smc.Scene(title='T', conditions={'a': {'b': ok(plant='dufing')}})",
        ("'duffing'", "line 2"),
    ),
    "a gain that is not there": ("smc.law('classical', kk=1.0)", ("kk", "line 4")),
    "labels alike": (
        "smc.Scene(title='T', conditions={'a': {'B c': ok(), 'b_c': ok()}})",
        ("B c and b_c", "line 4"),
    ),
}


@pytest.mark.parametrize("mistake", SCENES)
def test_a_mistake_in_a_scene_file_names_the_file_and_the_line(mistake, call, folder):
    expression, words = SCENES[mistake]
    (folder / "wrong.py").write_text(
        "import smc_mujoco as smc\n"
        "def ok(plant='duffing'): return smc.Scenario(plant=plant, law='none', duration=0.1)\n"
        "\n"
        f"scene = {expression}\n"
    )
    refused(call("run", "wrong.py", "--no-film"), "wrong.py", *words)
    assert not (folder / "videos").exists()


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            "import nowhere_to_be_found",
            "ModuleNotFoundError: No module named 'nowhere_to_be_found'",
        ),
        ("raise ValueError", "ValueError"),
    ],
)
def test_what_a_user_s_file_raises_is_shown_from_that_file_on(line, said, call, folder):
    (folder / "mine.py").write_text(f"{line}\n")
    for words in (
        ["run", "mine.py"],
        ["compare", "duffing", "--law", "mine.py"],
    ):
        code, _, err = call(*words)
        # which 3.13 places elsewhere
        tracebacks = []
        for text in err.splitlines():
            if set(text.strip()) != {"^"}:
                tracebacks.append(text)
        assert code == 1
        assert tracebacks == [
            TRACEBACK,
            '  File "mine.py", line 1, in <module>',
            f"    {line}",
            said,
        ]
    with pytest.raises((ImportError, OSError, ValueError)) as raised:
        smc.grid(["duffing"], ["mine.py"])
    assert type(raised.value).__name__ == said.partition(":")[0]


@pytest.mark.parametrize(
    "words",
    [
        ["run"],
        ["walk"],
        ["run", "duffing", "--fast"],
        ["run", "duffing", "--threads", "0"],
    ],
    ids=" ".join,
)
def test_a_wrong_command_line_ends_with_code_2_and_shows_the_usage(words, call):
    code, out, err = call(*words)
    assert code == 2
    assert out == ""
    assert "Usage: smc-mujoco" in err
    assert "Traceback" not in err


STOPPED = (
    "smc-mujoco: stopped. A command that keeps a folder goes on from it if you run it again.\n"
)
OUTCOMES = {  # what a command raises -> its exit code and what it says
    "bad input": (ScenarioError("k is 0: give more"), 2, "smc-mujoco: k is 0: give more\n"),
    "Ctrl-C": (KeyboardInterrupt(), 130, STOPPED),
    "a closed pipe": (BrokenPipeError(), 1, ""),
    "a full disk": (
        OSError(28, "No space", "a.csv"),
        2,
        "smc-mujoco: a.csv: No space; choose another folder or make room\n",
    ),
    "no file": (
        OSError("torn"),
        2,
        "smc-mujoco: a file: torn; choose another folder or make room\n",
    ),
    "no memory": (MemoryError(), 2, "smc-mujoco: out of memory: give fewer or shorter runs\n"),
}


@pytest.mark.parametrize("case", OUTCOMES)
def test_a_command_ends_with_the_code_and_the_sentence_of_what_it_raises(case, capfd, monkeypatch):
    signals = types.SimpleNamespace(
        devnull=os.devnull,
        O_WRONLY=os.O_WRONLY,
        open=os.open,
        dup2=lambda new, _: os.close(new),
    )
    monkeypatch.setattr(console, "os", signals)  # the test's stdout stays
    error, *expected = OUTCOMES[case]
    with pytest.raises(SystemExit) as end, console.errors_as_sentences():
        raise error
    assert [end.value.code, capfd.readouterr().err] == expected


@pytest.mark.filterwarnings("always")
def test_a_warning_that_parts_of_a_command_repeat_is_printed_once(call, monkeypatch):
    def late(*_, **__):
        for words in ("late", "later", "late"):
            with warnings.catch_warnings():  # which forgets what was shown
                warnings.warn(words, ScenarioWarning, stacklevel=1)
        raise SystemExit(0)

    monkeypatch.setattr(main, "app", late)
    assert call() == (0, "", "smc-mujoco: late\nsmc-mujoco: later\n")


# the process around it


GARBAGE = """
import smc_mujoco.simulation.run
class Garbage:
    def __del__(self): print("collected")
Garbage.one = Garbage()
"""


def test_a_command_does_not_wait_for_a_last_collection():
    assert python("-c", GARBAGE).stdout == ""


HELP = """
import contextlib, io, sys
from smc_mujoco.cli.main import main
for words in (
    ["--help"], ["run", "--help"], ["show", "--help"], ["list", "--help"], ["list"], ["--version"]
):
    said = io.TextIOWrapper(io.BytesIO(), "utf-8")
    with contextlib.redirect_stdout(said):
        try:
            main(words)
        except SystemExit as end:
            assert not end.code, end.code
    said.seek(0)
    print(repr(said.read()))
print(*({"numpy", "mujoco", "numba", "llvmlite", "matplotlib", "scipy", "PIL"} & {*sys.modules}))
"""


def test_help_version_and_names_import_neither_mujoco_numba_nor_matplotlib(tmp_path):
    done = python("-c", HELP, folder=tmp_path)
    assert done.stderr == ""
    *said, heavy = done.stdout.split("\n")[:-1]
    for words, text in zip(
        (("run", "show", "list"), ("--seed", "--threads"), ("--export",), ()), said, strict=False
    ):
        assert "Usage: smc-mujoco" in text
        for word in words:
            assert word in text
    assert said[-1] == repr(f"smc-mujoco {smc.__version__}\n")
    assert heavy == ""


SCRIPT = '''"""Is this run once?"""

import json

import smc_mujoco as smc
from beside_it import LEVEL

print("the file runs")


@smc.law_function
def plain(y, gains, memory):
    return -float(json.dumps(LEVEL)) * y.de, y.e


scene = smc.Scene(
    title="Once",
    conditions={"nominal": {"plain": smc.Scenario(plant="duffing", law=plain, duration=0.05)}},
)

if __name__ == "__main__":
    from smc_mujoco.cli import run_scene as show
    show.figures = lambda *_: []
    smc.play(__file__)
'''


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    """A scene run as a script from another folder: (its folder, what came of it)."""
    folder = tmp_path_factory.mktemp("script")
    (folder / "scenes").mkdir()
    (folder / "scenes" / "once.py").write_text(SCRIPT)
    (folder / "scenes" / "beside_it.py").write_text("LEVEL = 2.0\n")
    return folder, python("scenes/once.py", "--no-film", folder=folder)


def test_a_scene_run_as_a_script_is_executed_once(script):
    _, done = script
    assert done.returncode == 0
    assert done.stdout.count("the file runs") == 1


def test_a_scene_imports_its_neighbour_and_writes_to_the_working_folder(script):
    folder, _ = script
    assert [path.name for path in (folder / "videos" / "once").iterdir()] == ["nominal-plain.npz"]


def test_a_terminal_that_knows_ascii_only_gets_all_there_is(scene, folder, trace):
    code = "\n".join(
        [
            "from smc_mujoco.cli import run_scene",
            "from smc_mujoco.cli.main import main",
            "run_scene.figures = lambda *_: []",
            "for words in (['list'], ['run', 'mine.py', '--no-film', '--out', 'out'], ['show', "
            "'one.npz']):",
            "    try: main(words)",
            "    except SystemExit as end: assert not end.code, words",
        ]
    )
    done = python("-c", code, folder=folder, PYTHONIOENCODING="ascii")
    assert done.returncode == 0
    assert done.stderr == ""
    assert done.stdout.isascii()
    for word in ("Plants", "noisy-rough.npz", "settling_time"):
        assert word in done.stdout


LONG = """
import smc_mujoco as smc

steps = {"control_period": 0.1, "physics_step": 1e-3}
run = smc.Scenario(plant="duffing", law="none", duration=20_000.0, **steps)
scene = smc.Scene(title="Long", conditions={"nominal": {"long": run}})
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for a process")
def test_ctrl_c_in_mid_simulation_is_one_sentence_and_exit_code_130(call, folder, monkeypatch):
    started = []
    (folder / "long.py").write_text(LONG)
    advance = runs.ScenarioBatch.advance
    before = signal.signal(signal.SIGINT, signal.default_int_handler)

    def stopped(*arguments):
        started.append(time.process_time())
        threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
        return advance(*arguments)

    monkeypatch.setattr(runs.ScenarioBatch, "advance", stopped)
    try:
        code, out, err = call("run", "long.py", "--no-film")
    finally:
        signal.signal(signal.SIGINT, before)
    assert time.process_time() - started[0] < 0.8
    assert code == 130
    assert err == STOPPED
    assert "Traceback" not in out
    assert list((folder / "videos" / "long").iterdir()) == []


def test_a_command_runs_without_a_standard_output(monkeypatch):
    """A shell closes it by >&-."""
    monkeypatch.setattr(sys, "stdout", None)
    with pytest.raises(SystemExit) as ended:
        main.main(["--version"])
    assert ended.value.code == 0
    sys.stdout.close()


def test_a_call_is_told_to_end_in_the_main_thread_alone(call, monkeypatch):
    """Python lets no other thread set what a signal does."""
    reported = []
    monkeypatch.setattr(main.signal, "signal", lambda *given: reported.append(given))
    ThreadPoolExecutor(1).submit(call, "--version").result()
    assert reported == []
    assert call("--version")[0] == 0
    assert reported == [(signal.SIGTERM, main._end)]


def stop(*_):
    raise KeyboardInterrupt("of the user's own handler")


@pytest.mark.parametrize(
    ("handler", "words"),
    [
        (signal.SIG_IGN, ""),
        (stop, "of the user's own handler"),
    ],
)
def test_being_told_to_end_is_ctrl_c_also_where_that_is_ignored(handler, words):
    before = signal.signal(signal.SIGINT, handler)
    try:
        with pytest.raises(KeyboardInterrupt) as ended:
            main._end()
    finally:
        signal.signal(signal.SIGINT, before)
    assert str(ended.value) == words


@pytest.mark.parametrize("duration", [0.1, 0.3])
def test_chatter_measures_in_runs_of_the_duration_that_it_is_given(duration, call, monkeypatch):
    """The least is a tenth of a second: alone against a duration that is lost, or another least."""
    lasted = []

    def run(scenarios, threads):
        lasted.extend(scenario.duration for scenario in scenarios)
        raise ScenarioError("enough")

    monkeypatch.setattr(runs, "run", run)
    line = ("chatter", "duffing", "--law", "pid", "--gains", "default", "--duration")
    refused(call(*line, duration), "enough")
    assert lasted == [duration]
    assert "0.1" in call(*line, 0.099)[2]
    assert lasted == [duration]


def test_x0_is_one_number_or_one_for_each_channel():
    assert options.parsed_starts(None) is None
    for text, x0 in (("-0.3", (-0.3,)), ("0.3,-0.2,1", (0.3, -0.2, 1.0))):
        starts = options.parsed_starts(text)
        assert starts is not None
        assert starts.x0 == x0
    with pytest.raises(smc.ScenarioError, match=r"--x0 is '0.3;1': give a number"):
        options.parsed_starts("0.3;1")


@pytest.mark.skipif(gl.missing_renderer() is not None, reason="no OpenGL")
def test_a_film_of_an_answer_has_as_many_pictures_as_its_time_allows(tmp_path, monkeypatch):
    clock = pace.clock
    monkeypatch.setattr(pace, "clock", lambda traces, fps, speed: clock(traces, fps, 1.0))
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    scenario = case("duffing", smc.law("pid"), "nominal", 0.5)
    recommendation = types.SimpleNamespace(worst_trace=smc.run(scenario))
    assert studies._worst_title(recommendation).startswith("Worst run, nominal: Duffing")
    said = []
    note = lambda text, **how: said.append(text)  # noqa: E731
    terminal = types.SimpleNamespace(note=note, wrote=said.append)
    for seconds, least in ((0.0, 0.0), (20.0, 30.0)):
        studies._film(recommendation, tmp_path, time.monotonic() + seconds, terminal, least)
        assert "no time for a film" in said.pop()
    with monkeypatch.context() as patch:  # over while the first picture is prepared
        patch.setattr(film, "placement", lambda *_: pytest.fail("it went on"))
        studies._film(recommendation, tmp_path, time.monotonic() + 1e-3, terminal)
        assert "no time for a film" in said.pop()
    assert not list(tmp_path.iterdir())
    with monkeypatch.context() as patch:
        patch.setattr(studies, "MADE", 0.0)  # no share of the time is left for pictures
        looks = itertools.count()  # at a clock that goes on by 1 s: a picture takes one
        patch.setattr(studies, "time", types.SimpleNamespace(monotonic=lambda: next(looks)))
        studies._film(recommendation, tmp_path, 5.5, terminal)  # s, the fifth look and a half
        assert "no time for a film" in said.pop()
        assert not list(tmp_path.iterdir())
    with monkeypatch.context() as patch:
        patch.setattr(studies, "MADE", 0.0)
        studies._film(recommendation, tmp_path, time.monotonic() + 600.0, terminal)
    assert said[0] == tmp_path / "worst.png"
    assert re.search(r"in place of a film, which would take \d+ s\b", said[1])
    with Image.open(said[0]) as picture:
        assert picture.size == (1280, 720)
    with monkeypatch.context() as patch:  # pictures take longer than the first ones told

        def write(frames, made, part):
            patch.setattr(studies, "time", types.SimpleNamespace(monotonic=lambda: math.inf))
            list(made)

        patch.setitem(film.WRITERS, ".mp4", write)
        studies._film(recommendation, tmp_path, time.monotonic() + 600.0, terminal)
    assert "no time for a film" in said.pop()
    assert [path.name for path in tmp_path.iterdir()] == ["worst.png"]
    studies._film(recommendation, tmp_path, time.monotonic() + 600.0, terminal)
    assert said[2:] == [tmp_path / "worst.mp4"]
    frame = next(ffmpeg.read_frames(str(said[2])))
    assert frame["fps"] == studies.MAX_FPS
    assert {path.name for path in tmp_path.iterdir()} == {said[0].name, said[2].name}


def test_the_picture_of_an_answer_is_of_the_largest_error_after_half_of_the_run():
    t = np.linspace(0.0, 1.0, 11)
    x = np.where(t == 0.7, 0.3, 1.0 - t)[:, None]
    trace = types.SimpleNamespace(t=t, x=x, r=np.zeros((11, 1)))
    assert studies._worst_time(trace) == 0.5
    trace.x = np.where(t[:, None] == t[7], -0.6, x)
    assert studies._worst_time(trace) == t[7]


def test_json_goes_to_standard_output_and_the_rest_beside_it(capsys):
    with pytest.raises(SystemExit):
        main.main(["list", "metrics", "--json", "-"])
    said = capsys.readouterr()
    assert json.loads(said.out)
    assert "wrote" not in said.out + said.err


def test_run_with_a_law_leads_to_compare(capsys):
    with pytest.raises(SystemExit) as end:
        main.main(["run", "duffing", "--law", "pid"])
    assert end.value.code == 2
    assert "smc-mujoco compare PLANT --law LAW" in capsys.readouterr().err
