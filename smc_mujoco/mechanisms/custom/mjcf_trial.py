"""Reading and compiling a model, and its first accelerations, in the process of `common.guard`,
which it may crash.

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


def worker(job: Mapping[str, Any], report: Callable) -> None:
    """Try the model that a job describes: library, plugins, path or text with assets.

    `report` reports a stage.
    """

    def fail(message: bytes | None) -> None:
        report(FAULT, *(message or b"").decode(errors="replace").split())
        os._exit(0)

    def warned(message: bytes) -> None:  # MuJoCo's other warnings concern runs
        if b"NaN" in message and b"XML" in message:
            fail(b"it holds a NaN")

    report("loading")
    library = ctypes.CDLL(job["library"])
    for name in ("mj_parseXML", "mj_parseXMLString", "mj_compile", "mj_makeData"):
        getattr(library, name).restype = ctypes.c_void_p
    library.mjs_getError.restype = ctypes.c_char_p
    handlers = {"mju_user_error": HANDLER(fail), "mju_user_warning": HANDLER(warned)}
    for name, handler in handlers.items():
        ctypes.c_void_p.in_dll(library, name).value = ctypes.cast(handler, ctypes.c_void_p).value
    for plugin in job["plugins"]:
        library.mj_loadPluginLibrary(plugin.encode())
    report("reading")
    error = ctypes.create_string_buffer(MESSAGE_SIZE)
    files = None
    if job["path"]:
        spec = library.mj_parseXML(os.fsencode(job["path"]), None, error, MESSAGE_SIZE)
    else:
        files = ctypes.create_string_buffer(VFS_SIZE)
        library.mj_defaultVFS(files)
        for name, place in job["assets"].items():
            content = Path(place).read_bytes()
            library.mj_addBufferVFS(files, name.encode(), content, len(content))
        spec = library.mj_parseXMLString(Path(job["text"]).read_bytes(), files, error, MESSAGE_SIZE)
    if not spec:
        fail(error.value)
    report("compiling")
    pointer = ctypes.c_void_p(spec)
    model = library.mj_compile(pointer, files)
    if not model:
        fail(library.mjs_getError(pointer))
    report("starting")
    data = library.mj_makeData(ctypes.c_void_p(model))
    if not data:
        fail(b"no memory for its data")
    library.mj_forward(ctypes.c_void_p(model), ctypes.c_void_p(data))
