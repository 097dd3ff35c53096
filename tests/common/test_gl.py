"""`import smc_mujoco` never fails for want of OpenGL; where films cannot be made, one sentence says why."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has a choice of backend")

REPORT = """
import os, smc_mujoco.common.gl as gl
gl.choose()
import mujoco
print(os.environ["MUJOCO_GL"], gl.note(), gl.missing(), sep="\\n")
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


def report(hidden: tuple[str, ...] = (), first: str = "", **variables: str) -> tuple[str, str, str]:
    """MUJOCO_GL, the note and the missing sentence of a new process ("None" for none)."""
    clean = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY")}
    code = first + (HIDE.format(words=hidden) if hidden else "") + REPORT
    done = subprocess.run(
        [sys.executable, "-c", code], env=clean | variables, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    backend, note, missing = done.stdout.splitlines()
    return backend, note, missing


@pytest.fixture(scope="module")
def default() -> tuple[str, str, str]:
    return report()


def test_unset_takes_a_backend_without_a_word(default):
    backend, note, _ = default
    assert backend in ("egl", "osmesa", "disabled")
    assert note == "None"


def test_unset_renders_where_egl_does(default):
    backend, _, missing = default
    if backend != "egl":
        pytest.skip("no libEGL here")
    assert missing == "None" or missing.startswith("no film: egl does not render")


def test_an_unknown_backend_is_replaced_and_named(default):
    backend, note, missing = report(MUJOCO_GL="nonsense")
    assert (backend, missing == "None") == (default[0], default[2] == "None")
    assert note.startswith("MUJOCO_GL=nonsense is no backend of MuJoCo: ")


def test_a_backend_that_loads_is_kept_whatever_its_case(default):
    if default[0] == "disabled":
        pytest.skip("no backend here")
    assert report(MUJOCO_GL=f" {default[0].upper()} ")[:2] == (default[0], "None")


@pytest.mark.parametrize("wish", ["egl", "osmesa"])
def test_without_libraries_all_but_films_works(wish):
    backend, note, missing = report(hidden=ALL, MUJOCO_GL=wish)
    assert backend == "disabled"
    assert note == f"MUJOCO_GL={wish} does not load here: films are off"
    assert "apt-get install libegl1 libgl1" in missing
    assert f"MUJOCO_GL={wish}" in missing


def test_osmesa_that_is_missing_falls_back_to_egl(default):
    if default[0] != "egl":
        pytest.skip("no libEGL here")
    backend, note, _ = report(hidden=("OSMesa",), MUJOCO_GL="osmesa")
    assert (backend, note) == ("egl", "MUJOCO_GL=osmesa does not load here: egl is used instead")


def test_egl_without_any_gl_library_is_not_taken():
    # libEGL.so.1 alone satisfies the linker, and still `import mujoco` fails
    assert report(hidden=("libGL", "libOpenGL", "OSMesa"))[0] == "disabled"


def test_rendering_turned_off_stays_off():
    backend, note, missing = report(MUJOCO_GL="off")
    assert (backend, note) == ("off", "None")
    assert missing == "no film: MUJOCO_GL=off turns rendering off: unset it"


def test_a_display_that_is_not_there_is_named():
    backend, note, missing = report(MUJOCO_GL="glfw")
    assert (backend, note) == ("glfw", "None")
    assert missing.startswith("no film: MuJoCo cannot open a window")


def test_a_conflicting_pyopengl_platform_is_named():
    backend, _, missing = report(PYOPENGL_PLATFORM="glx")
    assert backend == "disabled"
    assert missing == "no film: PYOPENGL_PLATFORM=glx rules out what is installed: unset it"


def test_nothing_changes_once_mujoco_is_imported():
    first = "import os, mujoco; os.environ['MUJOCO_GL'] = 'glfw'\n"
    assert report(first=first)[0] == "glfw"
