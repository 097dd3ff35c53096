"""Check that a window can be opened, before MuJoCo and its viewer are loaded: it ends the process if it cannot."""

import os
import sys

from smc_mujoco.common import gl

PROBE = """
import glfw
if not glfw.init():
    raise SystemExit("GLFW cannot use it")
glfw.window_hint(glfw.VISIBLE, False)
if not glfw.create_window(64, 64, "", None, None):
    raise SystemExit("it has no OpenGL")
"""


def missing() -> str | None:
    """Return None if the viewer can open, else why not and what to do. Opens a hidden window in another process."""
    if sys.platform == "darwin" and getattr(sys.modules.get("mujoco.viewer"), "_MJPYTHON", None) is None:
        return "no view: on macOS the viewer runs under MuJoCo's own interpreter: mjpython $(which smc-mujoco) view ..."
    cure = "run it where there is a screen, or film the scene with smc-mujoco run"
    named = [name for name in ("DISPLAY", "WAYLAND_DISPLAY") if os.environ.get(name)]
    if sys.platform == "linux" and not named:
        return f"no view: there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set): {cure}"
    if error := gl.probe("", PROBE):
        where = ", ".join(f"{name}={os.environ[name]}" for name in named) or "the screen"
        return f"no view: no window opens on {where} ({error}): {cure}"
    return None
