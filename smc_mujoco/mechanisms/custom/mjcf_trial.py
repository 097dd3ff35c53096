"""Reading and compiling a model, and its first accelerations, in the process of `common.guard`, which it may crash.

It calls MuJoCo through ctypes, so that it takes some hundredths of a second.
"""

import ctypes
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from smc_mujoco.common.guard import FAULT

MESSAGE_SIZE = 4000  # bytes of MuJoCo's error message, at most
VFS_SIZE = 1024  # bytes, more than any version's mjVFS has
HANDLER = ctypes.CFUNCTYPE(None, ctypes.c_char_p)


class Trial:
    """MuJoCo in this process. `say` reports a stage."""

    def __init__(self, order: Mapping[str, Any], say: Callable):
        self.say = say
        say("loading")
        self.library = ctypes.CDLL(order["library"])
        for name in ("mj_parseXML", "mj_parseXMLString", "mj_compile", "mj_makeData"):
            getattr(self.library, name).restype = ctypes.c_void_p
        self.library.mjs_getError.restype = ctypes.c_char_p
        self.handlers = HANDLER(self.fail), HANDLER(self.warned)
        for name, handler in zip(("mju_user_error", "mju_user_warning"), self.handlers, strict=True):
            ctypes.c_void_p.in_dll(self.library, name).value = ctypes.cast(handler, ctypes.c_void_p).value
        for plugin in order["plugins"]:
            self.library.mj_loadPluginLibrary(plugin.encode())

    def fail(self, message: bytes | None) -> None:
        """Report an error, and end the process."""
        self.say(FAULT, *(message or b"").decode(errors="replace").split())
        os._exit(0)

    def warned(self, message: bytes) -> None:
        """End the process if MuJoCo warns that the file holds a NaN; its other warnings concern runs."""
        if b"NaN" in message and b"XML" in message:
            self.fail(b"it holds a NaN")

    def run(self, order: Mapping[str, Any]) -> None:
        """Read the model, compile it, make its data, and compute its first accelerations."""
        self.say("reading")
        error, files = ctypes.create_string_buffer(MESSAGE_SIZE), None
        if order["path"]:
            spec = self.library.mj_parseXML(os.fsencode(order["path"]), None, error, MESSAGE_SIZE)
        else:
            files = ctypes.create_string_buffer(VFS_SIZE)
            self.library.mj_defaultVFS(files)
            for name, place in order["assets"].items():
                content = Path(place).read_bytes()
                self.library.mj_addBufferVFS(files, name.encode(), content, len(content))
            spec = self.library.mj_parseXMLString(Path(order["text"]).read_bytes(), files, error, MESSAGE_SIZE)
        if not spec:
            self.fail(error.value)
        self.say("compiling")
        pointer = ctypes.c_void_p(spec)
        model = self.library.mj_compile(pointer, files)
        if not model:
            self.fail(self.library.mjs_getError(pointer))
        self.say("starting")
        data = self.library.mj_makeData(ctypes.c_void_p(model))
        if not data:
            self.fail(b"no memory for its data")
        self.library.mj_forward(ctypes.c_void_p(model), ctypes.c_void_p(data))


def attempt(order: Mapping[str, Any], say: Callable) -> None:
    """Try the model that an order describes: library, plugins, path or text with assets."""
    Trial(order, say).run(order)
