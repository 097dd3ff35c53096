"""The OpenGL backend that renders pictures: EGL, OSMesa, or one that opens a window.

MuJoCo reads MUJOCO_GL when it is imported; if the variable is unset, it takes a backend that needs
a display. Importing smc_mujoco does not change the variable. The backend is chosen when the first
picture is rendered: the one that MUJOCO_GL names if it loads, else EGL, else OSMesa, else none.
`renderer` uses it even if MuJoCo took another one.

`import mujoco` fails if MUJOCO_GL names a backend that MuJoCo does not know or cannot load.
`choose_gl` prevents that; the command line calls it, and `mend_gl` does where a name of the package
is first used. Only Linux has a choice of backends. This module imports mujoco only when it is
needed.
"""

import atexit
import ctypes
import functools
import importlib
import os
import sys
import threading
import warnings
import weakref
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import mujoco
    import numpy as np

OFF_VALUES = ("disable", "disabled", "off", "false", "0")  # of MUJOCO_GL: no rendering
DISPLAY_VALUES = ("enable", "enabled", "on", "true", "1", "glfw", "glx")  # a display is needed
LIBRARIES = {  # backend -> groups of libraries; mujoco loads one of each group
    "egl": (
        ("libEGL.so.1",),
        ("libOpenGL.so.0", "libGL.so.1", "libGLESv2.so.2", "libGLESv1_CM.so.1"),
    ),
    "osmesa": (("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"),),
}
CURE = "install a renderer (Debian, Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri)"
TIMEOUT = 60.0  # s, for a probe: chosen
# Python code that fails if a backend cannot render.
PROBE = """
import mujoco
context = mujoco.GLContext(16, 16)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), mujoco.mjtFontScale.mjFONTSCALE_50)
"""

_LOCK = threading.Lock()  # one renderer is made at a time
_begun = False  # whether this process has made a renderer
_forked = False  # whether it was forked from one that had
_RENDERERS: "weakref.WeakSet[mujoco.Renderer]" = weakref.WeakSet()  # to be closed at exit


@functools.cache
def choice() -> tuple[str, str]:
    """Return what MUJOCO_GL names ("" when unset), and the backend of this process.

    The first call decides.
    """
    wish = os.environ.get("MUJOCO_GL", "").strip().lower()
    if sys.platform != "linux":
        return wish, wish
    for name in (wish, "egl", "osmesa"):
        if usable(name):
            return wish, name
    return wish, "disabled"


def choose_gl() -> str:
    """Set MUJOCO_GL to a backend that loads here, and return its name ("disabled" for none).

    Call it before you import mujoco if you make your own renderers. After the import, and on
    systems other than Linux, it sets nothing. Films, stills and environments of this package do not
    need it.
    """
    _, backend = choice()
    if sys.platform == "linux" and "mujoco" not in sys.modules:
        os.environ["MUJOCO_GL"] = backend
    return backend


def mend_gl() -> None:
    """Replace a MUJOCO_GL with which `import mujoco` would fail, and warn of it."""
    if not os.environ.get("MUJOCO_GL") or "mujoco" in sys.modules or not (why := note()):
        return
    from smc_mujoco.common.errors import ScenarioWarning, users_stacklevel

    choose_gl()
    warnings.warn(f"{why}; unset it or name another", ScenarioWarning, users_stacklevel())


def usable(backend: str) -> bool:
    """Return whether `import mujoco` works with this backend."""
    if backend not in LIBRARIES:
        return backend in OFF_VALUES + DISPLAY_VALUES
    if os.environ.get("PYOPENGL_PLATFORM", "").lower() not in ("", backend):
        return False
    return all(any(map(loads, group)) for group in LIBRARIES[backend])


def loads(library: str) -> bool:
    """Return whether the dynamic linker finds a library and all libraries that it needs."""
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def note() -> str | None:
    """Return one sentence if MUJOCO_GL names a backend that cannot be used, else None."""
    wish, backend = choice()
    if wish in ("", backend):
        return None
    if wish in LIBRARIES:
        why = "does not load here"
    else:
        why = "is not a backend of MuJoCo"
    return (
        f"MUJOCO_GL={wish} {why}: "
        f"{'films are off' if backend in OFF_VALUES else f'{backend} is used instead'}"
    )


