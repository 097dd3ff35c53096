"""Which OpenGL library MuJoCo renders with; chosen before the first `import mujoco`, which reads MUJOCO_GL.

`import mujoco` fails when MUJOCO_GL names a backend that it does not know or cannot load, and without
the variable it takes the one that needs a display. Here a backend that loads is kept; else EGL is
taken, else OSMesa, else none: everything but films works without. Only Linux has this choice.
"""

import ctypes
import dataclasses
import functools
import os
import sys

OFF = ("disable", "disabled", "off", "false", "0")
DISPLAY = ("enable", "enabled", "on", "true", "1", "glfw", "glx")
LIBRARIES = {  # what mujoco's import loads, backend by backend: one library of each group
    "egl": (("libEGL.so.1",), ("libOpenGL.so.0", "libGL.so.1", "libGLESv2.so.2", "libGLESv1_CM.so.1")),
    "osmesa": (("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"),),
}
PACKAGES = "install a renderer (Debian, Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri)"
PROBE = """
import mujoco
context = mujoco.GLContext(16, 16)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), mujoco.mjtFontScale.mjFONTSCALE_50)
"""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Choice:
    """MUJOCO_GL as it was found ("" when unset) and as it is now."""

    wish: str
    backend: str


@functools.cache
def choose() -> Choice:
    """Set MUJOCO_GL to a backend with which `import mujoco` works; nothing once mujoco is imported."""
    wish = os.environ.get("MUJOCO_GL", "").strip().lower()
    if sys.platform != "linux" or "mujoco" in sys.modules:
        return Choice(wish=wish, backend=wish)
    backend = next((name for name in (wish, "egl", "osmesa") if usable(name)), "disabled")
    os.environ["MUJOCO_GL"] = backend
    return Choice(wish=wish, backend=backend)


def usable(backend: str) -> bool:
    """Whether `import mujoco` works with this backend."""
    if backend not in LIBRARIES:
        return backend in OFF + DISPLAY
    if os.environ.get("PYOPENGL_PLATFORM", "").lower() not in ("", backend):
        return False
    return all(any(map(loads, group)) for group in LIBRARIES[backend])


def loads(library: str) -> bool:
    """Whether the dynamic linker finds this library and all that it needs."""
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def note() -> str | None:
    """One sentence when MUJOCO_GL held a value that had to be replaced."""
    choice = choose()
    if choice.wish in ("", choice.backend):
        return None
    why = "does not load here" if choice.wish in LIBRARIES else "is no backend of MuJoCo"
    then = "films are off" if choice.backend in OFF else f"{choice.backend} is used instead"
    return f"MUJOCO_GL={choice.wish} {why}: {then}"


@functools.cache
def missing() -> str | None:
    """None when a film can be rendered, else one sentence that says why not and what to do.

    Renders for real, in a process of its own: a broken driver can end the process it runs in.
    """
    choice = choose()
    if choice.wish in OFF:
        return f"no film: MUJOCO_GL={choice.wish} turns rendering off: unset it"
    found = f" (and MUJOCO_GL={choice.wish} cannot be used)" if note() else ""
    if choice.backend in OFF:
        platform = os.environ.get("PYOPENGL_PLATFORM")
        if platform:
            return f"no film: PYOPENGL_PLATFORM={platform} rules out what is installed{found}: unset it"
        return f"no film: neither libEGL with libGL nor libOSMesa is here{found}: {PACKAGES}"
    error = probe()
    if error is None:
        return None
    if choice.backend in LIBRARIES:
        return f"no film: {choice.backend} does not render{found} ({error}): {PACKAGES}"
    cure = "set MUJOCO_GL=egl before mujoco is imported" if sys.platform == "linux" else "unset MUJOCO_GL"
    return f"no film: MuJoCo cannot open a window to render in ({error}): {cure}"


def probe() -> str | None:
    """None when an empty model can be drawn, else how it failed."""
    import subprocess

    try:
        done = subprocess.run([sys.executable, "-c", PROBE], capture_output=True, text=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"a trial failed: {error}"
    if done.returncode == 0:
        return None
    return (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
