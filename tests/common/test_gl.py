"""The OpenGL backend: nothing is chosen before the first picture, which then works whatever MuJoCo
took.
"""

import ctypes.util
import inspect
import os
import subprocess
import sys

import mujoco
import pytest

from smc_mujoco.common import gl

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="only Linux has a choice of backend"
)

REPORT = """
import os, smc_mujoco.common.gl as gl
gl.choose_gl()
import mujoco
print(os.environ.get("MUJOCO_GL"), gl.note(), gl.missing_renderer(), sep="\\n")
"""
# the dynamic linker's answer on a machine without these libraries
HIDE = """
import ctypes
class Linker(ctypes.CDLL):
    def __init__(self, name, *args, **kwargs):
        if any(word in str(name) for word in {words}):
            raise OSError(name)
        super().__init__(name, *args, **kwargs)
ctypes.CDLL = Linker
"""
ALL = ("EGL", "OSMesa")


def fresh(code: str, **variables: str) -> str:
    """What a new process prints, which complains of nothing, at its end neither."""
    clean = {}
    for k, v in os.environ.items():
        if k not in ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY"):
            clean[k] = v
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=clean | variables,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0
    assert done.stderr == ""
    return done.stdout


def report(hidden: tuple[str, ...] = (), first: str = "", **variables: str) -> tuple[str, str, str]:
    """MUJOCO_GL, the note and the missing sentence of a new process ("None" for none)."""
    code = first + (HIDE.format(words=hidden) if hidden else "") + REPORT
    backend, note, missing = fresh(code, **variables).splitlines()
    return backend, note, missing


USES = [
    "import smc_mujoco as smc; smc.ScenarioError, smc.Noise\n",
    "import gymnasium; gymnasium.make('smc_mujoco:smc/Duffing-v0').reset()\n",
    "import gymnasium; gymnasium.make_vec('smc_mujoco:smc/Duffing-v0', num_envs=2).reset()\n",
]


@pytest.mark.parametrize(
    ("use", "wish"),
    list(zip(USES, ("osmesa", "egl", "x"), strict=True)),
    ids=["smc", "make", "make_vec"],
)
def test_a_script_runs_whatever_mujoco_gl_names_and_is_warned_once(wish, use):
    code = HIDE.format(words=ALL) + use
    command = [sys.executable, "-c", code + "import mujoco"]
    environment = os.environ | {"MUJOCO_GL": wish}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stderr.splitlines() if "ScenarioWarning" in line]
    for word in (f"MUJOCO_GL={wish}", "films are off", "unset it"):
        assert word in line


@pytest.fixture(scope="module")
def renders() -> None:
    """Skip where pictures cannot be rendered."""
    if (missing := report()[2]) != "None":
        pytest.skip(missing)


def test_without_libraries_all_but_films_works():
    backend, note, missing = report(hidden=ALL, MUJOCO_GL="osmesa")
    assert backend == "disabled"
    assert note == "MUJOCO_GL=osmesa does not load here: films are off"
    assert "apt-get install libegl1 libgl1" in missing
    assert "MUJOCO_GL=osmesa" in missing


def test_choose_gl_sets_nothing_once_mujoco_is_imported():
    assert report(first="import os, mujoco; os.environ['MUJOCO_GL'] = 'glfw'\n")[0] == "glfw"


EGL = {"libEGL.so.1", "libGL.so.1"}
MESA = {"libOSMesa.so.6"}
HERE = "install a renderer (Debian, Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri)"
NEITHER = "no film: neither libEGL with libGL nor libOSMesa is here"
# MUJOCO_GL, libraries, PYOPENGL_PLATFORM, error of a trial -> backend, note, why pictures are
# missing
BACKENDS = {
    "all there": ("", EGL | MESA, "", None, "egl", None, None),
    "only OSMesa": ("", MESA, "", None, "osmesa", None, None),
    "OSMesa wanted": (" OSMesa ", EGL | MESA, "", None, "osmesa", None, None),
    "no GL beside EGL": ("", {"libEGL.so.1"}, "", None, "disabled", None, f"{NEITHER}: {HERE}"),
    "nothing there": (
        "egl",
        set(),
        "",
        None,
        "disabled",
        "MUJOCO_GL=egl does not load here: films are off",
        f"{NEITHER} (and MUJOCO_GL=egl cannot be used): {HERE}",
    ),
    "OSMesa wanted, not there": (
        "osmesa",
        EGL,
        "",
        None,
        "egl",
        "MUJOCO_GL=osmesa does not load here: egl is used instead",
        None,
    ),
    "another word": (
        "x",
        EGL,
        "",
        None,
        "egl",
        "MUJOCO_GL=x is not a backend of MuJoCo: egl is used instead",
        None,
    ),
    "turned off": (
        "0",
        EGL,
        "",
        None,
        "0",
        None,
        "no film: MUJOCO_GL=0 turns rendering off: unset it",
    ),
    "a platform for OSMesa": ("", EGL | MESA, "OSMesa", None, "osmesa", None, None),
    "a platform for neither": (
        "egl",
        EGL | MESA,
        "glx",
        None,
        "disabled",
        "MUJOCO_GL=egl does not load here: films are off",
        "no film: PYOPENGL_PLATFORM=glx rules out what is installed (and MUJOCO_GL=egl cannot be "
        "used): unset it",
    ),
    "a broken driver": (
        "",
        EGL,
        "",
        "lost",
        "egl",
        None,
        f"no film: egl does not render (lost): {HERE}",
    ),
    "no window": (
        "glx",
        EGL,
        "",
        "no display",
        "glx",
        None,
        "no film: MuJoCo cannot open a window to render in (no display): set MUJOCO_GL=egl",
    ),
}


