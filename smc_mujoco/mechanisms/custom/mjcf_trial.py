"""A model compiled in a process of its own, which it may take down: read, compiled, and put into motion's first place.

It runs as a script and imports nothing but Python's own: MuJoCo is called through ctypes, so that all of it takes some
hundredths of a second. It tells how far it came by lines in a file. The last one is what was going on when the process
died, or "fine", or "error" and MuJoCo's words.
"""

import contextlib
import ctypes
import json
import os
import sys
from pathlib import Path
from typing import Any, TextIO

WORDS = 4000  # bytes of MuJoCo's complaint
VFS = 1024  # bytes, more than any version's mjVFS has
HANDLER = ctypes.CFUNCTYPE(None, ctypes.c_char_p)


def limit(memory: int) -> None:
    """Bound this process's memory, where the system has such bounds, and leave no core dumps."""
    try:
        import resource
    except ImportError:  # Windows
        return
    for kind, most in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CORE, 0)):
        with contextlib.suppress(OSError, ValueError):  # it is bounded more narrowly already
            resource.setrlimit(kind, (most, resource.getrlimit(kind)[1]))


class Trial:
    """MuJoCo in this process, and the file that is told how far it gets."""

    def __init__(self, order: dict[str, Any], told: TextIO):
        self.told = told
        self.say("loading")
        self.library = ctypes.CDLL(order["library"])
        for name in ("mj_parseXML", "mj_parseXMLString", "mj_compile", "mj_makeData"):
            getattr(self.library, name).restype = ctypes.c_void_p
        self.library.mjs_getError.restype = ctypes.c_char_p
        self.handlers = HANDLER(self.fail), HANDLER(self.warned)
        for name, handler in zip(("mju_user_error", "mju_user_warning"), self.handlers, strict=True):
            ctypes.c_void_p.in_dll(self.library, name).value = ctypes.cast(handler, ctypes.c_void_p).value
        for plugin in order["plugins"]:
            self.library.mj_loadPluginLibrary(plugin.encode())

    def say(self, line: str) -> None:
        """Write a line to the report file."""
        print(line, file=self.told, flush=True)

    def fail(self, words: bytes | None) -> None:
        """Report what is wrong, and end."""
        self.say("error " + " ".join((words or b"").decode(errors="replace").split()))
        os._exit(0)

    def warned(self, words: bytes) -> None:
        """End where MuJoCo warns that the file holds a NaN; its other warnings concern runs."""
        if b"NaN" in words and b"XML" in words:
            self.fail(b"it holds a NaN")

    def run(self, order: dict[str, Any]) -> None:
        """Read the model, compile it, make its data, and compute its first accelerations."""
        self.say("reading")
        said, files = ctypes.create_string_buffer(WORDS), None
        if order["path"]:
            spec = self.library.mj_parseXML(os.fsencode(order["path"]), None, said, WORDS)
        else:
            files = ctypes.create_string_buffer(VFS)
            self.library.mj_defaultVFS(files)
            for name, place in order["assets"].items():
                content = Path(place).read_bytes()
                self.library.mj_addBufferVFS(files, name.encode(), content, len(content))
            spec = self.library.mj_parseXMLString(Path(order["text"]).read_bytes(), files, said, WORDS)
        if not spec:
            self.fail(said.value)
        self.say("compiling")
        held = ctypes.c_void_p(spec)
        model = self.library.mj_compile(held, files)
        if not model:
            self.fail(self.library.mjs_getError(held))
        self.say("starting")
        data = self.library.mj_makeData(ctypes.c_void_p(model))
        if not data:
            self.fail(b"no memory for its data")
        self.library.mj_forward(ctypes.c_void_p(model), ctypes.c_void_p(data))
        self.say("fine")


def main(place: str) -> None:
    """Try the model that a JSON file describes: libraries, plugins, path or text with assets, memory, report file."""
    order = json.loads(Path(place).read_text())
    limit(order["memory"])
    with Path(order["told"]).open("w") as told:
        Trial(order, told).run(order)
        told.flush()
        os._exit(0)  # what it has built need not be torn down


if __name__ == "__main__":
    main(sys.argv[1])