@functools.cache
def missing_renderer() -> str | None:
    """Return None if a child process can render pictures, else a sentence with the cure."""
    wish, backend = choice()
    if wish in OFF_VALUES:
        return f"no film: MUJOCO_GL={wish} turns rendering off: unset it"
    if note():
        unusable = f" (and MUJOCO_GL={wish} cannot be used)"
    else:
        unusable = ""
    if backend in OFF_VALUES:
        if platform := os.environ.get("PYOPENGL_PLATFORM"):
            return (
                f"no film: PYOPENGL_PLATFORM={platform} rules out what is installed{unusable}: "
                "unset it"
            )
        return f"no film: neither libEGL with libGL nor libOSMesa is here{unusable}: {CURE}"
    error = probe(backend)
    if error is None:
        return None
    if backend in LIBRARIES:
        return f"no film: {backend} does not render{unusable} ({error}): {CURE}"
    if sys.platform == "linux":
        cure = "set MUJOCO_GL=egl"
    else:
        cure = "unset MUJOCO_GL"
    return f"no film: MuJoCo cannot open a window to render in ({error}): {cure}"


def probe(backend: str, code: str = PROBE) -> str | None:
    """Return None if a new process can run some code with a backend, else the last line of its
    error.
    """
    from smc_mujoco.common import process

    environment = {"MUJOCO_GL": backend} if backend else {}
    command = [sys.executable, "-W", "ignore", "-c", code]
    try:
        done = process.timed(command, TIMEOUT, True, None, **environment)
    except process.TimedOut:
        return f"a trial did not end within {TIMEOUT:g} s"
    if done.returncode == 0:
        return None
    return (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]


def renderer(model: "mujoco.MjModel", height: int = 240, width: int = 320) -> "mujoco.Renderer":
    """Return a renderer of pictures of this size, px, with the backend of `choice`, even if MuJoCo
    took another one.
    """
    import mujoco

    from smc_mujoco.common.errors import ScenarioError

    if why := missing_renderer():
        raise ScenarioError(why)
    global _begun  # noqa: PLW0603
    if _forked:
        raise ScenarioError(
            "no film in a process that was forked from one that had filmed, where OpenGL would "
            "wait for ever: film in the first process, or start others by spawn"
        )
    _begun = True

    if sys.platform != "linux":
        return mujoco.Renderer(model, height, width)
    _, backend = choice()
    module = sys.modules[
        mujoco.Renderer.__module__
    ].gl_context  # from which a Renderer takes its context class
    with _LOCK:
        before = getattr(module, "GLContext", None)  # absent if MUJOCO_GL turned rendering off
        try:
            name = backend if backend in LIBRARIES else "glfw"
            module.GLContext = importlib.import_module(f"mujoco.{name}").GLContext
            rendering = mujoco.Renderer(model, height, width)
        finally:
            if before is not None:
                module.GLContext = before
            elif hasattr(module, "GLContext"):
                del module.GLContext
    _RENDERERS.add(rendering)
    atexit.unregister(_close_all)
    atexit.register(
        _close_all
    )  # registered after MuJoCo's function that ends EGL, so that it runs before that one
    return rendering


def part(rendering: "mujoco.Renderer", box: tuple[int, int, int, int]) -> "np.ndarray":
    """Return a part of a renderer's picture, whose left, top, right and bottom are given, px,
    without drawing the rest.
    """
    import mujoco

    left_edge, top, right, bottom = box
    width, height = rendering.width, rendering.height
    views = rendering.scene.camera
    frustums = []
    for view in views:
        frustums.append((view.frustum_center, view.frustum_width))
        frustums[-1] += (view.frustum_bottom, view.frustum_top)
        pixel = (view.frustum_top - view.frustum_bottom) / height
        view.frustum_center += 0.5 * pixel * (left_edge + right - width)
        view.frustum_width = 0.5 * pixel * (right - left_edge)
        view.frustum_top -= pixel * top
        view.frustum_bottom += pixel * (height - bottom)
    rectangle = rendering._rect
    rendering._rect = mujoco.MjrRect(left_edge, height - bottom, right - left_edge, bottom - top)
    rendering._width, rendering._height = right - left_edge, bottom - top
    try:
        return rendering.render()
    finally:
        rendering._rect = rectangle
        rendering._width, rendering._height = width, height
        for view, frustum in zip(views, frustums, strict=True):
            view.frustum_center, view.frustum_width, view.frustum_bottom, view.frustum_top = frustum


def _after_fork() -> None:
    """Note in a child process whether its parent had begun OpenGL."""
    global _LOCK, _forked  # noqa: PLW0603
    _LOCK = threading.Lock()
    _forked = _forked or _begun


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def _close_all() -> None:
    """Close the renderers that are still open, before OpenGL ends."""
    for opened in list(_RENDERERS):
        opened.close()