@pytest.mark.quick
@pytest.mark.parametrize("case", BACKENDS)
def test_the_backend_is_the_wish_or_the_first_that_loads_and_the_rest_is_said(case, monkeypatch):
    wish, libraries, platform, error, *expected = BACKENDS[case]
    monkeypatch.setenv("MUJOCO_GL", wish)
    monkeypatch.setenv("PYOPENGL_PLATFORM", platform)
    monkeypatch.setattr(gl, "loads", libraries.__contains__)
    monkeypatch.setattr(gl, "probe", lambda backend: error)
    chosen = gl.choice.__wrapped__()
    monkeypatch.setattr(gl, "choice", lambda: chosen)
    assert [chosen[1], gl.note(), gl.missing_renderer.__wrapped__()] == expected


def test_a_trial_without_a_name_leaves_the_variable_and_one_that_hangs_ends(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    assert gl.probe("", "import os; assert os.environ['MUJOCO_GL'] == 'glfw'") is None
    monkeypatch.setattr(gl, "TIMEOUT", 0.01)
    said = gl.probe("egl", "import time; time.sleep(9)")
    assert said == "a trial did not end within 0.01 s"


def test_renderers_have_mujoco_s_size_by_default_and_are_closed_at_the_end(monkeypatch):
    sizes = []
    for factory in (gl.renderer, mujoco.Renderer):
        sizes.append(inspect.signature(factory).parameters)
    assert [[size[name].default for name in ("height", "width")] for size in sizes] == [
        [240, 320]
    ] * 2
    closed = []
    opened = type("Opened", (), {"close": lambda self: closed.append(id(self))})()
    monkeypatch.setattr(gl, "_RENDERERS", {opened})
    gl._close_all()
    assert closed == [id(opened)]


def test_a_library_loads_if_the_linker_finds_it():
    assert gl.loads(ctypes.util.find_library("c") or "libc.so.6")
    assert not gl.loads("libnope.so.1")


IMPORT = """
import os, sys
before = dict(os.environ), list(sys.meta_path), list(sys.path_hooks)
import smc_mujoco as smc
smc.Scenario(plant="duffing", law="none")
added = sys.meta_path.pop(0)  # it registers the plants when gymnasium is imported, and then goes
assert type(added).__module__ == "smc_mujoco.envs.registration"
assert (dict(os.environ), sys.meta_path, sys.path_hooks) == before, "something changed"
assert type(smc) is type(sys)
assert smc.__spec__.name == "smc_mujoco"
"""


def test_importing_the_package_changes_nothing_of_the_process():
    assert fresh(IMPORT) == ""


PICTURE = """
import sys, threading, mujoco
held = dict(vars(sys.modules[mujoco.Renderer.__module__].gl_context))
from smc_mujoco.common import gl
text = "<mujoco><worldbody><light/><geom size='1'/></worldbody></mujoco>"
model = mujoco.MjModel.from_xml_string(text)
renderer = gl.renderer(model, 48, 64)
renderer.update_scene(mujoco.MjData(model))
assert renderer.render().shape == (48, 64, 3)
assert dict(vars(sys.modules[mujoco.Renderer.__module__].gl_context)) == held
threading.keep = gl.renderer(model)  # closed by nobody, and freed after MuJoCo's modules
"""


@pytest.mark.usefixtures("renders")
def test_a_renderer_works_where_nothing_was_chosen():
    assert fresh(PICTURE) == ""


@pytest.mark.usefixtures("renders")
def test_a_renderer_works_where_mujoco_was_imported_without_one():
    first = "import os, mujoco; del os.environ['MUJOCO_GL']\n"
    assert fresh(first + PICTURE, MUJOCO_GL="disabled") == ""


@pytest.mark.usefixtures("renders")
def test_a_renderer_that_fails_leaves_nothing_in_mujoco():
    code = PICTURE.replace("renderer = gl.renderer(model, 48, 64)", WRONG)
    assert fresh(code.partition("renderer.update")[0] + "assert dict(vars(module)) == held") == ""


WRONG = """
module = sys.modules[mujoco.Renderer.__module__].gl_context
try:
    gl.renderer(model, 48, 10**6)
except ValueError as error:
    assert "width" in str(error)
"""
