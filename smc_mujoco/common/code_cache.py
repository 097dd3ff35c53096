"""Machine code on disk: what one process compiled, the next ones load.

A file holds one compiled function. Its name is a hash of everything that the machine code depends on: the function's
code with all that it reaches, the sources of this package, the versions of numba, LLVM and Python, numba's settings,
and the processor. So two processes never write different things under one name, and nothing goes stale. Files are
written whole or not at all and end in a hash of their content: one that is damaged counts as missing.

Loaded code gets an LLVM engine of its own. numba numbers the symbols of a process from 1, so code from two processes
may hold different functions under one symbol.
"""

import contextlib
import hashlib
import os
import pickle
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import llvmlite
import numba
from numba.core import config
from numba.core.caching import CompileResultCacheImpl
from numba.core.codegen import JITCPUCodegen, RuntimeLinker
from numba.core.registry import cpu_target

from smc_mujoco.common import files, fingerprint
from smc_mujoco.common.errors import ScenarioError

ENDING = ".code"
MAX_FILES = 1000  # a folder's; one that is full loses its oldest half
HASH_BYTES = hashlib.sha256().digest_size


class Cache:
    """The file of one function, as numba's CFunc reads and writes its cache."""

    def __init__(self, body: Callable, signature: Any):
        """Find the function's place on disk.

        Raises:
          RuntimeError: there is no folder to write to.
          ScenarioError: the function reaches what cannot be told from other things.
        """
        given = config.CACHE_DIR and Path(config.CACHE_DIR) / "smc_mujoco"  # one folder for all copies of the package
        folder = given or Path(CompileResultCacheImpl(body).locator.get_cache_path())
        self.path = folder / f"{body.__name__}-{_key(body, signature)}{ENDING}"

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return what CFunc reads of a compile result, or None where no whole file is there."""
        try:
            held = self.path.read_bytes()
        except OSError:
            return None
        content, digest = held[:-HASH_BYTES], held[-HASH_BYTES:]
        if hashlib.sha256(content).digest() != digest:
            return None
        state, wrapper = pickle.loads(content)
        library = JITCPUCodegen("smc_mujoco").unserialize_library(state)
        return SimpleNamespace(library=library, fndesc=SimpleNamespace(llvm_cfunc_wrapper_name=wrapper))

    def save_overload(self, signature: Any, result: Any) -> None:
        """Write the file, unless its code holds for this process alone or the disk refuses it."""
        if result.reload_init or any(map(_bound_to_process, _libraries(result.library, set()))):
            return
        state = result.library.serialize_using_object_code()
        content = pickle.dumps((state, result.fndesc.llvm_cfunc_wrapper_name))
        with contextlib.suppress(OSError, ScenarioError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            _make_room(self.path.parent)
            with files.replacing(self.path) as path:
                path.write_bytes(content + hashlib.sha256(content).digest())


def _key(body: Callable, signature: Any) -> str:
    """Return the hash of what the machine code of a function depends on."""
    codegen = cpu_target.target_context.codegen()
    given = {name: value for name, value in os.environ.items() if name.startswith("NUMBA_")}
    settings = sorted((given | {"NUMBA_CACHE_DIR": ""}).items())
    parts = sys.version, numba.__version__, llvmlite.__version__, codegen.magic_tuple(), settings, signature
    # decorators and intrinsics change the code, but not the function's fingerprint
    told = [*map(str, parts), fingerprint.package("studies"), fingerprint.of(body)]
    return hashlib.sha256("\0".join(told).encode()).hexdigest()[:32]


def _libraries(library: Any, found: set) -> Iterator[Any]:
    """Yield the library and all that are linked into it."""
    if library not in found:
        found.add(library)
        yield library
        for linked in library._linking_libraries:
            yield from _libraries(linked, found)


def _bound_to_process(library: Any) -> bool:
    """Whether code holds addresses of this process, or symbols that numba resolves later."""
    names = (variable.name for variable in library._final_module.global_variables)
    return library.has_dynamic_globals or any(name.startswith(RuntimeLinker.PREFIX) for name in names)


def _make_room(folder: Path) -> None:
    """Remove the oldest half of a full folder; a file that another process removed first is no matter."""
    found = list(folder.glob(f"*{ENDING}"))
    if len(found) < MAX_FILES:
        return
    for path in sorted(found, key=lambda path: path.stat().st_mtime)[: MAX_FILES // 2]:
        path.unlink(missing_ok=True)
